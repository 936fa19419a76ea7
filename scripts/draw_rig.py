"""Draw docs/images/rig.jpg: four fisheyes over the painted road of `ipm_rs.scene`, and the one view that they make.

python scripts/draw_rig.py docs/images/rig.jpg
"""

from __future__ import annotations

import sys

import numpy as np
from PIL import Image

import ipm_rs
from ipm_rs import scene

SIZE = (960, 640)
K = [[300, 0, 479.5], [0, 300, 319.5], [0, 0, 1]]
LENS = ipm_rs.KannalaBrandt([0.05, -0.012, 0.003, -0.0006], max_angle=np.radians(95))
CAR = [[-1.0, -0.95], [3.8, -0.95], [3.8, 0.95], [-1.0, 0.95]]
AHEAD = 14.0  # where on the scene's road the car stands: the zebra crossing is just ahead
EXPOSURE = {"front": 0.85, "left": 1.1, "back": 1.0, "right": 0.95}


def fisheye(x: float, y: float, yaw: float) -> ipm_rs.Camera:
    """Return a camera of 190 degrees at (x, y), 0.9 m high, that looks down towards a heading in degrees."""
    return ipm_rs.Camera.from_euler(
        K, image_size=SIZE, position=(x, y, 0.9), pitch=np.radians(36), yaw=np.radians(yaw), lens=LENS
    )


def photograph(camera: ipm_rs.Camera, exposure: float) -> np.ndarray:
    """Average the road over 3 x 3 rays of each pixel; what lies above the horizon or under the car is grey."""
    width, height = SIZE
    total = np.zeros((height * width, 3))
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    for du, dv in np.stack(np.meshgrid([-1 / 3, 0, 1 / 3], [-1 / 3, 0, 1 / 3]), -1).reshape(-1, 2):
        points = camera.ground_from_pixels(np.stack([u + du, v + dv], -1).reshape(-1, 2).astype(float))
        x, y = points[:, 0], points[:, 1]
        colour = np.full((len(points), 3), (168.0, 186.0, 204.0))
        seen = np.hypot(x, y) < 60
        colour[seen] = scene.colour(x[seen] + AHEAD, y[seen])
        colour[(x > -1.0) & (x < 3.8) & (abs(y) < 0.95)] = (52.0, 54.0, 60.0)
        total += colour
    return np.clip(exposure * total.reshape(height, width, 3) / 9, 0, 255).round().astype(np.uint8)


def main(path: str) -> None:
    """Write the picture."""
    rig = ipm_rs.Rig(
        {
            "front": fisheye(3.7, 0.0, 0),
            "left": fisheye(1.9, 0.95, 90),
            "back": fisheye(-0.9, 0.0, 180),
            "right": fisheye(1.9, -0.95, -90),
        }
    )
    grid = ipm_rs.BevGrid(x=(-7, 10), y=(-7.65, 7.65), resolution=0.02)
    images = {name: photograph(camera, EXPOSURE[name]) for name, camera in rig.items()}
    lut = ipm_rs.RigLut(rig, grid, exclude=CAR)
    view = lut.warp(images, interpolation="area", gains=lut.gains(images), border_value=(52, 54, 60))
    height = 640
    small = [Image.fromarray(image).resize((480, 320), Image.Resampling.LANCZOS) for image in images.values()]
    seen = Image.fromarray(view).resize((height * view.shape[1] // view.shape[0], height), Image.Resampling.LANCZOS)
    page = Image.new("RGB", (960 + 8 + seen.width, height), "white")
    for place, image in enumerate(small):
        page.paste(image, (480 * (place % 2), 320 * (place // 2)))
    page.paste(seen, (968, 0))
    page.save(path, quality=82, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1])
