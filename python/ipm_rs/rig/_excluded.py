"""Polygons on the ground whose cells a ring does not show."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import array_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError

__all__ = ["polygons_of"]

_MOST_POLYGONS = 10_000
_FARTHEST = 1e9
"""Metres."""


def polygons_of(exclude: Any) -> list[NDArray[Any]]:
    """Make a list of polygons, copies; one polygon is a list of one."""
    if exclude is None:
        return []
    try:
        listed = list(itertools.islice(exclude, _MOST_POLYGONS + 1))
    except MemoryError:
        raise
    except Exception as error:  # `__iter__` raises what it likes
        raise ArgumentTypeError(
            f"exclude: expected polygons, (M, 2) arrays of metres, got {type(exclude).__name__}"
        ) from error
    if len(listed) > _MOST_POLYGONS:
        raise ArgumentError(f"exclude: expected at most {_MOST_POLYGONS} polygons, got more")
    polygons = [array_of(f"exclude[{index}]", polygon).copy() for index, polygon in enumerate(listed)]
    if polygons and all(corner.ndim == 1 for corner in polygons):
        polygons = [array_of("exclude", listed).copy()]
        _check_corners("exclude", polygons[0])
        return polygons
    for index, polygon in enumerate(polygons):
        _check_corners(f"exclude[{index}]", polygon)
    return polygons


def _check_corners(name: str, polygon: NDArray[Any]) -> None:
    """Refuse too few corners, or some far out; another shape or dtype is refused by the core."""
    if polygon.ndim != 2 or polygon.dtype.kind not in "iuf":
        return
    wanted = f"{name}: expected a polygon of at least 3 corners x, y in metres"
    if len(polygon) < 3:
        raise ArgumentError(f"{wanted}, got {len(polygon)}; add corners, or leave it out")
    if not np.isfinite(polygon).all():
        raise ArgumentError(f"{wanted}, got one that is not finite; correct it")
    if (np.abs(polygon) > _FARTHEST).any():
        raise ArgumentError(f"{wanted}, up to {_FARTHEST:g} m away, got one that is farther; correct it")
