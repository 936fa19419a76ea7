"""Binned, turned and mirrored cameras, against pictures that were."""

from __future__ import annotations

import cv2
import golden
import numpy as np
import pytest
from helpers import refuses, textured
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors

K = [[420.0, 1.5, 330.0], [0, 410.0, 230.0], [0, 0, 1]]
PIXELS = [[1.0, 0, 330.0], [0, 0.98, 230.0], [0, 0, 1]]
LENSES = {
    "pinhole": (K, None),
    "brown": (
        K,
        ipm_rs.BrownConrady(
            [-0.1, 0.02, 0.01, -0.02, 1e-3, 0.01, 2e-3, 0, 3e-3, -1e-3, 4e-3, 2e-3, 0.03, -0.02], max_angle=1.0
        ),
    ),
    "kannala": (K, ipm_rs.KannalaBrandt([0.02, -0.004, 0, 0])),
    "mei": (K, ipm_rs.Mei(1.2, [0.05, -0.01, 0.02, 0.01])),
    "double sphere": (K, ipm_rs.DoubleSphere(-0.2, 0.6)),
    "eucm": (K, ipm_rs.Eucm(0.6, 1.1)),
    "polynomial": (PIXELS, ipm_rs.RadialPolynomial([340, -30, 40, -7])),
    "f-theta": (PIXELS, ipm_rs.FTheta([0, 300, 3], "forward", (1.01, 0.02, -0.01))),
    "inverse": (K, ipm_rs.InverseBrownConrady([0.1, 0.02, 0.01, -0.02])),
    "prism": (K, ipm_rs.ThinPrismFisheye([0.01, -0.02, 0.01, -0.02, 3e-3, -1e-3, 0.04, -0.05])),
    "sphere": (K, ipm_rs.Equirectangular()),
    "ocam": (PIXELS, ipm_rs.Ocam([-300, 0, 1e-3, 1e-7], (1.01, 0.02, -0.01))),
}


@pytest.fixture(params=LENSES)
def camera(request) -> ipm_rs.Camera:
    K, lens = LENSES[request.param]
    return ipm_rs.Camera.from_euler(
        K, image_size=(640, 480), position=(1.5, 0.3, 1.4), roll=0.1, pitch=0.2, yaw=-0.3, lens=lens
    )


def points(seed=0) -> np.ndarray:
    return np.random.default_rng(seed).uniform((3, -6, -1), (25, 6, 3), (300, 3))


def same_pixels(view, camera, change, mirror=1):
    before, depth, valid = camera.project(points())
    after, depth_after, valid_after = view.project(points() * (1, mirror, 1))
    assert valid.sum() > 60
    np.testing.assert_allclose(after, change(before), rtol=0, atol=1e-9)
    np.testing.assert_allclose(depth_after, depth, rtol=0, atol=1e-12)
    return valid, valid_after


def test_rotated180(camera):
    valid, after = same_pixels(camera.rotated180(), camera, lambda uv: (639, 479) - uv)
    np.testing.assert_array_equal(valid, after)
    assert camera.rotated180().rotated180() == camera
    np.testing.assert_allclose(camera.rotated180().position, camera.position, rtol=0, atol=1e-15)


