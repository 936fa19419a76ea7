"""Views without aliasing: `interpolation="area"` beside OpenCV's bilinear remap and its 4 x 4 supersampling.

The seed job's camera and stretch of road, in cells of three sizes that all are sampled at their centres. Answers are
compared with the mean over the cell; bilinear's is far from it, and its time is what area's is held against.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import ipm_rs
from adapters import OURS, Call, cv2_remap, ipm
from jobs import Job, Scene, bilinear
from timing import collection_off, interleaved, milliseconds

CELLS = {"5 x 2.5 cm": (0.05, 0.025), "10 cm": (0.1, 0.1), "20 cm": (0.2, 0.2)}

JOBS = (
    Job("uint8 x 3, area, 5 x 2.5 cm", "uint8", 3, "area", 7.5, "5 x 2.5 cm"),
    Job("uint8 x 3, area, 10 cm", "uint8", 3, "area", 6.0, "10 cm"),
    Job("uint8 x 3, area, 20 cm", "uint8", 3, "area", 4.2, "20 cm"),
    Job("uint8 x 1, area, 10 cm", "uint8", 1, "area", 6.0, "10 cm"),
    Job("uint16 x 3, area, 10 cm", "uint16", 3, "area", 6.0 * 257, "10 cm"),
    Job("float32 x 3, area, 10 cm", "float32", 3, "area", 6.0, "10 cm"),
)
"""Tolerances are of the root-mean-square difference, a seventh above what was measured: 6.6, 5.2 and 3.6.

White noise is the worst that there is, for every pixel at a footprint's rim counts. The exact mean ends at the edge of
the cell; area's footprints have soft rims and are never narrower than a pixel, hence its 6.6 where most cells are.
Bilinear is 16, 29 and 31 grey levels off, 4 x 4 samples 1.0, 4.6 and 7.0. What this means on a road: ground_truth.py.
"""

BILINEAR, REMAP = f"{OURS} bilinear", "OpenCV remap, bilinear"
SUPERSAMPLED = "OpenCV remap of 4 x 4 samples, INTER_AREA"

_SUPERSAMPLED_BOUNDS = {
    ("uint8 x 3, area, 10 cm", SUPERSAMPLED): 10.0,
    ("uint8 x 3, area, 20 cm", SUPERSAMPLED): 5.0,
}
BOUNDS = {
    "avx512": {
        ("uint8 x 3, area, 5 x 2.5 cm", REMAP): 1.0,
        ("uint8 x 3, area, 10 cm", REMAP): 1 / 1.5,
        ("uint8 x 3, area, 20 cm", REMAP): 1 / 2.2,
        **_SUPERSAMPLED_BOUNDS,
    },
    "avx2": {
        ("uint8 x 3, area, 5 x 2.5 cm", REMAP): 1 / 0.95,
        ("uint8 x 3, area, 10 cm", REMAP): 1 / 1.6,
        ("uint8 x 3, area, 20 cm", REMAP): 1 / 3.5,
        **_SUPERSAMPLED_BOUNDS,
    },
}
"""What this version set out to reach on one thread with these instruction sets: how many times faster than OpenCV."""
BUILD_BOUND = 3.0
"""At most so many times the table's own time may table and plan take, on one thread."""

SAMPLES = 16
"""A side, of the exact mean over a cell; twice as many move it by 0.6 grey levels at 20 cm, and no error by 0.1."""
COMPARED = 2048
"""Cells, picked at random: all 690,000 take half a minute, and others give the same error within 3 %."""


def measure(threads: int, rounds: int, seconds: float) -> dict[str, dict[str, Any]]:
    """Check and time every job, then what each size of cells needs."""
    ipm_rs.set_num_threads(threads)
    scenes = {name: Scene(cell=cell) for name, cell in CELLS.items()}
    warps = {}
    for job in JOBS:
        print(f"{job.name}, threads {threads}", file=sys.stderr, flush=True)
        warps[job.name] = measure_warps(scenes[job.scene], job, threads, rounds, seconds)
    return {"warps": warps, "builds": {name: measure_build(scene, threads, rounds) for name, scene in scenes.items()}}


