"""``ipm-rs rig``: one bird's-eye view of several cameras."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ipm_rs
from ipm_rs.cli import rig_stream
from ipm_rs.cli.arguments import (
    Commands,
    add_grid,
    add_ground,
    add_reading,
    check_apart,
    check_not_input,
    check_output,
    count,
    load_rig,
    real,
    resolution,
    value,
)
from ipm_rs.cli.printing import Progress, emit, error_line, no_progress, progress_bar
from ipm_rs.cli.tables import check_sees
from ipm_rs.errors import ArgumentError, FileError, ImageError, IpmError
from ipm_rs.files import images

# Colours of cameras in the picture of --source, far from each other for the eye; then they begin again.
_COLOURS = (
    (230, 97, 1), (94, 60, 153), (27, 158, 119), (231, 41, 138), (102, 166, 30), (56, 108, 176), (166, 118, 29),
    (102, 102, 102),
)  # fmt: skip


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    rig = commands.add_parser(
        "rig",
        help="one bird's-eye view of several cameras",
        description="""\
One metric bird's-eye view of all cameras of a vehicle. RIG is what Rig.save wrote, or any file or directory that holds
several cameras: nuScenes, Argoverse 2, Waymo, KITTI, a Kalibr chain, a directory with a calibration for each camera.
Each cell shows the camera that resolves it best, mixed along seams.

Give an image for each camera, or a directory of images: then the first files of all make the first view, and so on, in
the order of their names. An image that cannot be read is left out with --missing, else its view is.

