"""Arrays of any kind as pictures that Pillow can draw on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ipm_rs._arguments import array_of
from ipm_rs.errors import DtypeError, ImageError
from ipm_rs.files.images import require_pillow

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.Image import Image

__all__ = ["rgb_of", "to_image"]

_DARKEST, _BRIGHTEST = 1.0, 99.0  # percentiles: a few hot pixels must not make all others black


def to_image(pixels: ArrayLike | Image) -> Image:
    """Return an array as a picture to look at, RGB of 8 bits.

    uint8 is taken as it is and bool as black and white. Other numbers, 16-bit images, depths, counts, are stretched:
    their 1st and 99th percentile become black and white, and NaN black.

    Parameters
    ----------
    pixels : (H, W) or (H, W, C) array_like, or PIL.Image.Image
        One channel is grey, three are colour, a second or fourth (alpha) is left out; of any other number the mean of
        all is shown.

    Returns
    -------
    PIL.Image.Image
        RGB, W x H pixels, which shares no memory with the array.

    Raises
    ------
    ImageError
        The shape is another, or there is no pixel.
    DtypeError, ArgumentTypeError, ArgumentError
        It is no array of numbers.
    MissingExtraError
        Pillow is not installed.
    """
    Image = require_pillow()
    return Image.fromarray(rgb_of("pixels", pixels))


def rgb_of(name: str, pixels: ArrayLike | Image) -> NDArray[np.uint8]:
    """Return an array or a picture as a new (H, W, 3) array of uint8; the errors call it by its name."""
    Image = require_pillow()
    if isinstance(pixels, Image.Image):
        return np.array(pixels.convert("RGB"))
    array = array_of(name, pixels)
    if array.dtype.kind not in "buif":
        raise DtypeError(f"{name}: expected an image of numbers, got {array.dtype}; pass uint8, uint16 or float32")
    if array.ndim not in (2, 3) or 0 in array.shape:
        raise ImageError(f"{name}: expected shape (H, W) or (H, W, C) with at least one pixel, got {array.shape}")
    planes = array[..., None] if array.ndim == 2 else array
    channels = planes.shape[2]
    if channels in (3, 4):
        return _to_bytes(planes[..., :3])
    if channels > 4:
        planes = planes.mean(axis=2, keepdims=True, dtype=np.float64)
    return np.repeat(_to_bytes(planes[..., :1]), 3, axis=2)


def _to_bytes(values: NDArray[Any]) -> NDArray[np.uint8]:
    if values.dtype == np.uint8:
        return values.copy()
    if values.dtype == np.bool_:
        return np.where(values, np.uint8(255), np.uint8(0))
    numbers = values.astype(np.float64)
    known = np.isfinite(numbers)
    if not known.any():
        return np.zeros(numbers.shape, np.uint8)
    # beyond 1e150 the difference of two might be no number any more
    numbers = np.where(known, numbers, 0.0).clip(-1e150, 1e150)
    low, high = np.percentile(numbers[known], (_DARKEST, _BRIGHTEST))
    if not high > low:
        low, high = numbers[known].min(), numbers[known].max()
    levels = 255 * ((numbers - low) / (high - low if high > low else 1.0)).clip(0, 1)
    return np.asarray(np.where(known, np.rint(levels), 0), np.uint8)
