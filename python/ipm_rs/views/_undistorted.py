"""`Camera.undistorted`: the camera of a picture without the lens."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import array_of, flag_of, number_of
from ipm_rs._core import BrownConrady, Camera, Cylindrical, Equirectangular, KannalaBrandt, rotation_from_euler
from ipm_rs.errors import ArgumentError, CalibrationError, CalibrationWarning

__all__ = ["undistorted"]

_SIDE = 200  # steps along each side of the image: its rays are found to a fraction of a pixel
_STEEPEST = math.radians(85)  # a flat picture of more has corners a hundred times as coarse as its middle
_STEP = 1e-5  # radians, of the scale on the axis: its error is of the order of the square

Array = NDArray[np.float64]


def undistorted(
    self: Camera,
    *,
    size: Sequence[int] | None = None,
    focal: float | Sequence[float] | None = None,
    alpha: float | None = None,
    level: bool = False,
    lens: Any = None,
) -> Camera:
    """Make the camera of this one's picture without its lens, for `Lut.between`.

    ``Lut.between(camera, camera.undistorted())`` is ``cv2.undistort``: the same K and size, straight lines straight.

    Parameters
    ----------
    size : (int, int), optional
        Width and height of the new picture; the old ones if not given.
    focal : float or (float, float), optional
        Focal length in pixels, or fx and fy, with the axis in the picture's middle. Without it and `alpha` the scale on
        the axis and the principal point stay, scaled with the size as `Camera.resized` does.
    alpha : float, optional
        From 0, the largest upright rectangle that is all of the old picture, to 1, the smallest that holds all of it,
        as ``cv2.getOptimalNewCameraMatrix`` has it.
    level : bool
        Turn the view level, roll and pitch 0, where this camera looks.
    lens : lens, optional
        Of the new camera: ``Cylindrical()``, ``Equirectangular()``, or any other. None is a pinhole, which shows less
        than 180 degrees.

    Returns
    -------
    Camera
        At the same place. ``cropped`` and ``resized`` take it further.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Both `focal` and `alpha`, or numbers that cannot be right.
    CalibrationError
        With `alpha` a flat picture would have to show more than 85 degrees from its axis: give `focal`, or a `lens`.
    """
    if focal is not None and alpha is not None:
        raise ArgumentError("alpha: expected either focal= or alpha=, got both; alpha works out the focal length")
    width, height = self.image_size if size is None else _size(size)
    pose = self.camera_from_vehicle
    if flag_of("level", level):
        pose = _level(self)
    if focal is not None:
        fx, fy = _focal(focal)
        K = np.array([[fx, 0, (width - 1) / 2], [0, fy, (height - 1) / 2], [0, 0, 1]])
    else:
        K = _kept(self, width, height)
    made = Camera(K, image_size=(width, height), camera_from_vehicle=pose, lens=lens)
    return made if alpha is None else _fitted(self, made, _part(alpha))


def _size(size: Sequence[int]) -> tuple[int, int]:
    given = array_of("size", size)
    if given.shape != (2,) or given.dtype.kind not in "iu" or given.min() < 1:
        raise ArgumentError("size: expected (width, height), two whole numbers of at least 1")
    return int(given[0]), int(given[1])


def _focal(focal: float | Sequence[float]) -> tuple[float, float]:
    given = array_of("focal", focal)
    if given.dtype.kind not in "iuf" or given.shape not in ((), (2,)) or not (np.isfinite(given) & (given > 0)).all():
        raise ArgumentError("focal: expected pixels above 0, one number or (fx, fy)")
    fx, fy = np.broadcast_to(given, 2).tolist()
    return float(fx), float(fy)


def _part(alpha: float) -> float:
    part = number_of("alpha", alpha)
    if not 0 <= part <= 1:
        raise ArgumentError(f"alpha: expected a number from 0 to 1, got {part:g}")
    return part


def _level(camera: Camera) -> Array:
    """camera_from_vehicle of a view that looks the same way, but level."""
    rotation = camera.camera_from_vehicle[:3, :3]
    ahead = rotation[2]
    if math.hypot(ahead[0], ahead[1]) < 1e-6:
        raise ArgumentError("level: expected a camera that does not look straight up or down, which has no way ahead")
    yaw = math.atan2(ahead[1], ahead[0])
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]) @ rotation_from_euler(0, 0, yaw).T
    pose[:3, 3] = -pose[:3, :3] @ camera.position
    return pose


def _kept(camera: Camera, width: int, height: int) -> Array:
    """K of a pinhole with the camera's scale on the axis, for a picture of this size."""
    K = np.array(camera.intrinsics)
    if camera.lens is not None and not isinstance(
        camera.lens, (BrownConrady, KannalaBrandt, Cylindrical, Equirectangular)
    ):
        eye = camera.with_pose(np.eye(4))
        beside = np.array([[_STEP, 0, 1], [-_STEP, 0, 1], [0, _STEP, 1], [0, -_STEP, 1], [0, 0, 1]])
        around = eye.project(beside)[0]
        K = np.array([[(around[0] - around[1])[0], 0, around[4, 0]], [0, (around[2] - around[3])[1], around[4, 1]]])
        K[:, :2] /= 2 * _STEP
        K = np.vstack([K, [0, 0, 1]])
    K[0, 1] = 0
    across, down = width / camera.image_size[0], height / camera.image_size[1]
    fx, fy = K[0, 0] * across, K[1, 1] * down
    return np.array([[fx, 0, (K[0, 2] + 0.5) * across - 0.5], [0, fy, (K[1, 2] + 0.5) * down - 0.5], [0, 0, 1]])


