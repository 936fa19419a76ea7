"""Arguments of the refinements, checked; and a guard for numbers that no arithmetic survives."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import array_of
from ipm_rs._core import Camera
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = ["camera_of", "guarded", "numbers_of"]

P = ParamSpec("P")
R = TypeVar("R")


def guarded(function: Callable[P, R]) -> Callable[P, R]:
    """Let NumPy warn of nothing in a function, and make an ArgumentError of equations that cannot be solved."""

    @functools.wraps(function)
    def inner(*arguments: P.args, **keywords: P.kwargs) -> R:
        try:
            with np.errstate(all="ignore"):
                return function(*arguments, **keywords)
        except np.linalg.LinAlgError as error:
            raise ArgumentError(
                f"{function.__name__}: expected numbers of a usual size, metres and pixels, got some that cannot be "
                f"reckoned with ({error}); check units and order"
            ) from error

    return inner


def numbers_of(name: str, value: Any, shape: Sequence[int | None], what: str) -> NDArray[np.float64]:
    """Return finite numbers of a shape as float64; None stands for any length.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Another shape, or no numbers; `what` says in the message what they are.
    CalibrationError
        One of them is not finite.
    """
    array = array_of(name, value)
    fits = array.ndim == len(shape) and all(
        want in (None, size) for want, size in zip(shape, array.shape, strict=False)
    )
    wanted = "(" + ", ".join("N" if size is None else str(size) for size in shape) + ("," if len(shape) == 1 else "")
    if array.dtype.kind not in "iuf":
        raise ArgumentTypeError(
            f"{name}: expected {wanted}) numbers, {what}, got {array.dtype} of shape {array.shape}; pass real numbers"
        )
    if not fits:
        raise ArgumentError(f"{name}: expected shape {wanted}), {what}, got {array.shape}; reshape it")
    with np.errstate(all="ignore"):
        result = np.array(array, dtype=np.float64)
    if not np.isfinite(result).all():
        at = tuple(int(index) for index in np.argwhere(~np.isfinite(result))[0])
        raise CalibrationError(f"{name}: expected finite numbers, {what}, got {result[at]} at {at}; leave that row out")
    return result


def camera_of(name: str, value: Any) -> Camera:
    """Return a camera, or raise ArgumentTypeError for anything else."""
    if not isinstance(value, Camera):
        raise ArgumentTypeError(f"{name}: expected an ipm_rs.Camera, got {type(value).__name__}; Camera.load reads one")
    return value
