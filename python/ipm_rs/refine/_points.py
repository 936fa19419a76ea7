"""The pose of a camera from points that were surveyed, of the road or of anything else, through any lens.

Every three points, seen along three rays, leave up to four poses; the one that the most points agree with (Fischler and
Bolles 1981) is refined by the least squares of the distances in the raw picture. That tries both of the poses between
which a plane leaves a doubt (Schweighofer and Pinz 2006), and lenses beyond 180 degrees work as others do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import number_of, rows_of
from ipm_rs._core import Camera, HeightMap, Plane
from ipm_rs.calibration._rotations import rodrigues
from ipm_rs.errors import ArgumentError
from ipm_rs.refine._inputs import guarded
from ipm_rs.refine._motion import angles_of, axes_of_angles, upright
from ipm_rs.refine._projection import Eye
from ipm_rs.refine._search import Search, apart, eyes_of_any_focal_length
from ipm_rs.refine._solve import inverse_of

__all__ = ["PoseFit", "camera_from_ground_points", "camera_from_points", "from_ground_points", "from_points"]

Matrix = NDArray[np.float64]
Ground = float | Plane | HeightMap

_LEAST_SPREAD = 1e-3  # of the smaller side of a set of points to the larger: below it is a line
_LOOSEST = 0.5  # of the camera's height, its standard deviation: above it the points tell no pose
_ENOUGH_FREEDOM = 6
"""Numbers beyond those that the pose needs, from which the pixels' error is estimated. Of fewer, chance makes too much:
three points more than needed tell it within 30 %."""
_TOLD = (10.0, 20.0, 40.0)


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A pose that was found, and how far it can be trusted; as text with its deviations at 10, 20 and 40 m."""

    camera: Camera
    """The camera in its pose."""
    residuals: NDArray[np.float64]
    """(N, 2) pixels: where the camera sees each point less where it was given; NaN where it sees none."""
    used: NDArray[np.bool_]
    """(N,) which points the pose was found from; the others were too far off."""
    covariance: NDArray[np.float64]
    """(6, 6) of x, y, z in metres and of turns about the vehicle's x, y, z axes in radians; where the focal length was
    sought, (7, 7) with it in pixels. For pixels whose error is that of the residuals; where there are less than three
    points more than the pose needs, at least 1 pixel."""
    pixel_deviation: float
    """That error: the standard deviation of a coordinate, pixels."""
    ground: float | Plane | HeightMap
    """The road of the points; 0 for points of any height."""
    alternatives: tuple[Camera, ...] = ()
    """Other poses that fit as well: three points look alike from up to four places, few of a plane from two."""

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by name.

        "x", "y", "z" in metres, "roll", "pitch", "yaw" in radians, as `Camera.from_euler` takes them, and
        "focal_length" in pixels where it was sought.
        """
        _, pitch, yaw = angles_of(self.camera.vehicle_from_camera)
        # of a camera that looks straight down the picture tells roll and yaw together: each gets half of it
        from_turn = np.linalg.pinv(axes_of_angles(pitch, yaw), rcond=1e-3)
        variances = np.diag(self.covariance).copy()
        variances[3:6] = np.diag(from_turn @ self.covariance[3:6, 3:6] @ from_turn.T)
        names = ("x", "y", "z", "roll", "pitch", "yaw", "focal_length")
        return {name: math.sqrt(max(v, 0.0)) for name, v in zip(names, variances, strict=False)}

    @guarded
    def ground_deviation(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Return the standard deviation of x and y, (N, 2) metres, of ground points read through this camera.

        It is what the pose's uncertainty makes of points (N, 2) of the road that it was found from; their own pixels
        are taken as exact. It grows with the square of the distance: points at 10 m say little of 40 m. Infinite where
        the camera sees no road.

        Raises
        ------
        ArgumentError, ArgumentTypeError
            The points are no (N, 2) array of finite numbers.
        """
        points = rows_of("xy", xy, 2)
        pixels = self.camera.project(points, ground=self.ground)[0]
        J = np.empty((len(points), 2, len(self.covariance)))
        for column in range(J.shape[2]):
            # pixels move by some 1e-3 for 1e-6 metres or radians, of which float64 keeps ten digits
            size = 1e-6 if column < 6 else 1e-6 * float(self.camera.intrinsics[0, 0])
            ends = [_moved(self.camera, column, sign * size) for sign in (1.0, -1.0)]
            ahead, behind = (camera.ground_from_pixels(pixels, ground=self.ground)[:, :2] for camera in ends)
            J[:, :, column] = (ahead - behind) / (2.0 * size)
        variances = np.einsum("nij,jk,nik->ni", J, self.covariance, J)
        return np.where(np.isfinite(variances), np.sqrt(np.maximum(variances, 0.0)), np.inf)

    def __str__(self) -> str:
        x, y, z = self.camera.position
        off, angles = self.deviations, np.degrees(angles_of(self.camera.vehicle_from_camera))
        said = [
            f"{name} {value:.3f} +- {math.degrees(off[name]):.3f} deg"
            for name, value in zip(("roll", "pitch", "yaw"), angles, strict=True)
        ]
        lines = [
            f"camera at ({x:.3f}, {y:.3f}, {z:.3f}) m, +- ({off['x']:.3f}, {off['y']:.3f}, {off['z']:.3f}) m",
            ", ".join(said),
        ]
        if "focal_length" in off:
            lines.append(f"focal length {self.camera.intrinsics[0, 0]:.1f} +- {off['focal_length']:.1f} px")
        rms = math.sqrt(float(np.mean(self.residuals[self.used] ** 2)))
        lines.append(
            f"{self.used.sum()} of {len(self.used)} points used, {rms:.2f} px off; pixels +- {self.pixel_deviation:.2f}"
        )
        told = self.ground_deviation([[distance, 0.0] for distance in _TOLD])[:, 0]
        lines.append(
            "x read from pixels +- " + ", ".join(f"{m:.2f} m at {d:.0f} m" for m, d in zip(told, _TOLD, strict=True))
        )
        return "\n".join(lines)


