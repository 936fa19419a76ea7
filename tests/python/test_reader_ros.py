"""ROS CameraInfo: raw and rectified, YAML, INI and messages, binning and regions, against OpenCV."""

from __future__ import annotations

import array
import types

import calibration_samples as samples
import cv2
import numpy as np
import pytest
from helpers import refuses
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import ros

K = np.array([[438.783367, 0.0, 305.593336], [0.0, 437.302876, 243.738352], [0.0, 0.0, 1.0]])
D = [-0.361976, 0.110510, 0.001014, 0.000505, 0.0]
R = [[0.999978, 0.002789, -0.006046], [-0.002816, 0.999986, -0.004401], [0.006034, 0.004417, 0.999972]]
P = np.array([[393.6538, 0, 322.797939, -31.5], [0, 393.6538, 241.090902, 0], [0, 0, 1, 0]])

POSE = ipm_rs.Camera.from_euler(np.eye(3), image_size=(1, 1), position=(1.2, 0.3, 1.5), roll=0.02, pitch=0.2, yaw=-0.1)
T = POSE.camera_from_vehicle
POINTS = np.array([[8.0, 0.5, 0.0], [12.0, -3.0, 0.5], [6.0, 1.0, 1.0], [20.0, 4.0, 2.0]])
OPTICAL = POINTS @ T[:3, :3].T + T[:3, 3]


def content(**changes) -> dict:
    """The file's content; a change of None removes the key."""
    whole = {
        "image_width": 640,
        "image_height": 480,
        "camera_name": "left",
        "camera_matrix": {"rows": 3, "cols": 3, "data": K.ravel().tolist()},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": D},
        "rectification_matrix": {"rows": 3, "cols": 3, "data": np.ravel(R).tolist()},
        "projection_matrix": {"rows": 3, "cols": 4, "data": P.ravel().tolist()},
        **changes,
    }
    return {key: value for key, value in whole.items() if value is not None}


def test_raw_is_K_and_D(tmp_path):
    path = tmp_path / "left.yaml"
    path.write_bytes(samples.ROS_YAML)
    for source in (path, content()):
        camera = ipm_rs.Camera.from_ros(source, camera_from_vehicle=T)
        assert camera.image_size == (640, 480)
        assert camera.lens == ipm_rs.BrownConrady(D)
        expected = cv2.projectPoints(OPTICAL, np.zeros(3), np.zeros(3), K, np.array(D))[0][:, 0]
        np.testing.assert_allclose(camera.project(POINTS)[0], expected, rtol=0, atol=1e-9)


def test_rectified_is_P_and_R():
    camera = ipm_rs.Camera.from_ros(content(), image="rectified", vehicle_from_camera=np.linalg.inv(T))
    assert camera.lens is None
    homogeneous = np.column_stack([OPTICAL @ np.array(R).T, np.ones(len(OPTICAL))]) @ P.T
    np.testing.assert_allclose(camera.project(POINTS)[0], homogeneous[:, :2] / homogeneous[:, 2:], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(camera.intrinsics, P[:, :3])


def test_rectified_and_raw_show_the_same_rays():
    """Undistorting the raw pixel with OpenCV gives the rectified one, for a camera without a stereo offset."""
    flat = P.copy()
    flat[0, 3] = 0
    whole = content(projection_matrix=flat.tolist())
    raw = ipm_rs.Camera.from_ros(whole, camera_from_vehicle=T).project(POINTS)[0]
    rectified = ipm_rs.Camera.from_ros(whole, image="rectified", camera_from_vehicle=T).project(POINTS)[0]
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-14)
    theirs = cv2.undistortPoints(raw[:, None], K, np.array(D), None, np.array(R), flat, criteria)[:, 0]
    # The printed rotation is one to 1e-6 only, and OpenCV does not repeat its division by w: hence the tolerance.
    np.testing.assert_allclose(rectified, theirs, rtol=0, atol=1e-3)


