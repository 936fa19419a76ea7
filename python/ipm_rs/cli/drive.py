"""The drive of ``ipm-rs mosaic``: the pictures of a camera or of several, and where the vehicle was at each."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ipm_rs
from ipm_rs import streams
from ipm_rs.cli.arguments import load_camera_sized, load_rig
from ipm_rs.cli.rig import sources_of
from ipm_rs.cli.rig_stream import opened
from ipm_rs.errors import ArgumentError, CalibrationError, ImageError
from ipm_rs.files import images
from ipm_rs.mosaic.driving import Drive

__all__ = ["Poses", "cameras_of", "stream_of"]

Cameras = ipm_rs.Camera | ipm_rs.Rig

_MEND = (
    "they were taken for the camera's own (x right, y down, z ahead); give --poses-of vehicle where they are the "
    "vehicle's"
)


def cameras_of(args: argparse.Namespace) -> tuple[Cameras, dict[str, Path]]:
    """Return the camera, or those of the rig that streams are given for, and these streams by name ("" of the one)."""
    words = args.streams
    if len(words) == 1 and ("=" not in words[0] or Path(words[0]).exists()):
        camera = load_camera_sized(args)
        if args.mask is not None:
            camera = camera.masked(images.read(args.mask)[0] > 127)
        return camera, {"": Path(words[0])}
    if args.mask is not None:
        raise ArgumentError(
            "--mask: expected none with several cameras, got one; give each its own with Camera.masked and Rig.save"
        )
    args.rig = args.calibration
    rig = load_rig(args, args.image_size)
    sources = sources_of(words, rig)
    return ipm_rs.Rig({name: rig[name] for name in sources}), sources


def stream_of(cameras: Cameras, sources: Mapping[str, Path], args: argparse.Namespace) -> streams.Stream:
    """Return the stream of all pictures: of several cameras those of one moment together, as far as they are there."""
    if isinstance(cameras, ipm_rs.Camera):
        stream = streams.open(str(sources[""]))
        _check_size(stream, cameras)
    else:
        each = {name: opened(path, name) for name, path in sources.items()}
        for name, one in each.items():
            _check_size(one, cameras[name])
        stream = streams.together(each, partial=True)
    return stream.chosen(every=args.every, start=args.start, end=args.end)


def _check_size(stream: streams.Stream, camera: ipm_rs.Camera) -> None:
    width, height = camera.image_size
    if stream.size is not None and stream.size != (width, height):
        raise ImageError(
            f"{stream.path}: expected {width}x{height} pixels, as the calibration was made for, got "
            f"{stream.size[0]}x{stream.size[1]}; give --image-size if it was made for these"
        )


class Poses:
    """Where the vehicle was at each frame: from the file that is given, else from the stream."""

    def __init__(self, args: argparse.Namespace, cameras: Cameras) -> None:
        self.source, self.most = args.streams[0], args.max_step
        self.trajectory: ipm_rs.Trajectory | None = None
        self.before: tuple[str, Any] | None = None
        self.numbered = self.kitti = False
        if args.poses is None:
            return
        camera = cameras if isinstance(cameras, ipm_rs.Camera) else next(iter(cameras.values()))
        mount = camera.vehicle_from_camera
        kitti = _in_kittis_form(Path(args.poses))
        self.kitti = kitti
        sensor = None
        if args.poses_of == "camera" or (kitti and args.poses_of is None):
            sensor = mount
        elif kitti:
            sensor = np.eye(4)  # the numbers as they are: x ahead and z up, not a camera's axes
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
        # all of them before anything is added: what a map holds it keeps
        drive = Drive()
        for pose in self.trajectory.poses:
            drive.goes_to(pose)
        oddity = drive.oddity(_MEND) if sensor is mount else drive.oddity()
        if oddity is not None:
            raise CalibrationError(f"{args.poses}: {oddity}")

    def at(self, ticket: streams.Ticket, own: Any) -> NDArray[np.float64]:
        """Return the pose of a frame.

        Raises
        ------
        CalibrationError
            There is none, or it is far from the one before.
        """
        pose = own if self.trajectory is None else self.given(ticket)
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
        found: NDArray[np.float64] = pose
        return found

    def given(self, ticket: streams.Ticket) -> NDArray[np.float64] | None:
        """Return what the file says of a frame, None where there is no file."""
        trajectory = self.trajectory
        if trajectory is None:
            return None
        if ticket.timestamp is not None and not self.numbered:
            return trajectory.at(ticket.timestamp)
        if not (self.numbered or self.kitti):  # KITTI's are of one line for each picture, also with a times.txt beside
            raise ArgumentError(
                f"{self.source}: expected frames with timestamps, as the poses have, got none; give a video, a bag "
                "or a dataset, or poses in KITTI's form, one line for each frame"
            )
        if ticket.index >= len(trajectory):
            raise ArgumentError(f"--poses: expected a pose for each frame, got {len(trajectory)} for more frames")
        pose: NDArray[np.float64] = trajectory.poses[ticket.index]
        return pose


def _in_kittis_form(path: Path) -> bool:
    """Say whether a file has 12 numbers in its first line, and so no times."""
    try:
        with path.open("rb") as file:
            return len(next((line for line in file if line.strip()), b"").split()) == 12
    except OSError:
        return False  # a directory, or nothing: what reads it says so
