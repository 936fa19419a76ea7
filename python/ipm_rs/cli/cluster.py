"""``ipm-rs warp ... --ray``: what the command does with images on a cluster instead of on this machine alone."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

import ipm_rs
from ipm_rs.cli.arguments import check_not_input, check_output, load_camera_sized
from ipm_rs.cli.printing import emit, error_line, no_progress, progress_bar
from ipm_rs.cli.tables import table_of
from ipm_rs.errors import ArgumentError, FileError, IpmError
from ipm_rs.files import images
from ipm_rs.ray._files import RECORDS
from ipm_rs.streams import folder
from ipm_rs.streams.sinks import VIDEO_CODECS

_ALONE = ("start", "end", "threads", "topic", "scene", "poses", "mask_video")
"""Options that a cluster does not know."""
_TOLD = 5
"""So many errors of images are printed; the last line counts the others."""


def run(args: argparse.Namespace, grid: ipm_rs.BevGrid, options: dict[str, Any]) -> None:
    """Check what a cluster does not do, then leave the rest to `ipm_rs.ray.warp_files`."""
    for source in args.images:
        if "://" not in source and not folder.recognises(source):
            raise ArgumentError(f"--ray: expected images and folders of them, got {source}; leave --ray out")
    if args.output.lower().endswith(tuple(VIDEO_CODECS)):
        raise ArgumentError(f"--ray: expected a folder as the output, got {args.output}, a video; leave --ray out")
    for option in _ALONE:
        if getattr(args, option) is not None:
            raise ArgumentError(
                f"--{option.replace('_', '-')}: expected none with --ray, got one; leave one of both out"
            )
    if args.axes:
        raise ArgumentError("--axes: expected none with --ray, got it; draw some views with ipm_rs.draw.axes() instead")
    if args.every != 1:
        raise ArgumentError(
            f"--every: expected 1 with --ray, got {args.every}; name the images, or a .txt list of them"
        )
    out = Path(args.output)
    if out.is_dir() and any(out.iterdir()) and not (out / RECORDS).is_dir() and not args.force:
        raise FileError(f"{out}: expected an empty folder, or one that --ray began, got files; give --force or another")
    if args.mask is not None:
        images.check_format(args.mask, "L", "the mask")
        check_output(args.mask, may_exist=args.force)
        check_not_input(args.mask, [args.calibration, *args.images])
    lut = table_of(load_camera_sized(args), grid, args.ground)
    options.pop("threads")
    summary = _warp(args, lut, options)
    if args.mask is not None:
        images.write(args.mask, np.where(lut.mask, np.uint8(255), np.uint8(0)), images.Look("L"))
    if not args.quiet:
        skipped = f", {summary.skipped} were there" if summary.skipped else ""
        rows, cols = lut.shape
        emit(
            f"{args.output}  {cols} x {rows}  {summary.done} images{skipped}  {100 * lut.mask.mean():.1f} % valid  "
            f"{summary.seconds:.1f} s, {summary.rate:.1f} images/s"
        )
    if summary.failed:
        total = summary.done + summary.skipped + len(summary.failed)
        raise FileError(f"{len(summary.failed)} of {total} images could not be warped, see above")


def _warp(args: argparse.Namespace, lut: ipm_rs.Lut, options: dict[str, Any]) -> ipm_rs.streams.Summary:
    show = not args.quiet and sys.stderr.isatty()
    told = 0
    with (progress_bar("image") if show else no_progress)(iter(int, 1)) as (bar, say):
        steps = iter(bar)

        def report(done: int, failed: list[IpmError]) -> None:
            nonlocal told
            for _ in range(done + len(failed)):
                next(steps, None)
            for error in failed:
                told += 1
                if told <= _TOLD:
                    say(error_line(error), sys.stderr)

        return ipm_rs.ray.warp_files(
            args.images if len(args.images) > 1 else args.images[0],
            lut,
            args.output,
            workers=args.jobs,
            level=args.png_level,
            strict=args.strict,
            overwrite=args.force,
            address=args.ray or None,
            report=report,
            **options,
        )
