"""camodocal's camera files, as VINS-Mono, VINS-Fusion and their kin use them; KITTI-360's ``image_02.yaml`` is one.

The format, after camodocal's ``camera_models``; ``model_type`` says which, in any case:

* ``PINHOLE``: ``projection_parameters`` fx fy cx cy, ``distortion_parameters`` k1 k2 p1 p2.
* ``MEI``: ``mirror_parameters`` xi, ``distortion_parameters`` k1 k2 p1 p2, ``projection_parameters`` gamma1 gamma2
  u0 v0.
* ``KANNALA_BRANDT``: ``projection_parameters`` k2 k3 k4 k5 mu mv u0 v0. Their k2 to k5 are k1 to k4 elsewhere.
* ``SCARAMUZZA``: ``poly_parameters`` p0 p1 ..., ``affine_parameters`` ac ad ae cx cy. Unlike in OCamCalib's own files
  x runs along the **columns**: u = ac x + ad y + cx, v = ae x + y + cy. The forward polynomial is the definition;
  ``inv_poly_parameters`` is a fit of it and is not used.

Pixel (0, 0) is a pixel's centre, axes optical (x right, y down, z forward).

Settings of VINS name their camera files (``cam0_calib: "cam0.yaml"``), which are looked for beside them, and have
``body_T_cam0`` (4x4), or ``extrinsicRotation`` and ``extrinsicTranslation``, which take points of the **camera to the
IMU**. VINS-Mono's have the camera's own keys in the same file.

A file knows no road and no vehicle: ``vehicle_from_imu=`` says how the IMU stands on the vehicle (x forward, y left,
z up); without it the first camera is at the origin and looks along +x, and ``ground=`` is minus its height.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, KannalaBrandt, Mei, Ocam
from ipm_rs.calibration import kitti_360
from ipm_rs.calibration._bodies import on_body, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, pinhole, rigid, rotation
from ipm_rs.calibration._files import Document, Source, open_document, same_size
from ipm_rs.calibration._opencvlens import three
from ipm_rs.calibration._plain import has, plain_section, tree_missing
from ipm_rs.errors import ArgumentError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "camodocal"
KEYS = (
    "model_type", "camera_name", "image_width", "image_height", "distortion_parameters", "projection_parameters",
    "mirror_parameters", "poly_parameters", "affine_parameters", "body_T_cam0", "cam0_calib", "extrinsicRotation",
    "extrinsicTranslation",
)  # fmt: skip

_MODELS = ("PINHOLE", "MEI", "KANNALA_BRANDT", "SCARAMUZZA")
_CALIB = re.compile(r"cam([0-9])_calib")
_BROWN = ("k1", "k2", "p1", "p2")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = tree_missing(document)
    if lacks is not None:
        return lacks
    tree = document.tree
    if _named(tree) and not document.is_json:
        return None
    if kitti_360.missing(document) is None:  # its fisheyes, beside its other files
        return f"{kitti_360.TITLE}'s"
    if not has(tree, "model_type"):
        return "no key 'model_type'"
    parts = ("projection_parameters", "affine_parameters")
    return None if any(isinstance(tree.get(part), Mapping) for part in parts) else f"no key {' or '.join(parts)}"


def cameras(document: Document) -> list[str]:
    """Names of the cameras of settings, as ``camera=`` takes them; none where there is one."""
    return [key.removesuffix("_calib") for key in _named(document.tree)]


def _named(content: Mapping[Any, Any]) -> list[str]:
    """Keys by which settings name the files of their cameras."""
    return sorted(key for key in content if isinstance(key, str) and _CALIB.fullmatch(key))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | int | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_imu: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera file of camodocal, or a camera of the settings of VINS.

    Parameters
    ----------
    source : str, path or mapping
        A camera's file, or settings that name one (both need the extra ``yaml``); or a camera's content as a mapping.
    camera : str or int, optional
        0 or 1, or "cam0" or "cam1": which of the settings'; needed if they name more than one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_imu : (4, 4) array, optional
        Pose of the IMU in the vehicle frame, for settings with ``body_T_cam0``.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Where ``vehicle_from_imu`` and the settings put it, else as seen from the first, which looks along +x.

    Raises
    ------
    MissingFileError, FileError
        A file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the model is none of the four.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    MissingExtraError
        PyYAML is not installed.
    """
    check_word("camera", camera)
    content = plain_section(source, TITLE)
    content.nearest = nearest_rotation
    files = _named(content.content)
    index = 0
    place = content
    if files:
        index = pick([key.removesuffix("_calib") for key in files], camera, content.origin)
        place = _beside(source, content, files[index])
    elif camera is not None:
        raise ArgumentError(
            f"{content.origin}: camera: expected none, the file holds one camera, got {camera!r}; drop it"
        )
    size = place.image_size("image_width", "image_height")
    same_size(image_size, size, place.origin)
    K, lens = _model(place)
    poses = [_body_from_camera(content, number) for number in range(max(len(files), 1))]
    own, first = poses[index], poses[0]
    if own is None or first is None:
        if vehicle_from_imu is not None or index:
            raise CalibrationError(
                f"{content.origin}: expected body_T_cam{index} and body_T_cam0, which "
                f"{'camera' if index else 'vehicle_from_imu'}= needs, missing; pass the settings that have them"
            )
        own = first = np.eye(4)
    pose = on_body(own, first, vehicle_from_imu, "vehicle_from_imu", nearest=nearest_rotation)
    return build(place.origin, K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _beside(source: Any, settings: Section, key: str) -> Section:
    """Content of the camera's file that settings name."""
    name = settings.text(key)
    if isinstance(source, Mapping):
        raise CalibrationError(f"{settings.where(key)}: expected a path to read it from, got a mapping; pass the file")
    path = open_document(source, TITLE).path.parent / name
    place = plain_section(str(path), TITLE)
    if _named(place.content):
        raise CalibrationError(f"{place.origin}: expected a camera's file, got settings; correct {key}")
    place.nearest = settings.nearest
    return place


def _body_from_camera(content: Section, number: int) -> Matrix | None:
    if f"body_T_cam{number}" in content:
        return content.pose(f"body_T_cam{number}")
    if number == 0 and "extrinsicRotation" in content and "extrinsicTranslation" in content:
        R = rotation(content.value("extrinsicRotation"), content.where("extrinsicRotation"), nearest=content.nearest)
        return rigid(R, three(content.value("extrinsicTranslation"), content.where("extrinsicTranslation")))
    return None


def _model(place: Section) -> tuple[Matrix, Any]:
    word = place.text("model_type").upper()
    if word not in _MODELS:
        place.text("model_type", among=_MODELS)
    if word == "SCARAMUZZA":
        return _scaramuzza(place)
    focal = place.section("projection_parameters")
    names = {"PINHOLE": ("fx", "fy", "cx", "cy"), "MEI": ("gamma1", "gamma2", "u0", "v0")}.get(
        word, ("mu", "mv", "u0", "v0")
    )
    focal.require(*names)
    K = pinhole(*(focal.number(key, unit="pixels") for key in names))
    if word == "KANNALA_BRANDT":
        focal.require("k2", "k3", "k4", "k5")
        with blame(focal.where()):
            return K, KannalaBrandt([focal.number(key) for key in ("k2", "k3", "k4", "k5")])
    distortion = place.section("distortion_parameters")
    distortion.require(*_BROWN)
    terms = [distortion.number(key) for key in _BROWN]
    with blame(distortion.where()):
        if word == "MEI":
            return K, Mei(place.section("mirror_parameters").number("xi"), terms)
        return K, BrownConrady(terms) if any(terms) else None


def _scaramuzza(place: Section) -> tuple[Matrix, Ocam]:
    values, affine = place.section("poly_parameters"), place.section("affine_parameters")
    affine.require("ac", "ad", "ae", "cx", "cy")
    count = len(values.content)
    polynomial = [values.number(f"p{power}") for power in range(max(count, 2))]
    c, d, e = (affine.number(key) for key in ("ac", "ad", "ae"))
    if c == 0:
        raise CalibrationError(f"{affine.where('ac')}: expected a number near 1, got 0; correct it")
    # Ours is u = x + e y, v = d x + c y before K: ac goes into K.
    with blame(place.origin):
        lens = Ocam(polynomial, (1.0, e, d / c))
    K = np.array([[c, 0.0, affine.number("cx")], [0.0, 1.0, affine.number("cy")], [0.0, 0.0, 1.0]])
    return K, lens
