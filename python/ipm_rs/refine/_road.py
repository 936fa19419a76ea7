"""How two pictures of a drive show the same road: differences of brightness, and their derivatives by the pose."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, Plane, get_num_threads, rotation_from_euler
from ipm_rs.calibration._rotations import OPTICAL_FROM_FLU
from ipm_rs.refine._motion import angles_of, axes_of_angles, pose_of
from ipm_rs.refine._pictures import Pyramid
from ipm_rs.refine._projection import Eye
from ipm_rs.refine._solve import Normal

__all__ = [
    "CUT",
    "PARAMETERS",
    "Pair",
    "Pose",
    "Road",
    "Sight",
    "correlation",
    "exposed",
    "in_threads",
    "pose_of_camera",
    "weights_of",
]

Matrix = NDArray[np.float64]
T = TypeVar("T")
U = TypeVar("U")

PARAMETERS = ("roll", "pitch", "yaw", "height")

CUT = 4.685
"""Tukey's constant: what is off by more standard deviations counts for nothing, and 95 % of the information stays."""


class Pose(NamedTuple):
    """Where the camera is: vehicle_from_camera, and by how much each picture's pitch differs, radians."""

    rotation: Matrix
    position: Matrix
    nods: Matrix

    def moved(self, step: Matrix, free: Sequence[int]) -> Pose:
        """Return the pose after a step in those of `PARAMETERS` that are free, and in the nods."""
        whole = np.zeros(4)
        whole[list(free)] = step[: len(free)]
        roll, pitch, yaw = angles_of(square(self.rotation)) + whole[:3]
        rotation = rotation_from_euler(roll, pitch, yaw) @ OPTICAL_FROM_FLU.T
        position = self.position + whole[3] * np.array([0.0, 0.0, 1.0])
        nods = self.nods + step[len(free) :] if len(step) > len(free) else self.nods
        return Pose(rotation, position, nods)

    def at(self, picture: int) -> Pose:
        """Return the pose as it was at a picture, with its own pitch."""
        if not len(self.nods):
            return self
        level = self._replace(nods=np.zeros(0))
        return level.moved(self.nods[[picture]], [PARAMETERS.index("pitch")])

    @property
    def camera_from_vehicle(self) -> Matrix:
        """(4, 4), without nods."""
        return pose_of(self.rotation, self.position)


def pose_of_camera(camera: Camera) -> Pose:
    """Return the pose of a camera, without nods."""
    pose = camera.vehicle_from_camera
    return Pose(pose[:3, :3], pose[:3, 3], np.zeros(0))


