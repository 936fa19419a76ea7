"""Files of several cameras, and names of other tools, as the OpenCV reader takes them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors

D = [0.071, 0.008, -0.003, 0.0009]
FISHEYE = ipm_rs.KannalaBrandt(D)


def K(f):
    return [[f, 0.0, 483.5], [0.0, f + 1, 322.25], [0.0, 0.0, 1.0]]


def part(f, **more):
    return {"K": K(f), "D": [[d] for d in D], **more}


def pose(z):
    return {"rvec": [0.0, 0.0, 0.0], "tvec": [0.0, 0.0, z]}


def write(tmp_path, content, form="json"):
    path = tmp_path / f"cameras.{form}"
    if form == "json":
        path.write_text(json.dumps(content))
    else:
        path.write_text(pytest.importorskip("yaml").safe_dump(content))
    return path


SHAPES = {
    "a section for each": {"front": part(301), "left": part(302), "size": [960, 640]},
    "a size in each": {"front": part(301, image_size=[960, 640]), "left": part(302, image_size=[960, 640])},
    "a group": {"cameras": {"front": part(301), "left": part(302)}, "resolution": {"width": 960, "height": 640}},
    "a list": {"cameras": [{"name": n, "size": [960, 640], **part(f)} for n, f in (("front", 301), ("left", 302))]},
    "a bare list": [
        {"id": n, "size": {"rows": 640, "cols": 960}, **part(f)} for n, f in (("front", 301), ("left", 302))
    ],
    "parts in groups": {
        "image_size": "960x640",
        "intrinsic": {"front": part(301), "left": part(302)},
        "extrinsic": {"front": pose(1.0), "left": pose(2.0)},
    },
    "parts of each": {
        "image_size": [960, 640],
        **{n: {"intrinsic": part(f), "extrinsic": pose(f - 300.0)} for n, f in (("front", 301), ("left", 302))},
    },
    "parts of each in a group": {
        "cameras": {
            n: {"intrinsics": {"camera_matrix": K(f), "dist_coeffs": D}, "resolution": {"width": 960, "height": 640}}
            for n, f in (("front", 301), ("left", 302))
        }
    },
    "parts of each in a list": [
        {"name": n, "calibration": part(f, image_size=[960, 640])} for n, f in (("front", 301), ("left", 302))
    ],
    "all of it in a section": {"rig": {"cameras": {"front": part(301), "left": part(302)}}, "size": [960, 640]},
    "parts in sections": {
        name: {"intrinsics": K(f), "dist_coeffs": D, "width": 960, "height": 640}
        for name, f in (("front", 301), ("left", 302))
    },
}  # fmt: skip


@pytest.mark.parametrize("form", ["json", "yaml"])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_section_for_each_camera(shape, form, tmp_path):
    path = write(tmp_path, SHAPES[shape], form)
    for name, f in (("front", 301), ("left", 302)):
        camera = ipm_rs.Camera.load(path, camera=name, lens="fisheye")
        np.testing.assert_array_equal(camera.intrinsics, K(f))
        assert camera.lens == FISHEYE and camera.image_size == (960, 640)
        if shape in ("parts in groups", "parts of each"):
            assert camera.camera_from_vehicle[2, 3] == f - 300
    with refuses(errors.ArgumentError, str(path), "camera: expected one of 'front', 'left'", "got None"):
        ipm_rs.Camera.load(path, lens="fisheye")
    with refuses(errors.ArgumentError, "camera: expected one of 'front', 'left'", "'rear'"):
        ipm_rs.Camera.load(path, lens="fisheye", camera="rear")
    with refuses(errors.ArgumentError, "cameras", "lens='fisheye'"):
        ipm_rs.Camera.load(path, camera="front")


def test_one_camera_in_several_places(tmp_path):
    content = {"intrinsic": part(300, size=[960, 640]), "extrinsic": {"mast": pose(1.0), "bumper": pose(2.0)}}
    path = write(tmp_path, content)
    for name, z in (("mast", 1), ("bumper", 2)):
        camera = ipm_rs.Camera.load(path, camera=name, lens="fisheye")
        assert camera.camera_from_vehicle[2, 3] == z and camera.intrinsics[0, 0] == 300
    with refuses(errors.ArgumentError, "'mast', 'bumper'"):
        ipm_rs.Camera.load(path, lens="fisheye")
    single = write(tmp_path, {"camera": part(300, size=[960, 640]), "extrinsics": pose(3.0)})
    assert ipm_rs.Camera.load(single, lens="fisheye").camera_from_vehicle[2, 3] == 3


def test_sections_of_a_pair(tmp_path):
    sides = {"right": part(302), "left": part(301)}
    path = write(tmp_path, {**sides, "size": [960, 640], "R": np.eye(3).tolist(), "T": [[-0.4], [0.0], [0.0]]})
    left, right = (ipm_rs.Camera.load(path, camera=side, lens="fisheye") for side in ("left", "right"))
    np.testing.assert_allclose(left.position, 0, atol=1e-12)
    np.testing.assert_allclose(right.position, [0, -0.4, 0], rtol=0, atol=1e-12)


def test_numbers_of_cameras(tmp_path):
    """Cameras that are counted from 0, and more than two."""
    for names, choices in (
        (("K0", "D0", "K1", "D1"), {0: 301, 1: 302, "left": 301, "right": 302}),
        (("cameraMatrixL", "distCoeffsL", "cameraMatrixR", "distCoeffsR"), {"L": 301, "R": 302, 1: 301, "right": 302}),
        (("cam1_K", "cam1_D", "cam2_K", "cam2_D"), {"cam1": 301, 2: 302}),
        (("K_01", "D_01", "K_02", "D_02", "K_03", "D_03"), {1: 301, "3": 303}),
    ):
        content = {"size": [960, 640], "R": np.eye(3).tolist(), "T": [-0.4, 0, 0]}
        content |= {name: K(301 + i // 2) if i % 2 == 0 else D for i, name in enumerate(names)}
        path = write(tmp_path, content)
        for camera, f in choices.items():
            assert ipm_rs.Camera.load(path, camera=camera, lens="fisheye").intrinsics[0, 0] == f, (names, camera)
        with refuses(errors.ArgumentError, "camera: expected"):
            ipm_rs.Camera.load(path, lens="fisheye")
        with refuses(errors.ArgumentError, "camera: expected", "7"):
            ipm_rs.Camera.load(path, camera=7, lens="fisheye")


@pytest.mark.parametrize(
    "names",
    [
        {"CameraMat": "K", "DistCoeff": "D", "ImageSize": [960, 640], "DistModel": "fisheye"},
        {"CameraMatrix": "K", "DistortionCoeff": "D", "resolution": {"width": 960, "height": 640}, "lens": "fisheye"},
        {"camera_matrix": "K", "distance_coefficients": "D", "size": {"rows": 640, "cols": 960}, "type": "equidistant"},
        {"camMatrix": "K", "dist_coef": "D", "img_width": 960, "img_height": 640, "camera_model": "fisheye"},
        {"cameraIntrinsics": "K", "distCoeffs": "D", "frame_size": "960x640", "lens_type": "KANNALA_BRANDT"},
        {"intrinsics": "K", "distortion": "D", "size": [[960], [640]], "model": "opencv_fisheye"},
    ],
)
def test_names_of_other_tools(names, tmp_path):
    content = {
        key: {"K": K(300), "D": [D]}.get(value, value) if isinstance(value, str) else value
        for key, value in names.items()
    }
    for form in ("json", "yaml"):
        camera = ipm_rs.Camera.load(write(tmp_path, content, form))
        np.testing.assert_array_equal(camera.intrinsics, K(300))
        assert camera.image_size == (960, 640) and camera.lens == FISHEYE


def test_a_number_named_k_is_no_camera(tmp_path):
    path = write(tmp_path, {"camera_matrix": K(300), "dist": [0.1, 0, 0, 0, 0], "size": [960, 640], "k": 0.04, "k1": 3})
    assert ipm_rs.Camera.load(path).intrinsics[0, 0] == 300


def test_two_lenses_are_refused():
    content = {"K": K(300), "D": D, "size": [960, 640], "camera_model": "fisheye", "distortion_model": "plumb_bob"}
    with refuses(
        errors.CalibrationError, "expected one lens", "fisheye (camera_model)", "brown_conrady (distortion_model)"
    ):
        ipm_rs.Camera.from_opencv(content)


def test_real_ring(shared_data):
    path = shared_data / "ring_fisheye" / "calibration.json"
    content = json.loads(path.read_text())
    for name in content:
        camera = ipm_rs.Camera.load(path, camera=name, lens="fisheye")
        np.testing.assert_array_equal(camera.intrinsics, content[name]["K"])
        assert camera.lens == ipm_rs.KannalaBrandt(content[name]["D"])
    with refuses(errors.ArgumentError, *(repr(name) for name in content)):
        ipm_rs.Camera.load(path, lens="fisheye")


def test_photonvision(tmp_path):
    """What it exports: a size of decimals, eight terms, and the board's corners beside them."""
    eight = [0.0587, -0.107, 0.00032, 0.00148, 0.0414, 0.00068, 0.00145, -0.00375]
    content = {
        "resolution": {"width": 1280.0, "height": 800.0},
        "cameraIntrinsics": {"rows": 3, "cols": 3, "type": 6, "data": [922.9, 0.0, 647.4, 0.0, 919.8, 399.8, 0, 0, 1]},
        "distCoeffs": {"rows": 1, "cols": 8, "type": 6, "data": eight},
        "calobjectWarp": [4.6e-4, 9.7e-4],
        "observations": [{"locationInImageSpace": [{"x": 1.0, "y": 2.0}], "snapshotName": "img0.png"}],
        "lensmodel": "LENSMODEL_OPENCV8",
    }
    camera = ipm_rs.Camera.load(write(tmp_path, content))
    np.testing.assert_array_equal(camera.intrinsics, [[922.9, 0, 647.4], [0, 919.8, 399.8], [0, 0, 1]])
    assert camera.image_size == (1280, 800) and camera.lens == ipm_rs.BrownConrady(eight)
    content["lensmodel"] = "LENSMODEL_SPLINED_STEREOGRAPHIC"
    with refuses(errors.CalibrationError, "lensmodel", "which has no model"):
        ipm_rs.Camera.load(write(tmp_path, content))


