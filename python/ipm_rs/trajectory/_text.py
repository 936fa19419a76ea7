"""Poses in lines of text: TUM, KITTI odometry, csv (EuRoC's ground truth too), and the OXTS packets of KITTI raw."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ipm_rs._core import rotation_from_euler
from ipm_rs.errors import FileError
from ipm_rs.files.atomic import check_source, reading
from ipm_rs.trajectory._quaternions import Array, to_matrices

__all__ = ["assembled", "column", "csv", "kitti", "moment", "oxts", "recognised", "rows_of", "tum"]

_MAX_BYTES = 1 << 30
_NORM_TOLERANCE = 1e-2  # of |q|: three printed digits
_EARTH_RADIUS = 6378137.0
_NAMES = {
    "t": "timestamp|time|t|stamp|timestamp_s|time_s|timestamp [s]",
    "t_ms": "timestamp_ms|time_ms|timestamp [ms]",
    "t_us": "timestamp_us|time_us|timestamp [us]",
    "t_ns": "timestamp_ns|time_ns|timestamp [ns]",
    **{axis: "@|t@|p@|@_m|t@_m|@ [m]|p_rs_r_@|p_rs_r_@ [m]|position_@|position.@".replace("@", axis) for axis in "xyz"},
    **{
        f"q{axis}": f"q{axis}|q_{axis}|q_rs_{axis}|q_rs_{axis} []|orientation_{axis}|orientation.{axis}"
        for axis in "wxyz"
    },
    **{angle: f"{angle}|{angle}_rad" for angle in ("roll", "pitch", "yaw")},
    **{f"{angle}_deg": f"{angle}_deg" for angle in ("roll", "pitch", "yaw")},
}
"""Names of the columns of csv files that are ours, TUM's, EuRoC's, Argoverse 2's or rostopic's."""
_UNITS = {"t": 1.0, "t_ms": 1e-3, "t_us": 1e-6, "t_ns": 1e-9}


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """Give the number and the text of each line that is neither empty nor a comment."""
    check_source(path, "a file of poses")
    if path.stat().st_size > _MAX_BYTES:
        raise FileError(f"{path}: expected poses, got a file of more than {_MAX_BYTES >> 30} GB; pass another")
    with reading(path, "a text file of poses"):
        text = path.read_text(encoding="utf-8-sig")
    for number, line in enumerate(text.splitlines(), 1):
        if (line := line.strip()) and not line.startswith("#"):
            yield number, line


def rows_of(path: Path, columns: Sequence[int], wanted: str) -> Array:
    """Return the numbers of a file, as many as one of `columns` in each line."""
    rows: list[list[float]] = []
    for number, line in lines_of(path):
        words = line.replace(",", " ").split()
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) not in columns or not all(map(math.isfinite, row)) or (rows and len(row) != len(rows[0])):
            raise FileError(f"{path}: line {number}: expected {wanted}, got {line!r:.80}; correct it")
        rows.append(row)
    if not rows:
        raise FileError(f"{path}: expected {wanted} in each line, got no line; it may be cut short")
    return np.array(rows)


def recognised(path: Path) -> str:
    """Return the format of a text file, by its first line."""
    first = next(lines_of(path), (1, ""))[1]
    words = first.replace(",", " ").split()
    numeric = all(_is_number(word) for word in words)
    if numeric and len(words) == 12:
        return "kitti"
    if numeric and len(words) == 8 and "," not in first:
        return "tum"
    if "," in first or path.suffix.lower() == ".csv":
        return "csv"
    raise FileError(
        f"{path}: expected poses, got {first!r:.60} in the first line; known are lines of 8 numbers (TUM), of 12 "
        "(KITTI), and csv with a line of names"
    )


def tum(path: Path) -> tuple[Array, Array]:
    """Read lines ``timestamp tx ty tz qx qy qz qw``."""
    rows = rows_of(path, (8,), "timestamp tx ty tz qx qy qz qw")
    return rows[:, 0], assembled(str(path), rows[:, 1:4], rows[:, [7, 4, 5, 6]])


def kitti(path: Path) -> tuple[None, Array]:
    """Read 12 numbers a line, 3x4 by rows; the format has no timestamps."""
    rows = rows_of(path, (12,), "12 numbers, 3x4 by rows")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows.reshape(-1, 3, 4)
    return None, poses


def column(path: Path) -> Array:
    """Return the seconds of ``times.txt``, one in each line."""
    return rows_of(path, (1,), "a number of seconds")[:, 0]


def csv(path: Path) -> tuple[Array, Array]:
    """Read a line of names, and what they name."""
    check_source(path, "a csv file of poses")
    with reading(path, "a csv file of poses"), path.open(encoding="utf-8-sig") as file:
        header = next((line for line in file if line.strip()), "")
    names = [word.strip().lower() for word in header.lstrip("# ").split(",")]
    if all(_is_number(name) for name in names):
        raise FileError(
            f"{path}: expected names in the first line, got numbers; write timestamp,x,y,z,qw,qx,qy,qz above them"
        )
    places = {
        ours: [index for index, name in enumerate(names) if name in theirs.split("|")]
        for ours, theirs in _NAMES.items()
    }
    twice = next((ours for ours, found in places.items() if len(found) > 1), None)
    if twice is not None:
        raise FileError(f"{path}: expected one column {twice}, got {len(places[twice])}; remove one")
    rows = _csv_rows(path, len(names), header.lstrip().startswith("#"))
    found = {ours: rows[:, place[0]] for ours, place in places.items() if place}
    clock = [name for name in _UNITS if name in found]
    if len(clock) != 1 or not all(axis in found for axis in "xyz"):
        raise FileError(
            f"{path}: expected columns timestamp, x, y, z, got {', '.join(names)!r:.120}; rename them in the first line"
        )
    times, place = found[clock[0]] * _UNITS[clock[0]], np.stack([found[axis] for axis in "xyz"], -1)
    if all(f"q{axis}" in found for axis in "wxyz"):
        return times, assembled(str(path), place, np.stack([found[f"q{axis}"] for axis in "wxyz"], -1))
    angles = []
    for angle in ("roll", "pitch", "yaw"):
        degrees = found.get(f"{angle}_deg")
        radians = found.get(angle) if degrees is None else np.radians(degrees)
        if radians is None:
            raise FileError(f"{path}: expected columns qw, qx, qy, qz or roll, pitch, yaw, got none; add them")
        angles.append(radians)
    return times, _posed([rotation_from_euler(*each) for each in zip(*angles, strict=True)], place)


def _csv_rows(path: Path, count: int, header_is_comment: bool) -> Array:
    rows, lines = [], lines_of(path)
    if not header_is_comment:
        next(lines)
    for number, line in lines:
        words = line.split(",")
        try:
            row = [float(word) for word in words[:count]]
        except ValueError:
            row = []
        if len(row) != count or len(words) > count + (words[-1].strip() == "") or not all(map(math.isfinite, row)):
            raise FileError(f"{path}: line {number}: expected {count} numbers, got {line!r:.80}; correct it")
        rows.append(row)
    if not rows:
        raise FileError(f"{path}: expected poses below the names, got none; it may be cut short")
    return np.array(rows)


def oxts(path: Path) -> tuple[Array, Array]:
    """Read ``oxts/timestamps.txt`` and ``oxts/data/*.txt`` of KITTI raw: lat, lon, alt, roll, pitch, yaw.

    Positions by the Mercator projection at the first latitude, as the dataset's own development kit has them; east,
    north, up from the first. Angles are ours: positive pitch looks down, yaw is 0 towards the east.
    """
    folder = path / "oxts" if (path / "oxts").is_dir() else path
    moments = [moment(folder / "timestamps.txt", number, line) for number, line in lines_of(folder / "timestamps.txt")]
    files = sorted((folder / "data").glob("*.txt"))
    if len(files) != len(moments):
        raise FileError(
            f"{folder}: expected a packet in data/ for each of {len(moments)} timestamps, got {len(files)}; "
            "fetch it again"
        )
    if not files:
        raise FileError(f"{folder}: expected packets in data/, got none; fetch it again")
    packets = []
    for file in files:
        row = rows_of(file, range(6, 100), "lat lon alt roll pitch yaw ...")
        packets.append(row[0, :6])
    latitude, longitude, altitude, roll, pitch, yaw = np.array(packets).T
    if (np.abs(latitude) >= 90).any():
        raise FileError(f"{folder}: expected latitudes within 90 degrees, got others; fetch it again")
    scale = math.cos(math.radians(latitude[0]))
    east = scale * _EARTH_RADIUS * np.radians(longitude)
    north = scale * _EARTH_RADIUS * np.log(np.tan(np.radians(90 + latitude) / 2))
    place = np.stack([east, north, altitude], -1)
    turns = [rotation_from_euler(*each) for each in zip(roll, pitch, yaw, strict=True)]
    return np.array(moments), _posed(turns, place - place[0])


def moment(path: Path, number: int, line: str) -> float:
    """Return the seconds since 1970 of KITTI's ``2011-09-26 13:02:25.964389445``, taken as UTC."""
    try:
        whole, _, fraction = line.partition(".")
        date = datetime.datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=datetime.timezone.utc)
        return date.timestamp() + (float(f"0.{fraction}") if fraction else 0.0)
    except ValueError as error:
        raise FileError(
            f"{path}: line {number}: expected a moment such as 2011-09-26 13:02:25.964389445, got "
            f"{line!r:.60}; correct it"
        ) from error


def assembled(origin: str, positions: Array, quaternions: Array) -> Array:
    """Return (N, 4, 4) poses of positions and quaternions, w x y z, whose norms are checked."""
    with np.errstate(over="ignore"):  # an infinite norm is refused like any other
        norms = np.linalg.norm(quaternions, axis=1)
    off = np.flatnonzero(~(np.abs(norms - 1) <= _NORM_TOLERANCE))
    if len(off):
        raise FileError(
            f"{origin}: expected quaternions of norm 1, got norm {norms[off[0]]:.6g} in pose {off[0] + 1}; check the "
            "order of the columns"
        )
    return _posed(to_matrices(quaternions / norms[:, None]), positions)


def _posed(rotations: Array | list[Array], positions: Array) -> Array:
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations, positions
    return poses


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
