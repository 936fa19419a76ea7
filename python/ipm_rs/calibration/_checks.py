"""Checks that the readers share: numbers, matrices and rotations out of a calibration, with errors that say where.

`where` is the place that a message begins with, ``"camera.json: intrinsic.fx"``; `Section` composes it. Every problem
is a `CalibrationError` with the place, what was expected, what came and how to mend it.
"""

from __future__ import annotations

import difflib
import math
import numbers as abstract
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = [
    "OPTICAL_FROM_FLU",
    "Matrix",
    "Section",
    "blame",
    "describe",
    "image_size",
    "inverse",
    "listed",
    "matrix",
    "number",
    "numbers",
    "pinhole",
    "pose",
    "quaternion",
    "rigid",
    "rotation",
    "whole",
]

Matrix = NDArray[np.float64]

OPTICAL_FROM_FLU: Matrix = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Axes x forward, y left, z up to the optical ones, x right, y down, z forward."""
OPTICAL_FROM_FLU.flags.writeable = False

_ROTATION_TOLERANCE = 1e-4  # of |R^T R - I|, the camera's own
_NORM_TOLERANCE = 1e-3  # of |q| - 1: printed digits, no more


def describe(value: Any) -> str:
    """Name a value in a message: its type, and the value itself where that is short."""
    if value is None or isinstance(value, bool):
        return f"{value!r}"
    text = repr(value) if isinstance(value, (str, int, float)) and not _is_huge(value) else ""
    if isinstance(value, (list, tuple)):
        return f"{type(value).__name__} of {len(value)}"
    return f"{type(value).__name__} {text}" if text and len(text) <= 60 else type(value).__name__


def _is_huge(value: Any) -> bool:
    return isinstance(value, int) and value.bit_length() > 200  # its digits would fill the message, or be refused


def listed(words: Iterable[str], limit: int = 12) -> str:
    """Words in a message, quoted; a long list is cut. A token of 64 digits is not, so that it can be passed on."""
    every = [repr(word if len(word) <= 64 else word[:61] + "...") for word in words]
    rest = len(every) - limit
    return ", ".join(every[:limit]) + (f" and {rest} more" if rest > 0 else "") if every else "none"


# ---------------------------------------------------------------------------------------------------------------------
# Values


def number(value: Any, where: str, *, unit: str = "", positive: bool = False) -> float:
    """Check one finite real number."""
    wanted = "a finite, positive number" if positive else "a finite number"
    in_unit = f" in {unit}" if unit else ""
    if isinstance(value, bool) or not isinstance(value, abstract.Real):
        raise CalibrationError(
            f"{where}: expected {wanted}, got {describe(value)}; write it as a plain number{in_unit}"
        )
    try:
        real = float(value)
    except OverflowError:
        real = math.inf
    if not math.isfinite(real) or (positive and real <= 0):
        raise CalibrationError(f"{where}: expected {wanted}, got {real}; correct it{',' if unit else ''}{in_unit}")
    return real


def whole(value: Any, where: str, *, minimum: int = 0, maximum: int = 2**31 - 1, unit: str = "") -> int:
    """Check one whole number; ``640.0`` counts as one."""
    real = number(value, where, unit=unit)
    if real != int(real) or not minimum <= real <= maximum:
        raise CalibrationError(
            f"{where}: expected a whole number from {minimum} to {maximum}, got {real:.15g}; correct it"
        )
    return int(real)


def numbers(value: Any, where: str, count: int | Sequence[int] | None = None, *, unit: str = "") -> Matrix:
    """Check a list of finite numbers, of one of the given lengths; (N,) float64."""
    items = _items(value)
    counts = (count,) if isinstance(count, int) else count
    wanted = "numbers" if counts is None else f"{_or(counts)} numbers"
    if items is None:
        raise CalibrationError(f"{where}: expected a list of {wanted}, got {describe(value)}; write them in a list")
    if counts is not None and len(items) not in counts:
        raise CalibrationError(
            f"{where}: expected {wanted}, got {len(items)}; check that the list is complete and of this format"
        )
    return np.array([number(item, f"{where}[{index}]", unit=unit) for index, item in enumerate(items)], dtype=float)


def matrix(value: Any, where: str, shape: tuple[int, int], *, unit: str = "") -> Matrix:
    """Check a matrix of finite numbers, given by rows, as one row-major list, or as an array; float64."""
    rows, columns = shape
    items = _items(value)
    if items is not None and len(items) == rows and any(_items(item) is not None for item in items):
        return np.array([numbers(row, f"{where}[{i}]", columns, unit=unit) for i, row in enumerate(items)])
    if items is None or len(items) != rows * columns:
        got = describe(value) if items is None else _shape(items)
        raise CalibrationError(
            f"{where}: expected a {rows}x{columns} matrix, got {got}; give {rows} rows of {columns} numbers, or all "
            f"{rows * columns} row by row"
        )
    return numbers(items, where, rows * columns, unit=unit).reshape(rows, columns)


def _items(value: Any) -> list[Any] | tuple[Any, ...] | None:
    """Elements of a list, a tuple or an array; None for anything else."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    return value if isinstance(value, (list, tuple)) else None


