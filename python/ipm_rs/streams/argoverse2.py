"""A log of Argoverse 2: ``sensors/cameras/<name>/<nanoseconds>.jpg``, ``calibration`` and the vehicle's poses.

Poses are those of ``city_SE3_egovehicle.feather``, interpolated to each picture's timestamp, seconds since 1970. The
road is not at z = 0: ``ground=-0.33``. Needs the extra ``arrow``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ipm_rs.calibration import argoverse2
from ipm_rs.errors import FileError
from ipm_rs.streams._dataset import Shot, chosen_name, pictures_in, poses_at, stream_of
from ipm_rs.streams._frame import Stream
from ipm_rs.trajectory import Trajectory

__all__ = ["TITLE", "read", "recognises"]

TITLE = "a log of Argoverse 2"


def recognises(path: str) -> bool:
    """Say whether a path is the directory of a log."""
    return (Path(path) / "sensors" / "cameras").is_dir()


def read(path: str, camera: Any = "ring_front_center", max_gap: float = 1.0) -> Stream:
    """Open a log.

    Parameters
    ----------
    path : str
        Its directory.
    camera : str
        The name of the camera.
    max_gap : float
        Seconds that two poses may be apart for one between them.

    Raises
    ------
    MissingFileError, FileError, CalibrationError
        A file is missing, damaged or cannot be right.
    ArgumentError, ArgumentTypeError
        There is no such camera.
    MissingExtraError
        pyarrow is not installed.
    """
    folder = Path(path) / "sensors" / "cameras"
    names = sorted(entry.name for entry in folder.iterdir() if entry.is_dir()) if folder.is_dir() else []
    name = chosen_name("camera", camera, names, path)
    calibration = argoverse2.read(path, camera=name)
    pictures = pictures_in(folder / name)
    wrong = next((each for each in pictures if not each.stem.isdecimal()), None)
    if wrong is not None:
        raise FileError(f"{wrong}: expected a name of nanoseconds, got another; remove it")
    pictures.sort(key=lambda each: int(each.stem))
    times = [int(each.stem) * 1e-9 for each in pictures]
    poses: list[Any] = [None] * len(times)
    file = Path(path) / "city_SE3_egovehicle.feather"
    if file.is_file() and times:
        poses = poses_at(Trajectory.load(file, max_gap=max_gap), times)
    shots = [Shot(*each[:2], calibration, each[2]) for each in zip(pictures, times, poses, strict=True)]
    return stream_of(path, shots, argoverse2.GROUND)
