"""Prove that an installed ipm_rs works, with NumPy and nothing else: `python -W error scripts/smoke.py`."""

from __future__ import annotations

import pickle
import subprocess
import sys
import sysconfig
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import ipm_rs


def check_installed() -> None:
    """Fail when the package comes from a source tree instead of an installed wheel."""
    site = {Path(sysconfig.get_path(name)).resolve() for name in ("platlib", "purelib")}
    found = Path(ipm_rs.__file__).resolve()
    if not site & set(found.parents):
        raise SystemExit(f"ipm_rs was imported from {found}, expected one of {sorted(map(str, site))}")


def check_warp() -> None:
    """Warp a seeded image through a level camera and compare one cell with a hand calculation."""
    intrinsics = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
    camera = ipm_rs.Camera.from_euler(intrinsics, image_size=(640, 480), position=(0.0, 0.0, 1.5))
    grid = ipm_rs.BevGrid(x=(8, 25), y=(-4, 4), resolution=0.1, sample_at="corner")
    lut = ipm_rs.Lut(camera, grid)
    assert grid.shape == lut.shape == (170, 80)
    assert lut.mask.all()

    image = np.random.default_rng(1).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    for interpolation in ("nearest", "bilinear"):
        bev = lut.warp(image, interpolation=interpolation)
        assert bev.shape == (170, 80, 3) and bev.dtype == np.uint8
        # Row 100 is x = 25 - 100 * 0.1 = 15 m, column 40 is y = 0: u = 320, v = 240 + 500 * 1.5 / 15 = 290.
        assert (bev[100, 40] == image[290, 320]).all(), interpolation
        assert (lut.warp(image, interpolation=interpolation, threads=1) == bev).all()

    assert pickle.loads(pickle.dumps(lut)) == lut
    try:
        lut.warp(image[:100])
    except ipm_rs.IpmError as error:
        assert "640x480" in str(error), error
    else:
        raise AssertionError("an image of another size than the table's was accepted")


def check_command_line() -> None:
    """Without the extra `cli`, `info` works and the rest says what to install."""
    with tempfile.TemporaryDirectory() as folder:

        def run(*arguments: str) -> subprocess.CompletedProcess[str]:
            command = [sys.executable, "-W", "error", "-m", "ipm_rs", *arguments]
            return subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)

        info = run("info")
        assert info.returncode == 0 and ipm_rs.__version__ in info.stdout, info
        if find_spec("PIL") is None:
            demo = run("demo")
            assert demo.returncode == 2 and "ipm-rs[cli]" in demo.stderr, demo
            assert not list(Path(folder).iterdir())


if __name__ == "__main__":
    check_installed()
    check_warp()
    check_command_line()
    python = ".".join(map(str, sys.version_info[:3]))
    print(f"ipm_rs {ipm_rs.__version__} works: Python {python}, NumPy {np.__version__}, {ipm_rs.cpu_info()['isa']}")
