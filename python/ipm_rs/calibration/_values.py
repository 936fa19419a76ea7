"""Numbers, lists and matrices out of a calibration, checked, and how values and words are named in messages.

`where` is the place that a message begins with, ``"camera.json: intrinsic.fx"``. Every problem is a `CalibrationError`
with the place, what was expected, what came and how to mend it.
"""

from __future__ import annotations

import math
import numbers as abstract
import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import CalibrationError

__all__ = [
    "Matrix",
    "coefficients",
    "describe",
    "forgotten_commas",
    "image_size",
    "items_of",
    "listed",
    "matrix",
    "number",
    "numbers",
    "whole",
]

Matrix = NDArray[np.float64]


def describe(value: Any) -> str:
    """Name a value in a message: its type, and the value itself where that is short."""
    if value is None or isinstance(value, bool):
        return f"{value!r}"
    text = repr(value) if isinstance(value, (str, int, float)) and not _is_huge(value) else ""
    if isinstance(value, (list, tuple)):
        short = 0 < len(value) <= 4 and all(isinstance(x, (int, float)) and not _is_huge(x) for x in value)
        return f"{type(value).__name__} {value!r}" if short else f"{type(value).__name__} of {len(value)}"
    if isinstance(value, np.ndarray):
        return f"array {value.tolist()!r:.60}" if 0 < value.size <= 4 else f"array of shape {value.shape}"
    return f"{type(value).__name__} {text}" if text and len(text) <= 60 else type(value).__name__


def _is_huge(value: Any) -> bool:
    return isinstance(value, int) and value.bit_length() > 200  # its digits would fill the message, or be refused


def listed(words: Iterable[str], limit: int = 12) -> str:
    """Words in a message, quoted; a long list is cut. A token of 64 digits is not, so that it can be passed on."""
    every = [repr(word if len(word) <= 64 else word[:61] + "...") for word in words]
    rest = len(every) - limit
    return ", ".join(every[:limit]) + (f" and {rest} more" if rest > 0 else "") if every else "none"


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
    items = items_of(value)
    counts = (count,) if isinstance(count, int) else count
    wanted = "numbers" if counts is None else f"{_or(counts)} numbers"
    if items is None:
        mend = "write them in a list, with commas between" if _several(value) else "write them in a list"
        raise CalibrationError(f"{where}: expected a list of {wanted}, got {describe(value)}; {mend}")
    # nearly always so: of three numbers two thirds of the time of the checks one by one, of fifteen a fifth
    are_floats = all(type(item) is float for item in items) and all(map(math.isfinite, items))
    if are_floats and (counts is None or len(items) in counts):
        return np.array(items, dtype=float)
    forgotten_commas(items, where)
    if counts is not None and len(items) not in counts:
        raise CalibrationError(
            f"{where}: expected {wanted}, got {len(items)}; check that the list is complete and of this format"
        )
    return np.array([number(item, f"{where}[{index}]", unit=unit) for index, item in enumerate(items)], dtype=float)


def matrix(value: Any, where: str, shape: tuple[int, int], *, unit: str = "") -> Matrix:
    """Check a matrix of finite numbers, given by rows, as one row-major list, or as an array; float64."""
    rows, columns = shape
    items = items_of(value)
    forgotten_commas(items or (), where)
    if items is not None and len(items) == rows and any(items_of(item) is not None for item in items):
        return np.array([numbers(row, f"{where}[{i}]", columns, unit=unit) for i, row in enumerate(items)])
    if items is None or len(items) != rows * columns:
        got = describe(value) if items is None else _shape(items)
        raise CalibrationError(
            f"{where}: expected a {rows}x{columns} matrix, got {got}; give {rows} rows of {columns} numbers, or all "
            f"{rows * columns} row by row"
        )
    return numbers(items, where, rows * columns, unit=unit).reshape(rows, columns)


_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_SEVERAL = re.compile(rf"\s*{_NUMBER}(?:[\s;]+{_NUMBER})+[\s;]*")


def _several(value: Any) -> bool:
    """Whether it is text of several numbers, parted by blanks."""
    return isinstance(value, str) and len(value) < 10_000 and _SEVERAL.fullmatch(value) is not None


def forgotten_commas(items: Sequence[Any], where: str) -> None:
    """Refuse a list in which blanks part numbers: ``[652.0 0.0 718.5]`` is one piece of text to YAML."""
    text = next((item for item in items if isinstance(item, str) and _several(item)), None)
    if text is not None:
        raise CalibrationError(
            f"{where}: expected numbers with commas between them, got {text!r:.60} as one; write the commas"
        )


def coefficients(value: Any, where: str, counts: Sequence[int]) -> Matrix:
    """Check the numbers of a lens, of one of the given lengths.

    Zeros beyond a length are those of a model with more terms, and change nothing: they are left out. A list that is
    too short and all zero is a lens that bends nothing: it is filled up.
    """
    values = numbers(value, where)
    if len(values) in counts:
        return values
    longest = max((count for count in counts if count < len(values) and not values[count:].any()), default=None)
    if longest is not None:
        return values[:longest]
    if len(values) and len(values) < min(counts) and not values.any():
        return np.zeros(min(counts))
    return numbers(value, where, counts)


def items_of(value: Any) -> list[Any] | tuple[Any, ...] | None:
    """Elements of a list, a tuple or an array; None for anything else."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    return value if isinstance(value, (list, tuple)) else None


def _shape(items: Sequence[Any]) -> str:
    inner = {len(row) for row in map(items_of, items) if row is not None}
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
