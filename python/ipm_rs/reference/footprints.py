"""What a cell covers of the image, and the warps that look at all of it: the mean (`area`), the majority (`mode`).

A pixel is a square of one value, as wide as the distance between pixel centres: (0, 0) reaches from -0.5 to 0.5. The
footprint of a cell is the quadrilateral of its four corners on the image. `area` is the mean of the squares over the
footprint, each weighted by the area that the footprint covers of it; this is what ``cv2.INTER_AREA`` computes for
upright footprints. Of a footprint of exactly one pixel it is bilinear interpolation: the weights are the products of
the fractions. That is why footprints are never taken to be smaller than a pixel.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .warps import remap_bilinear, remap_nearest, valid_mask

__all__ = ["covered_area", "footprints", "remap_area", "remap_mode"]


def footprints(corner_x: ArrayLike, corner_y: ArrayLike) -> NDArray[np.float64]:
    """Footprints of cells out of the pixels where their corners are seen.

    A footprint whose sides are shorter than a pixel is widened to one pixel, about its middle.

    Parameters
    ----------
    corner_x, corner_y : array_like, shape (rows + 1, columns + 1)
        Source pixel of every corner, as :func:`project` gives it for :func:`grid_corners`.

    Returns
    -------
    ndarray, shape (rows, columns, 4, 2), float64
        Corners of each footprint in order around it, pixels. NaN where a corner is not seen.
    """
    at = np.stack([np.asarray(corner_x, dtype=np.float64), np.asarray(corner_y, dtype=np.float64)], axis=-1)
    around = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-2)
    first, second, third, fourth = np.moveaxis(around, -2, 0)
    along = (second + third - first - fourth) / 2
    down = (third + fourth - first - second) / 2
    lengths = [np.linalg.norm(side, axis=-1, keepdims=True) for side in (along, down)]
    # a side without a length has no direction either, and gets that of its axis
    with np.errstate(divide="ignore", invalid="ignore"):
        along, down = (
            np.where(length > 0, side * np.maximum(1, 1 / length), axis)
            for side, length, axis in zip((along, down), lengths, np.eye(2), strict=True)
        )
    middle = around.mean(axis=-2)
    widened = np.stack([middle + (i * along + j * down) / 2 for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))], axis=-2)
    is_narrow = (lengths[0] < 1) | (lengths[1] < 1)
    return np.where(is_narrow[..., np.newaxis], widened, around)


def covered_area(polygon: ArrayLike, columns: tuple[int, int], rows: tuple[int, int]) -> NDArray[np.float64]:
    """Area that a polygon covers of each pixel.

    The area of the polygon left of X and above Y is the sum over its edges of the integral of min(y, Y) along x, up to
    X (Green's theorem); the area in a pixel is the difference of that at the pixel's four corners.

    Parameters
    ----------
    polygon : array_like, shape (M, 2)
        Corners x, y in order around it, pixels. It must not cross itself.
    columns, rows : (int, int)
        First pixel, and the one behind the last.

    Returns
    -------
    ndarray, shape (rows[1] - rows[0], columns[1] - columns[0]), float64
        In pixels: 1 where a pixel is covered wholly.
    """
    corners = np.asarray(polygon, dtype=np.float64)
    right = np.arange(columns[0], columns[1] + 1)[np.newaxis, :] - 0.5
    bottom = np.arange(rows[0], rows[1] + 1)[:, np.newaxis] - 0.5
    total = np.zeros((bottom.size, right.size))
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if x0 == x1:
            continue  # nothing lies below a vertical edge
        begin, end = min(x0, x1), np.clip(right, min(x0, x1), max(x0, x1))
        slope = (y1 - y0) / (x1 - x0)
        ends = (y0 + slope * (begin - x0), y0 + slope * (end - x0))
        low, high = np.minimum(*ends), np.maximum(*ends)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = bottom - (bottom - low) ** 2 / (2 * (high - low))
        mean = np.where(high <= bottom, (low + high) / 2, np.where(low >= bottom, bottom, crossing))
        total += np.sign(x1 - x0) * (end - begin) * mean
    area: NDArray[np.float64] = np.abs(np.diff(np.diff(total, axis=0), axis=1))
    return area


def remap_area(
    image: ArrayLike, map_x: ArrayLike, map_y: ArrayLike, footprints: ArrayLike, border_value: ArrayLike = 0
) -> NDArray[np.generic]:
    """Backward warp to the mean of each footprint.

    Parameters
    ----------
    image : array_like, shape (H, W) or (H, W, C), integer or float
        Source.
    map_x, map_y : array_like, shape (rows, columns)
        Source pixel of every cell: where it lies within the rectangle of pixel centres the cell is valid.
    footprints : array_like, shape (rows, columns, 4, 2)
        As :func:`footprints` gives them. What lies outside the image takes no part.
    border_value : scalar or array_like, shape (C,)
        For cells that are not valid: they are those of :func:`remap_bilinear`.

    Returns
    -------
    ndarray, shape (rows, columns) or (rows, columns, C), dtype of `image`
        The exact float64 mean, rounded once: integers to nearest with halves up, floats to their dtype.
    """
    image = np.asarray(image)
    out = remap_bilinear(image, map_x, map_y, border_value)
    for cell, weights, pixels in _seen(image, map_x, map_y, footprints):
        mean = np.tensordot(weights, pixels.astype(np.float64), 2) / weights.sum()
        out[cell] = np.floor(mean + 0.5) if np.issubdtype(image.dtype, np.integer) else mean
    return out


def remap_mode(
    labels: ArrayLike, map_x: ArrayLike, map_y: ArrayLike, footprints: ArrayLike, border_value: ArrayLike = 0
) -> NDArray[np.generic]:
    """Backward warp to the id that covers most of each footprint; of equal ones the smallest, channel by channel.

    Parameters
    ----------
    labels : array_like, shape (H, W) or (H, W, C), integer or bool
        Source.
    map_x, map_y : array_like, shape (rows, columns)
        Source pixel of every cell: where it lies within the rectangle of pixel centres the cell is valid.
    footprints : array_like, shape (rows, columns, 4, 2)
        As :func:`footprints` gives them. What lies outside the image takes no part.
    border_value : scalar or array_like, shape (C,)
        For cells that are not valid: they are those of :func:`remap_nearest`.

    Returns
    -------
    ndarray, shape (rows, columns) or (rows, columns, C), dtype of `labels`
    """
    labels = np.asarray(labels)
    out = remap_nearest(labels, map_x, map_y, border_value)
    for cell, weights, pixels in _seen(labels, map_x, map_y, footprints):
        for channel in np.ndindex(labels.shape[2:]):
            ids, places = np.unique(pixels[(..., *channel)], return_inverse=True)
            # areas that are equal differ by their rounding
            covered = np.round(np.bincount(places.ravel(), weights.ravel()), 9)
            out[(*cell, *channel)] = ids[np.argmax(covered)]
    return out


def _seen(
    image: NDArray[np.generic], map_x: ArrayLike, map_y: ArrayLike, footprints: ArrayLike
) -> Iterator[tuple[tuple[int, int], NDArray[np.float64], NDArray[np.generic]]]:
    """Yield the valid cells whose footprint is known, with the pixels around it and the area that it covers of each."""
    height, width = image.shape[:2]
    polygons = np.asarray(footprints, dtype=np.float64)
    known = valid_mask(map_x, map_y, (width, height)) & np.isfinite(polygons).all(axis=(-2, -1))
    for i, j in zip(*np.nonzero(known), strict=True):
        low = np.clip(np.floor(polygons[i, j].min(axis=0) + 0.5), 0, (width - 1, height - 1)).astype(int)
        high = np.clip(np.ceil(polygons[i, j].max(axis=0) + 0.5), low + 1, (width, height)).astype(int)
        weights = covered_area(polygons[i, j], (low[0], high[0]), (low[1], high[1]))
        if weights.any():
            yield (int(i), int(j)), weights, image[low[1] : high[1], low[0] : high[0]]
