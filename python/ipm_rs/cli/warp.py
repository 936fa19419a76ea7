"""``ipm-rs warp``: camera images to bird's-eye views."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import ipm_rs
from ipm_rs import calibration, streams
from ipm_rs.cli import cluster, stream
from ipm_rs.cli.arguments import (
    Commands,
    add_camera,
    add_grid,
    add_ground,
    add_image_size,
    check_not_input,
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
from ipm_rs.cli.stream import with_axes
from ipm_rs.cli.tables import table_of
from ipm_rs.errors import ArgumentError, FileError, ImageError, IpmError
from ipm_rs.files import images
from ipm_rs.streams import folder
from ipm_rs.streams.ordered import cpus, ordered

_LINES = 20
"""Of more images, one line tells of all."""


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    warp = commands.add_parser(
        "warp",
        help="warp camera images to bird's-eye views",
        description="""\
Warp camera images to metric bird's-eye views. Row 0 is far ahead, column 0 is to the left; metres are those of the
vehicle frame of the calibration: x forward, y left, z up.

The input is one or several images, a folder of them, a "pattern", a .txt list of paths, a video, a ROS bag or MCAP, or
a drive of KITTI raw, KITTI odometry, nuScenes, Argoverse 2 or DGP (bags and drives named for CALIBRATION too: their own
is taken); the output a file for one image, else a folder or a video (.mp4 .mov .mkv .webm .avi). Frames are decoded,
warped and encoded on --jobs threads. After a stop, --skip-existing goes on.

