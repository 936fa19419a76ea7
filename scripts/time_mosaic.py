#!/usr/bin/env python3
"""Time a frame's way into a map: beside the warp of the same cells, and beside OpenCV.

    .venv/bin/python scripts/time_mosaic.py [--rounds 8]

`grey` is a picture of KITTI's size, 4 to 20 m ahead, `set` six coloured ones of nuScenes' size, to 15 m all around,
both at 5 cm, on one thread: the least CPU time, of 20 in a row, of kinds that take turns in one process. The vehicle
stands still, so tiles and pictures are as near as caches hold them, for all alike. Every kind does the same windows of
the same tiles:

- `add`: `Mosaic.add`, from the call to its end: finds the windows, makes tables, averages over cells, weighs, adds.
- `area warp`: `Lut.warp(interpolation="area")` alone, of tables that are ready, or of new ones, as a camera needs that
  moves.
- `OpenCV, one sum`: `initUndistortRectifyMap` makes the maps (the vehicle moves: they serve one frame), `remap`
  interpolates, `accumulate` adds the values and the count of cells inside the picture, in float32.
- `OpenCV, all layers`: the same, and what a mosaic keeps besides: how well each cell is resolved (central differences
  of the maps), weights by its eighth power, distances, the sum of weights and of weighted values, of squares, and the
  best frame's value; in float32.
- `OpenCV, all layers, averaged`: the same of averages: 4 x 4 samples a cell, their mean by `resize`. Below that OpenCV
  shows the aliasing that a mosaic does not have.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
from PIL import Image
from try_mosaic import bend, kitti_frame

import ipm_rs
from ipm_rs.mosaic._placing import Placed, placed, windows

CELL, TILE, COARSEST = 0.05, 512, 1 / 16
FINER = 4
TOGETHER = 20


def nuscenes_set() -> tuple[ipm_rs.Rig, dict[str, np.ndarray]]:
    """Return a rig and coloured pictures of the size of nuScenes'."""
    angles = {"front": 0, "front_left": 55, "front_right": -55, "back": 180, "back_left": 110, "back_right": -110}
    K, size = [[1266, 0, 800], [0, 1266, 450], [0, 0, 1]], (1600, 900)
    rig = ipm_rs.Rig(
        {
            name: ipm_rs.Camera.from_euler(K, image_size=size, position=(1, 0, 1.5), pitch=0.05, yaw=np.deg2rad(angle))
            for name, angle in angles.items()
        }
    )
    spots = np.random.default_rng(0).integers(0, 256, (225, 400, 3), np.uint8)
    picture = np.asarray(Image.fromarray(spots).resize(size, Image.Resampling.BICUBIC))
    return rig, dict.fromkeys(rig, picture)


@dataclass
class Sums:
    """The layers of a window in float32."""

    shape: tuple[int, int]
    channels: tuple[int, ...]
    numbers: dict[str, np.ndarray] = field(default_factory=dict)

    def of(self, name: str, *, each: bool) -> np.ndarray:
        """Return a layer: of each channel, or of the cell."""
        if name not in self.numbers:
            dtype = np.uint8 if name == "best" else np.float32
            self.numbers[name] = np.zeros((*self.shape, *(self.channels if each else ())), dtype)
        return self.numbers[name]


@dataclass
class Picture:
    """A picture placed in the map, the windows that it is added to, and OpenCV's sums of them."""

    frame: Placed
    image: np.ndarray
    grids: list[ipm_rs.BevGrid]
    sums: list[Sums]


def picture_of(camera: ipm_rs.Camera, image: np.ndarray, pose: np.ndarray, distance: tuple[float, float]) -> Picture:
    """Return a picture with the windows that a mosaic would add it to."""
    frame = placed(camera, pose, 0.0, distance, 1.0)
    grids = [window.grid for window in windows(frame, CELL, TILE)]
    return Picture(frame, image, grids, [Sums(grid.shape, image.shape[2:]) for grid in grids])


