"""What a valid cell costs, over the number of cells and over their share of the grid."""

from __future__ import annotations

import numpy as np

import ipm_rs
from jobs import CALIBRATION
from timing import interleaved

MEGACELLS = (0.25, 1, 4, 16)
WIDTHS = (2048, 1100, 700, 400, 260, 150)  # columns of the image that are left: fewer cells see it, just as densely


def table(width: int, megacells: float) -> ipm_rs.Lut:
    """Build the table of a square grid from 10 to 50 m ahead and the middle of the seed job's image."""
    camera = ipm_rs.Camera.from_cityscapes(CALIBRATION).cropped((2048 - width) // 2, 0, width, 1024)
    side = round(1000 * megacells**0.5)
    return ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(10, 50), y=(-4.5, 4.5), resolution=(40 / side, 9 / side)))


def measure(rounds: int, seconds: float) -> list[list[float | str]]:
    """Rows of (table, milliseconds, nanoseconds per valid cell) for uint8 x 3, bilinear, on one thread."""
    noise = np.random.default_rng(20240229).integers(0, 256, (1024, 2048, 3), np.uint8)
    sizes = [(2048, size) for size in MEGACELLS] + [(width, 1) for width in WIDTHS[1:]]
    luts, calls = {}, {}
    for width, size in sizes:
        lut = table(width, size)
        image = np.ascontiguousarray(noise[:, :width])
        out = lut.warp(image)
        name = f"{size:g} megacells, {lut.mask.mean():.0%} valid"
        luts[name] = lut
        calls[name] = lambda lut=lut, image=image, out=out: lut.warp(image, out=out, threads=1)
    times = interleaved(calls, rounds, seconds)
    return [
        [name, times[name].median, 1e6 * times[name].median / np.count_nonzero(lut.mask)] for name, lut in luts.items()
    ]
