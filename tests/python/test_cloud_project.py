"""Points to pixels, many at once, and the z-buffer of what a camera sees of them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from helpers import refuses, same
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors, reference

K = np.array([[300.0, 0.0, 159.5], [0.0, 310.0, 99.5], [0.0, 0.0, 1.0]])
W, H = 320, 200
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(W, H), position=(1.5, -0.2, 1.4), roll=0.02, pitch=0.1, yaw=-0.3)
LENS = ipm_rs.Camera(
    np.array([[90.0, 0.0, 159.5], [0.0, 90.0, 99.5], [0.0, 0.0, 1.0]]),
    image_size=(W, H),
    camera_from_vehicle=CAMERA.camera_from_vehicle,
    lens=ipm_rs.KannalaBrandt([0.02, -0.003, 0.0, 0.0]),
)


def cloud(count: int = 20_000, columns: int = 3, dtype: str = "float64", seed: int = 0) -> np.ndarray:
    """Points all around the vehicle."""
    points = np.random.default_rng(seed).normal(size=(count, columns))
    points[:, :3] *= (20, 12, 2)
    return points.astype(dtype)


# ---------------------------------------------------------------- project


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_project_equals_the_reference_and_opencv(dtype):
    points = cloud(dtype=dtype)
    uv, depth, valid = CAMERA.project(points)
    expected = reference.project(points, K, CAMERA.camera_from_vehicle, (W, H))
    front = expected[1] > 0.1
    assert uv.dtype == depth.dtype == np.float64 and valid.dtype == np.bool_
    assert np.allclose(uv[front], expected[0][front], rtol=1e-12, atol=1e-9)
    assert np.allclose(depth, expected[1], atol=1e-12)
    assert np.array_equal(np.isnan(uv).any(1), depth <= 0)
    assert (valid != expected[2])[front].sum() == 0
    pose = CAMERA.camera_from_vehicle
    theirs, _ = cv2.projectPoints(points[front].astype(float), cv2.Rodrigues(pose[:3, :3])[0], pose[:3, 3], K, None)
    assert np.allclose(uv[front], theirs[:, 0], rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "lens"])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_any_stride_without_a_difference(camera, dtype):
    wide = cloud(3001, 7, dtype)
    expected = camera.project(np.ascontiguousarray(wide[:, :3]).astype(float))
    four = np.ascontiguousarray(wide[:, :4])
    for view in (wide[:, :3], four[:, :3], np.asfortranarray(wide[:, :3]), np.repeat(wide, 2, axis=1)[:, :6:2]):
        assert all(same(a, b) for a, b in zip(camera.project(view), expected, strict=True))
    for rows in (slice(None, None, -1), slice(5, 2000, 3), slice(7, 8), slice(3000, 3001), slice(0, 0)):
        got = camera.project(wide[rows, :3])
        assert all(same(a, np.ascontiguousarray(b[rows])) for a, b in zip(got, expected, strict=True))
    same_row = np.broadcast_to(wide[3, :3], (5000, 3))
    assert np.array_equal(camera.project(same_row)[0], np.broadcast_to(expected[0][3], (5000, 2)))


def test_project_takes_what_numpy_takes():
    expected = CAMERA.project([[10.0, 0.0, 0.0]])
    for points in ([[10, 0, 0]], ((10, 0, 0),), np.array([[10, 0, 0]], np.int16), np.array([[10, 0, 0]], ">f4")):
        assert all(same(a, b) for a, b in zip(CAMERA.project(points), expected, strict=True))
    packed = np.zeros(3, [("pad", "u1"), ("xyz", "<f8", 3)])  # nothing is aligned
    packed["xyz"] = 10, 0, 0
    assert np.array_equal(CAMERA.project(packed["xyz"])[0][:1], expected[0])


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "lens"])
def test_project_threads_change_nothing(camera):
    points = cloud(100_000)
    one, three = camera.project(points, threads=1), camera.project(points, threads=3)
    assert all(same(a, b) for a, b in zip(one, three, strict=True))


def test_project_refuses():
    with refuses(errors.ArgumentError, "points", "(N, 3)", "(5, 4)"):
        CAMERA.project(np.zeros((5, 4)))
    with refuses(errors.ArgumentError, "points[None]"):
        CAMERA.project([1.0, 2.0, 3.0])
    with refuses(errors.ArgumentTypeError, "complex"):
        CAMERA.project(np.zeros((5, 3), complex))
    with refuses(errors.ArgumentError, "threads"):
        CAMERA.project(np.zeros((5, 3)), threads=0)


def test_claims_of_great_size_cost_nothing():
    point = np.array([10.0, 0.0, 0.0], np.float32)
    with refuses(errors.OutOfMemoryError, "allocate"):
        CAMERA.project(np.broadcast_to(point, (10**13, 3)))
    with refuses(errors.ArgumentError, "at most 4294967295", "in parts"):
        ipm_rs.render_points(np.broadcast_to(point, (2**32, 3)), CAMERA)
    _, index = ipm_rs.render_points(np.broadcast_to(point, (10**7, 3)), CAMERA)
    assert (index >= 0).sum() == 1 and index.max() == 0


# ---------------------------------------------------------------- render_points


@pytest.mark.parametrize("radius", [0, 1, 1.5, 2, 3.7])
@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "lens"])
def test_render_equals_the_reference(camera, radius):
    points = np.concatenate([cloud(4000), cloud(3000)])  # the first 3000 twice: ties
    depth, index = ipm_rs.render_points(points, camera, radius=radius)
    uv, z, _ = camera.project(points)
    expected = reference.nearest_points(uv, z, (W, H), radius)
    assert same(depth, expected[0]) and same(index, expected[1])
    assert (index >= 0).sum() > 500 and index.max() < 4000, "of equal depths the first point wins"


def test_render_by_distance():
    points = cloud(4000)
    depth, index = ipm_rs.render_points(points, LENS, kind="ray")
    uv, _, _ = LENS.project(points)
    expected = reference.nearest_points(uv, np.linalg.norm(points - LENS.position, axis=1), (W, H))
    assert np.array_equal(index, expected[1]) and np.allclose(depth, expected[0], rtol=1e-6, equal_nan=True)


def test_a_lens_sees_behind_by_distance_alone():
    camera = LENS.with_pose(ipm_rs.Camera(K, image_size=(W, H)).camera_from_vehicle)
    behind = np.array([[-1.0, 5.0, 0.0]])
    assert np.isfinite(camera.project(behind)[0]).all()
    wide = ipm_rs.Camera(
        np.array([[60.0, 0.0, 159.5], [0.0, 60.0, 99.5], [0.0, 0.0, 1.0]]), image_size=(W, H), lens=LENS.lens
    )
    assert (ipm_rs.render_points(behind, wide, kind="z")[1] == -1).all()
    depth, index = ipm_rs.render_points(behind, wide, kind="ray")
    assert (index == 0).sum() == 1 and np.nanmin(depth) == np.float32(26**0.5)


def test_nearest_wins_and_ties_go_to_the_first():
    ahead = np.array([[20.0, 0, 0], [10, 0, 0], [10, 0, 0], [15, 0, 0], [10 + 1e-9, 0, 0]])
    camera = ipm_rs.Camera(K, image_size=(W, H))
    depth, index = ipm_rs.render_points(ahead, camera)
    assert index[100, 160] == 1  # 159.5 and 99.5 round to even: 160, 100
    assert depth[100, 160] == 10 and (index >= 0).sum() == 1
    depth, index = ipm_rs.render_points(ahead[::-1], camera)
    assert index[100, 160] == 0, "1e-9 m farther is a tie in float32"


def test_values_of_any_kind():
    points = cloud()
    random = np.random.default_rng(1)
    depth, index = ipm_rs.render_points(points, CAMERA)
    seen = index >= 0
    for values in (
        random.integers(0, 256, (len(points), 3), dtype=np.uint8),
        random.integers(-9, 9, len(points)).astype(np.int16),
        random.random((len(points), 16)),
        random.random((2 * len(points), 6)).astype(np.float32)[::2, 1:4],
        random.random(len(points)) < 0.5,
        points,
    ):
        d, i, image = ipm_rs.render_points(points, CAMERA, values=values)
        assert same(d, depth) and same(i, index)
        assert image.dtype == values.dtype and image.shape == (H, W, *values.shape[1:])
        assert np.array_equal(image[seen], values[index[seen]]) and not image[~seen].any()
    labels = np.ones(len(points), np.uint8)
    assert (ipm_rs.render_points(points, CAMERA, values=labels, border_value=255)[2][~seen] == 255).all()
    colors = np.ones((len(points), 3), np.uint8)
    image = ipm_rs.render_points(points, CAMERA, values=colors, border_value=(7, 8, 9))[2]
    assert (image[~seen] == (7, 8, 9)).all()


def test_a_rendered_depth_image_is_one_to_back_project():
    points = cloud()
    depth, index = ipm_rs.render_points(points, CAMERA)
    back = ipm_rs.points_from_depth(depth, CAMERA, frame="vehicle")
    seen = index >= 0
    assert np.array_equal(~np.isnan(back[..., 0]), seen)
    # the pixel's centre is at most half a pixel from where the point fell
    miss = np.linalg.norm(back[seen] - points[index[seen]], axis=-1) / depth[seen]
    assert miss.max() < 1.05 * np.hypot(0.5 / 300, 0.5 / 310)


def test_limits_and_what_is_not_finite():
    points = cloud()
    points[::7, 1] = np.nan
    points[3::7, 0] = np.inf
    depth, index = ipm_rs.render_points(points, CAMERA, min_depth=5, max_depth=20)
    assert np.nanmin(depth) >= 5 and np.nanmax(depth) <= 20
    kept = (CAMERA.project(points)[1] >= 5) & (CAMERA.project(points)[1] <= 20)
    expected = reference.nearest_points(
        CAMERA.project(points)[0], np.where(kept, CAMERA.project(points)[1], -1), (W, H)
    )
    assert np.array_equal(index, expected[1])


@given(radius=st.floats(0, 6), seed=st.integers(0, 1000))
def test_points_at_the_rim(radius, seed):
    """Just outside the image a point still reaches in with its radius, and never over the other side."""
    random = np.random.default_rng(seed)
    camera = ipm_rs.Camera(K, image_size=(W, H))
    pixel = np.concatenate([random.uniform(-8, 8, (50, 2)), random.uniform(-8, 8, (50, 2)) + np.array([W, H])])
    z = random.uniform(1, 50, 100)
    points = np.stack([z, -(pixel[:, 0] - K[0, 2]) / K[0, 0] * z, -(pixel[:, 1] - K[1, 2]) / K[1, 1] * z], 1)
    depth, index = ipm_rs.render_points(points, camera, radius=radius)
    uv, z, _ = camera.project(points)
    expected = reference.nearest_points(uv, z, (W, H), radius)
    assert same(depth, expected[0]) and same(index, expected[1])


@pytest.mark.parametrize("radius", [0, 2])
def test_render_threads_change_nothing(radius):
    points = np.repeat(cloud(60_000, dtype="float32"), 2, axis=0)
    values = np.arange(len(points))
    one = ipm_rs.render_points(points, CAMERA, values=values, radius=radius, threads=1)
    for _ in range(3):
        more = ipm_rs.render_points(points, CAMERA, values=values, radius=radius, threads=4)
        assert all(same(a, b) for a, b in zip(one, more, strict=True))
    assert (one[1][one[1] >= 0] % 2 == 0).all(), "the first of two equal points"


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_no_points_make_an_empty_image(dtype):
    depth, index, image = ipm_rs.render_points(
        np.zeros((0, 3), dtype), CAMERA, values=np.zeros((0, 3), np.uint8), border_value=4
    )
    assert np.isnan(depth).all() and (index == -1).all() and (image == 4).all() and image.shape == (H, W, 3)
    uv, z, valid = CAMERA.project(np.zeros((0, 3), dtype))
    assert uv.shape == (0, 2) and z.shape == valid.shape == (0,)


def test_render_refuses():
    points = cloud(10)
    with refuses(errors.ArgumentTypeError, "camera", "ipm_rs.Camera", "ndarray"):
        ipm_rs.render_points(points, K)
    with refuses(errors.ArgumentError, "points", "(N, 3)", "(10, 2)"):
        ipm_rs.render_points(points[:, :2], CAMERA)
    with refuses(errors.ArgumentError, "values", "(10,)", "(9,)"):
        ipm_rs.render_points(points, CAMERA, values=np.zeros(9))
    with refuses(errors.ArgumentTypeError, "values", "list"):
        ipm_rs.render_points(points, CAMERA, values=[0] * 10)
    with refuses(errors.ArgumentError, "border_value", "3"):
        ipm_rs.render_points(points, CAMERA, values=np.zeros((10, 3)), border_value=(1, 2))
    with refuses(errors.ArgumentError, "border_value", "uint8", "256"):
        ipm_rs.render_points(points, CAMERA, values=np.zeros(10, np.uint8), border_value=256)
    for radius in (-1, np.nan, np.inf, 321):
        with refuses(errors.ArgumentError, "radius"):
            ipm_rs.render_points(points, CAMERA, radius=radius)
    for name, bad in (("min_depth", -1), ("max_depth", 0), ("threads", 0)):
        with refuses(errors.ArgumentError, name):
            ipm_rs.render_points(points, CAMERA, **{name: bad})
    huge = CAMERA.resized(40_000, 40_000)
    with refuses(errors.ArgumentError, "camera", "268435456", "resized"):
        ipm_rs.render_points(points, huge)
