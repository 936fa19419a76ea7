"""Waymo Open Dataset: the fields of ``CameraCalibration``, as mappings or JSON.

* ``intrinsic``: ``f_u f_v c_u c_v k1 k2 p1 p2 k3``, pixels, Brown-Conrady as OpenCV defines it.
* ``extrinsic``: ``transform``, a 4x4 matrix row by row (16 numbers), camera to vehicle, metres.
* ``width``, ``height`` in pixels; ``name``: 1 FRONT, 2 FRONT_LEFT, 3 FRONT_RIGHT, 4 SIDE_LEFT, 5 SIDE_RIGHT.

The camera's own axes are x out of the lens, y left, z up; the change to optical ones is made here. The vehicle frame
has x forward, y left, z up. Its height over the road is not documented: ``ground=0`` is within some decimetres, the
bottoms of labelled boxes gave -0.15 in one frame. Pixel (0, 0) is read as the centre of the first; the dataset does not
say. The rolling shutter (some tenths of a pixel) is not modelled.

The dataset's files are TensorFlow records, which this package does not read: convert the calibration with
``google.protobuf.json_format.MessageToDict(calibration)`` (or ``frame.context``, which has ``cameraCalibrations``),
pass the ``CameraCalibration`` message itself, or
give a row of the ``camera_calibration`` parquet table, whose column names begin with ``[CameraCalibrationComponent].``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import OPTICAL_FROM_FLU, Section, blame, describe, listed, pinhole, pose, rigid
from ipm_rs.calibration._files import Document, open_document
from ipm_rs.calibration._lenswords import refuse_foreign
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "Waymo"
KEYS = ("intrinsic", "extrinsic", "width", "height", "cameraCalibrations", "camera_calibrations", "transform")

_NAMES = ("UNKNOWN", "FRONT", "FRONT_LEFT", "FRONT_RIGHT", "SIDE_LEFT", "SIDE_RIGHT")
_LISTS = ("cameraCalibrations", "camera_calibrations")
_PREFIX = "[CameraCalibrationComponent]."
_COLUMNS = ("f_u", "f_v", "c_u", "c_v", "k1", "k2", "p1", "p2", "k3")
_NAME_COLUMN = "key.camera_name"


@np.errstate(all="ignore")  # what overflows is for the camera to refuse, not for NumPy to warn of
def read(source: Any, *, camera: str | int | None = None, nearest_rotation: bool = False) -> Camera:
    """Read a camera of the Waymo Open Dataset.

    Parameters
    ----------
    source : path, mapping, sequence or message
        A JSON file or its content: one calibration, a list of them, or a context with ``cameraCalibrations``; or a
        ``CameraCalibration`` message, or a list of these.
    camera : str or int, optional
        The name, "FRONT", or its number; not needed for one calibration.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        With a `BrownConrady` lens; its image size is the record's.

    Raises
    ------
    MissingFileError, FileError
        The file cannot be read.
    CalibrationError
        A field is missing, or its numbers cannot be right.
    ArgumentError, ArgumentTypeError
        There is no such camera, or it was not given for several; an argument has the wrong type.
    """
    check_word("camera", camera)
    place = _plain(_choose(source, camera))
    place.nearest = nearest_rotation
    place.require("intrinsic", "extrinsic", "width", "height")
    where = place.where("intrinsic")
    f_u, f_v, c_u, c_v, *terms = (float(value) for value in place.numbers("intrinsic", 9))
    for value, key in ((f_u, "f_u"), (f_v, "f_v")):
        if value <= 0:
            raise CalibrationError(
                f"{where}: expected a positive focal length {key}, got {value:g}; correct it, in pixels"
            )
    extrinsic = place.value("extrinsic")
    vehicle_from_sensor = (
        place.section("extrinsic").pose("transform")
        if isinstance(extrinsic, Mapping)
        else pose(extrinsic, place.where("extrinsic"), nearest=nearest_rotation)
    )
    if refuse_foreign(place.content, place.where(), bends=any(terms)):
        terms = [0.0] * 5
    with blame(place.where()):
        lens = BrownConrady(terms)
    return build(
        where,
        pinhole(f_u, f_v, c_u, c_v),
        image_size=place.image_size("width", "height"),
        vehicle_from_camera=vehicle_from_sensor @ rigid(OPTICAL_FROM_FLU.T, (0.0, 0.0, 0.0)),
        lens=lens,
    )


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format."""
    if not document.is_json:
        return "not JSON"
    content = document.json
    if isinstance(content, Mapping):
        content = next((content[key] for key in _LISTS if key in content), content)
    if isinstance(content, list):
        content = content[0] if content else {}
    if not isinstance(content, Mapping):
        return "no JSON object"
    if f"{_PREFIX}intrinsic.f_u" in content:
        return None
    lacks = [repr(key) for key in ("intrinsic", "extrinsic", "width", "height") if key not in content]
    if not lacks:
        values = content["intrinsic"]
        if not isinstance(values, list) or any(isinstance(value, (list, dict)) for value in values):
            return "no list f_u f_v c_u c_v k1 k2 p1 p2 k3 under 'intrinsic'"
        if len(values) == 9 and values[1] == values[3] == values[6] == values[7] == 0:
            return "a 3x3 matrix under 'intrinsic'"
    return f"no key {', '.join(lacks)}" if lacks else None


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    content, path = document.json, ""
    if isinstance(content, Mapping):
        path = next((key for key in _LISTS if key in content), "")
        content = content[path] if path else []
    places = [Section(value, document.origin, f"{path}[{index}]") for index, value in enumerate(content)]
    return [name for place in places if (name := _name(place))]


