"""MATLAB's ``monoCamera`` and ``cameraIntrinsics``, as plain numbers: a mapping, or JSON as ``jsonencode`` writes it.

In MATLAB, ``jsonencode(struct(sensor))`` or a few lines of your own give the file; ``.mat`` files are not read.

* Intrinsics, at the top or in ``Intrinsics`` (or ``intrinsics``): ``FocalLength`` [fx fy], ``PrincipalPoint`` [cx cy],
  ``ImageSize`` **[rows columns]**, ``Skew``; or, in place of the first two and the skew, ``K`` (upright) or
  ``IntrinsicMatrix`` (**transposed**, as MATLAB had it before 2022: the principal point is its last row);
  ``RadialDistortion`` [k1 k2] or [k1 k2 k3], ``TangentialDistortion`` [p1 p2].
* **Pixel (1, 1)** is the centre of the top-left pixel: 1 is subtracted from the principal point.
* ``Height`` in metres, ``Pitch``, ``Yaw``, ``Roll`` in **degrees**, ``SensorLocation`` [x y] in metres. Positive pitch
  looks down, positive yaw turns left, positive roll lifts the left side: "clockwise positive when looking in the
  positive direction of that axis". The rotation is ``Rz(yaw) Ry(pitch) Rx(roll)``; MATLAB's documentation confirms the
  signs, but prints no example with yaw and roll together.
* The vehicle frame is ISO 8855 (x forward, y left, z up) and the road is at ``z = 0``, the default
  ``ground=``, below the sensor by ``Height``.

Names are taken in any case, with or without ``_deg``; other keys are not used.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ipm_rs._core import BrownConrady, Camera
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, blame, coefficients, describe, matrix, number, numbers, pinhole
from ipm_rs.calibration._files import Document, Source, read_json, same_size
from ipm_rs.calibration._lenswords import refuse_foreign
from ipm_rs.errors import CalibrationError

__all__ = ["KEYS", "missing", "read"]

TITLE = "MATLAB monoCamera"
KEYS = ("ImageSize", "FocalLength", "PrincipalPoint", "IntrinsicMatrix", "RadialDistortion", "SensorLocation")

_MOST_KEYS = 1000  # at the top; a larger table is something else

_KNOWN = (
    "intrinsics focallength principalpoint imagesize skew k intrinsicmatrix radialdistortion tangentialdistortion "
    "height pitch yaw roll sensorlocation worldunits"
).split()


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    try:
        content = document.json
    except CalibrationError:
        return "not JSON"
    if not isinstance(content, Mapping):
        return "no JSON object"
    keys = {str(key) for key in content} if len(content) <= _MOST_KEYS else set()
    inner = [value for key, value in content.items() if str(key).lower() == "intrinsics"]
    keys |= {str(key) for value in inner if isinstance(value, Mapping) for key in value}
    names = {key.lower().removesuffix("_deg") for key in keys}
    if "imagesize" not in names or not names & {"focallength", "intrinsicmatrix"}:
        return "no ImageSize with FocalLength or IntrinsicMatrix"
    # Written otherwise than MATLAB does, [rows columns] and pixels from 1 would be a guess without its monoCamera.
    if not keys & {"ImageSize", "IntrinsicMatrix"} and "pitch" not in names:
        return "no Height and Pitch"
    return None


def read(source: Source, *, image_size: tuple[int, int] | None = None) -> Camera:
    """Read the numbers of a MATLAB ``monoCamera``.

    Parameters
    ----------
    source : str, path or mapping
        A JSON file, or the same as a mapping; see the module for the keys. Without ``Height`` and angles the camera is
        at the origin and looks along +x.
    image_size : (int, int), optional
        Width and height in pixels. If the file has ``ImageSize``, it must agree.

    Returns
    -------
    Camera
        In MATLAB's vehicle frame: x forward, y left, z up, the road at z = 0. Its pixels are 0-based: one less than
        what ``vehicleToImage`` gives.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, repeated, or its value cannot be right.
    ArgumentTypeError
        `source` is neither a path nor a mapping.
    """
    content = read_json(source, TITLE)
    values = _collect(content)
    size = image_size
    if "imagesize" in values:
        rows, columns = numbers(*values["imagesize"], 2, unit="pixels")
        size = Section({"rows": rows, "columns": columns}, values["imagesize"][1]).image_size("columns", "rows")
        same_size(image_size, size, content.origin)
    if size is None:
        raise CalibrationError(
            f"{content.origin}: expected ImageSize [rows columns], missing; add it, or pass image_size="
        )
    value, where = values.get("worldunits", ("m", ""))
    if not (isinstance(value, str) and value in ("meters", "metres", "m")):
        raise CalibrationError(f"{where}: expected 'meters', got {describe(value)}; convert Height and SensorLocation")
    x, y = numbers(*values["sensorlocation"], 2, unit="metres") if "sensorlocation" in values else (0.0, 0.0)
    height = number(*values["height"], unit="metres") if "height" in values else 0.0
    roll, pitch, yaw = (
        math.radians(number(*values[key], unit="degrees")) if key in values else 0.0 for key in ("roll", "pitch", "yaw")
    )
    K = _intrinsics(values, content.origin)
    with blame(content.origin):
        lens = _lens(values)
    refuse_foreign(content.content, content.origin, bends=lens is not None)
    return build(
        content.origin,
        K,
        make=Camera.from_euler,
        image_size=size,
        position=(x, y, height),
        roll=roll,
        pitch=pitch,
        yaw=yaw,
        lens=lens,
    )


def _collect(content: Section) -> dict[str, tuple[Any, str]]:
    """Every known key in lower case with its value and place; the intrinsics may be nested."""
    found: dict[str, tuple[Any, str]] = {}

    def add(section: Section) -> None:
        for key, value in section.content.items():
            name = str(key).lower().removesuffix("_deg").replace("_", "")
            if name not in _KNOWN:
                continue
            if name == "intrinsics":
                add(section.section(key))
            elif name in found:
                raise CalibrationError(
                    f"{section.where(str(key))}: expected once, got {found[name][1]} too; remove one"
                )
            else:
                found[name] = value, section.where(str(key))

    add(content)
    return found


def _intrinsics(values: dict[str, tuple[Any, str]], origin: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    ways = [name for name in ("k", "intrinsicmatrix", "focallength") if name in values]
    if len(ways) != 1:
        got = " and ".join(values[name][1].rpartition(": ")[2] for name in ways) or "none of them"
        raise CalibrationError(
            f"{origin}: expected FocalLength and PrincipalPoint, or K, or IntrinsicMatrix, got {got}; "
            "keep one of the three"
        )
    if ways == ["focallength"]:
        if "principalpoint" not in values:
            raise CalibrationError(f"{origin}: expected PrincipalPoint [cx cy] beside FocalLength, missing; add it")
        value, where = values["focallength"]
        fx, fy = (number(item, where, unit="pixels", positive=True) for item in numbers(value, where, 2))
        cx, cy = numbers(*values["principalpoint"], 2, unit="pixels")
        skew = number(*values["skew"], unit="pixels") if "skew" in values else 0.0
        K = pinhole(fx, fy, cx, cy, skew)
    else:
        K = matrix(*values[ways[0]], (3, 3), unit="pixels")
        if ways == ["intrinsicmatrix"]:
            K = K.T.copy()
        elif K[2, 0] or K[2, 1]:
            raise CalibrationError(
                f"{values['k'][1]}: expected the last row 0 0 1, got a transposed matrix; call it IntrinsicMatrix"
            )
        if K[0, 2] == K[1, 2] == 0 and (K[2, 0] or K[2, 1]):
            raise CalibrationError(
                f"{values[ways[0]][1]}: expected MATLAB's transposed matrix, the principal point in its last row, got "
                "an upright one; call it K"
            )
    K[:2, 2] -= 1  # MATLAB counts pixels from 1
    return K


def _lens(values: dict[str, tuple[Any, str]]) -> BrownConrady | None:
    radial = coefficients(*values["radialdistortion"], (2, 3)) if "radialdistortion" in values else np.zeros(2)
    tangential = numbers(*values["tangentialdistortion"], 2) if "tangentialdistortion" in values else np.zeros(2)
    k3 = radial[2] if len(radial) == 3 else 0.0
    terms = [*radial[:2], *tangential, k3]
    return BrownConrady(terms) if any(terms) else None
