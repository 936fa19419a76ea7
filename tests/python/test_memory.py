"""Memory: what a table holds, and that calls give back what they take."""

from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("threads", [1, 4])
@pytest.mark.parametrize("layout", ["HWC", "CHW", "NCHW"])
def test_peak_memory_with_out_does_not_grow(threads, layout):
    """1,000 calls after the first few: not a page more at the peak. In a process of its own, whose peak is its own."""
    code = f"""if True:
        import resource, tracemalloc, numpy as np, ipm_rs
        ipm_rs.set_num_threads({threads})
        camera = ipm_rs.Camera(np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]), image_size=(640, 480))
        camera = ipm_rs.Camera.from_euler(camera.intrinsics, image_size=(640, 480), position=(0, 0, 1.4), pitch=0.1)
        lut = ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(5, 15), y=(-15, 15), resolution=0.1))
        shape = dict(HWC=(480, 640, 3), CHW=(3, 480, 640), NCHW=(2, 3, 480, 640))["{layout}"]
        image = np.zeros(shape, np.uint8)
        out = lut.warp(image, layout="{layout}")
        call = lambda: lut.warp(image, out=out, layout="{layout}", border_value=(1, 2, 3), threads={threads})
        peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # KiB
        tracemalloc.start()
        for _ in range(200):  # until NumPy's and Python's own caches of small objects are full
            call()
        peak_before, traced_before = peak(), tracemalloc.get_traced_memory()[0]
        for _ in range(1000):
            call()
        print(peak() - peak_before, tracemalloc.get_traced_memory()[0] - traced_before)
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    resident, traced = map(int, done.stdout.split())
    # a late page of a thread's stack; a row lost with each call would be 900 KiB, an object 28,000 bytes
    assert resident <= 256, f"{resident} KiB more"
    assert traced < 24_000, f"{traced} bytes more"


def test_result_takes_no_more_than_itself(seed_lut):
    """No second output, no copy of the input: the peak of one call is the array that it returns."""
    import tracemalloc

    image = np.zeros((1024, 2048, 3), np.uint8)
    seed_lut.warp(image)
    tracemalloc.start()
    try:
        out = seed_lut.warp(image)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert out.nbytes <= peak < out.nbytes + 10_000


def assert_twelve_bytes_per_cell(map_x: np.ndarray, map_y: np.ndarray, size: tuple[int, int]) -> None:
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=size)
    where_rows_end = 8 * len(map_x)
    assert lut.nbytes <= 12 * map_x.size + where_rows_end


def test_bytes_per_cell_of_the_seed_job(seed_lut):
    rows, columns = seed_lut.shape
    fresh = pickle.loads(pickle.dumps(seed_lut))  # other tests' warps have added to it
    assert fresh.nbytes <= 12 * rows * columns
    assert fresh.nbytes <= 8.2 * rows * columns


PATHOLOGICAL = {
    "every cell another kind than the one before": lambda i, j: ((i + j) % 2 * 2.5, 0 * i + 1.0),
    "kinds of four in turn": lambda i, j: (np.take([0.5, 3.0, 3.4, 9.0], (i + j) % 4), 0 * i + 1.0),
    "nothing sees the image": lambda i, j: (0 * i - 50.0, 0 * j - 50.0),
    "all on one pixel": lambda i, j: (0 * i + 1.5, 0 * j + 1.5),
    "not a number every other cell": lambda i, j: (np.where(j % 2, np.nan, 1.0), 0 * i + 1.0),
    "all halo": lambda i, j: (0 * i - 0.5, 0 * j + 1.0),
    "noise around the edge": lambda i, j: tuple(np.random.default_rng(0).uniform(-2, 6, (2, *np.shape(i + j)))),
}


@pytest.mark.parametrize("name", PATHOLOGICAL)
@pytest.mark.parametrize("shape", [(400, 500), (1, 200_000), (20_000, 10)], ids=str)
def test_at_most_twelve_bytes_per_cell(name, shape):
    i, j = np.indices(shape).astype(np.int64)
    map_x, map_y = (np.ascontiguousarray(np.broadcast_to(m, shape).astype(float)) for m in PATHOLOGICAL[name](i, j))
    assert_twelve_bytes_per_cell(map_x, map_y, (4, 4))


@given(st.integers(0, 2**32), st.integers(1, 30), st.integers(1, 100))
def test_at_most_twelve_bytes_per_cell_of_any_maps(seed, rows, columns):
    map_x, map_y = np.random.default_rng(seed).uniform(-3, 8, (2, rows, columns))
    assert_twelve_bytes_per_cell(map_x, map_y, (5, 4))
