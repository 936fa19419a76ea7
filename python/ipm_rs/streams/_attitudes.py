"""Tables that differ from frame to frame: how the camera or the vehicle was tilted at each, out of a csv file."""

from __future__ import annotations

import csv
import functools
import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import number_of, path_text
from ipm_rs._core import BevGrid, Camera, Lut, rotation_from_euler
from ipm_rs.calibration._rotations import OPTICAL_FROM_FLU, inverse
from ipm_rs.errors import ArgumentTypeError, FileError
from ipm_rs.files.atomic import check_source, reading
from ipm_rs.streams._frame import Frame

__all__ = ["per_frame"]

_KEYS = {"name": "name", "frame": "index", "index": "index", "timestamp": "time", "time": "time"}
_ANGLES = ("roll", "pitch", "yaw", "vehicle_roll", "vehicle_pitch")
_PLACES = ("x", "y", "z", "vehicle_z")
_COLUMNS = {name: (name, 1.0) for name in (*_ANGLES, *_PLACES)} | {
    f"{name}_deg": (name, math.pi / 180) for name in _ANGLES
}
_WANTED = (
    "a column name, frame or timestamp, then some of roll, pitch, yaw, x, y, z, vehicle_roll, vehicle_pitch, vehicle_z"
)
_KEPT = 16
"""Tables of frames that had the same numbers: jobs that are under way ask for the same ones."""

Row = tuple[float, ...]


def per_frame(
    camera: Camera,
    grid: BevGrid,
    path: str | os.PathLike[str],
    *,
    ground: Any = 0.0,
    max_gap: float = 1.0,
) -> Callable[[Frame], Lut]:
    """Return what makes the table of each frame, for `warp`: a csv file says how the camera stood at it.

    The first line names the columns. One says which frame a line is for: ``name`` (of its file, without the ending),
    ``frame`` (its number in the stream, from 0), or ``timestamp`` (seconds of the stream; frames between two lines get
    what lies between). The others are numbers:

    * ``roll pitch yaw`` (radians; ``roll_deg`` ... in degrees) and ``x y z`` (metres) of the camera on the vehicle,
      positive pitch looking down: they take the place of the calibration's, and what is not there stays;
    * ``vehicle_roll vehicle_pitch vehicle_z``: how the vehicle leans and nods against the road, positive pitch with its
      nose down, and how far it is lifted: on top of the calibration.

    Parameters
    ----------
    camera : Camera
        The calibration.
    grid : BevGrid
        The cells.
    path : path
        The csv file.
    ground : float, Plane or HeightMap
        The road, see `Lut`.
    max_gap : float
        Seconds that two lines may be apart for a frame between them.

    Returns
    -------
    callable
        Takes a `Frame`, gives its `Lut`, and raises FileError where the file has nothing for it.

    Raises
    ------
    MissingFileError, FileError
        There is no such file, or its content cannot be right; the message names the line.
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    """
    if not isinstance(camera, Camera):
        raise ArgumentTypeError(f"camera: expected a Camera, got {type(camera).__name__}; Camera.load reads one")
    if not isinstance(grid, BevGrid):
        raise ArgumentTypeError(f"grid: expected a BevGrid, got {type(grid).__name__}; make one")
    place, gap = Path(path_text("path", path)), number_of("max_gap", max_gap)
    key, columns, rows = _read(place)

    @functools.lru_cache(_KEPT)
    def table(numbers: Row) -> Lut:
        return Lut(_posed(camera, dict(zip(columns, numbers, strict=True))), grid, ground=ground)

    if key == "time":
        times = np.array([moment for moment, _ in rows])
        values = np.array([numbers for _, numbers in rows]).reshape(len(rows), -1)
        return lambda frame: table(_between(place, frame, times, values, gap))
    known = dict(rows)
    if len(known) != len(rows):
        raise FileError(f"{place}: expected one line for each frame, got {len(rows) - len(known)} again; keep one")

    def found(frame: Frame) -> Lut:
        numbers = known.get(frame.name if key == "name" else frame.index)
        if numbers is None:
            which = frame.name if key == "name" else frame.index
            raise FileError(f"{place}: expected a line for frame {which}, got none; add it, or leave the frame out")
        return table(numbers)

    return found


