"""How near area is to the mean of its footprint, by the footprint's size: `python benches/python/footprints.py`.

White noise, the hardest image there is, under square footprints of 1.5 to 8 pixels along the axes, at 25 phases. The
exact mean weighs every pixel by how much of it the footprint covers. Printed is the root mean square of the difference
in per cent of the exact means' own standard deviation, the least and the most of all phases, and the same of bilinear
and of 4 x 4 bilinear samples a cell. Then the same of area for footprints that are turned, over cells of all phases.
"""

from __future__ import annotations

import numpy as np

import ipm_rs
from ipm_rs import reference

SIZES = (1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0)
CELLS = 60
TURNED = (10, 22, 45)
TURNED_CELLS = 26


def coverage(starts: np.ndarray, size: float, pixels: int) -> np.ndarray:
    """Return how much of each pixel an interval [start, start + size) covers: (cells, pixels), rows that sum to 1."""
    left = np.arange(pixels) - 0.5
    covered = np.minimum(starts[:, None] + size, left + 1) - np.maximum(starts[:, None], left)
    return np.clip(covered, 0, None) / size


def warp(image: np.ndarray, x: np.ndarray, y: np.ndarray, interpolation: str) -> np.ndarray:
    """Return the image at every pair of coordinates."""
    map_x, map_y = np.meshgrid(x, y)
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=image.shape[::-1])
    return lut.warp(image, interpolation=interpolation)


def errors(size: float, phase: tuple[float, float], image: np.ndarray) -> list[float]:
    """Return the errors of area, bilinear and 4 x 4 samples in per cent, for footprints of one size and phase."""
    x, y = (10 + p + size * np.arange(CELLS) for p in phase)
    fine_x, fine_y = ((c[:, None] + size * (np.arange(4) - 1.5) / 4).ravel() for c in (x, y))
    rows, columns = (coverage(c - size / 2, size, n) for c, n in zip((y, x), image.shape, strict=True))
    exact = rows @ image.astype(np.float64) @ columns.T
    views = (
        warp(image, x, y, "area"),
        warp(image, x, y, "bilinear"),
        warp(image, fine_x, fine_y, "bilinear").reshape(CELLS, 4, CELLS, 4).mean(axis=(1, 3)),
    )
    inner = (slice(1, -1), slice(1, -1))  # a cell at the rim has neighbours on one side only
    spread = exact[inner].std()
    return [float(100 * np.sqrt(((view - exact)[inner] ** 2).mean()) / spread) for view in views]


def turned_error(size: float, degrees: float, image: np.ndarray) -> float:
    """Return the error of area in per cent, for footprints turned by an angle."""
    along = size * np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
    middle = (np.array(image.shape[::-1]) - 1) / 2 + (0.21, 0.37)

    def at(count: int) -> np.ndarray:
        """Return pixels of a square of so many by so many points, one cell apart."""
        steps = np.arange(count) - (count - 1) / 2
        return np.moveaxis(middle + steps[None, :, None] * along + steps[:, None, None] * (-along[1], along[0]), -1, 0)

    maps = at(TURNED_CELLS)
    footprints = reference.footprints(*at(TURNED_CELLS + 1))
    exact = reference.remap_area(image.astype(np.float64), *maps, footprints)
    view = ipm_rs.Lut.from_maps(*maps, source_size=image.shape[::-1]).warp(image, interpolation="area")
    inner = (slice(1, -1), slice(1, -1))
    return float(100 * np.sqrt(((view - exact)[inner] ** 2).mean()) / exact[inner].std())


def main() -> None:
    """Print a row for each size."""
    image = np.random.default_rng(0).normal(size=(512, 512)).astype(np.float32)
    print("footprint          area, %       bilinear, %   4 x 4 samples, %")
    for size in SIZES:
        phases = [(a / 5 + 0.03, b / 5 + 0.03) for a in range(5) for b in range(5)]
        columns = np.transpose([errors(size, phase, image) for phase in phases])
        print(f"{size:5.2f} px ", *(f"{column.min():12.0f} to {column.max():3.0f}" for column in columns))
    print("footprint  " + "".join(f"{f'turned by {degrees}':>16s}" for degrees in TURNED) + "  (area, %)")
    for size in SIZES:
        print(f"{size:5.2f} px   " + "".join(f"{turned_error(size, degrees, image):16.0f}" for degrees in TURNED))


if __name__ == "__main__":
    main()
