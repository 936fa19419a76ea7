"""Camera: construction, projection both ways, derived cameras."""

from __future__ import annotations

import warnings

import cv2
import golden
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import reference

FLU_TO_OPTICAL = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def number(low: float, high: float):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


@st.composite
def cameras(draw) -> ipm_rs.Camera:
    """Any camera on a vehicle, looking anywhere, as odd as a crop or a stretched picture may be."""
    width, height = draw(st.integers(1, 4096)), draw(st.integers(1, 3000))
    K = np.array(
        [
            [draw(number(50, 6000)), 0.0, draw(number(-100, 4000))],
            [0.0, draw(number(50, 6000)), draw(number(-100, 4000))],
            [0.0, 0.0, 1.0],
        ]
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ipm_rs.CalibrationWarning)
        return ipm_rs.Camera.from_euler(
            K,
            image_size=(width, height),
            position=(draw(number(-5, 5)), draw(number(-5, 5)), draw(number(0.2, 5))),
            roll=draw(number(-3.1, 3.1)),
            pitch=draw(number(-1.5, 1.5)),
            yaw=draw(number(-3.1, 3.1)),
        )


# ---------------------------------------------------------------------------------------------------------------------
# Construction


def test_without_a_pose_it_stands_at_the_origin_and_looks_ahead():
    camera = ipm_rs.Camera(golden.K, image_size=golden.IMAGE_SIZE)
    expected = np.eye(4)
    expected[:3, :3] = FLU_TO_OPTICAL
    np.testing.assert_array_equal(camera.camera_from_vehicle, expected)
    np.testing.assert_array_equal(camera.position, (0, 0, 0))
    uv, depth, _ = camera.project(np.array([[5.0, 0.0, 0.0]]))
    np.testing.assert_allclose(uv, [[golden.U0, golden.V0]], rtol=0, atol=1e-12)
    assert depth[0] == 5.0


def test_from_euler_defaults_to_a_level_camera_at_its_position():
    camera = ipm_rs.Camera.from_euler(golden.K, image_size=golden.IMAGE_SIZE, position=(1.0, 2.0, 3.0))
    np.testing.assert_allclose(camera.camera_from_vehicle[:3, :3], FLU_TO_OPTICAL, rtol=0, atol=1e-15)
    np.testing.assert_allclose(camera.position, (1, 2, 3), rtol=0, atol=1e-15)


def test_properties(seed_camera):
    camera = seed_camera
    for name, shape in {
        "intrinsics": (3, 3),
        "camera_from_vehicle": (4, 4),
        "vehicle_from_camera": (4, 4),
        "position": (3,),
    }.items():
        value = getattr(camera, name)
        assert value.shape == shape and value.dtype == np.float64, name
    assert camera.image_size == (2048, 1024)
    assert camera.lens is None
    np.testing.assert_allclose(camera.vehicle_from_camera @ camera.camera_from_vehicle, np.eye(4), rtol=0, atol=1e-12)
    np.testing.assert_allclose(camera.vehicle_from_camera[:3, 3], camera.position, rtol=0, atol=1e-12)


def test_arrays_handed_out_are_copies(seed_camera):
    for name in ("intrinsics", "camera_from_vehicle", "vehicle_from_camera", "position"):
        before = getattr(seed_camera, name).copy()
        try:
            getattr(seed_camera, name)[...] = 7.0
        except ValueError:
            continue  # read-only is as good
        np.testing.assert_array_equal(getattr(seed_camera, name), before)


def test_arrays_taken_in_are_copies():
    K, pose = golden.K.copy(), golden.RT.copy()
    camera = ipm_rs.Camera(K, image_size=golden.IMAGE_SIZE, camera_from_vehicle=pose)
    K[:], pose[:] = 0, 0
    np.testing.assert_array_equal(camera.intrinsics, golden.K)
    np.testing.assert_array_equal(camera.camera_from_vehicle, golden.RT)


def test_pose_is_kept_as_given_bit_for_bit():
    """Published poses have six digits; forcing them to a true rotation costs 1e-3 px."""
    pose = golden.RT.copy()
    pose[:3, :3] += np.array([[3e-5, -2e-5, 1e-5], [1e-5, 4e-5, -2e-5], [0, 1e-5, -3e-5]])
    deviation = np.abs(pose[:3, :3].T @ pose[:3, :3] - np.eye(3)).max()
    assert 1e-5 < deviation < 1e-4
    camera = ipm_rs.Camera(golden.K, image_size=golden.IMAGE_SIZE, camera_from_vehicle=pose)
    assert camera.camera_from_vehicle.tobytes() == pose.tobytes()
    assert (
        ipm_rs.Camera(golden.K, image_size=golden.IMAGE_SIZE).with_pose(pose).camera_from_vehicle.tobytes()
        == pose.tobytes()
    )


