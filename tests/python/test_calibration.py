"""Reading Cityscapes camera files: both layouts, and every way in which a file can be wrong."""

from __future__ import annotations

import copy
import json
import os
import pathlib
import pickle
import types

import golden
import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import cityscapes

FLAT = {**golden.CALIBRATION["extrinsic"], **golden.CALIBRATION["intrinsic"]}
KEYS = ("x", "y", "z", "roll", "pitch", "yaw", "fx", "fy", "u0", "v0")


def nested() -> dict:
    return copy.deepcopy(golden.CALIBRATION)


def without(*keys: str) -> dict:
    return {key: value for key, value in FLAT.items() if key not in keys}


@pytest.fixture
def write(tmp_path):
    """Write a camera file and give its path."""

    def write_file(content, name="camera.json"):
        path = tmp_path / name
        data = content if isinstance(content, bytes) else json.dumps(content).encode()
        path.write_bytes(data)
        return path

    return write_file


# ---------------------------------------------------------------------------------------------------------------------
# What is read


@pytest.mark.parametrize("content", [golden.CALIBRATION, FLAT, without("baseline")], ids=["nested", "flat", "mono"])
@pytest.mark.parametrize("source", ["mapping", "str", "path"])
def test_every_layout_from_every_source(content, source, write):
    given = {"mapping": lambda: content, "str": lambda: str(write(content)), "path": lambda: write(content)}[source]()
    camera = ipm_rs.Camera.from_cityscapes(given)
    np.testing.assert_allclose(camera.camera_from_vehicle, golden.RT, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(camera.intrinsics, golden.K)
    assert camera.image_size == (2048, 1024)
    assert camera.lens is None
    assert camera == cityscapes.read(given)


def test_sections_may_differ_in_layout():
    mixed = {"extrinsic": golden.CALIBRATION["extrinsic"], **golden.CALIBRATION["intrinsic"]}
    assert cityscapes.read(mixed) == cityscapes.read(FLAT)


def test_image_size_is_an_argument():
    assert ipm_rs.Camera.from_cityscapes(FLAT, image_size=(2040, 1016)).image_size == (2040, 1016)
    assert cityscapes.read(FLAT, image_size=(2040, 1016)).image_size == (2040, 1016)


def test_other_keys_and_other_mappings_are_fine():
    content = types.MappingProxyType({**FLAT, "comment": "drive 7", "version": 2})
    assert cityscapes.read(content) == cityscapes.read(FLAT)


def test_integers_and_numpy_numbers_are_numbers():
    content = {**FLAT, "roll": 0, "fx": np.float64(golden.FX), "x": np.int32(2)}
    assert cityscapes.read(content).position[0] == pytest.approx(2.0, abs=1e-12)


def test_a_byte_order_mark_is_no_content(write):
    path = write(b"\xef\xbb\xbf" + json.dumps(FLAT).encode())
    assert cityscapes.read(path) == cityscapes.read(FLAT)


def test_input_is_not_modified():
    content = nested()
    cityscapes.read(content)
    assert content == golden.CALIBRATION


def test_real_files(shared_data):
    seed = ipm_rs.Camera.from_cityscapes(shared_data / "cityscapes" / "camera.json")
    np.testing.assert_allclose(seed.camera_from_vehicle, golden.RT, rtol=0, atol=1e-12)
    other = ipm_rs.Camera.from_cityscapes(shared_data / "cityscapes" / "frankfurt_style_camera_nested.json")
    np.testing.assert_allclose(other.position, (1.7, 0.1, 1.22), rtol=0, atol=1e-12)
    assert other.intrinsics[0, 2] == 1096.98


# ---------------------------------------------------------------------------------------------------------------------
# What is refused: content


@pytest.mark.parametrize("key", KEYS)
def test_missing_key(key, write):
    with refuses(errors.CalibrationError, "missing", f"{key} (", "top level"):
        cityscapes.read(without(key))
    path = write(without(key))
    with refuses(errors.CalibrationError, str(path), f"{key} ("):
        ipm_rs.Camera.from_cityscapes(path)


def test_all_missing_keys_are_named_with_their_place():
    content = nested()
    del content["extrinsic"]["z"], content["extrinsic"]["yaw"], content["intrinsic"]
    with refuses(errors.CalibrationError, "z (in 'extrinsic')", "yaw (in 'extrinsic')", "fx (at the top level)"):
        cityscapes.read(content)
    with refuses(errors.CalibrationError, *(f"{key} (" for key in KEYS)):
        cityscapes.read({})


@pytest.mark.parametrize(("key", "typed"), [("pitch", "Pitch"), ("pitch", "ptich"), ("fx", "FX"), ("x", "X")])
def test_misspelt_key_is_pointed_at(key, typed):
    with refuses(errors.CalibrationError, f"{key} (", repr(typed)):
        cityscapes.read({**without(key), typed: FLAT[key]})


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize(
    ("value", "named"),
    [
        ("0.5", "str '0.5'"),
        (True, "True"),
        (None, "None"),
        ([1.0], "list"),
        ({}, "dict"),
        (1j, "complex"),
        (float("nan"), "nan"),
        (float("inf"), "inf"),
        (-float("inf"), "-inf"),
        (10**400, "inf"),
    ],
    ids=str,
)
def test_not_a_finite_number(key, value, named):
    with refuses(errors.CalibrationError, f"{key}: expected a finite", f"got {named}"):
        ipm_rs.Camera.from_cityscapes({**FLAT, key: value})


@pytest.mark.parametrize("key", ["fx", "fy"])
@pytest.mark.parametrize("value", [0, 0.0, -0.0, -2263.5])
def test_focal_length_is_positive(key, value):
    with refuses(errors.CalibrationError, f"{key}: expected a finite, positive number, got {float(value)}"):
        cityscapes.read({**FLAT, key: value})


def test_nan_in_a_file(write):
    path = write(json.dumps({**FLAT, "yaw": float("nan")}).encode())
    assert b"NaN" in path.read_bytes()
    with refuses(errors.CalibrationError, str(path), "yaw", "nan"):
        cityscapes.read(path)


@pytest.mark.parametrize("section", ["extrinsic", "intrinsic"])
@pytest.mark.parametrize("value", [None, 3, [1, 2], "x"], ids=str)
def test_section_is_an_object(section, value):
    with refuses(errors.CalibrationError, f"{section}: expected an object", "got"):
        cityscapes.read({**nested(), section: value})


def test_key_given_twice():
    with refuses(errors.CalibrationError, "pitch", "extrinsic.pitch", "remove one"):
        cityscapes.read({**nested(), "pitch": 0.0})


def test_key_repeated_in_the_file(write):
    text = json.dumps(FLAT)[:-1] + ', "pitch": 0.1}'
    with refuses(errors.CalibrationError, "camera.json", "once", "'pitch'"):
        cityscapes.read(write(text.encode()))


# ---------------------------------------------------------------------------------------------------------------------
# What is refused: files


@pytest.mark.parametrize("cut", [0, 1, 20, -1])
def test_truncated_file(cut, write):
    data = json.dumps(FLAT).encode()[:cut]
    with refuses(errors.CalibrationError, "camera.json", "expected JSON", f"got {len(data)} byte"):
        ipm_rs.Camera.from_cityscapes(write(data))


@pytest.mark.parametrize("data", [b"[1, 2]", b"3", b'"text"', b"null", b"true"])
def test_json_but_not_an_object(data, write):
    with refuses(errors.CalibrationError, "camera.json", "expected a JSON object", "got"):
        cityscapes.read(write(data))


def test_not_json(write):
    with refuses(errors.CalibrationError, "camera.json", "expected JSON"):
        cityscapes.read(write(b"pitch: 0.1\n"))


def test_nested_too_deep(write):
    with refuses(errors.CalibrationError, "camera.json"):
        cityscapes.read(write(b"[" * 200_000))


@pytest.mark.parametrize(
    ("data", "got"),
    [
        (json.dumps({**FLAT, "name": "Köln"}, ensure_ascii=False).encode("latin-1"), "byte 0xf6"),
        (json.dumps(FLAT).encode("utf-16"), "text in UTF-16"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "a PNG image; did you swap calibration and image?"),
    ],
)
def test_not_utf8(data, got, write):
    with refuses(errors.CalibrationError, "camera.json", "UTF-8", got):
        cityscapes.read(write(data))


def test_no_such_file(tmp_path):
    path = tmp_path / "nowhere.json"
    with refuses(errors.MissingFileError, str(path), "check the path"):
        ipm_rs.Camera.from_cityscapes(path)
    with pytest.raises(FileNotFoundError):
        cityscapes.read(str(path))


@pytest.mark.parametrize("name", ["", ".", "\0", "a" * 5000], ids=["empty", "directory", "null byte", "too long"])
def test_unreadable_name(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with refuses(
        errors.FileError, "expected a name that a file can have" if "\0" in name else "expected a readable", "got"
    ):
        cityscapes.read(name)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_forbidden_file(write):
    path = write(FLAT)
    path.chmod(0)
    with refuses(errors.FileError, str(path), "permission"):
        cityscapes.read(path)


@pytest.mark.parametrize("source", [None, 3, [FLAT], b"camera.json", golden.K], ids=lambda s: type(s).__name__)
def test_source_of_another_type(source):
    with refuses(errors.ArgumentTypeError, "source: expected", type(source).__name__):
        cityscapes.read(source)
    with pytest.raises(TypeError):
        ipm_rs.Camera.from_cityscapes(source)


def test_open_file_is_not_a_source(write):
    with write(FLAT).open() as file, refuses(errors.ArgumentTypeError, "source", "json.load"):
        cityscapes.read(file)


def test_path_of_bytes():
    class BytesPath(os.PathLike):
        def __fspath__(self):
            return b"camera.json"

    with refuses(errors.ArgumentTypeError, "source", "b'camera.json'"):
        cityscapes.read(BytesPath())


def test_errors_survive_a_process_boundary(tmp_path):
    with pytest.raises(errors.FileError) as caught:
        cityscapes.read(pathlib.Path(tmp_path))
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is type(caught.value) and str(again) == str(caught.value)
