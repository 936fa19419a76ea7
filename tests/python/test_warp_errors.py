"""Calls of the warp that are refused: a typed error, the mend, and `out` untouched."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses, textured

import ipm_rs
from ipm_rs import errors

NAN, INF = float("nan"), float("inf")


@pytest.fixture(scope="module")
def lut() -> ipm_rs.Lut:
    """5 x 6 cells from an image of 8 x 4 pixels."""
    map_x, map_y = np.meshgrid(np.linspace(-2, 9, 6), np.linspace(-2, 5, 5))
    return ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 4))


@pytest.fixture
def out() -> np.ndarray:
    return textured(5, 6, 3, seed=11)


IMAGE = textured(4, 8, 3)


def test_the_call_that_the_others_spoil(lut, out):
    before = out.copy()
    lut.warp(IMAGE, out=out)
    assert (out != before).any()


# ---------------------------------------------------------------------------------------------------------------------
# image


@pytest.mark.parametrize("shape", [(8, 4, 3), (4, 9, 3), (3, 8, 3), (1024, 2048, 3)], ids=str)
def test_image_of_another_size(lut, out, shape):
    mend = "swapped" if shape[:2] == (8, 4) else "resized"
    with refuses(errors.ImageError, f"{shape[1]}x{shape[0]}", "8x4", "image_size=", mend, out=out):
        lut.warp(np.zeros(shape, np.uint8), out=out)


@pytest.mark.parametrize("shape", [(), (8,), (1, 4, 8, 3), (1, 1, 4, 8, 3)], ids=str)
@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_image_of_another_number_of_dimensions(lut, out, shape, interpolation):
    with refuses(errors.ImageError, "image", "(H, W)", "(H, W, C)", str(shape).strip("(),"), out=out):
        lut.warp(np.zeros(shape, np.uint8), interpolation=interpolation, out=out)


@pytest.mark.parametrize("shape", [(0, 8, 3), (4, 0, 3), (0, 0), (4, 8, 0)], ids=str)
def test_empty_image(lut, out, shape):
    with refuses(errors.ImageError, "image", "0", out=out):
        lut.warp(np.zeros(shape, np.uint8), out=out)


@pytest.mark.parametrize("dtype", ["bool", "int32", "uint32", "int64", "uint64", "longdouble"])
def test_dtypes_that_bilinear_cannot_blend(lut, out, dtype):
    with refuses(errors.DtypeError, "image", "uint8", "uint16", "float32", f"got {np.dtype(dtype)}", out=out):
        lut.warp(IMAGE.astype(dtype), interpolation="bilinear", out=out)


STRANGE = {
    "object": IMAGE.astype(object),
    "complex64": IMAGE.astype("complex64"),
    "complex128": IMAGE.astype("complex128"),
    "str": IMAGE.astype("U3"),
    "bytes": IMAGE.astype("S3"),
    "structured": np.zeros((4, 8, 3), dtype=[("a", "u1"), ("b", "u1")]),
    "void": np.zeros((4, 8, 3), dtype="V4"),
    "void of no bytes": np.empty((4, 8, 3), dtype="V0"),
    "structure of no fields": np.empty((4, 8, 3), dtype=np.dtype([])),
    "datetime64": IMAGE.astype("datetime64[s]"),
    "timedelta64": IMAGE.astype("timedelta64[s]"),
    "byte-swapped uint16": IMAGE.astype(np.dtype("u2").newbyteorder()),
    "byte-swapped float32": IMAGE.astype(np.dtype("f4").newbyteorder()),
}


@pytest.mark.parametrize("name", STRANGE)
@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_dtypes_that_are_no_image(lut, out, name, interpolation):
    image = STRANGE[name]
    with refuses(errors.DtypeError, "image", "expected", "got", out=out):
        lut.warp(image, interpolation=interpolation, out=out)
    with pytest.raises(TypeError):
        lut.warp(image, interpolation=interpolation)


def test_byte_swapped_says_how_to_mend(lut):
    with refuses(errors.DtypeError, "byte"):
        lut.warp(STRANGE["byte-swapped uint16"])


@pytest.mark.skipif(np.dtype(np.longdouble).itemsize == 8, reason="long double is double here")
def test_extended_precision_is_no_image(lut, out):
    with refuses(errors.DtypeError, "image", "8 bytes", np.dtype("g").name, out=out):
        lut.warp(IMAGE.astype(np.longdouble), interpolation="nearest", out=out)


OTHER_STRIDES = {
    "every second column": textured(4, 16, 3)[:, ::2],
    "flipped columns": textured(4, 8, 3)[:, ::-1],
    "channels of more": textured(4, 8, 4)[:, :, :3],
    "bgr to rgb": textured(4, 8, 3)[:, :, ::-1],
    "one channel of three": textured(4, 8, 3)[:, :, 1],
    "channels first": textured(3, 4).repeat(8).reshape(3, 4, 8).transpose(1, 2, 0),
    "fortran": np.asfortranarray(textured(4, 8, 3)),
    "transposed": textured(8, 4, 3).transpose(1, 0, 2),
    "one pixel for all": np.broadcast_to(textured(1, 1, 3), (4, 8, 3)),
}


@pytest.mark.parametrize("name", OTHER_STRIDES)
@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_strides_other_than_the_rows(lut, name, interpolation):
    image = OTHER_STRIDES[name]
    assert image.shape[:2] == (4, 8) and not image.flags.c_contiguous
    out = np.full((5, 6, *image.shape[2:]), 7, np.uint8)
    with refuses(errors.ImageError, "image", "ascontiguousarray(image)", out=out):
        lut.warp(image, interpolation=interpolation, out=out)


def test_row_stride_that_is_no_whole_number_of_samples(lut):
    raw = np.zeros(4 * 17 + 16, np.uint8)
    image = np.ndarray((4, 8), np.uint16, buffer=raw, strides=(17, 2))
    out = np.full((5, 6), 7, np.uint16)
    with refuses(errors.ImageError, "image", "aligned", "image.copy()", out=out):
        lut.warp(image, out=out)


@pytest.mark.parametrize("offset", [1, 2, 3])
@pytest.mark.parametrize("dtype", ["uint16", "float32"])
def test_unaligned_image(lut, offset, dtype):
    """Refused or right, never undefined."""
    good = textured(4, 8, None, dtype)
    raw = np.zeros(good.nbytes + 16, np.uint8)
    start = (-raw.ctypes.data) % 8 + offset
    raw[start : start + good.nbytes] = good.view(np.uint8).ravel()
    image = raw[start : start + good.nbytes].view(dtype).reshape(4, 8)
    if image.flags.aligned:
        np.testing.assert_array_equal(lut.warp(image), lut.warp(good))
    else:
        with refuses(errors.ImageError, "image", "align"):
            lut.warp(image)


@pytest.mark.parametrize("image", [None, 3, "image.png", [[1, 2], [3, 4]], b"abc", bytearray(32), object()])
def test_image_that_is_no_array(lut, out, image):
    with refuses(errors.ArgumentTypeError, "image", "array", type(image).__name__, out=out):
        lut.warp(image, out=out)


# ---------------------------------------------------------------------------------------------------------------------
# interpolation


@pytest.mark.parametrize("name", ["cubist", "AREA", "median", "NEAREST", "", "linear"])
def test_unknown_interpolation(lut, out, name):
    with refuses(errors.ArgumentError, "interpolation", "nearest", "bilinear", repr(name)[1:-1], out=out):
        lut.warp(IMAGE, interpolation=name, out=out)


@pytest.mark.parametrize("value", [0, 1.0, b"nearest", ["nearest"]], ids=repr)
def test_interpolation_is_a_name(lut, out, value):
    with refuses(errors.ArgumentTypeError, "interpolation", "nearest", "bilinear", out=out):
        lut.warp(IMAGE, interpolation=value, out=out)


def test_options_are_named(lut):
    with pytest.raises(TypeError):
        lut.warp(IMAGE, "nearest")
    with pytest.raises(TypeError):
        lut.warp(IMAGE, border="constant")
    with pytest.raises(TypeError):
        lut.warp()


# ---------------------------------------------------------------------------------------------------------------------
# border_value


@pytest.mark.parametrize(
    ("dtype", "interpolation", "value"),
    [
        ("uint8", "bilinear", 256),
        ("uint8", "bilinear", -1),
        ("uint8", "bilinear", 3.5),
        ("uint8", "bilinear", NAN),
        ("uint8", "bilinear", INF),
        ("uint8", "nearest", 256),
        ("uint8", "nearest", -1),
        ("uint8", "nearest", 0.25),
        ("uint8", "nearest", 10**30),
        ("uint16", "bilinear", 65536),
        ("uint16", "bilinear", NAN),
        ("float32", "bilinear", 1e300),
        pytest.param("float32", "bilinear", 10**400, id="float32-bilinear-10^400"),
        ("float16", "nearest", 1e5),
        ("bool", "nearest", 2),
        ("bool", "nearest", 0.5),
        ("int8", "nearest", 128),
        ("int8", "nearest", -129),
        ("int64", "nearest", 2**63),
        ("int64", "nearest", 1e19),
        ("uint64", "nearest", 2**64),
        ("uint64", "nearest", -1),
    ],
)
def test_border_value_that_the_dtype_cannot_hold(lut, dtype, interpolation, value):
    image = np.ones((4, 8, 3), dtype)
    out = np.ones((5, 6, 3), dtype)
    with refuses(errors.ArgumentError, "border_value", dtype, out=out):
        lut.warp(image, interpolation=interpolation, border_value=value, out=out)
    with refuses(errors.ArgumentError, "border_value", dtype, out=out):
        lut.warp(image, interpolation=interpolation, border_value=(0, 0, value), out=out)


@pytest.mark.parametrize("value", [(), (1, 2), (1, 2, 3, 4), np.zeros(5)], ids=repr)
def test_border_value_of_the_wrong_count(lut, out, value):
    with refuses(errors.ArgumentError, "border_value", "3", str(len(value)), out=out):
        lut.warp(IMAGE, border_value=value, out=out)


def test_border_value_of_the_wrong_count_for_a_grey_image(lut):
    with refuses(errors.ArgumentError, "border_value", "1", "3"):
        lut.warp(IMAGE[:, :, 0].copy(), border_value=(1, 2, 3))


@pytest.mark.parametrize("value", ["0", b"0", 1j, {}, object(), [[1, 2, 3]], ["a", "b", "c"], (1, None, 3)])
def test_border_value_that_is_no_number(lut, out, value):
    with pytest.raises((errors.ArgumentError, errors.ArgumentTypeError), match="border_value"):
        lut.warp(IMAGE, border_value=value, out=out)
    np.testing.assert_array_equal(out, textured(5, 6, 3, seed=11))


# ---------------------------------------------------------------------------------------------------------------------
# threads


@pytest.mark.parametrize("threads", [0, -1, -(10**30)])
def test_threads_below_one(lut, out, threads):
    with refuses(errors.ArgumentError, "threads", "at least 1", str(threads), out=out):
        lut.warp(IMAGE, threads=threads, out=out)


@pytest.mark.parametrize("threads", [1.5, 2.0, "2", [2], NAN], ids=repr)
def test_threads_is_a_whole_number(lut, out, threads):
    with refuses(errors.ArgumentTypeError, "threads", type(threads).__name__, out=out):
        lut.warp(IMAGE, threads=threads, out=out)


@pytest.mark.parametrize("threads", [0, -1])
def test_set_num_threads_below_one(threads):
    before = ipm_rs.get_num_threads()
    with refuses(errors.ArgumentError, "at least 1", str(threads)):
        ipm_rs.set_num_threads(threads)
    assert ipm_rs.get_num_threads() == before


@pytest.mark.parametrize("threads", [None, 1.5, "2"], ids=repr)
def test_set_num_threads_takes_a_whole_number(threads):
    before = ipm_rs.get_num_threads()
    with pytest.raises(TypeError):
        ipm_rs.set_num_threads(threads)
    assert ipm_rs.get_num_threads() == before


# ---------------------------------------------------------------------------------------------------------------------
# out


@pytest.mark.parametrize("shape", [(6, 5, 3), (5, 6), (5, 6, 1), (5, 6, 4), (5, 7, 3), (10, 12, 3)], ids=str)
def test_out_of_another_shape(lut, shape):
    out = np.full(shape, 7, np.uint8)
    with refuses(errors.ImageError, "out: expected shape (5, 6, 3)", f"got {shape}", out=out):
        lut.warp(IMAGE, out=out)


@pytest.mark.parametrize("shape", [(1, 5, 6, 3), (90,), (), (0, 6, 3)], ids=str)
def test_out_that_is_no_image(lut, shape):
    out = np.full(shape, 7, np.uint8)
    with refuses(errors.ImageError, "out: expected shape (5, 6, 3)", f"got {shape}", out=out):
        lut.warp(IMAGE, out=out)


def test_out_of_a_grey_image_has_two_dimensions(lut):
    out = np.full((5, 6, 1), 7, np.uint8)
    with refuses(errors.ImageError, "out", "(5, 6)", out=out):
        lut.warp(IMAGE[:, :, 0].copy(), out=out)
    out = np.full((5, 6), 7, np.uint8)
    with refuses(errors.ImageError, "out", "(5, 6, 1)", out=out):
        lut.warp(IMAGE[:, :, :1].copy(), out=out)


@pytest.mark.parametrize("dtype", ["int8", "uint16", "float32", "bool", "float64", "object"])
def test_out_of_another_dtype(lut, dtype):
    out = np.ones((5, 6, 3), dtype)
    with refuses(errors.DtypeError, "out", "uint8", dtype, out=None if dtype == "object" else out):
        lut.warp(IMAGE, out=out)
    assert (out == 1).all()


def test_byte_swapped_out(lut):
    image = IMAGE.astype("uint16")
    out = np.ones((5, 6, 3), np.dtype("u2").newbyteorder())
    with refuses(errors.DtypeError, "out", "byte order", out.dtype.str, out=out):
        lut.warp(image, out=out)


def test_read_only_out(lut, out):
    out.setflags(write=False)
    with refuses(errors.ImageError, "out", "read-only", out=out):
        lut.warp(IMAGE, out=out)


@pytest.mark.parametrize(
    "view",
    [lambda big: big[:, ::2], lambda big: big[:, 5::-1], lambda big: big[:, :6, ::-1]],
    ids=["every second column", "flipped columns", "flipped channels"],
)
def test_out_with_strides_other_than_the_rows(lut, view):
    big = textured(5, 12, 3)
    out = view(big)
    assert out.shape == (5, 6, 3)
    with refuses(errors.ImageError, "out", out=big):
        lut.warp(IMAGE, out=out)


def test_out_whose_rows_are_one_row(lut):
    """A zero row stride is fine to read and senseless to write, where several threads would race."""
    one = np.full((1, 6, 3), 7, np.uint8)
    out = np.lib.stride_tricks.as_strided(one, (5, 6, 3), (0, 3, 1))
    with refuses(errors.ImageError, "out", out=one):
        lut.warp(IMAGE, out=out)


def test_out_whose_rows_overlap(lut):
    raw = np.full(200, 7, np.uint8)
    out = np.lib.stride_tricks.as_strided(raw, (5, 6, 3), (9, 3, 1))
    with refuses(errors.ImageError, "out", out=raw):
        lut.warp(IMAGE, out=out)


@pytest.mark.parametrize("out", [[[0]], "out.png", 3, bytearray(90), True], ids=repr)
def test_out_that_is_no_array(lut, out):
    with refuses(errors.ArgumentTypeError, "out", "array", type(out).__name__):
        lut.warp(IMAGE, out=out)


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_out_is_the_image(interpolation, dtype):
    map_x, map_y = np.meshgrid(np.arange(8.0)[::-1], np.arange(4.0))
    flip = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 4))
    image = textured(4, 8, 3, dtype)
    with refuses(errors.ImageError, "out", "image", "memory", out=image):
        flip.warp(image, interpolation=interpolation, out=image)


OVERLAPS = {
    "same memory, other view": lambda big: (big[:4], big[:4]),
    "shifted by a row": lambda big: (big[:4], big[1:5]),
    "last row touches first": lambda big: (big[:4], big[3:7]),
    "flipped": lambda big: (big[:4], big[3::-1]),
    "crossing rows": lambda big: (big[0:7:2], big[2:6]),
}


@pytest.mark.parametrize("name", OVERLAPS)
def test_out_overlaps_the_image(name):
    map_x, map_y = np.meshgrid(np.arange(8.0)[::-1], np.arange(4.0))
    flip = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 4))
    big = textured(7, 8, 3)
    image, out = OVERLAPS[name](big)
    assert np.shares_memory(image, out) and image.shape == out.shape
    with refuses(errors.ImageError, "out", "image", "memory", out=big):
        flip.warp(image, out=out)


def test_out_overlaps_under_another_dtype():
    map_x, map_y = np.meshgrid(np.arange(8.0), np.arange(4.0))
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 4))
    raw = np.zeros(4 * 8 * 8, np.uint8)
    image, out = raw[:128].view(np.float32).reshape(4, 8), raw[64:192].view(np.float32).reshape(4, 8)
    with refuses(errors.ImageError, "memory", out=raw):
        lut.warp(image, out=out)
    label, other = raw[:32].view(bool).reshape(4, 8), raw[8:40].view(bool).reshape(4, 8)
    with refuses(errors.ImageError, "memory", out=raw):
        lut.warp(label, interpolation="nearest", out=other)
