"""Values of the warp: against the reference, OpenCV and exact arithmetic, cell by cell."""

from __future__ import annotations

import cv2
import golden
import numpy as np
import pytest
from helpers import exact_bilinear, same, textured
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import reference

CV2 = {"nearest": cv2.INTER_NEAREST, "bilinear": cv2.INTER_LINEAR}
REFERENCE = {"nearest": reference.remap_nearest, "bilinear": reference.remap_bilinear}
BORDERS = {None: 137, 1: (137,), 3: (9, 200, 77), 4: (9, 200, 77, 31)}


@pytest.fixture(scope="module")
def seed_maps():
    """Exact float64 source coordinates of the seed grid; NaN where a cell sees nothing."""
    xy = reference.grid_xy(golden.GRID_X, golden.GRID_Y, golden.GRID_RESOLUTION, "corner")
    return reference.maps(golden.K, golden.RT, golden.IMAGE_SIZE, xy)


@pytest.fixture(scope="module")
def edge_maps():
    """Coordinates in, on and just beyond a 23 x 17 image, dense at the edges, with some that are no number."""
    random = np.random.default_rng(5)
    map_x = random.uniform(-2.5, 24.5, (120, 130))
    map_y = random.uniform(-2.5, 18.5, (120, 130))
    map_x[:10], map_y[10:20] = 22.0, 16.0
    map_x[20:30], map_y[30:40] = 0.0, 0.0
    map_x[40:60] = np.round(map_x[40:60] * 2) / 2
    map_y[50:70] = np.round(map_y[50:70] * 2) / 2
    map_x[70, :40] = np.nan
    map_y[70, 30:60] = np.inf
    map_x[70, 60:80] = -np.inf
    map_x[70, 80:100] = 1e300
    return map_x, map_y


def differs(a, b) -> np.ndarray:
    return np.abs(a.astype(np.int64) - b.astype(np.int64))


# ---------------------------------------------------------------------------------------------------------------------
# 8 bits: reference and OpenCV


@pytest.mark.parametrize("interpolation", CV2)
@pytest.mark.parametrize("channels", BORDERS)
def test_seed_geometry_is_cv2_and_the_reference(seed_lut, seed_maps, channels, interpolation):
    image = textured(1024, 2048, channels)
    border = BORDERS[channels]
    ours = seed_lut.warp(image, interpolation=interpolation, border_value=border)
    assert (ours.shape, ours.dtype) == ((860, 800, *image.shape[2:]), np.uint8)

    expected = REFERENCE[interpolation](image, *seed_maps, border)
    step = 0 if interpolation == "nearest" else 1
    assert differs(ours, expected).max() <= step, "every cell, valid, halo and outside"

    theirs = cv2.remap(
        image,
        *seed_lut.maps(outside=-9),
        CV2[interpolation],
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=border if channels else (border,) * 4,
    ).reshape(ours.shape)
    assert differs(ours, theirs).max() <= step, "every cell, valid, halo and outside"

    outside = np.isnan(seed_maps[0])
    assert outside.sum() > 100_000 and (ours[outside] == border).all()
    assert len(np.unique(ours[seed_lut.mask])) == 256


@pytest.mark.parametrize("interpolation", CV2)
@pytest.mark.parametrize("channels", BORDERS)
def test_edges_are_cv2_and_the_reference(edge_maps, channels, interpolation):
    image = textured(17, 23, channels, seed=2)
    border = BORDERS[channels]
    lut = ipm_rs.Lut.from_maps(*edge_maps, source_size=(23, 17))
    ours = lut.warp(image, interpolation=interpolation, border_value=border)
    step = 0 if interpolation == "nearest" else 1
    assert differs(ours, REFERENCE[interpolation](image, *edge_maps, border)).max() <= step
    theirs = cv2.remap(
        image,
        *lut.maps(outside=-9),
        CV2[interpolation],
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=border if channels else (border,) * 4,
    ).reshape(ours.shape)
    assert differs(ours, theirs).max() <= step
    halo = ~np.isnan(lut.maps()[0]) & ~lut.mask
    assert halo.sum() > 1000


