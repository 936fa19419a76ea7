"""From measurements to docs/benchmarks.md."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import areas
import clouds
import ipm_rs
from adapters import OURS, OURS_PERSPECTIVE, OURS_REMAP

PACKAGES = (
    "numpy",
    "opencv-python-headless",
    "opencv-python",
    "kornia-rs",
    "torch",
    "pillow",
    "scikit-image",
    "scipy",
)

BOUNDS = {
    "avx512": {
        ("uint8 x 3, bilinear", "1"): 5.5,
        ("uint8 x 3, bilinear", "2"): 5.0,
        ("uint8 x 1, bilinear", "1"): 2.5,
        ("uint16 x 1, bilinear", "1"): 2.0,
        ("uint16 x 3, bilinear", "1"): 2.0,
        ("float32 x 3, bilinear", "1"): 2.0,
        ("float32 x 16, bilinear", "1"): 3.0,
        ("float32 x 1, bilinear", "1"): 1.2,
        ("uint8 x 3, nearest", "1"): 3.0,
        ("uint8 x 1, nearest", "1"): 1.5,
        ("uint8 x 3, bilinear, 3840 x 2160 to 2000 x 2000", "1"): 4.0,
        ("uint8 x 3, bilinear, 3840 x 2160 to 2000 x 2000", "2"): 3.5,
        ("uint8 x 3, bilinear, 64 x 64 to 64 x 64", "1"): 1.0,
        ("uint8 x 3, bilinear; warp_perspective, no table", "1"): 2.0,
        ("uint8 x 3, bilinear; remap, no table", "1"): 2.0,
        ("table of the seed job", "1"): 1 / 0.5,
        ("table through Brown-Conrady, 5 coefficients", "1"): 3.0,
        ("table through equidistant", "1"): 3.0,
        ("a new pose for every frame: table and warp", "1"): 1 / 0.7,
    },
    "avx2": {
        ("uint8 x 3, bilinear", "1"): 4.7,
        ("uint8 x 1, bilinear", "1"): 3.2,
        ("uint8 x 3, nearest", "1"): 3.0,
        ("uint8 x 1, nearest", "1"): 2.2,
    },
}
"""What this version set out to reach on CPUs with these instruction sets: how many times faster than OpenCV."""

HEAD = """\
# Benchmarks

<!-- Written by `make bench-peers`; do not edit by hand. -->

The job is one frame of a Cityscapes camera, 2048 x 1024, warped to the road from 7 to 50 m ahead and 10 m to either
side: 860 x 800 cells of 5 x 2.5 cm. {coverage:.0%} of the cells see the image. The picture is structure plus seeded
noise on every pixel, so that neither caches nor weights are easy.

`make bench-peers` measures all of it again on your machine and rewrites this page.

{environment}

"""

AREA = """
## Area

Each cell the mean of what it covers of the image: 7 to 50 m ahead and 10 m to either side, cells sampled at their
centres. *Error* is the root-mean-square difference from the exact mean over the cell (16 x 16 samples in float64, 2048
cells that lie well inside the image) on a picture that is mostly white noise, the worst case. Bilinear is not meant to
agree: it is the time to compare with. The ratio of the 4 x 4 samples is to ipm_rs in turns with them alone, apart from
the others.
"""

METHOD = """\
## How it was measured

* Every answer is checked before anything is timed: against the definition in float64, at all cells that lie inside the
  image by 0.01 px. *Error* is the largest difference, in units of the image (0 to 255; 0 to 65535 for uint16); for
  nearest it is the share of cells that took another pixel. What exceeds the tolerance is marked "no", and is timed
  but not compared with in the first table. Tolerances: one grey level for uint8, a quarter of a grey level in 256 for
  uint16 and float32, 0.1 % of the cells for nearest.
* One process per thread count. ipm_rs and OpenCV take turns, in rotating order, garbage collection off: each call runs
  twice untimed, so that it finds its own data in the caches, and then four times timed. The other libraries take turns
  among themselves afterwards, slow ones for fewer rounds: a call of 30 ms between them leaves neither ipm_rs nor OpenCV
  the clock and the caches that they have side by side, and what it took from each was not the same.
