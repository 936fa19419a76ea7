"""How bright a frame is beside the map so far."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import _mosaic_shows
from ipm_rs.mosaic._cache import Tiles
from ipm_rs.mosaic._placing import Placed, Window
from ipm_rs.mosaic._tiles import Kind
from ipm_rs.mosaic._views import view_of

__all__ = ["gain_of"]

_FEWEST = 200
"""Cells that must be there of both: their median is then known to a hundredth, where frame and map lie a cell apart."""

_RESOLVED = 0.25
"""Pixels a cell from which on a cell of the frame is compared: its mean is then not of something else."""

_HELD = 0.95
"""How much of a difference is made up for. The rest lets the map follow the camera within some 150 frames: with all of
it a tenth of a level, which vignetting leaves between near and far, would add up from frame to frame without an end."""

_LEAST, _MOST = 1 / 4, 4.0


def gain_of(
    tiles: Tiles, kind: Kind, image: NDArray[Any], frame: Placed, parts: Iterable[Window], threads: int | None
) -> float:
    """Return what to multiply a picture by, 1 where it and the map have too little in common."""
    most = float(np.iinfo(kind.dtype).max)
    ratios: list[NDArray[np.float64]] = []
    for window in parts:
        tile = tiles.get(window.key, kind)
        if tile is None:
            continue
        rows, columns = (slice(at, at + count) for at, count in zip(window.at, window.grid.shape, strict=True))
        values, seen = _mosaic_shows(frame, image, window.grid, _RESOLVED, threads)
        seen &= tile.arrays.counts[rows, columns] > 0
        shown = values.reshape(*seen.shape, kind.channels)[seen]
        known = view_of("weighted", tile, rows, columns)[seen].reshape(shown.shape)
        # what is clipped, or mostly noise, says nothing
        fair = ((shown < 0.97 * most) & (known < 0.97 * most)).all(1)
        one, other = shown[fair].mean(1, dtype=np.float64), known[fair].mean(1, dtype=np.float64)
        bright = (one > 0.03 * most) & (other > 0.03 * most)
        ratios.append(other[bright] / one[bright])
    every = np.concatenate(ratios) if ratios else np.empty(0)
    if len(every) < _FEWEST:
        return 1.0
    return float(np.clip(np.median(every), _LEAST, _MOST) ** _HELD)
