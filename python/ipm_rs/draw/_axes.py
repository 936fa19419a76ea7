"""Metre axes around a bird's-eye view."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ipm_rs._arguments import array_of, number_of
from ipm_rs._core import BevGrid
from ipm_rs.draw import _style as style
from ipm_rs.draw._lines import polylines
from ipm_rs.draw._pixels import rgb_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError, DtypeError, ImageError
from ipm_rs.files.images import require_pillow

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.Image import Image

__all__ = ["around", "axes", "hatched"]

_LARGEST = 20_000
"""Pixels: a longer side is more likely a slip in `scale` than a poster."""

_TICK_SPACE = 56
"""Pixels from one tick to the next, at least, for text of 16 pixels."""


def axes(
    view: ArrayLike | Image,
    grid: BevGrid,
    *,
    mask: ArrayLike | None = None,
    resolved: ArrayLike | None = None,
    track: ArrayLike | None = None,
    step: float | None = None,
    scale: float | None = None,
    font_size: float = 16.0,
    title: str = "",
) -> Image:
    """Draw metre axes around a bird's-eye view: x, forward, up its left side; y, to the left, along its bottom.

    Parameters
    ----------
    view : (rows, columns) or (rows, columns, C) array_like, or PIL.Image.Image
        What `Lut.warp` or `RigLut.warp` made; shown as `to_image` does.
    grid : BevGrid
        The grid of the view's cells.
    mask : (rows, columns) array_like of bool, optional
        Cells where it is False are hatched; `Lut.mask`.
    resolved : (rows, columns) array_like of bool, optional
        Cells where it is False are veiled: what they show lies between two pixels; `Lut.resolved_mask()`.
    track : (N, 2) array_like, optional
        Points of a way, metres, drawn as a line: where a vehicle went. Where a point is NaN the line is interrupted.
    step : float, optional
        Metres from one tick to the next; by default as many as there is room for.
    scale : float, optional
        Pixels of the drawing for a metre. By default each cell is one pixel, and what it shows is unchanged; of cells
        that are not square the shorter side is, so that metres are as long along both axes.
    font_size : float
        Height of the text, pixels.
    title : str
        A line above the view.

    Returns
    -------
    PIL.Image.Image
        RGB, the view with margins. These are drawn once for a grid and kept: a frame of a video costs a copy.

    Raises
    ------
    ImageError
        View and grid, or a mask and the grid, differ in size.
    ArgumentError, ArgumentTypeError, DtypeError
        Another argument is wrong.
    MissingExtraError
        Pillow is not installed.
    """
    Image = require_pillow()
    if not isinstance(grid, BevGrid):
        raise ArgumentTypeError(f"grid: expected an ipm_rs.BevGrid, got {type(grid).__name__}")
    if not isinstance(title, str):
        raise ArgumentTypeError(f"title: expected text, got {type(title).__name__}")
    pixels = rgb_of("view", view)
    _check_shape("view", pixels.shape[:2], grid)
    shown = hatched(pixels, _flags("mask", mask, grid), _flags("resolved", resolved, grid))
    size = _size(grid, None if scale is None else number_of("scale", scale))
    height = number_of("font_size", font_size)
    if not 4 <= height <= 200:
        raise ArgumentError(f"font_size: expected 4 to 200 pixels, got {height:g}")
    spacing = _steps(grid, size, height) if step is None else _given_step(step, grid)
    page, corner = _frame(grid, size, spacing, height, title)
    page = page.copy()
    picture = Image.fromarray(shown)
    if picture.size != size:
        smaller = size[0] < picture.width or size[1] < picture.height
        picture = picture.resize(size, Image.Resampling.LANCZOS if smaller else Image.Resampling.NEAREST)
    if track is not None:
        _draw_track(picture, grid, track)
    page.paste(picture, corner)
    return page


def _draw_track(picture: Image, grid: BevGrid, track: ArrayLike) -> None:
    """Draw a way onto the picture of a grid."""
    from PIL import ImageDraw

    points = array_of("track", track)
    if points.ndim != 2 or points.shape[1] != 2 or points.dtype.kind not in "iuf":
        raise ArgumentTypeError(
            f"track: expected points (N, 2) in metres, got {points.dtype} of shape {points.shape}; give x and y of each"
        )
    width, height = picture.size
    (x_min, x_max), (y_min, y_max) = grid.x, grid.y
    across = (y_max - points[:, 1].astype(np.float64)) / (y_max - y_min) * width - 0.5
    down = (x_max - points[:, 0].astype(np.float64)) / (x_max - x_min) * height - 0.5
    pixels = np.stack([across, down], axis=1)
    # Pillow's own coordinates are of 32 bits; nothing that far outside is seen
    pixels[~(np.abs(pixels) < 1e6).all(axis=1)] = np.nan
    gaps = np.flatnonzero(np.isnan(pixels[:, 0]))
    pieces = [piece[~np.isnan(piece[:, 0])] for piece in np.split(pixels, gaps)]
    line_width = max(2.0, min(width, height) / 200)
    polylines(ImageDraw.Draw(picture), [piece for piece in pieces if len(piece) > 1], style.ACCENT, line_width)


def around(
    page: Image, grid: BevGrid, box: tuple[int, int, int, int], step: float | tuple[float, float], size: float
) -> None:
    """Draw axes around a box (left, top, width, height) of a page, for text of a size in pixels."""
    from PIL import ImageDraw

    draw = ImageDraw.Draw(page)
    (x_min, x_max), (y_min, y_max) = grid.x, grid.y
    left, top, width, height = box
    along_x, along_y = (step, step) if isinstance(step, (int, float)) else step
    bottom, unit = top + height, size / 23.0
    near, far, line = round(3 * unit), round(12 * unit), max(1, round(2 * unit))
    for x in style.ticks(x_min, x_max, along_x):
        level = top + round((x_max - x) / (x_max - x_min) * height)
        draw.line((left - far, level, left - near, level), fill=style.INK, width=line)
        style.text(draw, (left - 20 * unit, level), style.tick_label(x), size, anchor="rm")
    for y in style.ticks(y_min, y_max, along_y):
        column = left + round((y_max - y) / (y_max - y_min) * width)
        draw.line((column, bottom + near, column, bottom + far), fill=style.INK, width=line)
        style.text(draw, (column, bottom + 20 * unit), style.tick_label(y), size, anchor="mt")
    style.text(draw, (left + width / 2, bottom + 56 * unit), "y, left (m)", size, style.MUTED, anchor="mt")
    label = style.upright("x, forward (m)", size)
    page.paste(style.MUTED, (round(left - 104 * unit), top + (height - label.height) // 2), label)


def hatched(
    pixels: NDArray[np.uint8], mask: NDArray[Any] | None, resolved: NDArray[Any] | None = None
) -> NDArray[np.uint8]:
    """Return a view whose unseen cells are hatched, and whose unresolved ones are veiled."""
    rows, cols = pixels.shape[:2]
    row, col = np.ogrid[:rows, :cols]
    shown = pixels
    if resolved is not None:
        # half way to blue-grey, with stripes the other way round: told apart from the hatching also in print
        veil = np.where(((row - col) % 10 < 2)[..., None], 208, 120) * np.array([0.9, 1.0, 1.15])
        faded = (0.55 * pixels + 0.45 * veil).clip(0, 255).astype(np.uint8)
        shown = np.where(np.asarray(resolved, bool)[..., None], shown, faded)
    if mask is not None:
        stripes = np.where(
            ((row + col) % 14 < 2)[..., None], np.array(style.HATCH, np.uint8), np.array(style.UNSEEN, np.uint8)
        )
        shown = np.where(np.asarray(mask, bool)[..., None], shown, stripes)
    return shown


def _flags(name: str, given: ArrayLike | None, grid: BevGrid) -> NDArray[np.bool_] | None:
    if given is None:
        return None
    array = array_of(name, given)
    if array.dtype.kind not in "bui":
        raise DtypeError(f"{name}: expected True and False, got {array.dtype}; compare first, as in values > 0")
    _check_shape(name, array.shape, grid)
    return np.asarray(array != 0)


def _check_shape(name: str, shape: tuple[int, ...], grid: BevGrid) -> None:
    if tuple(shape) != grid.shape:
        rows, cols = grid.shape
        got = " x ".join(map(str, shape)) or "a single value"
        raise ImageError(f"{name}: expected {rows} rows x {cols} columns, as the grid has, got {got}; pass its grid")


def _size(grid: BevGrid, scale: float | None) -> tuple[int, int]:
    """Return (width, height) of the view on the page."""
    (x_min, x_max), (y_min, y_max), (rows, cols), (dx, dy) = grid.x, grid.y, grid.shape, grid.resolution
    if scale is None:
        if math.isclose(dx, dy, rel_tol=1e-9):
            return _checked((cols, rows))
        scale = 1.0 / min(dx, dy)
    elif scale <= 0:
        raise ArgumentError(f"scale: expected pixels for a metre above 0, got {scale:g}")
    return _checked((max(1.0, (y_max - y_min) * scale), max(1.0, (x_max - x_min) * scale)))


def _checked(size: tuple[float, float]) -> tuple[int, int]:
    if not max(size) <= _LARGEST:
        raise ArgumentError(
            f"scale: expected a drawing of at most {_LARGEST} pixels, got {size[0]:.0f} x {size[1]:.0f}; give fewer "
            "pixels for a metre"
        )
    return round(size[0]), round(size[1])


def _given_step(step: float, grid: BevGrid) -> tuple[float, float]:
    metres = number_of("step", step)
    longest = max(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0])
    if not 0 < metres or longest / metres > 1000:
        raise ArgumentError(f"step: expected metres above 0, and not over 1000 ticks, got {metres:g}; leave it out")
    return metres, metres


def _steps(grid: BevGrid, size: tuple[int, int], font_size: float) -> tuple[float, float]:
    """Return the metres from tick to tick along x and y: the same for both, unless one axis is too short for it."""
    room = _TICK_SPACE * font_size / 16
    lengths = grid.x[1] - grid.x[0], grid.y[1] - grid.y[0]
    along_x, along_y = (
        style.nice_step(length, pixels / room) for length, pixels in zip(lengths, (size[1], size[0]), strict=True)
    )
    both = max(along_x, along_y)

    def step(own: float, length: float) -> float:
        return both if length / both >= 2 else own

    return step(along_x, lengths[0]), step(along_y, lengths[1])


@functools.lru_cache(maxsize=4)
def _frame(
    grid: BevGrid, size: tuple[int, int], step: tuple[float, float], font_size: float, title: str
) -> tuple[Image, tuple[int, int]]:
    """Return a page with axes and room for the view, and the place of the view's corner."""
    from PIL import Image, ImageDraw

    unit = font_size / 23.0
    # half of a last label reaches beyond the view; so does the first one, which the left margin has room for
    left, top = round(112 * unit), round((66 if title else 24) * unit)
    right, bottom = round(34 * unit), round(96 * unit)
    page = Image.new("RGB", (left + size[0] + right, top + size[1] + bottom), style.PAPER)
    if title:
        style.text(ImageDraw.Draw(page), (left, top - 22 * unit), title, 1.15 * font_size)
    around(page, grid, (left, top, *size), step, font_size)
    return page, (left, top)
