"""How well two cameras show the same road alike: what a wrong extrinsic looks like in numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, HeightMap, Lut, Plane

__all__ = ["Agreement", "PairView", "pair_views"]

# Shifts are tried cell by cell, so cells are at least this part of the farthest one: 21 x 21 shifts.
_STEPS = 10

# Fewer cells than this, or a picture that varies by a smaller part of its brightness, say nothing of a shift: 0.5 grey
# levels of 255.
_FEWEST_CELLS = 64
_LEAST_CONTRAST = 0.002

# Source pixels a cell, in the direction with fewest: what is resolved worse is smear, mostly of what stands far away.
_LEAST_RESOLUTION = 0.5


@dataclass(frozen=True)
class Agreement:
    """How two cameras agree on the cells that both see."""

    cells: int
    """How many cells they share, of those the pair is compared in."""
    difference: float
    """Mean of the first camera's picture minus the second's, in units of the images; channels averaged."""
    correlation: float
    """Of the structure of their pictures, -1 to 1: each less its mean over as far as shifts are looked for, so that
    exposure and vignetting do not count. NaN where one has no contrast."""
    shift: tuple[float, float]
    """(x, y) in metres by which the second's picture is to be moved to fit the first's best; NaN without contrast."""
    shifted_correlation: float
    """Of their pictures after that shift."""


@dataclass(frozen=True, eq=False)
class PairView:
    """Tables of two cameras for the part of a grid that both see."""

    luts: tuple[Lut, Lut]
    seen: NDArray[np.bool_]
    resolution: tuple[float, float]
    reach: tuple[int, int]

    def compare(self, images: tuple[Any, Any]) -> Agreement:
        """Compare their pictures."""
        one, other = (
            _grey(lut.warp(image, interpolation="area")) for lut, image in zip(self.luts, images, strict=True)
        )
        values = one[self.seen], other[self.seen]
        structures = [_structure(picture, self.seen, self.reach) for picture in (one, other)]
        scores = _correlations(structures[0], structures[1], self.seen, self.reach)
        middle = self.reach
        best, shift = math.nan, (math.nan, math.nan)
        if not np.isnan(scores).all():
            at = np.unravel_index(np.nanargmax(scores), scores.shape)
            best = float(scores[at])
            down, right = (int(at[axis]) - middle[axis] + _peak(scores, at, axis) for axis in (0, 1))
            # rows go back along x, columns to the right along y
            shift = (-down * self.resolution[0], -right * self.resolution[1])
        return Agreement(
            cells=int(self.seen.sum()),
            difference=float(values[0].mean() - values[1].mean()),
            correlation=float(scores[middle]),
            shift=shift,
            shifted_correlation=best,
        )


def pair_views(
    cameras: Mapping[str, Camera],
    seen: Mapping[str, NDArray[np.bool_]],
    grid: BevGrid,
    ground: float | Plane | HeightMap,
    farthest: float,
) -> dict[tuple[str, str], PairView]:
    """Return the tables of all pairs of cameras that share enough of a grid to be compared.

    Parameters
    ----------
    cameras, seen : mapping
        The cameras, and which cells each may show.
    grid, ground
        The grid and the road.
    farthest : float
        The largest shift that is looked for, metres.
    """
    found: dict[tuple[str, str], PairView] = {}
    names = list(cameras)
    factors = [max(1, math.ceil(farthest / (_STEPS * size))) for size in grid.resolution]
    for index, second in enumerate(names):
        for first in names[:index]:
            both = seen[first] & seen[second]
            part = _part(both, grid, (factors[0], factors[1]))
            if part is None:
                continue
            coarse, shared = part
            luts = Lut(cameras[first], coarse, ground=ground), Lut(cameras[second], coarse, ground=ground)
            for lut in luts:
                shared = shared & lut.resolved_mask(_LEAST_RESOLUTION)
            if shared.sum() >= _FEWEST_CELLS:
                rows, columns = (round(farthest / size) for size in coarse.resolution)
                found[first, second] = PairView(luts, shared, coarse.resolution, (rows, columns))
    return found


def _part(both: NDArray[np.bool_], grid: BevGrid, factors: tuple[int, int]) -> tuple[BevGrid, NDArray[np.bool_]] | None:
    """Return the grid of whole blocks of cells around some cells, and which of its blocks consist of these alone."""
    rows, columns = np.flatnonzero(both.any(axis=1)), np.flatnonzero(both.any(axis=0))
    if not len(rows):
        return None
    (top, bottom), (left, right) = (
        (where[0] // factor, where[-1] // factor + 1) for where, factor in ((rows, factors[0]), (columns, factors[1]))
    )
    bottom, right = min(bottom, both.shape[0] // factors[0]), min(right, both.shape[1] // factors[1])
    if bottom <= top or right <= left:
        return None
    (dx, dy), x_max, y_max = grid.resolution, grid.x[1], grid.y[1]
    step = (dx * factors[0], dy * factors[1])
    coarse = BevGrid(
        x=(x_max - bottom * step[0], x_max - top * step[0]),
        y=(y_max - right * step[1], y_max - left * step[1]),
        resolution=step,
    )
    inner = both[top * factors[0] : bottom * factors[0], left * factors[1] : right * factors[1]]
    blocks = inner.reshape(bottom - top, factors[0], right - left, factors[1]).all(axis=(1, 3))
    return coarse, np.asarray(blocks)


def _grey(image: NDArray[Any]) -> NDArray[np.float32]:
    grey: NDArray[np.float32] = image.astype(np.float32)
    return grey.mean(axis=2) if grey.ndim == 3 else grey


def _structure(picture: NDArray[np.float32], seen: NDArray[np.bool_], reach: tuple[int, int]) -> NDArray[np.float64]:
    """Return a picture less its mean over the seen cells of a box around each cell, relative to the brightest of it."""
    near = _box_sum(np.where(seen, picture, 0.0), reach) / np.maximum(_box_sum(seen.astype(np.float64), reach), 1.0)
    brightest = float(np.abs(picture[seen]).max())
    return np.where(seen, picture - near, 0.0) / (brightest if brightest > 0 else 1.0)


def _box_sum(values: NDArray[np.float64], reach: tuple[int, int]) -> NDArray[np.float64]:
    for axis, cells in enumerate(reach):
        size = values.shape[axis]
        sums = np.concatenate([np.zeros_like(values.take([0], axis)), values.cumsum(axis)], axis)
        middle = np.arange(size)
        ends, begins = np.minimum(middle + cells + 1, size), np.maximum(middle - cells, 0)
        values = sums.take(ends, axis) - sums.take(begins, axis)
    return values


def _correlations(
    one: NDArray[np.float64], other: NDArray[np.float64], seen: NDArray[np.bool_], reach: tuple[int, int]
) -> NDArray[np.float64]:
    """Correlation of a picture with another moved by -reach to reach (rows, columns), over the cells seen in both.

    Both are 0 where they are not seen. Shifts of which too few cells or too little contrast is left are NaN. Sums over
    what overlaps are cross-correlations with the mask, for all shifts at once (Padfield 2012, "Masked object
    registration in the Fourier domain").
    """
    shape = [size + 2 * cells for size, cells in zip(seen.shape, reach, strict=True)]
    mask = seen.astype(np.float64)
    spectra = [np.fft.rfft2(values, shape) for values in (one, one**2, other, other**2, mask)]
    rows, columns = (np.arange(-cells, cells + 1) for cells in reach)

    def sums(here: int, there: int) -> NDArray[np.float64]:
        every = np.fft.irfft2(spectra[here] * spectra[there].conj(), shape)
        return every[np.ix_(rows, columns)]

    count = np.round(sums(4, 4))
    a, aa, b, bb, ab = sums(0, 4), sums(1, 4), sums(4, 2), sums(4, 3), sums(0, 2)
    with np.errstate(all="ignore"):
        spread_a, spread_b = aa - a * a / count, bb - b * b / count
        score = (ab - a * b / count) / np.sqrt(spread_a * spread_b)
        enough = (count >= _FEWEST_CELLS) & (np.minimum(spread_a, spread_b) > _LEAST_CONTRAST**2 * count)
    return np.where(enough, score, math.nan)


def _peak(scores: NDArray[np.float64], at: tuple[Any, ...], axis: int) -> float:
    """Return how far beside the best shift the peak lies along an axis, in cells: that of a parabola through three."""
    line, place = scores.take(at[1 - axis], 1 - axis), int(at[axis])
    if not 0 < place < len(line) - 1:
        return 0.0
    before, here, after = line[place - 1 : place + 2]
    bend = before - 2 * here + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend < 0 else 0.0
