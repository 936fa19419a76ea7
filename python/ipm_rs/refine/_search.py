"""The pose that points agree on: of every three of them, then by least squares of those that agree."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Camera
from ipm_rs.errors import ArgumentError, CalibrationError
from ipm_rs.refine._inputs import numbers_of
from ipm_rs.refine._motion import pose_of, turned
from ipm_rs.refine._projection import Eye
from ipm_rs.refine._solve import Normal, minimise
from ipm_rs.refine._three import poses_of_triples

__all__ = ["Fit", "Search", "apart", "eyes_of_any_focal_length"]

Matrix = NDArray[np.float64]

_SEED = 20_261_130
_TRIPLES = 300  # up to 13 points every triple is tried; of points half of which are wrong, 300 miss once in 10^17
_STARTS = 6
_FOCALS = np.geomspace(0.2, 8.0, 28)
"""Focal lengths that are tried where none is known, in parts of the image's width: angles of view of 136 to 7 degrees,
near enough to each other for the search to go on from the nearest."""


class Pose(NamedTuple):
    """State of the search: vehicle_from_camera, and the factor of the focal length."""

    rotation: Matrix
    position: Matrix
    scale: float = 1.0


class Fit(NamedTuple):
    """A pose at its best, and what it makes of the points."""

    loss: float
    pose: Pose
    camera: Camera
    normal: Normal
    residuals: Matrix
    used: NDArray[np.bool_]


class Search:
    """The poses of some points.

    Parameters
    ----------
    name : str
        What the points are called in messages.
    pixels, points : (N, 2), (N, 3)
        Where the picture shows the points, and where they are, metres.
    tolerance : float
        Pixels; what is farther off is misplaced.
    above : bool
        Whether the points are of a road, which the camera stands above.
    with_focal : bool
        Whether the focal length is sought too.
    """

    def __init__(
        self, name: str, pixels: Matrix, points: Matrix, *, tolerance: float, above: bool, with_focal: bool
    ) -> None:
        self.name, self.pixels, self.points = name, pixels, points
        self.tolerance, self.above, self.with_focal = tolerance, above, with_focal
        self._fewest = 3 if not (above or with_focal) else 4
        self._triples = _triples(points)

    def fits(self, eyes: Sequence[Eye]) -> list[Fit]:
        """Return what fits at least half of the points, the best first.

        Raises
        ------
        ArgumentError
            Nothing does; the message says why, as far as that can be told.
        CalibrationError
            The lens sees too few of the pixels.
        """
        starts = sorted((start for eye in eyes for start in self._starts(eye)), key=lambda start: start[0])
        every = [self._refined(eye, pose) for _, eye, pose in starts[: _STARTS * (2 if self.with_focal else 1)]]
        found = sorted((fit for fit in every if fit is not None), key=lambda fit: fit.loss)
        needed = max(-(-len(self.points) // 2), min(self._fewest, len(self.points)))
        agreeing = [fit for fit in found if fit.used.sum() >= needed]
        if agreeing:
            return agreeing
        self._check_lens(eyes[0])
        if self.above:
            turned_over = Search(
                self.name,
                self.pixels,
                self.points * (1.0, -1.0, 1.0),
                tolerance=self.tolerance,
                above=True,
                with_focal=self.with_focal,
            )
            losses = [loss for eye in eyes for loss, _, _ in turned_over._starts(eye)]
            if losses and min(losses) < 0.5 * len(self.points) * self.tolerance**2:
                raise ArgumentError(
                    f"{self.name}: expected points seen from above, x ahead and y to the left, got their mirror image; "
                    "y counts to the left: pass -y"
                )
        count = max((int(fit.used.sum()) for fit in found), default=0)
        many = {3: "three", 4: "four"}[self._fewest]
        raise ArgumentError(
            f"{self.name}: expected pixels at which a camera sees the points, but no {many} agree with the rest: the "
            f"best pose has {count} of {len(self.points)} within {self.tolerance:g} px; check the order of the points, "
            "K, the lens and the units, or pass a larger tolerance="
        )

    def _check_lens(self, eye: Eye) -> None:
        seen = int(np.isfinite(eye.rays(self.pixels)).all(1).sum())
        if seen < self._fewest:
            raise CalibrationError(
                f"pixels: expected at least {self._fewest} that the lens sees, got {seen} of {len(self.pixels)}; "
                "check K and the lens"
            )

    def _starts(self, eye: Eye) -> list[tuple[float, Eye, Pose]]:
        """Return the best poses of triples and their losses, no two of them nearly the same."""
        rays = eye.rays(self.pixels)
        triples = self._triples[np.isfinite(rays[self._triples]).all((1, 2))]
        if not len(triples):
            return []
        rotations, translations = poses_of_triples(rays[triples], self.points[triples])
        positions = -np.einsum("lji,lj->li", rotations, translations)
        if self.above:
            keep = positions[:, 2] > self.points[:, 2].mean()
            rotations, translations, positions = rotations[keep], translations[keep], positions[keep]
        if not len(rotations):
            return []
        seen = np.einsum("lij,nj->lni", rotations, self.points) + translations[:, None]
        losses = self._losses(eye.pixels(seen.reshape(-1, 3)).reshape(len(seen), -1, 2) - self.pixels)
        found: list[tuple[float, Eye, Pose]] = []
        for index in np.argsort(losses)[: 20 * _STARTS]:
            pose = Pose(rotations[index].T, positions[index])
            if len(found) < _STARTS and all(differ(pose, other) for _, _, other in found):
                found.append((float(losses[index]), eye, pose))
        return found

    def _losses(self, off: Matrix) -> Matrix:
        """Sum squared distances in pixels, none above that of a misplaced point."""
        return np.minimum(_square(off), self.tolerance**2).sum(-1)

    def _refined(self, eye: Eye, pose: Pose) -> Fit | None:
        """Refine a pose on the points that agree with it, until these no longer change."""
        # the pose of three points has their errors, and with another focal length none fits: begin with the better half
        square = _square(self._off(eye, pose))
        half = float(np.partition(square, len(square) // 2)[len(square) // 2])
        used = square <= max((2.0 * self.tolerance) ** 2, half if self.with_focal else 0.0)
        for _ in range(10):
            if used.sum() < self._fewest:
                return None
            pose, normal = minimise(partial(self._normal, eye, used), pose, _moved, iterations=100)
            again = _square(self._off(eye, pose)) <= self.tolerance**2
            if len(self.points) == self._fewest:  # none can be spared
                again |= _square(self._off(eye, pose)) <= (4.0 * self.tolerance) ** 2
            if (again == used).all():
                break
            used = again
        if self.above and not pose.position[2] > self.points[:, 2].mean():
            return None
        off = self._off(eye, pose)
        camera = _scaled(eye.camera, pose.scale).with_pose(pose_of(pose.rotation, pose.position))
        return Fit(float(self._losses(off)), pose, camera, normal, off, used)

    def _off(self, eye: Eye, pose: Pose) -> Matrix:
        seen = (self.points - pose.position) @ pose.rotation
        return _zoomed(eye, pose.scale).pixels(seen) - self.pixels

    def _normal(self, eye: Eye, used: NDArray[np.bool_], pose: Pose) -> Normal:
        """Return the normal equations of the distances in pixels by (turn, place[, logarithm of the focal length])."""
        away = self.points[used] - pose.position
        pixels, slopes = _zoomed(eye, pose.scale).slopes(away @ pose.rotation)
        residuals = (pixels - self.pixels[used]).reshape(-1)
        size = 6 + self.with_focal
        if not (np.isfinite(slopes).all() and np.isfinite(residuals).all()):
            return Normal(math.inf, np.zeros(size), np.eye(size))
        by_point = slopes @ pose.rotation.T  # by the point's place in the vehicle frame
        # a turn w of the camera moves what it sees by -w x a, and -b . (w x a) = (b x a) . w
        by_turn = np.stack([np.cross(by_point[:, row], away) for row in (0, 1)], 1)
        columns = [by_turn, -by_point]
        if self.with_focal:
            columns.append((pixels - eye.camera.intrinsics[:2, 2])[:, :, None])
        return Normal.of(residuals, np.concatenate(columns, -1).reshape(len(residuals), size))


def eyes_of_any_focal_length(image_size: Sequence[int], lens: Any, principal_point: Any) -> list[Eye]:
    """Return cameras with square pixels of the focal lengths that are tried where none is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a guess is not to be warned of
        width, height = Camera(np.diag([100.0, 100.0, 1.0]), image_size=image_size).image_size
        centre = np.array([(width - 1) / 2, (height - 1) / 2])
        if principal_point is not None:
            centre = numbers_of("principal_point", principal_point, (2,), "(cx, cy) in pixels")
        guesses = [np.array([[f, 0.0, centre[0]], [0.0, f, centre[1]], [0.0, 0.0, 1.0]]) for f in width * _FOCALS]
        return [Eye(Camera(K, image_size=image_size, lens=lens)) for K in guesses]


