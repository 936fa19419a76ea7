"""Our own JSON: every camera comes back bit for bit, and nothing else is taken for one."""

from __future__ import annotations

import json
import math

import calibration_datasets as samples
import numpy as np
import pytest
from helpers import refuses
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import json as own

K = [[900.1, 0.3, 640.7], [0.0, 901.2, 359.9], [0.0, 0.0, 1.0]]
PIXELS = [[1.0, 0.0, 640.7], [0.0, 1.01, 359.9], [0.0, 0.0, 1.0]]
LENSES = {
    "pinhole": None,
    "BrownConrady 4": ipm_rs.BrownConrady([-0.3, 0.1, 1e-3, -2e-4]),
    "BrownConrady 5": ipm_rs.BrownConrady([-0.3, 0.1, 1e-3, -2e-4, 1 / 3], max_angle=0.7),
    "BrownConrady 8": ipm_rs.BrownConrady([-0.3, 0.1, 1e-3, -2e-4, 0.01, 0.2, 0.02, 0.003]),
    "BrownConrady 12": ipm_rs.BrownConrady([-0.3, 0.1, 1e-3, -2e-4, 0.01, 0.2, 0.02, 3e-3, 1e-3, 0, -1e-3, 1e-4]),
    "BrownConrady 14": ipm_rs.BrownConrady([-0.3, 0.1, 1e-3, 0, 0.01, 0.2, 0, 0, 1e-3, 0, -1e-3, 1e-4, 0.01, -0.02]),
    "KannalaBrandt": ipm_rs.KannalaBrandt([0.1 / 3, -0.01, 0.001, -1e-4]),
    "KannalaBrandt limited": ipm_rs.KannalaBrandt([0.1 / 3, -0.01, 0.001, -1e-4], max_angle=1.1),
    "Mei": ipm_rs.Mei(2.2 / 3, [0.02, 0.1, 4e-4, 4e-4]),
    "DoubleSphere": ipm_rs.DoubleSphere(-0.2 / 3, 0.57, max_angle=math.pi / 3),
    "Eucm": ipm_rs.Eucm(0.6, 1.1 / 3),
    "RadialPolynomial": ipm_rs.RadialPolynomial([339.7, -31.9 / 3, 48.2, -7.2]),
    "FTheta": ipm_rs.FTheta([0.0, 2.7e-3, 2.4e-8 / 3], "backward", (1.001, 1e-4, 0.0), max_angle=1.1),
    "Fov": ipm_rs.Fov(0.9 / 3),
    "Division": ipm_rs.Division(-0.1 / 3),
    "InverseBrownConrady": ipm_rs.InverseBrownConrady([0.1 / 3, -0.05, 1e-4, 2e-4, 0.01]),
    "ThinPrismFisheye": ipm_rs.ThinPrismFisheye([0.01 / 3, -0.02, 1e-3, -2e-3, 3e-3, -1e-3, 4e-3, -5e-3]),
    "Cylindrical": ipm_rs.Cylindrical(max_angle=2.1),
    "Equirectangular": ipm_rs.Equirectangular(),
    "Ocam": ipm_rs.Ocam([-240.1, 0.0, 1.7e-3 / 3, -4e-7], (1.0001, -1e-4, 2e-4)),
}


def identical(a, b) -> bool:
    """Equal, and every float to the bit, the sign of zero included."""
    return (
        a == b
        and a.intrinsics.tobytes() == b.intrinsics.tobytes()
        and a.camera_from_vehicle.tobytes() == b.camera_from_vehicle.tobytes()
        and a.image_size == b.image_size
        and repr(a.lens) == repr(b.lens)
        and hash(a) == hash(b)
    )


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_every_lens_comes_back(lens, tmp_path):
    matrix = PIXELS if type(lens).__name__ in ("RadialPolynomial", "FTheta", "Ocam") else K
    pose = np.eye(4)
    pose[:3, :3] = ipm_rs.rotation_from_euler(0.1, 0.2, 0.3)
    pose[:3, 3] = (1 / 3, -0.0, 5e-324)
    camera = ipm_rs.Camera(matrix, image_size=(1280, 720), camera_from_vehicle=pose, lens=lens)
    path = tmp_path / "camera.json"
    camera.save(path)
    assert identical(ipm_rs.Camera.load(path), camera)
    assert identical(ipm_rs.Camera.from_json(str(path)), camera)
    assert identical(ipm_rs.Camera.from_json(camera.to_json()), camera)
    assert identical(ipm_rs.Camera.from_json(json.loads(camera.to_json())), camera)
    assert path.read_text() == camera.to_json()


def test_every_lens_model_is_there():
    models = {type(lens).__name__ for lens in LENSES.values() if lens is not None}
    assert models == set(own._LENSES)
    assert all(hasattr(ipm_rs, model) for model in models)


numbers = st.floats(-1e6, 1e6)


