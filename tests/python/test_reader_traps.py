"""Calibrations that look right and are not: units, placeholders, rounded rotations, other lenses, slips of the pen."""

from __future__ import annotations

import json

import numpy as np
import pytest
from calibration_samples import ROS_YAML, SAMPLES, WOODSCAPE
from helpers import refuses

import ipm_rs
from ipm_rs import cli, errors

K = [[655.5, 0.0, 323.25], [0.0, 656.5, 238.75], [0.0, 0.0, 1.0]]
D = [0.11, -0.21, 0.0007, -0.0003, 0.08]
ONE = {"camera_matrix": K, "dist_coeffs": D, "image_size": [640, 480]}
PAIR = {"M1": K, "D1": D, "M2": K, "D2": D, "image_size": [640, 480], "R": np.eye(3).tolist()}


def write(tmp_path, content, name="camera.json"):
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


# ---------------------------------------------------------------------------------------------------------------------
# Units


def test_a_pair_in_millimetres(tmp_path):
    path = write(tmp_path, {**PAIR, "T": [-240.0, 3.0, 1.0]})
    assert ipm_rs.Camera.load(path, camera=1).position.tolist() == [0, 0, 0]
    with refuses(errors.CalibrationError, str(path), "T: expected metres", "240.021", "metres_per_unit="):
        ipm_rs.Camera.load(path, camera=2)
    camera = ipm_rs.Camera.load(path, camera=2, metres_per_unit=0.001)
    np.testing.assert_allclose(camera.position, [-0.001, -0.24, 0.003], rtol=0, atol=1e-12)
    assert ipm_rs.Camera.load(path, camera=2, metres_per_unit=1.0).position[1] == pytest.approx(-240)
    near = write(tmp_path, {**PAIR, "T": [-19.0, 3.0, 1.0]})
    assert ipm_rs.Camera.load(near, camera=2).position[1] == pytest.approx(-19), "20 units may be metres"


def test_a_board_in_centimetres(tmp_path):
    path = write(tmp_path, {**ONE, "rvec": [0.0, 0.2, 0.0], "tvec": [[3.0], [-4.0], [84.0]]})
    with refuses(errors.CalibrationError, "tvec: expected metres", "metres_per_unit="):
        ipm_rs.Camera.load(path)
    camera = ipm_rs.Camera.load(path, metres_per_unit=0.01)
    np.testing.assert_allclose(camera.camera_from_vehicle[:3, 3], [0.03, -0.04, 0.84], rtol=0, atol=1e-12)
    posed = ipm_rs.Camera.from_opencv(path, vehicle_from_camera=np.eye(4))
    assert posed.position.tolist() == [0, 0, 0], "a pose of the caller's is in metres"


def test_options_are_for_formats_that_leave_a_choice(tmp_path):
    path = SAMPLES["woodscape"].write(tmp_path)
    with refuses(errors.ArgumentError, "frame: expected none", "has one frame", "'camera'", "drop it"):
        ipm_rs.Camera.load(path, frame="camera")
    with refuses(errors.ArgumentError, "metres_per_unit: expected none", "counts in metres", "0.001", "drop it"):
        ipm_rs.Camera.load(path, metres_per_unit=0.001)
    with refuses(errors.ArgumentError, "nearest_rotation: expected none", "no rotation", "drop it"):
        ipm_rs.Camera.load(SAMPLES["matlab"].write(tmp_path), nearest_rotation=True)


# ---------------------------------------------------------------------------------------------------------------------
# Rotations with few digits


def rounded(digits=3):
    """A rotation as a data sheet prints it, and the nearest one."""
    R = np.round(ipm_rs.rotation_from_euler(0.31, -0.22, 0.57), digits)
    U, _, V = np.linalg.svd(R)
    return R, U @ V


ROUNDED, NEAREST = rounded()
TALL = np.vstack([np.column_stack([ROUNDED, [0.3, -0.2, 0.1]]), [0, 0, 0, 1]])
_TEXT = " ".join(map(str, TALL[:3].ravel()))
_P = "720.5 0 610.25 0 0 720.5 171.75 0 0 0 1 0"
_SENSOR = {"translation": [1, 0, 1.5], "camera_intrinsic": K}
_CHAIN = {
    "camera_model": "pinhole",
    "intrinsics": [600, 600, 320, 240],
    "distortion_model": "none",
    "distortion_coeffs": [],
    "resolution": [640, 480],
}

