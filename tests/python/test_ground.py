"""The road as a height, a plane and a height map."""

from __future__ import annotations

import copy
import math
import pickle

import cv2
import golden
import numpy as np
import pytest
from helpers import refuses
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors

NAN, INF = float("nan"), float("inf")
GRID = ipm_rs.BevGrid(x=(5, 45), y=(-9, 9), resolution=(0.25, 0.2))


def number(low: float, high: float):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def hilly(xy: np.ndarray) -> np.ndarray:
    return 0.5 * np.sin(0.4 * xy[..., 0]) + 0.15 * np.cos(xy[..., 1])


@pytest.fixture(scope="module")
def hills() -> ipm_rs.HeightMap:
    return ipm_rs.HeightMap.on_grid(hilly(GRID.xy()), GRID)


# ---------------------------------------------------------------------------------------------------------------------
# Planes


@given(number(-0.3, 0.3), number(-0.3, 0.3), number(-2, 0.5), number(0.1, 9), st.sampled_from([1, -1]))
def test_plane_forms_agree(slope, bank, height, scale, sign):
    plane = ipm_rs.Plane.from_angles(slope=slope, bank=bank, height=height)
    a, b, c = plane.coefficients
    assert (a, b, c) == pytest.approx((height, math.tan(slope), math.tan(bank)), abs=1e-15)
    assert ipm_rs.Plane.from_coefficients(a, b, c) == plane
    x, y = 12.5, -3.25
    again = ipm_rs.Plane(normal=plane.normal * scale * sign, point=(x, y, plane.height_at([[x, y]])[0]))
    np.testing.assert_allclose(again.coefficients, (a, b, c), rtol=0, atol=1e-13)
    assert plane.normal[2] > 0
    assert np.linalg.norm(plane.normal) == pytest.approx(1, abs=1e-15)


def test_positive_slope_is_uphill_and_positive_bank_lifts_the_left():
    plane = ipm_rs.Plane.from_angles(slope=0.1, bank=0.05, height=-0.3)
    origin, ahead, left = plane.height_at([[0, 0], [1, 0], [0, 1]])
    assert origin == -0.3
    assert ahead - origin == pytest.approx(math.tan(0.1))
    assert left - origin == pytest.approx(math.tan(0.05))


@given(number(-0.2, 0.2), number(-0.2, 0.2), number(-1, 0.3), st.integers(0, 2**32 - 1))
def test_plane_there_and_back(seed_camera, slope, bank, height, seed):
    plane = ipm_rs.Plane.from_angles(slope=slope, bank=bank, height=height)
    pixels = np.random.default_rng(seed).uniform((0, 0), (2047, 1023), (40, 2))
    points = seed_camera.ground_from_pixels(pixels, ground=plane)
    hit = ~np.isnan(points[:, 0])
    np.testing.assert_allclose(points[hit, 2], plane.height_at(points[hit, :2]), rtol=0, atol=1e-9)
    near = hit & (np.abs(points) < 1e4).all(axis=1)
    for uv in (seed_camera.project(points[near])[0], seed_camera.project(points[near, :2], ground=plane)[0]):
        np.testing.assert_allclose(uv, pixels[near], rtol=0, atol=1e-6)
    # independent: the plane's homography
    a, b, c = plane.coefficients
    lift = np.array([[1, 0, 0], [0, 1, 0], [b, c, a], [0, 0, 1]])
    ground_from_image = np.linalg.inv(golden.K @ golden.RT[:3] @ lift)
    theirs = cv2.perspectiveTransform(pixels[None], ground_from_image)[0]
    np.testing.assert_allclose(points[near, :2], theirs[near], rtol=1e-6, atol=1e-6)


def test_a_level_plane_is_the_height(seed_camera, seed_grid):
    plane = ipm_rs.Plane(normal=(0, 0, 1), point=(3, 4, -0.33))
    assert ipm_rs.Lut(seed_camera, seed_grid, ground=plane) == ipm_rs.Lut(seed_camera, seed_grid, ground=-0.33)
    pixels = [[1000.0, 900.0], [20.0, 600.0]]
    np.testing.assert_array_equal(
        seed_camera.ground_from_pixels(pixels, ground=plane), seed_camera.ground_from_pixels(pixels, ground=-0.33)
    )


