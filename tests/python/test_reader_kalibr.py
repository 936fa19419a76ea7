"""Kalibr camera chains: every lens, both directions of the IMU, the chain of poses, against formulas and OpenCV."""

from __future__ import annotations

import copy

import calibration_samples as samples
import cv2
import numpy as np
import pytest
from helpers import refuses
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import kalibr
from ipm_rs.calibration._yaml import parse_yaml

CHAIN = parse_yaml(samples.KALIBR_CHAIN.decode(), "chain")
CAM = CHAIN["cam0"]
NONE = {"distortion_model": "none", "distortion_coeffs": []}


def one(**changes) -> dict:
    """A chain of one camera; a change of None removes the key."""
    section = {**{key: value for key, value in CAM.items() if key != "T_cam_imu"}, **changes}
    return {"cam0": {key: value for key, value in section.items() if value is not None}}


def euler(position, roll=0.0, pitch=0.0, yaw=0.0) -> np.ndarray:
    """(4, 4) of FLU axes, from their attitude."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = ipm_rs.rotation_from_euler(roll, pitch, yaw), position
    return T


@pytest.mark.parametrize(
    ("changes", "lens"),
    [
        ({}, ipm_rs.BrownConrady(CAM["distortion_coeffs"])),
        ({"distortion_model": "none", "distortion_coeffs": []}, None),
        ({"distortion_model": "none", "distortion_coeffs": None}, "refused"),
        ({"distortion_coeffs": [0, 0, 0, 0]}, None),
        (
            {"distortion_model": "equidistant", "distortion_coeffs": [-0.0016, 0.024, -0.035, 0.0198]},
            ipm_rs.KannalaBrandt([-0.0016, 0.024, -0.035, 0.0198]),
        ),
        (
            {"camera_model": "omni", "intrinsics": [1.2, 900, 901, 380, 255]},
            ipm_rs.Mei(1.2, CAM["distortion_coeffs"]),
        ),
        (
            {"camera_model": "omni", "intrinsics": [0.9, 900, 901, 380, 255], **NONE},
            ipm_rs.Mei(0.9, [0, 0, 0, 0]),
        ),
        (
            {"camera_model": "ds", "intrinsics": [-0.2, 0.6, 317, 316, 380, 255], **NONE},
            ipm_rs.DoubleSphere(-0.2, 0.6),
        ),
        (
            {"camera_model": "eucm", "intrinsics": [0.6, 1.1, 317, 316, 380, 255], **NONE},
            ipm_rs.Eucm(0.6, 1.1),
        ),
    ],
)  # fmt: skip
def test_every_lens(changes, lens):
    content = one(**changes)
    if lens == "refused":
        with refuses(errors.CalibrationError, "cam0", "missing distortion_coeffs"):
            kalibr.read(content)
        return
    camera = ipm_rs.Camera.from_kalibr(content)
    assert camera.lens == lens and camera.image_size == (752, 480)
    fu, fv, pu, pv = content["cam0"]["intrinsics"][-4:]
    np.testing.assert_array_equal(camera.intrinsics, [[fu, 0, pu], [0, fv, pv], [0, 0, 1]])


def test_an_empty_value_is_an_empty_list():
    assert kalibr.read({"cam0": {**one()["cam0"], "distortion_model": "none", "distortion_coeffs": None}}).lens is None


def test_pixels_of_double_sphere():
    """The formula of the double sphere paper in NumPy, x right, y down, z forward."""
    camera = kalibr.read(CHAIN, camera="cam2")
    xi, alpha, fu, fv, pu, pv = CHAIN["cam2"]["intrinsics"]
    to_camera = camera.camera_from_vehicle
    points = np.array([[3.0, 1.0, -1.2], [2.0, -3.0, 0.4], [0.3, 2.0, -1.0], [10.0, 0.1, 0.2]])
    x, y, z = (points @ to_camera[:3, :3].T + to_camera[:3, 3]).T
    d1 = np.sqrt(x * x + y * y + z * z)
    k = xi * d1 + z
    scale = alpha * np.sqrt(x * x + y * y + k * k) + (1 - alpha) * k
    np.testing.assert_allclose(
        camera.project(points)[0], np.column_stack([fu * x / scale + pu, fv * y / scale + pv]), rtol=0, atol=1e-9
    )


def test_pixels_of_equidistant():
    values = [-0.0016509958435871643, 0.02437222940989351, -0.03582816956989852, 0.019860839087717054]
    camera = kalibr.read(one(distortion_model="equidistant", distortion_coeffs=values))
    points = np.array([[5.0, 1.0, -1.2], [2.0, -3.0, 0.4], [10.0, 0.1, 0.2]])
    optical = points @ camera.camera_from_vehicle[:3, :3].T
    expected = cv2.fisheye.projectPoints(
        optical[:, None], np.zeros(3), np.zeros(3), camera.intrinsics, np.array(values)
    )
    np.testing.assert_allclose(camera.project(points)[0], expected[0][:, 0], rtol=0, atol=1e-9)


# ---------------------------------------------------------------------------------------------------------------------
# Poses


def test_the_chain_goes_from_the_camera_before():
    first = kalibr.read(CHAIN, camera="cam0").camera_from_vehicle
    np.testing.assert_array_equal(first[:3, :3], [[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    second = np.array(CHAIN["cam1"]["T_cn_cnm1"]) @ first
    np.testing.assert_allclose(kalibr.read(CHAIN, camera=1).camera_from_vehicle, second, rtol=0, atol=1e-12)
    third = np.array(CHAIN["cam2"]["T_cn_cnm1"]) @ second
    np.testing.assert_allclose(kalibr.read(CHAIN, camera="cam2").camera_from_vehicle, third, rtol=0, atol=1e-12)
    # x of cam1 is -0.11 in cam0: the second camera stands 11 cm to the right of the first.
    assert kalibr.read(CHAIN, camera=1).position[1] == pytest.approx(-0.11, abs=1e-3)


def test_vehicle_from_cam0():
    mounted = ipm_rs.Camera.from_euler(np.eye(3), image_size=(1, 1), position=(1, 0.2, 1.4), pitch=0.1, yaw=0.3)
    camera = kalibr.read(CHAIN, camera=0, vehicle_from_cam0=mounted.vehicle_from_camera)
    np.testing.assert_allclose(camera.camera_from_vehicle, mounted.camera_from_vehicle, rtol=0, atol=1e-12)
    camera = kalibr.read(CHAIN, camera=1, vehicle_from_cam0=mounted.vehicle_from_camera)
    expected = np.array(CHAIN["cam1"]["T_cn_cnm1"]) @ mounted.camera_from_vehicle
    np.testing.assert_allclose(camera.camera_from_vehicle, expected, rtol=0, atol=1e-12)


def test_both_directions_of_the_imu():
    imu = euler((0.5, 0.1, 1.0), roll=0.1, pitch=-0.2, yaw=1.4)
    camera = kalibr.read(CHAIN, camera=0, vehicle_from_imu=imu)
    expected = np.array(CAM["T_cam_imu"]) @ np.linalg.inv(imu)
    np.testing.assert_allclose(camera.camera_from_vehicle, expected, rtol=0, atol=1e-12)
    openvins = one(T_imu_cam=np.linalg.inv(CAM["T_cam_imu"]).tolist())
    np.testing.assert_allclose(
        kalibr.read(openvins, vehicle_from_imu=imu).camera_from_vehicle, expected, rtol=0, atol=1e-9
    )


def test_through_the_imu_where_there_is_no_chain():
    second = np.array(CHAIN["cam1"]["T_cn_cnm1"]) @ CAM["T_cam_imu"]
    content = {"cam0": CAM, "cam1": {**one()["cam0"], "T_cam_imu": second.tolist()}}
    np.testing.assert_allclose(
        kalibr.read(content, camera=1).camera_from_vehicle,
        kalibr.read(CHAIN, camera=1).camera_from_vehicle,
        rtol=0,
        atol=1e-6,  # the printed T_cam_imu is a rotation to 1e-8
    )


def test_old_name_and_openvins_header(tmp_path):
    old = samples.KALIBR_CHAIN.replace(b"T_cn_cnm1", b"baseline_last_to_this_cam")
    path = tmp_path / "chain.yaml"
    path.write_bytes(b"%YAML:1.0\n---\n" + old)
    for camera in range(3):
        assert kalibr.read(path, camera=camera) == kalibr.read(CHAIN, camera=camera)


# ---------------------------------------------------------------------------------------------------------------------
# Mistakes


def test_which_camera():
    with refuses(errors.ArgumentError, "camera: expected one of 'cam0', 'cam1', 'cam2'", "None"):
        kalibr.read(CHAIN)
    for wrong in ("cam7", 3, True, "1", [], np.zeros(2)):
        with refuses(errors.ArgumentError, "camera: expected one of", "cam0"):
            kalibr.read(CHAIN, camera=wrong)


@pytest.mark.parametrize(
    ("changes", "phrases"),
    [
        ({"camera_model": "kb4"}, ["cam0.camera_model", "'pinhole'", "'kb4'"]),
        ({"camera_model": None, "resolution": None}, ["missing camera_model; resolution"]),
        ({"distortion_model": "fov", "distortion_coeffs": [0.9, 0.1]}, ["cam0.distortion_coeffs", "got 2"]),
        ({"distortion_model": "fov", "distortion_coeffs": [3.9]}, ["cam0", "omega", "below pi"]),
        ({"distortion_model": "equi"}, ["'equidistant'", "'equi'"]),
        (
            {"camera_model": "omni", "intrinsics": [1, 2, 3, 4, 5], "distortion_model": "equidistant"},
            ["distortion_model"],
        ),
        ({"camera_model": "ds", "intrinsics": [1, 2, 3, 4]}, ["cam0.intrinsics", "6 numbers", "got 4"]),
        ({"intrinsics": [458.0, 457.0, 367.0]}, ["cam0.intrinsics", "4 numbers", "got 3"]),
        ({"intrinsics": [458.0, float("inf"), 367.0, 248.0]}, ["cam0.intrinsics[1]", "inf"]),
        ({"intrinsics": [0.0, 457.0, 367.0, 248.0]}, ["cam0", "is the camera calibrated?"]),
        (
            {"camera_model": "ds", "intrinsics": [3, 0.5, 1, 1, 0, 0], "distortion_model": "none"},
            ["cam0.distortion_coeffs", "0 numbers, got 4"],
        ),
        (
            {**NONE, "camera_model": "ds", "intrinsics": [3, 0.5, 1, 1, 0, 0]},
            ["cam0: DoubleSphere: xi: expected", "got 3; correct it"],
        ),
        ({"distortion_coeffs": [0.1] * 5}, ["cam0.distortion_coeffs", "4 numbers", "got 5"]),
        ({"resolution": [752.5, 480]}, ["cam0.resolution", "752.5"]),
        ({"resolution": [752]}, ["cam0.resolution", "2 numbers"]),
        ({"resolution": "752x480"}, ["cam0.resolution", "list of 2 numbers"]),
    ],
)
def test_what_is_refused(changes, phrases):
    with refuses(errors.CalibrationError, "Kalibr camchain calibration: ", *phrases):
        kalibr.read(one(**changes))


def test_poses_that_are_refused():
    for change, phrases in [
        (np.zeros((4, 4)).tolist(), ["rotation"]),
        (np.diag([1.0, 1.0, -1.0, 1.0]).tolist(), ["reflection"]),
        (np.eye(4)[:2].tolist(), ["3x4"]),
        ([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [1, 2, 3, 1]], ["last row", "transposed"]),
        (None, ["object", "expected"]),
    ]:
        content = copy.deepcopy(CHAIN)
        content["cam1"]["T_cn_cnm1"] = change
        with (
            refuses(errors.CalibrationError, "cam1.T_cn_cnm1", *phrases[:1])
            if change is not None
            else refuses(errors.CalibrationError, "cam1.T_cn_cnm1")
        ):
            kalibr.read(content, camera="cam1")
    content = copy.deepcopy(CHAIN)
    del content["cam1"]["T_cn_cnm1"]
    with refuses(errors.CalibrationError, "cam1", "T_cn_cnm1", "T_cam_imu"):
        kalibr.read(content, camera="cam1")
    content["cam1"]["T_imu_cam"] = content["cam1"]["T_cam_imu"] = CAM["T_cam_imu"]
    with refuses(errors.CalibrationError, "cam1", "got both"):
        kalibr.read(content, camera="cam1")
    with refuses(errors.CalibrationError, "cam0", "T_cam_imu", "vehicle_from_cam0="):
        kalibr.read(one(), vehicle_from_imu=np.eye(4))
    with refuses(errors.ArgumentError, "got both"):
        kalibr.read(CHAIN, camera=0, vehicle_from_imu=np.eye(4), vehicle_from_cam0=np.eye(4))
    with refuses(errors.CalibrationError, "vehicle_from_cam0", "rotation"):
        kalibr.read(CHAIN, camera=0, vehicle_from_cam0=np.zeros((4, 4)))


def test_files_of_others(tmp_path):
    path = tmp_path / "calibration.json"
    path.write_text('{"value0": {"T_imu_cam": [], "intrinsics": []}}')
    with refuses(errors.CalibrationError, str(path), "basalt"):
        kalibr.read(path)
    path.write_text("camera: 1\n")
    with refuses(errors.CalibrationError, str(path), "cam0"):
        kalibr.read(path)


leaves = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4) | st.just(10**400)
values = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=3), inner), max_leaves=8
)


@given(
    key=st.sampled_from([*CHAIN["cam1"], "T_cam_imu", "T_imu_cam"]),
    value=values,
    model=st.sampled_from(["pinhole", "omni", "ds", "eucm"]),
)
def test_any_value_of_any_key(key, value, model):
    content = copy.deepcopy(CHAIN)
    content["cam1"]["camera_model"] = model
    content["cam1"][key] = value
    try:
        kalibr.read(content, camera="cam1")
    except errors.IpmError as error:
        assert len(str(error)) < 2000


@pytest.mark.filterwarnings("ignore::ipm_rs.CalibrationWarning")  # any numbers make odd cameras
@given(numbers=st.lists(st.floats(-10, 1000), min_size=6, max_size=6), model=st.sampled_from(["omni", "ds", "eucm"]))
def test_any_intrinsics(numbers, model):
    count = 5 if model == "omni" else 6
    changes = {
        "camera_model": model,
        "intrinsics": numbers[:count],
        "distortion_model": "none",
        "distortion_coeffs": [],
    }
    try:
        kalibr.read(one(**changes))
    except errors.CalibrationError as error:
        assert "cam0" in str(error)
