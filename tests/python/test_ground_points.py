"""Without a calibration: homographies from points, vanishing points."""

from __future__ import annotations

import math
import warnings

import cv2
import golden
import numpy as np
import pytest
from helpers import refuses
from hypothesis import assume, given
from hypothesis import strategies as st
from test_camera import cameras

import ipm_rs
from ipm_rs import errors

NAN = float("nan")
GROUND = np.array([[10.0, 3.0], [10.0, -3.0], [30.0, 4.0], [28.0, -3.5]])
IMAGE_FROM_GROUND = (golden.K @ golden.RT[:3])[:, [0, 1, 3]]


def seen(ground: np.ndarray) -> np.ndarray:
    return cv2.perspectiveTransform(np.asarray(ground, float)[None], IMAGE_FROM_GROUND)[0]


# ---------------------------------------------------------------------------------------------------------------------
# Homographies


@given(st.integers(0, 2**32 - 1))
def test_four_points_give_cv2s_transform(seed):
    ground = np.random.default_rng(seed).uniform((6, -8), (50, 8), (4, 2))
    try:
        H, off = ipm_rs.homography_from_points(seen(ground), ground)
    except errors.ArgumentError:
        assume(False)
    assert (off < 1e-6).all()
    theirs = cv2.getPerspectiveTransform(ground.astype(np.float32), seen(ground).astype(np.float32))
    # theirs takes float32 points
    grid = np.stack(np.meshgrid([10.0, 20, 40], [-5.0, 0, 5]), -1).reshape(1, -1, 2)
    truth = cv2.perspectiveTransform(grid, IMAGE_FROM_GROUND)[0]
    ours = np.abs(cv2.perspectiveTransform(grid, H)[0] - truth).max()
    assert ours < 1e-4
    assert ours <= np.abs(cv2.perspectiveTransform(grid, theirs)[0] - truth).max() + 1e-6
    assert (np.column_stack([ground, np.ones(4)]) @ H[2] > 0).all()
    np.testing.assert_allclose((np.column_stack([ground, np.ones(4)]) @ H[2]).mean(), 1, rtol=1e-9)


@given(st.integers(5, 60), st.floats(0.01, 3), st.integers(0, 2**32 - 1))
def test_many_noisy_points_fit_as_well_as_cv2s(count, noise, seed):
    random = np.random.default_rng(seed)
    ground = random.uniform((6, -8), (40, 8), (count, 2))
    image = seen(ground) + random.normal(0, noise, (count, 2))
    try:
        H, off = ipm_rs.homography_from_points(image, ground)
    except errors.ArgumentError:
        assume(False)
    theirs, _ = cv2.findHomography(ground, image, 0)
    rms = np.sqrt((off**2).mean())
    their_off = np.linalg.norm(cv2.perspectiveTransform(ground[None], theirs)[0] - image, axis=1)
    assert rms <= np.sqrt((their_off**2).mean()) * (1 + 1e-6)
    again = np.linalg.norm(cv2.perspectiveTransform(ground[None], H)[0] - image, axis=1)
    np.testing.assert_allclose(off, again, rtol=0, atol=1e-7)


def test_a_misplaced_click_stands_out():
    ground = np.array([[x, y] for x in (10.0, 15, 20, 30) for y in (-3.0, 0, 3)])
    image = seen(ground)
    image[5] += (12, -7)
    _, off = ipm_rs.homography_from_points(image, ground)
    assert off.argmax() == 5 and off[5] > 2 * np.delete(off, 5).max()


def test_units_and_origins_do_not_matter():
    """Map coordinates: hundreds of kilometres from the origin, pixels of a large image."""
    far = GROUND + np.array([691_600.0, 5_334_700.0])
    _, off = ipm_rs.homography_from_points(seen(GROUND), far)
    assert (off < 1e-5).all()
    _, off = ipm_rs.homography_from_points(seen(GROUND) * 1000, GROUND * 1e-3)
    assert (off < 1e-6).all()


