"""How far bird's-eye views are from a road whose truth is known: PSNR near, far and overall.

An analytic road (asphalt grain, lane lines, 10 cm chequer, 5 cm zebra) is photographed through a camera by
supersampling, warped back onto the road, and compared with the road itself, averaged over each cell.

    python benches/python/ground_truth.py                       every case and cell size
    python benches/python/ground_truth.py --yaw-deg 60 --roll-deg 5 --seed 3
    python benches/python/ground_truth.py --lens fisheye --slope 0.05
    python benches/python/ground_truth.py --pattern lanes

How far bilinear is behind depends on what lies on the road: `--pattern` leaves all but one thing out.
"""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import ipm_rs

SIZES = ((0.05, 0.025), (0.1, 0.1), (0.2, 0.2))
NEAR = 20.0
"""Metres from the origin at which the near range ends."""

POSITION = (1.7, 0.026, 1.2124)
PITCH = 0.0384


PATTERNS = ("all", "lanes", "chequer", "zebra", "grain")


class Road:
    """Grey level of the road at (x, y), drawn 7 degrees off `yaw`, so that no pattern is in step with cells."""

    def __init__(self, yaw: float = 0.0, seed: int = 0, pattern: str = "all") -> None:
        self.pattern = pattern
        noise = np.random.default_rng(seed).normal(size=(1024, 1024))
        frequency = np.fft.fftfreq(1024)
        smooth = np.exp(-2 * (np.pi * 1.0) ** 2 * (frequency[:, None] ** 2 + frequency[None, :] ** 2))
        grain = np.fft.ifft2(np.fft.fft2(noise) * smooth).real
        self.grain = (grain / grain.std() * 18).astype(np.float32)  # 2.5 cm a sample
        self.cos, self.sin = np.cos(yaw + 0.12), np.sin(yaw + 0.12)

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the grey level, 0 to 255, at points of one shape."""
        x, y = self.cos * x + self.sin * y, -self.sin * x + self.cos * y
        value = 90 + self.grain[np.floor(x * 40).astype(np.int32) & 1023, np.floor(y * 40).astype(np.int32) & 1023]
        if self.pattern in ("all", "lanes"):
            value = np.where((abs(abs(y) - 1.75) < 0.075) & (x % 3 < 2), 230, value)
        if self.pattern in ("all", "chequer"):
            value = np.where((abs(y - 4) < 1) & ((np.floor(x * 10) + np.floor(y * 10)) % 2 == 0), 210, value)
        if self.pattern in ("all", "zebra"):
            value = np.where((x > 11) & (x < 13) & (abs(y) < 1.5) & (np.floor(y * 20) % 2 == 0), 240, value)
        return value


@dataclass(frozen=True)
class Case:
    """A camera over a road; the grid moves into its view and stays along the axes of the vehicle."""

    name: str
    yaw_deg: float = 0.0
    roll_deg: float = 0.0
    lens: str = "pinhole"
    slope: float = 0.0
    seed: int = 0
    image_size: tuple[int, int] = (2048, 1024)
    pattern: str = "all"

    @property
    def yaw(self) -> float:
        """Radians."""
        return float(np.deg2rad(self.yaw_deg))

    @property
    def camera(self) -> ipm_rs.Camera:
        """The camera."""
        width, height = self.image_size
        if self.lens == "fisheye":
            focal, lens, pitch = width / 3.8, ipm_rs.KannalaBrandt([0.02, -0.005, 0.001, 0.0]), 0.5
        else:
            focal, lens, pitch = width * 1.1, None, PITCH
        K = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])
        angles = {"yaw": self.yaw, "pitch": pitch, "roll": float(np.deg2rad(self.roll_deg))}
        return ipm_rs.Camera.from_euler(K, image_size=self.image_size, position=POSITION, lens=lens, **angles)

    @property
    def ground(self) -> Any:
        """The road: level, or rising ahead by so many metres a metre."""
        return ipm_rs.Plane.from_coefficients(0.0, self.slope, 0.0) if self.slope else 0.0

    def grid(self, cell: tuple[float, float]) -> ipm_rs.BevGrid:
        """Return the cells: ahead of the camera, or a square around what it looks at."""
        if self.lens == "fisheye":
            middle, half, sizes = 6.0, 4.0, cell
        else:
            middle, half, sizes = 22.0, 15.0, cell
        if not self.yaw_deg:
            x = (7.0, 50.0) if self.lens == "pinhole" else (3.0, 11.0)
            return ipm_rs.BevGrid(x=x, y=(-10.0, 10.0) if self.lens == "pinhole" else (-4.0, 4.0), resolution=sizes)
        x, y = (round(middle * float(turn(self.yaw)), 1) for turn in (np.cos, np.sin))
        return ipm_rs.BevGrid(x=(x - half, x + half), y=(y - half, y + half), resolution=sizes)


CASES = (
    Case("straight ahead"),
    Case("yaw 60, roll 5", yaw_deg=60, roll_deg=5),
    Case("yaw -100, roll -4", yaw_deg=-100, roll_deg=-4, seed=3),
    Case("yaw 30, roll -10", yaw_deg=30, roll_deg=-10, seed=7),
    Case("roll 10", roll_deg=10, seed=5),
    Case("fisheye", lens="fisheye", image_size=(1280, 960), seed=1),
    Case("fisheye, yaw 75, roll 8", lens="fisheye", image_size=(1280, 960), yaw_deg=75, roll_deg=8, seed=2),
    Case("slope of 5 %", slope=0.05, seed=4),
    Case("slope of -4 %, yaw -40, roll 6", slope=-0.04, yaw_deg=-40, roll_deg=6, seed=6),
)


class Trial:
    """A case rendered once, and its views for one size of cells."""

    def __init__(self, case: Case, samples: int = 6) -> None:
        self.case, self.camera, self.road = case, case.camera, Road(case.yaw, case.seed, case.pattern)
        self.image = self._render(samples)

    def _render(self, samples: int) -> np.ndarray:
        (width, height), total = self.case.image_size, 0.0
        for a in range(samples):
            for b in range(samples):
                u, v = np.meshgrid(
                    np.arange(width) + (a + 0.5) / samples - 0.5, np.arange(height) + (b + 0.5) / samples - 0.5
                )
                points = self.camera.ground_from_pixels(np.stack([u, v], -1).reshape(-1, 2), ground=self.case.ground)
                x, y = points[:, 0].reshape(height, width), points[:, 1].reshape(height, width)
                seen = np.isfinite(x) & (np.hypot(x, y) < 300)
                total = total + np.where(seen, self.road(np.where(seen, x, 0), np.where(seen, y, 0)), 150.0)
        return np.clip(np.rint(total / samples**2), 0, 255).astype(np.uint8)

    def compare(self, cell: tuple[float, float], views: dict[str, Callable[[View], np.ndarray]]) -> dict[str, tuple]:
        """Return PSNR (near, far, all) in dB of each view of the cells that see the image well inside its edge."""
        view = View(self, cell)
        return {name: view.psnr(make(view)) for name, make in views.items()}


class View:
    """A trial's grid of one size of cells."""

    def __init__(self, trial: Trial, cell: tuple[float, float]) -> None:
        self.trial, self.cell, self.grid = trial, cell, trial.case.grid(cell)
        self.lut = ipm_rs.Lut(trial.camera, self.grid, ground=trial.case.ground)

    @cached_property
    def fine(self) -> ipm_rs.Lut:
        """A table of 8 x 8 samples a cell."""
        grid = ipm_rs.BevGrid(x=self.grid.x, y=self.grid.y, resolution=(self.cell[0] / 8, self.cell[1] / 8))
        return ipm_rs.Lut(self.trial.camera, grid, ground=self.trial.case.ground)

    @cached_property
    def well_inside(self) -> np.ndarray:
        """Which cells see the image well inside its edge."""
        width, height = self.trial.case.image_size
        u, v = self.lut.maps()
        return (u > 20) & (u < width - 21) & (v > 20) & (v < height - 21)

    @cached_property
    def truth_inside(self) -> np.ndarray:
        """The truth of the cells `well_inside`, one after the other."""
        return self.truth(self.grid.xy()[self.well_inside])

    def truth(self, xy: np.ndarray) -> np.ndarray:
        """Return the road averaged over the cells around `xy`, by points of at most 6.25 mm apart.

        By 8 x 8 points a cell, where the view by 8 x 8 samples looks too, both had the same errors: beside a fisheye,
        in cells of 20 cm, that view seemed to be worse by 3 dB than it is, and so did what averages all.
        """
        count = max(8, round(max(self.cell) / 0.00625))
        total = np.zeros(xy.shape[:-1])
        for a in (np.arange(count) + 0.5) / count - 0.5:
            for b in (np.arange(count) + 0.5) / count - 0.5:
                total += self.trial.road(xy[..., 0] + a * self.cell[0], xy[..., 1] + b * self.cell[1])
        return total / count**2

    def mean_of_blocks(self, fine: np.ndarray, count: int) -> np.ndarray:
        """Return the means of `count` x `count` blocks."""
        rows, cols = self.lut.shape
        return fine.astype(np.float64).reshape(rows, count, cols, count).mean(axis=(1, 3))

    def psnr(self, view: np.ndarray) -> tuple[float, float, float]:
        """Return PSNR near, far and overall in dB; NaN where there are no such cells."""
        square = (view[self.well_inside].astype(np.float64) - self.truth_inside) ** 2
        near_enough = NEAR if self.trial.case.lens == "pinhole" else 5.0
        near = np.hypot(*self.grid.xy()[self.well_inside].T) < near_enough

        def psnr(cells: np.ndarray) -> float:
            return 10 * np.log10(255**2 / square[cells].mean()) if cells.sum() > 100 else np.nan

        return psnr(near), psnr(~near), psnr(np.ones_like(near))


