"""Cells, polylines, the horizon, ranges and their errors."""

from __future__ import annotations

import itertools
import math

import golden
import numpy as np
import pytest
from helpers import refuses
from hypothesis import assume, given
from hypothesis import strategies as st
from test_camera import cameras, number

import ipm_rs
from ipm_rs import errors

NAN = float("nan")
GRID = ipm_rs.BevGrid(x=(2, 42), y=(-10, 10), resolution=(0.25, 0.2))
SLOPE = ipm_rs.Plane.from_angles(slope=0.03, bank=-0.02, height=-0.2)


def fisheye(**pose) -> ipm_rs.Camera:
    """Sees 109 degrees to each side of its axis: also behind its own plane."""
    lens = ipm_rs.KannalaBrandt([0.05, -0.02, 0.003, 0], max_angle=1.9)
    pose = {"position": (2.0, 0.3, 1.1), "pitch": 0.4, "roll": 0.05, "yaw": 0.2} | pose
    return ipm_rs.Camera.from_euler(
        [[300, 0, 640], [0, 305, 400], [0, 0, 1]], image_size=(1281, 801), lens=lens, **pose
    )


# ---------------------------------------------------------------------------------------------------------------------
# Cells


@pytest.mark.parametrize("ground", [0.0, -0.33, SLOPE], ids=repr)
@pytest.mark.parametrize("sample_at", ["center", "corner"])
def test_cells_are_those_of_the_table(seed_camera, ground, sample_at):
    grid = ipm_rs.BevGrid(x=GRID.x, y=GRID.y, resolution=GRID.resolution, sample_at=sample_at)
    lut = ipm_rs.Lut(seed_camera, grid, ground=ground)
    rc = np.argwhere(np.ones(grid.shape))
    uv, depth, valid = seed_camera.pixels_from_cells(rc, grid, ground=ground)
    np.testing.assert_array_equal(valid, lut.mask.ravel())
    map_x, map_y = lut.maps()
    np.testing.assert_allclose(uv[valid, 0], map_x.ravel()[valid], rtol=0, atol=2.5e-4)
    np.testing.assert_allclose(uv[valid, 1], map_y.ravel()[valid], rtol=0, atol=2.5e-4)
    assert (depth[valid] > 0).all()
    np.testing.assert_allclose(seed_camera.cells_from_pixels(uv[valid], grid, ground=ground), rc[valid], atol=1e-6)


def test_cells_of_a_fisheye_and_of_a_height_map():
    heights = ipm_rs.HeightMap.on_grid(0.3 * np.sin(GRID.xy()[..., 0] * 0.5), GRID)
    camera = fisheye()
    for ground in (0.0, heights):
        rc = np.argwhere(np.ones(GRID.shape))
        uv, _, valid = camera.pixels_from_cells(rc, GRID, ground=ground)
        assert (valid != ipm_rs.Lut(camera, GRID, ground=ground).mask.ravel()).sum() <= 2
        off = np.abs(camera.cells_from_pixels(uv[valid], GRID, ground=ground) - rc[valid]).max(axis=1)
        assert valid.sum() > 5000 and (off < 1e-5).mean() > 0.999


def test_pixels_without_road_have_no_cell(seed_camera):
    rc = seed_camera.cells_from_pixels([[1000.0, 100.0], [NAN, 900.0], [1000.0, 900.0]], GRID)
    np.testing.assert_array_equal(np.isnan(rc), [[True, True], [True, True], [False, False]])
    assert seed_camera.cells_from_pixels(np.empty((0, 2)), GRID).shape == (0, 2)
    with refuses(errors.ArgumentTypeError, "grid: expected an ipm_rs.BevGrid, got tuple"):
        seed_camera.cells_from_pixels([[1, 1]], (3, 4))


# ---------------------------------------------------------------------------------------------------------------------
# Polylines


def distances(pieces: list[np.ndarray], pixels: np.ndarray) -> np.ndarray:
    """From each pixel to the nearest piece."""
    best = np.full(len(pixels), np.inf)
    for piece in pieces:
        for a, b in itertools.pairwise(piece):
            along = b - a
            t = np.clip(((pixels - a) @ along) / (along @ along), 0, 1)
            best = np.minimum(best, np.linalg.norm(pixels - (a + t[:, None] * along), axis=1))
    return best


