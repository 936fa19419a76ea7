"""Which cells of a grid a camera sees, how well, and why it does not see the others."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, HeightMap, Lut, Plane
from ipm_rs.diagnosis._stand import height_at

__all__ = ["REASONS", "Coverage", "FarEnd", "coarser", "cover", "seen_share"]

REASONS: dict[str, str] = {
    "resolved": "seen",
    "unresolved": "seen, but below one pixel for two cells",
    "behind": "behind the camera",
    "lens": "outside the lens",
    "left": "left of the image",
    "right": "right of the image",
    "above": "above the image",
    "below": "below the image",
    "masked": "masked",
    "hidden": "hidden by a crest",
    "unknown": "the road is not known there",
    "horizon": "above the horizon: the road is above the camera",
}
"""What may be said of a cell, in the order of the numbers in `Coverage.why`."""
_NUMBER = {name: number for number, name in enumerate(REASONS)}

_MOST_CELLS = 600_000
"""A larger grid is looked at in coarser cells: 0.1 s instead of seconds, and no picture shows more."""


@dataclass(frozen=True)
class FarEnd:
    """What small errors cost where the camera sees farthest straight ahead of it."""

    place: tuple[float, float]
    """(x, y), metres."""
    distance: float
    """From the camera, measured level."""
    by_pixel: float
    """By how many metres the distance is off if the pixel is off by one; infinite where that passes the horizon."""
    by_pitch: float
    """The same for a tenth of a degree of pitch."""
    resolved_to: float | None
    """Up to which distance cells are resolved on the way there; None where none is."""


@dataclass(frozen=True, eq=False)
class Coverage:
    """The cells of a grid, by what a camera sees of them."""

    grid: BevGrid
    """The grid that was looked at: as given, or in coarser cells where it has more than 600 000."""
    lut: Lut
    why: NDArray[np.uint8]
    """(rows, columns), the place in `REASONS` of what is to be said of each cell."""
    far: FarEnd | None
    warned: tuple[str, ...]
    """What the table warned of."""

    @property
    def shares(self) -> dict[str, float]:
        """Part of all cells, by reason, the largest first; without those that no cell has."""
        counts = np.bincount(self.why.ravel(), minlength=len(REASONS)) / self.why.size
        found = {name: float(counts[number]) for name, number in _NUMBER.items() if counts[number] > 0}
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which cells show the road, (rows, columns) bool."""
        return self.why <= _NUMBER["unresolved"]

    @property
    def resolved(self) -> NDArray[np.bool_]:
        """Which cells show it with at least one pixel for two cells, (rows, columns) bool."""
        return self.why == _NUMBER["resolved"]


def cover(camera: Camera, grid: BevGrid, ground: float | Plane | HeightMap) -> Coverage:
    """Look at every cell of a grid."""
    grid, factor = coarser(grid, _MOST_CELLS)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        lut = Lut(camera, grid, ground=ground)
    resolved = lut.resolved_mask(0.5 * factor)
    why = _reasons(camera, grid, ground, lut.mask, resolved)
    return Coverage(grid, lut, why, _far_end(camera, grid, ground, why), tuple(str(each.message) for each in caught))


def seen_share(camera: Camera, grid: BevGrid, ground: float | Plane | HeightMap) -> float:
    """Return which part of a grid a camera above its road sees, from some 600 cells of it."""
    rows, cols = grid.shape
    some = np.stack(np.meshgrid(np.linspace(0, rows - 1, 25), np.linspace(0, cols - 1, 25)), -1).reshape(-1, 2)
    if camera.position[2] <= height_at(ground, *camera.position[:2]):
        return 0.0
    _, _, valid = camera.project(grid.ground_from_cell(some), ground=ground)
    return float(valid.mean())


def coarser(grid: BevGrid, most: int) -> tuple[BevGrid, float]:
    """Return a grid of at most so many cells or so, and how many times as large they are along a side."""
    rows, cols = grid.shape
    times = math.sqrt(rows * cols / most)
    if times <= 1:
        return grid, 1.0
    fewer = [max(1, round(size / times)) for size in (rows, cols)]
    size = [size * cells / few for size, cells, few in zip(grid.resolution, (rows, cols), fewer, strict=True)]
    coarse = BevGrid(x=grid.x, y=grid.y, resolution=size, sample_at=grid.sample_at)
    return coarse, math.sqrt(size[0] * size[1] / (grid.resolution[0] * grid.resolution[1]))


def _reasons(
    camera: Camera,
    grid: BevGrid,
    ground: float | Plane | HeightMap,
    mask: NDArray[np.bool_],
    resolved: NDArray[np.bool_],
) -> NDArray[np.uint8]:
    xy = grid.xy().reshape(-1, 2)
    uv, depth, valid = camera.project(xy, ground=ground)
    width, height = camera.image_size
    with np.errstate(invalid="ignore"):
        across, down = (uv[:, 0] + 0.5) / width - 0.5, (uv[:, 1] + 0.5) / height - 0.5
        sideways = np.abs(across) > np.abs(down)
        outside = np.where(
            sideways,
            np.where(across < 0, _NUMBER["left"], _NUMBER["right"]),
            np.where(down < 0, _NUMBER["above"], _NUMBER["below"]),
        )
        inside = (np.abs(across) <= 0.5 - 0.5 / width + 1e-12) & (np.abs(down) <= 0.5 - 0.5 / height + 1e-12)
    why = np.where(inside, _NUMBER["hidden"], outside)
    wide = camera.lens is not None and camera.lens.max_angle > math.pi / 2
    nowhere = np.isnan(uv[:, 0])
    why = np.where(nowhere, np.where((depth > 0) | wide, _NUMBER["lens"], _NUMBER["behind"]), why)
    why = np.where(valid, _NUMBER["masked"] if camera.mask is not None else _NUMBER["hidden"], why)
    if isinstance(ground, HeightMap):
        why = np.where(np.isnan(ground.height_at(xy)), _NUMBER["unknown"], why)
    flat = mask.ravel()
    why = np.where(flat, np.where(resolved.ravel(), _NUMBER["resolved"], _NUMBER["unresolved"]), why)
    if camera.position[2] <= height_at(ground, *camera.position[:2]):
        why = np.where(flat | valid, _NUMBER["horizon"], why)
    return why.astype(np.uint8).reshape(grid.shape)


def _far_end(camera: Camera, grid: BevGrid, ground: float | Plane | HeightMap, why: NDArray[np.uint8]) -> FarEnd | None:
    """Return what errors cost at the farthest seen cell within five degrees of where the camera looks, or at all."""
    seen = why <= _NUMBER["unresolved"]
    if not seen.any():
        return None
    xy, state = grid.xy()[seen], why[seen]
    away = xy - camera.position[:2]
    distance = np.hypot(*away.T)
    axis = camera.vehicle_from_camera[:2, 2]
    along = (away @ axis) / np.maximum(distance * np.hypot(*axis), 1e-12)
    ahead = along > math.cos(math.radians(5))
    if not ahead.any():
        ahead = np.ones_like(ahead)
    index = int(np.argmax(np.where(ahead, distance, -1)))
    near = ahead & (state == _NUMBER["resolved"])
    uv, _, _ = camera.project(xy[index : index + 1], ground=ground)
    by_pixel, by_pitch = camera.range_error(uv, ground=ground)
    return FarEnd(
        place=(float(xy[index, 0]), float(xy[index, 1])),
        distance=float(distance[index]),
        by_pixel=float(by_pixel[0]),
        by_pitch=float(by_pitch[0]),
        resolved_to=float(distance[near].max()) if near.any() else None,
    )
