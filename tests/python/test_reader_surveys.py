"""ONCE, ZOD, OpenLane, PandaSet, A2D2, Cam2BEV, Autoware.AI and SensorsCalibration against an independent reading."""

from __future__ import annotations

import json

import numpy as np
import pytest
from calibration_fleets import (
    A2D2,
    AUTOWARE,
    CAM2BEV,
    ONCE,
    OPENLANE,
    OPENLANE_V2,
    PANDASET,
    PJLAB,
    PJLAB_EXTRINSIC,
    ZOD,
)
from calibration_samples import SAMPLES
from helpers import refuses

import ipm_rs
from ipm_rs import BrownConrady, Camera, KannalaBrandt, errors

POINTS = np.array([[14.0, 2.0, -1.1], [9.0, -1.0, -1.3], [32.0, 3.5, 0.4]])  # x forward, y left, z up
DOWN = np.array([[0, -0.28, 0.96], [-1, 0, 0], [0, -0.96, -0.28]])  # of a camera that looks ahead and down


def copy(content):
    return json.loads(json.dumps(content))


def placed(R: object, *t: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T


def brown(xyz, K, terms):
    """OpenCV's formula by hand; (N, 3) camera axes to pixels."""
    k1, k2, p1, p2, k3 = terms
    x, y = xyz[:, 0] / xyz[:, 2], xyz[:, 1] / xyz[:, 2]
    r2 = x * x + y * y
    L = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * L + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    yd = y * L + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.column_stack([K[0][0] * xd + K[0][2], K[1][1] * yd + K[1][2]])


def pixels(camera, points=POINTS):
    uv, _, _ = camera.project(points)
    assert np.isfinite(uv).all()
    return uv


def test_once_through_the_lidar(tmp_path):
    """As the kit projects, points of the lidar, whose x is left and y back."""
    path = SAMPLES["once"].write(tmp_path)
    entry = ONCE["calib"]["cam01"]
    lidar = np.column_stack([POINTS[:, 1], -POINTS[:, 0], POINTS[:, 2], np.ones(3)])
    seen = (np.linalg.inv(entry["cam_to_velo"]) @ lidar.T).T[:, :3]
    expected = brown(seen, entry["cam_intrinsic"], entry["distortion"])
    camera = Camera.load(path, camera="cam01", image_size=(1920, 1020))
    np.testing.assert_allclose(pixels(camera), expected, rtol=0, atol=1e-9)
    undistorted = Camera.from_once(ONCE["calib"], camera="cam01", image_size=(1920, 1020), image="undistorted")
    assert undistorted.lens is None
    np.testing.assert_array_equal(undistorted.intrinsics, entry["cam_intrinsic"])
    np.testing.assert_allclose(undistorted.position, [0.45, 0.02, -0.3], rtol=0, atol=1e-12)
    assert list(Camera.load_all(path, image_size=(1920, 1020))) == ["cam01", "cam05"]


def test_zod_by_its_kit(tmp_path):
    camera = Camera.load(SAMPLES["zod"].write(tmp_path))
    entry = ZOD["FC"]
    seen = (np.linalg.inv(entry["extrinsics"]) @ np.column_stack([POINTS, np.ones(3)]).T).T
    flat = np.linalg.norm(seen[:, :2], axis=1)
    angle = np.arctan2(flat, seen[:, 2])
    bent = angle * np.polyval([*entry["distortion"][::-1], 1.0], angle**2)
    K = np.array(entry["intrinsics"])
    expected = np.column_stack([K[i, i] * bent * seen[:, i] / flat + K[i, 2] for i in range(2)])
    np.testing.assert_allclose(pixels(camera), expected, rtol=0, atol=1e-9)
    assert camera == Camera.from_zod(entry) and camera.image_size == (3848, 2168)
    np.testing.assert_allclose(camera.vehicle_from_camera, placed(DOWN, 1.975, 0.0088, 1.147), rtol=0, atol=1e-9)
    with refuses(errors.CalibrationError, "FC.xi", "its model is not documented"):
        Camera.from_zod({"FC": {**entry, "xi": 1.2}})


def test_openlane_is_in_waymos_axes(tmp_path):
    camera = Camera.load(SAMPLES["openlane"].write(tmp_path), image_size=(1920, 1280))
    forward = (np.linalg.inv(OPENLANE["extrinsic"]) @ np.column_stack([POINTS, np.ones(3)]).T).T
    x, y, z = forward[:, :3].T  # of the camera: forward, left, up
    expected = np.column_stack([935.125 - 2059.05 * y / x, 635.05 - 2059.05 * z / x])
    np.testing.assert_allclose(pixels(camera), expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(camera.position, [1.54, -0.023, 2.115], rtol=0, atol=1e-12)
    with refuses(errors.ArgumentError, "camera: expected none, the file holds one"):
        Camera.from_openlane(OPENLANE, camera="FRONT", image_size=(1920, 1280))


def test_openlane_v2_is_optical(tmp_path):
    path = SAMPLES["openlane v2"].write(tmp_path)
    front = Camera.load(path, camera="ring_front_center", image_size=(1550, 2048))
    np.testing.assert_allclose(front.vehicle_from_camera, placed(DOWN, 1.63, -0.002, 1.43), rtol=0, atol=1e-9)
    assert front.lens is None and front.intrinsics[0, 0] == 1686.5
    side = Camera.load(path, camera="ring_side_left", image_size=(2048, 1550))
    uv = side.project([[1.31, 10.27, 1.44]])[0]  # straight ahead of it, 10 m to the left of the car
    np.testing.assert_allclose(uv, [[1029.0, 776.0]], rtol=0, atol=1e-9)
    with refuses(errors.ArgumentError, "expected one of 'ring_front_center', 'ring_side_left'"):
        Camera.from_openlane(OPENLANE_V2, image_size=(2048, 1550))


def test_pandaset_looks_where_its_name_says(tmp_path):
    path = SAMPLES["pandaset"].write(tmp_path)
    cameras = Camera.load_all(path, image_size=(1920, 1080))
    assert list(cameras) == ["back_camera", "front_camera"]
    ahead, behind = cameras["front_camera"], cameras["back_camera"]
    assert ahead.vehicle_from_camera[0, 2] > 0.9 > 0 > behind.vehicle_from_camera[0, 2]
    assert ahead.lens == BrownConrady([-0.5894, 0.66, 0.0011, -0.001, -1.0088])
    # y of (0, 0, 0.8, -0.6): turns by 180 degrees about that axis
    u = np.array([0.0, 0.8, -0.6])
    R = 2 * np.outer(u, u) - np.eye(3)
    lidar = np.column_stack([POINTS[:, 1], -POINTS[:, 0], POINTS[:, 2]])
    seen = lidar @ R.T + [0.00026, -0.0391, -0.044]
    K = [[1970.0131, 0, 970.0002], [0, 1970.0091, 483.2988], [0, 0, 1]]
    expected = brown(seen, K, (-0.5894, 0.66, 0.0011, -0.001, -1.0088))
    got, _, _ = ahead.project(POINTS)
    known = np.isfinite(got).all(axis=1)
    assert known.any()
    np.testing.assert_allclose(got[known], expected[known], rtol=0, atol=1e-9)


def test_a2d2_by_its_tutorial(tmp_path):
    path = SAMPLES["a2d2"].write(tmp_path)
    camera = Camera.load(path, camera="front_center")
    view = A2D2["cameras"]["front_center"]["view"]
    x = np.array(view["x-axis"]) / np.linalg.norm(view["x-axis"])
    y = np.array(view["y-axis"]) - x * (x @ view["y-axis"])
    y /= np.linalg.norm(y)
    to_global = placed(np.column_stack([x, y, np.cross(x, y)]), *view["origin"])
    vehicle = placed(np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]]), 0.0, 0.5, 0.0)
    # the sample's vehicle faces -y of the global frame, its camera +x of it: look out of the side
    seen = (np.linalg.inv(to_global) @ vehicle @ np.column_stack([POINTS[:, [1, 0, 2]] * [-1, 1, 1], np.ones(3)]).T).T
    beside = POINTS[:, [1, 0, 2]] * [-1, 1, 1]
    optical = np.column_stack([-seen[:, 1], -seen[:, 2], seen[:, 0]])
    entry = A2D2["cameras"]["front_center"]
    expected = brown(optical, entry["CamMatrixOriginal"], entry["Distortion"][0])
    np.testing.assert_allclose(pixels(camera, beside), expected, rtol=0, atol=1e-9)
    undistorted = Camera.from_a2d2(path, camera="front_center", image="undistorted")
    K = np.array(entry["CamMatrix"])
    expected = (K @ (optical / optical[:, 2:]).T).T[:, :2]
    np.testing.assert_allclose(pixels(undistorted, beside), expected, rtol=0, atol=1e-9)
    side = Camera.from_a2d2(path, camera="side_left")
    assert side.lens == KannalaBrandt([0.014, -0.011, 0.0102, -0.0062]) and side.image_size == (1920, 1208)
    assert list(Camera.load_all(path)) == ["front_center", "side_left"]


