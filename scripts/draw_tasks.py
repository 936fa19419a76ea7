"""Draw the pictures of docs/tasks, of the first page and of those of C++ and Ray from what their blocks make.

python scripts/draw_tasks.py docs/images
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import task_files
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from run_snippets import prepare, run_blocks

import ipm_rs

PAGES = Path(__file__).resolve().parents[1] / "docs" / "tasks"
GAP, PAPER = 14, (255, 255, 255)
Names = dict[str, Any]


def picture(pixels: Any, height: int) -> Image.Image:
    """Return pixels, or a file of them, as a picture of that height; small ones keep their cells' edges."""
    image = Image.open(pixels) if isinstance(pixels, (str, Path)) else pixels
    image = (image if isinstance(image, Image.Image) else Image.fromarray(image)).convert("RGB")
    size = (round(image.width * height / image.height), height)
    return image.resize(size, Image.Resampling.NEAREST if height > image.height else Image.Resampling.LANCZOS)


def side_by_side(*images: Image.Image) -> Image.Image:
    """Return pictures in a row."""
    width = sum(image.width for image in images) + GAP * (len(images) - 1)
    sheet = Image.new("RGB", (width, max(image.height for image in images)), PAPER)
    left = 0
    for image in images:
        sheet.paste(image, (left, 0))
        left += image.width + GAP
    return sheet


