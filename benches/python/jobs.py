"""What is measured: one real geometry in three sizes, textured images, the jobs, and the exact answer to each.

The geometry is the "seed job": a Cityscapes camera (2048 x 1024) and the road from 7 to 50 m ahead and 10 m to either
side, in 860 x 800 cells of 5 x 2.5 cm sampled at their corners. The same view is there as 2000 x 2000 cells from a
camera of 3840 x 2160, and as 64 x 64 cells from 64 x 64 pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ipm_rs

CALIBRATION = {
    "extrinsic": {"x": 1.7, "y": 0.02624, "z": 1.2124, "roll": 0.0, "pitch": 0.0384256, "yaw": -0.0097268},
    "intrinsic": {"fx": 2263.54773399985, "fy": 2250.3728170599807, "u0": 1079.0175620000632, "v0": 515.006600600019},
}
X, Y = (7, 50), (-10, 10)


@dataclass(frozen=True)
class Job:
    """One kind of image under one interpolation, and how far from the exact answer a result may be."""

    name: str
    dtype: str
    channels: int
    interpolation: str
    tolerance: float  # bilinear: largest difference, in units of the image; nearest: largest share of other pixels
    scene: str = "seed"

    @property
    def shape_suffix(self) -> tuple[int, ...]:
        """The channel axis, which images of one channel do not have."""
        return () if self.channels == 1 else (self.channels,)


JOBS = (
    Job("uint8 x 3, bilinear", "uint8", 3, "bilinear", 1.0),
    Job("uint8 x 1, bilinear", "uint8", 1, "bilinear", 1.0),
    Job("uint16 x 1, bilinear", "uint16", 1, "bilinear", 64.0),
    Job("uint16 x 3, bilinear", "uint16", 3, "bilinear", 64.0),
    Job("float32 x 1, bilinear", "float32", 1, "bilinear", 0.25),
    Job("float32 x 3, bilinear", "float32", 3, "bilinear", 0.25),
    Job("float32 x 16, bilinear", "float32", 16, "bilinear", 0.25),
    Job("uint8 x 3, nearest", "uint8", 3, "nearest", 0.001),
    Job("uint8 x 1, nearest", "uint8", 1, "nearest", 0.001),
    Job("uint8 x 3, bilinear, 3840 x 2160 to 2000 x 2000", "uint8", 3, "bilinear", 1.0, "large"),
    Job("uint8 x 3, bilinear, 64 x 64 to 64 x 64", "uint8", 3, "bilinear", 1.0, "small"),
)
"""Images span 0..255, uint16 spans 0..65535, so the bilinear tolerances are 1, 1, 1/4 and 1/4 of a grey level in 256.

They leave room for coordinates in float32 (about 1e-4 px, which noise of full contrast turns into 0.03 levels), not
for coordinates in steps of 1/32 px. Under nearest, the same coordinates may flip a pixel whose position is a near tie.
"""


LENSES = {
    "Brown-Conrady, 5 coefficients": ipm_rs.BrownConrady([-0.3, 0.12, 1e-3, -5e-4, -0.02]),
    "equidistant": ipm_rs.KannalaBrandt([0.02, -0.01, 0.003, -0.0005]),
}
"""Lenses to put before the seed job's camera, each of a model that OpenCV has too."""


