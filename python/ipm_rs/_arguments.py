"""Paths and arrays of the functions that are written in Python."""

from __future__ import annotations

import itertools
import math
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError, IpmError

__all__ = ["array_of", "check_word", "flag_of", "names_of", "number_of", "path_text", "rows_of"]


def path_text(name: str, path: Any) -> str:
    """Return a path as text.

    Raises
    ------
    ArgumentTypeError
        It is no path.
    FileError
        No file can have the name: it holds a null byte or a lone surrogate.
    """
    try:
        text = os.fspath(path)
    except MemoryError:
        raise
    except Exception as error:  # `__fspath__` raises what it likes
        raise ArgumentTypeError(f"{name}: expected a path, got {type(path).__name__}; pass the file's name") from error
    if not isinstance(text, str):
        raise ArgumentTypeError(f"{name}: expected a text path, got {text!r:.80}; decode it with os.fsdecode()")
    try:
        encoded = os.fsencode(text)
    except UnicodeEncodeError:
        encoded = b"\0"
    if b"\0" in encoded:
        raise FileError(f"{name}: expected a name that a file can have, got {text!r:.80}; correct it")
    return text


def flag_of(name: str, value: Any) -> bool:
    """Return True or False, or raise ArgumentTypeError for anything else."""
    if not isinstance(value, (bool, np.bool_)):
        raise ArgumentTypeError(f"{name}: expected True or False, got {type(value).__name__}")
    return bool(value)


def check_word(name: str, value: Any) -> None:
    """Refuse an option that cannot be told in a message: Python prints no integer of thousands of digits."""
    try:
        repr(value), str(value)
    except MemoryError:
        raise
    except Exception as error:  # `__repr__` raises what it likes
        got = type(value).__name__
        raise ArgumentTypeError(f"{name}: expected a name or a number, got {got} that cannot be printed") from error


def names_of(name: str, value: Any) -> list[str]:
    """Return names as a list: one, or an iterable of up to 1000.

    Raises
    ------
    ArgumentTypeError
        It is something else.
    """
    if isinstance(value, str):
        return [value]
    try:
        listed = list(itertools.islice(value, 1000))
    except MemoryError:
        raise
    except Exception as error:  # `__iter__` raises what it likes
        raise ArgumentTypeError(f"{name}: expected names, got {type(value).__name__}; pass a list of text") from error
    for item in listed:
        if not isinstance(item, str):
            raise ArgumentTypeError(
                f"{name}: expected names, got {type(item).__name__} among them; pass a list of text"
            )
    return listed


def array_of(name: str, value: Any) -> NDArray[Any]:
    """Return an array-like as an array.

    Raises
    ------
    ArgumentError
        Some of its values are masked: NumPy would drop the mask without a word.
    ArgumentTypeError
        NumPy makes no array of it.
    """
    try:
        array = np.asanyarray(value)
        masked = isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array)
    except (IpmError, MemoryError):
        raise
    except Exception as error:  # `__array__` raises what it likes
        raise ArgumentTypeError(f"{name}: expected an array of numbers, got {type(value).__name__}") from error
    if masked:
        raise ArgumentError(
            f"{name}: expected values none of which is masked, got a MaskedArray with masked ones; say what stands in "
            f"their place with {name}.filled(value), or leave them out"
        )
    return np.asarray(array)


def number_of(name: str, value: Any, *, low: float = -math.inf, high: float = math.inf, what: str = "") -> float:
    """Return a finite number between two limits, which are not allowed themselves; `what` follows it in messages.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        It is none.
    """
    array = array_of(name, value)
    if array.shape != () or array.dtype.kind not in "iuf":
        raise ArgumentTypeError(f"{name}: expected a number{what}, got {array.dtype} of shape {array.shape}")
    if not (np.isfinite(array) and low < array < high):
        limits = (f" above {low:g}" if low > -math.inf else "") + (f" and below {high:g}" if high < math.inf else "")
        raise ArgumentError(f"{name}: expected a finite number{limits}{what}, got {float(array):g}; correct it")
    return float(array)


def rows_of(name: str, values: Any, columns: int) -> NDArray[np.float64]:
    """Return (N, columns) coordinates of a scene.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        They have another shape, are no numbers, not finite or beyond 1e9.
    """
    array = array_of(name, values)
    if array.dtype.kind not in "iuf":
        raise ArgumentTypeError(f"{name}: expected numbers, got {array.dtype}")
    if array.ndim != 2 or array.shape[1] != columns:
        raise ArgumentError(f"{name}: expected shape (N, {columns}), got {array.shape}")
    rows = array.astype(np.float64)
    if not np.isfinite(rows).all() or (np.abs(rows) > 1e9).any():
        raise ArgumentError(f"{name}: expected finite numbers of a scene, got NaN, infinite or beyond 1e9")
    return rows
