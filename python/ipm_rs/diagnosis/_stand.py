"""Where a camera stands and looks, and what it sees of its road: numbers, without judgement."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Camera, HeightMap, Plane

__all__ = ["Stand", "angles_of", "height_at", "stand_of"]

FLU_TO_OPTICAL = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
_TABLE = (5.0, 10.0, 20.0, 30.0, 50.0, 100.0)


@dataclass(frozen=True, eq=False)
class Stand:
    """Where a camera stands and looks; metres and degrees."""

    position: tuple[float, float, float]
    height: float
    """Above the road under it; NaN where that is not known."""
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    view_deg: tuple[float, float]
    horizon_row: float | None
    """In the middle column; None where the horizon is not there."""
    sees: str
    """What the middle column shows: "road and sky", "road", "sky"."""
    bottom_range: float
    """Metres to the road at the bottom of the middle column; NaN where it is not seen."""
    rows: dict[float, float]
    """Row of the middle column that sees the road at so many metres."""


def angles_of(vehicle_from_camera: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return roll, pitch and yaw in radians as `Camera.from_euler` takes them."""
    B = vehicle_from_camera[:3, :3] @ FLU_TO_OPTICAL
    pitch = math.asin(float(np.clip(-B[2, 0], -1, 1)))
    return math.atan2(B[2, 1], B[2, 2]), pitch, math.atan2(B[1, 0], B[0, 0])


def height_at(ground: float | Plane | HeightMap, x: float, y: float) -> float:
    """Return z of the road at a place; of a height map that does not reach there, its middle height."""
    if isinstance(ground, Plane):
        return float(ground.height_at([[x, y]])[0])
    if isinstance(ground, HeightMap):
        here = float(ground.height_at([[x, y]])[0])
        return here if math.isfinite(here) else float(np.nanmedian(ground.heights))
    return float(ground)


def stand_of(camera: Camera, ground: float | Plane | HeightMap) -> Stand:
    """Return where a camera stands and looks."""
    x, y, z = (float(value) for value in camera.position)
    roll, pitch, yaw = angles_of(camera.vehicle_from_camera)
    width, height = camera.image_size
    ranges = camera.row_ranges(ground=ground)
    row, sees = _horizon(camera, ground, ranges)
    return Stand(
        position=(x, y, z),
        height=z - height_at(ground, x, y),
        heading_deg=math.degrees(yaw),
        pitch_deg=math.degrees(pitch),
        roll_deg=math.degrees(roll),
        view_deg=(_angle_of_view(camera, 0, width), _angle_of_view(camera, 1, height)),
        horizon_row=row,
        sees=sees,
        bottom_range=float(ranges[-1]),
        rows=_rows(ranges),
    )


def _angle_of_view(camera: Camera, axis: int, pixels: int) -> float:
    """Return the angle from edge to edge through the principal point, degrees; of a lens, as far as it sees."""
    K = camera.intrinsics
    uv = np.tile([K[0, 2], K[1, 2]], (129, 1))
    uv[:, axis] = np.linspace(-0.5, pixels - 0.5, 129)
    cosines = camera.unproject(uv) @ camera.vehicle_from_camera[:3, 2]
    seen = np.flatnonzero(np.isfinite(cosines))
    if not len(seen):
        return math.nan
    signs = [1.0 if uv[k, axis] >= K[axis, 2] else -1.0 for k in (seen[0], seen[-1])]
    first, last = (math.degrees(math.acos(float(np.clip(cosines[k], -1, 1)))) for k in (seen[0], seen[-1]))
    return signs[1] * last - signs[0] * first


def _horizon(
    camera: Camera, ground: float | Plane | HeightMap, ranges: NDArray[np.float64]
) -> tuple[float | None, str]:
    middle = (camera.image_size[0] - 1) / 2
    for piece in camera.horizon(ground=0.0 if isinstance(ground, HeightMap) else ground):
        for (u0, v0), (u1, v1) in itertools.pairwise(piece):
            if min(u0, u1) <= middle <= max(u0, u1) and u0 != u1:
                return float(v0 + (middle - u0) / (u1 - u0) * (v1 - v0)), "road and sky"
    seen = np.isfinite(ranges)
    return None, "road and sky" if seen.any() and not seen.all() else "road" if seen.all() else "sky"


def _rows(ranges: NDArray[np.float64]) -> dict[float, float]:
    """Return the rows, between pixels too, at which the range passes some distances, from the bottom up."""
    found: dict[float, float] = {}
    order = ranges[::-1]
    known = np.flatnonzero(np.isfinite(order))
    if len(known) < 2:
        return found
    values = order[known]
    for metres in _TABLE:
        passed = np.flatnonzero((values[:-1] <= metres) & (values[1:] > metres))
        if len(passed):
            k = int(passed[0])
            part = (metres - values[k]) / (values[k + 1] - values[k])
            found[metres] = len(ranges) - 1 - float(known[k] + part * (known[k + 1] - known[k]))
    return found