def densely(vertices: np.ndarray, count=4001) -> np.ndarray:
    t = np.linspace(0, 1, count)[:, None]
    return np.concatenate([a + t * (b - a) for a, b in itertools.pairwise(vertices)])


@given(cameras(), st.integers(0, 2**32 - 1))
def test_pieces_are_the_visible_part(camera, seed):
    vertices = np.random.default_rng(seed).uniform(-40, 40, (4, 3))
    pieces = camera.project_polyline(vertices)
    uv, _, valid = camera.project(densely(vertices))
    assert (distances(pieces, uv[valid]) < 1e-3).all()
    width, height = camera.image_size
    for piece in pieces:
        assert piece.dtype == np.float64 and piece.shape[1] == 2 and len(piece) >= 2
        assert (piece >= 0).all() and (piece <= [width - 1, height - 1]).all()
        assert len(piece) <= 4, "straight lines have no inner points"


@pytest.mark.parametrize("tolerance", [0.05, 0.25, 2.0])
def test_a_lens_bends_lines_to_the_tolerance(tolerance):
    camera = fisheye()
    random = np.random.default_rng(5)
    points, seen = 0, 0
    for _ in range(60):
        vertices = random.uniform((-20, -20, -1), (30, 20, 3), (3, 3))
        pieces = camera.project_polyline(vertices, tolerance=tolerance)
        uv, _, valid = camera.project(densely(vertices))
        assert (distances(pieces, uv[valid]) <= tolerance * 1.1 + 1e-9).all()
        points += sum(map(len, pieces))
        seen += valid.any()
    assert seen > 20
    assert points < {0.05: 75, 0.25: 40, 2.0: 24}[tolerance] * seen, "no more points than it takes"


def test_a_lane_past_the_camera_does_not_wrap(seed_camera):
    lane = np.array([[-30.0, 1.75], [80.0, 1.75]])
    (piece,) = seed_camera.project_polyline(lane)
    far = seed_camera.project(lane[1:])[0][0]
    np.testing.assert_allclose(piece[-1], far, rtol=0, atol=1e-9)
    assert piece[0, 0] == 0 or piece[0, 1] == 1023, "it enters at the image's edge"
    behind = seed_camera.project_polyline([[-30.0, 1.75], [-2.0, 0.0]])
    assert behind == []


def test_it_sees_behind_its_plane_as_its_lens_does():
    camera = fisheye(pitch=0.0, roll=0, yaw=0)
    beside = np.array([[1.5, 3.0, 1.1], [1.9, 3.0, 1.1]])  # camera at x = 2
    (piece,) = camera.project_polyline(beside, margin=2000)
    assert len(piece) >= 2
    np.testing.assert_allclose(piece[[0, -1]], camera.project(beside)[0], rtol=0, atol=1e-9)
    assert (camera.project(beside)[1] < 0).all()


def test_the_ground_under_polylines(seed_camera):
    lane = np.array([[8.0, 1.5], [20.0, 2.5], [45.0, -1.0]])
    for ground in (None, 0.0, -0.33, SLOPE):
        (piece,) = seed_camera.project_polyline(lane, ground=ground)
        np.testing.assert_array_equal(piece, seed_camera.project(lane, ground=ground)[0])
    with refuses(errors.ArgumentError, "ground: expected only with (N, 2) points"):
        seed_camera.project_polyline(np.ones((3, 3)), ground=0.0)


def test_on_a_height_map_it_follows_the_road_and_hides_behind_crests():
    camera = ipm_rs.Camera.from_euler(golden.K, image_size=(2048, 1024), position=(0, 0, 2.0), pitch=0.04)
    crest = 0.9 * np.exp(-(((GRID.xy()[..., 0] - 18) / 2) ** 2))
    ground = ipm_rs.HeightMap.on_grid(crest, GRID)
    lane = np.array([[4.0, 1.0], [41.0, -1.0]])
    pieces = camera.project_polyline(lane, ground=ground)
    uv, _, valid = camera.project(densely(lane), ground=ground)
    assert (distances(pieces, uv[valid]) < 0.28).all()
    assert len(pieces) == 2, "before the crest and far beyond it"
    hidden = ~valid & camera.project(np.column_stack([densely(lane), ground.height_at(densely(lane))]))[2]
    assert hidden.sum() > 100


