"""Cameras on a body (IMU, robot): every number of the samples against an independent reading, and the wrong files."""

from __future__ import annotations

import json

import numpy as np
import pytest
from calibration_samples import SAMPLES
from calibration_tools import BASALT, CAMODOCAL, EUROC, NCAMERA, OKVIS, ORB_SLAM2, ORB_SLAM3, VINS
from helpers import refuses

import ipm_rs
from ipm_rs import BrownConrady, DoubleSphere, Eucm, KannalaBrandt, Mei, errors

pytest.importorskip("yaml")

S = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])  # optical axes from x forward, y left, z up
VEHICLE_FROM_BODY = np.array([[0.6, -0.8, 0, 1.1], [0.8, 0.6, 0, -0.2], [0, 0, 1, 1.4], [0, 0, 0, 1]])


def rows(*numbers: float) -> np.ndarray:
    return np.vstack([np.reshape(numbers, (3, 4)), [0, 0, 0, 1]])


VINS_0 = rows(0, -1, 0, -0.021, 1, 0, 0, -0.064, 0, 0, 1, 0.009)
VINS_1 = rows(0, -1, 0, -0.019, 0.8, 0, 0.6, 0.045, -0.6, 0, 0.8, 0.007)
EUROC_0 = rows(0, -0.8, -0.6, -0.0216, 1, 0, 0, -0.0647, 0, -0.6, 0.8, 0.0098)
NCAMERA_0 = rows(0, -1, 0, 0.01, 1, 0, 0, -0.06, 0, 0, 1, 0.02)
NCAMERA_1 = rows(0, -1, 0, 0.011, 0.8, 0, 0.6, 0.05, -0.6, 0, 0.8, 0.02)
OKVIS_0 = rows(0, -1, 0, -0.0216, 1, 0, 0, -0.0647, 0, 0, 1, 0.0098)
OKVIS_1 = rows(0, -1, 0, -0.0198, 1, 0, 0, 0.0454, 0, 0, 1, 0.0079)
BASALT_0 = rows(1, 0, 0, 0.045, 0, 0.28, -0.96, -0.071, 0, 0.96, 0.28, -0.047)  # 2 atan(0.6 / 0.8) about x
BASALT_1 = rows(0.8432, 0, 0.5376, -0.056, 0, 1, 0, -0.069, -0.5376, 0, 0.8432, -0.044)
ORB_1 = rows(-1, 0, 0, 0.045, 0, 0.6, 0.8, -0.072, 0, 0.8, -0.6, -0.046)
ORB_12 = rows(0.8, 0, 0.6, 0.101, 0, 1, 0, 0.002, -0.6, 0, 0.8, -0.001)
BROWN = BrownConrady([-0.2917, 0.08228, 5.333e-05, -1.578e-04])

CASES = {
    "camodocal": ((461.6, 460.3, 363.0, 248.1), (752, 480), BROWN),
    "camodocal mei": (
        (1336.3, 1335.7, 716.94, 705.76),
        (1400, 1400),
        Mei(2.2134, [0.016798, 1.6548, 4.2223e-4, 4.2462e-4]),
    ),
    "camodocal fisheye": (
        (190.978, 190.973, 254.931, 256.897),
        (512, 510),
        KannalaBrandt([0.0034823, 0.00071503, -0.0020532, 0.00020293]),
    ),
    "camodocal vins": ((457.1, 460.3, 363.0, 248.1), (752, 480), BROWN),
    "camodocal vins-mono": ((461.6, 460.3, 363.0, 248.1), (752, 480), BROWN),
    "euroc": ((458.6, 457.3, 367.2, 248.4), (752, 480), BrownConrady([-0.2834, 0.07396, 0.000194, 1.762e-05])),
    "ncamera": ((250.5, 251.25, 317.0, 241.5), (752, 480), KannalaBrandt([-0.018, 0.012, -0.009, 0.0021])),
    "okvis": ((357.6, 356.1, 379.9, 255.2), (752, 480), KannalaBrandt([0.01, -0.004, 0.0006, 0.0002])),
    "basalt": ((190.9, 190.8, 252.6, 255.0), (512, 512), KannalaBrandt([0.0037, 0.0012, -0.0024, 0.0003])),
    "orbslam": (
        (190.442, 190.434, 252.597, 254.917),
        (512, 512),
        KannalaBrandt([0.0034003, 0.0017669, -0.0026631, 0.00032995]),
    ),
    "orbslam 2": (
        (517.306, 516.469, 318.643, 255.314),
        (640, 480),
        BrownConrady([0.262, -0.953, -0.0054, 0.0026, 1.163]),
    ),
}
"""K as fx fy cx cy, size and lens."""

