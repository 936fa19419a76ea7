"""Measure streams against their bounds: `python scripts/try_streams.py [folder] [video] [memory] [resume]`, or all.

folder  200 JPEGs of 2048 x 1024 to PNGs of 860 x 800: two jobs at least 1.7 times as fast as one, and one job within
        1.15 of the CPU time of decoding and encoding alone
video   mp4 of 1080p to an mp4 of 860 x 800: at least 0.85 of the rate at which PyAV decodes and encodes the same sizes
memory  100 000 frames of a synthetic stream: resident memory flat to 5 %
resume  killed at 30 random moments, `--skip-existing` each time: the folder of an undisturbed run

Runs that are compared alternate, and the least of each counts, because other work on the machine only ever adds.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
from PIL import Image
from process_memory import resident

import ipm_rs
from ipm_rs import scene, streams
from ipm_rs.files import images
from ipm_rs.streams import Frame, Stream, Ticket

K = [[2262.52, 0, 1096.98], [0, 2265.3, 513.137], [0, 0, 1]]
CITYSCAPES = ipm_rs.Camera.from_euler(K, image_size=(2048, 1024), position=(1.7, 0.1, 1.22), pitch=0.038, yaw=-0.0195)
GRID = ipm_rs.BevGrid(x=(7, 50), y=(-10, 10), resolution=(0.05, 0.025))
Clock = Callable[[], float]


def least(clock: Clock, rounds: int, *works: Callable[[], Any]) -> list[float]:
    """Return the least time of each work, of rounds in which they alternate."""
    found = [float("inf")] * len(works)
    for _ in range(rounds):
        for number, work in enumerate(works):
            begin = clock()
            work()
            found[number] = min(found[number], clock() - begin)
    return found


def noisy(camera: ipm_rs.Camera) -> np.ndarray:
    """Return a picture of the road that compresses like one of a camera, not like a drawing."""
    picture = scene.render(camera).astype(np.int16)
    return np.clip(picture + np.random.default_rng(0).normal(0, 4, picture.shape), 0, 255).astype(np.uint8)


def folder(work: Path, count: int = 200) -> None:
    """Measure JPEGs to PNGs."""
    (work / "in").mkdir()
    first = work / "in" / "0.jpg"
    Image.fromarray(noisy(CITYSCAPES)).save(first, quality=95)
    for number in range(1, count):
        (work / "in" / f"{number}.jpg").write_bytes(first.read_bytes())
    lut = ipm_rs.Lut(CITYSCAPES, GRID)
    view = lut.warp(images.read(first)[0])

    def run(jobs: int) -> None:
        summary = streams.warp(streams.open(work / "in"), lut, work / f"out{jobs}", jobs=jobs, threads=1)
        assert summary.done == count, summary

    def alone() -> None:
        for path in sorted((work / "in").iterdir()):
            images.read(path)
            images.write(work / "alone.png", view, images.Look("L"), level=1)

    wall_one, wall_two = least(time.perf_counter, 3, lambda: run(1), lambda: run(2))
    cpu_one, cpu_alone = least(time.process_time, 2, lambda: run(1), alone)
    print(f"folder: {count / wall_one:.1f} frames/s with one job, {count / wall_two:.1f} with two:", end=" ")
    print(f"{wall_one / wall_two:.2f} times (at least 1.7)")
    print(f"folder: {1e3 * cpu_one / count:.1f} ms of CPU a frame, decode and encode alone", end=" ")
    print(f"{1e3 * cpu_alone / count:.1f}: {cpu_one / cpu_alone:.3f} times (at most 1.15)", flush=True)


def video(work: Path, count: int = 150) -> None:
    """Measure a video to a video, against PyAV alone."""
    size = (1920, 1080)
    camera = ipm_rs.Camera.from_euler(
        [[1400, 0, 959.5], [0, 1400, 539.5], [0, 0, 1]], image_size=size, position=(1.7, 0, 1.3), pitch=0.06
    )
    picture = noisy(camera)
    with av.open(str(work / "in.mp4"), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"preset": "veryfast"})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for number in range(count):
            frame = av.VideoFrame.from_ndarray(np.roll(picture, 3 * number, axis=1), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    lut = ipm_rs.Lut(camera, GRID)
    views = [np.roll(lut.warp(picture), -2 * number, axis=0) for number in range(8)]

    def ours() -> None:
        assert streams.warp(streams.open(work / "in.mp4"), lut, work / "out.mp4").done == count

    def alone() -> None:
        with av.open(str(work / "in.mp4")) as source, av.open(str(work / "alone.mp4"), "w") as target:
            source.streams.video[0].thread_type = "AUTO"
            stream = target.add_stream("libx264", rate=30, options={"preset": "veryfast", "crf": "20"})
            stream.width, stream.height, stream.pix_fmt = GRID.shape[1], GRID.shape[0], "yuv420p"
            stream.codec_context.thread_type = "AUTO"
            for number, frame in enumerate(source.decode(video=0)):
                frame.to_ndarray(format="rgb24")
                target.mux(stream.encode(av.VideoFrame.from_ndarray(views[number % 8], format="rgb24")))
            target.mux(stream.encode(None))

    wall, wall_alone = least(time.perf_counter, 3, ours, alone)
    cpu, cpu_alone = least(time.process_time, 2, ours, alone)
    print(f"video: {count / wall:.1f} frames/s, PyAV {count / wall_alone:.1f}: {wall_alone / wall:.2f} (at least 0.85)")
    print(f"video: {1e3 * cpu / count:.1f} ms of CPU a frame, PyAV {1e3 * cpu_alone / count:.1f}", flush=True)


def memory(work: Path, count: int = 100_000) -> None:
    """Measure the memory of a long stream."""
    image = np.random.default_rng(0).integers(0, 255, (90, 160, 3), np.uint8)
    camera = ipm_rs.Camera.from_euler(
        [[80, 0, 79.5], [0, 80, 44.5], [0, 0, 1]], image_size=(160, 90), position=(0, 0, 1.4), pitch=0.2
    )
    lut = ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(2, 12), y=(-4, 4), resolution=0.25))
    seen: list[float] = []

    def tickets() -> Iterator[Ticket]:
        for number in range(count):
            name = f"{number:06d}"
            yield Ticket(name, number, number / 30, lambda name=name, number=number: Frame(image.copy(), name, number))

    def report(ticket: Ticket, _: Any) -> None:
        if ticket.index % (count // 20) == count // 20 - 1:
            seen.append(resident())

    summary = streams.warp(Stream("synthetic", tickets, count), lut, work / "out", ending=".npz", report=report)
    assert summary.done == count
    late = seen[2:]
    print(f"memory: {min(late):.1f} to {max(late):.1f} MB after the first tenth,", end=" ")
    print(f"{100 * (max(late) / min(late) - 1):.2f} % (at most 5), {summary.rate:.0f} frames/s", flush=True)


def resume(work: Path, moments: int = 30) -> None:
    """Kill the command again and again, and compare the folder in the end."""
    (work / "in").mkdir()
    camera = ipm_rs.Camera.from_euler(
        [[500, 0, 479.5], [0, 500, 269.5], [0, 0, 1]], image_size=(960, 540), position=(0, 0, 1.4), pitch=0.1
    )
    camera.save(work / "camera.json")
    picture = noisy(camera)
    for number in range(400):
        Image.fromarray(np.roll(picture, number, axis=1)).save(work / "in" / f"{number:04}.jpg")
    command = [sys.executable, "-m", "ipm_rs", "warp", str(work / "camera.json"), str(work / "in"), "--quiet", "-o"]
    subprocess.run([*command, str(work / "whole")], check=True)
    chance, killed = random.Random(0), 0
    for moment in range(moments):
        before = len(list((work / "again").glob("*.png")))
        wanted = before + chance.randrange(1, 2 * (400 - before) // (moments - moment + 1) + 2)
        with subprocess.Popen([*command, str(work / "again"), "--skip-existing"], stderr=subprocess.DEVNULL) as process:
            while process.poll() is None and len(list((work / "again").glob("*.png"))) < wanted:
                time.sleep(0.002)
            time.sleep(chance.uniform(0, 0.02))  # in the middle of whatever comes next
            if process.poll() is None:
                process.send_signal(chance.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGINT)))
                killed += 1
        half = [path.name for path in (work / "again").glob("*") if path.suffix != ".png"]
        assert len(half) <= 2 * killed, half  # what SIGKILL left of the frames in hand
    made = len(list((work / "again").glob("*_bev.png")))
    subprocess.run([*command, str(work / "again"), "--skip-existing"], check=True)
    whole, again = ({p.name: p.read_bytes() for p in (work / name).glob("*.png")} for name in ("whole", "again"))
    assert whole == again and len(whole) == 400
    print(
        f"resume: killed {killed} times, {made} of 400 frames made by then; the folder is equal to an undisturbed run's"
    )


PARTS = {"folder": folder, "video": video, "memory": memory, "resume": resume}


def main(names: list[str]) -> None:
    """Measure."""
    print(f"load average {os.getloadavg()[0]:.1f}, {streams.ordered.cpus()} CPUs")
    for name in names or PARTS:
        with tempfile.TemporaryDirectory(prefix="ipm_rs-") as work:
            PARTS[name](Path(work))


if __name__ == "__main__":
    main(sys.argv[1:])
