"""Backward warps by maps, and which cells see the image."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["remap_bilinear", "remap_cubic", "remap_lanczos4", "remap_nearest", "touches_image", "valid_mask"]


def valid_mask(map_x: ArrayLike, map_y: ArrayLike, source_size: tuple[int, int]) -> NDArray[np.bool_]:
    """Where coordinates lie in the rectangle of pixel centres ``[0, w - 1] x [0, h - 1]``.

    Parameters
    ----------
    map_x, map_y : array_like, equal shapes
        Pixel coordinates; NaN and infinite entries are not valid.
    source_size : (int, int)
        Width and height, pixels.

    Returns
    -------
    ndarray of the maps' shape, bool
    """
    map_x, map_y = np.asarray(map_x), np.asarray(map_y)
    width, height = source_size
    return (map_x >= 0) & (map_x <= width - 1) & (map_y >= 0) & (map_y <= height - 1)


def remap_nearest(
    image: ArrayLike, map_x: ArrayLike, map_y: ArrayLike, border_value: ArrayLike = 0
) -> NDArray[np.generic]:
    """Backward warp that copies the pixel whose centre is nearest: ``out = image[round(map_y), round(map_x)]``.

    Parameters
    ----------
    image : array_like, shape (H, W) or (H, W, C), any dtype
        Source.
    map_x, map_y : array_like, shape (rows, columns)
        Source pixel of every output cell.
    border_value : scalar or array_like, shape (C,)
        Result where the rounded pixel does not exist, or where a coordinate is NaN or infinite.

    Returns
    -------
    ndarray, shape (rows, columns) or (rows, columns, C), dtype of `image`

    Notes
    -----
    Rounding is ``np.round``: halves go to the even neighbour.
    """
    image = np.asarray(image)
    height, width = image.shape[:2]
    column = np.round(np.asarray(map_x, dtype=np.float64))
    row = np.round(np.asarray(map_y, dtype=np.float64))
    exists = valid_mask(column, row, (width, height))
    out = np.empty(exists.shape + image.shape[2:], dtype=image.dtype)
    out[...] = np.asarray(border_value, dtype=image.dtype)
    out[exists] = image[row[exists].astype(np.intp), column[exists].astype(np.intp)]
    return out


def remap_bilinear(
    image: ArrayLike, map_x: ArrayLike, map_y: ArrayLike, border_value: ArrayLike = 0
) -> NDArray[np.generic]:
    """Backward warp that blends the four surrounding pixels by distance.

    With ``x0 = floor(map_x)``, ``a = map_x - x0`` and the same for y and b:
    ``out = (1-a)(1-b) I[y0, x0] + a(1-b) I[y0, x0+1] + (1-a)b I[y0+1, x0] + ab I[y0+1, x0+1]``.

    Parameters
    ----------
    image : array_like, shape (H, W) or (H, W, C), integer or float
        Source.
    map_x, map_y : array_like, shape (rows, columns)
        Source pixel of every output cell.
    border_value : scalar or array_like, shape (C,)
        Stands in for pixels that do not exist, so cells less than one pixel outside the image (the halo) blend with
        it; the result of cells further away, and where a coordinate is NaN or infinite.

    Returns
    -------
    ndarray, shape (rows, columns) or (rows, columns, C), dtype of `image`
        The exact float64 sum, rounded once: integers to nearest with halves up, floats to their dtype.

    Notes
    -----
    A pixel of weight zero takes no part, so a NaN beside or beyond the sampled place does not leak into it. (The core,
    as OpenCV, spares a cell only the NaN of `border_value`; a NaN pixel reaches every cell that it surrounds.)
    """
    image = np.asarray(image)
    height, width = image.shape[:2]
    x = np.asarray(map_x, dtype=np.float64)
    y = np.asarray(map_y, dtype=np.float64)
    touches = touches_image(x, y, (width, height))
    # Cells that see nothing of the image are parked beyond its corner, where all four pixels are border_value.
    x, y = np.where(touches, x, -2.0), np.where(touches, y, -2.0)
    x0, y0 = np.floor(x), np.floor(y)
    a, b = x - x0, y - y0
    total = np.zeros(x.shape + image.shape[2:], dtype=np.float64)
    for dx, dy, weight in (
        (0, 0, (1 - a) * (1 - b)),
        (1, 0, a * (1 - b)),
        (0, 1, (1 - a) * b),
        (1, 1, a * b),
    ):
        pixel = remap_nearest(image, x0 + dx, y0 + dy, border_value).astype(np.float64)
        weight = weight.reshape(weight.shape + (1,) * (image.ndim - 2))
        with np.errstate(invalid="ignore"):
            total += np.where(weight > 0, weight * pixel, 0.0)
    if np.issubdtype(image.dtype, np.integer):
        total = np.floor(total + 0.5)
    return total.astype(image.dtype)


def remap_cubic(
    image: ArrayLike, map_x: ArrayLike, map_y: ArrayLike, border_value: ArrayLike = 0
) -> NDArray[np.generic]:
    """Backward warp by bicubic convolution of the 4 x 4 surrounding pixels, as ``cv2.INTER_CUBIC``.

    The weight of a pixel at distance d along each axis is ``(a + 2) d^3 - (a + 3) d^2 + 1`` up to 1 and
    ``a d^3 - 5a d^2 + 8a d - 4a`` up to 2, with a = -0.75 (Keys, Cubic convolution interpolation for digital image
    processing, 1981).

    Parameters
    ----------
    image : array_like, shape (H, W) or (H, W, C), integer or float
        Source.
    map_x, map_y : array_like, shape (rows, columns)
        Source pixel of every output cell.
    border_value : scalar or array_like, shape (C,)
        Stands in for pixels that do not exist, and is the result where a coordinate is NaN or infinite.

    Returns
    -------
    ndarray, shape (rows, columns) or (rows, columns, C), dtype of `image`
        The exact float64 sum, rounded once: integers to nearest with halves up, then brought into their range, because
        the weights beside the middle are negative.
    """

    def weight(distance: NDArray[np.float64]) -> NDArray[np.float64]:
        a, d = -0.75, np.abs(distance)
        near = (a + 2) * d**3 - (a + 3) * d**2 + 1
        return np.where(d <= 1, near, np.where(d < 2, a * d**3 - 5 * a * d**2 + 8 * a * d - 4 * a, 0.0))

    return _convolved(image, map_x, map_y, border_value, weight, 2)


def remap_lanczos4(
    image: ArrayLike, map_x: ArrayLike, map_y: ArrayLike, border_value: ArrayLike = 0
) -> NDArray[np.generic]:
    """Backward warp by Lanczos' windowed sinc over the 8 x 8 surrounding pixels, as ``cv2.INTER_LANCZOS4``.

    The weight of a pixel at distance d along each axis is ``sinc(d) sinc(d / 4)``, the eight brought to a sum of 1.
    Arguments and result as those of :func:`remap_cubic`.
    """

    def weight(distance: NDArray[np.float64]) -> NDArray[np.float64]:
        weights = np.sinc(distance) * np.sinc(distance / 4)
        # sinc of whole numbers is 0, but for the rounding of pi
        return np.where(distance == np.round(distance), (distance == 0).astype(np.float64), weights)

    return _convolved(image, map_x, map_y, border_value, weight, 4)


def _convolved(
    image: ArrayLike,
    map_x: ArrayLike,
    map_y: ArrayLike,
    border_value: ArrayLike,
    weight: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    side: int,
) -> NDArray[np.generic]:
    """Sum ``2 side x 2 side`` pixels by the weights of their distances, brought to a sum of 1 along each axis."""
    image = np.asarray(image)
    x, y = np.asarray(map_x, dtype=np.float64), np.asarray(map_y, dtype=np.float64)
    somewhere = np.isfinite(x) & np.isfinite(y)
    # Cells that see nothing of the image are parked beyond its corner, where all pixels are border_value.
    x, y = np.where(somewhere, x, -2.0 * side), np.where(somewhere, y, -2.0 * side)
    offsets = np.arange(1 - side, side + 1)
    x0, y0 = np.floor(x), np.floor(y)
    across = np.stack([weight(x - (x0 + offset)) for offset in offsets])
    down = np.stack([weight(y - (y0 + offset)) for offset in offsets])
    across, down = across / across.sum(0), down / down.sum(0)
    total = np.zeros(x.shape + image.shape[2:], dtype=np.float64)
    for dy, b in zip(offsets, down, strict=True):
        for dx, a in zip(offsets, across, strict=True):
            pixel = remap_nearest(image, x0 + dx, y0 + dy, border_value).astype(np.float64)
            both = (a * b).reshape(x.shape + (1,) * (image.ndim - 2))
            with np.errstate(invalid="ignore"):
                total += np.where(both != 0, both * pixel, 0.0)
    if np.issubdtype(image.dtype, np.integer):
        limits = np.iinfo(image.dtype)
        total = np.clip(np.floor(total + 0.5), limits.min, limits.max)
    return total.astype(image.dtype)


def touches_image(x: NDArray[np.float64], y: NDArray[np.float64], source_size: tuple[int, int]) -> NDArray[np.bool_]:
    """Tell which cells are valid or halo: less than one pixel outside the rectangle of pixel centres."""
    width, height = source_size
    return (x > -1) & (x < width) & (y > -1) & (y < height)