* Results go into memory allocated beforehand where the library takes it (ipm_rs, OpenCV, SciPy). Maps, tables,
  tensors and planes are prepared beforehand for everyone.
* *Ratio* is the median of the other library divided by the median of ipm_rs.
* scikit-image, SciPy, Pillow and the NumPy reference have no threads and appear under one thread only.
"""


def environment() -> list[str]:
    """Describe machine, versions and commit, as Markdown list items."""
    versions = []
    for package in PACKAGES:
        try:
            versions.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            continue
    return [
        f"* ipm_rs {ipm_rs.__version__}, commit {_commit()}, instruction set {ipm_rs.cpu_info()['isa']}",
        f"* {_cpu()}, {len(_affinity())} CPUs, {platform.system()} {platform.machine()}",
        f"* Python {platform.python_version()}, {', '.join(versions)}",
    ]


def page(results: dict[str, Any]) -> str:
    """Render the whole page."""
    parts = [HEAD.format(coverage=results["coverage"], environment="\n".join(results["environment"]))]
    parts.append("## ipm_rs and the fastest OpenCV variant that gives the right answer\n\n")
    parts.append(
        "Medians. A ratio above 1 means that ipm_rs is faster; where it is slower the ratio is bold. *At least* is\n"
        "what this version set out to reach with that instruction set; ratios below it are marked. *To any* is the\n"
        "ratio to the fastest variant of OpenCV, whether or not its answer is right. Where OpenCV has no right\n"
        "answer, another library stands in.\n\n"
    )
    header = ["job", "threads", "ipm_rs, ms", "OpenCV, ms", "ratio", "at least", "which", "to any"]
    parts.append(_table(header, _summary(results)))
    for threads, jobs in results["warps"].items():
        for job, rows in jobs.items():
            parts.append(f"\n## {job}, {_threads(threads)}\n\n")
            header = ["", "median, ms", "min", "p95", "ratio", "error", "agrees"]
            parts.append(_table(header, _details(rows)))
    for isa, jobs in results["isas"].items():
        for job, rows in jobs.items():
            parts.append(f"\n## {job}, one thread, ipm_rs held to {isa}\n\n")
            parts.append(_table(["", "median, ms", "min", "p95", "ratio", "error", "agrees"], _details(rows)))
    for threads, rows in results["frames"].items():
        parts.append(f"\n## A new pose for every frame, uint8 x 3, bilinear, {_threads(threads)}\n\n")
        parts.append(_table(["", "median, ms", "min", "p95", "ratio", "error", "agrees"], _details(rows)))
    for threads, rows in results["builds"].items():
        parts.append(f"\n## From calibration to table, {_threads(threads)}\n\n")
        parts.append(_table(["", "median, ms", "min", "p95", "ratio"], [row[:5] for row in _details(rows)]))
    parts.append(
        "\nipm_rs builds a packed table with a validity mask; the others give maps that do not know where the image or"
        "\nthe front of the camera ends, except the NumPy reference. `getPerspectiveTransform` solves for nine numbers"
        "\nfrom four points, after which OpenCV computes every coordinate again in each `warpPerspective`.\n\n"
    )
    for threads, lenses in results["lens_builds"].items():
        for lens, rows in lenses.items():
            parts.append(f"\n## From calibration to table through a lens: {lens}, {_threads(threads)}\n\n")
            parts.append(_table(["", "median, ms", "min", "p95", "ratio"], [row[:5] for row in _details(rows)]))
    parts.append(
        "\nOpenCV goes straight from the distorted image to the road: `initUndistortRectifyMap` with the inverse of"
        "\nthe ground's homography as its new camera matrix. Both are checked against the NumPy reference first.\n\n"
    )
    parts += _cells(results["cells"]) + _python_threads(results["python_threads"])
    parts += _areas(results["areas"]) + _clouds(results["clouds"])
    return "".join(parts) + METHOD


def _areas(results: dict[str, Any]) -> list[str]:
    parts = [AREA]
    bounds, builds = [], []
    for threads, run in results.items():
        for job, rows in run["warps"].items():
            parts.append(f"\n### {job}, {_threads(threads)}\n\n")
            parts.append(_table(["", "median, ms", "min", "p95", "ratio", "error", "agrees"], _details(rows)))
            for name, row in rows.items():
                if threads == "1" and (bound := areas.BOUNDS.get(ipm_rs.cpu_info()["isa"], {}).get((job, name))):
                    mine, theirs = row.get("ours", rows[OURS]["median"]), row["median"]
                    numbers = [f"{mine:.3g}", f"{theirs:.3g}", f"{mine / theirs:.2f}", _ratio(theirs, mine)]
                    bounds.append([job, name, *numbers, _bound(bound, theirs / mine)])
        for cells, build in run["builds"].items():
            both, size = build["table"] + build["plan"], build["table_bytes"] + build["plan_bytes"]
            most = f"{areas.BUILD_BOUND:.1f}" if threads == "1" else ""
            missed = ", **missed**" if most and both > areas.BUILD_BOUND * build["table"] else ""
            times = [f"{build['table']:.3g}", f"{build['plan']:.3g}", f"{both / build['table']:.2f}", most + missed]
            builds.append([cells, threads, *times, *(f"{b / 1e6:.2f}" for b in (build["table_bytes"], size))])
    if bounds:
        parts.append("\n### Area: what this version set out to reach, one thread\n\n")
        header = ["job", "which", "ipm_rs, ms", "OpenCV, ms", "times its time", "ratio", "at least"]
        parts.append(_table(header, bounds))
    parts.append("\n### Area: time and memory of the table\n\n")
    times = ["table, ms", "first area warp adds, ms", "both, times the table", "at most"]
    parts.append(_table(["", "threads", *times, "table, MB", "with area, MB"], builds))
    return [*parts, "\n"]


def _clouds(results: dict[str, Any]) -> list[str]:
    text = (
        "\n## Depth, points and pixels\n\n"
        "Beside the fastest NumPy that gives the right answer. Errors are metres, for projecting pixels.\n\n"
    )
    lines, details = [], []
    for threads, jobs in results.items():
        for job, rows in jobs.items():
            right = {name: row["median"] for name, row in rows.items() if name.startswith("NumPy") and row["agrees"]}
            name, mine = min(right, key=right.__getitem__), rows[OURS]["median"]
            shown = _bound(clouds.BOUNDS.get(ipm_rs.cpu_info()["isa"], {}).get((job, threads)), right[name] / mine)
            alone = results.get("1", {}).get(job, rows)[OURS]["median"]
            numbers = [f"{mine:.3g}", f"{right[name]:.3g}", _ratio(right[name], mine), shown, f"{alone / mine:.2f}"]
            lines.append([job, threads, *numbers, name.removeprefix("NumPy, ")])
            details.append(f"\n### {job[:1].upper()}{job[1:]}, {_threads(threads)}\n\n")
            details.append(_table(["", "median, ms", "min", "p95", "ratio", "error", "agrees"], _details(rows)))
    header = ["job", "threads", "ipm_rs, ms", "NumPy, ms", "ratio", "at least", "times one thread", "which"]
    return [text, _table(header, lines), *details, "\n"]


def _cells(series: dict[str, list[list[Any]]]) -> list[str]:
    if not series:
        return []
    parts = ["\n## Time per valid cell, uint8 x 3, bilinear, one thread\n\n"]
    for rows in series.values():
        lines = [[name, f"{time:.3f}", f"{per_cell:.2f}"] for name, time, per_cell in rows]
        spread = max(row[2] for row in rows) / min(row[2] for row in rows)
        parts.append(_table(["", "median, ms", "ns per valid cell"], lines))
        parts.append(f"\nThe dearest valid cell takes {spread:.2f} times as long as the cheapest.\n\n")
    return parts


def _python_threads(rows: dict[str, list[float]]) -> list[str]:
    if not rows:
        return []
    text = "\n## Two Python threads at once, uint8 x 3, bilinear, each call on one thread\n\n"
    lines = [[name, f"{one:.0f}", f"{two:.0f}", f"{best:.2f}"] for name, (one, two, best) in rows.items()]
    return [text, _table(["", "one, calls/s", "two, calls/s", "best ratio of five runs"], lines), "\n"]


def _summary(results: dict[str, Any]) -> list[list[str]]:
    lines = []
    for threads, jobs in results["warps"].items():
        for job, rows in jobs.items():
            lines.append(_line(job, threads, rows, OURS))
            if job == "uint8 x 3, bilinear":
                for ours in (OURS_REMAP, OURS_PERSPECTIVE):
                    if ours in rows:
                        lines.append(_line(f"{job}; {ours.split(' ', 1)[1]}", threads, rows, ours))
    for isa, jobs in results["isas"].items():
        lines += [_line(f"{job}; {isa}", "1", rows, OURS) for job, rows in jobs.items()]
    for threads, rows in results["builds"].items():
        name = "OpenCV warpPerspective of one frame"
        one_warp = {OURS: rows[OURS], name: rows[name] | {"agrees": True}}
        lines.append(_line("table of the seed job", threads, one_warp, OURS))
    for threads, lenses in results["lens_builds"].items():
        lines += [_line(f"table through {lens}", threads, rows, OURS) for lens, rows in lenses.items()]
    for threads, rows in results["frames"].items():
        lines.append(_line("a new pose for every frame: table and warp", threads, rows, OURS))
    return lines


def _line(job: str, threads: str, rows: dict[str, Any], ours: str) -> list[str]:
    times = {name: row["median"] for name, row in rows.items() if not name.startswith(OURS)}
    opencv = [name for name in times if name.startswith("OpenCV")]
    right = [name for name in times if rows[name]["agrees"] and "reference" not in name]
    name = min(set(opencv) & set(right) or right or opencv, key=times.__getitem__)
    which = name.removeprefix("OpenCV ") + ("" if name in right else ", wrong")
    mine, theirs = rows[ours]["median"], times[name]
    isa = next((isa for isa in BOUNDS if job.endswith(f"; {isa}")), ipm_rs.cpu_info()["isa"])
    bound = BOUNDS.get(isa, {}).get((job.removesuffix(f"; {isa}"), threads))
    shown = _bound(bound, theirs / mine)
    numbers = [f"{mine:.3g}", f"{theirs:.3g}", _ratio(theirs, mine), shown]
    return [job, threads, *numbers, which, _ratio(min(times[name] for name in opencv), mine)]


def _details(rows: dict[str, Any]) -> list[list[str]]:
    ours = rows[OURS]["median"]
    lines = []
    for name, row in sorted(rows.items(), key=lambda item: item[1]["median"]):
        times = [f"{row[key]:.3g}" if row[key] < 100 else f"{row[key]:.0f}" for key in ("median", "minimum", "p95")]
        ratio = "" if name == OURS else _ratio(row["median"], row.get("ours", ours))
        agrees = {True: "yes", False: "**no**", None: ""}[row.get("agrees")]
        lines.append([name, *times, ratio, row.get("error", ""), agrees])
    return lines


def _bound(bound: float | None, ratio: float) -> str:
    if bound is None:
        return ""
    return (f"{bound:.1f}" if bound >= 1 else f"{bound:.2f}") + ("" if ratio >= bound else ", **missed**")


def _ratio(theirs: float, ours: float) -> str:
    ratio = theirs / ours
    text = f"{ratio:.2f}" if ratio < 10 else f"{ratio:.0f}"
    return text if ratio >= 1 else f"**{text}**"


def _table(header: list[str], rows: list[list[str]]) -> str:
    words = {"", "job", "which"}
    align = ["---" if name in words else "---:" for name in header]
    return "".join("| " + " | ".join(map(str, cells)) + " |\n" for cells in [header, align, *rows])


def _threads(threads: str) -> str:
    return "one thread" if threads == "1" else f"{threads} threads"


def _affinity() -> set[int]:
    return os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))


def _cpu() -> str:
    if sys.platform == "linux":
        lines = Path("/proc/cpuinfo").read_text().partition("\n\n")[0].splitlines()
        known = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}
        if "model name" in known:
            # the name may tell no generation: Zen 4 and Zen 5 are both "AMD EPYC", and differ twofold in wide vectors
            return f"{known['model name']} (family {known.get('cpu family')}, model {known.get('model')})"
    return platform.processor() or platform.machine()


def _commit() -> str:
    def git(*arguments: str) -> str:
        command = ["git", "-C", str(Path(__file__).parent), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        return git("rev-parse", "--short", "HEAD") + (" with changes" if git("status", "--porcelain", "-uno") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