def test_eight_bits_are_the_nearest_level_but_for_close_calls(seed_lut, seed_maps):
    image = textured(1024, 2048)
    exact, _ = exact_bilinear(image, *(np.nan_to_num(m, nan=-9.0) for m in seed_maps), 137)
    ours = seed_lut.warp(image, border_value=137)
    assert np.abs(ours - exact).max() < 0.52
    rounded = np.floor(exact + 0.5) == ours
    assert rounded.mean() > 0.997


@given(
    st.integers(1, 24),
    st.integers(1, 24),
    st.integers(1, 40),
    st.integers(1, 40),
    st.sampled_from([None, 1, 2, 3, 4, 5, 16]),
    st.sampled_from(["nearest", "bilinear"]),
    st.integers(0, 2**32 - 1),
)
def test_any_maps_any_size(width, height, rows, columns, channels, interpolation, seed):
    random = np.random.default_rng(seed)
    image = textured(height, width, channels, seed=seed)
    map_x = random.uniform(-2, width + 1, (rows, columns))
    map_y = random.uniform(-2, height + 1, (rows, columns))
    on_grid = random.random((rows, columns)) < 0.3
    map_x[on_grid], map_y[on_grid] = np.round(map_x[on_grid] * 2) / 2, np.round(map_y[on_grid] * 2) / 2
    bad = random.random((rows, columns)) < 0.05
    map_x[bad] = random.choice([np.nan, np.inf, -np.inf, 1e308], bad.sum())
    border = random.integers(0, 256, channels or 1).tolist() if channels else int(random.integers(0, 256))
    ours = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(width, height)).warp(
        image, interpolation=interpolation, border_value=border
    )
    expected = REFERENCE[interpolation](image, map_x, map_y, border)
    assert ours.shape == expected.shape
    assert differs(ours, expected).max() <= (0 if interpolation == "nearest" else 1)


# ---------------------------------------------------------------------------------------------------------------------
# 16 bits, floats, other channel counts: the exact value


@pytest.mark.parametrize("channels", [None, 1, 2, 3, 4, 5, 16])
def test_sixteen_bits_are_within_three_of_65535(edge_maps, seed_lut, seed_maps, channels):
    scenes = [(edge_maps, ipm_rs.Lut.from_maps(*edge_maps, source_size=(23, 17)), (17, 23))]
    if channels in (None, 3):
        scenes.append((seed_maps, seed_lut, (1024, 2048)))
    for maps, lut, (height, width) in scenes:
        image = textured(height, width, channels, "uint16", seed=3)
        border = list(range(1000, 60000, 3700))[: channels or 1]
        finite = [np.nan_to_num(m, nan=-9.0, posinf=-9.0, neginf=-9.0) for m in maps]
        exact, _ = exact_bilinear(image, *finite, np.array(border) if channels else border[0])
        ours = lut.warp(image, border_value=border if channels else border[0])
        assert (ours.shape, ours.dtype) == (exact.shape, np.uint16)
        assert np.abs(ours - exact).max() <= 3
        assert differs(ours, reference.remap_bilinear(image, *maps, border if channels else border[0])).max() <= 3


@pytest.mark.parametrize("channels", [None, 1, 2, 3, 4, 5, 16])
@pytest.mark.parametrize("scale", [1.0, 1e-30, 1e30])
def test_floats_are_within_2_14_of_the_range_of_their_taps(edge_maps, channels, scale):
    image = (textured(17, 23, channels, "float32", seed=4) * np.float32(scale)).astype(np.float32)
    border = (np.linspace(-150, 150, channels or 1) * scale).astype(np.float32)
    border = border if channels else border[0]
    finite = [np.nan_to_num(m, nan=-9.0, posinf=-9.0, neginf=-9.0) for m in edge_maps]
    exact, spread = exact_bilinear(image, *finite, border.astype(np.float64))
    lut = ipm_rs.Lut.from_maps(*edge_maps, source_size=(23, 17))
    ours = lut.warp(image, border_value=border.tolist())
    assert (ours.shape, ours.dtype) == (exact.shape, np.float32)
    assert np.isfinite(ours).all()
    error = np.abs(ours.astype(np.float64) - exact)
    rounding = 4 * np.spacing(np.abs(image).max())
    assert (error <= spread * 2**-14 + rounding).all(), (error - spread * 2**-14).max()


