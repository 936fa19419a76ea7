"""``ipm-rs cloud``: depth images to point clouds and pictures of them from above."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ipm_rs
from ipm_rs import pointfile
from ipm_rs.cli.arguments import (
    Commands,
    add_camera,
    add_grid,
    check_not_input,
    check_output,
    count,
    load_camera,
    output_names,
    read_headers,
    real,
    resolution,
)
from ipm_rs.cli.printing import Progress, emit, error_line, no_progress, progress_bar
from ipm_rs.errors import ArgumentError, CalibrationError, FileError, ImageError
from ipm_rs.files import depth as depthfile
from ipm_rs.files import images

RAMP = np.array([(24, 28, 84), (0, 110, 150), (60, 170, 90), (240, 220, 60), (255, 255, 255)], dtype=np.float64)
"""Colours of heights, low to high, for the picture."""

_HIGHEST = 1e5  # metres, as of a road


@dataclass(frozen=True)
class _Job:
    """One depth image, its colours if there are any, and what is to be written."""

    depth: depthfile.Header
    colours: images.Header | None
    cloud: Path | None
    picture: Path | None


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    cloud = commands.add_parser(
        "cloud",
        help="depth images to point clouds, and to pictures from above",
        description="""\
Make point clouds of depth images: a point for each pixel, in metres, coloured by a camera image if there is one. And
pictures of them from above, row 0 far ahead, column 0 to the left: each cell shows the colour of its highest point,
or, without colours, its height.

Depth may be CARLA's colour code (an RGB or RGBA image), a 16-bit image with --depth-scale, or metres in a float TIFF,
.npy or .npz. The ending of a point cloud decides its format: """
        + " ".join(pointfile.FORMATS)
        + """.