POSES = {
    "camodocal vins": (VINS_1, VINS_0),
    "camodocal vins-mono": (VINS_0, VINS_0),
    "euroc": (EUROC_0, EUROC_0),
    "ncamera": (NCAMERA_1, NCAMERA_0),
    "okvis": (OKVIS_1, OKVIS_0),
    "basalt": (BASALT_1, BASALT_0),
    "orbslam": (ORB_1 @ ORB_12, ORB_1),
}
"""Where the camera and the file's first camera stand on the body."""


@pytest.mark.parametrize("title", CASES)
def test_every_number_is_read(title, tmp_path):
    focal, size, lens = CASES[title]
    body_from_camera, body_from_first = POSES.get(title, (np.eye(4), np.eye(4)))
    sample = SAMPLES[title]
    path = sample.write(tmp_path)
    camera = ipm_rs.Camera.load(path, **sample.options)
    fx, fy, cx, cy = focal
    np.testing.assert_allclose(camera.intrinsics, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], rtol=0, atol=1e-9)
    assert camera.image_size == size and camera.lens == lens
    expected = np.linalg.inv(body_from_camera) @ body_from_first @ S
    np.testing.assert_allclose(camera.camera_from_vehicle, expected, rtol=0, atol=1e-9)
    argument = "vehicle_from_body" if sample.format in ("euroc", "ncamera") else "vehicle_from_imu"
    if title in POSES:
        read = getattr(ipm_rs.Camera, f"from_{sample.format}")
        mounted = read(path, **sample.options, **{argument: VEHICLE_FROM_BODY})
        np.testing.assert_allclose(mounted.vehicle_from_camera, VEHICLE_FROM_BODY @ body_from_camera, rtol=0, atol=1e-9)


def test_ncamera_in_maplabs_list_of_sensors(tmp_path):
    """An NCAMERA among other sensors, matrices in rows, names by their topics, T_C_B; a lidar's image is no camera."""
    yaml = pytest.importorskip("yaml")
    content = yaml.safe_load(NCAMERA)
    first, second = content["cameras"]
    for number, entry in enumerate((first, second)):
        del entry["camera"]["label"]
        entry["camera"]["topic"] = f"/cam{number}"
    first["T_B_C"]["data"] = NCAMERA_0.tolist()
    second["T_C_B"] = {"rows": 4, "cols": 4, "data": np.linalg.inv(NCAMERA_1).tolist()}
    del second["T_B_C"]
    lidar = {"camera": {"type": "camera-3d-lidar", "intrinsics": {"rows": 2, "cols": 1, "data": [1, 2]}}}
    sensors = [{"sensor_type": "IMU", "id": "a"}, {"sensor_type": "NCAMERA", "cameras": [first, second, lidar]}]
    path = tmp_path / "sensors.yaml"
    path.write_text(yaml.safe_dump({"sensors": sensors}))
    cameras = ipm_rs.Camera.load_all(path)
    assert list(cameras) == ["/cam0", "/cam1"]
    expected = np.linalg.inv(NCAMERA_1) @ NCAMERA_0 @ S
    np.testing.assert_allclose(cameras["/cam1"].camera_from_vehicle, expected, rtol=0, atol=1e-9)
    mounted = ipm_rs.Camera.from_ncamera(path, camera="/cam1", vehicle_from_body=VEHICLE_FROM_BODY)
    np.testing.assert_allclose(mounted.vehicle_from_camera, VEHICLE_FROM_BODY @ NCAMERA_1, rtol=0, atol=1e-9)
    with refuses(errors.CalibrationError, "ncamera: no key 'cameras'"):
        path.write_text(yaml.safe_dump({"sensors": sensors[:1]}))
        ipm_rs.Camera.load(path)


