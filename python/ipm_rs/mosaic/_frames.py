"""The pictures of a frame, checked before anything is added."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import array_of, number_of
from ipm_rs._core import Camera
from ipm_rs.errors import ArgumentError, ArgumentTypeError, DtypeError, ImageError
from ipm_rs.rig import Rig
from ipm_rs.rig._cameras import check_names

__all__ = ["Again", "Picture", "Wanted", "again_of", "checked_pictures", "id_of"]


@dataclass(frozen=True)
class Picture:
    """A camera with the frame's mask, its name in the rig, and what it saw."""

    name: str
    camera: Camera
    image: NDArray[Any]


@dataclass(frozen=True)
class Wanted:
    """What the pictures of a map are like; None where the first one decides."""

    channels: int | None
    dtype: np.dtype[Any] | None
    labels: bool = False


@dataclass(frozen=True)
class Again:
    """A frame that is gone through again, with what `Mosaic.add` was told of its pictures."""

    camera: Any
    image: Any
    map_from_vehicle: Any
    mask: Any = None
    gain: Any = 1.0


def again_of(item: Any) -> Again:
    """Return a frame of a list: (camera, image, map_from_vehicle), and maybe a mapping with ``gain`` and ``mask``.

    Raises
    ------
    ArgumentTypeError, ArgumentError
    """
    wanted = "frames: expected (camera, image, map_from_vehicle), or a fourth item such as {'gain': 1.2, 'mask': mask}"
    if not isinstance(item, (tuple, list)) or len(item) not in (3, 4):
        got = f"{type(item).__name__} of {len(item)}" if isinstance(item, (tuple, list)) else type(item).__name__
        raise ArgumentTypeError(f"{wanted}, got {got}; give what `add` was given")
    options = item[3] if len(item) == 4 else {}
    if not isinstance(options, Mapping):
        raise ArgumentTypeError(f"{wanted}, got {type(options).__name__} as the fourth; give a mapping")
    try:
        options = dict(options)
        others = [str(key) for key in options if key not in ("gain", "mask")]
    except MemoryError:
        raise
    except Exception as error:  # a mapping of somebody else's raises what it likes
        raise ArgumentTypeError(f"{wanted}, got a mapping that cannot be read as the fourth; give a dict") from error
    if others:
        raise ArgumentError(
            f"frames: expected 'gain' and 'mask' of a frame, got {others[0]!r:.40} too; give `ground` and `distance` "
            "to `refine`, and leave out the rest"
        )
    return Again(*item[:3], **options)


def checked_pictures(
    camera: Any, image: Any, mask: Any, wanted: Wanted, gain: float | Mapping[str, float]
) -> list[Picture]:
    """Return the pictures of a frame, all of one dtype and as many channels.

    Raises
    ------
    ArgumentTypeError, ArgumentError, ImageError, DtypeError
    """
    if isinstance(camera, Camera):
        given = {"": (camera, image, mask)}
    elif isinstance(camera, Mapping):
        rig = camera if isinstance(camera, Rig) else Rig(camera)
        given = _of_rig(rig, image, mask)
    else:
        raise ArgumentTypeError(f"camera: expected an ipm_rs.Camera or Rig, got {type(camera).__name__}")
    gains = _gains_of(gain, list(given), wanted.labels)
    channels, dtype = wanted.channels, wanted.dtype
    pictures = []
    for key, (one, picture, shown) in given.items():
        name = f"image[{key!r}]" if key else "image"
        array = _image_of(name, picture, one)
        depth = 1 if array.ndim == 2 else array.shape[2]
        channels, dtype = channels or depth, dtype or array.dtype
        if array.dtype != dtype:
            raise DtypeError(f"{name}: expected {dtype}, as the map has, got {array.dtype}; convert it")
        if depth != channels:
            raise ImageError(f"{name}: expected {channels} channels, as the map has, got {depth}; convert it")
        pictures.append(Picture(key, one if shown is None else one.masked(shown), _brightened(array, gains[key])))
    return pictures


def id_of(name: str | None, picture: Picture, map_from_vehicle: NDArray[np.float64]) -> int:
    """Return what tells a picture from those of other frames: by the frame's name, else by what and where it is."""
    if name is not None:
        return zlib.crc32(f"{name}\0{picture.name}".encode("utf-8", "surrogatepass"))
    return zlib.crc32(picture.image.tobytes(), zlib.crc32(map_from_vehicle.tobytes()))


def _gains_of(gain: Any, names: list[str], labels: bool) -> dict[str, float]:
    each = gain if isinstance(gain, Mapping) else dict.fromkeys(names, gain)
    lacking = [name for name in names if name not in each]
    if lacking:
        where = f"camera {lacking[0]!r}" if lacking[0] else "one camera, a number"
        raise ArgumentError(f"gain: expected one for {where}, got none; give a number for all, or one for each picture")
    found = {name: number_of("gain", each[name], low=0.0, high=16.0 + 1e-9) for name in names}
    if labels and any(value != 1 for value in found.values()):
        raise ArgumentError("gain: expected 1 of labels, which have no brightness, got another number; leave it out")
    return found


def _of_rig(rig: Rig, images: Any, masks: Any) -> dict[str, tuple[Camera, Any, Any]]:
    if not isinstance(images, Mapping):
        raise ArgumentTypeError(f"image: expected a mapping of cameras to pictures, got {type(images).__name__}")
    check_names(rig, "image", images)
    if masks is not None and not isinstance(masks, Mapping):
        raise ArgumentTypeError(f"mask: expected a mapping of cameras to masks, got {type(masks).__name__}")
    check_names(rig, "mask", masks or ())
    shown = {} if masks is None else masks
    return {
        name: (camera, images[name], shown.get(name)) for name, camera in rig.items() if images.get(name) is not None
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
