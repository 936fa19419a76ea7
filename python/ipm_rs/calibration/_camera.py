"""The last step of every reader: a camera out of what it found, with the file's name before what cannot be right."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ipm_rs._core import Camera, FTheta, Ocam, RadialPolynomial
from ipm_rs.calibration._checks import Matrix, blame
from ipm_rs.errors import CalibrationError

__all__ = ["build"]

_SMALL = 64  # pixels; a test's picture of few pixels may have a focal length of one


def build(
    where: str, K: Matrix, *, image_size: Any, lens: Any = None, make: Callable[..., Camera] = Camera, **pose: Any
) -> Camera:
    """Make a camera by ``Camera`` or another of its constructors; `where` is the place that K comes from.

    Raises
    ------
    CalibrationError
        K is a placeholder: a focal length of one pixel or less, which a real image cannot have.
    CalibrationError, ArgumentError, ArgumentTypeError
        As ``Camera`` says, with the place.
    """
    with blame(where):
        camera = make(K, image_size=image_size, lens=lens, **pose)
    focal = min(K[0, 0], K[1, 1])
    # A polynomial in pixels holds the focal length itself, and K then has ones.
    if focal <= 1 and max(camera.image_size) > _SMALL and not isinstance(lens, (RadialPolynomial, FTheta, Ocam)):
        width, height = camera.image_size
        raise CalibrationError(
            f"{where}: expected focal lengths in pixels, got fx = {K[0, 0]:g} and fy = {K[1, 1]:g} for an image of "
            f"{width}x{height}; K is a placeholder or counts in the image's width, calibrate the camera or multiply it"
        )
    return camera
