"""BevGrid: shapes, both samplings, metres and cells, refusals."""

from __future__ import annotations

import time

import golden
import numpy as np
import pytest
from helpers import refuses
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors, reference

NAN, INF = float("nan"), float("inf")


def grid(x=(7, 50), y=(-10, 10), resolution=(0.05, 0.025), **options) -> ipm_rs.BevGrid:
    return ipm_rs.BevGrid(x=x, y=y, resolution=resolution, **options)


def test_documents_shape(seed_grid):
    assert seed_grid.shape == golden.GRID_SHAPE
    assert reference.grid_shape(golden.GRID_X, golden.GRID_Y, golden.GRID_RESOLUTION) == golden.GRID_SHAPE
    assert (seed_grid.x, seed_grid.y) == (golden.GRID_X, golden.GRID_Y)
    assert seed_grid.resolution == golden.GRID_RESOLUTION
    assert seed_grid.sample_at == "corner"


def test_43_metres_are_860_rows_whatever_the_last_bit_says():
    assert 43 / 0.05 == 860.0
    for x in [(7, 50), (7.1, 50.1), (-43, 0), (0.3, 43.3), (1e4 + 7, 1e4 + 50)]:
        for resolution in (0.05, np.nextafter(0.05, 1), np.nextafter(0.05, 0)):
            assert grid(x=x, y=(0, 1), resolution=(resolution, 0.5)).shape == (860, 2)
    assert int((7.3 - 7.0) / 0.1) == 2, "the plain quotient does fall short"
    assert grid(x=(7.0, 7.3), y=(0, 1), resolution=(0.1, 0.5)).shape == (3, 2)