# For each format the content with a rounded rotation, and which rotation of the camera it becomes.
CASES = {
    "kitti": (
        {**{f"P{i}": [float(x) for x in _P.split()] for i in range(4)}, "Tr": TALL[:3].tolist()},
        {"image_size": (1242, 375)},
    ),
    "ros": (
        {
            "width": 640,
            "height": 480,
            "K": K,
            "D": D,
            "R": ROUNDED.tolist(),
            "P": np.column_stack([K, [0, 0, 0]]).tolist(),
            "distortion_model": "plumb_bob",
        },
        {"image": "rectified", "camera_from_vehicle": np.eye(4)},
    ),
    "opencv": ({**ONE, "rvec": ROUNDED.tolist(), "tvec": [0, 0, 1]}, {}),
    "kalibr": (
        {"cam0": _CHAIN, "cam1": {**_CHAIN, "T_cn_cnm1": TALL.tolist()}},
        {"camera": 1, "vehicle_from_cam0": np.eye(4)},
    ),
    "waymo": (
        {
            "intrinsic": [600, 600, 320, 240, 0, 0, 0, 0, 0],
            "extrinsic": TALL.ravel().tolist(),
            "width": 640,
            "height": 480,
        },
        {},
    ),
    "cityscapes": (
        {"sensor": {"fx": 600, "fy": 600, "u0": 320, "v0": 240, "sensor_T_ISO_8855": TALL[:3].tolist()}},
        {"image_size": (640, 480)},
    ),
    "carla": (
        {"image_size_x": 640, "image_size_y": 480, "fov": 90, "transform": TALL.tolist()},
        {"handedness": "right"},
    ),
}
OPTICAL = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
WANTED = {
    "kitti": NEAREST,
    "ros": NEAREST,
    "opencv": NEAREST,
    "kalibr": NEAREST,
    "waymo": OPTICAL @ NEAREST.T,
    "cityscapes": OPTICAL @ NEAREST,
    "carla": OPTICAL @ NEAREST.T,
}


@pytest.mark.parametrize("name", CASES)
def test_rotations_of_three_digits(name):
    content, options = CASES[name]
    read = getattr(ipm_rs.Camera, f"from_{name}")
    with refuses(errors.CalibrationError, "|R^T R - I|", "nearest_rotation=True"):
        read(content, **options)
    camera = read(content, **options, nearest_rotation=True)
    np.testing.assert_allclose(camera.camera_from_vehicle[:3, :3], WANTED[name], rtol=0, atol=1e-12)


def test_a_rotation_that_is_none_has_no_nearest(tmp_path):
    for R in (ROUNDED * 1.05, ROUNDED[::-1], np.zeros((3, 3))):
        content = {**ONE, "rvec": R.tolist(), "tvec": [0, 0, 1]}
        for options in ({}, {"nearest_rotation": True}):
            with pytest.raises(errors.CalibrationError, match="expected a rotation") as caught:
                ipm_rs.Camera.from_opencv(content, **options)
            assert "nearest_rotation" not in str(caught.value)
    lines = "".join(f"P{i}: {_P}\n" for i in range(4)) + f"Tr: {_TEXT}\n"
    path = write(tmp_path, lines, "calib.txt")
    camera = ipm_rs.Camera.load(path, image_size=(1242, 375), nearest_rotation=True)
    np.testing.assert_allclose(camera.camera_from_vehicle[:3, :3], NEAREST, rtol=0, atol=1e-12)


