"""Polygons cut by straight lines (Sutherland and Hodgman 1974)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["inside", "inside_circle", "inside_rectangle"]

Points = NDArray[np.float64]


def inside(ring: Points, distances: Points) -> Points:
    """Cut a polygon of any dimension to where `distances`, linear in the points, are positive.

    Parameters
    ----------
    ring : (N, k) array
        Vertices, in order.
    distances : (N,) array
        Of each from what cuts.

    Returns
    -------
    (M, k) array
        The vertices of what is left; none where nothing is. Parts that a concave polygon falls into hang together by
        edges that lie on the cut, in both directions, which take no area.
    """
    if not len(ring):
        return ring
    after, other = np.roll(ring, -1, axis=0), np.roll(distances, -1)
    keeps, crosses = distances > 0, (distances > 0) != (other > 0)
    part = (distances / np.where(crosses, distances - other, 1.0))[:, np.newaxis] * crosses[:, np.newaxis]
    # a vertex that is kept, and behind it where its edge is cut
    pairs = np.stack([ring, ring + part * (after - ring)], axis=1)
    result: Points = pairs[np.column_stack([keeps, crosses])]
    return result


def inside_rectangle(ring: Points, low: tuple[float, float], high: tuple[float, float]) -> Points:
    """Cut a polygon of (N, 2) to a rectangle, its edge included."""
    for axis in (0, 1):
        for sign, edge in ((1, low[axis]), (-1, high[axis])):
            ring = inside(ring, sign * (ring[:, axis] - edge))
            ring[:, axis] = np.maximum(ring[:, axis], edge) if sign > 0 else np.minimum(ring[:, axis], edge)
    return ring


def inside_circle(ring: Points, centre: Points, radius: float) -> Points:
    """Cut a polygon of (N, 2) to a circle, of which 128 chords are taken: inside it by up to 3e-4 of the radius."""
    for angle in np.arange(128) * (2 * np.pi / 128):
        outwards = np.array([np.cos(angle), np.sin(angle)])
        ring = inside(ring, radius * np.cos(np.pi / 128) - (ring - centre) @ outwards)
        if not len(ring):
            break
    return ring
