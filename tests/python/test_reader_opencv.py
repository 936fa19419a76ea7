"""OpenCV FileStorage calibrations: all three forms, names, lenses, pairs and poses, against OpenCV itself."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from helpers import refuses
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import opencv

K = np.array([[535.9, 0.0, 342.3], [0.0, 536.4, 235.6], [0.0, 0.0, 1.0]])
D = np.array([-0.266, -0.0386, 0.00178, -0.00028, 0.238])
SIZE = (640, 480)
POINTS = np.array([[8.0, 0.5, 0.0], [12.0, -3.0, 0.5], [6.0, 1.0, 1.0], [20.0, 4.0, 2.0]])
MOUNTED = ipm_rs.Camera.from_euler(K, image_size=SIZE, position=(1.2, 0.3, 1.5), roll=0.02, pitch=0.2, yaw=-0.1)
T = MOUNTED.camera_from_vehicle


def content(**changes) -> dict:
    """One camera; a change of None removes the key."""
    whole = {"camera_matrix": K, "distortion_coefficients": D, "image_width": 640, "image_height": 480, **changes}
    return {key: value for key, value in whole.items() if value is not None}


def store(path, values) -> None:
    """Write with OpenCV."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        storage.write(key, value)
    storage.release()


@pytest.mark.parametrize("form", ["yml", "yaml", "json", "xml"])
def test_every_form(form, tmp_path):
    path = tmp_path / f"camera.{form}"
    rvec, tvec = cv2.Rodrigues(T[:3, :3])[0], T[:3, 3]
    store(path, content(rvec=rvec, tvec=tvec, image_size=np.array(SIZE, np.int32), note="made by hand"))
    camera = ipm_rs.Camera.from_opencv(path)
    assert camera.image_size == SIZE and camera.lens == ipm_rs.BrownConrady(D)
    assert ipm_rs.Camera.load(path) == camera
    np.testing.assert_allclose(camera.camera_from_vehicle, T, rtol=0, atol=1e-12)
    expected = cv2.projectPoints(POINTS, rvec, tvec, K, D)[0][:, 0]
    np.testing.assert_allclose(camera.project(POINTS)[0], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "name", ["camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "intrinsic_matrix", "mtx", "M"]
)
@pytest.mark.parametrize(
    "coefficients",
    [
        *("distortion_coefficients", "Distortion_Coefficients", "distortion_coeffs", "distortionCoefs", "distortion"),
        *("dist_coeffs", "distCoeffs", "dist_coef", "dist", "D"),
    ],
)
def test_names(name, coefficients, tmp_path):
    whole = {name: K.tolist(), coefficients: D.reshape(1, 5).tolist()[0], "imageSize": [640, 480]}
    assert opencv.read(whole) == opencv.read(content())
    path = tmp_path / "camera.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in whole.items()))
    assert ipm_rs.Camera.load(path) == opencv.read(whole)


def test_lists_written_by_hand(tmp_path):
    """What `yaml.dump({..., "dist_coeff": dist.tolist()})` of so many tutorials writes."""
    path = tmp_path / "calibration.yaml"
    path.write_text(f"camera_matrix: {K.tolist()}\ndist_coeff: {[D.tolist()]}\n")
    camera = ipm_rs.Camera.load(path, image_size=SIZE)
    assert camera == opencv.read(content())
    column = {"mtx": K.tolist(), "dist": D.reshape(5, 1).tolist(), "rvec": [[0.1], [0.2], [0.3]], "tvec": [[1, 2, 3]]}
    assert opencv.read(column, image_size=SIZE).camera_from_vehicle[2, 3] == 3
    path.write_text('{"mtx": ' + str(K.tolist()) + ', "dist": ' + str(D.tolist()) + "}")
    assert ipm_rs.Camera.load(path, image_size=SIZE) == camera


def test_names_of_products_are_no_lenses():
    assert opencv.read(content(camera_model="acA1920-40gc", model="pinhole")).lens == ipm_rs.BrownConrady(D)


@pytest.mark.parametrize(
    "size",
    [
        {"resolution": np.array([[640.0], [480.0]])},
        {"image_Width": 640, "image_Height": 480},
        {"width": 640, "height": 480},
    ],
)
def test_sizes(size):
    assert opencv.read({"K": K, "D": D, **size}) == opencv.read(content())


def test_size_from_the_caller():
    alone = {"K": K, "D": D}
    assert opencv.read(alone, image_size=(640, 480)) == opencv.read(content())
    with refuses(errors.CalibrationError, "image_width", "image_size="):
        opencv.read(alone)
    with refuses(errors.CalibrationError, "(640, 480)"):
        opencv.read(content(), image_size=(64, 48))
    with refuses(errors.CalibrationError, "one image size", "320x240 and 640x480"):
        opencv.read(content(resolution=[320, 240]))


# ---------------------------------------------------------------------------------------------------------------------
# Lenses

FOUR = [-0.04, 0.02, -0.026, 0.008]


@pytest.mark.parametrize(
    ("changes", "options", "lens"),
    [
        ({}, {}, ipm_rs.BrownConrady(D)),
        ({"distortion_coefficients": None}, {"lens": "pinhole"}, None),
        ({}, {"lens": "pinhole"}, None),
        ({"distortion_coefficients": FOUR, "distortion_model": "fisheye"}, {"lens": "pinhole"}, None),
        ({"distortion_coefficients": np.zeros((5, 1))}, {}, None),
        ({"distortion_coefficients": np.zeros(4)}, {}, None),
        ({"distortion_coefficients": np.zeros(4)}, {"lens": "fisheye"}, ipm_rs.KannalaBrandt([0, 0, 0, 0])),
        ({"D": FOUR, "distortion_coefficients": None}, {"lens": "fisheye"}, ipm_rs.KannalaBrandt(FOUR)),
        ({"D": FOUR, "distortion_coefficients": None}, {"lens": "brown_conrady"}, ipm_rs.BrownConrady(FOUR)),
        ({"distortion_coefficients": FOUR, "distortion_model": "equidistant"}, {}, ipm_rs.KannalaBrandt(FOUR)),
        ({"distortion_coefficients": FOUR, "camera_model": "fisheye"}, {}, ipm_rs.KannalaBrandt(FOUR)),
        ({"distortion_coefficients": FOUR, "fisheye_model": 1}, {}, ipm_rs.KannalaBrandt(FOUR)),
        ({"distortion_coefficients": FOUR, "fisheye_model": 0}, {}, ipm_rs.BrownConrady(FOUR)),
        ({"distortion_coefficients": FOUR, "model": "plumb_bob"}, {}, ipm_rs.BrownConrady(FOUR)),
        ({"distortion_coefficients": FOUR, "xi": 1.3}, {}, ipm_rs.Mei(1.3, FOUR)),
        ({"distortion_coefficients": FOUR, "xi": np.array([[1.3]])}, {"lens": "omnidir"}, ipm_rs.Mei(1.3, FOUR)),
    ],
)
def test_lenses(changes, options, lens):
    assert opencv.read(content(**changes), **options).lens == lens


@pytest.mark.parametrize(
    "changes",
    [{}, {"kc": D.tolist()}, {"lens_distortion": D}, {"distortion_model": "radtan"}, {"camera_model": "fisheye"}],
    ids=lambda changes: next(iter(changes), "none"),
)
def test_coefficients_that_are_not_found_are_no_pinhole(changes, tmp_path):
    """Under a name that nobody knows, or cut off: the picture would be bent, and nothing would say so."""
    with refuses(errors.CalibrationError, "expected distortion_coefficients", "missing among", "lens='pinhole'"):
        opencv.read(content(distortion_coefficients=None, **changes))
    pair = {"M1": K, "M2": K, "D1": D, "size": SIZE, "R": np.eye(3), "T": [-1, 0, 0]}
    assert opencv.read(pair, camera=1).lens == ipm_rs.BrownConrady(D)
    with refuses(errors.CalibrationError, "of camera 2, missing", "distortion_coefficients2"):
        opencv.read(pair, camera=2)


def test_load_takes_the_lens_that_the_file_lacks(tmp_path):
    path = tmp_path / "front.yaml"
    store(path, content(distortion_coefficients=np.array(FOUR)))
    with refuses(errors.ArgumentError, str(path), "lens='fisheye' if cv2.fisheye", "lens='brown_conrady' if"):
        ipm_rs.Camera.load(path)
    assert ipm_rs.Camera.load(path, lens="fisheye").lens == ipm_rs.KannalaBrandt(FOUR)
    assert ipm_rs.Camera.load(path, lens="brown_conrady").lens == ipm_rs.BrownConrady(FOUR)
    assert ipm_rs.Camera.load(path, lens="pinhole").lens is None
    with refuses(errors.ArgumentError, "lens: expected one of", "'wide'"):
        ipm_rs.Camera.load(path, lens="wide")


def test_four_coefficients_are_not_guessed():
    with refuses(errors.ArgumentError, "distortion_coefficients", "'brown_conrady'", "'fisheye'", "lens="):
        opencv.read(content(distortion_coefficients=FOUR))


def test_fisheye_pixels():
    camera = opencv.read(content(distortion_coefficients=FOUR), lens="fisheye", camera_from_vehicle=T)
    optical = (POINTS @ T[:3, :3].T + T[:3, 3])[:, None]
    expected = cv2.fisheye.projectPoints(optical, np.zeros(3), np.zeros(3), K, np.array(FOUR))[0][:, 0]
    np.testing.assert_allclose(camera.project(POINTS)[0], expected, rtol=0, atol=1e-9)


# ---------------------------------------------------------------------------------------------------------------------
# Poses


def test_where_the_pose_comes_from():
    rvec, tvec = cv2.Rodrigues(T[:3, :3])[0], T[:3, 3:]
    stored = content(rvec=rvec, tvec=tvec * 1000)
    np.testing.assert_allclose(opencv.read(stored, metres_per_unit=0.001).camera_from_vehicle, T, rtol=0, atol=1e-12)
    rotated = content(rvec=T[:3, :3], tvec=tvec)
    np.testing.assert_allclose(opencv.read(rotated).camera_from_vehicle, T, rtol=0, atol=1e-12)
    world = np.eye(4)
    world[:3, :3], world[:3, 3] = ipm_rs.rotation_from_euler(0.1, 0.2, 0.3), (4, 5, 6)
    camera = opencv.read(rotated, vehicle_from_world=world)
    np.testing.assert_allclose(camera.camera_from_vehicle, T @ np.linalg.inv(world), rtol=0, atol=1e-12)
    other = MOUNTED.with_pose(np.eye(4)).camera_from_vehicle
    np.testing.assert_array_equal(opencv.read(stored, camera_from_vehicle=other).camera_from_vehicle, other)
    assert opencv.read(content()).camera_from_vehicle[2, 0] == 1, "no pose: looks along +x"
    assert opencv.read(content(rvec=[0, 0, 0], tvec=[0, 0, 1])).camera_from_vehicle[2, 3] == 1


@pytest.fixture(scope="module")
def pair():
    """A stereo pair with everything that cv2.stereoRectify makes of it."""
    R, t = ipm_rs.rotation_from_euler(0.01, -0.02, 0.015), np.array([[-0.12], [0.003], [0.002]])
    K2, D2 = K + np.array([[3.0, 0, 4], [0, 2, -5], [0, 0, 0]]), D * 0.9
    R1, R2, P1, P2, Q = cv2.stereoRectify(K, D, K2, D2, SIZE, R, t)[:5]
    return {
        "intrinsics": {"M1": K, "D1": D, "M2": K2, "D2": D2, "image_size": list(SIZE)},
        "extrinsics": {"R": R, "T": t, "R1": R1, "R2": R2, "P1": P1, "P2": P2, "Q": Q},
    }


def test_both_cameras_of_a_pair(pair):
    whole = {**pair["intrinsics"], **pair["extrinsics"]}
    left = opencv.read(whole, camera="left", camera_from_vehicle=T)
    right = opencv.read(whole, camera=2, camera_from_vehicle=T)
    np.testing.assert_array_equal(left.camera_from_vehicle, T)
    np.testing.assert_array_equal(left.intrinsics, pair["intrinsics"]["M1"])
    optical = POINTS @ T[:3, :3].T + T[:3, 3]
    rvec = cv2.Rodrigues(whole["R"])[0]
    expected = cv2.projectPoints(optical, rvec, whole["T"], whole["M2"], whole["D2"])[0][:, 0]
    np.testing.assert_allclose(right.project(POINTS)[0], expected, rtol=0, atol=1e-9)
    # the second camera is 12 cm to the right
    assert (np.linalg.inv(T[:3, :3]) @ np.array([0.12, 0, 0]))[1] < 0 and right.position[1] < left.position[1]


def test_rectified_pixels_lie_on_one_row(pair):
    cameras = [
        opencv.read(
            pair["intrinsics"], extrinsics=pair["extrinsics"], camera=side, rectified=True, camera_from_vehicle=T
        )
        for side in ("left", "right")
    ]
    left, right = (camera.project(POINTS) for camera in cameras)
    assert cameras[0].lens is None
    np.testing.assert_allclose(left[0][:, 1], right[0][:, 1], rtol=0, atol=1e-9)
    disparity = left[0][:, 0] - right[0][:, 0]
    P2 = pair["extrinsics"]["P2"]
    np.testing.assert_allclose(
        disparity, -P2[0, 3] / left[1] + (pair["extrinsics"]["P1"] - P2)[0, 2], rtol=0, atol=1e-6
    )
    raw = opencv.read(pair["intrinsics"], camera=1, camera_from_vehicle=T).project(POINTS)[0]
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-14)
    theirs = cv2.undistortPoints(
        raw[:, None], K, D, None, pair["extrinsics"]["R1"], pair["extrinsics"]["P1"], criteria
    )[:, 0]
    np.testing.assert_allclose(left[0], theirs, rtol=0, atol=1e-7)


