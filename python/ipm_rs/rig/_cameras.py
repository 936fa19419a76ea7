"""`Rig`: the cameras of a vehicle by their names."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of, names_of
from ipm_rs._core import Camera
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = ["Rig", "check_names"]


class Rig(Mapping[str, Camera]):
    """The cameras of a vehicle by their names, all posed in one vehicle frame. Immutable, comparable, picklable.

    It is an ordered mapping: ``rig["front"]``, ``list(rig)``, ``len(rig)``, ``rig.items()``.

    Parameters
    ----------
    cameras : mapping of str to Camera
        At least one; the order is kept.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        There is no camera, or something else in its place.
    """

    __slots__ = ("_cameras",)

    def __init__(self, cameras: Mapping[str, Camera]) -> None:
        if not isinstance(cameras, Mapping):
            raise ArgumentTypeError(
                f"cameras: expected a mapping of names to cameras, got {type(cameras).__name__}; "
                'write Rig({"front": camera, ...})'
            )
        for name, camera in cameras.items():
            if not isinstance(name, str):
                raise ArgumentTypeError(f"cameras: expected names that are text, got {name!r:.60}; use str(...)")
            if not name.isprintable():  # no file and no message can hold it
                raise ArgumentError(f"cameras: expected names that can be printed, got {name!a:.60}")
            if not isinstance(camera, Camera):
                raise ArgumentTypeError(
                    f"cameras[{name!r}]: expected an ipm_rs.Camera, got {type(camera).__name__}; Camera.load reads one"
                )
        if not cameras:
            raise ArgumentError("cameras: expected at least one, got none; pass a mapping of names to cameras")
        self._cameras = dict(cameras)

    @property
    def cameras(self) -> dict[str, Camera]:
        """The cameras by their names, as a new dict."""
        return dict(self._cameras)

    def __getitem__(self, name: str) -> Camera:
        if name not in self._cameras:
            raise KeyError(f"{name!r} is none of {', '.join(map(repr, self._cameras))}")
        return self._cameras[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._cameras)

    def __len__(self) -> int:
        return len(self._cameras)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Rig):
            return NotImplemented
        return list(self._cameras.items()) == list(other._cameras.items())

    def __hash__(self) -> int:
        return hash(tuple(self._cameras.items()))

    def __reduce__(self) -> tuple[Any, ...]:
        return Rig, (dict(self._cameras),)

    def __repr__(self) -> str:
        return f"Rig({', '.join(f'{name}: {w}x{h}' for name, (w, h) in self._sizes())})"

    def _repr_html_(self) -> str:
        from ipm_rs._notebook import html_of

        return html_of(lambda: "\n".join(["Rig", *(f"  {name}: {camera!r}" for name, camera in self._cameras.items())]))

    def _sizes(self) -> Iterator[tuple[str, tuple[int, int]]]:
        return ((name, camera.image_size) for name, camera in self._cameras.items())

    def subset(self, names: Iterable[str]) -> Rig:
        """Return the rig of some of its cameras, in the order of `names`.

        Raises
        ------
        ArgumentError
            A name is none of the rig's, or there is none.
        """
        wanted = names_of("names", names)
        check_names(self, "names", wanted)
        return Rig({name: self._cameras[name] for name in wanted})

    def moved(self, map_from_vehicle: ArrayLike) -> Rig:
        """Return the rig in another frame: its cameras' vehicle frame becomes that of a map.

        Parameters
        ----------
        map_from_vehicle : (4, 4) array_like
            Where the vehicle stands, a rigid transform, metres.

        Raises
        ------
        CalibrationError
            It is not rigid.
        """
        pose = array_of("map_from_vehicle", map_from_vehicle)
        if pose.shape != (4, 4) or pose.dtype.kind not in "iuf":
            raise CalibrationError(
                f"map_from_vehicle: expected a rigid 4x4 transform, got {pose.dtype} of shape {pose.shape}"
            )
        with np.errstate(all="ignore"):  # what overflows is for the camera to refuse
            moved = {name: pose.astype(float) @ camera.vehicle_from_camera for name, camera in self._cameras.items()}
        return Rig({name: _posed(camera, moved[name]) for name, camera in self._cameras.items()})

    def to_json(self) -> str:
        """Return the rig as JSON text, each float to the last bit."""
        import json  # with what it needs, only here

        from ipm_rs.calibration._load import RIG_FORMAT, RIG_VERSION

        cameras = {name: json.loads(camera.to_json()) for name, camera in self._cameras.items()}
        return json.dumps({"format": RIG_FORMAT, "version": RIG_VERSION, "cameras": cameras}, indent=2) + "\n"

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the rig as a JSON file, whole or not at all; `load` gives an equal rig.

        Raises
        ------
        FileError
            The file cannot be written.
        ArgumentTypeError
            `path` is no path.
        """
        from ipm_rs.files.atomic import as_path, atomically

        text = self.to_json()
        with atomically(as_path(path)) as file:
            file.write(text.encode())

    @staticmethod
    def load(path: str | os.PathLike[str], **options: Any) -> Rig:
        """Read a rig: what `save` wrote, or every camera of a calibration file or directory.

        Parameters
        ----------
        path : str or path
            As `Camera.load_all` takes it.
        **options
            Those of `Camera.load_all`, for other files than our own.

        Raises
        ------
        MissingFileError, FileError, CalibrationError, ArgumentError
            As `Camera.load_all`.
        """
        from ipm_rs.calibration._load import load_all

        return Rig(load_all(path, **options))


def check_names(rig: Rig, what: str, names: Iterable[str]) -> None:
    """Refuse names that are none of a rig's cameras'; `what` is the argument that they come from.

    Raises
    ------
    ArgumentError
        Such a name is there.
    """
    unknown = [name for name in names if name not in rig]
    if unknown:
        raise ArgumentError(f"{what}: expected names of {rig!r}, got {unknown[0]!r}; pass one of {list(rig)}")


def _posed(camera: Camera, vehicle_from_camera: NDArray[np.float64]) -> Camera:
    posed = Camera(
        camera.intrinsics, image_size=camera.image_size, vehicle_from_camera=vehicle_from_camera, lens=camera.lens
    )
    return posed if camera.mask is None else posed.masked(camera.mask)
