"""``transforms.json`` of nerfstudio, instant-ngp and the NeRF synthetic scenes.

The format, after nerfstudio's "data conventions" and instant-ngp's ``colmap2nerf.py``:

* ``w h fl_x fl_y cx cy k1 k2 k3 k4 p1 p2``, at the top or in a frame of its own; or ``camera_angle_x`` alone, the angle
  of view over the width in radians. Without ``cx, cy`` they are the middle of the image.
* **The corner of the image is (0, 0)**, as COLMAP, whose numbers these are, has it: 0.5 is subtracted, so that pixel
  (0, 0) is the centre of the first.
* ``camera_model``: ``OPENCV`` (the default), ``OPENCV_FISHEYE``, ``PINHOLE``, ``SIMPLE_PINHOLE``; instant-ngp's
  ``is_fisheye`` means ``OPENCV_FISHEYE``. Others are refused.
* ``frames``: ``file_path`` and ``transform_matrix``, which takes points of the camera to the world. The camera's axes
  are **OpenGL's** (x right, y up, z towards the viewer); they are turned into optical ones here.
* nerfstudio's world has z up; its origin, heading and scale are whatever the reconstruction left, and there is no road.
  ``vehicle_from_world=`` (to x forward, y left, z up) and ``metres_per_unit=`` say what is known; without them it is
  taken for the vehicle frame. Pass the road's height in that frame as ``ground=``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, KannalaBrandt
from ipm_rs.calibration._bodies import pick, turned
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, inverse, pinhole
from ipm_rs.calibration._files import Document, Source, keys_missing, needs_size, read_json, same_size
from ipm_rs.calibration._mount import metric, rigid_argument
from ipm_rs.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "nerfstudio"
KEYS = (
    "fl_x", "fl_y", "camera_angle_x", "camera_model", "frames", "transform_matrix", "file_path", "aabb_scale",
    "applied_transform",
)  # fmt: skip

_MODELS = ("OPENCV", "OPENCV_FISHEYE", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = keys_missing(document, "frames")
    if lacks is None:
        frames = document.json["frames"]
        whole = isinstance(frames, list) and bool(frames) and isinstance(frames[0], dict)
        if not whole or "transform_matrix" not in frames[0]:
            return "no list of frames with 'transform_matrix'"
        places = (document.json, frames[0])
        lacks = None if any(key in place for place in places for key in ("fl_x", "camera_angle_x")) else "no key 'fl_x'"
    return lacks


def cameras(document: Document) -> list[str]:
    """Paths of the frames, as ``camera=`` takes them."""
    return _names(read_json(document, TITLE).sections("frames"))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | int | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_world: ArrayLike | None = None,
    metres_per_unit: float = 1.0,
    nearest_rotation: bool = False,
) -> Camera:
    """Read the camera of one frame.

    Parameters
    ----------
    source : str, path or mapping
        ``transforms.json``, or its content as a mapping.
    camera : str or int, optional
        The frame: its ``file_path``, or its number from 0; needed if there is more than one.
    image_size : (int, int), optional
        Width and height in pixels; needed if the file has no ``w`` and ``h``, and must agree if it has them.
    vehicle_from_world : (4, 4) array, optional
        Where the file's world, its lengths scaled to metres, stands in the vehicle frame. Without it the world is taken
        for the vehicle frame, which is right only where x is forward and z is up in it.
    metres_per_unit : float
        Length of the world's unit in metres.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        In the vehicle frame that the caller's pose means.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the model has no lens here.
    ArgumentError, ArgumentTypeError
        There is no such frame; an argument is wrong.
    """
    check_word("camera", camera)
    content = read_json(source, TITLE)
    content.nearest = nearest_rotation
    frames = content.sections("frames")
    frame = frames[pick(_names(frames), camera, content.origin)]
    place = Section({**content.content, **frame.content}, content.origin, frame.path, nearest=nearest_rotation)
    if "w" in place and "h" in place:
        size = place.image_size("w", "h")
        same_size(image_size, size, content.origin)
    else:
        size = needs_size(image_size, content.origin, "the file has no w and h: take the image's")
    K, lens = _intrinsics(place, size), _lens(place)
    world_from_camera = metric(turned(place.pose("transform_matrix")), metres_per_unit)
    world = rigid_argument(vehicle_from_world, "vehicle_from_world", nearest=nearest_rotation)
    pose = inverse(world_from_camera) @ inverse(world)
    return build(place.where(), K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _names(frames: list[Section]) -> list[str]:
    names = [str(frame.content.get("file_path", index)) for index, frame in enumerate(frames)]
    return names if len(set(names)) == len(names) else [str(index) for index in range(len(names))]


def _intrinsics(place: Section, size: Any) -> Matrix:
    try:
        width, height = (float(side) for side in size)
    except (TypeError, ValueError):  # the camera says what is wrong with it
        width = height = 1.0
    if "fl_x" in place:
        fx = place.number("fl_x", unit="pixels", positive=True)
    else:
        angle = place.number("camera_angle_x", unit="radians", positive=True)
        if angle >= math.pi:
            raise CalibrationError(
                f"{place.where('camera_angle_x')}: expected an angle of view in radians, below pi, got {angle:g}; "
                "convert degrees to radians"
            )
        fx = 0.5 * width / math.tan(0.5 * angle)
    fy = place.number("fl_y", unit="pixels", positive=True) if "fl_y" in place else fx
    cx = place.number("cx", unit="pixels") if "cx" in place else width / 2
    cy = place.number("cy", unit="pixels") if "cy" in place else height / 2
    return pinhole(fx, fy, cx - 0.5, cy - 0.5)


def _lens(place: Section) -> Any:
    model = place.text("camera_model", among=_MODELS) if "camera_model" in place else "OPENCV"
    fisheye = model == "OPENCV_FISHEYE" or place.content.get("is_fisheye") is True
    order = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    terms = [place.number(key) if key in place else 0.0 for key in order]
    if not fisheye and "k4" in place and place.number("k4"):
        raise CalibrationError(
            f"{place.where('k4')}: expected 0 for OPENCV, got {place.number('k4'):g}; if it is a fisheye, say "
            'camera_model: "OPENCV_FISHEYE"'
        )
    with blame(place.where()):
        if fisheye:
            return KannalaBrandt(terms)
        return BrownConrady(terms if terms[4] else terms[:4]) if any(terms) and "PINHOLE" not in model else None
