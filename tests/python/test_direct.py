"""`remap` and `warp_perspective`: against OpenCV, the reference, and the table."""

import cv2
import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors, reference

CV_BORDERS = {
    "constant": cv2.BORDER_CONSTANT,
    "replicate": cv2.BORDER_REPLICATE,
    "reflect": cv2.BORDER_REFLECT,
    "reflect_101": cv2.BORDER_REFLECT_101,
    "wrap": cv2.BORDER_WRAP,
}
CV_MODES = {"bilinear": cv2.INTER_LINEAR, "nearest": cv2.INTER_NEAREST}
WIDTH, HEIGHT = 131, 97
BORDER = (7, 200, 90, 33)


def noise(channels, dtype=np.uint8, height=HEIGHT, width=WIDTH):
    shape = (height, width) if channels == 1 else (height, width, channels)
    values = np.random.default_rng(channels).integers(0, 256, shape)
    return values.astype(dtype) * (dtype(257) if dtype == np.uint16 else dtype(1))


def random_maps(seed, shape=(120, 90)):
    """Far outside, inside, on whole pixels and on halves."""
    rng = np.random.default_rng(seed)
    map_x = rng.uniform(-3 * WIDTH, 4 * WIDTH, shape).astype(np.float32)
    map_y = rng.uniform(-3 * HEIGHT, 4 * HEIGHT, shape).astype(np.float32)
    map_x[::2], map_y[::2] = rng.uniform(-2, WIDTH + 1, shape)[::2], rng.uniform(-2, HEIGHT + 1, shape)[::2]
    map_x[::5] = rng.integers(-10, 2 * WIDTH, map_x[::5].shape) / 2
    return map_x, map_y


def random_homography(seed):
    rng = np.random.default_rng(seed)
    return np.eye(3) + rng.normal(size=(3, 3)) * [[0.2, 0.2, 20], [0.2, 0.2, 20], [5e-4, 5e-4, 0]]


@pytest.mark.parametrize("border_mode", CV_BORDERS)
@pytest.mark.parametrize("interpolation", CV_MODES)
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_remap_equals_opencv_to_one_grey_level(channels, interpolation, border_mode):
    image = noise(channels)
    for seed in range(4):
        maps = random_maps(seed)
        options = {"border_mode": border_mode, "border_value": BORDER[:channels]}
        ours = ipm_rs.remap(image, *maps, interpolation=interpolation, **options)
        theirs = cv2.remap(
            image, *maps, CV_MODES[interpolation], borderMode=CV_BORDERS[border_mode], borderValue=BORDER[:channels]
        )
        assert np.abs(ours.astype(int) - theirs).max() <= (interpolation == "bilinear")
        assert len(np.unique(ours)) > 200


@pytest.mark.parametrize("border_mode", CV_BORDERS)
@pytest.mark.parametrize("inverse_map", [False, True])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_warp_perspective_equals_opencv_to_one_grey_level(channels, inverse_map, border_mode):
    image = noise(channels)
    for seed in range(6):
        matrix = random_homography(seed)
        dsize = (90, 120)
        flags = cv2.INTER_LINEAR | (cv2.WARP_INVERSE_MAP if inverse_map else 0)
        theirs = cv2.warpPerspective(
            image, matrix, dsize, flags=flags, borderMode=CV_BORDERS[border_mode], borderValue=BORDER[:channels]
        )
        ours = ipm_rs.warp_perspective(
            image, matrix, dsize, inverse_map=inverse_map, border_mode=border_mode, border_value=BORDER[:channels]
        )
        output_from_source = np.linalg.inv(matrix) if inverse_map else matrix
        columns, rows = np.meshgrid(np.arange(90), np.arange(120))
        q = np.linalg.inv(output_from_source) @ np.stack([columns.ravel(), rows.ravel(), np.ones(columns.size)])
        # far out OpenCV's float32 coordinates are the ones that are off: mirrored or repeated, they land anywhere
        near = (np.abs(q[:2] / q[2]) < 1000).all(0).reshape(rows.shape)
        assert near.mean() > 0.5
        compared = near if border_mode in ("reflect", "reflect_101", "wrap") else np.ones_like(near)
        assert np.abs(ours.astype(int) - theirs)[compared].max() <= 1


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.uint8, 0.52), (np.uint16, 3), (np.float32, 255 / 2**14)])
@pytest.mark.parametrize("channels", [1, 2, 5, 16])
def test_every_channel_count_is_held_to_the_exact_value(channels, dtype, tolerance):
    image = noise(channels, dtype)
    map_x, map_y = (entries.astype(np.float64) for entries in random_maps(channels))
    exact = reference.remap_bilinear(image.astype(np.float64), map_x, map_y, border_value=9)
    ours = ipm_rs.remap(image, map_x, map_y, border_value=9)
    assert ours.dtype == dtype
    assert np.abs(ours - exact).max() <= tolerance + 1e-4


