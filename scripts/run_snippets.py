"""Run the Python blocks of Markdown files and folders: `python scripts/run_snippets.py README.md docs/datasets`.

The blocks of one file run in order, in one namespace, in a temporary folder that holds a calibration `camera.json` and
an image `frame.png` (and `frame.npy`, the same pixels); for docs/streams.md also a bag and a drive, and for docs/tasks
what scripts/task_files.py writes. A block after the comment `<!-- not run -->` is skipped. A file without any block is
an error: a check that finds nothing to check must not pass.

A page `docs/datasets/<format>.md` finds the files of that format's samples (tests/python/calibration_samples.py)
instead, and a noise `frame.png` of the size that its camera has. Whatever such a page calls `lut` must see some of its
grid.
"""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import ipm_rs

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "python"))
import task_files
from bags import Bag
from calibration_samples import SAMPLES

BLOCK = re.compile(r"(?P<skip><!-- not run -->\s*)?^```(?:python|py)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)
CAMERA = {
    "extrinsic": {"baseline": 0.209, "pitch": 0.038, "roll": 0.0, "yaw": -0.0195, "x": 1.7, "y": 0.1, "z": 1.22},
    "intrinsic": {"fx": 2262.52, "fy": 2265.3, "u0": 1096.98, "v0": 513.137},
}


def prepare(folder: Path, page: Path) -> None:
    """Write the files that the snippets of a page read."""
    if page.parent.name == "tasks":
        task_files.write(folder, page.stem)
        return
    size = (2048, 1024)
    samples = [sample for sample in SAMPLES.values() if sample.format == page.stem]
    if samples and page.parent.name == "datasets":
        for sample in reversed(samples):  # of equal names, the first sample's file stays
            sample.write(folder)
        size = ipm_rs.Camera.load(samples[0].write(folder), **samples[0].options).image_size
    else:
        (folder / "camera.json").write_text(json.dumps(CAMERA))
    if page.name == "streams.md":
        prepare_streams(folder)
    image = np.random.default_rng(0).integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    np.save(folder / "frame.npy", image)
    Image.fromarray(image).save(folder / "frame.png", compress_level=0)


def prepare_streams(folder: Path) -> None:
    """Write a bag and a sequence of KITTI odometry, two frames each."""
    sequence = folder / "dataset" / "sequences" / "00"
    (sequence / "image_2").mkdir(parents=True)
    (folder / "dataset" / "poses").mkdir()
    projection = "700 0 620 0 0 700 187 0 0 0 1 0"
    (sequence / "calib.txt").write_text("".join(f"P{camera}: {projection}\n" for camera in range(4)))
    (sequence / "times.txt").write_text("0.0\n0.1\n")
    poses = "".join(f"1 0 0 0 0 1 0 0 0 0 1 {metres}\n" for metres in (0, 1.2))
    (folder / "dataset" / "poses" / "00.txt").write_text(poses)
    with Bag(folder / "run.bag", "bag") as bag:
        for number in range(2):
            pixels = np.full((375, 1242, 3), 50 * number, np.uint8)
            Image.fromarray(pixels).save(sequence / "image_2" / f"{number:06}.png")
            bag.tf([("map", "base_link", (1.2 * number, 0, 0), (1, 0, 0, 0))], 10 + 0.1 * number)
            bag.image("/front/image_raw", pixels, "rgb8", 10 + 0.1 * number)


def run(path: Path) -> int:
    """Run the blocks of one file and return how many ran."""
    return run_blocks(path)[0]


def run_blocks(path: Path) -> tuple[int, dict[str, Any]]:
    """Run the blocks of one file; return how many ran, and the names that they leave."""
    text = path.read_text(encoding="utf-8")
    namespace: dict[str, Any] = {"__name__": "__main__"}
    count = 0
    for match in BLOCK.finditer(text):
        if match["skip"]:
            continue
        line = text.count("\n", 0, match.start("code"))
        # Padding with empty lines makes tracebacks and SyntaxErrors name the line of the Markdown file.
        exec(compile("\n" * line + match["code"], str(path), "exec"), namespace)
        count += 1
    if count == 0:
        raise SystemExit(f"{path}: no Python block found to run")
    if path.parent.name == "datasets" and not namespace["lut"].mask.mean() > 0.05:
        raise SystemExit(f"{path}: the table of its example sees nothing of the road")
    return count, namespace


def main() -> None:
    """Run the files named on the command line."""
    names = [Path(name).resolve(strict=True) for name in sys.argv[1:]]
    paths = [path for name in names for path in (sorted(name.glob("*.md")) if name.is_dir() else [name])]
    if not paths:
        raise SystemExit("usage: run_snippets.py FILE.md|FOLDER ...")
    for path in paths:
        with tempfile.TemporaryDirectory(prefix="ipm_rs-") as folder:
            prepare(Path(folder), path)
            os.chdir(folder)
            count = run(path)
            os.chdir(path.parent)
        print(f"{path.name}: {count} blocks ran")


if __name__ == "__main__":
    main()
