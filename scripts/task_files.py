"""Writes what the pages of docs/tasks read: a short drive over the painted road of `ipm_rs.scene`, by page.

Every page finds a calibration ``camera.json`` and pictures ``frames/000000.png`` to ``000003.png``, 1.6 m apart; some
find more, see `MORE`. Whatever a page shows is therefore known, and its blocks can assert it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import ipm_rs
from ipm_rs import scene

SIZE = (640, 360)
K = [[350.0, 0, 319.5], [0, 350, 179.5], [0, 0, 1]]
MOUNT = {"position": (1.6, 0.0, 1.5), "pitch": 0.12}
CAMERA = ipm_rs.Camera.from_euler(K, image_size=SIZE, **MOUNT)
FRAMES, STEP = 4, 1.6

LABELS = {"void": 0, "road": 1, "marking": 2, "pavement": 3, "grass": 4, "cycle lane": 5}
COLOURS = [(0, 0, 0), (128, 64, 128), (255, 255, 255), (244, 35, 232), (107, 142, 35), (190, 60, 50)]
_LABEL_OF = {
    scene.GRASS: "grass", scene.PAVEMENT: "pavement", scene.KERB: "pavement", scene.ASPHALT: "road",
    scene.PATCH: "road", scene.CYCLE_LANE: "cycle lane", scene.WHITE: "marking", scene.YELLOW: "marking",
    scene.IRON: "road",
}  # fmt: skip


@cache
def photograph(number: int) -> NDArray[np.uint8]:
    """Return the picture of a frame: the vehicle has moved, which for the road is a camera further ahead."""
    x, y, z = MOUNT["position"]
    camera = ipm_rs.Camera.from_euler(K, image_size=SIZE, position=(x + STEP * number, y, z), pitch=MOUNT["pitch"])
    return scene.render(camera)


def labels(number: int) -> NDArray[np.uint8]:
    """Return the ids of `LABELS` in a frame; 0 above the horizon."""
    width, height = SIZE
    u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    points = CAMERA.ground_from_pixels(np.stack([u, v], -1).reshape(-1, 2))
    seen = np.hypot(points[:, 0], points[:, 1]) < 80
    found = np.zeros(len(points), np.uint8)
    ids = np.array([LABELS[_LABEL_OF[material]] for material in range(len(scene.MATERIALS))], np.uint8)
    found[seen] = ids[scene._material(points[seen, 0] + STEP * number, points[seen, 1])]
    return found.reshape(height, width)


def scan() -> NDArray[np.float32]:
    """Return rows x, y, z, intensity of a laser scanner on the roof, 1.9 m high: 64 rings of the road."""
    down, around = np.meshgrid(np.radians(np.linspace(2.5, 24, 64)), np.radians(np.arange(-60, 60, 0.15)))
    distance = 1.9 / np.tan(down)
    x, y = distance * np.cos(around), distance * np.sin(around)
    material = scene._material(x.astype(np.float32), y.astype(np.float32))
    echo = np.array([60, 40, 45, 12, 9, 25, 220, 200, 30], np.float32)  # grass to iron: paint shines
    noise = np.random.default_rng(0).normal(0, (0.01, 6.0), (*x.shape, 2))
    return np.stack(
        [x, y, noise[..., 0], np.clip(echo[material] + noise[..., 1], 0, 255)], -1, dtype=np.float32
    ).reshape(-1, 4)


def video(folder: Path) -> None:
    """Write ``drive.mp4``, ten frames a second."""
    frames = ipm_rs.streams.open(folder / "frames")
    height, width = SIZE[1], SIZE[0]
    u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    same = ipm_rs.Lut.from_maps(u, v, source_size=SIZE)
    ipm_rs.streams.warp(frames, same, folder / "drive.mp4")


def annotated(folder: Path) -> None:
    """Write ``labels/000000.png`` and so on, with a palette."""
    (folder / "labels").mkdir()
    for number in range(FRAMES):
        picture = Image.fromarray(labels(number))
        picture.putpalette(np.array(COLOURS, np.uint8).tobytes())
        picture.save(folder / "labels" / f"{number:06}.png")


MORE: dict[str, Any] = {
    "video": video,
    "labels": annotated,
    "training": annotated,
    "lidar": lambda folder: np.save(folder / "scan.npy", scan()),
    "phone": lambda folder: Image.fromarray(photograph(0)).save(folder / "photo.jpg", quality=92),
}


def write(folder: Path, page: str) -> None:
    """Write the files of a page."""
    CAMERA.save(folder / "camera.json")
    (folder / "frames").mkdir()
    for number in range(FRAMES):
        Image.fromarray(photograph(number)).save(folder / "frames" / f"{number:06}.png", compress_level=1)
    MORE.get(page, lambda _: None)(folder)
