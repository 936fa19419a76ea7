"""Lens models: against OpenCV, against the NumPy reference, over their domains, and as objects."""

from __future__ import annotations

import copy
import pickle

import cv2
import golden
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import reference
from ipm_rs.reference import lenses

# ---------------------------------------------------------------------------------------------------------------------
# Lenses of every model, as real ones are

KITTI_RAW = [-3.691481e-01, 1.968681e-01, 1.353473e-03, 5.677587e-04, -6.770705e-02]  # 2011_09_26, camera 2
ALL_TERMS = [0.1, 0.02, 1e-3, -2e-3, 3e-3, 0.2, 0.1, 0.01, 1e-3, 2e-3, -1e-3, 3e-4, 0.03, -0.05]
PINHOLE_LIKE = [
    ipm_rs.BrownConrady(KITTI_RAW[:4]),
    ipm_rs.BrownConrady(KITTI_RAW),
    *(ipm_rs.BrownConrady(ALL_TERMS[:count]) for count in (4, 5, 8, 12, 14)),
    ipm_rs.KannalaBrandt([0.02, -0.01, 3e-3, -5e-4]),
    ipm_rs.KannalaBrandt([-0.1, 0.0, 0.0, 0.0]),
    ipm_rs.Mei(2.2134, [0.0168, 1.6549, 4.2e-4, 4.2e-4]),
    ipm_rs.Mei(0.8, [-0.02, 0.001, 4e-4, -5e-4]),
    ipm_rs.DoubleSphere(-0.2, 0.6),
    ipm_rs.DoubleSphere(0.3, 0.4),
    ipm_rs.Eucm(0.6, 1.1),
    ipm_rs.Eucm(0.3, 0.8),
    ipm_rs.Fov(0.93),
    ipm_rs.Division(-0.35),
    ipm_rs.Division(0.12),
    ipm_rs.InverseBrownConrady([-0.15, 0.06, 1e-3, -2e-3]),
    ipm_rs.InverseBrownConrady([0.16, -0.05, -5e-4, 7e-4, 0.02]),
    ipm_rs.ThinPrismFisheye([0.012, -0.02, 1e-3, -2e-3, 3e-3, -1e-3, 4e-3, -5e-3]),
    ipm_rs.ThinPrismFisheye([0.01, -0.02, 3e-3, -1e-3, 5e-4, -1e-4, 1e-3, -2e-3, 4e-3, -5e-3, 2e-3, -1e-3]),
    ipm_rs.Cylindrical(),
    ipm_rs.Equirectangular(),
]
IN_PIXELS = [
    ipm_rs.RadialPolynomial([339.749, -31.988, 48.275, -7.201]),
    ipm_rs.Ocam([-350.0, 0.0, 1e-3, -1e-6, 1e-9], (1.001, 2e-3, -3e-3)),
    ipm_rs.Ocam([420.0, 0.0, -8e-4, 2e-7]),
    ipm_rs.FTheta([0.0, 340.0, 4.0, -9.0, 1.5], "forward", (1.002, 1e-3, -2e-3)),
    ipm_rs.FTheta([0.0, 2.7e-3, 2.4e-8, 1.9e-11, 1.2e-14], "backward"),  # as NVIDIA's 120 degree cameras, in small
    ipm_rs.FTheta([0.0, 3e-3, -1e-7, 2e-10, -6e-13, 4e-16, -1e-19], "backward", (0.998, -1e-3, 1e-3)),
]
LENSES = [*PINHOLE_LIKE, *IN_PIXELS]
LIMITED = [
    ipm_rs.BrownConrady(KITTI_RAW, max_angle=0.5),
    ipm_rs.KannalaBrandt([0.02, -0.01, 3e-3, -5e-4], max_angle=1.6),
    ipm_rs.Mei(2.2134, [0.0168, 1.6549, 4.2e-4, 4.2e-4], max_angle=1.6),
    ipm_rs.DoubleSphere(-0.2, 0.6, max_angle=1.6),
    ipm_rs.Eucm(0.6, 1.1, max_angle=1.6),
    ipm_rs.RadialPolynomial([339.749, -31.988, 48.275, -7.201], max_angle=1.6),
    ipm_rs.Ocam([-350.0, 0.0, 1e-3, -1e-6, 1e-9], max_angle=1.6),
    ipm_rs.FTheta([0.0, 340.0, 4.0], "forward", max_angle=1.6),
    ipm_rs.FTheta([0.0, 2.7e-3, 2.4e-8, 1.9e-11, 1.2e-14], "backward", max_angle=1.2),
    ipm_rs.Fov(0.93, max_angle=1.2),
    ipm_rs.Division(-0.35, max_angle=1.6),
    ipm_rs.InverseBrownConrady([-0.15, 0.06, 1e-3, -2e-3], max_angle=0.5),
    ipm_rs.ThinPrismFisheye([0.012, -0.02, 1e-3, -2e-3, 3e-3, -1e-3, 4e-3, -5e-3], max_angle=1.2),
    ipm_rs.Cylindrical(max_angle=1.6),
    ipm_rs.Equirectangular(max_angle=1.6),
]
# where the formula goes from the pixel to the ray, a pixel is less certain at the edge, where the angle stands still
BY_INVERSE = ipm_rs.Ocam | ipm_rs.FTheta | ipm_rs.InverseBrownConrady | ipm_rs.Division
OPTICAL_FROM_FLU = reference.OPTICAL_FROM_FLU