def test_floats_on_the_seed_geometry(seed_lut, seed_maps):
    image = textured(1024, 2048, None, "float32")
    exact, spread = exact_bilinear(image, *(np.nan_to_num(m, nan=-9.0) for m in seed_maps), -7.0)
    ours = seed_lut.warp(image, border_value=-7)
    assert (np.abs(ours - exact) <= spread * 2**-14 + 1e-5).all()
    assert (ours[np.isnan(seed_maps[0])] == -7).all()


@pytest.mark.parametrize("channels", [2, 5, 16])
def test_eight_bits_with_other_channel_counts(edge_maps, channels):
    image = textured(17, 23, channels, seed=6)
    border = list(range(250, 0, -15))[:channels]
    finite = [np.nan_to_num(m, nan=-9.0, posinf=-9.0, neginf=-9.0) for m in edge_maps]
    exact, _ = exact_bilinear(image, *finite, np.array(border))
    ours = ipm_rs.Lut.from_maps(*edge_maps, source_size=(23, 17)).warp(image, border_value=border)
    assert np.abs(ours - exact).max() < 0.52


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_channels_do_not_mix(edge_maps, dtype):
    """Each channel alone gives what it gives among others: no kernel is special."""
    image = textured(17, 23, 16, dtype, seed=7)
    border = list(range(16))
    lut = ipm_rs.Lut.from_maps(*edge_maps, source_size=(23, 17))
    for interpolation in CV2:
        for channels in (1, 2, 3, 4, 5, 16):
            part = np.ascontiguousarray(image[:, :, :channels])
            together = lut.warp(part, interpolation=interpolation, border_value=border[:channels])
            for channel in range(channels):
                alone = lut.warp(
                    np.ascontiguousarray(image[:, :, channel]),
                    interpolation=interpolation,
                    border_value=border[channel],
                )
                np.testing.assert_array_equal(together[:, :, channel], alone)


# ---------------------------------------------------------------------------------------------------------------------
# Answers one can do in the head


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("interpolation", CV2)
@pytest.mark.parametrize("shift", [(0, 0), (3, 0), (0, 2), (-4, 1), (100, 0)])
def test_whole_shifts_are_exact(dtype, interpolation, shift):
    image = textured(13, 19, 3, dtype)
    dx, dy = shift
    map_x, map_y = np.meshgrid(np.arange(19.0) + dx, np.arange(13.0) + dy)
    out = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(19, 13)).warp(
        image, interpolation=interpolation, border_value=(1, 2, 3)
    )
    expected = np.empty_like(image)
    expected[:] = np.array([1, 2, 3], dtype=dtype)
    for row in range(13):
        for column in range(19):
            if 0 <= row + dy < 13 and 0 <= column + dx < 19:
                expected[row, column] = image[row + dy, column + dx]
    assert same(out, expected)


def test_halves_average_and_ties_round_up():
    image = np.array([[10, 20, 31], [40, 50, 61]], dtype=np.uint8)
    lut = ipm_rs.Lut.from_maps(np.array([[0.5, 1.5, 0.0, 0.5]]), np.array([[0.0, 0.0, 0.5, 0.5]]), source_size=(3, 2))
    np.testing.assert_array_equal(lut.warp(image), [[15, 26, 25, 30]])  # 25.5 goes up
    np.testing.assert_array_equal(lut.warp(image.astype(np.float32)), [[15, 25.5, 25, 30]])
    np.testing.assert_array_equal(lut.warp(image.astype(np.uint16) * 257), [[3855, 6554, 6425, 7710]])


