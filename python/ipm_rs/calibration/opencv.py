"""OpenCV calibrations in ``cv2.FileStorage`` files: YAML, JSON or XML, of one camera or of a stereo pair.

OpenCV fixes how a matrix is written, not what it is called. These names are known, in any case, with or without
underscores:

=============  ====================================================================================================
what           names
=============  ====================================================================================================
K (3x3)        ``camera_matrix, cameraMatrix, intrinsic_matrix, intrinsics, mtx, K, M``
distortion     ``distortion_coefficients, distortion_coeffs, distortion, dist_coeffs, dist_coefs, dist, D``, or one
               coefficient less: ``dist_coeff``
size           ``image_width`` and ``image_height``, or two numbers ``image_size, resolution, frame_size, size``
pose           ``rvec`` (3 numbers or a 3x3 rotation) and ``tvec``
stereo         K and D with ``1`` or ``2``, ``left`` or ``right`` at the end or the start (``M1, D1, K_left``); ``R, T``
rectified      ``R1, P1, R2, P2``
=============  ====================================================================================================

* Distortion is Brown-Conrady (4, 5, 8, 12 or 14 terms in OpenCV's order) for ``cv2.calibrateCamera``, k1..k4 for
  ``cv2.fisheye``, and with ``xi`` for ``cv2.omnidir``. **Four numbers alone may be either of the first two**: then
  ``lens=`` must say which, unless the file does (``distortion_model``, ``camera_model``, ``model``, ``fisheye_model``).
  A file without any is refused, because they may be there under another name: ``lens="pinhole"`` says that there are
  none, or that the images went through ``cv2.undistort``, which keeps K.
* ``rvec, tvec`` take points of the user's world (often a chessboard) to the camera's optical axes (x right, y down,
  z forward). That world is taken for the vehicle frame; ``vehicle_from_world=`` and ``metres_per_unit=`` correct that.
  OpenCV's lengths are in the unit of the board's squares.
* In a pair, ``R, T`` take points of camera 1 to camera 2.
* Pixel (0, 0) is a pixel's centre.
* The file knows no vehicle (x forward, y left, z up) and no road: give the pose, or pass the road's height under the
  camera as ``ground=-height``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BrownConrady, Camera, KannalaBrandt, Mei
from ipm_rs.calibration import kalibr
from ipm_rs.calibration._checks import blame, describe, inverse, listed, matrix, numbers, rigid, rotation, whole
from ipm_rs.calibration._checks import image_size as checked_size
from ipm_rs.calibration._files import Document, Source, open_document, same_size
from ipm_rs.calibration._filestorage import parse_storage, plain
from ipm_rs.calibration._mount import metric, mounted, rigid_argument
from ipm_rs.errors import ArgumentError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["missing", "read"]

TITLE = "OpenCV"

_K = ("cameramatrix", "intrinsicmatrix", "intrinsics", "mtx", "k", "m")
_D = (
    "distortioncoefficients",
    *(word + ending for word in ("distortion", "dist") for ending in ("coeffs", "coeff", "coefs", "coef", "")),
    "d",
)
_SIZE = ("imagesize", "resolution", "framesize", "size")
_MODEL = ("distortionmodel", "cameramodel", "modeltype", "model", "fisheyemodel")
_SIDES = {"1": ("1", "left"), "2": ("2", "right")}
_LENSES = {
    "brown_conrady": ("brownconrady", "plumbbob", "radtan", "rationalpolynomial", "opencv"),
    "fisheye": ("fisheye", "equidistant", "kannalabrandt", "kb4", "opencvfisheye"),
    "omnidir": ("omnidir", "omni", "mei"),
}
_COUNTS = {"brown_conrady": (0, 4, 5, 8, 12, 14), "fisheye": (4,), "omnidir": (4, 5)}

# Where a name may have an underscore: camera_matrix, dist_coeffs.
_SYLLABLE = re.compile("camera|intrinsic|matrix|distortion|dist|coefficients|coeff?s?|intrinsics|mtx|[a-z]")

Matrix = NDArray[np.float64]


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    text = document.text.lstrip()
    written = "opencv-matrix" in text or text.startswith(("%YAML", "<?xml", "<opencv_storage"))
    if not written and not _has_key(text, _D):  # by hand, from plain lists
        return "no opencv-matrix"
    if not written and ("projection_matrix" in text or "rectification_matrix" in text):
        return "projection_matrix, so ROS's"
    if not written and kalibr.missing(document) is None:
        return "a section cam0, so Kalibr's"
    if "mirror_parameters" in text:
        return "mirror_parameters, so KITTI-360's"
    return None if _has_key(text, _K) else "no camera_matrix"


def _has_key(text: str, names: tuple[str, ...]) -> bool:
    """Whether the text has one of the names as a key of YAML, JSON or XML, of one camera or of one of a pair."""
    spelled = "|".join("[_-]?".join(_SYLLABLE.findall(name)) for name in names)
    side = "(?:1|2|left|right)"
    pattern = rf'(?:^[ \t]*|[<"])(?:{side}[_-]?)?(?:{spelled})(?:[_-]?{side})?(?:"?[ \t]*:|[ \t]+type_id|>)'
    return re.search(pattern, text, re.MULTILINE | re.IGNORECASE) is not None


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | int | None = None,
    image_size: tuple[int, int] | None = None,
    lens: Literal["brown_conrady", "fisheye", "omnidir", "pinhole"] | None = None,
    extrinsics: Source | None = None,
    rectified: bool = False,
    camera_from_vehicle: ArrayLike | None = None,
    vehicle_from_camera: ArrayLike | None = None,
    vehicle_from_world: ArrayLike | None = None,
    metres_per_unit: float = 1.0,
) -> Camera:
    """Read a calibration made with OpenCV.

    Parameters
    ----------
    source : str, path or mapping
        A FileStorage file (its YAML form needs the extra ``yaml``), or its content as a mapping of arrays.
    camera : str or int, optional
        1 or "left", 2 or "right": which of a stereo pair.
    image_size : (int, int), optional
        Width and height in pixels; needed if the file lacks them, and must agree if it has them.
    lens : str, optional
        "brown_conrady", "fisheye" or "omnidir", the module of OpenCV that made the file; needed where it is not clear.
        "pinhole": no lens, for images that ``cv2.undistort`` made, or a file that has no coefficients.
    extrinsics : str, path or mapping, optional
        The second file of a stereo calibration, with ``R, T, R1, P1, ...``.
    rectified : bool
        Whether the images of a stereo pair went through ``cv2.stereoRectify`` and ``cv2.remap``.
    camera_from_vehicle, vehicle_from_camera : (4, 4) array, optional
        Pose of the (first) camera, in place of the file's; with neither, and none in the file, the camera is at the
        origin and looks along +x.
    vehicle_from_world : (4, 4) array, optional
        Where the world of ``rvec, tvec``, its lengths in metres, stands in the vehicle frame.
    metres_per_unit : float
        Length of the unit of ``tvec`` and ``T`` in metres: 0.001 where squares were measured in millimetres.

    Returns
    -------
    Camera
        Of the raw image with its lens; of the rectified one without.

    Raises
    ------
    MissingFileError, FileError
        A file does not exist, or cannot be read.
    CalibrationError
        A matrix is missing, ambiguous, or cannot be right.
    ArgumentError, ArgumentTypeError
        `lens` or `camera` is needed or wrong; poses are given twice.
    MissingExtraError
        PyYAML is not installed.
    """
    if lens is not None and (not isinstance(lens, str) or lens not in (*_LENSES, "pinhole")):
        raise ArgumentError(
            f"lens: expected one of {listed((*_LENSES, 'pinhole'))}, got {lens!r:.60}; name OpenCV's module"
        )
    values = _Named(source, extrinsics)
    side = _side(values, camera)
    size = _size(values, image_size)
    given = camera_from_vehicle is not None or vehicle_from_camera is not None
    if given and vehicle_from_world is not None:
        raise ArgumentError(
            "vehicle_from_world: expected it without camera_from_vehicle or vehicle_from_camera, got both; drop one"
        )
    pose = None if given else _world_pose(values, metres_per_unit, vehicle_from_world)
    if pose is None:
        if vehicle_from_world is not None:
            raise CalibrationError(
                f"{values.origin}: expected rvec and tvec, which vehicle_from_world= needs, missing; pass "
                "vehicle_from_camera="
            )
        pose = mounted(camera_from_vehicle, vehicle_from_camera)
    if side == "2":
        R, T = (values.get(name) for name in ("r", "t"))
        if R is None or T is None:
            raise CalibrationError(
                f"{values.origin}: expected R and T from camera 1 to camera 2, missing; pass the file that has them as "
                "extrinsics="
            )
        pose = metric(rigid(rotation(*R), _three(*T)), metres_per_unit) @ pose
    model: Any = None
    if rectified:
        K, turn = _rectified(values, side)
        pose = rigid(turn, np.zeros(3)) @ pose
    else:
        K = matrix(*_one(values, _K, side, "camera_matrix"), (3, 3), unit="pixels")
        with blame(values.origin):
            model = _lens(values, side, lens)
    with blame(values.origin):
        return Camera(K, image_size=size, camera_from_vehicle=pose, lens=model)


class _Named:
    """Values by their name in lower case without underscores, each with its place for messages."""

    def __init__(self, source: Source, extrinsics: Source | None) -> None:
        self.values: dict[str, tuple[Any, str]] = {}
        self.spelled: list[str] = []
        self.origin = ""
        for part, name in ((source, "source"), (extrinsics, "extrinsics")):
            if part is None and name == "extrinsics":
                continue
            if isinstance(part, Mapping):
                origin = f"{TITLE} calibration"
                content = plain(part, origin)
            else:
                document = open_document(part, TITLE, or_mapping=True, argument=name)
                origin, content = document.origin, parse_storage(document.text, document.origin)
            self.origin = self.origin or origin
            self.add(content, origin)

    def add(self, content: Any, origin: str) -> None:
        if not isinstance(content, Mapping):
            raise CalibrationError(
                f"{origin}: expected named matrices, got {describe(content)}; pass a FileStorage file"
            )
        for key, value in content.items():
            name = str(key).lower().replace("_", "").replace("-", "")
            where = f"{origin}: {key}"
            if name in self.values:
                raise CalibrationError(f"{where}: expected once, got it beside {self.values[name][1]}; keep one")
            self.values[name] = value, where
            self.spelled.append(str(key))

    def get(self, name: str) -> tuple[Any, str] | None:
        return self.values.get(name)


def _variants(names: tuple[str, ...], side: str | None) -> list[str]:
    if side is None:
        return list(names)
    return [variant for name in names for mark in _SIDES[side] for variant in (name + mark, mark + name)]


def _find(values: _Named, names: tuple[str, ...], side: str | None) -> list[tuple[Any, str]]:
    return [found for name in _variants(names, side) if (found := values.get(name)) is not None]


def _one(values: _Named, names: tuple[str, ...], side: str | None, title: str) -> tuple[Any, str]:
    """Return the one value among several names; none and several are errors."""
    found = _find(values, names, side)
    if len(found) > 1:
        got = " and ".join(where.rpartition(": ")[2] for _, where in found)
        raise CalibrationError(f"{values.origin}: expected one {title}, got {got}; keep one")
    if not found:
        of = "" if side is None else f" of camera {side}"
        raise CalibrationError(
            f"{values.origin}: expected {title}{of}, missing among {listed(values.spelled)}; "
            f"rename the matrix to {title}{side or ''}"
        )
    return found[0]


def _side(values: _Named, camera: str | int | None) -> str | None:
    """Return "1", "2", or None for a file of one camera."""
    pair = [side for side in _SIDES if _find(values, _K, side)]
    if camera is None:
        if pair and not _find(values, _K, None):
            if len(pair) == 1:
                return pair[0]
            raise ArgumentError(
                f"{values.origin}: camera: expected 1 (left) or 2 (right), got None; "
                "the file holds a pair, say which to read"
            )
        return None
    side = next((key for key, marks in _SIDES.items() if str(camera).lower() in marks), None)
    if side is None or isinstance(camera, bool) or side not in pair:
        known = " or ".join(f"{key} ({_SIDES[key][1]})" for key in pair) or "none, for the file holds one camera"
        raise ArgumentError(f"{values.origin}: camera: expected {known}, got {camera!r:.60}; correct or drop it")
    return side


def _size(values: _Named, given: tuple[int, int] | None) -> tuple[int, int]:
    sizes = set()
    for name in _SIZE:
        found = values.get(name)
        if found is not None:
            w, h = _three(*found, count=2)
            sizes.add(checked_size(w, h, found[1]))
    width, height = (
        next((found for name in names if (found := values.get(name)) is not None), None)
        for names in (("imagewidth", "width"), ("imageheight", "height"))
    )
    if width is not None and height is not None:
        sizes.add((whole(*width, minimum=1), whole(*height, minimum=1)))
    if len(sizes) > 1:
        got = " and ".join(f"{w}x{h}" for w, h in sorted(sizes))
        raise CalibrationError(f"{values.origin}: expected one image size, got {got}; keep the one of the images")
    if not sizes:
        if given is None:
            raise CalibrationError(
                f"{values.origin}: expected image_width and image_height, missing; pass image_size=(width, height)"
            )
        return given
    size = sizes.pop()
    same_size(given, size, values.origin)
    return size


def _three(value: Any, where: str, count: int = 3) -> Matrix:
    """Three numbers, written as a row, a column or a list."""
    return numbers(_flat(value), where, count)


def _flat(value: Any) -> Any:
    """Make a list of a matrix of one row or one column, given as an array or as nested lists; leave the rest."""
    if isinstance(value, np.ndarray):
        return value.ravel().tolist()
    if isinstance(value, (list, tuple)) and len(value) == 1 and isinstance(value[0], (list, tuple)):
        return value[0]
    if isinstance(value, (list, tuple)) and value and all(isinstance(x, (list, tuple)) and len(x) == 1 for x in value):
        return [item[0] for item in value]
    return value


def _world_pose(values: _Named, metres_per_unit: float, vehicle_from_world: ArrayLike | None) -> Matrix | None:
    """``camera_from_vehicle`` of the file's rvec and tvec; None where it has none."""
    rvec, tvec = values.get("rvec"), values.get("tvec")
    if rvec is None and tvec is None:
        return None
    if rvec is None or tvec is None:
        raise CalibrationError(f"{values.origin}: expected rvec and tvec, got one of them; add the other")
    flat = _flat(rvec[0])
    if isinstance(flat, (list, tuple)) and (len(flat) == 9 or any(isinstance(row, (list, tuple)) for row in flat)):
        R = rotation(flat, rvec[1])
    else:
        R = _rodrigues(numbers(flat, rvec[1], 3))
    world = rigid_argument(vehicle_from_world, "vehicle_from_world")
    return metric(rigid(R, _three(*tvec)), metres_per_unit) @ inverse(world)