def intrinsics(lens, skew=1.5):
    """K as the lens wants it."""
    if isinstance(lens, ipm_rs.RadialPolynomial | ipm_rs.Ocam | ipm_rs.FTheta):
        return np.array([[1.0, 0.0, 640.2], [0.0, 1.02, 480.7], [0.0, 0.0, 1.0]])
    return np.array([[350.0, skew, 640.2], [0.0, 355.0, 480.7], [0.0, 0.0, 1.0]])


def forward(lens, K=None):
    """A camera at the origin that looks along +x."""
    return ipm_rs.Camera(intrinsics(lens) if K is None else K, image_size=(1280, 960), lens=lens)


def directions(angle, azimuth):
    """Unit directions in the camera frame."""
    angle, azimuth = np.broadcast_arrays(angle, azimuth)
    return np.stack([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)], axis=-1)


def in_vehicle(points):
    """Points of the camera frame of :func:`forward` in the vehicle frame."""
    return np.asarray(points) @ OPTICAL_FROM_FLU


lens_ids = [repr(lens)[:60] for lens in LENSES]
each_lens = pytest.mark.parametrize("lens", LENSES, ids=lens_ids)

# ---------------------------------------------------------------------------------------------------------------------
# OpenCV

small = st.floats(-0.01, 0.01)


@st.composite
def brown_coefficients(draw):
    count = draw(st.sampled_from([4, 5, 8, 12, 14]))
    radial = st.floats(-0.3, 0.3)
    values = [draw(radial), draw(radial), draw(small), draw(small), draw(radial)]
    values += [draw(st.floats(0, 0.3)) for _ in range(3)]
    values += [draw(small) for _ in range(4)] + [draw(st.floats(-0.1, 0.1)) for _ in range(2)]
    return values[:count]


@given(brown_coefficients(), st.integers(0, 2**32 - 1))
@settings(max_examples=150, deadline=None)
def test_brown_conrady_is_opencv(coefficients, seed):
    rng = np.random.default_rng(seed)
    lens = ipm_rs.BrownConrady(coefficients)
    K = np.array([[959.8, 0.0, 696.0], [0.0, 956.9, 224.2], [0.0, 0.0, 1.0]])
    angle = rng.uniform(0, min(lens.max_angle, 1.3), 200)
    points = directions(angle, rng.uniform(-np.pi, np.pi, 200)) * rng.uniform(0.5, 60, (200, 1))
    uv, depth, _ = forward(lens, K).project(in_vehicle(points))
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(coefficients))[0][:, 0]
    scale = np.maximum(1, np.abs(expected) / 1e4)  # far outside the image, float64 has fewer decimals
    assert np.all(np.abs(uv - expected) / scale < 1e-7)
    assert np.allclose(depth, points[:, 2], rtol=0, atol=1e-12)


@given(st.lists(st.floats(-0.05, 0.05), min_size=4, max_size=4), st.integers(0, 2**32 - 1))
@settings(max_examples=150, deadline=None)
def test_kannala_brandt_is_opencv_in_front(coefficients, seed):
    rng = np.random.default_rng(seed)
    lens = ipm_rs.KannalaBrandt(coefficients)
    K = np.array([[330.0, 0.0, 640.0], [0.0, 331.0, 480.0], [0.0, 0.0, 1.0]])
    angle = rng.uniform(0, min(lens.max_angle, np.pi / 2 - 1e-3), 200)
    points = directions(angle, rng.uniform(-np.pi, np.pi, 200)) * rng.uniform(0.5, 60, (200, 1))
    uv, _, _ = forward(lens, K).project(in_vehicle(points))
    rvec = np.zeros(3)
    expected = cv2.fisheye.projectPoints(points[:, None], rvec, rvec, K, np.array(coefficients))[0][:, 0]
    assert np.abs(uv - expected).max() < 1e-7