@pytest.mark.parametrize(
    ("image", "ground", "error", "named"),
    [
        (seen(GROUND)[:3], GROUND[:3], errors.ArgumentError, "at least four points, got 3"),
        (seen(GROUND)[:0], GROUND[:0], errors.ArgumentError, "at least four points, got 0"),
        (seen(GROUND), GROUND[:3], errors.ArgumentError, "4 and 3 points"),
        (seen(GROUND), GROUND[[0, 1, 2, 1]], errors.ArgumentError, "ground_points: expected at least four different"),
        (seen(GROUND)[[0, 1, 2, 1]], GROUND, errors.ArgumentError, "points 1 and 3 in the same place"),
        (seen(GROUND), [[10, 3], [10, 0], [10, -3], [30, 0]], errors.ArgumentError, "points 0, 1, 2 on one line"),
        (np.ones((9, 2)), np.ones((9, 2)), errors.ArgumentError, "coincide"),
        (seen(GROUND)[[1, 0, 2, 3]], GROUND, errors.ArgumentError, "mixed up"),
        (np.full((4, 2), NAN), GROUND, errors.CalibrationError, "image_points: expected finite"),
        (seen(GROUND), GROUND * math.inf, errors.CalibrationError, "ground_points: expected finite"),
        (np.column_stack([seen(GROUND), [1] * 4]), GROUND, errors.ArgumentError, "image_points: expected shape (N, 2)"),
        ("clicks", GROUND, errors.ArgumentTypeError, "image_points: expected"),
        (seen(GROUND), None, errors.ArgumentTypeError, "ground_points: expected"),
    ],
)
def test_points_that_are_refused(image, ground, error, named):
    grid = ipm_rs.BevGrid(x=(7, 30), y=(-5, 5), resolution=0.1)
    with refuses(error, named):
        ipm_rs.homography_from_points(image, ground)
    with refuses(error, named):
        ipm_rs.Lut.from_ground_points(image, ground, grid, source_size=(2048, 1024))


def test_five_points_on_a_line_and_one_beside_it_are_refused():
    ground = np.array([[x, 0.05 * x] for x in (8.0, 12, 18, 25, 33)] + [[15.0, 3.0]])
    with refuses(errors.ArgumentError, "on one line"):
        ipm_rs.homography_from_points(seen(ground), ground)


@given(st.integers(0, 2**32 - 1), st.integers(4, 8), st.sampled_from([0, 1e-7, 1e-3, 1, 1e9]))
def test_whatever_the_points_only_our_errors(seed, count, grain):
    """Points on a coarse raster: many coincide or lie on lines."""
    random = np.random.default_rng(seed)
    image, ground = random.integers(0, 4, (2, count, 2)) * max(grain, 1) + random.normal(0, 1, (2, count, 2)) * grain
    try:
        H, off = ipm_rs.homography_from_points(image, ground)
    except errors.ArgumentError:
        return
    assert np.isfinite(H).all() and np.isfinite(off).all()
    assert (np.column_stack([ground, np.ones(count)]) @ H[2] > 0).all()


# ---------------------------------------------------------------------------------------------------------------------
# Straight to the table


def test_four_clicks_make_the_table_of_the_camera(seed_camera):
    grid = ipm_rs.BevGrid(x=(-30, 50), y=(-10, 10), resolution=0.2)
    lut = ipm_rs.Lut.from_ground_points(seen(GROUND), GROUND, grid, source_size=(2048, 1024))
    expected = ipm_rs.Lut(seed_camera, grid)
    np.testing.assert_array_equal(lut.mask, expected.mask)
    assert not lut.mask[grid.xy()[..., 0] < 1].any(), "nothing behind the camera"
    for ours, theirs in zip(lut.maps(outside=-9), expected.maps(outside=-9), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=2.5e-4)


def test_a_mirrored_road_is_refused(seed_camera):
    grid = ipm_rs.BevGrid(x=(7, 30), y=(-5, 5), resolution=0.1)
    with refuses(errors.ArgumentError, "mirror image", "sign of y"):
        ipm_rs.Lut.from_ground_points(seen(GROUND), GROUND * (1, -1), grid, source_size=(2048, 1024))
    with refuses(errors.ArgumentTypeError, "grid: expected an ipm_rs.BevGrid"):
        ipm_rs.Lut.from_ground_points(seen(GROUND), GROUND, GROUND, source_size=(2048, 1024))


# ---------------------------------------------------------------------------------------------------------------------
# Vanishing points