Or give each camera a video, a topic of a bag (run.mcap:/front/image_raw), a folder or a drive, and a folder or a video
(.mp4 .mov .mkv .webm .avi) for the views: each frame of the first camera makes one, with the pictures of the others
that are nearest in time.""",
        examples="""\
  ipm-rs rig rig.json front=f.png left=l.png back=b.png right=r.png -o bev.png
  ipm-rs rig rig.json front=f.png left=l.png back=b.png right=r.png -o bev.png --exclude -1 3.8 -0.95 0.95 --gains
  ipm-rs rig log/ ring_front_center=front/ ring_front_left=left/ -o bevs/ --ground -0.33 --missing next
  ipm-rs rig rig.json front=front.mp4 left=left.mp4 back=back.mp4 right=right.mp4 -o bev.mp4
  ipm-rs rig rig.json front=run.mcap:/front/image_raw left=run.mcap:/left/image_raw -o bev.mp4 --missing border
  ipm-rs rig rig.json front=labels_f.png left=labels_l.png -o bev.png --interpolation mode""",
    )
    rig.add_argument("rig", metavar="RIG", help="calibration of all cameras, a file or a directory")
    rig.add_argument(
        "images", metavar="NAME=IMAGE", nargs="+", help="the image of each camera, or its directory, video or topic"
    )
    rig.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        required=True,
        type=Path,
        help="a file; a directory where images are directories; a video",
    )
    grid = add_grid(rig, "where a cell is sampled", x=(-10.0, 10.0))
    add_ground(grid)
    grid.add_argument(
        "--bowl",
        metavar=("FLAT", "RADIUS"),
        nargs=2,
        type=real,
        help="a surface that is flat within FLAT metres of the grid's middle and rises in an arc of RADIUS outside",
    )
    grid.add_argument(
        "--exclude",
        metavar=("XMIN", "XMAX", "YMIN", "YMAX"),
        nargs=4,
        type=real,
        action="append",
        default=[],
        help="a rectangle on the ground that is not shown, the own car; may be given several times",
    )
    pixels = rig.add_argument_group("pixels")
    pixels.add_argument(
        "--interpolation",
        choices=("nearest", "bilinear", "cubic", "lanczos4", "area", "mode"),
        default="area",
        help="area, the mean of all that a cell covers; bilinear, faster; nearest and mode for labels; cubic and "
        "lanczos4, as OpenCV's, not for roads (default: area)",
    )
    pixels.add_argument(
        "--border-value", metavar="V", nargs="+", type=value, default=[0], help="of cells that nobody sees (default: 0)"
    )
    pixels.add_argument(
        "--blend",
        choices=("best", "feather", "priority"),
        default="best",
        help="who shows a cell that several see: the one that resolves it best, all, the first (default: best)",
    )
    pixels.add_argument(
        "--feather", metavar="M", type=real, default=0.5, help="metres across which seams are mixed (default: 0.5)"
    )
    pixels.add_argument(
        "--gains", action="store_true", help="make the cameras equally bright, by what two of them see of the same road"
    )
    add_reading(pixels)
    pixels.add_argument(
        "--image-size", metavar=("W", "H"), nargs=2, type=count, help="of all images, if the calibration does not say"
    )
    running = rig.add_argument_group("run")
    running.add_argument(
        "--missing",
        choices=("next", "border"),
        help="what becomes of the cells of a camera without an image, else an error: the next best camera's, or empty",
    )
    running.add_argument("--mask", metavar="PATH", type=Path, help="also write which cells a camera sees, 255 or 0")
    running.add_argument(
        "--source", metavar="PATH", type=Path, help="also write which camera shows each cell, a colour for each"
    )
    running.add_argument("--jobs", metavar="N", type=count, help="frames at a time (default: the CPUs there are)")
    running.add_argument("--every", metavar="N", type=count, default=1, help="only every so many-th frame of streams")
    running.add_argument("--start", metavar="S", type=real, help="seconds from the first frame of streams to begin at")
    running.add_argument("--end", metavar="S", type=real, help="seconds from the first frame of streams to end before")
    running.add_argument(
        "--tolerance",
        metavar="S",
        type=real,
        help="seconds that pictures of one moment may lie apart (default: half of what those of the first camera do)",
    )
    running.add_argument("--threads", metavar="N", type=count, help="threads of a warp (default: the CPUs there are)")
    running.add_argument("--force", action="store_true", help="replace existing outputs")
    running.add_argument("--quiet", action="store_true", help="print nothing but warnings and errors")
    rig.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Check everything, then make view after view."""
    rig = load_rig(args, args.image_size)
    grid = ipm_rs.BevGrid(x=args.x, y=args.y, resolution=resolution(args.resolution), sample_at=args.sample_at)
    sources = sources_of(args.images, rig)
    streamed = rig_stream.concerns(sources, args)
    views = [] if streamed else _views(sources, rig, args)
    outputs = [] if streamed else _outputs(views, args)
    lut = ipm_rs.RigLut(
        rig,
        grid,
        ground=_ground(args, grid),
        exclude=[[[x0, y0], [x1, y0], [x1, y1], [x0, y1]] for x0, x1, y0, y1 in args.exclude],
        blend=args.blend,
        feather=args.feather,
    )
    check_sees(lut)
    options: dict[str, Any] = {
        "interpolation": args.interpolation,
        "border_value": args.border_value[0] if len(args.border_value) == 1 else tuple(args.border_value),
        "threads": args.threads,
        "missing": args.missing,
    }
    if streamed:
        rig_stream.run(args, lut, sources, options)
        _write_maps(lut, args)
        return
    show_progress = len(views) > 1 and not args.quiet and sys.stderr.isatty()
    progress: Progress = progress_bar("view") if show_progress else no_progress
    gains: dict[str, NDArray[np.float32]] | None = None
    failed = 0
    with progress(list(zip(views, outputs, strict=True))) as (jobs, say):
        for paths, output in jobs:
            try:
                pixels, look = _read(paths, rig, args, say)
                if args.gains and len(pixels) == len(rig):
                    gains = lut.gains(pixels, previous=gains)
                view = lut.warp(pixels, gains=gains, **options)
            except IpmError as error:  # one damaged set does not stop the others
                if len(views) == 1:
                    raise
                failed += 1
                say(error_line(error), sys.stderr)
                continue
            output.parent.mkdir(parents=True, exist_ok=True)
            images.write(output, view, look)
            if not args.quiet:
                say(f"{output}  {view.shape[1]} x {view.shape[0]}  {len(pixels)} of {len(rig)} cameras", sys.stdout)
    if failed < len(views):
        _write_maps(lut, args)
    if failed:
        raise FileError(f"{failed} of {len(views)} views could not be made, see above; the others were written")


def sources_of(words: list[str], rig: ipm_rs.Rig) -> dict[str, Path]:
    """Paths of the cameras' images, by their names."""
    found: dict[str, Path] = {}
    for word in words:
        name, equals, path = word.partition("=")
        if not equals or not path:
            raise ArgumentError(f"{word}: expected NAME=IMAGE, got no name; write {next(iter(rig))}={word}")
        if name not in rig:
            raise ArgumentError(f"{word}: expected a camera of the rig, got {name!r}; pass one of {', '.join(rig)}")
        if name in found:
            raise ArgumentError(f"{word}: expected each camera once, got {name!r} twice; leave one out")
        found[name] = Path(path)
    return found


