"""KITTI (object, tracking, odometry, road, raw) and KITTI-360: numbers, frames, lenses, and what is refused."""

from __future__ import annotations

import math

import calibration_datasets as samples
import cv2
import golden
import numpy as np
import pytest
from calibration_samples import SAMPLES
from helpers import refuses

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import kitti, kitti_360, kitti_raw

SIZE = (1242, 375)
FLU_FROM_OPTICAL = samples.OPTICAL_FROM_FLU.T


def square(T) -> np.ndarray:
    """(4, 4) of 12 numbers."""
    return np.vstack([np.reshape(T, (3, 4)), (0, 0, 0, 1)])


def product(content, camera=2) -> np.ndarray:
    """P R0 Tr, the dataset's own definition."""
    R0 = np.eye(4)
    R0[:3, :3] = np.reshape(content["R0_rect"], (3, 3))
    return np.reshape(content[f"P{camera}"], (3, 4)) @ R0 @ square(content["Tr_velo_to_cam"])


def pixels(P, points) -> np.ndarray:
    """Pixels of a 3x4 projection."""
    uvw = np.column_stack([points, np.ones(len(points))]) @ P.T
    return uvw[:, :2] / uvw[:, 2:]


@pytest.fixture(scope="module")
def points():
    random = np.random.default_rng(4)
    return np.column_stack([random.uniform(4, 60, 500), random.uniform(-15, 15, 500), random.uniform(-2, 3, 500)])


# ---------------------------------------------------------------------------------------------------------------------
# Object, road


@pytest.mark.parametrize("camera", range(4))
def test_object_is_the_product_of_the_matrices(camera, points):
    got, depth, _ = kitti.read(golden.KITTI, camera=camera, image_size=SIZE).project(points)
    P = product(golden.KITTI, camera)
    np.testing.assert_allclose(got, pixels(P, points), rtol=0, atol=1e-9)
    np.testing.assert_allclose(depth, np.column_stack([points, np.ones(500)]) @ P[2], rtol=0, atol=1e-12)


def test_fourth_column_is_kept_whole():
    K, offset = kitti.projection(kitti.Section(golden.KITTI, "x"), "P2")
    np.testing.assert_allclose(offset, golden.KITTI_OFFSET, rtol=0, atol=5e-7)
    np.testing.assert_allclose(K @ offset, np.reshape(golden.KITTI["P2"], (3, 4))[:, 3], rtol=0, atol=1e-13)
    right = kitti.projection(kitti.Section(golden.KITTI, "x"), "P3")[1]
    assert offset[0] - right[0] == pytest.approx(0.53271, abs=5e-6)


def test_matrices_are_taken_as_printed():
    camera = kitti.read(golden.KITTI, camera=0, image_size=SIZE)
    R = camera.camera_from_vehicle[:3, :3]
    expected = np.reshape(golden.KITTI["R0_rect"], (3, 3)) @ square(golden.KITTI["Tr_velo_to_cam"])[:3, :3]
    np.testing.assert_array_equal(R, expected)
    assert 1e-9 < np.abs(R.T @ R - np.eye(3)).max() < 1e-6, "six digits are not orthonormal, and stay so"


def test_road_frame():
    camera = kitti.read(golden.KITTI, image_size=SIZE, frame="road")
    right, forward = golden.KITTI_ROAD_XZ.T
    uv, _, valid = camera.project(np.column_stack([forward, -right]))
    np.testing.assert_allclose(uv, golden.KITTI_ROAD_UV, rtol=0, atol=1e-6)
    assert valid.all()
    left, *_ = kitti.read(golden.KITTI, camera=0, image_size=SIZE, frame="road").position[1:]
    np.testing.assert_allclose(left, -0.0096, rtol=0, atol=5e-5)
    camera0 = kitti.read(golden.KITTI, camera=0, image_size=SIZE, frame="road").position
    np.testing.assert_allclose(camera0, (0.2789, -0.0096, 1.5971), rtol=0, atol=1e-4)


