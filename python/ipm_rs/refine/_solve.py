"""Nonlinear least squares for a handful of parameters (Levenberg 1944, Marquardt 1963)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["jacobian", "minimised"]

Vector = NDArray[np.float64]

# Parameters are metres and radians: a step of 1e-6 moves pixels by about 1e-3, of which float64 keeps ten digits.
_STEP = 1e-6


def jacobian(residuals: Callable[[Vector], Vector], at: Vector) -> Vector:
    """Return how residuals change with each parameter, (residuals, parameters), by central differences."""
    columns = []
    for index in range(len(at)):
        step = np.zeros_like(at)
        step[index] = _STEP
        columns.append((residuals(at + step) - residuals(at - step)) / (2 * _STEP))
    return np.stack(columns, axis=1)


def minimised(residuals: Callable[[Vector], Vector], start: Vector, *, most_steps: int = 60) -> tuple[Vector, float]:
    """Return the parameters near `start` of the smallest sum of squares, and that sum.

    Residuals that are not finite count as no improvement, so a step out of the model's domain is taken back.
    """
    at, damping = start.copy(), 1e-3
    now = residuals(at)
    cost = _cost(now)
    for _ in range(most_steps):
        J = jacobian(residuals, at)
        if not np.isfinite(J).all():
            break
        normal, gradient = J.T @ J, J.T @ now
        while damping < 1e12:
            step = np.linalg.lstsq(normal + damping * np.diag(np.diag(normal) + 1e-12), -gradient, rcond=None)[0]
            then = residuals(at + step)
            if _cost(then) < cost:
                break
            damping *= 10
        else:
            break
        gain = cost - _cost(then)
        at, now, cost, damping = at + step, then, _cost(then), max(damping / 10, 1e-12)
        if gain <= 1e-10 * cost or np.abs(step).max() < 1e-13:
            break
    return at, cost


def _cost(residuals: Vector) -> float:
    cost = float(residuals @ residuals)
    return cost if np.isfinite(cost) else np.inf
