"""Point cloud files: KITTI and nuScenes ``.bin``, ``.npy``, PLY and PCD.

    cloud = pointfile.read("000114.bin")
    layers = ipm_rs.rasterize(cloud.points, grid, cloud.values["intensity"])
    pointfile.write("cloud.ply", points, {"red": red, "green": green, "blue": blue})

========  ===========================================================  ==============================================
ending    read                                                         written
========  ===========================================================  ==============================================
.bin      float32 rows; ``.pcd.bin`` (nuScenes) x y z intensity ring,  x y z and the values, float32
          others (KITTI) x y z intensity; ``columns=`` for more
.npy      (N, 3) or wider, or a structured array with x, y, z          the same rows, or a structured array
.ply      ascii and binary, the scalars of its vertices                binary, little-endian
.pcd      ascii, binary and binary_compressed, by pypcd4 (extra        binary
          ``cloud``)
========  ===========================================================  ==============================================

Nothing is allocated that the size of the file does not bear out, and a file is written whole or not at all. Frames and
units are those of the file: a nuScenes sweep is x right, y forward, a KITTI one x forward, y left.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError, IpmError, MissingFileError

__all__ = ["FORMATS", "Cloud", "check_name", "read", "write"]

FORMATS = (".bin", ".npy", ".pcd", ".ply")
"""Endings of the files that are read and written."""

COLOURS = ("red", "green", "blue")


@dataclass(frozen=True)
class Cloud:
    """Points and what they carry.

    Attributes
    ----------
    points : ndarray, shape (N, 3), float32 or float64
        x, y, z.
    values : dict of str to ndarray, shape (N,)
        Everything else, by name: "intensity", "ring", "red", "green", "blue", ...
    """

    points: NDArray[Any]
    values: dict[str, NDArray[Any]] = field(default_factory=dict)


def read(path: str | PathLike[str], *, columns: Sequence[str] | None = None) -> Cloud:
    """Read a point cloud file, whose ending decides the format.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence of str, optional
        Names of the columns of a ``.bin`` or ``.npy`` file, among them "x", "y" and "z".

    Returns
    -------
    Cloud

    Raises
    ------
    MissingFileError, FileError
        There is no such file, or it is damaged or of another format.
    ArgumentError
        The ending or the columns make no sense.
    MissingExtraError
        A PCD file, and pypcd4 is not installed.
    """
    from ipm_rs.pointfile import pcd, ply, rows

    path = Path(path)
    ending = check_name(path)
    if columns is not None:
        if ending in (".ply", ".pcd"):
            raise ArgumentError(f"columns: expected none for {ending}, which names its own, got {list(columns)}")
        columns = _columns(columns)
    if not path.exists():
        raise MissingFileError(f"{path}: expected a point cloud, found no file; check the path")
    if not path.is_file():
        raise FileError(f"{path}: expected a point cloud, got {'a directory' if path.is_dir() else 'no regular file'}")
    with _explained(path):
        if ending == ".bin":
            table = rows.read_bin(path, columns)
        elif ending == ".npy":
            table = rows.read_npy(path, columns)
        else:
            table = (ply if ending == ".ply" else pcd).read(path)
    return _cloud(path, table)


def write(
    path: str | PathLike[str], points: ArrayLike, values: Mapping[str, ArrayLike] | None = None, *, force: bool = False
) -> None:
    """Write a point cloud file, whole or not at all; its ending decides the format.

    Viewers know the values "red", "green", "blue" (uint8) and "intensity". Points that are NaN are written as they are.

    Parameters
    ----------
    path : path
        The file.
    points : array_like, shape (N, 3), float32 or float64
        x, y, z; other real dtypes are written as float64.
    values : mapping of str to array_like, shape (N,), optional
        What the points carry: bool, integers up to 32 bits, float32 or float64, under names without spaces.
    force : bool
        Replace an existing file.

    Raises
    ------
    FileError
        The file exists or cannot be written.
    ArgumentError, ArgumentTypeError
        Shapes, dtypes or names that do not fit.
    """
    from ipm_rs.imagefile import atomically
    from ipm_rs.pointfile import pcd, ply, rows

    path = Path(path)
    ending = check_name(path)
    table = _table(points, values or {})
    if os.path.lexists(path) and not force:
        raise FileError(f"{path}: expected a new file, got one that exists; give another name, or force=True")
    writers: dict[str, Callable[[Any, dict[str, NDArray[Any]]], None]] = {
        ".bin": rows.write_bin,
        ".npy": rows.write_npy,
        ".pcd": pcd.write,
        ".ply": ply.write,
    }
    with atomically(path) as file:
        writers[ending](file, table)


def check_name(path: Path) -> str:
    """Return the ending of a name, or raise ArgumentError if no format has it."""
    ending = path.suffix.lower()
    if ending not in FORMATS:
        got = repr(path.suffix) if path.suffix else "no ending"
        raise ArgumentError(f"{path}: expected a name that ends in {', '.join(FORMATS)}, got {got}")
    return ending


def _columns(columns: Sequence[str]) -> list[str]:
    names = [columns] if isinstance(columns, str) else list(columns)
    if len(set(names)) != len(names) or not {"x", "y", "z"} <= set(names):
        raise ArgumentError(f'columns: expected different names, among them "x", "y" and "z", got {names}')
    return names


def _cloud(path: Path, table: dict[str, NDArray[Any]]) -> Cloud:
    """Put x, y, z together, and take colours apart that PCL packs into one number."""
    missing = [axis for axis in "xyz" if axis not in table]
    if missing:
        raise FileError(f"{path}: expected points with x, y and z, got {', '.join(table) or 'nothing'}")
    axes = [table.pop(axis) for axis in "xyz"]
    kind = np.float32 if all(axis.dtype == np.float32 for axis in axes) else np.float64
    points = np.stack([axis.astype(kind, copy=False) for axis in axes], axis=1)
    for name in ("rgb", "rgba"):
        packed = table.get(name)
        if packed is not None and packed.dtype.itemsize == 4 and not set(COLOURS) & set(table):
            del table[name]
            bits = np.ascontiguousarray(packed).view(np.uint32)
            table |= {
                colour: (bits >> shift).astype(np.uint8) for colour, shift in zip(COLOURS, (16, 8, 0), strict=True)
            }
    return Cloud(points, table)


def _table(points: ArrayLike, values: Mapping[str, ArrayLike]) -> dict[str, NDArray[Any]]:
    """Columns by name, of the dtypes that files hold."""
    xyz = np.asarray(points)
    if xyz.dtype.kind not in "fiub":
        raise ArgumentTypeError(f"points: expected real numbers, got dtype {xyz.dtype}")
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        mend = "; give the other columns as values" if xyz.ndim == 2 else "; use points.reshape(-1, 3)"
        raise ArgumentError(f"points: expected shape (N, 3), got {xyz.shape}{mend}")
    if xyz.dtype != np.float32:
        xyz = xyz.astype(np.float64)
    table: dict[str, NDArray[Any]] = dict(zip("xyz", xyz.T, strict=True))
    for name, items in values.items():
        column = np.asarray(items)
        if not isinstance(name, str) or not name.isascii() or not name.replace("_", "a").isalnum() or name in table:
            raise ArgumentError(f"values: expected names of letters, digits and _, other than x, y, z, got {name!r}")
        if column.shape != (len(xyz),):
            raise ArgumentError(
                f"values[{name!r}]: expected shape ({len(xyz)},), a value for each point, got {column.shape}"
            )
        if column.dtype.kind == "b":
            column = column.astype(np.uint8)
        if column.dtype.kind not in "fiu" or column.dtype.itemsize > (8 if column.dtype.kind == "f" else 4):
            raise ArgumentTypeError(
                f"values[{name!r}]: expected bool, integers up to 32 bits, float32 or float64, got {column.dtype}"
            )
        if column.dtype == np.float16:
            column = column.astype(np.float32)
        table[name] = column
    return table


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Make errors of ours of what goes wrong in a damaged file."""
    try:
        yield
    except (IpmError, MemoryError):
        raise
    except OSError as error:
        raise FileError(f"{path}: expected a readable file, got: {error.strerror or error}; check it") from error
    except Exception as error:  # NumPy, pypcd4 and the text of a header fail in many ways
        reason = " ".join(str(error).split())[:200]
        raise FileError(
            f"{path}: expected a point cloud, got: {reason}; it may be cut short or damaged, fetch it again"
        ) from error