def test_halo_blends_with_the_border():
    image = np.full((2, 3), 200, np.uint8)
    us = np.array([[-0.5, -0.25, -0.75, -1.0, 2.5, 2.75, 3.0, 1.0]])
    lut = ipm_rs.Lut.from_maps(us, np.zeros_like(us), source_size=(3, 2))
    np.testing.assert_array_equal(lut.warp(image, border_value=0), [[100, 150, 50, 0, 100, 50, 0, 200]])
    np.testing.assert_array_equal(lut.warp(image, border_value=100), [[150, 175, 125, 100, 150, 125, 100, 200]])
    corner = ipm_rs.Lut.from_maps(np.array([[-0.5]]), np.array([[1.5]]), source_size=(3, 2))
    assert corner.warp(image, border_value=0) == 50


def test_nearest_rounds_halves_to_even():
    image = np.array([[10, 20, 30, 40]], dtype=np.uint8)
    us = np.array([[-0.5, 0.5, 1.5, 2.5, 3.5, -0.500001, 3.499999, 3.500001]])
    lut = ipm_rs.Lut.from_maps(us, np.zeros_like(us), source_size=(4, 1))
    np.testing.assert_array_equal(
        lut.warp(image, interpolation="nearest", border_value=7), [[10, 10, 30, 30, 7, 7, 40, 7]]
    )


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, -1e300])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("interpolation", CV2)
def test_map_entries_that_are_no_place_give_the_border(value, dtype, interpolation):
    with np.errstate(over="ignore"):
        value = np.dtype(dtype).type(value)
    bad = np.array([[value, 1.0, value, 1.0]], dtype=dtype)
    lut = ipm_rs.Lut.from_maps(bad, bad[:, [1, 0, 0, 1]], source_size=(3, 3))
    image = np.full((3, 3), 200, np.uint8)
    np.testing.assert_array_equal(lut.warp(image, interpolation=interpolation, border_value=9), [[9, 9, 9, 200]])
    np.testing.assert_array_equal(lut.mask, [[False, False, False, True]])


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (1, 2), (2, 1)], ids=str)
@pytest.mark.parametrize("channels", [None, 1, 3, 4])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_the_smallest_images(shape, channels, dtype):
    height, width = shape
    image = textured(height, width, channels, dtype)
    map_x, map_y = np.meshgrid(np.linspace(-1.2, width + 0.2, 23), np.linspace(-1.2, height + 0.2, 23))
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(width, height))
    np.testing.assert_array_equal(
        lut.warp(image, interpolation="nearest", border_value=5), reference.remap_nearest(image, map_x, map_y, 5)
    )
    expected = reference.remap_bilinear(image, map_x, map_y, 5)
    ours = lut.warp(image, border_value=5)
    tolerance = {"uint8": 1, "uint16": 3, "float32": 0.03}[dtype]
    np.testing.assert_allclose(ours.astype(float), expected.astype(float), rtol=0, atol=tolerance)


def test_a_border_of_nan_marks_the_outside_and_leaves_valid_cells_alone():
    """Also on the last row and column, where two of the four pixels do not exist but have no weight."""
    image = textured(6, 8, None, "float32")
    map_x, map_y = np.meshgrid(np.arange(-2.0, 10, 0.5), np.arange(-2.0, 8, 0.5))
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 6))
    out = lut.warp(image, border_value=np.nan)
    np.testing.assert_array_equal(np.isnan(out), ~lut.mask)
    assert lut.mask[map_x == 7].any() and lut.mask[map_y == 5].any()


