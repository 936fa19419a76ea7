"""OpenCV calibrations: ``cv2.FileStorage`` (YAML, JSON, XML), ``numpy.savez``, plain YAML and JSON; one camera or more.

OpenCV fixes how a matrix is written, not what it is called. These names are known, in any case, with or without
underscores:

=============  ====================================================================================================
what           names
=============  ====================================================================================================
K (3x3)        ``camera_matrix, cameraMatrix, CameraMat, camMatrix, intrinsic_matrix, intrinsics, mtx, K, M``
distortion     ``distortion_coefficients, distortion_coeffs, distortion, dist_coeffs, dist_coefs, dist, D``, or one
               coefficient less: ``dist_coeff, DistCoeff``
size           ``image_width`` and ``image_height``, or ``image_size, resolution, frame_size, size``: two numbers,
               ``{width, height}`` or ``{rows, cols}``
pose           ``rvec`` (3 numbers or a 3x3 rotation) and ``tvec``
stereo         K and D with ``1`` or ``2``, ``left`` or ``right``, ``L`` or ``R`` at the end or the start (``M1, D1,
               K_left``); ``R, T``
rectified      ``R1, P1, R2, P2``
=============  ====================================================================================================

* A file may have a section for each camera, ``{front: {K, D}, rear: {K, D}}``, or a list of them; ``camera=`` chooses.
* ``numpy.savez`` files (``.npz``) are read as far as they hold small arrays of numbers; nothing in them is unpickled.
* Distortion is Brown-Conrady (4, 5, 8, 12 or 14 terms in OpenCV's order) for ``cv2.calibrateCamera``, k1..k4 for
  ``cv2.fisheye``, and with ``xi`` for ``cv2.omnidir``. **Four numbers alone may be either of the first two**: then
  ``lens=`` must say which, unless the file does (``distortion_model``, ``camera_model``, ``model``, ``fisheye_model``).
  A file without any is refused, because they may be there under another name: ``lens="pinhole"`` says that there are
  none, or that the images went through ``cv2.undistort``, which keeps K. So is a lens that we do not have, by its name
  (``inverse_brown_conrady``, ``division``), unless all its coefficients are 0.
* ``rvec, tvec`` take points of the user's world (often a chessboard) to the camera's optical axes (x right, y down,
  z forward). That world is taken for the vehicle frame; ``vehicle_from_world=`` and ``metres_per_unit=`` correct that.
  OpenCV's lengths are in the unit of the board's squares: more than 20 are hardly metres, and are refused until
  ``metres_per_unit=`` says what they are.
* In a pair, ``R, T`` take points of camera 1 to camera 2.
* Pixel (0, 0) is a pixel's centre.
* The file knows no vehicle (x forward, y left, z up) and no road: give the pose, or pass the road's height under the
  camera as ``ground=-height``.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration import _names as names
from ipm_rs.calibration import _sections, a2d2, autoware, json, kalibr, matlab, pandaset, ros
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import blame, describe, inverse, listed, matrix, numbers, rigid, rotation
from ipm_rs.calibration._files import Document, Source, open_document
from ipm_rs.calibration._filestorage import plain
from ipm_rs.calibration._mount import metric, mounted, rigid_argument
from ipm_rs.calibration._names import Named
from ipm_rs.calibration._opencvlens import LENSES, flat, lens_of, size_of, three
from ipm_rs.calibration._rotations import rodrigues
from ipm_rs.errors import ArgumentError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "cameras", "missing", "read"]

TITLE = "OpenCV"
KEYS = (*names.K, *names.D, *names.SIZE, *names.WIDTH, *names.HEIGHT, "rvec", "tvec")

Matrix = NDArray[np.float64]


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if document.is_directory:
        return "a directory"
    for other in () if document.is_npz else (json, ros, kalibr, matlab, a2d2, pandaset, autoware):
        if other.missing(document) is None:
            return f"{other.TITLE}'s"
    tree = document.tree
    if not isinstance(tree, (Mapping, list)):
        return "no named values"
    if names.has_camera(tree) or _sections.sections(tree):
        return None
    content = tree if isinstance(tree, Mapping) and len(tree) <= names.MAX_KEYS else {}
    reasons = [
        f"{str(key)[:40]!r} is no 3x3 matrix: {why}"
        for key, value in content.items()
        if names.spelled(key) in names.K and (why := names.near_matrix(value)) is not None
    ]
    return reasons[0] if reasons else "no 3x3 camera_matrix"


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
    metres_per_unit: float | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a calibration made with OpenCV.

    Parameters
    ----------
    source : str, path or mapping
        A file of ``cv2.FileStorage`` or ``numpy.savez``, or YAML or JSON with the names above (YAML needs the extra
        ``yaml``); or its content as a mapping of arrays, such as ``dict(numpy.load(path))``.
    camera : str or int, optional
        1 or "left", 2 or "right": which of a stereo pair; or the name of a section.
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
    metres_per_unit : float, optional
        Length of the unit of ``tvec`` and ``T`` in metres: 0.001 where squares were measured in millimetres. Without it
        they are metres, if no longer than 20.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Of the raw image with its lens; of the rectified one without.

    Raises
    ------
    MissingFileError, FileError
        A file does not exist, or cannot be read.
    CalibrationError
        A matrix is missing, ambiguous, or cannot be right; the lens is one that we do not have; lengths that are hardly
        metres came without `metres_per_unit`.
    ArgumentError, ArgumentTypeError
        `lens` or `camera` is needed or wrong; poses are given twice.
    MissingExtraError
        PyYAML is not installed.
    """
    check_word("camera", camera)
    if lens is not None and (not isinstance(lens, str) or lens not in (*LENSES, "pinhole")):
        raise ArgumentError(
            f"lens: expected one of {listed((*LENSES, 'pinhole'))}, got {lens!r:.60}; name OpenCV's module"
        )
    values, side, second = _chosen(source, extrinsics, camera)
    size = size_of(values, image_size)
    given = camera_from_vehicle is not None or vehicle_from_camera is not None
    if given and vehicle_from_world is not None:
        raise ArgumentError(
            "vehicle_from_world: expected it without camera_from_vehicle or vehicle_from_camera, got both; drop one"
        )
    pose = None if given else _world_pose(values, metres_per_unit, vehicle_from_world, nearest_rotation)
    if pose is None:
        if vehicle_from_world is not None:
            raise CalibrationError(
                f"{values.origin}: expected rvec and tvec, which vehicle_from_world= needs, missing; pass "
                "vehicle_from_camera="
            )
        pose = mounted(camera_from_vehicle, vehicle_from_camera, nearest=nearest_rotation)
    if second:
        R, T = values.get("r"), values.get("t")
        if R is None or T is None:
            raise CalibrationError(
                f"{values.origin}: expected R and T from camera 1 to camera 2, missing; pass the file that has them as "
                "extrinsics="
            )
        between = rigid(rotation(*R, nearest=nearest_rotation), three(*T))
        pose = metric(between, metres_per_unit, T[1]) @ pose
    model: Any = None
    if rectified:
        K, turn = _rectified(values, side, nearest_rotation)
        pose = rigid(turn, np.zeros(3)) @ pose
    else:
        K = matrix(*values.one(names.K, side, "camera_matrix", matrices=True), (3, 3), unit="pixels")
        with blame(values.origin):
            model = lens_of(values, side, lens)
    return build(values.origin, K, image_size=size, camera_from_vehicle=pose, lens=model)


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    origin, content = _content(document, "source")
    found = _sections.sections(content)
    if found:
        return list(found)
    values = Named(origin)
    values.add(content, origin)
    return values.sides


