"""DepthAI's calibration of OAK cameras: ``dai.CalibrationHandler.eepromToJsonFile()``, ``depthai_calib.json``.

The format, after DepthAI's ``EepromData`` and ``CalibrationHandler``. ``cameraData`` is a list of pairs, a socket's
number (0 is CAM_A, the colour camera of most devices; 1 CAM_B, left; 2 CAM_C, right) and

* ``width``, ``height``, ``intrinsicMatrix`` (3x3, by rows), in pixels of that size; pixel (0, 0) is a pixel's centre.
* ``distortionCoeff``: for ``cameraType`` 0 (perspective) OpenCV's fourteen, k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty;
  for 1 (fisheye) k1 k2 k3 k4 of ``cv2.fisheye``. Other types have no lens here.
* ``extrinsics``: ``rotationMatrix`` and ``translation`` (x, y, z in **centimetres**; ``lengthUnit`` of version 8: 0
  metre, 1 centimetre, 2 millimetre, 3 inch, 4 foot) take points of this camera to that of ``toCameraSocket``; -1 is the
  end of the chain. Axes are optical (x right, y down, z forward). ``specTranslation`` is the drawing's, and not used.

The file knows no road and no vehicle: ``vehicle_from_base=`` is the pose of the camera at the chain's end in the
vehicle frame (x forward, y left, z up); without it that camera is at the origin and looks along +x, and ``ground=`` is
minus its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, KannalaBrandt
from ipm_rs.calibration._bodies import on_body, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, coefficients, describe, rigid
from ipm_rs.calibration._files import Document, Source, keys_missing, read_json, same_size
from ipm_rs.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "DepthAI"
KEYS = (
    "cameraData", "boardName", "intrinsicMatrix", "distortionCoeff", "extrinsics", "toCameraSocket", "rotationMatrix",
    "translation", "specHfovDeg", "stereoRectificationData",
)  # fmt: skip

_UNITS = (1.0, 0.01, 0.001, 0.0254, 0.3048)
_CENTIMETRE = 1


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacks = keys_missing(document, "cameraData")
    return lacks or (None if isinstance(document.json["cameraData"], list) else "no list 'cameraData'")


def cameras(document: Document) -> list[str]:
    """Sockets of the calibrated cameras, as ``camera=`` takes them."""
    return [socket for socket, place in _sockets(read_json(document, TITLE)).items() if _calibrated(place)]


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: int | str | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_base: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of an OAK device.

    Parameters
    ----------
    source : str, path or mapping
        The JSON file, or its content as a mapping.
    camera : int or str, optional
        Its socket: 0, 1, 2 or "CAM_A", "CAM_B", "CAM_C"; needed if more than one is calibrated.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_base : (4, 4) array, optional
        Pose in the vehicle frame of the camera to which the chain of ``toCameraSocket`` leads (optical axes).
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Where ``vehicle_from_base`` and the chain put it, else as seen from the chain's end, which looks along +x.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the camera's type has no lens here.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    """
    check_word("camera", camera)
    content = read_json(source, TITLE)
    content.nearest = nearest_rotation
    sockets = _sockets(content)
    known = [socket for socket, place in sockets.items() if _calibrated(place)]
    if not known:
        raise CalibrationError(
            f"{content.where('cameraData')}: expected a camera with intrinsicMatrix, got none; calibrate the device"
        )
    if isinstance(camera, str) and len(camera) == 5 and camera.upper().startswith("CAM_"):
        camera = str(ord(camera[-1].upper()) - ord("A"))
    socket = known[pick(known, str(camera) if isinstance(camera, int) else camera, content.origin)]
    place = sockets[socket]
    size = place.image_size("width", "height")
    same_size(image_size, size, content.origin)
    K = place.matrix("intrinsicMatrix", (3, 3), unit="pixels")
    lens = _lens(place)
    pose = on_body(
        _base_from_camera(sockets, socket), np.eye(4), vehicle_from_base, "vehicle_from_base", nearest=nearest_rotation
    )
    return build(place.where(), K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _sockets(content: Section) -> dict[str, Section]:
    pairs = content.value("cameraData")
    found: dict[str, Section] = {}
    for index, pair in enumerate(pairs if isinstance(pairs, (list, tuple)) else [pairs]):
        where = f"cameraData[{index}]"
        if not isinstance(pair, (list, tuple)) or len(pair) != 2 or not isinstance(pair[0], (int, float)):
            raise CalibrationError(
                f"{content.where(where)}: expected a socket's number and its camera, got {describe(pair)}; fetch the "
                "file from the device again"
            )
        if str(int(pair[0])) in found:
            raise CalibrationError(
                f"{content.where(where)}: expected every socket once, got {pair[0]!r} again; keep one"
            )
        found[str(int(pair[0]))] = Section(pair[1], content.origin, where, nearest=content.nearest)
    return found


def _calibrated(place: Section) -> bool:
    values = place.content.get("intrinsicMatrix")
    return bool(values) and values != [[0.0] * 3] * 3


def _lens(place: Section) -> Any:
    kind = place.whole("cameraType") if "cameraType" in place else 0
    values = place.value("distortionCoeff")
    where = place.where("distortionCoeff")
    if kind not in (0, 1):
        raise CalibrationError(
            f"{place.where('cameraType')}: expected 0 (perspective) or 1 (fisheye), got {kind}, which has no lens; "
            "calibrate with one of these"
        )
    if kind == 1:
        with blame(where):
            return KannalaBrandt(coefficients(values, where, (4,)))
    terms = coefficients(values, where, (0, 4, 5, 8, 12, 14))
    with blame(where):
        return BrownConrady(terms) if terms.any() else None


def _base_from_camera(sockets: dict[str, Section], socket: str) -> Matrix:
    """Along the chain of ``toCameraSocket``, in metres."""
    T = np.eye(4)
    for _ in range(len(sockets) + 1):
        place = sockets[socket]
        if "extrinsics" not in place:
            return T
        step = place.section("extrinsics")
        target = step.whole("toCameraSocket", minimum=-1) if "toCameraSocket" in step else -1
        if target == -1:
            return T
        unit = step.whole("lengthUnit") if "lengthUnit" in step else _CENTIMETRE
        if unit >= len(_UNITS):
            raise CalibrationError(
                f"{step.where('lengthUnit')}: expected 0 to {len(_UNITS) - 1}, got {unit}; correct it"
            )
        vector = step.section("translation")
        t = [_UNITS[unit] * vector.number(axis) for axis in "xyz"]
        T = rigid(step.rotation("rotationMatrix"), t) @ T
        if str(target) not in sockets:
            raise CalibrationError(
                f"{step.where('toCameraSocket')}: expected one of {', '.join(sockets)}, got {target}; fetch the file "
                "again"
            )
        socket = str(target)
    raise CalibrationError(
        f"{sockets[socket].where('extrinsics')}: expected a chain of cameras that ends, got a circle; fetch the file "
        "again"
    )
