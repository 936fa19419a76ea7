"""Poses from ground points through any lens, and cameras from projection matrices and angles of view."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors, refine

K = [[420.0, 1.0, 640.0], [0, 415.0, 470.0], [0, 0, 1]]
SIZE = (1280, 960)
LENSES = {
    "pinhole": None,
    "brown": ipm_rs.BrownConrady([-0.2, 0.05, 1e-3, -5e-4, -0.005]),
    "kannala": ipm_rs.KannalaBrandt([0.041, -0.016, 0.0035, -0.0006]),
    "mei": ipm_rs.Mei(0.9, [-0.02, 0.003, 1e-4, 2e-4]),
    "double sphere": ipm_rs.DoubleSphere(-0.1, 0.57),
    "eucm": ipm_rs.Eucm(0.6, 1.05),
}
GROUND = np.array([[2, 1], [2.5, -1.5], [4, 0.3], [5, 2.5], [6, -2], [3, 2], [1.6, -0.4], [9, 1], [8, -3]])


def camera(lens=None, **pose) -> ipm_rs.Camera:
    given = {"position": (0.4, -0.2, 2.1), "roll": 0.04, "pitch": 0.45, "yaw": -0.1, **pose}
    return ipm_rs.Camera.from_euler(K, image_size=SIZE, lens=lens, **given)


def clicks(true, ground=GROUND, height=0.0) -> np.ndarray:
    return true.project(np.column_stack([ground, np.full(len(ground), height)]))[0]


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("count", [4, 9])
def test_exact_points_give_the_pose_itself(name, count):
    true = camera(LENSES[name])
    options = {"K": K, "image_size": SIZE, "lens": LENSES[name]}
    found = ipm_rs.Camera.from_ground_points(clicks(true)[:count], GROUND[:count], **options)
    np.testing.assert_allclose(found.vehicle_from_camera, true.vehicle_from_camera, atol=1e-9)
    assert found.lens == true.lens and found.image_size == SIZE


def test_a_ground_that_is_not_at_zero_and_a_camera_that_looks_back():
    true = camera(LENSES["kannala"], yaw=2.9, position=(1.0, 0.5, 1.5))
    behind = GROUND * (-1, 1)
    found = refine.from_ground_points(
        clicks(true, behind, -0.3), behind, K=K, image_size=SIZE, lens=true.lens, ground=-0.3
    )
    np.testing.assert_allclose(found.camera.vehicle_from_camera, true.vehicle_from_camera, atol=1e-9)
    assert found.used.all() and np.abs(found.residuals).max() < 1e-7


def test_wrong_points_are_left_out():
    true, random = camera(LENSES["kannala"]), np.random.default_rng(3)
    ground = random.uniform((1.5, -4), (12, 4), (24, 2))
    pixels = clicks(true, ground) + random.normal(0, 0.3, (24, 2))
    wrong = np.zeros(24, bool)
    wrong[[1, 5, 8, 13, 20, 21]] = True
    pixels[wrong] += random.uniform(30, 90, (6, 2))
    found = refine.from_ground_points(pixels, ground, K=K, image_size=SIZE, lens=true.lens)
    np.testing.assert_array_equal(found.used, ~wrong)
    np.testing.assert_allclose(found.camera.position, true.position, atol=0.02)
    again = refine.from_ground_points(pixels, ground, K=K, image_size=SIZE, lens=true.lens)
    assert again.camera == found.camera


def test_the_covariance_is_that_of_the_errors():
    true = camera(LENSES["kannala"])
    errors_, stated, at_40 = [], [], []
    for seed in range(20):
        pixels = clicks(true) + np.random.default_rng(seed).normal(0, 1, (9, 2))
        found = refine.from_ground_points(pixels, GROUND, K=K, image_size=SIZE, lens=true.lens, tolerance=20)
        errors_.append(found.camera.position - true.position)
        stated.append(np.sqrt(np.diag(found.covariance)[:3]))
        at_40.append(found.ground_deviation([[10, 0], [20, 0], [40, 0]])[:, 0])
    ratio = np.abs(errors_) / stated
    # 60 numbers: 68 and 95 % of them, give or take what so few allow (three standard deviations of a binomial)
    assert 0.5 < (ratio < 1).mean() < 0.87 and (ratio < 2).mean() > 0.86
    near, middle, far = np.median(at_40, axis=0)
    assert (
        near < middle / 2 < far / 4 and far > 0.3
    )  # with the square of the distance: clicks at 10 m say little of 40 m


def test_the_deviation_at_a_distance_is_what_other_clicks_would_say():
    true = camera()
    pixel = true.project([[20.0, 0.0, 0.0]])[0]
    seen, stated = [], []
    for seed in range(20):
        pixels = clicks(true) + np.random.default_rng(seed).normal(0, 0.5, (9, 2))
        found = refine.from_ground_points(pixels, GROUND, K=K, image_size=SIZE, tolerance=20)
        seen.append(found.camera.ground_from_pixels(pixel)[0, 0])
        stated.append(found.ground_deviation([[20.0, 0.0]])[0, 0])
    assert 0.5 < np.std(seen) / np.median(stated) < 1.7


def test_wrong_input():
    true = camera()
    options = {"K": K, "image_size": SIZE}
    pixels = clicks(true)
    with refuses(errors.ArgumentError, "at least 4 points"):
        refine.from_ground_points(pixels[:3], GROUND[:3], **options)
    with refuses(errors.ArgumentError, "as many of both"):
        refine.from_ground_points(pixels[:5], GROUND[:6], **options)
    line = np.column_stack([np.arange(6.0) + 2, 0.5 * np.arange(6)])
    with refuses(errors.ArgumentError, "one line"):
        refine.from_ground_points(clicks(true, line), line, **options)
    with refuses(errors.ArgumentError, "mirror image"):
        refine.from_ground_points(pixels, GROUND * (1, -1), **options)
    with refuses(errors.ArgumentError, "no four agree"):
        random = np.random.default_rng(0).uniform(0, 900, (9, 2))
        refine.from_ground_points(random, GROUND, tolerance=0.01, **options)
    for wrong in (np.where(pixels > 600, np.nan, pixels), pixels[:, :1], pixels.astype(str)):
        with refuses(errors.IpmError, "pixels"):
            refine.from_ground_points(wrong, GROUND, **options)
    looking = ipm_rs.Camera.from_euler(K, image_size=SIZE, position=(0, 0, 1.4), pitch=0.06)
    ahead = np.array([[6.0, -2], [6, 2], [12, 2], [12, -2], [20, 0]])
    with refuses(errors.ArgumentError, "how high", "swapped"):
        refine.from_ground_points(ahead, clicks(looking, ahead), K=K, image_size=SIZE)
    with refuses(errors.ArgumentError, "how high"):  # on one row: seen from within the road's plane
        refine.from_ground_points(
            np.column_stack([np.linspace(400, 900, 5), np.full(5, 480.0)]), ahead, K=K, image_size=SIZE, tolerance=50
        )
    with refuses(errors.ArgumentError, "tolerance"):
        refine.from_ground_points(pixels, GROUND, tolerance=0, **options)
    with refuses(errors.CalibrationError, "the lens sees"):
        far = np.full((9, 2), 1e6) + np.arange(9)[:, None]
        refine.from_ground_points(far, GROUND, lens=LENSES["kannala"], **options)


def test_a_projection_matrix_is_taken_apart():
    true = camera(pitch=0.2)
    P = np.asarray(true.intrinsics) @ true.camera_from_vehicle[:3]
    for scale in (1, 0.37, -5e3):
        found = ipm_rs.Camera.from_projection(scale * P, image_size=SIZE)
        np.testing.assert_allclose(found.intrinsics, true.intrinsics, atol=1e-9)
        np.testing.assert_allclose(found.vehicle_from_camera, true.vehicle_from_camera, atol=1e-12)
    with refuses(errors.CalibrationError, "singular"):
        ipm_rs.Camera.from_projection(np.ones((3, 4)), image_size=SIZE)
    with refuses(errors.ArgumentError, "shape (3, 4)"):
        ipm_rs.Camera.from_projection(np.eye(3), image_size=SIZE)
    with refuses(errors.ArgumentTypeError, "numbers"):
        ipm_rs.Camera.from_projection("P", image_size=SIZE)


def test_an_angle_of_view():
    wide = ipm_rs.Camera.from_fov(np.radians(90), image_size=(640, 480), position=(0, 0, 1.5), pitch=0.1)
    np.testing.assert_allclose(wide.intrinsics, [[320, 0, 319.5], [0, 320, 239.5], [0, 0, 1]])
    np.testing.assert_allclose(wide.position, [0, 0, 1.5], atol=1e-12)
    tall = ipm_rs.Camera.from_fov(np.radians(90), image_size=(640, 480), vertical=True)
    np.testing.assert_allclose(tall.intrinsics[0, 0], 240)
    for wrong in (0, np.pi, 90, np.nan):
        with refuses(errors.CalibrationError, "fov"):
            ipm_rs.Camera.from_fov(wrong, image_size=(640, 480))
    with refuses(errors.ArgumentTypeError, "vertical"):
        ipm_rs.Camera.from_fov(1.0, image_size=(640, 480), vertical="yes")


def differences(found: ipm_rs.Camera, true: ipm_rs.Camera) -> float:
    return float(np.abs(found.vehicle_from_camera - true.vehicle_from_camera).max())


@pytest.mark.parametrize("lens", [None, LENSES["kannala"]])
def test_the_focal_length_is_found_too(lens):
    square = np.diag([1, 420 / 415, 1]) @ np.array(K) * (np.array([[1, 0, 1], [1, 1, 1], [1, 1, 1]]))
    true = ipm_rs.Camera.from_euler(square, image_size=SIZE, position=(0.4, -0.2, 2.1), pitch=0.45, lens=lens)
    options = {"image_size": SIZE, "lens": lens, "principal_point": true.intrinsics[:2, 2]}
    found = refine.from_ground_points(clicks(true), GROUND, **options)
    assert differences(found.camera, true) < 1e-9 and abs(found.camera.intrinsics[0, 0] - 420) < 1e-6
    assert found.covariance.shape == (7, 7) and "focal_length" in str(sorted(found.deviations))
    down = ipm_rs.Camera.from_euler(K, image_size=SIZE, position=(0, 0, 5), pitch=np.pi / 2)
    square = np.array([[1, 1.0], [-1, 2], [-1, -1.5], [1, -1]])
    with refuses(
        errors.ArgumentError, "expected points that tell"
    ):  # twice as high with twice the focal length looks the same
        refine.from_ground_points(clicks(down, square), square, image_size=SIZE, principal_point=(640, 470))
    with refuses(errors.ArgumentError, "principal_point"):
        refine.from_ground_points(clicks(true), GROUND, K=K, **options)


def test_focal_lengths_are_off_by_what_is_stated():
    true = ipm_rs.Camera.from_fov(1.3, image_size=SIZE, position=(0.4, -0.2, 2.1), pitch=0.3)
    ratio = []
    for seed in range(20):
        pixels = clicks(true) + np.random.default_rng(seed).normal(0, 1, (9, 2))
        found = refine.from_ground_points(pixels, GROUND, image_size=SIZE)
        ratio.append((found.camera.intrinsics[0, 0] - true.intrinsics[0, 0]) / found.deviations["focal_length"])
    assert 9 <= np.sum(np.abs(ratio) < 1) <= 18 and np.sum(np.abs(ratio) < 2) >= 17


def test_a_road_that_climbs():
    climb = ipm_rs.Plane.from_angles(slope=0.1, bank=-0.05, height=0.2)
    true = camera(LENSES["eucm"])
    pixels = true.project(GROUND, ground=climb)[0]
    found = refine.from_ground_points(pixels, GROUND, K=K, image_size=SIZE, lens=true.lens, ground=climb)
    assert differences(found.camera, true) < 1e-9
    seen = found.ground_deviation([[6.0, 0.0], [-50.0, 0.0]])
    assert np.isfinite(seen[0]).all() and np.isinf(seen[1]).all(), "what is behind is not known at all"
    unknown = ipm_rs.HeightMap(np.zeros((4, 4)), origin=(0, -1), spacing=1.0)
    with refuses(errors.ArgumentError, "knows the road", "leave it out"):
        refine.from_ground_points(pixels, GROUND, K=K, image_size=SIZE, lens=true.lens, ground=unknown)


@pytest.mark.parametrize("name", LENSES)
def test_points_of_any_height(name):
    true = camera(LENSES[name])
    points = np.column_stack([GROUND, [0, 0.5, 1.2, 0.3, 1.9, 0.1, 0.7, 1.1, 0.2]])
    options = {"K": K, "image_size": SIZE, "lens": true.lens}
    pixels = true.project(points)[0]
    assert differences(ipm_rs.Camera.from_points(pixels, points, **options), true) < 1e-9
    three = refine.from_points(pixels[:3], points[:3], **options)
    every = [three.camera, *three.alternatives]
    assert min(differences(each, true) for each in every) < 1e-7
    for each in every:
        np.testing.assert_allclose(each.project(points[:3])[0], pixels[:3], atol=1e-6)
    up = [-each.vehicle_from_camera[2, 1] for each in every]
    assert up == sorted(up, reverse=True), "the most upright comes first"
    with refuses(errors.ArgumentError, "at least 4"):
        refine.from_points(pixels[:3], points[:3], image_size=SIZE)


def test_a_camera_that_looks_straight_down_has_finite_deviations():
    down = ipm_rs.Camera.from_euler(K, image_size=SIZE, position=(0, 0, 5), pitch=np.pi / 2)
    square = np.array([[1, 1.0], [-1, 2], [-1, -1.5], [1, -1]])
    found = refine.from_ground_points(clicks(down, square), square, K=K, image_size=SIZE)
    assert differences(found.camera, down) < 1e-9
    assert max(found.deviations[name] for name in ("roll", "pitch", "yaw")) < 0.05
    assert "4 of 4 points" in str(found) and "at 40 m" in str(found)
