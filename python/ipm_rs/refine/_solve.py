"""Levenberg-Marquardt on normal equations: the one solver of everything that is refined here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Normal", "forward", "inverse_of", "minimise", "patched", "patches_of", "scatter_of"]

State = TypeVar("State")

_MOST_DAMPING = 1e9


@dataclass(frozen=True)
class Normal:
    """Half the sum of squares at a state, its gradient, and the Gauss-Newton matrix ``J^T J``."""

    cost: float
    gradient: NDArray[np.float64]
    hessian: NDArray[np.float64]

    @staticmethod
    def of(residuals: NDArray[np.float64], jacobian: NDArray[np.float64]) -> Normal:
        """Return the normal equations of residuals (N,) and their derivatives (N, P)."""
        return Normal(0.5 * float(residuals @ residuals), jacobian.T @ residuals, jacobian.T @ jacobian)


def minimise(
    evaluate: Callable[[State], Normal],
    state: State,
    move: Callable[[State, NDArray[np.float64]], State],
    *,
    iterations: int = 60,
    tolerance: float = 1e-12,
) -> tuple[State, Normal]:
    """Walk downhill from a state.

    Parameters
    ----------
    evaluate : callable
        The normal equations at a state; a cost that is not finite marks a state that cannot be.
    state : object
        Where to begin.
    move : callable
        The state after a step, (P,), from another: states need be no vectors.
    iterations : int
        At most so many evaluations.
    tolerance : float
        Ends when a step lowers the cost by a smaller part than this.

    Returns
    -------
    (state, Normal)
        The best state and its normal equations.
    """
    current = evaluate(state)
    damping = 1e-4
    for _ in range(iterations):
        # Marquardt's scaling: parameters in metres and in radians are damped alike
        scale = np.sqrt(np.maximum(np.diag(current.hessian), 1e-300))
        damped = current.hessian / np.outer(scale, scale) + damping * np.eye(len(scale))
        try:
            factor = np.linalg.cholesky(damped)
            step = backward(factor, forward(factor, -1.0 * current.gradient / scale)) / scale
        except np.linalg.LinAlgError:
            step = np.full(len(scale), np.nan)
        # what the equations promise: at the least cost nothing, and trying on would only find rounding
        if 0.0 <= -0.5 * float(current.gradient @ step) <= 0.1 * tolerance * current.cost:
            break
        trial_state = move(state, step) if np.isfinite(step).all() else state
        trial = evaluate(trial_state) if trial_state is not state else current
        if trial.cost < current.cost:
            gained = current.cost - trial.cost
            small = gained <= tolerance * current.cost
            state, current, damping = trial_state, trial, max(damping * 0.1, 1e-12)
            if small:
                break
        else:
            damping *= 10.0
            if damping > _MOST_DAMPING:
                break
    return state, current


def inverse_of(hessian: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the inverse of a Gauss-Newton matrix, symmetric; None where it tells nothing of some direction."""
    scale = np.sqrt(np.diag(hessian)).astype(np.float64)
    if not (np.isfinite(scale).all() and (scale > 0).all()):
        return None
    try:
        factor = np.linalg.cholesky(hessian / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return None
    part = forward(factor, np.eye(len(scale))) / scale
    inverse = np.einsum("ki,kj->ij", part, part)
    # of a matrix whose diagonal is 1, the largest eigenvalue is no more than its size, the smallest no less than this
    return inverse if float((np.diag(inverse) * scale**2).sum()) < 1e13 else None


def forward(factor: NDArray[np.floating[Any]], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve ``L x = right``, of a lower triangle, for a vector (N,) or columns (N, K).

    `np.linalg.solve` and `eigh` share a hundred unknowns between OpenBLAS's threads, whose start takes 20 to 90 ms
    where others want the CPUs too; Cholesky and this take half a millisecond together.
    """
    found = np.array(right, dtype=np.float64)
    for row, values in enumerate(factor):
        found[row] = (found[row] - np.einsum("j,j...->...", values[:row], found[:row])) / values[row]
    return found


def backward(factor: NDArray[np.floating[Any]], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve ``L^T x = right``, of a lower triangle."""
    return forward(factor.T[::-1, ::-1], right[::-1])[::-1]


def patches_of(places: NDArray[np.float64], size: float) -> NDArray[np.intp]:
    """Return the number of the square patch of road, from 0 on, that each of some places (N, 3) lies on."""
    away = places - places.mean(0)
    along = np.linalg.eigh(np.einsum("ni,nj->ij", away, away))[1][:, :0:-1]  # the road's two directions
    patches = np.floor(np.einsum("ni,ij->nj", away, along) / size).astype(np.int64)
    patches -= patches.min(0, initial=0)
    rows, columns = patches.T
    numbers = rows * (columns.max(initial=0) + 1) + columns
    return np.unique(numbers, return_inverse=True)[1].reshape(-1)


def patched(places: NDArray[np.float64], pulls: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Sum pulls (N, P) over square patches of the road that places (N, 3) lie on."""
    which = patches_of(places, size)
    return np.stack([np.bincount(which, weights=column) for column in pulls.T], -1)


def scatter_of(pulls: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance of the sum of pulls (N, P) that are drawn each for itself."""
    return np.asarray(pulls.T @ pulls * (len(pulls) / max(len(pulls) - 1, 1)), dtype=np.float64)
