"""Depth images to points, points to pixels, to what a camera sees, to a grid: answers first, then times.

Each job has its calls by library; the answer of each is checked against float64 before anything is timed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import ipm_rs
import rasters
from adapters import OURS, installed
from timing import interleaved

Call = Callable[[], Any]
WIDTH, HEIGHT = 1920, 1080
MAX_DEPTH = 900.0
COUNT = 1_000_000
K = np.array([[960.0, 0.0, 959.5], [0.0, 960.0, 539.5], [0.0, 0.0, 1.0]])
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(WIDTH, HEIGHT), position=(1.0, 0.0, 1.5), pitch=0.05)

BACK_PROJECT = f"decode and back-project {WIDTH} x {HEIGHT}"
PROJECT = "project a million points"
RENDER = f"z-buffer of a million points, {WIDTH} x {HEIGHT}"

BOUNDS = {
    "avx512": {(BACK_PROJECT, "1"): 8.0, (PROJECT, "1"): 4.0, (rasters.RASTERIZE, "1"): 4.0},
    "avx2": {(BACK_PROJECT, "1"): 4.8, (rasters.RASTERIZE, "1"): 5.0},
}
"""What this version set out to reach with these instruction sets: how many times faster than the fastest NumPy that
gives the right answer."""


def measure(threads: int, rounds: int, seconds: float) -> dict[str, dict[str, Any]]:
    """Check and time every job."""
    ipm_rs.set_num_threads(threads)
    results = {}
    jobs = {BACK_PROJECT: _back_project, PROJECT: _project, RENDER: _render, rasters.RASTERIZE: rasters.rasterize}
    for name, make in jobs.items():
        calls, wrong = make()
        rows: dict[str, Any] = {}
        for library, call in calls.items():
            error, tolerance = wrong(call())
            rows[library] = {"error": f"{error:.2g}", "agrees": error <= tolerance}
        if not rows[OURS]["agrees"]:
            raise SystemExit(f"{name}: ipm_rs is wrong by {rows[OURS]['error']}; nothing was timed")
        for library, times in interleaved(calls, min(rounds, 30), seconds).items():
            rows[library].update(times.as_dict())
        results[name] = rows
    return results


def _back_project() -> tuple[dict[str, Call], Callable[[Any], tuple[float, float]]]:
    """CARLA's BGRA to points of the optical frame, NaN beyond 900 m."""
    image = np.random.default_rng(7).integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8)
    exact = ipm_rs.reference.points_from_depth(
        ipm_rs.reference.decode_carla_depth(image, "bgra"), K, max_depth=MAX_DEPTH
    )
    weights = np.array([65536.0, 256.0, 1.0])
    across = ((np.arange(WIDTH) - K[0, 2]) / K[0, 0]).astype(np.float32)
    down = ((np.arange(HEIGHT) - K[1, 2]) / K[1, 1]).astype(np.float32)[:, None]
    row, column = np.indices((HEIGHT, WIDTH))
    rays = np.linalg.inv(K) @ np.stack([column.ravel(), row.ravel(), np.ones(row.size)])

    def ours() -> NDArray[np.float32]:
        return ipm_rs.points_from_depth(image, K, max_depth=MAX_DEPTH, order="bgra")

    def lean() -> NDArray[np.float32]:
        depth = image[..., :3].astype(np.float32) @ weights.astype(np.float32)
        depth *= np.float32(1000 / (256**3 - 1))
        depth[depth > MAX_DEPTH] = np.nan
        points = np.empty((HEIGHT, WIDTH, 3), np.float32)
        np.multiply(depth, across, out=points[..., 0])
        np.multiply(depth, down, out=points[..., 1])
        points[..., 2] = depth
        return points

    def usual() -> NDArray[np.float64]:
        depth = np.dot(image[..., :3].astype(np.float64), weights) / (256**3 - 1) * 1000
        depth[depth > MAX_DEPTH] = np.nan
        return (rays * depth.ravel()).T.reshape(HEIGHT, WIDTH, 3)

    calls: dict[str, Call] = {
        OURS: ours,
        "NumPy, rays by broadcasting, float32": lean,
        "NumPy, inv(K) @ [u, v, 1]": usual,
    }
    if (open3d := installed("open3d")) is not None:
        intrinsic = open3d.camera.PinholeCameraIntrinsic(WIDTH, HEIGHT, K[0, 0], K[1, 1], K[0, 2], K[1, 2])

        def theirs() -> NDArray[np.float64]:
            depth = open3d.geometry.Image(ipm_rs.decode_carla_depth(image))  # it has no decoder
            cloud = open3d.geometry.PointCloud.create_from_depth_image(
                depth, intrinsic, depth_scale=1.0, depth_trunc=MAX_DEPTH, project_valid_depth_only=False
            )
            return np.asarray(cloud.points).reshape(HEIGHT, WIDTH, 3)

        calls["Open3D create_from_depth_image"] = theirs

    def wrong(points: NDArray[Any]) -> tuple[float, float]:
        # a limit in float32 may fall to the other side
        both = np.isfinite(points) & np.isfinite(exact)
        assert both.sum() > 0.999 * np.isfinite(exact).sum()
        return float(np.abs(points - exact)[both].max()), 1e-3

    return calls, wrong