def test_lines_of_the_road_meet_where_x_points(seed_camera):
    marks = np.array([[[8.0, y], [40.0, y]] for y in (-5.25, -1.75, 1.75, 5.25)])
    lines = seed_camera.project(marks.reshape(-1, 2))[0].reshape(-1, 2, 2)
    for some in (lines, lines[:2], lines[:, ::-1]):
        np.testing.assert_allclose(ipm_rs.vanishing_point(some), golden.VANISHING_POINT, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("lines", "error", "named"),
    [
        ([[[0, 0], [1, 1]]], errors.ArgumentError, "at least two, got 1"),
        ([[[0, 0], [1, 1]], [[5, 0], [6, 1]]], errors.ArgumentError, "parallel"),
        ([[[0, 0], [1, 1]], [[5, 2], [5, 2]]], errors.ArgumentError, "line 1 with both points in one place"),
        ([[[0, NAN], [1, 1]], [[5, 2], [5, 3]]], errors.CalibrationError, "lines: expected finite"),
        ([[0, 0, 1, 1], [5, 0, 6, 0]], errors.ArgumentError, "(N, 2, 2), two points (u, v) of each line, got (2, 4)"),
        ("lines", errors.ArgumentTypeError, "lines: expected"),
    ],
)
def test_lines_that_are_refused(lines, error, named):
    with refuses(error, named):
        ipm_rs.vanishing_point(lines)


@pytest.mark.parametrize(
    "lens",
    [
        None,
        ipm_rs.KannalaBrandt([0.05, -0.012, 0.002, -0.0004]),
        ipm_rs.BrownConrady([-0.28, 0.07, 5e-4, -3e-4, 0.0]),
        ipm_rs.DoubleSphere(-0.2, 0.58),
    ],
    ids=repr,
)
def test_lines_of_a_raw_picture_meet_through_its_lens(lens):
    K, size = [[405.0, 0, 652.0], [0, 402.0, 468.0], [0, 0, 1]], (1300, 940)
    pose = {"position": (0.4, 0.1, 1.45), "pitch": 0.25, "yaw": -0.12}
    camera = ipm_rs.Camera.from_euler(K, image_size=size, lens=lens, **pose)
    lines = np.array([camera.project([[2.5, y, 0], [16.0, y, 0]])[0] for y in (-2.1, 1.4, 3.0, 0.1)])
    expected = camera.project([[1e12, 0, 0]])[0][0]
    for clicked in (lines[:2], lines):
        elsewhere = camera.with_pose(np.eye(4))  # the pose does not matter
        np.testing.assert_allclose(ipm_rs.vanishing_point(clicked, camera=elsewhere), expected, rtol=0, atol=1e-6)
    if lens is None:
        np.testing.assert_allclose(ipm_rs.vanishing_point(lines), expected, rtol=0, atol=1e-6)
    else:
        assert np.hypot(*(np.array(ipm_rs.vanishing_point(lines[:2])) - expected)) > 2, "straight lines miss it"
    found = ipm_rs.Camera.from_vanishing_point(
        ipm_rs.vanishing_point(lines, camera=camera),
        image_size=size,
        focal_length=(405.0, 402.0),
        principal_point=(652.0, 468.0),
        height=1.45,
        x=0.4,
        y=0.1,
        lens=lens,
    )
    np.testing.assert_allclose(found.camera_from_vehicle, camera.camera_from_vehicle, rtol=0, atol=1e-8)


def test_lines_through_a_camera_that_are_refused():
    lens = ipm_rs.KannalaBrandt([0.05, -0.012, 0.002, -0.0004], max_angle=1.2)
    camera = ipm_rs.Camera([[405.0, 0, 652.0], [0, 402.0, 468.0], [0, 0, 1]], image_size=(1300, 940), lens=lens)
    line = [[300.0, 800.0], [500.0, 500.0]]
    with refuses(errors.ArgumentTypeError, "camera", "ipm_rs.Camera", "KannalaBrandt"):
        ipm_rs.vanishing_point([line, line], camera=lens)
    with refuses(errors.ArgumentError, "at least two"):
        ipm_rs.vanishing_point([line], camera=camera)
    with refuses(errors.ArgumentError, "one and the same"):
        ipm_rs.vanishing_point([line, line], camera=camera)
    with refuses(errors.ArgumentError, "one place"):
        ipm_rs.vanishing_point([line, [line[0], line[0]]], camera=camera)
    with refuses(errors.ArgumentError, "lens", "of line 1"):
        ipm_rs.vanishing_point([line, [[-4000.0, 0.0], [9.0, 9.0]]], camera=camera)