def test_undistort_points_is_the_inverse_of_opencv():
    camera = forward(ipm_rs.BrownConrady(KITTI_RAW), np.array([[959.8, 0, 696], [0, 956.9, 224.2], [0, 0, 1]]))
    uv = np.random.default_rng(1).uniform([100, 50], [1290, 460], (500, 2))
    rays = camera.unproject(uv) @ OPTICAL_FROM_FLU.T
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-14)
    distortion, eye = np.array(KITTI_RAW), np.eye(3)
    expected = cv2.undistortPoints(uv[:, None], camera.intrinsics, distortion, None, eye, eye, criteria)[:, 0]
    assert np.abs(rays[:, :2] / rays[:, 2:] - expected).max() < 1e-9


# ---------------------------------------------------------------------------------------------------------------------
# The reference


@each_lens
def test_is_the_reference_over_the_whole_domain(lens):
    rng = np.random.default_rng(3)
    angle = np.concatenate([rng.uniform(0, lens.max_angle, 3000), rng.uniform(0, np.pi, 2000)])
    rays = directions(angle, rng.uniform(-np.pi, np.pi, 5000)) * rng.uniform(0.5, 60, (5000, 1))
    camera = forward(lens)
    uv, depth, valid = camera.project(in_vehicle(rays))
    expected, same_depth, same_valid = reference.project(
        in_vehicle(rays), camera.intrinsics, camera.camera_from_vehicle, camera.image_size, lens
    )
    clear = np.abs(angle - lens.max_angle) > 1e-9  # of the edge itself rounding decides
    assert np.array_equal(np.isnan(uv), np.isnan(expected)) or np.array_equal(
        np.isnan(uv[clear]), np.isnan(expected[clear])
    )
    near = np.abs(expected).max(axis=1) < 1e4
    assert near.sum() > 500
    sure = near & (angle < lens.max_angle * 0.999) if isinstance(lens, BY_INVERSE) else near
    assert np.abs(uv - expected)[sure].max() < 1e-7
    assert np.allclose(depth, same_depth, rtol=0, atol=1e-12)
    assert np.array_equal(valid[clear], same_valid[clear])


@pytest.mark.slow
@each_lens
def test_the_domain_ends_where_the_reference_folds(lens):
    if isinstance(lens, ipm_rs.Cylindrical | ipm_rs.Equirectangular):
        assert lens.max_angle == np.pi, "to all sides"
        return
    if isinstance(lens, BY_INVERSE | ipm_rs.DoubleSphere | ipm_rs.Eucm | ipm_rs.Fov):
        # these know their end themselves: up to there nothing folds
        step = 3e-2 if isinstance(lens, ipm_rs.InverseBrownConrady | ipm_rs.FTheta) else 1e-3  # searched for each
        assert lenses.fold_angle(lambda rays: lenses.image_of(rays, lens), step) > lens.max_angle - 3 * step
        return
    formula = {
        "BrownConrady": lambda rays: lenses.brown_conrady(rays, lens.coefficients),
        "KannalaBrandt": lambda rays: lenses.kannala_brandt(rays, lens.coefficients),
        "Mei": lambda rays: lenses.mei(rays, lens.xi, lens.coefficients),
        "RadialPolynomial": lambda rays: lenses.radial_polynomial(rays, lens.coefficients),
        "ThinPrismFisheye": lambda rays: lenses.thin_prism_fisheye(rays, lens.coefficients),
    }[type(lens).__name__]
    fold = lenses.fold_angle(formula, 5e-4)
    assert lens.max_angle <= fold + 1e-3, "nothing beyond a fold"
    assert lens.max_angle >= fold - 6e-3, "little before it: prism terms may cost some"


@pytest.mark.parametrize("lens", [*LENSES, *LIMITED], ids=repr)
@pytest.mark.parametrize("ground", [0.0, -0.3])
def test_the_table_is_the_reference(lens, ground):
    K = intrinsics(lens)
    camera = ipm_rs.Camera.from_euler(
        K, image_size=(1280, 960), position=(0.5, 0.2, 1.4), roll=0.03, pitch=0.5, yaw=0.4, lens=lens
    )
    x, y, cell = (-30, 30), (-24, 24), 0.4
    grid = ipm_rs.BevGrid(x=x, y=y, resolution=cell)
    lut = ipm_rs.Lut(camera, grid, ground=ground)
    xy = reference.grid_xy(x, y, cell)
    assert np.array_equal(grid.xy(), xy)
    map_x, map_y = reference.maps(K, camera.camera_from_vehicle, camera.image_size, xy, ground, lens)
    got_x, got_y = lut.maps()
    assert np.array_equal(np.isnan(got_x), np.isnan(map_x))
    seen = ~np.isnan(map_x)
    assert seen.sum() > 1000
    assert np.abs(got_x - map_x)[seen].max() < 2e-4  # float32, and taps of 1/32768 px
    assert np.abs(got_y - map_y)[seen].max() < 2e-4
    assert np.array_equal(lut.mask, reference.valid_mask(map_x, map_y, camera.image_size))
    image = np.random.default_rng(0).integers(0, 256, (960, 1280), np.uint8)
    bev = lut.warp(image, border_value=7).astype(int)
    assert np.abs(bev - reference.remap_bilinear(image, map_x, map_y, 7).astype(int)).max() <= 1
    nearest = lut.warp(image, interpolation="nearest", border_value=7)
    assert np.array_equal(nearest, reference.remap_nearest(image, map_x, map_y, 7))