def test_a_pose_of_the_callers_with_three_digits():
    info = {"width": 640, "height": 480, "K": K, "D": D, "distortion_model": "plumb_bob"}
    for read, content in ((ipm_rs.Camera.from_opencv, ONE), (ipm_rs.Camera.from_ros, info)):
        with refuses(errors.CalibrationError, "camera_from_vehicle", "rotation"):
            read(content, camera_from_vehicle=TALL)
        camera = read(content, camera_from_vehicle=TALL, nearest_rotation=True)
        np.testing.assert_allclose(camera.camera_from_vehicle[:3, :3], NEAREST, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(camera.camera_from_vehicle[:3, 3], TALL[:3, 3])


def test_quaternions_of_two_digits():
    q = np.array([0.52, -0.49, 0.49, -0.51])
    record = {**_SENSOR, "rotation": q.tolist()}
    with refuses(errors.CalibrationError, "norm", "nearest_rotation=True"):
        ipm_rs.Camera.from_nuscenes(record)
    camera = ipm_rs.Camera.from_nuscenes(record, nearest_rotation=True)
    exact = ipm_rs.Camera.from_nuscenes({**record, "rotation": (q / np.linalg.norm(q)).tolist()})
    np.testing.assert_allclose(camera.camera_from_vehicle, exact.camera_from_vehicle, rtol=0, atol=1e-12)
    with refuses(errors.CalibrationError, "norm", "check its four numbers"):
        ipm_rs.Camera.from_nuscenes({**record, "rotation": (q * 1.1).tolist()}, nearest_rotation=True)


# ---------------------------------------------------------------------------------------------------------------------
# Placeholders, and coefficients of another lens


@pytest.mark.parametrize(
    ("name", "content", "options"),
    [
        ("opencv", {**ONE, "camera_matrix": np.eye(3).tolist()}, {}),
        ("opencv", {**ONE, "camera_matrix": [[0.9, 0, 0.5], [0, 1.2, 0.5], [0, 0, 1]]}, {}),
        (
            "kitti",
            {**{f"P{i}": np.eye(3, 4).tolist() for i in range(4)}, "Tr": np.eye(3, 4).tolist()},
            {"image_size": (1242, 375)},
        ),
        (
            "ros",
            {"width": 640, "height": 480, "K": np.eye(3).tolist(), "D": [0.0] * 5, "distortion_model": "plumb_bob"},
            {},
        ),
        ("nuscenes", {**_SENSOR, "camera_intrinsic": np.eye(3).tolist(), "rotation": [0.5, -0.5, 0.5, -0.5]}, {}),
        ("kalibr", {"cam0": {**_CHAIN, "intrinsics": [1, 1, 0, 0]}}, {}),
        ("matlab", {"FocalLength": [1, 1], "PrincipalPoint": [1, 1], "ImageSize": [480, 640]}, {}),
        (
            "cityscapes",
            {**dict.fromkeys(("x", "y", "z", "roll", "pitch", "yaw", "u0", "v0"), 0.0), "fx": 1, "fy": 1},
            {},
        ),
    ],
)
def test_matrices_that_were_never_filled_in(name, content, options):
    with refuses(errors.CalibrationError, "expected focal lengths in pixels", "placeholder"):
        getattr(ipm_rs.Camera, f"from_{name}")(content, **options)


def test_a_small_picture_may_have_any_focal_length():
    small = {**ONE, "camera_matrix": [[1, 0, 31.5], [0, 1, 31.5], [0, 0, 1]], "image_size": [64, 64]}
    with pytest.warns(ipm_rs.CalibrationWarning, match="focal length"):
        assert ipm_rs.Camera.from_opencv(small).intrinsics[0, 0] == 1


def test_woodscape_with_coefficients_without_unit():
    for own in ({"k1": 0.03, "k2": -0.01, "k3": 0.002, "k4": 0.0}, {"k1": -0.2}, {"k1": 1.0, "k2": 0.0}):
        changed = {**WOODSCAPE, "intrinsic": {**WOODSCAPE["intrinsic"], **own}}
        with refuses(errors.CalibrationError, "intrinsic.k1", "pixels", "1280 pixels wide", "KannalaBrandt"):
            ipm_rs.Camera.from_woodscape(changed)
    thumbnail = {**WOODSCAPE["intrinsic"], "width": 64, "height": 48, "k1": 17.0, "k2": -1.6, "k3": 2.4, "k4": -0.4}
    assert ipm_rs.Camera.from_woodscape({**WOODSCAPE, "intrinsic": thumbnail}).image_size == (64, 48)


# ---------------------------------------------------------------------------------------------------------------------
# Lenses that we do not have

PERSPECTIVE = (
    "inverse_brown_conrady",
    "distortion.inverse_brown_conrady",
    "RS2_DISTORTION_MODIFIED_BROWN_CONRADY",
    "division",
)
FISHEYE = ("thin_prism_fisheye", "RAD_TAN_THIN_PRISM_FISHEYE", "ftheta", "f-theta", "equisolid", "stereographic")


@pytest.mark.parametrize("key", ["model", "camera_model", "distortion_model", "DistModel", "type", "lens", "lensType"])
@pytest.mark.parametrize("word", (*PERSPECTIVE, *FISHEYE))
def test_lenses_of_others_under_any_key(key, word, tmp_path):
    path = write(tmp_path, {**ONE, key: word})
    with refuses(errors.CalibrationError, str(path), key, word, "no model"):
        ipm_rs.Camera.load(path)
    path = write(tmp_path, {**ONE, key: word, "dist_coeffs": [0.0] * 5})
    if word in FISHEYE:  # it bends without any coefficient
        with refuses(errors.CalibrationError, key, word):
            ipm_rs.Camera.load(path)
    else:
        assert ipm_rs.Camera.load(path).lens is None


def test_lenses_of_others_in_other_formats(tmp_path):
    info = {"width": 640, "height": 480, "K": K, "D": D, "distortion_model": "inverse_brown_conrady"}
    with refuses(errors.CalibrationError, "distortion_model", "'inverse_brown_conrady'"):
        ipm_rs.Camera.from_ros(info)
    assert ipm_rs.Camera.from_ros({**info, "D": [0.0] * 5}).lens is None
    chain = {**_CHAIN, "distortion_model": "fov", "distortion_coeffs": [0.92]}
    assert ipm_rs.Camera.from_kalibr({"cam0": chain}).lens == ipm_rs.Fov(0.92)
    assert ipm_rs.Camera.from_kalibr({"cam0": {**chain, "distortion_coeffs": [0.0]}}).lens is None
    record = {**_SENSOR, "rotation": [0.5, -0.5, 0.5, -0.5], "camera_distortion": D, "distortion_model": "division"}
    with refuses(errors.CalibrationError, "distortion_model", "'division'"):
        ipm_rs.Camera.from_nuscenes(record)
    path = write(tmp_path, "1 FOV 640 480 600 601 320 240 0.0\n2 FOV 640 480 600 601 320 240 0.7\n", "cameras.txt")
    assert ipm_rs.Camera.load(path, camera=1).lens is None
    assert ipm_rs.Camera.load(path, camera=2).lens == ipm_rs.Fov(0.7)


def test_ordinary_words_are_no_lenses(tmp_path):
    for more in ({"name": "division 3"}, {"comment": "polynomial"}, {"camera_model": "acA1920-40gc"}, {"fov": 90}):
        assert ipm_rs.Camera.load(write(tmp_path, {**ONE, **more})).lens == ipm_rs.BrownConrady(D)


# ---------------------------------------------------------------------------------------------------------------------
# Slips


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.yaml", ROS_YAML.decode().replace("438.783367, 0.000000,", "438.783367 0.000000")),
        ("b.yaml", ROS_YAML.decode().replace("-0.361976, 0.110510, 0.001014", "-0.361976 0.110510 0.001014")),
        ("c.yaml", "K: [[600 0 320], [0 600 240], [0 0 1]]\nD: [0.1, 0, 0, 0, 0]\nsize: [640, 480]\n"),
        ("d.yaml", "K: [[600, 0, 320], [0, 600, 240], [0, 0, 1]]\nD: [0.1 0 0 0 0]\nsize: [640, 480]\n"),
        ("e.yaml", "K: [600 0 320; 0 600 240; 0 0 1]\nD: [0.1, 0, 0, 0, 0]\nsize: [640, 480]\n"),
        ("f.yaml", "K: [[600, 0, 320], [0, 600, 240], [0, 0, 1]]\nD: 0.1 0 0 0 0\nsize: [640, 480]\n"),
        ("g.json", '{"K": [[600, 0, 320], [0 600, 240], [0, 0, 1]], "D": [0.1, 0, 0, 0, 0]}'),
        (
            "h.yaml",
            "cam0:\n  camera_model: pinhole\n  intrinsics: [600 600 320 240]\n  distortion_model: none\n"
            "  distortion_coeffs: []\n  resolution: [640, 480]\n",
        ),
    ],
)
def test_forgotten_commas(name, text, tmp_path):
    pytest.importorskip("yaml")
    path = write(tmp_path, text, name)
    with pytest.raises(errors.CalibrationError, match="comma") as caught:
        ipm_rs.Camera.load(path)
    assert "cut short" not in str(caught.value) and str(path) in str(caught.value)


