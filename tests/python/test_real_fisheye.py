"""Four real fisheyes around a car on a chequered cloth: in the bird's-eye view its squares measure 0.40 m and 0.80 m.

Each calibration file holds, besides K and the equidistant coefficients, a homography from an undistorted image to a
bird's-eye view at 1 cm per pixel, fitted by hand to four points. A rigid pose is fitted to it, then to every second
feature of the cloth (corners of the 0.40 m squares, centres of the discs in the 0.80 m ones); the others are measured.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import ipm_rs
from ipm_rs.calibration._filestorage import parse_storage

pytest.importorskip("yaml")
CELL = 0.02  # metres

# Pixel of each camera's view at 1 cm per pixel to the vehicle: origin in the middle of the car, x forward, y left.
VEHICLE_FROM_VIEW = {
    "front": [[0, -0.01, 8], [-0.01, 0, 6], [0, 0, 1]],
    "back": [[0, 0.01, -8], [0.01, 0, -6], [0, 0, 1]],
    "left": [[0.01, 0, -8], [0, -0.01, 6], [0, 0, 1]],
    "right": [[-0.01, 0, 8], [0, 0.01, -6], [0, 0, 1]],
}


def features(name: str) -> tuple[list, list]:
    """Nominal (x, y) of corners and of discs; the cloth is 10 m x 6 m and centred on the car."""
    if name in ("front", "back"):
        sign = 1 if name == "front" else -1
        corners = [(sign * x, y) for y in (2.6, 2.2, 1.8, 1.4, -1.4, -1.8, -2.2, -2.6) for x in (4.6, 4.2, 3.8, 3.4)]
        return corners, [(sign * x, y) for y in (0.6, -0.2) for x in (4.6, 3.8)]
    sign = 1 if name == "left" else -1
    corners = [(x, sign * y) for y in (2.6, 2.2, 1.8) for x in (4.6, 4.2, 3.8, 3.4, 3.0, 2.6, 2.2)]
    return corners, [(x, sign * y) for y in (2.6, 1.8) for x in (1.4, 0.6, -0.2, -1.0, -1.8)]


def solve(camera, rays, ground):
    """The camera, mounted where `rays` of its own frame meet `ground` points best."""
    plane = (rays[:, :2] / rays[:, 2:])[:, None].copy()
    points = np.column_stack([ground, np.zeros(len(ground))])
    _, rvec, tvec = cv2.solvePnP(points, plane, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    rvec, tvec = cv2.solvePnPRefineLM(points, plane, np.eye(3), None, rvec, tvec)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(rvec)[0], tvec[:, 0]
    return camera.with_pose(pose)


def from_homography(path, camera, name):
    """The camera at the rigid pose nearest to the file's homography."""
    content = parse_storage(path.read_text(), str(path))
    undistorted = camera.intrinsics
    undistorted[[0, 1], [0, 1]] *= np.ravel(content["scale_xy"])
    undistorted[:2, 2] += np.ravel(content["shift_xy"])
    view_from_vehicle = np.linalg.inv(VEHICLE_FROM_VIEW[name])
    camera_from_ground = np.linalg.inv(content["project_matrix"] @ undistorted) @ view_from_vehicle
    ground = np.vstack(features(name))
    return solve(camera, np.column_stack([ground, np.ones(len(ground))]) @ camera_from_ground.T, ground)


def look(camera, image, x, y):
    grid = ipm_rs.BevGrid(x=x, y=y, resolution=CELL / 2)
    return grid, ipm_rs.Lut(camera, grid).warp(image)


def measure(camera, image, name, window):
    """(x, y) where the bird's-eye view shows each corner and each disc."""
    corners, discs = features(name)
    grid, view = look(camera, image, (-6, 6), (-5, 5))
    start = grid.cell_from_ground(corners)[:, ::-1].astype(np.float32)[:, None].copy()
    size = round(window / (CELL / 2))
    found = cv2.cornerSubPix(view, start, (size, size), (-1, -1), (3, 200, 1e-5))[:, 0].astype(float)
    result = [grid.ground_from_cell(found[:, ::-1])]
    for x, y in discs:
        grid, view = look(
            camera, image, (round(x - 0.36, 2), round(x + 0.36, 2)), (round(y - 0.36, 2), round(y + 0.36, 2))
        )
        dark = cv2.threshold(view, 0, 255, cv2.THRESH_BINARY_INV + cv2.THRESH_OTSU)[1]
        _, _, sizes, centres = cv2.connectedComponentsWithStats(dark)
        result.append(grid.ground_from_cell(centres[1 + sizes[1:, 4].argmax(), ::-1][None]))
    return np.vstack(result)