@guarded
def from_ground_points(
    pixels: ArrayLike,
    ground_points: ArrayLike,
    *,
    image_size: Sequence[int],
    K: ArrayLike | None = None,
    lens: Any = None,
    ground: float | Plane | HeightMap = 0.0,
    principal_point: Sequence[float] | None = None,
    tolerance: float = 4.0,
) -> PoseFit:
    """Find the pose of a camera from points of the road.

    Parameters
    ----------
    pixels : (N, 2) array_like
        Where the raw image shows the points, at least 4.
    ground_points : (N, 2) array_like
        (x, y) of the points in the vehicle frame, metres.
    image_size : (int, int)
        Width and height, pixels.
    K : (3, 3) array_like, optional
        Intrinsic matrix, pixels. Without it the focal length is found too, of square pixels.
    lens : lens, optional
        The lens; a pinhole if not given.
    ground : float, Plane or HeightMap
        The road that the points are on: its height, or a surface.
    principal_point : (float, float), optional
        Where K is not known: (cx, cy), the middle of the image if not given.
    tolerance : float
        Points that are farther off than this, pixels, are taken for mistakes, if there are more than four points.

    Returns
    -------
    PoseFit
        The camera, the residuals, and the covariance of the pose.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        There are fewer than 4 points, all on a line; a mirror image (y points left); points of which no four agree, or
        that do not tell the focal length.
    CalibrationError
        `K`, `image_size` or `lens` cannot be right, or most pixels lie where the lens sees nothing.
    """
    road = rows_of("ground_points", ground_points, 2)
    places = np.column_stack([road, _heights(road, ground)])
    return _found("ground_points", pixels, places, ground, image_size, K, lens, principal_point, tolerance, above=True)