def _rodrigues(rvec: Matrix) -> Matrix:
    """Rotation by |rvec| radians about rvec, after Rodrigues."""
    angle = math.hypot(*rvec)
    if angle == 0:
        return np.eye(3)
    x, y, z = rvec / angle
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result: Matrix = np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * (across @ across)
    return result


def _rectified(values: _Named, side: str | None) -> tuple[Matrix, Matrix]:
    """K of the rectified image, and the rotation into its axes."""
    if side is None:
        raise ArgumentError(
            "rectified, camera: expected a stereo pair's camera 1 or 2, got one camera; drop rectified="
        )
    P = matrix(*_one(values, (f"p{side}",), None, f"P{side}"), (3, 4), unit="pixels")
    # P2's fourth column is the baseline seen from camera 1. The pose came through R and T, which hold it already.
    return P[:, :3].copy(), rotation(*_one(values, (f"r{side}",), None, f"R{side}"))


def _lens(values: _Named, side: str | None, lens: str | None) -> BrownConrady | KannalaBrandt | Mei | None:
    if lens == "pinhole":
        return None
    stated = _stated(values)
    xi = next(iter(_find(values, ("xi",), side)), None)
    if lens is not None and stated is not None and lens != stated[0]:
        raise ArgumentError(f"lens: expected {stated[0]!r}, which {stated[1]} states, got {lens!r}; drop the argument")
    kind = lens or (stated[0] if stated else None) or ("omnidir" if xi is not None else None)
    found = _find(values, _D, side)
    if not found:
        of = "" if side is None else f" of camera {side}"
        raise CalibrationError(
            f"{values.origin}: expected distortion_coefficients{of}, missing among {listed(values.spelled)}; rename "
            f"them to distortion_coefficients{side or ''}, or pass lens='pinhole' if there are none"
        )
    value, where = _one(values, _D, side, "distortion_coefficients")
    coefficients = numbers(_flat(value), where)
    if kind is None:
        if len(coefficients) == 4 and coefficients.any():
            raise ArgumentError(
                f"{where}: lens: expected 'brown_conrady' (k1, k2, p1, p2) or 'fisheye' (k1 to k4), got None and four "
                "numbers that may be either; pass lens='fisheye' if cv2.fisheye made them, or lens='brown_conrady' if "
                "cv2.calibrateCamera did"
            )
        kind = "brown_conrady"
    coefficients = numbers(coefficients, f"{where} ({kind})", _COUNTS[kind])
    if kind == "fisheye":
        return KannalaBrandt(coefficients)
    if kind == "brown_conrady":
        return BrownConrady(coefficients) if coefficients.any() else None
    if xi is None:
        raise CalibrationError(f"{values.origin}: expected xi beside the coefficients of cv2.omnidir, missing; add it")
    return Mei(float(numbers(np.ravel(_flat(xi[0])).tolist(), xi[1], 1)[0]), coefficients[:4])


def _stated(values: _Named) -> tuple[str, str] | None:
    """Return the lens that the file itself states, and where."""
    for name in _MODEL:
        found = values.get(name)
        if found is None:
            continue
        value, where = found
        if name == "fisheyemodel" and isinstance(value, (int, float)):
            return ("fisheye" if value else "brown_conrady"), where
        word = value.lower().replace("_", "").replace("-", "") if isinstance(value, str) else ""
        for lens, words in _LENSES.items():
            if word in words:
                return lens, where
        if name == "distortionmodel":  # other keys may hold the name of a product
            raise CalibrationError(
                f"{where}: expected a known lens such as brown_conrady, fisheye or omnidir, got {describe(value)}; "
                "correct it"
            )
    return None
