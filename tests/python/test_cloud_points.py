"""Depth images to points: geometry against the reference, limits, layouts, frames, lenses, everything refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from helpers import refuses, same
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors, reference

K = np.array([[420.0, 0.0, 63.5], [0.0, 410.0, 40.25], [0.0, 0.0, 1.0]])
H, W = 90, 130
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(W, H), position=(1.5, -0.2, 1.4), roll=0.02, pitch=0.1, yaw=-0.3)


def scene(dtype: str = "float32", seed: int = 0) -> np.ndarray:
    """Depth from 0.1 to 100 m, or units of 1 / 256 m."""
    metres = np.random.default_rng(seed).random((H, W)) * 99.9 + 0.1
    return (metres * 256).astype(dtype) if dtype == "uint16" else metres.astype(dtype)


def close(got: np.ndarray, exact: np.ndarray) -> bool:
    """Rounded once: within a step of the dtype beside the largest coordinate, and NaN where that is."""
    step = np.finfo(got.dtype).eps
    allowed = step * np.nanmax(np.abs(exact), axis=-1, keepdims=True) + (1e-13 if got.dtype == np.float64 else 0)
    nan = np.isnan(exact)
    return (
        np.array_equal(np.isnan(got), nan)
        and (np.abs(got - exact)[~nan] <= np.broadcast_to(allowed, got.shape)[~nan]).all()
    )


@pytest.mark.parametrize("points", ["float32", "float64"])
@pytest.mark.parametrize("dtype", ["uint16", "float32", "float64"])
@pytest.mark.parametrize("kind", ["z", "ray"])
def test_equals_the_reference(dtype, points, kind):
    depth = scene(dtype)
    scale = 1 / 256 if dtype == "uint16" else None
    got = ipm_rs.points_from_depth(depth, K, kind=kind, depth_scale=scale, dtype=points)
    assert got.shape == (H, W, 3) and got.dtype == points
    assert close(got, reference.points_from_depth(depth * (scale or 1.0), K, kind=kind))
    length = got[..., 2] if kind == "z" else np.linalg.norm(got, axis=-1)
    assert np.allclose(length, depth * (scale or 1.0), rtol=1e-6)


def test_a_camera_is_its_matrix():
    depth = scene()
    assert same(ipm_rs.points_from_depth(depth, K), ipm_rs.points_from_depth(depth, CAMERA))
    assert ipm_rs.points_from_depth(depth, K).dtype == np.float32
    skewed = K + np.array([[0, 3.0, 0], [0, 0, 0], [0, 0, 0]])
    assert close(ipm_rs.points_from_depth(depth, skewed), reference.points_from_depth(depth, skewed))


def test_points_project_onto_their_own_pixels():
    """There and back, for each frame that a camera knows."""
    row, column = np.indices((H, W))
    points = ipm_rs.points_from_depth(scene(), CAMERA, frame="vehicle", dtype="float64")
    uv, depth, valid = CAMERA.project(points.reshape(-1, 3))
    assert valid[1:-1].mean() > 0.95  # the rim may be out by rounding
    assert np.abs(uv - np.stack([column, row], -1).reshape(-1, 2)).max() < 1e-9
    assert np.allclose(depth, scene().ravel(), atol=1e-9)


def test_frames():
    depth = scene()
    camera = ipm_rs.points_from_depth(depth, CAMERA, dtype="float64")
    flu = ipm_rs.points_from_depth(depth, CAMERA, frame="flu", dtype="float64")
    assert np.allclose(flu, np.stack([camera[..., 2], -camera[..., 0], -camera[..., 1]], -1), atol=1e-12)
    vehicle = ipm_rs.points_from_depth(depth, CAMERA, frame="vehicle", dtype="float64")
    pose = CAMERA.vehicle_from_camera
    assert np.allclose(vehicle, camera @ pose[:3, :3].T + pose[:3, 3], atol=1e-12)
    assert same(vehicle, ipm_rs.points_from_depth(depth, CAMERA, frame=pose, dtype="float64"))
    world = np.eye(4)
    world[:3, 3] = 1e6, 2e6, 3e6
    far = ipm_rs.points_from_depth(depth, K, frame=world @ pose, dtype="float64")
    assert np.allclose(far - world[:3, 3], vehicle, atol=1e-8)


def test_half_a_pixel():
    """800 px and 90 degrees: the documents' functions are 0.0625 m off at 50 m, this one is not."""
    w, h = 800, 600
    corner = np.array([[400.0, 0.0, 400.0], [0.0, 400.0, 300.0], [0.0, 0.0, 1.0]])
    camera = ipm_rs.Camera(corner - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]), image_size=(w, h))
    flu = ipm_rs.points_from_depth(np.full((h, w), 50.0), camera, frame="flu", dtype="float64")
    forward, left, up = ipm_rs.depth_to_lidar(np.full((h, w), 0.05), w, h, corner)[0].reshape(3, h, w)
    assert np.allclose(forward, flu[..., 0])
    assert np.allclose(flu[..., 1] - left, 0.0625) and np.allclose(flu[..., 2] - up, 0.0625)
    # ours is symmetric about the axis, as the picture is
    assert np.allclose(flu[:, ::-1, 1], -flu[..., 1]) and np.allclose(flu[::-1, :, 2], -flu[..., 2])
    assert np.allclose(flu[:, 0, 1], 399.5 * 50 / 400)


