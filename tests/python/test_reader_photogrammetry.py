"""OpenSfM, Metashape and RealSense: every number against an independent reading, and the wrong files."""

from __future__ import annotations

import json
import logging

import numpy as np
import pytest
from calibration_fleets import METASHAPE, OPENSFM, REALSENSE, REALSENSE_TEXT
from calibration_samples import SAMPLES
from helpers import refuses

import ipm_rs
from ipm_rs import BrownConrady, Camera, KannalaBrandt, errors

cv2 = pytest.importorskip("cv2")

ENU = [[1.0, 0, 0, 5], [0, 1, 0, -2], [0, 0, 1, 0], [0, 0, 0, 1]]


def copy(content):
    return json.loads(json.dumps(content))


# ---------------------------------------------------------------------------------------------------------------------
# OpenSfM


def test_opensfm_brown_by_its_formulas(tmp_path):
    """Normalised coordinates of `geometry.rst`, then its matrix to pixels."""
    path = SAMPLES["opensfm"].write(tmp_path)
    camera = Camera.load(path, camera="DJI_0001.JPG")
    model, shot = list(OPENSFM[0]["cameras"].values())[1], OPENSFM[0]["shots"]["DJI_0001.JPG"]
    R = cv2.Rodrigues(np.array(shot["rotation"]))[0]
    seen = np.array([[0.1, -0.2, 1.0], [-0.3, 0.15, 1.0], [0.2, 0.3, 1.0]]) * 7.5
    world = (seen - shot["translation"]) @ R
    x, y = seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2]
    r2 = x * x + y * y
    d = 1 + model["k1"] * r2 + model["k2"] * r2**2 + model["k3"] * r2**3
    tx = 2 * model["p1"] * x * y + model["p2"] * (r2 + 2 * x * x)
    ty = 2 * model["p2"] * x * y + model["p1"] * (r2 + 2 * y * y)
    u = model["focal_x"] * (d * x + tx) + model["c_x"]
    v = model["focal_y"] * (d * y + ty) + model["c_y"]
    expected = np.column_stack([4000 * u + (3000 - 1) / 2, 4000 * v + (4000 - 1) / 2])
    np.testing.assert_allclose(camera.project(world)[0], expected, rtol=0, atol=1e-9)
    moved = Camera.from_opensfm(path, camera="DJI_0001.JPG", vehicle_from_world=ENU, metres_per_unit=2.0)
    np.testing.assert_allclose(moved.project(2 * world + [5, -2, 0])[0], expected, rtol=0, atol=1e-9)
    assert list(Camera.load_all(path)) == ["03.jpg", "DJI_0001.JPG"]


def test_opensfm_perspective_and_the_other_models():
    camera = Camera.from_opensfm(OPENSFM, camera="03.jpg")
    K = [[3264 * 0.8697, 0, 1631.5], [0, 3264 * 0.8697, 1223.5], [0, 0, 1]]
    np.testing.assert_allclose(camera.intrinsics, K, rtol=0, atol=1e-9)
    assert camera.lens == BrownConrady([0.0885, -0.2324, 0, 0]) and camera.image_size == (3264, 2448)
    sized = {"width": 640, "height": 480}
    models = {
        "fish": {"projection_type": "fisheye", **sized, "focal": 0.5, "k1": 0.01, "k2": -0.02},
        "cv": {"projection_type": "fisheye_opencv", **sized, "focal_x": 0.5, "focal_y": 0.6, "k1": 0.1, "k4": 0.02},
        "simple": {"projection_type": "simple_radial", "focal_x": 0.5, "focal_y": 0.5, "k1": 0.1},
        "ball": {"projection_type": "spherical", **sized},
    }
    assert Camera.from_opensfm(models, camera="fish").lens == KannalaBrandt([0.01, -0.02, 0, 0])
    bent = Camera.from_opensfm(models, camera="cv")
    assert bent.lens == KannalaBrandt([0.1, 0, 0, 0.02])
    np.testing.assert_array_equal(bent.intrinsics, [[320, 0, 319.5], [0, 384, 239.5], [0, 0, 1]])
    np.testing.assert_array_equal(bent.vehicle_from_camera[:3, 2], [1, 0, 0])
    assert Camera.from_opensfm(models, camera="simple", image_size=(64, 48)).lens == BrownConrady([0.1, 0, 0, 0])
    with refuses(errors.CalibrationError, "width and height"):
        Camera.from_opensfm(models, camera="simple")
    with refuses(errors.CalibrationError, "projection_type: expected one of 'perspective'", "'spherical'"):
        Camera.from_opensfm(models, camera="ball")
    lost = copy(OPENSFM)
    lost[0]["shots"]["03.jpg"]["camera"] = "another"
    with refuses(errors.CalibrationError, "shots.03.jpg.camera", "expected one of the cameras", "'another'"):
        Camera.from_opensfm(lost, camera="03.jpg")


# ---------------------------------------------------------------------------------------------------------------------
# Metashape


