"""How brightness differs between two views of the same road, and what of it counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import _refine_differences, _refine_normal, get_num_threads
from ipm_rs.refine._solve import Normal

__all__ = ["correlation", "exposed", "in_threads", "likeness", "loss_of", "most_of", "normal_of", "weights_of"]

Matrix = NDArray[np.float64]
T = TypeVar("T")
U = TypeVar("U")

CUT = 4.685
"""Tukey's constant: what is off by more standard deviations counts for nothing, and 95 % of the information stays."""


def exposed(
    values: Matrix, there: Matrix, spread: float | None = None, slopes: Matrix | None = None
) -> tuple[Matrix, Any, NDArray[np.bool_]]:
    """Return how brightness differs when the first picture's gain and offset fit best, derivatives of that, and where.

    They are fitted to what Tukey's weights leave, from a gain of one and the median offset on: what moves is no light.
    The gain stays between a half and two: else a place without contrast would fit everything. Places that are NaN, and
    those with such derivatives, are left out. Without a spread that of the better half is taken.
    """
    return _refine_differences(values, there, slopes if slopes is None else np.ascontiguousarray(slopes), spread)


def normal_of(off: Matrix, slopes: Matrix, spread: float) -> Normal:
    """Return the normal equations of Tukey's loss, half a square where little is off, `most_of` at most."""
    return Normal(*_refine_normal(off, np.ascontiguousarray(slopes), spread))


def loss_of(off: Matrix, spread: float) -> float:
    """Return Tukey's loss, of each place from 0 to 1; without a spread all that differs counts in full."""
    if not spread > 0:
        return float(np.count_nonzero(off))
    return _refine_normal(off, np.zeros((len(off), 0)), spread)[0] / most_of(spread)


def most_of(spread: float) -> float:
    """Return the loss of what is so far off that it counts for nothing."""
    return CUT**2 / 6.0 * spread**2


def weights_of(off: Matrix, spread: float) -> Matrix:
    if not spread > 0:
        return np.zeros_like(off)
    share = off * (1.0 / (CUT * spread))
    share *= share
    rest = 1.0 - np.minimum(share, 1.0, out=share)
    return np.multiply(rest, rest, out=rest)


def correlation(a: NDArray[np.floating[Any]], b: NDArray[np.floating[Any]]) -> float:
    """Return the correlation of two lists; 0 where one has no contrast, -1 of fewer than ten."""
    if len(a) < 10:
        return -1.0
    a, b = a - a.mean(), b - b.mean()
    size = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size > 0 else 0.0


def likeness(a: NDArray[np.floating[Any]], b: NDArray[np.floating[Any]]) -> float:
    """Return the correlation of what two lists have in common, by Tukey's weights; -1 of fewer than ten.

    A moving thing that covers a third of a narrow overlap leaves 0.0 to 0.3 of the plain correlation of two views of
    the same road, which poses a degree off have by chance; without what is far off it is 0.98, theirs 0.6 at most.
    """
    if len(a) < 10:
        return -1.0
    a, b = (np.asarray(each, dtype=np.float64) for each in (a, b))
    off, _, both = exposed(b, a)
    weights = weights_of(off, 1.4826 * float(np.median(np.abs(off)))) if len(off) else off
    total = float(weights.sum())
    if not total > 0.0:
        return correlation(a, b)
    a, b = a[both], b[both]
    a, b = a - float(weights @ a) / total, b - float(weights @ b) / total
    size = math.sqrt(float(weights @ (a * a)) * float(weights @ (b * b)))
    return float(weights @ (a * b)) / size if size > 0.0 else 0.0


def in_threads(work: Callable[[T], U], items: Iterable[T]) -> list[U]:
    """Call `work` on each item, in order of the results, on the threads that there are: NumPy lets others run."""
    listed = list(items)
    count = min(len(listed), get_num_threads(), 8)
    if count <= 1:
        return [work(item) for item in listed]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(work, listed))