def test_what_has_no_depth_is_nan():
    depth = scene()
    missing = [0.0, -0.0, -1.0, np.nan, np.inf, -np.inf]
    depth[5, 10 : 10 + len(missing)] = missing
    points = ipm_rs.points_from_depth(depth, K)
    nan = np.isnan(points)
    assert (nan.all(-1) == nan.any(-1)).all()
    assert nan[5, 10 : 10 + len(missing)].all() and nan.sum() == 3 * len(missing)


def test_limits_are_kept_and_beyond_them_is_cut():
    depth = scene()
    depth[0, :4] = 10, 40, np.nextafter(np.float32(10), np.float32(0)), np.nextafter(np.float32(40), np.float32(99))
    nan = np.isnan(ipm_rs.points_from_depth(depth, K, min_depth=10, max_depth=40)).any(-1)
    assert np.array_equal(nan, (depth < 10) | (depth > 40))
    assert list(nan[0, :4]) == [False, False, True, True]
    assert not np.isnan(ipm_rs.points_from_depth(depth, K, max_depth=np.inf)).any()


def test_limits_measure_as_the_image_does():
    """Along the ray, a corner's 40 m are nearer to the plane than the centre's."""
    nan = np.isnan(ipm_rs.points_from_depth(np.full((H, W), 40.0), K, kind="ray", max_depth=40)).any()
    assert not nan


@pytest.mark.parametrize("stride", [1, 2, 3, 7, 89, 90, 1000])
def test_stride_takes_every_so_many_th(stride):
    depth = scene()
    mask = np.random.default_rng(2).random((H, W)) < 0.7
    whole = ipm_rs.points_from_depth(depth, K, mask=mask)
    strided = ipm_rs.points_from_depth(depth, K, mask=mask, stride=stride)
    assert same(strided, whole[::stride, ::stride].copy())
    points, index = ipm_rs.points_from_depth(depth, K, mask=mask, stride=stride, compact=True)
    kept = np.zeros((H, W), bool)
    kept[::stride, ::stride] = True
    assert np.array_equal(index, np.flatnonzero(kept & mask))
    assert same(points, whole.reshape(-1, 3)[index])


@pytest.mark.parametrize("dtype", ["bool", "uint8"])
def test_mask(dtype):
    depth, mask = scene(), np.random.default_rng(3).integers(0, 3, (H, 2 * W)).astype(dtype)
    view = mask[::-1, :W]
    nan = np.isnan(ipm_rs.points_from_depth(depth, K, mask=view)).any(-1)
    assert np.array_equal(nan, view == 0)