def _choose(source: Any, camera: Any) -> Section:
    """One calibration among those of the source."""
    if camera is not None and (isinstance(camera, bool) or not isinstance(camera, (str, int))):
        raise ArgumentTypeError(f"camera: expected a name or a number, got {describe(camera)}; pass 'FRONT'")
    origin, content = f"{TITLE} calibration", _message(source)
    if isinstance(content, (list, tuple)):
        content = [_message(value) for value in content]
    if not isinstance(content, (Mapping, list, tuple)):
        document = open_document(source, TITLE, or_mapping=True)
        origin, content = document.origin, document.json
    path = ""
    if isinstance(content, Mapping):
        path = next((key for key in _LISTS if key in content), "")
        content = content[path] if path else [content]
    if not isinstance(content, (list, tuple)):
        raise CalibrationError(
            f"{origin}: expected a calibration or a list, got {describe(content)}; see the docs of waymo"
        )
    one = len(content) == 1
    places = [Section(value, origin, path if one else f"{path}[{index}]") for index, value in enumerate(content)]
    if camera is None and one:
        return places[0]
    names = [_name(place) for place in places]
    wanted = _NAMES[camera] if isinstance(camera, int) and 0 <= camera < len(_NAMES) else camera
    found = [place for place, name in zip(places, names, strict=True) if camera is not None and name == wanted]
    if len(found) != 1:
        got = "none" if camera is None else f"{camera!r}" + (f", which {len(found)} have" if found else "")
        raise ArgumentError(
            f"camera: expected one of {origin}, got {got}; pass one of {listed(name or '?' for name in names)}"
        )
    return found[0]


def _message(source: Any) -> Any:
    """Fields of a protobuf message; anything else as it is."""
    fields = ("name", "intrinsic", "extrinsic", "width", "height")
    if isinstance(source, Mapping) or not all(hasattr(source, field) for field in fields):
        return source
    try:
        intrinsic, transform = list(source.intrinsic), list(source.extrinsic.transform)
    except (AttributeError, TypeError) as error:
        raise ArgumentTypeError(
            f"source: expected a CameraCalibration message, got {type(source).__name__} whose fields differ ({error}); "
            "pass its fields as a mapping"
        ) from error
    plain = {field: getattr(source, field) for field in ("name", "width", "height")}
    return {**plain, "intrinsic": intrinsic, "extrinsic": {"transform": transform}}


def _name(place: Section) -> str | None:
    """Return a calibration's name; numbers become names."""
    value = place.content.get("name", place.content.get(_NAME_COLUMN))
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < len(_NAMES):
        return _NAMES[value]
    return value if isinstance(value, str) else None


def _plain(place: Section) -> Section:
    """Turn a row of the parquet table into the plain fields."""
    if f"{_PREFIX}intrinsic.f_u" not in place:
        return place
    keys = [f"{_PREFIX}intrinsic.{name}" for name in _COLUMNS]
    others = {key: f"{_PREFIX}{key}" for key in ("extrinsic.transform", "width", "height")}
    place.require(*keys, *others.values())
    content = {
        "intrinsic": [place.number(key) for key in keys],
        "extrinsic": {"transform": place.value(others["extrinsic.transform"])},
        "width": place.value(others["width"]),
        "height": place.value(others["height"]),
    }
    return Section(content, place.origin, place.path)
