"""Cameras and points that are refused."""

from __future__ import annotations

import golden
import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors

SIZE = (2048, 1024)
NAN, INF = float("nan"), float("inf")


def changed(matrix: np.ndarray, *entries: tuple[tuple[int, int], float]) -> np.ndarray:
    matrix = matrix.copy()
    for place, value in entries:
        matrix[place] = value
    return matrix


@pytest.mark.parametrize(
    ("K", "named"),
    [
        (changed(golden.K, ((0, 0), NAN)), "nan"),
        (changed(golden.K, ((1, 2), INF)), "inf"),
        (changed(golden.K, ((0, 0), 0.0)), "0"),
        (changed(golden.K, ((1, 1), 0.0)), "0"),
        (changed(golden.K, ((0, 0), -1000.0)), "-1000"),
        (changed(golden.K, ((1, 1), -1000.0)), "-1000"),
        (changed(golden.K, ((2, 0), 1.0)), "transposed"),
        (changed(golden.K, ((2, 2), 2.0)), "[0, 0, 1]"),
        (changed(golden.K, ((1, 0), 3.0)), "3"),
        (np.zeros((3, 3)), "0"),
    ],
    ids=["nan", "inf", "fx 0", "fy 0", "fx < 0", "fy < 0", "last row", "scale", "lower", "zeros"],
)
def test_intrinsics_that_make_no_camera(K, named):
    with refuses(errors.CalibrationError, named):
        ipm_rs.Camera(K, image_size=SIZE)
    with refuses(errors.CalibrationError, named):
        ipm_rs.Camera.from_euler(K, image_size=SIZE, position=(0, 0, 1))


@pytest.mark.parametrize("shape", [(), (3,), (9,), (2, 3), (3, 4), (4, 4), (1, 3, 3), (0, 0)], ids=str)
def test_intrinsics_of_another_shape(shape):
    with refuses(errors.ArgumentError, "K: expected a 3x3 matrix", f"got shape {shape}"):
        ipm_rs.Camera(np.ones(shape), image_size=SIZE)


@pytest.mark.parametrize("K", [None, "K", object(), np.array([["a"] * 3] * 3)], ids=["None", "str", "object", "array"])
def test_intrinsics_that_are_not_numbers(K):
    with refuses(errors.ArgumentTypeError, "K: expected", "got"):
        ipm_rs.Camera(K, image_size=SIZE)


def test_complex_intrinsics_do_not_lose_their_imaginary_part():
    with refuses(errors.ArgumentTypeError, "K: expected", "complex"):
        ipm_rs.Camera(golden.K + 1j, image_size=SIZE)


@pytest.mark.parametrize("size", [(0, 10), (10, 0), (-1, 10), (0, 0)], ids=str)
def test_image_size_is_positive(size):
    with refuses(errors.ArgumentError, "image_size: expected", str(min(size))):
        ipm_rs.Camera(golden.K, image_size=size)


@pytest.mark.parametrize("size", [(10,), (10, 10, 3), "big", 10, None, (10.5, 10), ("a", 3), (NAN, 3)], ids=str)
def test_image_size_is_two_whole_numbers(size):
    with pytest.raises((errors.ArgumentError, errors.ArgumentTypeError), match=r"image_size: expected .*got"):
        ipm_rs.Camera(golden.K, image_size=size)


@pytest.mark.parametrize("size", [(2**31, 2**31), (2**40, 1), (10**30, 1)], ids=str)
def test_image_size_beyond_any_image(size):
    with pytest.raises((errors.ArgumentError, errors.ArgumentTypeError), match=r"image_size: expected .*got"):
        ipm_rs.Camera(golden.K, image_size=size)


def test_image_size_is_needed():
    with pytest.raises(TypeError, match="image_size"):
        ipm_rs.Camera(golden.K)


