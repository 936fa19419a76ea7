"""PCD, the files of the Point Cloud Library: read by pypcd4, written here.

Format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import FileError, MissingExtraError
from ipm_rs.pointfile import COLOURS, text

_HEADER_BYTES = 1 << 14
_MOST_FIELDS = 1024
_DENSEST = 100  # LZF makes at most 264 bytes of 3

_TYPES = {
    **{("F", size): f"f{size}" for size in (4, 8)},
    **{(sign.upper(), size): f"{sign}{size}" for sign in "iu" for size in (1, 2, 4, 8)},
}
_NAMES = {kind: f"{sign} {size}" for (sign, size), kind in _TYPES.items()}


@dataclass(frozen=True)
class _Header:
    """What a header claims, held against the size of the file: ``kinds`` are names and dtypes of a point's numbers."""

    kinds: list[tuple[str, str]]
    points: int
    data: str
    end: int

    @property
    def dtype(self) -> np.dtype[Any]:
        return np.dtype([(name, "<" + kind) for name, kind in self.kinds])


def read(path: Path) -> dict[str, NDArray[Any]]:
    """Read all fields of one number."""
    try:
        from pypcd4.pypcd4 import PointCloud
    except ImportError as error:
        raise MissingExtraError(
            'expected pypcd4, which reads PCD files, found none; install it with: pip install "ipm-rs[cloud]"'
        ) from error
    header = _header(path)
    names = [name for name, _ in header.kinds]
    with path.open("rb") as file:
        file.seek(header.end)
        if header.data == "ascii":
            columns = text.read_rows(path, file, header.points, header.kinds, _NAMES)
        elif header.data == "binary":
            records = np.frombuffer(file.read(header.points * header.dtype.itemsize), header.dtype, header.points)
            columns = [records[name] for name in names]
        else:
            # with a header of our own, so that what is unpacked is what was checked
            whole = io.BytesIO(
                _text([(f"f{i}", kind) for i, (_, kind) in enumerate(header.kinds)], header.points, header.data).encode(
                    "ascii"
                )
                + file.read()
            )
            records = PointCloud.from_fileobj(whole).pc_data  # type: ignore[arg-type] # any file that can be sought
            columns = [records[f"f{i}"] for i in range(len(names))]
    columns = [column.astype(column.dtype.newbyteorder("=")) for column in columns]
    return {name: column for name, column in zip(names, columns, strict=True) if not name.startswith("#")}


def _header(path: Path) -> _Header:
    """Return what the header says, or refuse one that claims more than the file holds."""
    with path.open("rb") as file:
        start = file.read(_HEADER_BYTES)
    claims: dict[str, list[str]] = {}
    end = 0
    for line in start.splitlines(keepends=True):
        end += len(line)
        name, *words = line.decode("latin-1").split() or ["#"]
        if name.startswith("#"):
            continue
        if name in claims:
            raise FileError(f"{path}: expected {name} once in its header, got it again; it is damaged")
        claims[name] = words
        if name == "DATA":
            break
    else:
        raise FileError(f"{path}: expected a PCD file with a header, got none; is it one?")
    fields = claims.get("FIELDS", [])
    sizes = _wholes(path, claims, "SIZE", [])
    counts = _wholes(path, claims, "COUNT", [1] * len(fields))
    types = claims.get("TYPE", [])
    if not len(fields) == len(sizes) == len(counts) == len(types) or sum(counts) > _MOST_FIELDS or not fields:
        raise FileError(
            f"{path}: expected up to {_MOST_FIELDS} fields with a SIZE, a TYPE and a COUNT each, got a header that "
            "says otherwise"
        )
    points = _points(path, claims)
    kinds = []
    for index, (field, type_, size, count) in enumerate(zip(fields, types, sizes, counts, strict=True)):
        if (type_, size) not in _TYPES:
            raise FileError(f"{path}: {field}: expected TYPE F, I or U and a SIZE of it, got {type_} {size}")
        name = f"#{index}" if field == "_" else field  # padding
        numbered = [name] if count == 1 else [f"{name}__{i:04d}" for i in range(count)]
        kinds += [(name, _TYPES[type_, size]) for name in numbered]
    if len({name for name, _ in kinds}) != len(kinds):
        raise FileError(f"{path}: expected each field once, got {', '.join(fields)[:200]}")
    data = " ".join(claims["DATA"])
    claimed = points * sum(int(kind[1:]) for _, kind in kinds)
    unpacked = int.from_bytes(start[end + 4 : end + 8], "little") if data == "binary_compressed" else claimed
    size = path.stat().st_size
    if data not in ("ascii", "binary", "binary_compressed"):
        raise FileError(f"{path}: expected DATA ascii, binary or binary_compressed, got {data[:80]!r}")
    # ascii holds itself against the size of the file, number by number
    least = {"ascii": 0, "binary": claimed, "binary_compressed": claimed // _DENSEST}[data]
    if least > size - end or (unpacked != claimed and points > 0):
        raise FileError(
            f"{path}: expected {points} points as its header says, got {size - end} bytes; it is cut short or damaged"
        )
    return _Header(kinds, points, data, end)


def _points(path: Path, claims: dict[str, list[str]]) -> int:
    """Return the number of points, on which all that is said of it must agree."""
    [width, *_] = _wholes(path, claims, "WIDTH", [0]) or [0]
    [height, *_] = _wholes(path, claims, "HEIGHT", [1]) or [1]
    [points, *_] = _wholes(path, claims, "POINTS", [width * height]) or [width * height]
    if "WIDTH" in claims and points != width * height:
        raise FileError(f"{path}: expected POINTS to be WIDTH x HEIGHT, got {points}, {width} and {height}")
    return points


def _wholes(path: Path, claims: dict[str, list[str]], name: str, default: list[int]) -> list[int]:
    words = claims.get(name)
    if words is None:
        return default
    if not all(word.isascii() and word.isdecimal() and len(word) < 16 for word in words):
        raise FileError(f"{path}: expected whole numbers for {name}, got {' '.join(words)[:80]!r}; it is damaged")
    return [int(word) for word in words]


def write(file: BinaryIO, table: dict[str, NDArray[Any]]) -> None:
    """Write a binary file; colours of 8 bits go into the one number that PCL packs them into."""
    if all(name in table and table[name].dtype == np.uint8 for name in COLOURS):
        red, green, blue = (table[name].astype(np.uint32) for name in COLOURS)
        table = {name: column for name, column in table.items() if name not in COLOURS}
        table["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)
    kinds = [(name, column.dtype.str[1:]) for name, column in table.items()]
    records = np.empty(len(table["x"]), dtype=[(name, "<" + kind) for name, kind in kinds])
    for name, column in table.items():
        records[name] = column
    file.write(_text(kinds, len(records), "binary").encode("ascii"))
    file.write(records.tobytes())


def _text(kinds: list[tuple[str, str]], count: int, data: str) -> str:
    """Return a header."""
    return "\n".join(
        (
            "# .PCD v0.7 - Point Cloud Data file format",
            "VERSION 0.7",
            f"FIELDS {' '.join(name for name, _ in kinds)}",
            f"SIZE {' '.join(kind[1:] for _, kind in kinds)}",
            f"TYPE {' '.join(kind[0].upper() for _, kind in kinds)}",
            f"COUNT {' '.join('1' for _ in kinds)}",
            f"WIDTH {count}",
            "HEIGHT 1",
            "VIEWPOINT 0 0 0 1 0 0 0",
            f"POINTS {count}",
            f"DATA {data}\n",
        )
    )
