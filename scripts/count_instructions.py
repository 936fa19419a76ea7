"""Instructions a cell, counted by callgrind, against those on record: `make bench-instructions`.

Runs each job of benches/instructions.rs once with IPM_RS_ISA=avx2 (valgrind cannot run AVX-512) and compares with
benches/instructions.json. More than 3 % above the record is a regression and exits with 1; `--write` makes a new
record, which is right after a change that is meant to cost, or that made a job cheaper.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RECORD = ROOT / "benches" / "instructions.json"
JOBS = [
    "bilinear u8x1",
    "bilinear u8x3",
    "bilinear u8x4",
    "bilinear u16x3",
    "bilinear f32x1",
    "bilinear f32x3",
    "bilinear i16x3",
    "bilinear f16x3",
    "bilinear f64x3",
    "nearest u8x1",
    "nearest u8x3",
    "nearest first",  # of u8x3, with what the table keeps of the nearest pixels
    "area u8x3",
    "area f32x3",
    "area plan",  # and a warp of u8x1, without which there is no plan
    "table",
    "cubic u8x3",
    "rig u8x3",  # three cameras and their seams
    "adjoint bilinear",  # of f32x3, as all adjoints here
    "adjoint nearest",
    "adjoint area",
    "mosaic u8x1",  # a frame into a tile: table, plan, warp, resolutions, sums
    "mosaic u8x3",
    "homography u8x3",
    "homography f32x1",
    "homography f32x3",
]
TOLERANCE = 0.03  # another compiler version moves a job by 1 to 2 %


def main() -> int:
    """Count every job, print, compare."""
    if shutil.which("valgrind") is None:
        print("valgrind was not found: nothing was counted (Debian: apt-get install valgrind)")
        return 0
    executable = build()
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    counts = {job: instructions_per_cell(executable, job) for job in JOBS}
    if "--write" in sys.argv[1:]:
        RECORD.write_text(json.dumps(counts, indent=2) + "\n")
        print(f"wrote {RECORD.relative_to(ROOT)}")
    worse = []
    for job, count in counts.items():
        before = record.get(job)
        change = f"{count / before - 1:+.1%}" if before else "new"
        print(f"{job:18s} {count:7.2f} instructions a cell  {change}")
        if before and count > before * (1 + TOLERANCE):
            worse.append(job)
    if worse and "--write" not in sys.argv[1:]:
        print(f"more than {TOLERANCE:.0%} above the record: {', '.join(worse)}", file=sys.stderr)
        return 1
    return 0


def build() -> str:
    """Compile the bench and return its path."""
    command = ["cargo", "bench", "--bench", "instructions", "--no-run", "--message-format=json"]
    result = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    messages = map(json.loads, result.stdout.splitlines())
    found = [m["executable"] for m in messages if m.get("executable") and m["target"]["name"] == "instructions"]
    return found[-1]


def instructions_per_cell(executable: str, job: str) -> float:
    """Count the instructions of one job, within the function `counted`."""
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=*counted*"]
    environment = {**os.environ, "IPM_RS_ISA": "avx2"}
    result = subprocess.run([*command, executable, job], env=environment, capture_output=True, text=True)
    collected = re.search(r"Collected : (\d+)", result.stderr)
    if result.returncode != 0 or collected is None or int(collected[1]) == 0:
        raise SystemExit(f"{job}: callgrind counted nothing:\n{result.stderr[-2000:]}")
    return int(collected[1]) / int(result.stdout)


if __name__ == "__main__":
    sys.exit(main())