@pytest.mark.parametrize(("slope", "bank"), [(0.04, 0.0), (-0.03, 0.0), (0.0, 0.06), (0.05, -0.08)])
def test_lut_of_a_plane_is_project(seed_camera, seed_grid, slope, bank):
    plane = ipm_rs.Plane.from_angles(slope=slope, bank=bank, height=-0.1)
    lut = ipm_rs.Lut(seed_camera, seed_grid, ground=plane)
    uv, _, valid = seed_camera.project(seed_grid.xy().reshape(-1, 2), ground=plane)
    edge = (np.abs(uv[:, :, None] - [[0, 2047], [0, 1023]]) < 1e-6).any(axis=(1, 2))
    np.testing.assert_array_equal(lut.mask.ravel()[~edge], valid[~edge])
    map_x, map_y = lut.maps()
    np.testing.assert_allclose(map_x.ravel()[valid], uv[valid, 0], rtol=0, atol=2.5e-4)
    np.testing.assert_allclose(map_y.ravel()[valid], uv[valid, 1], rtol=0, atol=2.5e-4)


def test_a_road_that_climbs_faster_than_the_camera_looks_has_no_horizon_below():
    camera = ipm_rs.Camera.from_euler(golden.K, image_size=(2048, 1024), position=(0, 0, 1.2))
    pixel = [[golden.U0, golden.V0 - 50]]
    assert np.isnan(camera.ground_from_pixels(pixel)).all()
    uphill = camera.ground_from_pixels(pixel, ground=ipm_rs.Plane.from_angles(slope=0.1))
    assert uphill[0, 2] > 1.2 and uphill[0, 0] > 10


def test_a_plane_above_the_camera_is_a_ceiling(seed_camera):
    ceiling = ipm_rs.Plane.from_angles(slope=0.01, height=5)
    pixels = np.array([[1000.0, 900.0], [1000.0, 200.0]])
    points = seed_camera.ground_from_pixels(pixels, ground=ceiling)
    assert np.isnan(points[0]).all() and points[1, 2] > 5


@pytest.mark.parametrize(
    ("make", "error", "named"),
    [
        (lambda: ipm_rs.Plane(normal=(1, 0, 0)), errors.ArgumentError, "upright"),
        (lambda: ipm_rs.Plane(normal=(1, 2, 1e-12)), errors.ArgumentError, "upright"),
        (lambda: ipm_rs.Plane(normal=(0, 0, 0)), errors.ArgumentError, "not zero"),
        (lambda: ipm_rs.Plane(normal=(0, NAN, 1)), errors.CalibrationError, "normal: expected finite"),
        (lambda: ipm_rs.Plane(normal=(0, 0, 1), point=(0, INF, 0)), errors.CalibrationError, "point: expected finite"),
        (lambda: ipm_rs.Plane(normal=(0, 1)), errors.ArgumentError, "normal: expected"),
        (lambda: ipm_rs.Plane(normal="up"), errors.ArgumentTypeError, "normal: expected"),
        (lambda: ipm_rs.Plane.from_coefficients(0, NAN, 0), errors.CalibrationError, "finite"),
        (lambda: ipm_rs.Plane.from_angles(slope=1.6), errors.ArgumentError, "radians"),
        (lambda: ipm_rs.Plane.from_angles(bank="2"), errors.ArgumentTypeError, "bank: expected a number"),
    ],
)
def test_planes_that_are_refused(make, error, named):
    with refuses(error, named):
        make()


# ---------------------------------------------------------------------------------------------------------------------
# Height maps


def test_heights_lie_where_origin_and_spacing_say():
    heights = np.arange(12.0).reshape(3, 4)
    up = ipm_rs.HeightMap(heights, origin=(10, -2), spacing=(2, 1))
    np.testing.assert_array_equal(up.height_at([[10, -2], [12, -2], [10, -1], [14, 1]]), [0, 4, 1, 11])
    np.testing.assert_array_equal(up.height_at([[11, -1.5]]), [2.5])
    down = ipm_rs.HeightMap(heights, origin=(10, -2), spacing=-0.5)
    np.testing.assert_array_equal(down.height_at([[9, -3.5]]), [11])
    assert np.isnan(up.height_at([[9.9, -2], [14.1, 0], [12, 1.1], [NAN, 0], [12, INF]])).all()


