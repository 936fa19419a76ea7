"""nuScenes, Lyft Level 5 and nuImages: ``calibrated_sensor.json`` with ``sensor.json`` beside it.

A record of ``calibrated_sensor.json`` has, in metres and pixels:

* ``translation`` (x y z) and ``rotation``, a quaternion in the order **w x y z**: camera to ego vehicle. (Read as x y z
  w, a front camera is nearly right and a side camera looks elsewhere.)
* ``camera_intrinsic``: K, 3x3; empty for lidar and radar.
* nuImages also: ``camera_distortion``, ``k1 k2 p1 p2 k3`` (Brown-Conrady), since its images are raw; a sixth number,
  k4, belongs to a fisheye model that the dataset does not define, and is refused unless it is 0. nuScenes' and Lyft's
  images are undistorted.
* ``token``, which ``sample_data.json`` refers to, and ``sensor_token``, which ``sensor.json`` gives the name of:
  ``CAM_FRONT``.

The camera's axes are optical (x right, y down, z forward). The ego frame has x forward, y left, z up, and its origin on
the ground below the rear axle: ``ground=0`` (the lidar sees the road 2 cm above it). Pixel (0, 0) is read as the centre
of the first; the dataset does not say.

Images have 1600 x 900 pixels in nuScenes and nuImages; Lyft's 1224 x 1024 or 1920 x 1080, so there `image_size` must be
given. (Lyft's tokens have 64 digits, the others' 32.)
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, blame, describe, listed, rigid
from ipm_rs.calibration._files import Document, keys_missing, needs_size, open_document
from ipm_rs.calibration._lenswords import refuse_foreign
from ipm_rs.calibration._sections import choose
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "nuScenes"
KEYS = ("translation", "rotation", "camera_intrinsic", "sensor_token", "camera_distortion", "token")

_KEYS = ("translation", "rotation", "camera_intrinsic")
_LYFT_TOKEN_LENGTH = 64
_TABLE, _SENSORS = "calibrated_sensor.json", "sensor.json"


@np.errstate(all="ignore")  # what overflows is for the camera to refuse, not for NumPy to warn of
def read(
    source: str | os.PathLike[str] | Mapping[str, Any] | Sequence[Mapping[str, Any]],
    *,
    camera: str | None = None,
    image_size: Sequence[int] | None = None,
    sensors: str | os.PathLike[str] | Sequence[Mapping[str, Any]] | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera of nuScenes, Lyft Level 5 or nuImages.

    Parameters
    ----------
    source : path, sequence or mapping
        ``calibrated_sensor.json`` or its directory; or the table as a list of records; or one record; or a mapping of
        names to records.
    camera : str, optional
        Which record: its ``token`` (what ``sample_data`` calls ``calibrated_sensor_token``), the name of its sensor
        ("CAM_FRONT") or its ``sensor_token``. Over a whole dataset a name fits hundreds of records that differ, which
        is refused: a token is always right. Not needed for one record.
    image_size : (int, int), optional
        Width and height in pixels. 1600 x 900 if not given, except for Lyft, which has two sizes.
    sensors : path or sequence, optional
        ``sensor.json`` or its list of records, for names; if not given, the file of this name beside `source`.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        With a `BrownConrady` lens where the record has ``camera_distortion``.

    Raises
    ------
    MissingFileError, FileError
        A file is missing or cannot be read.
    CalibrationError
        A key is missing, or its numbers cannot be right; the record is of a lidar or radar; or Lyft's `image_size` was
        not given.
    ArgumentError, ArgumentTypeError
        `camera` fits no record, several that differ, or was not given for a table; an argument has the wrong type.
    """
    check_word("camera", camera)
    place = _record(source, camera, sensors)
    place.nearest = nearest_rotation
    place.require(*_KEYS)
    if _no_camera(place.content):
        raise CalibrationError(
            f"{place.where('camera_intrinsic')}: expected a 3x3 matrix, got an empty list, as lidars and radars have "
            "it; pass a camera's record"
        )
    K = place.matrix("camera_intrinsic", (3, 3), unit="pixels")
    R, t = place.quaternion("rotation", "wxyz"), place.numbers("translation", 3, unit="metres")
    lens = _lens(place)
    tokens = [place.content.get(key) for key in ("token", "sensor_token")]
    if image_size is None and any(isinstance(token, str) and len(token) == _LYFT_TOKEN_LENGTH for token in tokens):
        needs_size(image_size, place.origin, "Lyft's images are 1224x1024 or 1920x1080: take the image's")
    size = (1600, 900) if image_size is None else image_size
    return build(place.where(), K, image_size=size, vehicle_from_camera=rigid(R, t), lens=lens)


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format."""
    if document.is_directory:
        return None if (document.path / _TABLE).is_file() else f"no {_TABLE} in it"
    if document.is_json and isinstance(document.json, list):
        first = document.json[0] if document.json else None
        complete = isinstance(first, Mapping) and all(key in first for key in _KEYS)
        return None if complete else f"no list of records with {', '.join(_KEYS)}"
    if document.is_json and _by_name(document.json):
        return None
    return keys_missing(document, *_KEYS)


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    if document.is_directory:
        document = Document(str(document.path / _TABLE), TITLE)
    content = document.json
    if isinstance(content, Mapping):
        return list(_by_name(content))
    names = _names(None, document.path.with_name(_SENSORS))
    records = [Section(record, document.origin, f"[{index}]").content for index, record in enumerate(content)]
    found = [_name(record, names) or _text(record, "token") for record in records if not _no_camera(record)]
    return list(dict.fromkeys(name for name in found if name))


def _lens(place: Section) -> BrownConrady | None:
    """NuImages' ``camera_distortion``; an empty list is none."""
    if place.content.get("camera_distortion") is None:
        return None
    values = place.numbers("camera_distortion", (0, 4, 5, 6))
    if not len(values) or refuse_foreign(place.content, place.where(), bends=bool(values.any())):
        return None
    if len(values) == 6 and values[5] != 0:
        raise CalibrationError(
            f"{place.where('camera_distortion')}[5]: expected five coefficients k1 k2 p1 p2 k3, got a sixth, "
            f"{values[5]:g}; its fisheye model is not documented, build Camera(K, ..., lens=) with the right model"
        )
    with blame(place.where("camera_distortion")):
        return BrownConrady(values[:5])