@pytest.mark.filterwarnings("ignore::ipm_rs.CalibrationWarning")  # any numbers make odd cameras
@settings(max_examples=100, deadline=None)
@given(
    focal=st.tuples(st.floats(1e-3, 1e6), st.floats(1e-3, 1e6)),
    centre=st.tuples(numbers, numbers, numbers),
    angles=st.tuples(*[st.floats(-4, 4)] * 3),
    position=st.tuples(numbers, numbers, numbers),
    size=st.tuples(st.integers(1, 40000), st.integers(1, 40000)),
)
def test_every_pinhole_comes_back(focal, centre, angles, position, size):
    (fx, fy), (cx, cy, skew), (roll, pitch, yaw) = focal, centre, angles
    assume(max(focal) > 1.5 or max(size) <= 64)  # others are placeholders
    matrix = [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]
    camera = ipm_rs.Camera.from_euler(matrix, image_size=size, position=position, roll=roll, pitch=pitch, yaw=yaw)
    assert identical(ipm_rs.Camera.from_json(camera.to_json()), camera)


def test_text_is_readable():
    text = ipm_rs.Camera(K, image_size=(1280, 720)).to_json()
    assert text.splitlines()[:4] == [
        "{",
        '  "format": "ipm_rs.Camera",',
        '  "version": 1,',
        '  "image_size": [1280, 720],',
    ]
    assert text.endswith("}\n")


def test_save_replaces_and_refuses(tmp_path):
    camera = ipm_rs.Camera(K, image_size=(1280, 720))
    path = tmp_path / "camera.json"
    path.write_text("old")
    camera.save(path)
    assert ipm_rs.Camera.load(path) == camera
    assert [file.name for file in tmp_path.iterdir()] == ["camera.json"], "nothing is left beside it"
    with refuses(errors.FileError, "nowhere", "expected to write it"):
        camera.save(tmp_path / "nowhere" / "camera.json")
    with refuses(errors.ArgumentTypeError, "path: expected a path, got int"):
        camera.save(3)
    with refuses(errors.ArgumentTypeError, "camera: expected a Camera, got int"):
        own.to_json(3)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"format": "other"}, "format: expected one of 'ipm_rs.Camera', got str 'other'"),
        ({"version": 2}, "version: expected 1, got 2; a newer ipm_rs wrote it"),
        ({"version": "1"}, "version: expected a finite number, got str '1'"),
        ({"image_size": [1280]}, "image_size: expected 2 numbers, got 1"),
        ({"image_size": [1280, 0]}, "image_size (height): expected a whole number"),
        ({"image_size": [1280, 720.5]}, "image_size (height): expected a whole number"),
        ({"intrinsics": [[0.0] * 3] * 3}, "JSON text"),
        ({"intrinsics": [[1.0, 0, 0], [0, 1, 0]]}, "intrinsics: expected a 3x3 matrix, got 2 rows of 3"),
        ({"intrinsics": [[math.nan] * 3] * 3}, "intrinsics[0][0]: expected a finite number, got nan"),
        ({"camera_from_vehicle": np.diag([1.0, -1, 1, 1]).tolist()}, "det R = -1"),
        ({"camera_from_vehicle": (2 * np.eye(4)).tolist()}, "camera_from_vehicle[:3, :3]: expected a rotation"),
        ({"lens": 3}, "lens: expected an object"),
        ({"lens": {}}, "lens: expected the keys model, missing model"),
        ({"lens": {"model": "Camera"}}, "lens.model: expected one of 'BrownConrady'"),
        ({"lens": {"model": "Mei", "coefficients": [0] * 4}}, "lens: expected the keys xi, coefficients, missing xi"),
        ({"lens": {"model": "Mei", "xi": 1, "coefficients": [0] * 5}}, "lens.coefficients: expected 4 numbers, got 5"),
        ({"lens": {"model": "BrownConrady", "coefficients": [0] * 6}}, "lens"),
        ({"lens": {"model": "Eucm", "alpha": 2, "beta": 1}}, "lens"),
        ({"lens": {"model": "Eucm", "alpha": 0.5, "beta": 1, "k1": 0}}, "lens: expected the keys model, alpha, beta"),
        ({"lens": {"model": "Eucm", "alpha": 0.5, "beta": 1, "max_angle": -1}}, "max_angle"),
        ({"lense": None}, "only, got 'lense' too"),
    ],
)
def test_refused(change, named):
    with refuses(errors.CalibrationError, "JSON text", named):
        ipm_rs.Camera.from_json(json.dumps({**samples.OWN, **change}))


@pytest.mark.parametrize("key", samples.OWN)
def test_missing_key(key, tmp_path):
    path = tmp_path / "camera.json"
    path.write_text(json.dumps({k: v for k, v in samples.OWN.items() if k != key}))
    with refuses(errors.CalibrationError, str(path), "missing", key):
        ipm_rs.Camera.from_json(path)


def test_no_json():
    for text in ("{", "{]", '{"a": 1, "a": 2}'):
        with refuses(errors.CalibrationError, "JSON text"):
            ipm_rs.Camera.from_json(text)
    with refuses(errors.MissingFileError, "[1]"):
        ipm_rs.Camera.from_json("[1]")
    with refuses(errors.ArgumentTypeError, "source: expected a path or a mapping, got int"):
        ipm_rs.Camera.from_json(3)