POSES = {
    "not a rotation": (changed(golden.RT, ((0, 0), 0.9)), "rotation"),
    "scaled by 1.001": (np.diag([1.001, 1.001, 1.001, 1.0]) @ golden.RT, "rotation"),
    "mirrored": (golden.RT @ np.diag([1.0, -1.0, 1.0, 1.0]), "left-handed"),
    "nan": (changed(golden.RT, ((0, 3), NAN)), "nan"),
    "nan in the rotation": (changed(golden.RT, ((0, 0), NAN)), "nan"),
    "inf": (changed(golden.RT, ((1, 3), INF)), "inf"),
    "last row": (changed(golden.RT, ((3, 0), 0.5)), "row"),
    "last row scale": (changed(golden.RT, ((3, 3), 2.0)), "row"),
    "transposed": (golden.RT.T, "row"),
    "zeros": (np.zeros((4, 4)), "got"),
}


@pytest.mark.parametrize("pose", POSES)
def test_poses_that_are_not_rigid(pose, seed_camera):
    matrix, named = POSES[pose]
    with refuses(errors.CalibrationError, "camera_from_vehicle", named):
        ipm_rs.Camera(golden.K, image_size=SIZE, camera_from_vehicle=matrix)
    with refuses(errors.CalibrationError, "vehicle_from_camera", named):
        ipm_rs.Camera(golden.K, image_size=SIZE, vehicle_from_camera=matrix)
    with refuses(errors.CalibrationError, named):
        seed_camera.with_pose(matrix)


def test_the_limit_of_a_rotation_is_1e_4():
    def stretched(by):
        return np.diag([by, 1.0, 1.0, 1.0]) @ golden.RT

    ipm_rs.Camera(golden.K, image_size=SIZE, camera_from_vehicle=stretched(1 + 0.45e-4))
    with refuses(errors.CalibrationError, "1e-4"):
        ipm_rs.Camera(golden.K, image_size=SIZE, camera_from_vehicle=stretched(1 + 0.6e-4))


@pytest.mark.parametrize("shape", [(3, 3), (3, 4), (16,), (1, 4, 4), (5, 5)], ids=str)
def test_pose_of_another_shape(shape, seed_camera):
    with refuses(errors.ArgumentError, "camera_from_vehicle: expected a 4x4 matrix", f"got shape {shape}"):
        ipm_rs.Camera(golden.K, image_size=SIZE, camera_from_vehicle=np.ones(shape))
    with refuses(errors.ArgumentError, "camera_from_vehicle: expected a 4x4 matrix", f"got shape {shape}"):
        seed_camera.with_pose(np.ones(shape))


def test_one_direction_of_the_pose_is_enough():
    with refuses(errors.CalibrationError, "camera_from_vehicle", "vehicle_from_camera", "both"):
        ipm_rs.Camera(golden.K, image_size=SIZE, camera_from_vehicle=golden.RT, vehicle_from_camera=golden.RT)


@pytest.mark.parametrize("name", ["roll", "pitch", "yaw"])
@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_angles_are_finite(name, value):
    with refuses(errors.CalibrationError, name, str(value)):
        ipm_rs.Camera.from_euler(golden.K, image_size=SIZE, position=(0, 0, 1), **{name: value})


@pytest.mark.parametrize("angles", [(NAN, 0, 0), (0, INF, 0), (0, 0, -INF)])
@pytest.mark.parametrize("function", [ipm_rs.rotation_from_euler, ipm_rs.flip_handedness_euler])
def test_free_functions_want_finite_angles(function, angles):
    with refuses(errors.CalibrationError, "expected finite", "got"):
        function(*angles)


@pytest.mark.parametrize("position", [(NAN, 0, 1), (0, INF, 1)])
def test_position_is_finite(position):
    with refuses(errors.CalibrationError, "position"):
        ipm_rs.Camera.from_euler(golden.K, image_size=SIZE, position=position)


@pytest.mark.parametrize("position", [(1, 2), (1, 2, 3, 4), 5.0, "abc", (1, 2, None), ()], ids=str)
def test_position_is_three_numbers(position):
    with pytest.raises((errors.ArgumentError, errors.ArgumentTypeError), match=r"position: expected .*got"):
        ipm_rs.Camera.from_euler(golden.K, image_size=SIZE, position=position)


@pytest.mark.parametrize("lens", ["fisheye", 3, [0.1, 0.2]], ids=str)
def test_a_lens_is_a_model_or_none(lens):
    with refuses(errors.ArgumentTypeError, "lens", "None", type(lens).__name__):
        ipm_rs.Camera(golden.K, image_size=SIZE, lens=lens)


