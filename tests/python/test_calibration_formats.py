"""What holds for the reader of every format: recognised, read, and nothing but our errors whatever the bytes."""

from __future__ import annotations

import inspect
import json
import logging
import time

import numpy as np
import pytest
from calibration_samples import SAMPLES, Sample
from helpers import refuses
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import calibration, errors
from ipm_rs.calibration._files import open_document

READERS = {name for name in dir(ipm_rs.Camera) if name.startswith("from_")} - {
    "from_euler",
    "from_fov",
    "from_ground_points",
    "from_points",
    "from_projection",
    "from_vanishing_point",
}

each_sample = pytest.mark.parametrize("sample", SAMPLES.values(), ids=SAMPLES.keys())


def load(sample: Sample, directory):
    return ipm_rs.Camera.load(sample.write(directory), **sample.options)


# ---------------------------------------------------------------------------------------------------------------------
# The registry


def test_every_format_has_its_class_method_with_the_same_signature():
    for name in calibration.FORMATS:
        method, read = getattr(ipm_rs.Camera, f"from_{name}"), calibration.reader(name).read
        given = [(p.name, p.kind, p.default) for p in inspect.signature(method).parameters.values()]
        assert given == [(p.name, p.kind, p.default) for p in inspect.signature(read).parameters.values()], name
        assert method.__doc__.strip()
    given = inspect.signature(ipm_rs.Camera.load).parameters
    assert list(given) == list(inspect.signature(calibration.load).parameters)


def test_every_format_says_its_frames():
    for name in calibration.FORMATS:
        module = calibration.reader(name)
        assert module.TITLE
        for word in ("ground=", "pixel", "forward"):
            assert word in module.__doc__, f"{name} does not say its {word!r}"


def test_every_format_has_a_sample():
    assert {sample.format for sample in SAMPLES.values()} == set(calibration.FORMATS)


def test_unknown_format_name():
    with refuses(errors.ArgumentError, "expected one of", "cityscapes", "kitty"):
        calibration.reader("kitty")


@each_sample
def test_recognised_and_read(sample, tmp_path, caplog):
    path = sample.write(tmp_path)
    assert calibration.recognise(path) == sample.format
    with caplog.at_level(logging.INFO, logger="ipm_rs.calibration"):
        camera = ipm_rs.Camera.load(path, **sample.options)
    assert f"read as {sample.format}" in caplog.text and str(path) in caplog.text
    assert camera == getattr(ipm_rs.Camera, f"from_{sample.format}")(path, **sample.options)


@each_sample
def test_no_other_format_claims_it(sample, tmp_path):
    document = open_document(sample.write(tmp_path), "")
    for name in calibration.FORMATS:
        try:
            lacks = calibration.reader(name).missing(document)
        except errors.IpmError:
            continue
        assert (lacks is None) == (name == sample.format), name


@each_sample
def test_image_size_is_checked_against_the_file(sample, tmp_path):
    camera = load(sample, tmp_path)
    options = {**sample.options, "image_size": camera.image_size}
    assert ipm_rs.Camera.load(sample.write(tmp_path), **options) == camera
    if "image_size" in inspect.signature(calibration.reader(sample.format).read).parameters:
        return
    with refuses(errors.CalibrationError, "image_size", "expected"):
        ipm_rs.Camera.load(sample.write(tmp_path), **{**options, "image_size": (17, 19)})


@each_sample
def test_camera_is_refused_where_there_is_one(sample, tmp_path):
    if "camera" in inspect.signature(calibration.reader(sample.format).read).parameters:
        return
    with refuses(errors.ArgumentError, "camera: expected none", "'left'"):
        ipm_rs.Camera.load(sample.write(tmp_path), **{**sample.options, "camera": "left"})


# ---------------------------------------------------------------------------------------------------------------------
# What is no calibration


