"""Cityscapes camera files: ``camera/<split>/<city>/<id>_camera.json``.

The format, after the dataset's own csCalibration.pdf (Schneider and Cordts, 2016):

* ``extrinsic``: ``x, y, z`` is the camera centre in the vehicle frame, metres; ``roll, pitch, yaw`` its attitude in
  radians, ``Rz(yaw) Ry(pitch) Rx(roll)``: positive pitch looks down, positive yaw turns left, positive roll lifts the
  left side. ``baseline`` is the stereo baseline, which one camera does not need.
* ``intrinsic``: focal lengths ``fx, fy`` and principal point ``u0, v0``, pixels, of the rectified 2048 x 1024 image,
  which has no lens distortion left.
* The vehicle frame is ISO 8855 (x forward, y left, z up) with its origin on the ground below the rear axle, so the
  road is at ``z = 0``. The camera's own frame has the same orientation (it looks along +x); the change to optical
  axes is ours.
* Pixel (0, 0) is "in the top-left image pixel", read as its centre.

The official files nest the keys in ``extrinsic`` and ``intrinsic``; a widely copied form has them flat. Both are read.
"""

from __future__ import annotations

import difflib
import json
import math
import numbers
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ipm_rs._core import Camera
from ipm_rs.errors import ArgumentTypeError, CalibrationError, FileError, MissingFileError

__all__ = ["read"]

_SECTIONS = {
    "extrinsic": ("x", "y", "z", "roll", "pitch", "yaw"),
    "intrinsic": ("fx", "fy", "u0", "v0"),
}


def read(source: str | os.PathLike[str] | Mapping[str, Any], *, image_size: tuple[int, int] = (2048, 1024)) -> Camera:
    """Read a Cityscapes camera calibration.

    Parameters
    ----------
    source : str, path or mapping
        A JSON file, or its content as a mapping. The keys are ``x, y, z`` (metres), ``roll, pitch, yaw`` (radians) and
        ``fx, fy, u0, v0`` (pixels), nested in ``extrinsic`` and ``intrinsic`` or flat. Other keys, ``baseline`` among
        them, are not used.
    image_size : (int, int)
        Width and height in pixels of the image that the intrinsics belong to; the file does not say it.

    Returns
    -------
    Camera
        In the vehicle frame of the dataset: x forward, y left, z up, the road at z = 0.

    Raises
    ------
    MissingFileError
        There is no such file.
    FileError
        The file cannot be read.
    CalibrationError
        The content is not a JSON object, or a key is missing, ambiguous, not a finite number or, for a focal length,
        not positive.
    ArgumentTypeError
        `source` is neither a path nor a mapping.
    """
    if isinstance(source, Mapping):
        origin, content = "Cityscapes calibration", source
    elif isinstance(source, (str, os.PathLike)):
        path = os.fspath(source)
        if not isinstance(path, str):
            raise ArgumentTypeError(f"source: expected a text path, got {path!r}; decode it with os.fsdecode()")
        origin, content = path, _load(path)
    else:
        raise ArgumentTypeError(
            f"source: expected a path or a mapping, got {type(source).__name__}; "
            "pass the file's name, or the mapping that json.load() returns"
        )
    values = _values(content, origin)
    return Camera.from_euler(
        np.array([[values["fx"], 0.0, values["u0"]], [0.0, values["fy"], values["v0"]], [0.0, 0.0, 1.0]]),
        image_size=image_size,
        position=(values["x"], values["y"], values["z"]),
        roll=values["roll"],
        pitch=values["pitch"],
        yaw=values["yaw"],
    )


