"""Pictures as the refinements look at them: grey, and halved again and again."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import array_of
from ipm_rs._core import Camera, remap
from ipm_rs.errors import DtypeError, ImageError

__all__ = ["Pyramid", "grey_of"]

Picture = NDArray[np.float32]

_WIDEST = 1400
"""Pixels of the finest level's width: of wider pictures halves are looked at, for a road's grain tells no more."""
_NARROWEST = 100
_BESIDE = np.array([[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]])


def grey_of(name: str, image: Any, camera: Camera) -> Picture:
    """Return a picture as (H, W) float32, the mean of its channels.

    Raises
    ------
    ImageError, DtypeError, ArgumentTypeError
        It is no picture, not of the camera's size, or not finite.
    """
    array = array_of(name, image)
    if array.dtype.kind not in "uif" or array.dtype.itemsize > 8:
        raise DtypeError(f"{name}: expected a picture of numbers, got {array.dtype}; pass uint8, uint16 or floats")
    if array.ndim == 3 and array.shape[2] in (3, 4):
        array = array[..., :3]
    elif array.ndim == 3 and array.shape[2] == 1:
        array = array[..., 0]
    width, height = camera.image_size
    if array.shape[:2] != (height, width) or array.ndim not in (2, 3):
        raise ImageError(
            f"{name}: expected a picture of {width}x{height}, (H, W) or (H, W, 3), as the camera's, got shape "
            f"{array.shape}; use camera.resized() or camera.cropped() for pictures of another size"
        )
    with np.errstate(all="ignore"):
        grey = array.astype(np.float32) if array.ndim == 2 else array.mean(axis=2, dtype=np.float32)
    if not np.isfinite(grey).all():
        raise ImageError(f"{name}: expected finite numbers, got NaN or infinity; fill them in")
    return grey


class Pyramid:
    """A picture and its halves, as they are; those finer than `first` are not kept.

    They are not smoothed: what a pixel then shows lies, in perspective, mostly beyond its own place on the road, the
    farther the more. Weights 1 2 1 put the roll off by 0.03 degrees, which plain pixels tell within 0.003.
    """

    def __init__(self, grey: Picture) -> None:
        self.first = 0
        while grey.shape[1] > _WIDEST:
            grey = _halved(grey)
            self.first += 1
        self._levels = [grey]
        while min(self._levels[-1].shape) > _NARROWEST:
            self._levels.append(_halved(self._levels[-1]))

    @property
    def levels(self) -> range:
        """The numbers of the levels, the finest first."""
        return range(self.first, self.first + len(self._levels))

    def picture(self, level: int) -> Picture:
        """Return a level."""
        return self._levels[level - self.first]

    def sample_with_slopes(
        self, level: int, pixels: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the brightness of a level at pixels (N, 2) of the whole picture, NaN outside, and its slopes (N, 2).

        They are along x and y, a pixel of the level wide.
        """
        if not len(pixels):
            return np.zeros(0), np.zeros((0, 2))
        picture, scale = self.picture(level), 0.5**level
        x, y = (pixels[:, k] * scale + (0.5 * scale - 0.5) for k in (0, 1))
        inside = (x >= 0.5) & (y >= 0.5) & (x <= picture.shape[1] - 1.5) & (y <= picture.shape[0] - 1.5)
        maps = x + _BESIDE[:, :1], y + _BESIDE[:, 1:]
        values = remap(picture, *maps, border_mode="replicate", threads=1).astype(np.float64)
        slopes = np.stack([values[1] - values[2], values[3] - values[4]], -1) * scale
        return np.where(inside, values[0], np.nan), np.where(inside[:, None], slopes, np.nan)


def _halved(picture: Picture) -> Picture:
    """Mean of each 2 x 2 pixels; a last odd row or column is left out."""
    rows, columns = picture.shape[0] // 2 * 2, picture.shape[1] // 2 * 2
    whole = picture[:rows, :columns]
    halved = whole[::2, ::2] + whole[1::2, ::2] + whole[::2, 1::2] + whole[1::2, 1::2]
    halved *= np.float32(0.25)
    return halved
