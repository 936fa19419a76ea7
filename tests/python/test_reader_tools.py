"""WoodScape, MATLAB monoCamera and COLMAP: published pixels, pixel bases, quaternion orders, and mistakes."""

from __future__ import annotations

import copy

import calibration_samples as samples
import cv2
import numpy as np
import pytest
from helpers import refuses
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import colmap, matlab, woodscape

# ---------------------------------------------------------------------------------------------------------------------
# WoodScape


def test_woodscape_pixels():
    """Pixels of the dataset's own projection.py."""
    camera = ipm_rs.Camera.from_woodscape(samples.WOODSCAPE)
    assert camera.image_size == (1280, 966)
    np.testing.assert_allclose(camera.intrinsics[:2, 2], [643.442, 479.407], rtol=0, atol=1e-9)
    uv, _, valid = camera.project([[10, 0, 0], [10, 3, 0], [20, 0, 0], [5, 5, 0]])
    expected = [[646.294177, 378.005484], [494.811915, 383.778905], [646.391483, 356.454913], [175.222347, 486.723323]]
    np.testing.assert_allclose(uv, expected, rtol=0, atol=5e-7)
    assert valid.all()
    forward = camera.vehicle_from_camera[:3, 2]
    assert np.degrees(np.arcsin(-forward[2])) == pytest.approx(23.41, abs=5e-3), "looks down"
    assert forward[0] > 0.9, "and ahead: a quaternion read as w, x, y, z would look left"
    np.testing.assert_allclose(camera.position, [3.7484, 0, 0.66017], rtol=0, atol=1e-12)


def test_woodscape_aspect_ratio_scales_v():
    content = copy.deepcopy(samples.WOODSCAPE)
    content["intrinsic"]["aspect_ratio"] = 1.25
    one, other = (woodscape.read(each).project([[5.0, 2.0, 0.3]])[0][0] for each in (samples.WOODSCAPE, content))
    assert other[0] == pytest.approx(one[0], abs=1e-9)
    assert other[1] - 479.407 == pytest.approx(1.25 * (one[1] - 479.407), abs=1e-9)


@pytest.mark.parametrize(
    ("section", "key", "value", "phrases"),
    [
        ("intrinsic", "model", "equidistant", ["intrinsic.model", "'radial_poly'", "'equidistant'"]),
        ("intrinsic", "poly_order", 5, ["intrinsic.poly_order", "got 5"]),
        ("intrinsic", "k4", None, ["intrinsic.k4", "None"]),
        ("intrinsic", "width", 1280.5, ["intrinsic.width", "1280.5"]),
        ("intrinsic", "aspect_ratio", 0, ["intrinsic.aspect_ratio", "positive"]),
        ("intrinsic", "cx_offset", float("nan"), ["intrinsic.cx_offset", "nan"]),
        ("intrinsic", "k1", -300.0, ["WoodScape calibration"]),
        ("extrinsic", "quaternion", [0, 0, 0, 0], ["extrinsic.quaternion", "norm 0"]),
        ("extrinsic", "quaternion", [0.5, 0.5, 0.5], ["extrinsic.quaternion", "4 numbers", "got 3"]),
        ("extrinsic", "quaternion", [1, 1, 1, 1], ["extrinsic.quaternion", "norm 2"]),
        ("extrinsic", "translation", [1, 2], ["extrinsic.translation", "3 numbers"]),
    ],
)
def test_woodscape_refuses(section, key, value, phrases):
    content = copy.deepcopy(samples.WOODSCAPE)
    content[section][key] = value
    with refuses(errors.CalibrationError, "WoodScape calibration: ", *phrases):
        woodscape.read(content)


def test_woodscape_names_what_is_missing():
    content = copy.deepcopy(samples.WOODSCAPE)
    del content["intrinsic"]["k2"], content["intrinsic"]["cy_offset"]
    with refuses(errors.CalibrationError, "intrinsic", "missing k2", "cy_offset"):
        woodscape.read(content)
    with refuses(errors.CalibrationError, "image_size", "(1280, 966)"):
        woodscape.read(samples.WOODSCAPE, image_size=(640, 483))


