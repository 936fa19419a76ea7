"""The pose of a camera from points of the ground that were surveyed, through any lens.

Rays of the pixels and points of the plane are related by a homography ``ray ~ [r1 r2 t] (x, y, 1)``, which four points
give (direct linear transform on rays, so that lenses beyond 180 degrees work too). The pose in it is then refined by
the least squares of the distances in pixels, from both of the poses between which a plane leaves a doubt
(Schweighofer and Pinz 2006). Wrong points are left out by random samples of four, from a fixed seed (Fischler and
Bolles 1981).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import number_of, rows_of
from ipm_rs._core import Camera
from ipm_rs.calibration._rotations import rodrigues
from ipm_rs.errors import ArgumentError, CalibrationError
from ipm_rs.refine._solve import Vector, jacobian, minimised

__all__ = ["PoseFit", "camera_from_ground_points", "from_ground_points"]

_MOST_SAMPLES = 300  # finds four right ones of which 60 % are with a chance of 1 - 1e-18
_LEAST_SPREAD = 1e-3  # of the smaller side of a set of points to the larger: below it is a line


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A pose that was found, and how far it can be trusted."""

    camera: Camera
    """The camera in its pose."""
    residuals: NDArray[np.float64]
    """(N, 2) pixels: where the camera sees each point less where it was given; NaN where it sees none."""
    used: NDArray[np.bool_]
    """(N,) which points the pose was found from; the others were too far off."""
    covariance: NDArray[np.float64]
    """(6, 6) of x, y, z in metres and of turns about the vehicle's x, y, z axes in radians. For pixels whose error is
    that of the residuals, or 1 pixel where there are no more points than the pose needs."""

    ground: float
    """z of the points that it was found from, metres."""

    def ground_deviation(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Return the standard deviation of x and y, (N, 2) metres, of ground points read through this camera.

        It is what the pose's uncertainty makes of points (N, 2) of the road that it was found from; their own pixels
        are taken as exact. It grows with the square of the distance: points at 10 m say little of 40 m.

        Raises
        ------
        ArgumentError, ArgumentTypeError
            The points are no (N, 2) array.
        """
        points = rows_of("xy", xy, 2)
        height = self.ground
        pixels, _, _ = self.camera.project(np.column_stack([points, np.full(len(points), height)]))

        def seen(parameters: Vector) -> Vector:
            return _posed(self.camera, parameters).ground_from_pixels(pixels, ground=height)[:, :2].ravel()

        J = jacobian(seen, np.zeros(6)).reshape(len(points), 2, 6)
        variances = np.einsum("nij,jk,nik->ni", J, self.covariance, J)
        return np.sqrt(variances)


def from_ground_points(
    pixels: ArrayLike,
    ground_points: ArrayLike,
    *,
    K: ArrayLike,
    image_size: Sequence[int],
    lens: Any = None,
    ground: float = 0.0,
    tolerance: float = 4.0,
) -> PoseFit:
    """Find the pose of a camera from points of a level ground.

    Parameters
    ----------
    pixels : (N, 2) array_like
        Where the raw image shows the points, at least 4.
    ground_points : (N, 2) array_like
        (x, y) of the points in the vehicle frame, metres.
    K : (3, 3) array_like
        Intrinsic matrix, pixels.
    image_size : (int, int)
        Width and height, pixels.
    lens : lens, optional
        The lens; a pinhole if not given.
    ground : float
        z of the points, metres.
    tolerance : float
        Points that are farther off than this, pixels, are taken for mistakes, if there are more than four points.

    Returns
    -------
    PoseFit
        The camera, the residuals, and the covariance of the pose.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        There are fewer than 4 points, all on a line; a mirror image (y points left); points of which no four agree.
    CalibrationError
        `K`, `image_size` or `lens` cannot be right, or most pixels lie where the lens sees nothing.
    """
    seen, points = rows_of("pixels", pixels, 2), rows_of("ground_points", ground_points, 2)
    if len(seen) != len(points):
        raise ArgumentError(f"pixels, ground_points: expected as many of both, got {len(seen)} and {len(points)}")
    if len(seen) < 4:
        raise ArgumentError(f"pixels: expected at least 4 points of the ground, got {len(seen)}; survey more")
    height, limit = number_of("ground", ground), number_of("tolerance", tolerance)
    if limit <= 0:
        raise ArgumentError(f"tolerance: expected pixels above 0, got {limit:g}")
    _check_spread(points)
    base = Camera(K, image_size=image_size, camera_from_vehicle=np.eye(4), lens=lens)
    rays = base.unproject(seen)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    known = ~np.isnan(rays[:, 0])
    if known.sum() < 4:
        raise CalibrationError(
            f"pixels: expected at least 4 that the lens sees, got {known.sum()} of {len(seen)}; check K and the lens"
        )
    problem = _Problem(base, seen, rays, np.column_stack([points, np.full(len(points), height)]), height)
    pose, used = problem.solved(known, limit)
    if pose is None:
        raise ArgumentError(
            "ground_points: expected points seen from above, x ahead and y to the left, got their mirror image or "
            "points of which no four agree; check the sign of y and the order of the points"
        )
    camera = base.with_pose(pose)
    residuals = camera.project(problem.points)[0] - seen
    J = jacobian(lambda parameters: problem.residuals(camera, parameters, used), np.zeros(6))
    freedom = 2 * int(used.sum()) - 6
    variance = float((residuals[used] ** 2).sum()) / freedom if freedom > 0 else 1.0
    return PoseFit(camera, residuals, used, np.asarray(variance * np.linalg.pinv(J.T @ J), dtype=np.float64), height)


def camera_from_ground_points(
    pixels: ArrayLike,
    ground_points: ArrayLike,
    *,
    K: ArrayLike,
    image_size: Sequence[int],
    lens: Any = None,
    ground: float = 0.0,
    tolerance: float = 4.0,
) -> Camera:
    """Find a camera from points of a level ground that were surveyed, through any lens.

    Four points are enough; with more, wrong ones are left out. How far the pose can be trusted says
    `ipm_rs.refine.from_ground_points`, which takes the same and gives the residuals and the covariance too.

    Parameters
    ----------
    pixels : (N, 2) array_like
        Where the raw image shows the points.
    ground_points : (N, 2) array_like
        (x, y) of the points in the vehicle frame, metres.
    K : (3, 3) array_like
        Intrinsic matrix, pixels.
    image_size : (int, int)
        Width and height, pixels.
    lens : lens, optional
        The lens; a pinhole if not given.
    ground : float
        z of the points, metres.
    tolerance : float
        Points that are farther off than this, pixels, are taken for mistakes.

    Returns
    -------
    Camera
        In the pose from which the points are seen where they were given.

    Raises
    ------
    ArgumentError, ArgumentTypeError, CalibrationError
        As `ipm_rs.refine.from_ground_points`.
    """
    return from_ground_points(
        pixels, ground_points, K=K, image_size=image_size, lens=lens, ground=ground, tolerance=tolerance
    ).camera


@dataclass(frozen=True)
class _Problem:
    base: Camera
    pixels: NDArray[np.float64]
    rays: NDArray[np.float64]
    points: NDArray[np.float64]
    height: float

    def residuals(self, camera: Camera, parameters: Vector, among: NDArray[np.bool_]) -> Vector:
        """Return the pixels between where a camera, moved by parameters, sees points and where they were given."""
        seen = _posed(camera, parameters).project(self.points[among])[0]
        return (seen - self.pixels[among]).ravel()

    def solved(self, known: NDArray[np.bool_], limit: float) -> tuple[NDArray[np.float64] | None, NDArray[np.bool_]]:
        """Return the pose, and the points that it fits; None where no four agree."""
        best, score, fits = None, math.inf, known
        for sample in self._samples(np.flatnonzero(known)):
            pose = self._pose(sample)
            if pose is None:
                continue
            cost = float(np.minimum(np.nan_to_num(self._off(pose), nan=np.inf), 4 * limit).sum())
            if cost < score:
                best, score = pose, cost
        if best is None:
            return None, known
        several = known.sum() > 4
        # the pose of four points, with their noise, may be a few times as far off
        fits = known & (self._off(best) < 4 * limit) if several else known
        for _ in range(10):
            if fits.sum() < 4:
                return None, known
            best = self._refined(best, fits)
            near = known & (self._off(best) < limit) if several else known
            if (near == fits).all():
                break
            fits = near
        return best, fits

    def _off(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far each point is from where it was given, pixels."""
        off: NDArray[np.float64] = np.linalg.norm(
            self.base.with_pose(pose).project(self.points)[0] - self.pixels, axis=1
        )
        return off

    def _samples(self, among: NDArray[np.intp]) -> list[list[int]]:
        """Return all of the points, then fours of them: every four of few, some of many."""
        every: list[list[int]] = [among.tolist()]
        if math.comb(len(among), 4) <= _MOST_SAMPLES:
            return every + [list(four) for four in itertools.combinations(among.tolist(), 4) if len(among) > 4]
        random = np.random.default_rng(0)
        return every + [random.choice(among, 4, replace=False).tolist() for _ in range(_MOST_SAMPLES)]

    def _pose(self, sample: Sequence[int]) -> NDArray[np.float64] | None:
        """Return the pose in the homography of some points; None where they are on a line, or seen from below."""
        rays, points = self.rays[list(sample)], self.points[list(sample), :2]
        centre = points.mean(axis=0)
        scale = float(np.abs(points - centre).max())
        if scale == 0 or _narrowness(points) < _LEAST_SPREAD:
            return None
        plane = np.column_stack([(points - centre) / scale, np.ones(len(points))])
        rows = []
        for (a, b, c), p in zip(rays, plane, strict=True):
            zero = np.zeros(3)
            rows += [np.concatenate([zero, -c * p, b * p]), np.concatenate([c * p, zero, -a * p])]
            rows.append(np.concatenate([-b * p, a * p, zero]))
        H = np.linalg.svd(np.array(rows))[2][-1].reshape(3, 3)
        H = H @ np.array([[1 / scale, 0, -centre[0] / scale], [0, 1 / scale, -centre[1] / scale], [0, 0, 1]])
        if np.sum(rays * (np.column_stack([points, np.ones(len(points))]) @ H.T)) < 0:
            H = -H
        length = math.sqrt(float(np.linalg.norm(H[:, 0]) * np.linalg.norm(H[:, 1])))
        if not length > 0:
            return None
        r1, r2, t = (H / length).T
        U, _, V = np.linalg.svd(np.column_stack([r1, r2, np.cross(r1, r2)]))
        R = U @ np.diag([1, 1, np.linalg.det(U @ V)]) @ V
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = R, t - R[:, 2] * self.height
        return pose if (-R.T @ t)[2] > 0 else None

    def _refined(self, pose: NDArray[np.float64], among: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the pose of the least squares, of the two from which a plane looks nearly alike."""
        found: list[tuple[float, NDArray[np.float64]]] = []
        for start in (pose, self._other(pose, among)):
            camera = self.base.with_pose(start)
            with np.errstate(all="ignore"):
                parameters, cost = minimised(partial(self.residuals, camera, among=among), np.zeros(6))
            refined = _posed(camera, parameters)
            if refined.position[2] > self.height:
                found.append((cost, refined.camera_from_vehicle))
        return min(found, key=lambda each: each[0])[1] if found else pose

    def _other(self, pose: NDArray[np.float64], among: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the pose with the plane's normal mirrored about the line of sight to the points' middle."""
        middle = self.points[among].mean(axis=0)
        sight = pose[:3, :3] @ middle + pose[:3, 3]
        sight /= np.linalg.norm(sight)
        normal = pose[:3, 2]
        mirrored = 2 * (normal @ sight) * sight - normal
        if mirrored @ sight > 0:  # of the two normals the one that looks at the camera
            mirrored = -mirrored
        axis, cosine = np.cross(normal, mirrored), float(np.clip(normal @ mirrored, -1, 1))
        size = float(np.linalg.norm(axis))
        if size < 1e-9:
            return pose
        turn = rodrigues(axis / size * math.atan2(size, cosine))
        other = np.eye(4)
        other[:3, :3] = turn @ pose[:3, :3]
        other[:3, 3] = pose[:3, :3] @ middle + pose[:3, 3] - other[:3, :3] @ middle
        return other


def _posed(camera: Camera, parameters: Vector) -> Camera:
    """Return a camera moved by x, y, z and turned about the vehicle's axes at its own place."""
    pose = camera.vehicle_from_camera
    moved = np.eye(4)
    moved[:3, :3] = rodrigues(parameters[3:]) @ pose[:3, :3]
    moved[:3, 3] = pose[:3, 3] + parameters[:3]
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = moved[:3, :3].T, -moved[:3, :3].T @ moved[:3, 3]
    return camera.with_pose(inverse)


def _narrowness(points: NDArray[np.float64]) -> float:
    """Return the ratio of the smaller to the larger extent of points: 0 on a line."""
    values = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(values[1] / values[0]) if values[0] > 0 else 0.0


def _check_spread(points: NDArray[np.float64]) -> None:
    if _narrowness(points) < _LEAST_SPREAD:
        raise ArgumentError("ground_points: expected points that are not all on one line; survey some beside it")
