"""How far the poses of a ring can be trusted: from how patches of road disagree, and from how pictures are sampled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ipm_rs.refine._loss import weights_of
from ipm_rs.refine._ring import Ring, State, View
from ipm_rs.refine._solve import inverse_of, patches_of

__all__ = ["covariance_of"]

Matrix = NDArray[np.float64]

_SAMPLED = 0.03
"""Pixels by which sampling puts the edges in a patch of road off, all of them alike; see `_alignment`."""
_TOGETHER = 0.04
"""Pixels by which it puts a whole overlap off: a lane line that runs along the line of sight falls between the same two
columns all the way. Chosen on seeds 0 to 3 of `scripts/try_refine.py ring pinhole6`; without it, rolls were stated five
times as good as they are."""


def covariance_of(ring: Ring, state: State) -> Matrix:
    """(4 N, 4 N) of roll, pitch, yaw and height of the free cameras.

    Patches of the road are off each for itself. A narrow overlap has a dozen of them, which the fit has made agree with
    each other: what one is off by is told by the rest of them, without it (the jackknife; MacKinnon and White 1985).
    """
    chosen = ring.chosen(state, 1)
    spreads, views = ring.spreads(state, chosen, 1), ring.views(state, 1, chosen, shifted=True)
    likely = np.tile(ring.likely, len(ring.free))
    told = [_told(ring, views, pair, chosen[pair], spread) for pair, spread in spreads.items()]
    stiff = np.diag(likely**-2)
    for where, _, stiffs in told:
        stiff[np.ix_(where, where)] += _positive(stiffs.sum(0), likely[where])
    inverse = inverse_of(stiff)
    if inverse is None:
        return np.diag(likely**2)
    # what no overlap tells is as uncertain as before
    middle = np.diag(likely**-2)
    for where, pulls, stiffs in told:
        own, part = np.eye(len(where)), inverse[np.ix_(where, where)]
        for pull, resisting in zip(pulls, stiffs, strict=True):
            alone = np.linalg.solve(own - resisting @ part, pull[:, 0])
            shifted = _SAMPLED * pull[:, 1:]
            middle[np.ix_(where, where)] += np.outer(alone, alone) + shifted @ shifted.T
        shifted = _TOGETHER * pulls.sum(0)[:, 1:]
        middle[np.ix_(where, where)] += shifted @ shifted.T
    covariance = inverse @ middle @ inverse
    # never less certain than as given
    times = np.minimum(likely / np.sqrt(np.diag(covariance)), 1.0)
    return np.asarray(covariance * times[:, None] * times, dtype=np.float64)


def _positive(stiff: Matrix, likely: Matrix) -> Matrix:
    """Return the nearest matrix that holds nothing less than not at all, in units of what is likely."""
    values, vectors = np.linalg.eigh(stiff * likely[:, None] * likely)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T / likely[:, None] / likely, dtype=np.float64)


class _Told(NamedTuple):
    """What a pair tells, patch by patch."""

    where: list[int]
    """Of which parameters."""
    pulls: Matrix
    """(G, P, 5): how the residuals pull at them, and how they would if the pictures were a pixel off."""
    stiff: Matrix
    """(G, P, P): how strongly they are held."""


def _told(
    ring: Ring, views: Mapping[str, View], pair: tuple[str, str], cells: NDArray[np.bool_], spread: float
) -> _Told:
    columns = ring.columns(pair)
    kept = [k for k, column in enumerate(columns) if column >= 0]
    places, pulls, stiffs = [np.zeros((0, 3))], [np.zeros((0, len(kept), 5))], [np.zeros((0, len(kept), len(kept)))]
    xy = ring.grids[1].xy()
    for off, J, whole, both in ring.differences(views, pair, cells, spread):
        weights = whole / spread**2 * weights_of(off, spread)
        by_camera = J.reshape(len(J), 2, 2, -1)
        by_pose = by_camera[..., :4].reshape(len(J), 2, 8)[:, :, kept]
        by_shift = by_camera[..., 4:].reshape(len(J), 2, 4)
        weighted = weights[:, None] * by_pose.mean(1)
        pulls.append(weighted[:, :, None] * np.column_stack([off, by_shift.mean(1)])[:, None, :])
        crossed = weights[:, None, None] * by_pose[:, 0, :, None] * by_pose[:, 1, None, :]
        stiffs.append(0.5 * (crossed + crossed.transpose(0, 2, 1)))
        places.append(np.column_stack([xy[both], np.zeros(len(off))]))
    which = patches_of(np.concatenate(places), ring.height)
    return _Told([columns[k] for k in kept], _summed(pulls, which), _summed(stiffs, which))


def _summed(parts: list[Matrix], which: NDArray[np.intp]) -> Matrix:
    """Sum rows over the patches that they belong to."""
    rows = np.concatenate(parts)
    total = np.zeros((int(which.max(initial=-1)) + 1, *rows.shape[1:]))
    np.add.at(total, which, rows)
    return total