Of several depth images, a damaged one is told of and left out; the others are made, and the exit status is 2.""",
        examples="""\
  ipm-rs cloud camera.json depth.png --rgb frame.png -o cloud.ply --bev bev.png
  ipm-rs cloud camera.json depth_mm.png --depth-scale 0.001 --max-depth 40 -o cloud.pcd
  ipm-rs cloud camera.json depth/*.npy -o clouds/ --bev bevs/ --x 0 60 --y -20 20 --resolution 0.1
  ipm-rs cloud calib.txt depth.npy --camera P2 --frame flu --bev above.png""",
    )
    add = cloud.add_argument
    add("calibration", metavar="CALIBRATION", help="camera calibration, in any of the formats that Camera.load reads")
    add("depth", metavar="DEPTH", nargs="+", type=Path, help="depth images, all of the calibration's size")
    add("--rgb", metavar="IMAGE", nargs="+", type=Path, help="camera images, one for each depth image, in their order")
    add("-o", "--output", metavar="OUT", help="the point cloud; a directory for several, which get <depth>.ply")
    add("--bev", metavar="PICTURE", help="the picture from above; a directory for several, which get <depth>_bev.png")
    depth = cloud.add_argument_group("depth")
    depth.add_argument(
        "--depth-scale", metavar="M", type=real, help="metres per unit of a 16-bit image (0.001 for millimetres)"
    )
    depth.add_argument("--min-depth", metavar="M", type=real, help="leave out what is nearer")
    depth.add_argument("--max-depth", metavar="M", type=real, help="leave out what is farther (CARLA's sky is at 1000)")
    depth.add_argument(
        "--kind", choices=("z", "ray"), default="z", help="planar depth, or distance from the camera (default: z)"
    )
    depth.add_argument("--stride", metavar="N", type=count, default=1, help="every N-th row and column (default: 1)")
    camera = cloud.add_argument_group("camera")
    add_camera(camera)
    camera.add_argument(
        "--frame",
        choices=("vehicle", "flu", "camera"),
        default="vehicle",
        help="of the points: vehicle, flu (the camera's: forward, left, up) or camera (optical) (default: vehicle)",
    )
    grid = add_grid(cloud)
    grid.add_argument(
        "--heights",
        metavar=("MIN", "MAX"),
        nargs=2,
        type=real,
        help="metres at the ends of the picture's colours (default: what 98 %% of the cells have)",
    )
    running = cloud.add_argument_group("run")
    running.add_argument("--threads", metavar="N", type=count, help="threads (default: the CPUs there are)")
    running.add_argument("--force", action="store_true", help="replace existing outputs")
    running.add_argument("--quiet", action="store_true", help="print nothing but warnings and errors")
    cloud.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Check everything, then make cloud after cloud."""
    if args.output is None and args.bev is None:
        raise ArgumentError("expected -o or --bev, got neither; say what to write")
    if args.bev is not None and args.frame == "camera":
        raise ArgumentError("--frame: expected vehicle or flu for --bev, got camera, whose z points forward")
    if args.heights is not None and not -_HIGHEST <= args.heights[0] < args.heights[1] <= _HIGHEST:
        raise ArgumentError(
            f"--heights: expected MIN < MAX in metres, within {_HIGHEST:g}, got {args.heights[0]:g} {args.heights[1]:g}"
        )
    grid = ipm_rs.BevGrid(x=args.x, y=args.y, resolution=resolution(args.resolution))
    depths, _ = read_headers(lambda path: depthfile.probe(path, args.depth_scale), args.depth)
    camera = _read_camera(args, next(depth.size for depth in depths if depth is not None))
    jobs = _jobs(args, depths, camera)
    show_progress = len(jobs) > 1 and not args.quiet and sys.stderr.isatty()
    progress: Progress = progress_bar("cloud") if show_progress else no_progress
    failed = len(depths) - len(jobs)
    with progress(jobs) as (steps, say):
        for job in steps:
            try:
                lines = _make(job, camera, grid, args)
            except (FileError, ImageError) as error:  # one damaged frame does not stop the others
                if len(depths) == 1:
                    raise
                failed += 1
                say(error_line(error), sys.stderr)
                continue
            if not args.quiet:
                for line in lines:
                    say(line, sys.stdout)
    if failed:
        raise FileError(f"{failed} of {len(depths)} depth images failed, see above; the others were written")


def _read_camera(args: argparse.Namespace, size: tuple[int, int]) -> ipm_rs.Camera:
    """Read the calibration; the size of the first depth image is for formats that do not hold one."""
    try:
        return load_camera(args, size)
    except CalibrationError as error:
        # a file that states another size: the comparison of the two says so better
        try:
            return load_camera(args, None)
        except CalibrationError:
            raise error from None


def _jobs(args: argparse.Namespace, depths: list[depthfile.Header | None], camera: ipm_rs.Camera) -> list[_Job]:
    """Refuse images that do not fit and outputs that exist, coincide or are inputs; nothing is written here.

    A pair of which one is damaged makes no job.
    """
    colours: list[images.Header | None] = [None] * len(depths)
    if args.rgb is not None:
        if len(args.rgb) != len(depths):
            raise ArgumentError(f"--rgb: expected {len(depths)} images, one for each depth image, got {len(args.rgb)}")
        colours, _ = read_headers(images.probe, args.rgb)
    for colour in colours:
        if colour is not None and colour.mode not in ("L", "RGB", "RGBA"):
            raise ImageError(f"{colour.path}: expected a grey or RGB image, got mode {colour.mode}; convert it")
    for image in (*depths, *colours):
        if image is not None and tuple(image.size) != tuple(camera.image_size):
            (width, height), (wanted_width, wanted_height) = image.size, camera.image_size
            raise ImageError(
                f"{image.path}: expected {wanted_width}x{wanted_height} pixels, as the calibration was made for, got "
                f"{width}x{height}; give images of that size, or camera.resized() in Python"
            )
    clouds = _outputs("-o", args.output, args.depth, ".ply")
    pictures = _outputs("--bev", args.bev, args.depth, "_bev.png")
    jobs = [
        _Job(depth, colour, cloud, picture)
        for depth, colour, cloud, picture in zip(depths, colours, clouds, pictures, strict=True)
        if depth is not None and (colour is not None or args.rgb is None)
    ]
    _check_outputs(jobs, args)
    return jobs


def _outputs(option: str, text: str | None, sources: list[Path], ending: str) -> list[Path] | list[None]:
    if text is None:
        return [None] * len(sources)
    return output_names(option, text, sources, lambda source: f"{source.stem}{ending}", "depth images")


def _check_outputs(jobs: list[_Job], args: argparse.Namespace) -> None:
    sources = [Path(args.calibration), *args.depth, *(args.rgb or [])]
    taken: set[str] = set()
    for path in (path for job in jobs for path in (job.cloud, job.picture) if path is not None):
        name = os.path.normcase(os.path.realpath(path))
        if name in taken:
            raise ArgumentError(f"{path}: expected an output of its own for each depth image, got it twice; rename one")
        taken.add(name)
        check_not_input(path, sources)
        made = path.parent == Path(args.output or "") or path.parent == Path(args.bev or "")
        check_output(path, may_exist=args.force, may_make=made)
    for job in jobs:
        if job.cloud is not None:
            pointfile.check_name(job.cloud)
        if job.picture is not None:
            images.check_format(job.picture, "RGB", "the picture")


def _make(job: _Job, camera: ipm_rs.Camera, grid: ipm_rs.BevGrid, args: argparse.Namespace) -> list[str]:
    """Make one cloud and its picture; returns what to say about them."""
    depth = depthfile.read(job.depth)
    rgb = None
    if job.colours is not None:
        pixels, _ = images.read(job.colours.path)
        rgb = np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else np.ascontiguousarray(pixels[..., :3])
    start = perf_counter()
    points, index = ipm_rs.points_from_depth(
        depth,
        camera,
        frame=args.frame,
        kind=args.kind,
        depth_scale=job.depth.scale,
        min_depth=args.min_depth,
        max_depth=args.max_depth,
        stride=args.stride,
        compact=True,
        threads=args.threads,
    )
    colours = None if rgb is None else rgb.reshape(-1, 3)[index]
    milliseconds = 1e3 * (perf_counter() - start)
    lines = []
    if job.cloud is not None:
        values = {} if colours is None else dict(zip(pointfile.COLOURS, colours.T, strict=True))
        job.cloud.parent.mkdir(parents=True, exist_ok=True)
        pointfile.write(job.cloud, points, values, force=args.force)
        lines.append(f"{job.cloud}  {len(points)} points  {milliseconds:.2f} ms")
    if job.picture is not None:
        start = perf_counter()
        picture, layers, about = _picture(points, colours, grid, args)
        milliseconds = 1e3 * (perf_counter() - start)
        job.picture.parent.mkdir(parents=True, exist_ok=True)
        images.write(job.picture, picture, images.Look("RGB"))
        rows, columns = grid.shape
        filled = 100 * float(np.count_nonzero(layers["count"])) / (rows * columns)
        lines.append(
            f"{job.picture}  {columns} x {rows}  {layers.inside} of {len(points)} points on the grid, {filled:.1f} % "
            f"of its cells  {about}  {milliseconds:.2f} ms"
        )
        if layers.inside == 0:
            emit(
                f"ipm-rs: warning: {job.picture}: no point is on the grid; check --x, --y, --frame and the calibration",
                sys.stderr,
            )
    return lines


def _picture(
    points: NDArray[Any], colours: NDArray[np.uint8] | None, grid: ipm_rs.BevGrid, args: argparse.Namespace
) -> tuple[NDArray[np.uint8], ipm_rs.Layers, str]:
    """Draw the cloud from above: the colours of the highest points, or the heights; cells without points are black."""
    if colours is not None:
        layers = ipm_rs.rasterize(points, grid, colours, ("count", "top"), threads=args.threads)
        return np.nan_to_num(layers["top"], nan=0.0).astype(np.uint8), layers, "colours of the highest points"
    layers = ipm_rs.rasterize(points, grid, reduce=("count", "max"), threads=args.threads)
    height, there = layers["max"], layers["count"] > 0
    if args.heights is not None:
        low, high = args.heights
    else:
        low, high = np.percentile(height[there], (1, 99)) if there.any() else (0.0, 1.0)
        high = max(high, low + 0.01)  # of a level road, the noise is not worth all of the colours
    share = np.clip((np.where(there, height, low) - low) / (high - low), 0, 1) * (len(RAMP) - 1)
    ramp = [np.interp(share, np.arange(len(RAMP)), channel) for channel in RAMP.T]
    picture = np.where(there[..., None], np.stack(ramp, axis=-1), 0).astype(np.uint8)
    return picture, layers, f"heights {low:.2f} to {high:.2f} m"
