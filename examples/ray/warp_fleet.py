"""Warp a fleet's frames on a Ray cluster, from one folder or bucket to another; runs again where it stopped.

    python warp_fleet.py camera.json frames/ bevs/                                         # this machine's CPUs
    ray up cluster.yaml                                                                    # a cluster, once
    ray submit cluster.yaml warp_fleet.py camera.json s3://fleet/42 s3://bevs/42 --address auto

Needs the extra ``ray``.
"""

from __future__ import annotations

import argparse

import ipm_rs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("calibration")
    parser.add_argument("frames")
    parser.add_argument("output")
    parser.add_argument("--address", help="of the cluster: auto on one of its machines; without it, this machine")
    parser.add_argument("--workers", type=int, help="by default as many as there is room for")
    args = parser.parse_args()

    camera = ipm_rs.Camera.load(args.calibration)
    lut = ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(7, 50), y=(-10, 10), resolution=0.05))
    done = 0

    def report(count: int, failed: list[ipm_rs.IpmError]) -> None:
        nonlocal done
        done += count
        print(f"{done} frames", *failed, sep="\n  ", flush=True)

    summary = ipm_rs.ray.warp_files(
        args.frames,
        lut,
        args.output,
        workers=args.workers,
        recursive=True,
        interpolation="area",
        address=args.address,
        report=report,
    )
    print(f"{summary.done} done, {summary.skipped} were there, {len(summary.failed)} failed, {summary.seconds:.0f} s")


if __name__ == "__main__":
    main()