@pytest.mark.parametrize("size", [(0, 5), (5, 0), (-3, 5)], ids=str)
def test_resized_to_nothing(seed_camera, size):
    with refuses(errors.ArgumentError, "expected", f"{min(size)}"):
        seed_camera.resized(*size)


@pytest.mark.parametrize("window", [(0, 0, 0, 5), (0, 0, 5, 0), (0, 0, -5, 5)], ids=str)
def test_cropped_to_nothing(seed_camera, window):
    with refuses(errors.ArgumentError, "expected", f"{min(window)}"):
        seed_camera.cropped(*window)


@pytest.mark.parametrize("window", [(2044, 0, 5, 5), (0, 1020, 5, 5), (2**32 - 1, 0, 5, 5)], ids=str)
def test_cropped_beyond_the_image(seed_camera, window):
    with refuses(errors.ArgumentError, "2048 x 1024", f"got x {window[0]}, y {window[1]}"):
        seed_camera.cropped(*window)


@pytest.mark.parametrize("window", [(-1, 0, 5, 5), (0, -1, 5, 5), (2**32, 0, 5, 5)], ids=str)
def test_cropped_from_no_pixel(seed_camera, window):
    with refuses(errors.ArgumentError, "expected a whole number", f"got {window[0] or window[1]}"):
        seed_camera.cropped(*window)


@pytest.mark.parametrize("bad", [1.5, "5", True], ids=repr)
def test_windows_and_sizes_are_whole_numbers(seed_camera, bad):
    with refuses(errors.ArgumentTypeError, "width: expected a whole number"):
        seed_camera.resized(bad, 5)
    with refuses(errors.ArgumentTypeError, "x: expected a whole number"):
        seed_camera.cropped(bad, 0, 5, 5)


@pytest.mark.parametrize("shape", [(), (3,), (5, 1), (5, 4), (2, 5, 3)], ids=str)
def test_points_of_another_shape(seed_camera, shape):
    with refuses(errors.ArgumentError, "(N, 3)", str(shape).strip("(),")):
        seed_camera.project(np.ones(shape))


@pytest.mark.parametrize("shape", [(), (2,), (5, 1), (5, 3), (2, 5, 2)], ids=str)
def test_pixels_of_another_shape(seed_camera, shape):
    with refuses(errors.ArgumentError, "(N, 2)", str(shape).strip("(),")):
        seed_camera.ground_from_pixels(np.ones(shape))


@pytest.mark.parametrize("points", [None, "abc", object(), np.array([["a", "b", "c"]])], ids=lambda p: type(p).__name__)
def test_points_that_are_not_numbers(seed_camera, points):
    with refuses(errors.ArgumentTypeError, "points"):
        seed_camera.project(points)
    with refuses(errors.ArgumentTypeError, "uv"):
        seed_camera.ground_from_pixels(points)


def test_complex_points_do_not_lose_their_imaginary_part(seed_camera):
    with refuses(errors.ArgumentTypeError, "complex"):
        seed_camera.project(golden.POINTS + 1j)


def test_height_is_given_once(seed_camera):
    with refuses(errors.ArgumentError, "ground", "(N, 2)"):
        seed_camera.project(golden.POINTS, ground=0.0)


@pytest.mark.parametrize("ground", [NAN, INF, -INF])
def test_ground_is_finite(seed_camera, seed_grid, ground):
    with refuses(errors.ArgumentError, "ground", str(ground)):
        seed_camera.project(golden.POINTS[:, :2], ground=ground)
    with refuses(errors.ArgumentError, "ground", str(ground)):
        seed_camera.ground_from_pixels(golden.UV, ground=ground)
    with refuses(errors.ArgumentError, "ground", str(ground)):
        ipm_rs.Lut(seed_camera, seed_grid, ground=ground)


@pytest.mark.parametrize("ground", ["0", [0.0], np.zeros(3)], ids=str)
def test_ground_is_a_number(seed_camera, seed_grid, ground):
    with refuses(errors.ArgumentTypeError, "ground"):
        seed_camera.project(golden.POINTS[:, :2], ground=ground)
    with refuses(errors.ArgumentTypeError, "ground"):
        ipm_rs.Lut(seed_camera, seed_grid, ground=ground)
