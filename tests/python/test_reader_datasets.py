"""Cityscapes-3D, nuScenes, Lyft, nuImages, Argoverse 2, Waymo: numbers, which record, and what is refused."""

from __future__ import annotations

import json
import math
import sys
import types

import calibration_datasets as samples
import cv2
import golden
import numpy as np
import pytest
from calibration_samples import SAMPLES
from helpers import refuses

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import argoverse2, cityscapes, nuscenes, waymo


def written(name, content, directory):
    path = directory / name
    path.write_text(json.dumps(content))
    return path


# ---------------------------------------------------------------------------------------------------------------------
# Cityscapes-3D


def sensor(**change):
    return {
        "sensor": {
            "sensor_T_ISO_8855": golden.SENSOR_T_ISO_8855,
            "fx": 2262.52,
            "fy": 2265.3,
            "u0": 1096.98,
            "v0": 513.137,
            **change,
        }
    }


def test_cityscapes_3d_is_cityscapes():
    K = {"fx": 2262.52, "fy": 2265.3, "u0": 1096.98, "v0": 513.137}
    pose = {"x": 1.7, "y": 0.1, "z": 1.22, "roll": 0.0, "pitch": 0.038, "yaw": -0.0195}
    one, other = cityscapes.read(sensor()), cityscapes.read({**K, **pose})
    np.testing.assert_allclose(one.camera_from_vehicle, other.camera_from_vehicle, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(one.intrinsics, other.intrinsics)


def test_cityscapes_order_of_the_angles():
    angles = {"roll": golden.ORDER_ROLL, "pitch": golden.ORDER_PITCH, "yaw": golden.ORDER_YAW}
    content = {**golden.CALIBRATION, "extrinsic": {**golden.CALIBRATION["extrinsic"], **angles}}
    uv, *_ = cityscapes.read(content).project(golden.ORDER_POINTS)
    np.testing.assert_allclose(uv, golden.ORDER_UV, rtol=0, atol=1e-9)
    uv, depth, valid = cityscapes.read(golden.CALIBRATION).project(golden.POINTS)
    np.testing.assert_allclose(uv, golden.UV, rtol=0, atol=1e-9)
    np.testing.assert_allclose(depth, golden.DEPTH, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(valid, golden.VALID)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (sensor(sensor_T_ISO_8855=None), "sensor.sensor_T_ISO_8855: expected a 3x4 matrix, got None"),
        (sensor(sensor_T_ISO_8855=[[0.0] * 4] * 3), "sensor.sensor_T_ISO_8855[:3, :3]: expected a rotation"),
        (sensor(sensor_T_ISO_8855=[[math.nan] * 4] * 3), "sensor.sensor_T_ISO_8855[0][0]: expected a finite number"),
        (sensor(fx=0), "sensor.fx: expected a finite, positive number"),
        ({"sensor": {}}, "missing sensor_T_ISO_8855; fx; fy; u0; v0"),
        ({"sensor": []}, "sensor: expected an object"),
        ({**sensor(), "imgWidth": 1024, "imgHeight": 512}, "image_size (1024, 512)"),
    ],
)
def test_cityscapes_3d_refused(content, named):
    with refuses(errors.CalibrationError, "Cityscapes calibration", named):
        cityscapes.read(content)


# ---------------------------------------------------------------------------------------------------------------------
# nuScenes, Lyft, nuImages


def test_nuscenes_front():
    camera = nuscenes.read(samples.FRONT_RECORD)
    uv, _, _ = camera.project(golden.NUSCENES_POINTS)
    np.testing.assert_allclose(uv, golden.NUSCENES_UV, rtol=0, atol=5.1e-7)
    np.testing.assert_allclose(camera.position, samples.FRONT_RECORD["translation"], rtol=0, atol=1e-12)
    assert camera.image_size == (1600, 900) and camera.lens is None