def _chosen(source: Source, extrinsics: Source | None, camera: Any) -> tuple[Named, str | None, bool]:
    """Return the values of the camera that is meant, its mark in a pair, and whether it is the second of one."""
    origin, content = _content(source, "source")
    values = Named(origin)
    cameras = _sections.sections(content)
    second = False
    if cameras:
        name = _sections.choose(cameras, camera, origin)
        values.add(cameras[name], f"{origin}: {name}")
        values.origin = f"{origin}: {name}"
        # Two sections with R and T beside them are a stereo pair.
        pair = (
            isinstance(content, Mapping) and len(cameras) == 2 and {"r", "t"} <= {names.spelled(key) for key in content}
        )
        second = pair and name == _in_order(cameras)[1]
    else:
        values.add(content, origin)
    if extrinsics is not None:
        other, more = _content(extrinsics, "extrinsics")
        values.add(more, other)
        if cameras:
            second = len(cameras) == 2 and name == _in_order(cameras)[1]
    if cameras:
        return values, None, second
    side = _side(values, camera)
    return values, side, side is not None and len(values.sides) == 2 and side == values.sides[1]


def _content(source: Any, argument: str) -> tuple[str, Any]:
    """Return what to call a source, and its content, matrices as arrays."""
    if isinstance(source, Mapping):
        origin = f"{TITLE} calibration"
        return origin, plain(_unpacked(source) if isinstance(source, np.lib.npyio.NpzFile) else source, origin)
    document = open_document(source, TITLE, or_mapping=True, argument=argument)
    content = plain(document.tree, document.origin)
    if not isinstance(content, (Mapping, list)):
        raise CalibrationError(
            f"{document.origin}: expected named values at the top, got {describe(content)}; pass the file that "
            "cv2.FileStorage wrote"
        )
    return document.origin, content


