"""CARLA: left- and right-handed transforms, the field of view, half a pixel, the ROS bridge's files."""

from __future__ import annotations

import math

import calibration_datasets as samples
import golden
import numpy as np
import pytest
from calibration_samples import SAMPLES
from helpers import refuses

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import carla

SIZE = (800, 600)


def get_matrix(x=0.0, y=0.0, z=0.0, roll=0.0, pitch=0.0, yaw=0.0) -> np.ndarray:
    """What carla.Transform.get_matrix() returns: row-major, column vectors, left-handed."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(math.radians(a)), math.sin(math.radians(a))) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr, x],
            [cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr, y],
            [sp, -cp * sr, cp * cr, z],
            [0, 0, 0, 1],
        ]
    )


class Transform:
    """Stands for carla.Transform."""

    def __init__(self, **numbers):
        self.numbers = numbers

    def get_matrix(self):
        return get_matrix(**self.numbers).tolist()


POSE = {"x": 1.5, "y": 0.25, "z": 2.4, "roll": 4.0, "pitch": -15.0, "yaw": 7.0}


def test_matrix_of_the_documents():
    roll, pitch, yaw = golden.CARLA_ROLL_PITCH_YAW_DEG
    np.testing.assert_allclose(get_matrix(roll=roll, pitch=pitch, yaw=yaw)[:3, :3], golden.CARLA_ROTATION, atol=1e-15)
    camera = carla.read(image_size=SIZE, fov=90, transform={"roll": roll, "pitch": pitch, "yaw": yaw})
    R = camera.vehicle_from_camera[:3, :3] @ samples.OPTICAL_FROM_FLU
    np.testing.assert_allclose(R, golden.FLU_ROTATION, rtol=0, atol=1e-15)
    roll, pitch, yaw = golden.FLU_ROLL_PITCH_YAW_DEG
    angles = {"roll": roll, "pitch": pitch, "yaw": yaw}
    assert carla.read(image_size=SIZE, fov=90, transform=angles, handedness="right") == camera


@pytest.mark.parametrize(
    "transform",
    [
        POSE,
        {"location": {k: POSE[k] for k in "xyz"}, "rotation": {k: POSE[k] for k in ("pitch", "yaw", "roll")}},
        {"location": [1.5, 0.25, 2.4], "rotation": {"pitch": -15, "yaw": 7, "roll": 4}},
        get_matrix(**POSE),
        get_matrix(**POSE).tolist(),
        Transform(**POSE),
    ],
    ids=["flat", "nested", "list", "array", "rows", "carla.Transform"],
)
def test_projection_is_carlas_own(transform):
    """K [y, -z, x] of the left-handed local point, less half a pixel."""
    camera = ipm_rs.Camera.from_carla(image_size=SIZE, fov=90.0, transform=transform)
    points = np.random.default_rng(7).uniform((4, -6, 0), (40, 6, 3), (400, 3))  # x forward, y right, z up
    local = (np.column_stack([points, np.ones(400)]) @ np.linalg.inv(get_matrix(**POSE)).T)[:, :3]
    uv = 400 * np.column_stack([local[:, 1], -local[:, 2]]) / local[:, :1] + (400, 300)
    got, depth, _ = camera.project(points * (1, -1, 1))
    np.testing.assert_allclose(got, uv - 0.5, rtol=0, atol=1e-9)
    np.testing.assert_allclose(depth, local[:, 0], rtol=0, atol=1e-12)


def test_signs():
    def look(**angles):
        return carla.read(image_size=SIZE, fov=90, transform=angles).vehicle_from_camera[:3, 2]

    assert look(pitch=10)[2] > 0, "nose up"
    assert look(yaw=10)[1] < 0, "nose right"
    left_side = carla.read(image_size=SIZE, fov=90, transform={"roll": 10}).vehicle_from_camera[:3, 0]
    assert left_side[2] < 0, "right side down"
    ros = carla.read(image_size=SIZE, fov=90, transform={"pitch": 10}, handedness="right")
    assert ros.vehicle_from_camera[2, 2] < 0, "the ROS bridge's pitch looks down"


@pytest.mark.parametrize(
    ("size", "fov", "focal"), [((800, 600), 90, 400), ((1920, 1080), 100, 805.535645930), ((960, 540), 90.0, 480)]
)
def test_intrinsics(size, fov, focal):
    K = carla.read(image_size=size, fov=fov).intrinsics
    np.testing.assert_allclose(K[[0, 1], [0, 1]], focal, rtol=0, atol=5e-10)
    np.testing.assert_array_equal(K[:2, 2], ((size[0] - 1) / 2, (size[1] - 1) / 2))
    np.testing.assert_array_equal(carla.intrinsics(size, fov), K)


def test_without_transform_it_looks_along_x():
    assert carla.read(image_size=SIZE, fov=90) == ipm_rs.Camera(carla.intrinsics(SIZE, 90), image_size=SIZE)


def test_attributes_of_a_sensor(tmp_path):
    camera = ipm_rs.Camera.load(SAMPLES["carla"].write(tmp_path))
    assert camera == carla.read(image_size=(960, 540), fov=90, transform=POSE)
    attributes = {key: value for key, value in samples.CARLA.items() if key != "transform"}
    assert carla.read(attributes, transform=Transform(**POSE)).image_size == (960, 540)


def test_ros_bridge(tmp_path):
    camera = ipm_rs.Camera.load(SAMPLES["carla ros bridge"].write(tmp_path))
    pose = {"x": -4.5, "z": 2.8, "pitch": 20.0}
    assert camera == carla.read(image_size=SIZE, fov=90, transform=pose, handedness="right")
    assert camera == carla.read(samples.ROS_BRIDGE, camera="rgb_view")
    assert camera.vehicle_from_camera[2, 2] < 0, "it looks down"
    with refuses(errors.ArgumentError, "camera", "got 'front'", "'rgb_view'"):
        carla.read(samples.ROS_BRIDGE, camera="front")
    vehicle = samples.ROS_BRIDGE["objects"][1]
    twice = {"objects": [{**vehicle, "sensors": [*vehicle["sensors"], {**vehicle["sensors"][1], "id": "rear"}]}]}
    with refuses(errors.ArgumentError, "got none", "'rgb_view', 'rear'"):
        carla.read(twice)
    assert carla.read(twice, camera="rear") == camera


def transform_of(**change):
    return {**samples.CARLA, "transform": {**POSE, **change}}


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ({**samples.CARLA, "fov": "wide"}, "fov: expected a finite, positive number, got str 'wide'"),
        ({**samples.CARLA, "fov": 180}, "fov: expected less than 180 degrees"),
        ({**samples.CARLA, "fov": 0}, "fov: expected a finite, positive number"),
        ({**samples.CARLA, "fov": None}, "fov: expected a finite, positive number, got None"),
        ({**samples.CARLA, "image_size_x": "0"}, "image_size_x: expected a whole number"),
        ({**samples.CARLA, "image_size_x": "1e999"}, "image_size_x: expected a finite number, got inf"),
        ({"image_size_x": 3, "fov": 90}, "missing image_size_y"),
        ({"image_size_x": 3, "image_size_y": 3}, "missing fov"),
        ({"fov": 90}, "image_size"),
        (transform_of(roll=math.nan), "transform.roll: expected a finite number, got nan"),
        (transform_of(ptich=3), "transform: expected the keys x, y, z, roll, pitch, yaw, got str 'ptich'"),
        (transform_of(location={"x": 1}), "expected 'x' once"),
        (transform_of(rotation=[1, 2, 3]), "transform.rotation: expected an object"),
        ({**samples.CARLA, "transform": {"location": [1, 2]}}, "transform.location: expected 3 numbers, got 2"),
        ({**samples.CARLA, "transform": np.diag([1, -1, 1, 1])}, "transform[:3, :3]: expected a rotation, det R = +1"),
        ({**samples.CARLA, "transform": 3}, "transform: expected a 3x4 matrix, got int 3"),
        ({**samples.CARLA, "handedness": "up"}, "handedness: expected one of 'left', 'right'"),
        ({**samples.CARLA, "spawn_point": {}}, "expected transform or spawn_point, got both"),
        ({"objects": []}, "none"),
    ],
)
def test_refused(content, named):
    error = errors.ArgumentError if "objects" in content else errors.CalibrationError
    with refuses(error, "CARLA calibration", named):
        carla.read(content)


def test_given_twice_or_not_at_all():
    with refuses(errors.ArgumentError, "fov: expected none", "drop one"):
        carla.read(samples.CARLA, fov=90)
    with refuses(errors.ArgumentError, "transform: expected none", "drop one"):
        carla.read(samples.CARLA, transform=POSE)
    with refuses(errors.CalibrationError, "image_size", "expected"):
        carla.read(samples.CARLA, image_size=(1, 2))
    with refuses(errors.CalibrationError, "CARLA camera", "missing fov"):
        carla.read(image_size=SIZE)
    with refuses(errors.CalibrationError, "CARLA camera", "image_size"):
        carla.read(fov=90)
    with refuses(errors.CalibrationError, "fov", "got str '90'"):
        carla.read(image_size=SIZE, fov="90")
    with refuses(errors.ArgumentError, "handedness", "'up'"):
        carla.read(image_size=SIZE, fov=90, handedness="up")
    for size in (3, "ab", (1,), (0, 5), (1.5, 2), None):
        with pytest.raises(errors.IpmError):
            carla.read(image_size=size, fov=90)