@pytest.mark.parametrize("form", ["json", "yaml"])
def test_matrices_whose_data_are_rows(form, tmp_path):
    """As SensorsCalibration and aslam_cv2 write them."""
    matrix = {"rows": 3, "cols": 3, "data": K(300)}
    content = {"camera_matrix": matrix, "dist_coeffs": {"rows": 1, "cols": 4, "data": [D]}, "image_size": [960, 640]}
    camera = ipm_rs.Camera.load(write(tmp_path, content, form), lens="fisheye")
    np.testing.assert_array_equal(camera.intrinsics, K(300))
    assert camera.lens == FISHEYE
    matrix["data"] = [*K(300)[:2], [0.0, 1.0]]
    with refuses(errors.CalibrationError, "camera_matrix", "expected 3 x 3 numbers"):
        ipm_rs.Camera.from_opencv(content, lens="fisheye")


def test_a_pose_that_is_not_understood_is_not_dropped(tmp_path):
    """Under `extrinsic` stands something else than rvec and tvec: no camera at the origin is made of it."""
    part_of = {"intrinsic": part(301), "extrinsic": {"position": [1, 2, 3], "heading": 0.5}}
    for content in ({"front": part_of}, {"front": part_of, "left": part_of}, {"cameras": [{"name": "a", **part_of}]}):
        with refuses(errors.CalibrationError, "got one of none", "opencv: no 3x3 camera_matrix"):
            ipm_rs.Camera.load(write(tmp_path, {**content, "image_size": [960, 640]}), lens="fisheye")
