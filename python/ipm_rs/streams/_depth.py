"""What ``compressed_depth_image_transport`` makes of depth images: a PNG of 16 bits or RVL, behind a header.

The message's format is ``16UC1; compressedDepth png``, ``32FC1; compressedDepth rvl`` or the like; older ones do not
say which, and are PNG. The first 12 bytes of the data are a number and the two parameters a, b of the quantisation, in
float32. Depths of ``16UC1`` are stored as they are, those of ``32FC1`` as ``round(a / metres + b)``, 0 where unknown.

RVL (Wilson, Fast Lossless Depth Image Compression, 2017): width and height as int32, then numbers in turn: so many
zeros, so many others, and these as zigzag differences from the one before. A number is groups of three bits, the lowest
first, each in a nibble whose highest bit says that another follows; nibbles fill words of 32 bits from the highest on.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ImageError
from ipm_rs.files import images

__all__ = ["depth_of", "is_depth"]

_HEADER = 12
_MOST_PIXELS = 1 << 28
"""A few bytes of RVL stand for any number of zeros, so the size that is claimed is looked at first."""


def is_depth(form: str) -> bool:
    """Say whether the format of a CompressedImage message is of this transport."""
    return "compressedDepth" in form


def depth_of(form: str, data: bytes, origin: str) -> NDArray[Any]:
    """Return (H, W) uint16 of the stored unit, or float32 metres, NaN where unknown, of a ``32FC1`` topic.

    Raises
    ------
    ImageError, FileError
        The data is damaged or cut short, or of an encoding that the transport does not have.
    """
    encoding = form.partition(";")[0].strip()
    if encoding not in ("16UC1", "mono16", "32FC1"):
        raise ImageError(
            f"{origin}: expected compressedDepth of 16UC1 or 32FC1, got {form!r:.60}; record the raw topic"
        )
    if len(data) <= _HEADER:
        raise ImageError(f"{origin}: expected compressedDepth, got {len(data)} bytes; it is cut short")
    body = data[_HEADER:]
    stored = _from_rvl(body, origin) if "rvl" in form else images.decode(body, origin)[0]
    if stored.dtype != np.uint16 or stored.ndim != 2:
        raise ImageError(f"{origin}: expected 16 bits of depth, got {stored.dtype} of shape {stored.shape}")
    if encoding != "32FC1":
        return stored
    a, b = np.frombuffer(data, "<f4", 2, 4)
    with np.errstate(all="ignore"):
        metres = a / (stored.astype(np.float32) - b)
    return np.where(stored == 0, np.float32(np.nan), metres)


def _from_rvl(body: bytes, origin: str) -> NDArray[np.uint16]:
    cols, rows = (int(number) for number in np.frombuffer(body[:8].ljust(8, b"\0"), "<i4"))
    if not (cols > 0 and rows > 0 and cols * rows <= _MOST_PIXELS):
        raise ImageError(f"{origin}: expected the size of a depth image, got {cols}x{rows}; it is damaged")
    count = cols * rows
    numbers = _numbers(body[8:])
    depths = np.zeros(count, np.uint16)
    counts: list[tuple[int, int, int]] = []  # first number of a run, its first pixel, its pixels
    place = pixel = 0
    while pixel < count:
        if place + 2 > len(numbers):
            raise ImageError(f"{origin}: expected {cols}x{rows} depths, got {pixel}; it is cut short")
        pixel += int(numbers[place])
        length = int(numbers[place + 1])
        if pixel + length > count or place + 2 + length > len(numbers):
            raise ImageError(f"{origin}: expected {cols}x{rows} depths, got runs of other lengths; it is damaged")
        counts.append((place + 2, pixel, length))
        place, pixel = place + 2 + length, pixel + length
    zigzag = np.concatenate([numbers[first : first + length] for first, _, length in counts])
    values = np.cumsum((zigzag >> 1) ^ -(zigzag & 1)).astype(np.uint16)
    done = 0
    for _, start, length in counts:
        depths[start : start + length] = values[done : done + length]
        done += length
    return depths.reshape(rows, cols)


def _numbers(stream: bytes) -> NDArray[np.int64]:
    """Return all whole numbers of a stream of nibbles; what is unfinished at its end is dropped."""
    words = np.frombuffer(stream, "<u4", len(stream) // 4)
    nibbles = ((words[:, None] >> np.arange(28, -1, -4, dtype=np.uint32)) & 15).astype(np.uint8).ravel()
    lasts = np.flatnonzero(nibbles < 8)
    if not len(lasts):
        return np.zeros(0, np.int64)
    starts = np.r_[0, lasts[:-1] + 1]
    nibbles = nibbles[: lasts[-1] + 1]
    order = np.arange(len(nibbles)) - np.repeat(starts, lasts - starts + 1)
    groups = (nibbles & 7).astype(np.int64) << np.minimum(3 * order, 33)
    return np.minimum(np.add.reduceat(groups, starts), 1 << 32)