def own_views() -> dict[str, Callable[[View], np.ndarray]]:
    """Return the views that need nothing but ipm_rs."""
    return {
        "8x8 supersampled": lambda view: np.rint(view.mean_of_blocks(view.fine.warp(view.trial.image), 8)),
        "ipm_rs bilinear": lambda view: view.lut.warp(view.trial.image),
        "ipm_rs area": lambda view: view.lut.warp(view.trial.image, interpolation="area"),
    }


def opencv_views() -> dict[str, Callable[[View], np.ndarray]]:
    """Return the views of OpenCV, none where it is not installed."""
    if importlib.util.find_spec("cv2") is None:
        return {}
    import cv2

    def remap(view: View, interpolation: int) -> np.ndarray:
        return cv2.remap(view.trial.image, *view.lut.maps(outside=-9), interpolation)

    def supersampled(view: View) -> np.ndarray:
        grid = ipm_rs.BevGrid(x=view.grid.x, y=view.grid.y, resolution=(view.cell[0] / 4, view.cell[1] / 4))
        fine = ipm_rs.Lut(view.trial.camera, grid, ground=view.trial.case.ground)
        rows, cols = view.lut.shape
        sampled = cv2.remap(view.trial.image, *fine.maps(outside=-9), cv2.INTER_LINEAR)
        return cv2.resize(sampled, (cols, rows), interpolation=cv2.INTER_AREA)

    return {
        "cv2 bilinear": lambda view: remap(view, cv2.INTER_LINEAR),
        "cv2 bicubic": lambda view: remap(view, cv2.INTER_CUBIC),
        "cv2 4x4 + INTER_AREA": supersampled,
    }


def main() -> None:
    """Print a row for each case, size of cells and method."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--yaw-deg", type=float)
    parser.add_argument("--roll-deg", type=float)
    parser.add_argument("--lens", choices=("pinhole", "fisheye"), default="pinhole")
    parser.add_argument("--slope", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pattern", choices=PATTERNS, default="all")
    args = parser.parse_args()
    cases = CASES
    if (
        args.yaw_deg is not None
        or args.roll_deg is not None
        or args.lens != "pinhole"
        or args.slope
        or args.seed
        or args.pattern != "all"
    ):
        size = (2048, 1024) if args.lens == "pinhole" else (1280, 960)
        own = Case(
            "as asked", args.yaw_deg or 0.0, args.roll_deg or 0.0, args.lens, args.slope, args.seed, size, args.pattern
        )
        cases = (own,)
    for case in cases:
        trial = Trial(case)
        for cell in SIZES:
            for name, psnr in trial.compare(cell, {**opencv_views(), **own_views()}).items():
                near, far, overall = psnr
                size = f"{cell[0]:g} x {cell[1]:g} m"
                print(f"{case.name:30s} {size:14s} {name:21s} near {near:6.2f}  far {far:6.2f}  all {overall:6.2f} dB")


if __name__ == "__main__":
    main()
