"""Draw docs/images/mosaic.jpg: a frame of a drive on the road of `ipm_rs.scene`, its view, and the map of 20 frames.

python scripts/draw_mosaic.py docs/images/mosaic.jpg
"""

from __future__ import annotations

import sys

import numpy as np
from PIL import Image

import ipm_rs
from ipm_rs import draw, scene

X, Y = (6.0, 40.0), (-6.0, 6.0)


def main(path: str) -> None:
    """Write the picture."""
    camera = ipm_rs.Camera.from_euler(
        [[500, 0, 319.5], [0, 500, 179.5], [0, 0, 1]], image_size=(640, 360), position=(1.5, 0, 1.4), pitch=0.12
    )
    mosaic = ipm_rs.Mosaic(0.04)
    frames = []
    for step in range(20):
        pose = np.eye(4)
        pose[:3, :3] = ipm_rs.rotation_from_euler(0, 0, 0.12 * np.sin(step / 4))
        pose[:2, 3] = 1.5 * step, 0.6 * np.sin(step / 3)
        picture = scene.render(camera.with_pose(camera.camera_from_vehicle @ np.linalg.inv(pose)))
        mosaic.add(camera, picture, map_from_vehicle=pose, distance=(3, 20))
        frames.append((camera, picture, pose))
    mosaic.refine(frames, distance=(3, 20))
    grid = mosaic.window(X, Y)
    own = ipm_rs.Lut(camera, grid)
    first = frames[0][1]
    layers = mosaic.layers(X, Y, names=("refined", "mask"))
    pages = [
        draw.axes(own.warp(first, interpolation="area"), grid, mask=own.mask, title="one frame", scale=18),
        draw.axes(layers["refined"], grid, mask=layers["mask"], title="20 frames, 1.5 m apart", scale=18),
    ]
    photo = Image.fromarray(first)
    width, height = 40 + photo.width + sum(page.width for page in pages), max(page.height for page in pages)
    sheet = Image.new("RGB", (width, height), "white")
    sheet.paste(photo, (20, (height - photo.height) // 2))
    left = photo.width + 40
    for page in pages:
        sheet.paste(page, (left, 0))
        left += page.width
    sheet.save(path, quality=88)


if __name__ == "__main__":
    main(sys.argv[1])
