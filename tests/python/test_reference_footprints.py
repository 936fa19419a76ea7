"""The reference's footprints, area and mode: against OpenCV, brute force, and answers one can do in the head."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from helpers import textured

from ipm_rs import reference


def upright(width, height, columns, rows):
    """Maps and footprints of cells of whole boxes of pixels."""
    x, y = np.meshgrid(np.arange(columns + 1) * width - 0.5, np.arange(rows + 1) * height - 0.5)
    return (x[:-1, :-1] + width / 2, y[:-1, :-1] + height / 2), reference.footprints(x, y)


def test_covered_areas_by_hand():
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    np.testing.assert_allclose(reference.covered_area(square, (0, 2), (0, 2)), np.full((2, 2), 0.25), atol=1e-15)
    triangle = [(-0.5, -0.5), (1.5, -0.5), (-0.5, 0.5)]  # half of 2 x 1 pixels
    np.testing.assert_allclose(reference.covered_area(triangle, (0, 2), (0, 2)), [[0.75, 0.25], [0, 0]], atol=1e-15)
    np.testing.assert_allclose(reference.covered_area(triangle[::-1], (0, 2), (0, 1)), [[0.75, 0.25]], atol=1e-15)


@pytest.mark.parametrize("seed", range(4))
def test_covered_areas_are_what_many_points_say(seed):
    random = np.random.default_rng(seed)
    angles = np.sort(random.uniform(0, 2 * np.pi, 4))
    polygon = (6.3, 4.8) + random.uniform(3, 6) * np.column_stack([np.cos(angles), 0.6 * np.sin(angles)])
    got = reference.covered_area(polygon, (0, 13), (0, 10))
    n = 60  # points along a pixel
    x, y = np.meshgrid((np.arange(13 * n) + 0.5) / n - 0.5, (np.arange(10 * n) + 0.5) / n - 0.5)
    points = np.column_stack([x.ravel(), y.ravel()])
    edges = zip(polygon, np.roll(polygon, -1, axis=0), strict=True)
    left = [(points - start) @ (start[1] - end[1], end[0] - start[0]) > 0 for start, end in edges]
    inside = (np.all(left, axis=0) | ~np.any(left, axis=0)).reshape(10, n, 13, n)
    assert got.sum() > 5
    np.testing.assert_allclose(got, inside.mean(axis=(1, 3)), atol=0.02)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(("width", "height"), [(2, 2), (4, 3), (2.5, 4), (5, 1.25)])
def test_upright_means_are_those_of_opencv(width, height, channels):
    image = textured(60, 100, channels, "float32")
    columns, rows = int(100 / width), int(60 / height)
    maps, footprints = upright(width, height, columns, rows)
    theirs = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
    got = reference.remap_area(image, *maps, footprints)
    np.testing.assert_allclose(got, theirs.reshape(got.shape), atol=2e-3)


def test_a_footprint_of_a_pixel_or_less_is_bilinear():
    image = textured(20, 30, 3, "float64")
    x, y = np.meshgrid(np.arange(9) * 0.8 + 5.3, np.arange(7) * 0.5 + 4.1)
    footprints = reference.footprints(x, y)
    np.testing.assert_allclose(np.ptp(footprints, axis=-2), 1)
    maps = (x[:-1, :-1] + 0.4, y[:-1, :-1] + 0.25)
    expected = reference.remap_bilinear(image, *maps)
    np.testing.assert_allclose(reference.remap_area(image, *maps, footprints), expected, atol=1e-10)


def test_corners_of_the_grid_surround_its_samples():
    for sample_at in ("center", "corner"):
        grid = ((2.0, 5.0), (-1.0, 2.0), (0.5, 0.25), sample_at)
        corners = reference.grid_corners(*grid)
        middles = (corners[:-1, :-1] + corners[1:, 1:]) / 2
        np.testing.assert_allclose(middles, reference.grid_xy(*grid), atol=1e-12)
    np.testing.assert_allclose(
        reference.grid_corners((2.0, 5.0), (-1.0, 2.0), (0.5, 0.25))[[0, -1], [0, -1]], [(5, 2), (2, -1)]
    )


def test_mode_is_what_covers_most():
    labels = np.full((8, 8), 7, np.int16)
    labels[:4, :4] = [[-3, -3, -3, 7], [-3, -3, 7, 7], [-3, -3, 7, 7], [-3, -3, 7, 7]]  # 9 of 16
    labels[4:, :2] = 2  # half
    maps, footprints = upright(4, 4, 2, 2)
    assert reference.remap_mode(labels, *maps, footprints).tolist() == [[-3, 7], [2, 7]]


def test_what_is_outside_takes_no_part():
    image = np.full((6, 6), 5.0)
    image[:, 0] = 50.0
    corners = np.array([[-3.5, 1.5], [-3.5, 1.5]]), np.array([[0.5, 0.5], [3.5, 3.5]])
    footprint = reference.footprints(*corners)
    assert reference.remap_area(image, [[0.0]], [[2.0]], footprint, 9) == pytest.approx((50 + 5) / 2)
    assert reference.remap_area(image, [[-1.5]], [[2.0]], footprint, 9) == 9  # its own middle is outside
    assert reference.remap_mode(image.astype(int), [[0.0]], [[2.0]], footprint) == 5
