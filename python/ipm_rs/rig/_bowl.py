"""`Bowl`: a road that rises around the car, so that what stands around it is not smeared to infinity."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of
from ipm_rs._core import BevGrid, HeightMap
from ipm_rs.errors import ArgumentError, ArgumentTypeError

__all__ = ["Bowl"]

_MOST_NODES = 2_000  # a side; a bowl is smooth, and a map of 4 million nodes holds 32 MB


class Bowl:
    """A surface that is flat around the car and rises outside, as surround views are shown on.

    On a flat road whatever stands on it is smeared away from the camera, without end. On a bowl it stands up where the
    flat part ends. Seen from above, distances beyond the flat part are no longer those of the road. Immutable,
    comparable, hashable, picklable.

    Parameters
    ----------
    flat : float or (float, float)
        Radius of the flat part, or the length (along x) and width of a flat rectangle, metres.
    radius : float
        Radius of the circular arc in which the surface begins to rise, metres.
    center : (float, float)
        (x, y) of the middle of the flat part, metres: that of the car, not of its rear axle.
    height : float
        z of the flat part, metres.
    steepest : float
        Slope at which the arc goes on as a straight wall, degrees, below 80.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        A number cannot be right.
    """

    __slots__ = ("_center", "_flat", "_height", "_radius", "_steepest")

    def __init__(
        self,
        flat: float | Sequence[float],
        radius: float = 5.0,
        center: Sequence[float] = (0.0, 0.0),
        height: float = 0.0,
        steepest: float = 60.0,
    ) -> None:
        sides = _numbers("flat", flat, (1, 2))
        if min(sides) <= 0:
            raise ArgumentError("flat: expected a radius, or a length and a width, above 0 metres")
        self._flat: float | tuple[float, float] = sides[0] if len(sides) == 1 else (sides[0], sides[1])
        (self._radius,), (self._height,) = _numbers("radius", radius, (1,)), _numbers("height", height, (1,))
        (self._steepest,) = _numbers("steepest", steepest, (1,))
        x, y = _numbers("center", center, (2,))
        self._center = (x, y)
        if self._radius <= 0:
            raise ArgumentError(f"radius: expected metres above 0, got {self._radius:g}")
        if not 0 < self._steepest < 80:
            raise ArgumentError(f"steepest: expected degrees above 0 and below 80, got {self._steepest:g}")

    @property
    def flat(self) -> float | tuple[float, float]:
        """Radius of the flat part, or its length and width, metres."""
        return self._flat

    @property
    def radius(self) -> float:
        """Radius of the arc, metres."""
        return self._radius

    @property
    def center(self) -> tuple[float, float]:
        """(x, y) of the middle of the flat part, metres."""
        return self._center

    @property
    def height(self) -> float:
        """Height z of the flat part, metres."""
        return self._height

    @property
    def steepest(self) -> float:
        """Slope of the wall, degrees."""
        return self._steepest

    def _parts(self) -> tuple[float | tuple[float, float], float, tuple[float, float], float, float]:
        return self._flat, self._radius, self._center, self._height, self._steepest

    def __eq__(self, other: object) -> bool:
        return self._parts() == other._parts() if isinstance(other, Bowl) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._parts())

    def __reduce__(self) -> tuple[Any, ...]:
        return Bowl, self._parts()

    def __repr__(self) -> str:
        flat, radius, center, height, steepest = self._parts()
        return f"Bowl(flat={flat}, radius={radius}, center={center}, height={height}, steepest={steepest})"

    def height_at(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Return z of the surface, (...,) float64 metres, at points (..., 2).

        With d the distance from the flat part, ``z = height + radius - sqrt(radius^2 - d^2)`` up to the steepest slope,
        and straight on from there.

        Raises
        ------
        ArgumentError, ArgumentTypeError
            The points are no (..., 2) array of numbers.
        """
        points = array_of("xy", xy)
        if points.ndim < 1 or points.shape[-1] != 2 or points.dtype.kind not in "iuf":
            raise ArgumentError(f"xy: expected (..., 2) numbers, got {points.dtype} of shape {points.shape}")
        across = np.abs(points.astype(np.float64) - self._center)
        if isinstance(self._flat, tuple):
            beyond = np.maximum(across - np.array(self._flat) / 2, 0.0)
            distance = np.hypot(beyond[..., 0], beyond[..., 1])
        else:
            distance = np.maximum(np.hypot(across[..., 0], across[..., 1]) - self._flat, 0.0)
        angle = math.radians(self._steepest)
        end = self._radius * math.sin(angle)
        arc = self._radius - np.sqrt(self._radius**2 - np.minimum(distance, end) ** 2)
        risen: NDArray[np.float64] = self._height + arc + math.tan(angle) * np.maximum(distance - end, 0.0)
        return risen

    def height_map(self, grid: BevGrid) -> HeightMap:
        """Return the surface below a grid, as ``ground=`` takes it.

        Its nodes are a cell apart, or as far as makes 2000 of the longer side, and reach over the grid's edges.

        Raises
        ------
        ArgumentTypeError
            `grid` is something else.
        """
        if not isinstance(grid, BevGrid):
            raise ArgumentTypeError(f"grid: expected an ipm_rs.BevGrid, got {type(grid).__name__}")
        (x0, x1), (y0, y1) = grid.x, grid.y
        steps = [
            max(size, (end - start) / _MOST_NODES)
            for size, start, end in zip(grid.resolution, (x0, y0), (x1, y1), strict=True)
        ]
        counts = [
            math.ceil((end - start) / step) + 3 for step, start, end in zip(steps, (x0, y0), (x1, y1), strict=True)
        ]
        origin = (x0 - steps[0], y0 - steps[1])
        xs, ys = (origin[axis] + steps[axis] * np.arange(counts[axis]) for axis in (0, 1))
        nodes = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1)
        return HeightMap(self.height_at(nodes), origin=origin, spacing=(steps[0], steps[1]))


def _numbers(name: str, value: float | Sequence[float], counts: Sequence[int]) -> list[float]:
    """Return the finite numbers of an argument, of which there may be as many as `counts` says."""
    array = array_of(name, value)
    if array.dtype.kind not in "iuf" or array.size not in counts or array.ndim > 1 or not np.isfinite(array).all():
        wanted = " or ".join(str(count) for count in counts)
        raise ArgumentError(f"{name}: expected {wanted} finite numbers, got {array.dtype} of shape {array.shape}")
    return [float(number) for number in array.reshape(-1)]
