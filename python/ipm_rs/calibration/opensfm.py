"""OpenSfM (also of WebODM, Mapillary): ``reconstruction.json`` and ``camera_models.json``.

The format, after OpenSfM's documentation of geometric models and its ``io.py``:

* ``cameras``: ``projection_type``, ``width``, ``height`` and the model's numbers: ``perspective`` (``focal``, k1, k2),
  ``simple_radial`` and ``radial`` (``focal_x``, ``focal_y``, ``c_x``, ``c_y``, k1[, k2]), ``brown`` (with k1, k2, k3,
  p1, p2), ``fisheye`` (``focal``, k1, k2), ``fisheye_opencv`` (k1 to k4). Others are refused.
* Focal lengths and ``c_x``, ``c_y`` are **normalised**: by the longer side of the image, from its middle. Pixel (0, 0)
  is a pixel's centre: ``cx = c_x max(w, h) + (w - 1) / 2``.
* ``shots``: for each image ``camera``, ``rotation`` (angle times axis, radians) and ``translation``, which take points
  of the world to the camera (optical axes: x right, y down, z forward), metres where GPS was there.
* The world is x east, y north, z up with GPS, else whatever came out, with z up and the ground near 0.
  ``vehicle_from_world=`` says how it stands in the vehicle frame (x forward, y left, z up); without it the world is
  taken for the vehicle frame, and the road's height in it is ``ground=``. A camera of ``camera_models.json`` is at the
  origin and looks along +x.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, KannalaBrandt
from ipm_rs.calibration._bodies import pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, describe, inverse, pinhole, rigid
from ipm_rs.calibration._files import Document, needs_size, open_document, same_size
from ipm_rs.calibration._mount import metric, mounted, rigid_argument
from ipm_rs.calibration._plain import has
from ipm_rs.calibration._rotations import rodrigues
from ipm_rs.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "OpenSfM"
KEYS = ("cameras", "shots", "projection_type", "focal", "focal_x", "c_x", "rotation", "translation", "camera", "points")

_TERMS = {
    "perspective": ("k1", "k2"),
    "simple_radial": ("k1",),
    "radial": ("k1", "k2"),
    "brown": ("k1", "k2", "p1", "p2", "k3"),
    "fisheye": ("k1", "k2"),
    "fisheye_opencv": ("k1", "k2", "k3", "k4"),
}
_ONE_FOCAL = ("perspective", "fisheye")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if document.is_directory or not document.is_json:
        return "not JSON"
    content = document.json
    parts = content if isinstance(content, list) else [content]
    if not parts or not all(isinstance(part, Mapping) for part in parts):
        return "no reconstruction"
    models = parts[0].get("cameras", parts[0])
    if (
        not isinstance(models, Mapping)
        or not models
        or not all(has(model, "projection_type") for model in models.values())
    ):
        return "no cameras with 'projection_type'"
    return None


def cameras(document: Document) -> list[str]:
    """Names of the shots, as ``camera=`` takes them; of the cameras where there are no shots."""
    return list(_entries(document.origin, document.json))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Any,
    *,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_world: ArrayLike | None = None,
    metres_per_unit: float = 1.0,
) -> Camera:
    """Read the camera of one shot.

    Parameters
    ----------
    source : str, path, mapping or list
        ``reconstruction.json`` or ``camera_models.json``, or its content.
    camera : str, optional
        The shot (the image's name), or the camera in ``camera_models.json``; needed if there is more than one.
    image_size : (int, int), optional
        Width and height in pixels; needed if the file has no ``width`` and ``height``, and must agree if it has them.
    vehicle_from_world : (4, 4) array, optional
        Where the world, its lengths in metres, stands in the vehicle frame. Without it the world is taken for the
        vehicle frame.
    metres_per_unit : float
        Length of the world's unit in metres, where there was no GPS.

    Returns
    -------
    Camera

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the model has no lens here.
    ArgumentError, ArgumentTypeError
        There is no such shot; an argument is wrong.
    """
    check_word("camera", camera)
    if isinstance(source, (Mapping, list, tuple)):
        origin, content = f"{TITLE} calibration", source
    else:
        document = open_document(source, TITLE, or_mapping=True)
        origin, content = document.origin, document.json
    entries = _entries(origin, content)
    names = list(entries)
    if not names:
        raise CalibrationError(f"{origin}: expected cameras or shots, got none; pass reconstruction.json")
    model, shot = entries[names[pick(names, camera, origin)]]
    if "width" in model and "height" in model:
        size = model.image_size("width", "height")
        same_size(image_size, size, origin)
    else:
        size = needs_size(image_size, origin, "the file has no width and height: take the image's")
    kind = model.text("projection_type", among=tuple(_TERMS))
    lens, K = _lens(model, kind), _intrinsics(model, kind, size)
    if shot is None:
        pose = mounted(None, None)
    else:
        turn, shift = shot.numbers("rotation", 3, unit="radians"), shot.numbers("translation", 3, unit="metres")
        world_from_camera = metric(inverse(rigid(rodrigues(turn), shift)), metres_per_unit)
        pose = inverse(world_from_camera) @ inverse(rigid_argument(vehicle_from_world, "vehicle_from_world"))
    return build(model.where(), K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _entries(origin: str, content: Any) -> dict[str, tuple[Section, Section | None]]:
    """Model and shot of each image; of each camera where there are no shots."""
    parts = content if isinstance(content, (list, tuple)) else [content]
    found: dict[str, tuple[Section, Section | None]] = {}
    for index, part in enumerate(parts):
        path = f"[{index}]" if isinstance(content, (list, tuple)) else ""
        place = Section(part, origin, path)
        models = place.section("cameras") if "cameras" in place else place
        if "shots" not in place or not place.section("shots").content:
            found |= {str(name): (models.section(str(name)), None) for name in models.content}
            continue
        shots = place.section("shots")
        for name in shots.content:
            shot = shots.section(str(name))
            found[str(name)] = (_model(models, shot), shot)
    return found


def _model(models: Section, shot: Section) -> Section:
    name = shot.text("camera")
    if name not in models:
        raise CalibrationError(f"{shot.where('camera')}: expected one of the cameras, got {describe(name)}; correct it")
    return models.section(name)


def _intrinsics(model: Section, kind: str, size: Any) -> Matrix:
    try:
        width, height = (float(side) for side in size)
    except (TypeError, ValueError):  # the camera says what is wrong with it
        width = height = 1.0
    longer = max(width, height)
    keys = ("focal", "focal") if kind in _ONE_FOCAL else ("focal_x", "focal_y")
    fx, fy = (longer * model.number(key, positive=True) for key in keys)
    offsets = (0.0, 0.0) if kind in _ONE_FOCAL else tuple(_or_zero(model, key) for key in ("c_x", "c_y"))
    return pinhole(fx, fy, longer * offsets[0] + (width - 1) / 2, longer * offsets[1] + (height - 1) / 2)


def _lens(model: Section, kind: str) -> Any:
    terms = [_or_zero(model, key) for key in _TERMS[kind]]
    with blame(model.where()):
        if kind.startswith("fisheye"):
            return KannalaBrandt((terms + [0.0] * 4)[:4])
        return BrownConrady(terms if len(terms) == 5 else (terms + [0.0] * 4)[:4]) if any(terms) else None


def _or_zero(model: Section, key: str) -> float:
    return model.number(key) if key in model else 0.0
