"""Between pixels, metres on the road, and cells of the grid: all directions, with points.

A detector gives the foot of an obstacle in pixels; a planner wants metres; a picture of the result wants cells.
"""

from __future__ import annotations

import numpy as np

import ipm_rs


def main() -> None:
    intrinsics = np.array([[1000.0, 0.0, 639.5], [0.0, 1000.0, 359.5], [0.0, 0.0, 1.0]])
    camera = ipm_rs.Camera.from_euler(
        intrinsics, image_size=(1280, 720), position=(1.2, 0.0, 1.5), pitch=0.05, yaw=0.02
    )
    grid = ipm_rs.BevGrid(x=(5, 45), y=(-10, 10), resolution=0.1)

    # Road -> image. Points on the road may leave out z; `ground=` is its height, 0 by default.
    on_road = np.array([[10.0, 0.0], [20.0, 3.5], [20.0, -3.5], [-5.0, 0.0], [6.0, 9.0]])
    uv, depth, valid = camera.project(on_road)
    for point, pixel, metres, seen in zip(on_road, uv, depth, valid, strict=True):
        print(f"road {point} -> pixel {pixel.round(2)}, depth {metres:6.2f} m, {'seen' if seen else 'not seen'}")
    assert valid.tolist() == [True, True, True, False, False]
    assert np.isnan(uv[3]).all()  # behind the camera: no pixel
    assert np.isfinite(uv[4]).all()  # left of the image: the pixel is exact all the same
    assert uv[1, 0] < uv[0, 0] < uv[2, 0]  # +y is left

    # Image -> road, and back to where we came from.
    back = camera.ground_from_pixels(uv)
    assert np.allclose(back[valid, :2], on_road[valid], atol=1e-9) and (back[valid, 2] == 0).all()
    sky = camera.ground_from_pixels([[640.0, 10.0]])
    assert np.isnan(sky).all()  # this ray never meets the road
    print(f"pixel (640, 10) -> {sky[0]}: sky")

    # Road -> cells (row, column), integers at the samples, and back.
    cells = grid.cell_from_ground(on_road[valid])
    print(f"cells:\n{cells.round(2)}")
    assert np.allclose(grid.ground_from_cell(cells), on_road[valid])
    assert np.allclose(grid.xy()[100, 50], grid.ground_from_cell([[100.0, 50.0]])[0])

    # The table holds the same geometry: the coordinates at which a cell samples the image are those of project().
    map_x, map_y = ipm_rs.Lut(camera, grid).maps()
    row, column = 200, 110
    pixel, _, _ = camera.project(grid.xy()[row, column][None])
    assert np.allclose(pixel[0], [map_x[row, column], map_y[row, column]], atol=1e-3)

    # A half-size image needs half-size intrinsics; the half pixel at the corner is taken care of.
    small, _, _ = camera.resized(640, 360).project(on_road[:1])
    assert np.allclose(small, (uv[:1] + 0.5) / 2 - 0.5)


if __name__ == "__main__":
    main()