def test_names_of_pairs():
    for names in (
        ("K1", "D1", "K2", "D2"),
        ("K_left", "D_left", "K_right", "D_right"),
        ("left_camera_matrix", "left_dist_coeffs", "right_camera_matrix", "right_dist_coeffs"),
    ):
        whole = {
            **dict(zip(names, (K, D, K * [[2], [2], [1]], D / 2), strict=True)),
            "size": (2 * SIZE[0], 2 * SIZE[1]),
            "R": np.eye(3),
            "T": [-1, 0, 0],
        }
        assert opencv.read(whole, camera="left").intrinsics[0, 0] == K[0, 0]
        assert opencv.read(whole, camera="RIGHT").intrinsics[0, 0] == 2 * K[0, 0]
        with refuses(errors.ArgumentError, "camera: expected 1 (left) or 2 (right)", "pair"):
            opencv.read(whole)


# ---------------------------------------------------------------------------------------------------------------------
# Mistakes


@pytest.mark.parametrize(
    ("changes", "phrases"),
    [
        ({"camera_matrix": None}, ["camera_matrix", "missing among", "'distortion_coefficients'"]),
        ({"K": K}, ["one camera_matrix", "camera_matrix and K"]),
        ({"Camera_Matrix": K}, ["Camera_Matrix", "expected once"]),
        ({"camera_matrix": K[:2]}, ["camera_matrix", "3x3"]),
        ({"camera_matrix": np.full((3, 3), np.nan)}, ["camera_matrix", "nan"]),
        ({"camera_matrix": np.eye(3)[::-1]}, ["OpenCV calibration"]),
        ({"camera_matrix": "none"}, ["camera_matrix", "str 'none'"]),
        ({"distortion_coefficients": D[:3]}, ["distortion_coefficients (brown_conrady)", "got 3"]),
        ({"distortion_coefficients": [*D[:4], np.inf]}, ["distortion_coefficients[4]", "inf"]),
        ({"distortion_model": "wavy"}, ["distortion_model", "'wavy'"]),
        ({"image_width": -640}, ["image_width", "-640"]),
        ({"image_width": "wide"}, ["image_width", "'wide'"]),
        ({"rvec": [0.0, 0.0, 1.0]}, ["rvec and tvec", "got one"]),
        ({"rvec": [0.0, 0.0], "tvec": [0, 0, 0]}, ["rvec", "3 numbers"]),
        ({"rvec": np.zeros((3, 3)), "tvec": [0, 0, 0]}, ["rvec", "rotation"]),
        ({"distortion_model": "omnidir", "distortion_coefficients": FOUR}, ["xi"]),
    ],
)
def test_what_is_refused(changes, phrases):
    with refuses(errors.CalibrationError, "OpenCV calibration", *phrases):
        opencv.read(content(**changes))