@pytest.mark.parametrize("data", [b"", b"{}", b"[]", b"3", b"\xff\xfd", b"hello: world\n"])
def test_no_known_format(data, tmp_path):
    path = tmp_path / "file.txt"
    path.write_bytes(data)
    with refuses(errors.CalibrationError, str(path), "tried", *calibration.FORMATS):
        ipm_rs.Camera.load(path)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", ["(it is empty)"]),
        (b"\xb9abc\r\n", ["(expected text in UTF-8, got byte 0xb9", "kitti_raw, kitti_360, kitti, ", ": not text"]),
        (b"1 0 0\n0 1 0\n0 0 1\n", ["kitti: no line P0:, P1:, P2:, P3:", "kitti_raw: no line R_rect_00:"]),
        (b'[{"a": 1}]', ["nuscenes: no list of records", "kitti_360: no line S_rect_00:"]),
        (b'{\n"a": [\n1,\n2\n],\n"b": [\n3]\n}', ["json, cityscapes, kitti_raw, kitti_360, kitti", "none of its keys"]),
        (b'{"value0": {"intrinsics": []}}', ["kalibr: basalt's calibration.json"]),
        (b"[" + b"1,\n" * 2000 + b"1]", ["kitti_raw, kitti_360, kitti: too long a file"]),
    ],
    ids=["empty", "picture", "matrix", "list", "object", "basalt", "table"],
)
def test_every_reason_is_of_its_own_format(data, said, tmp_path):
    """A line never asks to mend what the format has nothing to do with, and what is wrong for all is said once."""
    path = tmp_path / "file.txt"
    path.write_bytes(data)
    with pytest.raises(errors.CalibrationError) as caught:
        ipm_rs.Camera.load(path)
    head, *reasons = str(caught.value).splitlines()
    named = [name for line in reasons for name in line.partition(":")[0].strip().split(", ")]
    assert sorted(named) == sorted(calibration.FORMATS)
    for phrase in said:
        assert any(phrase in line for line in (head, *reasons)), phrase
    assert len(reasons) <= 9, "more are not read"
    for line in reasons:
        assert "; " not in line and "every key once" not in line, line


def test_lens_is_for_formats_that_do_not_state_it(tmp_path):
    for sample in SAMPLES.values():
        if sample.format != "opencv":
            with refuses(errors.ArgumentError, "lens: expected none", "leaves no choice", "'fisheye'", "drop it"):
                ipm_rs.Camera.load(sample.write(tmp_path), **sample.options, lens="fisheye")


def test_no_known_format_in_a_directory(tmp_path):
    with refuses(errors.CalibrationError, str(tmp_path), "tried", "json, cityscapes", "a directory"):
        ipm_rs.Camera.load(tmp_path)


def test_no_such_file(tmp_path):
    with refuses(errors.MissingFileError, "nowhere.json", "check the path"):
        ipm_rs.Camera.load(tmp_path / "nowhere.json")


@pytest.mark.parametrize("name", sorted(READERS))
def test_a_name_that_no_file_can_have(name):
    with pytest.raises(errors.IpmError):
        getattr(ipm_rs.Camera, name)("x" * 5000)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("lines.txt", "\n" * 900_000),
        ("lines.json", "\n" * 200_000 + '{"opencv-matrix": 1, "camera_matrix": /'),
        (
            "digits.xml",
            "<?xml version='1.0'?><opencv_storage><camera_matrix>"
            + "9" * 200_000
            + "x</camera_matrix></opencv_storage>",
        ),
    ],
)
def test_time_grows_with_the_file_and_not_with_its_square(name, text, tmp_path):
    path = tmp_path / name
    path.write_text(text)
    start = time.perf_counter()
    for read in (ipm_rs.Camera.load, ipm_rs.Camera.from_kalibr, ipm_rs.Camera.from_opencv):
        with pytest.raises(errors.IpmError):
            read(path)
    assert time.perf_counter() - start < 20  # minutes, with a pattern that looks at the rest again from every line


@pytest.mark.parametrize("path", [None, 3, {}, b"x"], ids=lambda path: type(path).__name__)
def test_path_of_another_type(path):
    with refuses(errors.ArgumentTypeError, "expected a path", type(path).__name__):
        ipm_rs.Camera.load(path)


# ---------------------------------------------------------------------------------------------------------------------
# Whatever the bytes: a camera or one of our errors

WORDS = [*rb"nan inf 1e999 1e308 1e-320 -1 0 1_0 x ] &a".split(), b"\n", b"\x00", b"\xff", b": ", b"&a *a"]
TOKENS = [b"nan", b"-", b"1e999", b"0", b"\n", b"[", b"{", b'"']
# changed numbers make odd cameras
odd_cameras = pytest.mark.filterwarnings("ignore::ipm_rs.CalibrationWarning")
fuzzed = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def harmless(sample: Sample, files: dict[str, bytes], directory) -> None:
    """Read mutated files both ways."""
    changed = Sample(sample.format, files, sample.source or next(iter(sample.files)), sample.options)
    path = changed.write(directory)
    for read in (ipm_rs.Camera.load, getattr(ipm_rs.Camera, f"from_{sample.format}")):
        try:
            camera = read(path, **sample.options)
        except errors.IpmError as error:
            assert len(str(error)) < 8000
        else:
            assert isinstance(camera, ipm_rs.Camera)


@each_sample
@odd_cameras
@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97])
def test_cut_short(sample, share, tmp_path):
    for name, data in sample.files.items():
        harmless(sample, {**sample.files, name: data[: int(share * len(data))]}, tmp_path)


