"""layout=: planar images and batches through one call, against one call for each image."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses, same, textured

import ipm_rs
from ipm_rs import errors

HEIGHT, WIDTH = 40, 50
ROWS, COLUMNS = 60, 70
AXES = ["CHW", "NHWC", "NCHW"]


@pytest.fixture(scope="module")
def lut() -> ipm_rs.Lut:
    """A turned, scaled view of a 50 x 40 image, with halo and outside."""
    rows, columns = np.mgrid[0:ROWS, 0:COLUMNS].astype(np.float64)
    return ipm_rs.Lut.from_maps(
        0.8 * columns + 0.21 * rows - 6.3, 0.7 * rows - 0.13 * columns + 2.2, source_size=(WIDTH, HEIGHT)
    )


def batch(layout: str, count: int, channels: int, dtype: str = "uint8") -> tuple[np.ndarray, list[np.ndarray]]:
    """An array in a layout, and the same images one by one as (H, W, C)."""
    if "N" not in layout:
        count = 1
    images = [textured(HEIGHT, WIDTH, channels, dtype, seed=seed) for seed in range(count)]
    stacked = np.stack(images)  # NHWC
    if layout in ("CHW", "NCHW"):
        stacked = stacked.transpose(0, 3, 1, 2)
    return np.ascontiguousarray(stacked if "N" in layout else stacked[0]), images


def as_images(layout: str, array: np.ndarray) -> list[np.ndarray]:
    """The images of an array in a layout, one by one as contiguous (H, W, C)."""
    array = array if "N" in layout else array[np.newaxis]
    if layout in ("CHW", "NCHW"):
        array = array.transpose(0, 2, 3, 1)
    return [np.ascontiguousarray(image) for image in array]


@pytest.mark.parametrize("layout", AXES)
@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("channels", [1, 3, 5])
@pytest.mark.parametrize(
    ("dtype", "interpolation"),
    [
        ("uint8", "bilinear"),
        ("uint16", "bilinear"),
        ("float32", "bilinear"),
        ("uint8", "nearest"),
        ("int64", "nearest"),
    ],
)
def test_every_image_is_warped_as_alone(lut, layout, count, channels, dtype, interpolation):
    array, images = batch(layout, count, channels, dtype)
    border = list(range(3, 3 + channels))
    options = {"interpolation": interpolation, "border_value": border}
    expected = [lut.warp(image, **options) for image in images]
    for threads in (1, 3):
        got = lut.warp(array, layout=layout, threads=threads, **options)
        assert got.dtype == array.dtype and got.flags.c_contiguous
        assert all(map(same, as_images(layout, got), expected))
    assert got.shape == tuple({"H": ROWS, "W": COLUMNS, "C": channels, "N": len(images)}[axis] for axis in layout)
    out = np.full_like(got, 77)
    assert lut.warp(array, layout=layout, out=out, **options) is out
    assert same(out, got)


def test_hwc_is_the_default(lut):
    image = textured(HEIGHT, WIDTH, 3)
    assert same(lut.warp(image, layout="HWC"), lut.warp(image))
    assert same(lut.warp(image[..., 0].copy(), layout="HWC"), lut.warp(image[..., 0].copy()))


def test_one_border_value_serves_all_planes(lut):
    array, images = batch("NCHW", 3, 4)
    got = lut.warp(array, layout="NCHW", border_value=201)
    assert all(map(same, as_images("NCHW", got), [lut.warp(image, border_value=201) for image in images]))
    assert (got == 201).any()


@pytest.mark.parametrize("layout", AXES)
def test_an_identity_table_gives_the_array_back(layout):
    """Nothing is transposed on the way, also where height, width and channels could be taken for each other."""
    map_x, map_y = np.meshgrid(np.arange(3.0), np.arange(3.0))
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(3, 3))
    array = np.arange(81, dtype=np.uint8).reshape(3, 3, 3, 3)
    array = array if "N" in layout else array[1]
    for interpolation in ("nearest", "bilinear"):
        assert same(lut.warp(array, layout=layout, interpolation=interpolation), np.ascontiguousarray(array))


# ---------------------------------------------------------------------------------------------------------------------
# strides

NCHW_VIEWS = {
    "crop of a larger batch": lambda: textured(9 * 8 * 100, 130).reshape(9, 8, 100, 130)[2:7, 1:4, 30:70, 17:67],
    "every second plane": lambda: textured(5 * 6 * 40, 50).reshape(5, 6, 40, 50)[:, ::2],
    "planes from bgr": lambda: textured(5 * 3 * 40, 50).reshape(5, 3, 40, 50)[:, ::-1],
    "batch backwards": lambda: textured(5 * 3 * 40, 50).reshape(5, 3, 40, 50)[::-1],
    "rows upside down": lambda: textured(5 * 3 * 40, 50).reshape(5, 3, 40, 50)[:, :, ::-1],
    "one image for all": lambda: np.broadcast_to(textured(3 * 40, 50).reshape(3, 40, 50), (5, 3, 40, 50)),
    "one plane for all": lambda: np.broadcast_to(textured(40, 50), (5, 3, 40, 50)),
    "planes before images": lambda: textured(5 * 3 * 40, 50).reshape(3, 5, 40, 50).transpose(1, 0, 2, 3),
    "row by row": lambda: textured(40 * 5 * 3, 50).reshape(40, 5, 3, 50).transpose(1, 2, 0, 3),
    "one plane each": lambda: textured(5 * 7 * 40, 50).reshape(5, 7, 40, 50)[:, 3:4],
}


@pytest.mark.parametrize("view", NCHW_VIEWS)
def test_any_stride_between_planes_images_and_rows(lut, view):
    array = NCHW_VIEWS[view]()
    border = [7] * array.shape[1]
    expected = lut.warp(np.ascontiguousarray(array), layout="NCHW", border_value=border)
    assert same(lut.warp(array, layout="NCHW", border_value=border), expected)
    assert same(lut.warp(array[1], layout="CHW", border_value=border), expected[1])
    assert len(np.unique(expected)) > 20


@pytest.mark.parametrize("view", ["crop of a larger batch", "every second image", "batch backwards"])
def test_any_stride_between_interleaved_images(lut, view):
    big = textured(8 * 100, 130 * 3).reshape(8, 100, 130, 3)
    array = {
        "crop of a larger batch": big[2:7, 30:70, 17:67],
        "every second image": big[::2, :40, :50],
        "batch backwards": big[::-1, 5:45, :50],
    }[view]
    assert same(lut.warp(array, layout="NHWC"), lut.warp(np.ascontiguousarray(array), layout="NHWC"))


@pytest.mark.parametrize("axes", [(0, 1, 2, 3), (1, 0, 2, 3), (2, 0, 1, 3), (2, 1, 0, 3), (0, 2, 1, 3)], ids=str)
@pytest.mark.parametrize("backwards", [False, True])
def test_out_may_be_strided_too_and_nothing_else_is_written(lut, axes, backwards):
    array, _ = batch("NCHW", 4, 3)
    expected = lut.warp(array, layout="NCHW", border_value=9)
    # a canvas whose first three axes are N, C, H in any order, with gaps in each
    lengths = [(4, 3, ROWS, COLUMNS)[axis] for axis in axes]
    canvas = textured(1, int(np.prod(lengths)) * 16).reshape([2 * length for length in lengths])
    window = tuple(
        slice(1, None, 2) if axis != 3 else slice(5, 5 + length) for axis, length in zip(axes, lengths, strict=True)
    )
    out = canvas[window].transpose(np.argsort(axes))
    out = out[::-1, :, ::-1] if backwards else out
    assert out.shape == expected.shape
    before = canvas.copy()
    assert lut.warp(array, layout="NCHW", border_value=9, out=out, threads=2) is out
    np.testing.assert_array_equal(out, expected)
    canvas[window] = before[window]
    assert same(canvas, before)


def test_nothing_is_copied():
    """Planes of 4 GB that are one row: a copy would take long and much."""
    row = textured(1, 60_000)
    columns = np.linspace(0, 59_999, 100).round()
    lut = ipm_rs.Lut.from_maps(
        columns[np.newaxis], np.linspace(0, 64_999, 100).round()[np.newaxis], source_size=(60_000, 65_000)
    )
    for layout in ("CHW", "NHWC", "NCHW"):
        shape = {"CHW": (20, 65_000, 60_000), "NHWC": (20, 65_000, 60_000, 1), "NCHW": (4, 5, 65_000, 60_000)}[layout]
        image = np.broadcast_to(row[..., np.newaxis] if layout == "NHWC" else row, shape)
        got = lut.warp(image, layout=layout).reshape(20, 100)
        np.testing.assert_array_equal(got, np.broadcast_to(row[:, columns.astype(int)], (20, 100)))


def test_many_small_planes_and_few_large_ones(seed_lut):
    small = ipm_rs.Lut.from_maps(*(m + 0.25 for m in np.meshgrid(np.arange(5.0), np.arange(4.0))), source_size=(7, 6))
    planes = textured(1000 * 6, 7).reshape(1000, 6, 7)
    expected = np.stack([small.warp(plane, threads=1) for plane in planes])
    for threads in (1, 2, 7):
        assert same(small.warp(planes, layout="CHW", threads=threads), expected)
    large = textured(3 * 1024, 2048).reshape(3, 1024, 2048)
    expected = np.stack([seed_lut.warp(plane, threads=1) for plane in large])
    for threads in (1, 2, 7):
        assert same(seed_lut.warp(large, layout="CHW", threads=threads), expected)


# ---------------------------------------------------------------------------------------------------------------------
# refusals


@pytest.mark.parametrize(
    ("layout", "shape", "expected"),
    [
        ("HWC", (2, 40, 50, 3), "(H, W) or (H, W, C)"),
        ("CHW", (40, 50), "(C, H, W)"),
        ("CHW", (2, 3, 40, 50), "(C, H, W)"),
        ("NHWC", (40, 50, 3), "(N, H, W, C)"),
        ("NHWC", (1, 1, 40, 50, 3), "(N, H, W, C)"),
        ("NCHW", (40, 50), "(N, C, H, W)"),
        ("NCHW", (3, 40, 50), "(N, C, H, W)"),
    ],
)
def test_wrong_number_of_axes_names_layout_and_shape(lut, layout, shape, expected):
    with refuses(errors.ImageError, "image", f'layout="{layout}"', expected, f"got {shape}"):
        lut.warp(np.zeros(shape, np.uint8), layout=layout)


@pytest.mark.parametrize(
    ("layout", "shape", "other"),
    [
        ("HWC", (3, 40, 50), "CHW"),
        ("CHW", (40, 50, 3), "HWC"),
        ("NHWC", (2, 3, 40, 50), "NCHW"),
        ("NCHW", (2, 40, 50, 3), "NHWC"),
    ],
)
def test_a_shape_of_another_layout_is_recognised(lut, layout, shape, other):
    with refuses(errors.ImageError, "image", f'layout="{layout}"', str(shape), f'fits layout="{other}"', "50x40"):
        lut.warp(np.zeros(shape, np.uint8), layout=layout)


@pytest.mark.parametrize("layout", AXES)
def test_another_size(lut, layout):
    shape = {"CHW": (3, 41, 50), "NHWC": (2, 41, 50, 3), "NCHW": (2, 3, 41, 50)}[layout]
    with refuses(errors.ImageError, "image is 50x41", "50x40", "resized"):
        lut.warp(np.zeros(shape, np.uint8), layout=layout)


@pytest.mark.parametrize(
    ("layout", "shape"),
    [
        ("CHW", (0, 40, 50)),
        ("CHW", (3, 40, 0)),
        ("NHWC", (0, 40, 50, 3)),
        ("NHWC", (2, 40, 50, 0)),
        ("NCHW", (0, 3, 40, 50)),
        ("NCHW", (2, 0, 40, 50)),
    ],
)
def test_empty_axes(lut, layout, shape):
    with refuses(errors.ImageError, "image", "at least one", str(shape)):
        lut.warp(np.zeros(shape, np.uint8), layout=layout)


@pytest.mark.parametrize("name", ["hwc", "HCW", "NCHWC", "", "CHW "])
def test_unknown_layout(lut, name):
    with refuses(errors.ArgumentError, "layout", "HWC", "NCHW", repr(name)[1:-1]):
        lut.warp(np.zeros((40, 50), np.uint8), layout=name)


@pytest.mark.parametrize("value", [0, b"HWC", ["HWC"]], ids=repr)
def test_layout_is_a_name(lut, value):
    with refuses(errors.ArgumentTypeError, "layout", "NHWC", type(value).__name__):
        lut.warp(np.zeros((40, 50), np.uint8), layout=value)


@pytest.mark.parametrize("layout", AXES)
@pytest.mark.parametrize("values", [0, 2, 4, 6])
def test_border_value_is_one_or_one_for_each_channel(lut, layout, values):
    """Also where planes are as many as a multiple of the values."""
    array, _ = batch(layout, 4, 3)
    with refuses(errors.ArgumentError, "border_value", "3", str(values)):
        lut.warp(array, layout=layout, border_value=[1] * values)


def test_interleaved_images_are_no_planes(lut):
    image = textured(HEIGHT, WIDTH, 3)
    with refuses(errors.ImageError, "adjacent", "ascontiguousarray(image)"):
        lut.warp(image.transpose(2, 0, 1), layout="CHW")
    with refuses(errors.ImageError, "adjacent", 'layout="CHW"', "ascontiguousarray(image)"):
        lut.warp(textured(3 * HEIGHT, WIDTH).reshape(3, HEIGHT, WIDTH).transpose(1, 2, 0))


def test_out_of_another_shape(lut):
    array, _ = batch("NCHW", 2, 3)
    for shape in [(2, ROWS, COLUMNS, 3), (3, 3, ROWS, COLUMNS), (2, 3, ROWS, COLUMNS + 1), (3, ROWS, COLUMNS)]:
        out = np.full(shape, 7, np.uint8)
        with refuses(errors.ImageError, f"out: expected shape (2, 3, {ROWS}, {COLUMNS}), got {shape}", out=out):
            lut.warp(array, layout="NCHW", out=out)


def test_out_whose_planes_overlap(lut):
    array, _ = batch("NCHW", 2, 3)
    raw = np.full(2 * 3 * ROWS * COLUMNS * 2, 7, np.uint8)
    plane = ROWS * COLUMNS
    for strides in [
        (3 * plane, plane - 1, COLUMNS, 1),
        (2 * plane, plane, COLUMNS, 1),
        (0, plane, COLUMNS, 1),
        (3 * plane, 0, COLUMNS, 1),
        (3 * plane, plane, COLUMNS - 1, 1),
        (COLUMNS, COLUMNS, 6 * COLUMNS, 1),
    ]:
        out = np.lib.stride_tricks.as_strided(raw, (2, 3, ROWS, COLUMNS), strides)
        with refuses(errors.ImageError, "out", "overlap", out=raw):
            lut.warp(array, layout="NCHW", out=out)


def test_out_overlaps_one_image_of_the_batch():
    map_x, map_y = np.meshgrid(np.arange(8.0)[::-1], np.arange(4.0))
    flip = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 4))
    big = textured(6 * 4, 8).reshape(6, 4, 8)
    with refuses(errors.ImageError, "out", "memory", out=big):
        flip.warp(big[:4], layout="CHW", out=big[2:])
    assert same(flip.warp(big[:3], layout="CHW", out=big[3:]), big[:3, :, ::-1].copy())