def spacings(measured, nominal, distance):
    """Measured distance of every two features that are `distance` apart on the cloth."""
    apart = np.linalg.norm(nominal[:, None] - nominal[None], axis=2)
    i, j = np.nonzero(np.triu(np.abs(apart - distance) < 1e-6))
    return np.linalg.norm(measured[i] - measured[j], axis=1)


@pytest.mark.parametrize("name", ["front", "back", "left", "right"])
def test_squares_of_the_cloth(shared_data, name):
    pillow = pytest.importorskip("PIL.Image")
    folder = shared_data / "fisheye_surround"
    image = np.asarray(pillow.open(folder / f"{name}.png").convert("L"))
    lens = ipm_rs.Camera.from_opencv(folder / f"{name}.yaml", lens="fisheye")
    assert lens.image_size == (960, 640) and isinstance(lens.lens, ipm_rs.KannalaBrandt)
    looking_ahead = lens.camera_from_vehicle[:3, :3]  # rays of unproject() are in the vehicle frame
    corners, discs = (np.array(part) for part in features(name))
    nominal = np.vstack([corners, discs])

    camera = from_homography(folder / f"{name}.yaml", lens, name)
    for window in (0.1, 0.1, 0.07, 0.07, 0.07):
        measured = measure(camera, image, name, window)
        pixels = camera.project(measured)[0]
        fit = slice(0, None, 2)
        camera = solve(camera, lens.unproject(pixels[fit]) @ looking_ahead.T, nominal[fit])
    measured = measure(camera, image, name, 0.07)

    squares = spacings(measured[: len(corners)], corners, 0.4)
    tiles = spacings(measured[len(corners) :], discs, 0.8)
    assert len(squares) >= 32 and len(tiles) >= 4
    assert squares.mean() == pytest.approx(0.4, abs=CELL / 2)
    assert tiles.mean() == pytest.approx(0.8, abs=CELL)
    assert squares.std() < CELL, "the cloth is creased by about 1.5 cm"
    held_out = (measured - nominal)[1::2]
    assert np.sqrt((held_out**2).mean()) < CELL
    # The car is 5 m x 2 m: the cameras sit where they must, none mirrored, 0.6 to 1.1 m high.
    expected = {"front": (2.5, 0.2), "back": (-2.0, 0.05), "left": (0.8, 1.05), "right": (0.8, -1.0)}[name]
    np.testing.assert_allclose(camera.position[:2], expected, atol=0.1)
    assert 0.6 < camera.position[2] < 1.1


@pytest.mark.parametrize("name", ["front", "back", "left", "right"])
def test_no_ghosts_within_thirty_metres(shared_data, name):
    """Every valid cell is the one place on the road that its pixel sees, and lies on the camera's side of the car."""
    path = shared_data / "fisheye_surround" / f"{name}.yaml"
    camera = from_homography(path, ipm_rs.Camera.from_opencv(path, lens="fisheye"), name)
    grid = ipm_rs.BevGrid(x=(-30, 30), y=(-30, 30), resolution=0.25)
    mask = ipm_rs.Lut(camera, grid).mask
    assert mask.mean() > 0.2
    cells = grid.xy()[mask]
    uv, _, valid = camera.project(cells)
    assert valid.mean() > 0.999  # the table's coordinates are float32: a cell on the limit may differ
    back = camera.ground_from_pixels(uv[valid])[:, :2]
    far = np.linalg.norm(cells[valid] - camera.position[:2], axis=1)
    assert (np.linalg.norm(back - cells[valid], axis=1) / far).max() < 1e-4
    rays = np.column_stack([cells, np.zeros(len(cells))]) - camera.position
    angles = np.arccos((rays @ camera.vehicle_from_camera[:3, 2]) / np.linalg.norm(rays, axis=1))
    assert angles.max() <= camera.lens.max_angle + 1e-6
