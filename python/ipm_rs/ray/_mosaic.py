"""A map of the road on many machines: stretches of the drive, each a map of its own, which add up."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

from numpy.typing import ArrayLike

from ipm_rs._arguments import flag_of
from ipm_rs._core import Camera, HeightMap, Plane
from ipm_rs.errors import ArgumentTypeError, FileError, ImageError, IpmError
from ipm_rs.mosaic import Mosaic
from ipm_rs.mosaic._checks import each_of
from ipm_rs.ray._batches import image_of
from ipm_rs.ray._cluster import connected, whole
from ipm_rs.rig import Rig

__all__ = ["mosaic"]

Frame = tuple[Camera | Rig | Mapping[str, Camera], Any, ArrayLike] | tuple[Any, Any, Any, str]
Named = tuple[str, tuple[Any, Any, Any]]

_AT_ONCE = 2
"""Stretches for each CPU that are under way: one is worked on, and one waits."""


def mosaic(
    frames: Iterable[Frame],
    into: Mosaic,
    *,
    ground: float | Plane | HeightMap | Literal["wheels"] = 0.0,
    distance: Sequence[float] | None = None,
    stretch: int = 50,
    strict: bool = True,
    address: str | None = None,
    report: Callable[[int, list[IpmError]], None] | None = None,
) -> int:
    """Add the frames of a drive to a map on a cluster: to the same last bit as one process, in any order of frames.

    Each task adds a stretch of consecutive frames to a map of its own, which is then merged. A worker that dies is
    replaced and its stretch done again; it is merged once. Into a map with a `path` the same call may be made again
    after a stop: frames that it holds already are left out.

    Parameters
    ----------
    frames : iterable of (camera, image, map_from_vehicle)
        As `Mosaic.add` takes them; instead of an image the path or URI of its file, which the worker reads, of a rig a
        mapping of them, or a function that returns either. A fourth item is the frame's name in the map; else that is
        its path, else its number.
    into : Mosaic
        The map.
    ground, distance
        As for `Mosaic.add`.
    stretch : int
        Frames for each task. A stretch sends its tiles: 10 MB for each 25 m square at 5 cm.
    strict : bool
        Stop at the first frame whose image cannot be read; otherwise it is left out and `report` is told of it.
    address : str, optional
        Of the cluster; by default that of this process or of ``RAY_ADDRESS``, or one of this machine's CPUs.
    report : callable, optional
        Called when a stretch is merged with the number of its frames and the errors of those that could not be read.

    Returns
    -------
    int
        How many frames were added.

    Raises
    ------
    ImageError, FileError, CalibrationError, ArgumentError, ArgumentTypeError, MosaicError
        As `Mosaic.add`, of the first frame that is wrong; stretches that were merged before stay.
    MissingExtraError
        Ray is not installed.
    """
    if not isinstance(into, Mosaic):
        raise ArgumentTypeError(f"into: expected an ipm_rs.Mosaic, got {type(into).__name__}; make one")
    size, strict = whole("stretch", stretch, 1, 100_000), flag_of("strict", strict)
    kept = ("resolution", "tile", "channels", "dtype", "samples", "labels")
    settings = {name: getattr(into, name) for name in kept}
    options = {"ground": ground, "distance": distance}
    before = into.frames
    with connected(address) as ray:
        add = ray.remote(_added)
        shared = ray.put((settings, options, strict))
        most = max(2, int(_AT_ONCE * float(ray.cluster_resources().get("CPU", 1))))
        pending: list[Any] = []
        for part in _stretches(frames, into, size):
            pending.append(add.remote(part, shared))
            while len(pending) >= most:
                pending = _merged(ray, pending, into, report)
        while pending:
            pending = _merged(ray, pending, into, report)
    return into.frames - before


def _merged(ray: Any, pending: list[Any], into: Mosaic, report: Any) -> list[Any]:
    """Merge the first that is ready, and return the others."""
    ready, others = ray.wait(pending, num_returns=1)
    found = ray.get(ready[0])
    if isinstance(found, Exception):
        raise found
    made, failed = found
    into.merge(made)
    if report is not None:
        report(made.frames, failed)
    return list(others)


def _stretches(frames: Iterable[Frame], into: Mosaic, size: int) -> Iterator[list[Named]]:
    part: list[Named] = []
    for number, frame in enumerate(each_of("frames", frames)):
        if not isinstance(frame, (tuple, list)) or len(frame) not in (3, 4):
            raise ArgumentTypeError(
                f"frames: expected (camera, image, map_from_vehicle), or a name with them, got {type(frame).__name__}"
            )
        image = frame[1]
        if len(frame) == 4:
            name = frame[3]
            if not isinstance(name, str):
                raise ArgumentTypeError(f"frames: expected text as a frame's name, got {type(name).__name__}")
        else:
            name = os.fspath(image) if isinstance(image, (str, os.PathLike)) else f"{number:08d}"
        if name in into:
            continue
        part.append((str(name), (frame[0], image, frame[2])))
        if len(part) == size:
            yield part
            part = []
    if part:
        yield part


def _added(part: list[Named], shared: Any) -> Any:
    """Return the map of a stretch and the errors of frames that are left out, or what was wrong with it.

    Of an exception that is raised Ray would hand on a traceback.
    """
    settings, options, strict = shared
    made, failed = Mosaic(**settings), list[IpmError]()
    try:
        for name, (camera, image, pose) in part:
            try:
                picture = _read(image)
            except (FileError, ImageError) as error:
                if strict:
                    raise
                failed.append(error)
                continue
            made.add(camera, picture, map_from_vehicle=pose, name=name, threads=1, **options)
    except Exception as error:
        return error
    return made, failed


def _read(image: Any) -> Any:
    if callable(image):
        return _read(image())
    if isinstance(image, Mapping):
        return {name: None if one is None else _read(one) for name, one in image.items()}
    if isinstance(image, os.PathLike):
        image = os.fspath(image)
    return image_of(image)[0] if isinstance(image, str) else image
