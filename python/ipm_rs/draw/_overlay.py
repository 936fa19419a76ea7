"""The road's metres on a photo: a grid, its outline, the horizon."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import flag_of, number_of
from ipm_rs._core import BevGrid, Camera, HeightMap, Plane
from ipm_rs.draw import _style as style
from ipm_rs.draw._lines import polylines
from ipm_rs.draw._pixels import rgb_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError, ImageError
from ipm_rs.files.images import require_pillow

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

__all__ = ["overlay"]

_MOST_LINES = 400
"""Along one axis: more cover the photo."""


def overlay(
    image: ArrayLike | Image,
    camera: Camera,
    grid: BevGrid | None = None,
    *,
    ground: float | Plane | HeightMap = 0.0,
    spacing: float | None = None,
    outline: bool = True,
    horizon: bool = True,
    labels: bool = True,
    line_width: float | None = None,
) -> Image:
    """Draw the road's metres on a photo: lines at whole metres (yellow), a grid's outline (orange), the horizon (blue).

    Lines that lie on lane lines, kerbs and the real horizon speak for a calibration; the eye sees a tenth of a degree.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like, or PIL.Image.Image
        The camera's image; shown as `to_image` does.
    camera : Camera
        The camera, of the image's size.
    grid : BevGrid, optional
        Lines are drawn inside it, and its outline; without one only the horizon is.
    ground : float, Plane or HeightMap
        The road, as for `Lut`.
    spacing : float, optional
        Metres from line to line; by default 1, 2 or 5 times a power of ten, some ten lines.
    outline, horizon, labels : bool
        Whether the grid's outline, the horizon and the metres beside the lines are drawn.
    line_width : float, optional
        Pixels; by default what can be seen of a photo of this size on a screen.

    Returns
    -------
    PIL.Image.Image
        RGB, of the image's size.

    Raises
    ------
    ImageError
        The image has another size than the camera's.
    ArgumentError, ArgumentTypeError, DtypeError
        Another argument is wrong.
    MissingExtraError
        Pillow is not installed.
    """
    Image = require_pillow()
    from PIL import ImageDraw

    if not isinstance(camera, Camera):
        raise ArgumentTypeError(f"camera: expected an ipm_rs.Camera, got {type(camera).__name__}")
    if grid is not None and not isinstance(grid, BevGrid):
        raise ArgumentTypeError(f"grid: expected an ipm_rs.BevGrid, got {type(grid).__name__}")
    flags = {"outline": outline, "horizon": horizon, "labels": labels}
    shown = {name: flag_of(name, value) for name, value in flags.items()}
    pixels = rgb_of("image", image)
    size = pixels.shape[1], pixels.shape[0]
    if size != camera.image_size:
        raise ImageError(
            f"image: expected {camera.image_size[0]}x{camera.image_size[1]} pixels, as the camera has, got "
            f"{size[0]}x{size[1]}; use camera.resized()"
        )
    width = max(1.0, max(size) / 640) if line_width is None else number_of("line_width", line_width)
    if not 0 < width <= max(size):
        raise ArgumentError(f"line_width: expected pixels above 0, got {width:g}")
    step = 0.0
    if grid is not None:
        step = _spacing(grid, None if spacing is None else number_of("spacing", spacing))
    photo = Image.fromarray(pixels)
    draw = ImageDraw.Draw(photo)
    # first, so that a ground that is none is refused also where nothing else is drawn
    sky = [] if isinstance(ground, HeightMap) else camera.horizon(ground=ground)
    if grid is not None:
        _metres(draw, camera, grid, ground, step, width, shown["labels"])
    if shown["horizon"]:
        polylines(draw, sky, style.HORIZON, width * 1.5)
    if grid is not None and shown["outline"]:
        (x_min, x_max), (y_min, y_max) = grid.x, grid.y
        corners = [(x_min, y_min), (x_min, y_max), (x_max, y_max), (x_max, y_min)]
        polylines(draw, _line(camera, _dense(corners, ground), ground, closed=True), style.ACCENT, width * 2)
    return photo


def _spacing(grid: BevGrid, given: float | None) -> float:
    longest = max(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0])
    if given is None:
        return style.nice_step(longest, 10)
    if given <= 0 or longest / given > _MOST_LINES:
        raise ArgumentError(
            f"spacing: expected metres above 0, and at most {_MOST_LINES} lines, got {given:g}; leave it out"
        )
    return given


def _line(
    camera: Camera, points: NDArray[np.float64], ground: float | Plane | HeightMap, *, closed: bool = False
) -> list[NDArray[np.float64]]:
    """Return where the image shows a line of the road; nothing where no polyline can follow it."""
    try:
        return camera.project_polyline(points, ground=ground, closed=closed)
    except ArgumentError:  # a road seen edge-on, whose image winds on and on: drawings leave out what they cannot draw
        return []


def _dense(corners: list[tuple[float, float]], ground: float | Plane | HeightMap) -> NDArray[np.float64]:
    """Return a polygon's vertices; on a height map also points between them, which may be hidden one by one."""
    points = np.array(corners, dtype=np.float64)
    if not isinstance(ground, HeightMap):
        return points
    along = np.linspace(0, 1, 50, endpoint=False)[:, None]
    ends = np.roll(points, -1, axis=0)
    return np.concatenate([a + along * (b - a) for a, b in zip(points, ends, strict=True)])


def _metres(
    draw: ImageDraw,
    camera: Camera,
    grid: BevGrid,
    ground: float | Plane | HeightMap,
    step: float,
    width: float,
    labels: bool,
) -> None:
    (x_min, x_max), (y_min, y_max) = grid.x, grid.y
    drawn: list[tuple[list[NDArray[np.float64]], str]] = []
    for x in style.ticks(x_min, x_max, step):
        drawn.append((_line(camera, np.array([(x, y_max), (x, y_min)]), ground), f"{style.tick_label(x)} m"))
    for y in style.ticks(y_min, y_max, step):
        drawn.append((_line(camera, np.array([(x_min, y), (x_max, y)]), ground), ""))
    for pieces, _ in drawn:
        polylines(draw, pieces, style.METRES, width)
    size = 9 * width + 4
    taken: list[float] = []
    for pieces, label in drawn if labels else []:
        if not pieces or not label:
            continue
        u, v = max((piece[0] for piece in pieces), key=lambda point: -point[0])
        near_top = v < 1.3 * size
        if any(abs(v - other) < 1.2 * size for other in taken) or not math.isfinite(u + v):
            continue  # beyond some distance lines are closer than text is high
        taken.append(float(v))
        place = float(np.clip(u, 4, camera.image_size[0] - style.width_of(label, size) - 4))
        style.text(
            draw, (place, v + (1.2 * size if near_top else -3)), label, size, style.METRES, anchor="ls", halo="#101418"
        )
