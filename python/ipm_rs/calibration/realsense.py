"""Intel RealSense: intrinsics out of librealsense, as JSON or YAML, or as text.

The format, after librealsense's documentation of projection and its ``rsutil.h``:

* ``rs2_intrinsics`` as scripts write it: ``width``, ``height``, ``fx``, ``fy``, ``ppx``, ``ppy``, ``coeffs`` (five),
  and ``model`` or ``distortion_model``, by name or number; alone or in a section for each stream (``color``,
  ``depth``).
* What ``rs-enumerate-devices -c`` prints, whole: a block ``Intrinsic of "Color" / 1280x720`` for each stream and size.
  And what ``print(intrinsics)`` gives: ``[ 640x480  p[313.9 236.6]  f[612.9 613.5]  Brown Conrady [0 0 0 0 0] ]``.
* Pixel (0, 0) is a pixel's centre; axes optical (x right, y down, z forward).
* Brown Conrady is OpenCV's (k1, k2, p1, p2, k3). **Inverse** Brown Conrady, which colour streams have, goes from the
  image to the ray by that formula after ``rs_types.h``, but ``rs2_project_point_to_pixel`` takes the same numbers from
  the ray to the image: where they are not all 0, as they often are, ``inverse_means=`` must say which. Modified Brown
  Conrady where p1 or p2 is not 0 has no lens here. Kannala-Brandt is ``cv2.fisheye``'s; F-theta has no lens here.

There is no pose and no road: the camera is at the origin and looks along +x, forward, unless ``vehicle_from_camera=``
says how it is mounted; ``ground=`` is minus its height.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, InverseBrownConrady, KannalaBrandt
from ipm_rs.calibration._bodies import one_of, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, blame, describe, pinhole
from ipm_rs.calibration._files import Document, Source, open_document, same_size
from ipm_rs.calibration._mount import mounted
from ipm_rs.calibration._plain import has, plain_section
from ipm_rs.calibration._yaml import scalar
from ipm_rs.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "RealSense"
KEYS = ("ppx", "ppy", "fx", "fy", "coeffs", "model", "width", "height", "intrinsics", "Intrinsic")

_PARTS = ("ppx", "ppy", "fx", "fy", "width", "height")
_MODELS = ("none", "modified", "inverse", "ftheta", "brown", "kannala")  # as rs2_distortion counts them
_WORDS = {
    "none": "none", "modifiedbrownconrady": "modified", "inversebrownconrady": "inverse", "ftheta": "ftheta",
    "brownconrady": "brown", "kannalabrandt4": "kannala", "kannalabrandt": "kannala",
}  # fmt: skip

_LONGEST = 200_000  # characters of text; a device prints 30 000
_BLOCK = re.compile(r'^[ \t]*Intrinsic of "([^"\n]{1,40})"[ \t/]*([0-9]+x[0-9]+)?[^\n]*$', re.MULTILINE)
_LINE = re.compile(
    r"^[ \t]*(Width|Height|PPX|PPY|Fx|Fy|Distortion|Coeffs)[ \t]*:[ \t]*([^\n]*?)[ \t\r]*$", re.MULTILINE
)
_PRINTED = re.compile(
    r"\[ *([0-9]{1,6})x([0-9]{1,6}) +p\[([^\s\]]+) +([^\s\]]+)\] +f\[([^\s\]]+) +([^\s\]]+)\] +([A-Za-z0-9 -]{3,30}?) *"
    r"\[([^\]\n]{1,200})\] *\]"
)


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if document.is_directory:
        return "a directory"
    if document.is_json or document.keys:
        return None if _sections(document.keys) else "no keys ppx, ppy, fx, fy"
    return None if _of_text(document.text) else 'no line Intrinsic of "..."'


def cameras(document: Document) -> list[str]:
    """Names of the streams, as ``camera=`` takes them; none where there is one."""
    found = _sections(document.keys) if document.is_json or document.keys else _of_text(document.text)
    return list(found) if len(found) > 1 else []


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    camera_from_vehicle: ArrayLike | None = None,
    vehicle_from_camera: ArrayLike | None = None,
    inverse_means: Literal["undistorts", "distorts"] | None = None,
) -> Camera:
    """Read the intrinsics of one stream of a RealSense.

    Parameters
    ----------
    source : str, path or mapping
        JSON or YAML (which needs the extra ``yaml``), or text of ``rs-enumerate-devices -c``; or the content as a
        mapping.
    camera : str, optional
        The stream: its section, "color", or its name and size in text, "Color 1280x720"; needed if there is more than
        one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    camera_from_vehicle, vehicle_from_camera : (4, 4) array, optional
        How the camera is mounted, in either direction.
    inverse_means : {"undistorts", "distorts"}, optional
        What Inverse Brown Conrady's coefficients do that are not all 0. ``"undistorts"``: the formula goes from the
        image to the ray, `InverseBrownConrady`, as librealsense's documentation says and
        ``rs2_deproject_pixel_to_point`` does. ``"distorts"``: from the ray to the image, `BrownConrady`, as OpenCV fits
        them and ``rs2_project_point_to_pixel`` does. Of a straight edge in a picture only the right one makes a
        straight line.

    Returns
    -------
    Camera
        Without a pose at the origin, looking along +x.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the lens has no model here.
    ArgumentError, ArgumentTypeError
        There is no such stream; an argument is wrong.
    """
    check_word("camera", camera)
    if inverse_means is not None:
        one_of("inverse_means", inverse_means, ("undistorts", "distorts"), "or leave it out")
    origin, found = f"{TITLE} calibration", {}
    if not isinstance(source, Mapping):
        document = open_document(source, TITLE, or_mapping=True)
        origin = document.origin
        found = {} if document.is_json or document.keys else _of_text(document.text)
    if not found:
        content = plain_section(source, TITLE)
        found = _sections(content.content)
        if not found:
            content.require(*_PARTS)
    names = list(found)
    name = names[pick(names, "" if names == [""] and camera is None else camera, origin)]
    place = Section(found[name], origin, name)
    place.require(*_PARTS)
    size = place.image_size("width", "height")
    same_size(image_size, size, origin)
    K = pinhole(*(place.number(key, unit="pixels") for key in ("fx", "fy", "ppx", "ppy")))
    pose = mounted(camera_from_vehicle, vehicle_from_camera)
    return build(place.where(), K, image_size=size, camera_from_vehicle=pose, lens=_lens(place, inverse_means))


def _sections(content: Any) -> dict[str, Any]:
    """Each stream's intrinsics by its name; by "" where they stand at the top."""
    if has(content, *_PARTS):
        return {"": content}
    if not isinstance(content, Mapping) or len(content) > 100:
        return {}
    inner = {str(name): value.get("intrinsics", value) for name, value in content.items() if isinstance(value, Mapping)}
    return {name: value for name, value in inner.items() if has(value, *_PARTS)}


