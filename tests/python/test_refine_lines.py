"""Poses from marked lines, the horizon, a known width and a known way, through every kind of lens."""

from __future__ import annotations

import numpy as np
import pytest

import ipm_rs
from ipm_rs import errors, refine

K = [[800.0, 0.0, 639.5], [0.0, 800.0, 359.5], [0.0, 0.0, 1.0]]
LENSES = {
    "pinhole": None,
    "brown": ipm_rs.BrownConrady([-0.3, 0.1, 0.001, -0.001, 0.0]),
    "fisheye": ipm_rs.KannalaBrandt([0.05, -0.01, 0.002, 0.0]),
}


def camera(lens: str, roll: float, pitch: float, yaw: float, height: float = 1.4) -> ipm_rs.Camera:
    angles = dict(zip(("roll", "pitch", "yaw"), np.radians([roll, pitch, yaw]), strict=True))
    return ipm_rs.Camera.from_euler(K, image_size=(1280, 720), position=(1.5, 0.2, height), lens=LENSES[lens], **angles)


def angles(camera: ipm_rs.Camera) -> np.ndarray:
    """How far its right side leans, it looks down and to the left, degrees."""
    right, _, ahead = camera.vehicle_from_camera[:3, :3].T
    return np.degrees([np.arcsin(right[2]), np.arcsin(-ahead[2]), np.arctan2(ahead[1], ahead[0])])


def seen(camera: ipm_rs.Camera, points: object) -> np.ndarray:
    points = np.asarray(points, np.float64)
    pixels = camera.project(points.reshape(-1, 3))[0]
    assert np.isfinite(pixels).all()
    return pixels.reshape(*points.shape[:-1], 2)


ALONG = [[(6.0, y, 0.0), (25.0, y, 0.0)] for y in (2.0, -1.75, -3.5)]
ACROSS = [[(x, -3.0, 0.0), (x, 2.5, 0.0)] for x in (8.0, 9.0, 14.0)]
FAR = [(1e9, y, 1.4) for y in (-4e8, 0.0, 3e8)]


@pytest.mark.parametrize("lens", LENSES)
def test_lines_and_the_horizon_give_the_rotation_to_rounding(lens):
    true, start = camera(lens, 1.5, 6.0, -2.0), camera(lens, -0.5, 9.0, 1.0)
    along, across, far = seen(true, ALONG), seen(true, ACROSS), seen(true, FAR)
    for found in (
        refine.from_lines(start, along, across=across),
        refine.from_lines(start, along, horizon=far),
        refine.from_lines(start, along, across=across, horizon=far),
    ):
        np.testing.assert_allclose(found.vehicle_from_camera, true.vehicle_from_camera, atol=1e-9)
        assert found.lens == true.lens
    upright = refine.from_lines(start, horizon=far)
    up = upright.camera_from_vehicle[:3, 2]
    np.testing.assert_allclose(up, true.camera_from_vehicle[:3, 2], atol=1e-9)


@pytest.mark.parametrize("lens", LENSES)
def test_lines_along_alone_give_what_the_vanishing_point_does(lens):
    true, start = camera(lens, 0.0, 6.0, -2.0), camera(lens, 0.0, 3.0, 1.0)
    found = refine.from_lines(start, seen(true, ALONG))
    forward = found.camera_from_vehicle[:3, 0]
    np.testing.assert_allclose(forward, true.camera_from_vehicle[:3, 0], atol=1e-9)
    # the smallest turn: what is beside the axis of the turn moves by no more than it
    turned = found.camera_from_vehicle[:3, :3] @ start.vehicle_from_camera[:3, :3]
    angle = np.degrees(np.arccos((np.trace(turned) - 1) / 2))
    assert angle == pytest.approx(np.degrees(np.arccos(forward @ start.camera_from_vehicle[:3, 0])), abs=1e-6)


def test_a_camera_that_looks_back_keeps_looking_back():
    true = ipm_rs.Camera.from_euler(K, image_size=(1280, 720), position=(-1.0, 0.0, 1.0), pitch=0.15, yaw=np.pi)
    start = ipm_rs.Camera.from_euler(K, image_size=(1280, 720), position=(-1.0, 0.0, 1.0), pitch=0.1, yaw=3.1)
    behind = [[(-5.0, y, 0.0), (-20.0, y, 0.0)] for y in (-2.0, 1.5)]
    crossing = [[(x, -2.0, 0.0), (x, 2.0, 0.0)] for x in (-6.0, -9.0)]
    found = refine.from_lines(start, seen(true, behind), across=seen(true, crossing))
    np.testing.assert_allclose(found.vehicle_from_camera, true.vehicle_from_camera, atol=1e-9)


@pytest.mark.parametrize("lens", LENSES)
def test_a_width_and_a_way_give_the_height_to_rounding(lens):
    true, start = camera(lens, 1.0, 6.0, -2.0, 1.63), camera(lens, 1.0, 6.0, -2.0, 1.0)
    left, right = (seen(true, [(x, y, 0.0) for x in (6.0, 9.0, 20.0)]) for y in (1.75, -1.9))
    found = refine.height_from_width(start, left, right, 3.65)
    np.testing.assert_allclose(found.vehicle_from_camera, true.vehicle_from_camera, atol=1e-9)
    spots = np.array([(9.0, 1.0, 0.0), (12.0, -2.0, 0.0), (16.0, 0.0, 0.0)])
    before, after = seen(true, spots), seen(true, spots - (1.3, 0.0, 0.0))
    found = refine.height_from_travel(start, before, after, 1.3)
    np.testing.assert_allclose(found.vehicle_from_camera, true.vehicle_from_camera, atol=1e-9)
    found = refine.height_from_travel(start, after, before, -1.3)
    np.testing.assert_allclose(found.vehicle_from_camera, true.vehicle_from_camera, atol=1e-9)
    high = refine.height_from_width(start, left, right, 3.65, ground=-0.3)
    assert high.position[2] == pytest.approx(1.33, abs=1e-9)


