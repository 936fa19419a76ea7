"""Tables that are refused."""

from __future__ import annotations

import time

import golden
import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors

NAN, INF = float("nan"), float("inf")
X, Y = (m.astype(np.float32) for m in np.meshgrid(np.arange(6.0), np.arange(4.0)))


def test_maps_of_two_shapes():
    with refuses(errors.LutError, "map_y", "4", "6"):
        ipm_rs.Lut.from_maps(X, Y[:, :5], source_size=(6, 4))
    with refuses(errors.LutError, "map_y"):
        ipm_rs.Lut.from_maps(X, Y.T, source_size=(6, 4))


@pytest.mark.parametrize("shape", [(), (6,), (2, 3, 4)], ids=str)
def test_maps_of_other_dimensions(shape):
    with refuses(errors.LutError, "map_x", "(rows, columns)"):
        ipm_rs.Lut.from_maps(np.ones(shape), np.ones(shape), source_size=(6, 4))


@pytest.mark.parametrize("shape", [(0, 4), (4, 0), (0, 0)], ids=str)
def test_empty_maps(shape):
    with refuses(errors.LutError, "map_x", "0"):
        ipm_rs.Lut.from_maps(np.ones(shape), np.ones(shape), source_size=(6, 4))


@pytest.mark.parametrize("dtype", ["int16", "int64", "uint8", "float16", "complex128", "object", "bool"])
def test_maps_of_other_dtypes(dtype):
    with refuses(errors.DtypeError, "map_x", "float32", "float64", np.dtype(dtype).name.replace("float64", "f8")[:2]):
        ipm_rs.Lut.from_maps(X.astype(dtype), Y.astype(dtype), source_size=(6, 4))


@pytest.mark.parametrize(
    "maps", [([[0.0]], [[0.0]]), (None, None), ("x", "y"), (X, [[0.0]])], ids=["lists", "None", "str", "mixed"]
)
def test_maps_that_are_not_arrays(maps):
    with refuses(errors.ArgumentTypeError, "map_", "array"):
        ipm_rs.Lut.from_maps(*maps, source_size=(6, 4))


@pytest.mark.parametrize("size", [(0, 4), (6, 0), (-6, 4)], ids=str)
@pytest.mark.parametrize("make", ["maps", "homography"])
def test_source_size_is_positive(make, size):
    with refuses(errors.ArgumentError, "source_size: expected", str(min(size))):
        if make == "maps":
            ipm_rs.Lut.from_maps(X, Y, source_size=size)
        else:
            ipm_rs.Lut.from_homography(np.eye(3), size=(6, 4), source_size=size)


@pytest.mark.parametrize("size", [(6,), (6, 4, 3), 6, None, "64", (6.5, 4)], ids=str)
def test_source_size_is_two_whole_numbers(size):
    with pytest.raises((errors.ArgumentError, errors.ArgumentTypeError), match=r"source_size: expected .*got"):
        ipm_rs.Lut.from_maps(X, Y, source_size=size)
    with pytest.raises((errors.ArgumentError, errors.ArgumentTypeError), match=r"^size: expected .*got"):
        ipm_rs.Lut.from_homography(np.eye(3), size=size, source_size=(6, 4))


@pytest.mark.parametrize("size", [(0, 4), (6, 0), (6, -4)], ids=str)
def test_output_size_is_positive(size):
    with refuses(errors.ArgumentError, "size: expected", str(min(size))):
        ipm_rs.Lut.from_homography(np.eye(3), size=size, source_size=(6, 4))


def test_absurd_output_is_refused_before_the_memory_is_asked_for():
    began = time.perf_counter()
    with refuses(errors.LutError, "60000 x 60000", "smaller output"):
        ipm_rs.Lut.from_homography(np.eye(3), size=(60000, 60000), source_size=(6, 4))
    with refuses(errors.ArgumentError, "source_size: expected", "1000000 x 1000000"):
        ipm_rs.Lut.from_homography(np.eye(3), size=(6, 4), source_size=(10**6, 10**6))
    assert time.perf_counter() - began < 0.5


SINGULAR = {
    "zeros": np.zeros((3, 3)),
    "two equal rows": np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [0.0, 0.0, 1.0]]),
    "nan": np.diag([1.0, NAN, 1.0]),
    "inf": np.diag([INF, 1.0, 1.0]),
}


@pytest.mark.parametrize("matrix", SINGULAR)
def test_homographies_that_map_to_nothing(matrix):
    with refuses(errors.LutError, "M", "expected"):
        ipm_rs.Lut.from_homography(SINGULAR[matrix], size=(6, 4), source_size=(6, 4))


@pytest.mark.parametrize("shape", [(), (9,), (2, 3), (4, 4), (3, 3, 1)], ids=str)
def test_homographies_of_another_shape(shape):
    with refuses(errors.ArgumentError, "M: expected a 3x3 matrix", f"got shape {shape}"):
        ipm_rs.Lut.from_homography(np.ones(shape), size=(6, 4), source_size=(6, 4))


@pytest.mark.parametrize("matrix", [None, "M", np.array([["a"] * 3] * 3)], ids=["None", "str", "array"])
def test_homographies_that_are_not_numbers(matrix):
    with refuses(errors.ArgumentTypeError, "M: expected", "got"):
        ipm_rs.Lut.from_homography(matrix, size=(6, 4), source_size=(6, 4))


def test_camera_and_grid_are_what_they_are_called(seed_camera, seed_grid):
    with refuses(errors.ArgumentTypeError, "camera: expected an ipm_rs.Camera, got BevGrid"):
        ipm_rs.Lut(seed_grid, seed_camera)
    with refuses(errors.ArgumentTypeError, "grid: expected an ipm_rs.BevGrid, got ndarray"):
        ipm_rs.Lut(seed_camera, golden.K)
    with pytest.raises(TypeError):
        ipm_rs.Lut()


@pytest.mark.parametrize("outside", ["x", [1.0], 1j], ids=str)
def test_outside_value_of_maps_is_a_number(seed_lut, outside):
    with refuses(errors.ArgumentTypeError, "outside"):
        seed_lut.maps(outside=outside)
