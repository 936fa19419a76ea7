"""Arrays that go in and come out: strides, read-only inputs, out=, threads."""

from __future__ import annotations

import concurrent.futures
import pickle
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers import same, textured

import ipm_rs

INTERPOLATIONS = ["nearest", "bilinear"]
SHAPE = (40, 50)


@pytest.fixture(scope="module")
def lut() -> ipm_rs.Lut:
    """A turned, scaled view of a 50 x 40 image, with halo and outside."""
    rows, columns = np.mgrid[0:60, 0:70].astype(np.float64)
    return ipm_rs.Lut.from_maps(
        0.8 * columns + 0.21 * rows - 6.3, 0.7 * rows - 0.13 * columns + 2.2, source_size=(50, 40)
    )


def strided(name: str, channels: int | None, dtype: str) -> np.ndarray:
    """Views of 40 x 50 whose rows are not where a contiguous image has them."""
    tail = () if channels is None else (channels,)
    big = textured(100, 130, channels, dtype)
    if name == "crop":
        return big[30:70, 17:67]
    if name == "every second row":
        return textured(80, 50, channels, dtype)[::2]
    if name == "flipped rows":
        return textured(40, 50, channels, dtype)[::-1]
    if name == "every second row from below":
        return big[99::-2][5:45, 3:53]
    if name == "one row for all":
        return np.broadcast_to(textured(1, 50, channels, dtype), (*SHAPE, *tail))
    raise ValueError(name)


VIEWS = ["crop", "every second row", "flipped rows", "every second row from below", "one row for all"]


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("channels", [None, 1, 3, 4, 5])
@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_row_strides(lut, view, channels, interpolation, dtype):
    image = strided(view, channels, dtype)
    assert image.shape[:2] == SHAPE and image.strides[0] != 50 * image.itemsize * (channels or 1)
    before = image.copy()
    out = lut.warp(image, interpolation=interpolation, border_value=3)
    assert same(out, lut.warp(np.ascontiguousarray(image), interpolation=interpolation, border_value=3))
    np.testing.assert_array_equal(image, before)
    assert len(np.unique(out)) > 20


@pytest.mark.parametrize("dtype", ["bool", "int64", "float64", "int16"])
@pytest.mark.parametrize("view", VIEWS)
def test_row_strides_under_nearest_of_other_dtypes(lut, view, dtype):
    image = strided(view, 3, dtype)
    out = lut.warp(image, interpolation="nearest")
    assert same(out, lut.warp(np.ascontiguousarray(image), interpolation="nearest"))


def test_a_strided_input_is_not_copied():
    """One row that stands for 65 000: a copy would take 3.9 GB, and far longer than the 100 cells."""
    row = textured(1, 60_000)
    image = np.broadcast_to(row, (65_000, 60_000))
    columns = np.linspace(0, 59_999, 100).round()
    lut = ipm_rs.Lut.from_maps(
        columns[np.newaxis], np.linspace(0, 64_999, 100).round()[np.newaxis], source_size=(60_000, 65_000)
    )
    for interpolation in INTERPOLATIONS:
        began = time.perf_counter()
        out = lut.warp(image, interpolation=interpolation)
        assert time.perf_counter() - began < 0.5
        np.testing.assert_array_equal(out, row[:, columns.astype(int)])


def test_dimensions_of_one_have_no_stride_to_speak_of():
    """A column or a channel cut out of something larger is contiguous enough."""
    column = textured(40, 50, 3)[:, 7:8]
    tall = ipm_rs.Lut.from_maps(np.zeros((40, 1)), np.arange(40.0)[:, None], source_size=(1, 40))
    assert same(tall.warp(column), np.ascontiguousarray(column))
    row = textured(40, 50)[5:6]
    wide = ipm_rs.Lut.from_maps(np.arange(50.0)[None], np.zeros((1, 50)), source_size=(50, 1))
    assert same(wide.warp(row), np.ascontiguousarray(row))
    thin = textured(40, 50)[:, ::7][:, :1]
    assert same(tall.warp(thin), np.ascontiguousarray(thin))
    mono = textured(1, 50)[:, :, np.newaxis]
    assert same(wide.warp(mono), mono)


def test_read_only_input(lut):
    image = textured(*SHAPE, 3)
    expected = lut.warp(image)
    image.setflags(write=False)
    assert same(lut.warp(image), expected)
    assert same(lut.warp(np.frombuffer(image.tobytes(), np.uint8).reshape(image.shape)), expected)


def test_subclasses_and_memory_maps(lut, tmp_path):
    image = textured(*SHAPE, 3)
    mapped = np.memmap(tmp_path / "image", dtype=np.uint8, mode="w+", shape=image.shape)
    mapped[:] = image
    assert same(np.asarray(lut.warp(mapped)), lut.warp(image))


def test_channels_of_the_result_are_those_of_the_image(lut):
    assert lut.warp(textured(*SHAPE)).shape == (60, 70)
    assert lut.warp(textured(*SHAPE, 1)).shape == (60, 70, 1)
    assert lut.warp(textured(*SHAPE, 3)).shape == (60, 70, 3)


def test_result_is_a_fresh_contiguous_array(lut):
    image = textured(*SHAPE, 3)
    first, second = lut.warp(image), lut.warp(image)
    assert first.flags.c_contiguous and first.flags.writeable
    assert not np.shares_memory(first, second) and not np.shares_memory(first, image)
    first[...] = 0
    assert second.any()


