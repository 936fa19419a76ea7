"""Lut: where each cell samples, and which cells see nothing."""

from __future__ import annotations

import pickle

import cv2
import golden
import numpy as np
import pytest
from helpers import double_loop, same, textured
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import reference


def identity_maps(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    map_x, map_y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    return map_x, map_y


# ---------------------------------------------------------------------------------------------------------------------
# From camera and grid, against the documents' double loop


def check_against_double_loop(lut, camera, xs, ys, rows, columns, ground=0.0):
    """Where our maps are not NaN they are the loop's; where they are, the loop's cell cannot see the image."""
    pick = np.ix_(rows, columns)
    map_x, map_y = (m[pick] for m in lut.maps())
    loop_x, loop_y = double_loop(camera.intrinsics, camera.camera_from_vehicle, xs[rows], ys[columns], ground)
    seen = ~np.isnan(map_x)
    assert (seen == ~np.isnan(map_y)).all()
    assert seen.any() and not seen.all(), "the scene must have both kinds of cell"
    np.testing.assert_allclose(map_x[seen], loop_x[seen], rtol=0, atol=1e-3)
    np.testing.assert_allclose(map_y[seen], loop_y[seen], rtol=0, atol=1e-3)
    width, height = camera.image_size
    depth = np.array([[camera.camera_from_vehicle[2] @ (x, y, ground, 1.0) for y in ys[columns]] for x in xs[rows]])
    touches = (depth > 0) & (loop_x > -1) & (loop_x < width) & (loop_y > -1) & (loop_y < height)
    np.testing.assert_array_equal(seen, touches)
    inside = touches & (loop_x >= 0) & (loop_x <= width - 1) & (loop_y >= 0) & (loop_y <= height - 1)
    np.testing.assert_array_equal(lut.mask[pick], inside)


def test_coarse_grid_is_the_double_loop(seed_camera):
    grid = ipm_rs.BevGrid(x=(7, 50), y=(-10, 10), resolution=(0.5, 0.25), sample_at="corner")
    lut = ipm_rs.Lut(seed_camera, grid)
    assert lut.shape == (86, 80)
    xs, ys = 50 - 0.5 * np.arange(86), 10 - 0.25 * np.arange(80)
    check_against_double_loop(lut, seed_camera, xs, ys, np.arange(86), np.arange(80))


def test_cells_of_the_full_grid_are_the_double_loop(seed_camera, seed_lut):
    random = np.random.default_rng(1)
    rows = np.unique(np.r_[0, 859, random.integers(0, 860, 70)])
    columns = np.unique(np.r_[0, 799, random.integers(0, 800, 70)])
    xs, ys = 50 - 0.05 * np.arange(860), 10 - 0.025 * np.arange(800)
    check_against_double_loop(seed_lut, seed_camera, xs, ys, rows, columns)


@pytest.mark.parametrize("ground", [-0.33, 0.2])
def test_road_height_and_centre_sampling(seed_camera, ground):
    grid = ipm_rs.BevGrid(x=(4, 40), y=(-12, 12), resolution=(0.6, 0.3))
    lut = ipm_rs.Lut(seed_camera, grid, ground=ground)
    xs, ys = 40 - 0.6 * (np.arange(60) + 0.5), 12 - 0.3 * (np.arange(80) + 0.5)
    check_against_double_loop(lut, seed_camera, xs, ys, np.arange(60), np.arange(80), ground)
    flat = ipm_rs.Lut(seed_camera, grid)
    assert lut != flat


def test_full_grid_is_the_reference(seed_lut):
    xy = reference.grid_xy(golden.GRID_X, golden.GRID_Y, golden.GRID_RESOLUTION, "corner")
    expected = reference.maps(golden.K, golden.RT, golden.IMAGE_SIZE, xy)
    for ours, theirs in zip(seed_lut.maps(), expected, strict=True):
        np.testing.assert_array_equal(np.isnan(ours), np.isnan(theirs))
        # half a Q15 step, and half a float32 step at column 2047
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=2**-16 + 2**-13)
    valid = reference.valid_mask(*expected, golden.IMAGE_SIZE)
    np.testing.assert_array_equal(seed_lut.mask, valid)
    halo = ~np.isnan(expected[0]) & ~valid
    assert valid.sum() == 586_241 and halo.sum() == 164, "the scene has a halo to speak of"


