"""One function per way of warping: it prepares everything that a user would prepare once, and returns the call to time.

An adapter returns None for a job that its library cannot do. Results are written into memory that is allocated
beforehand wherever the library takes it; nobody is charged for a conversion that a pipeline would not need.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType

import cv2
import numpy as np
from numpy.typing import NDArray

import ipm_rs
from jobs import JOBS, Job, Scene, X, Y

Call = Callable[[], NDArray[np.generic]]
Adapter = Callable[[Scene, Job, NDArray[np.generic], int], Call | None]


def installed(name: str) -> ModuleType | None:
    """Import an optional library, or return None."""
    try:
        return import_module(name)
    except ImportError:
        return None


def _out(scene: Scene, job: Job) -> NDArray[np.generic]:
    return np.zeros((*scene.shape, *job.shape_suffix), job.dtype)


def _dsize(scene: Scene) -> tuple[int, int]:
    return scene.shape[1], scene.shape[0]


def _cv2_flag(job: Job) -> int:
    return cv2.INTER_LINEAR if job.interpolation == "bilinear" else cv2.INTER_NEAREST


# ---------------------------------------------------------------- warping


def ipm(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call:
    out = _out(scene, job)
    return lambda: scene.lut.warp(image, interpolation=job.interpolation, out=out, threads=threads)


def ipm_remap(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call | None:
    if not hasattr(ipm_rs, "remap"):
        return None
    map_x, map_y = scene.maps
    options = {"interpolation": job.interpolation, "out": _out(scene, job), "threads": threads}
    return lambda: ipm_rs.remap(image, map_x, map_y, **options)


def ipm_warp_perspective(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call | None:
    if not hasattr(ipm_rs, "warp_perspective"):
        return None
    options = {"interpolation": job.interpolation, "out": _out(scene, job), "threads": threads}
    return lambda: ipm_rs.warp_perspective(image, scene.homography, _dsize(scene), inverse_map=True, **options)


def cv2_remap(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call:
    map_x, map_y = scene.maps
    flag, out = _cv2_flag(job), _out(scene, job)
    return lambda: cv2.remap(image, map_x, map_y, flag, dst=out)


def cv2_remap_fixed(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call:
    fixed = cv2.convertMaps(*scene.maps, cv2.CV_16SC2, nninterpolation=job.interpolation == "nearest")
    flag, out = _cv2_flag(job), _out(scene, job)
    return lambda: cv2.remap(image, fixed[0], fixed[1], flag, dst=out)


def cv2_warp_perspective(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call:
    matrix, size, out = scene.homography, _dsize(scene), _out(scene, job)
    flags = _cv2_flag(job) | cv2.WARP_INVERSE_MAP
    return lambda: cv2.warpPerspective(image, matrix, size, dst=out, flags=flags)


def numpy_reference(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call | None:
    if threads > 1:
        return None  # it has no threads
    map_x, map_y = scene.uv
    remap = getattr(ipm_rs.reference, f"remap_{job.interpolation}")
    return lambda: remap(image, map_x, map_y)


def kornia_rs(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call | None:
    library = installed("kornia_rs.imgproc")
    if library is None or job.dtype != "uint8" or job.channels != 3:
        return None
    # Source -> output; threads come from RAYON_NUM_THREADS, which peers.py sets.
    matrix = tuple(np.linalg.inv(scene.homography).ravel())
    return lambda: library.warp_perspective(image, matrix, scene.shape, job.interpolation)


def torch_grid_sample(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call | None:
    torch = installed("torch")
    if torch is None or job.dtype != "float32":
        return None
    torch.set_num_threads(threads)
    planes = image.reshape(*image.shape[:2], job.channels).transpose(2, 0, 1)
    source = torch.from_numpy(np.ascontiguousarray(planes))[None]
    size = np.array(scene.source_size, dtype=np.float64)
    normalised = 2 * np.stack(scene.uv, axis=-1) / (size - 1) - 1
    grid = torch.from_numpy(normalised.astype(np.float32))[None]
    sample = torch.nn.functional.grid_sample
    options = {"mode": job.interpolation, "padding_mode": "zeros", "align_corners": True}
    # The result stays in (channels, rows, columns) while it is timed; the transposed view costs nothing.
    shape = (*scene.shape, *job.shape_suffix)
    return lambda: sample(source, grid, **options)[0].permute(1, 2, 0).numpy().reshape(shape)


def scipy_map_coordinates(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call | None:
    ndimage = installed("scipy.ndimage")
    if ndimage is None or threads > 1:
        return None
    coordinates = np.stack(scene.uv[::-1])
    order = 1 if job.interpolation == "bilinear" else 0
    if job.channels == 1:
        out = _out(scene, job)
        return lambda: ndimage.map_coordinates(image, coordinates, out, order=order, prefilter=False)
    planes = [np.ascontiguousarray(image[..., channel]) for channel in range(job.channels)]
    outs = np.zeros((job.channels, *scene.shape), job.dtype)

    def call() -> NDArray[np.generic]:
        for plane, out in zip(planes, outs, strict=True):
            ndimage.map_coordinates(plane, coordinates, out, order=order, prefilter=False)
        return outs.transpose(1, 2, 0)

    return call


def skimage_warp(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call | None:
    transform = installed("skimage.transform")
    if transform is None or threads > 1:
        return None
    options = {"output_shape": scene.shape, "order": 1 if job.interpolation == "bilinear" else 0}
    return lambda: transform.warp(image, scene.homography, preserve_range=True, clip=False, **options)


def pillow_transform(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call | None:
    library = installed("PIL.Image")
    if library is None or threads > 1 or job.dtype != "uint8":
        return None
    # Pillow counts pixels from their corners: shift by half a pixel on both sides.
    half = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
    matrix = half @ scene.homography @ np.linalg.inv(half)
    data = tuple((matrix / matrix[2, 2]).ravel()[:8])
    filters = library.Resampling
    resample = filters.BILINEAR if job.interpolation == "bilinear" else filters.NEAREST
    source, size, method = library.fromarray(image), _dsize(scene), library.Transform.PERSPECTIVE
    return lambda: np.asarray(source.transform(size, method, data, resample))


OURS = "ipm_rs"
OURS_REMAP, OURS_PERSPECTIVE = "ipm_rs remap, no table", "ipm_rs warp_perspective, no table"
WARPS: dict[str, Adapter] = {
    OURS: ipm,
    OURS_REMAP: ipm_remap,
    OURS_PERSPECTIVE: ipm_warp_perspective,
    "OpenCV remap, float32 maps": cv2_remap,
    "OpenCV remap, CV_16SC2 maps": cv2_remap_fixed,
    "OpenCV warpPerspective": cv2_warp_perspective,
    "kornia-rs warp_perspective": kornia_rs,
    "torch grid_sample": torch_grid_sample,
    "Pillow transform": pillow_transform,
    "scikit-image warp": skimage_warp,
    "SciPy map_coordinates": scipy_map_coordinates,
    "NumPy, ipm_rs.reference": numpy_reference,
}

# ---------------------------------------------------------------- building the table
# Each call goes from the calibration to float32 maps (or to what else a library warps with). The maps of the general
# libraries hold no validity: they continue behind the camera.

Build = Callable[[], tuple[NDArray[np.generic], NDArray[np.generic]] | None]


def build_ipm(scene: Scene, threads: int) -> Build:
    ipm_rs.set_num_threads(threads)

    def call() -> None:
        ipm_rs.Lut(scene.camera, scene.grid)

    return call


def build_numpy(scene: Scene, threads: int) -> Build | None:
    if threads > 1:
        return None
    camera, reference = scene.camera, ipm_rs.reference

    def call() -> tuple[NDArray[np.generic], NDArray[np.generic]]:
        xy = reference.grid_xy(X, Y, scene.resolution, "corner")
        return reference.maps(camera.intrinsics, camera.camera_from_vehicle, camera.image_size, xy)

    return call


def build_cv2_perspective(scene: Scene, threads: int) -> Build:
    rows, columns = scene.shape

    def call() -> tuple[NDArray[np.generic], NDArray[np.generic]]:
        cells = np.empty((rows, columns, 2), np.float32)
        cells[..., 0] = np.arange(columns)
        cells[..., 1] = np.arange(rows)[:, None]
        return cv2.split(cv2.perspectiveTransform(cells, scene.homography))

    return call


def build_cv2_rectify(scene: Scene, threads: int) -> Build:
    camera, no_lens, no_rotation = scene.camera.intrinsics, np.zeros(4), np.eye(3)

    def call() -> tuple[NDArray[np.generic], NDArray[np.generic]]:
        # Its "new camera matrix" may be any homography: this one makes the maps those of the ground plane.
        new = np.linalg.inv(np.linalg.inv(camera) @ scene.homography)
        return cv2.initUndistortRectifyMap(camera, no_lens, no_rotation, new, _dsize(scene), cv2.CV_32FC1)

    return call


def build_cv2_warp(scene: Scene, threads: int) -> Build:
    """No build: one warp of uint8 x 3 that needs none, to show what a build may cost."""
    job = JOBS[0]
    warp = cv2_warp_perspective(scene, job, scene.image(job), threads)

    def call() -> None:
        warp()

    return call


def build_cv2_homography(scene: Scene, threads: int) -> Build:
    rows, columns = scene.shape
    cells = np.array([[0, 0], [columns - 1, 0], [columns - 1, rows - 1], [0, rows - 1]], np.float32)
    pixels = cv2.perspectiveTransform(cells[None], scene.homography)[0]

    def call() -> None:
        cv2.getPerspectiveTransform(cells, pixels)

    return call


BUILDS = {
    OURS: build_ipm,
    "OpenCV warpPerspective of one frame": build_cv2_warp,
    "OpenCV initUndistortRectifyMap": build_cv2_rectify,
    "OpenCV perspectiveTransform of the cells": build_cv2_perspective,
    "OpenCV getPerspectiveTransform (no table)": build_cv2_homography,
    "NumPy, ipm_rs.reference": build_numpy,
}


def build_lens_ipm(scene: Scene, camera: ipm_rs.Camera, threads: int) -> Build:
    ipm_rs.set_num_threads(threads)

    def call() -> None:
        ipm_rs.Lut(camera, scene.grid)

    return call


def build_lens_cv2(scene: Scene, camera: ipm_rs.Camera, threads: int) -> Build:
    K, no_rotation, size = camera.intrinsics, np.eye(3), _dsize(scene)
    # OpenCV's best route: its "new camera matrix" may be any homography, so one call goes straight to the road.
    new = np.linalg.inv(np.linalg.inv(K) @ scene.homography)
    coefficients = np.array(camera.lens.coefficients)
    fisheye = isinstance(camera.lens, ipm_rs.KannalaBrandt)
    rectify = cv2.fisheye.initUndistortRectifyMap if fisheye else cv2.initUndistortRectifyMap
    return lambda: rectify(K, coefficients, no_rotation, new, size, cv2.CV_32FC1)


LENS_BUILDS = {OURS: build_lens_ipm, "OpenCV initUndistortRectifyMap": build_lens_cv2}

# ---------------------------------------------------------------- a new pose for every frame
# From a pose to a bird's-eye view of uint8 x 3: what a table costs that is used once, and the ways without one.


def frame_ipm(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call:
    ipm_rs.set_num_threads(threads)
    out = _out(scene, job)
    return lambda: ipm_rs.Lut(scene.camera, scene.grid).warp(image, out=out)


def frame_cv2_rectify(scene: Scene, job: Job, image: NDArray[np.generic], threads: int) -> Call:
    maps, flag, out = build_cv2_rectify(scene, threads), _cv2_flag(job), _out(scene, job)
    return lambda: cv2.remap(image, *maps(), flag, dst=out)


FRAMES: dict[str, Adapter] = {
    OURS: frame_ipm,
    OURS_PERSPECTIVE: ipm_warp_perspective,
    "OpenCV warpPerspective": cv2_warp_perspective,
    "OpenCV initUndistortRectifyMap and remap": frame_cv2_rectify,
}
