"""What the layouts of datasets share: pictures on the disk, each with a moment, a calibration and a pose."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Camera
from ipm_rs.calibration._values import describe, listed
from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError
from ipm_rs.files import images
from ipm_rs.streams._frame import Frame, Stream, Ticket
from ipm_rs.trajectory import Trajectory

__all__ = ["Shot", "chosen_name", "pictures_in", "poses_at", "stream_of"]

Pose = NDArray[np.float64]
_ENDINGS = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True, eq=False)
class Shot:
    """One picture of a dataset; its timestamp is in seconds."""

    path: Path
    timestamp: float | None
    camera: Camera | None
    pose: Pose | None


def stream_of(path: str, shots: Sequence[Shot], ground: float | None = None) -> Stream:
    """Return the stream of pictures in order, of a vehicle frame in which the road is at `ground`.

    Raises
    ------
    FileError
        There are none, or their timestamps do not grow.
    """
    if not shots:
        raise FileError(f"{path}: expected pictures, got none; fetch it again, or choose another camera")
    times = [shot.timestamp for shot in shots if shot.timestamp is not None]
    back = np.flatnonzero(np.diff(times) <= 0)
    if len(back):
        first, second = shots[int(back[0])], shots[int(back[0]) + 1]
        raise FileError(
            f"{path}: expected timestamps that grow, got {second.timestamp:.6f} of {second.path.name} after "
            f"{first.timestamp:.6f} of {first.path.name}; fetch it again"
        )
    camera = shots[0].camera if all(shot.camera == shots[0].camera for shot in shots) else None
    return Stream(
        path,
        functools.partial(_tickets, shots),
        count=len(shots),
        rate=(len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else None,
        size=camera.image_size if camera else None,
        camera=camera,
        origin=times[0] if times else 0.0,
        ground=ground,
    )


def _tickets(shots: Sequence[Shot]) -> Iterator[Ticket]:
    for index, shot in enumerate(shots):
        load = functools.partial(_load, shot, index)
        yield Ticket(shot.path.stem, index, shot.timestamp, load, shot.path)


def _load(shot: Shot, index: int) -> Frame:
    pixels, _ = images.read(shot.path)
    return Frame(pixels, shot.path.stem, index, shot.timestamp, shot.camera, shot.pose)


def poses_at(trajectory: Trajectory, times: Sequence[float]) -> list[Pose | None]:
    """Return the pose at each moment, None where the trajectory does not reach."""
    covered = trajectory.covers(list(times))
    found = iter(trajectory.at(np.asarray(times, np.float64)[covered]))
    return [next(found) if inside else None for inside in covered]


def pictures_in(folder: Path) -> list[Path]:
    """Return the images of a directory by their names; none where there is no such directory."""
    found = folder.iterdir() if folder.is_dir() else iter(())
    return sorted(path for path in found if path.suffix.lower() in _ENDINGS and path.name[0] != ".")


def chosen_name(argument: str, value: Any, names: Iterable[str], path: str) -> str:
    """Return what is wanted of some names, or the only one there is.

    Raises
    ------
    ArgumentError, ArgumentTypeError, FileError
        There is no such one; or several, and none is given.
    """
    names = list(names)
    if not names:
        raise FileError(f"{path}: expected a {argument}, found none in it; fetch it again")
    if value is None and len(names) == 1:
        return names[0]
    if value is not None and not isinstance(value, str):
        raise ArgumentTypeError(f"{argument}: expected a name, got {describe(value)}; pass one of {listed(names)}")
    if value not in names:
        raise ArgumentError(f"{path}: {argument}: expected one of {listed(names)}, got {value!r:.60}; pass one")
    return str(value)
