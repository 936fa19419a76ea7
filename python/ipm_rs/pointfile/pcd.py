"""PCD, the files of the Point Cloud Library: read by pypcd4, written here.

Format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import FileError, MissingExtraError
from ipm_rs.pointfile import COLOURS

_HEADER_BYTES = 1 << 14
_MOST_FIELDS = 1024
_DENSEST = 100  # LZF makes at most 264 bytes of 3


def read(path: Path) -> dict[str, NDArray[Any]]:
    """Read all fields of one number."""
    try:
        from pypcd4.pypcd4 import PointCloud
    except ImportError as error:
        raise MissingExtraError(
            'expected pypcd4, which reads PCD files, found none; install it with: pip install "ipm-rs[cloud]"'
        ) from error
    points = _check_header(path)
    records = PointCloud.from_path(path).pc_data
    if len(records) != points:
        raise FileError(f"{path}: expected {points} points as its header says, got {len(records)}; it is cut short")
    return {
        name: records[name].astype(records.dtype[name].newbyteorder("="))
        for name in records.dtype.names or ()
        if not name.startswith("#")  # padding
    }


def _check_header(path: Path) -> int:
    """Return the number of points, or refuse a header that claims more than the file holds."""
    with path.open("rb") as file:
        start = file.read(_HEADER_BYTES)
    claims: dict[bytes, list[int]] = {}
    unpacked, read = None, 0
    for line in start.splitlines(keepends=True):
        read += len(line)
        name, *words = line.split() or [b"#"]
        if name in (b"SIZE", b"COUNT", b"WIDTH", b"HEIGHT", b"POINTS"):
            claims[name] = [int(word) for word in words]
        if name == b"DATA":
            if words == [b"binary_compressed"]:
                unpacked = int.from_bytes(start[read + 4 : read + 8], "little")
            break
    else:
        raise FileError(f"{path}: expected a PCD file with a header, got none; is it one?")
    sizes = claims.get(b"SIZE", [])
    counts = claims.get(b"COUNT", [1] * len(sizes))
    points = max([*claims.get(b"POINTS", [0]), *claims.get(b"WIDTH", [0])])
    numbers = [*sizes, *counts, *claims.get(b"HEIGHT", [1]), points]
    if not sizes or len(counts) != len(sizes) or min(numbers) < 0 or sum(counts) > _MOST_FIELDS:
        raise FileError(
            f"{path}: expected up to {_MOST_FIELDS} fields with a SIZE each, got a header that says otherwise"
        )
    claimed = points * sum(size * count for size, count in zip(sizes, counts, strict=True))
    if claimed > _DENSEST * path.stat().st_size or unpacked not in (None, claimed):
        raise FileError(
            f"{path}: expected {points} points as its header says, got {path.stat().st_size} bytes; it is cut short or "
            "damaged"
        )
    return points


def write(file: BinaryIO, table: dict[str, NDArray[Any]]) -> None:
    """Write a binary file; colours of 8 bits go into the one number that PCL packs them into."""
    if all(name in table and table[name].dtype == np.uint8 for name in COLOURS):
        red, green, blue = (table[name].astype(np.uint32) for name in COLOURS)
        table = {name: column for name, column in table.items() if name not in COLOURS}
        table["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)
    count = len(table["x"])
    kinds = {name: column.dtype.str[1:] for name, column in table.items()}
    header = "\n".join(
        (
            "# .PCD v0.7 - Point Cloud Data file format",
            "VERSION 0.7",
            f"FIELDS {' '.join(kinds)}",
            f"SIZE {' '.join(kind[1:] for kind in kinds.values())}",
            f"TYPE {' '.join(kind[0].upper() for kind in kinds.values())}",
            f"COUNT {' '.join('1' for _ in kinds)}",
            f"WIDTH {count}",
            "HEIGHT 1",
            "VIEWPOINT 0 0 0 1 0 0 0",
            f"POINTS {count}",
            "DATA binary\n",
        )
    )
    records = np.empty(count, dtype=[(name, "<" + kind) for name, kind in kinds.items()])
    for name, column in table.items():
        records[name] = column
    file.write(header.encode("ascii"))
    file.write(records.tobytes())
