"""``calib_results.txt`` of Scaramuzza's OCamCalib toolbox, also of the datasets that give its five rows.

The format, after the toolbox's ``ocam_functions.cpp``. Lines that begin with ``#`` are comments; the others are

1. the direct polynomial: how many coefficients, then a0, a1 (0), a2, ... in pixels;
2. the inverse polynomial: how many, then from the constant on: rho over the angle from the image plane, in radians;
3. the centre: **row, column**, from 0;
4. the affine parameters c, d, e;
5. the size: **height, width**.

In that frame x counts rows down and y columns to the right, and z points out of the camera's back: the ray of a pixel
rho from the centre is (x, y, a0 + a2 rho^2 + ...), ``row = c x + d y + xc``, ``column = e x + y + yc``. Pixel (0, 0) is
a pixel's centre. The direct polynomial is the definition, and is inverted to rounding; the file's inverse is a fit of
it and is used only where the first count is 0. Then the direct one is fitted to it here: how near is logged at level
INFO by ``ipm_rs.calibration``, more than 0.1 pixels is warned of, and more than 0.5 refused.

The file has no pose and knows no road: the camera is at the origin and looks along +x, forward, unless
``vehicle_from_camera=`` says how it is mounted; ``ground=`` is minus its height.
"""

from __future__ import annotations

import logging
import os
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._core import Camera, Ocam
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, blame, image_size, numbers
from ipm_rs.calibration._files import Document, open_document, same_size
from ipm_rs.calibration._mount import mounted
from ipm_rs.calibration._yaml import scalar
from ipm_rs.errors import CalibrationError, CalibrationWarning

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "missing", "read"]

TITLE = "OCamCalib"
KEYS = ("#polynomial", "#center:", "#affine", "#image")

_ROWS = ("polynomial", "inverse polynomial", "centre", "affine parameters", "image size")
_LONGEST = 100_000  # characters; a file has 1000
_MOST_TERMS = 12  # of the lens
_MOST_INVERSE = 40
_TOLERATED, _REFUSED = 0.1, 0.5  # pixels

