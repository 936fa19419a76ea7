"""How a vehicle sways against the poses of a drive: each picture's own pitch and height, and how much these spread.

A nod of a tenth of a degree moves the picture by a pixel or two; a common pitch moves both pictures of a pair alike,
and what they show of the road beside each other far less. Where a vehicle nods, one pitch for all pictures fits none,
and the one that fits best is wrong by several nods. So each picture has its own, drawn about that of the mounting with
a standard deviation that the pictures tell as well (a random effect, as statistics has it): with none, it is the plain
fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import CalibrationError
from ipm_rs.refine._alignment import Alignment, Solved
from ipm_rs.refine._loss import in_threads
from ipm_rs.refine._road import OF_EACH, Pair, Pose, Road, Sight
from ipm_rs.refine._solve import Normal, forward, inverse_of, minimise, patches_of, scatter_of

__all__ = ["Nodding"]

Matrix = NDArray[np.float64]

_LEVER = 1.5
"""Metres: a vehicle whose ends spring by so much about its middle nods by so many radians."""
_USUAL = float(np.radians(0.5))
"""How far a vehicle nods at most, usually: what nods are held to until the pictures have told."""
_SPREADS = np.radians(np.geomspace(0.003, 1.0, 41))
"""Standard deviations of nods that are weighed against each other and against none."""
_NOTICED = 5.0
"""So much larger is the logarithm of how likely the pictures are where nods are taken to be there. Of drives of six
pictures without nods it was 0 five times of five; with nods of 0.02 degrees 148 and 179."""
_ALIKE = 2.5
"""Pairs share pictures, and pull alike: so much larger is the variance of what pulls than if each did for itself.
Chosen on ten drives with nods of 0.15 degrees, seeds 1 to 5 and 100 to 104 of `scripts/try_refine.py`."""
_TRIED = np.radians(0.1 * np.arange(-6, 7))
_ROUNDS = 5
"""How often pairs are looked at for a better place: two or three times are enough for nods of 0.3 degrees."""


class _Told(NamedTuple):
    """What pictures tell of the nods."""

    spread: float
    """The standard deviation that makes the pictures the likeliest, radians; 0 for none."""
    gain: float
    """Logarithm of how much likelier they are with it than without nods."""


class _Equations(NamedTuple):
    """What pictures tell about a pose: of the parameters that are free, and of each picture's pitch and height."""

    spread: float
    """Standard deviation of the residuals."""
    normal: Normal
    middle: Matrix
    """Covariance of what pulls, patches of the road and pairs of pictures each for itself."""
    noise: float
    """Variance of the residuals, as far as neighbours that are off alike count once."""


