"""ONCE (One millioN sCenEs): ``<sequence>.json``, its key ``calib``.

The format, after the data set's documentation and its development kit:

* ``calib``: for each camera (``cam01``, ``cam03``, ``cam05`` to ``cam09``) ``cam_intrinsic`` (3x3, pixels),
  ``cam_to_velo`` (4x4) and ``distortion`` (k1, k2, p1, p2, k3 of OpenCV).
* ``cam_to_velo`` takes points of the camera (optical axes: x right, y down, z forward) to the lidar. The lidar's x
  points to the **left**, y to the **back**, z up; it is turned here, so that the vehicle frame has x forward, y left, z
  up.
* The origin stays the lidar's, on the roof: ``ground=`` is minus its height above the road, which the data set does not
  state. Measure it in a point cloud.
* There is no image size: 1920 x 1020. The data set does not say where a pixel's centre is; (0, 0) is read as the centre
  of the first, as OpenCV, through which its kit undistorts, has it.
* **Whether the published images are distorted** its documents do not agree on: the documentation says that distortions
  are removed, the kit undistorts what it loads. ``image=`` says which yours are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import FLU_FROM_LEFT_BACK_UP, brown, one_of, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section
from ipm_rs.calibration._files import Document, Source, keys_missing, needs_size, read_json

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "ONCE"
KEYS = ("calib", "cam_to_velo", "cam_intrinsic", "distortion", "meta_info", "frames")

_PARTS = ("cam_to_velo", "cam_intrinsic")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = keys_missing(document)
    return lacks or (None if _entries(document.json) else "no key 'calib' of cameras with 'cam_to_velo'")


def cameras(document: Document) -> list[str]:
    """Names of the cameras, as ``camera=`` takes them."""
    return list(_entries(document.json))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    image: Literal["raw", "undistorted"] = "raw",
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of a sequence of ONCE.

    Parameters
    ----------
    source : str, path or mapping
        ``<sequence>.json``, its content, or what it holds under ``calib``.
    camera : str, optional
        Its name, "cam01" (front) to "cam09"; needed if there is more than one.
    image_size : (int, int)
        Width and height in pixels, which the format does not state; (1920, 1020).
    image : {"raw", "undistorted"}
        Whether the images that will be warped are as the camera gave them, or went through ``undistort_image`` of the
        kit, which keeps the camera matrix.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        In the lidar's frame, turned to x forward, y left, z up.

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
    one_of("image", image, ("raw", "undistorted"), "say which images will be warped")
    content = read_json(source, TITLE)
    entries = _entries(content.content)
    if not entries:
        content.section("calib").require("cam01")
    names = list(entries)
    name = names[pick(names, camera, content.origin)]
    path = f"calib.{name}" if "calib" in content else name
    place = Section(entries[name], content.origin, path, nearest=nearest_rotation)
    place.require(*_PARTS, *(("distortion",) if image == "raw" else ()))
    size = needs_size(image_size, content.origin, "ONCE's images are 1920x1020: take the image's")
    K = place.matrix("cam_intrinsic", (3, 3), unit="pixels")
    lens = brown(place.value("distortion"), place.where("distortion")) if image == "raw" else None
    pose = FLU_FROM_LEFT_BACK_UP @ place.pose("cam_to_velo")
    return build(place.where(), K, image_size=size, vehicle_from_camera=pose, lens=lens)


def _entries(content: Mapping[Any, Any]) -> dict[str, Any]:
    """Each camera's calibration by its name."""
    content = content.get("calib", content)
    if not isinstance(content, Mapping):
        return {}
    return {
        str(name): entry
        for name, entry in content.items()
        if isinstance(entry, Mapping) and all(part in entry for part in _PARTS)
    }
