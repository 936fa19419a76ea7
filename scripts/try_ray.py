#!/usr/bin/env python3
"""Show that a cluster gives what one process gives, also when a worker is killed; and what a frame costs.

    .venv/bin/python scripts/try_ray.py [--frames 300] [--stages]

Needs the extra ``ray``. It starts a cluster of two CPUs on this machine, warps road pictures of 2048 x 1024 with one
worker and with two, kills one of two in the middle, and compares all files with those of one process. ``--stages``
measures instead what decoding, warping, encoding and moving a frame costs. Prints figures; fails where files differ.
"""

from __future__ import annotations

import argparse
import io
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

import ipm_rs
from ipm_rs import scene, streams
from ipm_rs.files import images

WIDTH, HEIGHT = 2048, 1024
K = [[2262.5, 0, 1096.98], [0, 2265.3, 513.14], [0, 0, 1]]
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(WIDTH, HEIGHT), position=(1.7, 0.1, 1.22), pitch=0.038, yaw=-0.02)
GRID = ipm_rs.BevGrid(x=(7, 50), y=(-10, 10), resolution=(0.05, 0.025))


def picture() -> np.ndarray:
    """Return a road as the camera sees it, with the grain of a sensor."""
    road = scene.render(CAMERA)
    grain = np.random.default_rng(1).normal(0, 3, road.shape)
    return np.clip(road + grain, 0, 255).astype(np.uint8)


def write_frames(folder: Path, count: int) -> None:
    """Write so many different JPEGs."""
    folder.mkdir()
    road = picture()
    for number in range(count):
        Image.fromarray(np.roll(road, 3 * number, axis=1)).save(folder / f"{number:04}.jpg", quality=90)


def workers_of_mine(at_work_on: str = "MapWorker") -> list[int]:
    """Return the process ids of the actors, or tasks, of this name of the cluster that this process started."""
    parents, names = {}, {}
    for place in Path("/proc").iterdir():
        if place.name.isdecimal():
            try:
                parents[int(place.name)] = int((place / "stat").read_text().rpartition(")")[2].split()[1])
                names[int(place.name)] = (place / "cmdline").read_text()
            except OSError:  # it has ended
                continue
    me = os.getpid()
    return [
        pid for pid, name in names.items() if name.startswith(f"ray::{at_work_on}") and me in ancestors(pid, parents)
    ]


def ancestors(pid: int, parents: dict[int, int]) -> set[int]:
    """Return the processes that a process descends from."""
    found: set[int] = set()
    while (pid := parents.get(pid, 0)) and pid not in found:
        found.add(pid)
    return found


def kill_one(killed: list[int]) -> None:
    """Kill the first worker that there is, and note it."""
    pids = workers_of_mine()
    print(f"  killing worker {pids[0]} of {len(pids)}", flush=True)
    os.kill(pids[0], signal.SIGKILL)
    killed.append(pids[0])


class Run:
    """What is noted of a run, in which a worker is killed when so many frames are done."""

    def __init__(self, kill_at: int | None) -> None:
        self.kill_at, self.done, self.killed = kill_at, 0, []
        self.moments: list[tuple[float, int]] = []

    def report(self, count: int, _: list[ipm_rs.IpmError]) -> None:
        """Note a partition that is done."""
        self.done += count
        self.moments.append((time.perf_counter(), count))
        if self.kill_at is not None and self.done >= self.kill_at:
            self.kill_at = None
            threading.Thread(target=kill_one, args=(self.killed,)).start()

    def rate(self) -> float:
        """Return frames a second; the first partitions come after the actors have started, which is not the frames'."""
        return sum(count for _, count in self.moments[2:]) / (self.moments[-1][0] - self.moments[1][0])


def same(one: Path, other: Path) -> bool:
    """Say whether two folders hold the same pictures, to the byte."""
    names = sorted(path.name for path in one.glob("*_bev.png"))
    return names == sorted(path.name for path in other.glob("*_bev.png")) and all(
        (one / name).read_bytes() == (other / name).read_bytes() for name in names
    )


def cluster(folder: Path, frames: int) -> None:
    """Compare one process, one worker, two, and two of which one is killed."""
    import ray

    lut = ipm_rs.Lut(CAMERA, GRID)
    write_frames(folder / "frames", frames)
    begin = time.perf_counter()
    streams.warp(streams.open(folder / "frames"), lut, folder / "one", jobs=1)
    print(f"one process, one job: {frames / (time.perf_counter() - begin):.1f} frames/s")
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
    rates: dict[int, float] = {}
    for workers, kill in ((2, True), (1, False), (2, False)):
        out, run = folder / f"out-{workers}-{kill}", Run(frames // 3 if kill else None)
        summary = ipm_rs.ray.warp_files(folder / "frames", lut, out, workers=workers, partition=10, report=run.report)
        alike = same(folder / "one", out)
        what = f"{workers} worker{'s' * (workers > 1)}{', one killed in the middle' * kill}"
        print(f"{what}: {run.rate():.1f} frames/s, {summary.done} done, files equal: {alike}", flush=True)
        assert alike and summary.done == frames and not summary.failed and bool(run.killed) == kill
        if not kill:
            rates[workers] = run.rate()
    print(f"two workers / one: {rates[2] / rates[1]:.2f}")
    ray.shutdown()


def stages() -> None:
    """Print what a frame costs, in CPU time of this process, by stage."""
    import ray

    lut, road = ipm_rs.Lut(CAMERA, GRID), picture()
    data = images.encode(".jpg", road, images.Look("RGB"))
    view = lut.warp(road, threads=1)
    print(f"frame {len(data)} bytes of JPEG, {road.nbytes} of pixels; view {view.nbytes} bytes")
    work: dict[str, Callable[[], object]] = {
        "decode JPEG": lambda: images.decode(data, "a"),
        "warp bilinear": lambda: lut.warp(road, threads=1),
        "warp area": lambda: lut.warp(road, threads=1, interpolation="area"),
        "encode PNG, level 1": lambda: images.encode(".png", view, images.Look("RGB")),
        "encode JPEG": lambda: images.encode(".jpg", view, images.Look("RGB")),
    }
    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
    work["store and fetch the pixels"] = lambda: ray.get(ray.put(road)).sum(dtype="u8", axis=None, where=False)
    work["store and fetch the JPEG"] = lambda: ray.get(ray.put(data))
    for name, job in work.items():
        times = []
        for _ in range(30):
            begin, wall = time.process_time(), time.perf_counter()
            job()
            times.append((1e3 * (time.process_time() - begin), 1e3 * (time.perf_counter() - wall)))
        print(f"{name}: {min(cpu for cpu, _ in times):.2f} ms of CPU, {min(wall for _, wall in times):.2f} ms of clock")
    for ending in (".png", ".jpg"):
        file = io.BytesIO(images.encode(ending, view, images.Look("RGB")))
        print(f"view as {ending}: {len(file.getvalue())} bytes")
    ray.shutdown()


def main() -> None:
    """Run what was asked for, in a folder that is removed at the end."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--stages", action="store_true")
    args = parser.parse_args()
    if args.stages:
        stages()
        return
    with tempfile.TemporaryDirectory(prefix="ipm-rs-ray-") as folder:
        cluster(Path(folder), args.frames)


if __name__ == "__main__":
    main()
