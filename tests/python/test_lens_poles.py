"""Rational Brown-Conrady lenses that rise to a pole of their quotient: every pixel before it has its ray."""

from __future__ import annotations

import numpy as np
import pytest

import ipm_rs

# k1 k2 p1 p2 k3 k4 k5 k6; each grows without bound up to its pole, which lies 35 to 68 degrees from the axis
POLES = {
    "46 degrees": [2.4109, -2.0, 0, 0, -0.9091, 2.9909, -1.5455, -1.8182],
    "45 degrees": [1.403, -2.1, 0, 0, -0.3, 1.9, -1.9, -1.0],
    "68 degrees": [0.5433, -0.0167, 0, 0, -0.0167, 1.0333, 0.1, -0.05],
    "35 degrees": [-1.0403, -1.8408, 0, 0, -0.4082, -0.8408, -2.149, -0.6122],
    "56 degrees": [0.3457, -0.2636, 0, 0, -0.0455, 0.7455, -0.2455, -0.1364],
}
BESIDE = {  # tangential terms and a thin prism
    "tangential": [2.4109, -2.0, 4e-4, -3e-4, -0.9091, 2.9909, -1.5455, -1.8182],
    "prism": [0.5433, -0.0167, 2e-4, 1e-4, -0.0167, 1.0333, 0.1, -0.05, 1e-4, 0, -2e-4, 0],
}
SIZE, CENTRE = (240, 150), (119.2, 75.6)


def radial(k, r):
    s = r * r
    return r * (1 + s * (k[0] + s * (k[1] + s * k[4]))) / (1 + s * (k[5] + s * (k[6] + s * k[7])))


def pole(k):
    roots = np.roots([k[7], k[6], k[5], 1])
    return np.sqrt(min(root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 0))


def camera(k, f):
    K = [[f, 0, CENTRE[0]], [0, f, CENTRE[1]], [0, 0, 1]]
    return ipm_rs.Camera(K, image_size=SIZE, camera_from_vehicle=np.eye(4), lens=ipm_rs.BrownConrady(k))


PIXELS = np.stack(np.meshgrid(np.arange(0.0, SIZE[0]), np.arange(0.0, SIZE[1])), -1).reshape(-1, 2)


@pytest.mark.parametrize("f", [50.0, 147.5])
@pytest.mark.parametrize("name", POLES)
def test_every_pixel_before_the_pole_has_its_ray(name, f):
    k = POLES[name]
    end = pole(k)
    grown = radial(k, np.linspace(0, end * (1 - 1e-9), 100_001))
    assert (np.diff(grown) > 0).all() and grown[-1] > 1e4, "a lens that folds before its pole shows nothing here"
    m = (PIXELS - CENTRE) / f
    length = np.linalg.norm(m, axis=1)
    low, high = np.zeros_like(length), np.full_like(length, end)
    for _ in range(60):
        middle = (low + high) / 2
        inside = radial(k, middle) < length
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    rays = np.column_stack([m * (low / length)[:, None], np.ones(len(m))])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    eye = camera(k, f)
    np.testing.assert_allclose(eye.unproject(PIXELS), rays, rtol=0, atol=1e-9)

    # the other ways from pixels to rays: depth images, their tables, the road
    depth = np.ones((SIZE[1], SIZE[0]))
    organised = ipm_rs.points_from_depth(depth, eye, dtype="float64").reshape(-1, 3)
    tabled = ipm_rs.points_from_depth(depth, ipm_rs.PixelRays(eye), dtype="float64").reshape(-1, 3)
    for points in (organised, tabled):
        np.testing.assert_allclose(points, rays / rays[:, 2:], rtol=0, atol=1e-6)
    ahead = eye.with_pose(np.array([[0, -1, 0, 0], [0, 0, -1, 1.5], [1, 0, 0, 0], [0, 0, 0, 1.0]]))
    below = rays[:, 1] > 1e-3
    ground = ahead.ground_from_pixels(PIXELS[below])
    expected = np.column_stack([rays[below, 2], -rays[below, 0]]) * (1.5 / rays[below, 1])[:, None]
    np.testing.assert_allclose(ground[:, :2], expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", BESIDE)
def test_tangential_terms_lose_no_pixel_either(name):
    eye = camera(BESIDE[name], 147.5)
    rays = eye.unproject(PIXELS)
    assert not np.isnan(rays).any(), f"{np.isnan(rays[:, 0]).sum()} of {len(rays)}"
    back = eye.project(rays)[0]
    # a ray is known to 1e-16; the nearer the pole, the more that is in pixels
    np.testing.assert_allclose(back, PIXELS, rtol=0, atol=1e-3)


@pytest.mark.parametrize("k", [[-0.3, 0.05, 0, 0, 0, 0.1, 0.0, 0.0], [-0.2, 0, 0, 0, 0, 0.3, 0, 0]])
def test_what_the_lens_does_not_reach_has_no_ray(k):
    """Before a fold nothing is allowed for: pixels farther out than the image of the fold stay without a ray."""
    lens = ipm_rs.BrownConrady(k)
    reach = radial(k, np.tan(lens.max_angle))
    eye = camera(k, 50.0)
    far = np.array(CENTRE) + 50.0 * reach * np.array([[1 + 1e-6, 0], [0, -1 - 1e-6], [1.2, 0.3]])
    assert np.isnan(eye.unproject(far)).all()
    near = np.array(CENTRE) + 50.0 * reach * np.array([[1 - 1e-6, 0], [0, -1 + 1e-6]])
    assert not np.isnan(eye.unproject(near)).any()