def test_every_corner_of_the_grid_lands_on_its_golden_pixel(seed_lut):
    map_x, map_y = seed_lut.maps()
    np.testing.assert_allclose((map_x[0, 0], map_y[0, 0]), golden.UV[4], rtol=0, atol=1e-4)
    np.testing.assert_allclose((map_x[800, 400], map_y[800, 400]), golden.UV[0], rtol=0, atol=1e-4)  # (10, 0)
    np.testing.assert_allclose((map_x[800, 280], map_y[800, 280]), golden.UV[1], rtol=0, atol=1e-4)  # (10, 3)
    np.testing.assert_allclose((map_x[800, 520], map_y[800, 520]), golden.UV[2], rtol=0, atol=1e-4)  # (10, -3)


def test_properties(seed_lut):
    assert seed_lut.shape == (860, 800)
    assert seed_lut.source_size == (2048, 1024)
    fresh = pickle.loads(pickle.dumps(seed_lut))  # other tests' warps have added to it
    assert isinstance(fresh.nbytes, int) and 0 < fresh.nbytes <= 12 * 860 * 800 + 4096
    assert (seed_lut.mask.shape, seed_lut.mask.dtype) == ((860, 800), np.bool_)
    for coordinates in seed_lut.maps():
        assert (coordinates.shape, coordinates.dtype) == ((860, 800), np.float32)
    text = repr(seed_lut)
    for part in ("860", "800", "2048", "1024"):
        assert part in text, text


@pytest.mark.parametrize("outside", [-9, -9.0, np.float32(-9), 1e6, np.inf, np.nan])
def test_outside_value_of_maps(seed_lut, outside):
    seen = ~np.isnan(seed_lut.maps()[0])
    for with_outside, plain in zip(seed_lut.maps(outside=outside), seed_lut.maps(), strict=True):
        np.testing.assert_array_equal(with_outside[seen], plain[seen])
        np.testing.assert_array_equal(with_outside[~seen], np.float32(outside))