def test_on_grid_holds_the_samples_of_the_grid(hills):
    xy = GRID.xy()
    np.testing.assert_allclose(hills.height_at(xy.reshape(-1, 2)), hilly(xy).ravel(), rtol=0, atol=1e-12)
    corner = ipm_rs.BevGrid(x=(5, 45), y=(-9, 9), resolution=(0.25, 0.2), sample_at="corner")
    on_corners = ipm_rs.HeightMap.on_grid(hilly(corner.xy()), corner)
    np.testing.assert_allclose(on_corners.height_at([[45, 9]]), hilly(np.array([[45.0, 9.0]])), rtol=0, atol=1e-12)


def test_bilinear_is_cv2(hills):
    """`cv2.remap` of the heights at fractional cells."""
    xy = np.random.default_rng(3).uniform((6, -8), (44, 8), (500, 2))
    rc = GRID.cell_from_ground(xy).astype(np.float32)
    theirs = cv2.remap(hills.heights.astype(np.float32), rc[:, 1:], rc[:, :1], cv2.INTER_LINEAR)[:, 0]
    np.testing.assert_allclose(hills.height_at(xy), theirs, rtol=0, atol=1e-5)


def test_a_plane_as_a_height_map_is_the_plane(seed_camera):
    plane = ipm_rs.Plane.from_angles(slope=0.03, bank=-0.02, height=-0.2)
    mapped = ipm_rs.HeightMap.on_grid(plane.height_at(GRID.xy().reshape(-1, 2)).reshape(GRID.shape), GRID)
    pixels = np.random.default_rng(1).uniform((300, 560), (1700, 1023), (500, 2))
    expected = seed_camera.ground_from_pixels(pixels, ground=plane)
    got = seed_camera.ground_from_pixels(pixels, ground=mapped)
    (far, right), (near, left) = GRID.xy()[0, -1], GRID.xy()[-1, 0]
    inside = (expected[:, 0] < far) & (expected[:, 0] > near) & (expected[:, 1] < left) & (expected[:, 1] > right)
    assert inside.sum() > 200
    np.testing.assert_allclose(got[inside], expected[inside], rtol=0, atol=1e-8)
    assert np.isnan(got[~inside]).all(), "outside the map the road is not known"
    flat, hilly_lut = ipm_rs.Lut(seed_camera, GRID, ground=plane), ipm_rs.Lut(seed_camera, GRID, ground=mapped)
    np.testing.assert_array_equal(flat.mask, hilly_lut.mask)
    for ours, theirs in zip(hilly_lut.maps(outside=-9), flat.maps(outside=-9), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=2.5e-4)


def first_hit_by_steps(heights: ipm_rs.HeightMap, eye: np.ndarray, towards: np.ndarray, length: float) -> np.ndarray:
    """NumPy: 20 000 steps of each ray; NaN where none is below the road, or it came there from ground not known."""
    t = np.linspace(0, length, 20_001)
    hits = np.full((len(towards), 3), NAN)
    for hit, direction in zip(hits, towards, strict=True):
        points = eye + t[:, None] * direction
        above = points[:, 2] - heights.height_at(points[:, :2])
        first = (above <= 0).argmax()
        if above[first - 1] > 0 >= above[first]:
            hit[:] = points[first]
    return hits


def test_a_ray_ends_where_it_first_meets_the_road(hills):
    camera = ipm_rs.Camera.from_euler(golden.K, image_size=(2048, 1024), position=(1, 0, 1.2), pitch=0.05)
    pixels = np.random.default_rng(2).uniform((0, 500), (2047, 900), (150, 2))
    got = camera.ground_from_pixels(pixels, ground=hills)
    rays = np.linalg.solve(golden.K, np.column_stack([pixels, np.ones(150)]).T).T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    rays = rays @ camera.vehicle_from_camera[:3, :3].T
    expected = first_hit_by_steps(hills, camera.position, rays, 60)
    both = ~np.isnan(got[:, 0]) & ~np.isnan(expected[:, 0])
    assert both.sum() > 60
    assert (np.isnan(got[:, 0]) != np.isnan(expected[:, 0])).sum() <= 2, "a step may miss a graze"
    assert (np.linalg.norm(got - expected, axis=1)[both] < 0.01).mean() > 0.97
    np.testing.assert_allclose(camera.project(got[both])[0], pixels[both], rtol=0, atol=1e-6)
    np.testing.assert_allclose(hills.height_at(got[both, :2]), got[both, 2], rtol=0, atol=1e-12)