@guarded
def from_points(
    pixels: ArrayLike,
    points: ArrayLike,
    *,
    image_size: Sequence[int],
    K: ArrayLike | None = None,
    lens: Any = None,
    principal_point: Sequence[float] | None = None,
    tolerance: float = 4.0,
) -> PoseFit:
    """Find the pose of a camera from points of any height.

    Parameters
    ----------
    pixels : (N, 2) array_like
        Where the raw image shows the points, at least 3; at least 4 without K.
    points : (N, 3) array_like
        The points in the vehicle frame, metres.
    image_size : (int, int)
        Width and height, pixels.
    K : (3, 3) array_like, optional
        Intrinsic matrix, pixels. Without it the focal length is found too, of square pixels.
    lens : lens, optional
        The lens; a pinhole if not given.
    principal_point : (float, float), optional
        Where K is not known: (cx, cy), the middle of the image if not given.
    tolerance : float
        Points that are farther off than this, pixels, are taken for mistakes, if some can be spared.

    Returns
    -------
    PoseFit
        The most upright of the poses that fit; the others, such as three points leave, are its ``alternatives``.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        There are too few points, or all on a line; points of which too few agree, or that do not tell the focal length.
    CalibrationError
        `K`, `image_size` or `lens` cannot be right, or most pixels lie where the lens sees nothing.
    """
    places = rows_of("points", points, 3)
    return _found("points", pixels, places, 0.0, image_size, K, lens, principal_point, tolerance, above=False)