@given(cameras())
def test_the_camera_of_its_own_vanishing_point(camera):
    """Every camera that looks ahead of the vehicle's side is found again from where +x is seen."""
    far = camera.position + np.array([1e7, 0, 0])
    uv, depth, _ = camera.project(far[None])
    assume(depth[0] > 1e5)
    K = camera.intrinsics
    attitude = camera.vehicle_from_camera[:3, :3] @ np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    roll = math.atan2(attitude[2, 1], attitude[2, 2])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ipm_rs.CalibrationWarning)
        found = ipm_rs.Camera.from_vanishing_point(
            uv[0],
            image_size=camera.image_size,
            focal_length=np.diag(K)[:2],
            principal_point=K[:2, 2],
            height=camera.position[2],
            x=camera.position[0],
            y=camera.position[1],
            roll=roll,
        )
    np.testing.assert_allclose(found.camera_from_vehicle, camera.camera_from_vehicle, rtol=0, atol=1e-5)
    np.testing.assert_array_equal(found.intrinsics, K)


def test_from_vanishing_point_at_the_seed(seed_camera):
    camera = ipm_rs.Camera.from_vanishing_point(
        golden.VANISHING_POINT,
        image_size=golden.IMAGE_SIZE,
        focal_length=(golden.FX, golden.FY),
        principal_point=(golden.U0, golden.V0),
        height=golden.POSITION[2],
        x=golden.POSITION[0],
        y=golden.POSITION[1],
    )
    np.testing.assert_allclose(camera.camera_from_vehicle, golden.RT, rtol=0, atol=1e-9)
    plain = ipm_rs.Camera.from_vanishing_point((500, 200), image_size=(1001, 401), focal_length=800, height=1.5)
    assert plain.intrinsics.tolist() == [[800, 0, 500], [0, 800, 200], [0, 0, 1]]
    np.testing.assert_allclose(plain.camera_from_vehicle[:3, :3], [[0, -1, 0], [0, 0, -1], [1, 0, 0]], atol=1e-15)
    assert plain.position.tolist() == [0, 0, 1.5]


def test_from_vanishing_point_through_a_lens():
    lens = ipm_rs.KannalaBrandt([0.02, -0.004, 0, 0])
    truth = ipm_rs.Camera.from_euler(
        [[400, 0, 640], [0, 400, 360], [0, 0, 1]],
        image_size=(1281, 721),
        position=(0, 0, 2.1),
        pitch=0.3,
        yaw=0.2,
        lens=lens,
    )
    uv = truth.project([[1e9, 0, 2.1]])[0][0]
    found = ipm_rs.Camera.from_vanishing_point(uv, image_size=(1281, 721), focal_length=400, height=2.1, lens=lens)
    np.testing.assert_allclose(found.camera_from_vehicle, truth.camera_from_vehicle, rtol=0, atol=1e-8)
    assert found.lens == lens


@pytest.mark.parametrize(
    ("change", "error", "named"),
    [
        ({"focal_length": 0}, errors.CalibrationError, "fx, fy > 0"),
        ({"focal_length": "long"}, errors.ArgumentTypeError, "focal_length"),
        ({"height": NAN}, errors.CalibrationError, "position: expected finite"),
        ({"vanishing_point": (NAN, 3)}, errors.CalibrationError, "vanishing_point: expected finite"),
        ({"vanishing_point": 3}, errors.ArgumentTypeError, "vanishing_point: expected"),
        ({"roll": math.inf}, errors.CalibrationError, "roll: expected finite"),
        ({"image_size": (0, 3)}, errors.ArgumentError, "image_size"),
        (
            {"lens": ipm_rs.KannalaBrandt([0, 0, 0, 0], max_angle=0.5), "vanishing_point": (9000, 3)},
            errors.ArgumentError,
            "lens gives a direction",
        ),
    ],
)
def test_from_vanishing_point_refuses(change, error, named):
    arguments = {"vanishing_point": (320, 200), "image_size": (641, 481), "focal_length": 500, "height": 1.4} | change
    with refuses(error, named):
        ipm_rs.Camera.from_vanishing_point(arguments.pop("vanishing_point"), **arguments)