def test_a_nan_pixel_reaches_its_neighbours_alone():
    """As in OpenCV: the cells whose four pixels it is one of, whatever its weight."""
    image = textured(6, 8, None, "float32")
    image[2, 3] = np.nan
    map_x, map_y = np.meshgrid(np.arange(0, 7.5, 0.5), np.arange(0, 5.5, 0.5))
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 6))
    out = lut.warp(image)
    near = (np.floor(map_x) >= 2) & (np.floor(map_x) <= 3) & (np.floor(map_y) >= 1) & (np.floor(map_y) <= 2)
    weighs = (np.abs(map_x - 3) < 1) & (np.abs(map_y - 2) < 1)
    assert near.sum() == 16 and weighs.sum() == 9
    assert np.isnan(out[weighs]).all() and not np.isnan(out[~near]).any()
    theirs = cv2.remap(image, *lut.maps(), cv2.INTER_LINEAR)
    np.testing.assert_array_equal(np.isnan(out), np.isnan(theirs))
    clean = lut.warp(np.nan_to_num(image))
    np.testing.assert_array_equal(out[~near], clean[~near])


# ---------------------------------------------------------------------------------------------------------------------
# Labels and dtypes under nearest

NEAREST_DTYPES = [
    "bool", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float16", "float32", "float64",
]  # fmt: skip


@pytest.mark.parametrize("dtype", NEAREST_DTYPES)
@pytest.mark.parametrize("channels", [None, 1, 3, 7])
def test_nearest_of_every_dtype(edge_maps, dtype, channels):
    image = textured(17, 23, channels, dtype, seed=8)
    lut = ipm_rs.Lut.from_maps(*edge_maps, source_size=(23, 17))
    ours = lut.warp(image, interpolation="nearest", border_value=1)
    assert same(ours, reference.remap_nearest(image, *edge_maps, 1))


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int32", "int64"])
def test_labels_keep_exactly_their_ids(seed_lut, dtype):
    ids = np.array([0, 7, 11, 23, 26, 33, 255 if dtype == "uint8" else 30_000], dtype=dtype)
    image = ids[np.random.default_rng(9).integers(0, len(ids), (1024, 2048))]
    bev = seed_lut.warp(image, interpolation="nearest", border_value=33)
    assert set(np.unique(bev)) == set(ids.tolist())
    assert (bev[~seed_lut.mask] == 33).mean() > 0.99


@pytest.mark.parametrize(
    ("dtype", "border"),
    [
        ("bool", True),
        ("int8", -128),
        ("uint64", 2**64 - 1),
        ("int64", -(2**63)),
        ("int64", 2**63 - 1),
        ("int64", 2**53 + 1),
        ("float16", 65504.0),
        ("float64", 1e300),
        ("float64", np.inf),
        ("float32", -np.inf),
        ("uint8", 255),
        ("uint8", np.uint8(255)),
        ("uint16", 65535),
        ("float64", 0.1),
        ("float32", 0.1),
    ],
)
def test_border_values_at_the_limits_of_their_dtype(dtype, border):
    image = np.zeros((2, 2), dtype)
    lut = ipm_rs.Lut.from_maps(np.full((1, 1), -5.0), np.zeros((1, 1)), source_size=(2, 2))
    out = lut.warp(image, interpolation="nearest", border_value=border)
    assert same(out, np.array([[border]], dtype=dtype))


@pytest.mark.parametrize("border", [(5, 6, 7), [5, 6, 7], np.array([5, 6, 7]), np.array([5, 6, 7], np.uint8)], ids=repr)
def test_border_value_per_channel(border):
    lut = ipm_rs.Lut.from_maps(np.full((2, 2), -5.0), np.zeros((2, 2)), source_size=(4, 4))
    for interpolation in CV2:
        out = lut.warp(textured(4, 4, 3), interpolation=interpolation, border_value=border)
        np.testing.assert_array_equal(out, np.broadcast_to([5, 6, 7], (2, 2, 3)))


def test_border_value_is_black_by_default():
    lut = ipm_rs.Lut.from_maps(np.full((2, 2), -5.0), np.zeros((2, 2)), source_size=(4, 4))
    assert not lut.warp(np.full((4, 4, 3), 200, np.uint8)).any()


def test_interpolation_is_bilinear_by_default(seed_lut):
    image = textured(1024, 2048)
    default = seed_lut.warp(image)
    assert same(default, seed_lut.warp(image, interpolation="bilinear"))
    assert not same(default, seed_lut.warp(image, interpolation="nearest"))
