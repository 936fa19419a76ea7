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

from adapters import BUILDS, OURS, WARPS
from jobs import JOBS, Job, Scene
from report import environment, page
from timing import interleaved


def measure_warps(scene: Scene, job: Job, threads: int, rounds: int, seconds: float) -> dict[str, Any]:
    """Check and time every library that can do the job."""
    image = scene.image(job)
    exact = scene.exact(job, image)
    calls = {name: call for name, adapter in WARPS.items() if (call := adapter(scene, job, image, threads))}
    rows: dict[str, Any] = {}
    for name, call in calls.items():
        error = scene.error(job, exact, call())
        shown = f"{error:.2%}" if job.interpolation == "nearest" else f"{error:.2f}"
        rows[name] = {"error": shown, "agrees": error <= job.tolerance}
    if not rows[OURS]["agrees"]:
        raise SystemExit(f"{job.name}: ipm_rs is wrong by {rows[OURS]['error']}; nothing was timed")
    for name, times in interleaved(calls, rounds, seconds).items():
        rows[name].update(times.as_dict())
    return rows


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


def measure(threads: int, rounds: int, seconds: float) -> dict[str, Any]:
    """Measure everything with one number of threads."""
    cv2.setNumThreads(threads)
    scene = Scene()
    warps = {}
    for job in JOBS:
        print(f"{job.name}, threads {threads}", file=sys.stderr, flush=True)
        warps[job.name] = measure_warps(scene, job, threads, rounds, seconds)
    builds = measure_builds(scene, threads, rounds, seconds)
    return {"warps": warps, "builds": builds, "coverage": float(scene.lut.mask.mean()), "environment": environment()}


def in_child(threads: int, arguments: argparse.Namespace) -> dict[str, Any]:
    """Measure in a new process: some libraries read their number of threads from the environment, once."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder, "result.json")
        names = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        variables = os.environ | dict.fromkeys(names, str(threads))
        command = [sys.executable, __file__, "--child", str(threads), "--result", str(result)]
        command += ["--quick"] if arguments.quick else []
        subprocess.run(command, check=True, env=variables)
        return json.loads(result.read_text())


def main() -> None:
    """Run the comparison once per number of threads and put the results together."""
    parser = argparse.ArgumentParser(description="Compare ipm_rs with other libraries: answers first, then times.")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2], help="numbers of threads (default: 1 2)")
    parser.add_argument("--quick", action="store_true", help="a few rounds only; the times mean little")
    parser.add_argument("--write", type=Path, metavar="FILE", help="write the page of results here")
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--result", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        rounds, seconds = (1, 0.0) if arguments.quick else (100, 2.0)
        arguments.result.write_text(json.dumps(measure(arguments.child, rounds, seconds)))
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
    }
    text = page(results)
    if arguments.quick:
        rows = [row for jobs in results["warps"].values() for job in jobs.values() for row in job.values()]
        print(f"{len(rows)} answers checked, {sum(row['agrees'] for row in rows)} agree with the exact one")
        return
    print(text)
    if arguments.write:
        arguments.write.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
