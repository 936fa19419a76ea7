"""The reference itself: against OpenCV, and against answers one can do in the head."""

from __future__ import annotations

import cv2
import golden
import numpy as np
import pytest
from helpers import double_loop, exact_bilinear, textured

from ipm_rs import reference


@pytest.fixture(scope="module")
def maps():
    random = np.random.default_rng(7)
    # thousandths, so that float32 maps for OpenCV mean the same place as ours to 1e-6
    map_x = np.round(random.uniform(-2, 24, (150, 160)), 3)
    map_y = np.round(random.uniform(-2, 18, (150, 160)), 3)
    away = np.abs(map_x % 1 - 0.5) < 1e-3
    map_x[away] += 0.01
    away = np.abs(map_y % 1 - 0.5) < 1e-3
    map_y[away] += 0.01
    return map_x, map_y


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_remaps_are_cv2(maps, channels):
    image = textured(17, 23, channels)
    border = (9, 200, 77, 31)[:channels]
    for ours, flag, tolerance in (
        (reference.remap_nearest, cv2.INTER_NEAREST, 0),
        (reference.remap_bilinear, cv2.INTER_LINEAR, 1),
    ):
        theirs = cv2.remap(
            image,
            *(m.astype(np.float32) for m in maps),
            flag,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=border,
        )
        result = ours(image, *maps, border)
        assert result.dtype == np.uint8
        assert np.abs(result.astype(int) - theirs.reshape(result.shape)).max() <= tolerance


@pytest.mark.parametrize("channels", [None, 2, 5])
def test_bilinear_is_the_exact_blend(maps, channels):
    image = textured(17, 23, channels, "float64")
    exact, _ = exact_bilinear(image, *maps, 12.5)
    np.testing.assert_allclose(reference.remap_bilinear(image, *maps, 12.5), exact, rtol=0, atol=1e-11)


def test_nearest_rounds_halves_to_even():
    row = np.array([[10, 20, 30, 40]], np.uint8)
    us = np.array([[-0.5, 0.5, 1.5, 2.5, 3.5]])
    np.testing.assert_array_equal(reference.remap_nearest(row, us, us * 0, 7), [[10, 10, 30, 30, 7]])


def test_integers_round_halves_up():
    image = np.array([[10, 11, 20], [10, 11, 20]], np.uint8)
    np.testing.assert_array_equal(reference.remap_bilinear(image, [[0.5, 1.5]], [[0.0, 0.5]]), [[11, 16]])
    assert reference.remap_bilinear(image.astype(np.float32), [[0.5]], [[0.0]]) == np.float32(10.5)


def test_halo_and_beyond():
    image = np.full((2, 3), 200, np.uint8)
    us = np.array([[-1.0, -0.5, 0.0, 2.0, 2.5, 3.0, np.nan, np.inf]])
    np.testing.assert_array_equal(
        reference.remap_bilinear(image, us, np.zeros_like(us), 100), [[100, 150, 200, 200, 150, 100, 100, 100]]
    )
    np.testing.assert_array_equal(
        reference.valid_mask(us, np.zeros_like(us), (3, 2)),
        [[False, False, True, True, False, False, False, False]],
    )


def test_a_pixel_without_weight_takes_no_part():
    image = np.array([[1.0, np.nan, 3.0]])
    np.testing.assert_array_equal(
        reference.remap_bilinear(image, [[0.0, 1.0, 2.0, 0.5]], np.zeros((1, 4)), np.nan), [[1, np.nan, 3, np.nan]]
    )


def test_input_is_not_modified(maps):
    image = textured(17, 23, 3)
    before = image.copy(), maps[0].copy(), maps[1].copy()
    reference.remap_nearest(image, *maps, 3)
    reference.remap_bilinear(image, *maps, 3)
    for now, then in zip((image, *maps), before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_maps_are_the_double_loop_where_the_image_is_touched():
    xy = reference.grid_xy((7, 50), (-10, 10), (1.0, 0.5), "corner")
    map_x, map_y = reference.maps(golden.K, golden.RT, golden.IMAGE_SIZE, xy)
    loop_x, loop_y = double_loop(golden.K, golden.RT, xy[:, 0, 0], xy[0, :, 1])
    touches = (loop_x > -1) & (loop_x < 2048) & (loop_y > -1) & (loop_y < 1024)
    np.testing.assert_array_equal(np.isnan(map_x), ~touches)
    assert touches.sum() > 1000 and (~touches).sum() > 100
    np.testing.assert_allclose(map_x[touches], loop_x[touches], rtol=0, atol=1e-9)
    np.testing.assert_allclose(map_y[touches], loop_y[touches], rtol=0, atol=1e-9)


def test_maps_have_nothing_behind_the_camera():
    xy = reference.grid_xy((-60, 0), (-30, 30), 1.0)
    map_x, map_y = reference.maps(golden.K, golden.RT, golden.IMAGE_SIZE, xy)
    assert map_x.size == 3600
    assert np.isnan(map_x).all() and np.isnan(map_y).all()


def test_pixels_to_ground_and_back():
    points = golden.POINTS
    back = reference.ground_from_pixels(golden.UV, golden.K, golden.RT)
    np.testing.assert_allclose(back, points, rtol=0, atol=1e-9)
    raised = reference.ground_from_pixels(golden.UV, golden.K, golden.RT, ground=0.3)
    assert (raised[:, 2] == 0.3).all()
    uv = reference.project(raised, golden.K, golden.RT, golden.IMAGE_SIZE)[0]
    np.testing.assert_allclose(uv, golden.UV, rtol=0, atol=1e-8)
    assert np.isnan(reference.ground_from_pixels([[1000.0, 300.0]], golden.K, golden.RT)).all()


@pytest.mark.parametrize("x", [(0, 1.02), (5, 5), (5, 1), (0, float("nan"))])
def test_grid_shape_refuses_partial_cells(x):
    with pytest.raises(ValueError, match="whole cells"):
        reference.grid_shape(x, (0, 1), 0.05)