def test_compact_gathers_alongside():
    depth = scene()
    depth[::3] = 0
    random = np.random.default_rng(4)
    colors = random.integers(0, 256, (H, W, 3), dtype=np.uint8)
    labels = random.integers(-5, 5, (H, W)).astype(np.int16)
    wide = random.random((H, W, 5))
    points, index, got = ipm_rs.points_from_depth(depth, K, compact=True, values=colors, max_depth=50)
    assert points.dtype == np.float32 and index.dtype == np.int64 and len(points) == len(index) == len(got)
    assert np.array_equal(index, np.flatnonzero((depth > 0) & (depth <= 50)))
    assert same(got, colors.reshape(-1, 3)[index])
    organised = ipm_rs.points_from_depth(depth, K, max_depth=50)
    assert same(points, organised[~np.isnan(organised[..., 0])])
    *_, several = ipm_rs.points_from_depth(depth, K, compact=True, values=(colors, labels, wide, labels > 0))
    kept = np.flatnonzero(depth > 0)
    expected = (colors.reshape(-1, 3)[kept], labels.ravel()[kept], wide.reshape(-1, 5)[kept], labels.ravel()[kept] > 0)
    assert isinstance(several, tuple) and all(same(a, b) for a, b in zip(several, expected, strict=True))


def test_a_compact_cloud_may_be_empty():
    empty = np.zeros((H, W), np.float32)
    points, index, labels = ipm_rs.points_from_depth(empty, K, compact=True, values=np.ones((H, W), np.int32))
    assert points.shape == (0, 3) and index.shape == (0,) and labels.shape == (0,) and labels.dtype == np.int32
    points, index, colors = ipm_rs.points_from_depth(empty, K, compact=True, values=np.ones((H, W, 4)))
    assert colors.shape == (0, 4)


def test_threads_change_nothing():
    depth = np.tile(scene(), (8, 8))
    depth[depth < 20] = np.nan
    for options in ({}, {"compact": True}, {"compact": True, "stride": 3}, {"frame": "flu", "kind": "ray"}):
        one = ipm_rs.points_from_depth(depth, K, threads=1, **options)
        three = ipm_rs.points_from_depth(depth, K, threads=3, **options)
        assert all(same(a, b) for a, b in zip(one, three, strict=True))


@given(
    top=st.integers(0, 40), left=st.integers(0, 60), height=st.integers(1, 40), width=st.integers(1, 70),
    flipped=st.booleans(), skip=st.integers(1, 3), stride=st.integers(1, 5),
)  # fmt: skip
def test_any_view_of_a_larger_image(top, left, height, width, flipped, skip, stride):
    canvas = scene()
    view = canvas[top : top + height, left : left + width]
    view = view[:: -skip if flipped else skip]
    got = ipm_rs.points_from_depth(view, K, stride=stride)
    assert same(got, ipm_rs.points_from_depth(np.ascontiguousarray(view), K, stride=stride))


def test_out():
    depth, canvas = scene(), np.full((H + 2, W + 4, 3), np.float32(-7))
    out = canvas[1:-1, 2:-2]
    got = ipm_rs.points_from_depth(depth, K, out=out)
    assert got is out and same(out.copy(), ipm_rs.points_from_depth(depth, K))
    assert (canvas[0] == -7).all() and (canvas[:, :2] == -7).all() and (canvas[:, -2:] == -7).all()
    double = np.zeros((H, W, 3))
    assert ipm_rs.points_from_depth(depth, K, out=double, dtype=np.float64) is double


def test_the_input_is_left_alone():
    depth = scene()
    depth[3] = np.nan
    before = depth.copy()
    depth.setflags(write=False)
    ipm_rs.points_from_depth(depth, K, max_depth=20, mask=np.zeros((H, W), bool))
    assert depth.tobytes() == before.tobytes()


