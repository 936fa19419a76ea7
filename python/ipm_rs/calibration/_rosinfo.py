"""What a ROS CameraInfo says, from YAML, JSON, INI, a dump of ``rostopic echo`` or ``ros2 topic echo``, or a message.

A dump has a document for each message, parted by ``---``. Messages of one camera differ in their headers only: any is
taken. Where they differ in their calibration, none is.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from ipm_rs.calibration._checks import Section, describe
from ipm_rs.calibration._files import Document, open_document
from ipm_rs.calibration._filestorage import plain
from ipm_rs.calibration._rosini import looks_like_ini, parse_ini
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = ["KEYS", "NOT_ROS", "TITLE", "content_of", "lacks"]

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
NOT_ROS = "the first line %YAML:1.0, so OpenCV's"
KEYS = (
    "image_width", "image_height", "camera_name", "camera_matrix", "distortion_model", "distortion_coefficients",
    "rectification_matrix", "projection_matrix", "binning_x", "binning_y", "roi", "header",
)  # fmt: skip
_OF_A_FILE = ("projection_matrix", "rectification_matrix", "distortion_model")
_OF_A_MESSAGE = ("header", "distortion_model", "binning_x", "roi")


def lacks(document: Document) -> str | None:
    """Say what a document lacks to be a CameraInfo; None if nothing."""
    text = document.text
    if looks_like_ini(text):
        return None if "camera matrix" in text else "no 'camera matrix'"
    # OpenCV's files share camera_matrix; the other keys they lack.
    if text.startswith("%YAML:"):
        return NOT_ROS
    first = _documents(document)[0]
    if not isinstance(first, Mapping):
        return "no [image] section, and no keys image_width, camera_matrix"
    if {"image_width", "camera_matrix"} <= first.keys() and any(key in first for key in _OF_A_FILE):
        return None
    for k, d, r, p in ("KDRP", "kdrp"):
        if {"width", "height", k, d} <= first.keys() and (r in first or p in first):
            if any(key in first for key in _OF_A_MESSAGE):
                return None
    return "no [image] section, and no image_width and camera_matrix with projection_matrix or distortion_model"


def content_of(source: Any, camera: str | None) -> Section:
    """Content under our names K, D, R, P, width, height, whatever the source calls them."""
    origin = f"{TITLE} calibration"
    content: Any
    if isinstance(source, Mapping):
        content = source
    elif all(hasattr(source, name) for name in ("width", "height", "distortion_model", "binning_x", "roi")):
        origin, content = "CameraInfo message", _from_message(source)
    else:
        if not isinstance(source, (str, os.PathLike, Document)):
            raise ArgumentTypeError(
                f"source: expected a path, a mapping or a CameraInfo message, got {type(source).__name__}; "
                "pass the file's name"
            )
        document = open_document(source, TITLE, or_mapping=True)
        origin = document.origin
        if looks_like_ini(document.text):
            content = parse_ini(document.text, origin, camera)
            camera = None
        else:
            content = _agreed(_documents(document), origin, camera)
    if camera is not None and (not isinstance(camera, str) or content.get("camera_name") != camera):
        raise ArgumentError(
            f"{origin}: camera: expected {content.get('camera_name')!r:.60}, the only one there, got {camera!r:.60}; "
            "leave it out"
        )
    # Matrices are written as {rows, cols, data}; a message has plain lists.
    content = plain(content, origin)
    return _Renamed({ours: name for ours in _NAMES for name in _NAMES[ours] if name in content}, content, origin)


def _documents(document: Document) -> list[Any]:
    """Messages of a dump; a JSON list of messages is one too."""
    documents = document.documents
    if len(documents) == 1 and isinstance(documents[0], list) and documents[0]:
        return documents[0] if all(isinstance(item, Mapping) for item in documents[0]) else documents
    return documents


def _agreed(documents: list[Any], origin: str, camera: Any) -> Mapping[str, Any]:
    """Return the one calibration that all documents have."""
    for content in documents:
        if not isinstance(content, Mapping):
            raise CalibrationError(
                f"{origin}: expected keys such as camera_matrix, got {describe(content)}; pass the camera's YAML file"
            )
    if isinstance(camera, str) and len(documents) > 1:
        documents = [content for content in documents if content.get("camera_name") == camera] or documents
    first = documents[0]
    keys = ("distortion_model", "binning_x", "binning_y", "roi", *(name for names in _NAMES.values() for name in names))
    for index, content in enumerate(documents[1:], 2):
        differs = [key for key in keys if repr(content.get(key)) != repr(first.get(key))]  # repr: nan is nan
        if differs:
            raise CalibrationError(
                f"{origin}: expected one calibration, got document {index} with another {differs[0]} than the first; "
                "keep the document of your images, the text between two '---'"
            )
    return first


class _Renamed(Section):
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
            content[name] = value.tolist() if isinstance(value, np.ndarray) else list(value)
    roi = message.roi
    content["roi"] = {
        name: getattr(roi, name) for name in ("x_offset", "y_offset", "width", "height") if hasattr(roi, name)
    }
    return content
