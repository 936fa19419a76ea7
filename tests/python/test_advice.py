"""Errors that name the mend that helps, first what is most often wrong."""

from __future__ import annotations

import re

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors

K = np.array([[880.0, 0, 639.5], [0, 880.0, 359.5], [0, 0, 1]])
SIZE = (1280, 720)
POSE = {"image_size": SIZE, "position": (1.2, -0.3, 1.5), "roll": 0.02, "pitch": 0.12, "yaw": -0.4}
CAMERA = ipm_rs.Camera.from_euler(K, **POSE)
GRID = ipm_rs.BevGrid(x=(4, 24), y=(-5, 5), resolution=0.25)


def rounded(digits: int) -> np.ndarray:
    pose = CAMERA.camera_from_vehicle
    pose[:3, :3] = pose[:3, :3].round(digits)
    return pose


def nearest(rotation: np.ndarray) -> np.ndarray:
    u, _, v = np.linalg.svd(rotation)
    return u @ v


# ---------------------------------------------------------------------------------------------------------------------
# Sizes


def test_images_of_another_size_name_image_size_first():
    lut = ipm_rs.Lut(CAMERA, GRID)
    order = r"960x540.*1280x720.*image_size=\(960, 540\).*resized\(\).*cropped\(\)"
    for image in (np.zeros((540, 960, 3), np.uint8), np.zeros((2, 540, 960, 3), np.uint8)):
        layout = "HWC" if image.ndim == 3 else "NHWC"
        with pytest.raises(errors.ImageError, match=order):
            lut.warp(image, layout=layout)
    with pytest.raises(errors.ImageError, match=order):
        ipm_rs.points_from_depth(np.ones((540, 960), np.float32), CAMERA)


def test_swapped_sizes_say_so():
    upright_k = [[880.0, 0, 359.5], [0, 880.0, 639.5], [0, 0, 1]]
    upright = ipm_rs.Camera.from_euler(upright_k, **POSE | {"image_size": (720, 1280)})
    words = r"swapped.*\(width, height\).*shape is \(height, width\).*image_size=\(1280, 720\)"
    with pytest.raises(errors.ImageError, match=words):
        ipm_rs.Lut(upright, GRID).warp(np.zeros((720, 1280), np.uint8))
    with pytest.raises(errors.ImageError, match=words):
        ipm_rs.points_from_depth(np.ones((720, 1280), np.float32), upright)
    depth, mask = np.ones((720, 1280), np.float32), np.ones((1280, 720), bool)
    with pytest.raises(errors.ImageError, match=r"mask is 720x1280 but depth is 1280x720; it seems transposed"):
        ipm_rs.points_from_depth(depth, CAMERA, mask=mask)


# ---------------------------------------------------------------------------------------------------------------------
# Rotations


@pytest.mark.parametrize("digits", [2, 3])
def test_few_digits_are_taken_with_nearest_rotation(digits):
    pose = rounded(digits)
    for make in (
        lambda **more: ipm_rs.Camera(K, image_size=SIZE, camera_from_vehicle=pose, **more),
        lambda **more: CAMERA.with_pose(pose, **more),
    ):
        with refuses(errors.CalibrationError, "nearest_rotation=True"):
            make()
        with refuses(errors.CalibrationError, "nearest_rotation=True"):
            make(nearest_rotation=False)
        got = make(nearest_rotation=True).camera_from_vehicle
        np.testing.assert_allclose(got[:3, :3], nearest(pose[:3, :3]), rtol=0, atol=1e-14)
        np.testing.assert_array_equal(got[:, 3], pose[:, 3])
    other = np.linalg.inv(CAMERA.camera_from_vehicle)
    other[:3, :3] = other[:3, :3].round(digits)
    got = ipm_rs.Camera(K, image_size=SIZE, vehicle_from_camera=other, nearest_rotation=True).vehicle_from_camera
    np.testing.assert_allclose(got[:3, :3], nearest(other[:3, :3]), rtol=0, atol=1e-14)
    with refuses(errors.ArgumentTypeError, "nearest_rotation", "True or False"):
        CAMERA.with_pose(pose, nearest_rotation="yes")


