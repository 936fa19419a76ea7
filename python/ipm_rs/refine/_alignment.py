"""Pictures of a drive made to agree about the road: a search on coarse ones, then least squares down to fine ones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, Lut, Plane
from ipm_rs.errors import ArgumentError, CalibrationError, ImageError
from ipm_rs.refine._loss import correlation, in_threads
from ipm_rs.refine._pictures import Pyramid
from ipm_rs.refine._projection import Eye
from ipm_rs.refine._road import PARAMETERS, Pair, Pose, Road, Sight, pose_of_camera
from ipm_rs.refine._solve import Normal, inverse_of, minimise, patched, scatter_of

__all__ = ["Alignment", "Solved"]

Matrix = NDArray[np.float64]

_POINTS = 120_000
"""Places that are compared at once at most, of all pairs together; 12 000 of one pair."""
_SEARCHED = 320
"""Pixels of the coarsest picture's width: there half a degree of pitch moves the road by a pixel."""
_TRIED_PITCH = np.radians(np.arange(-3.0, 3.01, 0.5))
_TRIED_HEIGHT = np.arange(0.8, 1.21, 0.05)
_TRIED_ROLL = np.radians(np.arange(-2.0, 2.01, 1.0))
_PATCH = 1.0
"""Side of the patches of road that are taken to be off each for itself, in heights of the camera."""
_SAMPLED = 0.03
"""Pixels. Bilinear sampling of grain that no pixel resolves puts all pictures off alike, by so much on average: chosen
on seeds 0 to 5 of `scripts/try_refine.py drive`, judged on others (see the docs)."""
_FARTHEST_TURN, _FARTHEST_HEIGHT = math.cos(math.radians(8.0)), 1.6
"""How far from the camera as it was given poses are looked at: the cosine of a turn, and a factor of the height."""
_LEAST_CORRELATION = 0.2
"""Of the places that are compared, below which the pictures show no road alike: unrelated ones reach 0.1."""
_STARTS = 3
_FEW_PAIRS = 12
_LIMITS = {"roll": math.radians(0.5), "pitch": math.radians(0.5), "yaw": math.radians(0.5), "height": 0.05}
"""Standard deviations beyond which the pictures do not tell a parameter; that of the height in heights."""


def _moved(free: Sequence[int], pose: Pose, step: Matrix) -> Pose:
    return pose.moved(step, free)


def _far(pose: Pose, other: Pose, height: float) -> bool:
    """Whether two poses are farther apart than coarse pictures lead from the one to the other."""
    cosine = 0.5 * (float(np.trace(pose.rotation.T @ other.rotation)) - 1.0)
    return cosine < math.cos(math.radians(0.8)) or abs(pose.position[2] - other.position[2]) > 0.08 * height


class Solved(NamedTuple):
    """A pose, which of `PARAMETERS` were found, their covariance, and what was left as it was and why."""

    pose: Pose
    free: tuple[int, ...]
    covariance: Matrix
    kept: dict[str, str]


