"""The picture of a rig's report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.diagnosis._picture import _SEVERITY, _scale, page_of, shrunk
from ipm_rs.draw import _style as style
from ipm_rs.draw import axes, overlay
from ipm_rs.draw._pixels import rgb_of
from ipm_rs.rig import Bowl, RigLut

if TYPE_CHECKING:
    from PIL.Image import Image

    from ipm_rs.diagnosis._ring import RigReport

__all__ = ["picture"]

_CAMERAS = (
    (230, 97, 1), (94, 60, 153), (27, 158, 119), (231, 41, 138), (102, 166, 30), (56, 108, 176), (166, 118, 29),
    (102, 102, 102),
)  # fmt: skip
_WIDTH = 1040


def picture(report: RigReport, lut: RigLut, images: dict[str, NDArray[Any]]) -> Image:
    """Draw the picture of a rig's report."""
    colours = {name: _CAMERAS[place % len(_CAMERAS)] for place, name in enumerate(lut.rig)}
    source = lut.source
    areas = np.array([*colours.values(), style.UNSEEN], np.uint8)[source]
    scale = _scale(lut.grid)
    views = [axes(areas, lut.grid, mask=source >= 0, scale=scale, title="Who shows it")]
    if images:
        small = {name: rgb_of("image", image) for name, image in images.items()}
        fused = lut.warp(small, interpolation="area", missing="border")
        dropped = [place for place, name in enumerate(lut.rig) if name not in images]
        there = (source >= 0) & ~np.isin(source, dropped)
        views.insert(0, axes(fused, lut.grid, mask=there, scale=scale, title="Bird's-eye view"))
    legend = [
        (colours[name], f"{name}: sees {100 * each.seen:.1f} %, shows {100 * report.shows[name]:.1f} %")
        for name, each in report.cameras.items()
    ]
    words = [(style.INK, line) for line in report.lines()]
    words += [(_SEVERITY[finding.severity], str(finding)) for finding in report.findings]
    return page_of(_photos(report, lut, images), words, views, legend)


def _photos(report: RigReport, lut: RigLut, images: dict[str, NDArray[Any]]) -> Image:
    """Put all photos on one sheet, in columns."""
    from PIL import Image, ImageDraw

    columns = 1 if len(lut.rig) == 1 else 2 if len(lut.rig) <= 4 else 3
    cell = (_WIDTH // columns - 6, round((_WIDTH // columns - 6) * 0.66))
    road = report.ground.height_map(report.grid) if isinstance(report.ground, Bowl) else report.ground
    made = []
    for name, camera in lut.rig.items():
        image = images.get(name)
        if image is None:
            times = min(1.0, cell[0] / camera.image_size[0])
            camera = camera.resized(*(max(1, round(size * times)) for size in camera.image_size))
            image = np.full(camera.image_size[::-1], 120, np.uint8)
        width = max(1.0, 1.2 * camera.image_size[0] / cell[0])
        photo = shrunk(overlay(image, camera, report.grid, ground=road, line_width=width), cell)
        style.text(ImageDraw.Draw(photo), (8, 24), name, 20, "#ffffff", halo="#101418")
        made.append(photo)
    height = max(photo.height for photo in made)
    rows = -(-len(made) // columns)
    sheet = Image.new("RGB", (_WIDTH, rows * (height + 6)), style.PAPER)
    for k, photo in enumerate(made):
        sheet.paste(photo, (k % columns * (_WIDTH // columns), k // columns * (height + 6)))
    return sheet
