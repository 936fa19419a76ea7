"""``ncamera.yaml`` of aslam_cv2, as maplab, ROVIO and SVO Pro write it.

The format, after aslam_cv2's and SVO's parsers: a list ``cameras``, each with

* ``camera``: ``type`` pinhole, ``intrinsics`` (a column of fu, fv, cu, cv), ``image_width``, ``image_height``,
  ``distortion`` with ``type`` and ``parameters``; ``label`` and ``id`` are names. Axes optical, pixel (0, 0) is a
  pixel's centre.
* ``distortion``: ``radial-tangential`` [k1, k2, p1, p2], ``equidistant`` [k1, k2, k3, k4], ``none``. What is called
  ``fisheye`` there is the FOV model of Devernay and Faugeras with its one number: it has no lens here and is refused.
* ``T_B_C`` takes points of the camera to the body, which is the IMU.

The file knows no road and no vehicle: ``vehicle_from_body=`` says how the body stands on the vehicle (x forward, y
left, z up); without it the first camera is at the origin and looks along +x, and ``ground=`` is minus its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._bodies import lens_named, on_body, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, pinhole
from ipm_rs.calibration._files import Document, Source, same_size
from ipm_rs.calibration._opencvlens import flat
from ipm_rs.calibration._plain import has, plain_section, tree_missing

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "ncamera"
KEYS = ("cameras", "camera", "T_B_C", "image_height", "image_width", "intrinsics", "distortion", "parameters", "label")

_WORDS = {"fisheye": "fov"}  # the FOV model there, not Kannala and Brandt's


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = tree_missing(document, "cameras")
    if lacks is None:
        cameras = document.tree["cameras"]
        found = isinstance(cameras, list) and cameras and all(has(item, "camera") for item in cameras)
        lacks = (
            None if found and has(cameras[0]["camera"], "intrinsics", "type") else "no list of cameras with 'camera'"
        )
    return lacks


def cameras(document: Document) -> list[str]:
    """Names of the cameras, as ``camera=`` takes them."""
    return _names(plain_section(document, TITLE).sections("cameras"))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | int | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_body: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of an ncamera file.

    Parameters
    ----------
    source : str, path or mapping
        The file (needs the extra ``yaml``), or its content as a mapping.
    camera : str or int, optional
        Its label, or its number from 0; needed if the file holds more than one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_body : (4, 4) array, optional
        Pose of the body (the IMU) in the vehicle frame.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Where ``vehicle_from_body`` and the file put it, else as seen from the first, which looks along +x.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the lens has no model here.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    MissingExtraError
        PyYAML is not installed.
    """
    check_word("camera", camera)
    content = plain_section(source, TITLE)
    content.nearest = nearest_rotation
    entries = content.sections("cameras")
    index = pick(_names(entries), camera, content.origin)
    entry = entries[index]
    section = entry.section("camera")
    section.require("type", "intrinsics", "distortion", "image_width", "image_height")
    section.text("type", among=("pinhole",))
    section = section.with_values(intrinsics=flat(section.value("intrinsics")))
    fu, fv, cu, cv = section.numbers("intrinsics", 4, unit="pixels")
    size = section.image_size("image_width", "image_height")
    same_size(image_size, size, content.origin)
    distortion = section.section("distortion")
    word = distortion.value("type")
    values = [] if word == "none" else flat(distortion.value("parameters"))
    lens = lens_named(word, values, distortion.where(), others=_WORDS)
    body_from_camera, body_from_first = _pose(entry), _pose(entries[0])
    if vehicle_from_body is not None:
        entry.require("T_B_C")
    pose = on_body(body_from_camera, body_from_first, vehicle_from_body, "vehicle_from_body", nearest=nearest_rotation)
    return build(section.where(), pinhole(fu, fv, cu, cv), image_size=size, camera_from_vehicle=pose, lens=lens)


def _names(entries: list[Section]) -> list[str]:
    labels = [entry.section("camera").content.get("label") for entry in entries]
    names = [str(label) if isinstance(label, (str, int)) else str(index) for index, label in enumerate(labels)]
    return names if len(set(names)) == len(names) else [str(index) for index in range(len(names))]


def _pose(entry: Section) -> Any:
    return entry.pose("T_B_C") if "T_B_C" in entry else np.eye(4)
