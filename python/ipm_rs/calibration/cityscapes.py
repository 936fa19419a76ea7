"""Cityscapes camera files: ``camera/<split>/<city>/<id>_camera.json``, and those of Cityscapes-3D.

The format, after the dataset's own csCalibration.pdf (Schneider and Cordts, 2016):

* ``extrinsic``: ``x, y, z`` is the camera centre in the vehicle frame, metres; ``roll, pitch, yaw`` its attitude in
  radians, ``Rz(yaw) Ry(pitch) Rx(roll)``: positive pitch looks down, positive yaw turns left, positive roll lifts the
  left side. ``baseline`` is the stereo baseline, which one camera does not need.
* ``intrinsic``: focal lengths ``fx, fy`` and principal point ``u0, v0``, pixels, of the rectified 2048 x 1024 image,
  which has no lens distortion left.
* The vehicle frame is ISO 8855 (x forward, y left, z up) with its origin on the ground below the rear axle, so the
  road is at ``z = 0``: ``ground=0``. The camera's own frame has the same orientation (it looks along +x); the change to
  optical axes is ours.
* Pixel (0, 0) is "in the top-left image pixel", read as its centre.

The official files nest the keys in ``extrinsic`` and ``intrinsic``; a widely copied form has them flat. Both are read.

Cityscapes-3D (``gtBbox3d/<split>/<city>/<id>_gtBbox3d.json``) has the same frames and units in another form: ``sensor``
holds ``fx, fy, u0, v0`` and ``sensor_T_ISO_8855``, the 3x4 transform from the vehicle to the camera's own frame.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ipm_rs._core import Camera
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import OPTICAL_FROM_FLU, Section, describe, pinhole, rigid
from ipm_rs.calibration._files import Document, Source, keys_missing, read_json, same_size
from ipm_rs.errors import CalibrationError

__all__ = ["KEYS", "TITLE", "missing", "read"]

TITLE = "Cityscapes"
KEYS = ("extrinsic", "intrinsic", "roll", "pitch", "yaw", "fx", "fy", "u0", "v0", "sensor", "sensor_T_ISO_8855")

_SECTIONS = {
    "extrinsic": ("x", "y", "z", "roll", "pitch", "yaw"),
    "intrinsic": ("fx", "fy", "u0", "v0"),
}


@np.errstate(all="ignore")  # what overflows is for the camera to refuse, not for NumPy to warn of
def read(source: Source, *, image_size: tuple[int, int] = (2048, 1024), nearest_rotation: bool = False) -> Camera:
    """Read a Cityscapes camera calibration.

    Parameters
    ----------
    source : str, path or mapping
        A JSON file, or its content as a mapping. The keys are ``x, y, z`` (metres), ``roll, pitch, yaw`` (radians) and
        ``fx, fy, u0, v0`` (pixels), nested in ``extrinsic`` and ``intrinsic`` or flat. Other keys, ``baseline`` among
        them, are not used. A Cityscapes-3D file or its mapping is told by the key ``sensor``.
    image_size : (int, int)
        Width and height in pixels of the image that the intrinsics belong to; the file does not say it.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

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
    place = read_json(source, TITLE)
    place.nearest = nearest_rotation
    if "sensor" in place:
        return _read_3d(place, image_size)
    values = _values(place)
    return build(
        place.where("intrinsic") if "intrinsic" in place else place.origin,
        pinhole(values["fx"], values["fy"], values["u0"], values["v0"]),
        make=Camera.from_euler,
        image_size=image_size,
        position=(values["x"], values["y"], values["z"]),
        roll=values["roll"],
        pitch=values["pitch"],
        yaw=values["yaw"],
    )


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format."""
    if keys_missing(document, "sensor") is None:
        return keys_missing(document, "sensor.sensor_T_ISO_8855")
    nested = keys_missing(document, "extrinsic.pitch", "intrinsic.u0")
    if keys_missing(document, "pitch", "u0") is None:
        return None
    return nested


def _read_3d(place: Section, image_size: tuple[int, int]) -> Camera:
    sensor = place.section("sensor")
    sensor.require("sensor_T_ISO_8855", *_SECTIONS["intrinsic"])
    if "imgWidth" in place and "imgHeight" in place:
        same_size(image_size, place.image_size("imgWidth", "imgHeight"), place.origin)
    T = sensor.pose("sensor_T_ISO_8855")
    fx, fy, u0, v0 = (sensor.number(key, unit="pixels", positive=key in ("fx", "fy")) for key in _SECTIONS["intrinsic"])
    pose = rigid(OPTICAL_FROM_FLU, (0, 0, 0)) @ T
    return build(sensor.where(), pinhole(fx, fy, u0, v0), image_size=image_size, camera_from_vehicle=pose)


def _values(place: Section) -> dict[str, float]:
    """All ten numbers, found nested or flat; every problem of one kind is named at once."""
    found: dict[str, float] = {}
    missing_keys: list[str] = []
    for name, keys in _SECTIONS.items():
        nested = name in place
        if nested and not isinstance(place.content[name], Mapping):
            raise CalibrationError(
                f"{place.where(name)}: expected an object with {', '.join(keys)}, got {describe(place.content[name])}; "
                "nest the numbers in it, or leave it out and write them flat"
            )
        section = place.section(name) if nested else place
        for key in keys:
            if nested and key in place and key in section:
                raise CalibrationError(
                    f"{place.where(key)}: expected once, got both {name}.{key} and a flat {key}; remove one"
                )
            if key in section:
                found[key] = section.number(key, unit=_unit(key), positive=key in ("fx", "fy"))
            else:
                where = f"in {name!r}" if nested else "at the top level"
                missing_keys.append(f"{key} ({where}{section.hint(key)})")
    if missing_keys:
        raise CalibrationError(
            f"{place.origin}: expected the keys x, y, z, roll, pitch, yaw, fx, fy, u0, v0, missing "
            f"{'; '.join(missing_keys)}; add them, in metres, radians and pixels"
        )
    return found


def _unit(key: str) -> str:
    return "pixels" if key in _SECTIONS["intrinsic"] else "metres" if key in "xyz" else "radians"