def manual(xyz, f, cx, cy, b1, b2, k, p1, p2, w, h):
    """The manual's appendix, with its corner-based pixels taken to centres."""
    x, y = xyz[:, 0] / xyz[:, 2], xyz[:, 1] / xyz[:, 2]
    r2 = x * x + y * y
    L = 1 + k[0] * r2 + k[1] * r2**2 + k[2] * r2**3 + k[3] * r2**4
    xd = x * L + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
    yd = y * L + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    return np.column_stack([w * 0.5 + cx + xd * f + xd * b1 + yd * b2, h * 0.5 + cy + yd * f]) - 0.5


SEEN = np.array([[0.1, -0.2, 1.0], [-0.3, 0.15, 1.0], [0.2, 0.3, 1.0]]) * 6.5
NUMBERS = (3705.4728, 11.6738, -27.7497, 0.5262, -0.3058)


def test_metashape_by_its_manual(tmp_path):
    path = SAMPLES["metashape"].write(tmp_path)
    camera = Camera.load(path, camera="DJI_0002_D")
    expected = manual(SEEN, *NUMBERS, (-0.0919, -0.0112, 0.0062, 0.0), -0.0003134, 0.0001164, 5280, 3956)
    R, t = np.array([[0, -0.28, 0.96], [-1, 0, 0], [0, -0.96, -0.28]]), 12.5 * np.array([0.75, 0.5, 0.125])
    np.testing.assert_allclose(camera.project(SEEN @ R.T + t)[0], expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(camera.position, t, rtol=0, atol=1e-9)
    small = Camera.from_metashape(path, camera="DJI_0001_D", metres_per_unit=2.0, vehicle_from_world=ENU)
    np.testing.assert_allclose(small.position, [5.5, -1.0, 0.25], rtol=0, atol=1e-9)
    assert list(Camera.load_all(path)) == ["DJI_0001_D", "DJI_0002_D"], "the third is not aligned"


def test_a_fourth_radial_term_is_fitted(tmp_path, caplog):
    """Numbers of a drone's lens, whose four terms nearly cancel."""
    path = tmp_path / "cameras.xml"
    k = (-0.0919367147, -0.0762807468, 0.1162639394, -0.0761413904)
    text = METASHAPE.replace(b"-0.0919</k1>", b"-0.0919367147</k1>").replace(b"-0.0112</k2>", b"-0.0762807468</k2>")
    text = text.replace(b"0.0062</k3>", b"0.1162639394</k3><k4>-0.0761413904</k4>")
    path.write_bytes(text)
    with caplog.at_level(logging.INFO, logger="ipm_rs.calibration"):
        camera = Camera.load(path, camera=0)
    assert "the rational model fitted to the four terms is within" in caplog.text
    camera = camera.with_pose(np.eye(4))
    u, v = np.meshgrid(np.linspace(-0.7, 0.7, 15), np.linspace(-0.5, 0.5, 11))
    grid = np.column_stack([u.ravel(), v.ravel(), np.ones(u.size)])
    expected = manual(grid, *NUMBERS, k, -0.0003134, 0.0001164, 5280, 3956)
    assert np.abs(camera.project(grid)[0] - expected).max() < 0.06, "pixels of 5280"
    steep = METASHAPE.replace(b"-0.0919<", b"0.5<").replace(b"-0.0112<", b"-5<").replace(b"0.0062<", b"30<")
    path.write_bytes(steep.replace(b"</k3>", b"</k3><k4>-40</k4>"))
    with refuses(errors.CalibrationError, "M3M (12.29mm)", "expected radial terms that OpenCV's rational model fits"):
        Camera.load(path, camera=0)


def test_metashape_fisheyes_and_sensors_alone(tmp_path):
    path = tmp_path / "cameras.xml"
    fisheye = METASHAPE.replace(b'<calibration type="frame"', b'<calibration type="fisheye"')
    path.write_bytes(fisheye)
    with refuses(errors.CalibrationError, "a fisheye without tangential terms"):
        Camera.load(path, camera=0)
    path.write_bytes(fisheye.replace(b"<p1>-0.0003134</p1>", b"").replace(b"<p2>0.0001164</p2>", b""))
    assert Camera.load(path, camera=0).lens == KannalaBrandt([-0.0919, -0.0112, 0.0062, 0.0])
    path.write_bytes(METASHAPE.replace(b"transform>", b"moved>"))
    alone = Camera.load(path)
    np.testing.assert_array_equal(alone.vehicle_from_camera[:3, 2], [1, 0, 0])
    with refuses(errors.ArgumentError, "M3M (12.29mm)", "x"):
        Camera.load(path, camera="x")
    path.write_bytes(METASHAPE.replace(b"calibration", b"uncalibrated"))
    with refuses(errors.CalibrationError, "metashape: no <sensor> with <calibration>"):
        Camera.load(path)
    path.write_bytes(b"<!DOCTYPE x [<!ENTITY a 'b'>]>" + METASHAPE.partition(b"\n")[2])
    with refuses(errors.CalibrationError, "expected plain elements, got a DOCTYPE"):
        Camera.from_metashape(path)
    path.write_bytes(METASHAPE.replace(b"0 0 0 1</transform>", b"0 0 1</transform>"))
    with refuses(errors.CalibrationError, "DJI_0001_D", "transform", "expected a 3x4 matrix, got 15 numbers"):
        Camera.load(path, camera=0)


# ---------------------------------------------------------------------------------------------------------------------
# RealSense


def test_realsense_as_json_and_as_text(tmp_path):
    path = SAMPLES["realsense"].write(tmp_path)
    depth = Camera.load(path, camera="depth")
    np.testing.assert_array_equal(depth.intrinsics, [[425.0078, 0, 428.6284], [0, 425.0079, 241.7116], [0, 0, 1]])
    assert depth.lens == BrownConrady([0.11, -0.21, 0.0007, -0.0003, 0.08]) and depth.image_size == (848, 480)
    assert Camera.load(path, camera="color").lens is None, "an inverse lens that bends nothing"
    assert Camera.from_realsense(REALSENSE["color"]) == Camera.load(path, camera="color")
    mounted = Camera.from_realsense(REALSENSE, camera="color", vehicle_from_camera=ENU)
    np.testing.assert_array_equal(mounted.position, [5, -2, 0])
    printed = SAMPLES["realsense text"].write(tmp_path)
    cameras = Camera.load_all(printed)
    assert list(cameras) == ["Depth 640x480", "Color 1280x720"]
    color = cameras["Color 1280x720"]
    expected = [[912.776611328125, 0, 641.741088867188], [0, 912.644897460938, 369.680297851562], [0, 0, 1]]
    np.testing.assert_array_equal(color.intrinsics, expected)
    assert color.lens == BrownConrady([0.05, -0.02, 0, 0, 0.01]) and cameras["Depth 640x480"].lens is None
    line = tmp_path / "color.txt"
    line.write_text("color: [ 640x480  p[313.947 236.609]  f[612.916 613.482]  Inverse Brown Conrady [0 0 0 0 0] ]\n")
    got = Camera.load(line)
    np.testing.assert_array_equal(got.intrinsics, [[612.916, 0, 313.947], [0, 613.482, 236.609], [0, 0, 1]])
    assert got.image_size == (640, 480)


@pytest.mark.parametrize(
    ("model", "coeffs", "lens"),
    [
        ("distortion.brown_conrady", [0.1, 0, 0, 0, 0], BrownConrady([0.1, 0, 0, 0, 0])),
        (4, [0.1, 0, 0, 0, 0], BrownConrady([0.1, 0, 0, 0, 0])),
        (5, [0.1, 0.2, 0.0, 0.0, 0.0], KannalaBrandt([0.1, 0.2, 0, 0])),
        ("Kannala Brandt4", [0, 0, 0, 0, 0], KannalaBrandt([0, 0, 0, 0])),
        ("RS2_DISTORTION_NONE", [0, 0, 0, 0, 0], None),
        ("Inverse Brown Conrady", [0.1, 0, 0, 0, 0], "inverse_means='undistorts'"),
        (1, [0.1, 0, 0.01, 0, 0], "got modified Brown Conrady"),
        ("Ftheta", [0, 0, 0, 0, 0], "which has no lens here"),
        ("fov", [0, 0, 0, 0, 0], "expected a model of librealsense"),
        (None, [0.1, 0, 0, 0, 0], "expected a model of librealsense, such as Brown Conrady, got None"),
    ],
)
def test_models_of_librealsense(model, coeffs, lens):
    content = {**REALSENSE["color"], "model": model, "coeffs": coeffs}
    if isinstance(lens, str):
        with refuses(errors.CalibrationError, lens, "; "):
            Camera.from_realsense(content)
    else:
        assert Camera.from_realsense(content).lens == lens


@pytest.mark.parametrize(("means", "lens"), [("undistorts", ipm_rs.InverseBrownConrady), ("distorts", BrownConrady)])
def test_what_inverse_means_is_the_callers_to_say(means, lens):
    terms = [-0.05, 0.06, 3e-4, -2e-4, -0.01]
    content = {**REALSENSE["color"], "model": 2, "coeffs": terms}
    assert Camera.from_realsense(content, inverse_means=means).lens == lens(terms)
    assert Camera.from_realsense({**content, "coeffs": [0.0] * 5}, inverse_means=means).lens is None
    assert Camera.from_realsense({**content, "model": 4}, inverse_means=means).lens == BrownConrady(terms)
    with refuses(errors.ArgumentError, "inverse_means", "undistorts", "both"):
        Camera.from_realsense(content, inverse_means="both")


def test_text_without_a_block(tmp_path):
    path = tmp_path / "devices.txt"
    path.write_bytes(REALSENSE_TEXT.replace(b"PPX", b"ppx"))
    with refuses(errors.CalibrationError, "Depth 640x480", "missing ppx"):
        ipm_rs.Camera.load(path, camera="Depth 640x480")
    path.write_text("Intrinsics of a camera\n")
    with refuses(errors.CalibrationError, 'realsense: no line Intrinsic of "..."'):
        ipm_rs.Camera.load(path)
