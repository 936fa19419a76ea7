"""Signals that come while a call works: Ctrl-C ends it soon, whatever it is doing; other handlers let it go on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import ipm_rs

pytestmark = pytest.mark.slow

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="signals and /proc as Linux has them")

#: What every snippet below finds.
SETUP = """if True:
    import signal, sys, time, numpy as np, ipm_rs
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job was told to ignore it
    rng = np.random.default_rng(1)
    K = [[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]]
    camera = ipm_rs.Camera.from_euler(K, image_size=(640, 480), position=(0, 0, 1.5), pitch=0.1)
    bent = ipm_rs.Camera.from_euler(K, image_size=(640, 480), position=(0, 0, 1.5), pitch=0.1,
                                    lens=ipm_rs.KannalaBrandt([0.02, -0.004, 0, 0]))
    road = ipm_rs.HeightMap(rng.uniform(-0.1, 0.1, (60, 60)), origin=(3, -10), spacing=(0.4, 0.4))
    image = rng.integers(0, 5, (480, 640, 3)).astype(np.uint8)
"""

#: Work of many seconds, each a single call: a loop of short ones would end between two of them. Most of the memory that
#: they ask for is never touched.
LONG = {
    "warp, bilinear": "lut.warp(batch, layout='NHWC', {threads})",
    "warp, two threads": "lut.warp(batch, layout='NHWC', interpolation='mode', threads=2)",
    "warp, nearest": "lut.warp(batch, layout='NHWC', interpolation='nearest', {threads})",
    "warp, area": "lut.warp(batch, layout='NHWC', interpolation='area', {threads})",
    "warp, mode": "lut.warp(batch, layout='NHWC', interpolation='mode', {threads})",
    "Lut": "ipm_rs.Lut(bent, ipm_rs.BevGrid(x=(4, 24), y=(-8, 8), resolution=0.002), ground=road)",
    "remap": "ipm_rs.remap(many, maps, maps, {threads})",
    "warp_perspective": "ipm_rs.warp_perspective(many, np.eye(3), (5000, 4000), {threads})",
    "unproject": "bent.unproject(uv)",
    "ground_from_pixels": "bent.ground_from_pixels(uv, ground=road, {threads})",
    "points_from_depth": "ipm_rs.points_from_depth(depth, large, {threads})",
    "render_points": "ipm_rs.render_points(points, camera, radius=40, {threads})",
    "rasterize": "ipm_rs.rasterize(np.broadcast_to(points[:1], (900_000_000, 3)), grid, {threads})",
    "rasterize_polygons": "ipm_rs.rasterize_polygons([star], grid)",
    "project_polyline": "bent.project_polyline(points, tolerance=0.001)",
}

LARGE = """
    grid = ipm_rs.BevGrid(x=(4, 24), y=(-8, 8), resolution=0.01)
    lut = ipm_rs.Lut(camera, grid)
    batch = np.broadcast_to(image[..., 0].copy()[..., None], (600, 480, 640, 1))
    many = np.zeros((480, 640, 100), np.uint8)
    maps = np.full((4000, 5000), 3, np.float32)
    uv = np.tile(rng.uniform(0, 479, (1000, 2)), (12_000, 1))
    points = np.tile(rng.uniform((4, -3, 0), (9, 3, 1), (1000, 3)), (3000, 1))
    angle = np.linspace(0, 12_000, 3_000_000)
    star = np.stack([14 + 9 * np.cos(angle), 7 * np.sin(angle * 1.01)], 1)
    depth = np.broadcast_to(np.ones(8_000, np.float32), (20_000, 8_000))
    large = ipm_rs.Camera([[9e3, 0, 4e3], [0, 9e3, 1e4], [0, 0, 1]], image_size=(8_000, 20_000), lens=bent.lens)