@pytest.mark.parametrize("frame", ["imu", "camera", "road"])
def test_frames_see_the_same_world(frame, points):
    """A point given in each frame has one pixel."""
    R0 = np.eye(4)
    R0[:3, :3] = np.reshape(golden.KITTI["R0_rect"], (3, 3))
    rectified_from_velodyne = R0 @ square(golden.KITTI["Tr_velo_to_cam"])
    turned = np.eye(4)
    turned[:3, :3] = FLU_FROM_OPTICAL
    frame_from_velodyne = {
        "imu": np.linalg.inv(square(golden.KITTI["Tr_imu_to_velo"])),
        "camera": turned @ rectified_from_velodyne,
        "road": turned @ square(golden.KITTI["Tr_cam_to_road"]) @ np.linalg.inv(R0) @ rectified_from_velodyne,
    }[frame]
    moved = points @ frame_from_velodyne[:3, :3].T + frame_from_velodyne[:3, 3]
    expected, *_ = kitti.read(golden.KITTI, image_size=SIZE).project(points)
    got, *_ = kitti.read(golden.KITTI, image_size=SIZE, frame=frame).project(moved)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9)


def test_odometry_goes_to_the_rectified_camera(points, tmp_path):
    path = SAMPLES["kitti odometry"].write(tmp_path)
    got, *_ = ipm_rs.Camera.from_kitti(path, image_size=SIZE).project(points)
    np.testing.assert_allclose(got, pixels(samples.P[2] @ square(samples.VELO_TO_CAM), points), rtol=0, atol=1e-9)


def test_tracking_is_object_by_other_names(tmp_path):
    tracking = ipm_rs.Camera.from_kitti(SAMPLES["kitti tracking"].write(tmp_path), image_size=SIZE, frame="imu")
    objects = ipm_rs.Camera.from_kitti(SAMPLES["kitti object"].write(tmp_path), image_size=SIZE, frame="imu")
    assert tracking == objects


def test_projections_alone_serve_the_camera_frame():
    only = {key: golden.KITTI[key] for key in ("P0", "P1", "P2", "P3")}
    camera = kitti.read(only, camera=0, image_size=SIZE, frame="camera")
    assert camera == ipm_rs.Camera(np.reshape(only["P0"], (3, 4))[:, :3], image_size=SIZE)
    with refuses(errors.CalibrationError, "R0_rect", "missing"):
        kitti.read(only, image_size=SIZE)


def test_a_file_of_the_grey_cameras_alone_is_recognised(tmp_path):
    rows = "".join(f"{key}: {' '.join(map(str, golden.KITTI[key]))}\n" for key in ("P0", "P1"))
    (tmp_path / "calib.txt").write_text(rows)
    camera = ipm_rs.Camera.load(tmp_path / "calib.txt", SIZE, camera=1, frame="camera")
    assert camera == kitti.read(golden.KITTI, camera=1, image_size=SIZE, frame="camera")
    assert list(ipm_rs.Rig.load(tmp_path / "calib.txt", image_size=SIZE, frame="camera")) == ["P0", "P1"]
    with refuses(errors.CalibrationError, "P2 for camera=2", "cameras 0, 1", "camera=0"):
        ipm_rs.Camera.load(tmp_path / "calib.txt", SIZE, frame="camera")


@pytest.mark.parametrize("camera", [2, "2", "02", "P2", "image_2", "image_02", np.int64(2)], ids=repr)
def test_camera_by_name_or_number(camera):
    assert kitti.read(golden.KITTI, camera=camera, image_size=SIZE) == kitti.read(golden.KITTI, image_size=SIZE)


@pytest.mark.parametrize("frame", ["velodyne", "imu", "camera"])
def test_real_object_file(shared_data, frame):
    camera = ipm_rs.Camera.load(shared_data / "kitti" / "000114_calib.txt", image_size=SIZE)
    assert camera == kitti.read(golden.KITTI, image_size=SIZE)
    heights = {"velodyne": -1.65, "imu": -0.85, "camera": -1.58}
    camera = ipm_rs.Camera.from_kitti(shared_data / "kitti" / "000114_calib.txt", image_size=SIZE, frame=frame)
    (uv,), _, (valid,) = camera.project([[12.0, 0.0, heights[frame]]])
    assert valid and 550 < uv[0] < 680 and 240 < uv[1] < 310, "12 m ahead on the road is below the image's centre"


