"""The YAML and FileStorage parsers: what calibration files hold, and what no file may do."""

from __future__ import annotations

import math
import sys
import time

import cv2
import numpy as np
import pytest
from helpers import refuses
from hypothesis import given
from hypothesis import strategies as st

from ipm_rs import errors
from ipm_rs.calibration import _yaml
from ipm_rs.calibration._filestorage import parse_storage

pytest.importorskip("yaml")


def parse(text):
    return _yaml.parse_yaml(text, "camera.yaml")


def test_scalars_are_what_calibration_writers_mean():
    text = "[1, -2, 1., .5, 1e-05, 1E5, -3.5e+2, .inf, -.Inf, .NaN, nan, true, False, ~, null"
    values = parse(text + ", '1', \"no\", no, 1:30, 0x1f]")
    assert values[:9] == [1, -2, 1.0, 0.5, 1e-05, 1e5, -350.0, math.inf, -math.inf]
    assert math.isnan(values[9]) and math.isnan(values[10])
    assert values[11:] == [True, False, None, None, "1", "no", "no", "1:30", "0x1f"]
    assert [type(value) for value in values[:3]] == [int, int, float]


def test_aliases_are_plain_copies():
    assert parse("a: &id [1, 2]\nb: *id\n") == {"a": [1, 2], "b": [1, 2]}


def test_opencv_header_tag_and_missing_spaces():
    text = '%YAML:1.0\n---\nname:"image_02"\nK: !!opencv-matrix\n   rows:1\n   cols:2\n   dt:d\n   data:[ 1., 2. ]\n'
    content = parse(text)
    assert content["name"] == "image_02"
    assert content["K"] == _yaml.Tagged("opencv-matrix", {"rows": 1, "cols": 2, "dt": "d", "data": [1.0, 2.0]})
    np.testing.assert_array_equal(parse_storage(text, "x.yml")["K"], [[1.0, 2.0]])


BOMB = "a: &a [1,1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"{b}: &{b} [{','.join(['*' + a] * 10)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("text", "phrases"),
    [
        (BOMB, [f"at most {_yaml.MAX_VALUES} values", "line", "alias"]),
        ("a: &a [*a]", ["alias", "*a"]),
        ("[" * 100_000, ["32 levels"]),
        ("{a: " * 1000, ["32 levels"]),
        ("a: !!python/object/apply:os.system ['echo']", ["tag", "!!python/object/apply:os.system", "line 1"]),
        ("a: !!python/tuple [1]", ["tag", "!!python/tuple"]),
        ("a: !custom 1", ["tag", "!custom"]),
        ("!!binary x: 1", ["tag", "!!binary"]),
        ("a: 1\na: 2", ["'a' repeated", "line 2"]),
        ("a: 1\n---\nb: 2", ["one document"]),
        ("[1, 2]: 3", ["plain words as keys"]),
        ("a: [1, 2", ["expected YAML", "line"]),
        ("a: b: c", ["expected YAML", "line 1"]),
        ("a: \x07", ["expected YAML"]),
        ("%YAML 2.0\n---\na: 1", ["expected YAML"]),
        ("a: !!opencv-matrix 3", ["opencv-matrix"]),
    ],
)
def test_what_is_refused(text, phrases):
    start = time.perf_counter()
    with refuses(errors.CalibrationError, "camera.yaml", *phrases):
        parse(text)
    assert time.perf_counter() - start < 10


def test_too_many_values():
    with refuses(errors.CalibrationError, f"at most {_yaml.MAX_VALUES} values"):
        parse("[" + "1," * 600_000 + "1]")


def test_without_pyyaml_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "yaml", None)
    with refuses(errors.MissingExtraError, "camera.yaml", "ipm-rs[yaml]"):
        parse("a: 1")
    assert parse_storage('{"a": 1}', "camera.json") == {"a": 1}, "JSON needs no extra"


@given(st.text())
def test_any_text_is_data_or_our_error(text):
    for parser in (_yaml.parse_yaml, parse_storage):
        try:
            parser(text, "x")
        except errors.CalibrationError as error:
            assert str(error).startswith("x: ")


