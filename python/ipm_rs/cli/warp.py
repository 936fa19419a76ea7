"""``ipm-rs warp``: camera images to bird's-eye views."""

from __future__ import annotations

import argparse
import os
import sys
import textwrap
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import ipm_rs
from ipm_rs import calibration
from ipm_rs.cli.arguments import (
    Commands,
    add_camera,
    add_grid,
    add_image_size,
    check_output,
    count,
    load_camera_sized,
    output_names,
    read_headers,
    real,
    resolution,
    value,
)
from ipm_rs.cli.printing import Progress, emit, error_line, no_progress, progress_bar
from ipm_rs.errors import ArgumentError, FileError, ImageError, IpmError
from ipm_rs.files import images


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    warp = commands.add_parser(
        "warp",
        help="warp camera images to bird's-eye views",
        description="""\
Warp camera images to metric bird's-eye views. Row 0 is far ahead, column 0 is to the left; metres are those of the
vehicle frame of the calibration: x forward, y left, z up.

Images may be grey, 16-bit grey, colour, with alpha, or label images with a palette (nearest and mode only; indices and
palette are kept). EXIF orientation is not applied: the calibration belongs to the pixels as they are stored. Of several
images, a damaged one is told of and left out; the others are made, and the exit status is 2. The extension of the
output decides its format: """
        + " ".join(images.FORMATS)
        + ".\n\n"
        + textwrap.fill(f"The format of the calibration is recognised: {', '.join(calibration.FORMATS)}.", 118),
        examples="""\
  ipm-rs warp camera.json frame.png -o bev.png
  ipm-rs warp camera.json frame.png -o bev.png --x 7 50 --y -10 10 --resolution 0.05 0.025 --sample-at corner
  ipm-rs warp camera.json frames/*.png -o bevs/ --mask bevs/valid.png
  ipm-rs warp calib/000114.txt 000114.png -o bev.png --image-size 1242 375 --ground -1.73
  ipm-rs warp v1.0-mini/calibrated_sensor.json front.jpg -o bev.png --camera CAM_FRONT
  ipm-rs warp camera.json frame.png -o bev.png --resolution 0.1 --interpolation area
  ipm-rs warp camera.json labels.png -o bev_labels.png --interpolation mode --border-value 255""",
    )
    add = warp.add_argument
    add("calibration", metavar="CALIBRATION", help="camera calibration, a file or directory of a format named above")
    add("images", metavar="IMAGE", nargs="+", type=Path, help="camera images, all of the calibration's size")
    add(
        "-o",
        "--output",
        metavar="OUT",
        required=True,
        help="a file for one image; a directory for several, which get the names <image>_bev.png",
    )
    grid = add_grid(warp, "where a cell is sampled")
    grid.add_argument(
        "--ground", metavar="HEIGHT", type=real, default=0.0, help="height z of the road in metres (default: 0)"
    )
    pixels = warp.add_argument_group("pixels")
    pixels.add_argument(
        "--interpolation",
        choices=("bilinear", "nearest", "area", "mode"),
        default="bilinear",
        help="bilinear; area, the mean of all that a cell covers, without aliasing near the car; nearest and mode, the "
        "id that most of a cell has, for labels (default: bilinear)",
    )
    pixels.add_argument(
        "--border-value",
        metavar="V",
        nargs="+",
        type=value,
        default=[0],
        help="value of cells that the camera does not see, one or one per channel (default: 0)",
    )
    add_camera(pixels)
    add_image_size(pixels)
    running = warp.add_argument_group("run")
    running.add_argument(
        "--mask", metavar="PATH", type=Path, help="also write the validity mask, 255 where a cell is seen"
    )
    running.add_argument("--threads", metavar="N", type=count, help="threads of a warp (default: the CPUs there are)")
    running.add_argument("--force", action="store_true", help="replace existing outputs")
    running.add_argument("--quiet", action="store_true", help="print nothing but warnings and errors")
    warp.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Check everything, then warp image after image."""
    camera = load_camera_sized(args)
    grid = ipm_rs.BevGrid(x=args.x, y=args.y, resolution=resolution(args.resolution), sample_at=args.sample_at)
    found, failed = read_headers(images.probe, args.images)
    headers = [header for header in found if header is not None]
    for header in headers:
        _check_image(header, camera, args.interpolation)
    outputs = _outputs(args, headers)
    _check_outputs(outputs, headers, args)
    options: dict[str, Any] = {
        "interpolation": args.interpolation,
        "border_value": args.border_value[0] if len(args.border_value) == 1 else tuple(args.border_value),
        "threads": args.threads,
    }
    _rehearse(headers, options)
    show_progress = len(headers) > 1 and not args.quiet and sys.stderr.isatty()
    progress: Progress = progress_bar("image") if show_progress else no_progress

    lut = ipm_rs.Lut(camera, grid, ground=args.ground)
    mask = lut.mask
    with progress(list(zip(headers, outputs, strict=True))) as (jobs, say):
        for header, output in jobs:
            try:
                pixels, look = images.read(header.path)
                start = perf_counter()
                bev = lut.warp(pixels, **options)
            except (FileError, ImageError) as error:  # one damaged frame does not stop the others
                if len(args.images) == 1:
                    raise
                failed += 1
                say(error_line(error), sys.stderr)
                continue
            milliseconds = 1e3 * (perf_counter() - start)
            output.parent.mkdir(parents=True, exist_ok=True)
            images.write(output, bev, look)
            if not args.quiet:
                rows, cols = lut.shape
                say(f"{output}  {cols} x {rows}  {100 * mask.mean():.1f} % valid  {milliseconds:.2f} ms", sys.stdout)
    if args.mask is not None and failed < len(args.images):
        images.write(args.mask, np.where(mask, np.uint8(255), np.uint8(0)), images.Look("L"))
        if not args.quiet:
            emit(f"{args.mask}  {mask.shape[1]} x {mask.shape[0]}  mask")
    if failed:
        raise FileError(f"{failed} of {len(args.images)} images could not be read, see above; the others were written")


def _check_image(header: images.Header, camera: ipm_rs.Camera, interpolation: str) -> None:
    """Refuse an image that does not fit the camera or the interpolation, and tell of what is left out."""
    if header.size != tuple(camera.image_size):
        (width, height), (wanted_width, wanted_height) = header.size, camera.image_size
        raise ImageError(
            f"{header.path}: expected {wanted_width}x{wanted_height} pixels, as the calibration was made for, got "
            f"{width}x{height}; if it was made for {width}x{height}, give --image-size {width} {height}; if the image "
            "was scaled since, use the original, or Camera.resized() in Python"
        )
    if interpolation not in ("nearest", "mode") and header.mode in ("P", "1"):
        kind = "a label image with a palette" if header.mode == "P" else "a 1-bit image"
        raise ArgumentError(
            f"{header.path}: expected --interpolation nearest or mode for {kind}, got {interpolation}, which would mix "
            "its values; give --interpolation nearest, or convert the image to RGB or grey"
        )
    if header.orientation != 1:
        emit(f"ipm-rs: warning: {header.path}: EXIF orientation {header.orientation} is not applied", sys.stderr)
    if header.frames > 1:
        emit(f"ipm-rs: warning: {header.path}: the first of {header.frames} frames is used", sys.stderr)


def _outputs(args: argparse.Namespace, headers: list[images.Header]) -> list[Path]:
    """Names of the outputs of the images that can be read."""
    endings = {header.path: ".tif" if header.mode == "F" else ".png" for header in headers}
    names = output_names(
        "-o", args.output, args.images, lambda path: f"{path.stem}_bev{endings.get(path, '.png')}", "images"
    )
    return [name for name, path in zip(names, args.images, strict=True) if path in endings]


def _check_outputs(outputs: list[Path], headers: list[images.Header], args: argparse.Namespace) -> None:
    """Refuse outputs that cannot hold the pixels, exist, coincide, or are inputs."""
    sources = [Path(args.calibration), *(header.path for header in headers)]
    contents = [(output, header.mode, str(header.path)) for output, header in zip(outputs, headers, strict=True)]
    if args.mask is not None:
        contents.append((args.mask, "L", "the mask"))
        if args.mask.suffix.lower() in (".jpg", ".jpeg"):
            raise ArgumentError(f"--mask: expected a lossless format, got {args.mask}; use .png")
    directory = None if outputs == [Path(args.output)] else Path(args.output)  # made later if it does not exist
    taken: dict[str, str] = {}
    for path, mode, what in contents:
        images.check_format(path, mode, what)
        other = taken.setdefault(os.path.normcase(os.path.realpath(path)), what)
        if other is not what:
            raise ArgumentError(f"{path}: expected one output per image, got it from {other} and {what}; rename one")
        if path.exists() and any(source.exists() and path.samefile(source) for source in sources):
            raise ArgumentError(f"{path}: expected an output, got an input; give another name, also with --force")
        check_output(path, may_exist=args.force, may_make=path.parent == directory)


def _rehearse(headers: list[images.Header], options: dict[str, Any]) -> None:
    """Warp one pixel of each kind of image, so that what the core refuses is refused before any work."""
    one = ipm_rs.Lut.from_maps(np.zeros((1, 1), np.float32), np.zeros((1, 1), np.float32), source_size=(1, 1))
    for header in {header.mode: header for header in headers}.values():
        try:
            one.warp(header.blank(), **options)
        except IpmError as error:
            raise type(error)(f"{header.path} (mode {header.mode}): {error}") from error