Images may be grey, 16-bit grey, colour, with alpha, or label images with a palette (nearest and mode only; indices and
palette are kept). EXIF orientation is not applied: the calibration belongs to the pixels as they are stored. Of several
images, a damaged one is told of and left out; the others are made, and the exit status is 2. The extension of the
output decides its format: """
        + " ".join(images.FORMATS)
        + ".\n\n"
        + f"The format of the calibration is recognised: {', '.join(calibration.FORMATS)}.",
        examples="""\
  ipm-rs warp camera.json frame.png -o bev.png
  ipm-rs warp camera.json frame.png -o bev.png --x 7 50 --y -10 10 --resolution 0.05 0.025 --sample-at corner
  ipm-rs warp camera.json frames/*.png -o bevs/ --mask bevs/valid.png
  ipm-rs warp camera.json frames/ -o bevs/ --skip-existing
  ipm-rs warp camera.json drive.mp4 -o bev.mp4 --start 60 --end 90
  ipm-rs warp camera.json run.mcap --topic /front/image_raw -o bev.mp4
  ipm-rs warp 2011_09_26_drive_0001_sync/ 2011_09_26_drive_0001_sync/ -o bevs/
  ipm-rs warp camera.json drive.mp4 -o bev.mp4 --poses pitch.csv --mask-video seen.mp4
  ipm-rs warp camera.json frame.png -o bev.png --resolution 0.1 --axes
  ipm-rs warp camera.json s3://bucket/frames -o s3://bucket/bevs --ray auto
  ipm-rs warp calib/000114.txt 000114.png -o bev.png --image-size 1242 375 --ground -1.73
  ipm-rs warp v1.0-mini/calibrated_sensor.json front.jpg -o bev.png --camera CAM_FRONT
  ipm-rs warp camera.json frame.png -o bev.png --resolution 0.1 --interpolation area
  ipm-rs warp camera.json labels.png -o bev_labels.png --interpolation mode --border-value 255""",
    )
    add = warp.add_argument
    add("calibration", metavar="CALIBRATION", help="camera calibration, a file or directory of a format named above")
    add("images", metavar="IMAGE", nargs="+", help="images of the calibration's size, a folder, a video, a bag")
    add(
        "-o",
        "--output",
        metavar="OUT",
        required=True,
        help="a file for one image; a directory for several, which get the names <image>_bev.png; or a video",
    )
    grid = add_grid(warp, "where a cell is sampled")
    add_ground(grid, of_drives=True)
    pixels = warp.add_argument_group("pixels")
    pixels.add_argument(
        "--interpolation",
        choices=("nearest", "bilinear", "cubic", "lanczos4", "area", "mode"),
        default="bilinear",
        help="bilinear; area, the mean of all that a cell covers, without aliasing near the car; nearest and mode, the "
        "id that most of a cell has, for labels; cubic and lanczos4, as OpenCV's, not for roads (default: bilinear)",
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
    running.add_argument(
        "--mask-video", metavar="PATH", type=Path, help="also write a video of the mask of each frame, 255 or 0"
    )
    running.add_argument(
        "--poses",
        metavar="CSV",
        help="how the camera stood at each frame: name, frame or timestamp, then pitch_deg, roll_deg, yaw_deg, x, y, "
        "z, or vehicle_pitch_deg, vehicle_roll_deg, vehicle_z on top of the calibration; each frame has its own table",
    )
    running.add_argument(
        "--axes",
        action="store_true",
        help="draw axes in metres around each view, and hatch what the camera does not see",
    )
    running.add_argument("--jobs", metavar="N", type=count, help="frames at a time (default: the CPUs there are)")
    running.add_argument(
        "--ray",
        metavar="ADDRESS",
        nargs="?",
        const="",
        help="on a Ray cluster: --jobs workers take the images in partitions, and the same command after a stop goes "
        "on; IMAGE and OUT may be URIs (s3://...). ADDRESS is the cluster's, or auto; without one, what RAY_ADDRESS "
        "says, or the CPUs there are",
    )
    running.add_argument("--every", metavar="N", type=count, default=1, help="only every so many-th frame")
    running.add_argument("--start", metavar="S", type=real, help="seconds from the first frame to begin at")
    running.add_argument("--end", metavar="S", type=real, help="seconds from the first frame to end before")
    running.add_argument(
        "--topic", metavar="NAME", help="which images of a bag; the error lists them where it is needed"
    )
    running.add_argument("--scene", metavar="NAME", help="which scene of nuScenes, where there are several")
    running.add_argument(
        "--rotation",
        choices=("refuse", "ignore", "apply"),
        default="refuse",
        help="of a video that asks to be turned: the calibration is of the stored pixels (ignore) or the turned ones "
        "(apply); refused by default",
    )
    running.add_argument("--skip-existing", action="store_true", help="leave out what is there already: goes on")
    running.add_argument("--strict", action="store_true", help="stop at the first image or frame that fails")
    running.add_argument(
        "--png-level",
        metavar="N",
        type=int,
        choices=range(10),
        default=1,
        help="compression of PNG, 0 to 9 (default: 1; 6 takes three times as long for files a seventh smaller)",
    )
    running.add_argument("--threads", metavar="N", type=count, help="threads of a warp (default: the CPUs there are)")
    running.add_argument("--force", action="store_true", help="replace existing outputs")
    running.add_argument("--quiet", action="store_true", help="print nothing but warnings and errors")
    warp.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Check everything, then warp image after image."""
    grid = ipm_rs.BevGrid(x=args.x, y=args.y, resolution=resolution(args.resolution), sample_at=args.sample_at)
    options: dict[str, Any] = {
        "interpolation": args.interpolation,
        "border_value": args.border_value[0] if len(args.border_value) == 1 else tuple(args.border_value),
        "threads": args.threads,
    }
    if args.ray is not None:
        args.ground = args.ground or 0.0
        cluster.run(args, grid, options)
        return
    far = next((name for name in args.images if "://" in name), None)
    if far is not None:
        raise ArgumentError(f"{far}: expected files of this machine, got a URI; give --ray, which reads it")
    args.images = [Path(name) for name in args.images]
    if stream.concerns(args):
        stream.run(args, grid, options)
        return
    args.ground = args.ground or 0.0
    camera = load_camera_sized(args)
    if len(args.images) == 1 and folder.is_several(str(args.images[0])):
        several = args.images[0]
        args.images = folder.paths_of(str(several))
        if Path(args.output).suffix.lower() in images.FORMATS:
            raise ArgumentError(f"-o: expected a directory for the images of {several}, got {args.output}; give one")
        args.output = args.output.rstrip(os.sep) + os.sep  # a directory, also for a single image
    if args.start is not None or args.end is not None:
        raise ArgumentError("--start: expected a video, got images, which have no time; leave --start and --end out")
    args.images = args.images[:: args.every]
    found, failed = read_headers(images.probe, args.images)
    headers = [header for header in found if header is not None]
    for header in headers:
        _check_image(header, camera, args.interpolation)
    outputs = _outputs(args, headers)
    _check_outputs(outputs, headers, args)
    _rehearse(headers, options)
    show_progress = len(headers) > 1 and not args.quiet and sys.stderr.isatty()
    progress: Progress = progress_bar("image") if show_progress else no_progress

    lut = table_of(camera, grid, args.ground, may_be_empty=args.poses is not None)
    tables = None if args.poses is None else streams.per_frame(camera, grid, args.poses, ground=args.ground)
    mask = lut.mask
    jobs = min(args.jobs or cpus(), len(headers))
    if jobs > 1:
        options["threads"] = args.threads or 1  # the images are work enough for all CPUs

    def warp(job: tuple[int, images.Header, Path]) -> float | None:
        index, header, output = job
        if args.skip_existing and output.exists():
            return None
        pixels, look = images.read(header.path)
        table = lut if tables is None else tables(streams.Frame(pixels, header.path.stem, index))
        start = perf_counter()
        bev = table.warp(pixels, **options)
        milliseconds = 1e3 * (perf_counter() - start)
        output.parent.mkdir(parents=True, exist_ok=True)
        if args.axes:
            bev, look = with_axes(bev, table), images.Look("RGB")
        images.write(output, bev, look, level=args.png_level)
        return milliseconds

    places = {path: index for index, path in enumerate(args.images)}
    tasks = [
        (args.every * places[header.path], header, output) for header, output in zip(headers, outputs, strict=True)
    ]
    begin, done, skipped = perf_counter(), 0, 0
    line_each = not args.quiet and len(headers) <= _LINES
    rows, cols = lut.shape
    with (
        progress(tasks) as (steps, say),
        contextlib.closing(ordered(tasks, warp, jobs)) as results,
    ):
        for _, ((_, _, output), future) in zip(steps, results, strict=False):  # the bar moves with what is done
            try:
                milliseconds = future.result()
            except (FileError, ImageError) as error:  # one damaged frame does not stop the others
                if len(args.images) == 1 or args.strict or "expected to write" in str(error):
                    raise
                failed += 1
                say(error_line(error), sys.stderr)
                continue
            if milliseconds is None:
                skipped += 1
                continue
            done += 1
            if line_each:
                say(f"{output}  {cols} x {rows}  {100 * mask.mean():.1f} % valid  {milliseconds:.2f} ms", sys.stdout)
    if not args.quiet and (not line_each or skipped):
        seconds = perf_counter() - begin
        there = f", {skipped} were there" if skipped else ""
        emit(f"{args.output}  {done} images{there}  {cols} x {rows}  {100 * mask.mean():.1f} % valid  {seconds:.1f} s")
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
    labels = next((header.path for header in headers if args.axes and header.mode in ("P", "1")), None)
    if labels is not None:
        raise ArgumentError(f"--axes: expected grey or colour images, got labels in {labels}; leave it out")
    modes = ["RGB" if args.axes else header.mode for header in headers]
    contents = [(output, mode, str(header.path)) for output, mode, header in zip(outputs, modes, headers, strict=True)]
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
        check_not_input(path, sources)
        check_output(path, may_exist=args.force or args.skip_existing, may_make=path.parent == directory)


def _rehearse(headers: list[images.Header], options: dict[str, Any]) -> None:
    """Warp one pixel of each kind of image, so that what the core refuses is refused before any work."""
    one = ipm_rs.Lut.from_maps(np.zeros((1, 1), np.float32), np.zeros((1, 1), np.float32), source_size=(1, 1))
    for header in {header.mode: header for header in headers}.values():
        try:
            one.warp(header.blank(), **options)
        except IpmError as error:
            raise type(error)(f"{header.path} (mode {header.mode}): {error}") from error