def test_closed_margin_and_gaps(seed_camera):
    square = np.array([[10.0, 1.0], [10.0, -1.0], [12.0, -1.0], [12.0, 1.0]])
    (open_,) = seed_camera.project_polyline(square)
    (closed,) = seed_camera.project_polyline(square, closed=True)
    assert len(open_) == 4 and len(closed) == 5
    np.testing.assert_array_equal(closed[0], closed[-1])
    (wide,) = seed_camera.project_polyline([[10.0, -20.0], [10.0, 20.0]], margin=50)
    assert sorted(wide[:, 0]) == pytest.approx([-50, 2097])
    gap = np.array([[10.0, 1.0], [12.0, 1.0], [NAN, 0.0], [12.0, -1.0], [15.0, -1.0], [math.inf, 0.0]])
    assert [len(piece) for piece in seed_camera.project_polyline(gap)] == [2, 2]
    for none in (np.empty((0, 3)), np.empty((0, 2)), [[10.0, 0.0]], [[10.0, 0.0], [10.0, 0.0]]):
        assert seed_camera.project_polyline(none) == []
        seed_camera.project_polyline(none, closed=True)


@pytest.mark.parametrize(
    ("arguments", "error", "named"),
    [
        ({"tolerance": 0}, errors.ArgumentError, "tolerance of at least 0.001"),
        ({"tolerance": NAN}, errors.ArgumentError, "tolerance of at least 0.001"),
        ({"margin": -1}, errors.ArgumentError, "margin of at least 0"),
        ({"margin": math.inf}, errors.ArgumentError, "margin of at least 0"),
        ({"margin": 1e300}, errors.ArgumentError, "up to 1e9, got 1e300"),
        ({"tolerance": 1e300}, errors.ArgumentError, "up to 1e9"),
        ({"closed": "yes"}, errors.ArgumentTypeError, "closed: expected True or False"),
        ({"points": [1, 2, 3]}, errors.ArgumentError, "points: expected shape (N, 3)"),
        ({"points": np.ones((2, 4))}, errors.ArgumentError, "points: expected shape (N, 3)"),
    ],
)
def test_polylines_that_are_refused(seed_camera, arguments, error, named):
    with refuses(error, named):
        seed_camera.project_polyline(**({"points": [[8.0, 0.0, 0.0], [9.0, 0.0, 0.0]]} | arguments))


ANY = st.one_of(number(-60, 60), st.floats(), st.sampled_from([0.0, 1e300, -1e-300, 2.0, 1.1]))


@given(
    st.lists(st.tuples(ANY, ANY, ANY), max_size=6),
    st.sampled_from(["pinhole", "fisheye"]),
    st.sampled_from([0.0, SLOPE, ipm_rs.HeightMap([[0, 1], [0.5, NAN], [0, 0]], origin=(3, -9), spacing=(4, 20))]),
    st.booleans(),
)
def test_whatever_the_vertices_pieces_are_finite_and_inside(vertices, kind, ground, closed):
    """No panic, no endless subdivision: vertices at infinity, at the camera, in its plane, all in one place."""
    camera = fisheye() if kind == "fisheye" else level()
    vertices = np.reshape(vertices, (-1, 3))
    for pieces in (
        camera.project_polyline(vertices, closed=closed),
        camera.project_polyline(vertices[:, :2], ground=ground, closed=closed),
    ):
        assert sum(map(len, pieces)) < 3000
        for piece in pieces:
            assert len(piece) >= 2 and np.isfinite(piece).all()
            assert (piece >= 0).all() and (piece <= np.array(camera.image_size) - 1).all()


# ---------------------------------------------------------------------------------------------------------------------
# The horizon