def test_nuscenes_order_of_the_quaternion():
    """A front camera's is nearly its own mirror under the other order; a side camera's is not."""
    rotation = [0.6757265034669446, -0.6736266522251881, 0.21214015046209478, -0.21122827103904068]
    record = {**samples.SIDE_RECORD, "rotation": rotation}
    axis = nuscenes.read(record).vehicle_from_camera[:3, 2]
    np.testing.assert_allclose(axis, golden.NUSCENES_SIDE_AXIS, rtol=0, atol=5e-6)
    turned = {**record, "rotation": [*record["rotation"][1:], record["rotation"][0]]}
    assert abs(nuscenes.read(turned).vehicle_from_camera[:3, 2] - axis).max() > 0.3


@pytest.mark.parametrize(
    "camera", ["CAM_FRONT_LEFT", samples.SIDE_RECORD["token"], samples.SIDE_RECORD["sensor_token"]]
)
@pytest.mark.parametrize("how", ["file", "directory", "list"])
def test_nuscenes_record_of_a_table(camera, how, tmp_path):
    path = SAMPLES["nuscenes"].write(tmp_path)
    source = {"file": path, "directory": tmp_path, "list": samples.NUSCENES_TABLE}[how]
    sensors = samples.SENSORS if how == "list" else None
    assert nuscenes.read(source, camera=camera, sensors=sensors) == nuscenes.read(samples.SIDE_RECORD)
    assert nuscenes.read(path, camera=camera, sensors=tmp_path / "sensor.json") == nuscenes.read(samples.SIDE_RECORD)


def test_nuscenes_table_of_many_scenes():
    """One name, several calibrations: a token is needed. The same numbers again are no second calibration."""
    again = {**samples.FRONT_RECORD, "token": "3" * 32}
    moved = {**again, "translation": [1.7, 0.0, 1.5], "token": "4" * 32}
    options = {"sensors": samples.SENSORS, "camera": "CAM_FRONT"}
    assert nuscenes.read([samples.FRONT_RECORD, again], **options) == nuscenes.read(samples.FRONT_RECORD)
    table = [samples.FRONT_RECORD, again, moved]
    with refuses(errors.ArgumentError, "'CAM_FRONT'", "2 of", "calibrated_sensor_token"):
        nuscenes.read(table, **options)
    assert nuscenes.read(table, camera="4" * 32) == nuscenes.read(moved)


def test_nuscenes_camera_must_be_said():
    with refuses(errors.ArgumentError, "camera: expected a token", "got none", "'CAM_FRONT', 'CAM_FRONT_LEFT'"):
        nuscenes.read(samples.NUSCENES_TABLE, sensors=samples.SENSORS)
    with refuses(errors.ArgumentError, "'CAM_BACK'", "no record", samples.FRONT_RECORD["token"]):
        nuscenes.read(samples.NUSCENES_TABLE, camera="CAM_BACK")
    with refuses(errors.ArgumentTypeError, "camera: expected a token or a name, got int 0"):
        nuscenes.read(samples.NUSCENES_TABLE, camera=0)
    with refuses(errors.ArgumentError, "expected none for one record, got 'CAM_BACK'"):
        nuscenes.read(samples.FRONT_RECORD, camera="CAM_BACK")
    assert nuscenes.read([samples.FRONT_RECORD, samples.LIDAR_RECORD]) == nuscenes.read(samples.FRONT_RECORD)


def test_nuscenes_lidar_is_no_camera():
    for source, camera in ((samples.LIDAR_RECORD, None), (samples.NUSCENES_TABLE, "LIDAR_TOP")):
        with refuses(errors.CalibrationError, "camera_intrinsic", "empty list", "lidars"):
            nuscenes.read(source, camera=camera, sensors=samples.SENSORS)


def test_lyft_has_two_sizes():
    record = {**samples.SIDE_RECORD, "token": "a" * 64, "sensor_token": "b" * 64}
    with refuses(errors.CalibrationError, "image_size", "1224x1024 or 1920x1080"):
        nuscenes.read(record)
    assert nuscenes.read(record, image_size=(1224, 1024)).image_size == (1224, 1024)