def test_the_other_direction_is_the_inverse():
    vehicle_from_camera = np.linalg.inv(golden.RT)
    camera = ipm_rs.Camera(golden.K, image_size=golden.IMAGE_SIZE, vehicle_from_camera=vehicle_from_camera)
    np.testing.assert_allclose(camera.camera_from_vehicle, golden.RT, rtol=0, atol=1e-12)
    np.testing.assert_allclose(camera.vehicle_from_camera, vehicle_from_camera, rtol=0, atol=1e-12)
    np.testing.assert_allclose(camera.position, golden.POSITION, rtol=0, atol=1e-12)


def test_direction_matters():
    camera = ipm_rs.Camera(golden.K, image_size=(2048, 1024), vehicle_from_camera=golden.RT)
    assert np.abs(camera.camera_from_vehicle - golden.RT).max() > 1


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_matrices_in_any_memory_order(order, dtype):
    K = np.asarray(golden.K, order=order, dtype=dtype)
    pose = np.asarray(golden.ORDER_RT, order=order, dtype=dtype)
    camera = ipm_rs.Camera(K, image_size=golden.IMAGE_SIZE, camera_from_vehicle=pose)
    np.testing.assert_array_equal(camera.intrinsics, K.astype(np.float64))
    np.testing.assert_array_equal(camera.camera_from_vehicle, pose.astype(np.float64))


def test_repr_shows_where_it_stands_and_looks(seed_camera):
    text = repr(seed_camera)
    assert "2048" in text and "1024" in text
    assert "1.7" in text and "1.21" in text, "position"
    assert "2.2" in text or "0.038" in text, "pitch in degrees or radians"
    assert text != repr(seed_camera.with_pose(golden.ORDER_RT))


# ---------------------------------------------------------------------------------------------------------------------
# Projection