def test_real_labels(shared_data):
    """The corners of each 3D box, in the rectified camera's axes, are framed by its 2D box."""
    camera = ipm_rs.Camera.from_kitti(shared_data / "kitti" / "000114_calib.txt", image_size=SIZE, frame="camera")
    differences = []
    for line in (shared_data / "kitti" / "000114_label.txt").read_text().splitlines():
        kind, truncated, occluded, _, *numbers = line.split()
        if kind == "DontCare" or float(truncated) > 0 or occluded != "0":
            continue
        left, top, right, bottom, height, width, length, x, y, z, turn = map(float, numbers[:11])
        if left <= 0 or top <= 0 or right >= SIZE[0] - 1 or bottom >= SIZE[1] - 1:
            continue
        c, s = math.cos(turn), math.sin(turn)
        box = np.array([(i * length / 2, -j * height, k * width / 2) for i in (-1, 1) for j in (0, 1) for k in (-1, 1)])
        optical = box @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) + (x, y, z)
        uv, *_ = camera.project(optical @ FLU_FROM_OPTICAL.T)
        differences.append(np.array([*uv.min(axis=0), *uv.max(axis=0)]) - (left, top, right, bottom))
    assert len(differences) >= 3
    assert np.abs(np.median(differences, axis=0)).max() < 2, "un-truncated boxes agree to a pixel or so"


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"P2": None}, "P2: expected a 3x4 matrix, got None"),
        ({"P2": [1.0] * 11}, "P2: expected a 3x4 matrix, got 11 numbers"),
        ({"P2": [math.nan] * 12}, "P2[0]: expected a finite number, got nan"),
        ({"P2": [0.0] * 12}, "P2: expected K [I | t]"),
        ({"R0_rect": [2.0, 0, 0, 0, 2, 0, 0, 0, 2]}, "R0_rect: expected a rotation"),
        ({"R0_rect": [-1.0, 0, 0, 0, -1, 0, 0, 0, -1]}, "det R = -1"),
        ({"Tr_velo_to_cam": [0.0] * 12}, "Tr_velo_to_cam[:3, :3]: expected a rotation"),
        ({"Tr_velo_to_cam": "x"}, "Tr_velo_to_cam: expected a 3x4 matrix, got str"),
    ],
)
def test_wrong_numbers(change, named):
    with refuses(errors.CalibrationError, "KITTI calibration", named):
        kitti.read({**golden.KITTI, **change}, image_size=SIZE)


@pytest.mark.parametrize("key", ["P2", "R0_rect", "Tr_velo_to_cam"])
def test_missing_line(key, tmp_path):
    data = SAMPLES["kitti object"].files["000000.txt"]
    path = tmp_path / "000000.txt"
    path.write_bytes(b"".join(line for line in data.splitlines(True) if not line.startswith(key.encode())))
    with refuses(errors.CalibrationError, str(path), "missing", key):
        kitti.read(path, image_size=SIZE)


def test_line_twice_and_broken_number(tmp_path):
    path = tmp_path / "000000.txt"
    data = SAMPLES["kitti object"].files["000000.txt"]
    path.write_bytes(data + data[: data.index(b"\n") + 1])
    with refuses(errors.CalibrationError, str(path), "'P0'", "once", "line 9"):
        kitti.read(path, image_size=SIZE)
    path.write_bytes(data.replace(b"e+02", b"e+O2"))
    with refuses(errors.CalibrationError, str(path), "P2[0]: expected a finite number, got str '7.2"):
        kitti.read(path, image_size=SIZE)


