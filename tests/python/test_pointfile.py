"""Point cloud files: round trips, files of others, and what is damaged."""

from __future__ import annotations

import builtins
from pathlib import Path

import numpy as np
import pytest
from helpers import refuses, same

from ipm_rs import errors, pointfile

COUNT = 137


def cloud(kind: str = "float32") -> tuple[np.ndarray, dict[str, np.ndarray]]:
    random = np.random.default_rng(3)
    points = random.normal(0, 20, (COUNT, 3)).astype(kind)
    values = {name: random.integers(0, 256, COUNT, dtype=np.uint8) for name in ("red", "green", "blue")}
    values |= {
        "intensity": random.random(COUNT).astype(np.float32),
        "ring": random.integers(0, 64, COUNT).astype(np.uint16),
        "label": random.integers(-9, 9, COUNT).astype(np.int32),
        "time": random.random(COUNT),
    }
    return points, values


@pytest.mark.parametrize("kind", ["float32", "float64"])
@pytest.mark.parametrize("ending", [".ply", ".pcd", ".npy", ".PLY"])
def test_round_trip(tmp_path, ending, kind):
    if ending == ".pcd":
        pytest.importorskip("pypcd4")
    points, values = cloud(kind)
    path = tmp_path / f"cloud{ending}"
    pointfile.write(path, points, values)
    back = pointfile.read(path)
    assert same(back.points, points)
    assert set(back.values) == set(values)
    assert all(same(back.values[name], values[name]) for name in values)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_rows_of_floats(tmp_path):
    points, values = cloud()
    pointfile.write(tmp_path / "a.bin", points, {"intensity": values["intensity"]})
    back = pointfile.read(tmp_path / "a.bin")
    assert same(back.points, points) and same(back.values["intensity"].copy(), values["intensity"])
    pointfile.write(tmp_path / "a.npy", points)
    assert same(np.load(tmp_path / "a.npy"), points)
    np.save(tmp_path / "wide.npy", np.arange(20.0).reshape(4, 5))
    back = pointfile.read(tmp_path / "wide.npy")
    assert back.points.tolist()[1] == [5, 6, 7] and back.values["column_4"].tolist() == [4, 9, 14, 19]
    back = pointfile.read(tmp_path / "wide.npy", columns=("ring", "z", "y", "x", "i"))
    assert back.points.tolist()[1] == [8, 7, 6]


def test_kitti_and_nuscenes(shared_data):
    kitti = pointfile.read(shared_data / "kitti" / "000114.bin")
    raw = np.fromfile(shared_data / "kitti" / "000114.bin", np.float32).reshape(-1, 4)
    assert same(kitti.points, raw[:, :3].copy()) and list(kitti.values) == ["intensity"]
    assert 0 <= kitti.values["intensity"].min() and kitti.values["intensity"].max() <= 1
    sweep = next((shared_data / "nuscenes").glob("*.pcd.bin"))
    nuscenes = pointfile.read(sweep)
    assert list(nuscenes.values) == ["intensity", "ring"]
    assert set(np.unique(nuscenes.values["ring"])) <= set(range(32))