@given(cameras(), st.integers(0, 2**32 - 1))
def test_project_is_the_reference(camera, seed):
    points = np.random.default_rng(seed).uniform(-60, 60, (50, 3))
    uv, depth, valid = camera.project(points)
    uv_ref, depth_ref, valid_ref = reference.project(
        points, camera.intrinsics, camera.camera_from_vehicle, camera.image_size
    )
    near_edge = np.abs(depth_ref) < 1e-9
    np.testing.assert_allclose(depth, depth_ref, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(np.isnan(uv)[~near_edge], np.isnan(uv_ref)[~near_edge])
    ahead = depth_ref > 0.01
    np.testing.assert_allclose(uv[ahead], uv_ref[ahead], rtol=1e-10, atol=1e-8)
    width, height = camera.image_size
    to_edge = np.abs(uv_ref[:, None, :] - np.array([[0, 0], [width - 1, height - 1]])).min(axis=(1, 2))
    clear = ~(to_edge < 1e-6)
    np.testing.assert_array_equal(valid[clear], valid_ref[clear])


@given(cameras(), st.integers(0, 2**32 - 1))
def test_project_is_cv2_in_front_of_the_camera(camera, seed):
    points = np.random.default_rng(seed).uniform(-60, 60, (50, 3))
    _, depth, _ = camera.project(points)
    ahead = depth > 1.0
    assume(ahead.any())
    pose = camera.camera_from_vehicle
    rvec, _ = cv2.Rodrigues(pose[:3, :3])
    # Rodrigues angles lose digits near a half turn; cv2's own matrix is the pose that is compared.
    again = pose.copy()
    again[:3, :3], _ = cv2.Rodrigues(rvec)
    assume(np.abs(again - pose).max() < 1e-6)
    theirs, _ = cv2.projectPoints(points[ahead], rvec, pose[:3, 3], camera.intrinsics, None)
    ours = camera.with_pose(again).project(points[ahead])[0]
    near_axis = (np.abs(ours) < 1e5).all(axis=1)
    np.testing.assert_allclose(ours[near_axis], theirs[near_axis, 0], rtol=0, atol=1e-7)


def test_project_is_cv2_at_the_seed(seed_camera):
    rvec, _ = cv2.Rodrigues(golden.RT[:3, :3])
    theirs, _ = cv2.projectPoints(golden.SAMPLE_POINTS, rvec, golden.RT[:3, 3], golden.K, None)
    np.testing.assert_allclose(seed_camera.project(golden.SAMPLE_POINTS)[0], theirs[:, 0], rtol=0, atol=1e-7)


def test_valid_is_the_closed_rectangle_of_pixel_centres():
    """One metre ahead, f = 1: the pixel is the offset from the principal point, exactly."""
    camera = ipm_rs.Camera(np.eye(3), image_size=(4, 3))
    just = np.nextafter
    us = [(0.0, True), (3.0, True), (just(0, -1), False), (just(3, 4), False), (-0.5, False), (3.5, False)]
    vs = [(0.0, True), (2.0, True), (just(0, -1), False), (just(2, 3), False)]
    points = np.array([[1.0, -u, -v] for u, _ in us for v, _ in vs])
    uv, _, valid = camera.project(points)
    np.testing.assert_array_equal(uv, [[u, v] for u, _ in us for v, _ in vs])
    np.testing.assert_array_equal(valid, [a and b for _, a in us for _, b in vs])


def test_on_the_principal_plane_there_is_no_image():
    camera = ipm_rs.Camera(np.eye(3), image_size=(4, 3))
    uv, depth, valid = camera.project(np.array([[0.0, 1.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]))
    assert np.isnan(uv).all() and not valid.any()
    np.testing.assert_array_equal(depth, [0.0, 0.0, -1.0])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_points_that_are_not_finite_have_no_image(seed_camera, bad, axis):
    points = np.array([[10.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    points[1, axis] = bad
    uv, _, valid = seed_camera.project(points)
    np.testing.assert_allclose(uv[0], golden.UV[0], rtol=0, atol=1e-9)
    assert np.isnan(uv[1]).all()
    np.testing.assert_array_equal(valid, [True, False])


def test_points_on_the_ground_may_leave_out_the_height(seed_camera):
    flat = seed_camera.project(golden.POINTS[:, :2])
    for ours, full in zip(flat, seed_camera.project(golden.POINTS), strict=True):
        np.testing.assert_array_equal(ours, full)
    lowered = golden.POINTS + np.array([0, 0, -0.33])
    at_height = seed_camera.project(golden.POINTS[:, :2], ground=-0.33)
    for ours, full in zip(at_height, seed_camera.project(lowered), strict=True):
        np.testing.assert_array_equal(ours, full)


def test_result_types(seed_camera):
    uv, depth, valid = seed_camera.project(golden.POINTS)
    assert (uv.shape, uv.dtype) == ((8, 2), np.float64)
    assert (depth.shape, depth.dtype) == ((8,), np.float64)
    assert (valid.shape, valid.dtype) == ((8,), np.bool_)
    xyz = seed_camera.ground_from_pixels(golden.UV)
    assert (xyz.shape, xyz.dtype) == ((8, 3), np.float64)


def test_no_points_give_no_pixels(seed_camera):
    uv, depth, valid = seed_camera.project(np.empty((0, 3)))
    assert uv.shape == (0, 2) and depth.shape == (0,) and valid.shape == (0,)
    assert seed_camera.ground_from_pixels(np.empty((0, 2))).shape == (0, 3)


@pytest.mark.parametrize(
    "view",
    [lambda p: p[::2], lambda p: p[::-1], lambda p: np.asfortranarray(p), lambda p: p.astype(np.float32)],
    ids=["every second", "reversed", "fortran", "float32"],
)
def test_points_in_any_memory_layout(seed_camera, view):
    points = view(golden.POINTS)
    expected = reference.project(points, golden.K, golden.RT, golden.IMAGE_SIZE)
    for ours, theirs in zip(seed_camera.project(points), expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


# ---------------------------------------------------------------------------------------------------------------------
# Back to the ground


@given(cameras(), number(-1.0, 0.1), st.integers(0, 2**32 - 1))
def test_pixel_to_ground_and_back(camera, ground, seed):
    width, height = camera.image_size
    pixels = np.random.default_rng(seed).uniform((-width, -height), (2 * width, 2 * height), (50, 2))
    points = camera.ground_from_pixels(pixels, ground=ground)
    expected = reference.ground_from_pixels(pixels, camera.intrinsics, camera.camera_from_vehicle, ground)
    np.testing.assert_allclose(points, expected, rtol=1e-8, atol=1e-8)
    hits = ~np.isnan(points).any(axis=1)
    assert (np.isnan(points).all(axis=1) == ~hits).all(), "NaN in all three coordinates or in none"
    assert (points[hits, 2] == ground).all()
    near = hits & (np.abs(points) < 1e4).all(axis=1)
    uv, depth, _ = camera.project(points[near])
    assert (depth > 0).all()
    np.testing.assert_allclose(uv, pixels[near], rtol=0, atol=1e-5)


@given(cameras(), number(-1.0, 0.1), st.integers(0, 2**32 - 1))
def test_ground_to_pixel_and_back(camera, ground, seed):
    xy = np.random.default_rng(seed).uniform(-60, 60, (50, 2))
    uv, depth, _ = camera.project(xy, ground=ground)
    ahead = depth > 0.5
    np.testing.assert_allclose(camera.ground_from_pixels(uv[ahead], ground=ground)[:, :2], xy[ahead], atol=1e-6)
    assert (np.isnan(uv).all(axis=1) == (depth <= 0)).all()


def test_rays_that_miss_the_road(seed_camera):
    horizon = golden.VANISHING_POINT[1]
    pixels = np.array([[1000.0, horizon - 50], [1000.0, 0.0], [1000.0, horizon + 50], [np.nan, 900], [900, np.inf]])
    missed = np.isnan(seed_camera.ground_from_pixels(pixels))
    np.testing.assert_array_equal(missed, np.repeat([[True], [True], [False], [True], [True]], 3, axis=1))


def test_a_road_above_the_camera_is_seen_above_the_horizon(seed_camera):
    pixels = np.array([[1000.0, 900.0], [1000.0, 300.0]])
    ceiling = seed_camera.ground_from_pixels(pixels, ground=5.0)
    assert np.isnan(ceiling[0]).all()
    assert ceiling[1, 2] == 5.0 and ceiling[1, 0] > 1.7


# ---------------------------------------------------------------------------------------------------------------------
# Derived cameras


@pytest.mark.parametrize("size", [(1024, 512), (4096, 2048), (1000, 700), (1, 1)])
def test_resized_keeps_pixel_areas(seed_camera, size):
    """Corners of the image stay corners: u' + 0.5 = (u + 0.5) s."""
    small = seed_camera.resized(*size)
    scale = np.array(size) / golden.IMAGE_SIZE
    assert small.image_size == size
    K = small.intrinsics
    np.testing.assert_allclose(np.diag(K)[:2], np.array([golden.FX, golden.FY]) * scale, rtol=1e-15)
    np.testing.assert_allclose(K[:2, 2], (np.array([golden.U0, golden.V0]) + 0.5) * scale - 0.5, rtol=0, atol=1e-10)
    uv = small.project(golden.POINTS)[0]
    np.testing.assert_allclose(uv, (golden.UV + 0.5) * scale - 0.5, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(small.camera_from_vehicle, seed_camera.camera_from_vehicle)


def test_resized_agrees_with_area_resampling(seed_camera):
    """Averaging 2 x 2 pixels of a ramp that encodes the coordinate gives what the resized camera predicts."""
    ramp = np.tile(np.arange(2048.0), (2, 1))
    half = cv2.resize(ramp, (1024, 1), interpolation=cv2.INTER_AREA)[0]
    uv_full = seed_camera.project(golden.POINTS[:1])[0]
    uv_half = seed_camera.resized(1024, 512).project(golden.POINTS[:1])[0]
    assert np.interp(uv_half[0, 0], np.arange(1024), half) == pytest.approx(uv_full[0, 0], abs=1e-6)


def test_cropped_moves_the_principal_point(seed_camera):
    part = seed_camera.cropped(100, 200, 800, 600)
    assert part.image_size == (800, 600)
    np.testing.assert_allclose(part.project(golden.POINTS)[0], golden.UV - [100, 200], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(part.camera_from_vehicle, seed_camera.camera_from_vehicle)
    assert np.diag(part.intrinsics).tolist() == np.diag(golden.K).tolist()


def test_cropped_whole_image_is_the_camera(seed_camera):
    assert seed_camera.cropped(0, 0, 2048, 1024) == seed_camera
    assert seed_camera.resized(2048, 1024) == seed_camera


def test_with_pose_changes_the_pose_alone(seed_camera):
    moved = seed_camera.with_pose(golden.ORDER_RT)
    np.testing.assert_array_equal(moved.camera_from_vehicle, golden.ORDER_RT)
    np.testing.assert_array_equal(moved.intrinsics, golden.K)
    assert moved.image_size == golden.IMAGE_SIZE
    np.testing.assert_allclose(moved.project(golden.ORDER_POINTS)[0], golden.ORDER_UV, rtol=0, atol=1e-9)
    np.testing.assert_allclose(seed_camera.camera_from_vehicle, golden.RT, rtol=0, atol=1e-12)


def test_skew_takes_part():
    K = golden.K.copy()
    K[0, 1] = 12.5
    camera = ipm_rs.Camera(K, image_size=(2048, 1024), camera_from_vehicle=golden.RT)
    expected = reference.project(golden.POINTS, K, golden.RT, (2048, 1024))[0]
    np.testing.assert_allclose(camera.project(golden.POINTS)[0], expected, rtol=0, atol=1e-9)
    assert np.abs(expected - golden.UV).max() > 1
    back = camera.ground_from_pixels(expected)
    np.testing.assert_allclose(back, golden.POINTS, rtol=0, atol=1e-7)
    scale = np.array([0.25, 0.75])
    resized = camera.resized(512, 768).project(golden.POINTS)[0]
    np.testing.assert_allclose(resized, (expected + 0.5) * scale - 0.5, rtol=0, atol=1e-9)
