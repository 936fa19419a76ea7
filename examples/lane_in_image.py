"""Lanes drawn back into a fisheye image, on a road that is not flat; where the horizon is, and how far rows see.

A lane passes the car: it starts behind the camera, leaves the image, and is bent by the lens.
"""

from __future__ import annotations

import numpy as np

import ipm_rs


def main() -> None:
    lens = ipm_rs.KannalaBrandt([0.05, -0.02, 0.003, 0.0], max_angle=np.radians(95))
    intrinsics = np.array([[320.0, 0.0, 639.5], [0.0, 320.0, 399.5], [0.0, 0.0, 1.0]])
    camera = ipm_rs.Camera.from_euler(
        intrinsics, image_size=(1280, 800), position=(2.0, 0.0, 1.2), pitch=0.3, lens=lens
    )
    lane = np.array([[-20.0, 1.75], [30.0, 1.75], [60.0, 4.0]])

    # Pieces (M, 2) in pixels, for cv2.polylines: nothing wraps, and no curve is missed by over a quarter pixel.
    (piece,) = camera.project_polyline(lane)
    print(f"lane: {len(piece)} points from {piece[0].round(1)} to {piece[-1].round(1)}")
    assert (piece >= 0).all() and (piece <= [1279, 799]).all()
    assert np.allclose(piece[-1], camera.project(lane[-1:])[0][0])

    # On a road with a crest, the lane behind it is not drawn.
    xy = np.stack(np.meshgrid(np.arange(-25.0, 65.0), np.arange(-10.0, 11.0), indexing="ij"), axis=-1)
    heights = 1.0 * np.exp(-(((xy[..., 0] - 20) / 4) ** 2))
    crest = ipm_rs.HeightMap(heights, origin=(-25, -10), spacing=1)
    pieces = camera.project_polyline(lane, ground=crest)
    drawn = np.concatenate(pieces)
    shown = camera.ground_from_pixels(drawn, ground=crest)
    print(f"with a crest at x = 20 m: drawn up to x = {np.nanmax(shown[:, 0]):.1f} m")
    assert np.nanmax(shown[:, 0]) < 21

    # The horizon is a curve; pixels below it see the road.
    horizon = np.concatenate(camera.horizon())
    print(f"horizon: {len(horizon)} points, row {horizon[:, 1].min():.1f} to {horizon[:, 1].max():.1f}")
    below, above = horizon + np.array([0, 2]), horizon - np.array([0, 2])
    ahead = np.abs(horizon[:, 0] - 639.5) < 400  # not at the limit of the lens
    assert not np.isnan(camera.ground_from_pixels(below[ahead])).any()
    assert np.isnan(camera.ground_from_pixels(above[ahead])).all()

    # How far the rows see, and what a pixel and a tenth of a degree of pitch are worth there.
    ranges = camera.row_ranges()
    for metres in (3, 10, 30):
        row = int(np.nanargmin(np.abs(ranges - metres)))
        by_pixel, by_pitch = camera.range_error([[639.5, row]])
        print(f"row {row}: {ranges[row]:5.1f} m; a pixel is {by_pixel[0]:.2f} m, 0.1 degree {by_pitch[0]:.2f} m")
    assert 2 < by_pixel[0] < 4 and 1 < by_pitch[0] < 2


if __name__ == "__main__":
    main()
