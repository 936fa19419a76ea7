"""What ROS's Image messages hold, as arrays whose colours come in the order red, green, blue.

========================================== ==========================================================================
encoding                                   array
========================================== ==========================================================================
mono8, 8UC1; mono16, 16UC1; 16SC1          (H, W) uint8; uint16; int16
rgb8, bgr8, rgba8, bgra8; rgb16 ...        (H, W, 3 or 4) uint8; uint16
bayer_rggb8, _bggr8, _gbrg8, _grbg8; ...16 (H, W, 3) uint8; uint16: the colours between, from their neighbours' mean
yuv422, uyvy; yuv422_yuy2, yuyv            (H, W, 3) uint8, by BT.601 of video range, as cv_bridge has it
nv12, nv21, nv24, nv42                     the same; luma first, then rows of U and V or V and U in turn
32FC1, 64FC1                               (H, W) float32, float64
========================================== ==========================================================================
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ImageError

__all__ = ["NAMES", "demosaiced", "pixels_of"]

_PLAIN = {
    "mono8": ("u1", 1),
    "8UC1": ("u1", 1),
    "mono16": ("u2", 1),
    "16UC1": ("u2", 1),
    "16SC1": ("i2", 1),
    "32FC1": ("f4", 1),
    "64FC1": ("f8", 1),
}
_COLOURS = {
    f"{order}{bits}": (f"u{bits // 8}", len(order), [order.index(c) for c in ("rgba"[: len(order)])])
    for order in ("rgb", "bgr", "rgba", "bgra")
    for bits in (8, 16)
}
_BAYER = {
    f"bayer_{tile}{bits}": (f"u{bits // 8}", tile) for tile in ("rggb", "bggr", "gbrg", "grbg") for bits in (8, 16)
}
_YUV = {"yuv422": (1, 0, 2), "uyvy": (1, 0, 2), "yuv422_yuy2": (0, 1, 3), "yuyv": (0, 1, 3)}
"""Where in four bytes the first luma, U and V stand; the second luma is two after the first."""

_PLANES = {"nv12": (2, 0, 1), "nv21": (2, 1, 0), "nv24": (1, 0, 1), "nv42": (1, 1, 0)}
"""How many pixels to each side share a chroma, and where in two bytes U and V stand."""

NAMES = (*_PLAIN, *_COLOURS, *_BAYER, *_YUV, *_PLANES)


def demosaiced(picture: NDArray[Any], encoding: str) -> NDArray[Any]:
    """Return a picture whose encoding may be a Bayer tile in colours; any other as it is."""
    if encoding not in _BAYER or picture.ndim != 2 or min(picture.shape) < 2:
        return picture
    return _demosaiced(picture, _BAYER[encoding][1])


def pixels_of(message: Any, origin: str) -> NDArray[Any]:
    """Return the pixels of an Image message.

    Raises
    ------
    ImageError
        Its encoding is unknown, or it holds fewer bytes than its size promises.
    """
    encoding, rows, cols = str(message.encoding), int(message.height), int(message.width)
    if encoding in _PLAIN:
        return _samples(message, *_PLAIN[encoding], origin)[..., 0]
    if encoding in _COLOURS:
        dtype, channels, order = _COLOURS[encoding]
        samples = _samples(message, dtype, channels, origin)
        return samples if order == sorted(order) else np.ascontiguousarray(samples[..., order])
    if encoding in _BAYER:
        dtype, tile = _BAYER[encoding]
        if rows < 2 or cols < 2:
            raise ImageError(f"{origin}: expected at least 2x2 pixels of {encoding}, got {cols}x{rows}")
        return _demosaiced(_samples(message, dtype, 1, origin)[..., 0], tile)
    if encoding in _YUV:
        if cols % 2:
            raise ImageError(f"{origin}: expected an even width of {encoding}, got {cols}; record it again")
        quads = _samples(message, "u1", 2, origin).reshape(rows, cols // 2, 4)
        y, u, v = _YUV[encoding]
        colours = _from_yuv(quads[..., y : y + 3 : 2], quads[..., u, None], quads[..., v, None])
        return colours.reshape(rows, cols, 3)
    if encoding in _PLANES:
        return _from_planes(message, *_PLANES[encoding], origin)
    raise ImageError(
        f"{origin}: expected an encoding of {', '.join(NAMES)}, got {encoding!r:.40}; convert the topic, with "
        "image_proc or image_transport"
    )


def _samples(message: Any, dtype: str, channels: int, origin: str) -> NDArray[Any]:
    """Return (rows, columns, channels), without a copy where the rows are the machine's own."""
    rows, cols, step = int(message.height), int(message.width), int(message.step)
    kind = np.dtype(dtype).newbyteorder(">" if message.is_bigendian else "<")
    width = cols * channels * kind.itemsize
    data = np.frombuffer(message.data, np.uint8)
    if not rows or not cols:
        raise ImageError(f"{origin}: expected a picture, got {cols}x{rows} pixels; leave it out")
    if step < width or len(data) < step * (rows - 1) + width:
        raise ImageError(
            f"{origin}: expected {cols}x{rows} pixels of {message.encoding}, {width} bytes a row, got {len(data)} "
            f"bytes in rows of {step}; it is cut short"
        )
    apart = np.lib.stride_tricks.as_strided(data, (rows, width), (step, 1), writeable=False)
    lines = apart if step % kind.itemsize == 0 and step == width else np.ascontiguousarray(apart)
    samples = lines.view(kind).reshape(rows, cols, channels)
    return samples if kind.isnative else samples.astype(kind.newbyteorder("="))