def test_lut_of_a_height_map_is_project_and_marks_what_a_crest_hides(hills):
    camera = ipm_rs.Camera.from_euler(golden.K, image_size=(2048, 1024), position=(1, 0, 1.2), pitch=0.05)
    lut = ipm_rs.Lut(camera, GRID, ground=hills)
    xy = GRID.xy().reshape(-1, 2)
    uv, _, valid = camera.project(xy, ground=hills)
    assert (lut.mask.ravel() == valid).mean() > 0.9999, "rounding at a node may differ"
    assert not np.isnan(uv[valid]).any()
    # the pixel of a valid cell sees that cell and no other
    back = camera.ground_from_pixels(uv[valid], ground=hills)[:, :2]
    assert (np.linalg.norm(back - xy[valid], axis=1) < 1e-3).mean() > 0.999
    # a hidden one has its exact pixel, which shows something nearer
    in_image = camera.project(np.column_stack([xy, hilly(xy)]))[2]
    hidden = in_image & ~valid
    assert hidden.sum() > 500
    seen_there = camera.ground_from_pixels(uv[hidden], ground=hills)[:, :2]
    met = ~np.isnan(seen_there[:, 0])  # not where the sight line came into the map below its border
    assert met.mean() > 0.9
    distances = [np.linalg.norm(there[met] - camera.position[:2], axis=1) for there in (seen_there, xy[hidden])]
    assert (distances[0] < distances[1]).mean() > 0.999


def test_the_table_does_not_depend_on_threads(hills, seed_camera):
    before = ipm_rs.get_num_threads()
    try:
        tables = []
        for threads in (1, 2, 5):
            ipm_rs.set_num_threads(threads)
            tables.append(ipm_rs.Lut(seed_camera, GRID, ground=hills))
        assert tables[0] == tables[1] == tables[2]
    finally:
        ipm_rs.set_num_threads(before)


def test_unknown_heights_make_invalid_cells(seed_camera):
    heights = np.zeros(GRID.shape)
    heights[40:50, 30:60] = NAN
    ground = ipm_rs.HeightMap.on_grid(heights, GRID)
    flat, holed = ipm_rs.Lut(seed_camera, GRID), ipm_rs.Lut(seed_camera, GRID, ground=ground)
    expected = flat.mask & ~np.isnan(heights)
    np.testing.assert_array_equal(holed.mask, expected)
    assert expected.sum() < flat.mask.sum()
    image = np.full((1024, 2048), 200, np.uint8)
    assert (holed.warp(image, border_value=7)[40:50, 30:60] == 7).all()


def test_beside_the_map_nothing_is_known(seed_camera):
    small = ipm_rs.HeightMap(np.zeros((11, 11)), origin=(15, -2), spacing=0.4)
    uv, depth, valid = seed_camera.project([[17.0, 0.0], [20.0, 0.0]], ground=small)
    assert valid.tolist() == [True, False]
    assert np.isnan(uv[1]).all() and np.isnan(depth[1])
    assert np.isnan(seed_camera.ground_from_pixels(seed_camera.project([[20.0, 0.0]])[0], ground=small)).all()


# ---------------------------------------------------------------------------------------------------------------------
# Objects and arguments

OBJECTS = [
    ipm_rs.Plane.from_angles(slope=0.02, bank=-0.1, height=-1.7),
    ipm_rs.Plane(normal=(0.1, 0.2, -3), point=(1, 2, 3)),
    ipm_rs.HeightMap([[0, 1], [2, NAN]], origin=(1, 2), spacing=(0.5, -0.25)),
]


@pytest.mark.parametrize("ground", OBJECTS, ids=lambda ground: type(ground).__name__)
def test_objects_are_values(ground):
    for again in (pickle.loads(pickle.dumps(ground)), copy.copy(ground), copy.deepcopy(ground)):
        assert again == ground and hash(again) == hash(ground) and repr(again) == repr(ground)
    for other in OBJECTS:
        assert (other == ground) == (other is ground)
    assert ground != 0.0
    with pytest.raises(AttributeError):
        ground.height = 3
    assert repr(ground).startswith(type(ground).__name__)


def test_plane_repr_is_the_call():
    plane = OBJECTS[0]
    assert eval(repr(plane), {"Plane": ipm_rs.Plane}) == plane


