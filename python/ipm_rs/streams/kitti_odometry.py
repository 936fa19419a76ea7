"""A sequence of KITTI odometry: ``sequences/00`` with ``image_0`` to ``image_3``, ``calib.txt`` and ``times.txt``.

Poses are in ``poses/00.txt`` of the dataset, or ``poses.txt`` in the sequence: one for each picture, of the rectified
left grey camera. They become those of the vehicle; the map is the frame in which it stood at the first picture. The
sequences 11 to 21 have none. Timestamps are the seconds of ``times.txt``, None without it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ipm_rs.calibration import kitti
from ipm_rs.calibration.kitti import camera_number
from ipm_rs.errors import FileError
from ipm_rs.files import images
from ipm_rs.streams._dataset import Shot, pictures_in, stream_of
from ipm_rs.streams._frame import Stream
from ipm_rs.trajectory import Trajectory
from ipm_rs.trajectory._text import column

__all__ = ["TITLE", "read", "recognises"]

TITLE = "a sequence of KITTI odometry"


def recognises(path: str) -> bool:
    """Say whether a path is the directory of a sequence."""
    place = Path(path)
    return (place / "calib.txt").is_file() and any((place / f"image_{k}").is_dir() for k in range(4))


def read(path: str, camera: Any = None, frame: Any = None) -> Stream:
    """Open a sequence.

    Parameters
    ----------
    path : str
        Its directory.
    camera : int or str, optional
        0 to 3; by default 2, the left colour camera, or the first there is.
    frame : {"velodyne", "camera"}, optional
        The vehicle frame, see `Camera.from_kitti`; by default "velodyne" where ``calib.txt`` has ``Tr``, else "camera".

    Raises
    ------
    MissingFileError, FileError, CalibrationError
        A file is missing, damaged or cannot be right; there are more or fewer poses than pictures.
    ArgumentError, ArgumentTypeError
        There is no such camera or frame.
    """
    place = Path(path)
    there = [k for k in range(4) if (place / f"image_{k}").is_dir()]
    if camera is None:
        camera = 2 if 2 in there else there[0] if there else 2
    number = camera_number(camera, (0, 1, 2, 3))
    pictures = pictures_in(place / f"image_{number}")
    if not pictures:
        raise FileError(f"{place / f'image_{number}'}: expected pictures, found none; the cameras there are {there}")
    file = place / "calib.txt"
    if frame is None:
        has_way = any(line.startswith("Tr") for line in file.read_text("utf-8", "replace").splitlines())
        frame = "velodyne" if has_way else "camera"
    size = images.probe(pictures[0]).size
    calibration = kitti.read(file, camera=number, frame=frame, image_size=size)
    times = column(place / "times.txt") if (place / "times.txt").is_file() else None
    if times is not None and len(times) != len(pictures):
        raise FileError(f"{place}: expected a line of times.txt for each of {len(pictures)} pictures, got {len(times)}")
    poses: Any = [None] * len(pictures)
    known = (place / "poses.txt", place.resolve().parent.parent / "poses" / f"{place.resolve().name}.txt")
    found = next((each for each in known if each.is_file()), None)
    if found is not None:
        first = kitti.read(file, camera=0, frame=frame, image_size=size).vehicle_from_camera
        seconds = np.arange(float(len(pictures)))  # each pose is of the picture of its number
        poses = Trajectory.load(found, format="kitti", timestamps=seconds, vehicle_from_sensor=first).poses
    moments = [None] * len(pictures) if times is None else times.tolist()
    shots = [Shot(each, time, calibration, pose) for each, time, pose in zip(pictures, moments, poses, strict=True)]
    return stream_of(path, shots, kitti.GROUND[frame])
