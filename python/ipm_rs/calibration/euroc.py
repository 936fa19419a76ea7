"""EuRoC / ASL ``sensor.yaml``, and the camera files of Kimera-VIO that follow it.

The format, after the data set's description and Kimera's parser:

* ``intrinsics`` [fu, fv, cu, cv], ``camera_model`` pinhole; ``resolution`` [width, height]; pixel (0, 0) is a pixel's
  centre; axes optical (x right, y down, z forward).
* ``distortion_model`` ``radial-tangential`` (``radtan``) [k1, k2, p1, p2] or ``equidistant`` [k1, k2, k3, k4], in
  ``distortion_coefficients``.
* ``T_BS`` takes points of the camera (the sensor, S) to the body (B), which is the IMU: ``data`` row by row.

The file knows no road and no vehicle. ``vehicle_from_body=`` says how the body stands on the vehicle (x forward, y
left, z up); without it the camera is at the origin and looks along +x, and ``ground=`` is minus its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import lens_named, on_body
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import pinhole
from ipm_rs.calibration._files import Document, Source, same_size
from ipm_rs.calibration._plain import plain_section, tree_missing

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "missing", "read"]

TITLE = "EuRoC sensor.yaml"
KEYS = ("T_BS", "intrinsics", "resolution", "camera_model", "distortion_model", "distortion_coefficients", "rate_hz")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    return tree_missing(document, "T_BS", "intrinsics", "resolution", "distortion_model")


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    image_size: tuple[int, int] | None = None,
    vehicle_from_body: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera of EuRoC's layout.

    Parameters
    ----------
    source : str, path or mapping
        ``mav0/cam0/sensor.yaml`` (needs the extra ``yaml``), or its content as a mapping.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_body : (4, 4) array, optional
        Pose of the body (the IMU) in the vehicle frame.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        With ``vehicle_from_body`` where the file has it, else at the origin, looking along +x.

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
    section = plain_section(source, TITLE)
    section.nearest = nearest_rotation
    section.require("T_BS", "intrinsics", "resolution", "distortion_model", "distortion_coefficients")
    if "camera_model" in section:
        section.text("camera_model", among=("pinhole",))
    fu, fv, cu, cv = section.numbers("intrinsics", 4, unit="pixels")
    size = section.pair("resolution")
    same_size(image_size, size, section.origin)
    lens = lens_named(
        section.value("distortion_model"), section.value("distortion_coefficients"), section.where("distortion_model")
    )
    body_from_camera = section.pose("T_BS")
    pose = on_body(body_from_camera, body_from_camera, vehicle_from_body, "vehicle_from_body", nearest=nearest_rotation)
    return build(section.origin, pinhole(fu, fv, cu, cv), image_size=size, camera_from_vehicle=pose, lens=lens)
