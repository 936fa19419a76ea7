"""Files of poses: what they hold, by their own formats, as seconds and ``map_from_vehicle``."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ipm_rs._arguments import array_of, path_text
from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError
from ipm_rs.files.atomic import check_source, reading
from ipm_rs.trajectory import _tables, _text
from ipm_rs.trajectory._quaternions import Array

__all__ = ["FORMATS", "read"]

Read = Callable[[Path], tuple[Array | None, Array]]

_CAMERA_AXES = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""``vehicle_from_camera`` of a camera that looks ahead from the vehicle's origin."""

FORMATS: dict[str, Read] = {
    "tum": _text.tum,
    "kitti": _text.kitti,
    "csv": _text.csv,
    "oxts": _text.oxts,
    "nuscenes": _tables.nuscenes,
    "argoverse2": _tables.argoverse2,
}


def read(path: Any, format: Any, timestamps: Any, mount: Array | None) -> tuple[Array, Array]:
    """Return the seconds, (N,), and ``map_from_vehicle``, (N, 4, 4), of a file; see `Trajectory.load`."""
    place = Path(path_text("path", path))
    if format is None:
        with reading(place, "poses"):  # what the file system says of a name that no file can have
            format = _recognised(place)
    elif not isinstance(format, str) or format not in FORMATS:
        raise ArgumentError(f"format: expected one of {', '.join(FORMATS)}; choose one, or leave it out")
    if format != "kitti" and timestamps is not None:
        raise ArgumentError(f"timestamps: expected none for {format}, whose files have them; leave it out")
    with reading(place, "poses"):
        times, poses = FORMATS[format](place)
    if format == "kitti":
        vehicle_from_camera = _CAMERA_AXES if mount is None else mount
        poses = vehicle_from_camera @ poses @ np.linalg.inv(vehicle_from_camera)
        poses[:, 3] = (0, 0, 0, 1)
        times = _times_of(timestamps, place, len(poses))
    elif mount is not None:
        poses = poses @ np.linalg.inv(mount)
        poses[:, 3] = (0, 0, 0, 1)
    assert times is not None
    return _sorted_once(place, times, poses) if format == "nuscenes" else (times, poses)


def _recognised(path: Path) -> str:
    """Return the format of a path, by the names in a directory or the first lines of a file."""
    if path.is_dir():
        for name, found in (
            ("nuscenes", (path / "ego_pose.json").is_file()),
            ("argoverse2", (path / "city_SE3_egovehicle.feather").is_file()),
            ("oxts", any((inner / "timestamps.txt").is_file() for inner in (path, path / "oxts"))),
        ):
            if found:
                return name
        raise FileError(
            f"{path}: expected poses, got a directory without ego_pose.json, city_SE3_egovehicle.feather or "
            "oxts/timestamps.txt; pass the file itself"
        )
    check_source(path, "a file of poses")
    ending = path.suffix.lower()
    if ending in (".json", ".feather"):
        return "nuscenes" if ending == ".json" else "argoverse2"
    return _text.recognised(path)


def _times_of(timestamps: Any, poses: Path, count: int) -> Array:
    """Return KITTI's timestamps: given, of a given file, or of ``times.txt`` beside the poses."""
    if timestamps is None:
        beside = poses.with_name("times.txt")
        official = poses.parent.parent / "sequences" / poses.stem / "times.txt"  # poses/00.txt of the dataset
        timestamps = next((place for place in (beside, official) if place.is_file()), None)
        if timestamps is None:
            raise ArgumentError(
                f"timestamps: expected them for {poses}, whose format has none, found no times.txt beside it; pass "
                "timestamps=, seconds or a file (the dataset has 10 poses a second: 0.1 * np.arange(N))"
            )
    if isinstance(timestamps, (str, os.PathLike)):
        times = _text.column(Path(path_text("timestamps", timestamps)))
    else:
        times = array_of("timestamps", timestamps)
        if times.dtype.kind not in "iuf" or times.ndim != 1:
            raise ArgumentTypeError(f"timestamps: expected (N,) seconds, got {times.dtype} of shape {times.shape}")
    if len(times) != count:
        raise ArgumentError(f"timestamps: expected {count}, as many as poses in {poses}, got {len(times)}")
    return times.astype(np.float64)


def _sorted_once(path: Path, times: Array, poses: Array) -> tuple[Array, Array]:
    """Sort poses of a table by time; several of one moment, of different sensors, are one where they agree."""
    order = np.argsort(times, kind="stable")
    times, poses = times[order], poses[order]
    again = np.flatnonzero(np.diff(times) == 0)
    if len(again) and not np.allclose(poses[again], poses[again + 1], atol=1e-3):
        raise FileError(
            f"{path}: expected one pose at a moment, got two that differ at {times[again[0]]:.6f} s; pass the poses of "
            "one vehicle"
        )
    return np.delete(times, again + 1), np.delete(poses, again + 1, axis=0)
