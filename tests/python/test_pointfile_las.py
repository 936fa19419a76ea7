"""LAS and LAZ: whole numbers kept, held against the format by hand and against files of laspy's own."""

from __future__ import annotations

import builtins
import struct

import numpy as np
import pytest
from helpers import refuses, same

from ipm_rs import errors, pointfile

laspy = pytest.importorskip("laspy")
ENDINGS = [".las", ".laz"]
COUNT = 211


def cloud():
    random = np.random.default_rng(5)
    points = random.normal(0, 30, (COUNT, 3)) + np.array((4.3e5, 5.2e6, 120.0))  # UTM
    values = {name: random.integers(0, 65536, COUNT).astype(np.uint16) for name in ("red", "green", "blue")}
    values |= {
        "intensity": random.integers(0, 65536, COUNT).astype(np.uint16),
        "classification": random.integers(0, 256, COUNT).astype(np.uint8),
        "return_number": random.integers(1, 16, COUNT).astype(np.uint8),
        "gps_time": random.random(COUNT) * 1e9,
        "ring": random.integers(0, 64, COUNT).astype(np.uint16),
        "confidence": random.random(COUNT).astype(np.float32),
        "label": random.integers(-9, 9, COUNT).astype(np.int32),
    }
    return points, values


@pytest.mark.parametrize("ending", ENDINGS)
def test_round_trip_to_the_last_whole_number(tmp_path, ending):
    points, values = cloud()
    first, second = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
    pointfile.write(first, points, values, scale=(0.001, 0.002, 0.0005), offset=(430000.0, 5200000.0, 100.0))
    back = pointfile.read(first)
    np.testing.assert_array_equal(back.scale, [0.001, 0.002, 0.0005])
    np.testing.assert_array_equal(back.offset, [430000.0, 5200000.0, 100.0])
    assert (np.abs(back.points - points) <= 0.5001 * back.scale).all() and back.points.dtype == np.float64
    for name, column in values.items():
        assert same(back.values[name], column), name
    pointfile.write(second, back.points, back.values, scale=back.scale, offset=back.offset)
    again = pointfile.read(second)
    assert same(again.points, back.points) and list(again.values) == list(back.values)
    assert all(same(again.values[name], column) for name, column in back.values.items())
    theirs, mine = laspy.read(first), laspy.read(second)
    assert all(np.array_equal(theirs[axis], mine[axis]) for axis in "XYZ")


def test_the_bytes_of_a_file(tmp_path):
    """Header and first point of LAS 1.4, format 7, unpacked by hand."""
    path = tmp_path / "a.las"
    colours = {name: np.array([v], np.uint8) for name, v in zip(("red", "green", "blue"), (0, 128, 255), strict=True)}
    pointfile.write(path, [[1.2345, -6.789, 0.0004]], {**colours, "intensity": np.array([0.5])})
    data = path.read_bytes()
    assert data[:4] == b"LASF" and data[24:26] == bytes([1, 4])
    size, first = struct.unpack_from("<HI", data, 94)
    form, length = struct.unpack_from("<BH", data, 104)
    assert (size, form, length) == (375, 7, 36)
    assert struct.unpack_from("<6d", data, 131) == (0.001, 0.001, 0.001, 0.0, 0.0, 0.0)
    assert struct.unpack_from("<Q", data, 247) == (1,)
    x, y, z, intensity = struct.unpack_from("<iiiH", data, first)
    assert (x, y, z, intensity) == (1234, -6789, 0, 32768), "steps of a millimetre; half of 65535 rounds to even"
    assert struct.unpack_from("<3H", data, first + 30) == (0, 128 * 257, 65535), "8 bits over 16"
    back = pointfile.read(path)
    np.testing.assert_allclose(back.points, [[1.234, -6.789, 0.0]], rtol=0, atol=1e-12)


@pytest.mark.parametrize("ending", ENDINGS)
def test_files_of_others(tmp_path, ending):
    """LAS 1.2, format 3, an extra dimension of three numbers and one with a scale of its own."""
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = [0.01, 0.01, 0.01], [100.0, -50.0, 0.0]
    header.add_extra_dim(laspy.ExtraBytesParams(name="normal", type="3f4"))
    header.add_extra_dim(
        laspy.ExtraBytesParams(name="height", type="i2", scales=np.array([0.5]), offsets=np.array([1.0]))
    )
    las = laspy.LasData(header)
    las.points = laspy.ScaleAwarePointRecord.zeros(3, header=header)
    las["X"], las["Y"], las["Z"] = [1, 2, -3], [10, 20, 30], [5, 6, 7]
    las["intensity"], las["red"], las["classification"] = [7, 8, 65535], [1, 2, 65535], [2, 31, 0]
    las["normal"] = np.arange(9.0, dtype=np.float32).reshape(3, 3)
    las["height"] = [1.5, 2.0, -3.0]
    las.write(tmp_path / f"a{ending}")
    back = pointfile.read(tmp_path / f"a{ending}")
    expected = [[100.01, -49.9, 0.05], [100.02, -49.8, 0.06], [99.97, -49.7, 0.07]]
    np.testing.assert_allclose(back.points, expected, rtol=0, atol=1e-12)
    assert back.values["intensity"].tolist() == [7, 8, 65535] and back.values["red"].tolist() == [1, 2, 65535]
    assert back.values["classification"].tolist() == [2, 31, 0]
    assert back.values["normal__0001"].tolist() == [1, 4, 7] and back.values["height"].tolist() == [1.5, 2.0, -3.0]
    empty = tmp_path / f"none{ending}"
    pointfile.write(empty, np.empty((0, 3)))
    assert pointfile.read(empty).points.shape == (0, 3)


