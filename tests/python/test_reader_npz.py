"""Calibrations that `numpy.savez` wrote: known names, nothing unpickled, and no claim of a header believed."""

from __future__ import annotations

import io
import os
import struct
import time
import zipfile

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors

K = np.array([[905.5, 0.0, 633.25], [0.0, 907.25, 361.5], [0.0, 0.0, 1.0]])
D = np.array([0.12, -0.31, 0.0011, -0.0004, 0.09])
SIZE = (1280, 720)
READERS = (ipm_rs.Camera.load, ipm_rs.Camera.from_opencv)


class MakesFolder:
    """Makes a folder when somebody unpickles it."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return os.mkdir, (self.path,)


def save(path, **arrays):
    np.savez(path, **arrays)
    return path


def entry(array, name="mtx.npy", header=None) -> bytes:
    """A zip archive with one `.npy` file, whose header may lie."""
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.asarray(array))
    content = buffer.getvalue()
    if header is not None:
        text = header.encode().ljust(118 - 1) + b"\n"
        content = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + content[128:]
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr(name, content)
    return packed.getvalue()


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    ("k", "d"),
    [
        ("mtx", "dist"),
        ("camera_matrix", "dist_coeffs"),
        ("cameraMatrix", "distCoeffs"),
        ("camMatrix", "distCoef"),
        ("K", "D"),
    ],
)
@pytest.mark.parametrize("shape", [(5,), (1, 5), (5, 1)])
def test_names_of_tutorials(read, k, d, shape, tmp_path):
    path = save(tmp_path / "calibration.npz", **{k: K, d: D.reshape(shape)}, ret=0.3, tvecs=np.ones((20, 3, 1)))
    camera = read(path, image_size=SIZE)
    np.testing.assert_array_equal(camera.intrinsics, K)
    assert camera.lens == ipm_rs.BrownConrady(D) and camera.image_size == SIZE
    with refuses(errors.CalibrationError, str(path), "image_size=(width, height)"):
        read(path)


def test_what_else_may_stand_beside_them(tmp_path):
    path = save(tmp_path / "a.npz", mtx=K, dist=D, image_size=np.array(SIZE), model="plumb_bob", note=b"by hand")
    assert ipm_rs.Camera.load(path).image_size == SIZE
    fisheye = save(tmp_path / "b.npz", K=K, D=D[:4, None], width=1280, height=720, model="fisheye")
    assert ipm_rs.Camera.load(fisheye).lens == ipm_rs.KannalaBrandt(D[:4])
    alone = save(tmp_path / "c.npz", K=np.asfortranarray(K.astype(">f4")), D=D, size=SIZE)
    np.testing.assert_array_equal(ipm_rs.Camera.load(alone).intrinsics, K)
    np.savez_compressed(tmp_path / "d.npz", K=K, D=D, image_size=SIZE)
    assert ipm_rs.Camera.load(tmp_path / "d.npz").image_size == SIZE


def test_a_pair(tmp_path):
    T = np.array([[-0.12], [0.002], [0.001]])
    arrays = {"K1": K, "D1": D, "K2": K * [[1.1], [1], [1]], "D2": D / 2, "R": np.eye(3), "T": T}
    path = save(tmp_path / "stereo.npz", **arrays, E=np.eye(3), F=np.eye(3))
    left, right = (ipm_rs.Camera.load(path, image_size=SIZE, camera=side) for side in (1, 2))
    assert left.lens == ipm_rs.BrownConrady(D) and right.lens == ipm_rs.BrownConrady(D / 2)
    np.testing.assert_allclose(right.position, [-0.001, -0.12, 0.002], rtol=0, atol=1e-12)
    with refuses(errors.ArgumentError, "camera: expected 1 (left) or 2 (right)"):
        ipm_rs.Camera.load(path, image_size=SIZE)


def test_nothing_is_unpickled(tmp_path):
    rvecs = np.empty(2, object)
    rvecs[:] = [MakesFolder(tmp_path / "ran")] * 2
    path = save(tmp_path / "calibration.npz", mtx=K, dist=D, rvecs=rvecs)
    for read in READERS:
        np.testing.assert_array_equal(read(path, image_size=SIZE).intrinsics, K)
    matrix = np.empty((), object)
    matrix[()] = MakesFolder(tmp_path / "ran")
    for read in READERS:
        with refuses(errors.CalibrationError, "camera_matrix"):
            read(save(tmp_path / "worse.npz", mtx=matrix, dist=D), image_size=SIZE)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    "data",
    [
        entry(K, header="{'descr': '<f8', 'fortran_order': False, 'shape': (3000000000, 3), }"),
        entry(K, header="{'descr': '<f8', 'fortran_order': False, 'shape': (-3, -3), }"),
        entry(K, header="{'descr': '<f8', 'fortran_order': False, 'shape': (3, 3"),
        entry(K, header="{'descr': '<f8', 'fortran_order': False, 'shape': " + "(" * 60),
        entry(K, header="{'descr': '<f8', 'fortran_order': False, 'shape': (3L, 3L, \"\"\"), }"),
        entry(K, header="{'descr': 'q9', 'fortran_order': False, 'shape': (3, 3), }"),
        entry(K)[:200],
        entry(K)[:-30],
        b"PK\x03\x04" + bytes(60),
        b"PK\x05\x06" + bytes(18),
        entry(K, name="mtx.txt"),
    ],
)
def test_damaged_files(data, tmp_path):
    path = tmp_path / "calibration.npz"
    path.write_bytes(data)
    for read in READERS:
        start = time.perf_counter()
        with refuses(errors.CalibrationError, str(path)):
            read(path, image_size=SIZE)
        assert time.perf_counter() - start < 5


def test_any_flipped_byte(tmp_path):
    """A checksum finds what is damaged in the arrays; elsewhere the file is read as it was, or refused."""
    path = tmp_path / "calibration.npz"
    np.savez_compressed(path, mtx=K, dist=D, image_size=SIZE)
    good, whole = path.read_bytes(), ipm_rs.Camera.load(path)
    for at in range(len(good)):
        path.write_bytes(good[:at] + bytes([good[at] ^ (1 << at % 8)]) + good[at + 1 :])
        try:
            assert ipm_rs.Camera.load(path) == whole
        except errors.IpmError:
            continue


def test_zip_bombs_stay_packed(tmp_path):
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("depth.npy", bytes(40 << 20))
        for name, array in (("mtx", K), ("dist", D)):
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, array)
            archive.writestr(f"{name}.npy", buffer.getvalue())
    start = time.perf_counter()
    np.testing.assert_array_equal(ipm_rs.Camera.load(path, image_size=SIZE).intrinsics, K)
    assert time.perf_counter() - start < 1
    with zipfile.ZipFile(path, "w") as archive:
        for i in range(1200):
            archive.writestr(f"a{i}.npy", b"")
    with refuses(errors.CalibrationError, "at most 1000 arrays"):
        ipm_rs.Camera.load(path)


def test_arrays_without_a_camera(tmp_path):
    path = tmp_path / "depth.npz"
    np.savez(path, depth=np.zeros((48, 64), np.float32))
    with refuses(errors.CalibrationError, "got one of none", "opencv: no 3x3 camera_matrix"):
        ipm_rs.Camera.load(path)
    np.savez(path, K, D)
    with refuses(errors.CalibrationError, "camera_matrix, missing among 'arr_0', 'arr_1'"):
        ipm_rs.Camera.from_opencv(path, image_size=SIZE)


def test_an_open_file_is_a_mapping(tmp_path):
    rvecs = np.empty(2, object)
    rvecs[:] = [MakesFolder(tmp_path / "ran")] * 2
    path = save(tmp_path / "calibration.npz", mtx=K, dist=D, rvecs=rvecs, kind="plumb_bob")
    with np.load(path) as arrays:
        assert ipm_rs.Camera.from_opencv(arrays, image_size=SIZE).lens == ipm_rs.BrownConrady(D)
    assert not (tmp_path / "ran").exists()