def test_threads_do_not_change_a_table():
    camera = ipm_rs.Camera.from_euler(intrinsics(LENSES[7]), image_size=(1280, 960), position=(0, 0, 1), lens=LENSES[7])
    grid = ipm_rs.BevGrid(x=(-20, 20), y=(-20, 20), resolution=0.1)
    before = ipm_rs.get_num_threads()
    try:
        tables = []
        for threads in (1, 2, 5):
            ipm_rs.set_num_threads(threads)
            tables.append(ipm_rs.Lut(camera, grid))
        assert tables[0] == tables[1] == tables[2]
    finally:
        ipm_rs.set_num_threads(before)


# ---------------------------------------------------------------------------------------------------------------------
# There and back


@each_lens
def test_unproject_undoes_project(lens):
    rng = np.random.default_rng(5)
    angle = np.concatenate(
        [rng.uniform(0, lens.max_angle, 4000), lens.max_angle * (1 - 10 ** rng.uniform(-9, -2, 500))]
    )
    rays = directions(angle, rng.uniform(-np.pi, np.pi, len(angle)))
    camera = forward(lens)
    uv, _, _ = camera.project(in_vehicle(rays))
    near = np.abs(uv - [640, 480]).max(axis=1) < 3e4
    if isinstance(lens, BY_INVERSE):
        near &= angle < lens.max_angle * 0.99
    assert near.sum() > 2000
    back = camera.unproject(uv[near])
    assert not np.isnan(back).any()
    assert np.abs(np.linalg.norm(back, axis=1) - 1).max() < 1e-15 * 4
    assert np.abs(camera.project(back)[0] - uv[near]).max() < 1e-9
    well = near & (angle < 0.95 * lens.max_angle)
    assert np.abs(camera.unproject(uv[well]) - in_vehicle(rays[well])).max() < 1e-9


@each_lens
def test_pixels_beyond_the_image_of_the_domain_have_no_ray(lens):
    camera = forward(lens)
    if isinstance(lens, ipm_rs.Cylindrical | ipm_rs.Equirectangular):
        K = camera.intrinsics
        around, down = K[0, 0] * np.pi, K[1, 1] * np.pi / 2
        beyond = [[K[0, 2] + 1.01 * around, K[1, 2]], [K[0, 2] - 1.01 * around, K[1, 2]]]
        if isinstance(lens, ipm_rs.Equirectangular):
            beyond.append([K[0, 2], K[1, 2] + 1.01 * down])
        assert np.isnan(camera.unproject(beyond)).all()
        return
    if isinstance(lens, ipm_rs.InverseBrownConrady):  # which sees up to 90 degrees, at pixels without end
        lens = ipm_rs.InverseBrownConrady(lens.coefficients, max_angle=0.9)
        camera = forward(lens)
    edge = camera.project(in_vehicle(directions(lens.max_angle * (1 - 1e-9), np.linspace(0, 6, 40))))[0]
    finite = np.abs(edge).max(axis=1) < 1e5
    beyond = np.array([640.2, 480.7]) + 1.01 * (edge[finite] - [640.2, 480.7])
    assert np.isnan(camera.unproject(beyond)).all()
    assert np.isnan(camera.unproject([[np.nan, 1], [1, np.inf], [-np.inf, 3]])).all()
    assert np.isnan(camera.ground_from_pixels(beyond)).all()


@each_lens
def test_ground_and_back(lens):
    camera = ipm_rs.Camera.from_euler(
        intrinsics(lens), image_size=(1280, 960), position=(0.5, 0.2, 1.4), roll=0.03, pitch=0.5, yaw=0.4, lens=lens
    )
    xy = np.random.default_rng(6).uniform(-10, 10, (2000, 2))
    uv, _, valid = camera.project(xy, ground=-0.2)
    assert valid.sum() > 150
    points = camera.ground_from_pixels(uv[valid], ground=-0.2)
    assert np.abs(points[:, :2] - xy[valid]).max() < 1e-6
    assert np.all(points[:, 2] == -0.2)


def test_a_pinhole_unprojects_too():
    camera = ipm_rs.Camera(golden.K, image_size=golden.IMAGE_SIZE, camera_from_vehicle=golden.RT)
    uv = np.array([[0.0, 0.0], [1000.5, 300.25], [-5000.0, 9000.0]])
    rays = camera.unproject(uv)
    assert np.abs(np.linalg.norm(rays, axis=1) - 1).max() < 1e-15
    assert np.abs(camera.project(camera.position + 7 * rays)[0] - uv).max() < 1e-8


