"""What the readers of cameras on a body (an IMU, a robot) share: which camera, its lens by name, and where it stands.

The body's axes are rarely those of the vehicle, so nothing is assumed: the caller says how the body stands on the
vehicle, or the first camera is at the origin and looks along +x, with the others beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._core import BrownConrady, KannalaBrandt
from ipm_rs.calibration._checks import OPTICAL_FROM_FLU, Matrix, blame, coefficients, inverse, rigid
from ipm_rs.calibration._lenswords import known_lens
from ipm_rs.calibration._mount import rigid_argument
from ipm_rs.calibration._sections import choose
from ipm_rs.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["lens_named", "on_body", "pick", "turned"]

_BROWN = (4, 5, 8, 12, 14)


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
    """Lens of Brown-Conrady or Kannala-Brandt by a format's word for it; None where nothing bends.

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
    if kind not in ("brown_conrady", "fisheye", "pinhole"):
        raise CalibrationError(
            f"{where}: expected a lens such as radial-tangential, equidistant or none, got {word!r:.60}, which has no "
            "model here; calibrate again with one of these, or undistort the images first"
        )
    if kind == "pinhole":
        return None
    terms = coefficients(values, f"{where} ({word})", (4,) if kind == "fisheye" else _BROWN)
    with blame(where):
        if kind == "fisheye":
            return KannalaBrandt(terms)
        return BrownConrady(terms) if terms.any() else None


def turned(T: Matrix) -> Matrix:
    """Give the pose of a camera with OpenGL's axes (x right, y up, z back) as that of its optical axes."""
    return T @ np.diag([1.0, -1.0, -1.0, 1.0])