def test_arrays_handed_out_do_not_reach_the_table(seed_camera):
    lut = ipm_rs.Lut(seed_camera, ipm_rs.BevGrid(x=(8, 12), y=(-2, 2), resolution=0.5))
    before = lut.mask.copy(), *(m.copy() for m in lut.maps())
    for array in (lut.mask, *lut.maps()):
        try:
            array[...] = 0
        except ValueError:
            continue  # read-only is as good
    for now, then in zip((lut.mask, *lut.maps()), before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_building_does_not_depend_on_the_threads(seed_camera, seed_grid, seed_lut):
    before = ipm_rs.get_num_threads()
    try:
        for threads in (1, 2, 7):
            ipm_rs.set_num_threads(threads)
            assert ipm_rs.Lut(seed_camera, seed_grid) == seed_lut
    finally:
        ipm_rs.set_num_threads(before)


# ---------------------------------------------------------------------------------------------------------------------
# Behind the camera


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_sixty_metres_round_the_car_paint_nothing_behind_the_camera(seed_camera, interpolation):
    grid = ipm_rs.BevGrid(x=(-60, 60), y=(-60, 60), resolution=0.2, sample_at="corner")
    xy = grid.xy()
    points = np.concatenate([xy, np.zeros_like(xy[..., :1])], axis=-1)
    _, depth, _ = reference.project(points, golden.K, golden.RT, golden.IMAGE_SIZE)
    behind = depth <= 0
    # without culling, the homography paints the mirror image of the road ahead
    homogeneous = points @ golden.RT[:3, :3].T + golden.RT[:3, 3]
    with np.errstate(divide="ignore"):
        mirrored = (homogeneous @ golden.K.T)[..., :2] / homogeneous[..., 2:]
    ghosts = behind & reference.valid_mask(mirrored[..., 0], mirrored[..., 1], golden.IMAGE_SIZE)
    assert ghosts.sum() > 10_000, "the scene must tempt"

    lut = ipm_rs.Lut(seed_camera, grid)
    bev = lut.warp(np.full((1024, 2048), 255, np.uint8), interpolation=interpolation, border_value=0)
    assert not lut.mask[behind].any()
    assert not bev[behind].any()
    for coordinates in lut.maps():
        assert np.isnan(coordinates[behind]).all()
    assert lut.mask.sum() > 10_000 and (bev[lut.mask] == 255).all()


def test_a_camera_that_looks_away_sees_nothing(seed_camera):
    backwards = seed_camera.with_pose(golden.RT @ np.diag([-1.0, -1.0, 1.0, 1.0]))
    with pytest.warns(ipm_rs.CalibrationWarning, match="behind it"):
        lut = ipm_rs.Lut(backwards, ipm_rs.BevGrid(x=(7, 50), y=(-10, 10), resolution=0.5))
    assert not lut.mask.any()
    bev = lut.warp(np.full((1024, 2048, 3), 255, np.uint8), border_value=(1, 2, 3))
    assert (bev == (1, 2, 3)).all()


def test_a_grid_under_the_camera(seed_camera):
    """The cell whose depth is zero has no pixel and disturbs no other."""
    level = ipm_rs.Camera.from_euler(golden.K, image_size=golden.IMAGE_SIZE, position=(0.0, 0.0, 1.2))
    lut = ipm_rs.Lut(level, ipm_rs.BevGrid(x=(-10, 10), y=(-10, 10), resolution=1.0, sample_at="corner"))
    assert lut.shape == (20, 20)
    assert not lut.mask[10:].any(), "x = 0 and behind"
    assert lut.mask[:7].any()


# ---------------------------------------------------------------------------------------------------------------------
# From maps


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_maps_come_back(dtype):
    map_x, map_y = (m.astype(dtype) for m in identity_maps(7, 5))
    lut = ipm_rs.Lut.from_maps(map_x + dtype_of(dtype)(0.25), map_y, source_size=(9, 5))
    assert lut.shape == (5, 7) and lut.source_size == (9, 5)
    for ours, given_map in zip(lut.maps(), (map_x + 0.25, map_y), strict=True):
        np.testing.assert_array_equal(ours, given_map)
    assert lut.mask.all()


def dtype_of(name: str):
    return np.dtype(name).type


def test_float64_maps_keep_their_digits():
    """A coordinate just below a half: as float32 it would be the half, and go to the even neighbour."""
    image = np.arange(2048, dtype=np.uint16)[np.newaxis]
    for coordinate, pixel in [(1500.4999999, 1500), (1501.4999999, 1501), (1501.5, 1502), (1500.5, 1500)]:
        lut = ipm_rs.Lut.from_maps(np.array([[coordinate]]), np.zeros((1, 1)), source_size=(2048, 1))
        assert lut.warp(image, interpolation="nearest") == pixel, coordinate
        assert np.round(lut.maps()[0][0, 0]) == pixel, "float32 maps stay on the same side"


def test_maps_may_be_strided():
    map_x, map_y = identity_maps(8, 6)
    big_x, big_y = np.zeros((12, 16)), np.zeros((6, 8), order="F")
    big_x[::2, ::2], big_y[...] = map_x, map_y
    contiguous = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 6))
    assert ipm_rs.Lut.from_maps(big_x[::2, ::2], big_y, source_size=(8, 6)) == contiguous
    assert ipm_rs.Lut.from_maps(map_x[::-1][::-1], map_y, source_size=(8, 6)) == contiguous


def test_maps_taken_in_are_copies():
    map_x, map_y = identity_maps(8, 6)
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 6))
    map_x[:] = np.nan
    assert lut.mask.all()


def test_mask_of_maps_is_the_closed_rectangle():
    us = np.array([0.0, -1e-12, -0.5, -1.0, 4.0, 4.0 + 1e-9, 4.999, 5.0, 2.0, np.nan, np.inf, -np.inf, 1e300, -1e300])
    vs = np.array([0.0, 1.5, 3.0, 3.0 + 1e-9, -1e-12, np.nan, np.inf])
    map_x, map_y = (np.ascontiguousarray(m) for m in np.broadcast_arrays(us, vs[:, None]))
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(5, 4))
    expected = reference.valid_mask(map_x, map_y, (5, 4))
    assert 0 < expected.sum() < expected.size
    np.testing.assert_array_equal(lut.mask, expected)


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 30), st.integers(1, 30), st.integers(0, 2**32 - 1))
def test_any_maps_come_back_where_they_touch_the_image(rows, columns, width, height, seed):
    random = np.random.default_rng(seed)
    map_x = random.uniform(-3, width + 2, (rows, columns))
    map_y = random.uniform(-3, height + 2, (rows, columns))
    bad = random.random((rows, columns)) < 0.1
    map_x[bad] = random.choice([np.nan, np.inf, -np.inf, 1e308, -1e308], bad.sum())
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(width, height))
    np.testing.assert_array_equal(lut.mask, reference.valid_mask(map_x, map_y, (width, height)))
    touches = (map_x > -1) & (map_x < width) & (map_y > -1) & (map_y < height)
    for ours, given_map in zip(lut.maps(), (map_x, map_y), strict=True):
        np.testing.assert_array_equal(np.isnan(ours), ~touches)
        np.testing.assert_allclose(ours[touches], given_map[touches], rtol=0, atol=2**-16 + 1e-5)


