"""okvis's ``config_*.yaml``: a list ``cameras`` beside the estimator's settings.

The format, after okvis's and okvis2's parser. Each camera has

* ``T_SC``: points of the camera to the sensor, which is the IMU; sixteen numbers, row by row.
* ``image_dimension`` [width, height], ``focal_length`` [fu, fv], ``principal_point`` [cu, cv]; pixel (0, 0) is a
  pixel's centre, axes optical (x right, y down, z forward).
* ``distortion_type`` with ``distortion_coefficients``: ``radialtangential`` (also ``plumb_bob``) [k1, k2, p1, p2],
  ``radialtangential8`` (``plumb_bob8``) [k1, k2, p1, p2, k3, k4, k5, k6], ``equidistant`` [k1, k2, k3, k4].

The file knows no road and no vehicle: ``vehicle_from_imu=`` says how the IMU stands on the vehicle (x forward, y left,
z up); without it the first camera is at the origin and looks along +x, and ``ground=`` is minus its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import lens_named, on_body, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, pinhole
from ipm_rs.calibration._files import Document, Source, same_size
from ipm_rs.calibration._plain import has, plain_section, tree_missing

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "okvis"
KEYS = (
    "cameras", "T_SC", "image_dimension", "distortion_coefficients", "distortion_type", "focal_length",
    "principal_point", "camera_params", "imu_params",
)  # fmt: skip

_PARTS = ("image_dimension", "distortion_coefficients", "distortion_type", "focal_length", "principal_point")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = tree_missing(document, "cameras")
    if lacks is None:
        cameras = document.tree["cameras"]
        found = isinstance(cameras, list) and bool(cameras) and has(cameras[0], *_PARTS)
        lacks = None if found else f"no list of cameras with {_PARTS[0]}"
    return lacks


def cameras(document: Document) -> list[str]:
    """Numbers of the cameras, as ``camera=`` takes them."""
    return [str(index) for index in range(len(document.tree["cameras"]))]


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | int | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_imu: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of an okvis configuration.

    Parameters
    ----------
    source : str, path or mapping
        The file (needs the extra ``yaml``), or its content as a mapping.
    camera : int, optional
        Its number from 0; needed if the file holds more than one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_imu : (4, 4) array, optional
        Pose of the IMU in the vehicle frame.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Where ``vehicle_from_imu`` and the file put it, else as seen from the first, which looks along +x.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the lens has no model here.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    MissingExtraError
        PyYAML is not installed.
    """
    check_word("camera", camera)
    content = plain_section(source, TITLE)
    content.nearest = nearest_rotation
    entries = content.sections("cameras")
    entry = entries[pick([str(index) for index in range(len(entries))], camera, content.origin)]
    entry.require(*_PARTS)
    size = entry.pair("image_dimension")
    same_size(image_size, size, content.origin)
    lens = lens_named(
        entry.value("distortion_type"), entry.value("distortion_coefficients"), entry.where("distortion_type"),
        others={"radialtangential8": "brown_conrady", "plumb_bob8": "brown_conrady"},
    )  # fmt: skip
    pose = on_body(_pose(entry), _pose(entries[0]), vehicle_from_imu, "vehicle_from_imu", nearest=nearest_rotation)
    K = pinhole(*entry.numbers("focal_length", 2, unit="pixels"), *entry.numbers("principal_point", 2, unit="pixels"))
    return build(entry.where(), K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _pose(entry: Section) -> Matrix:
    return entry.pose("T_SC")