# ---------------------------------------------------------------------------------------------------------------------
# MATLAB


SIZE = {"ImageSize": [480, 640]}


def test_matlab_documentation_example():
    """vehicleToImage and imageToVehicle of MATLAB's documentation, whose pixels count from 1."""
    camera = ipm_rs.Camera.from_matlab(samples.MATLAB)
    assert camera.image_size == (640, 480)
    uv = camera.project([[10.0, 0.0]])[0][0]
    np.testing.assert_allclose(uv + 1, [320.0, 216.2296], rtol=0, atol=5e-5)
    ground = camera.ground_from_pixels([[300 - 1, 300 - 1]])[0]
    np.testing.assert_allclose(ground[:2], [6.5959, 0.1732], rtol=0, atol=5e-5)


def test_matlab_spellings_are_one_camera():
    flat = {"focalLength": [800, 800], "principalPoint": [320, 240], "imageSize": [480, 640]}
    flat |= {"height": 2.18, "pitch_deg": 14}
    upright = {"ImageSize": [480, 640], "K": [[800, 0, 320], [0, 800, 240], [0, 0, 1]], "Height": 2.18, "Pitch": 14}
    old = {**upright, "IntrinsicMatrix": [[800, 0, 0], [0, 800, 0], [320, 240, 1]]}
    del old["K"]
    expected = matlab.read(samples.MATLAB)
    assert matlab.read(flat) == matlab.read(upright) == matlab.read(old) == expected


def test_matlab_signs_and_location():
    content = {**samples.MATLAB, "Yaw": 10, "Roll": 3, "SensorLocation": [1.5, -0.25]}
    expected = ipm_rs.Camera.from_euler(
        [[800, 0, 319], [0, 800, 239], [0, 0, 1]],
        image_size=(640, 480),
        position=(1.5, -0.25, 2.18),
        roll=np.radians(3),
        pitch=np.radians(14),
        yaw=np.radians(10),
    )
    assert matlab.read(content) == expected


def test_matlab_distortion_is_opencvs():
    intrinsics = {
        **samples.MATLAB["Intrinsics"],
        "RadialDistortion": [-0.3, 0.1, 0.01],
        "TangentialDistortion": [1e-3, -2e-3],
    }
    camera = matlab.read({**samples.MATLAB, "Intrinsics": {**intrinsics, "Skew": 2.0}})
    assert camera.lens == ipm_rs.BrownConrady([-0.3, 0.1, 1e-3, -2e-3, 0.01])
    assert camera.intrinsics[0, 1] == 2.0
    assert matlab.read({**samples.MATLAB, "RadialDistortion": [0, 0], "TangentialDistortion": [0, 0]}).lens is None


def test_matlab_without_a_mount_looks_ahead():
    camera = matlab.read(samples.MATLAB["Intrinsics"])
    np.testing.assert_array_equal(camera.position, [0, 0, 0])
    assert camera.camera_from_vehicle[2, 0] == 1


@pytest.mark.parametrize(
    ("changes", "phrases"),
    [
        ({"Intrinsics": {"FocalLength": [800, 800], **SIZE}}, ["PrincipalPoint"]),
        ({"Intrinsics": {**SIZE}}, ["FocalLength", "none of them"]),
        ({"Intrinsics": 3}, ["Intrinsics", "int 3"]),
        ({"FocalLength": [800, 800]}, ["FocalLength", "expected once"]),
        ({"K": np.eye(3).tolist()}, ["keep one"]),
        ({"Height": "2 m"}, ["Height", "'2 m'"]),
        ({"Pitch": float("inf")}, ["Pitch", "inf"]),
        ({"WorldUnits": "inches"}, ["WorldUnits", "'inches'"]),
        ({"SensorLocation": [1, 2, 3]}, ["SensorLocation", "2 numbers"]),
        ({"RadialDistortion": [0.1]}, ["RadialDistortion", "2 or 3 numbers"]),
        ({"Intrinsics": {"K": [[800, 0, 0], [0, 800, 0], [320, 240, 1]], **SIZE}}, ["K", "IntrinsicMatrix"]),
        ({"Intrinsics": {"IntrinsicMatrix": [[800, 0, 9], [0, 800, 9], [0, 0, 1]], **SIZE}}, ["call it K"]),
        ({"Intrinsics": {"FocalLength": [0, 8], "PrincipalPoint": [1, 1], **SIZE}}, ["FocalLength", "positive"]),
        ({"Intrinsics": {"FocalLength": [8, 8], "PrincipalPoint": [1, 1]}}, ["ImageSize", "image_size="]),
        ({"Intrinsics": {"FocalLength": [8, 8], "PrincipalPoint": [1, 1], "ImageSize": [480, 0]}}, ["ImageSize"]),
    ],
)  # fmt: skip
def test_matlab_refuses(changes, phrases):
    with refuses(errors.CalibrationError, "MATLAB monoCamera calibration: ", *phrases):
        matlab.read({**samples.MATLAB, **changes})