def test_ncamera_with_the_unified_projection():
    yaml = pytest.importorskip("yaml")
    content = yaml.safe_load(NCAMERA)
    place = content["cameras"][0]["camera"]
    place["type"] = "unified-projection"
    place["intrinsics"] = {"rows": 5, "cols": 1, "data": [0.9, 461.2, 459.8, 363.1, 248.7]}
    camera = ipm_rs.Camera.from_ncamera(content, camera="cam0")
    assert camera.lens == Mei(0.9, [-0.29, 0.083, 0.0002, 1.5e-05])
    assert camera.intrinsics[0, 0] == 461.2
    del place["distortion"]
    assert ipm_rs.Camera.from_ncamera(content, camera="cam0").lens == Mei(0.9, [0, 0, 0, 0])
    place["distortion"] = {"type": "equidistant", "parameters": {"rows": 4, "cols": 1, "data": [0.1, 0, 0, 0]}}
    with refuses(errors.CalibrationError, "expected radial-tangential or none beside unified-projection"):
        ipm_rs.Camera.from_ncamera(content, camera="cam0")
    place["type"] = "omni"
    with refuses(errors.CalibrationError, "camera.type: expected one of 'pinhole', 'unified-projection'"):
        ipm_rs.Camera.from_ncamera(content, camera="cam0")


@pytest.mark.parametrize(("word", "terms"), [("plumb_bob", 4), ("plumb_bob8", 8), ("radialtangential8", 8)])
def test_names_of_okvis_lenses(word, terms):
    yaml = pytest.importorskip("yaml")
    content = yaml.safe_load(OKVIS.partition(b"\n")[2])
    values = [0.01 * (index + 1) for index in range(terms)]
    content["cameras"][0] |= {"distortion_type": word, "distortion_coefficients": values}
    assert ipm_rs.Camera.from_okvis(content, camera=0).lens == BrownConrady(values)


def test_the_other_cameras_of_basalt(tmp_path):
    path = SAMPLES["basalt"].write(tmp_path)
    assert ipm_rs.Camera.from_basalt(path, camera=0).lens == DoubleSphere(-0.172, 0.593)
    assert ipm_rs.Camera.from_basalt(path, camera=2).lens == Eucm(0.62, 1.05)
    unified = json.loads(json.dumps(BASALT))
    unified["value0"]["intrinsics"][2] = {
        "camera_type": "ucm", "intrinsics": {"fx": 191.0, "fy": 191.1, "cx": 250.5, "cy": 251.5, "alpha": 0.62}
    }  # fmt: skip
    camera = ipm_rs.Camera.from_basalt(unified, camera=2).with_pose(np.eye(4))
    x, y, z = 0.7, -0.4, 1.3
    divisor = 0.62 * np.sqrt(x * x + y * y + z * z) + 0.38 * z
    uv = camera.project([[x, y, z]])[0][0]
    np.testing.assert_allclose(uv, [191.0 * x / divisor + 250.5, 191.1 * y / divisor + 251.5], rtol=0, atol=1e-9)