def _shape(items: Sequence[Any]) -> str:
    inner = {len(row) for row in map(_items, items) if row is not None}
    if not inner:
        return f"{len(items)} numbers"
    return f"{len(items)} rows of {_or(sorted(inner))}" if len(inner) < 4 else f"{len(items)} ragged rows"


def _or(words: Sequence[Any]) -> str:
    *some, last = words
    return f"{', '.join(map(str, some))} or {last}" if some else str(last)


def image_size(width: Any, height: Any, where: str) -> tuple[int, int]:
    """Check (width, height) of an image out of a file."""
    return (
        whole(width, f"{where} (width)", minimum=1, unit="pixels"),
        whole(height, f"{where} (height)", minimum=1, unit="pixels"),
    )


# ---------------------------------------------------------------------------------------------------------------------
# Rotations and poses


def rotation(value: Any, where: str) -> Matrix:
    """Check a (3, 3) rotation, which is kept as given: ``|R^T R - I| <= 1e-4`` and ``det R > 0``."""
    R = matrix(value, where, (3, 3))
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(np.abs(R.T @ R - np.eye(3)).max())
        mirrored = bool(np.linalg.det(R) <= 0) if error <= _ROTATION_TOLERANCE else False
    if not error <= _ROTATION_TOLERANCE:
        raise CalibrationError(
            f"{where}: expected a rotation, |R^T R - I| <= {_ROTATION_TOLERANCE:g}, got {error:.3g}; check the order "
            "of the numbers, and print them with six digits or more"
        )
    if mirrored:
        raise CalibrationError(
            f"{where}: expected a rotation, det R = +1, got a reflection, det R = -1; it is of a left-handed frame or "
            "lacks a sign, see flip_handedness_rotation()"
        )
    return R


def pose(value: Any, where: str, *, unit: str = "metres") -> Matrix:
    """Check a rigid transform, 3x4 or 4x4, by rows or flat; (4, 4) float64, its numbers as given."""
    items = _items(value)
    tall = items is not None and len(items) in (4, 16)
    T = matrix(value, where, (4, 4) if tall else (3, 4), unit=unit)
    rotation(T[:3, :3], f"{where}[:3, :3]")
    if tall and not np.array_equal(T[3], (0, 0, 0, 1)):
        raise CalibrationError(
            f"{where}[3]: expected the last row 0 0 0 1, got {' '.join(f'{x:g}' for x in T[3])}; a transform that is "
            "stored by columns must be transposed first"
        )
    return T if tall else np.vstack([T, (0.0, 0.0, 0.0, 1.0)])


def quaternion(value: Any, where: str, order: str) -> Matrix:
    """Rotation matrix, (3, 3), of a unit quaternion whose numbers come in the order ``"wxyz"`` or ``"xyzw"``.

    It is normalised first; a norm more than 1e-3 from 1 is refused.
    """
    q = numbers(value, where, 4)
    with np.errstate(over="ignore"):
        norm = float(np.sqrt((q * q).sum()))
    if not abs(norm - 1) <= _NORM_TOLERANCE:
        raise CalibrationError(
            f"{where}: expected a quaternion of norm 1 ({', '.join(order)}), got norm {norm:.6g}; "
            + ("a camera that is not turned has w = 1" if norm == 0 else "check its four numbers")
        )
    w, x, y, z = (float(q[order.index(axis)]) / norm for axis in "wxyz")
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def rigid(R: Matrix, t: Matrix | Sequence[float]) -> Matrix:
    """(4, 4) transform of a rotation and a translation."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T


def inverse(T: Matrix) -> Matrix:
    """(4, 4) inverse of a rigid transform as printed: not quite orthonormal, which this undoes exactly."""
    undone = np.asarray(np.linalg.inv(T), dtype=np.float64)
    undone[3] = (0.0, 0.0, 0.0, 1.0)
    return undone


def pinhole(fx: float, fy: float, cx: float, cy: float, skew: float = 0.0) -> Matrix:
    """(3, 3) intrinsic matrix."""
    return np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


@contextmanager
def blame(origin: str) -> Iterator[None]:
    """Put the file's name before whatever a camera or a lens made in the block finds wrong; NumPy warns of nothing.

    What only says which number cannot be is told to be corrected: here it stands in a file.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except (CalibrationError, ArgumentError, ArgumentTypeError) as error:
        place = "" if str(error).startswith(origin) else f"{origin}: "
        mend = "" if "; " in str(error) or str(error).endswith("?") else "; correct it"
        if not place and not mend:
            raise
        raise type(error)(f"{place}{error}{mend}") from error