class Pair(NamedTuple):
    """Two pictures, and how the vehicle (or the camera) moved from the one to the other: second_from_first."""

    first: int
    second: int
    motion: Matrix
    place: Matrix
    """Where the first was taken: ``map_from_vehicle`` or ``map_from_camera``."""


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
        self._masks: dict[int, NDArray[np.bool_]] = {}
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
        mask = self.eye.camera.mask
        if mask is None:
            return pixels
        if level not in self._masks:
            self._masks[level] = _eroded(mask, 2**level)
        rows, columns = mask.shape
        whole = np.nan_to_num(pixels, nan=-1.0, posinf=-1.0, neginf=-1.0)
        at = np.clip(np.rint(whole), 0, (columns - 1, rows - 1)).astype(np.intp)
        return np.where(self._masks[level][at[:, 1], at[:, 0]][:, None], pixels, np.nan)

    def _sight(self, pose: Pose, pair: Pair, pixels: Matrix, rays: Matrix, level: int, most: int) -> Sight:
        twice = np.isfinite(self.residuals(pose, pair, Sight(rays, rays[:, 0]), level, slopes=False)[0])
        pixels, rays = pixels[twice], rays[twice]
        values, slopes = self._brightness(self.pyramids[pair.first], level, pixels)
        if len(pixels) > most:
            # Of every two neighbours the steeper: of all places the steepest would mostly be those of moving things.
            steep = np.nan_to_num(np.hypot(slopes[:, 0], slopes[:, 1]))
            even = np.arange(0, len(pixels) - 1, 2)
            keep = even + (steep[even + 1] > steep[even])
            rays, values = rays[keep], values[keep]
        return Sight(rays, values)

    @staticmethod
    def _brightness(pyramid: Pyramid, level: int, pixels: Matrix) -> tuple[Matrix, Matrix]:
        """Brightness at pixels of the whole picture, and its slope there, a pixel of the level wide."""
        half = 0.5 * 2.0**level
        beside = np.array([[0.0, 0.0], [half, 0.0], [-half, 0.0], [0.0, half], [0.0, -half]])
        values = pyramid.sample(level, pixels + beside[:, None])
        slopes = np.stack([values[1] - values[2], values[3] - values[4]], -1) / (2.0 * half)
        return values[0], slopes

    # ------------------------------------------------------------------------------------------------------------------
    # Residuals

    def residuals(self, pose: Pose, pair: Pair, sight: Sight, level: int, slopes: bool) -> tuple[Matrix, Matrix | None]:
        """Return the brightness of the second picture where it shows a sight, and its derivatives.

        Returns
        -------
        values : (N,)
            NaN where the second picture does not show the place.
        derivatives : (N, 6) or None
            By roll, pitch, yaw, height, and by the pitch of the first and of the second picture.
        """
        first, second = pose.at(pair.first).rotation, pose.at(pair.second).rotation
        rays, centre, n = sight.rays, pose.position, self.normal
        d = rays @ first.T
        slant = np.einsum("nj,j->n", d, n)
        with np.errstate(all="ignore"):
            s = (self.offset - float(n @ centre)) / slant
        s = np.where(s > 0, s, np.nan)
        if self.of_camera:
            seen = (s[:, None] * rays) @ pair.motion[:3, :3].T + pair.motion[:3, 3]
        else:
            away = (centre + s[:, None] * d) @ pair.motion[:3, :3].T + pair.motion[:3, 3] - centre
            seen = away @ second
        pyramid = self.pyramids[pair.second]
        if not slopes:
            return pyramid.sample(level, self._shown(self.eye.pixels(seen), level)), None
        pixels, by_point = self.eye.slopes(seen)
        pixels = self._shown(pixels, level)
        values, steep = self._brightness(pyramid, level, pixels)
        by_seen = np.einsum("ni,nij->nj", steep, by_point)  # by the point in the second camera's frame
        if self.of_camera:
            along = np.einsum("nj,nj->n", by_seen @ pair.motion[:3, :3], rays) / slant
            by_turn = -(along * s)[:, None] * np.cross(d, n)
            by_nods = np.stack([by_turn, np.zeros_like(by_turn)])
            by_height = -along * n[2]
        else:
            g = by_seen @ second.T  # by the point in the vehicle's frame at the second picture
            q = g @ pair.motion[:3, :3]  # and at the first
            across = q - ((q * d).sum(1) / slant)[:, None] * n  # as far as the point stays on the road
            by_nods = np.stack([s[:, None] * np.cross(d, across), np.cross(g, away)])
            by_height = across[:, 2] - g[:, 2]
        axes = [axes_of_angles(*angles_of(square(each))[1:]) for each in (first, second)]
        by_angles = [by_nods[k] @ axes[k] for k in (0, 1)]
        return values, np.column_stack([by_angles[0] + by_angles[1], by_height, by_angles[0][:, 1], by_angles[1][:, 1]])

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
            values, there = values[both], sight.values[both]
            off, _ = exposed(values, there, spread, None)
            share = np.minimum((off / (CUT * spread)) ** 2, 1.0)
            total += float(np.mean(1.0 - (1.0 - share) ** 3))
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
        values = self.residuals(pose, pair, sight, level, slopes=False)[0]
        both = np.isfinite(values)
        return exposed(values[both], sight.values[both], None, None)[0]

    def normal_of(self, pose: Pose, sights: Sequence[Sight], level: int, spread: float, free: Sequence[int]) -> Normal:
        """Return the normal equations of Tukey's loss."""
        items = list(zip(self.pairs, sights, strict=True))
        parts = in_threads(lambda item: self._part(pose, item, level, spread, free), items)
        size = len(free) + len(pose.nods)
        cost, gradient, hessian = 0.0, np.zeros(size), np.zeros((size, size))
        for pair, part in zip(self.pairs, parts, strict=True):
            cost += part.cost
            where = list(range(len(free)))
            if len(pose.nods):
                where += [len(free) + pair.first, len(free) + pair.second]
            gradient[where] += part.gradient
            hessian[np.ix_(where, where)] += part.hessian
        return Normal(cost, gradient, hessian)

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
            first = pose.at(pair.first).rotation
            rays = sight.rays[both]
            d = rays @ first.T
            s = (self.offset - float(self.normal @ pose.position)) / np.einsum("nj,j->n", d, self.normal)
            road = s[:, None] * rays if self.of_camera else pose.position + s[:, None] * d
            return road @ pair.place[:3, :3].T + pair.place[:3, 3], (weights_of(off, spread) * off)[:, None] * J

        return in_threads(of, list(zip(self.pairs, sights, strict=True)))

    def _part(self, pose: Pose, item: tuple[Pair, Sight], level: int, spread: float, free: Sequence[int]) -> Normal:
        """Return the normal equations of a pair by the free parameters, and by its own two nods if there are any."""
        columns = [*free, 4, 5] if len(pose.nods) else list(free)
        found = self._weighted(pose, item, level, spread, columns)
        most, places = CUT**2 / 6.0 * spread**2, len(item[1].values)
        if found is None:
            return Normal(places * most, np.zeros(len(columns)), np.zeros((len(columns), len(columns))))
        off, J, _ = found
        # what leaves the picture counts as the rest does: else poses would be drawn to where less, or more, is seen
        all_over_seen = places / len(off)
        share = np.minimum((off / (CUT * spread)) ** 2, 1.0)
        weighted = weights_of(off, spread)[:, None] * J
        return Normal(
            all_over_seen * float((most * (1.0 - (1.0 - share) ** 3)).sum()),
            all_over_seen * np.einsum("np,n->p", weighted, off),
            all_over_seen * np.einsum("np,nq->pq", weighted, J),
        )

    def _weighted(
        self, pose: Pose, item: tuple[Pair, Sight], level: int, spread: float, columns: Sequence[int]
    ) -> tuple[Matrix, Matrix, NDArray[np.bool_]] | None:
        """Return how brightness differs, the derivatives by columns, and of which places; None of fewer than ten."""
        pair, sight = item
        values, derivatives = self.residuals(pose, pair, sight, level, slopes=True)
        assert derivatives is not None
        J = derivatives[:, columns]
        both = np.isfinite(values) & np.isfinite(J).all(1)
        if both.sum() < 10:
            return None
        off, J = exposed(values[both], sight.values[both], spread, J[both])
        return off, J, both