def _demosaiced(raw: NDArray[Any], tile: str) -> NDArray[Any]:
    """Return (H, W, 3): each colour that a pixel lacks is the mean of its nearest neighbours that have it, rounded up.

    The border is mirrored about its outermost pixels, which keeps the tile's phase.
    """
    rows, cols = raw.shape
    wide = np.pad(raw, 1, mode="reflect").astype(np.uint32)

    def at(dy: int, dx: int, y: int, x: int) -> NDArray[np.uint32]:
        return wide[1 + y + dy : 1 + y + dy + rows - y : 2, 1 + x + dx : 1 + x + dx + cols - x : 2][
            : (rows - y + 1) // 2, : (cols - x + 1) // 2
        ]

    result = np.empty((rows, cols, 3), raw.dtype)
    for place, colour in enumerate(tile):
        y, x = divmod(place, 2)
        out = result[y::2, x::2]
        own = raw[y::2, x::2]
        sides = at(0, -1, y, x) + at(0, 1, y, x)
        ends = at(-1, 0, y, x) + at(1, 0, y, x)
        if colour == "g":
            beside = tile[place ^ 1]  # which of red and blue is in this row
            first, second = ("rgb".index(c) for c in (beside, "b" if beside == "r" else "r"))
            out[..., 1], out[..., first], out[..., second] = own, (sides + 1) // 2, (ends + 1) // 2
            continue
        corners = at(-1, -1, y, x) + at(-1, 1, y, x) + at(1, -1, y, x) + at(1, 1, y, x)
        other = "b" if colour == "r" else "r"
        out[..., "rgb".index(colour)], out[..., 1] = own, (sides + ends + 2) // 4
        out[..., "rgb".index(other)] = (corners + 2) // 4
    return result


def _from_planes(message: Any, shared: int, u: int, v: int, origin: str) -> NDArray[np.uint8]:
    """Return (H, W, 3) of a plane of luma with one of chroma below it, whose rows are of equal length where halved."""
    rows, cols = int(message.height), int(message.width)
    step = int(message.step) or cols  # some drivers leave it out
    data = np.frombuffer(message.data, np.uint8)
    if not rows or not cols or rows % shared or cols % shared:
        even = "an even width and height" if shared == 2 else "a picture"
        raise ImageError(f"{origin}: expected {even} of {message.encoding}, got {cols}x{rows}; record it again")
    below, apart = rows // shared, step * 2 // shared  # rows of chroma, and bytes from one to the next
    if step < cols or len(data) < step * rows + apart * (below - 1) + 2 * cols // shared:
        raise ImageError(
            f"{origin}: expected {cols}x{rows} pixels of {message.encoding}, {cols} bytes a row of luma, got "
            f"{len(data)} bytes in rows of {step}; it is cut short"
        )
    luma = data[: step * rows].reshape(rows, step)[:, :cols]
    chroma = np.lib.stride_tricks.as_strided(
        data[step * rows :], (below, cols // shared, 2), (apart, 2, 1), writeable=False
    )
    blocks = luma.reshape(below, shared, cols // shared, shared)
    colours = _from_yuv(blocks, *(chroma[:, None, :, None, place] for place in (u, v)))
    return colours.reshape(rows, cols, 3)


def _from_yuv(luma: NDArray[np.uint8], u: NDArray[np.uint8], v: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return red, green and blue on a last axis: BT.601, luma 16 to 235, in integers of 20 bits after the point."""
    bright = 1220542 * np.maximum(luma.astype(np.int32) - 16, 0)
    red, blue = v.astype(np.int32) - 128, u.astype(np.int32) - 128
    half = 1 << 19
    colours = np.stack(
        [bright + 1673527 * red + half, bright - 852492 * red - 409993 * blue + half, bright + 2116026 * blue + half],
        -1,
    )
    return np.clip(colours >> 20, 0, 255).astype(np.uint8)
