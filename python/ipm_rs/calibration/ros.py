"""ROS ``CameraInfo``: the YAML and INI files of ``camera_calibration_parsers``, and the message itself.

The format, after ``sensor_msgs/CameraInfo`` and REP-104:

* ``camera_matrix`` (K) and ``distortion_coefficients`` (D) describe the **raw** image; ``rectification_matrix`` (R) and
  ``projection_matrix`` (P) the **rectified** one. Mixing them is the usual mistake: ``image=`` says which is meant.
* ``distortion_model``: ``plumb_bob`` (k1, k2, t1, t2, k3), ``rational_polynomial`` (8, 12 or 14 terms in OpenCV's
  order), ``equidistant`` (k1..k4). Without it, five coefficients are ``plumb_bob``, as ROS has it; four are refused,
  for they may be either.
* ``P[:, 3]`` is the place of a right stereo camera: ``P[0, 3] = -fx' B``. P takes points of the left camera's rectified
  frame, and so the pose of the left camera is the one to give.
* A dump of ``ros2 topic echo`` or ``rostopic echo`` (``k d r p``, ``K D R P``) is read as the message that it shows.
* A camera whose K is zero is uncalibrated.
* ``binning_x, binning_y`` and ``roi`` change the image that is published; the matrices stay those of the full one.
* Frames end in ``_optical``: x right, y down, z forward. Pixel (0, 0) is a pixel's centre. The pose is not in the file
  but in tf: look up ``vehicle_from_camera`` for the optical frame, ``base_link`` (x forward, y left, z up) from it. Its
  road is where the robot's is: ``ground=0`` for ``base_footprint``.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, KannalaBrandt
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, blame, coefficients, numbers, rigid
from ipm_rs.calibration._files import Document, same_size
from ipm_rs.calibration._lenswords import refuse_foreign
from ipm_rs.calibration._mount import metric, mounted
from ipm_rs.calibration._rosinfo import KEYS, TITLE, content_of, lacks
from ipm_rs.errors import ArgumentError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "missing", "read"]

# All but the last are OpenCV's one formula, in which terms that are not there are 0.
_COUNTS = {
    "plumb_bob": (5, 4),
    "rational_polynomial": (8, 12, 14),
    "equidistant": (4,),
    "fisheye": (4,),
}

Matrix = NDArray[np.float64]


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    return "a directory" if document.is_directory else lacks(document)


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: str | os.PathLike[str] | Mapping[str, Any] | Any,
    *,
    image: Literal["raw", "rectified"] = "raw",
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    camera_from_vehicle: ArrayLike | None = None,
    vehicle_from_camera: ArrayLike | None = None,
    ros_binning: bool = False,
    metres_per_unit: float | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a ROS camera calibration.

    Parameters
    ----------
    source : str, path, mapping or message
        A YAML file (needs the extra ``yaml``), an INI file, a dump of ``ros2 topic echo`` or ``rostopic echo``, JSON
        with a message's fields, the content of any of them as a mapping, or a ``sensor_msgs/CameraInfo`` message of ROS
        1 or 2. Of a dump of several messages, all must have the same calibration.
    image : "raw" or "rectified"
        Whether the images are as the sensor gave them (K and D), or went through ``image_proc`` (P and R).
    camera : str, optional
        Name of the section, for INI files of several cameras.
    image_size : (int, int), optional
        Width and height of the images, after region of interest and binning. The file says it; if given it must agree.
    camera_from_vehicle, vehicle_from_camera : (4, 4) array, optional
        Pose of the raw camera's optical frame; with neither it is at the origin and looks along +x. For a rectified
        image R is applied on top; for a P with a fourth column the pose is that of the left camera.
    ros_binning : bool
        Whether binning by b moves the principal point to c / b, as ROS's image_geometry does, in place of the exact
        (c + 0.5) / b - 0.5.
    metres_per_unit : float, optional
        Length in metres of the unit of P's fourth column, the stereo offset: 0.001 where the board was measured in
        millimetres. Without it it is metres, if the offset is no longer than 20.
    nearest_rotation : bool
        Take the nearest rotation for an R that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Of the raw image with its lens, or of the rectified one without.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        The camera is uncalibrated; a key is missing or cannot be right; the distortion model is not known.
    ArgumentError, ArgumentTypeError
        An argument has a wrong value or type.
    MissingExtraError
        PyYAML is not installed.
    """
    check_word("image", image)
    check_word("camera", camera)
    if not isinstance(image, str) or image not in ("raw", "rectified"):
        raise ArgumentError(f"image: expected 'raw' or 'rectified', got {image!r:.60}; say which images will be warped")
    section = content_of(source, camera)
    section.nearest = nearest_rotation
    section.require("width", "height", *(("R", "P") if image == "rectified" else ("K", "D")))
    full = section.image_size("width", "height")
    pose = mounted(camera_from_vehicle, vehicle_from_camera, nearest=nearest_rotation)
    lens: BrownConrady | KannalaBrandt | None = None
    if image == "raw":
        K = _calibrated(section, "K", section.matrix("K", (3, 3), unit="pixels"))
        with blame(section.origin):
            lens = _lens(section)
    else:
        P = section.matrix("P", (3, 4), unit="pixels")
        K = _calibrated(section, "P", P[:, :3].copy())
        if K[1, 0] or tuple(K[2]) != (0, 0, 1):
            raise CalibrationError(
                f"{section.where('P')}: expected [fx' 0 cx' Tx, 0 fy' cy' Ty, 0 0 1 0], got other numbers where "
                "these have 0 and 1; check their order"
            )
        offset = rigid(np.eye(3), np.asarray(np.linalg.solve(K, P[:, 3]), dtype=np.float64))
        pose = metric(offset, metres_per_unit, section.where("P")) @ rigid(section.rotation("R"), np.zeros(3)) @ pose
    region, blocks = _published(section, full)
    same_size(image_size, (region[2] // blocks[0], region[3] // blocks[1]), section.origin)
    # as the matrices are written, of the full image: what is derived from it may rightly be off its middle
    whole = build(
        section.where("K" if image == "raw" else "P"), K, image_size=full, camera_from_vehicle=pose, lens=lens
    )
    if region != (0, 0, *full):
        whole = whole.cropped(*region)
    return whole if blocks == (1, 1) else whole.binned(*blocks, rule="first_pixel" if ros_binning else "area")


def _calibrated(section: Section, key: str, K: Matrix) -> Matrix:
    if K[0, 0] == 0 or K[1, 1] == 0:
        raise CalibrationError(
            f"{section.where(key)}: expected focal lengths, got 0, which is how ROS marks an uncalibrated camera; run "
            "camera_calibration, or fill in the matrix"
        )
    return K


def _lens(section: Section) -> BrownConrady | KannalaBrandt | None:
    D = section.value("D")
    terms = numbers(D.ravel() if isinstance(D, np.ndarray) else D, section.where("D"))
    known = "plumb_bob, rational_polynomial or equidistant"
    if refuse_foreign(section.content, section.origin, bends=bool(terms.any()), known=known):
        return None
    model = section.content.get("distortion_model")
    if model in (None, "", "none"):
        if not terms.any():
            return None
        if model == "none" or len(terms) != 5:
            raise CalibrationError(
                f"{section.where('distortion_model')}: expected a model for {len(terms)} coefficients, "
                f"got {model!r}; write plumb_bob, rational_polynomial or equidistant"
            )
        model = "plumb_bob"
    else:
        model = section.text("distortion_model", among=tuple(_COUNTS))
    terms = coefficients(terms, f"{section.where('D')} ({model})", _COUNTS[model])
    if model in ("equidistant", "fisheye"):
        return KannalaBrandt(terms)
    return BrownConrady(terms) if terms.any() else None


def _published(section: Section, full: tuple[int, int]) -> tuple[tuple[int, int, int, int], tuple[int, int]]:
    """Return what of the image is published: the region (x, y, width, height), then the blocks of its binning."""
    region = (0, 0, *full)
    if section.content.get("roi") is not None:
        roi = section.section("roi")
        x, y, w, h = (roi.whole(key) if key in roi else 0 for key in ("x_offset", "y_offset", "width", "height"))
        if w or h:  # all zero means the whole image
            if not (w and h) or x + w > full[0] or y + h > full[1]:
                raise CalibrationError(
                    f"{section.where('roi')}: expected a region inside of {full[0]}x{full[1]}, got {w}x{h} at "
                    f"({x}, {y}); correct it, or set all four to 0 for the whole image"
                )
            region = (x, y, w, h)
    keys = ("binning_x", "binning_y")
    # 0 and 1 both mean none
    bx, by = (max(section.whole(key), 1) if section.content.get(key) is not None else 1 for key in keys)
    width, height = region[2] // bx, region[3] // by
    if not (width and height):
        raise CalibrationError(
            f"{section.where('binning_x')}: expected an image left after binning, got {width}x{height}; "
            "correct the binning"
        )
    return region, (bx, by)