@pytest.mark.parametrize(
    ("lens", "focal"),
    [
        (ipm_rs.BrownConrady([-0.2, 0.03, 1e-3, -5e-4, 0.0]), 120.0),
        (ipm_rs.KannalaBrandt([0.05, -0.01, 0.002, 0.0]), 60.0),
        (ipm_rs.DoubleSphere(-0.2, 0.6), 60.0),
    ],
    ids=["brown_conrady", "kannala_brandt", "double_sphere"],
)
@pytest.mark.parametrize("kind", ["z", "ray"])
def test_behind_a_lens(lens, focal, kind):
    matrix = np.array([[focal, 0.0, W / 2], [0.0, focal, H / 2], [0.0, 0.0, 1.0]])
    camera = ipm_rs.Camera(matrix, image_size=(W, H), vehicle_from_camera=CAMERA.vehicle_from_camera, lens=lens)
    depth = scene("float64")
    points = ipm_rs.points_from_depth(depth, camera, frame="vehicle", kind=kind, dtype="float64")
    seen = ~np.isnan(points).any(-1)
    assert seen.mean() > 0.5
    row, column = np.indices((H, W))
    uv, z, _ = camera.project(points[seen])
    assert np.abs(uv - np.stack([column, row], -1)[seen]).max() < 1e-6
    far = z if kind == "z" else np.linalg.norm(points[seen] - camera.position, axis=-1)
    assert np.allclose(far, depth[seen], rtol=1e-9)
    rays = camera.unproject(np.stack([column, row], -1).reshape(-1, 2).astype(float)).reshape(H, W, 3)
    if kind == "ray":
        assert np.allclose(points, camera.position + rays * depth[..., None], equal_nan=True)


@pytest.mark.parametrize("kind", ["z", "ray"])
@pytest.mark.parametrize(
    "lens", [None, ipm_rs.BrownConrady([-0.2, 0.03, 1e-3, -5e-4]), ipm_rs.Mei(1.2, [-0.1, 0, 0, 0])]
)
def test_rays_worked_out_once_are_the_camera_s(lens, kind):
    matrix = np.array([[120.0, 0.0, W / 2], [0.0, 120.0, H / 2], [0.0, 0.0, 1.0]])
    camera = ipm_rs.Camera(matrix, image_size=(W, H), vehicle_from_camera=CAMERA.vehicle_from_camera, lens=lens)
    rays = ipm_rs.PixelRays(camera)
    for options in ({}, {"frame": "vehicle"}, {"frame": "flu", "stride": 3, "max_depth": 50}, {"dtype": "float64"}):
        expected = ipm_rs.points_from_depth(scene(), camera, kind=kind, **options)
        assert same(ipm_rs.points_from_depth(scene(), rays, kind=kind, **options), expected)
    assert rays.camera == camera and rays.nbytes == W * H * 24 and "PixelRays(Camera(130x90" in repr(rays)
    again = pickle.loads(pickle.dumps(rays))
    assert again == rays and hash(again) == hash(rays) and rays != ipm_rs.PixelRays(camera.resized(20, 10))
    assert same(ipm_rs.points_from_depth(scene(), again), ipm_rs.points_from_depth(scene(), rays))
    with refuses(errors.ImageError, "depth is 129x90", "130x90"):
        ipm_rs.points_from_depth(scene()[:, 1:], rays)
    with refuses(errors.ArgumentTypeError, "camera", "ndarray"):
        ipm_rs.PixelRays(matrix)


def test_beyond_180_degrees_there_is_no_planar_depth():
    matrix = np.array([[30.0, 0.0, 64.5], [0.0, 30.0, 44.5], [0.0, 0.0, 1.0]])
    camera = ipm_rs.Camera(matrix, image_size=(W, H), lens=ipm_rs.KannalaBrandt([0, 0, 0, 0]))
    ray = ipm_rs.points_from_depth(np.ones((H, W)), camera, kind="ray", dtype="float64")
    z = ipm_rs.points_from_depth(np.ones((H, W)), camera, kind="z", dtype="float64")
    behind = ray[..., 2] <= 0
    assert behind.any() and np.isnan(z[behind]).all()
    assert np.allclose(z[~behind][:, 2], 1)


