"""DGP, Argoverse 1 and mmdetection3d: every number against an independent reading, and the wrong files."""

from __future__ import annotations

import json

import numpy as np
import pytest
from calibration_samples import SAMPLES
from calibration_tools import ARGOVERSE1, DGP, MMDET3D
from helpers import refuses

from ipm_rs import BrownConrady, Camera, errors

AHEAD = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]  # (0.5, -0.5, 0.5, -0.5), w first
POINTS = np.array([[12.0, 3.0, -1.6], [8.0, -2.0, -1.7], [40.0, 5.0, 0.5]])


def placed(R: object, *t: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T


def turn(w: float, x: float, y: float, z: float) -> np.ndarray:
    """Rotation of a unit quaternion, by what it does to each axis."""
    u = np.array([x, y, z])
    return np.column_stack([v + 2 * w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v)) for v in np.eye(3)])


CASES = {
    "dgp": ((2181.5, 2181.7, 928.0, 615.9, 0.0), None, placed(AHEAD, 1.7, 0.2, 1.35)),
    "dgp side": (
        (1059.3, 1060.1, 960.5, 606.2, 0.25),
        BrownConrady([-0.02, 0.003, 0.0001] + [0.0] * 11),
        placed(turn(0.1, -0.1, 0.7, -0.7), 1.5, -0.4, 1.3),
    ),
    "argoverse1": ((1392.1, 1392.6, 969.5, 604.75, 0.0), None, placed(AHEAD, 1.64, 0.0, 1.37)),
    "argoverse1 side": (
        (1398.4, 1398.9, 969.5, 604.75, 0.0),
        None,
        placed(turn(0.7, -0.7, 0.1, -0.1), 1.31, 0.25, 1.38),
    ),
    "mmdet3d ego": ((1266.4, 1266.4, 816.3, 491.5, 0.0), None, placed(AHEAD, 1.7, 0.02, 1.5)),
}


@pytest.mark.parametrize("title", CASES)
def test_every_number_is_read(title, tmp_path):
    (fx, fy, cx, cy, skew), lens, vehicle_from_camera = CASES[title]
    sample = SAMPLES[title]
    camera = Camera.load(sample.write(tmp_path), **sample.options)
    np.testing.assert_allclose(camera.intrinsics, [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], rtol=0, atol=1e-9)
    np.testing.assert_allclose(camera.vehicle_from_camera, vehicle_from_camera, rtol=0, atol=1e-9)
    assert (camera.image_size, camera.lens) == (sample.options["image_size"], lens)


@pytest.mark.parametrize("shape", ["4x4", "3x4", "flat"])
def test_the_fourth_column_is_of_the_pose(shape):
    entry = json.loads(json.dumps(MMDET3D["images"]["CAM2"]))
    P = np.array(entry["cam2img"])
    entry["cam2img"] = {"4x4": P, "3x4": P[:3], "flat": P[:3].ravel()}[shape].tolist()
    camera = Camera.from_mmdet3d(entry)
    q = np.column_stack([POINTS, np.ones(3)]) @ (P @ np.array(entry["lidar2cam"])).T
    np.testing.assert_allclose(camera.project(POINTS)[0], q[:, :2] / q[:, 2:3], rtol=0, atol=1e-9)
    assert camera.image_size == (1242, 375)


def test_the_frames_of_an_entry():
    content = {"metainfo": {}, "data_list": [MMDET3D]}
    lidar = Camera.from_mmdet3d(content, camera="CAM_FRONT", frame="lidar", image_size=(1600, 900))
    expected = MMDET3D["images"]["CAM_FRONT"]["lidar2cam"]
    np.testing.assert_allclose(lidar.camera_from_vehicle, expected, rtol=0, atol=1e-9)
    with refuses(errors.CalibrationError, "cam2ego", "missing"):
        Camera.from_mmdet3d(MMDET3D, camera="CAM2", frame="ego")
    with refuses(errors.ArgumentError, "frame: expected 'ego' or 'lidar'"):
        Camera.from_mmdet3d(MMDET3D, camera="CAM2", frame="camera")


@pytest.mark.parametrize(
    ("title", "names"),
    [("dgp", ["CAMERA_01", "CAMERA_05"]), ("argoverse1", ["ring_front_center", "ring_side_left"])],
)
def test_all_cameras(title, names, tmp_path):
    sample = SAMPLES[title]
    cameras = Camera.load_all(sample.write(tmp_path), image_size=sample.options["image_size"])
    assert list(cameras) == names


WRONG = [
    ("dgp", {**DGP, "names": DGP["names"][:2]}, {"camera": "CAMERA_01"}, "names: expected a list of 3"),
    ("dgp", DGP, {"camera": "LIDAR"}, "expected one of 'CAMERA_01', 'CAMERA_05'"),
    ("dgp", DGP, {"camera": "CAMERA_01"}, "DDAD's images are 1936x1216"),
    ("argoverse1", ARGOVERSE1, {"camera": "ring_rear_left", "image_size": (1920, 1200)}, "expected one of 'ring_front"),
    ("argoverse1", ARGOVERSE1, {"camera": "ring_side_left"}, "ring images are 1920x1200"),
    ("mmdet3d", {"images": {}}, {}, "missing cam2img"),
    ("mmdet3d", MMDET3D, {"camera": "CAM_FRONT"}, "the entry has no width and height"),
    ("mmdet3d", {"cam2img": [[1, 2], [3, 4]], "lidar2cam": [], "width": 9, "height": 9}, {}, "expected a 3x3 matrix"),
]


@pytest.mark.parametrize(("form", "content", "options", "message"), WRONG)
def test_wrong_files(form, content, options, message):
    with refuses(errors.IpmError, message, ";"):
        getattr(Camera, f"from_{form}")(content, **options)