def test_no_pose_looks_ahead():
    camera = ipm_rs.Camera.from_ros(content())
    np.testing.assert_array_equal(camera.camera_from_vehicle[:3, :3], [[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    np.testing.assert_array_equal(camera.position, [0, 0, 0])


def test_ini_equals_yaml(tmp_path):
    (tmp_path / "ost.txt").write_bytes(samples.ROS_INI)
    (tmp_path / "ost.yaml").write_bytes(samples.ROS_YAML)
    for image in ("raw", "rectified"):
        assert ros.read(tmp_path / "ost.txt", image=image) == ros.read(tmp_path / "ost.yaml", image=image)


def test_ini_of_two_cameras(tmp_path):
    path = tmp_path / "stereo.ini"
    path.write_bytes(samples.ROS_INI + samples.ROS_INI.replace(b"/left", b"/right").replace(b"438.7", b"439.7"))
    assert ros.read(path, camera="narrow_stereo/right").intrinsics[0, 0] == 439.783367
    assert ros.read(path, camera="narrow_stereo/left").intrinsics[0, 0] == 438.783367
    with refuses(errors.ArgumentError, str(path), "camera: expected one of", "narrow_stereo/right"):
        ros.read(path)


@pytest.mark.parametrize(
    ("model", "values", "lens"),
    [
        ("plumb_bob", D, ipm_rs.BrownConrady(D)),
        ("plumb_bob", [0.0] * 5, None),
        (None, D, ipm_rs.BrownConrady(D)),
        ("", [], None),
        ("none", [0.0], None),
        (None, [0.0] * 4, None),
        ("rational_polynomial", [0.18, -0.018, -6e-4, 5e-5, -2e-4, 0.54, -0.027, 0.001], "same"),
        ("equidistant", [0.01, -0.02, 0.003, -0.0004], ipm_rs.KannalaBrandt([0.01, -0.02, 0.003, -0.0004])),
        ("equidistant", [0.0] * 4, ipm_rs.KannalaBrandt([0.0] * 4)),
    ],
)
def test_models(model, values, lens):
    lens = ipm_rs.BrownConrady(values) if lens == "same" else lens
    assert ros.read(content(distortion_model=model, distortion_coefficients=values)).lens == lens


def message(upper: bool, **changes):
    """What rclpy or rospy deliver, as far as a reader can see."""
    names = "KDRP" if upper else "kdrp"
    fields = {
        "width": 640, "height": 480, "distortion_model": "plumb_bob", "binning_x": 0, "binning_y": 0,
        "roi": types.SimpleNamespace(x_offset=0, y_offset=0, width=0, height=0, do_rectify=False),
        names[0]: np.ravel(K), names[1]: array.array("d", D), names[2]: tuple(np.ravel(R)), names[3]: np.ravel(P),
        **changes,
    }  # fmt: skip
    return types.SimpleNamespace(**fields)


@pytest.mark.parametrize("upper", [True, False], ids=["ROS 1", "ROS 2"])
def test_messages(upper):
    for image in ("raw", "rectified"):
        assert ros.read(message(upper), image=image) == ros.read(content(), image=image)


def test_region_and_binning_follow_the_pixels():
    """A pixel of the published image, traced back to the full one, is on the same ray."""
    roi = {"x_offset": 40, "y_offset": 30, "width": 560, "height": 400}
    full, published = ros.read(content()), ros.read(content(roi=roi, binning_x=2, binning_y=4))
    assert published.image_size == (280, 100)
    back = (published.project(POINTS)[0] + 0.5) * [2, 4] - 0.5 + [40, 30]
    np.testing.assert_allclose(back, full.project(POINTS)[0], rtol=0, atol=1e-9)
    theirs = ros.read(content(roi=roi, binning_x=2, binning_y=4), ros_binning=True)
    np.testing.assert_allclose(theirs.intrinsics[:2, 2], (K[:2, 2] - [40, 30]) / [2, 4], rtol=0, atol=1e-12)
    assert ros.read(content(binning_x=1, binning_y=0, roi=dict.fromkeys(roi, 0))) == full


@pytest.mark.parametrize(
    ("changes", "phrases"),
    [
        ({"camera_matrix": [0.0] * 9}, ["camera_matrix", "uncalibrated"]),
        ({"camera_matrix": None}, ["missing camera_matrix"]),
        ({"image_width": None, "image_height": None}, ["missing image_width, image_height"]),
        ({"image_width": 0}, ["image_width", "whole number"]),
        ({"image_width": 640.5}, ["image_width", "640.5"]),
        ({"image_width": "wide"}, ["image_width", "'wide'"]),
        ({"camera_matrix": [1.0] * 8}, ["camera_matrix", "3x3", "8 numbers"]),
        ({"camera_matrix": {"rows": 3, "cols": 3, "data": [1.0] * 8}}, ["camera_matrix", "got 8"]),
        ({"camera_matrix": [float("nan")] * 9}, ["camera_matrix", "finite", "nan"]),
        ({"camera_matrix": [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]}, ["ROS CameraInfo"]),
        ({"distortion_coefficients": [0.1] * 3}, ["distortion_coefficients (plumb_bob)", "5 or 4", "got 3"]),
        ({"distortion_coefficients": [0.1, 0.2, 0.3, 0.4, "x"]}, ["distortion_coefficients[4]", "'x'"]),
        ({"distortion_model": None, "distortion_coefficients": [0.1] * 4}, ["distortion_model", "4 coefficients"]),
        ({"distortion_model": "none"}, ["distortion_model", "'none'"]),
        ({"distortion_model": "fov"}, ["distortion_model", "plumb_bob", "'fov'"]),
        ({"distortion_model": 3}, ["distortion_model", "int 3"]),
        ({"roi": {"x_offset": 600, "y_offset": 0, "width": 100, "height": 480}}, ["roi", "inside of 640x480"]),
        ({"roi": {"width": 10}}, ["roi", "10x0"]),
        ({"roi": 7}, ["roi", "int 7"]),
        ({"binning_x": 1000}, ["binning_x", "0x480"]),
        ({"binning_y": -1}, ["binning_y", "-1"]),
    ],
)
def test_what_is_refused(changes, phrases):
    with refuses(errors.CalibrationError, "ROS CameraInfo calibration: ", *phrases):
        ros.read(content(**changes))


@pytest.mark.parametrize(
    ("changes", "phrases"),
    [
        ({"projection_matrix": None}, ["missing projection_matrix"]),
        ({"projection_matrix": [0.0] * 12}, ["projection_matrix", "uncalibrated"]),
        ({"projection_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]]}, ["projection_matrix", "0 0 1"]),
        ({"rectification_matrix": [0.0] * 9}, ["rectification_matrix", "rotation"]),
        ({"rectification_matrix": [-1, 0, 0, 0, 1, 0, 0, 0, 1]}, ["rectification_matrix", "reflection"]),
    ],
)
def test_what_is_refused_of_a_rectified_camera(changes, phrases):
    with refuses(errors.CalibrationError, "ROS CameraInfo calibration: ", *phrases):
        ros.read(content(**changes), image="rectified")


def test_arguments():
    with refuses(errors.ArgumentError, "image: expected 'raw' or 'rectified'", "'both'"):
        ros.read(content(), image="both")
    with refuses(errors.CalibrationError, "image_size", "(640, 480)"):
        ros.read(content(), image_size=(320, 240))
    with refuses(errors.ArgumentError, "camera: expected 'left'", "'right'"):
        ros.read(content(), camera="right")
    with refuses(errors.ArgumentTypeError, "a CameraInfo message", "int"):
        ros.read(3)
    with refuses(errors.IpmError, "camera_from_vehicle", "vehicle_from_camera"):
        ros.read(content(), camera_from_vehicle=T, vehicle_from_camera=T)


INI = samples.ROS_INI.decode()


@pytest.mark.parametrize(
    ("text", "phrases"),
    [
        (INI.replace("camera matrix", "matrix"), ["camera matrix"]),
        (INI.replace("0.000505 0.000000\n", "0.000505\n"), ["distortion", "got 4", "YAML form"]),
        (INI.replace("0.000505", "five"), ["distortion_coefficients[3]", "'five'"]),
        (INI.replace("width\n640", "width\n640 480"), ["image_width", "list [640, 480]"]),
        (INI.replace("width\n", ""), ["line 5", "name above"]),
        (INI.replace("437.302876", ""), ["camera_matrix", "8 numbers"]),
        (INI.replace("[image]", "[picture]"), ["missing image_width"]),
        (INI + "[narrow_stereo/left]\n", ["[narrow_stereo/left] again"]),
        (INI + "projection\n1\n", ["'projection' again"]),
        (INI[: INI.index("distortion")], ["missing 'distortion', 'rectification', 'projection'", "cut short"]),
        (INI[: INI.index("rectification")], ["missing 'rectification', 'projection'", "cut short"]),
        (INI.replace("-0.361976 0.110510 0.001014 0.000505 0.000000\n", ""), ["distortion", "got 0"]),
        (INI.replace("438.783367", "0").replace("437.302876", "0"), ["uncalibrated"]),
    ],
)
def test_ini_that_is_refused(text, phrases, tmp_path):
    path = tmp_path / "ost.txt"
    path.write_text(text)
    with refuses(errors.CalibrationError, str(path), *phrases):
        ros.read(path)


def test_ini_of_eight_coefficients_cut_after_five(tmp_path):
    """Five are another model's count: the file would be read, with a lens that it never had."""
    path = tmp_path / "ost.txt"
    eight = "0.18 -0.018 -0.0006 0.00005 -0.0002 0.54 -0.027 0.001"
    text = INI.replace("-0.361976 0.110510 0.001014 0.000505 0.000000", eight)
    path.write_text(text)
    assert len(ros.read(path).lens.coefficients) == 8
    path.write_text(text[: text.index(" 0.54")])
    with refuses(errors.CalibrationError, str(path), "narrow_stereo/left", "missing", "cut short"):
        ipm_rs.Camera.load(path)


@pytest.mark.parametrize("camera", [[], {}, 3, np.zeros(2)], ids=lambda camera: type(camera).__name__)
def test_camera_of_another_type(camera, tmp_path):
    path = tmp_path / "ost.txt"
    path.write_text(INI)
    with refuses(errors.ArgumentError, str(path), "camera: expected one of", "narrow_stereo/left"):
        ros.read(path, camera=camera)
    with refuses(errors.ArgumentError, "camera: expected 'left'"):
        ros.read(content(), camera=camera)
    with refuses(errors.ArgumentError, "image: expected"):
        ros.read(content(), image=camera)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4) | st.just(10**400),
    lambda inner: st.lists(inner, max_size=12) | st.dictionaries(st.sampled_from(["rows", "cols", "data", "x"]), inner),
    max_leaves=12,
)


@given(key=st.sampled_from([*content(), "roi", "binning_x", "K", "d", "width"]), value=json_values, image=st.booleans())
def test_any_value_of_any_key(key, value, image):
    try:
        ros.read({**content(), key: value}, image="raw" if image else "rectified")
    except errors.IpmError as error:
        assert len(str(error)) < 2000
