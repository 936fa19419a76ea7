"""LAS and LAZ, the files of laser scanners and surveys: read and written by laspy.

Format: https://www.asprs.org/divisions-committees/lidar-division/laser-las-file-format-exchange-activities.

A coordinate is a whole number of steps: ``x = X * scale + offset``, which is worked out in float64. Read and written
again with the file's own scale and offset, the whole numbers are the same.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ArgumentError, FileError, MissingExtraError
from ipm_rs.pointfile import COLOURS

__all__ = ["SCALE", "read", "write"]

SCALE = 0.001
"""Metres of a step, where the caller says nothing: a millimetre, and 2147 km either way."""

_POINTS_AT_ONCE = 1_000_000
_DENSEST = 1 << 16  # points to a byte of a .laz file; of a million equal ones it has 30 000
_FARTHEST = 2**31 - 1
_AXES = ("X", "Y", "Z")


def read(path: Path) -> tuple[dict[str, NDArray[Any]], NDArray[np.float64], NDArray[np.float64]]:
    """Read the points of a file: every dimension by its name, and (3,) scale and offset."""
    laspy = _laspy()
    _check(path)
    with _no_panic(path), laspy.open(path, laz_backend=_backend(laspy), read_evlrs=False) as reader:
        header = reader.header
        scale, offset = (np.array(triple, dtype=np.float64) for triple in (header.scales, header.offsets))
        if not (np.isfinite(scale).all() and np.isfinite(offset).all() and scale.all()):
            raise FileError(f"{path}: expected a scale and an offset, got {scale} and {offset}; it is damaged")
        # in pieces, since a compressed file may claim more points than it holds
        at_once = min(max(path.stat().st_size, 1000), _POINTS_AT_ONCE)
        pieces = [_dimensions(piece) for piece in reader.chunk_iterator(at_once)]
        pieces = pieces or [_dimensions(reader.read_points(0))]
    found = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    if len(found["X"]) != header.point_count:
        raise FileError(f"{path}: expected {header.point_count} points, got {len(found['X'])}; it is cut short")
    with np.errstate(over="ignore"):
        table = {axis.lower(): found.pop(axis) * scale[i] + offset[i] for i, axis in enumerate(_AXES)}
    for name, column in found.items():
        table[name if name not in table else f"extra_{name}"] = column
    return table, scale, offset


def write(
    file: BinaryIO,
    table: dict[str, NDArray[Any]],
    scale: NDArray[np.float64] | None,
    offset: NDArray[np.float64] | None,
    *,
    compress: bool,
) -> None:
    """Write LAS 1.4, with the point format that has colours where there are all three."""
    laspy = _laspy()
    backend = _backend(laspy) if compress else None
    header = laspy.LasHeader(point_format=7 if all(name in table for name in COLOURS) else 6, version="1.4")
    xyz = [table.pop(axis) for axis in "xyz"]
    header.scales = np.full(3, SCALE) if scale is None else scale
    header.offsets = _offsets(xyz) if offset is None else offset
    standard = header.point_format.standard_dimensions
    known = {dimension.name: dimension for dimension in standard if dimension.name not in _AXES}
    for name, column in table.items():
        if name not in known:
            _check_name(name)
            header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=column.dtype))
    las = laspy.LasData(header)
    las.points = laspy.ScaleAwarePointRecord.zeros(len(xyz[0]), header=header)
    for i, axis in enumerate(_AXES):
        las[axis] = _steps(xyz[i], float(header.scales[i]), float(header.offsets[i]), axis.lower())
    for name, column in table.items():
        las[name] = _fitted(name, column, known[name]) if name in known else column
    las.write(file, do_compress=compress, laz_backend=backend)


def _laspy() -> Any:
    try:
        import laspy
    except ImportError as error:
        raise MissingExtraError(
            'expected laspy, which reads and writes LAS files, found none; install it with: pip install "ipm-rs[cloud]"'
        ) from error
    return laspy


def _backend(laspy: Any) -> Any:
    """Choose the decompressor of one thread: the other one believes a damaged file's sizes, and asks for the memory."""
    available = laspy.LazBackend.detect_available()
    return next((backend for backend in (laspy.LazBackend.Lazrs, *available) if backend in available), None)


@contextmanager
def _no_panic(path: Path) -> Iterator[None]:
    """Turn a panic of the decompressor, which is no `Exception`, into an error."""
    try:
        yield
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        raise FileError(f"{path}: expected compressed points, got what cannot be unpacked; it is damaged") from error


