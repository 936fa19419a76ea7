"""Settings of ORB-SLAM2 and ORB-SLAM3 (``TUM1.yaml``, ``EuRoC.yaml``): ``Camera.fx`` or, from 1.0 on, ``Camera1.fx``.

The format, after ORB-SLAM3's documentation of its calibration and its parsers:

* ``Camera.fx fy cx cy`` (2 and the first of 3) or ``Camera1.*`` and ``Camera2.*`` (``File.version: "1.0"``), in pixels;
  pixel (0, 0) is a pixel's centre, axes optical (x right, y down, z forward).
* ``Camera.type``: ``PinHole`` with ``k1 k2 p1 p2`` and ``k3`` where it is there; ``KannalaBrandt8`` with ``k1`` to
  ``k4``; ``Rectified`` bends nothing. None is a pinhole.
* ``Camera.width, Camera.height`` are often absent: then ``image_size=`` is needed. ``Camera.newWidth`` is what the
  program shrinks images to; the camera is that of the file's images.
* ``Stereo.T_c1_c2`` (``Tlr`` in older files) takes points of the second camera to the first; ``IMU.T_b_c1`` (``Tbc``)
  those of the first camera to the IMU.
* In ``EuRoC.yaml`` of ORB-SLAM2 ``Camera.*`` is the pair after rectification by ``LEFT.*`` and ``RIGHT.*``.

The file knows no road and no vehicle: ``vehicle_from_imu=`` says how the IMU stands on the vehicle (x forward, y left,
z up); without it the first camera is at the origin and looks along +x, and ``ground=`` is minus its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, KannalaBrandt
from ipm_rs.calibration._bodies import on_body, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, pinhole
from ipm_rs.calibration._files import Document, Source, needs_size, same_size
from ipm_rs.calibration._plain import has, plain_section, tree_missing
from ipm_rs.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "ORB-SLAM"
KEYS = (
    "Camera.fx", "Camera.fy", "Camera.cx", "Camera.cy", "Camera.k1", "Camera1.fx", "Camera.type", "Camera.width",
    "Camera.fps", "ORBextractor.nFeatures", "Stereo.T_c1_c2", "IMU.T_b_c1", "Tbc",
)  # fmt: skip

_FOCAL = ("fx", "fy", "cx", "cy")
_SECOND = ("Stereo.T_c1_c2", "Tlr")
_IMU = ("IMU.T_b_c1", "Tbc")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    first = tree_missing(document, *(f"Camera.{key}" for key in _FOCAL))
    if first is None or tree_missing(document, *(f"Camera1.{key}" for key in _FOCAL)) is None:
        return None
    return first


def cameras(document: Document) -> list[str]:
    """Numbers of the cameras, as ``camera=`` takes them; none where there is one."""
    return ["1", "2"] if "Camera2.fx" in document.tree else []


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | int | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_imu: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera of ORB-SLAM's settings.

    Parameters
    ----------
    source : str, path or mapping
        The settings (need the extra ``yaml``), or their content as a mapping.
    camera : str or int, optional
        1 or 2; needed if the file holds both.
    image_size : (int, int), optional
        Width and height in pixels; needed if the file lacks ``Camera.width``, and must agree if it has it.
    vehicle_from_imu : (4, 4) array, optional
        Pose of the IMU in the vehicle frame, for files with ``IMU.T_b_c1`` or ``Tbc``.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Where ``vehicle_from_imu`` and the file put it, else as seen from the first, which looks along +x.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the camera's type has no lens here.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    MissingExtraError
        PyYAML is not installed.
    """
    check_word("camera", camera)
    content = plain_section(source, TITLE)
    content.nearest = nearest_rotation
    prefixes = [prefix for prefix in ("Camera1", "Camera2") if f"{prefix}.fx" in content]
    if "Camera.fx" in content:
        prefixes = ["Camera", *(prefix for prefix in prefixes if prefix == "Camera2")]
    if not prefixes:
        content.require("Camera.fx")
    prefix = prefixes[pick(["1", "2"][: len(prefixes)] if prefixes != ["Camera2"] else ["2"], camera, content.origin)]
    where = content.where(prefix)
    content.require(*(f"{prefix}.{key}" for key in _FOCAL))
    if "Camera.width" in content and "Camera.height" in content:
        size = content.image_size("Camera.width", "Camera.height")
        same_size(image_size, size, content.origin)
    else:
        size = needs_size(
            image_size, content.origin, "the file has no Camera.width and Camera.height: take the image's"
        )
    lens = _lens(content, prefix)
    first_from_camera = np.eye(4)
    if prefix == "Camera2":
        first_from_camera = _pose(content, _SECOND, "camera=2")
    body_from_first = _pose(content, _IMU, "vehicle_from_imu=") if vehicle_from_imu is not None else np.eye(4)
    pose = on_body(
        body_from_first @ first_from_camera, body_from_first, vehicle_from_imu, "vehicle_from_imu",
        nearest=nearest_rotation,
    )  # fmt: skip
    K = pinhole(*(content.number(f"{prefix}.{key}", unit="pixels") for key in _FOCAL))
    return build(where, K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _pose(content: Section, keys: tuple[str, ...], reason: str) -> Matrix:
    key = next((key for key in keys if key in content), None)
    if key is None:
        raise CalibrationError(f"{content.origin}: expected {' or '.join(keys)}, which {reason} needs, missing; add it")
    return content.pose(key)


def _lens(content: Section, prefix: str) -> Any:
    kind = "PinHole"
    if "Camera.type" in content:
        kind = content.text("Camera.type", among=("PinHole", "Pinhole", "KannalaBrandt8", "Rectified"))
    if kind == "KannalaBrandt8":
        names = [f"{prefix}.{key}" for key in ("k1", "k2", "k3", "k4")]
        content.require(*names)
        with blame(content.where(prefix)):
            return KannalaBrandt([content.number(name) for name in names])
    present = [key for key in ("k1", "k2", "p1", "p2", "k3") if f"{prefix}.{key}" in content]
    terms = [content.number(f"{prefix}.{key}") if key in present else 0.0 for key in ("k1", "k2", "p1", "p2", "k3")]
    if present and not has(content.content, f"{prefix}.k1"):
        content.require(f"{prefix}.k1")
    with blame(content.where(prefix)):
        return BrownConrady(terms if "k3" in present else terms[:4]) if any(terms) else None
