"""The pictures of a frame, checked before anything is added."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import array_of
from ipm_rs._core import Camera
from ipm_rs.errors import ArgumentTypeError, DtypeError, ImageError
from ipm_rs.rig import Rig
from ipm_rs.rig._cameras import check_names

__all__ = ["Picture", "checked_pictures"]


@dataclass(frozen=True)
class Picture:
    """A camera with the frame's mask, and what it saw."""

    camera: Camera
    image: NDArray[Any]


def checked_pictures(
    camera: Any, image: Any, mask: Any, channels: int | None, dtype: np.dtype[Any] | None, gain: float
) -> list[Picture]:
    """Return the pictures of a frame, all of one dtype and as many channels.

    Raises
    ------
    ArgumentTypeError, ArgumentError, ImageError, DtypeError
    """
    if isinstance(camera, Camera):
        given = {"image": (camera, image, mask)}
    elif isinstance(camera, Mapping):
        rig = camera if isinstance(camera, Rig) else Rig(camera)
        given = _of_rig(rig, image, mask)
    else:
        raise ArgumentTypeError(f"camera: expected an ipm_rs.Camera or Rig, got {type(camera).__name__}")
    pictures = []
    for name, (one, picture, shown) in given.items():
        array = _image_of(name, picture, one)
        depth = 1 if array.ndim == 2 else array.shape[2]
        channels, dtype = channels or depth, dtype or array.dtype
        if array.dtype != dtype:
            raise DtypeError(f"{name}: expected {dtype}, as the map has, got {array.dtype}; convert it")
        if depth != channels:
            raise ImageError(f"{name}: expected {channels} channels, as the map has, got {depth}; convert it")
        pictures.append(Picture(one if shown is None else one.masked(shown), _brightened(array, gain)))
    return pictures


def _of_rig(rig: Rig, images: Any, masks: Any) -> dict[str, tuple[Camera, Any, Any]]:
    if not isinstance(images, Mapping):
        raise ArgumentTypeError(f"image: expected a mapping of cameras to pictures, got {type(images).__name__}")
    check_names(rig, "image", images)
    if masks is not None and not isinstance(masks, Mapping):
        raise ArgumentTypeError(f"mask: expected a mapping of cameras to masks, got {type(masks).__name__}")
    check_names(rig, "mask", masks or ())
    shown = {} if masks is None else masks
    return {
        f"image[{name!r}]": (camera, images[name], shown.get(name))
        for name, camera in rig.items()
        if images.get(name) is not None
    }


def _image_of(name: str, value: Any, camera: Camera) -> NDArray[Any]:
    array = array_of(name, value)
    if array.dtype not in (np.uint8, np.uint16):
        raise DtypeError(f"{name}: expected uint8 or uint16, got {array.dtype}; scale it to one of them")
    width, height = camera.image_size
    if array.ndim not in (2, 3) or array.shape[:2] != (height, width):
        raise ImageError(
            f"{name}: expected shape ({height}, {width}) or ({height}, {width}, C), as its camera has, got "
            f"{array.shape}"
        )
    if array.ndim == 3 and not 1 <= array.shape[2] <= 16:
        raise ImageError(f"{name}: expected 1 to 16 channels, got {array.shape[2]}")
    inner = array.strides[1:] != array.itemsize * np.cumprod([1, *array.shape[:1:-1]])[::-1]
    return np.ascontiguousarray(array) if np.any(inner) else array


def _brightened(image: NDArray[Any], gain: float) -> NDArray[Any]:
    if gain == 1.0:
        return image
    most = np.iinfo(image.dtype).max
    table = np.minimum(np.rint(np.arange(most + 1) * gain), most).astype(image.dtype)
    brightened: NDArray[Any] = table[image]
    return brightened
