"""Left- and right-handed frames: CARLA's numbers, involution, and a real left-handed calibration."""

from __future__ import annotations

import golden
import numpy as np
import pytest
from helpers import refuses
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors, reference

angle = st.floats(-3.2, 3.2)
MODULES = pytest.mark.parametrize("module", [ipm_rs, reference], ids=["core", "reference"])
MIRROR = np.diag([1.0, -1.0, 1.0])


def carla_rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """CARLA's Transform.get_matrix(), written out: Rz(yaw) Ry(-pitch) Rx(-roll), radians."""
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    return np.array(
        [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr],
            [cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr],
            [sp, -cp * sr, cp * cr],
        ]
    )


@MODULES
def test_carla_example(module):
    flipped = module.flip_handedness_rotation(golden.CARLA_ROTATION)
    np.testing.assert_allclose(flipped, golden.FLU_ROTATION, rtol=0, atol=1e-15)
    angles = module.flip_handedness_euler(*golden.CARLA_ROLL_PITCH_YAW_DEG)
    assert isinstance(angles, tuple) and angles == golden.FLU_ROLL_PITCH_YAW_DEG
    rotation = module.rotation_from_euler(*np.radians(angles))
    np.testing.assert_allclose(rotation, golden.FLU_ROTATION, rtol=0, atol=1e-15)


def test_the_written_out_carla_matrix_is_the_golden_one():
    angles = np.radians(golden.CARLA_ROLL_PITCH_YAW_DEG)
    np.testing.assert_allclose(carla_rotation(*angles), golden.CARLA_ROTATION, rtol=0, atol=1e-15)


@given(angle, angle, angle)
def test_angles_and_matrices_agree(roll, pitch, yaw):
    left_handed = carla_rotation(roll, pitch, yaw)
    for module in (ipm_rs, reference):
        from_matrix = module.flip_handedness_rotation(left_handed)
        from_angles = module.rotation_from_euler(*module.flip_handedness_euler(roll, pitch, yaw))
        np.testing.assert_allclose(from_matrix, from_angles, rtol=0, atol=1e-14)
        np.testing.assert_allclose(from_matrix, MIRROR @ left_handed @ MIRROR, rtol=0, atol=1e-15)
        assert np.linalg.det(from_matrix) == pytest.approx(1.0)


@given(angle, angle, angle, st.integers(0, 2**32 - 1))
def test_conversion_is_its_own_inverse(roll, pitch, yaw, seed):
    points = np.random.default_rng(seed).uniform(-100, 100, (7, 3))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = carla_rotation(roll, pitch, yaw), points[0]
    for module in (ipm_rs, reference):
        np.testing.assert_array_equal(module.flip_handedness(module.flip_handedness(points)), points)
        np.testing.assert_array_equal(module.flip_handedness_pose(module.flip_handedness_pose(pose)), pose)
        rotation = pose[:3, :3]
        np.testing.assert_array_equal(
            module.flip_handedness_rotation(module.flip_handedness_rotation(rotation)), rotation
        )
        assert module.flip_handedness_euler(*module.flip_handedness_euler(roll, pitch, yaw)) == (roll, pitch, yaw)


@given(angle, angle, angle, st.integers(0, 2**32 - 1))
def test_a_point_may_be_mirrored_before_or_after_its_pose(roll, pitch, yaw, seed):
    """The law that fixes every sign: flip(T p) = flip(T) flip(p)."""
    random = np.random.default_rng(seed)
    points, shift = random.uniform(-10, 10, (5, 3)), random.uniform(-10, 10, 3)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = carla_rotation(roll, pitch, yaw), shift
    for module in (ipm_rs, reference):
        after = module.flip_handedness(points @ pose[:3, :3].T + shift)
        flipped = module.flip_handedness_pose(pose)
        before = module.flip_handedness(points) @ flipped[:3, :3].T + flipped[:3, 3]
        np.testing.assert_allclose(before, after, rtol=0, atol=1e-12)


@MODULES
def test_points(module):
    points = np.array([[1.0, 2.0, 3.0], [-4.0, -5.0, 6.0]])
    before = points.copy()
    flipped = module.flip_handedness(points)
    np.testing.assert_array_equal(flipped, [[1, -2, 3], [-4, 5, 6]])
    np.testing.assert_array_equal(points, before)
    assert flipped.dtype == np.float64
    assert module.flip_handedness(np.empty((0, 3))).shape == (0, 3)