@pytest.mark.parametrize("border_mode", CV_BORDERS)
@pytest.mark.parametrize("interpolation", CV_MODES)
def test_nan_and_infinite_entries_give_the_border_value_in_every_mode(interpolation, border_mode):
    map_x = np.array([[np.nan, 3, np.inf, -np.inf, 3.5]])
    map_y = np.array([[3, np.nan, 3, 3, 4.0]])
    ours = ipm_rs.remap(
        noise(3), map_x, map_y, interpolation=interpolation, border_mode=border_mode, border_value=BORDER[:3]
    )
    assert (ours[0, :4] == BORDER[:3]).all()
    assert (ours[0, 4] != BORDER[:3]).any()


@pytest.mark.parametrize("interpolation", CV_MODES)
def test_equals_the_table_bit_for_bit(interpolation):
    image, (map_x, map_y) = noise(3), random_maps(5)
    table = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(WIDTH, HEIGHT))
    expected = table.warp(image, interpolation=interpolation, border_value=11)
    for maps in [(map_x, map_y), (map_x.astype(float), map_y.astype(float)), (map_x[:, ::-1].copy()[:, ::-1], map_y)]:
        got = ipm_rs.remap(image, *maps, interpolation=interpolation, border_value=11)
        assert (got == expected).all()
    matrix = random_homography(3)
    table = ipm_rs.Lut.from_homography(matrix, size=(90, 120), source_size=(WIDTH, HEIGHT))
    got = ipm_rs.warp_perspective(image, matrix, (90, 120), inverse_map=True, interpolation=interpolation)
    assert (got == table.warp(image, interpolation=interpolation)).all()


@pytest.mark.parametrize("border_mode", CV_BORDERS)
def test_threads_and_out_change_nothing(border_mode):
    image, maps = noise(3), random_maps(6, (400, 300))
    expected = ipm_rs.remap(image, *maps, threads=1, border_mode=border_mode)
    out = np.full((400, 310, 3), 77, np.uint8)
    view = out[:, 5:305]
    assert ipm_rs.remap(image, *maps, threads=3, border_mode=border_mode, out=view) is view
    assert (view == expected).all()
    assert (out[:, :5] == 77).all() and (out[:, 305:] == 77).all()


def test_labels_of_any_dtype_keep_their_ids():
    maps = random_maps(7)
    for dtype in (np.bool_, np.int8, np.int16, np.int64, np.float16, np.float64):
        labels = (noise(1) % 2).astype(dtype)
        got = ipm_rs.remap(labels, *maps, interpolation="nearest", border_mode="reflect_101")
        assert got.dtype == dtype
        assert set(np.unique(got)) == {0, 1}


