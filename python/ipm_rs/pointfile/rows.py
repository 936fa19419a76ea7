"""Rows of numbers: ``.bin`` as KITTI and nuScenes have it, and ``.npy``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ArgumentError, FileError

KITTI = ("x", "y", "z", "intensity")
NUSCENES = (*KITTI, "ring")


def read_bin(path: Path, columns: Sequence[str] | None) -> dict[str, NDArray[Any]]:
    """Read little-endian float32 rows."""
    names = columns or (NUSCENES if path.name.lower().endswith(".pcd.bin") else KITTI)
    size, row = path.stat().st_size, 4 * len(names)
    if size % row:
        fits = [str(count) for count in range(3, 9) if size % (4 * count) == 0]
        mend = f"its size fits rows of {' or '.join(fits)}; name them with columns=" if fits else "it may be cut short"
        raise FileError(
            f"{path}: expected rows of {len(names)} float32 ({', '.join(names)}), got {size} bytes, no whole number of "
            f"them; {mend}"
        )
    numbers = np.fromfile(path, dtype="<f4").astype(np.float32, copy=False).reshape(-1, len(names))
    return {name: numbers[:, i] for i, name in enumerate(names)}


def write_bin(file: BinaryIO, table: dict[str, NDArray[Any]]) -> None:
    """Write all columns as little-endian float32."""
    file.write(np.stack([column.astype("<f4") for column in table.values()], axis=1).tobytes())


def read_npy(path: Path, columns: Sequence[str] | None) -> dict[str, NDArray[Any]]:
    """Read (N, k) numbers, or a structured array."""
    # mapped: what the header claims is held against the size of the file before memory is asked for
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    if array.dtype.names:
        if columns is not None:
            raise ArgumentError(f"columns: expected none for a structured array, got {list(columns)}")
        flat = array.reshape(-1)
        return {name: _real(path, np.array(flat[name])) for name in array.dtype.names if array.dtype[name].shape == ()}
    if array.ndim < 2 or array.shape[-1] < 3:
        raise FileError(f"{path}: expected an array of shape (N, 3) or wider, got {array.shape}")
    numbers = _real(path, np.array(array.reshape(-1, array.shape[-1])))
    names = columns or ("x", "y", "z", *(f"column_{i}" for i in range(3, numbers.shape[1])))
    if len(names) != numbers.shape[1]:
        raise ArgumentError(f"columns: expected {numbers.shape[1]} names for {path}, got {list(names)}")
    return {name: numbers[:, i] for i, name in enumerate(names)}


def _real(path: Path, numbers: NDArray[Any]) -> NDArray[Any]:
    if numbers.dtype.kind not in "fiub":
        raise FileError(f"{path}: expected real numbers, got dtype {numbers.dtype}")
    return numbers.astype(numbers.dtype.newbyteorder("="), copy=False)


def write_npy(file: BinaryIO, table: dict[str, NDArray[Any]]) -> None:
    """Write (N, 3) numbers, or a structured array if there are values."""
    if len(table) == 3:
        array = np.stack(list(table.values()), axis=1)
    else:
        array = np.empty(len(table["x"]), dtype=[(name, column.dtype) for name, column in table.items()])
        for name, column in table.items():
            array[name] = column
    np.lib.format.write_array(file, array, allow_pickle=False)