# ---------------------------------------------------------------------------------------------------------------------
# Mappings


class Section:
    """A mapping in a calibration that knows the file and the place it comes from.

    Parameters
    ----------
    content : mapping
        Its keys and values.
    origin : str
        The file, or what stands for it in messages.
    path : str
        Its place in the file, ``"cam0.intrinsics"``; empty at the top.
    """

    def __init__(self, content: Any, origin: str, path: str = "") -> None:
        self.origin, self.path = origin, path
        if not isinstance(content, Mapping):
            place = f"{origin}: {path}" if path else origin
            raise CalibrationError(
                f"{place}: expected an object with keys, got {describe(content)}; nest the keys in it"
            )
        self.content: Mapping[Any, Any] = content

    def __contains__(self, key: str) -> bool:
        return key in self.content

    def where(self, key: str = "") -> str:
        """Place of a key, for messages."""
        path = ".".join(part for part in (self.path, key) if part)
        return f"{self.origin}: {path}" if path else self.origin

    def require(self, *keys: str) -> None:
        """Check that all keys are there; every missing one is named at once."""
        missing = [key + self.hint(key, known=keys) for key in keys if key not in self.content]
        if missing:
            raise CalibrationError(
                f"{self.where()}: expected the keys {', '.join(keys)}, missing {'; '.join(missing)}; add them, "
                "or fetch the file again"
            )

    def only(self, *keys: str) -> None:
        """Check that there are no other keys."""
        other = [key for key in self.content if key not in keys]
        if other:
            raise CalibrationError(
                f"{self.where()}: expected the keys {', '.join(keys)} only, got {listed(map(str, other))} too; remove "
                "what does not belong"
            )

    def hint(self, key: str, known: Sequence[str] = ()) -> str:
        """Name the key there that may be a misspelling of a missing one; empty if there is none."""
        names = [name for name in self.content if isinstance(name, str) and name not in known]
        alike = [name for name in names if name.lower() == key.lower()]
        if not alike and len(key) > 2:  # short names are all alike
            alike = difflib.get_close_matches(key, names, n=1)
        return f", where there is {alike[0]!r}" if alike else ""

    def value(self, key: str) -> Any:
        """Whatever the key holds; it must be there."""
        self.require(key)
        return self.content[key]

    def number(self, key: str, *, unit: str = "", positive: bool = False) -> float:
        """Return the finite number of a key."""
        return number(self.value(key), self.where(key), unit=unit, positive=positive)

    def whole(self, key: str, *, minimum: int = 0) -> int:
        """Return the whole number of a key."""
        return whole(self.value(key), self.where(key), minimum=minimum)

    def numbers(self, key: str, count: int | Sequence[int] | None = None, *, unit: str = "") -> Matrix:
        """Return the list of finite numbers of a key."""
        return numbers(self.value(key), self.where(key), count, unit=unit)

    def matrix(self, key: str, shape: tuple[int, int], *, unit: str = "") -> Matrix:
        """Return the matrix of a key, which may be nested or flat."""
        return matrix(self.value(key), self.where(key), shape, unit=unit)

    def rotation(self, key: str) -> Matrix:
        """Return the 3x3 rotation of a key, as given."""
        return rotation(self.value(key), self.where(key))

    def pose(self, key: str, *, unit: str = "metres") -> Matrix:
        """Return the rigid 3x4 or 4x4 transform of a key as (4, 4)."""
        return pose(self.value(key), self.where(key), unit=unit)

    def quaternion(self, key: str, order: str) -> Matrix:
        """Return the rotation matrix of a key's unit quaternion."""
        return quaternion(self.value(key), self.where(key), order)

    def text(self, key: str, among: Sequence[str] = ()) -> str:
        """Return the text of a key, one of `among` if that is given."""
        value = self.value(key)
        if not isinstance(value, str) or (among and value not in among):
            wanted = f"one of {listed(among)}" if among else "text"
            raise CalibrationError(f"{self.where(key)}: expected {wanted}, got {describe(value)}; correct it")
        return value

    def section(self, key: str) -> Section:
        """Return the mapping of a key."""
        return Section(self.value(key), self.origin, f"{self.path}.{key}" if self.path else key)

    def image_size(self, width: str, height: str) -> tuple[int, int]:
        """Return (width, height) from two keys."""
        return self.whole(width, minimum=1), self.whole(height, minimum=1)