def _unpacked(arrays: np.lib.npyio.NpzFile) -> dict[str, Any]:
    """Arrays of an open ``numpy.load(path)``, without those that it refuses to unpickle or cannot unpack."""
    found = {}
    for name in arrays.files:
        try:
            found[name] = arrays[name]
        except (ArithmeticError, EOFError, NotImplementedError, OSError, RuntimeError, ValueError, zipfile.BadZipFile):
            continue
        except zlib.error:
            continue
    return {name: value for name, value in found.items() if value.dtype.kind in "biufUS"}


def _in_order(cameras: Mapping[str, Any]) -> list[str]:
    """Names of two cameras, the first of the pair before the second: left before right, else as they are written."""
    right = [name for name in cameras if "right" in name.lower() or name.lower() in ("r", "2")]
    return sorted(cameras, key=lambda name: name in right)


def _side(values: Named, camera: str | int | None) -> str | None:
    """Return the mark of a camera, or None for a file of one camera without a mark."""
    sides = values.sides
    if camera is None and len(sides) < 2:
        return sides[0] if sides else None
    pair = len(sides) == 2 and ("left" in sides or sides == ["1", "2"] or sides == ["0", "1"])
    known = " or ".join(sides) or "none, for the file holds one camera"
    if pair:
        known = " or ".join(("1 (left)", "2 (right)") if "0" not in sides else ("0 (left)", "1 (right)"))
    if camera is None:
        raise ArgumentError(
            f"{values.origin}: camera: expected {known}, got None; "
            f"the file holds {'a pair' if pair else f'{len(sides)} cameras'}, say which to read"
        )
    word = str(camera).lower().removeprefix("camera").removeprefix("cam") if not isinstance(camera, bool) else ""
    aliases = {word}
    if len(sides) <= 2:
        first, second = ({"left", "l"}, {"right", "r"}) if "0" in sides else ({"1", "left", "l"}, {"2", "right", "r"})
        aliases |= next((names for names in (first, second) if word in names), set())
    found = [side for side in sides if side in aliases]
    if "0" in sides and word in ("left", "l", "right", "r"):
        found = [sides[0] if word in ("left", "l") else sides[-1]]
    if len(found) != 1:
        raise ArgumentError(f"{values.origin}: camera: expected {known}, got {camera!r:.60}; correct or drop it")
    return found[0]


def _world_pose(
    values: Named, metres_per_unit: float | None, vehicle_from_world: ArrayLike | None, nearest: bool
) -> Matrix | None:
    """``camera_from_vehicle`` of the file's rvec and tvec; None where it has none."""
    rvec, tvec = values.get("rvec"), values.get("tvec")
    if rvec is None and tvec is None:
        return None
    if rvec is None or tvec is None:
        raise CalibrationError(f"{values.origin}: expected rvec and tvec, got one of them; add the other")
    turn = flat(rvec[0])
    if isinstance(turn, (list, tuple)) and (len(turn) == 9 or any(isinstance(row, (list, tuple)) for row in turn)):
        R = rotation(turn, rvec[1], nearest=nearest)
    else:
        R = rodrigues(numbers(turn, rvec[1], 3))
    world = rigid_argument(vehicle_from_world, "vehicle_from_world", nearest=nearest)
    return metric(rigid(R, three(*tvec)), metres_per_unit, tvec[1]) @ inverse(world)


def _rectified(values: Named, side: str | None, nearest: bool) -> tuple[Matrix, Matrix]:
    """K of the rectified image, and the rotation into its axes."""
    if side is None:
        raise ArgumentError(
            "rectified, camera: expected a stereo pair's camera 1 or 2, got one camera; drop rectified="
        )
    # P2's fourth column is the baseline seen from camera 1. The pose came through R and T, which hold it already.
    P = matrix(*values.one(("p",), side, "P"), (3, 4), unit="pixels")
    R = rotation(*values.one(("r",), side, "R"), nearest=nearest)
    return P[:, :3].copy(), R
