"""Two published functions: value for value, their defects included, the input left alone."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses, same
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors, reference

FOV = 90.0


def matrix(w: int, h: int) -> np.ndarray:
    """CARLA's own, counted from the corner."""
    focal = w / (2 * np.tan(FOV * np.pi / 360))
    return np.array([[focal, 0, w / 2], [0, focal, h / 2], [0, 0, 1.0]])


def normalized(w: int, h: int, dtype: str, seed: int = 0) -> np.ndarray:
    """Depths from 0 to 1 with exact limits, their neighbours and NaN among them."""
    depth = np.random.default_rng(seed).random((h, w)).astype(dtype)
    limit = depth.dtype.type(0.9)
    special = [limit, np.nextafter(limit, depth.dtype.type(1)), np.nextafter(limit, depth.dtype.type(0)), np.nan, 0, 1]
    flat = depth.reshape(-1)
    flat[: len(special)] = special[: flat.size]
    return depth


def literally(depth, w, h, K, max_depth):
    """The document's loop over pixels, written out from its description."""
    points, metres = np.zeros((3, w * h)), np.zeros((h, w), depth.dtype)
    inverse = np.linalg.inv(K)
    for i in range(h):
        for j in range(w):
            d, u, v = depth[i, j], w - 1 - j, h - 1 - i
            if d > max_depth:
                d, u, v = depth.dtype.type(0), 0, 0
            metres[i, j] = d * depth.dtype.type(1000)
            px, py, pz = inverse @ [u, v, 1] * float(metres[i, j])
            points[:, i * w + j] = pz, px, py
    return points, metres


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_depth_to_lidar_is_what_the_document_computes(dtype):
    w, h = 24, 17
    depth = normalized(w, h, dtype)
    before = depth.tobytes()
    points, metres = ipm_rs.depth_to_lidar(depth, w, h, matrix(w, h))
    assert depth.tobytes() == before, "the original writes zeros into it"
    assert points.shape == (3, w * h) and points.dtype == np.float64
    assert metres.shape == (h, w) and metres.dtype == dtype
    for expected in (
        literally(depth, w, h, matrix(w, h), 0.9),
        reference.depth_to_lidar(depth, w, h, matrix(w, h)),
    ):
        # the matrix product of NumPy may fuse: the last digit is BLAS's own
        assert np.allclose(points, expected[0], rtol=1e-13, atol=1e-10, equal_nan=True)
        assert same(metres, expected[1])


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_the_limit_itself_and_nan_stay(dtype):
    depth = normalized(10, 8, dtype)
    limit = float(depth[0, 0])
    points, metres = ipm_rs.depth_to_lidar(depth, 10, 8, matrix(10, 8), limit)
    assert metres[0, 0] == depth[0, 0] * depth.dtype.type(1000) and points[0, 0] > 899
    assert metres[0, 1] == 0 and (points[:, 1] == 0).all(), "farther: at the origin, count and order kept"
    assert metres[0, 2] > 899
    assert np.isnan(metres[0, 3]) and np.isnan(points[:, 3]).all()
    cloud = ipm_rs.depth_to_local_point_cloud(depth, FOV, max_depth=limit)
    assert len(cloud) == np.count_nonzero(~(depth > limit)) and np.isnan(cloud).any(1).sum() == 1


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_carla_084_deletes_where_the_document_zeroes(dtype):
    w, h = 24, 17
    depth = normalized(w, h, dtype)
    cloud = ipm_rs.depth_to_local_point_cloud(depth, FOV)
    kept = ~(depth.ravel() > 0.9)
    assert cloud.shape == (kept.sum(), 3) and cloud.dtype == np.float64
    assert np.allclose(cloud, reference.depth_to_local_point_cloud(depth, FOV), rtol=1e-13, atol=1e-10, equal_nan=True)
    lidar, _ = ipm_rs.depth_to_lidar(depth, w, h, matrix(w, h))
    assert np.array_equal(lidar.T[kept], cloud[:, (2, 0, 1)], equal_nan=True)
    color = np.random.default_rng(0).integers(0, 256, (h, w, 3), dtype=np.uint8)
    again, colors = ipm_rs.depth_to_local_point_cloud(depth, FOV, color=color)
    assert same(again, cloud) and same(colors, color.reshape(-1, 3)[kept])


@given(w=st.integers(1, 12), h=st.integers(1, 12), seed=st.integers(0, 99), limit=st.floats(0, 1))
def test_any_size_and_limit(w, h, seed, limit):
    depth = normalized(w, h, "float64", seed)
    K = matrix(w, h) + np.random.default_rng(seed).random((3, 3)) * 0.1  # any invertible matrix
    points, metres = ipm_rs.depth_to_lidar(depth, w, h, K, max_depth=limit)
    expected = reference.depth_to_lidar(depth, w, h, K, limit)
    assert np.allclose(points, expected[0], rtol=1e-9, atol=1e-7, equal_nan=True)
    assert same(metres, expected[1])


def test_flat_strided_and_whole_inputs():
    depth = normalized(10, 8, "float64")
    expected = ipm_rs.depth_to_lidar(depth, 10, 8, matrix(10, 8))
    wide = np.repeat(depth, 2, axis=1)
    for view in (depth.ravel(), depth.tolist(), wide[:, ::2], np.asfortranarray(depth), depth[..., None]):
        got = ipm_rs.depth_to_lidar(view, 10, 8, matrix(10, 8))
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(got, expected, strict=True))
    points, metres = ipm_rs.depth_to_lidar(np.ones((8, 10), np.uint8), 10, 8, matrix(10, 8), max_depth=2)
    assert (points[0] == 1000).all() and metres.dtype == np.float64


def test_wrong_arguments_are_refused():
    depth, K = normalized(10, 8, "float64"), matrix(10, 8)
    with refuses(errors.ImageError, "normalized_depth", "8 x 10", "(7, 10)"):
        ipm_rs.depth_to_lidar(depth[:7], 10, 8, K)
    for singular in (np.zeros((3, 3)), np.ones((3, 3)), K * np.nan, np.diag([1.0, 1.0, 0.0])):
        with refuses(errors.CalibrationError, "K", "invertible"):
            ipm_rs.depth_to_lidar(depth, 10, 8, singular)
    with refuses(errors.ArgumentError, "K", "3x3", "(4, 4)"):
        ipm_rs.depth_to_lidar(depth, 10, 8, np.eye(4))
    with refuses(errors.ArgumentError, "max_depth", "nan"):
        ipm_rs.depth_to_lidar(depth, 10, 8, K, np.nan)
    with refuses(errors.ArgumentTypeError, "w", "whole"):
        ipm_rs.depth_to_lidar(depth, 10.0, 8, K)
    with refuses(errors.ArgumentTypeError, "normalized_depth", "str"):
        ipm_rs.depth_to_lidar("depth", 10, 8, K)
    with refuses(errors.ImageError, "normalized_depth", "at least one"):
        ipm_rs.depth_to_lidar(np.zeros((0, 10)), 10, 0, K)
    for fov in (0, 180, -90, np.nan):
        with refuses(errors.ArgumentError, "fov", "degrees"):
            ipm_rs.depth_to_local_point_cloud(depth, fov)
    with refuses(errors.ImageError, "(H, W)"):
        ipm_rs.depth_to_local_point_cloud(depth.ravel(), 90)
    with refuses(errors.ImageError, "color", "(8, 10, C)"):
        ipm_rs.depth_to_local_point_cloud(depth, 90, color=np.zeros((7, 10, 3), np.uint8))
