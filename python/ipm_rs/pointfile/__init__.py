"""Point cloud files: KITTI and nuScenes ``.bin``, ``.npy``, PLY, PCD, LAS and LAZ.

    cloud = pointfile.read("000114.bin")
    layers = ipm_rs.rasterize(cloud.points, grid, cloud.values["intensity"])
    pointfile.write("cloud.ply", points, {"red": red, "green": green, "blue": blue})

========  ===========================================================  ==============================================
ending    read                                                         written
========  ===========================================================  ==============================================
.bin      float32 rows; ``.pcd.bin`` (nuScenes) x y z intensity ring,  x y z and the values, float32
          others (KITTI) x y z intensity; ``columns=`` for others
.npy      (N, 3) or wider, or a structured array with x, y, z          the same rows, or a structured array
.ply      ascii and binary, the scalars of its vertices                binary, little-endian
.pcd      ascii, binary and binary_compressed, with pypcd4 (extra      binary
          ``cloud``)
.las,     every dimension of a point, with laspy (extra ``cloud``)     LAS 1.4, with ``scale=`` and ``offset=``
.laz
========  ===========================================================  ==============================================

Nothing is allocated that the size of the file does not bear out, and a file is written whole or not at all. Frames and
units are those of the file: a nuScenes sweep is x right, y forward, a KITTI one x forward, y left.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of, flag_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError
from ipm_rs.files.atomic import as_path, atomically, check_source, check_target, reading

__all__ = ["FORMATS", "Cloud", "check_name", "read", "write"]

FORMATS = (".bin", ".las", ".laz", ".npy", ".pcd", ".ply")
"""Endings of the files that are read and written."""

COLOURS = ("red", "green", "blue")

_LAS = (".las", ".laz")


@dataclass(frozen=True)
class Cloud:
    """Points and what they carry.

    Attributes
    ----------
    points : ndarray, shape (N, 3), float32 or float64
        x, y, z.
    values : dict of str to ndarray, shape (N,)
        Everything else, by name: "intensity", "ring", "red", "green", "blue", ...
    scale, offset : ndarray, shape (3,), float64, or None
        Of a LAS or LAZ file: its coordinates are whole steps of `scale` from `offset`. `write` with both gives back the
        same whole numbers.
    """

    points: NDArray[Any]
    values: dict[str, NDArray[Any]] = field(default_factory=dict)
    scale: NDArray[np.float64] | None = None
    offset: NDArray[np.float64] | None = None

    def __repr__(self) -> str:
        return f"Cloud({len(self.points)} points {self.points.dtype}{''.join(f', {name}' for name in self.values)})"

    def _repr_html_(self) -> str:
        from ipm_rs._notebook import cloud_picture, html_of

        return html_of(lambda: repr(self), lambda: cloud_picture(self.points))


def read(path: str | PathLike[str], *, columns: Sequence[str] | None = None) -> Cloud:
    """Read a point cloud file, whose ending decides the format.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence of str, optional
        Names of the columns of a ``.bin`` or ``.npy`` file, among them "x", "y" and "z". A ``.bin`` file does not say
        how many it has: without names it is read as KITTI's x y z intensity (``.pcd.bin`` as nuScenes') where its size
        fits rows of four and none of 3, 5, 6 or 8, or where the rows are plainly KITTI's: the fourth number from 0 to
        1 everywhere, the others metres.

    Returns
    -------
    Cloud

    Raises
    ------
    MissingFileError, FileError
        There is no such file, or it is damaged or of another format, or a ``.bin`` file needs `columns`.
    ArgumentError
        The ending or the columns make no sense.
    MissingExtraError
        A PCD file, and pypcd4 is not installed; a LAS or LAZ file, and laspy is not.
    """
    from ipm_rs.pointfile import las, pcd, ply, rows

    path = as_path(path)
    ending = check_name(path)
    if columns is not None:
        columns = _columns(columns)
        if ending not in (".bin", ".npy"):
            raise ArgumentError(f"columns: expected none for {ending}, which names its own, got {columns}")
    check_source(path, "a point cloud")
    scale = offset = None
    with reading(path, "a point cloud"):
        if ending == ".bin":
            table = rows.read_bin(path, columns)
        elif ending == ".npy":
            table = rows.read_npy(path, columns)
        elif ending in _LAS:
            table, scale, offset = las.read(path)
        else:
            table = (ply if ending == ".ply" else pcd).read(path)
    return _cloud(path, table, scale, offset)


def write(
    path: str | PathLike[str],
    points: ArrayLike,
    values: Mapping[str, ArrayLike] | None = None,
    *,
    scale: ArrayLike | None = None,
    offset: ArrayLike | None = None,
    force: bool = False,
) -> None:
    """Write a point cloud file, whole or not at all; its ending decides the format.

    Viewers know the values "red", "green", "blue" (uint8) and "intensity". Points that are NaN are written as they are;
    LAS has none, and refuses them. There colours and intensity have 16 bits: uint8 colours are spread over them (255 is
    65535), an intensity of floats from 0 to 1 too, and other names become extra dimensions.

    Parameters
    ----------
    path : path
        The file.
    points : array_like, shape (N, 3), float32 or float64
        x, y, z; other real dtypes are written as float64.
    values : mapping of str to array_like, shape (N,), optional
        What the points carry: bool, integers up to 32 bits, float32 or float64, under names without spaces.
    scale, offset : float or (3,) array_like, optional
        For LAS and LAZ: the step of the coordinates, and where they count from. Without them 0.001 and 0, or the whole
        metres of the least coordinate where the earth's are too far from 0.
    force : bool
        Replace an existing file.

    Raises
    ------
    FileError
        The file exists or cannot be written, or the path is that of a directory, a device or a pipe.
    ArgumentError, ArgumentTypeError
        Shapes, dtypes or names that do not fit.
    """
    from ipm_rs.pointfile import las, pcd, ply, rows

    path = as_path(path)
    ending = check_name(path)
    table = _table(points, {} if values is None else values)
    steps, start = _triple("scale", scale, ending), _triple("offset", offset, ending)
    if steps is not None and not (steps > 0).all():
        raise ArgumentError(f"scale: expected positive numbers, got {steps}; 0.001 is a millimetre")
    check_target(path)
    if not flag_of("force", force) and os.path.lexists(path):
        raise FileError(f"{path}: expected a new file, got one that exists; give another name, or force=True")
    writers: dict[str, Callable[[Any, dict[str, NDArray[Any]]], None]] = {
        **{
            name: partial(las.write, scale=steps, offset=start, compress=name == ".laz")  # tables that are theirs
            for name in _LAS
        },
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


def _triple(name: str, value: ArrayLike | None, ending: str) -> NDArray[np.float64] | None:
    """Check (3,) finite numbers, or one for all three, which LAS alone has."""
    if value is None:
        return None
    array = array_of(name, value)
    if ending not in _LAS:
        raise ArgumentError(f"{name}: expected none for {ending}, which holds numbers as they are, got some; drop it")
    if array.dtype.kind not in "fiu" or array.shape not in ((), (3,)) or not np.isfinite(array).all():
        raise ArgumentError(
            f"{name}: expected a finite number or three, got {array.dtype} of shape {array.shape}; pass x, y and z"
        )
    return np.broadcast_to(array.astype(np.float64), (3,)).copy()


def _columns(columns: Sequence[str]) -> list[str]:
    if isinstance(columns, (str, bytes)) or not isinstance(columns, Iterable):
        raise ArgumentTypeError(
            f'columns: expected a list of names, such as ["x", "y", "z", "intensity"], got {columns!r:.80}'
        )
    names = list(columns)
    if not all(isinstance(name, str) for name in names):
        raise ArgumentTypeError(f"columns: expected names, got {names!r:.200}")
    if len(set(names)) != len(names) or not {"x", "y", "z"} <= set(names):
        raise ArgumentError(f'columns: expected different names, among them "x", "y" and "z", got {names}')
    return names


def _cloud(
    path: Path,
    table: dict[str, NDArray[Any]],
    scale: NDArray[np.float64] | None = None,
    offset: NDArray[np.float64] | None = None,
) -> Cloud:
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
    return Cloud(points, table, scale, offset)


def _table(points: ArrayLike, values: Mapping[str, ArrayLike]) -> dict[str, NDArray[Any]]:
    """Columns by name, of the dtypes that files hold."""
    xyz = array_of("points", points)
    if xyz.dtype.kind not in "fiub":
        raise ArgumentTypeError(f"points: expected real numbers, got dtype {xyz.dtype}")
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        mend = "; give the other columns as values" if xyz.ndim == 2 else "; use points.reshape(-1, 3)"
        raise ArgumentError(f"points: expected shape (N, 3), got {xyz.shape}{mend}")
    if xyz.dtype != np.float32:
        xyz = xyz.astype(np.float64)
    if not isinstance(values, Mapping):
        got = type(values).__name__
        raise ArgumentTypeError(f"values: expected a mapping of names to arrays, got {got}; give {{name: array}}")
    table: dict[str, NDArray[Any]] = dict(zip("xyz", xyz.T, strict=True))
    for name, items in values.items():
        column = array_of(f"values[{name!r:.80}]", items)
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