def test_arguments(pair):
    with refuses(errors.ArgumentError, "lens: expected one of", "'wide'"):
        opencv.read(content(), lens="wide")
    with refuses(errors.ArgumentError, "lens: expected one of", "['fisheye']"):
        opencv.read(content(), lens=["fisheye"])
    with refuses(errors.ArgumentError, "lens: expected 'fisheye'", "distortion_model"):
        opencv.read(content(distortion_model="fisheye", distortion_coefficients=FOUR), lens="brown_conrady")
    with refuses(errors.ArgumentError, "camera: expected none", "'left'"):
        opencv.read(content(), camera="left")
    with refuses(errors.ArgumentError, "camera: expected 1 (left) or 2 (right)", "3"):
        opencv.read(pair["intrinsics"], camera=3)
    with refuses(errors.CalibrationError, "R and T", "extrinsics="):
        opencv.read(pair["intrinsics"], camera=2)
    with refuses(errors.ArgumentError, "rectified"):
        opencv.read(content(), rectified=True)
    with refuses(errors.CalibrationError, "P1", "missing"):
        opencv.read(pair["intrinsics"], camera=1, rectified=True)
    with refuses(errors.ArgumentError, "vehicle_from_world", "got both"):
        opencv.read(content(), vehicle_from_world=np.eye(4), vehicle_from_camera=np.eye(4))
    with refuses(errors.CalibrationError, "rvec and tvec", "vehicle_from_world="):
        opencv.read(content(), vehicle_from_world=np.eye(4))
    for wrong in (0, -1, float("nan"), "mm"):
        with refuses(errors.IpmError, "metres_per_unit"):
            opencv.read(content(rvec=[0, 0, 1], tvec=[0, 0, 1]), metres_per_unit=wrong)
    with refuses(errors.ArgumentTypeError, "extrinsics", "int"):
        opencv.read(pair["intrinsics"], camera=1, extrinsics=3)
    with refuses(errors.ArgumentTypeError, "source", "NoneType"):
        opencv.read(None)


leaves = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4) | st.just(10**400)
values = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=9) | st.dictionaries(st.text(max_size=3), inner), max_leaves=10
)
keys = st.sampled_from(
    [*content(), "rvec", "tvec", "xi", "K", "D1", "M1", "size", "model", "fisheye_model", "type_id", "rows"]
)


@given(changes=st.dictionaries(keys, values, max_size=3), lens=st.sampled_from([None, "fisheye", "omnidir"]))
def test_any_value_of_any_key(changes, lens):
    try:
        opencv.read({**content(rvec=[0.1, 0.2, 0.3], tvec=[1, 2, 3]), **changes}, lens=lens)
    except errors.IpmError as error:
        assert len(str(error)) < 2000
