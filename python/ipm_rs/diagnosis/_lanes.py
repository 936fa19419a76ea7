"""Whether what runs along the road runs parallel in the bird's-eye view: what a wrong pitch looks like.

Where lines along the road are parallel to x, a column of the view has one colour from near to far. So the view is made
with other pitches and yaws too, and the one whose columns differ most among each other, beside what differs within
them, is that of straight lines. A hint, from one picture: `ipm_rs.refine` finds poses, with their uncertainty.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, HeightMap, Lut, Plane, rotation_from_euler
from ipm_rs.errors import IpmError

__all__ = ["Straightness", "straightness_of"]

_CELL = (0.25, 0.1)
_AHEAD, _ASIDE = 20.0, 6.0
_PITCHES = np.arange(-3.0, 3.01, 0.5)  # degrees; then the two beside the best, at half the step
_SHEARS = np.linspace(-0.06, 0.06, 25)


@dataclass(frozen=True)
class Straightness:
    """With which pitch and yaw lines along the road become parallel to x."""

    pitch_deg: float
    """By how much the pitch is too large, degrees."""
    yaw_deg: float
    """By how much lines lean to the left then, degrees."""
    now: float
    """Part of the view's variance that is between columns, as the camera stands."""
    best: float
    """The same with the best pitch."""


def straightness_of(camera: Camera, ground: float | Plane | HeightMap, image: NDArray[Any]) -> Straightness | None:
    """Return with which pitch lines run straight; None where the camera does not look along the road."""
    x, y, _ = camera.position
    axis = camera.vehicle_from_camera[:3, 2]
    if axis[0] < 0.85 or isinstance(ground, HeightMap):
        return None
    ranges = camera.row_ranges(ground=ground)
    nearest = float(np.nanmin(ranges)) if np.isfinite(ranges).any() else math.nan
    if not nearest < 30:
        return None
    first, middle = math.ceil(x + nearest + 0.5), round(float(y), 1)
    grid = BevGrid(x=(first, first + _AHEAD), y=(middle - _ASIDE, middle + _ASIDE), resolution=_CELL)
    scores: dict[float, NDArray[np.float64]] = {}

    def look(degrees: float) -> float:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            lut = Lut(_pitched(camera, -math.radians(degrees)), grid, ground=ground)
        scores[degrees] = _between_columns(lut.warp(image), lut.mask)
        return float(np.nanmax(scores[degrees], initial=-1.0))

    try:
        best = max((look(float(degrees)), float(degrees)) for degrees in _PITCHES)[1]
        best = max((float(np.nanmax(scores[best], initial=-1.0)), best), (look(best - 0.25), best - 0.25))[1]
        best = max((float(np.nanmax(scores[best], initial=-1.0)), best), (look(best + 0.25), best + 0.25))[1]
    except IpmError:
        return None
    if np.isnan(scores[best]).all() or np.isnan(scores[0.0]).all():
        return None
    return Straightness(
        pitch_deg=best,
        yaw_deg=math.degrees(float(_SHEARS[int(np.nanargmax(scores[best]))])),
        now=float(np.nanmax(scores[0.0])),
        best=float(np.nanmax(scores[best])),
    )


def _pitched(camera: Camera, angle: float) -> Camera:
    """Return the camera that looks down by so much more, at its place."""
    pose = camera.vehicle_from_camera
    pose[:3, :3] = rotation_from_euler(0.0, angle, 0.0) @ pose[:3, :3]
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3]
    return camera.with_pose(inverse, nearest_rotation=True)


def _between_columns(view: NDArray[Any], mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return, for each shear, the part of the variance of the view's edges that is between its columns."""
    grey = view.astype(np.float64)
    grey = grey.mean(axis=2) if grey.ndim == 3 else grey
    aside = grey[:, 2:] - grey[:, :-2]
    known = mask[:, 2:] & mask[:, :-2]
    limit = 3 * float(np.median(np.abs(aside[known]))) + 1e-9 if known.sum() > 500 else math.nan
    edges = np.where(known, np.clip(aside, -limit, limit), 0.0)
    rows, cols = edges.shape
    ahead = (np.arange(rows)[::-1] - rows / 2) * _CELL[0] / _CELL[1]
    found = np.full(len(_SHEARS), np.nan)
    if math.isnan(limit):
        return found
    for k, shear in enumerate(_SHEARS):
        moved = np.arange(cols)[None, :] - np.rint(shear * ahead)[:, None].astype(int)
        inside = (moved >= 0) & (moved < cols)
        at = np.clip(moved, 0, cols - 1)
        values = np.take_along_axis(edges, at, axis=1) * inside
        there = np.take_along_axis(known, at, axis=1) & inside
        count = there.sum(axis=0)
        full = count > rows / 3
        if full.sum() < 20:
            continue
        mean = values.sum(axis=0)[full] / count[full]
        every = (values**2).sum(axis=0)[full] / count[full]
        # the mean of n cells without any structure has the variance of one by n
        found[k] = ((mean**2 - every / count[full]).sum()) / every.sum()
    return found