def _check(path: Path) -> None:
    """Hold what the header claims against the size of the file, before anything is allocated for it."""
    size = path.stat().st_size
    with path.open("rb") as file:
        start = file.read(375)
        if start[:4] != b"LASF" or len(start) < 227:
            raise FileError(f"{path}: expected a LAS file, which begins with LASF, got another; is it one?")
        major, minor = start[24:26]
        header_size, first, records = struct.unpack_from("<HII", start, 94)
        form, length, points = struct.unpack_from("<BHI", start, 104)
        if (major, minor) >= (1, 4) and len(start) >= 255:
            points = struct.unpack_from("<Q", start, 247)[0] or points
        packed = bool(form & 0x80)
        claimed = points // _DENSEST if packed else points * length
        if not 227 <= header_size <= first <= size or records * 54 > first - header_size or claimed > size - first:
            raise FileError(
                f"{path}: expected {points} points of {length} bytes from byte {first} on, as its header says, got a "
                f"file of {size} bytes; it is cut short or damaged"
            )
        if packed and points:
            _check_chunks(path, file, first, size)


def _check_chunks(path: Path, file: BinaryIO, first: int, size: int) -> None:
    """Refuse a table of more pieces than the file has bytes: lists as long are made of it."""
    file.seek(first)
    [place] = struct.unpack("<q", file.read(8).ljust(8, b"\0"))
    if place == -1:  # of a writer that could not go back: at the end
        file.seek(max(0, size - 8))
        [place] = struct.unpack("<q", file.read(8).ljust(8, b"\0"))
    if not first < place <= size - 8:
        raise FileError(
            f"{path}: expected a table of pieces in it, got its place as {place}; it is cut short or damaged"
        )
    file.seek(place)
    _, pieces = struct.unpack("<II", file.read(8))
    if pieces > size:
        raise FileError(f"{path}: expected fewer pieces than bytes, got {pieces} of {size}; it is damaged")


def _dimensions(points: Any) -> dict[str, NDArray[Any]]:
    """Every dimension of some points as arrays of their own, those of several numbers one by one."""
    found: dict[str, NDArray[Any]] = {}
    for name in points.point_format.dimension_names:
        column = np.array(points[name])
        if column.ndim == 1:
            found[name] = column
        else:
            found |= {f"{name}__{i:04d}": column[:, i].copy() for i in range(column.shape[1])}
    return found


def _offsets(xyz: list[NDArray[Any]]) -> NDArray[np.float64]:
    """0, or for coordinates of the earth, that no step of a millimetre reaches, the whole metres of their least."""
    offsets = np.zeros(3)
    for i, axis in enumerate(xyz):
        low, high = (float(axis.min()), float(axis.max())) if len(axis) else (0.0, 0.0)
        if max(abs(low), abs(high)) > 0.9 * _FARTHEST * SCALE:
            offsets[i] = np.floor(low)
    return offsets


def _steps(axis: NDArray[Any], scale: float, offset: float, name: str) -> NDArray[np.int32]:
    with np.errstate(all="ignore"):
        steps = np.round((axis.astype(np.float64) - offset) / scale)
        bad = ~(np.abs(steps) <= _FARTHEST)  # NaN too
    if bad.any():
        value = float(axis[int(np.flatnonzero(bad)[0])])
        wanted = f"from {offset - _FARTHEST * scale:g} to {offset + _FARTHEST * scale:g}"
        raise ArgumentError(
            f"points: expected {name} {wanted}, which steps of {scale:g} from {offset:g} reach, got {value:g}; "
            + ("leave such points out, LAS has no NaN" if not np.isfinite(value) else "pass scale= and offset=")
        )
    return steps.astype(np.int32)


def _fitted(name: str, column: NDArray[Any], dimension: Any) -> NDArray[Any]:
    """Return a column as the file's dimension holds it."""
    most = int(dimension.max) if dimension.kind.name != "FloatingPoint" else 0
    if not most:
        return column.astype(np.float64)
    if name in COLOURS and column.dtype == np.uint8:
        return column.astype(np.uint16) * 257  # 255 is 65535: the format asks for the whole range
    low, high = (float(column.min()), float(column.max())) if len(column) else (0.0, 0.0)
    if name == "intensity" and column.dtype.kind == "f" and low >= 0 and high <= 1:
        return np.round(column.astype(np.float64) * most).astype(np.uint16)
    least = int(dimension.min)
    if column.dtype.kind == "f" or not (least <= low and high <= most):
        raise ArgumentError(
            f"values[{name!r}]: expected whole numbers from {least} to {most}"
            f"{', or 0.0 to 1.0' if name == 'intensity' else ''}, as LAS has them, got {column.dtype} from {low:g} to "
            f"{high:g}; convert them, or give another name"
        )
    return column


def _check_name(name: str) -> None:
    if len(name) > 31 or name in _AXES:
        raise ArgumentError(
            f"values: expected names of at most 31 letters other than X, Y, Z, as LAS has them, got {name!r:.80}; give "
            "another name"
        )