def stacked(*images: Image.Image) -> Image.Image:
    """Return pictures below each other, in the middle."""
    width = max(image.width for image in images)
    sheet = Image.new("RGB", (width, sum(image.height for image in images) + GAP * (len(images) - 1)), PAPER)
    top = 0
    for image in images:
        sheet.paste(image, ((width - image.width) // 2, top))
        top += image.height + GAP
    return sheet


def video(made: Names) -> Image.Image:
    """Return a frame and three views with axes."""
    views = [
        made["with_axes"](made["lut"].warp(frame.image, interpolation="area"), made["lut"])
        for frame in ipm_rs.streams.open("drive.mp4")
    ]
    return side_by_side(picture("frames/000000.png", 520), *(picture(view, 520) for view in views[:3]))


def folder(made: Names) -> Image.Image:
    """Return all frames above their views."""
    columns = [
        stacked(picture(f"frames/{k:06}.png", 190), picture(f"bevs/{k:06}_bev.png", 420))
        for k in range(task_files.FRAMES)
    ]
    return side_by_side(*columns)


def labels(made: Names) -> Image.Image:
    """Return photo, labels, labels from above, and the ids that bilinear interpolation makes up."""
    palette = np.zeros((256, 3), np.uint8)
    palette[: len(task_files.COLOURS)] = task_files.COLOURS
    mixed = made["lut"].warp(made["labels"].astype(np.float32))
    wrong = made["lut"].mask & (np.abs(mixed - np.rint(mixed)) > 1e-3)
    shown = palette[made["bev"]] // 3
    shown[wrong] = (255, 40, 40)
    pair = stacked(picture("frames/000000.png", 200), picture(palette[made["labels"]], 200))
    return side_by_side(pair, picture(palette[made["bev"]], pair.height), picture(shown, pair.height))


def lidar(made: Names) -> Image.Image:
    """Return echoes over the photo, the photo from above, the echoes from above, and both."""
    photo = made["image"].copy()
    strength = made["scan"][made["valid"], 3]
    photo[made["rows"], made["columns"]] = heat(strength)
    seen = ~np.isnan(made["strength"])
    echoes = np.full((*seen.shape, 3), 24, np.uint8)
    echoes[seen] = heat(made["strength"][seen])
    both = made["bev"].copy()
    bright = seen & (np.nan_to_num(made["strength"]) > 110)
    both[bright] = (255, 60, 30)
    return side_by_side(picture(photo, 400), *(picture(each, 400) for each in (made["bev"], echoes, both)))


def heat(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Return colours of 0 to 255, dark blue over green to yellow."""
    stops = np.array([(35, 20, 90), (40, 110, 150), (70, 180, 110), (250, 230, 60)], float)
    place = np.linspace(0, 255, len(stops))
    return np.stack([np.interp(values, place, stops[:, k]) for k in range(3)], -1).astype(np.uint8)


def phone(made: Names) -> Image.Image:
    """Return the photo with the clicks and the road's metres, and the view from above."""
    over = picture(ipm_rs.draw.overlay(made["photo"], made["camera"], grid=made["grid"]), 540)
    draw = ImageDraw.Draw(over)
    scale = 540 / task_files.SIZE[1]
    for u, v in made["pixels"]:
        x, y = (u + 0.5) * scale, (v + 0.5) * scale
        draw.ellipse((x - 7, y - 7, x + 7, y + 7), outline=(255, 40, 40), width=3)
    view = ipm_rs.draw.axes(made["bev"], made["grid"])
    return side_by_side(over, picture(view, 540))


def training(made: Names) -> Image.Image:
    """Return three samples of picture, labels and mask."""
    palette = np.zeros((256, 3), np.uint8)
    palette[: len(task_files.COLOURS)] = task_files.COLOURS
    palette[made["VOID"]] = (0, 0, 0)
    data = made["Drive"]("frames", made["lut"].camera, made["lut"].grid)
    data.random = np.random.default_rng(3)
    samples = []
    for k in range(3):
        view, target, mask = data[k]
        parts = (view.transpose(1, 2, 0), palette[target], np.where(mask, np.uint8(255), np.uint8(70)))
        samples.append(side_by_side(*(picture(part, 300) for part in parts)))
    return side_by_side(*samples)


def cpp() -> Image.Image:
    """Return a photo, the two maps as shades, and what `cv::remap` makes of them: the line of the page's program."""
    camera, photo = task_files.CAMERA, task_files.photograph(0)
    lut = ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(4, 24), y=(-6, 6), resolution=0.04))
    with tempfile.TemporaryDirectory(prefix="ipm_rs-") as work:
        path = str(Path(work) / "front.yml")
        lut.export(path)
        maps = cv2.FileStorage(path, cv2.FILE_STORAGE_READ)
        map_x, map_y = (maps.getNode(name).mat() for name in ("map_x", "map_y"))
        maps.release()
    view = cv2.remap(photo, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    shades = []
    for values, end in ((map_x, camera.image_size[0]), (map_y, camera.image_size[1])):
        shade = heat(values / end * 255)
        shade[~lut.mask] = 24
        shades.append(picture(shade, 400))
    return side_by_side(picture(photo, 400), *shades, picture(view, 400))


def ray() -> Image.Image:
    """Return what a worker takes and gives back: a partition of frames, and their views."""
    lut = ipm_rs.Lut(task_files.CAMERA, ipm_rs.BevGrid(x=(4, 24), y=(-6, 6), resolution=0.04))
    frames = np.stack([task_files.photograph(k) for k in range(task_files.FRAMES)])
    views = ipm_rs.ray.Warp(lut, interpolation="area")({"image": frames})["bev"]
    columns = [stacked(picture(frame, 130), picture(view, 260)) for frame, view in zip(frames, views, strict=True)]
    return side_by_side(*columns)


def first() -> Image.Image:
    """Return the picture of the first page: a photo with its metres, and the road from above."""
    camera, grid = task_files.CAMERA, ipm_rs.BevGrid(x=(4, 24), y=(-6, 6), resolution=0.04)
    photo = task_files.photograph(0)
    view = ipm_rs.Lut(camera, grid).warp(photo, interpolation="area")
    over = ipm_rs.draw.overlay(photo, camera, grid=grid)
    return side_by_side(picture(over, 480), picture(ipm_rs.draw.axes(view, grid), 480))


DRAWN: dict[str, Callable[[Names], Image.Image]] = {
    "video": video,
    "folder": folder,
    "labels": labels,
    "lidar": lidar,
    "phone": phone,
    "training": training,
}


def main(target: str) -> None:
    """Write the pictures."""
    place = Path(target).resolve()
    for page, draw in DRAWN.items():
        with tempfile.TemporaryDirectory(prefix="ipm_rs-") as work:
            prepare(Path(work), PAGES / f"{page}.md")
            os.chdir(work)
            sheet = draw(run_blocks(PAGES / f"{page}.md")[1])
            os.chdir(place)
        sheet.save(place / f"{page}.jpg", quality=88)
    for name, sheet in (("first", first()), ("cpp", cpp()), ("ray", ray())):
        sheet.save(place / f"{name}.jpg", quality=88)


if __name__ == "__main__":
    main(*sys.argv[1:])