# ---------------------------------------------------------------------------------------------------------------------
# out=


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("channels", [None, 1, 3])
def test_out_is_filled_and_returned_itself(lut, interpolation, channels):
    image = textured(*SHAPE, channels)
    expected = lut.warp(image, interpolation=interpolation, border_value=9)
    out = np.full_like(expected, 77)
    assert lut.warp(image, interpolation=interpolation, border_value=9, out=out) is out
    assert same(out, expected)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_out_may_have_any_row_stride(lut, interpolation, dtype):
    image = textured(*SHAPE, 3, dtype)
    expected = lut.warp(image, interpolation=interpolation, border_value=9)
    frame = textured(200, 100, 3, dtype, seed=3)
    for window in (np.s_[20:80, 10:80], np.s_[20:140:2, 10:80], np.s_[79:19:-1, 10:80]):
        canvas = frame.copy()
        view = canvas[window]
        assert view.shape == expected.shape
        assert lut.warp(image, interpolation=interpolation, border_value=9, out=view) is view
        np.testing.assert_array_equal(view, expected)
        canvas[window] = frame[window]
        assert same(canvas, frame), "nothing was written outside the view"


def test_out_beside_the_image_in_one_buffer(lut):
    buffer = np.zeros((40 + 60, 70, 3), np.uint8)
    image, out = buffer[:40, :50], buffer[40:]
    image[:] = textured(*SHAPE, 3)
    assert not np.shares_memory(image, out)
    expected = lut.warp(image.copy())
    assert lut.warp(image, out=out) is out
    np.testing.assert_array_equal(out, expected)


def test_out_can_be_used_again(lut):
    a, b = textured(*SHAPE, 3, seed=1), textured(*SHAPE, 3, seed=2)
    out = lut.warp(a)
    lut.warp(b, out=out)
    assert same(out, lut.warp(b))


# ---------------------------------------------------------------------------------------------------------------------
# threads=


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_the_result_does_not_depend_on_threads(seed_lut, interpolation, dtype):
    image = textured(1024, 2048, 3, dtype)
    one = seed_lut.warp(image, interpolation=interpolation, threads=1, border_value=5)
    assert len(np.unique(one)) > 200
    for threads in (None, 2, 3, 8, 64, np.int64(2)):
        assert same(seed_lut.warp(image, interpolation=interpolation, threads=threads, border_value=5), one), threads


def test_set_num_threads(seed_lut):
    image = textured(1024, 2048, 3)
    before = ipm_rs.get_num_threads()
    assert before >= 1
    expected = seed_lut.warp(image, threads=1)
    try:
        for threads in (1, 2, 5, 64):
            ipm_rs.set_num_threads(threads)
            assert ipm_rs.get_num_threads() == threads
            assert same(seed_lut.warp(image), expected)
    finally:
        ipm_rs.set_num_threads(before)


@pytest.mark.parametrize("threads", [1, 2])
def test_many_python_threads_share_one_table(seed_lut, threads):
    images = [textured(1024, 2048, 3, seed=seed) for seed in range(3)]
    expected = [seed_lut.warp(image, threads=1) for image in images]
    outs = [np.empty_like(expected[0]) for _ in range(8)]

    def work(index: int) -> bool:
        for turn in range(5):
            which = (index + turn) % 3
            seed_lut.warp(images[which], out=outs[index], threads=threads)
            if not same(outs[index], expected[which]):
                return False
        return True

    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        results = list(pool.map(work, range(8)))
    assert results == [True] * 8


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_memory_does_not_grow(lut):
    """Results, refusals, tables and pickles are given back."""

    def resident_megabytes() -> float:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

    image = textured(*SHAPE, 3)
    maps = lut.maps()

    def turn():
        for _ in range(200):
            lut.warp(image, threads=2)
            ipm_rs.Lut.from_maps(*maps, source_size=(50, 40))
            pickle.loads(pickle.dumps(lut))
            with pytest.raises(ipm_rs.IpmError):
                lut.warp(image, border_value=300)

    turn()
    before = resident_megabytes()
    for _ in range(4):
        turn()
    # 800 rounds of some 100 kB: a leak of any of them shows
    assert resident_megabytes() - before < 5


@pytest.mark.parametrize("border_value", [0, 7, (1, 2, 3)])
@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("threads", [1, 2])
def test_a_grid_that_is_mostly_outside(interpolation: str, border_value: object, threads: int) -> None:
    """Where most cells are outside, contiguous rows are filled together; strided ones never are."""
    rows, columns = np.mgrid[0:700, 0:500].astype(np.float64)
    wedge = ipm_rs.Lut.from_maps((columns - 250) * 100 / (1 + rows), 200.0 - rows, source_size=(50, 40))
    assert 0 < wedge.mask.mean() < 0.1
    image = textured(40, 50, 3)
    padded = np.full((700, 501, 3), 99, np.uint8)
    options = {"interpolation": interpolation, "border_value": border_value, "threads": threads}
    apart = wedge.warp(image, out=padded[:, :500], **options)
    together = wedge.warp(image, out=np.full((700, 500, 3), 99, np.uint8), **options)
    assert same(together, apart)
    assert (padded[:, 500] == 99).all()
    map_x, _ = wedge.maps(outside=np.nan)
    assert (together[np.isnan(map_x)] == border_value).all()
    assert wedge.mask.any(axis=1).sum() > 30