def test_mirrored(camera):
    mirrored = camera.mirrored()
    valid, after = same_pixels(mirrored, camera, lambda uv: (639 - uv[:, :1]) * [1, 0] + uv * [0, 1], mirror=-1)
    np.testing.assert_array_equal(valid, after)
    assert mirrored.mirrored() == camera
    np.testing.assert_allclose(mirrored.position, camera.position * (1, -1, 1), rtol=0, atol=1e-15)
    assert np.linalg.det(mirrored.camera_from_vehicle[:3, :3]) == pytest.approx(1)
    upside_down = mirrored.rotated180()
    same_pixels(upside_down, camera, lambda uv: uv * [1, 0] + (479 - uv) * [0, 1], mirror=-1)


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_flipped_pictures_make_the_same_view(camera, interpolation):
    """The bird's-eye view from a turned image is the same; that from a mirrored one is the mirror image."""
    image = textured(480, 640, 3)
    grid = ipm_rs.BevGrid(x=(2, 20), y=(-6, 6), resolution=0.1)
    bev = ipm_rs.Lut(camera, grid).warp(image, interpolation=interpolation).astype(int)
    turned = ipm_rs.Lut(camera.rotated180(), grid).warp(
        np.ascontiguousarray(image[::-1, ::-1]), interpolation=interpolation
    )
    mirrored = ipm_rs.Lut(camera.mirrored(), grid).warp(
        np.ascontiguousarray(image[:, ::-1]), interpolation=interpolation
    )
    assert (bev > 0).mean() > 0.3
    for ours in (turned, mirrored[:, ::-1]):
        # rounding of coordinates may fall on the other side of a half
        assert (np.abs(ours - bev) > 1).mean() < 1e-4


@pytest.mark.parametrize(("x", "y"), [(2, 2), (4, 2), (3, 3), (1, 1)])
def test_binned_is_the_picture_of_blocks(camera, x, y):
    binned = camera.binned(x, y)
    assert binned.image_size == (640 // x, 480 // y)
    same_pixels(binned, camera, lambda uv: (uv + 0.5) / (x, y) - 0.5)
    # a picture that says where its pixels were
    ramp = np.stack(np.meshgrid(np.arange(640, dtype=np.float32), np.arange(480, dtype=np.float32)), axis=-1)
    whole = ramp[: 480 // y * y, : 640 // x * x]
    blocks = cv2.resize(whole, (640 // x, 480 // y), interpolation=cv2.INTER_AREA)
    uv, _, valid = binned.project(points())
    map_xy = uv[valid].astype(np.float32)
    # one channel at a time: of two, cv2 rounds coordinates to 1/32
    looked_up = [cv2.remap(one, map_xy[:, :1], map_xy[:, 1:], cv2.INTER_LINEAR)[:, 0] for one in cv2.split(blocks)]
    np.testing.assert_allclose(np.transpose(looked_up), camera.project(points())[0][valid], rtol=0, atol=1e-3)


@pytest.mark.parametrize(("x", "y"), [(2, 2), (4, 3)])
def test_binned_by_the_first_pixel_is_slicing(camera, x, y):
    binned = camera.binned(x, y, rule="first_pixel")
    same_pixels(binned, camera, lambda uv: uv / (x, y))
    assert binned.binned(1) == binned


def test_one_number_bins_both_axes(seed_camera):
    assert seed_camera.binned(2) == seed_camera.binned(2, 2) == seed_camera.resized(1024, 512)
    K = seed_camera.binned(4, rule="first_pixel").intrinsics
    np.testing.assert_allclose(K[:2], np.array(golden.K)[:2] / 4, rtol=1e-15)


@given(st.integers(1, 9), st.integers(1, 9))
def test_binning_leaves_out_what_is_not_whole(x, y):
    camera = ipm_rs.Camera(K, image_size=(641, 487)).binned(x, y)
    assert camera.image_size == (641 // x, 487 // y)
    assert camera.intrinsics[0, 0] == pytest.approx(420 / x)


@pytest.mark.parametrize(
    ("arguments", "error", "named"),
    [
        ({"x": 0}, errors.ArgumentError, "got 0 x 0"),
        ({"x": 1, "y": 0}, errors.ArgumentError, "1 x 0"),
        ({"x": 2049}, errors.ArgumentError, "2048 x 1024"),
        ({"x": 1.5}, errors.ArgumentTypeError, "x: expected a whole number"),
        ({"x": 2, "rule": "ros"}, errors.ArgumentError, "first_pixel"),
        ({"x": 2, "rule": 3}, errors.ArgumentTypeError, "first_pixel"),
    ],
)
def test_binnings_that_are_refused(seed_camera, arguments, error, named):
    with refuses(error, named):
        seed_camera.binned(**arguments)