def test_arrays_are_copied():
    heights = np.zeros((3, 3))
    ground = ipm_rs.HeightMap(heights, origin=(0, 0), spacing=1)
    heights[:] = 5
    ground.heights[:] = 6
    assert (ground.heights == 0).all()


@pytest.mark.parametrize(
    ("make", "error", "named"),
    [
        (lambda: ipm_rs.HeightMap(np.zeros(4), origin=(0, 0), spacing=1), errors.ArgumentError, "(rows, columns)"),
        (lambda: ipm_rs.HeightMap(np.zeros((1, 4)), origin=(0, 0), spacing=1), errors.ArgumentError, "2 x 2"),
        (lambda: ipm_rs.HeightMap(np.zeros((0, 0)), origin=(0, 0), spacing=1), errors.ArgumentError, "2 x 2"),
        (lambda: ipm_rs.HeightMap(np.zeros((2, 2)), origin=(0, 0), spacing=0), errors.ArgumentError, "spacing"),
        (lambda: ipm_rs.HeightMap(np.zeros((2, 2)), origin=(0, 0), spacing=NAN), errors.CalibrationError, "spacing"),
        (lambda: ipm_rs.HeightMap(np.zeros((2, 2)), origin=(NAN, 0), spacing=1), errors.CalibrationError, "origin"),
        (lambda: ipm_rs.HeightMap(np.zeros((2, 2)), origin=0, spacing=1), errors.ArgumentTypeError, "origin"),
        (lambda: ipm_rs.HeightMap(np.zeros((2, 2)), origin=(1e20, 0), spacing=1), errors.ArgumentError, "apart"),
        (lambda: ipm_rs.HeightMap(np.full((2, 2), NAN), origin=(0, 0), spacing=1), errors.ArgumentError, "known"),
        (lambda: ipm_rs.HeightMap([[0, 0], [INF, 0]], origin=(0, 0), spacing=1), errors.ArgumentError, "finite"),
        (lambda: ipm_rs.HeightMap("hills", origin=(0, 0), spacing=1), errors.ArgumentTypeError, "heights: expected"),
        (lambda: ipm_rs.HeightMap.on_grid(np.zeros((3, 3)), GRID), errors.ArgumentError, "(160, 90), got (3, 3)"),
        (lambda: ipm_rs.HeightMap.on_grid(np.zeros((3, 3)), "grid"), errors.ArgumentTypeError, "BevGrid"),
    ],
)
def test_height_maps_that_are_refused(make, error, named):
    with refuses(error, named):
        make()


@pytest.mark.parametrize("ground", ["flat", [0, 0], np.zeros((2, 2)), object()])
def test_other_grounds_are_refused(seed_camera, ground):
    for call in (
        lambda: seed_camera.project([[10, 0]], ground=ground),
        lambda: seed_camera.ground_from_pixels([[10, 0]], ground=ground),
        lambda: ipm_rs.Lut(seed_camera, GRID, ground=ground),
    ):
        with refuses(errors.ArgumentTypeError, "ground: expected a height in metres, an ipm_rs.Plane", "got"):
            call()


@pytest.mark.parametrize("ground", [NAN, INF])
def test_heights_that_are_not_finite_are_refused(seed_camera, ground):
    with refuses(errors.ArgumentError, "ground: expected a finite height"):
        ipm_rs.Lut(seed_camera, GRID, ground=ground)


@pytest.mark.parametrize(
    ("value", "mend"),
    [
        (np.finfo(np.float32).min, "<= 1e5"),
        (1e20, "<= 1e5"),
        (-123456.0, "<= 1e5"),
        (-32768, "== -32768.0"),
        (32767, "== 32767.0"),
        (-9999, "== -9999.0"),
        (9999, "== 9999.0"),
        (-99999, "== -99999.0"),
        (-999, "== -999.0"),
    ],
)
def test_numbers_that_stand_for_no_data_are_no_heights(seed_camera, value, mend):
    heights = np.random.default_rng(6).normal(0, 0.2, (30, 20))
    heights[7, 3] = heights[12, 9] = value
    options = {"origin": (4, -9), "spacing": 1.0}
    with refuses(errors.ArgumentError, "no data", "[7, 3]", "2 in all", "NaN", "np.where(", mend):
        ipm_rs.HeightMap(heights, **options)
    with refuses(errors.ArgumentError, "no data"):
        ipm_rs.HeightMap(np.full((5, 5), float(value)), **options)
    # the mend mends
    mended = ipm_rs.HeightMap(np.where(heights > -1e4, heights, np.nan) if value < -1e4 else heights * 0, **options)
    assert mended.shape == (30, 20)