# ---------------------------------------------------------------------------------------------------------------------
# Vectors that were published, and the hazards


def test_the_fold_over_point_of_kitti_raw():
    K = [[959.791, 0, 696.0217], [0, 956.9251, 224.1806], [0, 0, 1]]
    camera = ipm_rs.Camera(K, image_size=(1392, 512), lens=ipm_rs.BrownConrady(KITTI_RAW))
    point = np.array([[8.0, 1.65, 5.0]])
    ghost = cv2.projectPoints(point, np.zeros(3), np.zeros(3), np.array(K), np.array(KITTI_RAW))[0][0, 0]
    assert 0 < ghost[0] < 1392 and 0 < ghost[1] < 512, "the bare formula puts it inside the image"
    assert np.abs(ghost - [901.2, 269.5]).max() < 0.1
    uv, depth, valid = camera.project(in_vehicle(point))
    assert np.isnan(uv).all() and not valid.any() and depth[0] == 5.0
    assert np.degrees(ipm_rs.BrownConrady([*KITTI_RAW[:2], 0, 0, KITTI_RAW[4]]).max_angle) == pytest.approx(
        50.44, abs=0.006
    )


def test_mei_of_kitti_360():
    lens = ipm_rs.Mei(
        2.2134047507854890, [1.6798235660113681e-02, 1.6548773243373522, 4.2223943394772046e-04, 4.2462134260997584e-04]
    )
    K = [[1336.3220825849971, 0, 716.94323510126321], [0, 1335.7883350012958, 705.76498308221585], [0, 0, 1]]
    uv, _, _ = ipm_rs.Camera(K, image_size=(1400, 1400), lens=lens).project(
        in_vehicle([[1, 0, 1], [0, 1, 1], [1, 0, 0]])
    )
    assert np.abs(uv - [[1042.7485, 705.7980], [716.9765, 1031.4395], [1364.7281, 705.8801]]).max() < 1e-4
    assert np.degrees(lens.max_angle) == pytest.approx(116.9, abs=0.05)


def test_beyond_90_degrees_opencv_mirrors_and_we_do_not():
    lens = ipm_rs.KannalaBrandt([0.0, 0.0, 0.0, 0.0])
    K = np.array([[300.0, 0, 640], [0, 300.0, 480], [0, 0, 1]])
    uv, depth, _ = forward(lens, K).project(in_vehicle([[2.0, 0.0, -1.0]]))
    assert uv[0] == pytest.approx([640 + 300 * (np.pi - np.arctan(2)), 480], abs=1e-9)
    assert depth[0] == -1


def test_no_distortion_is_the_pinhole():
    points = np.random.default_rng(2).uniform([-5, -20, -3], [40, 20, 3], (2000, 3))
    K = intrinsics(None)
    bare = ipm_rs.Camera(K, image_size=(1280, 960))
    for lens in (ipm_rs.BrownConrady([0] * 5), ipm_rs.Mei(0, [0] * 4), ipm_rs.DoubleSphere(0, 0), ipm_rs.Eucm(0, 1)):
        uv, depth, valid = ipm_rs.Camera(K, image_size=(1280, 960), lens=lens).project(points)
        expected = bare.project(points)
        near = np.abs(expected[0]).max(axis=1) < 1e6
        assert np.array_equal(np.isnan(uv), np.isnan(expected[0]))
        assert np.abs(uv - expected[0])[near].max() < 1e-8
        assert np.array_equal(depth, expected[1]) and np.array_equal(valid, expected[2])


@each_lens
def test_resized_and_cropped_follow_the_pixels(lens):
    camera = forward(lens)
    points = in_vehicle(directions(np.linspace(0.05, 0.6, 50), np.linspace(0, 6, 50)))
    u, v = camera.project(points)[0].T
    half = camera.resized(640, 320)
    assert half.lens == lens
    assert np.abs(half.project(points)[0] - np.stack([(u + 0.5) / 2 - 0.5, (v + 0.5) / 3 - 0.5], -1)).max() < 1e-9
    part = camera.cropped(100, 50, 800, 600)
    assert np.abs(part.project(points)[0] - np.stack([u - 100, v - 50], -1)).max() < 1e-9
    assert part.lens == lens and camera.with_pose(np.eye(4)).lens == lens


