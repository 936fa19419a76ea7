"""Compare ipm_rs with OpenCV and other libraries on one job: answers first, then times.

python benches/python/peers.py                              print the tables
python benches/python/peers.py --write docs/benchmarks.md   write the page too (`make bench-peers`)
python benches/python/peers.py --quick                      a few rounds: does the comparison itself still work?
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import cv2

import areas
import cells
import clouds
import ipm_rs
import threads as python_threads
from adapters import BUILDS, FRAMES, LENS_BUILDS, OURS, WARPS, Adapter, Call
from jobs import JOBS, LENSES, Job, Scene
from report import environment, page
from timing import interleaved

OTHER_ISAS = ("avx2",)
"""Instruction sets to measure besides the best, where this machine has them."""


def measure_warps(
    scene: Scene, job: Job, threads: int, rounds: int, seconds: float, adapters: dict[str, Adapter] = WARPS
) -> dict[str, Any]:
    """Check and time every library that can do the job; all of them on the seed job alone."""
    image = scene.image(job)
    exact = scene.exact(job, image)
    if job.scene != "seed":
        adapters = {name: adapter for name, adapter in adapters.items() if name.startswith((OURS, "OpenCV"))}
    calls = {name: call for name, adapter in adapters.items() if (call := adapter(scene, job, image, threads))}
    rows: dict[str, Any] = {}
    for name, call in calls.items():
        error = scene.error(job, exact, call())
        shown = f"{error:.2%}" if job.interpolation == "nearest" else f"{error:.2f}"
        rows[name] = {"error": shown, "agrees": error <= job.tolerance}
    if not rows[OURS]["agrees"]:
        raise SystemExit(f"{job.name}: ipm_rs is wrong by {rows[OURS]['error']}; nothing was timed")
    for heat in heats(calls):
        for name, times in interleaved(heat, rounds, seconds).items():
            rows[name].update(times.as_dict())
    return rows


def heats(calls: dict[str, Call]) -> list[dict[str, Call]]:
    """Split calls into those that take turns with each other: ipm_rs and OpenCV, and all others."""
    sides = {True: {}, False: {}}
    for name, call in calls.items():
        sides[name.startswith((OURS, "OpenCV"))][name] = call
    return [heat for heat in sides.values() if heat]


def measure_builds(scene: Scene, threads: int, rounds: int, seconds: float) -> dict[str, Any]:
    """Time the ways from a calibration to a table; the maps must be those of the scene where it sees the image."""
    calls = {name: call for name, adapter in BUILDS.items() if (call := adapter(scene, threads))}
    for name, call in calls.items():
        maps = call()
        if maps is not None:
            worst = max(abs(found - true)[scene.inside].max() for found, true in zip(maps, scene.uv, strict=True))
            if not worst < 1e-2:
                raise SystemExit(f"{name}: its maps are off by {worst:.3g} px; nothing was timed")
    return {name: times.as_dict() for name, times in interleaved(calls, rounds, seconds).items()}


def measure_lens_builds(scene: Scene, threads: int, rounds: int, seconds: float) -> dict[str, dict[str, Any]]:
    """Time the ways from a camera with a lens to a table; every one must agree with the NumPy reference."""
    results = {}
    for lens_name, lens in LENSES.items():
        camera, exact = scene.through(lens)
        width, height = camera.image_size
        (u, v), margin = exact, 1e-2
        inside = (u > margin) & (u < width - 1 - margin) & (v > margin) & (v < height - 1 - margin)
        calls = {name: adapter(scene, camera, threads) for name, adapter in LENS_BUILDS.items()}
        for name, call in calls.items():
            maps = call() or ipm_rs.Lut(camera, scene.grid).maps()
            worst = max(abs(found - true)[inside].max() for found, true in zip(maps, exact, strict=True))
            if not worst < 1e-3:
                raise SystemExit(f"{name}, {lens_name}: its maps are off by {worst:.3g} px; nothing was timed")
        times = interleaved(calls, rounds, seconds).items()
        results[lens_name] = {name: taken.as_dict() | {"agrees": True} for name, taken in times}
    return results


def measure(threads: int, only: str | None, rounds: int, seconds: float) -> dict[str, Any]:
    """Measure everything with one number of threads, or only the warps whose name begins so."""
    cv2.setNumThreads(threads)
    scenes = {name: Scene(name) for name in ("seed", "large", "small")}
    warps = {}
    for job in JOBS:
        if only is None or job.name.startswith(only):
            print(f"{job.name}, threads {threads}, {ipm_rs.cpu_info()['isa']}", file=sys.stderr, flush=True)
            warps[job.name] = measure_warps(scenes[job.scene], job, threads, rounds, seconds)
    result = {"warps": warps}
    if only is None:
        seed = scenes["seed"]
        result["builds"] = measure_builds(seed, threads, rounds, seconds)
        result["lens_builds"] = measure_lens_builds(seed, threads, rounds, seconds)
        result["frames"] = measure_warps(seed, JOBS[0], threads, rounds, seconds, FRAMES)
        result["areas"] = areas.measure(threads, rounds, seconds)
        result["clouds"] = clouds.measure(threads, rounds, seconds)
        result["coverage"] = float(seed.lut.mask.mean())
        result["environment"] = environment()
        if threads == 1:
            result["cells"] = cells.measure(min(rounds, 30), seconds)
            result["python_threads"] = python_threads.measure(seconds / 4)
    return result


def in_child(threads: int, arguments: argparse.Namespace, isa: str | None = None) -> dict[str, Any]:
    """Measure in a new process: some libraries read their number of threads from the environment, once."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder, "result.json")
        names = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        variables = os.environ | dict.fromkeys(names, str(threads)) | {"IPM_RS_NUM_THREADS": str(threads)}
        command = [sys.executable, __file__, "--child", str(threads), "--result", str(result)]
        command += ["--quick"] if arguments.quick else ["--seconds", str(arguments.seconds)]
        if isa:
            variables["IPM_RS_ISA"] = isa
            command += ["--only", "uint8"]
        subprocess.run(command, check=True, env=variables)
        return json.loads(result.read_text())