_log = logging.getLogger("ipm_rs.calibration")


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if document.is_directory:
        return "a directory"
    rows = _rows(document)
    shape = [len(words) for _, words in rows]
    counted = [words[0] == str(len(words) - 1) for _, words in rows[:2]]
    return None if len(rows) == 5 and shape[2:] == [2, 3, 2] and all(counted) else "no five rows of two polynomials"


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: str | os.PathLike[str],
    *,
    image_size: tuple[int, int] | None = None,
    camera_from_vehicle: ArrayLike | None = None,
    vehicle_from_camera: ArrayLike | None = None,
) -> Camera:
    """Read a camera of OCamCalib.

    Parameters
    ----------
    source : str or path
        ``calib_results.txt``.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    camera_from_vehicle, vehicle_from_camera : (4, 4) array, optional
        How the camera is mounted, in either direction.

    Returns
    -------
    Camera
        With an `Ocam` lens; without a pose at the origin, looking along +x.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A row is missing or cannot be right, or no direct polynomial fits the inverse one of a file that has no other.
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    """
    document = open_document(source, TITLE)
    rows = _rows(document)
    if len(rows) != len(_ROWS):
        raise CalibrationError(
            f"{document.origin}: expected five rows, {', '.join(_ROWS)}, got {len(rows)}; pass calib_results.txt, whole"
        )
    direct, inverse = (_polynomial(document, *row, name) for row, name in zip(rows[:2], _ROWS, strict=False))
    (xc, yc), (c, d, e), (height, width) = (
        numbers([scalar(word) for word in words], f"{document.origin}: line {line}: {name}", count)
        for (line, words), name, count in zip(rows[2:], _ROWS[2:], (2, 3, 2), strict=True)
    )
    size = _size(width, height, f"{document.origin}: line {rows[4][0]}")
    same_size(image_size, size, document.origin)
    if not len(direct):
        direct = _fitted(inverse, np.hypot(max(yc, size[0] - yc), max(xc, size[1] - xc)), document.origin)
    with blame(document.origin):
        lens = Ocam(direct, (float(c), float(d), float(e)))
    K = np.array([[1.0, 0.0, yc], [0.0, 1.0, xc], [0.0, 0.0, 1.0]])
    pose = mounted(camera_from_vehicle, vehicle_from_camera)
    return build(document.origin, K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _size(width: Any, height: Any, where: str) -> tuple[int, int]:
    return image_size(float(width), float(height), where)


def _rows(document: Document) -> list[tuple[int, list[str]]]:
    """Line numbers and words of the lines that are no comments."""
    lines = document.text[:_LONGEST].split("\n")
    rows = [(number, line.split()) for number, line in enumerate(lines, 1) if not line.lstrip().startswith("#")]
    return [(number, words) for number, words in rows if words]


def _polynomial(document: Document, line: int, words: list[str], name: str) -> Matrix:
    where = f"{document.origin}: line {line}: {name}"
    values = numbers([scalar(word) for word in words], where)
    most = _MOST_INVERSE if name == _ROWS[1] else _MOST_TERMS
    if values[0] != len(values) - 1 or len(values) - 1 > most:
        raise CalibrationError(
            f"{where}: expected how many coefficients follow, at most {most}, and as many, got {values[0]:g} and "
            f"{len(values) - 1}; the file may be cut short, fetch it again"
        )
    return values[1:]


def _fitted(inverse: Matrix, farthest: float, origin: str) -> Matrix:
    """Direct polynomial of an inverse one, least squares of pixels over the radii that the image has."""
    if not len(inverse):
        raise CalibrationError(f"{origin}: expected a polynomial, got neither a direct nor an inverse one; add it")
    angle = np.linspace(-np.pi / 2, np.pi / 2, 4001)[1:-1]
    rho = np.polyval(inverse[::-1], angle)
    slope = np.polyval(np.polyder(inverse[::-1]), angle)
    ends = np.flatnonzero((slope <= 0) | (rho > farthest) | ~np.isfinite(rho))
    keep = slice(0, ends[0] if len(ends) else len(angle))
    angle, rho, slope = angle[keep], rho[keep], slope[keep]
    angle, rho, slope = angle[rho > 0], rho[rho > 0], slope[rho > 0]
    best, error = np.zeros(0), np.inf
    with np.errstate(all="ignore"):  # what overflows fits nothing
        height = rho * np.tan(angle)
        weight = slope * rho / (rho**2 + height**2)  # pixels for a unit of height
        finite = bool(np.isfinite(weight).all() and np.isfinite(height * weight).all())
    if len(rho) >= 100 and finite:
        scale = rho.max()
        for degree in range(4, _MOST_TERMS):
            powers = [0, *range(2, degree + 1)]
            basis = np.stack([(rho / scale) ** power for power in powers], axis=1)
            solved = np.linalg.lstsq(basis * weight[:, None], height * weight, rcond=None)[0]
            again = np.polyval(inverse[::-1], np.arctan2(basis @ solved, rho))
            worst = float(np.abs(again - rho).max())
            if worst < error:
                best, error = np.zeros(degree + 1), worst
                best[powers] = solved / scale ** np.array(powers)
    if not error <= _REFUSED:
        raise CalibrationError(
            f"{origin}: expected an inverse polynomial that a direct one fits to {_REFUSED:g} pixels, got {error:.3g} "
            "at best; pass the file with the direct polynomial"
        )
    _log.info("%s: no direct polynomial; the one fitted to the inverse is within %.3g pixels of it", origin, error)
    if error > _TOLERATED:
        warnings.warn(
            f"{origin}: the direct polynomial fitted to the file's inverse one is up to {error:.2g} pixels off it; "
            "pass the file with the direct polynomial if you have it",
            CalibrationWarning,
            stacklevel=3,
        )
    return best
