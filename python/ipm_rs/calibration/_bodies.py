"""What the readers of cameras on a body (an IMU, a robot) share: which camera, its lens by name, and where it stands.

The body's axes are rarely those of the vehicle, so nothing is assumed: the caller says how the body stands on the
vehicle, or the first camera is at the origin and looks along +x, with the others beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Fov, KannalaBrandt
from ipm_rs.calibration._checks import OPTICAL_FROM_FLU, Matrix, blame, coefficients, inverse, rigid
from ipm_rs.calibration._lenswords import known_lens
from ipm_rs.calibration._mount import rigid_argument
from ipm_rs.calibration._sections import choose
from ipm_rs.errors import ArgumentError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = [
    "FLU_FROM_CAMERA_AXES",
    "FLU_FROM_LEFT_BACK_UP",
    "brown",
    "lens_named",
    "on_body",
    "one_of",
    "pick",
    "turned",
]

_BROWN = (4, 5, 8, 12, 14)

FLU_FROM_LEFT_BACK_UP: Matrix = rigid(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))
"""A lidar whose x points to the left and y to the back (Pandar64 as ONCE and PandaSet mount it), as a vehicle frame."""
FLU_FROM_LEFT_BACK_UP.flags.writeable = False

FLU_FROM_CAMERA_AXES: Matrix = rigid(OPTICAL_FROM_FLU.T, np.zeros(3))
"""From optical axes to those of a camera whose x points forward, y left, z up, as Waymo and A2D2 have them."""
FLU_FROM_CAMERA_AXES.flags.writeable = False


def pick(names: Sequence[str], camera: Any, origin: str) -> int:
    """Place of the camera that ``camera=`` means, by its name or else its number; a single one need not be named.

    Raises
    ------
    ArgumentError
        There is no such camera, or several and none is named.
    """
    if isinstance(camera, (int, np.integer)) and not isinstance(camera, bool) and str(camera) not in names:
        if 0 <= camera < len(names):
            return int(camera)
        camera = str(camera)
    return list(names).index(choose(dict.fromkeys(names), camera, origin))


def one_of(name: str, value: Any, words: Sequence[str], mend: str) -> str:
    """Check an argument that must be one of a few words.

    Raises
    ------
    ArgumentError
        It is none of them.
    """
    check_word(name, value)
    if not isinstance(value, str) or value not in words:
        wanted = " or ".join(map(repr, words))
        raise ArgumentError(f"{name}: expected {wanted}, got {value!r:.60}; {mend}")
    return value


def on_body(
    body_from_camera: Matrix, body_from_first: Matrix, vehicle_from_body: ArrayLike | None, name: str, *, nearest: bool
) -> Matrix:
    """``camera_from_vehicle`` of a camera on a body; `name` is the argument that says how the body stands."""
    if vehicle_from_body is not None:
        body_from_vehicle = inverse(rigid_argument(vehicle_from_body, name, nearest=nearest))
    else:
        body_from_vehicle = body_from_first @ rigid(OPTICAL_FROM_FLU, np.zeros(3))
    return inverse(body_from_camera) @ body_from_vehicle


def lens_named(word: Any, values: Any, where: str, *, others: Mapping[str, str] | None = None) -> Any:
    """Lens of Brown-Conrady, Kannala-Brandt or FOV by a format's word for it; None where nothing bends.

    Parameters
    ----------
    word : object
        What the file says: "radial-tangential", "equidistant", "none".
    values : object
        Its list of coefficients.
    where : str
        Where that stands, for messages.
    others : mapping, optional
        Words that the format alone gives to a lens of ours, or to none ("").
    """
    kind = (others or {}).get(word if isinstance(word, str) else "", known_lens(word))
    if kind not in ("brown_conrady", "fisheye", "fov", "pinhole"):
        raise CalibrationError(
            f"{where}: expected a lens such as radial-tangential, equidistant or none, got {word!r:.60}, which has no "
            "model here; calibrate again with one of these, or undistort the images first"
        )
    if kind == "pinhole":
        return None
    if kind == "brown_conrady":
        return brown(values, f"{where} ({word})")
    terms = coefficients(values, f"{where} ({word})", (1,) if kind == "fov" else (4,))
    with blame(where):
        if kind == "fov":
            return Fov(terms[0]) if terms.any() else None
        return KannalaBrandt(terms)


def brown(values: Any, where: str) -> BrownConrady | None:
    """Lens of OpenCV's terms, k1 k2 p1 p2[ k3 ...]; None where nothing bends."""
    terms = coefficients(values, where, _BROWN)
    with blame(where):
        return BrownConrady(terms) if terms.any() else None


def turned(T: Matrix) -> Matrix:
    """Give the pose of a camera with OpenGL's axes (x right, y up, z back) as that of its optical axes."""
    return T @ np.diag([1.0, -1.0, -1.0, 1.0])
