"""Who has a mosaic: copies, collected and forked ones, and threads."""

from __future__ import annotations

import copy
import gc
import os
import pickle
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from mosaic_drive import LENGTH, add, camera, frame, on_disk
from test_mosaic import assert_same

import ipm_rs
from ipm_rs.errors import FileError

FILES = Path("/proc/self/fd")
forks = pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")


@pytest.fixture
def child():
    """Calls a function in a forked process, which ends when `child.end()` is called; says what it returned."""
    process = None

    class Child:
        def __call__(self, function):
            nonlocal process
            answer, told = os.pipe()
            self.wait, self.go = os.pipe()
            process = os.fork()
            if process == 0:
                try:
                    os.close(self.go)
                    text = str(function())
                except BaseException as error:
                    text = f"{type(error).__name__}: {error}"
                os.write(told, text.encode())
                os.close(told)
                os.read(self.wait, 1)  # until the parent closes its end
                os._exit(0)
            os.close(told)
            with os.fdopen(answer, "rb") as file:
                return file.read().decode()

        def end(self):
            nonlocal process
            if process is not None:
                os.close(self.go)
                os.close(self.wait)
                os.waitpid(process, 0)
                process = None

    one = Child()
    yield one
    one.end()


def test_copies_of_a_map_on_disk_are_refused_and_change_nothing(tmp_path):
    with on_disk(tmp_path) as mosaic:
        add(mosaic, range(2))
        for copied in (pickle.dumps, copy.copy, copy.deepcopy):
            with pytest.raises(ipm_rs.MosaicError, match=r"Mosaic\.load"):
                copied(mosaic)
        gc.collect()
        with pytest.raises(FileError, match="in use"):
            ipm_rs.Mosaic.load(tmp_path)
        add(mosaic, range(2, 4))
    alone = ipm_rs.Mosaic(0.1, tile=64)
    add(alone, range(4))
    with ipm_rs.Mosaic.load(tmp_path) as mosaic:
        assert_same(mosaic, alone)
    twin = copy.deepcopy(alone)
    add(twin, range(4, 6))
    assert (alone.frames, twin.frames) == (4, 6), "in memory copies are of their own"


def test_a_collected_map_lets_others_open_it(tmp_path):
    mosaic = on_disk(tmp_path)
    add(mosaic, range(2))
    mosaic.commit()
    add(mosaic, range(2, 4))
    opened = list(FILES.iterdir()) if FILES.exists() else None
    del mosaic
    gc.collect()
    with ipm_rs.Mosaic.load(tmp_path) as again:
        assert again.frames == 2, "as it was at the last commit"
    assert opened is None or len(list(FILES.iterdir())) < len(opened)


@forks
def test_a_closed_map_is_free_although_a_fork_lives(tmp_path, child):
    mosaic = on_disk(tmp_path)
    add(mosaic, range(2))
    assert child(lambda: mosaic.frames) == "2"
    mosaic.close()
    with ipm_rs.Mosaic.load(tmp_path) as again:
        assert again.frames == 2


@forks
@pytest.mark.parametrize("how", ["close", "collect"])
def test_a_fork_leaves_the_lock_to_its_parent(tmp_path, child, how):
    held = [on_disk(tmp_path)]
    add(held[0], range(2))

    def lets_go():
        if how == "close":
            held[0].close()
        held.clear()
        gc.collect()
        return "done"

    assert child(lets_go) == "done"
    child.end()
    with pytest.raises(FileError, match="in use"):
        ipm_rs.Mosaic.load(tmp_path)
    add(held[0], range(2, 4))
    held[0].close()
    with ipm_rs.Mosaic.load(tmp_path) as again:
        assert again.frames == 4


@forks
def test_a_fork_reads_and_changes_nothing(tmp_path, child):
    with on_disk(tmp_path) as mosaic:
        add(mosaic, range(2))
        mosaic.commit()
        image, pose = frame(5)
        calls = {
            "add": lambda: mosaic.add(camera(), image, map_from_vehicle=pose),
            "merge": lambda: mosaic.merge(ipm_rs.Mosaic(0.1, tile=64)),
            "commit": mosaic.commit,
        }
        for call in calls.values():
            assert "by the process that opened" in child(call)
            child.end()
        total = int(mosaic.image().astype(np.int64).sum())
        assert child(lambda: int(mosaic.image().astype(np.int64).sum())) == str(total)


def in_threads(*calls):
    """Make calls at the same time; returns what they raised."""
    errors, begin = [], threading.Barrier(len(calls))

    def run(call):
        begin.wait()
        try:
            call()
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=run, args=(call,), daemon=True) for call in calls]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive(), "they wait for each other"
    return errors


@pytest.mark.parametrize("stored", [False, True])
def test_threads_add_and_read_in_turns(tmp_path, stored):
    mosaic = on_disk(tmp_path) if stored else ipm_rs.Mosaic(0.1, tile=64)
    add(mosaic, range(1))
    sys.setswitchinterval(1e-5)
    try:
        (low, high), y = mosaic.bounds

        def read():
            for _ in range(20):
                mosaic.layers((low, high), y)
                assert mosaic.tiles and mosaic.bounds and mosaic.nbytes and repr(mosaic)

        errors = in_threads(lambda: add(mosaic, range(1, LENGTH, 2)), lambda: add(mosaic, range(2, LENGTH, 2)), read)
    finally:
        sys.setswitchinterval(5e-3)
    assert not errors
    alone = ipm_rs.Mosaic(0.1, tile=64)
    add(alone, range(LENGTH))
    assert mosaic.frames == LENGTH
    assert_same(mosaic, alone)
    mosaic.close()


def test_maps_that_are_merged_into_each_other_do_not_wait_for_ever():
    one, other = ipm_rs.Mosaic(0.1, tile=64), ipm_rs.Mosaic(0.1, tile=64)
    image, pose = frame(0)
    for mosaic in (one, other):
        mosaic.add(camera(), image, map_from_vehicle=pose, distance=(1, 9))
    assert not in_threads(lambda: one.merge(other), lambda: other.merge(one))
    assert sorted((one.frames, other.frames)) == [2, 3], "one after the other"


def test_a_call_waits_until_the_other_is_done(monkeypatch):
    mosaic, entered, go, seen = ipm_rs.Mosaic(0.1, tile=64), threading.Event(), threading.Event(), []
    inner = ipm_rs.Mosaic._accumulate

    def slow(self, plan, threads):
        self._broken = True  # as in the middle of a frame
        entered.set()
        assert go.wait(30)
        self._broken = False
        return inner(self, plan, threads)

    monkeypatch.setattr(ipm_rs.Mosaic, "_accumulate", slow)
    adding = threading.Thread(target=add, args=(mosaic, range(1)), daemon=True)
    adding.start()
    assert entered.wait(30)
    reading = threading.Thread(target=lambda: seen.append(mosaic.layers()), daemon=True)
    reading.start()
    reading.join(0.3)
    assert reading.is_alive() and not seen
    go.set()
    reading.join(30)
    adding.join(30)
    assert seen[0]["count"].max() == 1
    twin = pickle.loads(pickle.dumps(mosaic))
    assert_same(twin, mosaic)
