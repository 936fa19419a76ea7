"""Open3D's ``PinholeCameraIntrinsic``, ``PinholeCameraParameters`` and ``PinholeCameraTrajectory`` as JSON.

The format, after Open3D's ``PinholeCameraIntrinsic.cpp`` and its documentation:

* ``width``, ``height``, ``intrinsic_matrix``: nine numbers **column by column**. Pixel (0, 0) is a pixel's centre
  (the default camera has cx = 319.5 for 640 pixels). There is no lens.
* ``extrinsic``: sixteen numbers column by column, points of the world to the camera (optical axes: x right, y down, z
  forward). ``parameters`` lists such cameras.
* The world is whatever the reconstruction left, often the first camera: ``vehicle_from_world=`` says how it stands in
  the vehicle frame (x forward, y left, z up). Without it, and for a file of intrinsics alone, the world is taken for
  the axes of a camera that looks along +x, and ``ground=`` is minus its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import on_body, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, inverse, pose
from ipm_rs.calibration._files import Document, Source, keys_missing, read_json, same_size
from ipm_rs.errors import ArgumentError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "Open3D"
KEYS = ("class_name", "intrinsic_matrix", "width", "height", "extrinsic", "parameters", "version_major")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if keys_missing(document, "class_name", "parameters") is None:
        entries = document.json["parameters"]
        if not isinstance(entries, list) or not entries or not isinstance(entries[0], dict):
            return "no list of parameters"
        content = entries[0]
    else:
        lacks = keys_missing(document)
        if lacks:
            return lacks
        content = document.json
    content = content.get("intrinsic", content)
    values = content.get("intrinsic_matrix") if isinstance(content, dict) else None
    if not isinstance(values, list) or "width" not in content:
        return "no key 'intrinsic_matrix'"
    by_columns = len(values) == 9 and all(isinstance(values[place], (int, float)) for place in range(9))
    return None if by_columns and values[2] == values[5] == 0 != values[6] else "no matrix written column by column"


def cameras(document: Document) -> list[str]:
    """Numbers of the cameras of a trajectory, as ``camera=`` takes them; none where there is one."""
    content = read_json(document, TITLE)
    return [str(index) for index, _ in enumerate(content.sections("parameters"))] if "parameters" in content else []


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: int | str | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_world: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera of Open3D.

    Parameters
    ----------
    source : str, path or mapping
        The JSON file, or its content as a mapping.
    camera : int, optional
        Number from 0 in a trajectory; needed if it has more than one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_world : (4, 4) array, optional
        Where the world of ``extrinsic`` stands in the vehicle frame.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        A pinhole.

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
    content = read_json(source, TITLE)
    if "parameters" in content:
        entries = content.sections("parameters")
        content = entries[pick([str(index) for index in range(len(entries))], camera, content.origin)]
    elif camera is not None:
        raise ArgumentError(f"{content.origin}: camera: expected none, the file holds one, got {camera!r}; drop it")
    content.nearest = nearest_rotation
    place = content.section("intrinsic") if "intrinsic" in content else content
    size = place.image_size("width", "height")
    same_size(image_size, size, content.origin)
    K = place.numbers("intrinsic_matrix", 9, unit="pixels").reshape(3, 3).T
    if not np.array_equal(K[2], (0, 0, 1)):
        raise CalibrationError(
            f"{place.where('intrinsic_matrix')}: expected nine numbers column by column, the third, sixth and ninth 0, "
            "0 and 1, got others; a matrix by rows is read by Camera.from_opencv"
        )
    world_from_camera = inverse(_extrinsic(content))
    T = on_body(world_from_camera, np.eye(4), vehicle_from_world, "vehicle_from_world", nearest=nearest_rotation)
    return build(place.where(), K.copy(), image_size=size, camera_from_vehicle=T)


def _extrinsic(content: Section) -> Matrix:
    if "extrinsic" not in content:
        return np.eye(4)
    values = content.numbers("extrinsic", 16).reshape(4, 4).T
    return pose(values.tolist(), content.where("extrinsic"), nearest=content.nearest)