def _record(source: Any, camera: Any, sensors: Any) -> Section:
    """One record of the table."""
    origin, content, names_file = f"{TITLE} calibration", source, None
    if not isinstance(source, (Mapping, list, tuple)):
        document = open_document(source, TITLE, or_mapping=True)
        if document.is_directory:
            document = Document(str(document.path / _TABLE), TITLE)
        names_file = document.path.with_name(_SENSORS) if document.path.name else None
        origin, content = document.origin, document.json
    if camera is not None and not isinstance(camera, str):
        raise ArgumentTypeError(f"camera: expected a token or a name, got {describe(camera)}; pass text: 'CAM_FRONT'")
    if isinstance(content, Mapping) and (records := _by_name(content)):
        name = choose(records, camera, origin)
        return Section(records[name], origin, name)
    if isinstance(content, Mapping):
        if camera is not None and camera not in (_text(content, "token"), _text(content, "sensor_token")):
            raise ArgumentError(f"camera: expected none for one record, got {camera!r}; drop it")
        return Section(content, origin)
    if not isinstance(content, (list, tuple)):
        raise CalibrationError(f"{origin}: expected a list of records, got {describe(content)}; pass {_TABLE}")
    return _choose(content, origin, camera, _names(sensors, names_file))


def _choose(records: Sequence[Any], origin: str, camera: str | None, names: Mapping[Any, str]) -> Section:
    """Find the record of a table that `camera` means, or its only camera."""
    for index, record in enumerate(records):
        Section(record, origin, f"[{index}]")
    if camera is None:
        found = [index for index, record in enumerate(records) if not _no_camera(record)]
    else:
        found = [index for index, record in enumerate(records) if _text(record, "token") == camera]
        found = found or [
            index
            for index, record in enumerate(records)
            if camera in (_text(record, "sensor_token"), _name(record, names))
        ]
    different = {repr([records[index].get(key) for key in (*_KEYS, "camera_distortion")]) for index in found}
    if len(different) == 1:
        return Section(records[found[0]], origin, f"[{found[0]}]")
    choice = sorted(
        {_name(record, names) or _text(record, "token") or "?" for record in records if not _no_camera(record)}
    )
    if found and camera is not None:
        raise ArgumentError(
            f"camera: expected one calibration, got {camera!r}, which {origin} has {len(different)} of; pass the "
            "calibrated_sensor_token of the image's sample_data record"
        )
    got = "none" if camera is None else f"{camera!r}, which {origin} has no record of"
    raise ArgumentError(
        f"camera: expected a token, or a sensor's name if {_SENSORS} is there, got {got}; pass one of {listed(choice)}"
    )


def _name(record: Mapping[str, Any], names: Mapping[Any, str]) -> str | None:
    return names.get(_text(record, "sensor_token") or "")


def _text(record: Mapping[str, Any], key: str) -> str | None:
    value = record.get(key)
    return value if isinstance(value, str) else None


def _no_camera(record: Mapping[str, Any]) -> bool:
    K = record.get("camera_intrinsic")
    return isinstance(K, (list, tuple)) and not K


def _by_name(content: Any) -> dict[str, Any]:
    """Return the cameras of a mapping of names to records; empty where it is something else."""
    if not isinstance(content, Mapping) or any(key in content for key in _KEYS):
        return {}
    found = {str(key): value for key, value in content.items() if isinstance(value, Mapping)}
    return {
        name: value for name, value in found.items() if all(key in value for key in _KEYS) and not _no_camera(value)
    }


def _names(sensors: Any, beside: Path | None) -> dict[str, str]:
    """Names of the sensors by token."""
    origin, content = "sensors", sensors
    if sensors is None:
        if beside is None or not beside.is_file():
            return {}
        sensors = str(beside)
    if not isinstance(sensors, (list, tuple)):
        document = open_document(sensors, TITLE, argument="sensors")
        origin, content = document.origin, document.json
    if not isinstance(content, (list, tuple)):
        raise CalibrationError(f"{origin}: expected a list of records, got {describe(content)}; pass {_SENSORS}")
    places = [Section(record, origin, f"[{index}]") for index, record in enumerate(content)]
    return {place.text("token"): place.text("channel") for place in places}
