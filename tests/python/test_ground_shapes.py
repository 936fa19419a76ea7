"""Polygons between road and picture, planes in other frames, homographies on a metric grid."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from helpers import refuses

import ipm_rs

K = np.array([[430.0, 0, 331.2], [0, 425.0, 236.7], [0, 0, 1]])
SIZE = (640, 480)
FISHEYE = ipm_rs.KannalaBrandt([0.04, -0.015, 0.003, -0.0005])
POSE = {"position": (1.5, 0.3, 1.4), "roll": 0.05, "pitch": 0.2, "yaw": -0.3}
CAMERAS = {
    "pinhole": ipm_rs.Camera.from_euler(K, image_size=SIZE, **POSE),
    "brown": ipm_rs.Camera.from_euler(K, image_size=SIZE, lens=ipm_rs.BrownConrady([-0.3, 0.1, 0, 0]), **POSE),
    "fisheye": ipm_rs.Camera.from_euler(
        [[180.0, 0, 319.5], [0, 182, 239.5], [0, 0, 1]], image_size=SIZE, lens=FISHEYE, **POSE
    ),
}
each_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
POLYGONS = {
    "ahead": [[5.0, 2], [5, -3], [12, -4], [14, 1]],
    "around the camera": [[-20.0, 9], [-20, -8], [30, -7], [30, 10]],
    "concave": [[4.0, 3], [15, 3], [15, 1], [6, 1], [6, -2], [15, -2], [15, -4], [4, -4]],
    "from behind": [[-10.0, 1], [-10, -2], [40, -2], [40, 1]],
}


def within(ring, points):
    """Whether points are in a polygon, by the even-odd rule."""
    inside = np.zeros(len(points), bool)
    for (ax, ay), (bx, by) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        crosses = (ay > points[:, 1]) != (by > points[:, 1])
        with np.errstate(all="ignore"):
            inside ^= crosses & (points[:, 0] < (bx - ax) * (points[:, 1] - ay) / (by - ay) + ax)
    return inside


@each_camera
@pytest.mark.parametrize("name", POLYGONS)
def test_a_pixel_is_in_the_image_of_a_polygon_if_its_road_is_in_the_polygon(camera, name):
    road = np.array(POLYGONS[name])
    image = camera.project_polygon(road, ground=-0.1)
    assert len(image) >= 3 and (image >= 0).all() and (image <= [639, 479]).all()
    uv = np.random.default_rng(1).uniform([0, 0], [639, 479], (4000, 2))
    xyz = camera.ground_from_pixels(uv, ground=-0.1)
    known = ~np.isnan(camera.unproject(uv)[:, 0])
    expected = within(road, np.nan_to_num(xyz[:, :2], nan=1e9)) & ~np.isnan(xyz[:, 0])
    wrong = (within(image, uv) != expected) & known
    assert 0.01 < expected.mean() < 0.99
    assert wrong.mean() < 2e-3, "but for what a few hundredths of a pixel at the edge decide"
    solid = camera.project_polygon(np.column_stack([road, np.full(len(road), -0.1)]))
    assert np.array_equal(solid, image)


def test_what_is_not_seen_has_no_image():
    for camera in CAMERAS.values():
        assert camera.project_polygon([[-30.0, 1], [-30, -1], [-60, -1], [-60, 1]]).shape == (0, 2)
    whole = CAMERAS["pinhole"].project_polygon([[9.0, 90, -90], [9, 90, 90], [9, -90, 90], [9, -90, -90]])
    filled = np.zeros((480, 640), np.uint8)
    cv2.fillPoly(filled, [np.round(whole).astype(np.int32)], 1)
    assert filled.all(), "a wall before the camera fills it"
    grown = CAMERAS["pinhole"].project_polygon([[9.0, 90, -90], [9, 90, 90], [9, -90, 90], [9, -90, -90]], margin=10)
    assert grown.min() == -10 and grown[:, 0].max() == 649


@each_camera
def test_the_ground_of_a_polygon_of_the_picture(camera):
    ring = np.array([[60.0, 20], [600, 40], [580, 470], [300, 300], [40, 460]])  # concave, and above the horizon
    plane = ipm_rs.Plane.from_angles(slope=0.02, height=-0.1)
    ground = camera.ground_polygon(ring, ground=plane, max_distance=40)
    assert len(ground) > 4 and np.abs(ground[:, 2] - plane.height_at(ground[:, :2])).max() < 1e-12
    assert np.linalg.norm(ground[:, :2] - camera.position[:2], axis=1).max() <= 40 * (1 + 1e-9)
    xy = np.random.default_rng(2).uniform([0, -20], [40, 20], (3000, 2))
    near = np.linalg.norm(xy - camera.position[:2], axis=1) < 39.9
    uv, _, _ = camera.project(xy, ground=plane)
    expected = within(ring, np.nan_to_num(uv, nan=-1e9)) & ~np.isnan(uv[:, 0])
    assert expected[near].mean() > 0.02
    assert (within(ground[:, :2], xy) != expected)[near].mean() < 4e-3
    sky = camera.ground_polygon([[300.0, 2], [340, 2], [340, 20]], ground=0.0)
    assert sky.shape == (0, 3)


def test_wrong_polygons():
    camera = CAMERAS["fisheye"]
    with refuses(ipm_rs.ArgumentError, "points", "from 3"):
        camera.project_polygon([[5.0, 1], [6, 1]])
    with refuses(ipm_rs.ArgumentError, "points", "shape (3, 4)"):
        camera.project_polygon(np.zeros((3, 4)))
    with refuses(ipm_rs.ArgumentError, "points", "NaN"):
        camera.project_polygon([[5.0, 1], [6, 1], [np.nan, 2]])
    with refuses(ipm_rs.ArgumentError, "ground", "(N, 3)"):
        camera.project_polygon(np.ones((3, 3)), ground=0.0)
    with refuses(ipm_rs.ArgumentError, "HeightMap", "project_polyline"):
        camera.project_polygon(np.ones((3, 2)), ground=ipm_rs.HeightMap(np.zeros((3, 3)), origin=(0, 0), spacing=1.0))
    with refuses(ipm_rs.ArgumentError, "margin"):
        camera.project_polygon(np.ones((3, 2)), margin=-1)
    with refuses(ipm_rs.ArgumentError, "pixels", "ray"):
        camera.ground_polygon([[-5e4, 0.0], [5, 5], [9, 9]])
    with refuses(ipm_rs.ArgumentError, "max_distance"):
        camera.ground_polygon([[0.0, 0], [5, 5], [9, 9]], max_distance=0)


# ---------------------------------------------------------------------------------------------------------------------
# Planes


def test_planes_in_other_frames():
    plane = ipm_rs.Plane(normal=(0.1, -0.05, 1), point=(3, 2, -0.4))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = ipm_rs.rotation_from_euler(0.1, -0.2, 2.0), (4, 5, 6)
    moved = plane.transformed(T)
    points = np.column_stack([xy := np.random.default_rng(3).uniform(-9, 9, (20, 2)), plane.height_at(xy)])
    there = points @ T[:3, :3].T + T[:3, 3]
    assert np.abs(moved.height_at(there[:, :2]) - there[:, 2]).max() < 1e-12
    assert np.allclose(moved.transformed(np.linalg.inv(T)).coefficients, plane.coefficients, rtol=0, atol=1e-12)

    camera = CAMERAS["fisheye"]
    pose = camera.camera_from_vehicle
    normal, point = pose[:3, :3] @ plane.normal, pose[:3, :3] @ points[0] + pose[:3, 3]
    measured = ipm_rs.Plane.from_camera(camera, normal=-2 * normal, point=point)
    assert np.allclose(measured.coefficients, plane.coefficients, rtol=0, atol=1e-12)


def test_wrong_planes():
    plane = ipm_rs.Plane(normal=(0, 0, 1))
    with refuses(ipm_rs.ArgumentError, "T", "(4, 4)"):
        plane.transformed(np.eye(3))
    for T in (np.diag([2.0, 2, 2, 1]), np.diag([1.0, -1, 1, 1]), np.diag([np.nan, 1, 1, 1])):
        with refuses(ipm_rs.CalibrationError, "T", "rotation"):
            plane.transformed(T)
    upright = np.eye(4)
    upright[:3, :3] = ipm_rs.rotation_from_euler(np.pi / 2, 0, 0)
    with refuses(ipm_rs.ArgumentError, "upright"):
        plane.transformed(upright)
    with refuses(ipm_rs.ArgumentTypeError, "camera"):
        ipm_rs.Plane.from_camera(K, normal=(0, -1, 0), point=(0, 1, 0))
    with refuses(ipm_rs.ArgumentTypeError, "normal"):
        ipm_rs.Plane.from_camera(CAMERAS["brown"], normal=(0, -1), point=(0, 1, 0))


# ---------------------------------------------------------------------------------------------------------------------
# Homographies


def clicks(count, noise=0.0, seed=5):
    camera = CAMERAS["pinhole"]
    rng = np.random.default_rng(seed)
    xy = rng.uniform([4, -4], [20, 3], (count, 2))
    return camera.project(xy, ground=0.0)[0] + rng.normal(0, noise, (count, 2)), xy


def test_a_homography_goes_both_ways_up_to_its_horizon():
    camera = CAMERAS["pinhole"]
    uv, xy = clicks(8)
    found = ipm_rs.Homography.from_points(uv, xy)
    assert found.errors.max() < 1e-9 and found.used.all()
    points = np.random.default_rng(6).uniform([-20, -20], [60, 20], (500, 2))
    pixels = found.pixels_from_ground(points)
    expected = camera.project(points, ground=0.0)[0]
    assert np.array_equal(np.isnan(pixels), np.isnan(expected))
    seen = ~np.isnan(pixels[:, 0])
    near = seen & (np.abs(pixels).max(axis=1) < 1e4)
    assert near.sum() > 100 and np.abs(pixels - expected)[near].max() < 1e-6
    assert np.allclose(found.ground_from_pixels(pixels[near]), points[near], rtol=0, atol=1e-8)
    sky = found.ground_from_pixels([[320.0, 5.0], [320.0, 470.0]])
    assert np.isnan(sky[0]).all() and not np.isnan(sky[1]).any()
    again = ipm_rs.Homography.from_matrix(-7 * found.matrix, seen=(8.0, 0.0))
    assert np.allclose(again.pixels_from_ground(points), pixels, equal_nan=True)


@pytest.mark.parametrize(("count", "wrong"), [(6, 1), (12, 5), (40, 18)])
def test_wrong_clicks_are_left_out(count, wrong):
    uv, xy = clicks(count, noise=0.5, seed=count)
    uv[:wrong] += np.random.default_rng(1).uniform(40, 200, (wrong, 2))
    found = ipm_rs.Homography.from_points(uv, xy, tolerance=3.0)
    assert not found.used[:wrong].any() and found.used[wrong:].all()
    assert found.errors[wrong:].max() < 3 and found.errors[:wrong].min() > 10
    assert np.array_equal(found.matrix, ipm_rs.Homography.from_points(uv, xy, tolerance=3.0).matrix), "the same again"
    alone, _ = ipm_rs.homography_from_points(uv[wrong:], xy[wrong:])
    assert np.allclose(found.matrix / found.matrix[2, 2], alone / alone[2, 2], rtol=1e-6, atol=1e-9)


def test_a_table_of_a_homography_on_a_grid_is_that_of_its_camera():
    grid = ipm_rs.BevGrid(x=(-10, 30), y=(-6, 6), resolution=0.2)
    uv, xy = clicks(8)
    matrix = ipm_rs.Homography.from_points(uv, xy).matrix
    expected = ipm_rs.Lut(CAMERAS["pinhole"], grid)
    for scale in (1, -2.5):
        lut = ipm_rs.Lut.from_homography(matrix * scale, grid=grid, source_size=SIZE)
        assert np.array_equal(lut.mask, expected.mask) and lut.grid == grid and lut.camera is None
        assert np.nanmax(np.abs(np.array(lut.maps()) - np.array(expected.maps()))) < 2e-4
    with refuses(ipm_rs.ArgumentError, "M", "mirror image", "diag"):
        ipm_rs.Lut.from_homography(matrix @ np.diag([1, -1, 1]), grid=grid, source_size=SIZE)
    with refuses(ipm_rs.ArgumentError, "size", "grid"):
        ipm_rs.Lut.from_homography(matrix, size=(4, 4), grid=grid, source_size=SIZE)
    with refuses(ipm_rs.LutError, "M", "determinant"):
        ipm_rs.Lut.from_homography(np.ones((3, 3)), grid=grid, source_size=SIZE)


def test_wrong_homographies():
    uv, xy = clicks(6)
    with refuses(ipm_rs.ArgumentError, "tolerance"):
        ipm_rs.Homography.from_points(uv, xy, tolerance=0)
    with refuses(ipm_rs.ArgumentError, "as many"):
        ipm_rs.Homography.from_points(uv, xy[:5], tolerance=2)
    with refuses(ipm_rs.ArgumentError, "image_points"):
        ipm_rs.Homography.from_points(uv, np.column_stack([np.arange(6.0), np.zeros(6)]), tolerance=2)
    with refuses(ipm_rs.ArgumentError, "singular"):
        ipm_rs.Homography.from_matrix(np.ones((3, 3)), seen=(1, 1))
    with refuses(ipm_rs.ArgumentError, "seen", "horizon"):
        ipm_rs.Homography.from_matrix(np.eye(3)[[2, 1, 0]], seen=(0, 1))