def test_ocam_of_a_file_is_ocamcalibs_own_formula():
    """`cam2world` of OCamCalib: x counts rows, y columns, and z points out of the back."""
    ss, (c, d, e) = [-350.0, 0.0, 1e-3, -1e-6, 1e-9], (1.001, 2e-3, -3e-3)
    xc, yc = 480.7, 640.2  # row, column
    lens = ipm_rs.Ocam(ss, (c, d, e))
    camera = ipm_rs.Camera([[1, 0, yc], [0, 1, xc], [0, 0, 1]], image_size=(1280, 960), lens=lens)
    column, row = np.random.default_rng(8).uniform([0, 0], [1279, 959], (300, 2)).T
    x, y = np.linalg.solve([[c, d], [e, 1]], np.stack([row - xc, column - yc]))
    z = np.polynomial.Polynomial(ss)(np.hypot(x, y))
    theirs = np.stack([x, y, z], axis=-1) / np.linalg.norm([x, y, z], axis=0)[:, None]
    optical = np.stack([theirs[:, 1], theirs[:, 0], -theirs[:, 2]], axis=-1)
    assert np.abs(camera.unproject(np.stack([column, row], -1)) - in_vehicle(optical)).max() < 1e-14
    assert np.abs(camera.project(in_vehicle(optical))[0] - np.stack([column, row], -1)).max() < 1e-9
    assert ipm_rs.Ocam(ss) == ipm_rs.Ocam([-a for a in ss]), "MATLAB's sign"


def test_vectors_of_colmap():
    """Pixels of COLMAP 4.2.1's `img_from_cam` without the half pixel of its corner base."""
    points = np.array([[0.3, -0.2, 1], [0.9, 0.4, 0.5], [0.9, 0.4, 0.01]])
    K = np.array([[500.0, 0, 500], [0, 510, 400], [0, 0, 1]])
    radial = [0.01, -0.02, 0.003, -0.001, 0.0005, -0.0001]
    for lens, expected in [
        (
            ipm_rs.Fov(0.9),
            [[654.94237715, 294.63918354], [1051.82636081, 650.16128357], [1292.11575262, 759.09247452]],
        ),
        (
            ipm_rs.Division(-0.3),
            [[644.56616242, 301.69500956], [1032.82266987, 641.54627701], [1326.49587094, 774.67812816]],
        ),
        (
            ipm_rs.ThinPrismFisheye([0.01, -0.02, 0.001, -0.002, 0.003, -0.001, 0.004, -0.005]),
            [[643.99471864, 301.9207334], [995.61884788, 621.65796338], [1150.92015522, 689.01102298]],
        ),
        (
            ipm_rs.ThinPrismFisheye([*radial, 0.001, -0.002, 0.004, -0.005, 0.002, -0.001]),
            [[644.55377922, 301.87556855], [996.05622403, 624.40966434], [1161.47645047, 700.28809047]],
        ),
    ]:
        uv, _, _ = forward(lens, K).project(in_vehicle(points))
        assert np.abs(uv - expected).max() < 2e-8, lens
    behind = forward(ipm_rs.Division(-0.3), K).project(in_vehicle([[0.9, 0.4, -0.5]]))[0]
    assert np.abs(behind - [[1806.01854616, 992.06174092]]).max() < 2e-8
    sphere = np.array([[1000 / (2 * np.pi), 0, 500.0], [0, 800 / np.pi, 400.0], [0, 0, 1]])
    uv, _, _ = forward(ipm_rs.Equirectangular(), sphere).project(in_vehicle([*points, [0.1, 0.2, -3]]))
    expected = [[546.38678954, 351.80222192], [669.29276639, 494.36383323], [748.23168451, 506.49411762]]
    assert np.abs(uv - [*expected, [994.6967988, 416.94206183]]).max() < 2e-8


def test_an_f_theta_of_either_form_is_the_other():
    """Of one power both are the same lens; of more, each undoes the other as far as the fit goes."""
    forth = forward(ipm_rs.FTheta([0, 500], "forward"))
    back = forward(ipm_rs.FTheta([0, 1 / 500], "backward"))
    points = in_vehicle(directions(np.linspace(0.01, 3, 200), np.linspace(0, 25, 200)))
    assert np.abs(forth.project(points)[0] - back.project(points)[0]).max() < 1e-9
    equidistant = ipm_rs.Camera(
        [[500, 0, 640.2], [0, 510, 480.7], [0, 0, 1]], image_size=(1280, 960), lens=ipm_rs.KannalaBrandt([0.0] * 4)
    )
    assert np.abs(forth.project(points)[0] - equidistant.project(points)[0]).max() < 1e-9


@pytest.mark.parametrize(("degree", "top"), [(3, 2e-11), (5, 3e-17), (9, 3e-28), (11, 1e-33)])
def test_a_backward_polynomial_of_any_degree_is_inverted_to_rounding(degree, top):
    polynomial = [0.0, 1e-3, 1e-8, *[0.0] * (degree - 3), top]
    camera = forward(ipm_rs.FTheta(polynomial, "backward"))
    rho = np.linspace(0, 1500, 4001)[1:]
    angle = np.polynomial.Polynomial(polynomial)(rho)
    seen = angle < 3.1
    uv, _, _ = camera.project(in_vehicle(directions(angle[seen], np.linspace(0, 6, 4000)[seen])))
    across, down = (uv - [640.2, 480.7]).T / np.array([[1.0], [1.02]])
    assert seen.sum() > 1000 and np.abs(np.hypot(across, down) - rho[seen]).max() < 1e-9


