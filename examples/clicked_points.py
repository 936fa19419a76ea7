"""A bird's-eye view without a calibration: from points clicked in the image, or from lane markings.

Somebody has measured four marks on the road, or knows the camera's height and focal length and sees two straight lines.
"""

from __future__ import annotations

import numpy as np

import ipm_rs


def main() -> None:
    # What is not known: the camera that took the picture. It stands in for the picture here.
    intrinsics = np.array([[1000.0, 0.0, 639.5], [0.0, 1000.0, 359.5], [0.0, 0.0, 1.0]])
    truth = ipm_rs.Camera.from_euler(intrinsics, image_size=(1280, 720), position=(0.0, 0.0, 1.5), pitch=0.05, yaw=0.02)
    grid = ipm_rs.BevGrid(x=(5, 45), y=(-8, 8), resolution=0.1)
    expected = ipm_rs.Lut(truth, grid)

    # Marks on the road, metres (x ahead, y left), and where they were clicked, to half a pixel or so.
    places = np.array([[8.0, 2.0], [8.0, -2.0], [30.0, -3.5], [30.0, 3.5], [15.0, 0.0], [20.0, 3.5]])
    clicked = truth.project(places)[0] + np.random.default_rng(1).normal(0, 0.3, (6, 2))

    lut = ipm_rs.Lut.from_ground_points(clicked, places, grid, source_size=(1280, 720))
    off = np.abs(np.subtract(lut.maps(), expected.maps()))
    print(f"six clicks: the view is off by {np.nanmedian(off):.2f} pixels of the image, {np.nanmax(off):.2f} at most")
    assert np.nanmedian(off) < 1 and np.nanmax(off) < 5

    # One click in the wrong place stands out.
    clicked[4] += (15, 6)
    _, errors = ipm_rs.homography_from_points(clicked, places)
    print(f"a misplaced click: {errors.round(1)} pixels off")
    assert errors.argmax() == 4

    # Two lane markings instead, and the camera's height and focal length.
    marks = np.array([[[8.0, 1.75], [40.0, 1.75]], [[8.0, -1.75], [40.0, -1.75]]])
    lines = truth.project(marks.reshape(-1, 2))[0].reshape(-1, 2, 2)
    found = ipm_rs.Camera.from_vanishing_point(
        ipm_rs.vanishing_point(lines), image_size=(1280, 720), focal_length=1000, height=1.5
    )
    print(f"from two markings: {found}")
    assert np.allclose(found.camera_from_vehicle, truth.camera_from_vehicle, atol=1e-9)
    assert ipm_rs.Lut(found, grid).mask.mean() == expected.mask.mean()


if __name__ == "__main__":
    main()