def test_camodocal_scaramuzza_runs_along_columns(tmp_path):
    """By camodocal's own formulas: a pixel less the centre, through the inverse affine matrix, is the ray's x and y."""
    camera = ipm_rs.Camera.load(SAMPLES["camodocal panorama"].write(tmp_path)).with_pose(np.eye(4))
    pixels = np.array([[645.1, 486.02], [900.0, 300.5], [500.25, 700.0], [1001.0, 480.0]])
    x, y = np.linalg.inv([[1.0002, 0.0011], [-0.0007, 1.0]]) @ (pixels - [645.1, 486.02]).T
    rho = np.hypot(x, y)
    z = -np.polyval([4.476e-09, -1.7578e-06, 1.7486e-03, 0.0, -244.5], rho)
    rays = np.column_stack([x, y, z]) / np.linalg.norm([x, y, z], axis=0)[:, None]
    np.testing.assert_allclose(camera.unproject(pixels), rays, rtol=0, atol=1e-9)
    assert camera.image_size == (1280, 960)


WRONG = {
    "an FOV lens": ("ncamera", NCAMERA.replace(b"radial-tangential", b"fisheye"), {"camera": 0}, "expected 1 "),
    "a camera that is not there": ("ncamera", NCAMERA, {"camera": "cam2"}, "expected one of 'cam0', 'cam1'"),
    "no camera chosen": ("okvis", OKVIS, {}, "expected one of '0', '1', got None"),
    "a number too many": ("euroc", EUROC.replace(b"248.4]", b"248.4, 1]"), {}, "intrinsics: expected 4 numbers, got 5"),
    "no rotation": ("euroc", EUROC.replace(b"-0.8, -0.6", b"-0.8, 0.6"), {}, "expected a rotation"),
    "another lens": ("euroc", EUROC.replace(b"radial-tangential", b"atan"), {}, "got 'atan', which has no model here"),
    "no size": ("orbslam", ORB_SLAM2.replace(b"Camera.width", b"Camera.newWidth"), {}, "pass image_size|image_size="),
    "no pose of the second": (
        "orbslam", ORB_SLAM3.replace(b"Stereo.T_c1_c2", b"Stereo.T"), {"camera": 2}, "Stereo.T_c1_c2 or Tlr"
    ),
    "an unknown model": ("camodocal", CAMODOCAL.replace(b"PINHOLE", b"PINHOLE_FULL"), {}, "expected one of 'PINHOLE'"),
    "settings whose camera is elsewhere": ("camodocal", VINS, {"camera": 1}, "cam1.yaml: expected a camodocal"),
    "a lens that misses a number": ("camodocal", CAMODOCAL.replace(b"p2:", b"p3:"), {}, "missing p2"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files(name, tmp_path):
    form, content, options, message = WRONG[name]
    path = tmp_path / "camera.yaml"
    path.write_bytes(content)
    with pytest.raises(errors.IpmError, match=message) as caught:
        getattr(ipm_rs.Camera, f"from_{form}")(path, **options)
    assert "; " in str(caught.value)


def test_a_type_without_a_lens_of_basalt():
    content = json.loads(json.dumps(BASALT))
    content["value0"]["intrinsics"][0]["camera_type"] = "fov"
    with refuses(errors.CalibrationError, "camera_type: expected one of 'pinhole', 'kb4'", "got str 'fov'"):
        ipm_rs.Camera.from_basalt(content, camera=0)
    content["value0"]["resolution"].pop()
    with refuses(errors.CalibrationError, "value0.resolution: expected a list of 3"):
        ipm_rs.Camera.from_basalt(content, camera=1)


@pytest.mark.parametrize(
    ("title", "names"),
    [
        ("camodocal vins", ["cam0", "cam1"]),
        ("ncamera", ["cam0", "cam1"]),
        ("okvis", ["0", "1"]),
        ("basalt", ["0", "1", "2"]),
        ("orbslam", ["1", "2"]),
    ],
)
def test_all_cameras_of_a_file_stand_in_one_frame(title, names, tmp_path):
    sample = SAMPLES[title]
    path = sample.write(tmp_path)
    cameras = ipm_rs.Camera.load_all(path)
    assert list(cameras) == names
    assert ipm_rs.Camera.load(path, **sample.options) in cameras.values()
    np.testing.assert_allclose(cameras[names[0]].camera_from_vehicle, S, rtol=0, atol=1e-12)
