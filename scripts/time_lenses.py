"""How long a table takes to build through each lens: `python scripts/time_lenses.py`, a table for docs/benchmarks.md.

CPU time of one thread, the smallest of many, of a 1280 x 960 camera and a grid of 600 x 800 cells that it sees; the
lenses by turns, so that all see the same machine. Cells that the lens cannot see cost less, so the share of cells seen
is in the last column.
"""

from __future__ import annotations

import os
import time

import numpy as np

os.environ.setdefault("IPM_RS_NUM_THREADS", "1")

import ipm_rs

SIZE = (1280, 960)
GRID = ipm_rs.BevGrid(x=(2, 32), y=(-10, 10), resolution=(0.05, 0.025))
ROUNDS = 15

LENSES = {
    "pinhole": None,
    "BrownConrady, 5": ipm_rs.BrownConrady([-0.28, 0.07, 1e-3, -5e-4, 0.01]),
    "KannalaBrandt": ipm_rs.KannalaBrandt([0.02, -0.01, 0.003, -0.0005]),
    "Mei": ipm_rs.Mei(0.9, [-0.02, 0.001, 4e-4, -5e-4]),
    "DoubleSphere": ipm_rs.DoubleSphere(-0.2, 0.6),
    "Eucm": ipm_rs.Eucm(0.6, 1.1),
    "RadialPolynomial": ipm_rs.RadialPolynomial([600.0, -30.0, 20.0, -4.0]),
    "Ocam": ipm_rs.Ocam([-600.0, 0.0, 5e-4, -2e-7, 1e-10]),
    "FTheta, forward": ipm_rs.FTheta([0.0, 600.0, 5.0, -8.0], form="forward"),
    "FTheta, backward": ipm_rs.FTheta([0.0, 1.65e-3, 1e-8, 1e-11], form="backward"),
    "Fov": ipm_rs.Fov(0.9),
    "Division": ipm_rs.Division(-0.3),
    "InverseBrownConrady": ipm_rs.InverseBrownConrady([-0.05, 0.02, 1e-3, -5e-4, 0.0]),
    "ThinPrismFisheye": ipm_rs.ThinPrismFisheye([0.01, -0.02, 1e-3, -2e-3, 3e-3, -1e-3, 4e-3, -5e-3]),
    "Cylindrical": ipm_rs.Cylindrical(),
    "Equirectangular": ipm_rs.Equirectangular(),
}
IN_PIXELS = ("RadialPolynomial", "Ocam", "FTheta, forward", "FTheta, backward")


def camera(name: str, lens: object) -> ipm_rs.Camera:
    """Of about the same focal length through every lens."""
    focal = 1.0 if name in IN_PIXELS else 600.0
    K = np.array([[focal, 0, 639.5], [0, focal, 479.5], [0, 0, 1]])
    return ipm_rs.Camera.from_euler(K, image_size=SIZE, position=(1.5, 0, 1.4), pitch=0.25, lens=lens)


def main() -> None:
    """Print the table."""
    ipm_rs.set_num_threads(1)
    cameras = {name: camera(name, lens) for name, lens in LENSES.items()}
    best = dict.fromkeys(cameras, float("inf"))
    for _ in range(ROUNDS):
        for name, one in cameras.items():
            start = time.thread_time()
            ipm_rs.Lut(one, GRID)
            best[name] = min(best[name], time.thread_time() - start)
    print("| lens | ms | times Kannala-Brandt | cells seen |\n|---|---|---|---|")
    for name, one in cameras.items():
        seen = ipm_rs.Lut(one, GRID).mask.mean()
        print(f"| {name} | {best[name] * 1e3:.2f} | {best[name] / best['KannalaBrandt']:.1f} | {seen:.0%} |")


if __name__ == "__main__":
    main()
