"""Depth images to points, points to depth images, in plain NumPy.

:func:`decode_carla_depth`, :func:`points_from_depth` and :func:`nearest_points` are the definitions that the core is
tested against; :func:`depth_to_lidar` and :func:`depth_to_local_point_cloud` are two published functions, re-written.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "decode_carla_depth",
    "depth_to_lidar",
    "depth_to_local_point_cloud",
    "encode_carla_depth",
    "nearest_points",
    "points_from_depth",
]


def decode_carla_depth(image: ArrayLike, order: str, normalized: bool = False) -> NDArray[np.float64]:
    """CARLA's colour-coded depth: ``(R + 256 G + 65536 B) / (256^3 - 1)``, times 1000 m.

    Parameters
    ----------
    image : array_like, shape (H, W, 3) or (H, W, 4), uint8
        Colour-coded depth.
    order : {"bgra", "rgba", "bgr", "rgb"}
        What the channels are.
    normalized : bool
        0 to 1 instead of metres.

    Returns
    -------
    ndarray, shape (H, W), float64
    """
    channels = np.asarray(image).astype(np.int64)
    red, green, blue = (channels[..., order.index(name)] for name in "rgb")
    fraction: NDArray[np.float64] = (red + 256 * green + 65536 * blue) / (256**3 - 1)
    return fraction if normalized else fraction * 1000.0


def encode_carla_depth(depth: ArrayLike, order: str, normalized: bool = False) -> NDArray[np.uint8]:
    """Encode depth as the nearest colour code, the largest one for all beyond; alpha is 255.

    Parameters
    ----------
    depth : array_like, shape (H, W)
        Metres, or 0 to 1; at least 0.
    order : {"bgra", "rgba", "bgr", "rgb"}
        What the channels become.
    normalized : bool
        Whether `depth` is 0 to 1.

    Returns
    -------
    ndarray, shape (H, W, 3) or (H, W, 4), uint8
    """
    fraction = np.asarray(depth, dtype=np.float64) / (1.0 if normalized else 1000.0)
    code = np.round(np.minimum(fraction, 1.0) * (256**3 - 1)).astype(np.int64)
    parts = {"r": code % 256, "g": code // 256 % 256, "b": code // 65536, "a": np.full_like(code, 255)}
    return np.stack([parts[name] for name in order], axis=-1).astype(np.uint8)


def points_from_depth(
    depth: ArrayLike,
    K: ArrayLike,
    frame_from_camera: ArrayLike | None = None,
    kind: str = "z",
    min_depth: float = 0.0,
    max_depth: float = np.inf,
) -> NDArray[np.float64]:
    """Back-projects a depth image through a pinhole: ``K^-1 [u, v, 1]^T depth``.

    Parameters
    ----------
    depth : array_like, shape (H, W)
        Metres.
    K : array_like, shape (3, 3)
        Pinhole matrix, pixels counted from the centre of the top-left one.
    frame_from_camera : array_like, shape (4, 4), optional
        Pose of the optical frame in that of the result.
    kind : {"z", "ray"}
        Planar depth, or the distance along the ray.
    min_depth, max_depth : float
        What is kept, both included.

    Returns
    -------
    ndarray, shape (H, W, 3), float64
        NaN where depth is not positive, not finite or outside the limits.
    """
    depth = np.asarray(depth, dtype=np.float64)
    row, column = np.indices(depth.shape)
    homogeneous = np.stack([column, row, np.ones_like(row)], axis=-1)
    ray = homogeneous @ np.linalg.inv(np.asarray(K, dtype=np.float64)).T
    if kind == "ray":
        ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        kept = (depth > 0) & (depth >= min_depth) & (depth <= max_depth) & (depth < np.inf)
    points: NDArray[np.float64] = ray * np.where(kept, depth, np.nan)[..., np.newaxis]
    if frame_from_camera is None:
        return points
    pose = np.asarray(frame_from_camera, dtype=np.float64)
    moved: NDArray[np.float64] = points @ pose[:3, :3].T + pose[:3, 3]
    return moved


def nearest_points(
    uv: ArrayLike, depth: ArrayLike, image_size: tuple[int, int], radius: float = 0.0
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Z-buffer, point by point: each pixel takes the nearest point that falls on it, of equal ones the first.

    Parameters
    ----------
    uv : array_like, shape (N, 2)
        Pixels as :func:`project` gives them; NaN where a point has no image.
    depth : array_like, shape (N,)
        Metres; what is not positive and finite is left out. Compared in float32.
    image_size : (int, int)
        Width and height, pixels.
    radius : float
        A point covers the pixels whose centres lie within so many pixels of its own.

    Returns
    -------
    depth : ndarray, shape (H, W), float32
        NaN where there is none.
    index : ndarray, shape (H, W), int64
        Row of `uv`, -1 where there is none.
    """
    width, height = image_size
    nearest, index = np.full((height, width), np.inf, np.float32), np.full((height, width), -1, np.int64)
    reach = int(radius)
    around = range(-reach, reach + 1)
    steps = [(dx, dy) for dy in around for dx in around if dx * dx + dy * dy <= radius * radius]
    distances = np.asarray(depth, dtype=np.float64).astype(np.float32)
    for number, ((u, v), distance) in enumerate(zip(np.asarray(uv).tolist(), distances, strict=True)):
        if not (np.isfinite(u) and 0 < distance < np.inf):
            continue
        for dx, dy in steps:
            x, y = round(u) + dx, round(v) + dy  # halves to even
            if 0 <= x < width and 0 <= y < height and distance < nearest[y, x]:
                nearest[y, x], index[y, x] = distance, number
    nearest[index < 0] = np.nan
    return nearest, index


