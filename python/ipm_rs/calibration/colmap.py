"""COLMAP models, text or binary: ``cameras.txt`` or ``cameras.bin``, and ``images.txt`` or ``images.bin`` for poses.

The format, after COLMAP's documentation and ``sensor/models.h``:

* ``cameras.txt``: ``CAMERA_ID MODEL WIDTH HEIGHT PARAMS...``, parameters in the order of `_MODELS` below.
* **The corner of the image is (0, 0)**, the centre of the top-left pixel (0.5, 0.5): 0.5 is subtracted from the
  principal point.
* ``images.txt``: two lines for each image, ``IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME``, then its points. The
  quaternion is **w, x, y, z**, and takes points of the world to the camera (optical axes), as does the translation.
* COLMAP's world has no scale, no direction of up and no road, unless it was aligned. ``vehicle_from_world=`` (into
  x forward, y left, z up) and ``metres_per_unit=`` say what is known about it; pass the height of the road in that
  frame as ``ground=``.

All models of COLMAP 4.2 have a counterpart here. Its fisheyes end at 90 degrees from the axis, ours where their images
fold.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, Division, Equirectangular, Eucm, Fov, KannalaBrandt, ThinPrismFisheye
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import (
    blame,
    inverse,
    listed,
    number,
    numbers,
    pinhole,
    quaternion,
    rigid,
)
from ipm_rs.calibration._checks import image_size as checked_size
from ipm_rs.calibration._colmapbin import camera_words, image_words, is_cameras
from ipm_rs.calibration._files import Document, open_document, same_size
from ipm_rs.calibration._mount import metric, rigid_argument
from ipm_rs.calibration._yaml import scalar
from ipm_rs.errors import ArgumentError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "cameras", "missing", "read"]

TITLE = "COLMAP"
KEYS = ("CAMERA_ID", "MODEL", "WIDTH", "HEIGHT", "PARAMS[]")

# Of each model: how many focal lengths, which come before cx and cy; its lens's parameters, behind them; and the lens.
_MODELS: dict[str, tuple[int, str, Callable[..., Any]]] = {
    "SIMPLE_PINHOLE": (1, "", lambda: None),
    "PINHOLE": (2, "", lambda: None),
    "SIMPLE_RADIAL": (1, "k1", lambda k1: BrownConrady([k1, 0, 0, 0])),
    "RADIAL": (1, "k1 k2", lambda k1, k2: BrownConrady([k1, k2, 0, 0])),
    "OPENCV": (2, "k1 k2 p1 p2", lambda *k: BrownConrady(k)),
    "FULL_OPENCV": (2, "k1 k2 p1 p2 k3 k4 k5 k6", lambda *k: BrownConrady(k)),
    "OPENCV_FISHEYE": (2, "k1 k2 k3 k4", lambda *k: KannalaBrandt(k)),
    "SIMPLE_RADIAL_FISHEYE": (1, "k1", lambda k1: KannalaBrandt([k1, 0, 0, 0])),
    "RADIAL_FISHEYE": (1, "k1 k2", lambda k1, k2: KannalaBrandt([k1, k2, 0, 0])),
    "SIMPLE_FISHEYE": (1, "", lambda: KannalaBrandt([0, 0, 0, 0])),
    "FISHEYE": (2, "", lambda: KannalaBrandt([0, 0, 0, 0])),
    "THIN_PRISM_FISHEYE": (2, "k1 k2 p1 p2 k3 k4 sx1 sy1", lambda *k: ThinPrismFisheye(k)),
    "RAD_TAN_THIN_PRISM_FISHEYE": (2, "k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3", lambda *k: ThinPrismFisheye(k)),
    "FOV": (2, "omega", Fov),
    "SIMPLE_DIVISION": (1, "k", Division),
    "DIVISION": (2, "k", Division),
    "EUCM": (2, "alpha beta", Eucm),
}
_SPHERE = "EQUIRECTANGULAR"
_FLAT = ("SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV", "FOV", "SIMPLE_DIVISION", "DIVISION")  # 0 bends nothing

_HEAD = 10_000  # characters, within which the first camera comes: a recogniser is asked of files of any size
_MOST_LINES = 200_000

Matrix = NDArray[np.float64]


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if document.is_directory:
        return "a directory"
    if is_cameras(document.data):
        return None
    rows = _rows(document.text[:_HEAD])
    known = (*_MODELS, _SPHERE)
    return None if rows and len(rows[0][1]) > 4 and rows[0][1][1] in known else "no line CAMERA_ID MODEL WIDTH HEIGHT"


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    return list(_cameras(document))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: str | os.PathLike[str],
    *,
    camera: int | str | None = None,
    images: str | os.PathLike[str] | None = None,
    image: int | str | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_world: ArrayLike | None = None,
    metres_per_unit: float = 1.0,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of a COLMAP model.

    Parameters
    ----------
    source : str or path
        ``cameras.txt`` or ``cameras.bin``.
    camera : int, optional
        CAMERA_ID; needed if the file holds more than one and no image is chosen.
    images : str or path, optional
        ``images.txt`` or ``images.bin``, for the pose.
    image : int or str, optional
        IMAGE_ID or NAME of the image in `images`; needed if there is more than one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_world : (4, 4) array, optional
        Where COLMAP's world, its lengths scaled to metres, stands in the vehicle frame. Without it the world is taken
        for the vehicle frame, which is right only for a model that was aligned so.
    metres_per_unit : float
        Length of COLMAP's unit in metres.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Without `images` at the origin, looking along +x.

    Raises
    ------
    MissingFileError, FileError
        A file does not exist, or cannot be read.
    CalibrationError
        A line cannot be right, or the model is none of COLMAP's.
    ArgumentError, ArgumentTypeError
        There is no such camera or image; an argument has the wrong type.
    """
    check_word("camera", camera)
    check_word("image", image)
    document = open_document(source, TITLE)
    pose = None
    if images is not None:
        points = open_document(images, TITLE, argument="images")
        camera, pose = _choose_image(points, image, camera, nearest_rotation)
        pose = metric(pose, metres_per_unit) @ inverse(
            rigid_argument(vehicle_from_world, "vehicle_from_world", nearest=nearest_rotation)
        )
    elif image is not None or vehicle_from_world is not None:
        raise ArgumentError(
            "image, vehicle_from_world: expected images= with them, got None; pass the path of images.txt"
        )
    place, words = _choose_camera(document, camera)
    where = f"{document.origin}: {place}"
    model = words[1]
    if model not in (*_MODELS, _SPHERE):
        raise CalibrationError(
            f"{where}: expected one of {', '.join((*_MODELS, _SPHERE))}, got {model!r:.40}; check the line, "
            "CAMERA_ID MODEL WIDTH HEIGHT PARAMS"
        )
    size = checked_size(_value(words[2:3]), _value(words[3:4]), where)
    same_size(image_size, size, document.origin)
    given = [scalar(word) for word in words[4:]]
    K, lens = _sphere(given, where) if model == _SPHERE else _intrinsics(model, given, where)
    return build(where, K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _intrinsics(model: str, given: list[Any], where: str) -> tuple[Matrix, Any]:
    """K and lens of a model with focal lengths."""
    focal, names, make = _MODELS[model]
    values = numbers(given, f"{where}: parameters of {model}", focal + 2 + len(names.split()))
    for length in values[:focal]:
        number(length, f"{where}: focal length", unit="pixels", positive=True)
    cx, cy = values[focal : focal + 2] - 0.5  # COLMAP counts from the corner
    terms = values[focal + 2 :].tolist()
    with blame(where):
        lens = None if model in _FLAT and not any(terms) else make(*terms)
    return pinhole(values[0], values[focal - 1], cx, cy), lens


def _sphere(given: list[Any], where: str) -> tuple[Matrix, Equirectangular]:
    """K and lens of a whole sphere, whose parameters are its width and height."""
    width, height = numbers(given, f"{where}: parameters of {_SPHERE}", 2)
    for length in (width, height):
        number(length, f"{where}: parameters of {_SPHERE}", unit="pixels", positive=True)
    K = pinhole(width / (2 * np.pi), height / np.pi, width / 2 - 0.5, height / 2 - 0.5)
    return K, Equirectangular()


def _rows(text: str) -> list[tuple[int, list[str]]]:
    """Line numbers and words of the lines that are no comments."""
    rows = [
        (index, line.split()) for index, line in enumerate(text.split("\n"), 1) if not line.lstrip().startswith("#")
    ]
    return [(index, words) for index, words in rows if words]


def _value(words: list[str]) -> Any:
    return scalar(words[0]) if words else None


def _cameras(document: Document) -> dict[str, tuple[str, list[str]]]:
    """Place and words of every camera by its CAMERA_ID."""
    if is_cameras(document.data):
        rows = camera_words(document.data, document.origin)
    elif document.data.count(b"\n") > _MOST_LINES:
        raise CalibrationError(
            f"{document.origin}: expected at most {_MOST_LINES} lines, got more; pass cameras.txt, the text model"
        )
    else:
        rows = [(f"line {line}", words) for line, words in _rows(document.text)]
    cameras: dict[str, tuple[str, list[str]]] = {}
    for place, words in rows:
        if len(words) < 2:
            raise CalibrationError(
                f"{document.origin}: {place}: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS, got one word; "
                "the file may be cut short, fetch it again"
            )
        if words[0] in cameras:
            raise CalibrationError(
                f"{document.origin}: {place}: expected every camera once, got {words[0]!r:.40} again; keep one"
            )
        cameras[words[0]] = place, words
    return cameras


def _choose_camera(document: Document, camera: int | str | None) -> tuple[str, list[str]]:
    cameras = _cameras(document)
    if not cameras:
        raise CalibrationError(f"{document.origin}: expected a camera, found none; pass cameras.txt or cameras.bin")
    if camera is None and len(cameras) == 1:
        return next(iter(cameras.values()))
    if str(camera) not in cameras:
        raise ArgumentError(
            f"{document.origin}: camera: expected one of {listed(cameras)}, got {camera!r:.60}; say which to read"
        )
    return cameras[str(camera)]


def _images(document: Document) -> list[tuple[str, list[str]]]:
    """Place and words of every image."""
    if b"\0" in document.data[:8]:  # the count; text has none
        return image_words(document.data, document.origin)
    # Every second line lists points, and is empty for an image without any: comments go, empty lines count.
    lines = [(index, line) for index, line in enumerate(document.text.split("\n"), 1) if not line.startswith("#")]
    return [(f"line {index}", line.split(None, 9)) for index, line in lines[::2] if line.strip()]


def _choose_image(
    document: Document, image: int | str | None, camera: int | str | None, nearest: bool
) -> tuple[int | str, Matrix]:
    """CAMERA_ID and (4, 4) camera_from_world of an image."""
    heads = _images(document)
    found = []
    for place, words in heads:
        if len(words) != 10:
            raise CalibrationError(
                f"{document.origin}: {place}: expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, got "
                f"{len(words)} words; pass images.txt, the text model"
            )
        if image is None or str(image) in (words[0], words[9].strip()):
            found.append((place, words))
    if len(found) != 1:
        names = listed([words[9].strip() for _, words in heads])
        raise ArgumentError(
            f"{document.origin}: image: expected one of {names}, got {image!r:.60}; say which image's pose to take"
        )
    place, words = found[0]
    where = f"{document.origin}: {place}"
    if camera is not None and str(camera) != words[8]:
        raise ArgumentError(
            f"{where}: camera: expected {words[8]!r:.40}, the image's own, got {camera!r:.60}; leave it out"
        )
    values = [scalar(word) for word in words[1:8]]
    R = quaternion(values[:4], f"{where}: QW QX QY QZ", "wxyz", nearest=nearest)
    return words[8], rigid(R, numbers(values[4:], f"{where}: TX TY TZ", 3))
