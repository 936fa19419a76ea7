"""``ipm-rs mosaic``: a map of the road from a drive."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import ipm_rs
from ipm_rs import draw, streams
from ipm_rs.cli.arguments import (
    Commands,
    add_camera,
    add_image_size,
    check_output,
    count,
    load_camera_sized,
    real,
)
from ipm_rs.cli.frames import Counted
from ipm_rs.cli.printing import emit, error_line, no_progress, progress_bar
from ipm_rs.errors import ArgumentError, CalibrationError, FileError, ImageError
from ipm_rs.files import images
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
it was when the same command is given again; frames of the same names are added once. A folder that holds a map already
gets the frames of another drive in addition.

The map's axes are those of the poses. Each cell is made of the frames that resolve it best.""",
        examples="""\
  ipm-rs mosaic calib.txt image_0/ --poses poses.txt --poses-of camera -o map/
  ipm-rs mosaic sequences/00 sequences/00 -o map/ --picture map.png    # a dataset that has its poses
  ipm-rs mosaic camera.json drive.mp4 --poses drive.tum --distance 4 15 --resolution 0.02 -o map/
  ipm-rs mosaic camera.json drive.mp4 --poses drive.tum -o map/ --tiles site/    # site/index.html shows it""",
    )
    mosaic.add_argument("calibration", metavar="CALIBRATION", help="camera calibration, a file or directory")
    mosaic.add_argument("stream", metavar="STREAM", help="a folder of images, a pattern, a video, a bag or a dataset")
    mosaic.add_argument("-o", "--output", metavar="MAP", type=Path, required=True, help="the map's folder")
    drive = mosaic.add_argument_group("drive")
    drive.add_argument("--poses", metavar="FILE", help="where the vehicle was; needed where STREAM does not say it")
    drive.add_argument(
        "--poses-of",
        choices=("vehicle", "camera"),
        default="vehicle",
        help="what the poses of FILE are of (default: vehicle)",
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
    camera = mosaic.add_argument_group("calibration")
    add_camera(camera)
    add_image_size(camera)
    camera.add_argument("--mask", metavar="IMAGE", type=Path, help="white where the camera shows the road")
    out = mosaic.add_argument_group("output")
    out.add_argument("--blend", choices=("weighted", "best", "mean"), default="weighted", help="how cells are drawn")
    out.add_argument("--picture", metavar="PNG", type=Path, help="also draw the map, with axes in metres")
    out.add_argument("--x", metavar=("MIN", "MAX"), nargs=2, type=real, help="of the picture (default: all)")
    out.add_argument("--y", metavar=("MIN", "MAX"), nargs=2, type=real, help="of the picture (default: all)")
    out.add_argument("--tiles", metavar="DIR", type=Path, help="also write XYZ tiles and a page that shows them")
    running = mosaic.add_argument_group("run")
    running.add_argument("--force", action="store_true", help="replace an existing picture")
    running.add_argument("--quiet", action="store_true", help="print nothing but errors")
    mosaic.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Check every argument, add frame after frame, draw, and tell what was done."""
    if args.picture is not None:
        images.check_format(args.picture, "RGB", "the picture")
        check_output(args.picture, may_exist=args.force)
    elif args.x is not None or args.y is not None:
        raise ArgumentError("--x, --y: expected --picture with them, got none; give its name")
    camera = load_camera_sized(args)
    if args.mask is not None:
        camera = camera.masked(images.read(args.mask)[0] > 127)
    stream = streams.open(args.stream, every=args.every, start=args.start, end=args.end)
    if stream.size is not None and stream.size != tuple(camera.image_size):
        raise ImageError(
            f"{args.stream}: expected {camera.image_size[0]}x{camera.image_size[1]} pixels, as the calibration was "
            f"made for, got {stream.size[0]}x{stream.size[1]}; give --image-size if it was made for these"
        )
    poses = _Poses(args, camera)
    ground = args.ground if args.ground == "wheels" else _height(args.ground)
    with ipm_rs.Mosaic(args.resolution, tile=args.tile, path=args.output) as mosaic:
        done = _add_all(mosaic, stream, camera, poses, ground, args)
        begin = perf_counter()
        mosaic.commit()
        done.seconds["write"] += perf_counter() - begin
        _draw(mosaic, args)
        if not args.quiet:
            emit(done.told(args.output, mosaic))
    if done.failed:
        raise FileError(f"{done.failed} of {done.failed + done.added + done.there} frames could not be read, see above")


class _Poses:
    """Where the vehicle was at each frame: from the file that is given, else from the stream."""

    def __init__(self, args: argparse.Namespace, camera: ipm_rs.Camera) -> None:
        self.source, self.most = args.stream, args.max_step
        self.trajectory: ipm_rs.Trajectory | None = None
        self.before: tuple[str, Any] | None = None
        self.numbered = False
        if args.poses is None:
            return
        sensor = camera.vehicle_from_camera if args.poses_of == "camera" else None
        try:
            self.trajectory = ipm_rs.Trajectory.load(args.poses, vehicle_from_sensor=sensor)
        except ArgumentError as error:
            if "timestamps" not in str(error):
                raise
            # KITTI's have none: the n-th pose is the n-th picture's
            with Path(args.poses).open("rb") as file:
                lines = sum(bool(line.strip()) for line in file)
            numbers = np.arange(float(lines))
            self.trajectory = ipm_rs.Trajectory.load(args.poses, timestamps=numbers, vehicle_from_sensor=sensor)
            self.numbered = True

    def at(self, ticket: streams.Ticket, own: Any) -> Any:
        """Return the pose of a frame.

        Raises
        ------
        CalibrationError
            There is none, or it is far from the one before.
        """
        pose = own if self.trajectory is None else self._given(ticket, self.trajectory)
        if pose is None:
            raise CalibrationError(f"{self.source}: expected poses in it, found none; give --poses FILE")
        if self.before is not None:
            step = float(np.linalg.norm(pose[:3, 3] - self.before[1]))
            if not step <= self.most:
                raise CalibrationError(
                    f"poses: expected frames at most {self.most:g} m apart, got {step:.1f} m from {self.before[0]} to "
                    f"{ticket.name}; map the stretches one by one, or give --max-step"
                )
        self.before = ticket.name, pose[:3, 3].copy()
        return pose

    def _given(self, ticket: streams.Ticket, trajectory: ipm_rs.Trajectory) -> Any:
        if ticket.timestamp is not None and not self.numbered:
            return trajectory.at(ticket.timestamp)
        if not self.numbered:
            raise ArgumentError(
                f"{self.source}: expected frames with timestamps, as the poses have, got none; give a video, a bag "
                "or a dataset, or poses in KITTI's form, one line for each frame"
            )
        if ticket.index >= len(trajectory):
            raise ArgumentError(f"--poses: expected a pose for each frame, got {len(trajectory)} for more frames")
        return trajectory.poses[ticket.index]


class _Done:
    """What a run did."""

    def __init__(self) -> None:
        self.added = self.there = self.failed = self.cells = 0
        self.metres = 0.0
        self.seconds = {"read": 0.0, "add": 0.0, "write": 0.0}

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
    camera: ipm_rs.Camera,
    poses: _Poses,
    ground: Any,
    args: argparse.Namespace,
) -> _Done:
    done = _Done()
    show = not args.quiet and sys.stderr.isatty()
    with (progress_bar("frame") if show else no_progress)(Counted(stream.count)) as (bar, say):
        steps = iter(bar)
        for ticket, frame, took in _decoded(stream, mosaic):
            next(steps, None)
            if isinstance(frame, Exception):
                done.failed += 1
                if done.failed <= _TOLD:
                    say(error_line(frame), sys.stderr)
                continue
            before = poses.before
            if frame is None:
                done.there += 1
                poses.before = None
                continue
            pose = poses.at(ticket, frame.map_from_vehicle)
            if before is not None:
                done.metres += float(np.linalg.norm(pose[:3, 3] - before[1]))
            begin = perf_counter()
            done.cells += mosaic.add(
                frame.camera if args.calibration == args.stream and frame.camera is not None else camera,
                frame.image,
                map_from_vehicle=pose,
                ground=ground,
                distance=args.distance,
                name=ticket.name,
            )
            done.seconds["read"] += took
            done.seconds["add"] += perf_counter() - begin
            done.added += 1
    return done


def _decoded(stream: streams.Stream, mosaic: ipm_rs.Mosaic) -> Iterator[tuple[streams.Ticket, Any, float]]:
    """Yield tickets with their frame, None where the map has it, or what is wrong with it, and the seconds waited."""

    def load(ticket: streams.Ticket) -> Any:
        if ticket.name in mosaic:
            return None
        try:
            return ticket.load()
        except (FileError, ImageError) as error:
            return error

    begin = perf_counter()
    with contextlib.closing(ordered(stream.tickets(), load, cpus())) as results:
        for ticket, future in results:
            yield ticket, future.result(), perf_counter() - begin
            begin = perf_counter()


def _height(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ArgumentError(f"--ground: expected a height in metres or wheels, got {text!r:.40}") from None


def _draw(mosaic: ipm_rs.Mosaic, args: argparse.Namespace) -> None:
    if mosaic.bounds is None:
        raise ArgumentError(
            "expected frames that see the road, got none that does; check the calibration and --distance"
        )
    if args.picture is not None:
        layers = mosaic.layers(args.x, args.y, names=(args.blend, "mask"))
        page = draw.axes(layers[args.blend], mosaic.window(args.x, args.y), mask=layers["mask"])
        images.write(args.picture, np.asarray(page), images.Look("RGB"))
    if args.tiles is not None:
        mosaic.export_tiles(args.tiles, blend=args.blend)
