"""Numbers confirmed elsewhere, to 1e-9, for the core and for the reference; and each classic mistake, caught."""

from __future__ import annotations

import golden
import numpy as np
import pytest

import ipm_rs
from ipm_rs import reference


def core_pose(position, roll, pitch, yaw):
    camera = ipm_rs.Camera.from_euler(
        golden.K, image_size=golden.IMAGE_SIZE, position=position, roll=roll, pitch=pitch, yaw=yaw
    )
    return camera.camera_from_vehicle


def core_project(points, pose):
    return ipm_rs.Camera(golden.K, image_size=golden.IMAGE_SIZE, camera_from_vehicle=pose).project(points)


def reference_project(points, pose):
    return reference.project(points, golden.K, pose, golden.IMAGE_SIZE)


@pytest.fixture(params=["core", "reference"])
def pose_of(request):
    return {"core": core_pose, "reference": reference.camera_from_euler}[request.param]


@pytest.fixture(params=["core", "reference"])
def project(request):
    return {"core": core_project, "reference": reference_project}[request.param]


def close(ours, theirs, tolerance=1e-9):
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance)


def test_seed_pose(pose_of):
    close(pose_of(golden.POSITION, golden.ROLL, golden.PITCH, golden.YAW), golden.RT)


def test_seed_intrinsics(seed_camera):
    close(seed_camera.intrinsics, golden.K)
    close(reference.intrinsic_matrix(golden.FX, golden.FY, golden.U0, golden.V0), golden.K)


def test_seed_pixels(project):
    uv, depth, valid = project(golden.POINTS, golden.RT)
    close(uv, golden.UV)
    close(depth, golden.DEPTH)
    np.testing.assert_array_equal(valid, golden.VALID)


def test_seed_camera_file_end_to_end(seed_camera):
    uv, depth, valid = seed_camera.project(golden.POINTS)
    close(seed_camera.camera_from_vehicle, golden.RT)
    close(seed_camera.position, golden.POSITION)
    close(uv, golden.UV)
    close(depth, golden.DEPTH)
    np.testing.assert_array_equal(valid, golden.VALID)


def test_order_pin_pose(pose_of):
    close(
        pose_of(golden.POSITION, golden.ORDER_ROLL, golden.ORDER_PITCH, golden.ORDER_YAW),
        golden.ORDER_RT,
    )


def test_order_pin_pixels(project):
    uv, depth, valid = project(golden.ORDER_POINTS, golden.ORDER_RT)
    close(uv, golden.ORDER_UV)
    assert (depth > 0).all() and valid.all()


def test_sample_points(project):
    """The documents' 26 points: off-image ones are invalid and keep their exact pixel."""
    assert golden.SAMPLE_POINTS.shape == (26, 3)
    uv, depth, valid = project(golden.SAMPLE_POINTS, golden.RT)
    homogeneous = golden.SAMPLE_POINTS[:, :2] @ golden.GROUND_HOMOGRAPHY[:, :2].T + golden.GROUND_HOMOGRAPHY[:, 2]
    close(uv, homogeneous[:, :2] / homogeneous[:, 2:], 1e-7)
    close(depth, homogeneous[:, 2], 1e-9)
    off_image = [tuple(point[:2]) for point in golden.SAMPLE_POINTS[~valid]]
    assert sorted(off_image) == sorted(golden.SAMPLE_OFF_IMAGE)
    for point, pixel in zip(golden.POINTS, golden.UV, strict=True):
        row = np.flatnonzero((golden.SAMPLE_POINTS == point).all(axis=1))
        assert len(row) == 1, point
        close(uv[row[0]], pixel)
    close(uv[(golden.SAMPLE_POINTS == (6, 0, 0)).all(axis=1)], [[1070.895, 1057.109]], 1e-3)


def test_points_behind_the_camera_have_no_pixel(project):
    behind = golden.SAMPLE_POINTS * [-1, 1, 1]
    uv, depth, valid = project(behind, golden.RT)
    assert np.isnan(uv).all()
    assert (depth < 0).all()
    assert not valid.any()


def test_vanishing_point(project):
    uv, _, valid = project([[1e9, 0.0, 0.0]], golden.RT)
    close(uv[0], golden.VANISHING_POINT, 1e-4)
    assert valid.all()


def test_optical_axis_meets_the_road(seed_camera):
    meets = seed_camera.ground_from_pixels(np.array([[golden.U0, golden.V0]]))
    close(meets[0], [*golden.AXIS_MEETS_ROAD, 0.0], 1e-3)
    close(reference.ground_from_pixels([[golden.U0, golden.V0]], golden.K, golden.RT), meets)


# ---------------------------------------------------------------------------------------------------------------------
# Mutation table: what each mistake costs in pixels, at (10, 0) and at (50, +-10). If a mistake were as good as no
# mistake at these points, the tests above would be blind to it.