def main() -> None:
    """Run the comparison once per number of threads and put the results together."""
    parser = argparse.ArgumentParser(description="Compare ipm_rs with other libraries: answers first, then times.")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2], help="numbers of threads (default: 1 2)")
    parser.add_argument("--quick", action="store_true", help="a few rounds only; the times mean little")
    parser.add_argument("--seconds", type=float, default=2.0, help="at most so long for each call (default: 2)")
    parser.add_argument("--write", type=Path, metavar="FILE", help="write the page of results here")
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--only", help=argparse.SUPPRESS)
    parser.add_argument("--result", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        rounds, seconds = (1, 0.0) if arguments.quick else (100, arguments.seconds)
        arguments.result.write_text(json.dumps(measure(arguments.child, arguments.only, rounds, seconds)))
        return
    if arguments.quick and arguments.write:
        parser.error("--quick measures too little to be written down; leave out one of --quick and --write")

    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    runs = {str(threads): in_child(threads, arguments) for threads in arguments.threads}
    first, *_ = runs.values()
    results = {
        "coverage": first["coverage"],
        "environment": [*first["environment"], f"* load average {load:.1f} when the measurement began"],
        "warps": {threads: run["warps"] for threads, run in runs.items()},
        "builds": {threads: run["builds"] for threads, run in runs.items()},
        "lens_builds": {threads: run["lens_builds"] for threads, run in runs.items()},
        "frames": {threads: run["frames"] for threads, run in runs.items()},
        "areas": {threads: run["areas"] for threads, run in runs.items()},
        "clouds": {threads: run["clouds"] for threads, run in runs.items()},
        "cells": next((run["cells"] for run in runs.values() if "cells" in run), {}),
        "python_threads": next((run["python_threads"] for run in runs.values() if "python_threads" in run), {}),
        "isas": {},
    }
    for isa in OTHER_ISAS:
        if isa in ipm_rs.cpu_info()["available_isas"] and isa != ipm_rs.cpu_info()["isa"]:
            results["isas"][isa] = in_child(1, arguments, isa)["warps"]
    text = page(results)
    if arguments.quick:
        warped_areas = [run["warps"] for run in results["areas"].values()]
        measured = [*results["warps"].values(), *warped_areas, *results["clouds"].values()]
        rows = [row for jobs in measured for job in jobs.values() for row in job.values()]
        print(f"{len(rows)} answers checked, {sum(row['agrees'] for row in rows)} agree with the exact one")
        return
    print(text)
    if arguments.write:
        arguments.write.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
