#!/usr/bin/env python3
"""Time `ipm_rs.torch.Warp` beside PyTorch's `grid_sample` on the CPU.

    .venv/bin/python scripts/time_torch.py [--repeats 7]

Needs the extra ``torch``. One process, CPU time, the best of several runs that alternate; the gradient goes to the
images alone. Prints a row for each job and order of the channels, then how two threads scale (wall time: that is of an
idle machine).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F

import ipm_rs

K = [[2262.5, 0, 1096.98], [0, 2265.3, 513.14], [0, 0, 1]]
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(2048, 1024), position=(1.7, 0.1, 1.22), pitch=0.038, yaw=-0.02)
JOBS = {
    "2048 x 1024 to 860 x 800": ((2048, 1024), (0.05, 0.025)),
    "512 x 256 to 215 x 200": ((512, 256), (0.2, 0.1)),
}


def table(size: tuple[int, int], resolution: tuple[float, float]) -> ipm_rs.Lut:
    """Return the table of images or features of that size."""
    return ipm_rs.Lut(CAMERA.resized(*size), ipm_rs.BevGrid(x=(7, 50), y=(-10, 10), resolution=resolution))


def best(calls: list[Callable[[], Any]], repeats: int, clock: Callable[[], float]) -> list[float]:
    """Return for each call the least milliseconds, after one run that is not counted."""
    least = [float("inf")] * len(calls)
    for repeat in range(repeats + 1):
        for place, call in enumerate(calls):
            begin = clock()
            call()
            if repeat:
                least[place] = min(least[place], 1e3 * (clock() - begin))
    return least


def backward(view: torch.Tensor, images: torch.Tensor) -> Callable[[], Any]:
    """Return what carries a gradient of ones back to the images."""
    grad = torch.ones_like(view)
    return lambda: torch.autograd.grad(view, images, grad, retain_graph=True)


def measure(warp: Any, grid: torch.Tensor, images: torch.Tensor, repeats: int) -> tuple[list[float], ...]:
    """Return the milliseconds of `grid_sample` and of ours, forward and backward, and how much two threads gain."""
    ways = [lambda images: F.grid_sample(images, grid, align_corners=True), warp]
    torch.set_num_threads(1)
    with torch.no_grad():
        there = best([partial(way, images) for way in ways], repeats, time.process_time)
    back = best([backward(way(images), images) for way in ways], repeats, time.process_time)
    walls = []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        with torch.no_grad():
            walls += best([partial(warp, images)], repeats, time.perf_counter)
        walls += best([backward(warp(images), images)], repeats, time.perf_counter)
    return there, back, [walls[0] / walls[2], walls[1] / walls[3]]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--channels", type=int, default=64)
    options = parser.parse_args()
    print(f"PyTorch {torch.__version__}, {ipm_rs.cpu_info()}")
    print("job, order | forward ms: grid_sample, ours, times | backward ms: grid_sample, ours, times")
    for name, (size, resolution) in JOBS.items():
        lut = table(size, resolution)
        axes = [2 * axis / (side - 1) - 1 for axis, side in zip(lut.maps(outside=-9), size, strict=True)]
        grid = torch.from_numpy(np.stack(axes, -1)[None])
        warp = ipm_rs.torch.Warp(lut)
        for order in (torch.contiguous_format, torch.channels_last):
            images = torch.rand(1, options.channels, *size[::-1]).contiguous(memory_format=order).requires_grad_()
            there, back, gains = measure(warp, grid, images, options.repeats)
            print(
                f"{name}, {str(order)[6:]} | {there[0]:.1f} {there[1]:.1f} {there[0] / there[1]:.1f}x | "
                f"{back[0]:.1f} {back[1]:.1f} {back[0] / back[1]:.1f}x"
            )
            print(f"    two threads: forward {gains[0]:.2f}x, backward {gains[1]:.2f}x", flush=True)


if __name__ == "__main__":
    main()
