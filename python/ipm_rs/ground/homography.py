"""`Homography`: between a plane in metres and the pixels that show it, known where it ends."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of, number_of, rows_of
from ipm_rs._core import homography_from_points
from ipm_rs.errors import ArgumentError, ArgumentTypeError, IpmError

__all__ = ["Homography"]

_MOST_SAMPLES = 500  # half of the points wrong: four right ones among them with all but 1e-14 of certainty


@dataclass(frozen=True, eq=False)
class Homography:
    """A plane in metres as a picture without a lens shows it: a sports field, a river, the ground below a drone.

    `Lut.from_homography(homography.matrix, grid=grid, source_size=size)` goes on to the bird's-eye view.

    Parameters
    ----------
    matrix : (3, 3) array, float64
        Takes (x, y, 1) in metres to pixels, its third component positive where the plane is seen.
    errors : (N,) array, float64
        Pixels from each point that it was made of to where it puts it; empty if it was made of none.
    used : (N,) array, bool
        Which of them it fits; the others are taken for mistakes.
    """

    matrix: NDArray[np.float64]
    errors: NDArray[np.float64]
    used: NDArray[np.bool_]

    @classmethod
    def from_points(
        cls, image_points: ArrayLike, ground_points: ArrayLike, *, tolerance: float | None = None
    ) -> Homography:
        """Find the homography of clicked points and their places, without the wrong ones.

        Fours of points are tried, all of them or 500 from a fixed seed; the one by which most lie within the tolerance
        is refined to the least squares of these (Fischler and Bolles 1981; Torr and Zisserman 2000).

        Parameters
        ----------
        image_points : (N, 2) array_like
            Pixels, N of 4 or more.
        ground_points : (N, 2) array_like
            The same points in metres.
        tolerance : float, optional
            Pixels beyond which a point is taken for a mistake; None takes all of them for right.

        Raises
        ------
        ArgumentError
            Fewer than four points, points on a line, or no four that agree.
        ArgumentTypeError, CalibrationError
            No numbers, or not finite.
        """
        if tolerance is None:
            matrix, errors = homography_from_points(image_points, ground_points)
            return cls(matrix, errors, np.ones(len(errors), bool))
        limit = number_of("tolerance", tolerance)
        if limit <= 0:
            raise ArgumentError(f"tolerance: expected pixels above 0, got {limit:g}")
        image, ground = rows_of("image_points", image_points, 2), rows_of("ground_points", ground_points, 2)
        if len(image) != len(ground) or len(image) < 4:
            raise ArgumentError(
                f"image_points, ground_points: expected as many of each, 4 or more, got {len(image)} and {len(ground)}"
            )
        best, score = None, math.inf
        for four in _samples(len(image)):
            try:
                matrix, _ = homography_from_points(image[four], ground[four])
            except IpmError:
                continue  # on a line, or seen from both sides
            cost = float(np.minimum(_off(matrix, image, ground), 4 * limit).sum())
            if cost < score:
                best, score = matrix, cost
        if best is None:
            raise ArgumentError("image_points: expected four points that make a plane, got none; are pairs mixed up?")
        # that of four points, with their noise, may be a few times as far off
        fits = _off(best, image, ground) < 4 * limit
        for _ in range(10):
            if fits.sum() < 4:
                break
            best, _ = homography_from_points(image[fits], ground[fits])
            near = _off(best, image, ground) < limit
            if (near == fits).all():
                break
            fits = near
        if fits.sum() < 4:
            raise ArgumentError(
                f"image_points: expected at least four points that agree to {limit:g} pixels, got {int(fits.sum())}; "
                "check the order of the points, or give a larger tolerance"
            )
        return cls(best, _off(best, image, ground), fits)

    @classmethod
    def from_matrix(cls, M: ArrayLike, *, seen: ArrayLike) -> Homography:
        """Take a matrix of somebody else's, whose sign is arbitrary.

        Parameters
        ----------
        M : (3, 3) array_like
            Takes (x, y, 1) in metres to pixels.
        seen : (float, float)
            (x, y) of a point of the plane that lies before the camera, which tells its two sides apart.

        Raises
        ------
        ArgumentError, ArgumentTypeError
            The matrix is singular or not finite, or the point on its horizon.
        """
        matrix = array_of("M", M)
        if matrix.dtype.kind not in "iuf":
            raise ArgumentTypeError(f"M: expected numbers, got {matrix.dtype}")
        if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
            raise ArgumentError(f"M: expected a finite (3, 3) matrix, got shape {matrix.shape}")
        matrix = matrix.astype(np.float64)
        if np.linalg.matrix_rank(matrix / np.abs(matrix).max(axis=1, keepdims=True).clip(1e-300)) < 3:
            raise ArgumentError("M: expected a matrix that can be inverted, got a singular one")
        point = rows_of("seen", np.reshape(array_of("seen", seen), (1, -1)), 2)[0]
        depth = float(matrix[2] @ [*point, 1])
        if depth == 0:
            raise ArgumentError("seen: expected a point before the camera, got one on the horizon")
        return cls(matrix * np.sign(depth), np.empty(0), np.empty(0, bool))

    def pixels_from_ground(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Say where points of the plane are seen.

        Parameters
        ----------
        xy : (N, 2) array_like
            Metres.

        Returns
        -------
        (N, 2) array, float64
            Pixels, also outside the picture; NaN for what lies behind the camera.

        Raises
        ------
        ArgumentError, ArgumentTypeError
            Another shape, no numbers, or not finite.
        """
        return _through(self.matrix, rows_of("xy", xy, 2))

    def ground_from_pixels(self, uv: ArrayLike) -> NDArray[np.float64]:
        """Say which points of the plane pixels show.

        Parameters
        ----------
        uv : (N, 2) array_like
            Pixels.

        Returns
        -------
        (N, 2) array, float64
            Metres; NaN above the horizon.

        Raises
        ------
        ArgumentError, ArgumentTypeError
            Another shape, no numbers, or not finite.
        """
        inverse: NDArray[np.float64] = np.asarray(np.linalg.inv(self.matrix), dtype=np.float64)
        return _through(inverse, rows_of("uv", uv, 2))


def _through(matrix: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    q = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    with np.errstate(all="ignore"):
        result: NDArray[np.float64] = np.where(q[:, 2:] > 0, q[:, :2] / q[:, 2:], np.nan)
    return result


def _off(matrix: NDArray[np.float64], image: NDArray[np.float64], ground: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels from each point to where the matrix puts its place; infinite behind the camera."""
    off: NDArray[np.float64] = np.linalg.norm(_through(matrix, ground) - image, axis=1)
    return np.nan_to_num(off, nan=np.inf)


def _samples(count: int) -> list[list[int]]:
    """Every four of few points, some of many."""
    if math.comb(count, 4) <= _MOST_SAMPLES:
        return [list(four) for four in itertools.combinations(range(count), 4)]
    random = np.random.default_rng(0)
    return [random.choice(count, 4, replace=False).tolist() for _ in range(_MOST_SAMPLES)]