def test_wrong_arguments_are_refused():
    depth = scene()
    points = ipm_rs.points_from_depth
    with refuses(errors.ArgumentError, "depth_scale", "uint16", "0.001", "5000", "256"):
        points(scene("uint16"), K)
    with refuses(errors.DtypeError, "uint8", "picture"):
        points(depth.astype(np.uint8), K)
    for dtype in ("int32", "float16", "complex64", ">f4"):
        with refuses(errors.DtypeError, "depth"):
            points(depth.astype(dtype), K)
    with refuses(errors.ImageError, "(H, W)", "decode_carla_depth"):
        points(np.zeros((H, W, 3), np.float32), K)
    with refuses(errors.ImageError, "(H, W)", "[..., 0]"):
        points(np.zeros((H, W, 1), np.float32), K)
    with refuses(errors.ImageError, "at least one pixel"):
        points(np.zeros((0, 5), np.float32), K)
    with refuses(errors.ImageError, "depth is 65x45", "130x90", "camera.resized()"):
        points(np.ascontiguousarray(depth[::2, ::2]), CAMERA)
    with refuses(errors.ArgumentError, "vehicle", "Camera", "flu"):
        points(depth, K, frame="vehicle")
    with refuses(errors.ArgumentError, "frame", "flu", "world"):
        points(depth, K, frame="world")
    with refuses(errors.CalibrationError, "frame", "rotation"):
        points(depth, K, frame=np.diag([1.0, -1.0, 1.0, 1.0]))
    with refuses(errors.ArgumentError, "kind", "ray", "depth"):
        points(depth, K, kind="depth")
    for name, bad in (
        ("max_depth", 0), ("max_depth", -1), ("max_depth", np.nan), ("min_depth", -1), ("min_depth", np.inf),
        ("min_depth", np.nan), ("depth_scale", 0), ("depth_scale", -1), ("depth_scale", np.inf), ("stride", 0),
        ("threads", 0),
    ):  # fmt: skip
        with refuses(errors.ArgumentError, name):
            points(depth, K, **{name: bad})
    for name, bad in (("stride", 1.5), ("stride", "2"), ("max_depth", "far"), ("compact", 2)):
        with refuses(errors.ArgumentTypeError, name):
            points(depth, K, **{name: bad})
    with refuses(errors.ArgumentError, "dtype", "float16"):
        points(depth, K, dtype="float16")
    with refuses(errors.ImageError, "mask", "130x90"):
        points(depth, K, mask=np.ones((H, W + 1), bool))
    with refuses(errors.DtypeError, "mask", "bool or uint8", "!= 0"):
        points(depth, K, mask=np.ones((H, W)))
    with refuses(errors.ArgumentError, "values", "compact=True", "[::stride, ::stride]"):
        points(depth, K, values=depth)
    with refuses(errors.ArgumentError, "out", "compact"):
        points(depth, K, compact=True, out=np.zeros((H, W, 3), np.float32))
    with refuses(errors.ImageError, "values[1]", "(90, 130)"):
        points(depth, K, compact=True, values=(depth, depth[1:]))
    with refuses(errors.DtypeError, "values", "complex"):
        points(depth, K, compact=True, values=depth.astype(complex))
    with refuses(errors.ImageError, "out", "(90, 130, 3)"):
        points(depth, K, out=np.zeros((H, W), np.float32))


@pytest.mark.parametrize(
    "matrix",
    [np.zeros((3, 3)), np.diag([0.0, 1, 1]), K * np.nan, K.T, np.diag([-400.0, 400, 1]), np.ones((3, 3))],
    ids=["zeros", "singular", "nan", "transposed", "negative", "ones"],
)
def test_a_matrix_that_is_no_pinhole_is_refused(matrix):
    with refuses(errors.CalibrationError, "K: expected [[fx, skew, cx]"):
        ipm_rs.points_from_depth(scene(), matrix)


def test_claims_of_great_size_cost_nothing():
    """A row repeated without memory claims 10^9 pixels."""
    claim = np.broadcast_to(np.ones((1, 40_000), np.float32), (30_000, 40_000))
    for options in ({}, {"compact": True}):
        with refuses(errors.ArgumentError, "depth", "at most 268435456 points", "1200000000", "stride"):
            ipm_rs.points_from_depth(claim, K, **options)
    points, index = ipm_rs.points_from_depth(claim, K, stride=1000, compact=True)
    assert len(points) == 1200 and index[-1] == 29_000 * 40_000 + 39_000