def _views(sources: Mapping[str, Path], rig: ipm_rs.Rig, args: argparse.Namespace) -> list[dict[str, Path]]:
    """Return the files that make each view."""
    lacking = [name for name in rig if name not in sources]
    if lacking and args.missing is None:
        raise ArgumentError(
            f"NAME=IMAGE: expected one for each camera, got none for {', '.join(lacking)}; give it, or --missing next"
        )
    folders = [name for name, path in sources.items() if path.is_dir()]
    if not folders:
        return [dict(sources)]
    if len(folders) < len(sources):
        single = next(name for name in sources if name not in folders)
        raise ArgumentError(
            f"{single}={sources[single]}: expected a directory, as {folders[0]}={sources[folders[0]]} is, got a file; "
            "give all cameras files, or all directories"
        )
    listed = {
        name: sorted(entry for entry in path.iterdir() if entry.suffix.lower() in images.FORMATS)
        for name, path in sources.items()
    }
    counts = {name: len(files) for name, files in listed.items()}
    if len(set(counts.values())) > 1 or 0 in counts.values():
        text = ", ".join(f"{name} {number}" for name, number in counts.items())
        raise ArgumentError(f"NAME=DIRECTORY: expected as many images for each camera, at least one, got {text}")
    return [dict(zip(listed, files, strict=True)) for files in zip(*listed.values(), strict=True)]


def _outputs(views: list[dict[str, Path]], args: argparse.Namespace) -> list[Path]:
    """Names of the outputs, checked: none is an input, none exists unless that is allowed."""
    first = next(iter(views[0]))
    names_directory = args.output.is_dir() or str(args.output).endswith(os.sep)
    several = len(views) > 1 or names_directory
    if several and args.output.exists() and not args.output.is_dir():
        raise ArgumentError(f"-o: expected a directory for {len(views)} views, got {args.output}, which is a file")
    outputs = [args.output / f"{view[first].stem}_bev.png" if several else args.output for view in views]
    extra = [path for path in (args.mask, args.source) if path is not None]
    inputs = [Path(args.rig), *(path for view in views for path in view.values())]
    check_apart((*outputs, *extra))
    for path in (*outputs, *extra):
        images.check_format(path, "L" if path in extra else "RGB", "the view")
        check_not_input(path, inputs)
        check_output(path, may_exist=args.force, may_make=several and path.parent == args.output)
    return outputs


def _ground(args: argparse.Namespace, grid: ipm_rs.BevGrid) -> float | ipm_rs.Bowl:
    if args.bowl is None:
        return float(args.ground)
    flat, radius = args.bowl
    center = (sum(grid.x) / 2, sum(grid.y) / 2)
    return ipm_rs.Bowl(flat=flat, radius=radius, center=center, height=args.ground)


def _read(
    paths: Mapping[str, Path], rig: ipm_rs.Rig, args: argparse.Namespace, say: Any
) -> tuple[dict[str, NDArray[Any]], images.Look]:
    """Read the images of a view; with --missing, those that can be read."""
    pixels: dict[str, NDArray[Any]] = {}
    look: images.Look | None = None
    for name, path in paths.items():
        try:
            header = images.probe(path)
            width, height = rig[name].image_size
            if header.size != (width, height):
                raise ImageError(
                    f"{path}: expected {width}x{height} pixels, as camera {name!r} has, got "
                    f"{header.size[0]}x{header.size[1]}; use the original, or --image-size"
                )
            image, own = images.read(path)
        except FileError as error:
            if args.missing is None:
                raise
            say(error_line(error), sys.stderr)
            continue
        if look is not None and own.mode != look.mode:
            raise ImageError(f"{path}: expected an image of mode {look.mode}, as the others are, got {own.mode}")
        pixels[name], look = image, look or own
    if look is None:
        raise FileError("expected at least one image that can be read, got none, see above")
    return pixels, look


def _write_maps(lut: ipm_rs.RigLut, args: argparse.Namespace) -> None:
    if args.mask is not None:
        images.write(args.mask, np.where(lut.mask, np.uint8(255), np.uint8(0)), images.Look("L"))
    if args.source is not None:
        source = lut.source
        colours = np.array([*(_COLOURS[k % len(_COLOURS)] for k in range(len(lut.rig))), (0, 0, 0)], np.uint8)
        images.write(args.source, colours[source], images.Look("RGB"))
        if not args.quiet:
            for place, name in enumerate(lut.rig):
                share = 100 * float((source == place).mean())
                red, green, blue = _COLOURS[place % len(_COLOURS)]
                emit(f"{args.source}  {name}: #{red:02x}{green:02x}{blue:02x}, {share:.1f} % of the cells")
