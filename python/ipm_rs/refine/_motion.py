"""Rotations and poses that move by small steps, and their angles as `Camera.from_euler` counts them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Camera
from ipm_rs.calibration._rotations import OPTICAL_FROM_FLU, rigid, rodrigues

__all__ = ["angles_of", "axes_of_angles", "cross_matrices", "pose_of", "turned", "upright"]

Matrix = NDArray[np.float64]


def turned(rotation: Matrix, vector: Matrix) -> Matrix:
    """Turn a rotation by a vector in the frame that it leads to, and make it orthonormal again."""
    U, _, V = np.linalg.svd(rodrigues(vector) @ rotation)
    return np.asarray(U @ V, dtype=np.float64)


def cross_matrices(vectors: Matrix) -> Matrix:
    """(N, 3, 3) matrices `[v]` with `[v] a = v x a`."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angles_of(vehicle_from_camera: Matrix) -> tuple[float, float, float]:
    """(roll, pitch, yaw) of a camera's rotation, as `Camera.from_euler` takes them, radians.

    A camera that looks straight down has no heading of its own: its roll is 0.
    """
    R = vehicle_from_camera[:3, :3] @ OPTICAL_FROM_FLU
    level = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], level)
    if level < 1e-9:
        return 0.0, pitch, math.atan2(-R[0, 1], R[1, 1])
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def axes_of_angles(pitch: float, yaw: float) -> Matrix:
    """(3, 3) matrix whose columns are the axes in the vehicle frame about which roll, pitch and yaw turn a camera."""
    cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
    return np.array([[cy * cp, -sy, 0.0], [sy * cp, cy, 0.0], [-sp, 0.0, 1.0]])


def pose_of(rotation: Matrix, position: Matrix) -> Matrix:
    """(4, 4) camera_from_vehicle of vehicle_from_camera's rotation and the camera's position."""
    return rigid(rotation.T, -rotation.T @ position)


def upright(camera: Camera) -> float:
    """How upright a camera stands, -1 to 1: the z of what is up in its image."""
    return -float(camera.vehicle_from_camera[2, 1])
