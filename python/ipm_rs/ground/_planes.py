"""`Plane.transformed` and `Plane.from_camera`: the road in the frame that it was measured in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of
from ipm_rs._core import Camera, Plane
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = ["from_camera", "transformed"]

_RIGID = 1e-4  # as of a camera's pose


def transformed(self: Plane, T: ArrayLike) -> Plane:
    """Give the same plane in another frame.

    Parameters
    ----------
    T : (4, 4) array_like
        Takes points of the plane's frame to the other: a rotation and a translation in metres.

    Returns
    -------
    Plane
        Whose points are ``T @ (x, y, z, 1)`` of this one's.

    Raises
    ------
    ArgumentError
        The plane stands upright there, so that it has no height at (x, y).
    CalibrationError
        `T` is no rigid motion.
    ArgumentTypeError
        `T` is no array of numbers.
    """
    matrix = array_of("T", T)
    if matrix.dtype.kind not in "iuf":
        raise ArgumentTypeError(f"T: expected numbers, got {matrix.dtype}")
    if matrix.shape != (4, 4):
        raise ArgumentError(f"T: expected shape (4, 4), got {matrix.shape}")
    matrix = matrix.astype(np.float64)
    R = matrix[:3, :3]
    with np.errstate(all="ignore"):
        rigid = np.abs(R.T @ R - np.eye(3)).max() <= _RIGID and np.linalg.det(R) > 0
    if not np.isfinite(matrix).all() or not rigid or (matrix[3] != [0, 0, 0, 1]).any():
        raise CalibrationError(
            "T: expected a rotation and a translation in metres, [[R, t], [0, 0, 0, 1]], got a matrix that scales, "
            "mirrors or is not finite"
        )
    point = R @ [0.0, 0.0, self.coefficients[0]] + matrix[:3, 3]
    return Plane(normal=(R @ self.normal).tolist(), point=point.tolist())


def from_camera(camera: Camera, *, normal: Sequence[float], point: Sequence[float]) -> Plane:
    """Make the plane that was measured in a camera's own frame, as from a board or a depth image.

    Parameters
    ----------
    camera : Camera
        In whose optical frame (x right, y down, z forward) the plane is given, and whose pose takes it to the vehicle.
    normal : (float, float, float)
        At a right angle to the plane, of any length and either sign. A level road's is about (0, -1, 0).
    point : (float, float, float)
        Any point of the plane, metres. Of ``n . p + d = 0`` it is ``-d n / (n . n)``.

    Returns
    -------
    Plane
        In the vehicle frame, for ``ground=``.

    Raises
    ------
    ArgumentError
        The normal is zero, or the plane upright in the vehicle frame.
    ArgumentTypeError, CalibrationError
        No camera; numbers that are none or not finite.
    """
    if not isinstance(camera, Camera):
        raise ArgumentTypeError(f"camera: expected a Camera, got {type(camera).__name__}; pass one")
    pose = camera.vehicle_from_camera
    turned = pose[:3, :3] @ _three("normal", normal)
    return Plane(normal=turned.tolist(), point=(pose[:3, :3] @ _three("point", point) + pose[:3, 3]).tolist())


def _three(name: str, values: Sequence[float]) -> NDArray[np.float64]:
    given = array_of(name, values)
    if given.dtype.kind not in "iuf" or given.shape != (3,):
        raise ArgumentTypeError(f"{name}: expected (x, y, z), got {given.dtype} of shape {given.shape}")
    if not np.isfinite(given).all():
        raise CalibrationError(f"{name}: expected finite numbers, got NaN or infinity")
    return given.astype(np.float64)