def test_inverse_coefficients_undistort():
    """What librealsense's header says: the formula takes the pixel to the ray."""
    k1, k2, p1, p2, k3 = coefficients = [-0.15, 0.06, 1e-3, -2e-3, 0.01]
    camera = forward(ipm_rs.InverseBrownConrady(coefficients), np.array([[600.0, 0, 640], [0, 610, 480], [0, 0, 1]]))
    uv = np.random.default_rng(4).uniform([200, 100], [1100, 860], (500, 2))
    x, y = (uv - [640, 480]).T / np.array([[600.0], [610.0]])
    r2 = x * x + y * y
    f = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    ux, uy = x * f + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * f + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)
    rays = in_vehicle(np.stack([ux, uy, np.ones_like(ux)], axis=-1))
    assert np.abs(camera.unproject(uv) - rays / np.linalg.norm(rays, axis=1, keepdims=True)).max() < 1e-15 * 4
    assert np.abs(camera.project(rays)[0] - uv).max() < 1e-10


# ---------------------------------------------------------------------------------------------------------------------
# Objects


@pytest.mark.parametrize("lens", [*LENSES, *LIMITED], ids=repr)
def test_lenses_are_values(lens):
    for again in (pickle.loads(pickle.dumps(lens)), copy.copy(lens), copy.deepcopy(lens), eval(f"ipm_rs.{lens!r}")):
        assert again == lens and hash(again) == hash(lens) and repr(again) == repr(lens)
        assert again.max_angle == lens.max_angle
    camera = forward(lens)
    assert camera.lens == lens and repr(lens) in repr(camera)
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        again = pickle.loads(pickle.dumps(camera, protocol))
        assert again == camera and hash(again) == hash(camera) and again.lens == lens
    if camera.intrinsics[0, 0] > 1.5:  # less is no focal length without a lens in pixels
        assert camera != forward(None, camera.intrinsics)
    with pytest.raises(AttributeError):
        lens.max_angle = 1.0


def test_different_lenses_differ():
    everything = [*LENSES, *LIMITED]
    for i, one in enumerate(everything):
        for other in everything[i + 1 :]:
            assert one != other, (one, other)
    assert ipm_rs.BrownConrady([0.1, 0, 0, 0]) == ipm_rs.BrownConrady([0.1, 0, 0, -0.0, 0])
    assert hash(ipm_rs.BrownConrady([0.1, 0, 0, 0])) == hash(ipm_rs.BrownConrady([0.1, 0, 0, -0.0, 0]))
    assert ipm_rs.KannalaBrandt([0] * 4) != "a lens"