def test_mountains_are_heights():
    for level in (-420.0, 999.0, 5230.0, 8848.0, 9999.0):
        heights = level + np.random.default_rng(6).normal(0, 5, (9, 9))
        heights[4, 4] = level
        assert ipm_rs.HeightMap(heights, origin=(0, 0), spacing=1.0).heights[4, 4] == level


@pytest.mark.parametrize("height", [1e6, -1e20, 1e300])
def test_roads_that_are_not_on_earth_are_refused(seed_camera, seed_grid, height):
    with refuses(errors.ArgumentError, "100 000"):
        ipm_rs.Lut(seed_camera, seed_grid, ground=height)
    with refuses(errors.ArgumentError, "100 000"):
        ipm_rs.Plane.from_angles(height=height)
    with refuses(errors.ArgumentError, "slopes"):
        ipm_rs.Plane.from_coefficients(0, 1e10, height)


@pytest.mark.parametrize("count", [0, 1, 2048, 2049, 5000])
def test_points_do_not_depend_on_threads(seed_camera, hills, count):
    pixels = np.random.default_rng(4).uniform((0, 400), (2047, 1023), (count, 2))
    for ground in (0.0, hills):
        one = seed_camera.ground_from_pixels(pixels, ground=ground, threads=1)
        assert one.shape == (count, 3)
        for threads in (2, 3):
            again = seed_camera.ground_from_pixels(pixels, ground=ground, threads=threads)
            assert again.tobytes() == one.tobytes()
        xy = np.nan_to_num(one[:, :2])
        for ours, theirs in zip(
            seed_camera.project(xy, ground=ground, threads=1),
            seed_camera.project(xy, ground=ground, threads=3),
            strict=True,
        ):
            assert ours.tobytes() == theirs.tobytes()
    with refuses(errors.ArgumentError, "threads: expected a whole number"):
        seed_camera.ground_from_pixels(pixels, threads=0)


def test_a_plane_fitted_to_real_laser_points_puts_pixels_on_the_road(shared_data):
    """KITTI 000114: the road under the laser scanner is not quite level and not quite where the manual says."""
    camera = ipm_rs.Camera.from_kitti(shared_data / "kitti" / "000114_calib.txt", image_size=(1242, 375))
    scan = np.fromfile(shared_data / "kitti" / "000114.bin", np.float32).reshape(-1, 4)[:, :3].astype(float)
    x, y, z = scan.T
    near = scan[(x > 4) & (x < 30) & (np.abs(y) < 5) & (z < -1.4) & (z > -2.0)]
    for _ in range(10):
        columns = np.column_stack([np.ones(len(near)), near[:, :2]])
        a, b, c = np.linalg.lstsq(columns, near[:, 2], rcond=None)[0]
        near = near[np.abs(columns @ (a, b, c) - near[:, 2]) < 0.05]
    plane = ipm_rs.Plane.from_coefficients(a, b, c)
    assert -1.8 < a < -1.6 and len(near) > 3000
    uv, _, valid = camera.project(near)
    nominal, fitted = (
        np.linalg.norm(camera.ground_from_pixels(uv[valid], ground=ground) - near[valid], axis=1)
        for ground in (-1.73, plane)
    )
    assert np.median(fitted) < 0.15
    assert np.median(fitted) < 0.4 * np.median(nominal)
    # and the points that the plane is fitted to, as a height map of their own
    grid = ipm_rs.BevGrid(x=(6, 12), y=(-3, 3), resolution=0.5)
    heights = np.full(grid.shape, NAN)
    for (row, column), height in zip(np.rint(grid.cell_from_ground(near[:, :2])).astype(int), near[:, 2], strict=True):
        if 0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]:
            heights[row, column] = height
    surface = ipm_rs.HeightMap.on_grid(heights, grid)
    level = ipm_rs.Lut(camera, grid, ground=plane).maps()
    uneven = ipm_rs.Lut(camera, grid, ground=surface).maps()
    assert np.isfinite(uneven[0]).mean() > 0.5
    assert np.nanmax(np.abs(np.subtract(uneven, level))) < 10, "5 cm of road are some pixels"