def camera_from_ground_points(
    pixels: ArrayLike,
    ground_points: ArrayLike,
    *,
    image_size: Sequence[int],
    K: ArrayLike | None = None,
    lens: Any = None,
    ground: float | Plane | HeightMap = 0.0,
    principal_point: Sequence[float] | None = None,
    tolerance: float = 4.0,
) -> Camera:
    """Find a camera from points of the road that were surveyed, through any lens.

    Four points are enough; with more, wrong ones are left out. How far the pose can be trusted says
    `ipm_rs.refine.from_ground_points`, which takes the same and gives the residuals and the covariance too.

    Parameters
    ----------
    pixels : (N, 2) array_like
        Where the raw image shows the points.
    ground_points : (N, 2) array_like
        (x, y) of the points in the vehicle frame, metres.
    image_size : (int, int)
        Width and height, pixels.
    K : (3, 3) array_like, optional
        Intrinsic matrix, pixels. Without it the focal length is found too, of square pixels.
    lens : lens, optional
        The lens; a pinhole if not given.
    ground : float, Plane or HeightMap
        The road that the points are on.
    principal_point : (float, float), optional
        Where K is not known: (cx, cy), the middle of the image if not given.
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
    given = {"image_size": image_size, "K": K, "lens": lens, "principal_point": principal_point, "tolerance": tolerance}
    return from_ground_points(pixels, ground_points, ground=ground, **given).camera


def camera_from_points(
    pixels: ArrayLike,
    points: ArrayLike,
    *,
    image_size: Sequence[int],
    K: ArrayLike | None = None,
    lens: Any = None,
    principal_point: Sequence[float] | None = None,
    tolerance: float = 4.0,
) -> Camera:
    """Find a camera from points of any height that were surveyed, through any lens.

    How far the pose can be trusted, and which others fit as well, says `ipm_rs.refine.from_points`.

    Parameters
    ----------
    pixels : (N, 2) array_like
        Where the raw image shows the points, at least 3.
    points : (N, 3) array_like
        The points in the vehicle frame, metres.
    image_size : (int, int)
        Width and height, pixels.
    K : (3, 3) array_like, optional
        Intrinsic matrix, pixels. Without it the focal length is found too, of square pixels.
    lens : lens, optional
        The lens; a pinhole if not given.
    principal_point : (float, float), optional
        Where K is not known: (cx, cy), the middle of the image if not given.
    tolerance : float
        Points that are farther off than this, pixels, are taken for mistakes.

    Returns
    -------
    Camera
        In the most upright pose from which the points are seen where they were given.

    Raises
    ------
    ArgumentError, ArgumentTypeError, CalibrationError
        As `ipm_rs.refine.from_points`.
    """
    given = {"image_size": image_size, "K": K, "lens": lens, "principal_point": principal_point, "tolerance": tolerance}
    return from_points(pixels, points, **given).camera


def _found(
    name: str,
    pixels: ArrayLike,
    points: Matrix,
    ground: Ground,
    image_size: Sequence[int],
    K: ArrayLike | None,
    lens: Any,
    principal_point: Sequence[float] | None,
    tolerance: float,
    *,
    above: bool,
) -> PoseFit:
    seen = rows_of("pixels", pixels, 2)
    limit = number_of("tolerance", tolerance, low=0.0, high=1e9, what=", pixels")
    if K is not None and principal_point is not None:
        raise ArgumentError("principal_point: expected it only without K, which holds it; leave one of them out")
    _check(name, seen, points, 4 if above or K is None else 3)
    search = Search(name, seen, points, tolerance=limit, above=above, with_focal=K is None)
    eyes = (
        eyes_of_any_focal_length(image_size, lens, principal_point)
        if K is None
        else [Eye(Camera(K, image_size=image_size, lens=lens))]
    )
    fits = search.fits(eyes)
    alike = apart([fit for fit in fits if fit.loss <= fits[0].loss + limit**2 / 4.0])
    if not above:  # nothing tells them apart: a camera that stands upright is likelier than one that hangs
        alike.sort(key=lambda fit: -upright(fit.camera))
    best, *others = alike
    inverse = inverse_of(best.normal.hessian)
    if inverse is None:
        raise ArgumentError(f"{name}: expected points that tell a pose, but they leave it open; add some, near and far")
    freedom = 2 * int(best.used.sum()) - len(inverse)
    variance = 2.0 * best.normal.cost / freedom if freedom > 0 else 0.0
    variance = variance if freedom >= _ENOUGH_FREEDOM else max(variance, 1.0)
    order = [3, 4, 5, 0, 1, 2, *range(6, len(inverse))]
    scale = np.ones(len(inverse))
    scale[6:] = best.camera.intrinsics[0, 0]  # the logarithm's derivative
    covariance = variance * inverse[np.ix_(order, order)] * np.outer(scale, scale)
    fit = PoseFit(
        camera=best.camera,
        residuals=best.residuals,
        used=best.used,
        covariance=covariance,
        pixel_deviation=math.sqrt(variance),
        ground=ground,
        alternatives=tuple(other.camera for other in others),
    )
    if above:  # a camera in the plane of the road, or kilometres away, sees all points on a line, or at one place
        height = float(best.camera.position[2] - points[:, 2].mean())
        off = math.sqrt(covariance[2, 2])
        if not off < _LOOSEST * height:
            raise ArgumentError(
                f"{name}: expected points that tell how high the camera is, but they leave it at {height:.3g} +- "
                f"{off:.2g} m; add points nearer and farther and beside each other, and check that pixels and points "
                "are not swapped"
            )
    if K is None and not fit.deviations["focal_length"] < 0.3 * best.camera.intrinsics[0, 0]:
        share = 100 * fit.deviations["focal_length"] / best.camera.intrinsics[0, 0]
        raise ArgumentError(
            f"{name}: expected points that tell the focal length, but they leave it within {share:.0f} %; add points "
            "farther away and nearer, or pass K"
        )
    return fit


def _moved(camera: Camera, column: int, size: float) -> Camera:
    """Return a camera moved along an axis, turned about one, or zoomed."""
    if column == 6:
        K = camera.intrinsics
        K[[0, 1], [0, 1]] += size
        return Camera(K, image_size=camera.image_size, camera_from_vehicle=camera.camera_from_vehicle, lens=camera.lens)
    pose, vector = camera.vehicle_from_camera, np.zeros(3)
    vector[column % 3] = size
    if column < 3:
        pose[:3, 3] += vector
    else:
        pose[:3, :3] = rodrigues(vector) @ pose[:3, :3]
    return camera.with_pose(np.linalg.inv(pose))


def _heights(road: Matrix, ground: Ground) -> Matrix:
    """Heights of the road at points (N, 2)."""
    if not isinstance(ground, (Plane, HeightMap)):
        return np.full(len(road), number_of("ground", ground, what=", metres, a Plane or a HeightMap"))
    heights = ground.height_at(road)
    if not np.isfinite(heights).all():
        x, y = road[int(np.argmin(np.isfinite(heights)))]
        raise ArgumentError(
            f"ground_points: expected points where the height map knows the road, got ({x:g}, {y:g}); leave it out"
        )
    return heights


def _check(name: str, pixels: Matrix, points: Matrix, fewest: int) -> None:
    if len(pixels) != len(points):
        raise ArgumentError(f"pixels, {name}: expected as many of both, got {len(pixels)} and {len(points)}")
    if len(points) < fewest:
        raise ArgumentError(f"{name}: expected at least {fewest} points, got {len(points)}; survey more")
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    if not spread[1] > _LEAST_SPREAD * spread[0]:
        raise ArgumentError(f"{name}: expected points that are not all on one line; survey some beside it")
