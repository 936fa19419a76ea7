"""Rows of numbers: ``.bin`` as KITTI and nuScenes have it, and ``.npy``."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ArgumentError, FileError

KITTI = ("x", "y", "z", "intensity")
NUSCENES = (*KITTI, "ring")

_USUAL = (3, 4, 5, 6, 8)
"""How many columns such files have: x y z, and with intensity, ring or time, colours or normals, or most of these."""

_MOST_COLUMNS = 1024
_LONGEST_HEADER = 1 << 16  # more than version 1 can have, and than NumPy reads


def read_bin(path: Path, columns: Sequence[str] | None) -> dict[str, NDArray[Any]]:
    """Read little-endian float32 rows."""
    named = columns or (NUSCENES if path.name.lower().endswith(".pcd.bin") else None)
    names = named or KITTI
    size, row = path.stat().st_size, 4 * len(names)
    fits = [count for count in _USUAL if size % (4 * count) == 0]
    if size % row:
        mend = f"its size fits rows of {_or(fits)}; name them with columns=" if fits else "it may be cut short"
        raise FileError(
            f"{path}: expected rows of {len(names)} float32 ({', '.join(names)}), got {size} bytes, no whole number of "
            f"them; {mend}"
        )
    numbers = np.fromfile(path, dtype="<f4").astype(np.float32, copy=False).reshape(-1, len(names))
    if named is None and len(fits) > 1 and not _is_kitti(numbers):
        raise FileError(
            f"{path}: expected columns=, for {size} bytes fit rows of {_or(fits)} float32, which do not look like "
            f"KITTI's; name what a row holds, such as columns={KITTI} or {(*KITTI[:3], 'red', 'green', 'blue')}"
        )
    return {name: numbers[:, i] for i, name in enumerate(names)}


def _is_kitti(rows: NDArray[np.float32]) -> bool:
    """Whether rows of four can be nothing but x, y, z in metres and a reflectance from 0 to 1.

    Of rows of 3, 5 or 6 numbers, the fourth of every four is now this column and now that one, so that it leaves 0..1
    as coordinates do. Of rows of 8 it may be two columns that stay there; then every other row is of another kind, and
    a row differs more from the next one than from the one after.
    """
    if len(rows) == 0:
        return True
    coordinates, reflectance = rows[:, :3], rows[:, 3]
    if not (np.isfinite(rows).all() and reflectance.min() >= 0 and reflectance.max() <= 1):
        return False
    if ((coordinates >= 0) & (coordinates <= 1)).mean() > 0.5:
        return False
    if len(rows) < 3:
        return True
    next_one, one_after = (np.abs(rows[lag:] - rows[:-lag]).mean(dtype=np.float64, axis=0) for lag in (1, 2))
    return bool((next_one <= 1.25 * one_after + 1e-6).all())


def _or(counts: Sequence[int]) -> str:
    *some, last = map(str, counts)
    return f"{', '.join(some)} or {last}" if some else last


def write_bin(file: BinaryIO, table: dict[str, NDArray[Any]]) -> None:
    """Write all columns as little-endian float32."""
    for name, column in table.items():
        if column.dtype.kind in "iu" and not np.array_equal(column.astype("<f4").astype(np.float64), column):
            raise ArgumentError(
                f"values[{name!r}]: expected whole numbers that float32, which .bin files hold, keeps as they are, got "
                "some beyond 2^24; write .ply, .pcd or .npy"
            )
    file.write(np.stack([column.astype("<f4") for column in table.values()], axis=1).tobytes())


def read_npy(path: Path, columns: Sequence[str] | None) -> dict[str, NDArray[Any]]:
    """Read (N, k) numbers, or a structured array."""
    array = mapped(path)
    if array.dtype.names:
        if columns is not None:
            raise ArgumentError(f"columns: expected none for a structured array, got {list(columns)}")
        flat = array.reshape(-1)
        scalars = [name for name in array.dtype.names if array.dtype[name].shape == ()]
        return {name: _real(path, flat[name]) for name in scalars}
    if array.ndim < 2 or not 3 <= array.shape[-1] <= _MOST_COLUMNS:
        raise FileError(f"{path}: expected an array of shape (N, 3) or a little wider, got {array.shape}")
    numbers = _real(path, array.reshape(-1, array.shape[-1]))
    names = columns or ("x", "y", "z", *(f"column_{i}" for i in range(3, numbers.shape[1])))
    if len(names) != numbers.shape[1]:
        raise ArgumentError(f"columns: expected {numbers.shape[1]} names for {path}, got {list(names)}")
    return {name: numbers[:, i] for i, name in enumerate(names)}


def mapped(path: Path) -> NDArray[Any]:
    """Map the array of a ``.npy`` file: what its header claims is held against the size of the file."""
    with path.open("rb") as file:
        check_header(path, file.read(12))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what NumPy and Python say of odd headers
            return np.lib.format.open_memmap(path, mode="r")
    except MemoryError as error:  # the parser of Python, on brackets in brackets
        raise FileError(f"{path}: expected an array, got a header that cannot be read; it is damaged") from error


def check_header(path: Path, start: bytes) -> None:
    """Refuse the first 12 bytes of a ``.npy`` whose header claims to be long: NumPy asks for so much memory at once."""
    length = int.from_bytes(start[8:12] if start[6:7] >= b"\2" else start[8:10], "little")
    if length > _LONGEST_HEADER:
        raise FileError(f"{path}: expected an array, got a header that claims {length} bytes; it is damaged")


def _real(path: Path, numbers: NDArray[Any]) -> NDArray[Any]:
    """Copy real numbers out of a map."""
    if numbers.dtype.kind not in "fiub":
        raise FileError(f"{path}: expected real numbers, got dtype {numbers.dtype}")
    return np.array(numbers, dtype=numbers.dtype.newbyteorder("="))


def write_npy(file: BinaryIO, table: dict[str, NDArray[Any]]) -> None:
    """Write (N, 3) numbers, or a structured array if there are values."""
    if len(table) == 3:
        array = np.stack(list(table.values()), axis=1)
    else:
        array = np.empty(len(table["x"]), dtype=[(name, column.dtype) for name, column in table.items()])
        for name, column in table.items():
            array[name] = column
    np.lib.format.write_array(file, array, allow_pickle=False)
