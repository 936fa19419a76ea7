"""COLMAP's binary models, nerfstudio, Open3D, DepthAI and OCamCalib: every number against an independent reading."""

from __future__ import annotations

import json
import math
import struct

import numpy as np
import pytest
from calibration_samples import SAMPLES
from calibration_tools import (
    BLENDER,
    COLMAP_BINARY,
    COLMAP_BINARY_IMAGES,
    NERFSTUDIO,
    OAK,
    OAK_BROWN,
    OCAM,
    OCAM_INVERSE,
    OPEN3D,
)
from helpers import refuses

import ipm_rs
from ipm_rs import BrownConrady, Camera, KannalaBrandt, errors

S = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])  # optical axes from x forward, y left, z up


def matrix(fx: float, fy: float, cx: float, cy: float) -> np.ndarray:
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def is_camera(camera: Camera, K: np.ndarray, size: tuple[int, int], lens: object, pose: np.ndarray) -> None:
    np.testing.assert_allclose(camera.intrinsics, K, rtol=0, atol=1e-9)
    np.testing.assert_allclose(camera.camera_from_vehicle, pose, rtol=0, atol=1e-9)
    assert (camera.image_size, camera.lens) == (size, lens)


def test_binary_colmap(tmp_path):
    path = SAMPLES["colmap binary"].write(tmp_path)
    lens = BrownConrady([-0.06, 0.021, 0.0003, -0.0005])
    is_camera(Camera.load(path, camera=3), matrix(1260.5, 1258, 803, 595.5), (1600, 1200), lens, S)
    assert list(Camera.load_all(path)) == ["3", "7"]
    (tmp_path / "images.bin").write_bytes(COLMAP_BINARY_IMAGES)
    camera = Camera.from_colmap(path, images=tmp_path / "images.bin", image="right.jpg")
    turn = [[-0.28, 0, 0.96, 0.1], [0, 1, 0, 0.2], [-0.96, 0, -0.28, 0.3], [0, 0, 0, 1]]  # 2 acos(0.6) about y
    is_camera(camera, matrix(500.5, 501, 319.5, 239.75), (640, 480), None, np.array(turn))
    first = Camera.from_colmap(path, images=tmp_path / "images.bin", image=11)
    np.testing.assert_allclose(first.camera_from_vehicle[:3, 3], [0.25, 1.5, -0.75], rtol=0, atol=1e-12)


@pytest.mark.parametrize("model", range(18))
def test_every_binary_model_has_its_parameters(model, tmp_path):
    """The counts of COLMAP's models.h; a camera after it shows that none is read too long."""
    count = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12, 16, 4, 5, 3, 4, 6, 2)[model]
    values = [900.0, 901.0, 320.0, 240.0, *[0.0] * 12][:count]
    if model == 16:
        values[5] = 1.0  # beta
    if model == 17:
        values = [640.0, 480.0]
    if model in (0, 2, 3, 8, 9, 12, 14):
        values = [900.0, 320.0, 240.0, *values[3:]][:count]
    data = struct.pack(f"<QiiQQ{count}d", 2, 1, model, 640, 480, *values) + COLMAP_BINARY[-struct.calcsize("<iiQQ4d") :]
    path = tmp_path / "cameras.bin"
    path.write_bytes(data)
    assert Camera.load(path, camera=7).intrinsics[0, 0] == 500.5
    assert Camera.load(path, camera=1).intrinsics[0, 2] == 319.5


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (COLMAP_BINARY[:-1], "cut short"),
        (COLMAP_BINARY + b"\0", "damaged"),
        (COLMAP_BINARY.replace(struct.pack("<ii", 7, 1), struct.pack("<ii", 7, 99)), "expected a model from 0 to 17"),
        (COLMAP_BINARY.replace(struct.pack("<ii", 7, 1), struct.pack("<ii", 3, 1)), "expected every camera once"),
    ],
)
def test_damaged_binaries(data, message, tmp_path):
    path = tmp_path / "cameras.bin"
    path.write_bytes(data)
    with refuses(errors.CalibrationError, message, ";"):
        Camera.from_colmap(path, camera=3)


# ---------------------------------------------------------------------------------------------------------------------
# nerfstudio

ON_WORLD = np.array([[0.0, -0.28, 0.96, 2.0], [-1.0, 0, 0, -1.0], [0, -0.96, -0.28, 1.4], [0, 0, 0, 1]])


