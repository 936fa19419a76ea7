"""Point files that are not what they say: refused at once and in words, or read right."""

from __future__ import annotations

import time
import tracemalloc

import numpy as np
import point_mutations
import pytest
from helpers import refuses, same

from ipm_rs import errors, pointfile

PLY = (
    "ply\nformat ascii 1.0\nelement vertex 2\n"
    + "".join(f"property float {axis}\n" for axis in "xyz")
    + "property {} v\nend_header\n"
)
PCD = "FIELDS x y z v\nSIZE 4 4 4 {}\nTYPE F F F {}\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n"
PCD_TYPES = {
    "uchar": "1 U",
    "char": "1 I",
    "short": "2 I",
    "ushort": "2 U",
    "int": "4 I",
    "uint": "4 U",
    "float": "4 F",
}


def written(tmp_path, format_: str, kind: str, word: str):
    path = tmp_path / f"a.{format_}"
    size, letter = PCD_TYPES[kind].split()
    header = PLY.format(kind) if format_ == "ply" else PCD.format(size, letter)
    path.write_text(f"{header}1 2 3 7\n4 5 6 {word}\n")
    return path


@pytest.mark.parametrize("format_", ["ply", "pcd"])
@pytest.mark.parametrize(
    ("kind", "bad", "good"),
    [
        ("uchar", ["256", "-1", "nan", "3.5", "3.0", "1e2", "0x10", "1_0", "99999999999999999999"], ["0", "255", "+7"]),
        ("char", ["128", "-129", "inf"], ["-128", "127"]),
        ("ushort", ["65536", "-5"], ["65535"]),
        ("short", ["32768"], ["-32768"]),
        ("uint", ["4294967296"], ["4294967295"]),
        ("int", ["2147483648", "-2147483649"], ["-2147483648"]),
        ("float", ["1e39", "two", "1_0"], ["nan", "-inf", "1e38", "0.1"]),
    ],
)
def test_text_that_its_type_does_not_hold(tmp_path, format_, kind, bad, good):
    if format_ == "pcd":
        pytest.importorskip("pypcd4")
    for word in bad:
        with refuses(errors.FileError, f"a.{format_}", "v: expected", word[:20]):
            pointfile.read(written(tmp_path, format_, kind, word))
    for word in good:
        back = pointfile.read(written(tmp_path, format_, kind, word)).values["v"]
        dtype = back.dtype
        assert same(back, np.array([7, float(word) if kind == "float" else int(word)], dtype))


VERTEX = "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
FIELDS = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"


@pytest.mark.parametrize(
    ("name", "text", "phrases"),
    [
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 9000000000000\nend_header\n", ["x, y and z", "no property"]),
        ("a.ply", "ply\nformat binary_little_endian 1.0\nelement vertex 9000000000000\nend_header\n", ["no property"]),
        ("a.ply", f"ply\nformat ascii 1.0\nelement rig 8000000000000\n{VERTEX.format(1)}end_header\n1 2 3\n", ["rig"]),
        (
            "a.ply",
            f"ply\nformat binary_big_endian 1.0\nelement rig 80000000\nproperty int i\n{VERTEX.format(1)}end_header\n",
            ["rig", "cut short"],
        ),
        ("a.ply", f"ply\nformat ascii 1.0\n{VERTEX.format(7000000000)}end_header\n1 2 3\n", ["7000000000"]),
        ("a.ply", f"ply\nformat ascii 1.0\n{VERTEX.format(2)}end_header\n1 2 3\n4 5\n6 7\n", ["3 numbers", "got 2"]),
        ("a.ply", f"ply\nformat ascii 1.0\n{VERTEX.format(1)}property float x\nend_header\n1 2 3 4\n", ["once"]),
        (
            "a.ply",
            f"ply\nformat ascii 1.0\n{VERTEX.format(1)}property list uchar int i\nend_header\n1 2 3 1 4\n",
            ["list in vertex"],
        ),
        ("a.pcd", f"{FIELDS}WIDTH 5000000000\nHEIGHT 1\nPOINTS 5000000000\nDATA ascii\n1 2 3\n", ["5000000000"]),
        ("a.pcd", f"{FIELDS}WIDTH 5000\nHEIGHT 4000000000\nPOINTS 1\nDATA ascii\n1 2 3\n", ["WIDTH x HEIGHT"]),
        ("a.pcd", f"{FIELDS}WIDTH 1\nHEIGHT 1\nPOINTS 1\nPOINTS 9\nDATA ascii\n1 2 3\n", ["POINTS once"]),
        ("a.pcd", f"{FIELDS}WIDTH 1.5\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1 2 3\n", ["WIDTH", "1.5"]),
        ("a.pcd", f"{FIELDS}WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA morse\n1 2 3\n", ["DATA", "morse"]),
        ("a.pcd", f"{FIELDS}WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1 2\n", ["3 numbers"]),
        ("a.pcd", FIELDS.replace("SIZE 4", "SIZE 3") + "WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1 2 3\n", ["F 3"]),
    ],
)  # fmt: skip
def test_what_a_header_claims_is_not_believed(tmp_path, name, text, phrases):
    if name == "a.pcd":
        pytest.importorskip("pypcd4")
    (tmp_path / name).write_text(text)
    start = time.process_time()
    with refuses(errors.FileError, name, *phrases):
        pointfile.read(tmp_path / name)
    assert time.process_time() - start < 2