class Alignment:
    """The pictures of a drive, and the poses of the camera with which they agree.

    Parameters
    ----------
    camera : Camera
        The camera as it was given.
    greys : mapping of int to (H, W) float32
        The pictures that are compared, by their numbers.
    poses : (N, 4, 4)
        Where each picture was taken.
    chosen : sequence of (int, int)
        Which are compared.
    ground, area : Plane, BevGrid
        The road, and the part of it that is looked at.
    of_camera : bool
        Whether the poses are the camera's own.
    height : float
        Of the camera above the road, metres.
    """

    def __init__(
        self,
        camera: Camera,
        greys: Mapping[int, NDArray[np.float32]],
        poses: Matrix,
        chosen: Sequence[tuple[int, int]],
        ground: Plane,
        area: BevGrid,
        of_camera: bool,
        height: float,
    ) -> None:
        self.camera, self.greys, self.ground, self.area, self.height = camera, greys, ground, area, height
        self.count, self.of_camera = len(poses), of_camera
        self.start = self.coarse = pose_of_camera(camera)
        self.pairs = [Pair(i, j, np.linalg.inv(poses[j]) @ poses[i], poses[i]) for i, j in chosen]
        indices = sorted(greys)
        pyramids = dict(zip(indices, in_threads(lambda index: Pyramid(greys[index]), indices), strict=True))
        some = next(iter(pyramids.values()))
        listed = [pyramids.get(index, some) for index in range(self.count)]
        self.road = Road(Eye(camera), listed, self.pairs, ground, of_camera)
        # what finds the neighbourhood only: a dozen pairs, spread over the drive, tell it
        few = self.pairs[:: -(-len(self.pairs) // _FEW_PAIRS)]
        self.few = Road(self.road.eye, listed, few, ground, of_camera)
        self.levels = some.levels
        narrow = (level for level in self.levels if some.picture(level).shape[1] <= _SEARCHED)
        self.coarsest = next(narrow, self.levels[-1])

    def solved(self) -> Solved:
        """Return the pose of the camera, without what the pictures do not tell.

        Raises
        ------
        CalibrationError
            The pictures do not agree whatever the pose, or do not tell the pitch.
        ArgumentError, ImageError
            No road is seen, or it has no contrast.
        """
        kept = {"yaw": "poses of the camera itself do not tell it"} if self.of_camera else {}
        while True:
            free = [index for index, name in enumerate(PARAMETERS) if name not in kept]
            pose = self._best(self.start, free)
            covariance = self._covariance(pose, free)
            untold = self.untold(free, covariance)
            kept |= untold
            if "pitch" in kept:
                raise CalibrationError(
                    f"images: expected pictures that tell the camera's pitch, but {kept['pitch']}; drive where the "
                    "road has markings or grain, straight on and with nobody ahead, or pass a grid= of such road"
                )
            if covariance is not None and not untold:
                return Solved(pose, tuple(free), covariance, kept)

    # ------------------------------------------------------------------------------------------------------------------

    def _best(self, start: Pose, free: Sequence[int]) -> Pose:
        """Return the pose that is found from the best of a grid of poses, or from the given one if that fits better."""
        coarse = [self._at_level(pose, free, self.coarsest, self.few) for pose in self._searched(start, free)]
        starts = [self._fittest(coarse)]
        found = [self._refined(starts[0], free)]
        finest = self.levels[0]
        sights = self.road.sights(found[0], self.area, finest, 2_000)
        if self.road.correlation(found[0], sights, finest) < self.road.correlation(start, sights, finest):
            starts.append(start)
            found.append(self._refined(start, free))
        scores = [self.road.correlation(pose, sights, finest) for pose in found]
        if max(scores) < _LEAST_CORRELATION:
            raise CalibrationError(
                "images: expected pictures that agree about the road with some pose of the camera, but their "
                f"correlation is {max(scores):.2f} at best; check the order of pictures and poses, metres, poses_of= "
                "and ground="
            )
        best = int(np.argmax(scores))
        self.coarse = starts[best]
        return found[best]

    def _fittest(self, poses: Sequence[Pose]) -> Pose:
        """Return the one of some poses with which the most places agree on coarse pictures."""
        sights = self.few.sights(poses[0], self.area, self.coarsest, 2_000)
        spread = min(self.few.spread(pose, sights, self.coarsest) for pose in poses)
        if not spread > 0:
            return poses[0]
        return min(poses, key=lambda pose: self.few.loss(pose, sights, self.coarsest, spread))

    def _searched(self, start: Pose, free: Sequence[int]) -> list[Pose]:
        """Return the best of a grid of poses on coarse pictures, and others that are far from it."""
        level, some = self.coarsest, self.few.pairs[:: -(-len(self.few.pairs) // 4)]
        road = Road(self.road.eye, self.road.pyramids, some, self.ground, self.of_camera)
        sights = road.sights(start, self.area, level, 600)
        self._check_contrast(sights)

        # of pictures that do not fit yet: half of it tells a place that fits from one that does not
        spread = 0.5 * road.spread(start, sights, level)

        def best(of: Sequence[Pose]) -> list[Pose]:
            losses = in_threads(lambda pose: road.loss(pose, sights, level, spread), of)
            return [of[index] for index in np.argsort(losses)]

        def apart(poses: Sequence[Pose]) -> list[Pose]:
            kept: list[Pose] = []
            for pose in poses:
                if len(kept) < _STARTS and all(_far(pose, other, self.height) for other in kept):
                    kept.append(pose)
            return kept

        def tried(pose: Pose, values: dict[int, Any]) -> list[Pose]:
            axes = [values[index] if index in values else np.zeros(1) for index in free]
            steps = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(free))
            return [pose, *(pose.moved(step, free) for step in steps)]

        heights = (_TRIED_HEIGHT - 1.0) * self.height
        found = []
        for pose in apart(best(tried(start, {1: _TRIED_PITCH, 3: heights}))):
            turned = best(tried(pose, {0: _TRIED_ROLL, 2: _TRIED_ROLL}))[0]
            found.append(best(tried(turned, {1: _TRIED_PITCH[::2] / 3.0, 3: heights[::2] / 2.0}))[0])
        return found

    def _check_contrast(self, sights: Sequence[Sight]) -> None:
        values = np.concatenate([sight.values for sight in sights]) if sights else np.zeros(0)
        if not len(values):
            raise ArgumentError(
                "grid: expected road that the camera sees, got none of it; pass a grid= ahead of the camera, in its "
                "vehicle frame"
            )
        if not float(values.std()) > 1e-3 * max(float(np.abs(values).max()), 1e-12):
            raise ImageError(
                "images: expected pictures whose road has contrast, got the same brightness everywhere; check that "
                "they are decoded, and that grid= is road that they show"
            )

    def _refined(self, pose: Pose, free: Sequence[int]) -> Pose:
        """Walk from coarse pictures to fine ones."""
        for level in range(self.coarsest, self.levels[0] - 1, -1):
            pose = self._at_level(pose, free, level, self.few if level == self.coarsest else self.road)
        return pose

    def _at_level(self, pose: Pose, free: Sequence[int], level: int, road: Road) -> Pose:
        most = self.most // (1 if level == self.levels[0] else 2)
        for _ in range(2):  # the second time with the spread, and the road, of a better pose
            sights = road.sights(pose, self.area, level, most)
            spread = road.spread(pose, sights, level)
            if not spread > 0:
                return pose
            evaluate = partial(self.normal, road, sights, level, spread, free)
            # coarse pictures are a way to the finest; only there the last digits count
            tolerance = 1e-6 if level == self.levels[0] else 1e-4
            pose, _ = minimise(evaluate, pose, partial(_moved, free), iterations=8, tolerance=tolerance)
        return pose

    def normal(
        self, road: Road, sights: Sequence[Sight], level: int, spread: float, free: Sequence[int], pose: Pose
    ) -> Normal:
        turn = 0.5 * (float(np.trace(pose.rotation.T @ self.start.rotation)) - 1.0)
        height = 1.0 + (pose.position[2] - self.start.position[2]) / self.height
        if turn < _FARTHEST_TURN or not 1.0 / _FARTHEST_HEIGHT < height < _FARTHEST_HEIGHT:
            size = len(free) + pose.sways.size
            return Normal(math.inf, np.zeros(size), np.eye(size))
        return road.normal_of(pose, sights, level, spread, free)

    def _covariance(self, pose: Pose, free: Sequence[int]) -> Matrix | None:
        """Return the covariance from how much the pictures disagree about the pose; None where it is open.

        Patches of the road count once, in however many pictures they are: what puts one of their pixels off, such as
        grain that no pixel resolves, puts the others off alike. And pairs of pictures count once: a vehicle nods.
        """
        level = self.levels[0]
        sights = self.road.sights(pose, self.area, level, self.most)
        spread = self.road.spread(pose, sights, level)
        inverse = inverse_of(self.road.normal_of(pose, sights, level, spread, free).hessian)
        if inverse is None:
            return None
        parts = self.road.pulls(pose, sights, level, spread, free)
        places, pulls = (np.concatenate(each) for each in zip(*parts, strict=True))
        by_patch = scatter_of(patched(places, pulls, size=self.patch))
        by_pair = scatter_of(np.stack([pulls.sum(0) for _, pulls in parts]))
        middle = by_patch + by_pair
        return np.asarray(inverse @ middle @ inverse + self.least(free), dtype=np.float64)

    def least(self, free: Sequence[int]) -> Matrix:
        """Return the covariance that pictures leave however many they are."""
        angle = _SAMPLED / float(self.camera.intrinsics[0, 0])
        least = [self.height * 10.0 * angle if PARAMETERS[index] == "height" else angle for index in free]
        return np.diag(np.square(least))

    @property
    def patch(self) -> float:
        """Side of the patches of road that are taken to be off each for itself, metres."""
        return _PATCH * self.height

    def untold(self, free: Sequence[int], covariance: Matrix | None) -> dict[str, str]:
        """Return what is not known well enough and why, the worst of it only: without it the rest may be."""
        if covariance is None:
            return {PARAMETERS[free[-1]]: "the pictures leave it open"}
        off = np.sqrt(np.diag(covariance))
        limits = np.array([_LIMITS[PARAMETERS[index]] * (self.height if index == 3 else 1.0) for index in free])
        worst = int(np.argmax(off / limits))
        if off[worst] <= limits[worst]:
            return {}
        name = PARAMETERS[free[worst]]
        said = f"{off[worst]:.2f} m" if name == "height" else f"{math.degrees(off[worst]):.2f} deg"
        return {name: f"the pictures leave it within +- {said}"}

    def without(self, pose: Pose, free: Sequence[int], untold: Mapping[str, str]) -> tuple[Pose, list[int]]:
        """Return a pose with what is not told as it was given, and what is still free."""
        back = [index for index in free if PARAMETERS[index] in untold]
        given, found = (np.array([*each.angles, each.position[2]]) for each in (self.start, pose))
        return pose.moved((given - found)[back], back), [index for index in free if index not in back]

    @property
    def most(self) -> int:
        """How many places of a pair are compared at most."""
        return max(200, min(12_000, _POINTS // len(self.pairs)))

    def agreement(self, pose: Pose) -> float:
        """Return the mean correlation of the bird's-eye views of each pair."""

        def score(pair: Pair) -> float:
            views, masks = [], []
            for index, motion in ((pair.first, np.eye(4)), (pair.second, pair.motion)):
                at = pose.at(pair.first if self.of_camera else index)  # the camera's motion carries its road along
                seen = motion @ at.camera_from_vehicle if self.of_camera else at.camera_from_vehicle @ motion
                lut = Lut(self.camera.with_pose(seen), self.area, ground=self.ground)
                views.append(lut.warp(self.greys[index], interpolation="area", threads=1))
                masks.append(lut.mask)
            both = masks[0] & masks[1]
            if both.sum() < 10:
                return math.nan
            values = [view[both].astype(np.float64) for view in views]
            return correlation(values[0], values[1])

        scores = np.array(in_threads(score, self.pairs))
        return float(np.nanmean(scores)) if np.isfinite(scores).any() else math.nan
