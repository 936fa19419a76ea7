"""Metric grids on the ground: their shape, where their cells sample, and where the cells' corners are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["grid_corners", "grid_shape", "grid_xy"]


def grid_shape(
    x: tuple[float, float], y: tuple[float, float], resolution: float | tuple[float, float]
) -> tuple[int, int]:
    """Rows and columns of a metric grid.

    Parameters
    ----------
    x, y : (float, float)
        Range ahead and to the left, metres, lower end first.
    resolution : float or (float, float)
        Cell size along x and along y, metres; one number serves both.

    Returns
    -------
    (int, int)
        ``(rows, columns)``: 43 m in cells of 0.05 m are 860 rows.

    Raises
    ------
    ValueError
        If a range is not a whole number of cells to 1e-6 of a cell.
    """
    dx, dy = np.broadcast_to(np.asarray(resolution, dtype=np.float64), 2)
    cells = np.array([(x[1] - x[0]) / dx, (y[1] - y[0]) / dy])
    whole = np.round(cells)
    if not np.all(np.abs(cells - whole) <= 1e-6) or not np.all(whole >= 1):
        raise ValueError(f"expected ranges of whole cells, got {cells[0]:.9g} x {cells[1]:.9g} cells")
    return int(whole[0]), int(whole[1])


def grid_xy(
    x: tuple[float, float],
    y: tuple[float, float],
    resolution: float | tuple[float, float],
    sample_at: str = "center",
) -> NDArray[np.float64]:
    """Ground position of every cell's sample; row 0 is farthest ahead, column 0 leftmost.

    Parameters
    ----------
    x, y : (float, float)
        Range ahead and to the left, metres, lower end first.
    resolution : float or (float, float)
        Cell size along x and along y, metres.
    sample_at : {"center", "corner"}
        ``"corner"`` samples the far left corner of each cell: ``X_i = x_max - i dx``, ``Y_j = y_max - j dy``.
        ``"center"`` samples half a cell nearer and further right.

    Returns
    -------
    ndarray, shape (rows, columns, 2), float64
        X and Y in the vehicle frame, metres.
    """
    dx, dy = np.broadcast_to(np.asarray(resolution, dtype=np.float64), 2)
    rows, columns = grid_shape(x, y, resolution)
    offset = {"center": 0.5, "corner": 0.0}[sample_at]
    ahead = x[1] - dx * (np.arange(rows) + offset)
    left = y[1] - dy * (np.arange(columns) + offset)
    return np.stack(np.meshgrid(ahead, left, indexing="ij"), axis=-1)


def grid_corners(
    x: tuple[float, float],
    y: tuple[float, float],
    resolution: float | tuple[float, float],
    sample_at: str = "center",
) -> NDArray[np.float64]:
    """Ground position of the corners of all cells: half a cell around their samples.

    Parameters
    ----------
    x, y : (float, float)
        Range ahead and to the left, metres, lower end first.
    resolution : float or (float, float)
        Cell size along x and along y, metres.
    sample_at : {"center", "corner"}
        Where cells are sampled, as for :func:`grid_xy`. Around corner samples the cells lie half a cell further away
        and further left than the ranges say.

    Returns
    -------
    ndarray, shape (rows + 1, columns + 1, 2), float64
        X and Y in the vehicle frame, metres. The cell (i, j) lies between the corners (i, j) and (i + 1, j + 1).
    """
    dx, dy = np.broadcast_to(np.asarray(resolution, dtype=np.float64), 2)
    rows, columns = grid_shape(x, y, resolution)
    offset = {"center": 0.0, "corner": -0.5}[sample_at]
    ahead = x[1] - dx * (np.arange(rows + 1) + offset)
    left = y[1] - dy * (np.arange(columns + 1) + offset)
    return np.stack(np.meshgrid(ahead, left, indexing="ij"), axis=-1)