# ---------------------------------------------------------------------------------------------------------------------
# From a homography (output pixel -> source pixel)


@pytest.mark.parametrize("scale", [1.0, -1.0, 1e-6, 1e6])
def test_identity_homography(scale):
    """The scale of a homography is arbitrary, its sign too."""
    image = textured(12, 17, 3)
    lut = ipm_rs.Lut.from_homography(np.eye(3) * scale, size=(17, 12), source_size=(17, 12))
    assert lut.shape == (12, 17) and lut.mask.all()
    for interpolation in ("nearest", "bilinear"):
        assert same(lut.warp(image, interpolation=interpolation), image)


def test_homography_that_scales():
    M = np.diag([0.5, 0.25, 1.0])
    lut = ipm_rs.Lut.from_homography(M, size=(17, 21), source_size=(9, 6))
    map_x, map_y = lut.maps()
    expected_x, expected_y = np.meshgrid(0.5 * np.arange(17), 0.25 * np.arange(21))
    np.testing.assert_array_equal(map_x, expected_x)
    np.testing.assert_array_equal(map_y, expected_y)


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_homography_of_the_road_is_the_camera(seed_camera, seed_grid, seed_lut, interpolation):
    """Cells -> metres -> pixels as one matrix: the same view, where all is ahead of the camera."""
    metres_from_cells = np.array([[0.0, -0.05, 50.0], [-0.025, 0.0, 10.0], [0.0, 0.0, 1.0]])
    M = golden.K @ golden.RT[:3][:, [0, 1, 3]] @ metres_from_cells
    lut = ipm_rs.Lut.from_homography(M, size=(800, 860), source_size=(2048, 1024))
    for ours, theirs in zip(lut.maps(outside=-9), seed_lut.maps(outside=-9), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-3)


def test_homography_is_cv2_warp_perspective():
    source = cv2.GaussianBlur(textured(60, 80), (0, 0), 2.0)
    M = np.array([[1.1, 0.2, -5.0], [-0.1, 0.9, 4.0], [1e-3, -5e-4, 1.0]])
    ours = ipm_rs.Lut.from_homography(M, size=(70, 50), source_size=(80, 60)).warp(source, border_value=9)
    theirs = cv2.warpPerspective(source, M, (70, 50), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderValue=9)
    assert np.abs(ours.astype(int) - theirs).max() <= 2  # OpenCV's own error here is above half a level
    assert len(np.unique(ours)) > 30


def test_both_signs_of_w_sample_and_zero_does_not():
    # w = column - 4: negative on the left, zero at column 4, positive on the right; u = 3 / w + 5
    M = np.array([[5.0, 0.0, 3.0 - 20.0], [0.0, 1.0, 0.0], [1.0, 0.0, -4.0]])
    M[1] = [2.0, 0.0, -8.0]  # v = 2 wherever w is not 0
    M[1, 1] = 1e-9  # keeps M invertible
    lut = ipm_rs.Lut.from_homography(M, size=(9, 1), source_size=(10, 5))
    map_x, map_y = lut.maps()
    w = np.arange(9) - 4.0
    with np.errstate(divide="ignore"):
        expected = 3 / w + 5
    np.testing.assert_array_equal(lut.mask[0], [True] * 4 + [False] + [True] * 4)
    np.testing.assert_allclose(map_x[0, w != 0], expected[w != 0], rtol=0, atol=1e-4)
    assert np.isnan(map_x[0, 4]) and np.isnan(map_y[0, 4])
    bev = lut.warp(np.full((5, 10), 200, np.uint8), border_value=3)
    assert bev[0, 4] == 3 and (bev[0, w != 0] == 200).all()


def test_what_nearest_adds_is_counted_but_is_no_part_of_the_table(seed_lut):
    fresh = pickle.loads(pickle.dumps(seed_lut))
    before = fresh.nbytes
    image = np.arange(1024 * 2048, dtype=np.uint32).reshape(1024, 2048)
    first = fresh.warp(image, interpolation="nearest")
    added = fresh.nbytes - before
    assert added == (4 * 860 * 800 if ipm_rs.cpu_info()["isa"] == "avx2" else 0)
    np.testing.assert_array_equal(fresh.warp(image, interpolation="nearest"), first)
    assert fresh.nbytes - before == added
    assert fresh == seed_lut and pickle.dumps(fresh) == pickle.dumps(seed_lut)