@given(st.text(alphabet="{}[]<>&*!:,-#'\"%@ \n\tab01._/?=\\|>"))
def test_any_punctuation_is_data_or_our_error(text):
    for prefix in ("", "<opencv_storage>", "%YAML:1.0\n---\n", "{"):
        for parser in (_yaml.parse_yaml, parse_storage):
            try:
                parser(prefix + text, "x")
            except errors.CalibrationError as error:
                assert str(error).startswith("x: ")


# ---------------------------------------------------------------------------------------------------------------------
# FileStorage


@pytest.mark.parametrize("form", ["yml", "json", "xml"])
def test_what_opencv_writes(form, tmp_path):
    path = tmp_path / f"calibration.{form}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    matrix = np.array([[500.25, 0, 320.5], [0, 501, 1e-7], [0, 0, 1]])
    storage.write("camera_matrix", matrix)
    storage.write("flat", np.array([960, 640], np.int32))
    storage.write("points", np.arange(6, dtype=np.float32).reshape(2, 1, 3))
    storage.write("nan", float("nan"))
    storage.write("minus", float("-inf"))
    storage.write("name", "left camera")
    storage.write("names", ["left", "far right"])
    storage.write("flags", 2)
    storage.writeComment("a comment")
    storage.release()
    content = parse_storage(path.read_text(), str(path))
    np.testing.assert_array_equal(content["camera_matrix"], matrix)
    np.testing.assert_array_equal(np.ravel(content["flat"]), [960, 640])
    assert content["points"].shape == (2, 1, 3)
    np.testing.assert_array_equal(np.ravel(content["points"]), np.arange(6))
    assert math.isnan(content["nan"]) and content["minus"] == -math.inf
    assert (content["name"], content["names"], content["flags"]) == ("left camera", ["left", "far right"], 2)


MATRIX = "K: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: {dt}\n   data: {data}\n"


@pytest.mark.parametrize(
    ("change", "phrases"),
    [
        ({"rows": 3}, ["K: data", "3 x 2 numbers", "got 2"]),
        ({"rows": -1}, ["K: rows", "-1"]),
        ({"rows": 1.5}, ["K: rows", "1.5"]),
        ({"rows": "true"}, ["K: rows", "True"]),
        ({"cols": 10**30}, ["K: cols"]),
        ({"dt": "q"}, ["K: dt", "q"]),
        ({"dt": "[d]"}, ["K: dt"]),
        ({"dt": '"2d"'}, ["K: data", "1 x 2 x 2 numbers"]),
        ({"data": "[1., x]"}, ["K: data", "'x'"]),
        ({"data": "[1., true]"}, ["K: data", "True"]),
        ({"data": "7"}, ["K: data", "7"]),
        ({"data": "[[1., 2.], [3., 4.]]"}, ["K: data", "[1.0, 2.0]"]),
        ({"data": "[[1.], [2., 3.]]"}, ["K: data", "[1.0]"]),
    ],
)
def test_matrices_that_are_none(change, phrases):
    fields = {"rows": 1, "cols": 2, "dt": "d", "data": "[1., 2.]", **change}
    with refuses(errors.CalibrationError, "x.yml", *phrases):
        parse_storage(MATRIX.format(**fields), "x.yml")


@pytest.mark.parametrize(
    ("text", "phrases"),
    [
        ('<!DOCTYPE x [<!ENTITY a "b">]><opencv_storage><K>&a;</K></opencv_storage>', ["DOCTYPE"]),
        ("<svg></svg>", ["opencv_storage", "<svg>"]),
        ("<opencv_storage><K>1</K>", ["expected XML"]),
        ("<opencv_storage><K>1</K><K>2</K></opencv_storage>", ["<K> repeated"]),
        ("<opencv_storage>" + "<a>" * 100, ["32 levels"]),
        ('{"a": 1', ["expected JSON"]),
        ('{"a": 1, "a": 2}', ["'a' repeated"]),
        ('{"a": ' * 100_000, ["x: expected"]),
        ("[1, 2]", ["named values"]),
        ("<opencv_storage>5</opencv_storage>", ["named values"]),
        ("", ["named values"]),
    ],
)
def test_storage_that_is_refused(text, phrases):
    with refuses(errors.CalibrationError, *phrases):
        parse_storage(text, "x")