@given(cameras(), number(-0.2, 0.2), number(-0.2, 0.2))
def test_the_horizon_line_is_where_rays_run_along_the_road(camera, slope, bank):
    plane = ipm_rs.Plane.from_angles(slope=slope, bank=bank)
    a, b, c = camera.horizon_line(ground=plane)
    assert a * a + b * b == pytest.approx(1)
    foot = np.array([-a * c, -b * c])
    uv = foot + np.outer([-500.0, 0.0, 500.0], [b, -a])
    along = camera.unproject(uv)
    np.testing.assert_allclose(along @ plane.normal, 0, rtol=0, atol=1e-6)
    # independent: K^-T R n
    expected = np.linalg.inv(camera.intrinsics).T @ camera.camera_from_vehicle[:3, :3] @ plane.normal
    expected /= -np.hypot(*expected[:2])
    np.testing.assert_allclose([a, b, c], expected, rtol=1e-9, atol=1e-9)
    pieces = camera.horizon(ground=plane)
    assert len(pieces) <= 1
    for piece in pieces:
        assert len(piece) == 2
        assert np.abs(piece @ [a, b] + c).max() < 1e-5


def test_the_horizon_of_the_seed(seed_camera):
    (piece,) = seed_camera.horizon()
    assert piece.shape == (2, 2) and sorted(piece[:, 0]) == [0, 2047]
    a, b, c = seed_camera.horizon_line()
    assert abs(a) < 1e-12 and b == pytest.approx(1) and -c == pytest.approx(golden.VANISHING_POINT[1], abs=1e-6)
    below, above = [[1000.0, 429.5]], [[1000.0, 427.5]]
    assert not np.isnan(seed_camera.ground_from_pixels(below)).any()
    assert np.isnan(seed_camera.ground_from_pixels(above)).all()
    assert seed_camera.horizon(ground=-1.7)[0].tolist() == piece.tolist(), "height does not move it"


def test_the_horizon_of_a_fisheye_is_a_curve():
    camera = fisheye(pitch=0.5)
    pieces = camera.horizon(tolerance=0.1)
    assert pieces and sum(map(len, pieces)) > 10
    for piece in pieces:
        rays = camera.unproject((piece[:-1] + piece[1:]) / 2)
        assert np.abs(rays[:, 2]).max() * 300 < 0.15
        spread = np.polyfit(piece[:, 0], piece[:, 1], 1)
        assert np.abs(np.polyval(spread, piece[:, 0]) - piece[:, 1]).max() > 3, "bent"
    # every direction along the road that falls on the image is near a piece
    angle = np.linspace(0, 2 * np.pi, 20_000)
    uv, _, valid = camera.project(camera.position + 1e8 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]))
    assert valid.sum() > 1000
    assert (distances(pieces, uv[valid][::7]) < 0.12).all()


def test_horizons_that_are_not_there(seed_camera):
    down = ipm_rs.Camera.from_euler(golden.K, image_size=(2048, 1024), position=(0, 0, 5), pitch=math.pi / 2)
    assert down.horizon() == [] and down.horizon_line() is None
    with refuses(errors.ArgumentError, "horizon_line: expected a pinhole", "horizon()"):
        fisheye().horizon_line()
    heights = ipm_rs.HeightMap(np.zeros((3, 3)), origin=(0, 0), spacing=1)
    for call in (seed_camera.horizon, seed_camera.horizon_line):
        with refuses(errors.ArgumentTypeError, "HeightMap", "no one horizon"):
            call(ground=heights)
    with refuses(errors.ArgumentError, "tolerance"):
        seed_camera.horizon(tolerance=0)


# ---------------------------------------------------------------------------------------------------------------------
# Ranges


@given(cameras(), number(-1.0, 0.1), st.integers(0, 2**32 - 1))
def test_range_is_the_level_distance_from_the_camera(camera, ground, seed):
    pixels = np.random.default_rng(seed).uniform((0, 0), camera.image_size, (30, 2))
    points = camera.ground_from_pixels(pixels, ground=ground)
    expected = np.linalg.norm((points - camera.position)[:, :2], axis=1)
    np.testing.assert_allclose(camera.ground_range(pixels, ground=ground), expected, rtol=1e-12)


def test_ranges_of_rows(seed_camera):
    ranges = seed_camera.row_ranges()
    assert ranges.shape == (1024,) and ranges.dtype == np.float64
    seen = ~np.isnan(ranges)
    assert not seen[:429].any() and seen[429:].all()
    assert (np.diff(ranges[429:]) < 0).all(), "nearer further down"
    middle = np.column_stack([np.full(1024, 1023.5), np.arange(1024.0)])
    np.testing.assert_array_equal(ranges, seed_camera.ground_range(middle))
    aside = seed_camera.row_ranges(column=100, ground=SLOPE)
    np.testing.assert_array_equal(aside[1000], seed_camera.ground_range([[100.0, 1000.0]], ground=SLOPE)[0])


