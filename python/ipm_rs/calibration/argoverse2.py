"""Argoverse 2: a log's directory ``calibration`` with ``intrinsics.feather`` and ``egovehicle_SE3_sensor.feather``.

* ``intrinsics.feather``: a row for each ``sensor_name``: ``fx_px, fy_px, cx_px, cy_px``, ``width_px, height_px``, and
  ``k1, k2, k3``, which are **not used**: all images come undistorted, and the dataset's own code uses K alone.
* ``egovehicle_SE3_sensor.feather``: ``qw qx qy qz`` (that order) and ``tx_m ty_m tz_m``, camera to ego vehicle.

Metres and pixels. The camera's axes are optical (x right, y down, z forward). The ego frame has x forward, y left, z up
and its origin at the height of the rear axle, so the road is **not** z = 0: ``ground=-0.33`` (fitted to a log's lidar
points; with 0, every distance comes out a fifth short). Pixel (0, 0) is read as the centre of the first; the dataset
does not say. The front camera's image is portrait, 1550 x 2048, the other ring cameras' 2048 x 1550.

Feather files are read through pyarrow (extra ``arrow``); rows given as mappings need nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, describe, listed, pinhole, quaternion, rigid
from ipm_rs.calibration._files import Document, Source, open_document
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError, MissingExtraError

__all__ = ["GROUND", "KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "Argoverse 2"
KEYS = ("fx_px", "fy_px", "cx_px", "cy_px", "width_px", "height_px", "sensor_name", "tx_m", "ty_m", "tz_m")

GROUND = -0.33
"""Height of the road in the vehicle frame in metres, fitted to laser points."""

_INTRINSICS, _POSES = "intrinsics", "egovehicle_SE3_sensor"
_NUMBERS = ("fx_px", "fy_px", "cx_px", "cy_px", "width_px", "height_px")
_MAX_BYTES, _MAX_ROWS = 1 << 20, 1000  # the dataset's have 4 kB and 11 rows
_POSE = ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")


@np.errstate(all="ignore")  # what overflows is for the camera to refuse, not for NumPy to warn of
def read(source: Source, *, camera: str = "ring_front_center", nearest_rotation: bool = False) -> Camera:
    """Read a camera of an Argoverse 2 log.

    Parameters
    ----------
    source : str, path or mapping
        The log's directory, or the directory ``calibration`` in it, or one of the two files (the other is beside it);
        or a mapping of "intrinsics" and "egovehicle_SE3_sensor" to their rows, a list of mappings each; or one mapping
        with the columns of both files for one camera.
    camera : str
        The ``sensor_name``; not needed where there is one row.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        A pinhole; its image size is the file's. The road is at ``ground=-0.33``.

    Raises
    ------
    MissingFileError, FileError
        A file is missing or cannot be read.
    CalibrationError
        A column is missing, or its numbers cannot be right.
    ArgumentError, ArgumentTypeError
        There is no such camera, or an argument has the wrong type.
    MissingExtraError
        pyarrow is not installed.
    """
    check_word("camera", camera)
    if not isinstance(camera, str):
        raise ArgumentTypeError(f"camera: expected a sensor_name, got {describe(camera)}; pass 'ring_front_center'")
    intrinsics, pose = _rows(source, camera)
    intrinsics.require(*_NUMBERS)
    pose.require(*_POSE)
    fx, fy = (intrinsics.number(key, unit="pixels", positive=True) for key in _NUMBERS[:2])
    cx, cy = (intrinsics.number(key, unit="pixels") for key in _NUMBERS[2:4])
    R = quaternion([pose.value(key) for key in _POSE[:4]], pose.where("qw qx qy qz"), "wxyz", nearest=nearest_rotation)
    t = [pose.number(key, unit="metres") for key in _POSE[4:]]
    return build(
        intrinsics.where(),
        pinhole(fx, fy, cx, cy),
        image_size=intrinsics.image_size("width_px", "height_px"),
        vehicle_from_camera=rigid(R, t),
    )


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format."""
    directory = _directory(document)
    lacks = [f"{name}.feather" for name in (_INTRINSICS, _POSES) if not (directory / f"{name}.feather").is_file()]
    if lacks:
        return f"no {' and no '.join(lacks)} {'in' if document.is_directory else 'beside'} it"
    if not document.is_directory and document.path.stem not in (_INTRINSICS, _POSES):
        return "another file's name"
    return None


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    path = str(_directory(document) / f"{_INTRINSICS}.feather")
    return [Section(row, path, f"[{index}]").text("sensor_name") for index, row in enumerate(_feather(path))]


def _directory(document: Document) -> Path:
    if not document.is_directory:
        return document.path.parent
    inner = document.path / "calibration"
    return inner if inner.is_dir() else document.path


def _rows(source: Any, camera: str) -> tuple[Section, Section]:
    """Return the camera's row of each table."""
    if isinstance(source, Mapping):
        place = Section(source, f"{TITLE} calibration")
        if _INTRINSICS not in place and _POSES not in place:
            return place, place
        tables = [(place.value(name), place.where(name)) for name in (_INTRINSICS, _POSES)]
    else:
        document = open_document(source, TITLE, or_mapping=True)
        if not document.is_directory:
            _ = document.data  # what is wrong with the path comes before what is wrong beside it
        paths = [str(_directory(document) / f"{name}.feather") for name in (_INTRINSICS, _POSES)]
        tables = [(_feather(path), path) for path in paths]
    first, second = (_row(rows, origin, camera) for rows, origin in tables)
    return first, second


def _row(rows: Any, origin: str, camera: str) -> Section:
    if isinstance(rows, Mapping):
        rows = [rows]
    if not isinstance(rows, Sequence) or isinstance(rows, str):
        raise CalibrationError(
            f"{origin}: expected a list of rows, got {describe(rows)}; give one mapping for each sensor"
        )
    places = [Section(row, origin, f"[{index}]") for index, row in enumerate(rows)]
    if len(places) == 1 and "sensor_name" not in places[0]:
        return places[0]
    named = [place for place in places if place.text("sensor_name") == camera]
    if len(named) == 1:
        return named[0]
    names = [place.text("sensor_name") for place in places]
    if named:
        raise CalibrationError(f"{origin}: expected one row for {camera!r}, got {len(named)}; keep one")
    raise ArgumentError(f"camera: expected a sensor of {origin}, got {camera!r}; pass one of {listed(names)}")


def _feather(path: str) -> list[dict[str, Any]]:
    """Rows of a feather file."""
    document = Document(path, TITLE)
    data = document.data  # bounded, and with our errors
    if len(data) > _MAX_BYTES:
        raise CalibrationError(
            f"{path}: expected a table of a few sensors, got {len(data)} bytes; pass the log's directory calibration"
        )
    try:
        from pyarrow import BufferReader, ipc
    except ImportError as error:
        raise MissingExtraError(
            f"{path}: expected pyarrow to read feather files, found none; pip install 'ipm-rs[arrow]', or pass the "
            "rows as mappings"
        ) from error
    try:
        table = ipc.open_file(BufferReader(data)).read_all()
        table.validate(full=True)  # what a damaged file says of its lengths must not reach the memory behind it
        if table.num_rows > _MAX_ROWS:
            raise ValueError(f"{table.num_rows} rows")
        rows: list[dict[str, Any]] = table.to_pylist()
    except Exception as error:  # damaged files make pyarrow raise ArrowInvalid, OSError, KeyError, MemoryError, ...
        raise CalibrationError(
            f"{path}: expected a feather file, got: {str(error)[:200]}; it may be cut short, fetch it again"
        ) from error
    return rows
