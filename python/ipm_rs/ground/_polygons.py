"""`Camera.project_polygon` and `Camera.ground_polygon`: areas between the road and the picture, closed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of, number_of
from ipm_rs._core import Camera, HeightMap, Plane
from ipm_rs.errors import ArgumentError, ArgumentTypeError
from ipm_rs.ground._clip import inside, inside_circle, inside_rectangle

__all__ = ["ground_polygon", "project_polygon"]

Points = NDArray[np.float64]

_NEAREST = 1e-6  # of the farthest vertex: nearer to a pinhole's own plane pixels lose their digits
_STEP = 0.02  # radians between the points of an edge behind a lens: a quarter of a pixel off with 5000 pixels a radian
_FARTHEST = 1e6  # pixels
_MOST = 100_000  # points of the edges of a polygon


def project_polygon(self: Camera, points: ArrayLike, *, ground: Any = None, margin: float = 0.0) -> Points:
    """Find the image of a polygon, clipped to the picture and closed.

    What lies behind the camera, above the horizon of a pinhole or outside the lens's domain is cut off, where
    `project` would give NaN; edges are bent as the lens bends them.

    Parameters
    ----------
    points : (N, 3) or (N, 2) array_like
        Vertices in the vehicle frame, metres, in order; the last is joined to the first. (N, 2) lie on `ground`.
    ground : float or Plane, optional
        Height or plane of (N, 2) points; 0 if not given.
    margin : float
        Pixels around the rectangle of pixel centres that are kept.

    Returns
    -------
    (M, 2) array, float64
        Pixels of the part that is seen; (0, 2) where nothing is. Parts that a concave polygon falls into are joined
        along the picture's edge, by lines that take no area: ``cv2.fillPoly`` fills what it should.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Fewer than three vertices, another shape, or numbers that are not finite.
    """
    ring = _ring("points", points, (2, 3))
    if ring.shape[1] == 2:
        plane = _plane(self, ground)
        ring = np.column_stack([ring, plane.height_at(ring)])
    elif ground is not None:
        raise ArgumentError("ground: expected None for (N, 3) points, which have their own height; pass (N, 2) with it")
    width, height = self.image_size
    grown = number_of("margin", margin)
    if not 0 <= grown <= 1e6:
        raise ArgumentError(f"margin: expected pixels from 0 to 1e6, got {grown:g}")
    pose = self.camera_from_vehicle
    seen = ring @ pose[:3, :3].T + pose[:3, 3]
    pixels = _flat(self, seen) if self.lens is None else _bent(self, seen)
    return inside_rectangle(pixels, (-grown, -grown), (width - 1 + grown, height - 1 + grown))


def ground_polygon(self: Camera, pixels: ArrayLike, *, ground: Any = None, max_distance: float = 200.0) -> Points:
    """Find the ground that a polygon of the picture shows, closed: what lies above the horizon is cut off.

    Parameters
    ----------
    pixels : (N, 2) array_like
        Vertices (u, v) in order; the last is joined to the first.
    ground : float or Plane, optional
        The road; 0 if not given.
    max_distance : float
        Metres from below the camera, level, at which it is cut: towards the horizon there is no end of it.

    Returns
    -------
    (M, 3) array, float64
        Vertices in the vehicle frame, metres; (0, 3) where no ground is seen.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Fewer than three vertices, another shape, or numbers that are not finite; a vertex that the lens has no ray for.
    """
    ring = _ring("pixels", pixels, (2,))
    reach = number_of("max_distance", max_distance)
    if not 0 < reach <= 1e6:
        raise ArgumentError(f"max_distance: expected metres above 0 and up to 1e6, got {reach:g}")
    plane = _plane(self, ground)
    if self.lens is not None:  # straight lines of the picture are bent on the road
        size = float(np.ptp(ring, axis=0).max())
        ring = _finer(ring, np.full(len(ring), max(size / 400, 1.0)))
    rays = self.unproject(ring)
    if np.isnan(rays).any():
        raise ArgumentError(
            f"pixels: expected pixels that the lens has a ray for, got {ring[np.isnan(rays[:, 0])][0].tolist()}; keep "
            "inside its image"
        )
    normal, (a, _, _) = plane.normal, plane.coefficients
    above = float(normal @ (self.position - [0, 0, a]))
    if above == 0:
        return np.empty((0, 3))
    downwards = rays @ normal * -np.sign(above)
    # a million times as far as the height is beyond every distance that is kept, or nearly level
    cut = inside(np.column_stack([rays, downwards]), downwards - 1e-9)
    if not len(cut):
        return np.empty((0, 3))
    reached = self.position + cut[:, :3] * (abs(above) / cut[:, 3:])
    flat = inside_circle(reached[:, :2], self.position[:2], reach)
    return np.column_stack([flat, plane.height_at(flat)]) if len(flat) else np.empty((0, 3))


def _ring(name: str, points: ArrayLike, columns: tuple[int, ...]) -> Points:
    ring = array_of(name, points)
    if ring.dtype.kind not in "iuf":
        raise ArgumentTypeError(f"{name}: expected numbers, got {ring.dtype}")
    if ring.ndim != 2 or ring.shape[1] not in columns or not 3 <= len(ring) <= _MOST:
        shapes = " or ".join(f"(N, {each})" for each in columns)
        raise ArgumentError(f"{name}: expected {shapes} vertices, from 3 to {_MOST}, got shape {ring.shape}")
    ring = ring.astype(np.float64)
    if not (np.abs(ring) <= 1e9).all():
        raise ArgumentError(f"{name}: expected finite numbers up to 1e9, got NaN, infinity or more")
    return ring


def _plane(camera: Camera, ground: Any) -> Plane:
    """Take `ground=` as a plane."""
    if isinstance(ground, Plane):
        return ground
    if isinstance(ground, HeightMap):
        raise ArgumentError(
            "ground: expected a height or a Plane, got a HeightMap, on which an area's outline alone does not say what "
            "is seen; project_polyline follows it"
        )
    return Plane.from_coefficients(0.0 if ground is None else number_of("ground", ground), 0.0, 0.0)


def _flat(camera: Camera, seen: Points) -> Points:
    """Project what lies before a pinhole; its edges stay straight."""
    near = _NEAREST * max(float(np.abs(seen).max()), 1e-3)
    seen = inside(seen, seen[:, 2] - near)
    image = np.maximum(seen[:, 2:], near) if len(seen) else seen[:, 2:]
    return (np.column_stack([seen[:, :2] / image, np.ones(len(seen))]) @ camera.intrinsics.T)[:, :2]


def _bent(camera: Camera, seen: Points) -> Points:
    """Project what lies in the lens's domain, edges in steps.

    On the plane where a direction lies at its angle from the axis, the domain is a circle, which is convex.
    """
    after = np.roll(seen, -1, axis=0)
    lengths = np.linalg.norm(after - seen, axis=1)
    with np.errstate(all="ignore"):
        # how near to the camera an edge comes, and so how wide it is seen at most
        part = np.clip(-(seen * (after - seen)).sum(axis=1) / lengths**2, 0, 1)
        nearest = np.linalg.norm(seen + np.nan_to_num(part)[:, np.newaxis] * (after - seen), axis=1)
    angles = np.minimum(lengths / np.maximum(nearest, 1e-12), math.pi * 50)
    fine = _finer(seen, np.where(angles > 0, lengths * _STEP / np.maximum(angles, _STEP), 1.0))
    across = np.hypot(fine[:, 0], fine[:, 1])
    angle = np.arctan2(across, fine[:, 2])
    with np.errstate(all="ignore"):
        plane = fine[:, :2] * np.where(across > 0, angle / across, 0.0)[:, np.newaxis]
    eye = camera.with_pose(np.eye(4))
    plane = inside_circle(plane, np.zeros(2), _end(eye))
    uv = eye.project(_rays(plane))[0]
    pixels: Points = uv[~np.isnan(uv[:, 0])]
    return pixels


def _rays(plane: Points) -> Points:
    """Turn points at their angle from the axis into directions."""
    angle = np.hypot(plane[:, 0], plane[:, 1])
    scale = np.sinc(angle / math.pi)  # sin(angle) / angle
    return np.column_stack([plane * scale[:, np.newaxis], np.cos(angle)])


def _end(eye: Camera) -> float:
    """Find the angle from the axis up to which a lens's image is one of this world.

    Some run off to 1e30 pixels before 90 degrees, where what is cut from their edges has no digits left.
    """
    last = min(eye.lens.max_angle, math.pi - 1e-6) * (1 - 1e-9) if eye.lens is not None else 0.0
    angles = last * (1 - np.append(np.geomspace(1, 1e-9, 400)[1:], 0))
    azimuths = np.arange(16) * (math.pi / 8)
    plane = angles[:, np.newaxis, np.newaxis] * np.stack([np.cos(azimuths), np.sin(azimuths)], axis=-1)
    uv = eye.project(_rays(plane.reshape(-1, 2)))[0].reshape(len(angles), -1)
    near = (np.abs(uv) < _FARTHEST).all(axis=1)
    return float(angles[-1] if near.all() else angles[max(int(np.argmin(near)) - 1, 0)])


def _finer(ring: Points, steps: Points) -> Points:
    """Put points between the vertices, no farther apart than the steps of each edge."""
    after = np.roll(ring, -1, axis=0)
    with np.errstate(all="ignore"):
        parts = np.ceil(np.linalg.norm(after - ring, axis=1) / steps)
    parts = np.clip(np.nan_to_num(parts, nan=1.0), 1, max(1, _MOST // len(ring))).astype(int)
    edges = [
        start + np.arange(count)[:, np.newaxis] / count * (end - start)
        for start, end, count in zip(ring, after, parts, strict=True)
    ]
    return np.concatenate(edges)
