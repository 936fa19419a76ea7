"""What no camera is, is refused; what hardly any is, is warned of, with the same text everywhere."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
import warnings

import numpy as np
import pytest

import ipm_rs

SIZE = (1280, 720)
GRID = ipm_rs.BevGrid(x=(4, 24), y=(-5, 5), resolution=0.25)


def intrinsics(fx=880.0, fy=880.0, cx=639.5, cy=359.5):
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def camera(K=None, **options):
    options = {"image_size": SIZE, "position": (1.5, 0.0, 1.4), "pitch": 0.1} | options
    return ipm_rs.Camera.from_euler(intrinsics() if K is None else K, **options)


@pytest.mark.parametrize(
    ("K", "words"),
    [
        (intrinsics(6.0, 6.0), "focal length.*millimetres"),
        (intrinsics(fx=400.0), "fx is 0.45 times fy"),
        (intrinsics(fy=400.0), "fx is 2.20 times fy"),
        (intrinsics(cx=0.499, cy=0.501), "principal point.*fraction"),
        (intrinsics(cx=0.0, cy=0.0), "principal point.*offset"),
        (intrinsics(cx=1152.0), "principal point.*90 % of the width"),
        (intrinsics(cy=40.0), "principal point.*resolution"),
        (intrinsics(cx=-3.0), "principal point"),
    ],
)
def test_odd_intrinsics_are_warned_of_and_taken_as_given(K, words):
    with pytest.warns(ipm_rs.CalibrationWarning, match=words):
        odd = ipm_rs.Camera(K, image_size=SIZE)
    np.testing.assert_array_equal(odd.intrinsics, K)
    with pytest.warns(ipm_rs.CalibrationWarning, match=words):
        camera(K)
    with pytest.warns(ipm_rs.CalibrationWarning, match=words):
        focal_length, principal_point = (K[0, 0], K[1, 1]), K[:2, 2]
        options = {"focal_length": focal_length, "principal_point": principal_point, "height": 1.4}
        ipm_rs.Camera.from_vanishing_point(principal_point + 1, image_size=SIZE, **options)
    with pytest.warns(ipm_rs.CalibrationWarning, match=words):
        ipm_rs.Camera.from_json(
            {"format": "ipm_rs.Camera", "version": 1, "image_size": list(SIZE), "intrinsics": K.tolist(), "lens": None}
            | {"camera_from_vehicle": np.eye(4).tolist()}
        )


@pytest.mark.parametrize(
    ("K", "size", "lens"),
    [
        (intrinsics(1100, 1098, 958, 541), (1920, 1080), None),
        (intrinsics(240, 240, 719.5, 719.5), (1440, 1440), ipm_rs.KannalaBrandt([0.02, -0.01, 0, 0])),
        (intrinsics(900, 620), SIZE, None),
        (intrinsics(cx=970.0, cy=170.0), SIZE, None),
        (intrinsics(1, 1, 643, 481), (1280, 966), ipm_rs.RadialPolynomial([339.7, -31.99, 48.28, -7.2])),
        (intrinsics(1, 1, 633, 407), (1280, 800), ipm_rs.Ocam([-243.0, 0.0, 1.7e-3, -1e-6, 4e-9])),
        (intrinsics(900, 900, 479.5, 959.5), (960, 1920), None),
    ],
)
def test_everyday_cameras_are_quiet(K, size, lens):
    ipm_rs.Camera(K, image_size=size, lens=lens)  # warnings are errors here


@pytest.mark.parametrize(
    ("K", "lens"),
    [
        (np.eye(3), None),
        (intrinsics(0.7, 1.2, 0.5, 0.5), None),
        (np.eye(3), ipm_rs.KannalaBrandt([0, 0, 0, 0])),
        (intrinsics(1, 1), ipm_rs.RadialPolynomial([1.05, -0.02, 0.01, 0.0])),
    ],
)
def test_placeholders_and_normalised_matrices_are_refused(K, lens):
    with pytest.raises(ipm_rs.CalibrationError, match=r"focal lengths in pixels.*placeholder.*times the width"):
        ipm_rs.Camera(K, image_size=SIZE, lens=lens)


def test_derived_and_copied_cameras_say_nothing_again():
    with pytest.warns(ipm_rs.CalibrationWarning):
        odd = ipm_rs.Camera(intrinsics(cx=1100.0), image_size=SIZE)
    corner = camera().cropped(0, 0, 300, 200)
    for one in (odd, corner):
        again = [pickle.loads(pickle.dumps(one, protocol)) for protocol in range(pickle.HIGHEST_PROTOCOL + 1)]
        assert all(other == one for other in [*again, copy.copy(one), copy.deepcopy(one)])
        one.resized(640, 360), one.with_pose(np.eye(4)), one.mirrored(), one.rotated180(), one.binned(2)
        one.cropped(0, 0, 20, 20)


def test_the_line_of_the_caller_is_shown():
    with pytest.warns(ipm_rs.CalibrationWarning) as seen:
        ipm_rs.Camera(intrinsics(cx=1100.0), image_size=SIZE)
        ipm_rs.Camera.from_nuscenes(
            {"translation": [1.6, 0, 1.5], "rotation": [0.5, -0.5, 0.5, -0.5], "sensor_token": "x"}
            | {"camera_intrinsic": intrinsics(cx=1400.0).tolist()}
        )
        ipm_rs.Lut(camera(yaw=np.pi), GRID)
    assert [warning.filename for warning in seen] == [__file__] * 3


def test_as_an_error_it_leaves_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error", ipm_rs.CalibrationWarning)
        with pytest.raises(ipm_rs.CalibrationWarning, match="principal point"):
            ipm_rs.Camera(intrinsics(cx=1100.0), image_size=SIZE)
        with pytest.raises(ipm_rs.CalibrationWarning, match="under it"):
            ipm_rs.Lut(camera(position=(0, 0, -1.0)), GRID)


@pytest.mark.parametrize(
    "ground",
    [
        0.0,
        ipm_rs.Plane.from_angles(slope=0.05, bank=-0.02, height=0.0),
        ipm_rs.HeightMap(np.zeros((40, 20)), origin=(-2, -9), spacing=1.0),
        ipm_rs.HeightMap(np.zeros((30, 20)), origin=(3, -9), spacing=1.0),
    ],
)
def test_a_road_seen_edge_on_has_no_valid_cell(ground):
    for pitch in (0.0, 0.2, -0.2):
        eye = camera(position=(0, 0, 0), pitch=pitch)
        with pytest.warns(ipm_rs.CalibrationWarning, match=r"0 m high.*road at 0 m.*edge-on.*height"):
            lut = ipm_rs.Lut(eye, GRID, ground=ground)
        assert not lut.mask.any()
        assert np.isnan(lut.maps()[0]).all()
        assert not eye.project([[9.0, 0.5], [20.0, -1.0]], ground=ground)[2].any()
        assert not eye.pixels_from_cells([[3.0, 3.0]], GRID, ground=ground)[2].any()
        assert np.isnan(eye.ground_from_pixels([[640.0, 700.0], [600.0, 20.0]], ground=ground)).all()
        assert eye.project_polyline([[5.0, 1.0], [20.0, 1.0]], ground=ground) == []


def test_a_camera_under_its_road_is_warned_of_and_sees_a_ceiling():
    with pytest.warns(ipm_rs.CalibrationWarning, match=r"-1\.25 m high.*1\.25 m under it.*solvePnP"):
        lut = ipm_rs.Lut(camera(position=(0, 0, -1.25), pitch=-0.1), GRID)
    assert lut.mask.any()
    slope = ipm_rs.Plane.from_angles(slope=0.0, bank=0.0, height=3.5)
    for ground in (3.5, slope, ipm_rs.HeightMap(np.full((40, 20), 3.5), origin=(3, -9), spacing=1.0)):
        with pytest.warns(ipm_rs.CalibrationWarning, match=r"road at 3\.5 m, but 2\.1 m under it"):
            assert ipm_rs.Lut(camera(pitch=-0.1), GRID, ground=ground).mask.any()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"yaw": np.pi}, "camera at .1.50, -?0.00, 1.40. m, looks 180.0 degrees.*behind it"),
        ({"K": intrinsics(3000, 3000), "yaw": 1.35}, "beyond the right edge"),
        ({"K": intrinsics(3000, 3000), "yaw": -1.35}, "beyond the left edge"),
        ({"pitch": 1.4}, "beyond the top edge.*sees the road at"),
        ({"pitch": -1.0}, "beyond the bottom edge.*sees no road"),
        (
            {"yaw": 1.3, "lens": ipm_rs.KannalaBrandt([0, 0, 0, 0], max_angle=0.1)},
            "beyond the angles",
        ),
        ({"ground": ipm_rs.HeightMap(np.full((9, 9), 0.1), origin=(200, 0), spacing=1.0)}, "does not know the road"),
    ],
)
def test_a_table_that_sees_nothing_says_why(options, words):
    ground = options.get("ground", 0.0)
    eye = camera(**{name: value for name, value in options.items() if name != "ground"})
    with pytest.warns(ipm_rs.CalibrationWarning, match=f"no cell.*({words})"):
        assert not ipm_rs.Lut(eye, GRID, ground=ground).mask.any()


def test_the_command_line_says_it_in_a_line(tmp_path):
    from PIL import Image

    Image.fromarray(np.zeros((720, 1280, 3), np.uint8)).save(tmp_path / "frame.png")
    camera(yaw=np.pi).save(tmp_path / "camera.json")
    words = ["warp", "camera.json", "frame.png", "-o", "bev.png", "--quiet"]
    words += ["--x", "4", "24", "--y", "-5", "5", "--resolution", "0.25"]
    run = {"cwd": tmp_path, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, "-m", "ipm_rs", *words], **run)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("ipm-rs: error: no cell") and done.stderr.count("\n") == 1, done.stderr
    camera(pitch=-0.1).save(tmp_path / "camera.json")
    words += ["--ground", "5"]  # under its road, which some ceilings are
    done = subprocess.run([sys.executable, "-m", "ipm_rs", *words], **run)
    assert done.returncode == 0, done.stderr
    assert done.stderr.startswith("ipm-rs: warning: the camera") and done.stderr.count("\n") == 1, done.stderr
    (tmp_path / "bev.png").unlink()
    code = "import sys, warnings, ipm_rs.cli; warnings.simplefilter('error', ipm_rs.CalibrationWarning); "
    code += f"sys.exit(ipm_rs.cli.main({words!r}))"
    done = subprocess.run([sys.executable, "-c", code], **run)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("ipm-rs: error: the camera") and done.stderr.count("\n") == 1, done.stderr
    assert not (tmp_path / "bev.png").exists()
