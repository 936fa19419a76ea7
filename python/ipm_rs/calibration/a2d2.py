"""Audi's A2D2: ``cams_lidars.json``.

The format, after the data set's tutorial:

* ``cameras``: for each (``front_center``, ``front_left``, ``side_right``, ...) ``view``, ``Lens`` ("Telecam": five
  terms k1, k2, p1, p2, k3 of OpenCV; "Fisheye": k1, k2, k3, k4 of ``cv2.fisheye``), ``CamMatrixOriginal`` with
  ``Distortion`` for the images as they are published, ``CamMatrix`` for those that ``undistort_image`` of the tutorial
  makes of them, ``Resolution`` [width, height].
* ``view``: ``x-axis``, ``y-axis`` and ``origin`` in the global frame, metres. The y axis is made perpendicular to x, z
  is their cross product. A **camera's** x points forward, y left, z up, as the vehicle's (``vehicle.view``): nothing is
  optical here.
* The vehicle's origin is not described; the front camera stands 0.94 m above it, which on that car is not the road's
  height. Measure the road in a point cloud and pass it as ``ground=``.
* It is not said where a pixel's centre is; (0, 0) is read as the centre of the first, as OpenCV, through which the
  tutorial undistorts, has it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera, KannalaBrandt
from ipm_rs.calibration._bodies import FLU_FROM_CAMERA_AXES, brown, one_of, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, coefficients, inverse, rigid
from ipm_rs.calibration._files import Document, Source, keys_missing, read_json, same_size
from ipm_rs.calibration._opencvlens import flat
from ipm_rs.calibration._plain import has
from ipm_rs.errors import CalibrationError

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "A2D2"
KEYS = (
    "cameras", "view", "CamMatrix", "CamMatrixOriginal", "Distortion", "Resolution", "Lens", "x-axis", "y-axis",
    "ego-dimensions", "tstamp_delay",
)  # fmt: skip

_LENSES = ("Telecam", "Fisheye")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = keys_missing(document, "cameras")
    return lacks or (None if _entries(document.json) else "no camera with 'view' and 'CamMatrix'")


def cameras(document: Document) -> list[str]:
    """Names of the cameras, as ``camera=`` takes them."""
    return list(_entries(document.json))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    image: Literal["original", "undistorted"] = "original",
) -> Camera:
    """Read one camera of A2D2.

    Parameters
    ----------
    source : str, path or mapping
        ``cams_lidars.json``, or its content as a mapping.
    camera : str, optional
        Its name, "front_center"; needed if there is more than one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    image : {"original", "undistorted"}
        Whether the images that will be warped are as published, or went through ``undistort_image`` of the tutorial.

    Returns
    -------
    Camera
        In the vehicle's frame, or the global one where the file has no ``vehicle``.

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
    one_of("image", image, ("original", "undistorted"), "say which images will be warped")
    content = read_json(source, TITLE)
    names = list(_entries(content.content))
    if not names:
        content.section("cameras").section("front_center").require("view", "CamMatrix")
    place = content.section("cameras").section(names[pick(names, camera, content.origin)])
    size = place.pair("Resolution")
    same_size(image_size, size, content.origin)
    lens = _lens(place) if image == "original" else None
    K = place.matrix("CamMatrixOriginal" if image == "original" else "CamMatrix", (3, 3), unit="pixels")
    pose = _pose(place.section("view")) @ FLU_FROM_CAMERA_AXES
    if has(content.content.get("vehicle"), "view"):
        pose = inverse(_pose(content.section("vehicle").section("view"))) @ pose
    return build(place.where(), K, image_size=size, vehicle_from_camera=pose, lens=lens)


def _lens(place: Section) -> Any:
    values, where = flat(place.value("Distortion")), place.where("Distortion")
    if place.text("Lens", among=_LENSES) == "Telecam":
        return brown(values, where)
    with blame(where):
        return KannalaBrandt(coefficients(values, where, (4,)))


def _pose(view: Section) -> Matrix:
    """Global from the view's axes, as the tutorial orthogonalises them."""
    x, y = (_unit(view.numbers(key, 3), view.where(key)) for key in ("x-axis", "y-axis"))
    y = _unit(y - x * (x @ y), view.where("y-axis"))
    return rigid(np.column_stack([x, y, np.cross(x, y)]), view.numbers("origin", 3, unit="metres"))


def _unit(axis: Matrix, where: str) -> Matrix:
    length = float(np.sqrt(axis @ axis))
    if not 1e-10 < length < np.inf:
        raise CalibrationError(
            f"{where}: expected an axis, not parallel to the other one, got a length of {length:.3g}; correct it"
        )
    return axis / length


def _entries(content: Mapping[Any, Any]) -> dict[str, Any]:
    found = content.get("cameras")
    if not isinstance(found, Mapping):
        return {}
    return {str(name): camera for name, camera in found.items() if has(camera, "view", "CamMatrix")}
