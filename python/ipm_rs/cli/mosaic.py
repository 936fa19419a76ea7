"""``ipm-rs mosaic``: a map of the road from a drive."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import ipm_rs
from ipm_rs import streams
from ipm_rs.cli import mosaic_out, mosaic_ray
from ipm_rs.cli.arguments import (
    Commands,
    add_camera,
    add_image_size,
    count,
    real,
)
from ipm_rs.cli.drive import Poses, cameras_of, stream_of
from ipm_rs.cli.frames import Counted
from ipm_rs.cli.mosaic_names import Names
from ipm_rs.cli.printing import emit, error_line, no_progress, progress_bar
from ipm_rs.errors import ArgumentError, DtypeError, FileError, ImageError
from ipm_rs.streams.ordered import cpus, ordered

_TOLD = 5
"""So many errors of frames are printed; the summary counts the others."""


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    mosaic = commands.add_parser(
        "mosaic",
        help="make a map of the road from a drive",
        description="""\
Add every frame of a drive to a map of the road, of tiles in a folder, and draw it. A run that was stopped goes on where
it was when the same command is given again: a frame is added once, also from a folder that was moved. A folder that
holds a map already gets the frames of another drive in addition, whatever their files are called.

The map's axes are those of the poses. Each cell is made of the frames that resolve it best.""",
        examples="""\
  ipm-rs mosaic calib.txt image_0/ --poses poses.txt --poses-of camera -o map/
  ipm-rs mosaic sequences/00 sequences/00 -o map/ --picture map.png    # a dataset that has its poses
  ipm-rs mosaic camera.json drive.mp4 --poses drive.tum --distance 4 15 --resolution 0.02 -o map/
  ipm-rs mosaic camera.json drive.mp4 --poses drive.tum -o map/ --tiles site/    # site/index.html shows it
  ipm-rs mosaic camera.json drive.mp4 --poses drive.tum -o map/ --geotiff map.tif --crs EPSG:32632 --origin 691e3 5336e3
  ipm-rs mosaic rig.json front=front.mp4 left=left.mp4 right=right.mp4 --poses drive.tum -o map/ --gains
  ipm-rs mosaic camera.json labels/ --poses poses.txt -o labels-map/ --labels
  ipm-rs mosaic camera.json frames/ --poses poses.txt -o map/ --ray    # on a cluster""",
    )
    mosaic.add_argument("calibration", metavar="CALIBRATION", help="calibration of the camera, or of a rig")
    mosaic.add_argument(
        "streams",
        metavar="STREAM",
        nargs="+",
        help="a folder of images, a pattern, a video, a bag or a dataset; of a rig NAME=STREAM for each camera",
    )
    mosaic.add_argument("-o", "--output", metavar="MAP", type=Path, required=True, help="the map's folder")
    drive = mosaic.add_argument_group("drive")
    drive.add_argument("--poses", metavar="FILE", help="where the vehicle was; needed where STREAM does not say it")
    drive.add_argument(
        "--poses-of",
        choices=("vehicle", "camera"),
        help="what the poses of FILE are of: the vehicle, or the camera, of a rig the first that is named (default: "
        "the camera in KITTI's form, 12 numbers a line, else the vehicle)",
    )
    drive.add_argument("--start", metavar="S", type=real, help="seconds from the beginning")
    drive.add_argument("--end", metavar="S", type=real, help="seconds from the beginning")
    drive.add_argument("--every", metavar="N", type=count, default=1, help="every so many-th frame (default: 1)")
    drive.add_argument(
        "--max-step",
        metavar="M",
        type=real,
        default=50.0,
        help="refuse poses of consecutive frames that are farther apart (default: 50)",
    )
    cells = mosaic.add_argument_group("map")
    cells.add_argument("--resolution", metavar="D", type=real, default=0.05, help="metres a cell (default: 0.05)")
    cells.add_argument("--tile", metavar="N", type=count, default=512, help="cells along a tile's side (default: 512)")
    cells.add_argument(
        "--distance",
        metavar=("MIN", "MAX"),
        nargs=2,
        type=real,
        default=[0.0, 40.0],
        help="metres from the vehicle that a frame shows (default: 0 40)",
    )
    cells.add_argument(
        "--ground",
        metavar="HEIGHT",
        default="wheels",
        help="height of the road in the map, or wheels: the plane under the vehicle at each pose (default)",
    )
    cells.add_argument(
        "--samples",
        metavar="N",
        type=count,
        help="keep the values of N frames a cell, for --blend robust and feathered (default: 8 with these, else none)",
    )
    cells.add_argument("--labels", action="store_true", help="images are of labels, which are voted on and never mixed")
    cells.add_argument("--gains", action="store_true", help="make each frame as bright as the map so far")
    camera = mosaic.add_argument_group("calibration")
    add_camera(camera)
    add_image_size(camera)
    camera.add_argument("--mask", metavar="IMAGE", type=Path, help="white where the camera shows the road")
    out = mosaic.add_argument_group("output")
    out.add_argument(
        "--blend",
        choices=("weighted", "best", "mean", "robust", "feathered", "labels"),
        help="how cells are drawn: weighted by what frames resolve (default); robust, without what stood there for few "
        "frames; best, the one frame that resolves the cell best; feathered, the same with seams mixed; mean, of all "
        "frames; labels, their votes (default where the map is of labels)",
    )
    out.add_argument("--picture", metavar="PNG", type=Path, help="also draw the map, with axes in metres")
    out.add_argument("--x", metavar=("MIN", "MAX"), nargs=2, type=real, help="of the picture (default: all)")
    out.add_argument("--y", metavar=("MIN", "MAX"), nargs=2, type=real, help="of the picture (default: all)")
    out.add_argument("--no-track", action="store_true", help="do not draw where the vehicle went on the picture")
    out.add_argument("--tiles", metavar="DIR", type=Path, help="also write XYZ tiles and a page that shows them")
    out.add_argument("--geotiff", metavar="TIF", type=Path, help="also write a GeoTIFF, x to the east, y to the north")
    out.add_argument("--crs", metavar="CRS", help="coordinate system of --geotiff, such as EPSG:32632")
    out.add_argument(
        "--origin", metavar=("E", "N"), nargs=2, type=real, help="where the map's (0, 0) lies in it (default: 0 0)"
    )
    running = mosaic.add_argument_group("run")
    running.add_argument(
        "--ray",
        metavar="ADDRESS",
        nargs="?",
        const="",
        help="add the frames on a Ray cluster: this one, or that of RAY_ADDRESS, or one of this machine's CPUs",
    )
    running.add_argument(
        "--strict", action="store_true", help="stop at the first frame that cannot be read or does not fit"
    )
    running.add_argument("--force", action="store_true", help="replace an existing picture or GeoTIFF")
    running.add_argument("--quiet", action="store_true", help="print nothing but warnings and errors")
    mosaic.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Check every argument, add frame after frame, draw, and tell what was done."""
    mosaic_out.check(args)
    if args.labels and args.gains:
        raise ArgumentError("--gains: expected none with --labels, got both; labels have no brightness")
    cameras, sources = cameras_of(args)
    stream = stream_of(cameras, sources, args)
    mosaic_out.check_inputs(args, sources.values(), stream)
    poses = Poses(args, cameras)
    ground = args.ground if args.ground == "wheels" else _height(args.ground)
    if args.ray is not None:
        mosaic_ray.check(args, sources, poses)
    with mosaic_out.removed_if_empty(args.output), _opened(args) as mosaic:
        done, names = Done(), Names(mosaic, stream, cameras, poses)
        if args.ray is None:
            _add_all(mosaic, stream, cameras, poses, names, ground, args, done)
        else:
            mosaic_ray.add_all(mosaic, stream, cameras, poses, names, ground, args, done)
        begin = perf_counter()
        mosaic.commit()
        done.seconds["write"] += perf_counter() - begin
        if mosaic.tiles or not done.failed:
            mosaic_out.write(mosaic, done.track, args)
        if done.bare:
            emit(
                f"ipm-rs: warning: {args.output}: {done.bare} frames were taken for those of the same file names that "
                "an earlier version or Mosaic.add put there; map another drive into a new folder",
                sys.stderr,
            )
        if not args.quiet:
            emit(done.told(args.output, mosaic))
    if done.failed:
        raise FileError(
            f"{done.failed} of {done.failed + done.added + done.there} frames could not be added, see above"
        )


def _opened(args: argparse.Namespace) -> ipm_rs.Mosaic:
    """Return the map of the folder, or a new one; what it keeps need not be said again."""
    samples, labels = args.samples, args.labels
    if samples is None and args.blend in ("robust", "feathered"):
        samples = 8
    if (args.output / "mosaic.json").exists():
        with ipm_rs.Mosaic.load(args.output) as known:
            samples = known.samples if args.samples is None else samples
            labels = labels or known.labels
    _check_blend(args.blend, samples, labels)  # first: a folder would stay behind, of a map that nobody wanted
    return ipm_rs.Mosaic(args.resolution, tile=args.tile, path=args.output, samples=samples, labels=labels)


def _check_blend(blend: str | None, samples: int | None, labels: bool) -> None:
    """Refuse, before frames are added, to draw what the map does not keep."""
    if blend in ("robust", "feathered") and not samples:
        raise ArgumentError(
            f"--blend {blend}: expected a map that keeps samples, got one without; map into a new folder"
        )
    if blend == "labels" and not labels:
        raise ArgumentError("--blend labels: expected a map of labels, got one of pictures; give --labels to a new map")
    if labels and blend not in (None, "best", "labels"):
        raise ArgumentError(f"--blend {blend}: expected a map of pictures, got one of labels; choose another")


class Done:
    """What a run did."""

    def __init__(self) -> None:
        self.added = self.there = self.bare = self.failed = self.cells = 0
        self.metres = 0.0
        self.track: list[Any] = []
        self.seconds = {"read": 0.0, "add": 0.0, "write": 0.0}

    def fails(self, error: Exception, say: Callable[..., object]) -> None:
        """Note that a frame could not be added; the first few are told of."""
        self.failed += 1
        if self.failed <= _TOLD:
            say(error_line(error), sys.stderr)

    def goes_to(self, pose: Any) -> None:
        """Note where the vehicle was next, where that is known."""
        self.track.append([np.nan, np.nan] if pose is None else pose[:2, 3])

    def told(self, output: Path, mosaic: ipm_rs.Mosaic) -> str:
        """Return the summary: a line."""
        there = f" ({self.there} were there)" if self.there else ""
        stages = ", ".join(f"{name} {1000 * took / max(self.added, 1):.1f}" for name, took in self.seconds.items())
        return (
            f"{output}  {self.metres / 1000:.3f} km  {self.added} frames{there}  {len(mosaic.tiles)} tiles  "
            f"{self.cells / max(self.added, 1):.0f} cells a frame  ms a frame: {stages}"
        )


def _add_all(
    mosaic: ipm_rs.Mosaic,
    stream: streams.Stream,
    cameras: Any,
    poses: Poses,
    names: Names,
    ground: Any,
    args: argparse.Namespace,
    done: Done,
) -> None:
    takes_own = args.calibration == args.streams[0]
    show = not args.quiet and sys.stderr.isatty()
    with (progress_bar("frame") if show else no_progress)(Counted(stream.count)) as (bar, say):
        steps = iter(bar)
        for ticket, name, frame, took in _decoded(stream, names):
            next(steps, None)
            if isinstance(frame, Exception):
                if args.strict:
                    raise frame
                done.fails(frame, say)
                continue
            before = poses.before
            if frame is None or name in mosaic:  # which it was not yet when the frame was decoded
                done.there += 1
                done.bare += name not in mosaic
                poses.before = None
                done.goes_to(poses.given(ticket))
                continue
            pose = poses.at(ticket, frame.map_from_vehicle)
            if before is not None:
                done.metres += float(np.linalg.norm(pose[:3, 3] - before[1]))
            done.goes_to(pose)
            begin = perf_counter()
            seen = frame.camera if takes_own and frame.camera is not None else cameras
            place: dict[str, Any] = {"map_from_vehicle": pose, "ground": ground, "distance": args.distance}
            held = mosaic.frames
            try:
                gain = mosaic.gain(seen, frame.image, **place) if args.gains else 1.0
                done.cells += mosaic.add(seen, frame.image, gain=gain, name=name, **place)
            except (ImageError, DtypeError) as error:  # of another size, or other numbers
                named = type(error)(f"{stream.path}: frame {ticket.name}: {error}")
                if args.strict:
                    raise named from error
                done.fails(named, say)
                continue
            done.seconds["read"] += took
            done.seconds["add"] += perf_counter() - begin
            done.added += mosaic.frames - held


def _decoded(stream: streams.Stream, names: Names) -> Iterator[tuple[streams.Ticket, str, Any, float]]:
    """Yield tickets, their names in the map, their frame and the seconds waited.

    Instead of a frame it is None where the map has it, or what is wrong with it.
    """

    def load(ticket: streams.Ticket) -> tuple[str, Any]:
        name = names.of(ticket)
        if names.has(ticket, name):
            return name, None
        try:
            return name, ticket.load()
        except (FileError, ImageError) as error:
            return name, error

    begin = perf_counter()
    with contextlib.closing(ordered(stream.tickets(), load, cpus())) as results:
        for ticket, future in results:
            yield ticket, *future.result(), perf_counter() - begin
            begin = perf_counter()


def _height(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ArgumentError(f"--ground: expected a height in metres or wheels, got {text!r:.40}") from None