@pytest.mark.slow
@each_sample
@odd_cameras
@fuzzed
@given(data=st.data())
def test_any_bytes_changed(sample, data, tmp_path):
    name = data.draw(st.sampled_from(sorted(sample.files)))
    content = bytearray(sample.files[name])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        new = data.draw(st.one_of(st.binary(max_size=3), st.sampled_from(TOKENS)))
        content[at : at + data.draw(st.integers(0, 4))] = new
    harmless(sample, {**sample.files, name: bytes(content)}, tmp_path)


@pytest.mark.slow
@each_sample
@odd_cameras
@fuzzed
@given(data=st.data())
def test_any_word_changed(sample, data, tmp_path):
    names = [name for name in sample.files if not name.endswith((".json", ".feather"))]
    if not names:
        return
    name = data.draw(st.sampled_from(names))
    words = sample.files[name].split(b" ")
    at = data.draw(st.integers(0, len(words) - 1))
    words[at : at + data.draw(st.integers(0, 1))] = data.draw(st.lists(st.sampled_from(WORDS), max_size=2))
    harmless(sample, {**sample.files, name: b" ".join(words)}, tmp_path)


values = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.just(10**400), st.just([]),
    st.just({}), st.lists(st.floats(), max_size=17), st.just(-1.0), st.just(0),
    st.just([[0.0] * 3] * 3), st.just([[0.0] * 4] * 4),
)  # fmt: skip


def places(content, path=()):
    """Paths of everything in a JSON document."""
    yield path
    inner = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in inner:
        yield from places(value, (*path, key))


def changed(content, path, value, action):
    """A copy with one place replaced, removed or given twice."""
    if not path:
        return value
    content = json.loads(json.dumps(content))
    parent = content
    for key in path[:-1]:
        parent = parent[key]
    if action == "replace":
        parent[path[-1]] = value
    elif action == "remove":
        del parent[path[-1]]
    elif isinstance(parent, list):
        parent.append(value)
    else:
        parent[f"{path[-1]}x"] = parent.pop(path[-1])
    return content


@pytest.mark.slow
@each_sample
@odd_cameras
@fuzzed
@given(data=st.data())
def test_any_json_value_changed(sample, data, tmp_path):
    documents = {name: content for name, content in sample.files.items() if name.endswith(".json")}
    if not documents:
        return
    name = data.draw(st.sampled_from(sorted(documents)))
    content = json.loads(documents[name])
    path = data.draw(st.sampled_from(list(places(content))))
    content = changed(content, path, data.draw(values), data.draw(st.sampled_from(["replace", "remove", "other"])))
    harmless(sample, {**sample.files, name: json.dumps(content).encode()}, tmp_path)


objects = st.one_of(
    values, st.just(b"x"), st.just(1j), st.just(object()), st.just(np.zeros((3, 3))), st.just(np.eye(4)),
    st.just(np.array([None])), st.just(np.array("x")), st.just(np.array([1j])), st.just(np.float32(2)),
    st.just({None: 1}), st.just(range(3)), st.just(np.array([], float)), st.just(np.ma.masked),
    st.just(float), st.just({1}),
)  # fmt: skip


@pytest.mark.slow
@each_sample
@odd_cameras
@fuzzed
@given(data=st.data())
def test_any_value_of_a_mapping_changed(sample, data):
    """Mappings hold what no file can."""
    content = next(iter(sample.files.values()))
    if content[:1] not in (b"{", b"["):
        return
    content = json.loads(content)
    *path, last = data.draw(st.sampled_from([path for path in places(content) if path]))
    parent = content
    for key in path:
        parent = parent[key]
    parent[last] = data.draw(objects)
    try:
        camera = getattr(ipm_rs.Camera, f"from_{sample.format}")(content, **sample.options)
    except errors.IpmError as error:
        assert len(str(error)) < 8000
    else:
        assert isinstance(camera, ipm_rs.Camera)


def test_messages_name_the_place_inside_a_matrix():
    """One bad row is named, and no other needed key is offered as a misspelling."""
    record = json.loads(SAMPLES["nuscenes record"].files["record.json"])
    record["camera_intrinsic"][1] = None
    with refuses(errors.CalibrationError, "camera_intrinsic[1]: expected a list of 3 numbers, got None"):
        ipm_rs.Camera.from_nuscenes(record)
    with pytest.raises(errors.CalibrationError) as caught:
        ipm_rs.Camera.from_carla({"image_size_x": 640, "fov": 90})
    assert "missing image_size_y" in str(caught.value) and "where there is" not in str(caught.value)
    with refuses(errors.CalibrationError, "missing fov, where there is 'FOV'"):
        ipm_rs.Camera.from_carla({"image_size_x": 640, "image_size_y": 480, "FOV": 90})
    with refuses(errors.CalibrationError, "image_size_x", "got 2147483648"):
        ipm_rs.Camera.from_carla({"image_size_x": 2**31, "image_size_y": 480, "fov": 90})