def level(height=1.4, focal=1000.0) -> ipm_rs.Camera:
    K = [[focal, 0, 640], [0, focal, 360], [0, 0, 1]]
    return ipm_rs.Camera.from_euler(K, image_size=(1281, 721), position=(0, 0, height))


@pytest.mark.parametrize("row", [370, 400, 500, 700])
def test_range_error_in_closed_form(row):
    """A level camera: r = h f / (v - cv); one pixel up is the larger error, and so is a camera that looks higher."""
    camera, hf = level(), 1400.0
    by_pixel, by_pitch = camera.range_error([[640.0, row]])
    assert by_pixel[0] == pytest.approx(hf / (row - 361) - hf / (row - 360), rel=1e-6)
    angle = math.atan2(row - 360, 1000)
    assert by_pitch[0] == pytest.approx(1.4 / math.tan(angle - math.radians(0.1)) - 1.4 / math.tan(angle), rel=1e-6)


def test_range_error_grows_without_bound_at_the_horizon():
    camera = level()
    by_pixel, by_pitch = camera.range_error([[640.0, 360.9], [640.0, 362.5], [640.0, 361.2], [640.0, 300.0]])
    np.testing.assert_array_equal(by_pixel == math.inf, [True, False, False, False])
    np.testing.assert_array_equal(by_pitch == math.inf, [True, False, True, False])
    assert np.isnan([by_pixel[3], by_pitch[3]]).all()


@given(cameras(), st.integers(0, 2**32 - 1))
def test_small_range_errors_are_derivatives(camera, seed):
    pixels = np.random.default_rng(seed).uniform((0, 0), camera.image_size, (20, 2))
    ranges = camera.ground_range(pixels)
    near = (ranges < 60) & (ranges > 1)
    assume(near.any())
    pixels, ranges = pixels[near], ranges[near]
    by_pixel, by_pitch = camera.range_error(pixels, pixel=1e-3, pitch_deg=1e-4)
    du, dv = (
        (camera.ground_range(pixels + step) - camera.ground_range(pixels - step)) / 2e-3
        for step in ([1e-3, 0], [0, 1e-3])
    )
    np.testing.assert_allclose(by_pixel, 1e-3 * np.hypot(du, dv), rtol=0.02)
    # pitch turns the rays about the level axis to the left of the camera's heading
    axes = camera.vehicle_from_camera[:3, :3] @ np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    yaw = math.atan2(axes[1, 0], axes[0, 0])
    turn = math.radians(1e-4)
    off = []
    for sign in (1, -1):
        attitude = ipm_rs.rotation_from_euler(0, 0, yaw) @ ipm_rs.rotation_from_euler(0, sign * turn, 0)
        attitude = attitude @ ipm_rs.rotation_from_euler(0, 0, -yaw)
        pose = np.eye(4)
        pose[:3, :3] = camera.camera_from_vehicle[:3, :3] @ attitude.T
        pose[:3, 3] = -pose[:3, :3] @ camera.position
        off.append(np.abs(camera.with_pose(pose).ground_range(pixels) - ranges))
    np.testing.assert_allclose(by_pitch, np.maximum(*off), rtol=1e-3, atol=1e-8)


def test_range_error_on_slopes_maps_and_fisheyes():
    flat = ipm_rs.HeightMap(np.full((60, 60), -0.2), origin=(0, -30), spacing=1)
    camera = fisheye()
    pixels = [[640.0, 500.0], [300.0, 450.0]]
    expected = camera.range_error(pixels, ground=-0.2)
    for ours, theirs in zip(camera.range_error(pixels, ground=flat), expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-6)
    assert (np.array(camera.range_error(pixels, ground=SLOPE)) > 0).all()
    for name in ("pixel", "pitch_deg"):
        with refuses(errors.ArgumentError, f"{name}: expected a finite number of at least 0"):
            camera.range_error(pixels, **{name: -1})
