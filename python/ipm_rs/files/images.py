"""Image files of the command line: read without loss or guesses, written whole or not at all.

Pillow (extra ``cli``) does the decoding and is imported when first needed. A file's Pillow mode decides what a warp
sees:

========  =======================  ==========================================================================
mode      array                    remarks
========  =======================  ==========================================================================
L, LA     (H, W), (H, W, 2) uint8  grey, grey with alpha
RGB(A)    (H, W, 3 or 4) uint8     alpha is a channel like the others
I;16      (H, W) uint16            16-bit grey, kept as 16 bits
F         (H, W) float32           TIFF only
P         (H, W) uint8             the palette's indices, for label images: nearest only, the palette is kept
1         (H, W) bool              nearest only
========  =======================  ==========================================================================

Others (CMYK, LAB, HSV, 32-bit integers, 16 bits per colour channel, of which Pillow would drop 8) are refused.
The stored pixels are taken as they are: EXIF orientation is not applied, since a calibration belongs to the sensor.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ipm_rs.errors import ArgumentError, FileError, ImageError, MissingExtraError
from ipm_rs.files.atomic import atomically, check_source, reading

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.Image import Image
    from PIL.ImageFile import ImageFile

MODES = {
    "1": (np.bool_, ()),
    "L": (np.uint8, ()),
    "LA": (np.uint8, (2,)),
    "P": (np.uint8, ()),
    "RGB": (np.uint8, (3,)),
    "RGBA": (np.uint8, (4,)),
    "I;16": (np.uint16, ()),
    "F": (np.float32, ()),
}
"""Dtype and channel axis of each mode that is read and written."""

_LOSSLESS = {"1", "L", "P", "RGB"}
FORMATS = {
    ".png": ("PNG", _LOSSLESS | {"LA", "RGBA", "I;16"}),
    ".tif": ("TIFF", _LOSSLESS | {"LA", "RGBA", "I;16", "F"}),
    ".tiff": ("TIFF", _LOSSLESS | {"LA", "RGBA", "I;16", "F"}),
    ".bmp": ("BMP", _LOSSLESS),
    ".jpg": ("JPEG", {"L", "RGB"}),
    ".jpeg": ("JPEG", {"L", "RGB"}),
}
"""Pillow's format name for each output extension, and the modes it holds."""

_ORIENTATION = 0x0112


@dataclass(frozen=True)
class Header:
    """What is known of an image file before it is decoded; ``size`` is (width, height)."""

    path: Path
    size: tuple[int, int]
    mode: str
    orientation: int
    frames: int

    def blank(self) -> NDArray[Any]:
        """One black pixel with the dtype and the channels of the image."""
        dtype, channels = MODES[self.mode]
        return np.zeros((1, 1, *channels), dtype)


@dataclass(frozen=True)
class Look:
    """How an array is stored: the Pillow mode, and for mode P the palette (flat RGB) and its transparency."""

    mode: str
    palette: tuple[int, ...] = ()
    transparency: int | bytes | None = None


def require_pillow() -> ModuleType:
    """Import and return ``PIL.Image``, or raise MissingExtraError when Pillow is not installed."""
    try:
        from PIL import Image
    except ImportError as error:
        raise MissingExtraError(
            'expected Pillow, which reads and writes images, found none; install it with: pip install "ipm-rs[cli]"'
        ) from error
    return Image


def probe(path: Path) -> Header:
    """Read the header of an image file and check that :func:`read` can decode its kind.

    Raises
    ------
    MissingFileError, FileError
        There is no such file, or it is no image that Pillow reads.
    ImageError
        It is an image of an unsupported kind.
    MissingExtraError
        Pillow is not installed.
    """
    with _opened(path) as image:
        return _header(path, image)


def read(path: Path) -> tuple[NDArray[Any], Look]:
    """Decode an image file: its pixels as the module's table says, and how to store them again.

    Raises as :func:`probe` does, and FileError when the file is cut short or damaged.
    """
    with _opened(path) as image:
        return _pixels(path, image)


def decode(data: bytes, origin: str) -> tuple[NDArray[Any], Look]:
    """Decode an image that is in memory; raises as :func:`read` does, with `origin` in the place of the path."""
    with _opened(origin, data) as image:
        return _pixels(origin, image)


def check_format(path: Path, mode: str, what: str) -> None:
    """Refuse an output name whose extension is unknown or cannot hold the mode; ``what`` describes the content."""
    known = FORMATS.get(path.suffix.lower())
    if known is None:
        got = repr(path.suffix) if path.suffix else "no extension"
        raise ArgumentError(f"{path}: expected a name that ends in {_or(FORMATS)}, got {got}; rename the output")
    if mode not in known[1]:
        fit = [extension for extension, (_, modes) in FORMATS.items() if mode in modes]
        raise ArgumentError(
            f"{path}: expected a format that holds {what} (mode {mode}), got {known[0]}; use {_or(fit)}"
        )