def exposed(values: Matrix, there: Matrix, spread: float | None, J: Matrix | None) -> tuple[Matrix, Any]:
    """Return how brightness differs when the first picture's gain and offset fit best, and derivatives of that.

    They are fitted to what Tukey's weights leave, from a gain of one and the median offset on: what moves is no light.
    The gain stays between a half and two: else a place without contrast would fit everything.
    """
    off = values - there
    if not len(off):
        return off, J
    off = off - np.median(off)
    for _ in range(2):
        weights = weights_of(off, 1.4826 * float(np.median(np.abs(off))) if spread is None else spread)
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


def _dot(a: Matrix, b: Matrix) -> float:
    """Return the sum of products.

    OpenBLAS shares `a @ b` between threads, whose start costs more than such a sum: on a busy machine ten milliseconds
    instead of ten microseconds.
    """
    return float(np.einsum("n,n->", a, b))


def weights_of(off: Matrix, spread: float) -> Matrix:
    share = np.minimum((off / (CUT * spread)) ** 2, 1.0) if spread > 0 else np.ones_like(off)
    return (1.0 - share) ** 2


def correlation(a: Matrix, b: Matrix) -> float:
    """Return the correlation of two lists; 0 where one has no contrast, -1 of fewer than ten."""
    if len(a) < 10:
        return -1.0
    a, b = a - a.mean(), b - b.mean()
    size = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size > 0 else 0.0


def square(rotation: Matrix) -> Matrix:
    pose = np.eye(4)
    pose[:3, :3] = rotation
    return pose


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


def in_threads(work: Callable[[T], U], items: Iterable[T]) -> list[U]:
    """Call `work` on each item, in order of the results, on the threads that there are: NumPy lets others run."""
    listed = list(items)
    count = min(len(listed), get_num_threads(), 8)
    if count <= 1:
        return [work(item) for item in listed]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(work, listed))