def differ(pose: Pose, other: Pose) -> bool:
    """Whether two poses are more than a degree or 2 % of the height apart."""
    cosine = (float(np.trace(pose.rotation.T @ other.rotation)) - 1.0) / 2.0
    away = float(np.linalg.norm(pose.position - other.position))
    return math.acos(min(max(cosine, -1.0), 1.0)) > 0.017 or away > 0.02 * max(abs(pose.position[2]), 0.1)


def apart(fits: Sequence[Fit]) -> list[Fit]:
    """Return the fits without those that repeat an earlier one."""
    kept: list[Fit] = []
    for fit in fits:
        if all(differ(fit.pose, other.pose) for other in kept):
            kept.append(fit)
    return kept


def _square(off: Matrix) -> Matrix:
    return np.nan_to_num((off**2).sum(-1), nan=np.inf)


def _moved(pose: Pose, step: Matrix) -> Pose:
    scale = pose.scale * math.exp(min(max(step[6], -0.5), 0.5)) if len(step) > 6 else pose.scale
    return Pose(turned(pose.rotation, step[:3]), pose.position + step[3:6], scale)


def _zoomed(eye: Eye, scale: float) -> Eye:
    return eye if scale == 1.0 else Eye(_scaled(eye.camera, scale))


def _scaled(camera: Camera, scale: float) -> Camera:
    if scale == 1.0:
        return camera
    K = camera.intrinsics
    K[:2, :2] *= scale
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a step of a search is not to be warned of
        return Camera(K, image_size=camera.image_size, lens=camera.lens)


def _triples(points: Matrix) -> NDArray[np.intp]:
    """(M, 3) indices of triples that make no flat triangle: all, or some drawn with a fixed seed."""
    count = len(points)
    if math.comb(count, 3) <= _TRIPLES:
        triples = np.array(list(itertools.combinations(range(count), 3)))
    else:
        random = np.random.default_rng(_SEED)
        triples = np.stack([random.choice(count, 3, replace=False) for _ in range(_TRIPLES)])
    corners = points[triples]
    sides = corners[:, [1, 2]] - corners[:, [0]]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1)
    sharp = area > 1e-3 * (sides**2).sum(-1).max(-1)
    return triples[sharp] if sharp.any() else triples[area > 0]
