"""Real files of calibration tools, from ../shared/data: read, and their pixels against OpenCV and published numbers."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

import ipm_rs
from ipm_rs import calibration
from ipm_rs.calibration._filestorage import parse_storage

yaml = pytest.importorskip("yaml")

RANDOM = np.random.default_rng(4)
POINTS = np.column_stack([RANDOM.uniform(3, 40, 200), RANDOM.uniform(-2, 2, 200), RANDOM.uniform(-1.5, 1.5, 200)])


@pytest.fixture
def files(shared_data):
    return shared_data / "calibration_files"


def pixels(camera, distortion, fisheye=False):
    """OpenCV's pixels of `POINTS`."""
    optical = POINTS @ camera.camera_from_vehicle[:3, :3].T + camera.camera_from_vehicle[:3, 3]
    zero, K, D = np.zeros(3), camera.intrinsics, np.ravel(distortion)
    if fisheye:
        return cv2.fisheye.projectPoints(optical[:, None], zero, zero, K, D)[0][:, 0]
    return cv2.projectPoints(optical, zero, zero, K, D)[0][:, 0]


def check(camera, distortion, fisheye=False):
    uv, _, valid = camera.project(POINTS)
    inside = np.isfinite(uv).all(axis=1)
    assert valid.sum() > 50 and inside.sum() > 100
    np.testing.assert_allclose(uv[inside], pixels(camera, distortion, fisheye)[inside], rtol=0, atol=1e-9)


def test_ros_yaml(files):
    path = files / "ros_camera_info.yaml"
    assert calibration.recognise(path) == "ros"
    camera, content = ipm_rs.Camera.load(path), yaml.safe_load(path.read_text())
    assert camera.image_size == (640, 480)
    np.testing.assert_array_equal(camera.intrinsics.ravel(), content["camera_matrix"]["data"])
    check(camera, content["distortion_coefficients"]["data"])
    rectified = ipm_rs.Camera.from_ros(path, image="rectified")
    assert rectified.lens is None
    P = np.reshape(content["projection_matrix"]["data"], (3, 4))
    np.testing.assert_array_equal(rectified.intrinsics, P[:, :3])


def test_ros_ini(files):
    path = files / "ros_calib8.ini"
    assert calibration.recognise(path) == "ros"
    camera = ipm_rs.Camera.load(path)
    lines = path.read_text().splitlines()
    check(camera, np.array(lines[lines.index("distortion") + 1].split(), dtype=float))
    # The radius folds over at 66.5 degrees, with the tangential terms a little before.
    assert 66.0 < np.degrees(camera.lens.max_angle) < 66.55
    rectified = ipm_rs.Camera.from_ros(path, image="rectified")
    start = lines.index("projection") + 1
    P = np.array([line.split() for line in lines[start : start + 3]], dtype=float)
    np.testing.assert_array_equal(rectified.intrinsics, P[:, :3])


def test_opencv_yaml(files):
    path = files / "opencv_filestorage.yml"
    assert calibration.recognise(path) == "opencv"
    camera = ipm_rs.Camera.load(path)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(camera.intrinsics, storage.getNode("camera_matrix").mat())
    check(camera, storage.getNode("distortion_coefficients").mat())


def test_kalibr_equidistant(files):
    path = files / "kalibr_pinhole_equidistant.yaml"
    assert calibration.recognise(path) == "kalibr"
    camera = ipm_rs.Camera.load(path)
    assert camera.image_size == (752, 480)
    check(camera, yaml.safe_load(path.read_text())["cam0"]["distortion_coeffs"], fisheye=True)


def test_kalibr_double_sphere(files):
    """The formula of the double sphere, in NumPy."""
    path = files / "kalibr_ds.yaml"
    content = yaml.safe_load(path.read_text())
    for name in ("cam0", "cam1"):
        camera = ipm_rs.Camera.load(path, camera=name)
        xi, alpha, fu, fv, pu, pv = content[name]["intrinsics"]
        x, y, z = (POINTS @ camera.camera_from_vehicle[:3, :3].T + camera.camera_from_vehicle[:3, 3:].T).T
        d1 = np.sqrt(x * x + y * y + z * z)
        scale = alpha * np.sqrt(x * x + y * y + (xi * d1 + z) ** 2) + (1 - alpha) * (xi * d1 + z)
        expected = np.column_stack([fu * x / scale + pu, fv * y / scale + pv])
        np.testing.assert_allclose(camera.project(POINTS)[0], expected, rtol=0, atol=1e-9)
    assert camera.position[1] == pytest.approx(-0.198, abs=2e-3), "20 cm to the right of the first"


def test_matlab(files):
    path = files / "matlab_monocamera.json"
    assert calibration.recognise(path) == "matlab"
    camera, golden = ipm_rs.Camera.load(path), json.loads(path.read_text())["golden"]
    road, pixel = golden["vehicleToImage"]
    np.testing.assert_allclose(camera.project([road])[0][0] + 1, pixel, rtol=0, atol=5e-5)
    pixel, road = golden["imageToVehicle"]
    np.testing.assert_allclose(camera.ground_from_pixels(np.array([pixel]) - 1)[0, :2], road, rtol=0, atol=5e-5)


@pytest.mark.parametrize("name", ["front", "back", "left", "right"])
def test_fisheyes(shared_data, name):
    path = shared_data / "fisheye_surround" / f"{name}.yaml"
    assert calibration.recognise(path) == "opencv"
    with pytest.raises(ipm_rs.errors.ArgumentError, match="pass lens='fisheye'"):
        ipm_rs.Camera.load(path)
    camera = ipm_rs.Camera.from_opencv(path, lens="fisheye")
    assert ipm_rs.Camera.load(path, lens="fisheye") == camera
    assert camera.image_size == (960, 640)
    check(camera, parse_storage(path.read_text(), name)["dist_coeffs"], fisheye=True)


def test_carla_town(shared_data):
    """The lane boundaries of the simulator's map lie on our camera's road, on their own sides and on the markings."""
    pillow = pytest.importorskip("PIL.Image")
    folder = shared_data / "carla"
    image = np.asarray(pillow.open(folder / "town04.png").convert("L")).astype(float)
    camera = ipm_rs.Camera.from_carla(image_size=(1024, 512), fov=45, transform={"z": 1.3, "pitch": -5})
    # World (left-handed) to camera (optical): its determinant is -1.
    camera_from_world = np.loadtxt(folder / "town04_trafo.txt")
    boundary = np.loadtxt(folder / "town04_boundary.txt")
    vehicle_from_world = camera.vehicle_from_camera @ camera_from_world
    left, right = (
        (np.column_stack([boundary[:, start : start + 3], np.ones(len(boundary))]) @ vehicle_from_world.T)[:, :3]
        for start in (0, 3)
    )
    np.testing.assert_allclose([left[:, 2], right[:, 2]], 0, atol=0.01)
    assert (left[:8, 1] > 1).all() and (right[:8, 1] < -1).all(), "not mirrored"

    # The right marking is solid: it is brighter than the road 0.4 m beside it.
    near = right[(right[:, 0] > 5) & (right[:, 0] < 20)]
    brightness = []
    for aside in (-0.4, 0.0, 0.4):
        u, v = np.round(camera.project(near + np.array([0.0, aside, 0.0]))[0]).astype(int).T
        brightness.append(image[v, u].mean())
    assert brightness[1] > max(brightness[0], brightness[2]) + 15