"""


def interrupted(work: str, threads: str) -> tuple[float, str]:
    """CPU seconds from SIGINT, 0.4 s into `work`, to the end of its process, and what that said.

    Not seconds of the clock: others may use the CPUs too.
    """
    call = work.replace("{threads}", threads)
    code = f"{SETUP}{LARGE}\n    print('go', flush=True)\n    {call}\n    print('done', flush=True)\n"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", code], **pipes) as child:
        try:
            assert child.stdout.readline() == "go\n", child.communicate()[1]
            time.sleep(0.4)
            assert child.poll() is None, f"too short: {child.communicate()}"
            before = Path(f"/proc/{child.pid}/stat").read_text().rpartition(")")[2].split()
            child.send_signal(signal.SIGINT)
            said = child.stdout.read() + child.stderr.read()
            usage = os.wait4(child.pid, 0)[2]
            ticks = int(before[11]) + int(before[12])
            return usage.ru_utime + usage.ru_stime - ticks / os.sysconf("SC_CLK_TCK"), said
        finally:
            child.kill()


@linux
@pytest.mark.parametrize("work", LONG)
def test_ctrl_c_ends_a_long_call(work):
    seconds, said = interrupted(LONG[work], "threads=1")
    assert "KeyboardInterrupt" in said and "done" not in said, said
    assert seconds < 1.0, f"{seconds:.1f} s"


def long_warp() -> tuple[ipm_rs.Lut, np.ndarray, np.ndarray]:
    """A warp of about a second: table, images, outputs."""
    column, row = np.meshgrid(np.linspace(0, 99, 1500), np.linspace(0, 99, 1500))
    lut = ipm_rs.Lut.from_maps(column, row, source_size=(100, 100))
    images = np.random.default_rng(0).integers(0, 255, (20, 100, 100, 3)).astype(np.uint8)
    return lut, images, np.zeros((20, 1500, 1500, 3), np.uint8)


@linux
@pytest.mark.parametrize("threads", [1, 4])
def test_a_handler_that_raises_nothing_lets_the_call_go_on(threads):
    """It runs while the call works, not after it, and may itself use the package."""
    lut, images, out = long_warp()
    small = ipm_rs.Lut.from_maps(np.zeros((4, 4)), np.zeros((4, 4)), source_size=(100, 100))
    handled = []

    def handle(signum, frame) -> None:
        handled.append((time.monotonic(), small.warp(images[0])))

    expected = lut.warp(images[-1], interpolation="mode")
    before = signal.signal(signal.SIGALRM, handle)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        # seconds of work, on any machine: bilinear is done before the timer
        lut.warp(images, layout="NHWC", interpolation="mode", out=out, threads=threads)
        ended = time.monotonic()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert len(handled) == 1
    assert handled[0][0] < ended
    assert (handled[0][1] == images[0, 0, 0]).all()
    assert (out[-1] == expected).all()


@linux
def test_what_a_handler_raises_comes_out_of_the_call_and_leaves_all_usable():
    lut, images, out = long_warp()

    class Enough(Exception):
        pass

    def handle(signum, frame) -> None:
        raise Enough

    before = signal.signal(signal.SIGALRM, handle)
    try:
        for threads in (1, 3):
            out[:] = 7
            signal.setitimer(signal.ITIMER_REAL, 0.1)
            with pytest.raises(Enough):
                lut.warp(images, layout="NHWC", interpolation="mode", out=out, threads=threads)
            assert (out[-1] == 7).all()  # given up before its end
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    out[:] = 7  # nobody holds it any more
    assert (lut.warp(images[:1], layout="NHWC", out=out[:1]) != 7).any()


def test_other_threads_work_on():
    """Python's signals are its main thread's: a call of another one is not ended by them."""
    lut, images, out = long_warp()
    results = []
    worker = threading.Thread(
        target=lambda: results.append(lut.warp(images, layout="NHWC", out=out, threads=2, interpolation="bilinear"))
    )
    worker.start()
    worker.join()
    assert results and results[0] is out
