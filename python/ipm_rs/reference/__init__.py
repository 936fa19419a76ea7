"""The whole path in plain NumPy: the oracle that the Rust core is tested against.

Four steps, each a few lines, written for obviousness and not for speed:

1. calibration numbers -> matrices: :func:`intrinsic_matrix`, :func:`rotation_from_euler`, :func:`camera_from_euler`;
2. metric grid -> ground points: :func:`grid_shape`, :func:`grid_xy`;
3. points -> pixels and back: :func:`project`, :func:`ground_from_pixels`, and :func:`maps` for a whole grid;
4. image + maps -> bird's-eye view: :func:`remap_nearest`, :func:`remap_bilinear` (and :func:`remap_cubic`,
   :func:`remap_lanczos4`), with :func:`valid_mask`; and, of all
   that each cell covers (:func:`grid_corners`, :func:`footprints`): :func:`remap_area`, :func:`remap_mode`.

From depth images to points and from points to what a camera sees of them: :mod:`~ipm_rs.reference.clouds`, whose names
are here too. :func:`rasterize` collects points in the cells of a grid; :mod:`~ipm_rs.reference.lenses` has the lens
models; :func:`flip_handedness` and its kin convert between left- and right-handed frames.

Conventions are those of the package. Vehicle frame: ISO 8855 (x forward, y left, z up), metres. Camera frame: OpenCV
optical (x right, y down, z forward). Pixel (0, 0) is the centre of the top-left pixel. Transforms are named
``dst_from_src`` and act on column vectors. Angles are radians. Sizes are (width, height), shapes are (rows, columns).

Everything is computed in float64. The package needs NumPy alone and takes nothing from the compiled core, so an
agreement between the two is evidence. Arguments are trusted: the checks and the typed errors are the core's job.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# relative: the package also works when it is loaded from its folder alone
from . import clouds, lenses
from .clouds import (
    decode_carla_depth,
    depth_to_lidar,
    depth_to_local_point_cloud,
    encode_carla_depth,
    nearest_points,
    points_from_depth,
)
from .footprints import covered_area, footprints, remap_area, remap_mode
from .grids import grid_corners, grid_shape, grid_xy
from .raster import rasterize
from .warps import remap_bilinear, remap_cubic, remap_lanczos4, remap_nearest, touches_image, valid_mask

__all__ = [
    "OPTICAL_FROM_FLU",
    "camera_from_euler",
    "clouds",
    "covered_area",
    "decode_carla_depth",
    "depth_to_lidar",
    "depth_to_local_point_cloud",
    "encode_carla_depth",
    "flip_handedness",
    "flip_handedness_euler",
    "flip_handedness_pose",
    "flip_handedness_rotation",
    "footprints",
    "grid_corners",
    "grid_shape",
    "grid_xy",
    "ground_from_pixels",
    "intrinsic_matrix",
    "lenses",
    "maps",
    "nearest_points",
    "points_from_depth",
    "project",
    "rasterize",
    "remap_area",
    "remap_bilinear",
    "remap_cubic",
    "remap_lanczos4",
    "remap_mode",
    "remap_nearest",
    "rotation_from_euler",
    "valid_mask",
]

OPTICAL_FROM_FLU: NDArray[np.float64] = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Change of axes from forward-left-up to right-down-forward: camX = -Y, camY = -Z, camZ = X."""

# ---------------------------------------------------------------------------------------------------------------------
# 1. Calibration numbers -> matrices


def intrinsic_matrix(fx: float, fy: float, u0: float, v0: float) -> NDArray[np.float64]:
    """Pinhole matrix K from focal lengths and principal point.

    Parameters
    ----------
    fx, fy : float
        Focal lengths, pixels.
    u0, v0 : float
        Principal point, pixels, counted from the centre of the top-left pixel.

    Returns
    -------
    ndarray, shape (3, 3), float64
        ``[[fx, 0, u0], [0, fy, v0], [0, 0, 1]]``.
    """
    return np.array([[fx, 0.0, u0], [0.0, fy, v0], [0.0, 0.0, 1.0]], dtype=np.float64)