# ---------------------------------------------------------------------------------------------------------------------
# COLMAP

PRISM = [0.01, -0.02, 1e-3, -2e-3, 3e-3, -1e-3, 4e-3, -5e-3]


@pytest.fixture
def model(tmp_path):
    """A text model."""
    (tmp_path / "cameras.txt").write_bytes(samples.COLMAP_CAMERAS)
    (tmp_path / "images.txt").write_bytes(samples.COLMAP_IMAGES)
    return tmp_path


def one(tmp_path, line: str):
    path = tmp_path / "cameras.txt"
    path.write_text(f"# a comment\n\n{line}\n")
    return path


@pytest.mark.parametrize(
    ("model", "focal", "lens", "coefficients"),
    [
        ("SIMPLE_PINHOLE", "500", "", None),
        ("PINHOLE", "500 501", "", None),
        ("SIMPLE_RADIAL", "500", "-0.1", [-0.1, 0, 0, 0]),
        ("SIMPLE_RADIAL", "500", "0", None),
        ("RADIAL", "500", "-0.1 0.02", [-0.1, 0.02, 0, 0]),
        ("OPENCV", "500 501", "-0.1 0.02 1e-3 -2e-3", [-0.1, 0.02, 1e-3, -2e-3]),
        (
            "FULL_OPENCV",
            "500 501",
            "-0.1 0.02 1e-3 -2e-3 0.1 0.2 0.3 0.4",
            [-0.1, 0.02, 1e-3, -2e-3, 0.1, 0.2, 0.3, 0.4],
        ),
        ("OPENCV_FISHEYE", "500 501", "0.1 0.02 0.003 0.0004", [0.1, 0.02, 0.003, 0.0004]),
        ("SIMPLE_RADIAL_FISHEYE", "500", "0.1", [0.1, 0, 0, 0]),
        ("RADIAL_FISHEYE", "500", "0.1 0.02", [0.1, 0.02, 0, 0]),
    ],
)
def test_colmap_models(model, focal, lens, coefficients, tmp_path):
    camera = ipm_rs.Camera.from_colmap(one(tmp_path, f"1 {model} 640 480 {focal} 320 240 {lens}"))
    expected = ipm_rs.KannalaBrandt if model.endswith("FISHEYE") else ipm_rs.BrownConrady
    assert camera.image_size == (640, 480) and camera.lens == (None if coefficients is None else expected(coefficients))
    fx, fy = float(focal.split()[0]), float(focal.split()[-1])
    # COLMAP's (320, 240) is the corner between four pixels; ours counts from the centre of the first.
    np.testing.assert_array_equal(camera.intrinsics, [[fx, 0, 319.5], [0, fy, 239.5], [0, 0, 1]])


