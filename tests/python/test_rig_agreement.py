"""`RigLut.agreement` finds by how much pictures lie beside each other; `Bowl` is the surface that it says."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors
from ipm_rs.rig import Agreement

K = [[120.0, 0, 127.5], [0, 120.0, 95.5], [0, 0, 1]]
GRID = ipm_rs.BevGrid(x=(-6, 8), y=(-6, 6), resolution=0.05)


def camera(yaw, x=0.0, y=0.0) -> ipm_rs.Camera:
    return ipm_rs.Camera.from_euler(
        K, image_size=(256, 192), position=(x, y, 1.5), pitch=np.radians(35), yaw=np.radians(yaw)
    )


def road(points) -> np.ndarray:
    """Waves of half a metre to two metres, at points (..., 2)."""
    x, y = points[..., 0], points[..., 1]
    waves = sum(
        np.sin(a * x + b * y + c) for a, b, c in [(3.1, 7.3, 0.2), (9.7, -4.1, 1.1), (-6.3, 5.9, 2.0), (12.1, 8.3, 0.7)]
    )
    return 120 + 25 * waves


def picture(camera, gain=1.0) -> np.ndarray:
    u, v = np.meshgrid(np.arange(256.0), np.arange(192.0))
    points = camera.ground_from_pixels(np.stack([u, v], axis=-1).reshape(-1, 2))
    grey = np.where(np.isnan(points[:, 0]), 90, road(points)) * gain
    return np.clip(grey, 0, 255).reshape(192, 256).round().astype(np.uint8)


CAMERAS = {"front": camera(0, 1.0), "left": camera(70, 0.8, 0.4), "back": camera(180, -1.0)}


def test_right_poses_agree_and_wrong_ones_are_found():
    images = {name: picture(camera, gain) for (name, camera), gain in zip(CAMERAS.items(), (1, 1.3, 1), strict=True)}
    right = ipm_rs.RigLut(CAMERAS, GRID).agreement(images)
    assert list(right) == [("front", "left")]
    found = right["front", "left"]
    assert isinstance(found, Agreement) and found.cells > 500
    assert found.correlation > 0.95 and np.hypot(*found.shift) < 0.01 and found.difference < -20
    # the left camera believed to stand elsewhere than it did: its picture lies beside
    for moved in ((0.2, -0.1), (-0.15, 0.25)):
        wrong = {**CAMERAS, "left": camera(70, 0.8 + moved[0], 0.4 + moved[1])}
        found = ipm_rs.RigLut(wrong, GRID).agreement(images)["front", "left"]
        assert found.correlation < 0.6 and found.shifted_correlation > 0.9
        np.testing.assert_allclose(found.shift, np.negative(moved), atol=0.02)


def test_pairs_that_say_nothing():
    lut = ipm_rs.RigLut(CAMERAS, GRID)
    flat = {name: np.full((192, 256, 3), 90, np.uint8) for name in CAMERAS}
    found = lut.agreement(flat)["front", "left"]
    assert np.isnan([found.correlation, found.shifted_correlation, *found.shift]).all() and found.difference == 0
    assert lut.agreement({**flat, "left": None}) == {}
    whole = ipm_rs.RigLut(CAMERAS, GRID, exclude=[[-9, -9], [9, -9], [9, 9], [-9, 9]])
    assert whole.agreement(flat) == {}
    for farthest in (0, -1, "far", np.nan, [1, 2]):
        with refuses(errors.IpmError, "farthest"):
            lut.agreement(flat, farthest=farthest)


def test_a_bowl_is_flat_then_an_arc_then_straight():
    bowl = ipm_rs.Bowl(flat=4.0, radius=2.0, center=(1.0, 0.0), height=-0.1, steepest=45)
    end = 4 + 2 * np.sin(np.radians(45))
    arc = 2 - np.sqrt(2.0)
    heights = bowl.height_at([[1, 0], [1, 3.99], [1, -5], [1 + end, 0], [1 - end - 1, 0]])
    expected = [-0.1, -0.1, -0.1 + 2 - np.sqrt(3), -0.1 + 2 - np.sqrt(2), -0.1 + arc + 1]
    np.testing.assert_allclose(heights, expected, atol=1e-12)
    square = ipm_rs.Bowl(flat=(6, 4), radius=2.0)
    np.testing.assert_allclose(square.height_at([[2.9, 1.9], [4, 0], [0, 3], [3.6, 2.8]]), [0, *3 * [2 - np.sqrt(3)]])
    surface = bowl.height_map(GRID)
    xy = np.random.default_rng(1).uniform((-6, -6), (8, 6), (500, 2))
    np.testing.assert_allclose(surface.height_at(xy), bowl.height_at(xy), atol=2e-3)
    assert pickle.loads(pickle.dumps(bowl)) == bowl == copy.deepcopy(bowl) and hash(bowl) == hash(copy.copy(bowl))


def test_a_rig_on_a_bowl_shows_what_the_bowl_shows():
    bowl = ipm_rs.Bowl(flat=3.0, radius=2.0)
    lut = ipm_rs.RigLut({"front": CAMERAS["front"]}, GRID, ground=bowl)
    alone = ipm_rs.Lut(CAMERAS["front"], GRID, ground=bowl.height_map(GRID))
    np.testing.assert_array_equal(lut.mask, alone.mask)
    assert lut.ground == bowl and pickle.loads(pickle.dumps(lut)) == lut
    assert not np.array_equal(lut.mask, ipm_rs.RigLut({"front": CAMERAS["front"]}, GRID).mask)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"flat": 0}, "flat"),
        ({"flat": (1, 2, 3)}, "flat"),
        ({"flat": "wide"}, "flat"),
        ({"flat": 3, "radius": -1}, "radius"),
        ({"flat": 3, "center": 2}, "center"),
        ({"flat": 3, "height": np.nan}, "height"),
        ({"flat": 3, "steepest": 90}, "steepest"),
    ],
)
def test_wrong_bowls_are_refused(wrong, words):
    with refuses(errors.ArgumentError, words):
        ipm_rs.Bowl(**wrong)
    with refuses(errors.ArgumentError, "xy"):
        ipm_rs.Bowl(3).height_at([1, 2, 3])