def test_sizes_are_printed(tmp_path):
    path = write(tmp_path, ONE)
    with refuses(errors.CalibrationError, "(640, 480)", "(1280, 960)"):
        ipm_rs.Camera.load(path, image_size=(1280, 960))
    with refuses(errors.CalibrationError, "(640, 480)", "(480, 640)", "(width, height)", "swap"):
        ipm_rs.Camera.load(path, image_size=(480, 640))
    with refuses(errors.CalibrationError, "(640, 480)", "[1, 2]"):
        ipm_rs.Camera.load(path, image_size=np.array([1, 2]))
    for odd in (np.zeros((2, 2)), [np.zeros(2)] * 2, "640x480", 3):
        with refuses(errors.CalibrationError, "(640, 480)"):
            ipm_rs.Camera.load(path, image_size=odd)
    with refuses(errors.CalibrationError, "(960, 540)", "(1920, 1080)"):
        ipm_rs.Camera.load(SAMPLES["carla"].write(tmp_path), image_size=(1920, 1080))


def test_odometry_without_tr(tmp_path):
    path = write(tmp_path, "".join(f"P{i}: {_P}\n" for i in range(4)), "calib.txt")
    for frame in ({}, {"frame": "velodyne"}, {"frame": "imu"}):
        with refuses(errors.CalibrationError, str(path), 'frame="camera"', "Tr"):
            ipm_rs.Camera.load(path, image_size=(1226, 370), **frame)
    camera = ipm_rs.Camera.load(path, image_size=(1226, 370), frame="camera", camera=0)
    np.testing.assert_array_equal(camera.camera_from_vehicle[:3], np.column_stack([OPTICAL, [0, 0, 0]]))
    with refuses(errors.ArgumentError, "frame: expected one of"):
        ipm_rs.Camera.load(path, image_size=(1226, 370), frame="ego")