def bilinear(image: NDArray[np.generic], u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sample the image in float64 at points that lie inside it, from the definition."""
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    a, b = ((part - whole).reshape(*u.shape, *(1,) * (image.ndim - 2)) for part, whole in ((u, column), (v, row)))
    top = image[row, column] * (1 - a) + image[row, column + 1] * a
    bottom = image[row + 1, column] * (1 - a) + image[row + 1, column + 1] * a
    return top * (1 - b) + bottom * b


class Scene:
    """Camera, grid and coordinates, in every form that some library wants. Nothing here is timed.

    With `cell`, the seed job in cells of so many metres along x and y, which are sampled at their centres.
    """

    def __init__(self, name: str = "seed", cell: tuple[float, float] | None = None) -> None:
        camera = ipm_rs.Camera.from_cityscapes(CALIBRATION)
        if name == "large":
            intrinsics = np.diag([1.875, 1.875, 1.0]) @ camera.intrinsics
            camera = ipm_rs.Camera(intrinsics, image_size=(3840, 2160), camera_from_vehicle=camera.camera_from_vehicle)
        elif name == "small":
            camera = camera.resized(64, 64)
        rows, columns = {"seed": (860, 800), "large": (2000, 2000), "small": (64, 64)}[name]
        self.camera = camera
        self.resolution = cell or ((X[1] - X[0]) / rows, (Y[1] - Y[0]) / columns)
        sample_at = "center" if cell else "corner"
        self.grid = ipm_rs.BevGrid(x=X, y=Y, resolution=self.resolution, sample_at=sample_at)

    @cached_property
    def lut(self) -> ipm_rs.Lut:
        """The table."""
        return ipm_rs.Lut(self.camera, self.grid)

    @property
    def source_size(self) -> tuple[int, int]:
        """Width and height of the image, pixels."""
        return self.camera.image_size

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the bird's-eye view."""
        return self.grid.shape

    @cached_property
    def homography(self) -> NDArray[np.float64]:
        """Output pixel (column, row, 1) -> source pixel, scaled so that the last entry is 1."""
        dx, dy = self.resolution
        into_cell = 0.5 if self.grid.sample_at == "center" else 0.0
        x, y = X[1] - into_cell * dx, Y[1] - into_cell * dy  # of the first sample
        ground_from_cell = np.array([[0.0, -dx, x], [-dy, 0.0, y], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        matrix = self.camera.intrinsics @ self.camera.camera_from_vehicle[:3] @ ground_from_cell
        return matrix / matrix[2, 2]

    @cached_property
    def uv(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Source coordinates of every cell in float64; this camera has the whole grid in front of it."""
        rows, columns = self.shape
        return self.project(np.arange(columns), np.arange(rows)[:, None])

    def project(self, column: NDArray[Any], row: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Source coordinates of places in the grid, whole numbers being the samples of its cells."""
        u, v, w = (a * column + b * row + c for a, b, c in self.homography)
        return u / w, v / w

    def through(self, lens: object) -> tuple[ipm_rs.Camera, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Put a lens before the camera: the camera, and the exact coordinates of its cells from the NumPy reference."""
        camera, reference = self.camera, ipm_rs.reference
        pose = camera.camera_from_vehicle
        camera = ipm_rs.Camera(camera.intrinsics, image_size=camera.image_size, camera_from_vehicle=pose, lens=lens)
        xy = reference.grid_xy(X, Y, self.resolution, "corner")
        return camera, reference.maps(camera.intrinsics, pose, camera.image_size, xy, lens=lens)

    @cached_property
    def maps(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The same in float32, as `cv2.remap` takes them."""
        u, v = self.uv
        return u.astype(np.float32), v.astype(np.float32)

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """Cells that every library must agree about: inside the image by more than the error of float32 coordinates."""
        (u, v), (width, height), margin = self.uv, self.source_size, 1e-2
        return (u > margin) & (u < width - 1 - margin) & (v > margin) & (v < height - 1 - margin)

    def image(self, job: Job) -> NDArray[np.generic]:
        """Texture with a fixed seed: stripes and a gradient, so that structure can move, and noise on every pixel."""
        width, height = self.source_size
        column, row = np.arange(width), np.arange(height)[:, None]
        structure = 40 * ((column // 23 + row // 17) % 2) + 30 * column / width + 25 * row / height  # 0 to 95
        noise = np.random.default_rng(20240229).integers(0, 161, (height, width, *job.shape_suffix))
        grey = structure.reshape(height, width, *(1 for _ in job.shape_suffix)) + noise
        if job.dtype == "uint16":
            grey = grey * 257
        return np.ascontiguousarray(grey.astype(job.dtype))

    def exact(self, job: Job, image: NDArray[np.generic]) -> NDArray[np.float64]:
        """Compute the answer in float64 at the cells of `inside`, from the definition and nobody's table."""
        u, v = (coordinate[self.inside] for coordinate in self.uv)
        if job.interpolation == "nearest":
            return image[np.rint(v).astype(int), np.rint(u).astype(int)].astype(np.float64)
        return bilinear(image, u, v)

    def error(self, job: Job, exact: NDArray[np.float64], answer: NDArray[np.generic]) -> float:
        """How far `answer` is from `exact`: the largest difference, or under nearest the share of other pixels."""
        expected = (*self.shape, *job.shape_suffix)
        if answer.shape != expected:
            raise ValueError(f"expected a result of shape {expected}, got {answer.shape}")
        difference = np.abs(answer[self.inside].astype(np.float64) - exact)
        if job.interpolation == "nearest":
            return float((difference > 0).reshape(len(difference), -1).any(axis=1).mean())
        return float(difference.max())
