"""`Lut.between`: the table from a camera's picture to that of another camera at the same place."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Camera, Lut
from ipm_rs.errors import ArgumentError, ArgumentTypeError, OutOfMemoryError

__all__ = ["between", "exact_maps"]

_APART = 1e-6  # metres; rounding of poses leaves less, and no picture shows it
_BAND = 1 << 16  # pixels at a time: their rays stay in the cache, and memory is that of the maps

Map = NDArray[np.float64]
BorderMode = Literal["constant", "replicate", "reflect", "reflect_101", "wrap"]


def between(source: Camera, target: Camera, *, border_mode: BorderMode = "constant") -> Lut:
    """Make the table from the pictures of `source` to those that `target` would take from the same place.

    Each pixel of the target looks along a ray, and samples the source where that ray is seen: undistorted, rectified,
    turned, cropped, on a cylinder, or any lens from any other. What the source does not see, or masks, is invalid.

    Parameters
    ----------
    source : Camera
        Whose pictures are warped.
    target : Camera
        Whose pictures are made, such as ``source.undistorted()``; ``source.with_pose(pose)`` turned, but at its place.

    border_mode : str
        What lies beyond the source's picture, as for `Lut`.

    Returns
    -------
    Lut
        Of the target's size. Its ``camera``, ``grid`` and ``ground`` are None: a view has no road.

    Raises
    ------
    ArgumentError
        The cameras stand at different places: only a road, or a depth, says what one sees of the other's picture.
    ArgumentTypeError
        No cameras.
    OutOfMemoryError
        There is no memory for the table.

    Notes
    -----
    Coordinates are those of ``cv2.initUndistortRectifyMap`` and ``cv2.fisheye.initUndistortRectifyMap``, in float64
    instead of float32; a table keeps them to 1/65536 pixel.
    """
    map_x, map_y = exact_maps(source, target)
    size, wraps = source.image_size, source.is_panorama
    lut = Lut.from_maps(map_x, map_y, source_size=size, border_mode=border_mode, source_wraps=wraps)
    mask = source.mask
    if mask is None:
        return lut
    # An average over all of a pixel's footprint is white only where every pixel that counts is shown; what lies outside
    # the picture hides nothing.
    white = lut.warp(mask.astype(np.uint8) * np.uint8(255), interpolation="area", border_value=255)
    map_x[white < 255] = np.nan
    return Lut.from_maps(map_x, map_y, source_size=size, border_mode=border_mode, source_wraps=wraps)


def exact_maps(source: Camera, target: Camera) -> tuple[Map, Map]:
    """Say where the target's pixels are in the source: two arrays of its (height, width), NaN where they are not."""
    for name, camera in (("source", source), ("target", target)):
        if not isinstance(camera, Camera):
            raise ArgumentTypeError(f"{name}: expected a Camera, got {type(camera).__name__}; pass one")
    apart = float(np.linalg.norm(source.position - target.position))
    if not apart <= _APART * max(1.0, float(np.abs(source.position).max())):
        raise ArgumentError(
            f"target: expected a camera at the place of the source, got one {apart:.3g} m from it; turn it with "
            "with_pose about its own position, or warp both onto the road with Lut(camera, grid)"
        )
    width, height = target.image_size
    try:
        map_x, map_y = np.empty((height, width)), np.empty((height, width))
    except (MemoryError, ValueError) as error:
        raise OutOfMemoryError(f"Lut: no memory for the {width}x{height} pixels of the target") from error
    # at the origin, so that rays are not added to a position, which costs digits
    eye = [_at_origin(camera) for camera in (source, target)]
    rows = max(1, _BAND // width)
    for first in range(0, height, rows):
        last = min(first + rows, height)
        v, u = np.mgrid[first:last, 0:width]
        rays = eye[1].unproject(np.column_stack([u.ravel(), v.ravel()]).astype(np.float64))
        pixels = eye[0].project(rays)[0].reshape(last - first, width, 2)
        map_x[first:last], map_y[first:last] = pixels[..., 0], pixels[..., 1]
    return map_x, map_y


def _at_origin(camera: Camera) -> Camera:
    pose = camera.camera_from_vehicle.copy()
    pose[:3, 3] = 0
    return camera.with_pose(pose)
