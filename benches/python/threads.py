"""Compare the throughput of two Python threads warping at once, each call on one thread, with that of one.

python benches/python/threads.py             print ipm_rs and OpenCV, best of five runs
python benches/python/threads.py --seconds 2 longer runs
"""

from __future__ import annotations

import argparse
import os
import threading
import time
from collections.abc import Callable

import cv2
import numpy as np

from adapters import OURS, WARPS
from jobs import JOBS, Scene

RUNS = 5
LIBRARIES = (OURS, "OpenCV remap, CV_16SC2 maps", "OpenCV remap, float32 maps")


def throughput(calls: list[Callable[[], object]], seconds: float) -> float:
    """Count the calls per second of Python threads, one for each of `calls`, all at once."""
    barrier, done = threading.Barrier(len(calls) + 1), [0] * len(calls)
    stop = False

    def work(index: int, call: Callable[[], object]) -> None:
        call()
        barrier.wait()
        while True:
            call()
            done[index] += 1
            if stop:
                return

    workers = [threading.Thread(target=work, args=item) for item in enumerate(calls)]
    for worker in workers:
        worker.start()
    barrier.wait()
    began = time.perf_counter()
    time.sleep(seconds)
    stop = True
    for worker in workers:
        worker.join()
    return sum(done) / (time.perf_counter() - began)


def scaling(scene: Scene, name: str, seconds: float) -> tuple[float, float, float]:
    """Measure calls per second of one thread, then of two, in each run; the ratio is that of the best run."""
    job = JOBS[0]
    image = scene.image(job)
    # an output of its own for each thread
    calls = [call for _ in range(2) if (call := WARPS[name](scene, job, image, 1))]
    runs = [(throughput(calls[:1], seconds), throughput(calls, seconds)) for _ in range(RUNS)]
    one, two = np.median(np.array(runs), axis=0)
    return float(one), float(two), max(both / alone for alone, both in runs)


def measure(seconds: float) -> dict[str, tuple[float, float, float]]:
    """Measure every library; the result goes to the page of benchmarks too."""
    cv2.setNumThreads(1)
    scene = Scene()
    return {name: scaling(scene, name, seconds) for name in LIBRARIES}


def main() -> None:
    """Print what two threads get done, beside one."""
    parser = argparse.ArgumentParser(description="Throughput of two Python threads beside that of one.")
    parser.add_argument("--seconds", type=float, default=0.5, help="length of a run (default: 0.5)")
    arguments = parser.parse_args()
    print(f"{JOBS[0].name}; {os.cpu_count()} CPUs, load average {os.getloadavg()[0]:.1f}; best of {RUNS} runs")
    for name, (one, two, best) in measure(arguments.seconds).items():
        print(f"{name:30s} one {one:7.0f}/s   two {two:7.0f}/s   best ratio {best:.2f}")


if __name__ == "__main__":
    main()
