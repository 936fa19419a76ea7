"""Poses from lines on the road, the horizon, a known width and a known way: what one or two pictures tell by hand.

Everything works on the rays of the pixels, so through any lens. The direction of a family of parallels is the one that
lies in the planes of all their lines (the least singular vector of the planes' normals; Hartley and Zisserman, section
8.6); the horizon's plane is likewise that of its rays. Lengths on the road grow with the height of the camera, so one
known length gives the height.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import number_of
from ipm_rs._core import Camera
from ipm_rs.errors import ArgumentError
from ipm_rs.refine._inputs import camera_of, guarded, numbers_of

__all__ = ["from_lines", "height_from_travel", "height_from_width"]

Matrix = NDArray[np.float64]

_APART = math.radians(15.0)
"""Marks that contradict each other by more than this are of something else. A pixel of noise puts lines across the
road, five metres long and 8 to 14 m away, up to 10 degrees off."""
_SHORTEST = 1e-6
"""Rays closer together than this, radians, make no line: 2 mm of a pixel of a usual camera."""


@guarded
def from_lines(
    camera: Camera, along: ArrayLike | None = None, *, across: ArrayLike | None = None, horizon: ArrayLike | None = None
) -> Camera:
    """Turn a camera so that lines on a level road lead where they should.

    Lines along the road (lane markings, kerbs) alone give pitch and yaw; with lines across it (stop lines, the edges of
    a crossing) or the horizon, roll too. The horizon alone gives roll and pitch. What they do not give stays, and so
    does the position.

    Parameters
    ----------
    camera : Camera
        Its lens, and about where it looks: which of the two ways along a line is forward, and what is up.
    along : (N, 2, 2) array_like, optional
        Two or more lines that are parallel to the vehicle's x axis, each by two pixels (u, v) of the raw picture, far
        apart.
    across : (N, 2, 2) array_like, optional
        Two or more lines on the road at right angles to these.
    horizon : (N, 2) array_like, optional
        Two or more pixels of the far level horizon (of the sea or a plain; hills stand above it).

    Returns
    -------
    Camera
        At the same place, turned.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Neither `along` nor `horizon`, fewer than two lines or pixels, both ends of one in the same place, pixels that
        the lens does not see, lines that are all one, or that contradict each other by more than 15 degrees.
    CalibrationError
        A number is not finite.
    """
    camera_of("camera", camera)
    if along is None and horizon is None:
        raise ArgumentError("along: expected lines along the road, or horizon= pixels of the horizon, got neither")
    if across is not None and along is None:
        raise ArgumentError("across: expected lines along the road beside those across it, got along=None; mark both")
    before = camera.camera_from_vehicle[:3, :3]  # columns: the vehicle's axes as the camera sees them
    forward, up = before[:, 0], before[:, 2]
    if along is not None:
        forward = _direction("along", camera, along, forward)
    if horizon is not None:
        up = _normal_of(_rays("horizon", camera, numbers_of("horizon", horizon, (None, 2), "pixels (u, v)")), up)
    elif across is not None:
        left = _direction("across", camera, across, before[:, 1])
        _check_square("across", left, forward, "the lines along the road")
        up = np.cross(forward, left)
    else:  # no turn about the lines themselves
        up = _turned(before[:, 0], forward) @ up
    if along is not None and horizon is not None:
        _check_square("horizon", up, forward, "straight up from the lines along the road")
    up = up / np.linalg.norm(up)
    forward = forward - (forward @ up) * up
    forward /= np.linalg.norm(forward)
    after = np.stack([forward, np.cross(up, forward), up], axis=1)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = after, -after @ camera.position
    return camera.with_pose(pose)


@guarded
def height_from_width(
    camera: Camera, left: ArrayLike, right: ArrayLike, width: float, *, ground: float = 0.0
) -> Camera:
    """Put a camera at the height at which two parallel lines on the road are a known width apart.

    A lane between its markings (3.75 m on many European motorways, 3.66 m in America), the track of a car's wheels, a
    crossing. The camera's rotation must be right: see `from_lines`.

    Parameters
    ----------
    camera : Camera
        Its rotation and lens; where it is but for its height.
    left, right : (N, 2) array_like
        Two or more pixels (u, v) of either line, of any part of it.
    width : float
        Metres from the one to the other, at right angles; of markings from middle to middle, or from the same edge.
    ground : float
        z of the road in the vehicle frame, metres.

    Returns
    -------
    Camera
        Higher or lower.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Fewer than two pixels of a line, pixels that do not see the road below the camera, lines that are one or are not
        parallel to 15 degrees, a width that is not positive.
    CalibrationError
        A number is not finite.
    """
    camera_of("camera", camera)
    apart = number_of("width", width, low=0.0, what=", metres")
    level = number_of("ground", ground, what=", metres")
    lines = [_on_road(name, camera, pixels) for name, pixels in (("left", left), ("right", right))]
    ways = []
    for name, points in zip(("left", "right"), lines, strict=True):
        spread = points - points.mean(axis=0)
        sizes, way = np.linalg.svd(spread, full_matrices=False)[1:]
        if not sizes[0] > 1e-6 * np.abs(points).max():
            raise ArgumentError(
                f"{name}: expected pixels along a line, got all in one place; mark two that are far apart"
            )
        ways.append(way[0])
    if abs(ways[0] @ ways[1]) < math.cos(_APART):
        angle = math.degrees(math.acos(min(1.0, abs(float(ways[0] @ ways[1])))))
        raise ArgumentError(
            f"right: expected a line parallel to left, got one at {angle:.1f} deg to it on the road; mark the same "
            "lane's, or mend the camera's pitch and roll first (from_lines)"
        )
    ways[1] *= math.copysign(1.0, ways[0] @ ways[1])
    way = (ways[0] + ways[1]) / np.linalg.norm(ways[0] + ways[1])
    between = lines[1].mean(axis=0) - lines[0].mean(axis=0)
    unit = abs(float(way[0] * between[1] - way[1] * between[0]))
    if not unit > 1e-3:
        raise ArgumentError("right: expected another line than left, got the same; mark the other side of the lane")
    return _at_height(camera, apart / unit, level)


@guarded
def height_from_travel(
    camera: Camera, before: ArrayLike, after: ArrayLike, distance: float, *, ground: float = 0.0
) -> Camera:
    """Put a camera at the height at which marks on the road came nearer by the distance that was driven.

    Two pictures, the same spots of the road clicked in both, and how far the vehicle drove straight ahead in between:
    its speed by the time between them. The camera's rotation must be right: see `from_lines`; `from_drive` finds all of
    it from many pictures.

    Parameters
    ----------
    camera : Camera
        Its rotation and lens; where it is but for its height.
    before, after : (N, 2) array_like
        Pixels (u, v) of one or more spots of the road, in the first picture and in the second; of several the median
        counts.
    distance : float
        Metres driven between the pictures, along the vehicle's x axis; negative backward.
    ground : float
        z of the road in the vehicle frame, metres.

    Returns
    -------
    Camera
        Higher or lower.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Other numbers of pixels in the two pictures, pixels that do not see the road below the camera, spots that did
        not move along the vehicle's x axis, to 15 degrees in the median, or moved the wrong way, no distance.
    CalibrationError
        A number is not finite.
    """
    camera_of("camera", camera)
    driven = number_of("distance", distance, what=", metres")
    level = number_of("ground", ground, what=", metres")
    if driven == 0.0:
        raise ArgumentError("distance: expected metres that were driven, got 0; take pictures that are apart")
    first, second = _on_road("before", camera, before, least=1), _on_road("after", camera, after, least=1)
    if len(first) != len(second):
        raise ArgumentError(
            f"after: expected as many pixels as before, {len(first)}, got {len(second)}; give one for each spot"
        )
    moved = first - second
    x, y = float(np.median(moved[:, 0])), float(np.median(moved[:, 1]))
    if abs(y) > math.tan(_APART) * abs(x):
        raise ArgumentError(
            "after: expected spots that move along the vehicle's x axis, got some that move at "
            f"{math.degrees(math.atan2(abs(y), abs(x))):.0f} deg to it; drive straight, or mend the yaw (from_lines)"
        )
    if not x * driven > 0.0:
        came, way = ("nearer", "forward") if x > 0 else ("away", "backward")
        raise ArgumentError(
            f"distance: expected one {way}, as the spots came {came}, got {driven:g}; swap the pictures"
        )
    return _at_height(camera, driven / x, level)


def _rays(name: str, camera: Camera, pixels: Matrix) -> Matrix:
    """Return the directions in which pixels look, of length 1, in the camera's optical axes."""
    if len(pixels) < 2:
        raise ArgumentError(f"{name}: expected two pixels or more, got {len(pixels)}; mark more, far apart")
    rays: Matrix = camera.unproject(pixels) @ camera.camera_from_vehicle[:3, :3].T
    lost = np.flatnonzero(~np.isfinite(rays).all(axis=1))
    if len(lost):
        u, v = pixels[lost[0]]
        raise ArgumentError(f"{name}: expected pixels that the lens sees, got ({u:g}, {v:g}); mark others")
    return rays


