"""What the readers of calibrations without a car in them share: where the caller says that the camera is mounted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Camera
from ipm_rs.calibration._checks import number, pose
from ipm_rs.errors import ArgumentError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["argument", "metric", "mounted", "rigid_argument"]

Matrix = NDArray[np.float64]


FARTHEST = 20.0
"""Units between a camera and a chessboard, or another camera, that may be metres; millimetres are more."""


def mounted(
    camera_from_vehicle: ArrayLike | None, vehicle_from_camera: ArrayLike | None, *, nearest: bool = False
) -> Matrix:
    """Give (4, 4) ``camera_from_vehicle`` from either direction; with neither, at the origin and looking along +x."""
    if nearest and camera_from_vehicle is not None:
        camera_from_vehicle = rigid_argument(camera_from_vehicle, "camera_from_vehicle", nearest=True)
    if nearest and vehicle_from_camera is not None:
        vehicle_from_camera = rigid_argument(vehicle_from_camera, "vehicle_from_camera", nearest=True)
    made = Camera(
        np.eye(3),
        image_size=(1, 1),
        camera_from_vehicle=camera_from_vehicle,
        vehicle_from_camera=vehicle_from_camera,
    )
    return made.camera_from_vehicle


def metric(T: Matrix, metres_per_unit: float | None, where: str = "") -> Matrix:
    """Give the rigid (4, 4) transform with its translation in metres.

    Raises
    ------
    CalibrationError
        There is no `metres_per_unit`, and metres it cannot be.
    ArgumentError
        `metres_per_unit` is no positive number.
    """
    if metres_per_unit is None:
        distance = float(np.linalg.norm(T[:3, 3]))
        if distance > FARTHEST:
            raise CalibrationError(
                f"{where}: expected metres, at most {FARTHEST:g}, got a length of {distance:.6g}, in the unit of the "
                "board's squares; pass metres_per_unit=, 0.001 for millimetres, 1 if it is metres"
            )
        return T
    scaled = T.copy()
    scaled[:3, 3] *= argument(metres_per_unit, "metres_per_unit")
    return scaled


def argument(value: object, name: str) -> float:
    """Check an argument that must be a positive number."""
    try:
        return number(value, name, positive=True)
    except ValueError as error:
        raise ArgumentError(str(error)) from None


def rigid_argument(value: ArrayLike | None, name: str, *, nearest: bool = False) -> Matrix:
    """Check an argument that must be a rigid (4, 4) transform; None is the identity."""
    return np.eye(4) if value is None else pose(np.asarray(value).tolist(), name, nearest=nearest)