def test_nuimages_has_a_lens():
    camera = nuscenes.read(samples.NUIMAGES_RECORD)
    assert camera.lens == ipm_rs.BrownConrady(samples.NUIMAGES_RECORD["camera_distortion"])
    points = np.random.default_rng(1).uniform((5, 2, -1), (40, 30, 3), (200, 3))
    T = camera.camera_from_vehicle
    expected, _ = cv2.projectPoints(
        points @ T[:3, :3].T + T[:3, 3], np.zeros(3), np.zeros(3), camera.intrinsics, np.array(camera.lens.coefficients)
    )
    uv, _, valid = camera.project(points)
    assert valid.sum() > 30
    np.testing.assert_allclose(uv[valid], expected[valid, 0], rtol=0, atol=1e-8)
    assert nuscenes.read({**samples.NUIMAGES_RECORD, "camera_distortion": []}).lens is None
    with_zero = {**samples.NUIMAGES_RECORD, "camera_distortion": [*samples.NUIMAGES_RECORD["camera_distortion"], 0]}
    assert nuscenes.read(with_zero) == camera
    with_zero["camera_distortion"][5] = 0.01
    with refuses(errors.CalibrationError, "camera_distortion[5]", "0.01", "not documented"):
        nuscenes.read(with_zero)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"rotation": [0, 0, 0, 0]}, "rotation: expected a quaternion of norm 1 (w, x, y, z), got norm 0"),
        ({"rotation": [1, 1, 0, 0]}, "rotation: expected a quaternion of norm 1 (w, x, y, z), got norm 1.41421"),
        ({"rotation": [1, 0, 0]}, "rotation: expected 4 numbers, got 3"),
        ({"rotation": [math.nan, 0, 0, 1]}, "rotation[0]: expected a finite number, got nan"),
        ({"translation": [0, 0]}, "translation: expected 3 numbers, got 2"),
        ({"translation": {"x": 1}}, "translation: expected a list of 3 numbers, got dict"),
        ({"camera_intrinsic": [[1, 0, 0], [0, 1, 0]]}, "camera_intrinsic: expected a 3x3 matrix, got 2 rows of 3"),
        ({"camera_intrinsic": [[0, 0, 0]] * 3}, "nuScenes calibration"),
        ({"camera_distortion": [0.1] * 3}, "camera_distortion: expected 0, 4, 5 or 6 numbers, got 3"),
    ],
)
def test_nuscenes_refused(change, named):
    with refuses(errors.CalibrationError, "nuScenes calibration", named):
        nuscenes.read({**samples.FRONT_RECORD, **change})


@pytest.mark.parametrize("key", ["rotation", "translation", "camera_intrinsic"])
def test_nuscenes_missing_key(key, tmp_path):
    table = [samples.FRONT_RECORD, {k: v for k, v in samples.SIDE_RECORD.items() if k != key}]
    path = written("calibrated_sensor.json", table, tmp_path)
    with refuses(errors.CalibrationError, str(path), "[1]", "missing", key):
        nuscenes.read(path, camera=samples.SIDE_RECORD["token"])


def test_nuscenes_files_that_are_something_else(tmp_path):
    with refuses(errors.CalibrationError, "expected a list of records", "got int 3"):
        nuscenes.read(written("calibrated_sensor.json", 3, tmp_path))
    with refuses(errors.CalibrationError, "[0]: expected an object", "got int 3"):
        nuscenes.read(written("calibrated_sensor.json", [3], tmp_path))
    with refuses(errors.CalibrationError, "sensor.json", "expected a list of records"):
        nuscenes.read(samples.NUSCENES_TABLE, camera="CAM_FRONT", sensors=written("sensor.json", {}, tmp_path))
    with refuses(errors.CalibrationError, "sensors", "[0]", "missing token"):
        nuscenes.read(samples.NUSCENES_TABLE, camera="CAM_FRONT", sensors=[{}])