def test_line_twice_is_said_by_load_too(tmp_path):
    """A file with a flaw is still of its format: no list of what the other formats lack."""
    path = tmp_path / "000000.txt"
    data = SAMPLES["kitti object"].files["000000.txt"]
    path.write_bytes(data + data[: data.index(b"\n") + 1])
    with refuses(errors.CalibrationError, f"{path}: expected the key 'P0' once, got it again in line 9"):
        ipm_rs.Camera.load(path, image_size=SIZE)


def test_a_number_cut_short_is_not_another_number(tmp_path):
    """Twelve numbers, of which the last, 2.7 of 2.718000000000e-01, would put the camera metres away."""
    path = tmp_path / "000000.txt"
    data = SAMPLES["kitti object"].files["000000.txt"]
    end = data.index(b"\n", data.index(b"Tr_velo_to_cam"))
    for cut in range(1, 19):
        path.write_bytes(data[: end - cut])
        for read in (ipm_rs.Camera.load, kitti.read):
            with refuses(errors.CalibrationError, str(path), "line 6", "fetch it again"):
                read(path, image_size=SIZE)
    expected = kitti.read(SAMPLES["kitti object"].write(tmp_path / "whole"), image_size=SIZE)
    path.write_bytes(data[:end])  # whole, and no more than the end of the line is missing
    assert kitti.read(path, image_size=SIZE) == expected


def test_what_the_file_lacks_must_be_given(tmp_path):
    path = SAMPLES["kitti object"].write(tmp_path)
    with refuses(errors.CalibrationError, str(path), "image_size", "1242x375"):
        ipm_rs.Camera.load(path)
    with refuses(errors.CalibrationError, "Tr_cam_to_road", "missing"):
        kitti.read(path, image_size=SIZE, frame="road")


@pytest.mark.parametrize(
    ("camera", "error"), [(4, ValueError), ("left", ValueError), (True, TypeError), (2.0, TypeError)]
)
def test_no_such_camera(camera, error):
    for module, source in ((kitti, golden.KITTI), (kitti_raw, {}), (kitti_360, {})):
        with pytest.raises(error, match="camera: expected one of 0, 1, 2, 3"):
            module.read(source, camera=camera)


@pytest.mark.parametrize(("frame", "error"), [("ego", errors.ArgumentError), (None, errors.ArgumentTypeError)])
def test_no_such_frame(frame, error):
    for module, source in ((kitti, golden.KITTI), (kitti_raw, {}), (kitti_360, {})):
        with refuses(error, "frame: expected one of", "velodyne"):
            module.read(source, frame=frame)


# ---------------------------------------------------------------------------------------------------------------------
# Raw