@pytest.mark.parametrize("order", ["ascii", "binary_big_endian", "binary_little_endian"])
def test_ply_files_of_others(tmp_path, order):
    """Comments, an element before the vertices, faces behind them, other names of types."""
    header = (
        f"ply\nformat {order} 1.0\ncomment made by hand\nobj_info x\nelement camera 2\nproperty float64 focus\n"
        "element vertex 3\nproperty float32 x\nproperty float y\nproperty double z\nproperty uint8 red\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = [(1.5, -2.0, 3.25, 200), (4.0, 5.0, 6.0, 7), (-1.0, 0.0, 1e3, 255)]
    if order == "ascii":
        body = b"0.5\n0.25\n" + b"".join(" ".join(map(str, row)).encode() + b" \n" for row in rows) + b"3 0 1 2\n"
    else:
        end = ">" if "big" in order else "<"
        kinds = [("x", end + "f4"), ("y", end + "f4"), ("z", end + "f8"), ("red", "u1")]
        body = np.array([0.5, 0.25], end + "f8").tobytes() + np.array(rows, kinds).tobytes() + b"\3" + bytes(12)
    (tmp_path / "a.ply").write_bytes(header.encode() + body)
    back = pointfile.read(tmp_path / "a.ply")
    assert back.points.dtype == np.float64 and back.points.tolist() == [list(row[:3]) for row in rows]
    assert same(back.values["red"], np.array([200, 7, 255], np.uint8))


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_pcd_files_of_others(tmp_path, encoding):
    pypcd4 = pytest.importorskip("pypcd4")
    points, values = cloud()
    columns = [*points.T, values["intensity"], values["ring"]]
    types = [np.float32] * 4 + [np.uint16]
    theirs = pypcd4.PointCloud.from_points(columns, ("x", "y", "z", "intensity", "ring"), types)
    theirs.save(tmp_path / "a.pcd", encoding=pypcd4.Encoding(encoding))
    back = pointfile.read(tmp_path / "a.pcd")
    np.testing.assert_allclose(back.points, points, rtol=1e-5 if encoding == "ascii" else 0)
    assert same(back.values["ring"], values["ring"])


def test_pcd_that_we_write_is_what_others_read(tmp_path):
    pypcd4 = pytest.importorskip("pypcd4")
    points, values = cloud()
    pointfile.write(tmp_path / "a.pcd", points, values)
    theirs = pypcd4.PointCloud.from_path(tmp_path / "a.pcd")
    assert same(theirs.numpy(("x", "y", "z")).astype(np.float32), points)
    colours = pypcd4.PointCloud.decode_rgb(theirs.numpy(("rgb",)).astype(np.float32).ravel())
    assert colours[:, 1].tolist() == values["green"].tolist()


def test_empty_clouds(tmp_path):
    for ending in (".ply", ".npy", ".bin"):
        pointfile.write(
            tmp_path / f"empty{ending}", np.empty((0, 3), np.float32), {"intensity": np.empty(0, np.float32)}
        )
        assert pointfile.read(tmp_path / f"empty{ending}").points.shape == (0, 3)


# ---------------------------------------------------------------------------------------------------------------------
# Damaged files and mistakes

PLY = "ply\nformat {}\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
PCD = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT {}\nWIDTH {}\nHEIGHT 1\nPOINTS {}\nDATA {}\n"


@pytest.mark.parametrize(
    ("name", "content", "phrases"),
    [
        ("a.bin", bytes(15), ["4 float32", "15 bytes", "cut short"]),
        ("a.bin", bytes(60), ["60 bytes", "rows of 3 or 5", "columns="]),
        ("a.npy", b"no array", ["point cloud", "damaged"]),
        (
            "a.npy",
            b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 3), }"
            + b" " * 46
            + b"\n",
            ["damaged"],
        ),
        ("a.ply", b"", ["PLY", "header"]),
        ("a.ply", b"plx\n" * 9, ["PLY", "header"]),
        ("a.ply", b"ply\n" + b"comment x\n" * 10_000, ["header"]),
        ("a.ply", PLY.format("ascii 1.0", 10**12).encode() + b"1 2 3\n", ["1000000000000", "cut short"]),
        ("a.ply", PLY.format("binary_little_endian 1.0", 10**9).encode() + bytes(24), ["1000000000", "24 bytes"]),
        ("a.ply", PLY.format("ascii 1.0", 1).encode() + b"1 2 3 4 5\n", ["3 numbers"]),
        ("a.ply", PLY.format("ascii 1.0", 1).encode() + b"1 two 3\n", ["damaged"]),
        ("a.ply", PLY.format("morse 1.0", 1).encode() + b"1 2 3\n", ["format morse"]),
        ("a.ply", PLY.format("ascii 1.0", "-4").encode() + b"1 2 3\n", ["element vertex -4"]),
        (
            "a.ply",
            b"ply\nformat ascii 1.0\nelement face 3\nproperty int x\nend_header\n1\n2\n3\n",
            ["vertices", "face"],
        ),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nend_header\n1\n", ["x, y and z", "got x"]),
        ("a.pcd", b"DATA?", ["PCD"]),
        ("a.pcd", PCD.format("1 1 1", 10**9, 10**9, "binary").encode() + bytes(24), ["1000000000", "cut short"]),
        ("a.pcd", PCD.format("1 1 999999999", 1, 1, "binary").encode() + bytes(24), ["1024 fields"]),
        (
            "a.pcd",
            PCD.format("1 1 1", 4, 4, "binary_compressed").encode() + b"\4\0\0\0\377\377\377\377abcd",
            ["cut short"],
        ),
        ("a.pcd", PCD.format("1 1 1", 40, 40, "binary").encode() + bytes(24), ["40 points", "got 2"]),
    ],
)
def test_damaged_files(tmp_path, name, content, phrases):
    if name.endswith(".pcd"):
        pytest.importorskip("pypcd4")
    (tmp_path / name).write_bytes(content)
    with refuses(errors.FileError, name, *phrases):
        pointfile.read(tmp_path / name)


