"""Cam2BEV's camera YAML: ``fx fy px py``, ``yaw pitch roll``, ``XCam YCam ZCam``.

The format, after the project's ``ipm.py``, which the numbers here equal:

* ``fx``, ``fy``, ``px``, ``py``: pixels. Their script warps with OpenCV, whose pixel (0, 0) is a pixel's centre, and so
  it is read; that ``px`` is half the width in their files hints at the corner, which would be half a pixel.
* ``yaw``, ``pitch``, ``roll``: **degrees**. ``R = S Rz(-yaw) Ry(-pitch) Rx(-roll)`` takes the vehicle's axes (x
  forward, y left, z up) to optical ones (S is the change of axes): the camera is turned by roll first, then pitch, then
  yaw about axes that turn with it, which is **not** the order of Cityscapes. Positive pitch looks down, positive yaw
  turns left.
* ``XCam``, ``YCam``, ``ZCam``: the camera's place in the vehicle frame, metres; ``t = -R X``. The road is z = 0:
  ``ground=0``.
* There is no image size (their simulated cameras: 964 x 604), and no lens.
"""

from __future__ import annotations

import math

import numpy as np

from ipm_rs._core import Camera
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import OPTICAL_FROM_FLU, Matrix, pinhole, rigid
from ipm_rs.calibration._files import Document, Source, needs_size
from ipm_rs.calibration._plain import plain_section, tree_missing
from ipm_rs.calibration._rotations import rodrigues

__all__ = ["KEYS", "TITLE", "missing", "read"]

TITLE = "Cam2BEV"
KEYS = ("px", "py", "XCam", "YCam", "ZCam", "yaw", "pitch", "roll")

_ALL = ("fx", "fy", "px", "py", "yaw", "pitch", "roll", "XCam", "YCam", "ZCam")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    return tree_missing(document, *_ALL)


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(source: Source, *, image_size: tuple[int, int] | None = None) -> Camera:
    """Read a camera of Cam2BEV.

    Parameters
    ----------
    source : str, path or mapping
        The YAML file (needs the extra ``yaml``), or its content as a mapping.
    image_size : (int, int)
        Width and height in pixels, which the format does not state; (964, 604) in their data sets.

    Returns
    -------
    Camera
        A pinhole in the vehicle frame, whose road is z = 0.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or `image_size` was not given.
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    MissingExtraError
        PyYAML is not installed.
    """
    content = plain_section(source, TITLE)
    content.require(*_ALL)
    size = needs_size(image_size, content.origin, "Cam2BEV's images are 964x604: take the image's")
    K = pinhole(*(content.number(key, unit="pixels") for key in ("fx", "fy", "px", "py")))
    yaw, pitch, roll = (content.number(key, unit="degrees") for key in ("yaw", "pitch", "roll"))
    R = OPTICAL_FROM_FLU @ _about(2, -yaw) @ _about(1, -pitch) @ _about(0, -roll)
    position = np.array([content.number(key, unit="metres") for key in ("XCam", "YCam", "ZCam")])
    return build(content.origin, K, image_size=size, camera_from_vehicle=rigid(R, -R @ position))


def _about(axis: int, degrees: float) -> Matrix:
    turn = np.zeros(3)
    turn[axis] = math.radians(math.remainder(degrees, 360.0))
    return rodrigues(turn)