def test_raw_rectified_is_the_object_benchmarks(tmp_path):
    path = SAMPLES["kitti raw"].write(tmp_path)
    for frame in ("velodyne", "imu", "camera"):
        raw = ipm_rs.Camera.from_kitti_raw(path, frame=frame)
        objects = ipm_rs.Camera.from_kitti(SAMPLES["kitti object"].write(tmp_path), image_size=SIZE, frame=frame)
        np.testing.assert_allclose(raw.camera_from_vehicle, objects.camera_from_vehicle, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(raw.intrinsics, objects.intrinsics)
        assert raw.image_size == SIZE and raw.lens is None


def test_raw_images_keep_their_lens(tmp_path, points):
    camera = ipm_rs.Camera.from_kitti_raw(SAMPLES["kitti raw"].write(tmp_path), camera=3, rectified=False)
    assert camera.image_size == (1392, 512)
    assert camera.lens == ipm_rs.BrownConrady(samples.DISTORTION)
    at_camera0 = points @ samples.VELO_TO_CAM[:, :3].T + samples.VELO_TO_CAM[:, 3]
    R, t = samples.rotation(0.003, -0.006, 0.009), np.array(samples.STEREO[3])
    K = np.array([[959.8, 0, 696.0], [0, 956.9, 224.2], [0, 0, 1]])
    expected, _ = cv2.projectPoints(at_camera0 @ R.T + t, np.zeros(3), np.zeros(3), K, np.array(samples.DISTORTION))
    uv, _, valid = camera.project(points)
    np.testing.assert_allclose(uv[valid], expected[valid, 0], rtol=0, atol=1e-7)
    assert valid.sum() > 100


def test_raw_needs_its_neighbours(tmp_path):
    path = SAMPLES["kitti raw"].write(tmp_path)
    (path / "calib_velo_to_cam.txt").unlink()
    assert ipm_rs.Camera.from_kitti_raw(path, frame="camera").image_size == SIZE
    with refuses(errors.MissingFileError, "calib_velo_to_cam.txt", "KITTI raw"):
        ipm_rs.Camera.from_kitti_raw(path)


def test_raw_from_mappings(tmp_path):
    content = {name.split("/")[1][:-4]: data for name, data in samples.KITTI_RAW_FILES.items()}
    tables = {}
    for name, data in content.items():
        rows = (line.partition(":") for line in data.decode().splitlines())
        tables[name] = {key: [float(x) for x in value.split()] for key, _, value in rows if key != "calib_time"}
    for rectified in (True, False):
        expected = ipm_rs.Camera.from_kitti_raw(SAMPLES["kitti raw"].write(tmp_path), rectified=rectified, frame="imu")
        assert ipm_rs.Camera.from_kitti_raw(tables, rectified=rectified, frame="imu") == expected
    with refuses(errors.CalibrationError, "KITTI raw calibration", "calib_velo_to_cam"):
        ipm_rs.Camera.from_kitti_raw({"calib_cam_to_cam": tables["calib_cam_to_cam"]})


# ---------------------------------------------------------------------------------------------------------------------
# KITTI-360


def test_360_perspective():
    content = {
        "perspective": golden.KITTI_360,
        "calib_cam_to_velo": golden.KITTI_360_CAM_TO_VELO,
        "calib_cam_to_pose": {"image_00": samples.TO_POSE[0]},
    }
    camera = kitti_360.read(content)
    assert camera.image_size == (1408, 376)
    (uv,), *_ = camera.project([[10.0, 0.0, -1.73]])
    np.testing.assert_allclose(uv, (724.166, 280.915), rtol=0, atol=5e-4)
    np.testing.assert_allclose(camera.position, (0.804, 0.299, -0.177), rtol=0, atol=5e-4)
    unrectified = np.reshape(golden.KITTI_360_CAM_TO_VELO, (3, 4))[:, 2]
    np.testing.assert_allclose(unrectified, (0.995, 0.044, -0.088), rtol=0, atol=5e-4)
    expected = (
        np.reshape(golden.KITTI_360["P_rect_00"], (3, 4))
        @ square(np.column_stack([np.reshape(golden.KITTI_360["R_rect_00"], (3, 3)), np.zeros(3)]))
        @ np.linalg.inv(square(golden.KITTI_360_CAM_TO_VELO))
    )
    points = np.random.default_rng(3).uniform((3, -9, -2), (50, 9, 3), (300, 3))
    np.testing.assert_allclose(camera.project(points)[0], pixels(expected, points), rtol=0, atol=1e-9)


def test_360_pose_frame_is_turned_upright(tmp_path):
    path = SAMPLES["kitti-360"].write(tmp_path)
    for number in range(4):
        camera = ipm_rs.Camera.from_kitti_360(path, camera=number, frame="pose")
        x, y, z = samples.TO_POSE[number][:, 3]
        np.testing.assert_allclose(camera.position, (x, -y, -z), rtol=0, atol=1e-7)
    front = ipm_rs.Camera.from_kitti_360(path, frame="pose").vehicle_from_camera[:3, :3]
    assert front[0, 2] > 0.99 and front[1, 0] < -0.99 and front[2, 1] < -0.99, "forward, right and down of the camera"


def test_360_cameras_see_the_same_world(tmp_path):
    """A point in both frames has one pixel in every camera."""
    path = SAMPLES["kitti-360"].write(tmp_path)
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    pose_from_velodyne = flip @ square(samples.TO_POSE[0]) @ np.linalg.inv(square(samples.CAM_TO_VELO))
    points = np.random.default_rng(5).uniform((-20, -20, -2), (20, 20, 3), (400, 3))
    moved = points @ pose_from_velodyne[:3, :3].T + pose_from_velodyne[:3, 3]
    for number in range(4):
        expected, _, seen = ipm_rs.Camera.from_kitti_360(path, camera=number).project(points)
        got, *_ = ipm_rs.Camera.from_kitti_360(path, camera=number, frame="pose").project(moved)
        assert seen.sum() > 20
        np.testing.assert_allclose(got[seen], expected[seen], rtol=0, atol=1e-6)


def test_360_fisheye(tmp_path):
    camera = ipm_rs.Camera.load(SAMPLES["kitti-360"].write(tmp_path), camera=2)
    assert camera.image_size == (1400, 1400)
    uv, *_ = camera.with_pose(np.eye(4)).project(golden.KITTI_360_RAYS)
    np.testing.assert_allclose(uv, golden.KITTI_360_RAYS_UV, rtol=0, atol=5e-5)
    assert math.degrees(camera.lens.max_angle) == pytest.approx(golden.KITTI_360_MAX_ANGLE_DEG, abs=0.05)


def test_360_fisheye_as_old_opencv_writes_it(tmp_path):
    """No space after a colon, which the dataset's own reader mends before it parses."""
    path = SAMPLES["kitti-360 fisheye"].write(tmp_path)
    expected = ipm_rs.Camera.from_kitti_360(path)
    path.write_bytes(path.read_bytes().replace(b": ", b":") + b"# end\n")
    assert ipm_rs.Camera.load(path) == expected


def test_360_fisheye_cut_short_within_its_last_number(tmp_path):
    path = SAMPLES["kitti-360 fisheye"].write(tmp_path)
    data = path.read_bytes().rstrip()
    assert data.endswith(b"v0: 7.0576498308221585e+02")
    for cut in (1, 4, 15):
        path.write_bytes(data[:-cut])
        with refuses(errors.CalibrationError, str(path), "complete numbers", "fetch it again"):
            ipm_rs.Camera.load(path)


def test_360_camera_of_its_own_file(tmp_path):
    path = SAMPLES["kitti-360 fisheye"].write(tmp_path)
    assert ipm_rs.Camera.load(path) == ipm_rs.Camera.from_kitti_360(path.parent, camera=3)
    assert ipm_rs.Camera.load(path, camera=1) == ipm_rs.Camera.from_kitti_360(path.parent, camera=1)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        (b"model_type: MEI", b"model_type: KB4", "model_type: expected one of 'MEI', got str 'KB4'"),
        (b"xi: 2.2", b"xi: -2.2", "xi"),
        (b"xi: 2.2134047507854890e+00", b"xi: .nan", "mirror_parameters.xi: expected a finite number"),
        (b"   p2: 4.2462134260997584e-04\n", b"", "missing p2"),
        (b"gamma1: 1.3", b"gamma1: -1.3", "gamma1: expected a finite, positive number"),
        (b"image_width: 1400", b"image_width: 0", "image_width: expected a whole number"),
        (b"mirror_parameters:", b"mirror:", "missing mirror_parameters"),
        (b"   k1: 1.6", b"   p1: 1.6", "'p1' once"),
        (b"u0: 7.1", b"u0 7.1", "expected 'key: value', got 'u0 7.1"),
    ],
)
def test_360_wrong_fisheye(old, new, named, tmp_path):
    path = SAMPLES["kitti-360 fisheye"].write(tmp_path)
    data = path.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new))
    with refuses(errors.CalibrationError, str(path), named):
        ipm_rs.Camera.from_kitti_360(path)


def test_360_needs_its_neighbours(tmp_path):
    path = SAMPLES["kitti-360"].write(tmp_path)
    (path / "calib_cam_to_velo.txt").unlink()
    assert ipm_rs.Camera.from_kitti_360(path, frame="pose").image_size == (1408, 376)
    with refuses(errors.MissingFileError, "calib_cam_to_velo.txt", "KITTI-360"):
        ipm_rs.Camera.from_kitti_360(path)
