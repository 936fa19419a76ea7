"""The INI form of a ROS calibration (``ost.txt``, ``calib.ini``) as the mapping that the YAML form would be.

``[image]`` holds ``width`` and ``height``, a section with the camera's name the matrices; a name stands on one line,
its numbers on the lines below. The model is not written: 5 coefficients are ``plumb_bob``, 8 ``rational_polynomial``.
"""

from __future__ import annotations

import re
from typing import Any

from ipm_rs.calibration._checks import listed
from ipm_rs.calibration._yaml import scalar
from ipm_rs.errors import ArgumentError, CalibrationError

__all__ = ["looks_like_ini", "parse_ini"]

_SECTION = re.compile(r"^\[([^\[\]{}\"]{1,200})\]$")  # and no list of JSON
_NAMES = {
    "camera matrix": "camera_matrix",
    "distortion": "distortion_coefficients",
    "rectification": "rectification_matrix",
    "projection": "projection_matrix",
}
_MODELS = {5: "plumb_bob", 8: "rational_polynomial"}


def looks_like_ini(text: str) -> bool:
    """Whether the first line that is no comment is a section's name."""
    lines = text[:100_000].splitlines()  # a file of any size is asked this
    line = next((line.strip() for line in lines if line.strip() and line.strip()[0] not in "#;"), "")
    return _SECTION.match(line) is not None and not _is_number(line.strip("[]").split(",")[0])


def parse_ini(text: str, origin: str, camera: str | None = None) -> dict[str, Any]:
    """Parse an INI calibration; `camera` names the section where there is more than one.

    Raises
    ------
    CalibrationError
        A line is out of place, a matrix is missing, or the number of coefficients belongs to no model.
    ArgumentError
        There is no such camera, or more than one and none is named.
    """
    image, cameras = _sections(text, origin)
    if camera is None and len(cameras) == 1:
        camera = next(iter(cameras))
    if not cameras:
        raise CalibrationError(
            f"{origin}: expected a section with 'camera matrix', found none; pass the camera's .ini file"
        )
    if not isinstance(camera, str) or camera not in cameras:
        raise ArgumentError(
            f"{origin}: camera: expected one of {listed(cameras)}, got {camera!r:.60}; say which to read"
        )
    # ROS writes all four; a file that ends within the distortion may still have as many numbers as another model takes.
    lacks = [repr(name) for name in _NAMES if name not in cameras[camera]]
    if lacks:
        raise CalibrationError(
            f"{origin}: {camera}: expected {', '.join(map(repr, _NAMES))}, missing {', '.join(lacks)}; the file may be "
            "cut short, fetch it again"
        )
    content: dict[str, Any] = {"camera_name": camera}
    for key, numbers in image.items():
        if key in ("width", "height"):
            content[f"image_{key}"] = numbers[0] if len(numbers) == 1 else numbers
    content |= {name: cameras[camera][key] for key, name in _NAMES.items()}
    coefficients = content["distortion_coefficients"]
    if len(coefficients) not in _MODELS:
        raise CalibrationError(
            f"{origin}: {camera}: distortion: expected 5 numbers (plumb_bob) or 8 (rational_polynomial), got "
            f"{len(coefficients)}; an INI file does not name its model, use the YAML form for others"
        )
    content["distortion_model"] = _MODELS[len(coefficients)]
    return content


def _sections(text: str, origin: str) -> tuple[dict[str, list[Any]], dict[str, dict[str, list[Any]]]]:
    """Return ``[image]``, and every section that holds a camera matrix."""
    image: dict[str, list[Any]] = {}
    sections: dict[str, dict[str, list[Any]]] = {}
    section: dict[str, list[Any]] | None = None
    values: list[Any] | None = None
    for index, raw in enumerate(text.splitlines(), 1):
        line = raw.strip()
        if not line or line[0] in "#;":
            continue
        heading = _SECTION.match(line)
        if heading and heading[1].strip() == "image":  # a stereo file repeats it for the second camera
            section, values = image, None
        elif heading:
            name = heading[1].strip()
            if name in sections:
                raise CalibrationError(
                    f"{origin}: line {index}: expected every section once, got [{name}] again; keep one"
                )
            section, values = sections.setdefault(name, {}), None
        elif section is None:
            raise CalibrationError(
                f"{origin}: line {index}: expected a section such as [image] first, got {line!r:.60}; add it"
            )
        elif _is_number(line.split()[0]):
            if values is None:
                raise CalibrationError(f"{origin}: line {index}: expected a name above these numbers; add it")
            values.extend(scalar(word) for word in line.split())
        else:
            if line in section and section is not image:
                raise CalibrationError(
                    f"{origin}: line {index}: expected every name once, got {line!r:.60} again; keep one"
                )
            values = []
            section.setdefault(line, values)
    return image, {name: content for name, content in sections.items() if "camera matrix" in content}


def _is_number(word: str) -> bool:
    return isinstance(scalar(word), (int, float)) and not isinstance(scalar(word), bool)