@MODULES
def test_pose_keeps_its_last_row_and_moves_its_origin(module):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = golden.CARLA_ROTATION, (1.0, 2.0, 3.0)
    flipped = module.flip_handedness_pose(pose)
    np.testing.assert_allclose(flipped[:3, :3], golden.FLU_ROTATION, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(flipped[:3, 3], (1, -2, 3))
    np.testing.assert_array_equal(flipped[3], (0, 0, 0, 1))


# ---------------------------------------------------------------------------------------------------------------------
# Town04: a lane boundary of a left-handed world, and the image of its camera


@MODULES
def test_town04_boundary_lands_on_its_labels(shared_data, module):
    """`town04_trafo.txt` takes left-handed world points straight to right-handed optical axes, hence det = -1.

    Undoing the change of axes (camX = y, camY = -z, camZ = x for a left-handed frame) leaves a proper pose between
    two left-handed frames, which is what `flip_handedness_pose` converts.
    """
    image_labels = pytest.importorskip("PIL.Image").open(shared_data / "carla" / "town04_label.png")
    labels = np.asarray(image_labels)
    optical_from_world = np.loadtxt(shared_data / "carla" / "town04_trafo.txt")
    boundary = np.loadtxt(shared_data / "carla" / "town04_boundary.txt")
    assert labels.shape == (512, 1024) and set(np.unique(labels)) == {0, 1, 2}
    assert np.linalg.det(optical_from_world[:3, :3]) == pytest.approx(-1.0, abs=1e-6)

    optical_from_left_handed = np.array([[0, 1.0, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    pose = module.flip_handedness_pose(optical_from_left_handed.T @ optical_from_world)
    optical_from_flu = np.array([[0, -1.0, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    camera_from_world = optical_from_flu @ pose
    assert np.linalg.det(camera_from_world[:3, :3]) == pytest.approx(1.0, abs=1e-6)

    focal = 1024 / (2 * np.tan(np.radians(45) / 2))
    # CARLA counts pixels from the image's corner, we from the first pixel's centre
    K = np.array([[focal, 0, 1024 / 2 - 0.5], [0, focal, 512 / 2 - 0.5], [0, 0, 1]])
    for side, columns, in_view in ((1, slice(0, 3), 54), (2, slice(3, 6), 56)):
        points = module.flip_handedness(boundary[:, columns])
        if module is ipm_rs:
            camera = ipm_rs.Camera(K, image_size=(1024, 512), camera_from_vehicle=camera_from_world)
            uv, _, valid = camera.project(points)
        else:
            uv, _, valid = reference.project(points, K, camera_from_world, (1024, 512))
        assert valid.sum() == in_view
        column, row = np.round(uv[valid]).astype(int).T
        assert (labels[row, column] == side).all()
        # the test would see a forgotten mirror
        wrong = reference.project(boundary[:, columns], K, camera_from_world, (1024, 512))
        column, row = np.round(wrong[0][wrong[2]]).astype(int).T
        assert (labels[row, column] == side).sum() < in_view // 4


def test_a_left_handed_pose_is_refused_with_the_mend(shared_data):
    pose = np.loadtxt(shared_data / "carla" / "town04_trafo.txt")
    with refuses(errors.CalibrationError, "det", "-1", "left-handed", "diag(1, -1, 1, 1)"):
        ipm_rs.Camera(golden.K, image_size=(1024, 512), camera_from_vehicle=pose)


# ---------------------------------------------------------------------------------------------------------------------
# Refusals


@pytest.mark.parametrize("shape", [(), (3,), (5, 2), (5, 4), (2, 5, 3)], ids=str)
def test_points_of_another_shape(shape):
    with refuses(errors.ArgumentError, "points", "(N, 3)", str(shape).strip("(),")):
        ipm_rs.flip_handedness(np.ones(shape))


@pytest.mark.parametrize("shape", [(), (4,), (3, 3), (3, 4), (1, 4, 4)], ids=str)
def test_poses_of_another_shape(shape):
    with refuses(errors.ArgumentError, "expected a 4x4 matrix", f"got shape {shape}"):
        ipm_rs.flip_handedness_pose(np.ones(shape))


@pytest.mark.parametrize("shape", [(), (3,), (4, 4), (3, 4), (1, 3, 3)], ids=str)
def test_rotations_of_another_shape(shape):
    with refuses(errors.ArgumentError, "expected a 3x3 matrix", f"got shape {shape}"):
        ipm_rs.flip_handedness_rotation(np.ones(shape))


@pytest.mark.parametrize("value", [None, "x", object()], ids=lambda v: type(v).__name__)
def test_what_is_no_array(value):
    for function in (ipm_rs.flip_handedness, ipm_rs.flip_handedness_pose, ipm_rs.flip_handedness_rotation):
        with refuses(errors.ArgumentTypeError, "expected", "got"):
            function(value)
    with refuses(errors.ArgumentTypeError, "roll: expected a number"):
        ipm_rs.flip_handedness_euler(value, 0.0, 0.0)
