"""What `ipm_rs.refine` computes in Rust, beside the same in plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest

import ipm_rs
from ipm_rs.refine import _loss
from ipm_rs.refine._pictures import Pyramid
from ipm_rs.refine._projection import Eye
from ipm_rs.refine._road import Pair, Road, Sight, pose_of_camera
from ipm_rs.refine._solve import Normal, forward, inverse_of, minimise

SIZE = (160, 120)
LENS = ipm_rs.KannalaBrandt([0.03, -0.01, 0.002, -0.0004])


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(4)


def exposed(values, there, spread, J):
    """`_loss.exposed` as its docstring has it."""
    off = values - there - np.median(values - there)
    for _ in range(2):
        width = 1.4826 * np.median(np.abs(off)) if spread is None else spread
        weights = (1 - np.minimum((off / (_loss.CUT * width)) ** 2, 1)) ** 2
        v, t = (each - np.average(each, weights=weights) for each in (values, there))
        gain = (weights * t * v).sum() / (weights * t * t).sum()
        off = v - np.clip(gain, 0.5, 2) * t
    J = J - np.average(J, axis=0, weights=weights)
    if 0.5 < gain < 2:
        J = J - np.outer(t, (weights * t) @ J / (weights * t * t).sum())
    return off, J


@pytest.mark.parametrize("spread", [None, 3.0])
@pytest.mark.parametrize("gain", [1.3, 0.2])
def test_light_is_fitted_to_what_does_not_move(random, spread, gain):
    there, J = random.uniform(50, 150, 401), random.normal(size=(401, 5))
    values = gain * there + 7 + random.normal(0, 2, 401) + np.where(np.arange(401) % 9 == 4, 90, 0)
    with_gaps, steep = values.copy(), J.copy()
    with_gaps[11], steep[23, 2] = np.nan, np.inf
    off, slopes, shown = _loss.exposed(with_gaps, there, spread, steep)
    kept = np.isfinite(with_gaps) & np.isfinite(steep).all(1)
    np.testing.assert_array_equal(shown, kept)
    expected = exposed(values[kept], there[kept], spread, J[kept])
    np.testing.assert_allclose(off, expected[0], atol=1e-10)
    np.testing.assert_allclose(slopes, expected[1], atol=1e-11)


def test_what_moves_does_not_make_views_unlike(random):
    """A thing in one of two views hides a third of the road; of other road they stay unlike."""
    road, other = random.normal(95, 10, 600), random.normal(95, 10, 600)
    view = 1.1 * road + 4 + random.normal(0, 2, 600)
    view[:200] = 190.0
    assert _loss.correlation(road, view) < 0.3 < 0.9 < _loss.likeness(road, view)
    assert abs(_loss.likeness(other, view)) < 0.2
    assert _loss.likeness(road, 2 * road + 1) == pytest.approx(1.0)
    assert _loss.likeness(road[:9], road[:9]) == -1.0
    assert _loss.likeness(np.full(20, 7.0), np.full(20, 7.0)) == 0.0


def test_equations_are_those_of_tukeys_loss(random):
    off, J = random.normal(0, 4, 300), random.normal(size=(300, 6))
    share = np.minimum((off / (_loss.CUT * 2.5)) ** 2, 1)
    weights = (1 - share) ** 2
    found = _loss.normal_of(off, J[:, ::-1][:, ::-1], 2.5)
    np.testing.assert_allclose(found.gradient, J.T @ (weights * off), rtol=1e-11)
    np.testing.assert_allclose(found.hessian, (J * weights[:, None]).T @ J, rtol=1e-11)
    np.testing.assert_array_equal(found.hessian, found.hessian.T)
    loss = (1 - (1 - share) ** 3).sum()
    assert abs(found.cost - _loss.CUT**2 / 6 * 2.5**2 * loss) < 1e-9 * found.cost
    assert abs(_loss.loss_of(off, 2.5) - loss) < 1e-11 * loss


@pytest.mark.parametrize("lens", [None, LENS])
@pytest.mark.parametrize("of_camera", [False, True])
def test_places_are_looked_at_where_the_second_camera_sees_them(random, lens, of_camera):
    camera = ipm_rs.Camera.from_euler(
        [[120.0, 0.3, 79.5], [0, 118, 50], [0, 0, 1]], image_size=SIZE, lens=lens, position=(0.8, 0.1, 1.4),
        roll=0.02, pitch=0.2, yaw=-0.03,
    )  # fmt: skip
    picture = random.uniform(0, 255, SIZE[::-1]).astype(np.float32)
    shown = np.ones(SIZE[::-1], bool)
    shown[60:70, 40:60] = False
    camera = camera.masked(shown)
    shown[59:71, 39:61] = False  # what a pixel's neighbours hide is not looked at
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = ipm_rs.rotation_from_euler(0.01, -0.02, 0.05), (-0.6, 0.1, 0.02)
    if of_camera:
        motion = camera.camera_from_vehicle @ motion @ camera.vehicle_from_camera
    climb = ipm_rs.Plane.from_angles(slope=0.02, bank=0.01)
    pixels = np.stack(np.meshgrid(np.arange(5.0, 155, 7), np.arange(5.0, 115, 5)), -1).reshape(-1, 2)
    eye = Eye(camera)
    road = Road(eye, [Pyramid(picture)] * 2, [Pair(0, 1, motion, np.eye(4))], climb, of_camera)
    rays = eye.rays(pixels)
    found = road.residuals(pose_of_camera(camera), road.pairs[0], Sight(rays, rays[:, 0]), 0, slopes=False)[0]

    second = motion @ camera.camera_from_vehicle if of_camera else camera.camera_from_vehicle @ motion
    uv = camera.with_pose(second).project(camera.ground_from_pixels(pixels, ground=climb))[0]
    at = np.nan_to_num(np.rint(uv), nan=-1.0).astype(int)
    inside = ((uv >= 0) & (uv <= (SIZE[0] - 1, SIZE[1] - 1))).all(1)
    inside[inside] &= shown[at[inside, 1], at[inside, 0]]
    expected = ipm_rs.reference.remap_bilinear(picture, uv[None, :, 0], uv[None, :, 1])[0]
    np.testing.assert_array_equal(np.isfinite(found), inside)
    assert 100 < inside.sum() < len(inside) - 50 and (at[~inside] >= 0).all(1).any()
    np.testing.assert_allclose(found[inside], expected[inside], atol=2e-3)


def test_triangles_and_inverses_are_those_of_numpy(random):
    A = random.normal(size=(30, 12))
    matrix, sizes = A.T @ A, 10.0 ** np.arange(-6, 6)
    factor = np.linalg.cholesky(matrix)
    np.testing.assert_allclose(factor @ forward(factor, np.eye(12)), np.eye(12), atol=1e-12)
    found = inverse_of(matrix * np.outer(sizes, sizes)) * np.outer(sizes, sizes)
    np.testing.assert_allclose(found, np.linalg.inv(matrix), atol=1e-12)
    A[:, 3] = A[:, 4]
    assert inverse_of(A.T @ A) is None, "two parameters that are told together only"
    assert inverse_of(np.diag([1.0, 0.0])) is None
    lowest, _ = minimise(lambda x: Normal.of(A @ x - A.sum(1), A), np.zeros(12), lambda x, step: x + step)
    np.testing.assert_allclose(A @ lowest, A.sum(1), atol=1e-9)