def test_corner_samples_are_the_documents(seed_grid):
    xy = seed_grid.xy()
    assert xy.shape == (860, 800, 2) and xy.dtype == np.float64
    rows, columns = np.arange(860), np.arange(800)
    np.testing.assert_allclose(xy[:, :, 0], np.tile(50 - 0.05 * rows[:, None], (1, 800)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(xy[:, :, 1], np.tile(10 - 0.025 * columns[None], (860, 1)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(xy[-1, -1], (7.05, -9.975), rtol=0, atol=1e-9)


def test_centre_samples_are_half_a_cell_on_and_the_default():
    centre, corner = grid(), grid(sample_at="corner")
    assert centre.sample_at == "center"
    assert centre == grid(sample_at="center") != corner
    np.testing.assert_allclose(corner.xy() - centre.xy(), np.full((860, 800, 2), (0.025, 0.0125)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(centre.xy()[0, 0], (49.975, 9.9875), rtol=0, atol=1e-9)


@pytest.mark.parametrize("sample_at", ["center", "corner"])
def test_xy_is_the_reference(sample_at):
    ours = grid(x=(-3.5, 12.1), y=(-2.4, 7.2), resolution=(0.3, 0.4), sample_at=sample_at)
    theirs = reference.grid_xy((-3.5, 12.1), (-2.4, 7.2), (0.3, 0.4), sample_at)
    assert ours.shape == theirs.shape[:2] == (52, 24)
    np.testing.assert_allclose(ours.xy(), theirs, rtol=0, atol=1e-9)


def test_one_number_serves_both_directions():
    assert grid(resolution=0.5) == grid(resolution=(0.5, 0.5))
    assert grid(resolution=0.5).shape == (86, 40)
    assert grid(resolution=0.5).resolution == (0.5, 0.5)


def test_ranges_given_in_whole_numbers_come_back_as_floats():
    assert all(isinstance(value, float) for value in (*grid().x, *grid().y, *grid().resolution))


def test_a_single_cell():
    one = grid(x=(5, 6), y=(2, 3), resolution=1)
    assert one.shape == (1, 1)
    np.testing.assert_array_equal(one.xy(), [[[5.5, 2.5]]])


def test_far_left_is_the_first_cell(seed_grid):
    xy = seed_grid.xy()
    assert (np.diff(xy[:, :, 0], axis=0) < 0).all(), "row 0 is farthest ahead"
    assert (np.diff(xy[:, :, 1], axis=1) < 0).all(), "column 0 is leftmost"


# ---------------------------------------------------------------------------------------------------------------------
# Cells and metres


@pytest.mark.parametrize("sample_at", ["center", "corner"])
def test_whole_cell_coordinates_are_the_samples(sample_at):
    g = grid(x=(0, 6), y=(-2, 2), resolution=(0.5, 0.25), sample_at=sample_at)
    rows, columns = g.shape
    cells = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1).reshape(-1, 2)
    samples = g.xy().reshape(-1, 2)
    assert len(cells) == 12 * 16
    np.testing.assert_allclose(g.ground_from_cell(cells.astype(float)), samples, rtol=0, atol=1e-12)
    np.testing.assert_allclose(g.cell_from_ground(samples), cells, rtol=0, atol=1e-9)


def test_corner_cell_zero_is_the_far_left_corner(seed_grid):
    np.testing.assert_allclose(seed_grid.cell_from_ground(np.array([[50.0, 10.0]])), [[0, 0]], rtol=0, atol=1e-9)
    np.testing.assert_allclose(seed_grid.cell_from_ground(np.array([[7.0, -10.0]])), [[860, 800]], rtol=0, atol=1e-9)
    np.testing.assert_allclose(seed_grid.cell_from_ground(np.array([[49.9, 0.0]])), [[2, 400]], rtol=0, atol=1e-9)


@given(
    low=st.floats(-50, 50),
    rows=st.integers(1, 400),
    columns=st.integers(1, 400),
    dx=st.sampled_from([0.01, 0.025, 0.05, 0.1, 0.2, 0.3, 1 / 3, 1.0]),
    dy=st.sampled_from([0.01, 0.03, 0.1, 0.7]),
    sample_at=st.sampled_from(["center", "corner"]),
)
def test_metres_to_cells_and_back(low, rows, columns, dx, dy, sample_at):
    g = grid(x=(low, low + rows * dx), y=(-low, -low + columns * dy), resolution=(dx, dy), sample_at=sample_at)
    assert g.shape == (rows, columns)
    cells = np.array([[0.0, 0.0], [rows - 1, columns - 1], [0.25, -3.5], [rows * 2.0, -columns]])
    points = g.ground_from_cell(cells)
    np.testing.assert_allclose(g.cell_from_ground(points), cells, rtol=0, atol=1e-7)
    np.testing.assert_allclose(g.ground_from_cell(g.cell_from_ground(points)), points, rtol=0, atol=1e-9)
    np.testing.assert_allclose(points[0], g.xy()[0, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(points[1], g.xy()[-1, -1], rtol=0, atol=1e-9)


def test_cells_of_points_outside_continue_the_grid(seed_grid):
    cells = seed_grid.cell_from_ground(np.array([[51.0, 11.0], [0.0, -20.0]]))
    np.testing.assert_allclose(cells, [[-20, -40], [1000, 1200]], rtol=0, atol=1e-9)


def test_nan_points_have_nan_cells(seed_grid):
    cells = seed_grid.cell_from_ground(np.array([[NAN, 1.0], [20.0, 0.0]]))
    assert np.isnan(cells[0, 0])
    assert np.isfinite(cells[1]).all()


def test_no_points_give_no_cells(seed_grid):
    assert seed_grid.cell_from_ground(np.empty((0, 2))).shape == (0, 2)
    assert seed_grid.ground_from_cell(np.empty((0, 2))).shape == (0, 2)


def test_repr_names_shape_ranges_and_sampling(seed_grid):
    text = repr(seed_grid)
    for part in ("860", "800", "0.05", "0.025", "corner", "50", "-10"):
        assert part in text, text


# ---------------------------------------------------------------------------------------------------------------------
# Refusals


@pytest.mark.parametrize(
    ("x", "resolution", "nearest"),
    [
        ((7, 50.02), 0.05, ("860", "50")),
        ((7, 50.03), 0.05, ("861", "50.05")),
        ((0, 1), 0.3, ("(0, 0.9)", "3 cells")),
        ((0, 10), 3.0, ("3", "9")),
        ((0, 0.4), 1.0, ("1",)),
        ((7, 50 + 2e-6 * 0.05 * 10), 0.05, ("860",)),
    ],
)
def test_partial_cells_are_refused_naming_the_nearest(x, resolution, nearest):
    with refuses(errors.GridError, "x", *nearest):
        grid(x=x, y=(0, 100), resolution=(resolution, 1))
    with refuses(errors.GridError, "y", *nearest):
        grid(x=(0, 100), y=x, resolution=(1, resolution))


def test_whole_cells_to_1e_6_of_a_cell():
    assert grid(x=(7, 50 + 0.5e-6 * 0.05), y=(0, 1), resolution=(0.05, 1)).shape == (860, 1)
    with refuses(errors.GridError, "860"):
        grid(x=(7, 50 + 2e-6 * 0.05), y=(0, 1), resolution=(0.05, 1))


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("bad", [(50, 7), (5, 5), (10, -10)], ids=str)
def test_reversed_and_empty_ranges(axis, bad):
    with refuses(errors.GridError, axis, str(bad[0]), str(bad[1])):
        grid(**{axis: bad})


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("bad", [(NAN, 5), (0, NAN), (-INF, 5), (0, INF)], ids=str)
def test_ranges_are_finite(axis, bad):
    with refuses(errors.GridError, axis, "finite"):
        grid(**{axis: bad})


@pytest.mark.parametrize("bad", [0, 0.0, -0.05, NAN, INF, (0.05, 0), (-0.05, 0.05), (NAN, 1), (1, INF)], ids=str)
def test_cell_size_is_positive_and_finite(bad):
    with refuses(errors.GridError, "resolution"):
        grid(resolution=bad)


@pytest.mark.parametrize("resolution", [1e-9, 1e-6, 1e-300, 5e-324, (1e-7, 1e-7)], ids=str)
def test_absurd_cells_are_refused_before_the_memory_is_asked_for(resolution):
    began = time.perf_counter()
    with refuses(errors.GridError, "resolution"):
        ipm_rs.BevGrid(x=(0, 50), y=(0, 50), resolution=resolution)
    assert time.perf_counter() - began < 0.5


def test_absurd_ranges_are_refused_before_the_memory_is_asked_for():
    for top in (1e9, 1e300, 1.7e308):
        with refuses(errors.GridError, "cells"):
            ipm_rs.BevGrid(x=(0, top), y=(0, top), resolution=1.0)
    with refuses(errors.GridError, "x"):
        ipm_rs.BevGrid(x=(-1.7e308, 1.7e308), y=(0, 1), resolution=1.0)


@pytest.mark.parametrize("bad", [5, None, "ab", (1,), (1, 2, 3), ("a", "b"), ()], ids=str)
@pytest.mark.parametrize("name", ["x", "y"])
def test_ranges_are_two_numbers(name, bad):
    with pytest.raises((errors.ArgumentError, errors.ArgumentTypeError), match=rf"{name}: expected .*got"):
        grid(**{name: bad})


@pytest.mark.parametrize("bad", [None, "fine", (0.1,), (0.1, 0.1, 0.1), ()], ids=str)
def test_resolution_is_one_or_two_numbers(bad):
    with pytest.raises((errors.ArgumentError, errors.ArgumentTypeError), match=r"resolution: expected .*got"):
        grid(resolution=bad)


@pytest.mark.parametrize("bad", ["centre", "Center", "", "edge", 0.5, b"center"], ids=str)
def test_sampling_has_two_names(bad):
    with pytest.raises((errors.ArgumentError, errors.ArgumentTypeError), match=r"center.*corner.*got"):
        grid(sample_at=bad)


def test_arguments_are_named():
    with pytest.raises(TypeError):
        ipm_rs.BevGrid((7, 50), (-10, 10), 0.05)
    with pytest.raises(TypeError, match="resolution"):
        ipm_rs.BevGrid(x=(7, 50), y=(-10, 10))


@pytest.mark.parametrize("shape", [(), (2,), (5, 3), (2, 5, 2)], ids=str)
def test_points_of_another_shape(seed_grid, shape):
    with refuses(errors.ArgumentError, "(N, 2)", str(shape).strip("(),")):
        seed_grid.cell_from_ground(np.ones(shape))
    with refuses(errors.ArgumentError, "(N, 2)", str(shape).strip("(),")):
        seed_grid.ground_from_cell(np.ones(shape))
