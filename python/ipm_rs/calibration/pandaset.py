"""PandaSet: ``static_extrinsic_calibration.yaml`` of its development kit, which has every camera.

The format, by its own numbers (where each camera stands and looks) beside the kit's code:

* For each sensor ``intrinsic`` {``K``: nine numbers row by row, ``D``: k1, k2, p1, p2, k3 of OpenCV} and ``extrinsic``
  {``transform``: {``rotation``: w, x, y, z by name, ``translation``: x, y, z in metres}}, which takes points of the
  main lidar (``main_pandar64``) to the camera's optical axes (x right, y down, z forward).
* The lidar's x points to the **left**, y to the **back**, z up: its front camera looks along -y, the left one along +x.
  It is turned here, so that the vehicle frame has x forward, y left, z up. The origin stays the lidar's, on the roof:
  ``ground=`` is minus its height above the road, which the kit does not state.
* ``camera/<name>/intrinsics.json`` of a sequence repeats fx, fy, cx, cy without the lens; its ``poses.json`` are in a
  world frame, and are not needed here.
* There is no image size: 1920 x 1080. It is not said where a pixel's centre is; (0, 0) is read as the centre of the
  first. The kit's ``projection`` leaves ``D`` out.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import FLU_FROM_LEFT_BACK_UP, brown, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, inverse, quaternion, rigid
from ipm_rs.calibration._files import Document, Source, needs_size
from ipm_rs.calibration._plain import has, plain_section, tree_missing

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "PandaSet"
KEYS = ("main_pandar64", "front_camera", "back_camera", "extrinsic", "transform", "intrinsic", "front_gt")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = tree_missing(document)
    return lacks or (None if _entries(document.tree) else "no camera with 'intrinsic.K' and 'extrinsic.transform'")


def cameras(document: Document) -> list[str]:
    """Names of the cameras, as ``camera=`` takes them."""
    return list(_entries(document.tree))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of PandaSet.

    Parameters
    ----------
    source : str, path or mapping
        ``static_extrinsic_calibration.yaml`` (needs the extra ``yaml``), or its content as a mapping.
    camera : str, optional
        Its name, "front_camera"; needed if there is more than one.
    image_size : (int, int)
        Width and height in pixels, which the format does not state; (1920, 1080).
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        In the main lidar's frame, turned to x forward, y left, z up.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or `image_size` was not given.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    MissingExtraError
        PyYAML is not installed.
    """
    check_word("camera", camera)
    content = plain_section(source, TITLE)
    content.nearest = nearest_rotation
    names = list(_entries(content.content))
    if not names:
        content.section("front_camera").require("intrinsic", "extrinsic")
    place = content.section(names[pick(names, camera, content.origin)])
    size = needs_size(image_size, content.origin, "PandaSet's images are 1920x1080: take the image's")
    intrinsic = place.section("intrinsic")
    K, lens = intrinsic.matrix("K", (3, 3), unit="pixels"), brown(intrinsic.value("D"), intrinsic.where("D"))
    camera_from_lidar = _transform(place.section("extrinsic").section("transform"))
    pose = camera_from_lidar @ inverse(FLU_FROM_LEFT_BACK_UP)
    return build(place.where(), K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _transform(place: Section) -> Any:
    turn, shift = place.section("rotation"), place.section("translation")
    turn.require(*"wxyz")
    q = [turn.number(key) for key in "wxyz"]
    R = quaternion(q, turn.where(), "wxyz", nearest=place.nearest)
    return rigid(R, [shift.number(axis, unit="metres") for axis in "xyz"])


def _entries(content: Mapping[Any, Any]) -> dict[str, Any]:
    return {
        str(name): sensor
        for name, sensor in content.items()
        if has(sensor, "extrinsic", "intrinsic")
        and has(sensor["intrinsic"], "K", "D")
        and has(sensor["extrinsic"], "transform")
    }