class Nodding:
    """The sways of a drive whose pictures were aligned with one pitch for all.

    Parameters
    ----------
    drive : Alignment
        The drive, already solved.
    """

    def __init__(self, drive: Alignment) -> None:
        self.drive = drive
        self._scale = np.tile([1.0, _LEVER], drive.count)

    def solved(self, plain: Solved, *, always: bool) -> tuple[Solved, float]:
        """Return the pose with the sways of the pictures, and the standard deviation of the nods, radians.

        It is the plain one, with a deviation of 0, where pictures show no nods, unless they are wanted `always`.

        Raises
        ------
        CalibrationError
            With a pitch of its own for each picture, they do not tell that of the camera.
        """
        drive, finest = self.drive, self.drive.levels[0]
        if not (always or self._noticed(plain)):
            return plain, 0.0
        free, kept = list(plain.free), dict(plain.kept)
        pose = self._unlocked(self._with_sways(drive.coarse), free)
        for level in range(drive.coarsest - 1, finest, -1):
            pose = self._walked(pose, free, level)
        while True:
            pose, covariance, spread = self._finest(pose, free)
            untold = drive.untold(free, covariance)
            if not untold:
                return Solved(pose, tuple(free), covariance, kept), spread
            if "pitch" in untold:
                raise CalibrationError(
                    f"images: expected pictures that tell the camera's pitch, but the vehicle nods by "
                    f"{np.degrees(spread):.2f} deg and {untold['pitch']}; take more pictures, or poses that know of "
                    "the nods"
                )
            kept |= untold
            pose, free = drive.without(pose, free, untold)

    def _noticed(self, plain: Solved) -> bool:
        """Whether pictures that were aligned with one pitch show nods.

        Small ones make the pictures likelier; large ones lead the one pitch so far astray that no small sway helps, but
        then some pair fits better elsewhere.
        """
        drive, pose = self.drive, self._with_sways(plain.pose)
        if self._told(self._equations(pose, plain.free, drive.levels[0]), pose).gain > _NOTICED:
            return True
        return any(self._steps(pose, drive.coarsest))

    # ------------------------------------------------------------------------------------------------------------------
    # What the pictures tell

    def _equations(self, pose: Pose, free: Sequence[int], level: int) -> _Equations:
        drive, n = self.drive, len(free)
        sights = drive.road.sights(pose, drive.area, level, drive.most)
        spread = drive.road.spread(pose, sights, level)
        normal = drive.normal(drive.road, sights, level, spread, free, pose)
        middle = self._middle(pose, sights, level, spread, free)
        inverse = np.linalg.pinv(normal.hessian[:n, :n], hermitian=True)
        return _Equations(spread, normal, middle, float(np.trace(inverse @ middle[:n, :n])) / n)

    def _middle(self, pose: Pose, sights: Sequence[Sight], level: int, spread: float, free: Sequence[int]) -> Matrix:
        road, n = self.drive.road, len(free)
        parts = road.pulls(pose, sights, level, spread, [*free, *OF_EACH])
        which = patches_of(np.concatenate([places for places, _ in parts]), self.drive.patch)
        count, at = int(which.max(initial=0)) + 1, 0
        by_patch = np.zeros((count, n + 2 * self.drive.count))
        by_pair = np.zeros((len(road.pairs), n + 2 * self.drive.count))
        for number, (pair, (_, pulls)) in enumerate(zip(road.pairs, parts, strict=True)):
            patch = which[at : at + len(pulls)]
            at += len(pulls)
            for column, pull in zip(road.columns(pair, n), pulls.T, strict=True):
                by_patch[:, column] += np.bincount(patch, weights=pull, minlength=count)
                by_pair[number, column] = pull.sum()
        return scatter_of(by_patch) + scatter_of(by_pair)

    def _told(self, equations: _Equations, pose: Pose) -> _Told:
        """Return how much the vehicle nods: the spread with which the pictures are the likeliest.

        Of a quadratic cost and sways that are drawn with a spread the likelihood has a closed form:
        ``(q^T (E + I / v)^-1 q - log det(I + v E)) / 2`` with stiffness E, pull q, variance v.
        """
        n = equations.normal.hessian.shape[0] - len(self._scale)
        scale = np.concatenate([np.ones(n), self._scale])
        H = equations.normal.hessian * np.outer(scale, scale) / equations.noise
        g = equations.normal.gradient * scale / equations.noise
        given = H[n:, :n] @ np.linalg.pinv(H[:n, :n], hermitian=True)  # whatever the sways, the pose follows
        stiff = H[n:, n:] - given @ H[:n, n:]
        pull = g[n:] - given @ g[:n] - stiff @ (pose.sways.reshape(-1) / self._scale)
        gains = [self._gain(stiff, pull, v) for v in _SPREADS]
        best = int(np.argmax(gains))
        return _Told(float(_SPREADS[best]), gains[best]) if gains[best] > 0.0 else _Told(0.0, 0.0)

    @staticmethod
    def _gain(stiff: Matrix, pull: Matrix, spread: float) -> float:
        """Return how much the logarithm of the likelihood gains where sways are drawn with a spread."""
        factor = np.linalg.cholesky(spread**2 * stiff + np.eye(len(pull)))
        moved = forward(factor, spread * pull)
        return float(0.5 * np.einsum("n,n->", moved, moved) - np.log(np.diag(factor)).sum())

    # ------------------------------------------------------------------------------------------------------------------
    # Walks

    def _finest(self, pose: Pose, free: Sequence[int]) -> tuple[Pose, Matrix, float]:
        """Return the pose on the finest pictures, the covariance of what is free, and the spread of the nods."""
        drive, n, finest = self.drive, len(free), self.drive.levels[0]
        for _ in range(2):
            equations = self._equations(pose, free, finest)
            usual = max(self._told(equations, pose).spread, float(_SPREADS[0]))
            pose = self._walked(pose, free, finest, usual, equations.noise)
        equations = self._equations(pose, free, finest)
        told = self._told(equations, pose).spread
        held = self._held_by(n, equations.noise, max(told, float(_SPREADS[0])))
        inverse = inverse_of(equations.normal.hessian + np.diag(held))
        if inverse is None:
            return pose, np.full((n, n), np.inf), told
        # the sways themselves are drawn too: of few pictures their mean is not that of the mounting
        middle = _ALIKE * equations.middle + equations.noise * np.diag(held)
        return pose, inverse[:n] @ middle @ inverse[:, :n] + drive.least(free), told

    def _walked(
        self, pose: Pose, free: Sequence[int], level: int, usual: float = _USUAL, noise: float | None = None
    ) -> Pose:
        drive, finest = self.drive, level == self.drive.levels[0]
        sights = drive.road.sights(pose, drive.area, level, drive.most // (1 if finest else 2))
        spread = drive.road.spread(pose, sights, level)
        if not spread > 0:
            return pose
        held = self._held_by(len(free), spread**2 if noise is None else noise, usual)
        evaluate = partial(self._normal, sights, level, spread, free, held)
        return minimise(
            evaluate, pose, lambda at, step: at.moved(step, free), iterations=8, tolerance=1e-6 if finest else 1e-4
        )[0]

    def _normal(
        self, sights: Sequence[Sight], level: int, spread: float, free: Sequence[int], held: Matrix, pose: Pose
    ) -> Normal:
        """Return the normal equations, and how unlikely large sways are."""
        plain = self.drive.normal(self.drive.road, sights, level, spread, free, pose)
        away = np.concatenate([np.zeros(len(free)), pose.sways.reshape(-1)])
        cost = plain.cost + 0.5 * float((held * away) @ away)
        return Normal(cost, plain.gradient + held * away, plain.hessian + np.diag(held))

    def _held_by(self, free: int, noise: float, usual: float) -> Matrix:
        """Return how strongly each parameter is held to where it is likely."""
        return np.concatenate([np.zeros(free), noise / (usual * self._scale) ** 2])

    def _with_sways(self, pose: Pose) -> Pose:
        return replace(pose, sways=np.zeros((self.drive.count, 2)))

    def _unlocked(self, pose: Pose, free: Sequence[int]) -> Pose:
        """Return the pose on coarse pictures with which no pair is caught beside where it would fit better.

        A nod that moves a picture by more than the width of what is seen on it leads a walk to a wrong place: of five
        drives with nods of 0.15 degrees, four pairs of 45 in all were caught, which put the pitch off by 0.4 degrees.
        """
        level = self.drive.coarsest
        pose = self._walked(pose, free, level)
        for _ in range(_ROUNDS):
            steps = self._steps(pose, level)
            if not any(steps):
                break
            sways = pose.sways.copy()
            for pair, step in zip(self.drive.road.pairs, steps, strict=True):
                # all later pictures go along with the second: between them nothing changes
                sways[[pair.first] if self.drive.of_camera else slice(pair.second, None), 0] += step
            sways[:, 0] -= sways[:, 0].mean()
            pose = self._walked(replace(pose, sways=sways), free, level)
        return pose

    def _steps(self, pose: Pose, level: int) -> list[float]:
        """Return for each pair how much more nod between its two pictures makes it fit best."""
        road = self.drive.road
        sights = road.sights(pose, self.drive.area, level, 1000)
        return in_threads(lambda item: self._step(pose, *item, level), list(zip(road.pairs, sights, strict=True)))

    def _step(self, pose: Pose, pair: Pair, sight: Sight, level: int) -> float:
        drive, sights = self.drive, [sight]
        road = Road(drive.road.eye, drive.road.pyramids, [pair], drive.ground, drive.of_camera)
        spread = 0.5 * road.spread(pose, sights, level)
        if not spread > 0:
            return 0.0
        losses = []
        for nod in _TRIED:
            sways = pose.sways.copy()
            sways[pair.first if drive.of_camera else pair.second, 0] += nod
            losses.append(road.loss(replace(pose, sways=sways), sights, level, spread))
        return float(_TRIED[int(np.argmin(losses))])