FLU_TO_OPTICAL = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def about(axis: int, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[i, i], rotation[i, j], rotation[j, i], rotation[j, j] = c, -s, s, c
    return rotation


def pixels(attitude, centre, points, translation=None, axes=FLU_TO_OPTICAL):
    """Written out once more, so that one piece at a time can be wrong."""
    translation = -attitude @ centre if translation is None else translation
    projected = (points @ attitude.T + translation) @ axes.T @ golden.K.T
    return projected[:, :2] / projected[:, 2:]


C = np.array(golden.POSITION)
TURNED = about(2, golden.YAW) @ about(1, golden.PITCH) @ about(0, golden.ROLL)
MISTAKES = {
    "rotation not transposed": (177, 173, lambda p: pixels(TURNED, C, p)),
    "pitch sign": (177, 173, lambda p: pixels((about(2, golden.YAW) @ about(1, -golden.PITCH)).T, C, p)),
    "yaw sign": (44, 46, lambda p: pixels((about(2, -golden.YAW) @ about(1, golden.PITCH)).T, C, p)),
    "t = -C, not rotated": (16, 3, lambda p: pixels(TURNED.T, C, p, translation=-C)),
    "sign of the lateral offset": (14, 2.5, lambda p: pixels(TURNED.T, C * [1, -1, 1], p)),
    "Ry Rz for Rz Ry": (0.107, 0.18, lambda p: pixels((about(1, golden.PITCH) @ about(2, golden.YAW)).T, C, p)),
    "mirrored u": (30, 981, lambda p: pixels(TURNED.T, C, p, axes=np.diag([-1.0, 1.0, 1.0]) @ FLU_TO_OPTICAL)),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_would_be_seen(mistake, seed_camera):
    at_10, at_50, mutant = MISTAKES[mistake]
    near, far = golden.POINTS[:1], golden.POINTS[4:6]
    close(seed_camera.project(near)[0], golden.UV[:1])
    close(seed_camera.project(far)[0], golden.UV[4:6])
    cost_near = np.abs(mutant(near) - seed_camera.project(near)[0]).max()
    cost_far = np.abs(mutant(far) - seed_camera.project(far)[0]).max()
    assert cost_near == pytest.approx(at_10, rel=0.03)
    assert cost_far == pytest.approx(at_50, rel=0.03)


def test_without_a_mistake_the_written_out_formula_is_ours(seed_camera):
    close(pixels(TURNED.T, C, golden.POINTS), seed_camera.project(golden.POINTS)[0])


def test_mirrored_u_one_lane_to_the_side(seed_camera):
    point = golden.POINTS[1:2]
    mutant = MISTAKES["mirrored u"][2](point)
    assert np.abs(mutant - seed_camera.project(point)[0]).max() == pytest.approx(1664, rel=0.01)


ROLL, PITCH, YAW = about(0, golden.ORDER_ROLL), about(1, golden.ORDER_PITCH), about(2, golden.ORDER_YAW)
OTHER_ORDERS = {
    "Rz Rx Ry": YAW @ ROLL @ PITCH,
    "Ry Rz Rx": PITCH @ YAW @ ROLL,
    "Ry Rx Rz": PITCH @ ROLL @ YAW,
    "Rx Rz Ry": ROLL @ YAW @ PITCH,
    "Rx Ry Rz": ROLL @ PITCH @ YAW,
    "roll sign": YAW @ PITCH @ ROLL.T,
}


@pytest.mark.parametrize("order", OTHER_ORDERS)
def test_every_other_euler_order_would_be_seen(order):
    """With roll 0, as in the seed camera, half of the orders coincide; these three angles tell all six apart."""
    wrong = pixels(OTHER_ORDERS[order].T, C, golden.ORDER_POINTS)
    assert np.abs(wrong - golden.ORDER_UV).max() > 10
    camera = ipm_rs.Camera.from_euler(
        golden.K,
        image_size=golden.IMAGE_SIZE,
        position=golden.POSITION,
        roll=golden.ORDER_ROLL,
        pitch=golden.ORDER_PITCH,
        yaw=golden.ORDER_YAW,
    )
    close(camera.project(golden.ORDER_POINTS)[0], golden.ORDER_UV)


@pytest.mark.parametrize("rotation_from_euler", [ipm_rs.rotation_from_euler, reference.rotation_from_euler])
def test_rotation_from_euler(rotation_from_euler):
    angles = golden.ORDER_ROLL, golden.ORDER_PITCH, golden.ORDER_YAW
    close(rotation_from_euler(*angles), YAW @ PITCH @ ROLL, 1e-15)
    close(FLU_TO_OPTICAL @ rotation_from_euler(*angles).T, golden.ORDER_RT[:3, :3])


@pytest.mark.parametrize(
    ("angles", "direction", "meaning"),
    [
        ({"pitch": 0.1}, (np.cos(0.1), 0, -np.sin(0.1)), "positive pitch looks down"),
        ({"yaw": 0.1}, (np.cos(0.1), np.sin(0.1), 0), "positive yaw turns left"),
        ({"roll": 0.1}, (1, 0, 0), "roll turns about the axis itself"),
    ],
)
def test_signs(pose_of, angles, direction, meaning):
    pose = pose_of((0.0, 0.0, 0.0), angles.get("roll", 0.0), angles.get("pitch", 0.0), angles.get("yaw", 0.0))
    close(pose[2, :3], direction, 1e-15)  # the optical axis in vehicle axes: third row of the rotation
    if "roll" in angles:
        assert pose[0, 2] < 0, "positive roll lifts the left side: the camera's right points down"
