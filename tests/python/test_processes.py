"""Other processes: a fork after first use, spawned workers, environment variables."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys

import numpy as np
import pytest
from helpers import textured

import ipm_rs

pytestmark = pytest.mark.slow

TIMEOUT = 60


def warp_checksum(lut: ipm_rs.Lut, queue) -> None:
    """Runs in the child: a warp on several threads, and a table built there."""
    bev = lut.warp(textured(400, 600, 3), threads=4)
    grid = ipm_rs.BevGrid(x=(5, 45), y=(-20, 20), resolution=0.1)
    again = ipm_rs.Lut(camera(), grid)
    queue.put((bev.tobytes(), again == lut))


def camera() -> ipm_rs.Camera:
    K = np.array([[500.0, 0, 300], [0, 500, 200], [0, 0, 1]])
    return ipm_rs.Camera.from_euler(K, image_size=(600, 400), position=(0, 0, 1.4), pitch=0.1)


def in_child(method: str) -> None:
    """Warp here on several threads, then in a child, which must come to the same answer in time."""
    lut = ipm_rs.Lut(camera(), ipm_rs.BevGrid(x=(5, 45), y=(-20, 20), resolution=0.1))
    expected = lut.warp(textured(400, 600, 3), threads=4).tobytes()
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    children = [context.Process(target=warp_checksum, args=(lut, queue), daemon=True) for _ in range(2)]
    for child in children:
        child.start()
    try:
        for _ in children:
            data, equal = queue.get(timeout=TIMEOUT)
            assert data == expected
            assert equal
        for child in children:
            child.join(TIMEOUT)
            assert child.exitcode == 0
    finally:
        for child in children:
            if child.is_alive():
                child.kill()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="fork is not safe here, whoever does it")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_after_first_use_does_not_hang():
    before = ipm_rs.get_num_threads()
    ipm_rs.set_num_threads(4)  # a pool even where there is one CPU
    try:
        in_child("fork")
    finally:
        ipm_rs.set_num_threads(before)


def test_spawned_workers_get_the_table_by_pickle():
    in_child("spawn")


def run(code: str, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )


def test_thread_count_from_the_environment():
    done = run("import ipm_rs; print(ipm_rs.get_num_threads())", IPM_RS_NUM_THREADS="3")
    assert done.stdout.split() == ["3"], done.stderr


def test_the_call_outranks_the_environment():
    code = "import ipm_rs; ipm_rs.set_num_threads(2); print(ipm_rs.get_num_threads())"
    assert run(code, IPM_RS_NUM_THREADS="3").stdout.split() == ["2"]


@pytest.mark.parametrize("value", ["", "0", "-1", "many", "99999999999999999999"])
def test_a_senseless_environment_neither_hangs_nor_panics(value):
    code = "import ipm_rs, numpy as np; print(ipm_rs.get_num_threads())"
    done = run(code, IPM_RS_NUM_THREADS=value)
    assert "panic" not in done.stderr.lower()
    assert done.returncode == 0 and int(done.stdout) >= 1, done.stderr


def test_the_instruction_set_can_be_forced():
    code = "import ipm_rs; print(ipm_rs.cpu_info())"
    done = run(code, IPM_RS_ISA="scalar")
    assert done.returncode == 0 and "scalar" in done.stdout, done.stderr


def test_an_instruction_set_that_is_not_there_is_an_error():
    code = (
        "import ipm_rs, numpy as np\n"
        "try:\n"
        "    ipm_rs.cpu_info()\n"
        "    lut = ipm_rs.Lut.from_maps(np.zeros((2, 2)), np.zeros((2, 2)), source_size=(2, 2))\n"
        "    lut.warp(np.zeros((2, 2), np.uint8))\n"
        "except ipm_rs.IpmError as error:\n"
        "    print('refused', error)\n"
    )
    done = run(code, IPM_RS_ISA="abacus")
    assert "panic" not in done.stderr.lower()
    assert "abacus" in done.stdout + done.stderr and "scalar" in done.stdout + done.stderr