def measure_warps(scene: Scene, job: Job, threads: int, rounds: int, seconds: float) -> dict[str, Any]:
    """Check and time one job.

    The supersampling takes turns with area alone: beside a call of up to 70 ms the others would lose their caches (see
    `heats` in peers.py). Its row has area's median of that heat as "ours".
    """
    image, plain = scene.image(job), replace(job, interpolation="bilinear")
    ours = ipm(scene, job, image, threads)
    remap = cv2_remap(scene, plain, image, threads)
    quick: dict[str, Call] = {OURS: ours, BILINEAR: ipm(scene, plain, image, threads), REMAP: remap}
    slow: dict[str, Call] = {OURS: ours, SUPERSAMPLED: supersampled(scene, job, image)}
    cells = well_inside(scene)
    exact = means(scene, image, cells)
    rows: dict[str, Any] = {}
    for name, call in {**quick, **slow}.items():
        difference = call()[cells].astype(np.float64) - exact
        error = float(np.sqrt((difference**2).mean()))
        rows[name] = {"error": f"{error:.2f}", "agrees": error <= job.tolerance}
    if not rows[OURS]["agrees"]:
        raise SystemExit(f"{job.name}: ipm_rs is wrong by {rows[OURS]['error']}; nothing was timed")
    beside = interleaved(slow, min(rounds, 30), seconds)
    rows[SUPERSAMPLED] |= beside[SUPERSAMPLED].as_dict() | {"ours": beside[OURS].median}
    for name, times in interleaved(quick, rounds, seconds).items():
        rows[name] |= times.as_dict()
    return rows


def supersampled(scene: Scene, job: Job, image: NDArray[np.generic]) -> Call:
    """OpenCV's way to a mean: bilinear onto cells of a quarter of the size, averaged by `resize`."""
    dx, dy = scene.resolution
    fine = Scene(cell=(dx / 4, dy / 4))
    maps, (rows, columns) = fine.maps, scene.shape
    sampled = np.empty((*fine.shape, *job.shape_suffix), job.dtype)
    out = np.empty((rows, columns, *job.shape_suffix), job.dtype)

    def call() -> NDArray[np.generic]:
        cv2.remap(image, *maps, cv2.INTER_LINEAR, dst=sampled)
        return cv2.resize(sampled, (columns, rows), dst=out, interpolation=cv2.INTER_AREA)

    return call


def well_inside(scene: Scene) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pick rows and columns of cells whose corners lie in the image, two pixels from its edge."""
    width, height = scene.source_size
    (rows, columns), inside = scene.shape, np.ones(scene.shape, bool)
    for down, across in ((-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)):
        u, v = scene.project(np.arange(columns) + across, np.arange(rows)[:, None] + down)
        inside &= (u > 2) & (u < width - 3) & (v > 2) & (v < height - 3)
    cells = np.random.default_rng(0).choice(np.flatnonzero(inside), COMPARED, replace=False)
    return np.unravel_index(cells, scene.shape)


def means(
    scene: Scene, image: NDArray[np.generic], cells: tuple[NDArray[np.intp], NDArray[np.intp]]
) -> NDArray[np.float64]:
    """Average exact samples over each of the cells, in float64 and from nobody's table."""
    row, column = (index[:, None] for index in cells)
    into_cell = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    lines = (bilinear(image, *scene.project(column + into_cell, row + down)).mean(axis=1) for down in into_cell)
    return sum(lines) / SAMPLES


def measure_build(scene: Scene, threads: int, rounds: int) -> dict[str, float]:
    """Medians over fresh tables: milliseconds of the table and of what the first area warp adds to it, and their bytes.

    What it adds is its time less that of the second one.
    """
    job, lut = JOBS[0], None
    image = scene.image(job)
    out = np.zeros((*scene.shape, *job.shape_suffix), job.dtype)

    def build() -> None:
        nonlocal lut
        lut = ipm_rs.Lut(scene.camera, scene.grid)

    def warp() -> None:
        lut.warp(image, interpolation="area", out=out, threads=threads)

    table, adds = [], []
    with collection_off():
        for _ in range(max(rounds, 3)):
            lut = None  # the last one goes away while no clock runs
            table.append(milliseconds(build))
            nbytes = lut.nbytes
            adds.append(milliseconds(warp) - milliseconds(warp))
    return {
        "table": float(np.median(table)),
        "plan": float(np.median(adds)),
        "table_bytes": nbytes,
        "plan_bytes": lut.nbytes - nbytes,
    }