@pytest.mark.parametrize("order", ["bgra", "rgba", "bgr", "rgb"])
@pytest.mark.parametrize("compact", [False, True])
def test_points_straight_from_carla_are_those_of_decoded_depth(order, compact):
    """Bit for bit, whatever else is asked for."""
    image = np.random.default_rng(6).integers(0, 256, (H, W + 3, len(order)), dtype=np.uint8)[:, 1:-2]
    image[..., order.index("b")] //= 8
    image[5:9, 7:20] = 0  # no depth
    depth = ipm_rs.decode_carla_depth(image, order=order)
    mask = np.random.default_rng(7).random((H, W)) < 0.9
    options = [
        {},
        {"frame": "flu", "max_depth": 60.0, "min_depth": 2.0},
        {"frame": "vehicle", "stride": 3, "dtype": "float64"},
        {"kind": "ray", "mask": mask, "depth_scale": 0.5, "threads": 2},
    ]
    here = {"image_size": (W, H), "camera_from_vehicle": np.eye(4)}
    skewed = ipm_rs.Camera([[420.0, 2.0, 63.5], [0.0, 410.0, 40.25], [0.0, 0.0, 1.0]], **here)
    bent = ipm_rs.Camera(K, lens=ipm_rs.Eucm(0.6, 1.1), **here)
    for camera in (CAMERA, skewed, bent, ipm_rs.PixelRays(bent)):
        for chosen in options:
            got = ipm_rs.points_from_depth(image, camera, order=order, compact=compact, **chosen)
            expected = ipm_rs.points_from_depth(depth, camera, compact=compact, **chosen)
            if not compact:
                got, expected = (got,), (expected,)
            assert all(same(a, b) for a, b in zip(got, expected, strict=True)), chosen
            assert np.isfinite(got[0]).any()


def test_carla_mistakes():
    image = np.zeros((H, W, 4), np.uint8)
    for wrong, phrases in (
        (image[..., 0], ("(H, W, 4)", f"({H}, {W})")),
        (image[..., :2], ("(H, W, 4)", f"({H}, {W}, 2)")),
    ):
        with refuses(errors.ImageError, "depth", *phrases):
            ipm_rs.points_from_depth(wrong.copy(), K, order="bgra")
    with refuses(errors.DtypeError, "depth", "uint8", "float32"):
        ipm_rs.points_from_depth(image.astype(np.float32), K, order="bgra")
    with refuses(errors.ArgumentError, "order", "4 channels", "rgb"):
        ipm_rs.points_from_depth(image, K, order="rgb")
    with refuses(errors.ArgumentError, "order", "argb"):
        ipm_rs.points_from_depth(image, K, order="argb")
    with refuses(errors.ImageError, "depth", "order="):
        ipm_rs.points_from_depth(image, K)
    with refuses(errors.DtypeError, "depth", "order="):
        ipm_rs.points_from_depth(image[..., 0].copy(), K)
    out = image.view(np.float32)
    with refuses(errors.ImageError, "out", f"({H}, {W}, 3)"):
        ipm_rs.points_from_depth(image, K, order="bgra", out=out)
    memory = np.zeros((H, W, 4), np.float32)
    points = memory.reshape(-1)[: H * W * 3].reshape(H, W, 3)
    coded = np.lib.stride_tricks.as_strided(memory.view(np.uint8), (H, W, 4), (16 * W, 4, 1))
    with refuses(errors.ImageError, "out", "memory", "depth", out=memory):
        ipm_rs.points_from_depth(coded, K, order="bgra", out=points)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("first", [0, 1, 3])
def test_large_clouds_are_those_of_their_rows(dtype, first):
    """Wherever the array begins; compact ones come by another way."""
    height, width = 720, 1283
    depth = np.random.default_rng(8).uniform(-1, 50, (height, width)).astype(np.float32)
    camera = ipm_rs.Camera.from_euler(
        [[900.0, 0, 640], [0, 900, 360], [0, 0, 1]], image_size=(width, height), position=(1, 0, 1.5), pitch=0.1
    )
    memory = np.full(height * width * 3 + 8, 7, dtype)
    out = memory[first : first - 8].reshape(height, width, 3)
    got = ipm_rs.points_from_depth(depth, camera, frame="vehicle", dtype=dtype, out=out)
    assert got is out and (memory[:first] == 7).all() and (memory[first - 8 :] == 7).all()
    points, index = ipm_rs.points_from_depth(depth, camera, frame="vehicle", dtype=dtype, compact=True)
    assert same(got.reshape(-1, 3)[index], points)
    assert np.isnan(got).all(-1).sum() == height * width - len(points)
