"""Points onto a grid: count, highest and mean of a million points, beside NumPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ipm_rs
from adapters import OURS

COUNT = 1_000_000
X, Y, CELL = (0.0, 50.0), (-25.0, 25.0), 0.1
RASTERIZE = "rasterise a million points (count, max, mean) onto 500 x 500"


def rasterize() -> tuple[dict[str, Callable[[], Any]], Callable[[Any], tuple[float, float]]]:
    """Points of a KITTI-like cloud, (N, 4) float32, a tenth of them beyond the grid."""
    random = np.random.default_rng(9)
    points = np.empty((COUNT, 4), np.float32)
    points[:, 0], points[:, 1] = random.uniform(-2.5, 52.5, COUNT), random.uniform(-25, 25, COUNT)
    points[:, 2], points[:, 3] = random.normal(0, 1, COUNT), random.random(COUNT)
    grid = ipm_rs.BevGrid(x=X, y=Y, resolution=CELL)
    rows, columns = grid.shape
    cells = rows * columns

    def cell_and_height() -> tuple[NDArray[np.intp], NDArray[np.float32]]:
        row = np.floor((X[1] - points[:, 0].astype(np.float64)) / CELL)
        column = np.floor((Y[1] - points[:, 1].astype(np.float64)) / CELL)
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return (row[inside] * columns + column[inside]).astype(np.intp), points[inside, 2]

    def finish(count: NDArray[Any], highest: NDArray[Any], total: NDArray[Any]) -> dict[str, NDArray[Any]]:
        highest[count == 0] = np.nan
        with np.errstate(invalid="ignore"):
            mean = (total / count).astype(np.float32)
        named = {"count": count, "max": highest, "mean": mean}
        return {name: layer.reshape(rows, columns) for name, layer in named.items()}

    def by_ufunc() -> dict[str, NDArray[Any]]:
        cell, z = cell_and_height()
        highest = np.full(cells, -np.inf, np.float32)
        np.maximum.at(highest, cell, z)
        return finish(np.bincount(cell, minlength=cells), highest, np.bincount(cell, z, minlength=cells))

    def by_sorting() -> dict[str, NDArray[Any]]:
        cell, z = cell_and_height()
        order = np.argsort(cell, kind="stable")
        cell, z = cell[order], z[order]
        first = np.flatnonzero(np.diff(cell, prepend=-1))
        count, highest, total = np.zeros(cells, np.int64), np.full(cells, np.nan, np.float32), np.zeros(cells)
        there = cell[first]
        count[there] = np.diff(first, append=len(cell))
        highest[there], total[there] = np.maximum.reduceat(z, first), np.add.reduceat(z.astype(np.float64), first)
        return finish(count, highest, total)

    exact = by_ufunc()

    def wrong(layers: dict[str, NDArray[Any]]) -> tuple[float, float]:
        assert np.array_equal(layers["count"], exact["count"])
        assert np.array_equal(layers["max"], exact["max"], equal_nan=True)
        return float(np.nanmax(np.abs(layers["mean"] - exact["mean"]))), 1e-6

    calls: dict[str, Callable[[], Any]] = {
        OURS: lambda: ipm_rs.rasterize(points, grid),
        "NumPy, maximum.at and bincount": by_ufunc,
        "NumPy, sorted by cell": by_sorting,
    }
    return calls, wrong
