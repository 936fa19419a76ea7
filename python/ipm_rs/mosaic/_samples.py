"""Views of samples: of each cell the values of the few frames that resolve it best, as keys and values.

Of a key the upper 12 bits say how well the frame resolves the cell, in octaves of 512 steps from 1/16 pixel a cell on,
and the lower 20 which frame it is; see `src/mosaic/accumulate.rs`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["feathered", "robust", "voted"]

Keys = NDArray[np.uint32]
Floats = NDArray[np.float32]

_FRAME = np.uint32((1 << 20) - 1)

_COMPARABLE = 0.5
"""Samples of less than half the best resolution, or half a pixel, are not compared: they show another, blurred road."""

_AGREES, _SPREAD = 12.0, 3 * 1.4826
"""Grey levels of 255 from the median, or three standard deviations by the median deviation, whichever is more, within
which a sample is of the road. 12 is six times the noise of a camera, and a quarter of what tells asphalt from paint."""


def _resolutions(keys: Keys) -> Floats:
    """Return pixels a cell, 0 where there is no sample."""
    steps = (keys >> np.uint32(20)).astype(np.int32)
    values = np.ldexp(((steps & 511) + 512).astype(np.float32), (steps >> 9) - 13)
    return np.asarray(np.where(keys > 0, values, 0), np.float32)


def _middle(values: Floats, count: NDArray[np.intp]) -> Floats:
    """Return medians over the third axis, of which the first `count` of what is sorted are meant."""
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    ordered = np.sort(values, axis=2)
    pair = (np.take_along_axis(ordered, at[:, :, None, None], 2)[:, :, 0] for at in (low, np.minimum(high, low + 1)))
    one, other = pair
    return np.asarray((one + other) / 2, np.float32)


def robust(keys: Keys, samples: NDArray[Any]) -> NDArray[Any]:
    """Return the mean of the samples that agree with most, weighed by the eighth power of how well they resolve.

    What stood there for fewer than half of the frames is left out; what all show is as sharp as the weighted mean.
    """
    most = float(np.iinfo(samples.dtype).max)
    resolutions = np.minimum(_resolutions(keys), 1)
    compared = resolutions >= np.maximum(_COMPARABLE * resolutions[:, :, :1], np.float32(1e-6))
    count = compared.sum(2)
    values = samples.astype(np.float32)
    median = _middle(np.where(compared[..., None], values, np.float32(np.inf)), count)
    away = np.abs(values - median[:, :, None])
    spread = _middle(np.where(compared[..., None], away, np.float32(np.inf)), count)
    limit = np.maximum(np.float32(_AGREES * most / 255), np.float32(_SPREAD) * spread)[:, :, None]
    agrees = compared & (away <= limit).all(3)
    weight = np.where(agrees, (resolutions / np.maximum(resolutions[:, :, :1], np.float32(1e-6))) ** 8, 0)
    total = weight.sum(2)[..., None]
    mean = (weight[..., None] * values).sum(2) / np.where(total > 0, total, 1)
    value = np.where(total > 0, mean, median)  # of colours no sample may agree in all channels
    return np.where(keys[:, :, :1] > 0, np.rint(value), 0).astype(samples.dtype)


def voted(keys: Keys, samples: NDArray[Any]) -> tuple[NDArray[Any], Floats]:
    """Return the label that most is for, and its share: a frame has a vote, or the part that it resolves of the cell.

    Of labels with as many votes the one that is seen best wins.
    """
    labels = samples[..., 0]
    weight = np.minimum(_resolutions(keys), 1)
    votes = np.stack(
        [np.where(labels == labels[:, :, k : k + 1], weight, 0).sum(2) for k in range(labels.shape[2])], axis=2
    )
    votes[keys == 0] = 0
    winner = votes.argmax(2)[..., None]
    share = np.take_along_axis(votes, winner, 2)[..., 0] / np.maximum(weight.sum(2), np.float32(1e-6))
    return np.take_along_axis(labels, winner, 2), share.astype(np.float32)


def feathered(keys: Keys, samples: NDArray[Any], radius: int) -> NDArray[Any]:
    """Return of each cell the frame that resolves it best, and near seams the mean of the frames on both sides.

    A frame counts as often as it is the best of the cells within `radius`; both arrays have so many cells more on every
    side than what is returned.
    """
    best = keys[:, :, 0] & _FRAME
    rows, columns = best.shape
    inner = slice(radius, rows - radius), slice(radius, columns - radius)
    shape = rows - 2 * radius, columns - 2 * radius
    frames = keys[inner] & _FRAME
    values = samples[inner]
    total = np.zeros((*shape, samples.shape[3]), np.uint64)
    weight = np.zeros(shape, np.uint64)
    for frame in np.unique(best[best > 0]):
        here = best == frame
        down, across = np.flatnonzero(here.any(1)), np.flatnonzero(here.any(0))
        # cells of the result within the radius of one that the frame is the best of
        top, bottom = max(int(down[0]) - 2 * radius, 0), min(int(down[-1]) + 1, shape[0])
        left, right = max(int(across[0]) - 2 * radius, 0), min(int(across[-1]) + 1, shape[1])
        if top >= bottom or left >= right:
            continue
        near = _boxes(here[top : bottom + 2 * radius, left : right + 2 * radius], radius)
        window = slice(top, bottom), slice(left, right)
        for k in range(frames.shape[2]):
            counted = np.where(frames[window][..., k] == frame, near, 0).astype(np.uint64)
            total[window] += counted[..., None] * values[window][:, :, k]
            weight[window] += counted
    half = weight // 2
    return np.asarray((total + half[..., None]) // np.maximum(weight, 1)[..., None], samples.dtype)


def _boxes(flags: NDArray[np.bool_], radius: int) -> NDArray[np.int64]:
    """Return how many are set of each (2 radius + 1) squared, for those that lie within."""
    size = 2 * radius + 1
    sums = np.zeros((flags.shape[0] + 1, flags.shape[1] + 1), np.int64)
    sums[1:, 1:] = flags.cumsum(0).cumsum(1)
    return np.asarray(sums[size:, size:] - sums[:-size, size:] - sums[size:, :-size] + sums[:-size, :-size])