def test_cam2bev_by_its_script(tmp_path):
    """The matrices of the project's `ipm.py`, written out again."""
    camera = Camera.load(SAMPLES["cam2bev"].write(tmp_path), image_size=(964, 604))
    a, b, c = np.deg2rad([-20.0, -8.0, 3.0])  # minus yaw, pitch, roll
    Rz = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    Ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    Rx = np.array([[1, 0, 0], [0, np.cos(c), -np.sin(c)], [0, np.sin(c), np.cos(c)]])
    R = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]) @ Rz @ Ry @ Rx
    seen = (POINTS - [1.7, -0.25, 1.4]) @ R.T
    K = np.array([[278.283, 0, 482.0], [0, 408.1295, 302.0], [0, 0, 1]])
    expected = (K @ (seen / seen[:, 2:]).T).T[:, :2]
    np.testing.assert_allclose(pixels(camera), expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(camera.position, [1.7, -0.25, 1.4], rtol=0, atol=1e-12)
    ahead = camera.vehicle_from_camera[:3, 2]
    assert ahead[2] < 0 < ahead[1], "8 degrees of pitch look down, 20 of yaw to the left"


def test_autoware_is_the_cameras_pose(tmp_path):
    path = SAMPLES["autoware"].write(tmp_path)
    camera = Camera.load(path)
    np.testing.assert_allclose(camera.vehicle_from_camera, placed(DOWN, 1.0245, -0.0389, -0.9366), rtol=0, atol=1e-9)
    assert camera.lens == BrownConrady([-0.3096, 0.0848, 0.0004, -0.0012, 0.0]) and camera.image_size == (640, 480)
    on_car = placed([[0, -1, 0], [1, 0, 0], [0, 0, 1]], 0.5, 0.0, 1.9)
    mounted = Camera.from_autoware(path, vehicle_from_lidar=on_car)
    expected = on_car @ camera.vehicle_from_camera
    np.testing.assert_allclose(mounted.vehicle_from_camera, expected, rtol=0, atol=1e-9)
    path.write_bytes(AUTOWARE.replace(b"plumb_bob", b"equidistant").replace(b"-0.0012, 0. ]", b"-0.0012, 0. ]"))
    assert Camera.from_autoware(path).lens == KannalaBrandt([-0.3096, 0.0848, 0.0004, -0.0012])
    path.write_bytes(AUTOWARE.replace(b"plumb_bob", b"ftheta"))
    with refuses(errors.CalibrationError, "DistModel", "has no model here"):
        Camera.from_autoware(path)


def test_sensorscalibration_from_lidar_and_back(tmp_path):
    path = SAMPLES["pjlab"].write(tmp_path)
    alone = Camera.load(path)
    assert alone.lens == BrownConrady([-0.364, 0.1789, 0.0006, -0.0004, -0.0538]), "five numbers, whatever cols says"
    np.testing.assert_array_equal(alone.vehicle_from_camera[:3, 2], [1, 0, 0])
    camera = Camera.from_pjlab(path, extrinsic=PJLAB_EXTRINSIC)
    T = np.array(PJLAB_EXTRINSIC["top_center_lidar-to-center_camera-extrinsic"]["param"]["sensor_calib"]["data"])
    seen = POINTS @ T[:3, :3].T + T[:3, 3]
    K = [[903.7596, 0, 695.7519], [0, 901.9653, 224.2509], [0, 0, 1]]
    expected = brown(seen, K, (-0.364, 0.1789, 0.0006, -0.0004, -0.0538))
    np.testing.assert_allclose(pixels(camera), expected, rtol=0, atol=1e-9)
    back = copy(PJLAB_EXTRINSIC)
    entry = back["top_center_lidar-to-center_camera-extrinsic"]
    entry["sensor_name"], entry["target_sensor_name"] = entry["target_sensor_name"], entry["sensor_name"]
    entry["param"]["sensor_calib"]["data"] = np.linalg.inv(T).tolist()
    np.testing.assert_allclose(
        Camera.from_pjlab(PJLAB, extrinsic=back).camera_from_vehicle, camera.camera_from_vehicle, rtol=0, atol=1e-9
    )
    entry["sensor_name"] = "left_camera"
    with refuses(errors.CalibrationError, "expected one from or to 'center_camera'", "'left_camera'"):
        Camera.from_pjlab(PJLAB, extrinsic=back)


WRONG = {
    "no size": ("once", ONCE, {"camera": "cam01"}, "expected image_size=", "1920x1020"),
    "another word": (
        "once", ONCE, {"camera": "cam01", "image_size": (1920, 1020), "image": "rectified"},
        "image: expected 'raw' or 'undistorted'", "say which images",
    ),
    "no such camera": ("once", ONCE, {"camera": "cam02"}, "expected one of 'cam01', 'cam05'", "cam02"),
    "a fourth column": (
        "zod", {"FC": {**ZOD["FC"], "intrinsics": np.hstack([np.eye(3), np.ones((3, 1))]).tolist()}}, {},
        "FC.intrinsics", "expected 0 in the fourth column",
    ),
    "parallel axes": (
        "a2d2",
        {"cameras": {"front_center": {**A2D2["cameras"]["front_center"], "view": {
            "origin": [0, 0, 0], "x-axis": [1, 0, 0], "y-axis": [2, 0, 0]}}}},
        {}, "front_center.view.y-axis", "not parallel to the other one",
    ),
    "another lens": (
        "a2d2", {"cameras": {"front_center": {**A2D2["cameras"]["front_center"], "Lens": "Zoom"}}}, {},
        "Lens: expected one of 'Telecam', 'Fisheye'", "'Zoom'",
    ),
    "degrees as text": ("cam2bev", {"yaw": "20"}, {"image_size": (964, 604)}, "missing fx"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_content(name):
    form, content, options, *message = WRONG[name]
    with refuses(errors.IpmError, *message):
        getattr(ipm_rs.Camera, f"from_{form}")(content, **options)


def test_wrong_files(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_bytes(CAM2BEV.replace(b"8.0", b"8 deg"))
    with refuses(errors.CalibrationError, "pitch: expected a finite number, got str '8 deg'", "degrees"):
        Camera.load(path, image_size=(964, 604))
    path.write_bytes(PANDASET.replace(b"y: 0.8, z: -0.6", b"y: 0.8, z: -0.9"))
    with refuses(errors.CalibrationError, "front_camera.extrinsic.transform.rotation", "norm 1"):
        Camera.load(path, camera="front_camera", image_size=(1920, 1080))
    path.write_bytes(PANDASET.replace(b"w: 0.0, x: 0.0, y: 0.8", b"x: 0.0, y: 0.8"))
    with refuses(errors.CalibrationError, "front_camera.extrinsic.transform.rotation", "missing w"):
        Camera.load(path, camera="front_camera", image_size=(1920, 1080))
