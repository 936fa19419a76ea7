"""Frames in the map: where their camera stands, and which windows of which tiles it sees well."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of, number_of
from ipm_rs._core import BevGrid, Camera, HeightMap, Plane, _mosaic_windows
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError
from ipm_rs.mosaic._tiles import TileKey
from ipm_rs.trajectory._trajectory import poses_of

__all__ = ["Placed", "Window", "distance_of", "ground_in_map", "placed", "pose_of", "windows"]

FARTHEST_OUT = 1e7
"""Metres from the map's origin: UTM's northings fit, and a cell of 1 mm is still told from the next in float64."""

Ground = float | Plane | HeightMap


@dataclass(frozen=True)
class Placed:
    """A camera in the map, as the core takes it; `id` tells the frame from others where samples are kept."""

    camera: Camera
    ground: Ground
    at: tuple[float, float]
    distance: tuple[float, float]
    weight: float
    id: int = 0


@dataclass(frozen=True)
class Window:
    """Some cells of a tile: the tile, the first row and column in it, and the grid of the cells."""

    key: TileKey
    at: tuple[int, int]
    grid: BevGrid


def pose_of(value: ArrayLike) -> NDArray[np.float64]:
    """Return a pose, or raise ArgumentError, ArgumentTypeError or CalibrationError for what is none."""
    array = array_of("map_from_vehicle", value)
    if array.shape != (4, 4):
        raise ArgumentError(f"map_from_vehicle: expected shape (4, 4), got {array.shape}; give one pose for each call")
    if array.dtype.kind in "iuf" and not np.isfinite(array).all():
        raise CalibrationError(
            "map_from_vehicle: expected finite numbers, got NaN or infinite ones; leave the frame out"
        )
    pose = poses_of("map_from_vehicle", array[None])[0]
    if np.abs(pose[:3, 3]).max() > FARTHEST_OUT:
        raise CalibrationError(
            f"map_from_vehicle: expected a place within {FARTHEST_OUT:g} m of the map's origin, got "
            f"{np.abs(pose[:3, 3]).max():g}; subtract an origin, or correct the unit"
        )
    return pose


def distance_of(value: Any) -> tuple[float, float]:
    """Return the two distances of an argument; None is no limit."""
    if value is None:
        return 0.0, math.inf
    array = array_of("distance", value)
    if array.shape != (2,) or array.dtype.kind not in "iuf":
        raise ArgumentTypeError(f"distance: expected (min, max) in metres, got {array.dtype} of shape {array.shape}")
    near, far = float(array[0]), float(array[1])
    if not 0 <= near < far:
        raise ArgumentError(f"distance: expected 0 <= min < max, got ({near:g}, {far:g}); swap or correct them")
    return near, far


def ground_in_map(ground: Any, map_from_vehicle: NDArray[np.float64]) -> Ground:
    """Return the road in the map; ``"wheels"`` is the plane z = 0 of the vehicle."""
    if isinstance(ground, str):
        if ground != "wheels":
            raise ArgumentError(f'ground: expected a height, a Plane, a HeightMap or "wheels", got {ground!r:.40}')
        return Plane(normal=(0.0, 0.0, 1.0)).transformed(map_from_vehicle)
    if isinstance(ground, (Plane, HeightMap)):
        return ground
    return number_of("ground", ground, what=' of metres, a Plane, a HeightMap or "wheels"')


def placed(
    camera: Camera, map_from_vehicle: NDArray[np.float64], ground: Ground, distance: tuple[float, float], weight: float
) -> Placed:
    """Return a camera in the map.

    Raises
    ------
    CalibrationError
        It is not above the road.
    """
    # R and t of camera_from_vehicle after the inverse of the pose, which is rigid to 1e-4 and kept as given
    in_map = camera.with_pose(camera.camera_from_vehicle @ np.linalg.inv(map_from_vehicle), nearest_rotation=True)
    position = in_map.position
    height = position[2] - float(height_at(ground, position[None, :2])[0])
    if height <= 0:
        raise CalibrationError(
            f"ground: expected the road below the camera, got it {-height:.2f} m above; give the road's height in the "
            'map, or ground="wheels" for the plane that the vehicle stands on'
        )
    return Placed(in_map, ground, (float(map_from_vehicle[0, 3]), float(map_from_vehicle[1, 3])), distance, weight)


def height_at(ground: Ground, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the road's heights, NaN where they are not known."""
    return np.full(len(xy), ground) if isinstance(ground, float) else ground.height_at(xy)


def windows(frame: Placed, resolution: float, side: int) -> list[Window]:
    """Return the windows that hold all cells that a frame sees well, tile by tile."""
    return [Window(*found) for found in _mosaic_windows(frame, resolution, side)]


def cells_grid(x: tuple[int, int], y: tuple[int, int], resolution: float) -> BevGrid:
    """Return the grid of the map's cells between two of them along each axis."""
    return BevGrid(
        x=(x[0] * resolution, x[1] * resolution), y=(y[0] * resolution, y[1] * resolution), resolution=resolution
    )
