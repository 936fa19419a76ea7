"""A drive of KITTI raw: ``2011_09_26/2011_09_26_drive_0001_sync``, with the day's calibration beside it.

``image_00`` to ``image_03`` hold ``data/*.png`` and ``timestamps.txt``, ``oxts`` the poses. Pictures of ``_sync``
drives are rectified, those of ``_extract`` are not. Timestamps are seconds since 1970, the files' time taken as UTC. A
frame's pose is interpolated between the packets of the GPS/IMU unit at its own timestamp, and None before the first and
after the last; the map is east, north, up from the first.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ipm_rs._core import Camera
from ipm_rs.calibration import kitti_raw
from ipm_rs.calibration.kitti import GROUND, camera_number
from ipm_rs.errors import FileError, MissingFileError
from ipm_rs.streams._dataset import Shot, pictures_in, poses_at, stream_of
from ipm_rs.streams._frame import Stream
from ipm_rs.trajectory import Trajectory
from ipm_rs.trajectory._text import lines_of, moment

__all__ = ["TITLE", "read", "recognises"]

TITLE = "a drive of KITTI raw"


def recognises(path: str) -> bool:
    """Say whether a path is the directory of a drive."""
    return any((Path(path) / f"image_0{k}" / "timestamps.txt").is_file() for k in range(4))


def read(path: str, camera: Any = 2, frame: Any = "velodyne", max_gap: float = 1.0) -> Stream:
    """Open a drive.

    Parameters
    ----------
    path : str
        Its directory; the calibration is in the directory above, or in this one.
    camera : int or str
        0 to 3; 2 is the left colour camera.
    frame : {"velodyne", "imu", "camera"}
        The vehicle frame, see `Camera.from_kitti_raw`.
    max_gap : float
        Seconds that two packets may be apart for a pose between them.

    Raises
    ------
    MissingFileError, FileError, CalibrationError
        A file is missing, damaged or cannot be right.
    ArgumentError, ArgumentTypeError
        There is no such camera or frame.
    """
    number = camera_number(camera, (0, 1, 2, 3))
    drive = Path(path)
    folder = drive / f"image_0{number}"
    stamps = folder / "timestamps.txt"
    times = [moment(stamps, line, text) for line, text in lines_of(stamps)]
    pictures = pictures_in(folder / "data")
    if len(pictures) != len(times):
        # drives with a hole have a timestamp for each number, and lack some of the pictures
        kept = [
            (path, times[int(path.stem)]) for path in pictures if path.stem.isdecimal() and int(path.stem) < len(times)
        ]
        if len(kept) != len(pictures):
            raise FileError(f"{folder}: expected a timestamp for each of {len(pictures)} pictures, got {len(times)}")
        times = [time for _, time in kept]
    calibration = _calibration(drive, number, frame)
    poses: list[Any] = [None] * len(times)
    if calibration is not None and (drive / "oxts" / "timestamps.txt").is_file() and times:
        of_imu = _calibration(drive, number, "imu")
        assert of_imu is not None
        mount = calibration.vehicle_from_camera @ of_imu.camera_from_vehicle
        poses = poses_at(Trajectory.load(drive, vehicle_from_sensor=_rigid(mount), max_gap=max_gap), times)
    shots = [Shot(*each[:2], calibration, each[2]) for each in zip(pictures, times, poses, strict=True)]
    return stream_of(path, shots, None if calibration is None else GROUND[frame])


def _calibration(drive: Path, number: int, frame: Any) -> Camera | None:
    for place in (drive.resolve().parent, drive):
        if (place / "calib_cam_to_cam.txt").is_file():
            rectified = not drive.resolve().name.endswith("_extract")
            try:
                return kitti_raw.read(place, camera=number, frame=frame, rectified=rectified)
            except MissingFileError:
                if frame != "imu":
                    raise
    return None


def _rigid(T: Any) -> Any:
    """Return a product of printed transforms with the last row that a rigid one has, to the bit."""
    T = np.array(T)
    T[3] = (0, 0, 0, 1)
    return T
