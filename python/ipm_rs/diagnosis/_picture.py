"""The picture of a report: photo, bird's-eye view, and which cells are not seen and why."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera
from ipm_rs.diagnosis._coverage import REASONS, Coverage
from ipm_rs.draw import _style as style
from ipm_rs.draw import axes, overlay, to_image
from ipm_rs.draw._pixels import rgb_of
from ipm_rs.files.images import require_pillow

if TYPE_CHECKING:
    from PIL.Image import Image

    from ipm_rs.diagnosis._report import Report

__all__ = ["map_of_reasons", "page_of", "picture"]

COLOURS: dict[str, tuple[int, int, int]] = {
    "resolved": (124, 179, 110),
    "unresolved": (208, 224, 160),
    "behind": (90, 96, 110),
    "lens": (150, 120, 170),
    "left": (236, 188, 130),
    "right": (226, 146, 120),
    "above": (150, 200, 230),
    "below": (190, 160, 120),
    "masked": (60, 60, 66),
    "hidden": (200, 100, 150),
    "unknown": (235, 235, 235),
    "horizon": (80, 150, 220),
}
_PHOTO = (1040, 620)
_VIEW = 720
_MARGIN, _GAP = 32, 40
_SEVERITY = {"error": "#c92a2a", "warning": style.ACCENT, "note": style.MUTED}


def picture(report: Report, coverage: Coverage, image: NDArray[Any] | None) -> Image:
    """Draw the picture of a report."""
    from ipm_rs.diagnosis._camera import fitting

    camera = report.camera if image is None else fitting(report.camera, image)
    photo = _photo(report, camera, image)
    views = [
        axes(map_of_reasons(coverage), coverage.grid, scale=_scale(coverage.grid), title="What is seen, and why not")
    ]
    if image is not None and camera == report.camera:
        view = rgb_of("image", coverage.lut.warp(_as_bytes(image), interpolation="bilinear"))
        scale = _scale(coverage.grid)
        shown = axes(
            view, coverage.grid, mask=coverage.seen, resolved=coverage.resolved, scale=scale, title="Bird's-eye view"
        )
        views.insert(0, shown)
    legend = [(COLOURS[name], f"{100 * share:.1f} %  {REASONS[name]}") for name, share in report.shares.items()]
    words = [(style.INK, line) for line in report.lines()]
    words += [(_SEVERITY[finding.severity], str(finding)) for finding in report.findings]
    return page_of(photo, words, views, legend)


def page_of(
    photo: Image,
    words: list[tuple[str, str]],
    views: list[Image],
    legend: list[tuple[tuple[int, int, int], str]],
) -> Image:
    """Put a photo with words under it on the left of a page, and views beside each other on its right."""
    Image = require_pillow()
    from PIL import ImageDraw

    size, line = 19, 26
    wrapped = [
        (colour, part, k)
        for colour, text in words
        for k, part in enumerate(textwrap.wrap(text, 100, subsequent_indent="              ") or [""])
    ]
    right = _MARGIN + _PHOTO[0] + _GAP
    width = right + sum(view.width + 8 for view in views) + _MARGIN
    tallest = max(view.height for view in views)
    height = 2 * _MARGIN + max(photo.height + 30 + line * len(wrapped), tallest + 20 + line * len(legend))
    page = Image.new("RGB", (width, height), style.PAPER)
    draw = ImageDraw.Draw(page)
    page.paste(photo, (_MARGIN, _MARGIN))
    level = _MARGIN + photo.height + 34
    for colour, text, continued in wrapped:
        style.text(draw, (_MARGIN + (92 if continued else 0), level), text.strip() if continued else text, size, colour)
        level += line
    left = right
    for view in views:
        page.paste(view, (left, _MARGIN))
        left += view.width + 8
    level = _MARGIN + tallest + 30
    for fill, text in legend:
        draw.rectangle((right + 60, level - 15, right + 78, level + 3), fill=fill, outline=style.RULE)
        style.text(draw, (right + 90, level), text, size)
        level += line
    return page


def map_of_reasons(coverage: Coverage) -> NDArray[np.uint8]:
    """Return the colour of each cell's reason, (rows, columns, 3)."""
    return np.array([COLOURS[name] for name in REASONS], np.uint8)[coverage.why]


def shrunk(photo: Image, size: tuple[int, int] = _PHOTO) -> Image:
    """Return a photo that fits a box."""
    from PIL import Image

    times = min(size[0] / photo.width, size[1] / photo.height)
    small = max(1, round(photo.width * times)), max(1, round(photo.height * times))
    return photo.resize(small, Image.Resampling.LANCZOS if times < 1 else Image.Resampling.NEAREST)


def _photo(report: Report, camera: Camera | None, image: NDArray[Any] | None) -> Image:
    width, height = report.camera.image_size
    if image is None:  # a large sensor needs no large grey picture
        times = min(1.0, _PHOTO[0] / width)
        camera = report.camera.resized(max(1, round(width * times)), max(1, round(height * times)))
        image = np.full((camera.image_size[1], camera.image_size[0]), 120, np.uint8)
    if camera is None:
        return shrunk(to_image(image))
    return shrunk(overlay(image, camera, report.grid, ground=report.ground, line_width=_line_width(camera)))


def _line_width(camera: Camera) -> float:
    """Return the pixels of a photo that are one and a half on the page."""
    width, height = camera.image_size
    return max(1.0, 1.5 * max(width / _PHOTO[0], height / _PHOTO[1]))


def _scale(grid: BevGrid) -> float:
    """Return the pixels for a metre with which a grid fits its place."""
    return min(_VIEW / (grid.x[1] - grid.x[0]), 0.75 * _VIEW / (grid.y[1] - grid.y[0]))


def _as_bytes(image: NDArray[Any]) -> NDArray[np.uint8]:
    return image if image.dtype == np.uint8 and image.ndim == 2 else rgb_of("image", image)