def test_real_nuscenes_files(shared_data):
    files = shared_data / "calibration_files"
    record = json.loads((files / "nuscenes_calibrated_sensor_record.json").read_text())
    camera = ipm_rs.Camera.load(files / "nuscenes_calibrated_sensor_record.json")
    np.testing.assert_allclose(camera.project(golden.NUSCENES_POINTS)[0], golden.NUSCENES_UV, rtol=0, atol=5.1e-7)
    assert camera == nuscenes.read(samples.FRONT_RECORD) == nuscenes.read(record)
    table = json.loads((files / "nuscenes_schema_calibrated_sensor.json").read_text())
    for row in table:
        if row["camera_intrinsic"]:
            path = files / "nuscenes_schema_calibrated_sensor.json"
            camera = ipm_rs.Camera.load(path, image_size=(1920, 1080), camera=row["token"])
            np.testing.assert_allclose(camera.position, row["translation"], rtol=0, atol=1e-12)
            assert abs(camera.vehicle_from_camera[2, 2]) < 0.2, "Lyft's cameras look along the road"
    with refuses(errors.ArgumentError, *(repr(row["token"]) for row in table if row["camera_intrinsic"])):
        ipm_rs.Camera.load(path)  # tokens in full, to be passed on


def test_real_nuscenes_sample_agrees_with_matrices(shared_data):
    """The quaternion of the record is the matrix that another tool made of it."""
    other = json.loads((shared_data / "nuscenes" / "calibration.json").read_text())["CAM_FRONT"]
    camera = nuscenes.read(samples.FRONT_RECORD)
    np.testing.assert_allclose(camera.vehicle_from_camera, other["cam2ego"], rtol=0, atol=5e-7)


# ---------------------------------------------------------------------------------------------------------------------
# Argoverse 2

TABLES = {"intrinsics": [samples.AV2_INTRINSICS], "egovehicle_SE3_sensor": [samples.AV2_POSE]}


@pytest.mark.parametrize("how", ["rows", "flat", "log", "calibration", "file"])
def test_argoverse2(how, tmp_path):
    if how in ("rows", "flat"):
        source = TABLES if how == "rows" else {**samples.AV2_POSE, **samples.AV2_INTRINSICS}
    else:
        pytest.importorskip("pyarrow")
        log = SAMPLES["argoverse2"].write(tmp_path)
        source = {"log": log, "calibration": log / "calibration", "file": log / "calibration" / "intrinsics.feather"}[
            how
        ]
    camera = ipm_rs.Camera.from_argoverse2(source)
    uv, *_ = camera.project(golden.ARGOVERSE2_POINTS)
    np.testing.assert_allclose(uv, golden.ARGOVERSE2_UV, rtol=0, atol=5.1e-7)
    assert camera.image_size == (1550, 2048), "portrait"
    assert camera.lens is None, "the images are undistorted: k1, k2, k3 are not for them"


def test_argoverse2_other_camera(tmp_path):
    pytest.importorskip("pyarrow")
    log = SAMPLES["argoverse2"].write(tmp_path)
    assert ipm_rs.Camera.load(log, camera="ring_side_left").image_size == (2048, 1550)
    with refuses(errors.ArgumentError, "got 'ring_rear'", "'ring_side_left', 'ring_front_center'"):
        ipm_rs.Camera.load(log, camera="ring_rear")
    with refuses(errors.ArgumentError, "intrinsics.feather", "got 'up_lidar'"):
        ipm_rs.Camera.load(log, camera="up_lidar")


