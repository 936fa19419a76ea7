"""From a calibration and an image to a bird's-eye view in metres.

Run it with `python examples/first_bev.py [OUT.npy]`; it needs NumPy alone and makes its own image.
"""

from __future__ import annotations

import sys

import numpy as np

import ipm_rs

# A Cityscapes calibration. `Camera.from_cityscapes` takes the path of such a JSON file just as well.
CALIBRATION = {
    "extrinsic": {"x": 1.7, "y": 0.1, "z": 1.22, "roll": 0.0, "pitch": 0.038, "yaw": -0.0195},
    "intrinsic": {"fx": 2262.52, "fy": 2265.30, "u0": 1096.98, "v0": 513.14},
}


def road_image(camera: ipm_rs.Camera) -> np.ndarray:
    """Draw what the camera sees of a grey road with two white lines at y = +1.75 m and y = -1.75 m."""
    width, height = camera.image_size
    u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    ground = camera.ground_from_pixels(np.column_stack([u.ravel(), v.ravel()])).reshape(height, width, 3)
    x, y = ground[..., 0], ground[..., 1]
    image = np.empty((height, width, 3), np.uint8)
    image[:] = (135, 170, 210)  # sky, where the ray of a pixel never meets the road: x and y are NaN there
    image[np.isfinite(x)] = (90, 90, 95)
    image[np.abs(np.abs(y) - 1.75) < 0.075] = (240, 240, 240)
    return image


def main() -> None:
    camera = ipm_rs.Camera.from_cityscapes(CALIBRATION)
    image = road_image(camera)

    # 7 to 40 m ahead and 10 m to either side, in cells of 5 cm: row 0 is farthest, column 0 leftmost.
    grid = ipm_rs.BevGrid(x=(7, 40), y=(-10, 10), resolution=0.05)
    lut = ipm_rs.Lut(camera, grid)  # build it once per camera
    bev = lut.warp(image)  # and use it for every frame

    print(camera)
    print(f"{image.shape} -> {bev.shape}, {lut.mask.mean():.0%} of the cells see the image")

    # The lines are where the road has them, and straight: check their columns in a near, a middle and a far row.
    for x in (8.0, 20.0, 38.0):
        (row, left), (_, right) = np.rint(grid.cell_from_ground([[x, 1.75], [x, -1.75]])).astype(int)
        white = np.flatnonzero(bev[row, :, 0] > 165)
        print(f"x = {x:4.1f} m: row {row}, white columns {white.min()}..{white.max()}, expected {left} and {right}")
        assert np.abs(white - left).min() <= 1 and np.abs(white - right).min() <= 1
        assert (np.minimum(np.abs(white - left), np.abs(white - right)) <= 3).all()
    assert (bev[~lut.mask] == 0).mean() > 0.99  # what the camera cannot see stays black, but for the blended rim

    if len(sys.argv) > 1:
        np.save(sys.argv[1], bev)


if __name__ == "__main__":
    main()