def test_arrays_that_are_no_points(tmp_path):
    for array in (np.zeros(5), np.zeros((5, 2)), np.zeros((5, 3), complex), np.array([["a"] * 3])):
        np.save(tmp_path / "a.npy", array)
        with refuses(errors.FileError, "a.npy"):
            pointfile.read(tmp_path / "a.npy")
    np.save(tmp_path / "o.npy", np.array([[None] * 3]), allow_pickle=True)
    with refuses(errors.FileError, "o.npy"):
        pointfile.read(tmp_path / "o.npy")


def test_mistakes_in_reading(tmp_path):
    with refuses(errors.MissingFileError, "a.ply"):
        pointfile.read(tmp_path / "a.ply")
    (tmp_path / "folder.ply").mkdir()
    with refuses(errors.FileError, "a directory"):
        pointfile.read(tmp_path / "folder.ply")
    for name in ("cloud.e57", "cloud"):
        with refuses(errors.ArgumentError, ".bin, .las, .laz, .npy, .pcd, .ply"):
            pointfile.read(tmp_path / name)
    with refuses(errors.ArgumentError, "columns", '"x", "y" and "z"'):
        pointfile.read(tmp_path / "a.bin", columns=("x", "y"))
    with refuses(errors.ArgumentError, "columns", ".ply"):
        pointfile.read(tmp_path / "a.ply", columns=("x", "y", "z"))


@pytest.mark.parametrize(
    ("error", "points", "values", "phrases"),
    [
        (errors.ArgumentError, np.zeros((4, 4)), {}, ["(N, 3)", "(4, 4)", "as values"]),
        (errors.ArgumentError, np.zeros((4, 4, 3)), {}, ["(N, 3)", "reshape"]),
        (errors.ArgumentTypeError, np.zeros((4, 3), complex), {}, ["real", "complex"]),
        (errors.ArgumentError, np.zeros((4, 3)), {"a": np.zeros(3)}, ["'a'", "(4,)", "(3,)"]),
        (errors.ArgumentError, np.zeros((4, 3)), {"a b": np.zeros(4)}, ["'a b'"]),
        (errors.ArgumentError, np.zeros((4, 3)), {"x": np.zeros(4)}, ["'x'"]),
        (errors.ArgumentTypeError, np.zeros((4, 3)), {"a": np.zeros(4, np.int64)}, ["int64"]),
    ],
)
def test_mistakes_in_writing(tmp_path, error, points, values, phrases):
    with refuses(error, *phrases):
        pointfile.write(tmp_path / "a.ply", points, values)
    assert list(tmp_path.iterdir()) == []


def test_what_exists_stays(tmp_path):
    path = tmp_path / "a.ply"
    path.write_bytes(b"mine")
    with refuses(errors.FileError, "exists", "force"):
        pointfile.write(path, np.zeros((1, 3)))
    assert path.read_bytes() == b"mine"
    pointfile.write(path, np.zeros((1, 3)), force=True)
    assert len(pointfile.read(path).points) == 1


def test_pcd_needs_its_extra(tmp_path, monkeypatch):
    (tmp_path / "a.pcd").write_bytes(b"x")
    there = builtins.__import__

    def absent(name, *rest, **more):
        if name.startswith("pypcd4"):
            raise ImportError(name)
        return there(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", absent)
    with refuses(errors.MissingExtraError, 'pip install "ipm-rs[cloud]"'):
        pointfile.read(Path(tmp_path / "a.pcd"))
