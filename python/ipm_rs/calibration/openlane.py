"""OpenLane (V1, on Waymo) and OpenLane-V2 (on Argoverse 2 and nuScenes): the JSON of a frame.

The format, after the data sets' documentation and kits:

* V1, ``<timestamp>.json``: ``intrinsic`` (3x3, pixels) and ``extrinsic`` (4x4) of the one front camera, beside
  ``lane_lines``. ``extrinsic`` takes points of Waymo's camera axes (x **forward, y left, z up**) to Waymo's vehicle
  frame, of the same axes, in metres. Its road is about ``ground=0``. The images are Waymo's own, whose slight
  distortion is not in the file.
* V2, ``info/<timestamp>.json``: ``sensor``, for each camera ``extrinsic`` {``rotation`` 3x3, ``translation``} from the
  camera's optical axes (x right, y down, z forward) to the vehicle, and ``intrinsic`` {``K``, ``distortion``}. The kit
  projects by K alone, and so does this reader. The vehicle frame is that of the source: ``ground=-0.33`` for
  Argoverse 2, 0 for nuScenes.
* Neither holds an image size: 1920 x 1280 (V1); 2048 x 1550, with 1550 x 2048 for ``ring_front_center``, or 1600 x 900
  (V2). Neither says where a pixel's centre is; (0, 0) is read as the centre of the first.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import FLU_FROM_CAMERA_AXES, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, rigid
from ipm_rs.calibration._files import Document, Source, keys_missing, needs_size, read_json
from ipm_rs.calibration._plain import has
from ipm_rs.errors import ArgumentError

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "OpenLane"
KEYS = ("lane_lines", "extrinsic", "intrinsic", "file_path", "sensor", "segment_id", "meta_data", "image_path")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = keys_missing(document, "lane_lines", "extrinsic", "intrinsic")
    if lacks and not (keys_missing(document, "sensor") is None and _sensors(document.json)):
        return lacks
    return None


def cameras(document: Document) -> list[str]:
    """Names of V2's cameras, as ``camera=`` takes them; none for V1."""
    return [] if "lane_lines" in document.json else list(_sensors(document.json))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read the camera of a frame of OpenLane, or one of OpenLane-V2.

    Parameters
    ----------
    source : str, path or mapping
        The frame's JSON file, or its content as a mapping.
    camera : str, optional
        Its name in V2, "ring_front_center", "CAM_FRONT"; needed if there is more than one. V1 has one.
    image_size : (int, int)
        Width and height in pixels, which the formats do not state; V1's are (1920, 1280).
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        A pinhole in the vehicle frame of the data set that OpenLane labels.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or `image_size` was not given.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    """
    check_word("camera", camera)
    content = read_json(source, TITLE)
    content.nearest = nearest_rotation
    if "sensor" in content and "lane_lines" not in content:
        return _read_v2(content, camera, image_size)
    if camera is not None:
        raise ArgumentError(f"{content.origin}: camera: expected none, the file holds one, got {camera!r:.60}; drop it")
    content.require("extrinsic", "intrinsic")
    size = needs_size(image_size, content.origin, "OpenLane's images are 1920x1280: take the image's")
    K = content.matrix("intrinsic", (3, 3), unit="pixels")
    pose = content.pose("extrinsic") @ FLU_FROM_CAMERA_AXES
    return build(content.where("intrinsic"), K, image_size=size, vehicle_from_camera=pose)


def _read_v2(content: Section, camera: str | None, image_size: Any) -> Camera:
    sensors = list(_sensors(content.content)) or list(content.section("sensor").content)
    names = [str(name) for name in sensors]
    place = content.section("sensor").section(names[pick(names, camera, content.origin)])
    extrinsic, intrinsic = place.section("extrinsic"), place.section("intrinsic")
    extrinsic.require("rotation", "translation")
    hint = "2048x1550, 1550x2048 for ring_front_center, or 1600x900 for nuScenes: take the image's"
    size = needs_size(image_size, content.origin, hint)
    K = intrinsic.matrix("K", (3, 3), unit="pixels")
    pose = rigid(extrinsic.rotation("rotation"), extrinsic.numbers("translation", 3, unit="metres"))
    return build(place.where(), K, image_size=size, vehicle_from_camera=pose)


def _sensors(content: Mapping[Any, Any]) -> dict[str, Any]:
    sensors = content.get("sensor")
    if not isinstance(sensors, Mapping):
        return {}
    return {
        str(name): sensor
        for name, sensor in sensors.items()
        if has(sensor, "extrinsic", "intrinsic") and has(sensor["intrinsic"], "K")
    }
