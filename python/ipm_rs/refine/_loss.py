"""How brightness differs between two views of the same road, and what of it counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import get_num_threads

__all__ = ["CUT", "correlation", "exposed", "in_threads", "median", "weights_of"]

Matrix = NDArray[np.float64]
T = TypeVar("T")
U = TypeVar("U")

CUT = 4.685
"""Tukey's constant: what is off by more standard deviations counts for nothing, and 95 % of the information stays."""


def exposed(values: Matrix, there: Matrix, spread: float | None, J: Matrix | None) -> tuple[Matrix, Any]:
    """Return how brightness differs when the first picture's gain and offset fit best, and derivatives of that.

    They are fitted to what Tukey's weights leave, from a gain of one and the median offset on: what moves is no light.
    The gain stays between a half and two: else a place without contrast would fit everything.
    """
    off = values - there
    if not len(off):
        return off, J
    off = off - median(off)
    for _ in range(2):
        weights = weights_of(off, 1.4826 * median(np.abs(off)) if spread is None else spread)
        total = float(weights.sum())
        if not total > 0:
            return off, J
        v, t = values - _dot(weights, values) / total, there - _dot(weights, there) / total
        weighted = weights * t
        contrast = _dot(weighted, t)
        gain = _dot(weighted, v) / contrast if contrast > 0 else 1.0
        clipped = min(max(gain, 0.5), 2.0)
        off = v - clipped * t
    if J is not None:
        J = J - np.einsum("n,np->p", weights, J) / total
        if clipped == gain and contrast > 0:
            J = J - t[:, None] * (np.einsum("n,np->p", weighted, J) / contrast)
    return off, J


def median(values: Matrix) -> float:
    """Return the median of a list that is not empty and has no NaN: `np.median` looks for NaN three times as long."""
    middle = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, middle)[middle])
    return float(np.partition(values, (middle - 1, middle))[middle - 1 : middle + 1].mean())


def _dot(a: Matrix, b: Matrix) -> float:
    """Return the sum of products.

    OpenBLAS shares `a @ b` between threads, whose start costs more than such a sum: on a busy machine ten milliseconds
    instead of ten microseconds.
    """
    return float(np.einsum("n,n->", a, b))


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


def in_threads(work: Callable[[T], U], items: Iterable[T]) -> list[U]:
    """Call `work` on each item, in order of the results, on the threads that there are: NumPy lets others run."""
    listed = list(items)
    count = min(len(listed), get_num_threads(), 8)
    if count <= 1:
        return [work(item) for item in listed]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(work, listed))
