"""Every dtype of a picture: what it is blended to, by a table and without one, and what is refused."""

import cv2
import hypothesis
import numpy as np
import pytest
from helpers import exact_bilinear, refuses, same
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors

WIDTH, HEIGHT = 61, 43
BLENDED = ("uint8", "int8", "uint16", "int16", "float16", "float32", "float64")
FLOATS = ("float16", "float32", "float64")
BORDERS = ("constant", "replicate", "reflect_101")
ROUNDING = {"uint8": 0.52, "int8": 0.52, "uint16": 3, "int16": 3}


def picture(dtype, channels=None, seed=0, height=HEIGHT, width=WIDTH):
    """Noise over the range of an integer dtype; floats from -3 to 3, float64 around an easting in metres."""
    random = np.random.default_rng(seed)
    shape = (height, width) if channels is None else (height, width, channels)
    if np.dtype(dtype).kind == "f":
        return (random.normal(0, 1, shape).clip(-3, 3) + (5e6 if dtype == "float64" else 0)).astype(dtype)
    limits = np.iinfo(dtype)
    return random.integers(limits.min, limits.max, shape, dtype=dtype, endpoint=True)


def maps(seed=0, shape=(37, 29), beyond=1.5):
    """Anywhere on the image, in its halo and outside; some on whole pixels."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(-beyond, WIDTH - 1 + beyond, shape), random.uniform(-beyond, HEIGHT - 1 + beyond, shape)
    x[::4], y[:, ::5] = np.floor(x[::4]), np.floor(y[:, ::5])
    return x, y


def allowed(dtype, spread, of_range):
    """How far from exact: the promise of the dtype, and for floats the rounding of numbers of this size."""
    if dtype in ROUNDING:
        return ROUNDING[dtype]
    largest = 5e6 + 4 if dtype == "float64" else 4
    return spread * of_range + 1.5 * largest * float(np.finfo(dtype).eps)


def border_of(dtype):
    return {"float64": 5e6 - 1, "uint8": 7, "uint16": 700}.get(dtype, -1.5 if dtype in FLOATS else -7)


@pytest.mark.parametrize("dtype", BLENDED)
@hypothesis.given(st.integers(0, 2**32), st.sampled_from([None, 1, 2, 3, 4, 5, 9]))
@hypothesis.settings(max_examples=15, deadline=None)
def test_blends_of_any_dtype_are_within_their_promise(dtype, seed, channels):
    image, (x, y), border = picture(dtype, channels, seed), maps(seed), border_of(dtype)
    exact, spread = exact_bilinear(image, x, y, border)
    table = ipm_rs.Lut.from_maps(x, y, source_size=(WIDTH, HEIGHT)).warp(image, border_value=border)
    direct = ipm_rs.remap(image, x, y, border_value=border)
    assert table.dtype == direct.dtype == dtype
    assert (np.abs(table.astype(float) - exact) <= allowed(dtype, spread, 2**-14)).all()
    assert (np.abs(direct.astype(float) - exact) <= allowed(dtype, spread, 2**-20)).all()


@pytest.mark.parametrize("dtype", BLENDED)
@pytest.mark.parametrize("border_mode", BORDERS)
def test_without_a_table_in_every_border_mode(dtype, border_mode):
    image, (x, y) = picture(dtype, 3), maps(5, beyond=WIDTH)
    fold = {
        "constant": lambda at, last: at,
        "replicate": lambda at, last: np.clip(at, 0, last),
        "reflect_101": lambda at, last: last - np.abs(last - np.mod(at, 2 * last)),
    }[border_mode]
    exact, spread = exact_bilinear(image, fold(x, WIDTH - 1), fold(y, HEIGHT - 1), border_of(dtype))
    got = ipm_rs.remap(image, x, y, border_mode=border_mode, border_value=border_of(dtype))
    assert (np.abs(got.astype(float) - exact) <= allowed(dtype, spread, 2**-20)).all()
    nearest = ipm_rs.remap(image, x, y, border_mode=border_mode, interpolation="nearest")
    assert nearest.dtype == dtype
    assert np.isin(nearest, np.append(image, 0)).all()


@pytest.mark.parametrize("dtype", BLENDED)
@pytest.mark.parametrize("inverse_map", [False, True])
def test_homographies_of_any_dtype(dtype, inverse_map):
    image, M = picture(dtype, 2), np.array([[0.9, 0.05, 2.5], [-0.04, 1.1, -1.25], [1e-3, -5e-4, 1]])
    j, i = np.meshgrid(np.arange(50), np.arange(40))
    u, v, w = np.einsum("ab,bij->aij", M if inverse_map else np.linalg.inv(M), [j, i, np.ones_like(i)])
    exact, spread = exact_bilinear(image, u / w, v / w, border_of(dtype))
    got = ipm_rs.warp_perspective(image, M, (50, 40), inverse_map=inverse_map, border_value=border_of(dtype))
    assert got.dtype == dtype
    assert (np.abs(got.astype(float) - exact) <= allowed(dtype, spread, 2**-20) + 1e-7).all()


def test_floats_without_a_table_are_better_than_one_can_be():
    image, (x, y) = picture("float64"), maps(3, beyond=-1)
    exact, spread = exact_bilinear(image, x, y)
    table = ipm_rs.Lut.from_maps(x, y, source_size=(WIDTH, HEIGHT)).warp(image)
    assert np.abs(table - exact).max() > 2**-18  # the table's fractions
    assert (np.abs(ipm_rs.remap(image, x, y) - exact) <= spread * 2**-40 + 4e-9).all()


def test_float32_just_below_a_pixel_is_not_rounded_to_it():
    image = np.array([[0, 1000, 0, 1000]] * 2, np.float32)
    x = np.array([[1 - 1e-5, 2 - 1e-5, 3 - 1e-5]])
    got = ipm_rs.remap(image, x, np.zeros_like(x))
    assert np.abs(got - [[999.99, 0.01, 999.99]]).max() < 1000 * 2**-20


def test_signed_integers_are_the_unsigned_ones_half_the_range_lower():
    x, y = maps(9)
    lut = ipm_rs.Lut.from_maps(x, y, source_size=(WIDTH, HEIGHT))
    minified = ipm_rs.Lut.from_homography(np.diag([4.5, 3.5, 1]), size=(13, 12), source_size=(WIDTH, HEIGHT))
    for signed, unsigned in (("int8", "uint8"), ("int16", "uint16")):
        image, top = picture(signed, 3), np.iinfo(signed).min
        lifted = image.view(unsigned) ^ np.array(top).astype(signed).view(unsigned)
        half = -int(top)
        for call in (
            lambda image, border: ipm_rs.remap(image, x, y, border_value=border),
            lambda image, border: lut.warp(image, border_value=border),
            lambda image, border: lut.warp(image, border_value=border, interpolation="nearest"),
            lambda image, border: minified.warp(image, border_value=border, interpolation="area"),
        ):
            assert (call(image, -5).astype(int) + half == call(lifted, half - 5)).all()


def test_ties_of_signed_integers_round_up():
    image = np.array([[-4, -3, 2, 3], [-4, -3, 2, 3]], np.int16)
    got = ipm_rs.remap(image, np.array([[0.5, 1.5, 2.5]]), np.zeros((1, 3)))
    assert got.tolist() == [[-3, 0, 3]]  # of -3.5, -0.5 and 2.5


def test_every_half_keeps_its_value():
    image = np.arange(2**16, dtype=np.uint16).view(np.float16).reshape(256, 256)
    x, y = np.meshgrid(np.arange(256.0), np.arange(256.0))
    # a pixel beside a NaN or an infinity is one of these, also where it has no weight
    calm = np.where(np.isfinite(image), image, np.float16(0))
    lut = ipm_rs.Lut.from_maps(x, y, source_size=(256, 256))
    for got in (lut.warp(calm), ipm_rs.remap(calm, x, y), lut.warp(calm, interpolation="area")):
        assert same(got + np.float16(0), calm + np.float16(0))  # -0 may become 0
    assert same(lut.warp(image, interpolation="nearest"), image)


def test_halves_are_rounded_to_even_as_numpy_does():
    image = np.random.default_rng(1).integers(0, 2**16, (64, 500), dtype=np.uint16).view(np.float16)
    image = np.where(np.isfinite(image), image, np.float16(1))
    x, y = np.meshgrid(np.arange(499) + 0.5, np.arange(64.0))
    wide = image.astype(np.float32)
    with np.errstate(over="ignore"):
        expected = (wide[:, :-1] + (wide[:, 1:] - wide[:, :-1]) * np.float32(0.5)).astype(np.float16)
    assert (ipm_rs.remap(image, x, y) == expected).all()
    assert (ipm_rs.Lut.from_maps(x, y, source_size=(500, 64)).warp(image) == expected).all()


def test_area_of_halves_is_that_of_float32_rounded_once():
    lut = ipm_rs.Lut.from_homography(np.diag([3.7, 2.9, 1]), size=(15, 14), source_size=(WIDTH, HEIGHT))
    for channels in (None, 1, 2, 3, 4, 5):
        image = picture("float16", channels)
        expected = lut.warp(image.astype(np.float32), interpolation="area", border_value=0.5).astype(np.float16)
        assert same(lut.warp(image, interpolation="area", border_value=0.5), expected)
        wide = image.astype(float) + 5e6
        exact = lut.warp(wide, interpolation="area", border_value=5e6)
        assert np.abs(exact - 5e6 - lut.warp(wide - 5e6, interpolation="area")).max() < 1e-7


@pytest.mark.parametrize("dtype", BLENDED)
@pytest.mark.parametrize("interpolation", ["bilinear", "nearest", "area"])
def test_layouts_strides_and_outputs_of_any_dtype(dtype, interpolation):
    x, y = maps(2)
    lut = ipm_rs.Lut.from_maps(x, y, source_size=(WIDTH, HEIGHT))
    batch = np.stack([picture(dtype, 3, seed) for seed in range(4)])
    options = {"interpolation": interpolation, "border_value": border_of(dtype) if dtype != "int8" else -3}
    expected = np.stack([lut.warp(image, **options) for image in batch])
    assert same(lut.warp(batch, layout="NHWC", **options), expected)
    planes = np.ascontiguousarray(batch.transpose(0, 3, 1, 2))
    assert same(lut.warp(planes, layout="NCHW", **options), np.ascontiguousarray(expected.transpose(0, 3, 1, 2)))
    padded = np.zeros((HEIGHT, WIDTH + 5, 3), dtype)[::-1, :WIDTH]
    padded[...] = batch[0]
    out = np.zeros((37, 31, 3), dtype)
    assert lut.warp(padded, out=out[:, :29], threads=3, **options).base is out
    assert same(out[:, :29].copy(), expected[0])
    assert (out[:, 29:] == 0).all()


@pytest.mark.parametrize("dtype", FLOATS)
def test_what_is_no_number_is_no_number_in_every_float(dtype):
    image = np.ones((4, 5), dtype)
    image[1, 2] = np.nan
    x, y = np.meshgrid(np.arange(8) * 0.5, np.arange(6) * 0.5)
    lut = ipm_rs.Lut.from_maps(x, y, source_size=(5, 4))
    table, direct = lut.warp(image), ipm_rs.remap(image, x, y)
    assert (np.isnan(table) == np.isnan(direct)).all()
    # any of the four pixels, also one without weight, but for the last column and row
    around = (x > 0.9) & (x < 3) & (y < 2)
    assert (np.isnan(table) == around).all()
    image[3, 0] = np.inf
    assert not np.isfinite(ipm_rs.remap(image, np.array([[0.0]]), np.array([[3.0]]))).any()


@pytest.mark.parametrize("interpolation", ["bilinear", "area"])
@pytest.mark.parametrize(
    ("dtype", "mend"),
    [
        ("bool", 'interpolation="{ids}"'),
        ("int32", "astype(numpy.float64)"),
        ("uint32", 'interpolation="{ids}"'),
        ("int64", "astype(numpy.float64)"),
        ("uint64", "ids"),
        ("complex64", "image.real"),
        ("longdouble", "astype(numpy.float64)"),
        ("V2", "astype(numpy.float32)"),
    ],
)
def test_what_is_not_blended_says_what_is(dtype, mend, interpolation):
    lut = ipm_rs.Lut.from_homography(np.eye(3), size=(5, 4), source_size=(5, 4))
    image, out = np.zeros((4, 5), dtype), np.full((4, 5), 1, dtype) if dtype != "V2" else None
    mend = mend.format(ids={"bilinear": "nearest", "area": "mode"}[interpolation])
    every = ["int8", "uint16", "int16", "float16", "float32", "float64", str(np.dtype(dtype)), mend]
    with refuses(errors.DtypeError, *every, out=out):
        lut.warp(image, interpolation=interpolation, out=out)
    if interpolation == "bilinear":
        with refuses(errors.DtypeError, *every):
            ipm_rs.remap(image, *np.zeros((2, 4, 5)))
        with refuses(errors.DtypeError, *every):
            ipm_rs.warp_perspective(image, np.eye(3), (5, 4))


def test_a_tensor_of_bfloat16_is_refused_by_name():
    class Tensor:
        dtype = "torch.bfloat16"

        def __dlpack_device__(self):
            return (1, 0)

        def __dlpack__(self, **options):
            raise BufferError("Unsupported dtype in DLTensor.")

        def __array__(self, *args, **options):
            raise TypeError("Got unsupported ScalarType BFloat16")

    lut = ipm_rs.Lut.from_homography(np.eye(3), size=(5, 4), source_size=(5, 4))
    for interpolation in ("bilinear", "nearest"):
        with refuses(errors.DtypeError, "image", "bfloat16", "float32"):
            lut.warp(Tensor(), interpolation=interpolation)


@pytest.mark.parametrize(
    ("dtype", "border", "words"),
    [
        ("int16", -32769, ["-32768 to 32767"]),
        ("int16", 0.5, ["whole number"]),
        ("int16", np.nan, ["whole number", "nan"]),
        ("int8", 128, ["-128 to 127"]),
        ("float16", 65520, ["65504", "6.5504e4"]),
        ("float64", 10**400, ["float64"]),
    ],
)
def test_border_values_that_a_dtype_cannot_hold(dtype, border, words):
    image = np.zeros((4, 5), dtype)
    for call in (
        lambda: ipm_rs.remap(image, *np.zeros((2, 4, 5)), border_value=border),
        lambda: ipm_rs.warp_perspective(image, np.eye(3), (5, 4), border_value=border),
        lambda: ipm_rs.Lut.from_homography(np.eye(3), size=(5, 4), source_size=(5, 4)).warp(image, border_value=border),
    ):
        with refuses(errors.ArgumentError, "border_value", dtype, words[-1]):
            call()


def test_outputs_of_another_dtype_are_refused():
    lut = ipm_rs.Lut.from_homography(np.eye(3), size=(5, 4), source_size=(5, 4))
    for dtype, other in (("int16", "uint16"), ("float16", "int16"), ("float64", "int64"), ("int8", "uint8")):
        out = np.ones((4, 5), other)
        for interpolation in ("bilinear", "nearest", "area"):
            with refuses(errors.DtypeError, "out", dtype, other, out=out):
                lut.warp(np.zeros((4, 5), dtype), interpolation=interpolation, out=out)


@pytest.mark.parametrize("channels", [None, 3, 4])
def test_opencv_agrees_on_int16_and_float64(channels):
    x, y = (entries.astype(np.float32) for entries in maps(4, beyond=-1))
    for dtype, near in (("int16", 1), ("float64", 3 / 32)):  # OpenCV rounds coordinates to 1/32 pixel unless it is SIMD
        image = picture(dtype, channels)
        if dtype == "int16":
            image //= 256
        image = image - (5e6 if dtype == "float64" else 0)
        image = cv2.GaussianBlur(image, (0, 0), 3).astype(dtype)
        theirs = cv2.remap(image, x, y, cv2.INTER_LINEAR)
        assert np.abs(ipm_rs.remap(image, x, y) - theirs).max() <= near + 0.5 * (dtype == "int16")