@pytest.mark.parametrize(
    ("model", "focal", "terms", "lens"),
    [
        ("FOV", "500 501", "0.9", ipm_rs.Fov(0.9)),
        ("FOV", "500 501", "0", None),
        ("SIMPLE_DIVISION", "500", "-0.2", ipm_rs.Division(-0.2)),
        ("DIVISION", "500 501", "0.1", ipm_rs.Division(0.1)),
        ("DIVISION", "500 501", "0", None),
        ("EUCM", "500 501", "0.6 1.1", ipm_rs.Eucm(0.6, 1.1)),
        ("SIMPLE_FISHEYE", "500", "", ipm_rs.KannalaBrandt([0] * 4)),
        ("FISHEYE", "500 501", "", ipm_rs.KannalaBrandt([0] * 4)),
        ("THIN_PRISM_FISHEYE", "500 501", ".01 -.02 1e-3 -2e-3 3e-3 -1e-3 4e-3 -5e-3", ipm_rs.ThinPrismFisheye(PRISM)),
        (
            "RAD_TAN_THIN_PRISM_FISHEYE",
            "500 501",
            ".01 -.02 1e-3 -2e-3 3e-3 -1e-3 4e-3 -5e-3 1e-3 2e-3 3e-3 4e-3",
            ipm_rs.ThinPrismFisheye([*PRISM, 1e-3, 2e-3, 3e-3, 4e-3]),
        ),
    ],
)
def test_colmap_models_of_other_lenses(model, focal, terms, lens, tmp_path):
    camera = ipm_rs.Camera.from_colmap(one(tmp_path, f"1 {model} 640 480 {focal} 320 240 {terms}"))
    assert camera.lens == lens and camera.intrinsics[1, 2] == 239.5
    assert camera.intrinsics[1, 1] == float(focal.split()[-1])


def test_colmap_sphere(tmp_path):
    """Its first column begins and its last one ends straight behind; pixels as COLMAP 4.2.1 has them, less a half."""
    camera = ipm_rs.Camera.from_colmap(one(tmp_path, "1 EQUIRECTANGULAR 1000 800 1000 800"))
    points = np.array([[0.3, -0.2, 1], [0.9, 0.4, -2], [0.1, 0.2, -3]])[:, [2, 0, 1]] * [1, -1, -1]
    expected = [[546.38678954, 351.80222192], [932.70070745, 445.93885164], [994.6967988, 416.94206183]]
    np.testing.assert_allclose(camera.project(points)[0], np.array(expected) - 0.5, rtol=0, atol=1e-8)


def test_colmap_pose(model):
    """x = K (R(qw, qx, qy, qz) X + t), in COLMAP's pixels half a pixel more."""
    camera = colmap.read(model / "cameras.txt", images=model / "images.txt", image="left/frame 1.jpg")
    assert camera == colmap.read(model / "cameras.txt", images=model / "images.txt", image=1, camera=2)
    # (w, x, y, z) = (.5, .5, -.5, .5) turns forward, left, up into right, down, forward
    np.testing.assert_allclose(camera.camera_from_vehicle[:3, :3], [[0, -1, 0], [0, 0, -1], [1, 0, 0]], atol=1e-12)
    points = np.array([[9.0, 1.0, -1.0], [12.0, -2.0, 0.5]])
    optical = points @ camera.camera_from_vehicle[:3, :3].T + [0.25, 1.5, -0.75]
    K = np.array([[2560.56, 0, 1536.25], [0, 2561.5, 1152.75], [0, 0, 1]])
    expected = cv2.projectPoints(optical, np.zeros(3), np.zeros(3), K, np.array([-0.02, 0.01, 0.001, -0.002]))[0][:, 0]
    np.testing.assert_allclose(camera.project(points)[0], expected - 0.5, rtol=0, atol=1e-9)

    world = np.eye(4)
    world[:3, :3], world[:3, 3] = ipm_rs.rotation_from_euler(0.1, 0.2, 0.3), (4, 5, 6)
    placed = colmap.read(
        model / "cameras.txt", images=model / "images.txt", image=1, vehicle_from_world=world, metres_per_unit=2.5
    )
    scaled = camera.camera_from_vehicle.copy()
    scaled[:3, 3] *= 2.5
    np.testing.assert_allclose(placed.camera_from_vehicle, scaled @ np.linalg.inv(world), rtol=0, atol=1e-12)
    second = colmap.read(model / "cameras.txt", images=model / "images.txt", image="right.jpg")
    assert isinstance(second.lens, ipm_rs.KannalaBrandt)
    # this rotation was printed with six digits and comes from COLMAP's own documentation
    np.testing.assert_allclose(np.linalg.det(second.camera_from_vehicle[:3, :3]), 1, atol=1e-12)


