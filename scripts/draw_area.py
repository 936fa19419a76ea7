"""Draw the pictures of docs/area.md into docs/images: bilinear beside area near the car, and the density of a view."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import ipm_rs

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Write both pictures."""
    spec = importlib.util.spec_from_file_location("ground_truth", ROOT / "benches" / "python" / "ground_truth.py")
    assert spec is not None and spec.loader is not None
    ground_truth = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = ground_truth
    spec.loader.exec_module(ground_truth)
    trial = ground_truth.Trial(ground_truth.CASES[0], samples=4)
    view = ground_truth.View(trial, (0.1, 0.1))
    _compare(view).save(ROOT / "docs" / "images" / "area.png", optimize=True)
    _density(view).save(ROOT / "docs" / "images" / "density.png", optimize=True)


def _compare(view) -> Image.Image:
    """Return the nearest metres, bilinear beside area beside the truth, four times enlarged."""
    image = view.trial.image
    panels = (
        ("bilinear", view.lut.warp(image)),
        ("area", view.lut.warp(image, interpolation="area")),
        ("the road itself", np.clip(np.rint(view.truth(view.grid.xy())), 0, 255).astype(np.uint8)),
    )
    xy = view.grid.xy()
    rows = np.flatnonzero((xy[:, 0, 0] > 9.5) & (xy[:, 0, 0] < 15.5))
    cols = np.flatnonzero((xy[0, :, 1] < 5.5) & (xy[0, :, 1] > -2.5))
    box = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    width, height, gap, head = 4 * len(cols), 4 * len(rows), 16, 40
    page = Image.new("L", (3 * width + 2 * gap, height + head), 255)
    draw = ImageDraw.Draw(page)
    for index, (name, panel) in enumerate(panels):
        left = index * (width + gap)
        page.paste(Image.fromarray(np.kron(panel[box], np.ones((4, 4), np.uint8))), (left, head))
        draw.text((left, 6), name, fill=0, font=ImageFont.load_default(24))
    return page


def _density(view) -> Image.Image:
    """Return the bird's-eye view, coloured by the source pixels that a cell has in its poorest direction."""
    levels = (
        (0.0, (120, 40, 120), "less than 1 pixel for 4 cells"),
        (0.25, (190, 60, 60), "1 for 4, or more"),
        (0.5, (220, 150, 50), "1 for 2: lut.resolved_mask()"),
        (1.0, (70, 150, 90), "1 a cell"),
        (4.0, (50, 110, 190), "4 a cell"),
    )
    bev = view.lut.warp(view.trial.image, interpolation="area")
    colours = np.full((*bev.shape, 3), 235.0)
    for least, colour, _ in levels:
        colours[view.lut.resolved_mask(least)] = colour
    shade = np.where(view.lut.mask, 0.35 + 0.65 * bev / 255, 1.0)
    picture = np.clip(colours * shade[..., None], 0, 255).astype(np.uint8)
    picture = np.kron(picture, np.ones((2, 2, 1), np.uint8))
    page = Image.new("RGB", (picture.shape[1] + 330, picture.shape[0]), (255, 255, 255))
    page.paste(Image.fromarray(picture), (0, 0))
    draw = ImageDraw.Draw(page)
    for index, (_, colour, text) in enumerate(levels):
        top = 20 + 40 * index
        left = picture.shape[1] + 20
        draw.rectangle((left, top, left + 26, top + 26), fill=colour)
        draw.text((left + 38, top + 1), text, fill=(0, 0, 0), font=ImageFont.load_default(20))
    return page


if __name__ == "__main__":
    print(f"ipm_rs {ipm_rs.__version__}")
    main()
