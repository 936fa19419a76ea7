"""Colour-coded depth: every order, layout and limit, against the formula in float64."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses, same

import ipm_rs
from ipm_rs import errors, reference

ORDERS = ("bgra", "rgba", "bgr", "rgb")


def coded(codes: np.ndarray, order: str) -> np.ndarray:
    """The image of 24-bit codes, its alpha noise."""
    parts = {"r": codes & 255, "g": codes >> 8 & 255, "b": codes >> 16, "a": codes * 7 & 255}
    return np.stack([parts[name] for name in order], axis=-1).astype(np.uint8)


@pytest.fixture(scope="module")
def codes() -> np.ndarray:
    """A million random codes, the two ends among them."""
    codes = np.random.default_rng(5).integers(0, 2**24, (1000, 1000), dtype=np.uint32)
    codes[0, 0], codes[-1, -1] = 0, 2**24 - 1
    return codes


def test_fifty_metres():
    image = np.array([[[205, 204, 12]]], np.uint8)
    assert ipm_rs.decode_carla_depth(image, order="rgb")[0, 0] == np.float32(50.000015)
    assert ipm_rs.decode_carla_depth(image[..., ::-1].copy(), order="bgr")[0, 0] == np.float32(50.000015)
    wrong = ipm_rs.decode_carla_depth(image, order="bgr")[0, 0]
    assert abs(wrong - 803.9) < 0.1, "the other order is another depth: nothing in the image tells"


@pytest.mark.parametrize("order", ORDERS)
def test_a_million_codes_are_exact(codes, order):
    image = coded(codes, order)
    normalized = ipm_rs.decode_carla_depth(image, order=order, normalized=True)
    assert normalized.dtype == np.float32 and normalized.shape == codes.shape
    assert np.array_equal(np.rint(normalized.astype(np.float64) * (2**24 - 1)).astype(np.uint32), codes)
    for unit, got in ((False, ipm_rs.decode_carla_depth(image, order=order)), (True, normalized)):
        exact = reference.decode_carla_depth(image, order, unit)
        assert np.array_equal(got, exact.astype(np.float32)), "the float64 value, rounded once"


def test_four_channels_are_bgra_unless_said(codes):
    image = coded(codes, "bgra")
    assert same(ipm_rs.decode_carla_depth(image), ipm_rs.decode_carla_depth(image, order="bgra"))
    assert not same(ipm_rs.decode_carla_depth(image), ipm_rs.decode_carla_depth(image, order="rgba"))


@pytest.mark.parametrize("order", ["bgra", "rgb"])
@pytest.mark.parametrize("width", [1, 2, 3, 7, 8, 9, 15, 16, 17, 31, 33, 63, 65])
def test_any_width_and_row_stride(codes, order, width):
    canvas = coded(codes[:40, :80], order)
    whole = ipm_rs.decode_carla_depth(canvas, order=order)
    for rows in (slice(3, 20), slice(20, 3, -2), slice(5, 6)):
        view = canvas[rows, 5 : 5 + width]
        assert np.array_equal(ipm_rs.decode_carla_depth(view, order=order), whole[rows, 5 : 5 + width])
    out = np.full((17, 90), np.float32(-1))
    got = ipm_rs.decode_carla_depth(canvas[3:20, 5 : 5 + width], order=order, out=out[:, 4 : 4 + width])
    assert np.shares_memory(got, out) and np.array_equal(got, whole[3:20, 5 : 5 + width])
    outside = np.ones_like(out, bool)
    outside[:, 4 : 4 + width] = False
    assert (out[outside] == -1).all()


def test_threads_change_nothing(codes):
    image = coded(codes, "bgra")
    assert same(ipm_rs.decode_carla_depth(image, threads=1), ipm_rs.decode_carla_depth(image, threads=3))
    depth = ipm_rs.decode_carla_depth(image)
    assert same(ipm_rs.encode_carla_depth(depth, threads=1), ipm_rs.encode_carla_depth(depth, threads=3))


@pytest.mark.parametrize("order", ORDERS)
def test_there_and_back(codes, order):
    image = coded(codes, order)
    normalized = ipm_rs.decode_carla_depth(image, order=order, normalized=True)
    back = ipm_rs.encode_carla_depth(normalized, order=order, normalized=True)
    if len(order) == 4:
        image[..., 3] = 255
    assert same(back, image)
    near = codes >> 1  # below 512 m, where float32 tells neighbouring codes apart
    image = coded(near, order)
    metres = ipm_rs.decode_carla_depth(image, order=order)
    assert np.array_equal(ipm_rs.encode_carla_depth(metres, order=order)[..., :3], image[..., :3])


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("normalized", [False, True])
def test_the_encoder_takes_the_nearest_code(dtype, normalized):
    depth = np.random.default_rng(1).random((50, 70)).astype(dtype) * (1 if normalized else 1000)
    depth[0, :4] = 0, 1e-9, 1 if normalized else 1000, np.inf
    got = ipm_rs.encode_carla_depth(depth, normalized=normalized)
    expected = reference.encode_carla_depth(depth, "bgra", normalized)
    code = [image[..., :3].astype(int) @ [65536, 256, 1] for image in (got, expected)]
    # one product and one quotient round otherwise than two: a tie may fall to the other side
    assert np.abs(code[0] - code[1]).max() <= 1 and (code[0] == code[1]).mean() > 0.999
    assert (got[..., 3] == 255).all() and (got[0, 2:4] == 255).all()


def test_what_has_no_code_is_refused_by_place():
    depth = np.ones((4, 5), np.float32)
    for bad, shown in ((np.nan, "NaN"), (-0.5, "-0.5")):
        depth[2, 3] = bad
        with refuses(errors.ImageError, "depth", shown, "row 2", "column 3"):
            ipm_rs.encode_carla_depth(depth)


def test_wrong_images_are_refused():
    image = np.zeros((4, 5, 4), np.uint8)
    with refuses(errors.ArgumentError, "order", "bgr", "rgb", "3 channels"):
        ipm_rs.decode_carla_depth(image[..., :3].copy())
    with refuses(errors.ArgumentError, "order", "4 letters", "'rgb'".replace("'", '"')):
        ipm_rs.decode_carla_depth(image, order="rgb")
    with refuses(errors.ArgumentError, "order", "argb"):
        ipm_rs.decode_carla_depth(image, order="argb")
    with refuses(errors.ArgumentTypeError, "order", "int"):
        ipm_rs.decode_carla_depth(image, order=4)
    with refuses(errors.DtypeError, "uint8", "float32"):
        ipm_rs.decode_carla_depth(image.astype(np.float32))
    for shape in ((4, 5), (4, 5, 2), (4, 5, 5)):
        with refuses(errors.ImageError, "(H, W, 4)", str(shape)):
            ipm_rs.decode_carla_depth(np.zeros(shape, np.uint8))
    with refuses(errors.ImageError, "adjacent", "ascontiguousarray"):
        ipm_rs.decode_carla_depth(image[..., ::-1])
    with refuses(errors.ImageError, "at least one pixel"):
        ipm_rs.decode_carla_depth(image[:0])
    with refuses(errors.ArgumentTypeError, "NumPy array"):
        ipm_rs.decode_carla_depth(object())
    with refuses(errors.ImageError, "(H, W)"):
        ipm_rs.encode_carla_depth(np.ones((4, 5, 1), np.float32))
    with refuses(errors.DtypeError, "float32 or float64", "uint16"):
        ipm_rs.encode_carla_depth(np.ones((4, 5), np.uint16))


def test_wrong_outputs_are_refused():
    image, frozen = np.full((4, 5, 4), 9, np.uint8), np.zeros((4, 5), np.float32)
    frozen.setflags(write=False)
    for out, phrase in (
        (np.zeros((4, 6), np.float32), "(4, 5)"),
        (np.zeros((4, 5)), "float32"),
        (frozen, "writable"),
        (np.zeros((4, 10), np.float32)[:, ::2], "adjacent"),
        (image.reshape(4, 20).view(np.float32), "image spans"),
    ):
        with refuses((errors.ImageError, errors.DtypeError), "out", phrase, out=out):
            ipm_rs.decode_carla_depth(image, out=out)
    with refuses(errors.ArgumentError, "threads"):
        ipm_rs.decode_carla_depth(image, threads=0)


def test_the_encoder_writes_where_it_is_wanted():
    depth = np.random.default_rng(2).uniform(0, 999, (30, 40)).astype(np.float32)
    canvas = np.full((34, 50, 4), 9, np.uint8)
    out = canvas[2:-2, 5:-5]
    assert ipm_rs.encode_carla_depth(depth, out=out) is out
    assert same(out.copy(), ipm_rs.encode_carla_depth(depth))
    canvas[2:-2, 5:-5] = 9
    assert (canvas == 9).all(), "written beside it"


def test_wrong_outputs_of_the_encoder_are_refused():
    depth = np.ones((30, 40), np.float32)
    for wrong, error, phrases in (
        (np.zeros((30, 40, 3), np.uint8), errors.ImageError, ("(30, 40, 4)", "(30, 40, 3)")),
        (np.zeros((30, 40, 4), np.int8), errors.DtypeError, ("uint8", "int8")),
        (np.broadcast_to(np.zeros((1, 40, 4), np.uint8), (30, 40, 4)), errors.ImageError, ("overlap",)),
        (np.zeros((30, 40, 8), np.uint8)[..., ::2], errors.ImageError, ("adjacent",)),
    ):
        with refuses(error, "out", *phrases, out=wrong):
            ipm_rs.encode_carla_depth(depth, out=wrong)
    fixed = np.zeros((30, 40, 4), np.uint8)
    fixed.flags.writeable = False
    with refuses(errors.ImageError, "out", "read-only", out=fixed):
        ipm_rs.encode_carla_depth(depth, out=fixed)
    with refuses(errors.ImageError, "out", "memory", "depth", out=depth):
        ipm_rs.encode_carla_depth(depth, out=depth.view(np.uint8).reshape(30, 40, 4))
