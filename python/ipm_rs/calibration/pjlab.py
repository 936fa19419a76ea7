"""SensorsCalibration (PJLab-ADG): ``<camera>-intrinsic.json``, with ``<lidar>-to-<camera>-extrinsic.json``.

The format, after the toolbox's code:

* The intrinsic file has one key, and under it ``param``: ``img_dist_w``, ``img_dist_h``, ``cam_K`` and ``cam_dist``
  (``rows``, ``cols``, ``data``: rows of numbers). ``cam_dist`` is OpenCV's k1, k2, p1, p2[, k3]. Where ``data`` has
  more numbers than ``cols`` says (a file of theirs has KITTI's five and says four) all are read. Pixel (0, 0) is a
  pixel's centre, as OpenCV, through which the tools undistort, has it.
* The extrinsic file has ``param.sensor_calib``, 4x4: points of ``sensor_name`` to ``target_sensor_name``, metres:
  ``x_camera = R x_lidar + t``, the camera's axes optical (x right, y down, z forward).
* The lidar's frame (x forward, y left, z up in their examples) is the vehicle frame, and ``ground=`` is minus the
  lidar's height. Without an extrinsic file the camera is at the origin and looks along +x.
* A file from a camera to something else (``car_center``) is the camera's pose there, with the axes that it has.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import brown
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, inverse, pose
from ipm_rs.calibration._files import Document, Source, keys_missing, read_json, same_size
from ipm_rs.calibration._mount import mounted
from ipm_rs.calibration._opencvlens import flat
from ipm_rs.calibration._plain import has
from ipm_rs.errors import CalibrationError

__all__ = ["KEYS", "TITLE", "missing", "read"]

TITLE = "SensorsCalibration"
KEYS = (
    "param", "img_dist_w", "img_dist_h", "cam_K", "cam_dist", "sensor_name", "target_sensor_name", "sensor_calib",
    "device_type", "param_type",
)  # fmt: skip


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = keys_missing(document)
    if lacks:
        return lacks
    entries = list(document.json.values())
    if len(entries) != 1 or not has(entries[0], "param") or not has(entries[0]["param"], "cam_K"):
        return "no one section with 'param.cam_K'"
    return None


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    extrinsic: Source | None = None,
    image_size: tuple[int, int] | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera of SensorsCalibration.

    Parameters
    ----------
    source : str, path or mapping
        The intrinsic JSON file, or its content as a mapping.
    extrinsic : str, path or mapping, optional
        The extrinsic file to or from this camera; it names both.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        In the frame of the other sensor; without `extrinsic` at the origin, looking along +x.

    Raises
    ------
    MissingFileError, FileError
        A file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the extrinsic file is of another camera.
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    """
    entry = _only(read_json(source, TITLE))
    place = entry.section("param")
    place.require("img_dist_w", "img_dist_h", "cam_K", "cam_dist")
    size = place.image_size("img_dist_w", "img_dist_h")
    same_size(image_size, size, place.origin)
    K = place.section("cam_K").matrix("data", (3, 3), unit="pixels")
    lens = brown(flat(place.section("cam_dist").value("data")), place.where("cam_dist"))
    if extrinsic is None:
        T = mounted(None, None)
    else:
        T = _camera_from(_only(read_json(extrinsic, TITLE)), entry.text("sensor_name"), nearest=nearest_rotation)
    return build(place.where(), K, image_size=size, camera_from_vehicle=T, lens=lens)


def _only(content: Section) -> Section:
    names = list(content.content)
    if len(names) != 1:
        raise CalibrationError(f"{content.origin}: expected one section, got {len(names)}; pass a file of one sensor")
    return content.section(str(names[0])) if isinstance(names[0], str) else Section(None, content.origin)


def _camera_from(entry: Section, camera: str, *, nearest: bool) -> Any:
    """``camera_from_sensor`` of an extrinsic file, whichever way round it is."""
    source, target = entry.text("sensor_name"), entry.text("target_sensor_name")
    if camera not in (source, target):
        raise CalibrationError(
            f"{entry.where()}: expected one from or to {camera!r:.60}, got {source!r:.60} to {target!r:.60}; pass the "
            "file of this camera"
        )
    place = entry.section("param").section("sensor_calib")
    T = pose(place.value("data"), place.where("data"), nearest=nearest)
    return T if target == camera else inverse(T)
