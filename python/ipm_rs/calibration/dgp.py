"""DGP's ``calibration/<sha>.json``, as DDAD and Parallel Domain have it.

The format, after DGP's ``sample.proto`` and ``geometry.proto``: three lists of one length,

* ``names`` of the sensors, cameras and lidars alike;
* ``extrinsics``: ``rotation`` (``qw qx qy qz``, by name) and ``translation`` (``x y z``, metres): points of the sensor
  to the frame of the **first sensor** of the list, or to the vehicle where that is what the first one is. A camera's
  axes are optical (x right, y down, z forward).
* ``intrinsics``: ``fx fy cx cy skew``, all 0 for a lidar; ``k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 taux tauy`` in OpenCV's
  meaning, or with ``fisheye`` 1 the k1 to k4 of ``cv2.fisheye``. Models of ``alpha, beta, xi, w`` are refused: DGP does
  not say which of them holds. That pixel (0, 0) is the centre of the first is assumed; the format does not say.

It has no image size: DDAD's images are 1936 x 1216. The frame has x forward, y left, z up in DDAD; where its road lies
is not stated, so measure it in a point cloud and pass it as ``ground=``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, KannalaBrandt
from ipm_rs.calibration._bodies import pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, pinhole, quaternion, rigid
from ipm_rs.calibration._files import Document, Source, keys_missing, needs_size, read_json
from ipm_rs.errors import CalibrationError

__all__ = ["KEYS", "TITLE", "cameras", "missing", "pose_of", "read"]

TITLE = "DGP"
KEYS = ("names", "extrinsics", "intrinsics", "rotation", "translation", "qw", "qx", "skew")

_TERMS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "taux", "tauy")
_OTHERS = ("alpha", "beta", "xi", "w", "equirectangular")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = keys_missing(document, "names", "extrinsics", "intrinsics")
    if lacks is None and not all(isinstance(document.json[key], list) for key in ("names", "extrinsics", "intrinsics")):
        return "no lists of names, extrinsics and intrinsics"
    return lacks


def cameras(document: Document) -> list[str]:
    """Names of the cameras, as ``camera=`` takes them."""
    return [name for name, place, _ in _sensors(read_json(document, TITLE)) if _is_camera(place)]


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of a DGP calibration.

    Parameters
    ----------
    source : str, path or mapping
        The JSON file, or its content as a mapping.
    camera : str, optional
        Its name, "CAMERA_01"; needed if there is more than one camera.
    image_size : (int, int)
        Width and height in pixels, which the format does not state; DDAD's are (1936, 1216).
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        In the frame of the file's poses.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, the lens has no model here, or `image_size` was not given.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    """
    check_word("camera", camera)
    content = read_json(source, TITLE)
    content.nearest = nearest_rotation
    sensors = [sensor for sensor in _sensors(content) if _is_camera(sensor[1])]
    if not sensors:
        raise CalibrationError(f"{content.where('intrinsics')}: expected a camera, got lidars only; pass another file")
    _, place, extrinsic = sensors[pick([name for name, _, _ in sensors], camera, content.origin)]
    size = needs_size(image_size, content.origin, "DDAD's images are 1936x1216: take the image's")
    fx, fy, cx, cy = (place.number(key, unit="pixels") for key in ("fx", "fy", "cx", "cy"))
    K = pinhole(fx, fy, cx, cy, _or_zero(place, "skew"))
    lens, pose = _lens(place), pose_of(extrinsic)
    return build(place.where(), K, image_size=size, vehicle_from_camera=pose, lens=lens)


def _sensors(content: Section) -> list[tuple[str, Section, Section]]:
    """Name, intrinsics and extrinsics of every sensor."""
    content.require("names", "intrinsics", "extrinsics")
    places, poses = content.sections("intrinsics"), content.sections("extrinsics")
    names = [str(name) for name in content.listed("names", len(places))]
    content.listed("extrinsics", len(places))
    if len(set(names)) != len(names):
        raise CalibrationError(f"{content.where('names')}: expected every name once, got one again; keep one")
    return list(zip(names, places, poses, strict=True))


def _is_camera(place: Section) -> bool:
    fx = place.content.get("fx")  # 0 for a lidar
    return fx is not None and not (isinstance(fx, (int, float)) and fx == 0)


def _or_zero(place: Section, key: str) -> float:
    return place.number(key) if key in place else 0.0


def _lens(place: Section) -> Any:
    others = [key for key in _OTHERS if _or_zero(place, key)]
    if others:
        raise CalibrationError(
            f"{place.where(others[0])}: expected 0, got {_or_zero(place, others[0]):g}, of a model that DGP does not "
            "tell apart; build Camera(K, ..., lens=) with the right one"
        )
    terms = [_or_zero(place, key) for key in _TERMS]
    with blame(place.where()):
        if _or_zero(place, "fisheye"):
            return KannalaBrandt([_or_zero(place, key) for key in ("k1", "k2", "k3", "k4")])
        return BrownConrady(terms) if any(terms) else None


def pose_of(place: Section) -> Matrix:
    """(4, 4) transform of a ``rotation`` and a ``translation``, each by name."""
    turn, shift = place.section("rotation"), place.section("translation")
    q = [turn.number(key) for key in ("qw", "qx", "qy", "qz")]
    R = quaternion(q, turn.where("qw qx qy qz"), "wxyz", nearest=place.nearest)
    return rigid(R, [shift.number(axis, unit="metres") for axis in "xyz"])
