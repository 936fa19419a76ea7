"""Autoware.AI's camera-lidar calibration: ``*_autoware_lidar_camera_calibration.yaml``.

The format, after Autoware.AI's ``calibration_publisher`` and its toolkits:

* ``CameraMat`` (3x3, pixels), ``DistCoeff`` (k1, k2, p1, p2, k3), ``ImageSize`` [width, height]; ``DistModel``, where
  it is there, names the lens, else it is OpenCV's. Pixel (0, 0) is a pixel's centre, as OpenCV has it.
* ``CameraExtrinsicMat`` (4x4): the camera's pose in the lidar's frame: points of the camera (optical axes: x right,
  y down, z forward) to the lidar, in metres.
* The lidar's frame is the driver's (Velodyne under ROS: x forward, y left, z up) and is taken for the vehicle frame
  unless ``vehicle_from_lidar=`` says how the lidar stands on the vehicle. Without it ``ground=`` is minus the lidar's
  height.
* Other tools write the same keys with the lidar to the camera: where the camera looks the wrong way, invert it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import brown, lens_named
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._files import Document, Source, same_size
from ipm_rs.calibration._mount import rigid_argument
from ipm_rs.calibration._opencvlens import flat
from ipm_rs.calibration._plain import plain_section, tree_missing

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "missing", "read"]

TITLE = "Autoware.AI"
KEYS = ("CameraExtrinsicMat", "CameraMat", "DistCoeff", "DistModel", "ImageSize", "ReprojectionError")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    return tree_missing(document, "CameraExtrinsicMat", "CameraMat")


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    image_size: tuple[int, int] | None = None,
    vehicle_from_lidar: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera of Autoware.AI.

    Parameters
    ----------
    source : str, path or mapping
        The YAML file (needs the extra ``yaml``), or its content as a mapping.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_lidar : (4, 4) array, optional
        Pose of the lidar in the vehicle frame; without it the lidar's frame is the vehicle's.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the lens has no model here.
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    MissingExtraError
        PyYAML is not installed.
    """
    content = plain_section(source, TITLE)
    content.nearest = nearest_rotation
    content.require("CameraExtrinsicMat", "CameraMat", "DistCoeff", "ImageSize")
    size = content.pair("ImageSize")
    same_size(image_size, size, content.origin)
    K = content.matrix("CameraMat", (3, 3), unit="pixels")
    word, values = content.content.get("DistModel"), flat(content.value("DistCoeff"))
    if word is None or (isinstance(word, str) and not word):
        lens = brown(values, content.where("DistCoeff"))
    else:
        lens = lens_named(word, values, content.where("DistModel"))
    vehicle_from_camera = rigid_argument(
        vehicle_from_lidar, "vehicle_from_lidar", nearest=nearest_rotation
    ) @ content.pose("CameraExtrinsicMat")
    return build(content.origin, K, image_size=size, vehicle_from_camera=vehicle_from_camera, lens=lens)
