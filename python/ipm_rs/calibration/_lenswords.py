"""Words for lenses in calibration files: which lens of ours each means, and which mean one that we do not have.

A lens that we do not have is worse than none: its coefficients under our formula bend the picture the wrong way, and
nothing says so. Files name it under many keys (``model``, ``camera_model``, ``DistModel``, ``type``, ``lens``), so
every word at a camera's level is looked at.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ipm_rs.errors import CalibrationError

__all__ = ["FOREIGN", "is_lens_key", "known_lens", "plain_word", "refuse_foreign"]

_LENSES = {
    "brown_conrady": (
        "brownconrady", "brown", "plumbbob", "radtan", "radialtangential", "rationalpolynomial", "rational", "opencv",
        "fullopencv", "radtan5", "radtan8", "pinholeradtan", "opencv4", "opencv5", "opencv8", "opencv12",
    ),
    "fisheye": (
        "fisheye", "equidistant", "equi", "kannalabrandt", "kannalabrandt4", "kannalabrandt8", "kb4", "kb8",
        "opencvfisheye", "pinholeequi", "fisheyeopencv",
    ),
    "omnidir": ("omnidir", "omni", "mei", "omnidirectional"),
    "pinhole": ("none", "nodistortion", "undistorted", "rectified", ""),
}  # fmt: skip

# Coefficients that are all zero leave a pinhole of these, but never of a fisheye, which bends without any.
_NEAR_PINHOLE = (
    "inversebrownconrady", "modifiedbrownconrady", "inversebrown", "inverseradtan", "division", "divisional",
    "simpledivision", "simpledivisional", "fov", "atan", "arctan", "arctangent", "polynomial", "poly3", "poly5", "poly",
    "ptlens", "spline", "cubicspline", "splineradial", "thinprism",
)  # fmt: skip
_BENT = (
    "thinprismfisheye", "radtanthinprismfisheye", "fisheyeradtanthinprism", "fisheye62", "fisheye624", "ftheta",
    "fthetalens", "equisolid", "equisolidangle", "stereographic", "orthographic", "orthogonal", "equirectangular",
    "spherical", "panoramic", "cylindrical", "scaramuzza", "ocam", "ocamcalib", "radialpoly", "doublesphere", "ds",
    "eucm", "ucm", "unified", "kannalabrandt6", "kannalabrandtthinprism", "linescan", "pushbroom",
    "splinedstereographic", "sterographic",
)  # fmt: skip
FOREIGN = (*_NEAR_PINHOLE, *_BENT)
"""Words, as `plain_word` gives them, for lenses without a counterpart under the names of OpenCV and ROS."""

# These are clear under any key; the others are ordinary words too, and count under a key that speaks of a lens.
_CLEAR = ("inversebrown", "modifiedbrown", "thinprismfisheye", "ftheta", "equisolid", "fisheye624")
_FILLERS = frozenset(
    ("lensmodel", "distortion", "camera", "model", "lens", "type", "rs2", "calibration", "projection", "dist")
)
_KEY_WORDS = ("model", "lens", "distort", "dist", "type", "projection")


def plain_word(value: Any) -> str:
    """Word of a lens in lower case, without what stands around it: "Distortion.Inverse_Brown_Conrady"."""
    if not isinstance(value, str) or len(value) > 80:
        return ""
    return "".join(part for part in re.split("[^a-z0-9]+", value.lower()) if part not in _FILLERS)


def known_lens(value: Any) -> str | None:
    """Name ours for a word: "brown_conrady", "fisheye", "omnidir", "pinhole"; None for any other word."""
    word = plain_word(value)
    return next((lens for lens, words in _LENSES.items() if word in words), None)


def is_lens_key(key: str) -> bool:
    """Whether a key speaks of a lens or a model."""
    return any(word in key.lower() for word in _KEY_WORDS)


def refuse_foreign(
    content: Mapping[Any, Any], origin: str, *, bends: bool, known: str = "brown_conrady, fisheye or omnidir"
) -> bool:
    """Refuse a calibration that names a lens which we do not have.

    Parameters
    ----------
    content : mapping
        Everything that the file says of the camera, without what is nested.
    origin : str
        Where that stands, for messages.
    bends : bool
        Whether any coefficient is not 0.
    known : str
        Words of the format that have a model here, for messages.

    Returns
    -------
    bool
        Whether such a lens is named whose coefficients, all 0, leave a pinhole.
    """
    named = False
    for key, value in content.items():
        word = plain_word(value)
        clear = any(part in word for part in _CLEAR)
        if not (clear or (word in FOREIGN and is_lens_key(str(key)))):
            continue
        fisheye = word in _BENT or "fisheye" in word or "ftheta" in word or "equisolid" in word
        if bends or fisheye:
            unless = "" if fisheye else ", unless all its coefficients are 0"
            raise CalibrationError(
                f"{origin}: {key}: expected a lens such as {known}, got {value!r:.60}, which has no model{unless}; "
                "calibrate with cv2.calibrateCamera or cv2.fisheye, or undistort the images first"
            )
        named = True
    return named