def test_nerfstudio(tmp_path):
    sample = SAMPLES["nerfstudio"]
    path = sample.write(tmp_path)
    lens = BrownConrady([0.0312, -0.0521, 0.0004, -0.0007])
    K = matrix(1402.5, 1399, 956.5, 544)
    is_camera(Camera.load(path, **sample.options), K, (1920, 1080), lens, np.linalg.inv(ON_WORLD))
    world = np.array([[0.0, 1, 0, 5], [-1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
    scaled = ON_WORLD.copy()
    scaled[:3, 3] *= 2.5
    camera = Camera.from_nerfstudio(path, camera=0, vehicle_from_world=world, metres_per_unit=2.5)
    is_camera(camera, K, (1920, 1080), lens, np.linalg.inv(world @ scaled))
    assert list(Camera.load_all(path)) == ["images/frame_00001.png", "images/frame_00002.png"]


def test_an_angle_of_view_alone(tmp_path):
    sample = SAMPLES["nerfstudio blender"]
    camera = Camera.load(sample.write(tmp_path), **sample.options)
    f = 400 / math.tan(0.6911112070083618 / 2)
    is_camera(camera, matrix(f, f, 399.5, 299.5), (800, 600), None, np.linalg.inv(ON_WORLD))
    with refuses(errors.CalibrationError, "expected image_size=(width, height)"):
        Camera.from_nerfstudio(BLENDER)
    with refuses(errors.CalibrationError, "expected an angle of view in radians"):
        Camera.from_nerfstudio({**BLENDER, "camera_angle_x": 39.6}, image_size=(800, 600))
    with refuses(errors.IpmError, "image_size"):
        Camera.from_nerfstudio(BLENDER, image_size="wide")


def test_fisheyes_of_nerfstudio():
    terms = {"k1": 0.02, "k2": -0.01, "k3": 0.003, "k4": -0.0002}
    plain = {key: value for key, value in NERFSTUDIO.items() if key not in ("p1", "p2", "camera_model")}
    for said in ({"camera_model": "OPENCV_FISHEYE"}, {"is_fisheye": True}):
        camera = Camera.from_nerfstudio({**plain, **terms, **said}, camera=1)
        assert camera.lens == KannalaBrandt([0.02, -0.01, 0.003, -0.0002])
    with refuses(errors.CalibrationError, "k4: expected 0 for OPENCV", "OPENCV_FISHEYE"):
        Camera.from_nerfstudio({**NERFSTUDIO, **terms}, camera=1)
    with refuses(errors.CalibrationError, "camera_model: expected one of 'OPENCV'"):
        Camera.from_nerfstudio({**NERFSTUDIO, "camera_model": "EQUIRECTANGULAR"}, camera=1)
    with refuses(errors.ArgumentError, "expected one of 'images/frame_00001.png'"):
        Camera.from_nerfstudio(NERFSTUDIO)


# ---------------------------------------------------------------------------------------------------------------------
# Open3D, DepthAI


def test_open3d_counts_by_columns(tmp_path):
    K = matrix(571.5, 570.25, 317.5, 241.5)
    is_camera(Camera.load(SAMPLES["open3d"].write(tmp_path)), K, (640, 480), None, S)
    sample = SAMPLES["open3d trajectory"]
    turned = np.array([[1, 0, 0, 0.1], [0, 0.96, -0.28, 0.2], [0, 0.28, 0.96, 0.3], [0, 0, 0, 1]])
    path = sample.write(tmp_path)
    is_camera(Camera.load(path, **sample.options), K, (640, 480), None, turned @ S)
    is_camera(Camera.from_open3d(path, camera=1, vehicle_from_world=np.eye(4)), K, (640, 480), None, turned)
    assert list(Camera.load_all(path)) == ["0", "1"]
    with refuses(errors.CalibrationError, "nine numbers column by column"):
        Camera.from_open3d({**OPEN3D, "intrinsic_matrix": [571.5, 0, 317.5, 0, 570.25, 241.5, 0, 0, 1]})
    with refuses(errors.ArgumentError, "expected none, the file holds one"):
        Camera.from_open3d(OPEN3D, camera=2)


def test_the_chain_of_an_oak(tmp_path):
    """Socket 1 leads to 2, 2 to 0: centimetres, each step camera to camera."""
    path = SAMPLES["depthai"].write(tmp_path)
    step = np.array([[0.96, 0, 0.28, 0], [0, 1, 0, 0.0003], [-0.28, 0, 0.96, 0.0004], [0, 0, 0, 1]])
    one, two = step.copy(), step.copy()
    one[0, 3], two[0, 3] = -0.0756, 0.0379
    K = matrix(799.7, 799.4, 662.9, 382.2)
    lens = BrownConrady(OAK_BROWN)
    for name in (1, "1", "CAM_B"):
        is_camera(Camera.load(path, camera=name), K, (1280, 800), lens, np.linalg.inv(two @ one) @ S)
    base = np.array([[0.0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])
    mounted = Camera.from_depthai(path, camera=1, vehicle_from_base=base)
    np.testing.assert_allclose(mounted.vehicle_from_camera, base @ two @ one, rtol=0, atol=1e-9)
    fisheye = Camera.load(path, camera=0)
    is_camera(
        fisheye, matrix(1010.5, 1009.8, 640.2, 361.7), (1280, 720), KannalaBrandt([0.01, -0.002, 0.0003, -0.0001]), S
    )
    assert list(Camera.load_all(path)) == ["1", "2", "0"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[2][1]["extrinsics"].update(OAK["cameraData"][0][1]["extrinsics"]), "got a circle"),
        (lambda data: data[1][1]["extrinsics"].update(toCameraSocket=5), "expected one of 1, 2, 0, got 5"),
        (lambda data: data[0][1].update(cameraType=3), "expected 0 (perspective) or 1 (fisheye), got 3"),
        (lambda data: data.append([1, {}]), "expected every socket once"),
        (lambda data: data.append([4]), "expected a socket's number and its camera"),
        (lambda data: [entry[1].update(intrinsicMatrix=[]) for entry in data], "calibrate the device"),
    ],
)
def test_wrong_oaks(change, message):
    content = json.loads(json.dumps(OAK))
    change(content["cameraData"])
    with refuses(errors.IpmError, message, ";"):
        Camera.from_depthai(content, camera=1)


# ---------------------------------------------------------------------------------------------------------------------
# OCamCalib


def test_ocamcalib_counts_rows_first(tmp_path):
    """By the toolbox's own formulas: row and column less the centre, through the inverse affine matrix, are x and y."""
    camera = Camera.load(SAMPLES["ocamcalib"].write(tmp_path)).with_pose(np.eye(4))
    pixels = np.array([[521.5, 388.25], [800.0, 388.25], [521.5, 100.0], [300.25, 610.0], [900.0, 200.0]])
    rows_columns = pixels[:, ::-1] - [388.25, 521.5]
    x, y = np.linalg.inv([[1.00015, 0.00008], [-0.00021, 1.0]]) @ rows_columns.T
    z = np.polyval([9.1e-09, -2.4e-06, 1.53e-03, 0.0, -179.0], np.hypot(x, y))
    rays = np.column_stack([y, x, -z])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    np.testing.assert_allclose(camera.unproject(pixels), rays, rtol=0, atol=1e-9)
    assert camera.image_size == (1024, 768)


def test_an_inverse_polynomial_alone(tmp_path, caplog):
    """Directions land where the inverse polynomial puts them, within the error that the log says."""
    values = [float(word) for word in OCAM_INVERSE.split(b"\n")[2].split()[1:]]
    path = SAMPLES["ocamcalib inverse"].write(tmp_path)
    with caplog.at_level("INFO", logger="ipm_rs.calibration"):
        camera = Camera.load(path).with_pose(np.eye(4))
    said = next(record.getMessage() for record in caplog.records if "no direct polynomial" in record.getMessage())
    error = float(said.split("within ")[1].split()[0])
    assert error < 0.1
    angles = np.linspace(0.02, 1.5, 60)
    rho = np.polyval(values[::-1], angles - np.pi / 2)
    inside = rho < 383
    uv = camera.project(np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)])[inside])[0]
    np.testing.assert_allclose(uv, np.column_stack([511.5 + rho, 383.5 + 0 * rho])[inside], rtol=0, atol=error + 0.005)
    assert inside.sum() > 40


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (OCAM.replace(b" 5 -1.79", b" 6 -1.79"), "as many, got 6 and 5"),
        (OCAM.replace(b"768 1024", b""), "expected five rows"),
        (OCAM.replace(b"768 1024", b"768 x"), "image size"),
        (OCAM_INVERSE.replace(b"323.8", b"442.8"), "that a direct one fits"),
    ],
)
def test_wrong_files_of_ocamcalib(data, message, tmp_path):
    path = tmp_path / "calib_results.txt"
    path.write_bytes(data)
    with refuses(errors.CalibrationError, message, ";"):
        Camera.from_ocamcalib(path)
    assert ipm_rs.Camera.from_ocamcalib(SAMPLES["ocamcalib"].write(tmp_path / "right"))