def depth_to_lidar(
    normalized_depth: ArrayLike, w: int, h: int, K: ArrayLike, max_depth: float = 0.9
) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Do what the published function of this name does, half a pixel off, but for its writing to the input.

    Parameters
    ----------
    normalized_depth : array_like, w * h numbers
        0 to 1; 1 is 1000 m.
    w, h : int
        Columns and rows.
    K : array_like, shape (3, 3)
        Intrinsic matrix, its principal point counted from the corner.
    max_depth : float
        Farther pixels become the point (0, 0, 0).

    Returns
    -------
    points : ndarray, shape (3, w * h), float64
        Rows forward, left, up.
    metres : ndarray, shape (h, w), dtype of the input
    """
    depth = np.array(normalized_depth).reshape(w * h)
    u = np.tile(np.arange(w - 1, -1, -1), h)
    v = np.repeat(np.arange(h - 1, -1, -1), w)
    far = depth > max_depth
    depth[far], u[far], v[far] = 0, 0, 0
    depth = depth * depth.dtype.type(1000)
    rays = np.linalg.inv(np.asarray(K, dtype=np.float64)) @ np.stack([u, v, np.ones_like(u)])
    left, up, forward = rays * depth
    return np.stack([forward, left, up]), depth.reshape(h, w)


def depth_to_local_point_cloud(normalized_depth: ArrayLike, fov: float, max_depth: float = 0.9) -> NDArray[np.float64]:
    """``depth_to_local_point_cloud`` of CARLA 0.8.4: half a pixel off as :func:`depth_to_lidar`.

    Parameters
    ----------
    normalized_depth : array_like, shape (h, w)
        0 to 1; 1 is 1000 m.
    fov : float
        Horizontal field of view, degrees.
    max_depth : float
        Farther pixels are left out.

    Returns
    -------
    ndarray, shape (N, 3), float64
        Left, up, forward.
    """
    depth = np.asarray(normalized_depth)
    h, w = depth.shape
    focal = w / (2.0 * np.tan(fov * np.pi / 360.0))
    K = np.array([[focal, 0.0, w / 2.0], [0.0, focal, h / 2.0], [0.0, 0.0, 1.0]])
    points, _ = depth_to_lidar(depth, w, h, K, np.inf)
    kept = ~(depth.ravel() > max_depth)
    return points[[1, 2, 0]].T[kept]
