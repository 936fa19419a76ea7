"""Argoverse 1 (tracking and forecasting logs): ``vehicle_calibration_info.json``.

The format, after argoverse-api's ``calibration.py`` and its maintainers' answers:

* ``camera_data_``: a list of ``key`` ("image_raw_ring_front_center") and ``value``:
  ``focal_length_x_px_, focal_length_y_px_, focal_center_x_px_, focal_center_y_px_, skew_``.
* ``distortion_coefficients_`` (k1, k2, k3) are **not** applied: all published images are undistorted already
  (argoverse-api issue 81).
* ``vehicle_SE3_camera_``: ``rotation.coefficients``, a quaternion **w x y z**, and ``translation`` in metres: camera
  (optical axes) to the ego vehicle, x forward, y left, z up, its origin at the rear axle.

It has no image size: ring cameras are 1920 x 1200, the stereo pair 2464 x 2056. The road lies below the origin: in
Argoverse 2, of the same kind of car, ``ground=-0.33``; for this data set it is not stated. That pixel (0, 0) is read as
the centre of the first is assumed; the data set does not say.
"""

from __future__ import annotations

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, pinhole, rigid
from ipm_rs.calibration._files import Document, Source, keys_missing, needs_size, read_json

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "Argoverse 1"
KEYS = (
    "camera_data_", "vehicle_SE3_camera_", "focal_length_x_px_", "focal_center_x_px_", "distortion_coefficients_",
    "vehicle_SE3_up_lidar_", "vehicle_SE3_down_lidar_",
)  # fmt: skip

_PREFIX = "image_raw_"


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = keys_missing(document, "camera_data_")
    return lacks or (None if isinstance(document.json["camera_data_"], list) else "no list 'camera_data_'")


def cameras(document: Document) -> list[str]:
    """Names of the cameras, as ``camera=`` takes them."""
    return [_name(entry) for entry in read_json(document, TITLE).sections("camera_data_")]


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of an Argoverse 1 log.

    Parameters
    ----------
    source : str, path or mapping
        ``vehicle_calibration_info.json``, or its content as a mapping.
    camera : str, optional
        Its name, "ring_front_center", with or without ``image_raw_``; needed if there is more than one.
    image_size : (int, int)
        Width and height in pixels, which the file does not state: (1920, 1200) for the ring, (2464, 2056) for stereo.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Of the undistorted images, in the ego vehicle's frame.

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
    entries = content.sections("camera_data_")
    word = camera.removeprefix(_PREFIX) if isinstance(camera, str) else camera
    place = entries[pick([_name(entry) for entry in entries], word, content.origin)].section("value")
    size = needs_size(image_size, content.origin, "ring images are 1920x1200, stereo 2464x2056: take the image's")
    focal = [f"focal_{part}_{axis}_px_" for part in ("length", "center") for axis in "xy"]
    place.require(*focal, "vehicle_SE3_camera_")
    fx, fy, cx, cy = (place.number(key, unit="pixels") for key in focal)
    K = pinhole(fx, fy, cx, cy, place.number("skew_") if "skew_" in place else 0.0)
    pose = place.section("vehicle_SE3_camera_")
    R = pose.section("rotation").quaternion("coefficients", "wxyz")
    vehicle_from_camera = rigid(R, pose.numbers("translation", 3, unit="metres"))
    return build(place.where(), K, image_size=size, vehicle_from_camera=vehicle_from_camera)


def _name(entry: Section) -> str:
    return entry.text("key").removeprefix(_PREFIX)