def _load(path: str) -> Mapping[str, Any]:
    """Content of a JSON file that must hold one object."""
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError as error:
        raise MissingFileError(
            f"{path}: expected a Cityscapes camera file, found none; check the path (current directory: {Path.cwd()})"
        ) from error
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        reason = getattr(error, "strerror", None) or error
        raise FileError(
            f"{path!r}: expected a readable Cityscapes camera file, got: {reason}; check the path and its permissions"
        ) from error
    try:
        content = json.loads(data.decode("utf-8-sig"), object_pairs_hook=_object)
    except UnicodeDecodeError as error:
        raise CalibrationError(
            f"{path}: expected JSON text in UTF-8, got byte 0x{data[error.start]:02x} at offset {error.start}; "
            "pass the camera's .json file, or save it as UTF-8"
        ) from error
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {error}") from None
    except (ValueError, RecursionError) as error:
        size = f"{len(data)} byte" + ("" if len(data) == 1 else "s")
        raise CalibrationError(
            f"{path}: expected JSON, got {size} that are not: {error}; the file may be cut short, fetch it again"
        ) from error
    if not isinstance(content, Mapping):
        raise CalibrationError(
            f"{path}: expected a JSON object, got {_describe(content)}; pass the *_camera.json file of the dataset"
        )
    return content


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """One JSON object; a repeated key is refused, where ``json`` would keep the last silently."""
    content = dict(pairs)
    if len(content) != len(pairs):
        keys = [key for key, _ in pairs]
        repeated = sorted({key for key in keys if keys.count(key) > 1})
        raise CalibrationError(f"expected every key once, got {', '.join(map(repr, repeated))} repeated; keep one")
    return content


def _values(content: Mapping[str, Any], origin: str) -> dict[str, float]:
    """All ten numbers, found nested or flat; every problem of one kind is named at once."""
    found: dict[str, Any] = {}
    missing: list[str] = []
    for section, keys in _SECTIONS.items():
        nested = section in content
        if nested and not isinstance(content[section], Mapping):
            raise CalibrationError(
                f"{origin}: {section}: expected an object with {', '.join(keys)}, got {_describe(content[section])}; "
                "nest the numbers in it, or leave it out and write them flat"
            )
        place = content[section] if nested else content
        for key in keys:
            if nested and key in content and key in place:
                raise CalibrationError(
                    f"{origin}: {key}: expected once, got both {section}.{key} and a flat {key}; remove one"
                )
            if key in place:
                found[key] = place[key]
            else:
                missing.append(_missing(key, section if nested else None, place))
    if missing:
        raise CalibrationError(
            f"{origin}: expected the keys x, y, z, roll, pitch, yaw, fx, fy, u0, v0, missing {'; '.join(missing)}; "
            "add them, in metres, radians and pixels"
        )
    return {key: _number(key, value, origin) for key, value in found.items()}


def _missing(key: str, section: str | None, place: Mapping[str, Any]) -> str:
    """Name a missing key, where it was looked for, and the key there that may be a misspelling of it."""
    where = f"in {section!r}" if section else "at the top level"
    names = [name for name in place if isinstance(name, str)]
    alike = [name for name in names if name.lower() == key]
    if not alike and len(key) > 2:  # short names are all alike
        alike = difflib.get_close_matches(key, names, n=1)
    hint = f", where there is {alike[0]!r}" if alike else ""
    return f"{key} ({where}{hint})"


def _number(key: str, value: Any, origin: str) -> float:
    """Check one finite number; focal lengths must be positive too."""
    unit = "pixels" if key in _SECTIONS["intrinsic"] else "metres" if key in "xyz" else "radians"
    wanted = "a finite, positive number" if key in ("fx", "fy") else "a finite number"
    problem = f"{origin}: {key}: expected {wanted}, got"
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise CalibrationError(f"{problem} {_describe(value)}; write it as a plain number in {unit}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number) or (key in ("fx", "fy") and number <= 0):
        raise CalibrationError(f"{problem} {number}; correct it, in {unit}")
    return number


def _describe(value: Any) -> str:
    """Name a value in a message: its type, and the value itself where that is short."""
    if value is None or isinstance(value, bool):
        return f"{value!r}"
    text = repr(value) if isinstance(value, (str, int, float)) else ""
    return f"{type(value).__name__} {text}" if text and len(text) <= 60 else type(value).__name__
