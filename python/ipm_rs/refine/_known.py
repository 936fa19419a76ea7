"""Cameras from what is known of them in other forms: a projection matrix, an angle of view."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ipm_rs._arguments import array_of, flag_of
from ipm_rs._core import Camera
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = ["from_fov", "from_projection"]


def from_projection(P: ArrayLike, *, image_size: Sequence[int]) -> Camera:
    """Make a pinhole camera of a projection matrix.

    ``P = s K [R | t]`` is taken apart by an RQ decomposition (Hartley and Zisserman, section 6.2.4); the scale and the
    sign of s do not matter.

    Parameters
    ----------
    P : (3, 4) array_like
        Vehicle frame (x, y, z, 1), metres, to homogeneous pixels.
    image_size : (int, int)
        Width and height, pixels.

    Returns
    -------
    Camera
        That sees every point at the pixel that `P` gives.

    Raises
    ------
    CalibrationError
        No camera has such a matrix: it is singular, or its rotation is a mirror image.
    ArgumentError, ArgumentTypeError
        It is no (3, 4) array of numbers.
    """
    matrix = array_of("P", P)
    if matrix.dtype.kind not in "iuf":
        raise ArgumentTypeError(f"P: expected numbers, got {matrix.dtype}")
    if matrix.shape != (3, 4):
        raise ArgumentError(f"P: expected shape (3, 4), got {matrix.shape}")
    matrix = matrix.astype(np.float64)
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:, :3])) <= 1e-15 * np.abs(matrix[:, :3]).max() ** 3:
        raise CalibrationError("P: expected K [R | t], got a matrix whose left 3x3 part is singular or not finite")
    if np.linalg.det(matrix[:, :3]) < 0:  # s is negative
        matrix = -matrix
    # RQ by the QR of the matrix turned over
    turned = np.flipud(np.eye(3))
    Q, R = np.linalg.qr((turned @ matrix[:, :3]).T)
    K, rotation = turned @ R.T @ turned, turned @ Q.T
    signs = np.diag(np.sign(np.diag(K)))
    K, rotation = K @ signs, signs @ rotation
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, np.linalg.solve(K, matrix[:, 3])
    K = K / K[2, 2]
    K[1, 0] = K[2, 0] = K[2, 1] = 0.0  # rounding leaves 1e-17 there
    return Camera(K, image_size=image_size, camera_from_vehicle=pose)


def from_fov(
    fov: float,
    *,
    image_size: Sequence[int],
    vertical: bool = False,
    position: Sequence[float] = (0.0, 0.0, 0.0),
    roll: float = 0.0,
    pitch: float = 0.0,
    yaw: float = 0.0,
    lens: Any = None,
) -> Camera:
    """Make a camera of its angle of view: square pixels, the axis through the image's middle.

    ``f = size / (2 tan(fov / 2))``, from edge to edge of the image.

    Parameters
    ----------
    fov : float
        Angle from the left edge to the right, radians, above 0 and below pi.
    image_size : (int, int)
        Width and height, pixels.
    vertical : bool
        The angle is from the top edge to the bottom instead.
    position : (float, float, float)
        x, y, z in the vehicle frame, metres.
    roll : float
        Left side up, radians.
    pitch : float
        Down, radians.
    yaw : float
        To the left, radians.
    lens : lens, optional
        A lens; the angle is then that of its pinhole.

    Returns
    -------
    Camera
        Whose principal point is ``((width - 1) / 2, (height - 1) / 2)``.

    Raises
    ------
    CalibrationError
        The angle cannot be right.
    ArgumentError, ArgumentTypeError
        Another argument is wrong.
    """
    angle = array_of("fov", fov)
    if angle.shape != () or angle.dtype.kind not in "iuf":
        raise ArgumentTypeError(f"fov: expected an angle in radians, got {angle.dtype} of shape {angle.shape}")
    if not 1e-3 < float(angle) < math.pi:
        raise CalibrationError(f"fov: expected radians above 0.001 and below pi, got {float(angle):g}")
    size = array_of("image_size", image_size)
    if size.shape != (2,) or size.dtype.kind not in "iu" or size.min() < 1:
        raise ArgumentError("image_size: expected (width, height), two whole numbers of at least 1")
    width, height = int(size[0]), int(size[1])
    focal: float = (height if flag_of("vertical", vertical) else width) / (2 * math.tan(float(angle) / 2))
    K = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    return Camera.from_euler(
        K, image_size=(width, height), position=position, roll=roll, pitch=pitch, yaw=yaw, lens=lens
    )
