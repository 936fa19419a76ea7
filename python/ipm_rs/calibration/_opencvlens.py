"""Lens and image size of an OpenCV calibration, under whatever names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ipm_rs._core import BrownConrady, KannalaBrandt, Mei
from ipm_rs.calibration._checks import Matrix, coefficients, describe, listed, numbers, whole
from ipm_rs.calibration._checks import image_size as checked_size
from ipm_rs.calibration._files import same_size
from ipm_rs.calibration._lenswords import FOREIGN, is_lens_key, known_lens, plain_word, refuse_foreign
from ipm_rs.calibration._names import HEIGHT, SIZE, WIDTH, D, Named, spelled
from ipm_rs.errors import ArgumentError, CalibrationError

__all__ = ["LENSES", "flat", "lens_of", "size_of", "three"]

LENSES = ("brown_conrady", "fisheye", "omnidir")
_COUNTS = {"brown_conrady": (0, 4, 5, 8, 12, 14), "fisheye": (4,), "omnidir": (4, 5)}
_STRICT = ("distortionmodel", "distmodel", "distortiontype", "disttype", "lensmodel")  # these hold nothing but a lens
_TEXT_SIZE = re.compile(r"\s*([0-9]{1,6})\s*[xX*,]\s*([0-9]{1,6})\s*")


def lens_of(values: Named, side: str | None, lens: str | None) -> BrownConrady | KannalaBrandt | Mei | None:
    """Lens of a camera; `lens` is what the caller says that it is."""
    if lens == "pinhole":
        return None
    stated = _stated(values)
    xi = next(iter(values.marked(("xi",), side)), None)
    if lens is not None and stated is not None and lens != stated[0]:
        raise ArgumentError(f"lens: expected {stated[0]!r}, which {stated[1]} states, got {lens!r}; drop the argument")
    kind = lens or (stated[0] if stated else None) or ("omnidir" if xi is not None else None)
    if not values.marked(D, side):
        refuse_foreign(values.content, values.origin, bends=True)
        if kind == "pinhole":
            return None
        of = "" if side is None else f" of camera {side}"
        raise CalibrationError(
            f"{values.origin}: expected distortion_coefficients{of}, missing among {listed(values.content)}; rename "
            f"them to distortion_coefficients{side or ''}, or pass lens='pinhole' if there are none"
        )
    value, where = values.one(D, side, "distortion_coefficients")
    terms = numbers(flat(value), where)
    if refuse_foreign(values.content, values.origin, bends=bool(terms.any())):
        return None
    if kind is None and len(terms) == 4 and terms.any():
        raise ArgumentError(
            f"{where}: lens: expected 'brown_conrady' (k1, k2, p1, p2) or 'fisheye' (k1 to k4), got None and four "
            "numbers that may be either; pass lens='fisheye' if cv2.fisheye made them, or lens='brown_conrady' if "
            "cv2.calibrateCamera did"
        )
    if kind == "pinhole":
        if terms.any():
            raise CalibrationError(
                f"{where}: expected no coefficients, since {stated[1] if stated else 'lens='} says none, got "
                f"{len(terms)}; remove one of the two"
            )
        return None
    return _made(values, kind or "brown_conrady", terms, where, xi)


def _made(
    values: Named, kind: str, terms: Matrix, where: str, xi: tuple[Any, str] | None
) -> BrownConrady | KannalaBrandt | Mei | None:
    terms = coefficients(terms, f"{where} ({kind})", _COUNTS[kind])
    if kind == "fisheye":
        return KannalaBrandt(terms)
    if kind == "brown_conrady":
        return BrownConrady(terms) if terms.any() else None
    if xi is None:
        raise CalibrationError(f"{values.origin}: expected xi beside the coefficients of cv2.omnidir, missing; add it")
    return Mei(float(numbers(np.ravel(flat(xi[0])).tolist(), xi[1], 1)[0]), terms[:4])


def _stated(values: Named) -> tuple[str, str] | None:
    """Return the lens that the file itself states, and where; two that differ are refused."""
    found: dict[str, str] = {}
    for key, value in values.content.items():
        name, where = spelled(key), values.values[spelled(key)][1]
        if name == "fisheyemodel" and isinstance(value, (int, float)):
            found.setdefault("fisheye" if value else "brown_conrady", where)
        elif name in _STRICT or is_lens_key(key):
            lens = known_lens(value) if isinstance(value, str) else None
            if name in _STRICT and lens is None and plain_word(value) not in FOREIGN:
                raise CalibrationError(
                    f"{where}: expected a known lens such as brown_conrady, fisheye or omnidir, got {describe(value)}; "
                    "correct it"
                )
            # Other keys may hold the name of a product, and "pinhole" says no more than that there is a K.
            if lens is not None and (lens != "pinhole" or name in _STRICT):
                found.setdefault(lens, where)
    if len(found) > 1:
        got = " and ".join(f"{lens} ({where.rpartition(': ')[2]})" for lens, where in found.items())
        raise CalibrationError(f"{values.origin}: expected one lens, got {got}; keep the one of the coefficients")
    return next(iter(found.items()), None)


def size_of(values: Named, given: Any) -> Any:
    """(width, height) that the file states, or else the caller's; they must agree."""
    sizes = set()
    for name in SIZE:
        found = values.get(name)
        if found is not None:
            sizes.add(_size(*found))
    width, height = values.get(*WIDTH), values.get(*HEIGHT)
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


def _size(value: Any, where: str) -> tuple[int, int]:
    """Read a size as two numbers, as an object of two sides, or as "640x480"."""
    if isinstance(value, Mapping):
        names = {spelled(key): item for key, item in value.items()}
        width = next((names[key] for key in ("width", "w", "cols", "columns", "x") if key in names), None)
        height = next((names[key] for key in ("height", "h", "rows", "y") if key in names), None)
        return checked_size(width, height, where)
    text = _TEXT_SIZE.fullmatch(value) if isinstance(value, str) else None
    if text is not None:
        return checked_size(int(text[1]), int(text[2]), where)
    width, height = three(value, where, count=2)
    return checked_size(width, height, where)


def three(value: Any, where: str, count: int = 3) -> Matrix:
    """Three numbers, written as a row, a column or a list."""
    return numbers(flat(value), where, count)


def flat(value: Any) -> Any:
    """Make a list of a matrix of one row or one column, given as an array or as nested lists; leave the rest."""
    if isinstance(value, np.ndarray):
        return value.ravel().tolist()
    while isinstance(value, (list, tuple)) and len(value) == 1 and isinstance(value[0], (list, tuple)):
        value = value[0]
    if isinstance(value, (list, tuple)) and value and all(isinstance(x, (list, tuple)) and len(x) == 1 for x in value):
        return [item[0] for item in value]
    return value
