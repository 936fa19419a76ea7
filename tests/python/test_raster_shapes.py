"""Boxes and polygons onto the grid, against the rule cell by cell."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors

GRID = ipm_rs.BevGrid(x=(0, 12), y=(-4, 4), resolution=(0.5, 0.25))


def centres(grid: ipm_rs.BevGrid) -> np.ndarray:
    (rows, columns), (dx, dy) = grid.shape, grid.resolution
    x, y = grid.x[1] - (np.arange(rows) + 0.5) * dx, grid.y[1] - (np.arange(columns) + 0.5) * dy
    return np.stack(np.broadcast_arrays(x[:, None], y), axis=-1)


def in_box(box: list[float]) -> np.ndarray:
    x, y, length, width, yaw = box
    offset = centres(GRID) - [x, y]
    along = offset @ [np.cos(yaw), np.sin(yaw)]
    left = offset @ [-np.sin(yaw), np.cos(yaw)]
    return (np.abs(along) < length / 2) & (np.abs(left) < width / 2)


@given(
    st.lists(
        st.tuples(st.floats(-2, 14), st.floats(-5, 5), st.floats(0.01, 8), st.floats(0.01, 4), st.floats(-7, 7)),
        max_size=6,
    )
)
def test_boxes_are_where_their_formula_says(boxes):
    """Centres nearer to an edge than rounding are left out of the comparison."""
    drawn = ipm_rs.rasterize_boxes(np.array(boxes, dtype=float).reshape(-1, 5), GRID)
    expected, sure = np.zeros(GRID.shape, np.int32), np.ones(GRID.shape, bool)
    for label, (x, y, length, width, yaw) in enumerate(boxes, 1):
        inner = in_box([x, y, length - 1e-9, width - 1e-9, yaw])
        sure &= inner == in_box([x, y, length + 1e-9, width + 1e-9, yaw])
        expected[inner] = label
    assert drawn.dtype == np.int32 and drawn.shape == GRID.shape
    np.testing.assert_array_equal(drawn[sure], expected[sure])


def test_later_boxes_win_and_yaw_turns_left():
    boxes = [[6, 0, 6, 2, 0], [6, 0, 6, 2, np.pi / 2]]
    drawn = ipm_rs.rasterize_boxes(boxes, GRID, labels=[7, -3], background=255)
    assert set(np.unique(drawn)) == {7, -3, 255}
    middle = tuple(np.round(GRID.cell_from_ground([[6.1, 0.1]])[0]).astype(int))
    assert drawn[middle] == -3
    left, right = (
        ipm_rs.rasterize_boxes([[6, 0, 6, 0.6, 0.5]], GRID)[:, :16],
        ipm_rs.rasterize_boxes([[6, 0, 6, 0.6, 0.5]], GRID)[:, 16:],
    )
    assert left[:12].sum() > left[12:].sum() and right[12:].sum() > right[:12].sum(), "its front is to the left"


def test_polygons_that_share_an_edge_share_no_cell_and_leave_none():
    """A fan around a corner of the lattice and one around a centre."""
    for hub in ((6.0, 0.0), (6.25, 0.125)):
        rim = [(0.25, -3.875), (0.25, 0.125), (0.25, 3.875), (6.25, 3.875), (11.75, 3.875), (11.75, -3.875)]
        fan = [[hub, a, b] for a, b in zip(rim, rim[1:] + rim[:1], strict=True)]
        whole = ipm_rs.rasterize_polygons([rim], GRID) > 0
        each = [ipm_rs.rasterize_polygons([part], GRID) > 0 for part in fan]
        np.testing.assert_array_equal(np.sum(each, axis=0), whole)
        assert whole.sum() == 23 * 31
        turned = ipm_rs.rasterize_polygons([rim[::-1]], GRID) > 0
        np.testing.assert_array_equal(turned, whole)


def test_a_figure_of_eight_is_filled_and_its_double_part_is_not():
    eight = [(2, -2), (10, 2), (2, 2), (10, -2)]
    drawn = ipm_rs.rasterize_polygons([eight], GRID)
    far = drawn[: 12 - 1].sum()
    assert far > 0 and drawn[13:].sum() > 0
    twice = [(2, -2), (10, -2), (10, 2), (2, 2)] * 2
    assert ipm_rs.rasterize_polygons([twice], GRID).sum() == 0


def test_on_top_of_what_is_there():
    out = np.full(GRID.shape, 9, np.int32)
    back = ipm_rs.rasterize_boxes([[6, 0, 2, 2, 0]], GRID, [4], out=out)
    assert back is out and set(np.unique(out)) == {4, 9}
    before = out.copy()
    with refuses(errors.ArgumentError, "boxes", "index 1", "not finite", out=out):
        ipm_rs.rasterize_boxes([[6, 0, 9, 9, 0], [np.nan, 0, 2, 2, 0]], GRID, out=out)
    np.testing.assert_array_equal(out, before)


def test_far_and_large():
    assert ipm_rs.rasterize_boxes([[1e8, 0, 2, 2, 0]], GRID).sum() == 0
    assert (ipm_rs.rasterize_boxes([[0, 0, 1e8, 1e8, 0.3]], GRID) == 1).all()
    assert ipm_rs.rasterize_boxes([], GRID).sum() == 0
    assert ipm_rs.rasterize_polygons([], GRID, background=-1).max() == -1
    assert ipm_rs.rasterize_boxes([[6, 0, 0, 0, 0]], GRID).sum() == 0


@pytest.mark.parametrize("sample_at", ["center", "corner"])
def test_centres_are_those_of_the_squares(sample_at):
    grid = ipm_rs.BevGrid(x=(0, 4), y=(-2, 2), resolution=1.0, sample_at=sample_at)
    assert np.argwhere(ipm_rs.rasterize_boxes([[2.5, 0.5, 0.2, 0.2, 0]], grid)).tolist() == [[1, 1]]


@pytest.mark.parametrize(
    ("error", "call", "phrases"),
    [
        (errors.ArgumentError, lambda: ipm_rs.rasterize_boxes([[1, 2, 3, 4]], GRID), ["(N, 5)", "(1, 4)"]),
        (errors.ArgumentError, lambda: ipm_rs.rasterize_boxes([[1, 2, -3, 4, 0]], GRID), ["negative", "index 0"]),
        (errors.ArgumentError, lambda: ipm_rs.rasterize_boxes([[1e300, 2, 3, 4, 0]], GRID), ["1e9 m"]),
        (errors.ArgumentError, lambda: ipm_rs.rasterize_boxes([[1, 2, 3, 4, 0]], GRID, [1, 2]), ["labels", "got 2"]),
        (errors.ArgumentError, lambda: ipm_rs.rasterize_boxes([[1, 2, 3, 4, 0]], GRID, [2**31]), ["labels", "2^31"]),
        (errors.ArgumentError, lambda: ipm_rs.rasterize_boxes([[1, 2, 3, 4, 0]], GRID, [10**30]), ["labels", "2^31"]),
        (errors.ArgumentTypeError, lambda: ipm_rs.rasterize_boxes([[1, 2, 3, 4, 0]], GRID, [1.5]), ["labels", "float"]),
        (errors.ArgumentTypeError, lambda: ipm_rs.rasterize_boxes([[1, 2, 3, 4, 0]], GRID, 3), ["labels", "int"]),
        (errors.ArgumentTypeError, lambda: ipm_rs.rasterize_boxes("boxes", GRID), ["boxes"]),
        (errors.ArgumentTypeError, lambda: ipm_rs.rasterize_boxes([[1, 2, 3, 4, 0]], None), ["grid"]),
        (errors.ArgumentError, lambda: ipm_rs.rasterize_polygons([[(0, 0), (1, 1)]], GRID), ["3 corners", "index 0"]),
        (errors.ArgumentError, lambda: ipm_rs.rasterize_polygons([np.zeros((4, 3))], GRID), ["polygons[0]", "(N, 2)"]),
        (
            errors.ArgumentError,
            lambda: ipm_rs.rasterize_polygons([[(0, 0), (1, np.inf), (1, 1)]], GRID),
            ["not finite"],
        ),
        (errors.ArgumentTypeError, lambda: ipm_rs.rasterize_polygons(5, GRID), ["polygons", "int"]),
        (
            errors.DtypeError,
            lambda: ipm_rs.rasterize_boxes([], GRID, out=np.zeros(GRID.shape)),
            ["out", "int32", "float64"],
        ),
        (
            errors.ArgumentError,
            lambda: ipm_rs.rasterize_boxes([], GRID, out=np.zeros((3, 3), np.int32)),
            ["out", "(3, 3)"],
        ),
        (
            errors.ArgumentError,
            lambda: ipm_rs.rasterize_boxes([], GRID, background=1, out=np.zeros(GRID.shape, np.int32)),
            ["background"],
        ),
        (
            errors.ArgumentError,
            lambda: ipm_rs.rasterize_boxes([], GRID, out=np.zeros((32, 24), np.int32).T),
            ["without gaps"],
        ),
    ],
)
def test_mistakes(error, call, phrases):
    with refuses(error, *phrases):
        call()


def test_an_output_that_may_not_be_written():
    out = np.zeros(GRID.shape, np.int32)
    out.flags.writeable = False
    with refuses(errors.ArgumentError, "out", "writable"):
        ipm_rs.rasterize_boxes([[6, 0, 2, 2, 0]], GRID, out=out)
