"""Rotations and poses out of a calibration, checked, and what is made of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ipm_rs.calibration._values import Matrix, items_of, matrix, numbers
from ipm_rs.errors import CalibrationError

__all__ = ["OPTICAL_FROM_FLU", "inverse", "pinhole", "pose", "quaternion", "rigid", "rodrigues", "rotation"]

OPTICAL_FROM_FLU: Matrix = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Axes x forward, y left, z up to the optical ones, x right, y down, z forward."""
OPTICAL_FROM_FLU.flags.writeable = False

_ROTATION_TOLERANCE = 1e-4  # of |R^T R - I|, the camera's own
_NEAREST_TOLERANCE = 3e-2  # three printed digits; beyond it the numbers are others, and no nearest rotation is right
_NORM_TOLERANCE = 1e-3  # of |q| - 1: printed digits, no more


def rotation(value: Any, where: str, *, nearest: bool = False) -> Matrix:
    """Check a (3, 3) rotation, which is kept as given: ``|R^T R - I| <= 1e-4`` and ``det R > 0``.

    With `nearest`, one that is off by up to 3e-2 is replaced by the nearest rotation, in the sum of squares.
    """
    R = matrix(value, where, (3, 3))
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(np.abs(R.T @ R - np.eye(3)).max())
        close = error <= _NEAREST_TOLERANCE
        mirrored = close and bool(np.linalg.det(R) <= 0)
    if mirrored:
        raise CalibrationError(
            f"{where}: expected a rotation, det R = +1, got a reflection, det R = -1; it is of a left-handed frame or "
            "lacks a sign, see flip_handedness_rotation()"
        )
    if nearest and close:
        U, _, V = np.linalg.svd(R)
        return np.asarray(U @ V, dtype=np.float64)
    if not error <= _ROTATION_TOLERANCE:
        mend = (
            "print the numbers with six digits or more, or pass nearest_rotation=True"
            if close
            else "check the order of the numbers"
        )
        raise CalibrationError(
            f"{where}: expected a rotation, |R^T R - I| <= {_ROTATION_TOLERANCE:g}, got {error:.3g}; {mend}"
        )
    return R


def pose(value: Any, where: str, *, unit: str = "metres", nearest: bool = False) -> Matrix:
    """Check a rigid transform, 3x4 or 4x4, by rows or flat; (4, 4) float64, its numbers as given, or see `rotation`."""
    items = items_of(value)
    tall = items is not None and len(items) in (4, 16)
    T = matrix(value, where, (4, 4) if tall else (3, 4), unit=unit)
    R = rotation(T[:3, :3], f"{where}[:3, :3]", nearest=nearest)
    if tall and not np.array_equal(T[3], (0, 0, 0, 1)):
        raise CalibrationError(
            f"{where}[3]: expected the last row 0 0 0 1, got {' '.join(f'{x:g}' for x in T[3])}; a transform that is "
            "stored by columns must be transposed first"
        )
    return rigid(R, T[:3, 3])


def quaternion(value: Any, where: str, order: str, *, nearest: bool = False) -> Matrix:
    """Rotation matrix, (3, 3), of a unit quaternion whose numbers come in the order ``"wxyz"`` or ``"xyzw"``.

    It is normalised first; a norm more than 1e-3 from 1, or with `nearest` more than 3e-2, is refused.
    """
    q = numbers(value, where, 4)
    with np.errstate(over="ignore"):
        norm = float(np.sqrt((q * q).sum()))
    close = abs(norm - 1) <= _NEAREST_TOLERANCE
    if not (abs(norm - 1) <= _NORM_TOLERANCE or (nearest and close)):
        mend = (
            "print them with six digits or more, or pass nearest_rotation=True" if close else "check its four numbers"
        )
        raise CalibrationError(
            f"{where}: expected a quaternion of norm 1 ({', '.join(order)}), got norm {norm:.6g}; "
            + ("a camera that is not turned has w = 1" if norm == 0 else mend)
        )
    w, x, y, z = (float(q[order.index(axis)]) / norm for axis in "wxyz")
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def rigid(R: Matrix, t: Matrix | Sequence[float]) -> Matrix:
    """(4, 4) transform of a rotation and a translation."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T


def inverse(T: Matrix) -> Matrix:
    """(4, 4) inverse of a rigid transform as printed: not quite orthonormal, which this undoes exactly."""
    undone = np.asarray(np.linalg.inv(T), dtype=np.float64)
    undone[3] = (0.0, 0.0, 0.0, 1.0)
    return undone


def pinhole(fx: float, fy: float, cx: float, cy: float, skew: float = 0.0) -> Matrix:
    """(3, 3) intrinsic matrix."""
    return np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def rodrigues(rvec: Matrix) -> Matrix:
    """Rotation by |rvec| radians about rvec, after Rodrigues."""
    angle = math.hypot(*rvec)
    if angle == 0:
        return np.eye(3)
    x, y, z = rvec / angle
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result: Matrix = np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * (across @ across)
    return result
