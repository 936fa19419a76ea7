"""ROS ``CameraInfo``: the YAML and INI files of ``camera_calibration_parsers``, and the message itself.

The format, after ``sensor_msgs/CameraInfo`` and REP-104:

* ``camera_matrix`` (K) and ``distortion_coefficients`` (D) describe the **raw** image; ``rectification_matrix`` (R) and
  ``projection_matrix`` (P) the **rectified** one. Mixing them is the usual mistake: ``image=`` says which is meant.
* ``distortion_model``: ``plumb_bob`` (k1, k2, t1, t2, k3), ``rational_polynomial`` (8, 12 or 14 terms in OpenCV's
  order), ``equidistant`` (k1..k4). Without it, five coefficients are ``plumb_bob``, as ROS has it; four are refused,
  for they may be either.
* ``P[:, 3]`` is the place of a right stereo camera: ``P[0, 3] = -fx' B``. P takes points of the left camera's rectified
  frame, and so the pose of the left camera is the one to give.
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

from ipm_rs._core import BrownConrady, Camera, KannalaBrandt
from ipm_rs.calibration._checks import Section, blame, describe, numbers, rigid
from ipm_rs.calibration._files import Document, open_document, same_size
from ipm_rs.calibration._filestorage import plain
from ipm_rs.calibration._mount import mounted
from ipm_rs.calibration._rosini import looks_like_ini, parse_ini
from ipm_rs.calibration._yaml import parse_yaml
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["missing", "read"]

TITLE = "ROS CameraInfo"

# Names in the files, in a message of ROS 1, in a message of ROS 2.
_NAMES = {
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
    "K": ("camera_matrix", "K", "k"),
    "D": ("distortion_coefficients", "D", "d"),
    "R": ("rectification_matrix", "R", "r"),
    "P": ("projection_matrix", "P", "p"),
}
_COUNTS = {"plumb_bob": (5, 4), "rational_polynomial": (8, 12, 14), "equidistant": (4,), "fisheye": (4,)}

Matrix = NDArray[np.float64]


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    text = document.text
    if looks_like_ini(text):
        return None if "camera matrix" in text else "no 'camera matrix'"
    # OpenCV's files share camera_matrix; these keys they lack.
    words = ("projection_matrix", "rectification_matrix", "distortion_model")
    if "image_width" in text and any(word in text for word in words) and not text.startswith("%YAML:"):
        return None
    return "no [image] section, and no image_width with projection_matrix"


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
) -> Camera:
    """Read a ROS camera calibration.

    Parameters
    ----------
    source : str, path, mapping or message
        A YAML file (needs the extra ``yaml``), an INI file, the content of either as a mapping, or a
        ``sensor_msgs/CameraInfo`` message of ROS 1 or 2.
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
    if not isinstance(image, str) or image not in ("raw", "rectified"):
        raise ArgumentError(f"image: expected 'raw' or 'rectified', got {image!r:.60}; say which images will be warped")
    section = _content(source, camera)
    section.require("width", "height", *(("R", "P") if image == "rectified" else ("K", "D")))
    full = section.image_size("width", "height")
    pose = mounted(camera_from_vehicle, vehicle_from_camera)
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
        pose = offset @ rigid(section.rotation("R"), np.zeros(3)) @ pose
    K, size = _published(section, K, full, ros_binning)
    same_size(image_size, size, section.origin)
    with blame(section.origin):
        return Camera(K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _content(source: Any, camera: str | None) -> Section:
    """Content under our names K, D, R, P, width, height, whatever the source calls them."""
    origin = f"{TITLE} calibration"
    content: Any
    if isinstance(source, Mapping):
        content = source
    elif all(hasattr(source, name) for name in ("width", "height", "distortion_model", "binning_x", "roi")):
        origin, content = "CameraInfo message", _from_message(source)
    else:
        if not isinstance(source, (str, os.PathLike)):
            raise ArgumentTypeError(
                f"source: expected a path, a mapping or a CameraInfo message, got {type(source).__name__}; "
                "pass the file's name"
            )
        document = open_document(source, TITLE, or_mapping=True)
        origin, text = document.origin, document.text
        if looks_like_ini(text):
            content = parse_ini(text, origin, camera)
            camera = None
        else:
            content = parse_yaml(text, origin)
            if not isinstance(content, dict):
                raise CalibrationError(
                    f"{origin}: expected keys such as camera_matrix, got {describe(content)}; "
                    "pass the camera's YAML file"
                )
    if camera is not None and (not isinstance(camera, str) or content.get("camera_name") != camera):
        raise ArgumentError(
            f"{origin}: camera: expected {content.get('camera_name')!r:.60}, the only one there, got {camera!r:.60}; "
            "leave it out"
        )
    # Matrices are written as {rows, cols, data}; a message has plain lists.
    content = plain(content, origin)
    return _Named({ours: name for ours in _NAMES for name in _NAMES[ours] if name in content}, content, origin)


class _Named(Section):
    """A section with our keys, which says in messages how the file calls them."""

    def __init__(self, names: Mapping[str, str], content: Mapping[str, Any], origin: str) -> None:
        self.names = names
        super().__init__({**content, **{ours: content[name] for ours, name in names.items()}}, origin)

    def where(self, key: str = "") -> str:
        return super().where(self.names.get(key, _NAMES[key][0] if key in _NAMES else key))

    def require(self, *keys: str) -> None:
        missing = [_NAMES[key][0] if key in _NAMES else key for key in keys if key not in self.content]
        if missing:
            raise CalibrationError(
                f"{self.origin}: expected the keys {', '.join(_NAMES[key][0] for key in keys if key in _NAMES)}, "
                f"missing {', '.join(missing)}; pass the calibration file that camera_calibration wrote"
            )


def _from_message(message: Any) -> dict[str, Any]:
    """Fields of a message, whose arrays may be NumPy's or of the array module."""
    names = ["width", "height", "distortion_model", "binning_x", "binning_y"]
    names += [name for pair in "KDRP" for name in (pair, pair.lower())]
    content = {name: getattr(message, name) for name in names if hasattr(message, name)}
    for name, value in content.items():
        if name.upper() in "KDRP":
            content[name] = list(value)
    roi = message.roi
    content["roi"] = {
        name: getattr(roi, name) for name in ("x_offset", "y_offset", "width", "height") if hasattr(roi, name)
    }
    return content


def _calibrated(section: Section, key: str, K: Matrix) -> Matrix:
    if K[0, 0] == 0 or K[1, 1] == 0:
        raise CalibrationError(
            f"{section.where(key)}: expected focal lengths, got 0, which is how ROS marks an uncalibrated camera; run "
            "camera_calibration, or fill in the matrix"
        )
    return K


def _lens(section: Section) -> BrownConrady | KannalaBrandt | None:
    D = section.value("D")
    coefficients = numbers(D.ravel() if isinstance(D, np.ndarray) else D, section.where("D"))
    model = section.content.get("distortion_model")
    if model in (None, "", "none"):
        if not coefficients.any():
            return None
        if model == "none" or len(coefficients) != 5:
            raise CalibrationError(
                f"{section.where('distortion_model')}: expected a model for {len(coefficients)} coefficients, "
                f"got {model!r}; write plumb_bob, rational_polynomial or equidistant"
            )
        model = "plumb_bob"
    else:
        model = section.text("distortion_model", among=tuple(_COUNTS))
    coefficients = numbers(coefficients, f"{section.where('D')} ({model})", _COUNTS[model])
    if model in ("equidistant", "fisheye"):
        return KannalaBrandt(coefficients)
    return BrownConrady(coefficients) if coefficients.any() else None


def _published(section: Section, K: Matrix, full: tuple[int, int], ros_binning: bool) -> tuple[Matrix, tuple[int, int]]:
    """K and size of the image that is published: the region of interest, then binning."""
    K = K.copy()
    width, height = full
    if section.content.get("roi") is not None:
        roi = section.section("roi")
        x, y, w, h = (roi.whole(key) if key in roi else 0 for key in ("x_offset", "y_offset", "width", "height"))
        if w or h:  # all zero means the whole image
            if not (w and h) or x + w > width or y + h > height:
                raise CalibrationError(
                    f"{section.where('roi')}: expected a region inside of {width}x{height}, got {w}x{h} at ({x}, {y}); "
                    "correct it, or set all four to 0 for the whole image"
                )
            width, height = w, h
            K[:2, 2] -= x, y
    for axis, key in enumerate(("binning_x", "binning_y")):
        b = section.whole(key) if section.content.get(key) is not None else 1
        if b > 1:  # 0 and 1 both mean none
            K[axis, :2] /= b
            K[axis, 2] = K[axis, 2] / b if ros_binning else (K[axis, 2] + 0.5) / b - 0.5
            width, height = (width // b, height) if axis == 0 else (width, height // b)
    if not (width and height):
        raise CalibrationError(
            f"{section.where('binning_x')}: expected an image left after binning, got {width}x{height}; "
            "correct the binning"
        )
    return K, (width, height)