def _of_text(text: str) -> dict[str, Any]:
    """Intrinsics out of what librealsense prints."""
    found: dict[str, Any] = {}
    text = text[:_LONGEST]
    starts = list(_BLOCK.finditer(text))
    for start, after in itertools.zip_longest(starts, starts[1:]):
        block = text[start.end() : after.start() if after else len(text)]
        lines: dict[str, Any] = {}
        for match in _LINE.finditer(block[:2000]):
            lines.setdefault(match[1].lower(), match[2])
        value = {key: scalar(lines[key]) for key in _PARTS if key in lines}
        value |= {
            "model": lines.get("distortion"),
            "coeffs": [scalar(word) for word in lines.get("coeffs", "").split()],
        }
        name = " ".join(filter(None, start.groups()))
        found.setdefault(name, value)  # a stream is printed once for each group of formats
    for number, match in enumerate(_PRINTED.finditer(text)):
        keys = ("width", "height", "ppx", "ppy", "fx", "fy")
        value = dict(zip(keys, map(scalar, match.groups()[:6]), strict=True))
        found[str(number)] = value | {"model": match[7], "coeffs": [scalar(word) for word in match[8].split()]}
    return found


def _lens(place: Section, inverse_means: str | None) -> Any:
    key = "distortion_model" if "distortion_model" in place and "model" not in place else "model"
    values = place.content.get("coeffs")
    terms = place.numbers("coeffs", (4, 5)) if values is not None else np.zeros(5)
    where = place.where(key)
    kind = _model(place.content.get(key), where, bends=bool(terms.any()))
    with blame(place.where("coeffs")):
        if kind == "kannala":
            return KannalaBrandt(terms[:4])
        if not terms.any() or kind == "none":
            return None
        if kind == "inverse" and inverse_means is None:
            raise CalibrationError(
                f"{where}: expected Brown Conrady, or coefficients of 0, got inverse Brown Conrady, whose coefficients "
                "librealsense takes either way; pass inverse_means='undistorts' (from the image to the ray) or "
                "'distorts' (from the ray to the image), whichever makes straight edges straight"
            )
        if kind == "inverse" and inverse_means == "undistorts":
            return InverseBrownConrady(terms)
        if kind == "modified" and terms[2:4].any():
            raise CalibrationError(
                f"{where}: expected Brown Conrady, or coefficients of 0, got modified Brown Conrady, which has no "
                "model; calibrate with cv2.calibrateCamera, or undistort the images first"
            )
        return BrownConrady(terms)


def _model(value: Any, where: str, *, bends: bool) -> str:
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < len(_MODELS):
        kind = _MODELS[value]
    elif value is None and not bends:
        return "none"
    else:
        word = re.sub("[^a-z0-9]", "", value.lower().rpartition(".")[2]) if isinstance(value, str) else ""
        kind = _WORDS.get(word.removeprefix("rs2distortion"), "")
    if kind in ("", "ftheta"):
        raise CalibrationError(
            f"{where}: expected a model of librealsense, such as Brown Conrady, got {describe(value)}"
            f"{', which has no lens here' if kind else ''}; say which it is"
        )
    return kind