def test_a_width_of_slanting_lines_is_taken_at_right_angles():
    true = camera("pinhole", 0.0, 6.0, 0.0)
    way, side = np.array([np.cos(0.1), np.sin(0.1), 0.0]), np.array([-np.sin(0.1), np.cos(0.1), 0.0])
    left, right = (seen(true, [s * way + w * side for s in (6.0, 18.0)]) for w in (1.5, -1.5))
    assert refine.height_from_width(true, left, right, 3.0).position[2] == pytest.approx(1.4, abs=1e-9)


def test_a_pixel_of_noise_costs_a_few_hundredths_of_a_degree():
    true, start = camera("brown", 1.0, 6.0, -2.0), camera("brown", 0.0, 5.0, 0.0)
    random, off = np.random.default_rng(3), []
    for _ in range(20):
        along, across = (seen(true, lines) + random.normal(0, 1.0, (3, 2, 2)) for lines in (ALONG, ACROSS))
        off.append(angles(refine.from_lines(start, along, across=across)) - angles(true))
    deviation = np.sqrt((np.array(off) ** 2).mean(axis=0))
    assert 0.001 < deviation[1] < 0.2 and 0.001 < deviation[2] < 0.2 and 0.001 < deviation[0] < 1.0


TRUE = camera("pinhole", 0.0, 6.0, 0.0)
LINES, STOPS = seen(TRUE, ALONG), seen(TRUE, ACROSS)
LEFT, RIGHT = LINES[0], LINES[1]


@pytest.mark.parametrize(
    ("call", "error", "phrase"),
    [
        (lambda: refine.from_lines(TRUE), errors.ArgumentError, "got neither"),
        (lambda: refine.from_lines(TRUE, across=STOPS, horizon=LEFT), errors.ArgumentError, "mark both"),
        (lambda: refine.from_lines(TRUE, LINES[:1]), errors.ArgumentError, "two lines or more, got 1"),
        (lambda: refine.from_lines(TRUE, LINES[[0, 0]]), errors.ArgumentError, "the same one again"),
        (lambda: refine.from_lines(TRUE, LINES[:, [0, 0]]), errors.ArgumentError, r"along\[\d\].*the same twice"),
        (lambda: refine.from_lines(TRUE, LINES, across=LINES), errors.ArgumentError, "right angles"),
        (
            lambda: refine.from_lines(TRUE, LINES, horizon=[(0, 700), (1279, 700)]),
            errors.ArgumentError,
            "horizon.*right",
        ),
        (lambda: refine.from_lines(TRUE, horizon=[(5, 5)]), errors.ArgumentError, "horizon: expected two pixels"),
        (lambda: refine.from_lines(TRUE, horizon=[(5, 5), (5, 5)]), errors.ArgumentError, "all in one place"),
        (lambda: refine.from_lines(TRUE, LINES * np.nan), errors.CalibrationError, "along"),
        (lambda: refine.from_lines("front", LINES), errors.ArgumentTypeError, "camera"),
        (lambda: refine.from_lines(TRUE, LINES[0]), errors.ArgumentError, "shape"),
        (lambda: refine.height_from_width(TRUE, LEFT, LEFT, 3.5), errors.ArgumentError, "another line"),
        (lambda: refine.height_from_width(TRUE, LEFT, STOPS[0], 3.5), errors.ArgumentError, "parallel"),
        (lambda: refine.height_from_width(TRUE, LEFT[:1], RIGHT, 3.5), errors.ArgumentError, "left: expected 2"),
        (lambda: refine.height_from_width(TRUE, LEFT[[0, 0]], RIGHT, 3.5), errors.ArgumentError, "all in one place"),
        (lambda: refine.height_from_width(TRUE, LEFT, RIGHT, 0), errors.ArgumentError, "width"),
        (lambda: refine.height_from_width(TRUE, LEFT - (0, 400), RIGHT, 3), errors.ArgumentError, "above it"),
        (lambda: refine.height_from_travel(TRUE, LEFT, LEFT[:1], 1), errors.ArgumentError, "as many pixels"),
        (lambda: refine.height_from_travel(TRUE, LEFT, LEFT, 0.0), errors.ArgumentError, "distance"),
        (lambda: refine.height_from_travel(TRUE, LEFT, LEFT, 1.0), errors.ArgumentError, "distance"),
        (lambda: refine.height_from_travel(TRUE, LEFT[::-1], LEFT, -1.0), errors.ArgumentError, "distance|move"),
        (lambda: refine.height_from_travel(TRUE, LEFT, RIGHT, 1.0), errors.ArgumentError, "straight"),
    ],
)
def test_wrong_marks_are_refused(call, error, phrase):
    with pytest.raises(error, match=phrase):
        call()