@pytest.mark.parametrize(
    ("line", "phrases"),
    [
        ("1 FOV 640 480 500 501 320 240 3.9", ["line 3", "omega", "below pi"]),
        ("1 THIN_PRISM_FISHEYE 640 480 500 501 320 240 0 0 0 0 0 0 0", ["parameters of THIN_PRISM_FISHEYE", "got 11"]),
        ("1 EQUIRECTANGULAR 640 480 640", ["parameters of EQUIRECTANGULAR", "got 1"]),
        ("1 WIDE 640 480 500 320 240", ["'WIDE'", "check the line"]),
        ("1 PINHOLE 640 480 500 320 240", ["parameters of PINHOLE", "4 numbers", "got 3"]),
        ("1 PINHOLE 640 480 500 501 320 240 1", ["parameters of PINHOLE", "got 5"]),
        ("1 PINHOLE 640 480 500 nan 320 240", ["parameters of PINHOLE", "nan"]),
        ("1 PINHOLE 640 480 -500 500 320 240", ["focal length", "positive"]),
        ("1 PINHOLE 640.5 480 500 500 320 240", ["line 3", "640.5"]),
        ("1 PINHOLE 640", ["line 3", "height"]),
        ("1", ["line 3", "one word"]),
        ("1 PINHOLE 640 480 500 500 320 240\n1 PINHOLE 640 480 500 500 320 240", ["line 4", "every camera once"]),
        ("# nothing", ["found none"]),
    ],
)
def test_colmap_refuses(line, phrases, tmp_path):
    path = one(tmp_path, line)
    with refuses(errors.CalibrationError, str(path), *phrases):
        colmap.read(path)


def test_colmap_choices(model):
    cameras, images = model / "cameras.txt", model / "images.txt"
    with refuses(errors.ArgumentError, "camera: expected one of '1', '2', '3'", "None"):
        colmap.read(cameras)
    with refuses(errors.ArgumentError, "camera: expected one of", "9"):
        colmap.read(cameras, camera=9)
    with refuses(errors.ArgumentError, "image: expected one of", "'left/frame 1.jpg', 'right.jpg'"):
        colmap.read(cameras, images=images)
    with refuses(errors.ArgumentError, "camera: expected '2'", "3"):
        colmap.read(cameras, images=images, image=1, camera=3)
    with refuses(errors.ArgumentError, "images="):
        colmap.read(cameras, image=1)
    with refuses(errors.CalibrationError, "image_size", "(3072, 2304)"):
        colmap.read(cameras, camera=1, image_size=(640, 480))
    with refuses(errors.MissingFileError, "images.txt"):
        colmap.read(cameras, images=model / "other" / "images.txt")
    images.write_text("1 0 0 0 0 0 0 0 2 a.jpg\n\n")
    with refuses(errors.CalibrationError, str(images), "QW QX QY QZ", "norm 0"):
        colmap.read(cameras, images=images)
    images.write_text("1 0 0 0 0 0 0 0 2\n\n")
    with refuses(errors.CalibrationError, str(images), "line 1", "9 words"):
        colmap.read(cameras, images=images)


@given(
    text=st.text(alphabet="0123456789.-+e \n#PINHOLEOPENCV_nanx", max_size=80),
    which=st.sampled_from(["cameras", "images"]),
)
def test_colmap_any_text(text, which, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp() / "colmap"
    folder.mkdir(exist_ok=True)
    files = {"cameras": samples.COLMAP_CAMERAS, "images": samples.COLMAP_IMAGES, which: text.encode()}
    for name, data in files.items():
        (folder / f"{name}.txt").write_bytes(data)
    for options in ({"camera": 1}, {"images": folder / "images.txt", "image": 1}):
        try:
            colmap.read(folder / "cameras.txt", **options)
        except errors.IpmError as error:
            assert len(str(error)) < 2000
