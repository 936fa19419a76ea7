"""The pool: its size, the GIL, callers at once, and what happens after errors and forks."""

from __future__ import annotations

import concurrent.futures
import faulthandler
import itertools
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from helpers import refuses, same, textured

import ipm_rs

pytestmark = pytest.mark.slow

TIMEOUT = 60
linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="fork and affinity as Linux has them")
forks = pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")


@pytest.fixture
def four_threads():
    """A pool even where there is one CPU."""
    before = ipm_rs.get_num_threads()
    ipm_rs.set_num_threads(4)
    yield
    ipm_rs.set_num_threads(before)


def run(code: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


# ---------------------------------------------------------------------------------------------------------------------
# how many


@linux
@pytest.mark.parametrize("count", [1, 2])
def test_affinity_is_respected(count):
    mine = sorted(os.sched_getaffinity(0))
    if len(mine) < count:
        pytest.skip(f"needs {count} CPUs")
    code = f"import os; os.sched_setaffinity(0, {mine[:count]}); import ipm_rs; print(ipm_rs.get_num_threads())"
    environment = {"IPM_RS_NUM_THREADS": ""}
    assert run(code, **environment) == str(count)


@linux
def test_no_more_threads_than_asked_for():
    """One thread makes none; four make three helpers; and only a warp large enough makes any."""
    code = """if True:
        import os, numpy as np, ipm_rs
        count = lambda: len(os.listdir("/proc/self/task"))
        before = count()
        column, row = np.meshgrid(np.arange(1000.0), np.arange(800.0))
        ipm_rs.set_num_threads(1)
        lut = ipm_rs.Lut.from_maps(column, row, source_size=(1000, 800))
        image = np.zeros((800, 1000, 3), np.uint8)
        lut.warp(image)
        alone = count() - before
        ipm_rs.set_num_threads(4)
        small = ipm_rs.Lut.from_maps(column[:8, :8].copy(), row[:8, :8].copy(), source_size=(8, 8))
        small.warp(np.zeros((8, 8, 3), np.uint8))
        little = count() - before
        lut.warp(image, threads=1)
        asked = count() - before
        lut.warp(image)
        lut.warp(image, threads=2)
        lut.warp(image, threads=100)
        print(alone, little, asked, count() - before)
    """
    assert run(code, OPENBLAS_NUM_THREADS="1") == "0 0 0 3"


@pytest.mark.parametrize("threads", [1, 7, 1000, 2**31, 2**62, 2**63, 2**64, 10**30])
def test_any_number_of_threads_may_be_asked_for(seed_lut, four_threads, threads):
    image = textured(1024, 2048)
    assert same(seed_lut.warp(image, threads=threads), seed_lut.warp(image, threads=1))


@pytest.mark.parametrize("value", ["abc", "0", "-1", "2.5", "1025", "1" + 30 * "0", "0x4"])
def test_a_number_of_threads_that_is_none_is_told_once_and_not_heeded(value):
    code = "import ipm_rs; ipm_rs.set_num_threads; print(ipm_rs.get_num_threads(), ipm_rs.get_num_threads())"
    done = subprocess.run(
        [sys.executable, "-W", "always", "-c", code],
        env={**os.environ, "IPM_RS_NUM_THREADS": value},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=True,
    )
    told = [line for line in done.stderr.splitlines() if "IPM_RS_NUM_THREADS" in line]
    assert len(told) == 1, done.stderr
    assert "RuntimeWarning" in told[0] and f'"{value}"' in told[0] and "1 to 1024" in told[0]
    expected = run("import ipm_rs; print(ipm_rs.get_num_threads())", IPM_RS_NUM_THREADS="")
    assert done.stdout.split() == [expected] * 2


@pytest.mark.parametrize("value", ["", "  ", "3", " 3 ", "1024"])
def test_a_number_of_threads_that_is_one_is_not_remarked_on(value):
    code = "import warnings; warnings.simplefilter('error'); import ipm_rs; print(ipm_rs.get_num_threads())"
    count = run(code, IPM_RS_NUM_THREADS=value)
    assert count == value.strip() or not value.strip()


def test_more_threads_than_can_be_of_use_are_refused():
    before = ipm_rs.get_num_threads()
    for count in (1025, 10**9, 10**30):
        with refuses(ipm_rs.ArgumentError, "at most 1024"):
            ipm_rs.set_num_threads(count)
    assert ipm_rs.get_num_threads() == before


# ---------------------------------------------------------------------------------------------------------------------
# given back


def tasks() -> int:
    """Threads of this process, whoever made them."""
    return sum(1 for _ in Path("/proc/self/task").iterdir())


def settled() -> int:
    """Threads of this process once those that were told to end have ended, on a busy machine a moment later."""
    before, since, end = tasks(), time.monotonic(), time.monotonic() + 10
    while time.monotonic() - since < 0.3 and time.monotonic() < end:
        time.sleep(0.01)
        if tasks() != before:
            before, since = tasks(), time.monotonic()
    return before


@linux
def test_threads_of_sizes_that_were_tried_are_given_back(seed_lut, four_threads):
    image = textured(1024, 2048)
    expected = seed_lut.warp(image, threads=1)
    ipm_rs.set_num_threads(1)  # which needs no pool
    alone = settled()
    for count in [*range(2, 40), 1, 17, 3]:
        ipm_rs.set_num_threads(count)
        assert same(seed_lut.warp(image, threads=count), expected)
        assert tasks() - alone == count - 1  # the others were waited for, not merely told


@linux
def test_sizes_that_change_while_others_warp(seed_lut, four_threads):
    image = textured(1024, 2048, 3)
    expected = seed_lut.warp(image, threads=1)
    ipm_rs.set_num_threads(2)
    seed_lut.warp(image)
    before = settled()
    stop = threading.Event()

    def resize() -> None:
        for count in itertools.cycle([2, 9, 1, 5]):
            if stop.is_set():
                return
            ipm_rs.set_num_threads(count)

    resizer = threading.Thread(target=resize)
    resizer.start()
    try:
        with concurrent.futures.ThreadPoolExecutor(4) as pool:
            for got in pool.map(lambda count: seed_lut.warp(image, threads=count), [2, 3, 5, 8] * 25):
                assert same(got, expected)
    finally:
        stop.set()
        resizer.join()
    ipm_rs.set_num_threads(2)
    seed_lut.warp(image)
    end = time.monotonic() + 10
    while tasks() > before and time.monotonic() < end:  # /proc lists a thread for a moment after it was waited for
        time.sleep(0.01)
    assert tasks() <= before  # fewer where threads of others ended meanwhile


STRESS = """if True:
    import os, random, resource, signal, sys, threading, time, numpy as np, ipm_rs
    column, row = np.meshgrid(np.linspace(0, 99, 500), np.linspace(0, 99, 400))
    lut = ipm_rs.Lut.from_maps(column, row, source_size=(100, 100))
    image = np.random.default_rng(0).integers(0, 255, (100, 100, 3)).astype(np.uint8)
    expected = lut.warp(image, threads=1)
    end, wrong, calls, signals, forks = time.monotonic() + SECONDS, [], 0, 0, 0

    def handle(number, frame):
        global signals
        signals += 1
        if not (lut.warp(image, threads=2) == expected).all():
            wrong.append("in a handler")

    def work(seed):
        global calls
        choose = random.Random(seed)
        while time.monotonic() < end:
            if not (lut.warp(image, threads=choose.choice([None, 1, 2, 7])) == expected).all():
                wrong.append("in a thread")
            calls += 1
            if choose.random() < 0.1:
                ipm_rs.set_num_threads(choose.choice([1, 2, 3, 12]))

    signal.signal(signal.SIGALRM, handle)
    signal.setitimer(signal.ITIMER_REAL, 0.05, 0.1)
    workers = [threading.Thread(target=work, args=(seed,)) for seed in range(3)]
    for worker in workers:
        worker.start()
    resident = lambda: int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()
    early = None
    batch = np.broadcast_to(image, (6, *image.shape))
    outs = np.empty((6, *lut.shape, 3), np.uint8)
    while time.monotonic() < end:
        lut.warp(batch, layout="NHWC", interpolation="mode", out=outs, threads=1)  # long enough to look for signals
        child = os.fork()
        if child == 0:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(20)
            ipm_rs.set_num_threads(3)
            os._exit(0 if (lut.warp(image, threads=3) == expected).all() else 1)
        forks += 1
        status = os.waitpid(child, 0)[1]
        if status:
            wrong.append(f"in a child: {status}")
        early = early or (resident() if time.monotonic() > end - SECONDS * 0.6 else None)
    for worker in workers:
        worker.join()
    signal.setitimer(signal.ITIMER_REAL, 0)
    grown = resident() - (early or resident())
    print(len(wrong), wrong[:3], calls, signals, forks, grown, flush=True)
    assert not wrong and grown < 32 << 20 and forks > 0 and signals > 3
"""


@linux
@forks
def test_threads_forks_sizes_and_signals_together():
    """For some seconds; IPM_RS_STRESS_SECONDS says how many."""
    seconds = os.environ.get("IPM_RS_STRESS_SECONDS", "4")
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", STRESS.replace("SECONDS", seconds)],
        capture_output=True,
        text=True,
        timeout=TIMEOUT + 2 * float(seconds),
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


# ---------------------------------------------------------------------------------------------------------------------
# the GIL


@pytest.mark.parametrize("threads", [1, 2])
def test_python_runs_on_while_a_warp_does(threads):
    """Another thread counts while one call warps for a tenth of a second or more."""
    column, row = np.meshgrid(np.linspace(0.5, 98.5, 4000), np.linspace(0.5, 98.5, 4000))
    lut = ipm_rs.Lut.from_maps(column, row, source_size=(100, 100))
    image = textured(100, 100, 9, "float32")
    out = np.empty((4000, 4000, 9), np.float32)
    lut.warp(image, out=out, threads=threads)  # every page of it is there
    ticks, running = [], True

    def count() -> None:
        while running:
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    try:
        began = time.perf_counter()
        lut.warp(image, out=out, threads=threads)
        ended = time.perf_counter()
    finally:
        running = False
        counter.join()
    within = sum(began < tick < ended for tick in ticks)
    # with the GIL held there would be none between the first and the last millisecond
    assert ended - began > 0.01
    assert within >= 3, (within, ended - began)


@pytest.mark.parametrize("threads", [1, 4])
def test_callers_at_once_get_what_they_would_alone(seed_lut, four_threads, threads):
    planes = textured(6 * 1024, 2048).reshape(6, 1024, 2048)
    image = textured(1024, 2048, 3, seed=1)
    calls = [
        lambda: seed_lut.warp(image, threads=threads),
        lambda: seed_lut.warp(planes, layout="CHW", threads=threads),
        lambda: seed_lut.warp(planes[3], interpolation="nearest", threads=threads),
        lambda: seed_lut.mask,
        lambda: np.stack(seed_lut.maps(-9)),
    ]
    expected = [call() for call in calls]
    with concurrent.futures.ThreadPoolExecutor(10) as pool:
        for _ in range(3):
            for got, wanted in zip(pool.map(lambda call: call(), calls * 4), expected * 4, strict=True):
                assert same(got, wanted)


def test_errors_leave_the_pool_usable(seed_lut, four_threads):
    image = textured(1024, 2048, 3)
    expected = seed_lut.warp(image, threads=1)
    for _ in range(20):
        for wrong in ({"border_value": 300}, {"threads": 0}, {"out": image}, {"layout": "CHW"}, {"interpolation": "x"}):
            with pytest.raises(ipm_rs.IpmError):
                seed_lut.warp(image, **wrong)
        assert same(seed_lut.warp(image), expected)


# ---------------------------------------------------------------------------------------------------------------------
# forks


def in_fork(work, depth: int = 1) -> None:
    """Run `work` in a fork of a fork of ...; a hang is killed by the alarm and shows as its signal."""
    child = os.fork()
    if child == 0:
        faulthandler.disable()
        signal.alarm(TIMEOUT // 2)
        code = 1
        try:
            if work():
                if depth > 1:
                    in_fork(work, depth - 1)
                code = 0
        finally:
            os._exit(code)
    assert os.waitpid(child, 0)[1] == 0


@linux
@forks
def test_forks_within_forks(seed_lut, four_threads):
    image = textured(1024, 2048)
    expected = seed_lut.warp(image, threads=4)
    in_fork(lambda: all(same(seed_lut.warp(image, threads=2), expected) for _ in range(3)), depth=3)
    assert same(seed_lut.warp(image, threads=4), expected)


@linux
@forks
def test_a_fork_that_has_another_size_of_pool(seed_lut, four_threads):
    image = textured(1024, 2048)
    expected = seed_lut.warp(image)

    def work() -> bool:
        for threads in (1, 2, 4, 3):
            ipm_rs.set_num_threads(threads)
            if not same(seed_lut.warp(image), expected):
                return False
        return True

    in_fork(work)


@linux
@forks
def test_forks_while_other_threads_warp(seed_lut, four_threads):
    """The child is forked at any moment of a call that it does not take part in."""
    image = textured(1024, 2048)
    expected = seed_lut.warp(image)
    stop = threading.Event()

    def warp() -> None:
        while not stop.is_set():
            seed_lut.warp(image)

    workers = [threading.Thread(target=warp) for _ in range(2)]
    for worker in workers:
        worker.start()
    try:
        for _ in range(20):
            in_fork(lambda: same(seed_lut.warp(image, threads=4), expected))
    finally:
        stop.set()
        for worker in workers:
            worker.join()


class Frames:
    """A data set as PyTorch's loaders take them: the table is made before the workers are."""

    def __init__(self, lut: ipm_rs.Lut) -> None:
        self.lut = lut

    def __getitem__(self, index: int) -> np.ndarray:
        return self.lut.warp(textured(1024, 2048, seed=index), threads=2)


def load(frames: Frames, indices, results) -> None:
    for index in iter(indices.get, None):
        results.put((index, frames[index].tobytes()))


@linux
@forks
@pytest.mark.parametrize("method", ["fork", "forkserver", "spawn"])
def test_loader_workers(seed_lut, four_threads, method):
    frames = Frames(seed_lut)
    expected = {index: frames[index].tobytes() for index in range(6)}
    context = multiprocessing.get_context(method)
    indices, results = context.Queue(), context.Queue()
    workers = [context.Process(target=load, args=(frames, indices, results), daemon=True) for _ in range(3)]
    for worker in workers:
        worker.start()
    try:
        for index in expected:
            indices.put(index)
        for _ in workers:
            indices.put(None)
        assert dict(results.get(timeout=TIMEOUT) for _ in expected) == expected
        for worker in workers:
            worker.join(TIMEOUT)
            assert worker.exitcode == 0
    finally:
        for worker in workers:
            if worker.is_alive():
                worker.kill()