@pytest.mark.parametrize(
    ("descr", "shape"),
    [
        ("'<f4'", (0, 4_000_000_000)),
        ("'<f4'", (4_000_000_000, 4_000_000_000)),
        ("'<f4'", (-1, 3)),
        ("'<U0'", (4_000_000_000, 3)),
        ("'|V0'", (4_000_000_000, 3)),
        ("[('x', '|V0'), ('y', '|V0'), ('z', '|V0')]", (4_000_000_000,)),
        ("'|O'", (1, 3)),
        ("-" * 500 + "1", (1, 3)),
        ("[" * 300, (1, 3)),
        ("'<c16'", (1, 3)),
    ],
)
def test_npy_headers_that_claim_too_much(tmp_path, descr, shape):
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(1013) + b"\n"
    content = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(48)
    (tmp_path / "a.npy").write_bytes(content)
    start = time.process_time()
    with refuses(errors.FileError, "a.npy"):
        pointfile.read(tmp_path / "a.npy")
    assert time.process_time() - start < 2


@pytest.mark.parametrize("version", [2, 3])
def test_npy_headers_that_claim_to_be_long(tmp_path, version):
    """Since version 2 four bytes say how long the header is; NumPy asks for so much memory before it reads."""
    (tmp_path / "a.npy").write_bytes(b"\x93NUMPY" + bytes([version, 0]) + (1 << 31).to_bytes(4, "little") + b"{'descr'")
    tracemalloc.start()
    try:
        with refuses(errors.FileError, "a.npy", "header", "2147483648"):
            pointfile.read(tmp_path / "a.npy")
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_how_many_columns_a_bin_file_has_is_not_guessed(tmp_path):
    random = np.random.default_rng(4)
    path = tmp_path / "scan.bin"
    for columns in (3, 5, 6, 8):
        rows = random.normal(0, 30, (2400, columns)).astype("<f4")
        rows[:, 3:] = random.random((2400, columns - 3))
        rows.tofile(path)
        with refuses(errors.FileError, "scan.bin", "columns=", "3, 4, 5, 6 or 8"):
            pointfile.read(path)
        names = [*"xyz", *(f"v{i}" for i in range(columns - 3))]
        back = pointfile.read(path, columns=names)
        assert same(back.points, rows[:, :3].copy()) and list(back.values) == names[3:]
    # colours up to 1 in a cloud that is not larger
    random.random((1200, 6)).astype("<f4").tofile(path)
    with refuses(errors.FileError, "columns="):
        pointfile.read(path)
    # a size that fits eight columns too, and no reflectance
    random.uniform(0, 200, (2002, 4)).astype("<f4").tofile(path)
    with refuses(errors.FileError, "4 or 8"):
        pointfile.read(path)


def test_rows_that_are_plainly_kitti_need_no_names(tmp_path):
    random = np.random.default_rng(4)
    rows = random.normal(0, 30, (2400, 4)).astype("<f4")
    rows[:, 3] = random.random(2400)
    for count in (2400, 2399, 1600, 15, 2, 1, 0):
        rows[:count].tofile(tmp_path / "000001.bin")
        back = pointfile.read(tmp_path / "000001.bin")
        assert same(back.points, rows[:count, :3].copy()) and list(back.values) == ["intensity"]
    # nuScenes says it by name
    rows = random.uniform(0, 200, (2400, 5)).astype("<f4")
    rows.tofile(tmp_path / "sweep.pcd.bin")
    assert same(pointfile.read(tmp_path / "sweep.pcd.bin").points, rows[:, :3].copy())


@pytest.mark.parametrize("columns", [4, "xyz", b"xyz", [1, 2, 3], ["x", "y", "z", None]])
def test_columns_are_names(tmp_path, columns):
    np.zeros((4, 4), np.float32).tofile(tmp_path / "a.bin")
    with refuses(errors.ArgumentTypeError, "columns", "names"):
        pointfile.read(tmp_path / "a.bin", columns=columns)


def test_whole_numbers_that_float32_would_round_are_not_written_as_such(tmp_path):
    with refuses(errors.ArgumentError, "'label'", "2^24"):
        pointfile.write(tmp_path / "a.bin", np.ones((2, 3)), {"label": np.array([1, (1 << 24) + 1], np.int32)})
    assert list(tmp_path.iterdir()) == []


def test_masked_and_ragged_points_are_refused(tmp_path):
    masked = np.ma.masked_greater(np.arange(12.0).reshape(4, 3), 7)
    with refuses(errors.ArgumentError, "points", "masked", "filled"):
        pointfile.write(tmp_path / "a.ply", masked)
    with refuses(errors.ArgumentError, "values['v']", "masked"):
        pointfile.write(tmp_path / "a.ply", np.ones((4, 3)), {"v": masked[:, 0]})
    with refuses(errors.ArgumentTypeError, "points"):
        pointfile.write(tmp_path / "a.ply", [[1, 2, 3], [4, 5]])


def test_mutations(tmp_path):
    pytest.importorskip("pypcd4")
    outcomes = point_mutations.run(800, seed=5, folder=tmp_path)
    assert sum(outcomes.values()) == 800
    assert all(outcomes[f"{kind} refused"] > 10 for kind in (".bin", ".npy", ".pcd", ".ply", "ascii.pcd", "ascii.ply"))