@pytest.mark.parametrize(
    ("change", "words", "without"),
    [
        (lambda T: T @ np.diag([1, -1, 1, 1]), "left-handed", "nearest_rotation"),
        (lambda T: np.vstack([1000 * T[:3], T[3:]]), "a scale is mixed in: divide R by 1000", "nearest_rotation"),
        (lambda T: T.T, "transpose, .T", "nearest_rotation"),
        (lambda T: np.vstack([K @ T[:3], T[3:]]), "R and not K R", "nearest_rotation"),
    ],
)
def test_each_wrong_rotation_has_its_own_mend(change, words, without):
    pose = change(CAMERA.camera_from_vehicle)
    for options in ({}, {"nearest_rotation": True}):
        with pytest.raises(errors.CalibrationError, match=re.escape(words)) as caught:
            ipm_rs.Camera(K, image_size=SIZE, camera_from_vehicle=pose, **options)
        assert without not in str(caught.value)


# ---------------------------------------------------------------------------------------------------------------------
# Angles


@pytest.mark.parametrize("name", ["roll", "pitch", "yaw"])
@pytest.mark.parametrize("degrees", [-90, 7.5, 180, 359.0])
def test_degrees_are_refused_where_radians_are_meant(name, degrees):
    with refuses(errors.ArgumentError, name, "radians", f"np.radians({degrees:g})"):
        ipm_rs.Camera.from_euler(K, **POSE | {name: degrees})
    angles = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0} | {name: degrees}
    with refuses(errors.ArgumentError, name, "np.radians"):
        ipm_rs.rotation_from_euler(**angles)


def test_a_whole_turn_is_radians():
    for angle in (6.28, -6.28, 2 * np.pi, 6.2831853072):
        ipm_rs.Camera.from_euler(K, **POSE | {"yaw": angle})
    assert ipm_rs.flip_handedness_euler(10.0, 20.0, -90.0) == (10.0, -20.0, 90.0)  # of any unit


def test_other_angles_name_radians():
    options = {"image_size": SIZE, "focal_length": 880, "height": 1.4}
    with refuses(errors.ArgumentError, "roll", "np.radians(30)"):
        ipm_rs.Camera.from_vanishing_point((640, 300), roll=30, **options)
    with refuses(errors.CalibrationError, "max_angle", "np.radians"):
        ipm_rs.KannalaBrandt([0, 0, 0, 0], max_angle=95)
    with refuses(errors.ArgumentError, "radians"):
        ipm_rs.Plane.from_angles(slope=3.0)


# ---------------------------------------------------------------------------------------------------------------------
# Arguments that must be named


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: ipm_rs.BevGrid((6, 40), (-8, 8), 0.05), "BevGrid(x=(6, 40), y=(-8, 8), resolution=0.05)"),
        (lambda: ipm_rs.Camera(K, SIZE), "image_size="),
        (lambda: ipm_rs.Camera.from_euler(K, SIZE, (0, 0, 1.4)), "position="),
        (lambda: ipm_rs.Camera.from_vanishing_point((640, 300), SIZE, 880, 1.4), "focal_length="),
        (lambda: ipm_rs.Plane((0, 0, 1)), "normal="),
        (lambda: ipm_rs.Plane.from_angles(0.1), "slope="),
        (lambda: ipm_rs.HeightMap(np.zeros((3, 3)), (0, 0), 1.0), "origin="),
        (lambda: ipm_rs.Lut(CAMERA, GRID, -0.3), "ground="),
        (lambda: ipm_rs.Lut.from_maps(np.zeros((2, 2)), np.zeros((2, 2)), (4, 4)), "source_size="),
        (lambda: ipm_rs.Lut.from_homography(np.eye(3), (4, 4), (4, 4)), "source_size="),
        (lambda: ipm_rs.Lut.from_ground_points([], [], GRID, (4, 4)), "source_size="),
    ],
)
def test_arguments_by_position_are_told_their_names(call, words):
    with refuses(errors.ArgumentTypeError, "by name", words):
        call()


@pytest.mark.parametrize("missing", ["x", "y", "resolution"])
def test_a_missing_argument_is_named(missing):
    given = {"x": (6, 40), "y": (-8, 8), "resolution": 0.05}
    del given[missing]
    with refuses(errors.ArgumentTypeError, f"{missing}="):
        ipm_rs.BevGrid(**given)