def maps(picture: Picture, grid: ipm_rs.BevGrid, finer: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return where each cell samples, or each of finer ones, by OpenCV's own vector code."""
    size = grid.resolution[0] / finer
    rows, columns = grid.shape
    to_map = np.array([[0, -size, grid.x[1] - size / 2], [-size, 0, grid.y[1] - size / 2], [0, 0, 0], [0, 0, 1]])
    camera = picture.frame.camera
    cells_from_rays = np.linalg.inv(camera.camera_from_vehicle[:3] @ to_map)
    shape = (columns * finer, rows * finer)
    return cv2.initUndistortRectifyMap(camera.intrinsics, None, None, cells_from_rays, shape, cv2.CV_32FC1)


def inside(picture: Picture, map_x: np.ndarray, map_y: np.ndarray) -> np.ndarray:
    """Return 255 for the cells that sample within the picture."""
    height, width = picture.image.shape[:2]
    return cv2.inRange(map_x, 0, width - 1) & cv2.inRange(map_y, 0, height - 1)


def one_sum(picture: Picture) -> None:
    """Add up values and counts."""
    for grid, sums in zip(picture.grids, picture.sums, strict=True):
        map_x, map_y = maps(picture, grid)
        view = cv2.remap(picture.image, map_x, map_y, cv2.INTER_LINEAR)
        seen = inside(picture, map_x, map_y)
        cv2.accumulate(view, sums.of("sums", each=True), mask=seen)
        cv2.accumulate(seen & 1, sums.of("count", each=False))


def all_layers(picture: Picture, *, averaged: bool = False) -> None:
    """Add up all that a mosaic keeps."""
    near, far = picture.frame.distance
    slope = np.array([[-0.5, 0, 0.5]], np.float32)
    for grid, sums in zip(picture.grids, picture.sums, strict=True):
        map_x, map_y = maps(picture, grid)
        if averaged:
            fine = cv2.remap(picture.image, *maps(picture, grid, FINER), cv2.INTER_LINEAR)
            view = cv2.resize(fine, grid.shape[::-1], interpolation=cv2.INTER_AREA)
        else:
            view = cv2.remap(picture.image, map_x, map_y, cv2.INTER_LINEAR)
        ax, ay, bx, by = (cv2.filter2D(one, -1, kernel) for kernel in (slope, slope.T) for one in (map_x, map_y))
        area, total = np.abs(ax * by - ay * bx), ax * ax + ay * ay + bx * bx + by * by
        largest = (total + np.sqrt(np.maximum(total * total - 4 * area * area, 0))) / 2
        resolution = area / np.sqrt(np.maximum(largest, np.float32(1e-9)))
        rows, columns = (np.arange(count, dtype=np.float32) + 0.5 for count in grid.shape)
        x = grid.x[1] - CELL * rows - picture.frame.at[0]
        y = grid.y[1] - CELL * columns - picture.frame.at[1]
        squared = (x * x)[:, None] + y * y
        counts = (inside(picture, map_x, map_y) > 0) & (squared >= near**2) & (squared < far**2)
        seen = (counts & (resolution >= COARSEST)).view(np.uint8)
        weight = np.minimum(resolution, 1)
        for _ in range(3):
            weight *= weight
        weight *= seen
        every = weight if view.ndim == 2 else cv2.merge([weight] * 3)
        cv2.accumulateProduct(view.astype(np.float32), every, sums.of("totals", each=True))
        cv2.accumulate(weight, sums.of("weights", each=False))
        cv2.accumulate(seen, sums.of("count", each=False))
        cv2.accumulate(view, sums.of("sums", each=True), mask=seen)
        cv2.accumulateSquare(view, sums.of("squares", each=True), mask=seen)
        known = sums.of("resolution", each=False)
        better = seen & (resolution > known)
        cv2.copyTo(resolution, better, known)
        cv2.copyTo(view, better, sums.of("best", each=True))


def least(kinds: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return milliseconds of CPU time of each, taken in turns, so that all meet the same machine.

    The least of means over `TOGETHER` calls: a mosaic adds what waited of some ten frames at once.
    """
    found = dict.fromkeys(kinds, np.inf)
    for _ in range(rounds):
        for name, work in kinds.items():
            begin = time.process_time()
            for _ in range(TOGETHER):
                work()
            found[name] = min(found[name], 1e3 * (time.process_time() - begin) / TOGETHER)
    return found


def compare(
    name: str, camera: ipm_rs.Camera | ipm_rs.Rig, image: object, limits: tuple[float, float], rounds: int
) -> None:
    """Print what adding costs beside the others."""
    pose = bend(9)
    cameras, images = ({"": camera}, {"": image}) if isinstance(camera, ipm_rs.Camera) else (camera, image)
    pictures = [picture_of(cameras[key], images[key], pose, limits) for key in cameras]
    tables = [(ipm_rs.Lut(one.frame.camera, grid), one.image) for one in pictures for grid in one.grids]
    mosaic = ipm_rs.Mosaic(CELL, tile=TILE)
    kinds: dict[str, Callable[[], object]] = {
        "add": lambda: mosaic.add(camera, image, map_from_vehicle=pose, distance=limits),
        "area warp, tables ready": lambda: [table.warp(of, interpolation="area") for table, of in tables],
        "area warp, and its tables": lambda: [
            ipm_rs.Lut(table.camera, table.grid).warp(of, interpolation="area") for table, of in tables
        ],
        "OpenCV, one sum": lambda: [one_sum(one) for one in pictures],
        "OpenCV, all layers": lambda: [all_layers(one) for one in pictures],
        "OpenCV, all layers, averaged": lambda: [all_layers(one, averaged=True) for one in pictures],
    }
    cells = kinds["add"]()
    found = least(kinds, rounds)
    inside_windows = sum(np.prod(grid.shape) for one in pictures for grid in one.grids)
    print(
        f"{name}: {cells} cells counted of {inside_windows} in {len(tables)} windows; {1e3 / found['add']:.0f} a second"
    )
    for kind, took in found.items():
        print(f"  {took:7.2f} ms  {took / found['add']:5.2f} of add  {kind}")
    warps = [found["add"] / took for kind, took in found.items() if kind.startswith("area")]
    print(f"  add is {warps[0]:.2f} of the area warp, {warps[1]:.2f} of that with its tables", flush=True)


def main() -> None:
    """Time both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=8)
    args = parser.parse_args()
    warnings.simplefilter("ignore", ipm_rs.errors.CalibrationWarning)  # windows at the rim of what a camera sees
    ipm_rs.set_num_threads(1)
    cv2.setNumThreads(1)
    compare("grey", *kitti_frame(), (4.0, 20.0), args.rounds)
    compare("set", *nuscenes_set(), (0.0, 15.0), args.rounds)


if __name__ == "__main__":
    main()