def _points() -> NDArray[np.float64]:
    return np.random.default_rng(8).normal(size=(COUNT, 3)) * (30, 20, 2)


def _numpy_project(points: NDArray[np.float64]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Pixels and depth, and nothing about what lies behind."""
    pose = CAMERA.camera_from_vehicle
    in_camera = points @ pose[:3, :3].T + pose[:3, 3]
    homogeneous = in_camera @ K.T
    return homogeneous[:, :2] / homogeneous[:, 2:], in_camera[:, 2]


def _project() -> tuple[dict[str, Call], Callable[[Any], tuple[float, float]]]:
    """Points all around to pixels; the NumPy beside it tells nothing of what has no image."""
    points = _points()
    pose = CAMERA.camera_from_vehicle
    turn = cv2.Rodrigues(pose[:3, :3])[0]
    exact, depth, _ = ipm_rs.reference.project(points, K, pose, (WIDTH, HEIGHT))
    front = depth > 0.1

    def with_validity() -> NDArray[np.float64]:
        uv, depth = _numpy_project(points)
        uv[depth <= 0] = np.nan
        _ = (uv >= 0).all(axis=1) & (uv[:, 0] <= WIDTH - 1) & (uv[:, 1] <= HEIGHT - 1)
        return uv

    calls: dict[str, Call] = {
        OURS: lambda: CAMERA.project(points)[0],
        "NumPy, pixels alone": lambda: _numpy_project(points)[0],
        "NumPy, with validity": with_validity,
        "OpenCV projectPoints": lambda: cv2.projectPoints(points, turn, pose[:3, 3], K, None)[0][:, 0],
    }
    return calls, lambda uv: (float(np.abs(uv - exact)[front].max()), 1e-6)


def _render() -> tuple[dict[str, Call], Callable[[Any], tuple[float, float]]]:
    """Find the nearest depth of each pixel and the number of its point."""
    points = _points()
    exact = CAMERA.project(points)
    pixel = np.rint(exact[0])
    seen = np.flatnonzero((pixel >= 0).all(1) & (pixel[:, 0] < WIDTH) & (pixel[:, 1] < HEIGHT))
    nearest = np.full(WIDTH * HEIGHT, np.inf)
    np.minimum.at(nearest, (pixel[seen, 1] * WIDTH + pixel[seen, 0]).astype(int), exact[1][seen])
    nearest = nearest.reshape(HEIGHT, WIDTH)

    def by_sorting() -> tuple[NDArray[Any], NDArray[Any]]:
        with np.errstate(all="ignore"):
            uv, z = _numpy_project(points)
            pixel = np.rint(uv)
        inside = (z > 0) & (pixel >= 0).all(1) & (pixel[:, 0] < WIDTH) & (pixel[:, 1] < HEIGHT)
        kept = np.flatnonzero(inside)
        kept = kept[np.argsort(-z[kept], kind="stable")]
        at = pixel[kept, 1].astype(np.intp) * WIDTH + pixel[kept, 0].astype(np.intp)
        depth, index = np.full(WIDTH * HEIGHT, np.nan, np.float32), np.full(WIDTH * HEIGHT, -1)
        depth[at], index[at] = z[kept], kept  # the last write, the nearest, stays
        return depth.reshape(HEIGHT, WIDTH), index.reshape(HEIGHT, WIDTH)

    def wrong(result: tuple[NDArray[Any], NDArray[Any]]) -> tuple[float, float]:
        depth, index = result
        assert np.array_equal(index >= 0, np.isfinite(nearest))
        return float(np.abs(depth - nearest)[index >= 0].max()), 1e-4

    return {OURS: lambda: ipm_rs.render_points(points, CAMERA), "NumPy, sorted by depth": by_sorting}, wrong