def _read(path: Path) -> tuple[str, list[str], list[tuple[Any, Row]]]:
    """Return what says which frame a line is for, the names of its numbers, and the lines."""
    check_source(path, "a csv file of poses")
    with reading(path, "a csv file of poses"), path.open(encoding="utf-8-sig", newline="") as file:
        lines = [(line, words) for line, words in enumerate(csv.reader(file), 1) if any(word.strip() for word in words)]
    names = [word.strip().lower().lstrip("# ") for word in lines[0][1]] if lines else []
    keys = [index for index, name in enumerate(names) if name in _KEYS]
    unknown = [name for index, name in enumerate(names) if index not in keys and name not in _COLUMNS]
    columns = [_COLUMNS[name][0] for name in names if name in _COLUMNS]
    if len(keys) != 1 or unknown or not columns or len(set(columns)) != len(columns):
        raise FileError(f"{path}: expected {_WANTED}, got {', '.join(names)!r:.120}; correct its first line")
    key = _KEYS[names[keys[0]]]
    factors = [_COLUMNS[name][1] for name in names if name in _COLUMNS]
    rows: list[tuple[Any, Row]] = []
    for line, words in lines[1:]:
        try:
            if len(words) != len(names):
                raise ValueError
            word = words[keys[0]].strip()
            which = word if key == "name" else int(word) if key == "index" else float(word)
            numbers = [float(word) for index, word in enumerate(words) if index not in keys]
            if not all(map(math.isfinite, [*numbers, 0 if isinstance(which, str) else which])):
                raise ValueError
        except ValueError as error:
            text = ",".join(words)
            raise FileError(
                f"{path}: line {line}: expected {len(names)} values, got {text!r:.80}; correct it"
            ) from error
        if key == "time" and rows and which <= rows[-1][0]:
            raise FileError(f"{path}: line {line}: expected timestamps that grow, got {which} after {rows[-1][0]}")
        rows.append((which, tuple(number * factor for number, factor in zip(numbers, factors, strict=True))))
    if not rows:
        raise FileError(f"{path}: expected a line for each frame, got none; it may be cut short")
    return key, columns, rows


def _between(path: Path, frame: Frame, times: NDArray[Any], values: NDArray[Any], max_gap: float) -> Row:
    """Return the numbers at a frame's timestamp: of its line, or between two lines."""
    moment = frame.timestamp
    if moment is None:
        raise FileError(f"{path}: expected frames with timestamps, got frame {frame.name} without; name frames instead")
    after = int(np.searchsorted(times, moment))
    if after < len(times) and times[after] == moment:
        return tuple(values[after].tolist())
    if not 0 < after < len(times) or times[after] - times[after - 1] > max_gap:
        raise FileError(
            f"{path}: expected lines around {moment:.6f} s at most {max_gap:g} s apart, for frame {frame.name}, got "
            f"{times[0]:.6f} to {times[-1]:.6f} s, with a gap there or none so far; add it, or leave the frame out"
        )
    share = (moment - times[after - 1]) / (times[after] - times[after - 1])
    return tuple(((1 - share) * values[after - 1] + share * values[after]).tolist())


def _posed(camera: Camera, numbers: dict[str, float]) -> Camera:
    """Return the camera as a line says that it stood over the road."""
    pose = camera.vehicle_from_camera.copy()
    if any(angle in numbers for angle in ("roll", "pitch", "yaw")):
        angles = dict(zip(("roll", "pitch", "yaw"), _angles(pose[:3, :3] @ OPTICAL_FROM_FLU), strict=True))
        pose[:3, :3] = rotation_from_euler(**(angles | _some(numbers, angles))) @ OPTICAL_FROM_FLU.T
    for index, axis in enumerate("xyz"):
        pose[index, 3] = numbers.get(axis, pose[index, 3])
    road_from_vehicle = np.eye(4)
    road_from_vehicle[:3, :3] = rotation_from_euler(
        numbers.get("vehicle_roll", 0.0), numbers.get("vehicle_pitch", 0.0), 0.0
    )
    road_from_vehicle[2, 3] = numbers.get("vehicle_z", 0.0)
    return camera.with_pose(inverse(road_from_vehicle @ pose))


def _some(numbers: dict[str, float], names: Sequence[str] | dict[str, float]) -> dict[str, float]:
    return {name: numbers[name] for name in names if name in numbers}


def _angles(R: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a rotation ``Rz(yaw) Ry(pitch) Rx(roll)``."""
    pitch = math.asin(max(-1.0, min(1.0, -R[2, 0])))
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])