def _fitted(source: Camera, made: Camera, part: float) -> Camera:
    """Make the camera between the largest rectangle in the source's picture and the smallest around it."""
    (width, height), pose = source.image_size, made.camera_from_vehicle
    across, down = np.linspace(0, width - 1, _SIDE), np.linspace(0, height - 1, _SIDE)
    sides = {
        "left": np.column_stack([np.zeros(_SIDE), down]),
        "right": np.column_stack([np.full(_SIDE, width - 1), down]),
        "top": np.column_stack([across, np.zeros(_SIDE)]),
        "bottom": np.column_stack([across, np.full(_SIDE, height - 1)]),
    }
    # where the lens ends inside the picture, its sides have no rays, and what lies within tells how far it goes
    within = np.stack(np.meshgrid(across[::4], down[::4]), -1).reshape(-1, 2)
    # on the plane that the new lens takes to pixels
    K = np.diag([1e3, 1e3, 1])
    eye = Camera(K, image_size=(1, 1), camera_from_vehicle=pose, lens=made.lens)
    plane, beyond = {}, False
    for side, pixels in (*sides.items(), ("within", within)):
        rays = source.unproject(pixels)
        m = eye.project(source.position + rays)[0] / 1e3
        if made.lens is None:
            steep = (rays @ pose[2, :3]) < math.cos(_STEEPEST)
            m[steep] = np.nan
            beyond |= bool(steep.any())
        plane[side] = m
    whole = np.concatenate(list(plane.values()))
    if (part > 0 and beyond) or np.isnan(whole).all():
        raise CalibrationError(
            "alpha: expected a picture whose edges a flat one can show, within 85 degrees of its axis, got one that "
            "sees more; give focal=, or lens=ipm_rs.Cylindrical()"
        )
    with np.errstate(all="ignore"):
        inner = [
            np.nanmax(_or(plane["left"][:, 0], whole[:, 0], np.nanmin)),
            np.nanmin(_or(plane["right"][:, 0], whole[:, 0], np.nanmax)),
            np.nanmax(_or(plane["top"][:, 1], whole[:, 1], np.nanmin)),
            np.nanmin(_or(plane["bottom"][:, 1], whole[:, 1], np.nanmax)),
        ]
        (left, top), (right, bottom) = np.nanmin(whole, axis=0), np.nanmax(whole, axis=0)
    if inner[0] >= inner[1] or inner[2] >= inner[3]:
        raise CalibrationError("alpha: expected a picture with an upright rectangle in it, got none; give focal=")
    w, h = made.image_size
    K = (1 - part) * _onto(inner, w, h) + part * _onto([left, right, top, bottom], w, h)
    with warnings.catch_warnings():  # a rectangle in a fisheye's picture may be far from square pixels
        warnings.simplefilter("ignore", CalibrationWarning)
        return Camera(K, image_size=(w, h), camera_from_vehicle=pose, lens=made.lens)


def _or(values: Array, others: Array, limit: Any) -> Array:
    """Return the values, or where none is known how far the others go."""
    return np.array([limit(others)]) if np.isnan(values).all() else values


def _onto(sides: Sequence[float], width: int, height: int) -> Array:
    """K that takes a rectangle, left, right, top, bottom, to the centres of the outermost pixels."""
    left, right, top, bottom = sides
    fx, fy = max(width - 1, 1) / (right - left), max(height - 1, 1) / (bottom - top)
    return np.array([[fx, 0, -fx * left], [0, fy, -fy * top], [0, 0, 1]])
