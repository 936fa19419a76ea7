"""Run the Python blocks of Markdown files: `python scripts/run_snippets.py README.md docs/index.md`.

The blocks of one file run in order, in one namespace, in a temporary folder that holds a calibration `camera.json` and
an image `frame.png` (and `frame.npy`, the same pixels). A block after the comment `<!-- not run -->` is skipped. A file
without any block is an error: a check that finds nothing to check must not pass.
"""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

BLOCK = re.compile(r"(?P<skip><!-- not run -->\s*)?^```(?:python|py)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)
CAMERA = {
    "extrinsic": {"baseline": 0.209, "pitch": 0.038, "roll": 0.0, "yaw": -0.0195, "x": 1.7, "y": 0.1, "z": 1.22},
    "intrinsic": {"fx": 2262.52, "fy": 2265.3, "u0": 1096.98, "v0": 513.137},
}


def prepare(folder: Path) -> None:
    """Write the files that the snippets read."""
    (folder / "camera.json").write_text(json.dumps(CAMERA))
    image = np.random.default_rng(0).integers(0, 256, (1024, 2048, 3), dtype=np.uint8)
    np.save(folder / "frame.npy", image)
    Image.fromarray(image).save(folder / "frame.png", compress_level=0)


def run(path: Path) -> int:
    """Run the blocks of one file and return how many ran."""
    text = path.read_text(encoding="utf-8")
    namespace: dict[str, object] = {"__name__": "__main__"}
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
    return count


def main() -> None:
    """Run the files named on the command line."""
    paths = [Path(name).resolve(strict=True) for name in sys.argv[1:]]
    if not paths:
        raise SystemExit("usage: run_snippets.py FILE.md ...")
    for path in paths:
        with tempfile.TemporaryDirectory(prefix="ipm_rs-") as folder:
            prepare(Path(folder))
            os.chdir(folder)
            count = run(path)
            os.chdir(path.parent)
        print(f"{path.name}: {count} blocks ran")


if __name__ == "__main__":
    main()