@pytest.mark.parametrize(
    ("table", "change", "named"),
    [
        ("intrinsics", {"fx_px": 0.0}, "fx_px: expected a finite, positive number, got 0.0"),
        ("intrinsics", {"cy_px": math.inf}, "cy_px: expected a finite number, got inf"),
        ("intrinsics", {"width_px": 1550.5}, "width_px: expected a whole number"),
        (
            "egovehicle_SE3_sensor",
            {"qw": 0.0, "qx": 0.0, "qy": 0.0, "qz": 0.0},
            "qw qx qy qz: expected a quaternion of norm 1",
        ),
        ("egovehicle_SE3_sensor", {"qw": None}, "qw qx qy qz[0]: expected a finite number, got None"),
        ("egovehicle_SE3_sensor", {"tz_m": "1"}, "tz_m: expected a finite number, got str '1'"),
    ],
)
def test_argoverse2_refused(table, change, named):
    rows = [{**TABLES[table][0], **change}]
    with refuses(errors.CalibrationError, f"Argoverse 2 calibration: {table}", named):
        argoverse2.read({**TABLES, table: rows})
    (key, *_) = change
    rows = [{k: v for k, v in TABLES[table][0].items() if k != key}]
    with refuses(errors.CalibrationError, "missing", key):
        argoverse2.read({**TABLES, table: rows})


def test_argoverse2_tables():
    with refuses(errors.CalibrationError, "missing egovehicle_SE3_sensor"):
        argoverse2.read({"intrinsics": []})
    with refuses(errors.CalibrationError, "one row for 'ring_front_center'", "got 2"):
        argoverse2.read({**TABLES, "intrinsics": TABLES["intrinsics"] * 2})
    with refuses(errors.CalibrationError, "expected a list of rows", "got int 3"):
        argoverse2.read({**TABLES, "intrinsics": 3})
    with refuses(errors.ArgumentTypeError, "camera: expected a sensor_name, got int 0"):
        argoverse2.read(TABLES, camera=0)


def test_argoverse2_without_pyarrow(tmp_path, monkeypatch):
    for name in samples.argoverse2_files():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"ARROW1")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with refuses(errors.MissingExtraError, "ipm-rs[arrow]", "intrinsics.feather"):
        ipm_rs.Camera.load(tmp_path / "log")
    assert argoverse2.read(TABLES).image_size == (1550, 2048), "rows need no pyarrow"


def test_argoverse2_damaged_file(tmp_path):
    pytest.importorskip("pyarrow")
    path = SAMPLES["argoverse2"].write(tmp_path) / "calibration" / "egovehicle_SE3_sensor.feather"
    data = path.read_bytes()
    for cut in (0, 7, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:cut])
        with refuses(errors.CalibrationError, str(path), "expected a feather file", "cut short"):
            argoverse2.read(tmp_path / "log")


# ---------------------------------------------------------------------------------------------------------------------
# Waymo


def test_waymo_golden():
    camera = waymo.read(samples.WAYMO)
    (ray,) = camera.unproject([golden.WAYMO_PIXEL])
    depth = ray @ camera.camera_from_vehicle[2, :3]
    point = camera.position + ray / depth * golden.WAYMO_DEPTH
    np.testing.assert_allclose(point, golden.WAYMO_POINT, rtol=0, atol=8.5e-6)
    assert camera.image_size == (1920, 1280)