def write(path: Path, pixels: NDArray[Any], look: Look, level: int = 1) -> None:
    """Write an image file, whole or not at all; an existing file is replaced.

    `level` is PNG's: of a road of 860 x 800 cells, 1 takes 75 ms, and 6, which is Pillow's own, 223 for a file a
    seventh smaller.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    with atomically(path) as file:
        _save(file, path.suffix, pixels, look, level)


def encode(ending: str, pixels: NDArray[Any], look: Look, level: int = 1) -> bytes:
    """Return the bytes of the file with that ending that :func:`write` would write.

    Raises
    ------
    ImageError
        The format does not hold such pixels.
    """
    file = io.BytesIO()
    try:
        _save(file, ending, pixels, look, level)
    except (OSError, ValueError, TypeError, KeyError, SystemError) as error:  # Pillow's, each for another reason
        raise ImageError(
            f"expected pixels that {FORMATS[ending][0]} holds, got {pixels.dtype} of shape {pixels.shape}: {error}; "
            "choose another format"
        ) from error
    return file.getvalue()


def _save(file: BinaryIO, ending: str, pixels: NDArray[Any], look: Look, level: int) -> None:
    image = require_pillow().fromarray(pixels)
    options: dict[str, Any] = {"quality": 95} if image.mode in ("L", "RGB") else {}  # for JPEG, the others ignore it
    if look.mode == "P":
        # An entry for every index: Pillow chooses the bits by the palette's length, and would cut off the indices
        # beyond it, such as the 255 that stands for "ignore" in label images.
        palette = list(look.palette)
        image.putpalette(palette + [0] * (3 * (int(pixels.max()) + 1) - len(palette)))
        options = {}
        if look.transparency is not None:
            options["transparency"] = look.transparency
    if ending.lower() == ".png":
        options["compress_level"] = level
    image.save(file, FORMATS[ending.lower()][0], **options)


def _pixels(name: Path | str, image: ImageFile) -> tuple[NDArray[Any], Look]:
    mode = _header(name, image).mode
    image.load()
    pixels: NDArray[Any] = np.asarray(image).astype(MODES[mode][0], copy=False)
    if mode != "P":
        return pixels, Look(mode)
    return pixels, Look(mode, tuple(image.getpalette("RGB") or ()), image.info.get("transparency"))


@contextmanager
def _opened(path: Path | str, data: bytes | None = None) -> Iterator[ImageFile]:
    """Open an image file, or its bytes, with Pillow; whatever goes wrong in the block becomes one of our errors."""
    Image = require_pillow()
    if data is None:
        check_source(Path(path), "an image file", "name the images one by one")
    with reading(path, "a readable image"), warnings.catch_warnings():
        # Pillow warns of large images and of broken metadata. Here the size must equal the calibration's before
        # anything is decoded, and of the metadata only the orientation is looked at.
        warnings.simplefilter("ignore")
        try:
            with Image.open(path if data is None else io.BytesIO(data)) as image:
                yield image
        except Image.DecompressionBombError as error:
            raise FileError(f"{path}: expected a camera image, got a file that claims to be huge: {error}") from error
        except Image.UnidentifiedImageError as error:
            size = Path(path).stat().st_size if data is None else len(data)
            kind = "an empty file" if size == 0 else "a file that Pillow does not recognise"
            raise FileError(f"{path}: expected an image, got {kind}; fetch it again, or convert it to PNG") from error


def _header(path: Path | str, image: ImageFile) -> Header:
    mode = image.mode
    if mode.startswith("I;16") or (mode == "I" and image.format == "PNG"):  # older Pillow opens 16-bit PNG as "I"
        mode = "I;16"
    if mode not in MODES:
        raise ImageError(f"{path}: expected an image of mode {_or(MODES)}, got {mode}; convert it to one of these")
    if mode != "I;16" and any(";16" in str(tile[3]) for tile in image.tile):
        raise ImageError(
            f"{path}: expected 8 bits per channel, got 16 in mode {mode}, of which Pillow reads 8; convert the image, "
            "or pass its array to Lut.warp() in Python"
        )
    orientation = _orientation(image)
    if image.format == "TIFF" and orientation != 1:
        raise ImageError(
            f"{path}: expected pixels as the sensor saw them, got a TIFF with orientation {orientation}, which Pillow "
            "would apply; remove the tag"
        )
    return Header(Path(path), image.size, mode, orientation, getattr(image, "n_frames", 1))


def _or(words: Iterable[str]) -> str:
    *some, last = words
    return f"{', '.join(some)} or {last}" if some else last


def _orientation(image: Image) -> int:
    """Return the EXIF orientation, 1 (as stored) where there is none or it is damaged."""
    try:
        # The base class's method: that of PNG images decodes the whole file, to look behind the pixels too.
        return int(require_pillow().Image.getexif(image).get(_ORIENTATION, 1))
    except Exception:  # Pillow raises what it likes, and the tag is not worth a refusal
        return 1