def rotation_from_euler(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """Rotation matrix ``Rz(yaw) Ry(pitch) Rx(roll)`` (ISO 8855, right-hand rule about each axis).

    For a camera on a vehicle this is the attitude ``vehicle_from_camera`` before the change to optical axes: positive
    pitch looks down, positive yaw turns left, positive roll lifts the left side. It is equation (3) of the Cityscapes
    calibration document (csCalibration.pdf).

    Parameters
    ----------
    roll, pitch, yaw : float
        Angles about x, y and z, radians.

    Returns
    -------
    ndarray, shape (3, 3), float64
    """
    cr, sr = np.cos(roll), np.sin(roll)
    cp, sp = np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    rotation: NDArray[np.float64] = about_z @ about_y @ about_x
    return rotation


def camera_from_euler(
    position: ArrayLike, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0
) -> NDArray[np.float64]:
    """Pose ``camera_from_vehicle`` of a camera that stands at `position` with the given attitude.

    ``R = (Rz(yaw) Ry(pitch) Rx(roll))^T`` and ``t = -R C`` (csCalibration.pdf), then the axes change from
    forward-left-up to optical.

    Parameters
    ----------
    position : array_like, shape (3,)
        Camera centre C in the vehicle frame, metres.
    roll, pitch, yaw : float
        Attitude in the vehicle frame, radians; see :func:`rotation_from_euler`.

    Returns
    -------
    ndarray, shape (4, 4), float64
        Homogeneous matrix that takes vehicle-frame points to the optical camera frame.
    """
    rotation = OPTICAL_FROM_FLU @ rotation_from_euler(roll, pitch, yaw).T
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = -rotation @ np.asarray(position, dtype=np.float64)
    return pose


# ---------------------------------------------------------------------------------------------------------------------
# 3. Points -> pixels and back


def project(
    points: ArrayLike, K: ArrayLike, camera_from_vehicle: ArrayLike, image_size: tuple[int, int], lens: Any = None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Pixels of vehicle-frame points: ``[u, v, 1]^T = K [lens(R p + t), 1]^T``; a pinhole's lens is ``(X/Z, Y/Z)``.

    Parameters
    ----------
    points : array_like, shape (..., 3)
        Points in the vehicle frame, metres.
    K : array_like, shape (3, 3)
        Pinhole matrix, pixels.
    camera_from_vehicle : array_like, shape (4, 4)
        Pose.
    image_size : (int, int)
        Width and height, pixels.
    lens : lens, optional
        Such as ``ipm_rs.BrownConrady``, see :func:`lenses.image_of`; None is a pinhole.

    Returns
    -------
    uv : ndarray, shape (..., 2), float64
        Pixel coordinates, exact also outside the image; NaN only where a point has no image because it is not in
        front of the camera, outside the lens's domain or not finite.
    depth : ndarray, shape (...), float64
        z in the camera frame, metres; negative behind the camera.
    valid : ndarray, shape (...), bool
        True where the pixel lies in the rectangle of pixel centres, ``[0, w - 1] x [0, h - 1]``.
    """
    points = np.asarray(points, dtype=np.float64)
    pose = np.asarray(camera_from_vehicle, dtype=np.float64)
    in_camera = points @ pose[:3, :3].T + pose[:3, 3]
    depth = in_camera[..., 2]
    K = np.asarray(K, dtype=np.float64)
    with np.errstate(all="ignore"):
        if lens is None:
            uv = (in_camera @ K.T)[..., :2] / np.where(depth > 0, depth, np.nan)[..., np.newaxis]
        else:
            uv = lenses.image_of(in_camera, lens) @ K[:2, :2].T + K[:2, 2]
    has_image = np.isfinite(uv).all(axis=-1)
    uv = np.where(has_image[..., np.newaxis], uv, np.nan)
    return uv, depth, valid_mask(uv[..., 0], uv[..., 1], image_size)


def ground_from_pixels(
    uv: ArrayLike, K: ArrayLike, camera_from_vehicle: ArrayLike, ground: float = 0.0
) -> NDArray[np.float64]:
    """Points where the rays of pixels meet the horizontal road ``z = ground``.

    The ray leaves the camera centre C along ``d = R^-1 K^-1 [u, v, 1]^T`` and meets the road at ``C + s d`` with
    ``s = (ground - C_z) / d_z``.

    Parameters
    ----------
    uv : array_like, shape (..., 2)
        Pixels.
    K : array_like, shape (3, 3)
        Pinhole matrix, pixels.
    camera_from_vehicle : array_like, shape (4, 4)
        Pose.
    ground : float
        Height of the road in the vehicle frame, metres.

    Returns
    -------
    ndarray, shape (..., 3), float64
        Points in the vehicle frame, metres; NaN where the ray does not meet the road in front of the camera.
    """
    uv = np.asarray(uv, dtype=np.float64)
    vehicle_from_camera = np.linalg.inv(np.asarray(camera_from_vehicle, dtype=np.float64))
    centre = vehicle_from_camera[:3, 3]
    homogeneous = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)
    ray = homogeneous @ np.linalg.inv(np.asarray(K, dtype=np.float64)).T @ vehicle_from_camera[:3, :3].T
    with np.errstate(all="ignore"):
        along = (ground - centre[2]) / ray[..., 2:]
        points = centre + along * ray
    hits = (along > 0) & np.isfinite(points).all(axis=-1, keepdims=True)
    points = np.where(hits, points, np.nan)
    points[..., 2] = np.where(hits[..., 0], ground, np.nan)
    return points


def maps(
    K: ArrayLike,
    camera_from_vehicle: ArrayLike,
    image_size: tuple[int, int],
    xy: ArrayLike,
    ground: float = 0.0,
    lens: Any = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Source pixel of every ground cell, as maps for the two ``remap`` functions.

    Parameters
    ----------
    K : array_like, shape (3, 3)
        Pinhole matrix, pixels.
    camera_from_vehicle : array_like, shape (4, 4)
        Pose.
    image_size : (int, int)
        Width and height, pixels.
    xy : array_like, shape (rows, columns, 2)
        Ground positions of the cells, metres, as :func:`grid_xy` gives them.
    ground : float
        Height of the road in the vehicle frame, metres.
    lens : lens, optional
        Such as ``ipm_rs.BrownConrady``; None is a pinhole.

    Returns
    -------
    map_x, map_y : ndarray, shape (rows, columns), float64
        Pixel coordinates of the cells that touch the image, which are the valid ones and the halo (less than one
        pixel outside the rectangle of pixel centres); NaN elsewhere.
    """
    xy = np.asarray(xy, dtype=np.float64)
    points = np.concatenate([xy, np.full_like(xy[..., :1], ground)], axis=-1)
    uv, _, _ = project(points, K, camera_from_vehicle, image_size, lens)
    touches = touches_image(uv[..., 0], uv[..., 1], image_size)
    return np.where(touches, uv[..., 0], np.nan), np.where(touches, uv[..., 1], np.nan)


# ---------------------------------------------------------------------------------------------------------------------
# Left- and right-handed frames. Mirroring the y axis, S = diag(1, -1, 1), turns one into the other and back.


def flip_handedness(points: ArrayLike) -> NDArray[np.float64]:
    """Points in the frame of the other handedness: ``(x, y, z) -> (x, -y, z)``.

    Parameters
    ----------
    points : array_like, shape (..., 3)
        Points, any unit.

    Returns
    -------
    ndarray, shape (..., 3), float64
    """
    flipped: NDArray[np.float64] = np.asarray(points, dtype=np.float64) * np.array([1.0, -1.0, 1.0])
    return flipped


def flip_handedness_euler(roll: float, pitch: float, yaw: float) -> tuple[float, float, float]:
    """Angles in the frame of the other handedness: ``(roll, pitch, yaw) -> (roll, -pitch, -yaw)``.

    Parameters
    ----------
    roll, pitch, yaw : float
        Angles, any unit. Left-handed ones follow the convention of CARLA and Unreal Engine (positive pitch lifts the
        nose, positive yaw turns right), right-handed ones that of :func:`rotation_from_euler`.

    Returns
    -------
    (float, float, float)
    """
    return roll, -pitch, -yaw


def flip_handedness_rotation(rotation: ArrayLike) -> NDArray[np.float64]:
    """Rotation in the frame of the other handedness: ``S R S`` with ``S = diag(1, -1, 1)``.

    Parameters
    ----------
    rotation : array_like, shape (3, 3)
        Rotation between two frames of one handedness.

    Returns
    -------
    ndarray, shape (3, 3), float64
    """
    sign = np.array([1.0, -1.0, 1.0])
    return np.asarray(rotation, dtype=np.float64) * np.outer(sign, sign)


def flip_handedness_pose(pose: ArrayLike) -> NDArray[np.float64]:
    """Pose in the frame of the other handedness: ``S T S`` with ``S = diag(1, -1, 1, 1)``.

    Parameters
    ----------
    pose : array_like, shape (4, 4)
        Pose between two frames of one handedness.

    Returns
    -------
    ndarray, shape (4, 4), float64
    """
    sign = np.array([1.0, -1.0, 1.0, 1.0])
    return np.asarray(pose, dtype=np.float64) * np.outer(sign, sign)