def _direction(name: str, camera: Camera, lines: Any, near: Matrix) -> Matrix:
    """Return the direction that parallel lines have, that way of the two which is nearer to another."""
    marks = numbers_of(name, lines, (None, 2, 2), "two pixels (u, v) of each line")
    if len(marks) < 2:
        raise ArgumentError(f"{name}: expected two lines or more, got {len(marks)}; one does not tell where it leads")
    ends = _rays(name, camera, marks.reshape(-1, 2)).reshape(-1, 2, 3)
    planes = np.cross(ends[:, 0], ends[:, 1])
    lengths = np.linalg.norm(planes, axis=1)
    if not (lengths > _SHORTEST).all():
        index = int(np.argmin(lengths))
        raise ArgumentError(f"{name}[{index}]: expected two pixels of a line, got the same twice; mark two far apart")
    sizes, ways = np.linalg.svd(planes / lengths[:, None])[1:]
    if not sizes[1] > 1e-6:
        raise ArgumentError(f"{name}: expected several lines, got the same one again; mark lines beside each other")
    return ways[2] * math.copysign(1.0, ways[2] @ near)


def _normal_of(rays: Matrix, near: Matrix) -> Matrix:
    """Return the normal of the plane of rays, on that side which is nearer to another."""
    sizes, ways = np.linalg.svd(rays, full_matrices=len(rays) < 3)[1:]
    if not sizes[1] > _SHORTEST:
        raise ArgumentError("horizon: expected pixels apart from each other, got all in one place; mark its two ends")
    return ways[2] * math.copysign(1.0, ways[2] @ near)