def test_waymo_axes_and_lens():
    points = np.random.default_rng(2).uniform((6, -8, -2), (60, 8, 4), (300, 3))
    local = (points - np.reshape(samples.WAYMO["extrinsic"]["transform"], (4, 4))[:3, 3]) @ np.reshape(
        samples.WAYMO["extrinsic"]["transform"], (4, 4)
    )[:3, :3]
    optical = local @ samples.OPTICAL_FROM_FLU.T
    fu, fv, cu, cv, *D = samples.WAYMO["intrinsic"]
    K = np.array([[fu, 0, cu], [0, fv, cv], [0, 0, 1]])
    expected, _ = cv2.projectPoints(optical, np.zeros(3), np.zeros(3), K, np.array(D))
    uv, _, valid = waymo.read(samples.WAYMO).project(points)
    assert valid.sum() > 100
    np.testing.assert_allclose(uv[valid], expected[valid, 0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("camera", ["SIDE_LEFT", 4])
@pytest.mark.parametrize("key", ["cameraCalibrations", "camera_calibrations", None])
def test_waymo_one_of_several(camera, key):
    left = {**samples.WAYMO, "name": "SIDE_LEFT" if key else 4, "width": 1919}
    every = [samples.WAYMO, left]
    assert waymo.read({key: every} if key else every, camera=camera).image_size == (1919, 1280)
    with refuses(errors.ArgumentError, "got none", "'FRONT', 'SIDE_LEFT'"):
        waymo.read(every)
    with refuses(errors.ArgumentError, "got 'REAR'"):
        waymo.read(every, camera="REAR")
    with refuses(errors.ArgumentError, "which 2 have"):
        waymo.read([left, left], camera="SIDE_LEFT")


def test_waymo_parquet_row():
    prefix = "[CameraCalibrationComponent]."
    names = ("f_u", "f_v", "c_u", "c_v", "k1", "k2", "p1", "p2", "k3")
    row = {
        "key.segment_context_name": "1005081002024129653_5313_150_5333_150",
        "key.camera_name": 1,
        **{f"{prefix}intrinsic.{n}": v for n, v in zip(names, samples.WAYMO["intrinsic"], strict=True)},
        f"{prefix}extrinsic.transform": np.array(samples.WAYMO["extrinsic"]["transform"]),
        f"{prefix}width": 1920,
        f"{prefix}height": np.int32(1280),
        f"{prefix}rolling_shutter_direction": 3,
    }
    assert waymo.read(row) == waymo.read(samples.WAYMO)
    assert waymo.read([row, {**row, "key.camera_name": 2}], camera="FRONT") == waymo.read(samples.WAYMO)
    del row[f"{prefix}width"]
    with refuses(errors.CalibrationError, "missing", f"{prefix}width"):
        waymo.read(row)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"intrinsic": [1.0] * 8}, "intrinsic: expected 9 numbers, got 8"),
        ({"intrinsic": [0.0] * 9}, "intrinsic: expected a positive focal length f_u, got 0"),
        ({"extrinsic": {"transform": [0.0] * 16}}, "extrinsic.transform[:3, :3]: expected a rotation"),
        ({"extrinsic": {}}, "extrinsic: expected the keys transform, missing transform"),
        ({"extrinsic": 3}, "extrinsic: expected a 3x4 matrix, got int 3"),
        ({"width": 0}, "width: expected a whole number"),
        ({"height": None}, "height: expected a finite number, got None"),
    ],
)
def test_waymo_refused(change, named):
    with refuses(errors.CalibrationError, "Waymo calibration", named):
        waymo.read({**samples.WAYMO, **change})


def test_waymo_message():
    """A protobuf message has attributes, and repeated fields that are no lists."""
    fields = {**samples.WAYMO, "intrinsic": tuple(samples.WAYMO["intrinsic"]), "name": 1}
    fields["extrinsic"] = types.SimpleNamespace(transform=tuple(samples.WAYMO["extrinsic"]["transform"]))
    message = types.SimpleNamespace(**fields)
    assert waymo.read(message) == waymo.read([message]) == waymo.read(samples.WAYMO)
    assert waymo.read([message], camera="FRONT") == waymo.read(samples.WAYMO)
    message.extrinsic = None
    with refuses(errors.ArgumentTypeError, "CameraCalibration message", "SimpleNamespace", "mapping"):
        waymo.read(message)


def test_waymo_transform_by_columns():
    T = np.reshape(samples.WAYMO["extrinsic"]["transform"], (4, 4)).T.ravel().tolist()
    with refuses(errors.CalibrationError, "extrinsic.transform[3]", "stored by columns"):
        waymo.read({**samples.WAYMO, "extrinsic": {"transform": T}})
