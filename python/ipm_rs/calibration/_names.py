"""Names under which tools store a camera matrix, coefficients and a size, and what belongs to which camera of a file.

OpenCV fixes how a matrix is written and not what it is called. A name is compared in lower case, without ``_ - .`` and
blanks. In a file of several cameras a mark at the end or the start of the name says whose it is: ``K1``, ``D_left``,
``cameraMatrixR``, ``cam0_K``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ipm_rs.calibration._checks import describe, listed
from ipm_rs.calibration._yaml import Tagged
from ipm_rs.errors import CalibrationError

__all__ = ["HEIGHT", "MAX_KEYS", "SIZE", "WIDTH", "D", "K", "Named", "has_camera", "near_matrix", "spelled"]

K = (
    "cameramatrix", "cameramat", "camermatrix", "cammatrix", "cammat", "cammtx", "intrinsicmatrix", "intrinsicmat",
    "intrinsics", "intrinsic", "cameraintrinsics", "cameraintrinsicmatrix", "matrix", "mtx", "kmatrix", "k", "m",
)  # fmt: skip
_WEAK = ("m", "matrix", "intrinsic")  # of other things too: these count beside coefficients only
_ENDINGS = (
    "coefficients", "coefficient", "coeffs", "coeff", "coefs", "coef", "params", "parameters", "vector", "vec", "mat",
    "matrix", "",
)  # fmt: skip
D = (
    *(word + ending for word in ("distortion", "distance", "dist") for ending in _ENDINGS),
    "distortions", "cameradistortion", "distorsion", "distorsioncoefficients", "distcoffs", "d",
)  # fmt: skip
SIZE = ("imagesize", "imgsize", "imageresolution", "resolution", "framesize", "size")
WIDTH, HEIGHT = ("imagewidth", "imgwidth", "width"), ("imageheight", "imgheight", "height")

MAX_KEYS = 1000
"""Of one camera, or of all that stand side by side; in a larger table there is no sense in looking for names."""

_MARK = re.compile(r"(?:cam|camera)?(left|right|l|r|[0-9]{1,2})")


def spelled(key: Any) -> str:
    """Name as it is compared."""
    return re.sub(r"[\s_.-]", "", str(key).lower())


def _side(mark: str) -> str:
    """Side that a mark means: "left", "right" or digits without leading zeros."""
    return {"l": "left", "r": "right"}.get(mark) or (str(int(mark)) if mark.isdecimal() else mark)


def _split(name: str, among: tuple[str, ...]) -> str | None:
    """Side of the camera whose value a marked name holds; None for other names."""
    for base in among:
        if name != base and (name.startswith(base) or name.endswith(base)):
            mark = _MARK.fullmatch(name[len(base) :] if name.startswith(base) else name[: -len(base)])
            if mark:
                return _side(mark[1])
    return None


def near_matrix(value: Any) -> str | None:
    """Say why a value cannot be a camera matrix; None if it may be one, whatever its numbers are."""
    if isinstance(value, Tagged):
        value = value.content
    if isinstance(value, Mapping):
        if not {"rows", "cols", "data"} <= value.keys():
            return "an object"
        if (value["rows"], value["cols"]) != (3, 3):
            return f"{value['rows']!r:.9} x {value['cols']!r:.9}"
        value = value["data"]
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, (list, tuple)):
        return describe(value)
    rows = [row if isinstance(row, (list, tuple)) else [row] for row in value]
    if len(rows) not in (3, 9) and not any(isinstance(item, str) for item in value):
        return f"{len(rows)} values"
    words = [word for row in rows for item in row for word in (item.split() if isinstance(item, str) else [item])]
    if len(words) != 9:
        return f"{len(words)} numbers"
    numbers = [word for word in words if isinstance(word, (int, float))]
    if len(numbers) == 9 and (numbers[6] or numbers[7]):
        turned = numbers[2] == numbers[5] == 0
        return "transposed, written column by column" if turned else "nine numbers whose last three are not 0 0 1"
    return None


def _cameras(content: Mapping[Any, Any]) -> set[str | None]:
    """Sides of which a mapping has a camera matrix; None for one without a mark."""
    if len(content) > MAX_KEYS:
        return set()
    names = {spelled(key): value for key, value in content.items()}
    lens = any(name in D or _split(name, D) for name in names)
    found: set[str | None] = set()
    for name, value in names.items():
        if near_matrix(value) is not None:
            continue
        if name in K and (lens or name not in _WEAK):
            found.add(None)
        elif (side := _split(name, K)) is not None and lens:
            found.add(side)
    return found


def has_camera(content: Any) -> bool:
    """Whether a mapping has a camera matrix under one of the names."""
    return isinstance(content, Mapping) and bool(_cameras(content))


class Named:
    """Values by name, each with its place for messages."""

    def __init__(self, origin: str) -> None:
        self.origin = origin
        self.values: dict[str, tuple[Any, str]] = {}
        self.content: dict[str, Any] = {}

    def add(self, content: Any, origin: str) -> None:
        """Add the content of a file; a name that is there already is refused."""
        if not isinstance(content, Mapping):
            raise CalibrationError(f"{origin}: expected named matrices, got {describe(content)}; name them")
        for key, value in content.items():
            name, where = spelled(key), f"{origin}: {key}"
            if name in self.values:
                raise CalibrationError(f"{where}: expected once, got it beside {self.values[name][1]}; keep one")
            self.values[name] = value, where
            self.content[str(key)] = value

    def get(self, *names: str) -> tuple[Any, str] | None:
        """Return the first of the names that is there."""
        return next((self.values[name] for name in names if name in self.values), None)

    @property
    def sides(self) -> list[str]:
        """Sides of the cameras whose matrices have a mark, in order; empty beside one without."""
        found = _cameras(self.content)
        if None in found:
            return []
        return sorted((side for side in found if side), key=lambda side: (len(side), side))

    def marked(self, names: tuple[str, ...], side: str | None) -> list[tuple[Any, str]]:
        """Every value under one of the names, with the mark of a side, or without any."""
        if side is None:
            return [self.values[name] for name in names if name in self.values]
        # left and 1 are one camera, as are right and 2: stereoRectify's P1 stands beside K_left.
        alike = {side} | ({"1", "left"} if side in ("1", "left") and "0" not in self.sides else set())
        alike |= {"2", "right"} if side in ("2", "right") and "0" not in self.sides else set()
        return [value for name, value in self.values.items() if name not in names and _split(name, names) in alike]

    def one(self, names: tuple[str, ...], side: str | None, title: str, *, matrices: bool = False) -> tuple[Any, str]:
        """Return the one value among several names; none and several are errors."""
        found = self.marked(names, side)
        if matrices and len(found) > 1:  # K, and another k that is no matrix
            found = [(value, where) for value, where in found if near_matrix(value) is None] or found
        if len(found) > 1:
            got = " and ".join(where.rpartition(": ")[2] for _, where in found)
            raise CalibrationError(f"{self.origin}: expected one {title}, got {got}; keep one")
        if not found:
            of = "" if side is None else f" of camera {side}"
            raise CalibrationError(
                f"{self.origin}: expected {title}{of}, missing among {listed(self.content)}; "
                f"rename the matrix to {title}{side or ''}"
            )
        return found[0]