def _check_square(name: str, one: Matrix, other: Matrix, what: str) -> None:
    off = math.degrees(math.asin(min(1.0, abs(float(one @ other)))))
    if off > math.degrees(_APART):
        raise ArgumentError(
            f"{name}: expected them at right angles to each other, got {off:.1f} deg beside {what}; check the marks, "
            "and the camera's K and lens"
        )


def _turned(one: Matrix, other: Matrix) -> Matrix:
    """Return the smallest turn that takes a direction to another (Rodrigues)."""
    axis, cos = np.cross(one, other), float(one @ other)
    if cos < -1.0 + 1e-12:
        raise ArgumentError(
            "along: expected lines about where the camera looks, got ones behind it; give its pose first"
        )
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + cos)


def _on_road(name: str, camera: Camera, pixels: Any, least: int = 2) -> Matrix:
    """Return where pixels see the road, (x, y) from below the camera in heights of it."""
    marks = numbers_of(name, pixels, (None, 2), "pixels (u, v)")
    if len(marks) < least:
        raise ArgumentError(f"{name}: expected {least} pixels or more, got {len(marks)}; mark more")
    rays = _rays(name, camera, np.concatenate([marks, marks[:1]]))[:-1] @ camera.camera_from_vehicle[:3, :3]
    above = np.flatnonzero(~(rays[:, 2] < -1e-6))
    if len(above):
        u, v = marks[above[0]]
        raise ArgumentError(
            f"{name}: expected pixels of the road, got ({u:g}, {v:g}) on the horizon or above it; mark nearer ones, or "
            "mend the camera's pitch first (from_lines)"
        )
    return rays[:, :2] / -rays[:, 2:]


def _at_height(camera: Camera, height: float, level: float) -> Camera:
    pose = camera.vehicle_from_camera
    pose[2, 3] = level + height
    return camera.with_pose(np.linalg.inv(pose))
