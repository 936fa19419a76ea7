"""Camera entries of mmdetection3d's info files (version 1.1 on): ``cam2img``, ``lidar2cam``, ``cam2ego``.

The format, after mmdetection3d's ``update_infos_to_v2.py`` and its documentation of coordinates:

* ``cam2img``: 3x3, 3x4 or 4x4. Where it has a **fourth column** (KITTI's cameras 1 to 3 stand beside the one that
  ``lidar2cam`` leads to) that is no part of K: it is folded into the pose here. Dropped, it is 14.7 pixels on KITTI.
* ``lidar2cam`` takes points of the lidar to the camera's optical axes; ``cam2ego`` those of the camera to the vehicle.
* ``height``, ``width`` of the image, where they are there. Images count as undistorted; Waymo's are not, and their
  distortion is not in the file.

One entry, or what an info file has for a frame (``images: {CAM_FRONT: {...}}``), as JSON or as a mapping: info files
are pickles, which are not read here since they may run anything: ``pickle.load`` them yourself if you trust them,
and pass ``infos["data_list"][0]``.

The vehicle frame is the ego vehicle's where there is ``cam2ego`` (x forward, y left, z up; nuScenes: ``ground=0``),
else the lidar's: x forward, y left, z up for KITTI and Waymo, where the road is minus the lidar's height (KITTI: about
-1.73). nuScenes' own lidar has x to the **right** and y forward, so ``frame="lidar"`` there is not a vehicle frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, inverse, matrix, rigid
from ipm_rs.calibration._files import Document, Source, needs_size, read_json, same_size
from ipm_rs.calibration._values import items_of
from ipm_rs.errors import ArgumentError, CalibrationError

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "mmdetection3d"
KEYS = ("cam2img", "lidar2cam", "cam2ego", "lidar2img", "images", "img_path", "data_list", "height", "width")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if not document.is_json:
        return "not JSON"
    return None if isinstance(document.json, Mapping) and _entries(document.json) else "no key 'cam2img'"


def cameras(document: Document) -> list[str]:
    """Names of the cameras of a frame, as ``camera=`` takes them; none where there is one entry."""
    return [name for name in _entries(document.json) if name]


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    frame: Literal["ego", "lidar"] | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera of an info file's entry.

    Parameters
    ----------
    source : str, path or mapping
        One camera's entry, or a frame's with ``images``: a JSON file, or a mapping.
    camera : str, optional
        Its key in ``images``: "CAM_FRONT", "CAM2"; needed if there is more than one.
    image_size : (int, int), optional
        Width and height in pixels; needed if the entry lacks them, and must agree if it has them.
    frame : {"ego", "lidar"}, optional
        Which frame is the vehicle's: through ``cam2ego`` or ``lidar2cam``. Without it the ego vehicle's where it is
        there.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        A pinhole, with the fourth column of ``cam2img`` in its pose.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, or a value cannot be right.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    """
    check_word("camera", camera)
    if frame not in (None, "ego", "lidar"):
        raise ArgumentError(f"frame: expected 'ego' or 'lidar', got {frame!r:.60}; correct it")
    content = read_json(source, TITLE)
    entries = _entries(content.content)
    if not entries:
        content.require("cam2img")
    names = list(entries)
    name = names[pick(names, "" if names == [""] and camera is None else camera, content.origin)]
    place = Section(entries[name], content.origin, f"images.{name}" if name else "", nearest=nearest_rotation)
    if "width" in place and "height" in place:
        size = place.image_size("width", "height")
        same_size(image_size, size, content.origin)
    else:
        size = needs_size(image_size, content.origin, "the entry has no width and height: take the image's")
    K, shift = _projection(place)
    key = "cam2ego" if frame == "ego" or (frame is None and "cam2ego" in place) else "lidar2cam"
    pose = place.pose(key)
    camera_from_vehicle = rigid(np.eye(3), shift) @ (inverse(pose) if key == "cam2ego" else pose)
    return build(place.where("cam2img"), K, image_size=size, camera_from_vehicle=camera_from_vehicle)


def _entries(content: Mapping[Any, Any]) -> dict[str, Any]:
    """Each camera's entry by its name; by "" where there is one alone."""
    if "cam2img" in content:
        return {"": content}
    frames = content.get("data_list")
    if isinstance(frames, list) and len(frames) == 1 and isinstance(frames[0], Mapping):
        content = frames[0]
    images = content.get("images")
    if not isinstance(images, Mapping):
        return {}
    return {str(name): entry for name, entry in images.items() if isinstance(entry, Mapping) and "cam2img" in entry}


def _projection(place: Section) -> tuple[Matrix, Matrix]:
    """K, and the shift in camera axes that the fourth column of ``cam2img`` stands for."""
    value, where = place.value("cam2img"), place.where("cam2img")
    rows = items_of(value) or ()
    wide = len(rows) == 12 or any(len(items_of(row) or ()) == 4 for row in rows)
    shape = (4, 4) if len(rows) in (4, 16) else (3, 4) if wide else (3, 3)
    P = matrix(value, where, shape, unit="pixels")
    if shape == (4, 4) and not np.array_equal(P[3], (0, 0, 0, 1)):
        raise CalibrationError(f"{where}[3]: expected the last row 0 0 0 1, got others; correct it")
    K = P[:3, :3].copy()
    if shape == (3, 3):
        return K, np.zeros(3)
    with blame(where):
        if not abs(np.linalg.det(K)) > 0:
            raise CalibrationError(f"{where}: expected a camera matrix that can be inverted, got one that cannot")
        return K, np.asarray(np.linalg.solve(K, P[:3, 3]), dtype=np.float64)
