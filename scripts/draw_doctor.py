"""Draw the pictures of docs/doctor.md: a report, and what typical mistakes look like.

python scripts/draw_doctor.py docs/images/doctor.png docs/images/mistakes.png
"""

from __future__ import annotations

import sys
import warnings

import numpy as np
from PIL import Image, ImageDraw

import ipm_rs
from ipm_rs import draw, scene

SIZE = (1024, 512)
K = np.array([[1130.0, 0, 539.0], [0, 1125, 257], [0, 0, 1]])
POSE = {"position": (1.7, 0.0, 1.3), "pitch": np.radians(3.0)}
GRID = ipm_rs.BevGrid(x=(6, 30), y=(-6, 6), resolution=0.05)
TREES = [(17.0, 3.9), (22.0, -4.6), (26.0, 4.4)]


def camera(**pose: object) -> ipm_rs.Camera:
    """Return the scene's camera, some of its pose changed."""
    return ipm_rs.Camera.from_euler(K, image_size=SIZE, **{**POSE, **pose})


def photograph(seen_by: ipm_rs.Camera) -> Image.Image:
    """Render the road and put trees beside it, the farthest first."""
    photo = Image.fromarray(scene.render(seen_by))
    pencil = ImageDraw.Draw(photo)
    for x, y in sorted(TREES, reverse=True):
        uv, _, _ = seen_by.project([(x, y, 0.0), (x, y, 2.2), (x, y, 3.4)])
        thick = max(2.0, K[0, 0] * 0.3 / x)
        pencil.line([tuple(uv[0]), tuple(uv[1])], fill="#5b4630", width=round(thick))
        u, v = uv[2]
        crown = K[0, 0] * 1.4 / x
        pencil.ellipse((u - crown, v - crown, u + crown, v + crown), fill="#35582b")
    return photo


def view(title: str, seen_by: ipm_rs.Camera, image: np.ndarray, grid: ipm_rs.BevGrid = GRID) -> Image.Image:
    """Draw a bird's-eye view with axes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        lut = ipm_rs.Lut(seen_by, grid)
    shown = lut.warp(image, interpolation="area")
    return draw.axes(shown, grid, mask=lut.mask, title=title, scale=20, font_size=15)


def main(report_path: str, mistakes_path: str) -> None:
    """Write both pictures."""
    true = camera()
    image = np.asarray(photograph(true))
    wrong = camera(pitch=np.radians(4.5))
    report = ipm_rs.doctor(wrong, GRID, image=image)
    report.draw().quantize(128).save(report_path, optimize=True)
    inverse = ipm_rs.Camera(K, image_size=SIZE, camera_from_vehicle=true.vehicle_from_camera)
    far = ipm_rs.BevGrid(x=(36, 60), y=(-6, 6), resolution=0.05)
    pictures = [
        view("As it should be", true, image),
        view("Splayed: pitch 1.5 deg off", wrong, image),
        view("Mirrored", true, image[:, ::-1].copy()),
        view("Black: the inverse pose", inverse, image),
        view("Streaks: too far away", true, image, far),
    ]
    page = Image.new("RGB", (sum(each.width for each in pictures), max(each.height for each in pictures)), "#fbfbf9")
    left = 0
    for each in pictures:
        page.paste(each, (left, 0))
        left += each.width
    page.quantize(128).save(mistakes_path, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