def test_attributes_are_what_was_given():
    assert ipm_rs.BrownConrady(np.array([[1, 2, 3, 4]]) / 1000).coefficients == [0.001, 0.002, 0.003, 0.004]
    assert ipm_rs.BrownConrady(np.array([1, 2, 3, 4], np.float32)[:, None] / 1024).coefficients[3] == 4 / 1024
    assert (ipm_rs.Mei(1.5, [0, 0, 0, 0]).xi, ipm_rs.Eucm(0.5, 2).beta) == (1.5, 2.0)
    assert ipm_rs.Ocam([-300, 0, 0.001], affine=[1, 0.5, 0]).affine == (1.0, 0.5, 0.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ipm_rs.BrownConrady([0.1, 0.2, 0.3]), ["4, 5, 8, 12 or 14", "got 3"]),
        (lambda: ipm_rs.BrownConrady([0.1] * 6), ["got 6"]),
        (lambda: ipm_rs.BrownConrady([]), ["got 0"]),
        (lambda: ipm_rs.BrownConrady([np.nan, 0, 0, 0]), ["finite", "NaN"]),
        (lambda: ipm_rs.BrownConrady([0] * 12 + [2.0, 0]), ["tau", "2"]),
        (lambda: ipm_rs.KannalaBrandt([0.1] * 5), ["4 (k1, k2, k3, k4)", "got 5"]),
        (lambda: ipm_rs.KannalaBrandt([0, 0, 0, np.inf]), ["finite", "inf"]),
        (lambda: ipm_rs.KannalaBrandt([0] * 4, max_angle=-1), ["max_angle", "radians", "-1"]),
        (lambda: ipm_rs.KannalaBrandt([0] * 4, max_angle=90), ["max_angle", "radians", "90"]),
        (lambda: ipm_rs.Mei(-0.5, [0] * 4), ["xi", "-0.5"]),
        (lambda: ipm_rs.Mei(1.0, [0] * 5), ["4 (k1, k2, p1, p2)", "got 5"]),
        (lambda: ipm_rs.DoubleSphere(0.1, 1.5), ["alpha", "0 to 1", "1.5"]),
        (lambda: ipm_rs.DoubleSphere(1.5, 0.1), ["xi", "1.5"]),
        (lambda: ipm_rs.Eucm(1.5, 0.5), ["alpha", "1.5"]),
        (lambda: ipm_rs.Eucm(0.5, -1), ["beta", "-1"]),
        (lambda: ipm_rs.RadialPolynomial([0, 1, 2, 3]), ["k1", "above 0"]),
        (lambda: ipm_rs.RadialPolynomial([1, 2, 3]), ["4 (k1", "got 3"]),
        (lambda: ipm_rs.Ocam([0, 1, 2]), ["a0", "reversed"]),
        (lambda: ipm_rs.Ocam([]), ["1 to 12", "got 0"]),
        (lambda: ipm_rs.Ocam([-300], (0, 0, 1)), ["c - d e", "got 0"]),
        (lambda: ipm_rs.FTheta([0.0], "forward"), ["2 to 12", "got 1"]),
        (lambda: ipm_rs.FTheta([300, 2, 1], "forward"), ["a0", "expected 0"]),
        (lambda: ipm_rs.FTheta([0, 3e-3], "forward"), ["a1", 'form="backward"']),
        (lambda: ipm_rs.FTheta([0, 300], "backward"), ["a1", 'form="forward"']),
        (lambda: ipm_rs.FTheta([0, 300], "forward", (0, 1, 1)), ["c - d e", "got -1"]),
        (lambda: ipm_rs.FTheta([0, 3e-3, -1], "backward"), ["FTheta", "folds back"]),
        (lambda: ipm_rs.Fov(0), ["omega", "leave the lens out"]),
        (lambda: ipm_rs.Fov(57.3), ["omega", "below pi"]),
        (lambda: ipm_rs.Division(np.nan), ["k", "finite"]),
        (lambda: ipm_rs.Division(1e9), ["Division", "folds back"]),
        (lambda: ipm_rs.InverseBrownConrady([0] * 8), ["4 or 5", "got 8"]),
        (lambda: ipm_rs.InverseBrownConrady([-1e7, 0, 0, 0]), ["InverseBrownConrady", "folds back"]),
        (lambda: ipm_rs.ThinPrismFisheye([0] * 10), ["8 (k1", "12 (k1", "got 10"]),
        (lambda: ipm_rs.Cylindrical(max_angle=0), ["max_angle", "above 0"]),
        (lambda: ipm_rs.Equirectangular(max_angle=180), ["max_angle", "radians"]),
        (lambda: ipm_rs.BrownConrady([0, 0, 1e4, 0]), ["k1, k2, p1, p2", "folds back", "order"]),
        (lambda: ipm_rs.KannalaBrandt([-1e9, 0, 0, 0]), ["4 (k1, k2, k3, k4)", "folds back"]),
    ],
)
def test_wrong_parameters(make, words):
    with pytest.raises(ipm_rs.CalibrationError) as error:
        make()
    for word in words:
        assert word in str(error.value), str(error.value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ipm_rs.BrownConrady("0.1, 0.2, 0.3, 0.4"),
        lambda: ipm_rs.BrownConrady(None),
        lambda: ipm_rs.BrownConrady([1 + 2j, 0, 0, 0]),
        lambda: ipm_rs.Mei("1", [0] * 4),
        lambda: ipm_rs.KannalaBrandt([0] * 4, max_angle="wide"),
        lambda: ipm_rs.Ocam([-300], affine="cde"),
        lambda: ipm_rs.FTheta([0, 300], None),
        lambda: ipm_rs.Fov("wide"),
        lambda: ipm_rs.Camera(np.eye(3), image_size=(4, 4), lens=[0.1, 0, 0, 0]),
        lambda: ipm_rs.Camera.from_euler(np.eye(3), image_size=(4, 4), lens="fisheye"),
    ],
)
def test_wrong_types(make):
    with pytest.raises(ipm_rs.ArgumentTypeError):
        make()


def test_another_form_of_an_f_theta_is_refused():
    with pytest.raises(ipm_rs.ArgumentError, match=r'form: expected "forward".*got "bw_poly"'):
        ipm_rs.FTheta([0, 300], "bw_poly")


def test_a_matrix_of_coefficients_is_refused():
    with pytest.raises(ipm_rs.ArgumentError, match=r"shape \(2, 4\)"):
        ipm_rs.KannalaBrandt(np.zeros((2, 4)))
