"""``ncamera.yaml`` of aslam_cv2, as maplab, ROVIO and SVO Pro write it, and maplab's ``sensors.yaml``.

The format, after aslam_cv2's and SVO's parsers: a list ``cameras``, at the top or in the entries of maplab's list
``sensors`` whose ``sensor_type`` is ``NCAMERA``. Each has

* ``camera``: ``type`` pinhole, ``intrinsics`` (a column of fu, fv, cu, cv), ``image_width``, ``image_height``,
  ``distortion`` with ``type`` and ``parameters``; ``label``, or else ``topic``, is its name. Axes optical, pixel (0, 0)
  is a pixel's centre. A ``type`` of unified-projection is MEI's model: xi stands before the four, and ``distortion``
  is radial-tangential or none. SVO's ``omni`` (a polynomial of 24 numbers) has no lens here and is refused.
* ``distortion``: ``radial-tangential`` [k1, k2, p1, p2], ``equidistant`` [k1, k2, k3, k4], ``none``, or left out. What
  is called ``fisheye`` there is the FOV model of Devernay and Faugeras with its one number.
* ``T_B_C`` takes points of the camera to the body, which is the IMU; ``T_C_B`` is its inverse.

The file knows no road and no vehicle: ``vehicle_from_body=`` says how the body stands on the vehicle (x forward, y
left, z up); without it the first camera is at the origin and looks along +x, and ``ground=`` is minus its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, Mei
from ipm_rs.calibration._bodies import lens_named, on_body, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, blame, inverse, pinhole
from ipm_rs.calibration._files import Document, Source, same_size
from ipm_rs.calibration._opencvlens import flat
from ipm_rs.calibration._plain import has, plain_section, tree_missing
from ipm_rs.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "ncamera"
KEYS = (
    "cameras", "camera", "T_B_C", "T_C_B", "image_height", "image_width", "intrinsics", "distortion", "parameters",
    "label", "sensors", "sensor_type",
)  # fmt: skip

_WORDS = {"fisheye": "fov"}  # the FOV model there, not Kannala and Brandt's
_LIDAR = "camera-3d-lidar"  # a range image, in maplab's lists only


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if tree_missing(document) is not None:
        return tree_missing(document)
    tree = document.tree
    groups = tree["sensors"] if isinstance(tree.get("sensors"), list) else [tree]
    lists = [group["cameras"] for group in groups if has(group, "cameras") and isinstance(group["cameras"], list)]
    if not lists:
        return "no key 'cameras'"
    first = [item for cameras in lists for item in cameras][:1]
    found = bool(first) and has(first[0], "camera") and has(first[0]["camera"], "intrinsics", "type")
    return None if found else "no list of cameras with 'camera'"


def cameras(document: Document) -> list[str]:
    """Names of the cameras, as ``camera=`` takes them."""
    return _names(_entries(plain_section(document, TITLE)))


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
    entries = _entries(content)
    entry = entries[pick(_names(entries), camera, content.origin)]
    section = entry.section("camera")
    section.require("type", "intrinsics", "image_width", "image_height")
    unified = section.text("type", among=("pinhole", "unified-projection")) == "unified-projection"
    section = section.with_values(intrinsics=flat(section.value("intrinsics")))
    *xi, fu, fv, cu, cv = section.numbers("intrinsics", 5 if unified else 4, unit="pixels")
    size = section.image_size("image_width", "image_height")
    same_size(image_size, size, content.origin)
    lens = _lens(section)
    if unified:
        lens = _mei(float(xi[0]), lens, section)
    for posed in (entry, entries[0]):  # without one a camera alone is at the origin; of several it would be anywhere
        if (len(entries) > 1 or vehicle_from_body is not None) and "T_C_B" not in posed:
            posed.require("T_B_C")
    body_from_camera, body_from_first = _pose(entry), _pose(entries[0])
    pose = on_body(body_from_camera, body_from_first, vehicle_from_body, "vehicle_from_body", nearest=nearest_rotation)
    return build(section.where(), pinhole(fu, fv, cu, cv), image_size=size, camera_from_vehicle=pose, lens=lens)


def _entries(content: Section) -> list[Section]:
    """Cameras at the top, or of every NCAMERA of maplab's list of sensors."""
    if "sensors" not in content:
        return content.sections("cameras")
    groups = [group for group in content.sections("sensors") if "cameras" in group]
    entries = [entry for group in groups for entry in group.sections("cameras")]
    found = [entry for entry in entries if entry.section("camera").content.get("type") != _LIDAR]
    if not found:
        raise CalibrationError(
            f"{content.where('sensors')}: expected an NCAMERA with cameras, got none; pass the file of the cameras"
        )
    return found


def _lens(section: Section) -> Any:
    if section.content.get("distortion") is None:
        return None
    distortion = section.section("distortion")
    word = distortion.value("type")
    values = [] if word == "none" else flat(distortion.value("parameters"))
    return lens_named(word, values, distortion.where(), others=_WORDS)


def _mei(xi: float, lens: Any, section: Section) -> Mei:
    if not (lens is None or isinstance(lens, BrownConrady)):
        raise CalibrationError(
            f"{section.where('distortion')}: expected radial-tangential or none beside unified-projection, got "
            "another; calibrate again with one of these"
        )
    with blame(section.where()):
        return Mei(xi, [0.0] * 4 if lens is None else lens.coefficients[:4])


def _names(entries: list[Section]) -> list[str]:
    cameras = [entry.section("camera").content for entry in entries]
    for key in ("label", "topic"):
        names = [str(camera[key]) for camera in cameras if isinstance(camera.get(key), (str, int))]
        if len(set(names)) == len(cameras) and all(names):
            return names
    return [str(index) for index in range(len(cameras))]


def _pose(entry: Section) -> Any:
    if "T_B_C" in entry or "T_C_B" not in entry:
        return entry.pose("T_B_C") if "T_B_C" in entry else np.eye(4)
    return inverse(entry.pose("T_C_B"))
