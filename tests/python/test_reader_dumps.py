"""CameraInfo messages as `rostopic echo` and `ros2 topic echo` print them, and as JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import calibration, errors

yaml = pytest.importorskip("yaml")

K = [1310.5, 0.0, 958.25, 0.0, 1309.0, 540.75, 0.0, 0.0, 1.0]
D = [-0.29, 0.11, 0.0004, -0.0007, -0.02]
INFO = {
    "header": {"stamp": {"sec": 12, "nanosec": 5}, "frame_id": "rear_optical"},
    "height": 1080,
    "width": 1920,
    "distortion_model": "plumb_bob",
    "d": D,
    "k": K,
    "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
    "p": [1310.5, 0.0, 958.25, 0.0, 0.0, 1309.0, 540.75, 0.0, 0.0, 0.0, 1.0, 0.0],
    "binning_x": 0,
    "binning_y": 0,
    "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
}


def upper(info):
    return {key.upper() if key in "kdrp" else key: value for key, value in info.items()}


def dump(*infos) -> str:
    return "".join(yaml.safe_dump(info, sort_keys=False) + "---\n" for info in infos)


@pytest.fixture
def load(tmp_path):
    def read(text, name="info.yaml", **options):
        path = tmp_path / name
        path.write_text(text)
        assert calibration.recognise(path) == "ros"
        return ipm_rs.Camera.load(path, **options)

    return read


@pytest.mark.parametrize("change", [dict, upper], ids=["ROS 2", "ROS 1"])
def test_a_message_as_yaml_and_json(change, load):
    info = change(INFO)
    for text in (dump(info), dump(info)[:-4], json.dumps(info), json.dumps([info, info])):
        camera = load(text)
        np.testing.assert_array_equal(camera.intrinsics, np.reshape(K, (3, 3)))
        assert camera.image_size == (1920, 1080) and camera.lens == ipm_rs.BrownConrady(D)


@pytest.mark.parametrize("change", [dict, upper], ids=["ROS 2", "ROS 1"])
def test_binning_and_region(change, load):
    roi = {"x_offset": 320, "y_offset": 100, "width": 1280, "height": 800, "do_rectify": True}
    camera = load(dump(change({**INFO, "binning_x": 4, "binning_y": 2, "roi": roi})))
    assert camera.image_size == (320, 400)
    c = [(958.25 - 320 + 0.5) / 4 - 0.5, (540.75 - 100 + 0.5) / 2 - 0.5]
    np.testing.assert_allclose(camera.intrinsics, [[1310.5 / 4, 0, c[0]], [0, 1309 / 2, c[1]], [0, 0, 1]], atol=1e-12)


def test_several_messages(load):
    later = {**INFO, "header": {"stamp": {"sec": 13, "nanosec": 0}, "frame_id": "rear_optical"}}
    assert load(dump(INFO, later, later)) == load(dump(INFO))
    for key, value in (("k", [9.0, *K[1:]]), ("binning_x", 2), ("d", [0.0] * 5), ("width", 1280)):
        with refuses(errors.CalibrationError, "expected one calibration", f"document 2 with another {key}", "'---'"):
            load(dump(INFO, {**INFO, key: value}))


def test_a_dump_that_was_cut(load):
    text = dump(INFO, INFO)
    with refuses(errors.CalibrationError, "document 2 with another"):
        load(text[: text.rindex("binning_x")])


def test_several_files_in_one(load):
    info = {
        "image_width": 1920,
        "image_height": 1080,
        "camera_name": "left",
        "camera_matrix": {"rows": 3, "cols": 3, "data": K},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": D},
    }
    other = {**info, "camera_name": "right", "camera_matrix": {"rows": 3, "cols": 3, "data": [1200.0, *K[1:]]}}
    assert load(dump(info, other), camera="right").intrinsics[0, 0] == 1200
    assert load(dump(info, other), camera="left").intrinsics[0, 0] == 1310.5
    with refuses(errors.CalibrationError, "document 2 with another camera_matrix"):
        load(dump(info, other))


def test_uncalibrated_messages(load):
    with refuses(errors.CalibrationError, "uncalibrated"):
        load(dump({**INFO, "k": [0.0] * 9, "p": [0.0] * 12}))


def test_a_message_without_its_matrices_is_none_of_ros(tmp_path):
    """OpenCV's reader takes K, D, width and height alone; a dump has R or P too."""
    path = tmp_path / "camera.json"
    path.write_text(json.dumps({"K": K, "D": D, "width": 1920, "height": 1080}))
    assert calibration.recognise(path) == "opencv"


@pytest.mark.parametrize(
    ("model", "terms", "lens"),
    [
        ("plumb_bob", [*D, 0.0, 0.0, 0.0], ipm_rs.BrownConrady(D)),
        ("plumb_bob", [0.0] * 8, None),
        ("plumb_bob", [0.0], None),
        (
            "rational_polynomial",
            [*D, 0.4, 0.1, 0.01, *[0.0] * 6],
            ipm_rs.BrownConrady([*D, 0.4, 0.1, 0.01, *[0.0] * 6]),
        ),
        ("rational_polynomial", [*D, 0.4, 0.1, 0.01, 0.0], ipm_rs.BrownConrady([*D, 0.4, 0.1, 0.01])),
        ("equidistant", [0.02, 0.01, -0.003, 0.001, 0.0], ipm_rs.KannalaBrandt([0.02, 0.01, -0.003, 0.001])),
    ],
)
def test_zeros_beyond_the_model(model, terms, lens, load):
    assert load(dump({**INFO, "distortion_model": model, "d": terms})).lens == lens


@pytest.mark.parametrize("columns", [5, 8])
def test_zeros_beyond_what_the_header_says(columns):
    whole = {"rows": 1, "cols": columns, "data": [*D, 0.4, 0.1, 0.01][:columns] + [0.0] * 6}
    info = {**INFO, "distortion_model": "rational_polynomial" if columns == 8 else "plumb_bob", "d": whole}
    assert ipm_rs.Camera.from_ros(info).lens == ipm_rs.BrownConrady(whole["data"][:columns])
    with refuses(errors.CalibrationError, "d: data", f"1 x {columns} numbers, got {columns + 1}", "rows and cols"):
        ipm_rs.Camera.from_ros({**info, "d": {**whole, "data": [*whole["data"][:columns], 0.1]}})
    assert ipm_rs.Camera.from_ros({**info, "d": {**whole, "data": [0.0] * 4}}).lens is None
    with refuses(errors.CalibrationError, f"1 x {columns} numbers, got 4"):
        ipm_rs.Camera.from_ros({**info, "d": {**whole, "data": D[:4]}})


def test_a_stereo_offset_in_millimetres():
    P = [*INFO["p"]]
    P[3] = -1310.5 * 240.0
    info = {**INFO, "p": P}
    with refuses(errors.CalibrationError, "p: expected metres", "240", "metres_per_unit="):
        ipm_rs.Camera.from_ros(info, image="rectified")
    camera = ipm_rs.Camera.from_ros(info, image="rectified", metres_per_unit=0.001)
    np.testing.assert_allclose(camera.position, [0, -0.24, 0], atol=1e-12)
    assert ipm_rs.Camera.from_ros(info) == ipm_rs.Camera.from_ros(INFO)