def test_what_las_cannot_hold(tmp_path):
    path = tmp_path / "a.las"
    one = [[1.0, 2.0, 3.0]]
    wrong = [
        ([[np.nan, 0, 0]], {}, {}, ("points: expected x", "got nan", "leave such points out")),
        ([[0, 1e7, 0]], {}, {"offset": 0.0}, ("points: expected y", "1e+07", "pass scale= and offset=")),
        (one, {"intensity": [70000]}, {}, ("values['intensity']", "0 to 65535", "or 0.0 to 1.0", "70000")),
        (one, {"intensity": [1.5]}, {}, ("values['intensity']", "float64 from 1.5")),
        (one, {"return_number": [16]}, {}, ("values['return_number']", "0 to 15", "16")),
        (one, {"classification": [-1]}, {}, ("values['classification']", "0 to 255", "-1")),
        (one, {"red": [0.5], "green": [0.5], "blue": [0.5]}, {}, ("values['red']", "whole numbers", "float64")),
        (one, {"a" * 32: [1]}, {}, ("at most 31 letters",)),
        (one, {"X": [1]}, {}, ("other than X, Y, Z",)),
        (one, {}, {"scale": 0.0}, ("scale: expected positive numbers",)),
        (one, {}, {"scale": -0.1}, ("scale: expected positive numbers",)),
        (one, {}, {"scale": (1.0, 2.0)}, ("scale: expected a finite number or three", "(2,)")),
        (one, {}, {"offset": np.inf}, ("offset: expected a finite number or three",)),
    ]
    for points, values, options, message in wrong:
        columns = {
            name: np.array(column, np.float64 if 0.5 in column or 1.5 in column else np.int32)
            for name, column in values.items()
        }
        with refuses(errors.ArgumentError, *message):
            pointfile.write(path, points, columns, **options)
        assert not path.exists() and not list(tmp_path.iterdir())
    with refuses(errors.ArgumentError, "scale: expected none for .ply", "drop it"):
        pointfile.write(tmp_path / "a.ply", one, scale=0.001)
    with refuses(errors.ArgumentError, "columns: expected none for .las"):
        pointfile.read(path, columns=["x", "y", "z"])


def test_the_earths_coordinates_get_an_offset(tmp_path):
    points = np.array([[430_000.123, 5_200_000.456, 12.0], [430_010.0, 5_200_100.0, 13.0]])
    pointfile.write(tmp_path / "a.las", points)
    back = pointfile.read(tmp_path / "a.las")
    np.testing.assert_array_equal(back.offset, [0.0, 5_200_000.0, 0.0])
    np.testing.assert_allclose(back.points, points, rtol=0, atol=0.0005001)


@pytest.mark.parametrize("ending", ENDINGS)
def test_files_that_are_cut_short_or_lie(tmp_path, ending):
    points, values = cloud()
    path = tmp_path / f"a{ending}"
    pointfile.write(path, points, values)
    data = path.read_bytes()
    for part in (data[:100], data[:300], data[:-700], b"LASX" + data[4:], data[:96] + b"\xff" * 4 + data[100:]):
        path.write_bytes(part)
        with refuses(errors.FileError, str(path)):
            pointfile.read(path)
    path.write_bytes(data[:247] + (2**60).to_bytes(8, "little") + data[255:])
    with refuses(errors.FileError, "1152921504606846976 points", "cut short or damaged"):
        pointfile.read(path)


def test_without_laspy(tmp_path, monkeypatch):
    real = builtins.__import__

    def missing(name, *arguments):
        if name == "laspy":
            raise ImportError(name)
        return real(name, *arguments)

    (tmp_path / "a.las").write_bytes(b"LASF")
    monkeypatch.setattr(builtins, "__import__", missing)
    for act in (lambda: pointfile.read(tmp_path / "a.las"), lambda: pointfile.write(tmp_path / "b.laz", [[1.0, 2, 3]])):
        with refuses(errors.MissingExtraError, 'pip install "ipm-rs[cloud]"'):
            act()
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.las"]
