"""Zenseact Open Dataset (ZOD): ``calibration.json`` of a frame, a sequence or a drive.

The format, after the data set's development kit:

* ``FC`` (the front camera): ``intrinsics`` (3x3 or 3x4, pixels), ``image_dimensions`` [width, height],
  ``distortion`` (k1, k2, k3, k4 of Kannala and Brandt; ``undistortion`` is a fit of the inverse, and is not used).
* ``extrinsics`` (4x4): the camera's pose in the ego vehicle's frame: points of the camera (optical axes: x right, y
  down, z forward) to x forward, y left, z up, in metres.
* The height of the ego frame's origin is not stated. The camera stands 1.15 m above it in the one file that was seen,
  on cars whose camera is higher than that above the road: measure where the road lies, and pass it as ``ground=``.
* The data set does not say where a pixel's centre is; (0, 0) is read as the centre of the first.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ipm_rs._core import Camera, KannalaBrandt
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, matrix
from ipm_rs.calibration._files import Document, Source, keys_missing, read_json, same_size
from ipm_rs.calibration._values import items_of
from ipm_rs.errors import CalibrationError

__all__ = ["KEYS", "TITLE", "missing", "read"]

TITLE = "ZOD"
KEYS = ("FC", "image_dimensions", "distortion", "undistortion", "field_of_view", "lidar_extrinsics", "intrinsics")

_PARTS = ("extrinsics", "intrinsics", "distortion", "image_dimensions")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    return keys_missing(document, *(f"FC.{part}" for part in _PARTS))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    image_size: tuple[int, int] | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read the front camera of ZOD.

    Parameters
    ----------
    source : str, path or mapping
        ``calibration.json``, its content, or what it holds under ``FC``.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        In the ego vehicle's frame.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, or a value cannot be right.
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    """
    content = read_json(source, TITLE)
    content.nearest = nearest_rotation
    place = content if "FC" not in content and isinstance(source, Mapping) else content.section("FC")
    place.require(*_PARTS)
    if place.content.get("xi") is not None and place.number("xi"):
        raise CalibrationError(
            f"{place.where('xi')}: expected none or 0, got {place.number('xi'):g}; its model is not documented, build "
            "Camera(K, ..., lens=) with the right one"
        )
    size = place.pair("image_dimensions")
    same_size(image_size, size, content.origin)
    with blame(place.where("distortion")):
        lens = KannalaBrandt(place.numbers("distortion", 4))
    pose = place.pose("extrinsics")
    return build(place.where(), _intrinsics(place), image_size=size, vehicle_from_camera=pose, lens=lens)


def _intrinsics(place: Section) -> Matrix:
    value, where = place.value("intrinsics"), place.where("intrinsics")
    rows = items_of(value) or ()
    wide = len(rows) == 12 or any(len(items_of(row) or ()) == 4 for row in rows)
    K = matrix(value, where, (3, 4 if wide else 3), unit="pixels")
    if wide and K[:, 3].any():
        raise CalibrationError(f"{where}: expected 0 in the fourth column, got others; correct it")
    return K[:, :3].copy()
