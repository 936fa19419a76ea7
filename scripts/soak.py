"""Threads, forks, signals and changes of the pool, all at once and for long: `python scripts/soak.py --seconds 1800`.

Every answer is compared with one that was made alone before; a child of a fork must answer too and end; memory must
be where it was after the first minute. Prints a line a minute; exit status 1 says what went wrong.
"""

from __future__ import annotations

import argparse
import gc
import os
import random
import signal
import sys
import threading
import time
import warnings

import numpy as np
from process_memory import resident

import ipm_rs

# MB by which memory may grow after the first quarter: allocators keep something of every thread.
GROWTH = 24
# Seconds within which a child must have answered.
CHILD = 60


class Work:
    """Jobs with known answers."""

    def __init__(self) -> None:
        intrinsics = [[320.0, 0, 319.5], [0, 320.0, 239.5], [0, 0, 1]]
        camera = ipm_rs.Camera.from_euler(intrinsics, image_size=(640, 480), position=(0, 0, 1.5), pitch=0.2)
        left = ipm_rs.Camera.from_euler(intrinsics, image_size=(640, 480), position=(0, 0.5, 1.5), pitch=0.2, yaw=0.6)
        grid = ipm_rs.BevGrid(x=(2, 26), y=(-8, 8), resolution=0.05)
        generator = np.random.default_rng(3)
        self.image = generator.integers(0, 256, (480, 640, 3), dtype=np.uint8)
        self.points = generator.normal(8, 6, (300_000, 3)).astype(np.float32)
        self.camera, self.grid = camera, grid
        self.lut = ipm_rs.Lut(camera, grid)
        self.ring = ipm_rs.RigLut(ipm_rs.Rig({"front": camera, "left": left}), grid)
        self.jobs = [
            lambda: self.lut.warp(self.image),
            lambda: self.lut.warp(self.image, interpolation="nearest"),
            lambda: self.lut.warp(self.image, interpolation="area"),
            lambda: ipm_rs.Lut(self.camera, self.grid).mask,
            lambda: self.ring.warp({"front": self.image, "left": self.image}),
            lambda: ipm_rs.rasterize(self.points, self.grid, reduce=("count", "max"))["count"],
            lambda: self.camera.project(self.points)[0],
        ]
        self.answers = [job() for job in self.jobs]

    def try_one(self, chance: random.Random) -> None:
        """Do a job and compare."""
        which = chance.randrange(len(self.jobs))
        if not np.array_equal(self.jobs[which](), self.answers[which], equal_nan=True):
            raise AssertionError(f"job {which} has another answer than alone")


def in_child(work: Work, seed: int) -> None:
    """Fork; the child does some work, and must end well and in time."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python warns of forks beside threads, which is the point
        child = os.fork()
    if child == 0:
        try:
            signal.setitimer(signal.ITIMER_REAL, 0)
            chance = random.Random(seed)
            for _ in range(3):
                work.try_one(chance)
            os._exit(0)
        except BaseException as error:  # whatever it was, the parent must hear of it
            print(f"child: {error!r}", file=sys.stderr, flush=True)
            os._exit(1)
    deadline = time.monotonic() + CHILD
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            raise AssertionError(f"a child of a fork did not answer within {CHILD} s")
        time.sleep(0.005)
    if status != 0:
        raise AssertionError(f"a child of a fork ended with {status}")


def main() -> int:
    """Run until the time is up or something went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--threads", type=int, default=4, help="of Python (default: %(default)s)")
    arguments = parser.parse_args()
    work, problems, stop = Work(), [], threading.Event()
    done = [0] * (arguments.threads + 1)
    signals = 0

    def on_alarm(*_: object) -> None:
        nonlocal signals
        signals += 1

    def busy(index: int) -> None:
        chance = random.Random(index)
        try:
            while not stop.is_set():
                work.try_one(chance)
                if chance.random() < 0.02:
                    ipm_rs.set_num_threads(chance.choice([1, 2, 3, 4, 8]))
                done[index] += 1
        except BaseException as error:  # a thread's error would be lost
            problems.append(f"thread {index}: {error!r}")
            stop.set()

    signal.signal(signal.SIGALRM, on_alarm)
    signal.setitimer(signal.ITIMER_REAL, 0.01, 0.013)
    threads = [threading.Thread(target=busy, args=(index,)) for index in range(arguments.threads)]
    for thread in threads:
        thread.start()
    started, told, forks, settled = time.monotonic(), 0, 0, None
    chance = random.Random(99)
    while not stop.is_set() and (elapsed := time.monotonic() - started) < arguments.seconds:
        try:
            in_child(work, forks)
            forks += 1
            work.try_one(chance)
            done[-1] += 1
        except BaseException as error:  # the threads must be told
            problems.append(repr(error))
            break
        if settled is None and elapsed > arguments.seconds / 4:
            gc.collect()
            settled = resident()
        if elapsed // 60 > told:
            told = int(elapsed // 60)
            print(f"{told} min: {sum(done)} jobs, {forks} forks, {signals} signals, {resident():.0f} MB", flush=True)
    stop.set()
    for thread in threads:
        thread.join()
    signal.setitimer(signal.ITIMER_REAL, 0)
    gc.collect()
    grown = resident() - (settled if settled is not None else resident())
    if grown > GROWTH:
        problems.append(f"memory grew by {grown:.0f} MB")
    for problem in problems:
        print(problem, file=sys.stderr)
    print(
        f"{sum(done)} jobs, {forks} forks, {signals} signals, memory grew by {grown:.0f} MB: {len(problems)} problems"
    )
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
