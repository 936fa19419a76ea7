"""Points, boxes and polygons onto a grid, in plain NumPy: the oracle of `ipm_rs.rasterize` and its kin.

See :mod:`ipm_rs.reference` for what holds here too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["rasterize"]


def rasterize(
    points: ArrayLike,
    x_range: tuple[float, float],
    y_range: tuple[float, float],
    resolution: float | tuple[float, float],
    values: ArrayLike | None = None,
    reduce: Sequence[str] = ("count", "max", "mean"),
    slices: Sequence[float] | None = None,
    density_full: float = 64.0,
) -> dict[str, NDArray[Any]]:
    """Collect points in the cells of a grid.

    The cell of a point is ``row = floor((x_max - x) / dx)``, ``column = floor((y_max - y) / dy)``; points at x_max and
    y_max are in, points at x_min and y_min are out.

    Parameters
    ----------
    points : array_like, shape (N, 2), (N, 3) or wider
        x, y, z in metres; a point with a coordinate that is not finite is ignored.
    x_range, y_range : (float, float)
        (min, max) of the grid, metres, whole numbers of cells.
    resolution : float or (float, float)
        Cell size along x and y, metres.
    values : array_like, shape (N,) or (N, C), optional
        What is collected instead of z; a point with a value that is not finite is ignored.
    reduce : sequence of str
        Names among count, density, min, max, mean, last, top.
    slices : sequence of float, optional
        Edges of height slices; slice s takes ``slices[s] <= z < slices[s + 1]``.
    density_full : float
        The count plus one at which the density is 1.

    Returns
    -------
    dict of str to ndarray
        (rows, columns) each, with an axis of the slices in front if there are any, and one of the channels behind
        if the values have one. Empty cells are 0 in count and density, NaN in the others.
    """
    points = np.asarray(points)
    dx, dy = np.broadcast_to(np.asarray(resolution, dtype=np.float64), 2)
    rows, columns = round((x_range[1] - x_range[0]) / dx), round((y_range[1] - y_range[0]) / dy)
    edges = np.array([-np.inf, np.inf] if slices is None else slices, dtype=np.float64)
    layers = len(edges) - 1

    xyz = points[:, :3].astype(np.float64)
    held = points[:, 2] if values is None else np.asarray(values)
    channels = held[:, np.newaxis] if held.ndim == 1 else held
    if not np.issubdtype(channels.dtype, np.floating):
        channels = channels.astype(np.float32 if channels.dtype.itemsize <= 2 else np.float64)
    z = xyz[:, 2] if xyz.shape[1] > 2 else np.zeros(len(xyz))
    with np.errstate(invalid="ignore", over="ignore"):
        row, column = np.floor((x_range[1] - xyz[:, 0]) / dx), np.floor((y_range[1] - xyz[:, 1]) / dy)
    layer = np.searchsorted(edges, z, side="right") - 1
    inside = np.isfinite(xyz).all(axis=1) & np.isfinite(channels).all(axis=1)
    inside &= (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    inside &= (xyz[:, 0] > x_range[0]) & (xyz[:, 1] > y_range[0]) & (layer >= 0) & (layer < layers)

    cells = layers * rows * columns
    cell = ((layer[inside] * rows + row[inside]) * columns + column[inside]).astype(np.intp)
    channels, height = channels[inside], z[inside]
    count = np.bincount(cell, minlength=cells)
    shape = (rows, columns) if slices is None else (layers, rows, columns)
    result: dict[str, NDArray[Any]] = {}
    for name in reduce:
        if name == "count":
            result[name] = count.astype(np.int32).reshape(shape)
        elif name == "density":
            result[name] = np.minimum(np.log(count + 1) / np.log(density_full), 1).astype(np.float32).reshape(shape)
        else:
            each = [_collect(name, cell, channel, height, count) for channel in channels.T]
            result[name] = np.stack(each, axis=-1).reshape(shape + held.shape[1:])
    return result


def _collect(
    name: str, cell: NDArray[np.intp], values: NDArray[Any], height: NDArray[np.float64], count: NDArray[np.intp]
) -> NDArray[Any]:
    """Collect one channel; `cell` says where each value goes."""
    out = np.full(len(count), np.nan, dtype=values.dtype)
    if name == "mean":
        sums = np.bincount(cell, weights=values.astype(np.float64), minlength=len(count)).astype(np.float64)
        np.divide(sums, count, out=sums, where=count > 0)
        out[count > 0] = sums[count > 0]
    elif name == "last":
        for index, value in zip(cell, values, strict=True):
            out[index] = value
    elif name == "top":
        best: dict[int, float] = {}
        for index, value, z in zip(cell.tolist(), values, height.tolist(), strict=True):
            if index not in best or z > best[index]:
                best[index], out[index] = z, value
    else:
        start, extreme = {"min": (np.inf, np.minimum), "max": (-np.inf, np.maximum)}[name]
        found = np.full(len(count), start, dtype=values.dtype)
        extreme.at(found, cell, values)
        out[count > 0] = found[count > 0]
    return out
