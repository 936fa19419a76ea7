"""How two pictures of a drive show the same road: differences of brightness, and their derivatives by the pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, Plane, _refine_shown, rotation_from_euler
from ipm_rs.calibration._rotations import OPTICAL_FROM_FLU
from ipm_rs.refine._loss import correlation, exposed, in_threads, loss_of, most_of, normal_of, weights_of
from ipm_rs.refine._motion import angles_of, pose_of
from ipm_rs.refine._pictures import Pyramid
from ipm_rs.refine._projection import Eye
from ipm_rs.refine._solve import Normal

__all__ = [
    "OF_EACH",
    "PARAMETERS",
    "SWAYING",
    "Pair",
    "Pose",
    "Road",
    "Sight",
    "pose_of_camera",
]

Matrix = NDArray[np.float64]

PARAMETERS = ("roll", "pitch", "yaw", "height")

SWAYING = (PARAMETERS.index("pitch"), PARAMETERS.index("height"))
"""In which of them a vehicle sways."""

OF_EACH = (4, 5, 6, 7)
"""Columns of the derivatives by the sways of the first picture and of the second, behind those by `PARAMETERS`."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Where the camera is: vehicle_from_camera, and how the vehicle sways, of which its poses know nothing."""

    rotation: Matrix
    position: Matrix
    sways: Matrix
    """(N, 2) by how much each picture's pitch, radians, and height, metres, differ; (0, 2) where none does."""

    def moved(self, step: Matrix, free: Sequence[int]) -> Pose:
        """Return the pose after a step in those of `PARAMETERS` that are free, then in the sways."""
        whole = np.zeros(4)
        whole[list(free)] = step[: len(free)]
        roll, pitch, yaw = self.angles + whole[:3]
        rotation = rotation_from_euler(roll, pitch, yaw) @ OPTICAL_FROM_FLU.T
        position = self.position + whole[3] * np.array([0.0, 0.0, 1.0])
        sways = self.sways + step[len(free) :].reshape(-1, 2) if len(step) > len(free) else self.sways
        return Pose(rotation, position, sways)

    @cached_property
    def angles(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw, radians."""
        return angles_of(self.rotation)

    def at(self, picture: int) -> Pose:
        """Return the pose as it was at a picture, with its own pitch and height."""
        if not len(self.sways):
            return self
        return self.still.moved(self.sways[picture], SWAYING)

    @property
    def still(self) -> Pose:
        """The pose of a vehicle that does not sway."""
        return replace(self, sways=np.zeros((0, 2)))

    def mounting(self, picture: int) -> list[float]:
        """Return roll, pitch, yaw and the position as they were at a picture."""
        mounting = [*self.angles, *self.position]
        if len(self.sways):
            mounting[1] += self.sways[picture, 0]
            mounting[5] += self.sways[picture, 1]
        return mounting

    @property
    def camera_from_vehicle(self) -> Matrix:
        """(4, 4), of a vehicle that does not sway."""
        return pose_of(self.rotation, self.position)


def pose_of_camera(camera: Camera) -> Pose:
    """Return the pose of a camera on a vehicle that does not sway."""
    pose = camera.vehicle_from_camera
    return Pose(pose[:3, :3], pose[:3, 3], np.zeros((0, 2)))


class Pair(NamedTuple):
    """Two pictures, and how the vehicle (or the camera) moved from the one to the other: second_from_first."""

    first: int
    second: int
    motion: Matrix
    place: Matrix
    """Where the first was taken: ``map_from_vehicle`` or ``map_from_camera``."""


class _Looked(NamedTuple):
    """The later picture of a pair, as it is looked at for what the earlier one shows of the road."""

    camera: Camera
    picture: NDArray[np.float32]
    level: int
    mask: NDArray[np.bool_] | None
    """Of the whole picture."""
    motion: Matrix
    of_camera: bool
    ground: Plane


class Sight(NamedTuple):
    """Pixels of a pair's first picture that show the road: their rays and their brightness."""

    rays: Matrix
    values: Matrix


class Road:
    """A drive's pictures, pairs of them, and the road between.

    Parameters
    ----------
    eye : Eye
        The camera without its pose.
    pyramids : sequence of Pyramid
        The pictures.
    pairs : sequence of Pair
        Which are compared.
    ground : Plane
        The road in the vehicle frame.
    of_camera : bool
        Whether the motions are the camera's own: then only the road's plane under the camera is sought.
    """

    def __init__(
        self, eye: Eye, pyramids: Sequence[Pyramid], pairs: Sequence[Pair], ground: Plane, of_camera: bool
    ) -> None:
        self.eye, self.pyramids, self.pairs, self.of_camera = eye, pyramids, pairs, of_camera
        self._masks: dict[int, NDArray[np.bool_] | None] = {}
        self.ground = ground
        self.normal = ground.normal
        self.offset = float(self.normal @ (0.0, 0.0, ground.coefficients[0]))

    # ------------------------------------------------------------------------------------------------------------------
    # Which pixels

    def sights(self, pose: Pose, grid: BevGrid, level: int, most: int) -> list[Sight]:
        """Return for each pair the pixels that show the road of a grid, at most so many, where brightness changes."""
        pixels, rays = self._pixels(pose, grid, level, 2 * most)
        return in_threads(lambda pair: self._sight(pose, pair, pixels, rays, level, most), self.pairs)

    def _pixels(self, pose: Pose, grid: BevGrid, level: int, most: int) -> tuple[Matrix, Matrix]:
        rows, columns = self.pyramids[0].picture(level).shape
        u, v = np.meshgrid(np.arange(1, columns - 1), np.arange(1, rows - 1))
        pixels = (np.stack([u, v], -1).reshape(-1, 2) + 0.5) * 2.0**level - 0.5
        camera = self.eye.camera.with_pose(pose.camera_from_vehicle)
        road = Plane(normal=self.normal.tolist(), point=(0.0, 0.0, self.offset / self.normal[2]))
        seen = camera.ground_from_pixels(pixels, ground=road)
        (x0, x1), (y0, y1) = grid.x, grid.y
        keep = (seen[:, 0] > x0) & (seen[:, 0] < x1) & (seen[:, 1] > y0) & (seen[:, 1] < y1)
        pixels = self._shown(pixels[keep], level)
        pixels = pixels[np.isfinite(pixels[:, 0])]
        # every so many-th, by a step that is in tune with no row length
        step = max(1, -(-len(pixels) // most))
        pixels = pixels[step // 2 :: step]
        return pixels, self.eye.rays(pixels)

    def _shown(self, pixels: Matrix, level: int) -> Matrix:
        """Return pixels, NaN where the camera's mask hides what a level shows there."""
        mask = self._mask(level)
        if mask is None:
            return pixels
        rows, columns = mask.shape
        at = np.clip(np.rint(pixels), 0, (columns - 1, rows - 1)).astype(np.intp)
        return np.where(mask[at[:, 1], at[:, 0]][:, None], pixels, np.nan)

    def _mask(self, level: int) -> NDArray[np.bool_] | None:
        """Return which pixels of the whole picture show nothing hidden, as far as a level's pixels reach."""
        if level not in self._masks:
            mask = self.eye.camera.mask
            self._masks[level] = None if mask is None else _eroded(mask, 2**level)
        return self._masks[level]

    def _sight(self, pose: Pose, pair: Pair, pixels: Matrix, rays: Matrix, level: int, most: int) -> Sight:
        twice = np.isfinite(self.residuals(pose, pair, Sight(rays, rays[:, 0]), level, slopes=False)[0])
        pixels, rays = pixels[twice], rays[twice]
        values, slopes = self.pyramids[pair.first].sample_with_slopes(level, pixels)
        if len(pixels) > most:
            # Of every two neighbours the steeper: of all places the steepest would mostly be those of moving things.
            steep = np.nan_to_num(np.hypot(slopes[:, 0], slopes[:, 1]))
            even = np.arange(0, len(pixels) - 1, 2)
            keep = even + (steep[even + 1] > steep[even])
            rays, values = rays[keep], values[keep]
        return Sight(rays, values)

    # ------------------------------------------------------------------------------------------------------------------
    # Residuals

    def residuals(self, pose: Pose, pair: Pair, sight: Sight, level: int, slopes: bool) -> tuple[Matrix, Matrix | None]:
        """Return the brightness of the second picture where it shows a sight, and its derivatives.

        Returns
        -------
        values : (N,)
            NaN where the second picture does not show the place.
        derivatives : (N, 8) or None
            By roll, pitch, yaw, height, and by pitch and height of the first and of the second picture.
        """
        picture = self.pyramids[pair.second].picture(level)
        looked = _Looked(self.eye.camera, picture, level, self._mask(level), pair.motion, self.of_camera, self.ground)
        return _refine_shown(looked, sight.rays, pose.mounting(pair.first), pose.mounting(pair.second), slopes)

    def correlation(self, pose: Pose, sights: Sequence[Sight], level: int) -> float:
        """Return the mean correlation of the pairs, -1 where a pair shows less than half of its places twice."""
        scores = []
        for pair, sight in zip(self.pairs, sights, strict=True):
            values = self.residuals(pose, pair, sight, level, slopes=False)[0]
            both = np.isfinite(values)
            scores.append(correlation(values[both], sight.values[both]) if both.sum() * 2 > len(both) else -1.0)
        return float(np.mean(scores))

    def loss(self, pose: Pose, sights: Sequence[Sight], level: int, spread: float) -> float:
        """Return Tukey's loss a place, from 0 to 1, which is that of a place that is shown otherwise or not at all."""
        total = 0.0
        for pair, sight in zip(self.pairs, sights, strict=True):
            values = self.residuals(pose, pair, sight, level, slopes=False)[0]
            both = np.isfinite(values)
            if both.sum() * 2 <= len(both):
                total += 1.0
                continue
            off = exposed(values, sight.values, spread)[0]
            total += loss_of(off, spread) / len(off)
        return total / len(self.pairs)

    # ------------------------------------------------------------------------------------------------------------------
    # Normal equations

    def spread(self, pose: Pose, sights: Sequence[Sight], level: int) -> float:
        """Return the standard deviation of the residuals, of the better half: 1.4826 of their median."""
        off = in_threads(lambda item: self._off(pose, item, level), zip(self.pairs, sights, strict=True))
        together = np.concatenate(off)
        return 1.4826 * float(np.median(np.abs(together))) if len(together) else math.nan

    def _off(self, pose: Pose, item: tuple[Pair, Sight], level: int) -> Matrix:
        pair, sight = item
        return exposed(self.residuals(pose, pair, sight, level, slopes=False)[0], sight.values)[0]

    def normal_of(self, pose: Pose, sights: Sequence[Sight], level: int, spread: float, free: Sequence[int]) -> Normal:
        """Return the normal equations of Tukey's loss."""
        items = list(zip(self.pairs, sights, strict=True))
        parts = in_threads(lambda item: self._part(pose, item, level, spread, free), items)
        size = len(free) + pose.sways.size
        cost, gradient, hessian = 0.0, np.zeros(size), np.zeros((size, size))
        for pair, part in zip(self.pairs, parts, strict=True):
            cost += part.cost
            where = self.columns(pair, len(free)) if len(pose.sways) else list(range(len(free)))
            gradient[where] += part.gradient
            hessian[np.ix_(where, where)] += part.hessian
        return Normal(cost, gradient, hessian)

    @staticmethod
    def columns(pair: Pair, free: int) -> list[int]:
        """Return which parameters a pair tells of: those that are free, and pitch and height of its two pictures."""
        return [*range(free), *(free + 2 * picture + k for picture in (pair.first, pair.second) for k in (0, 1))]

    def pulls(
        self, pose: Pose, sights: Sequence[Sight], level: int, spread: float, free: Sequence[int]
    ) -> list[tuple[Matrix, Matrix]]:
        """Return of each pair where on the map its residuals are, (N, 3), and how they pull at the free parameters."""

        def of(item: tuple[Pair, Sight]) -> tuple[Matrix, Matrix]:
            pair, sight = item
            found = self._weighted(pose, item, level, spread, list(free))
            if found is None:
                return np.zeros((0, 3)), np.zeros((0, len(free)))
            off, J, both = found
            first = pose.at(pair.first)
            rays = sight.rays[both]
            d = rays @ first.rotation.T
            s = (self.offset - float(self.normal @ first.position)) / np.einsum("nj,j->n", d, self.normal)
            road = s[:, None] * rays if self.of_camera else first.position + s[:, None] * d
            return road @ pair.place[:3, :3].T + pair.place[:3, 3], (weights_of(off, spread) * off)[:, None] * J

        return in_threads(of, list(zip(self.pairs, sights, strict=True)))

    def _part(self, pose: Pose, item: tuple[Pair, Sight], level: int, spread: float, free: Sequence[int]) -> Normal:
        """Return the normal equations of a pair by the free parameters, and by its pictures' sways if there are any."""
        columns = [*free, *OF_EACH] if len(pose.sways) else list(free)
        found = self._weighted(pose, item, level, spread, columns)
        places = len(item[1].values)
        if found is None:
            return Normal(places * most_of(spread), np.zeros(len(columns)), np.zeros((len(columns), len(columns))))
        off, J, _ = found
        # what leaves the picture counts as the rest does: else poses would be drawn to where less, or more, is seen
        all_over_seen, seen = places / len(off), normal_of(off, J, spread)
        return Normal(all_over_seen * seen.cost, all_over_seen * seen.gradient, all_over_seen * seen.hessian)

    def _weighted(
        self, pose: Pose, item: tuple[Pair, Sight], level: int, spread: float, columns: Sequence[int]
    ) -> tuple[Matrix, Matrix, NDArray[np.bool_]] | None:
        """Return how brightness differs, the derivatives by columns, and of which places; None of fewer than ten."""
        pair, sight = item
        values, derivatives = self.residuals(pose, pair, sight, level, slopes=True)
        assert derivatives is not None
        off, J, both = exposed(values, sight.values, spread, derivatives[:, columns])
        return None if len(off) < 10 else (off, J, both)


def _eroded(mask: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Return where a mask is True as far as `reach` around, along rows and columns."""
    for axis in (0, 1):
        for _ in range(reach):
            kept = mask.copy()
            inner = [slice(None), slice(None)]
            before, after = list(inner), list(inner)
            inner[axis], before[axis], after[axis] = slice(1, -1), slice(None, -2), slice(2, None)
            kept[tuple(inner)] &= mask[tuple(before)] & mask[tuple(after)]
            mask = kept
    return mask