def test_a_mapping_of_names_to_records(tmp_path):
    front, side = ({**_SENSOR, "translation": [x, 0, 1.5], "rotation": [0.5, -0.5, 0.5, -0.5]} for x in (1, 2))
    lidar = {**front, "camera_intrinsic": []}
    rig = {"CAM_FRONT": front, "CAM_SIDE": side, "LIDAR": lidar}
    for source in (rig, write(tmp_path, rig)):
        assert ipm_rs.Camera.from_nuscenes(source, camera="CAM_SIDE").position[0] == pytest.approx(2)
        with refuses(errors.ArgumentError, "camera: expected one of 'CAM_FRONT', 'CAM_SIDE'", "'CAM_BACK'"):
            ipm_rs.Camera.from_nuscenes(source, camera="CAM_BACK")
        with pytest.raises(errors.ArgumentError, match="say which") as caught:
            ipm_rs.Camera.from_nuscenes(source)
        assert "drop" not in str(caught.value)
    assert ipm_rs.Camera.load(write(tmp_path, rig), camera="CAM_FRONT").position[0] == pytest.approx(1)


# ---------------------------------------------------------------------------------------------------------------------
# The same on the command line


@pytest.mark.filterwarnings("ignore::ipm_rs.CalibrationWarning")  # KITTI's matrix, for smaller pictures
def test_command_line_names_its_own_options(tmp_path, capsys):
    image = pytest.importorskip("PIL.Image")
    picture = tmp_path / "frame.png"
    image.new("RGB", (640, 480)).save(picture)
    kitti = "".join(f"P{i}: {_P}\n" for i in range(4))
    for content, option in (
        ({**ONE, "rvec": [1.2, -1.2, 1.2], "tvec": [0, 900.0, 300.0]}, ["--metres-per-unit", "0.001"]),
        ({**ONE, "dist_coeffs": D[:4]}, ["--lens", "fisheye"]),
        (kitti, ["--vehicle-frame", "camera"]),
        (kitti + f"Tr: {_TEXT}\n", ["--nearest-rotation"]),
    ):
        path = write(tmp_path, content, "calib.txt" if isinstance(content, str) else "camera.json")
        command = ["warp", str(path), str(picture), "-o", str(tmp_path / "bev.png"), "--ground=-1.5", "--force"]
        if isinstance(content, str):
            command += ["--image-size", "640", "480"]
        command += ["--x", "8", "12", "--y", "-1", "1", "--quiet"]
        assert cli.main(command) == 2
        assert f"here: {option[0]}" in capsys.readouterr().err
        status, told = cli.main([*command, *option]), capsys.readouterr().err
        # the camera of the last one looks into the sky
        assert status == 0 or (option == ["--nearest-rotation"] and "no cell of the grid" in told), told
