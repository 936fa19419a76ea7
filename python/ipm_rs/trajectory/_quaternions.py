"""Many rotations at once, as unit quaternions in the order w x y z."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["of_matrices", "to_matrices", "turned"]

Array = NDArray[np.float64]

_NEARLY_ALIKE = 1 - 1e-9
"""Cosine of half the angle from which on the chord stands for the arc: they differ by 1e-14 there, and 1/sin grows."""


def to_matrices(quaternions: Array) -> Array:
    """Return the rotations, (N, 3, 3), of (N, 4) unit quaternions."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def of_matrices(rotations: Array) -> Array:
    """Return the unit quaternions, (N, 4), of (N, 3, 3) rotations; of each, the sign nearer to the last one.

    The largest of the four numbers is taken from the diagonal and the others are divided by it, so that no angle loses
    digits (Shepperd, 1978).
    """
    m = rotations
    trace = np.einsum("nii->n", m)
    squares = np.stack([1 + trace, *(1 + 2 * m[:, k, k] - trace for k in range(3))], axis=-1)  # 4 w^2, 4 x^2, ...
    across = [m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]]  # 4 w (x, y, z)
    along = {(i, j): m[:, i, j] + m[:, j, i] for i, j in ((0, 1), (0, 2), (1, 2))}  # 4 x y, ...
    candidates = np.stack(
        [
            np.stack([squares[:, 0], *across], -1),
            np.stack([across[0], squares[:, 1], along[0, 1], along[0, 2]], -1),
            np.stack([across[1], along[0, 1], squares[:, 2], along[1, 2]], -1),
            np.stack([across[2], along[0, 2], along[1, 2], squares[:, 3]], -1),
        ]
    )
    found = candidates[np.argmax(squares, axis=-1), np.arange(len(m))]
    found /= np.linalg.norm(found, axis=-1, keepdims=True)
    flips = np.einsum("ni,ni->n", found[1:], found[:-1]) < 0
    found[1:] *= np.where(np.cumsum(flips) % 2, -1.0, 1.0)[:, None]
    return found


def turned(first: Array, second: Array, share: Array) -> Array:
    """Return the rotations a `share` of the way from `first` to `second`, (N, 4) each: slerp, the shorter way round."""
    cosine = np.einsum("ni,ni->n", first, second)
    second = np.where(cosine[:, None] < 0, -second, second)
    cosine = np.clip(np.abs(cosine), 0.0, 1.0)
    alike = cosine > _NEARLY_ALIKE
    angle = np.arccos(np.where(alike, 0.0, cosine))
    sine = np.sin(angle)
    before = np.where(alike, 1 - share, np.sin((1 - share) * angle) / sine)
    after = np.where(alike, share, np.sin(share * angle) / sine)
    mixed = before[:, None] * first + after[:, None] * second
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True), dtype=np.float64)
