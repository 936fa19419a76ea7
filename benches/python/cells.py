"""What a valid cell costs, over the number of cells and over their share of the grid."""

from __future__ import annotations

import numpy as np

import ipm_rs
from jobs import CALIBRATION
from timing import interleaved

MEGACELLS = (0.25, 1, 4, 16)
GROWING = ((10, 4.5), (7, 10), (0, 15), (0, 20), (-10, 26), (-20, 32), (-30, 40), (-50, 50), (-55, 55))
"""Bird's-eye views from x_min to 50 m ahead and y_max to either side: from what the camera sees to all around it."""


def size_table(megacells: float) -> ipm_rs.Lut:
    """Build the table of a square number of cells from 10 to 50 m ahead, nearly all of which see the image."""
    side = round(1000 * megacells**0.5)
    grid = ipm_rs.BevGrid(x=(10, 50), y=(-4.5, 4.5), resolution=(40 / side, 9 / side))
    return ipm_rs.Lut(ipm_rs.Camera.from_cityscapes(CALIBRATION), grid)


def share_table(x_min: float, y_max: float) -> ipm_rs.Lut:
    """Build the table of a grid of 10 cm cells that grows around the car."""
    grid = ipm_rs.BevGrid(x=(x_min, 50), y=(-y_max, y_max), resolution=0.1)
    return ipm_rs.Lut(ipm_rs.Camera.from_cityscapes(CALIBRATION), grid)


def measure(rounds: int, seconds: float) -> dict[str, list[list[float | str]]]:
    """Rows of (table, milliseconds, nanoseconds per valid cell) for uint8 x 3, bilinear, on one thread."""
    image = np.random.default_rng(20240229).integers(0, 256, (1024, 2048, 3), np.uint8)
    series = {
        "size": {f"{size:g} megacells, 10..50 m x +-4.5 m": size_table(size) for size in MEGACELLS},
        "share": {f"{x}..50 m x +-{y:g} m, 10 cm": share_table(x, y) for x, y in GROWING},
    }
    return {name: _measure(luts, image, rounds, seconds) for name, luts in series.items()}


def _measure(luts: dict[str, ipm_rs.Lut], image: np.ndarray, rounds: int, seconds: float) -> list[list[float | str]]:
    calls = {}
    for name, lut in luts.items():
        out = lut.warp(image)
        calls[name] = lambda lut=lut, out=out: lut.warp(image, out=out, threads=1)
    times = interleaved(calls, rounds, seconds)
    return [
        [
            f"{name}, {lut.mask.mean():.0%} valid",
            times[name].median,
            1e6 * times[name].median / np.count_nonzero(lut.mask),
        ]
        for name, lut in luts.items()
    ]