def test_sources_beyond_32767_pixels():
    image = noise(1, height=3, width=70_000)
    map_x = np.array([[0.0, 40_000.25, 65_535.5, 69_998.75, 69_999.0]])
    map_y = np.ones_like(map_x)
    exact = reference.remap_bilinear(image.astype(float), map_x, map_y)
    assert np.abs(ipm_rs.remap(image, map_x, map_y) - exact).max() <= 0.52
    tall = np.ascontiguousarray(image.T)
    assert np.abs(ipm_rs.remap(tall, map_y, map_x) - exact).max() <= 0.52
    shift = np.array([[1, 0, -60_000.5], [0, 1, 0], [0, 0, 1]])
    got = ipm_rs.warp_perspective(image, shift, (100, 3))
    assert np.abs(got - (image[:, 60_000:60_100].astype(float) + image[:, 60_001:60_101]) / 2).max() <= 0.52


def test_one_pixel_is_everywhere_what_it_is():
    one = np.full((1, 1, 3), 200, np.uint8)
    maps = random_maps(8)
    for border_mode in ("replicate", "reflect", "reflect_101", "wrap"):
        assert (ipm_rs.remap(one, *maps, border_mode=border_mode) == 200).all()


IMAGE = noise(3)
MAP_X, MAP_Y = random_maps(9)


def remap(*maps, image=IMAGE, **options):
    return lambda out: ipm_rs.remap(image, *(maps or (MAP_X, MAP_Y)), out=out, **options)


def perspective(matrix, dsize=(90, 120), **options):
    return lambda out: ipm_rs.warp_perspective(IMAGE, matrix, dsize, out=out, **options)


@pytest.mark.parametrize(
    ("call", "error", "phrases"),
    [
        (remap(MAP_X, MAP_Y[1:]), errors.LutError, ["map_y", "(119, 90)"]),
        (remap(MAP_X.astype(int), MAP_Y), errors.DtypeError, ["map_x", "float32"]),
        (remap(MAP_X, MAP_Y.astype(float)), errors.DtypeError, ["map_y"]),
        (remap(MAP_X.tolist(), MAP_Y), errors.ArgumentTypeError, ["map_x", "list"]),
        (remap(border_mode="mirror"), errors.ArgumentError, ["reflect_101", "mirror"]),
        (remap(border_mode=4), errors.ArgumentTypeError, ["border_mode", "int"]),
        (remap(interpolation="area"), errors.ArgumentError, ["bilinear", "area"]),
        (remap(threads=0), errors.ArgumentError, ["threads", "0"]),
        (remap(border_value=(1, 2)), errors.ArgumentError, ["3 channels", "2"]),
        (remap(image=IMAGE.astype(np.int32)), errors.DtypeError, ["uint8", "int32", "float64"]),
        (perspective(np.ones((3, 3))), errors.LutError, ["determinant"]),
        (perspective(np.eye(3) * np.nan), errors.LutError, ["NaN"]),
        (perspective(np.eye(2)), errors.ArgumentError, ["M", "(2, 2)"]),
        (perspective(np.eye(3), (0, 120)), errors.ArgumentError, ["dsize", "0 x 120"]),
        (perspective(np.eye(3), (90.5, 120)), errors.ArgumentTypeError, ["dsize"]),
        (perspective(np.eye(3), (2**40, 120)), errors.ArgumentError, ["dsize", "2^32"]),
        (perspective(np.eye(3), inverse_map=1), errors.ArgumentTypeError, ["inverse_map", "True or False", "int"]),
        (remap(MAP_X.astype("f2"), MAP_Y), errors.DtypeError, ["map_x", "float16", "astype"]),
    ],
)
def test_mistakes_are_refused_and_nothing_is_written(call, error, phrases):
    out = np.full((120, 90, 3), 7, np.uint8)
    with refuses(error, *phrases, out=out):
        call(out)


def test_outputs_that_do_not_fit():
    with refuses(errors.ImageError, "out: expected shape (120, 90, 3)", "(90, 120, 3)"):
        perspective(np.eye(3))(np.empty((90, 120, 3), np.uint8))
    with refuses(errors.ImageError, "out", "memory"):
        perspective(np.eye(3), (WIDTH, HEIGHT))(IMAGE)
    with refuses(errors.LutError, "40000 x 40000 cells"):
        perspective(np.eye(3), (40_000, 40_000))(None)
