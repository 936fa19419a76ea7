"""Videos, topics of bags and drives in ``ipm-rs rig``: a view of each moment that the first camera has a frame of."""

from __future__ import annotations

import argparse
import functools
import threading
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ipm_rs
from ipm_rs import streams
from ipm_rs.cli.arguments import check_apart, check_not_input, check_output
from ipm_rs.cli.frames import check_destination, conclude, files_of, warped
from ipm_rs.errors import ArgumentError, FileError, ImageError
from ipm_rs.files import images
from ipm_rs.streams import bag
from ipm_rs.streams.sinks import VIDEO_CODECS

_OPTIONS = ("jobs", "start", "end", "tolerance")


def concerns(sources: Mapping[str, Path], args: argparse.Namespace) -> bool:
    """Say whether a camera has a stream other than images, or the output is a video."""
    others = [name for name, path in sources.items() if _kind(path) not in (None, "folder")]
    if others or args.output.suffix.lower() in VIDEO_CODECS:
        return True
    given = [option for option in _OPTIONS if getattr(args, option) is not None] + ["every"] * (args.every != 1)
    if given:
        raise ArgumentError(f"--{given[0]}: expected videos, bags or a video as the output, got images; leave it out")
    return False


def run(args: argparse.Namespace, lut: ipm_rs.RigLut, sources: Mapping[str, Path], options: dict[str, Any]) -> None:
    """Check every header and the output's name, then make view after view."""
    lacking = [name for name in lut.rig if name not in sources]
    if lacking and args.missing is None:
        raise ArgumentError(
            f"NAME=STREAM: expected one for each camera, got none for {', '.join(lacking)}; give it, or --missing next"
        )
    each = {name: opened(path, name) for name, path in sources.items()}
    for name, stream in each.items():
        size = lut.rig[name].image_size
        if stream.size is not None and stream.size != size:
            raise ImageError(
                f"{stream.path}: expected {size[0]}x{size[1]} pixels, as camera {name!r} has, got "
                f"{stream.size[0]}x{stream.size[1]}; use the original, or --image-size"
            )
    joined = streams.together(each, tolerance=args.tolerance, partial=args.missing is not None)
    joined = joined.chosen(every=args.every, start=args.start, end=args.end)
    check_destination(args.output, [stream.path for stream in each.values()], force=args.force, skip_existing=False)
    inputs = [args.rig, *(file for path in sources.values() for file in files_of(path))]
    extra = [path for path in (args.mask, args.source) if path is not None]
    check_apart([args.output, *extra])
    for path in extra:
        images.check_format(path, "L", "the view")
        check_not_input(path, inputs)
        in_folder = path.parent == args.output and args.output.suffix.lower() not in VIDEO_CODECS  # which is made
        check_output(path, may_exist=args.force, may_make=in_folder)
    table: Any = lut
    if args.gains:
        table = _Balanced(lut)
        joined = table.measuring(joined)
    summary = warped(joined, table, args.output, quiet=args.quiet, jobs=args.jobs, **options)
    conclude(args.output, lut, summary, quiet=args.quiet)


def _kind(path: Path) -> str | None:
    try:
        return streams.recognise(path)
    except FileError:
        return "bag" if _topic(path) else None


def _topic(path: Path) -> tuple[str, str] | None:
    """Return a bag and a topic of ``run.mcap:/front/image_raw``."""
    place, colon, topic = str(path).partition(":/")
    return (place, f"/{topic}") if colon and bag.recognises(place) else None


def opened(path: Path, name: str) -> streams.Stream:
    """Open what the command line gives for a camera."""
    found = _topic(path)
    if found is not None:
        return streams.open(found[0], kind="bag", topic=found[1], poses=False)
    if streams.recognise(path) == "bag":
        raise ArgumentError(f"{name}={path}: expected a topic of the bag, got none; write {name}={path}:/the/topic")
    return streams.open(path)


class _Balanced:
    """Makes the table of a frame, with gains that follow the pictures of all cameras from frame to frame.

    Frames are loaded on several threads, and gains go on from those of the frame before: so each frame waits for its
    turn to be measured, which all before it have had, those that cannot be read too.
    """

    def __init__(self, lut: ipm_rs.RigLut) -> None:
        self.lut = lut
        self.gains: dict[str, NDArray[np.float32]] | None = None
        self.of_frames: dict[int, dict[str, NDArray[np.float32]] | None] = {}

    def measuring(self, stream: streams.Stream) -> streams.Stream:
        """Return the stream whose frames are measured as they are loaded."""
        return replace(stream, make=lambda: self._tickets(stream))

    def _tickets(self, stream: streams.Stream) -> Iterator[streams.Ticket]:
        before = threading.Event()
        before.set()
        for ticket in stream.tickets():
            after = threading.Event()
            yield replace(ticket, load=functools.partial(self._load, ticket, before, after))
            before = after

    def _load(self, ticket: streams.Ticket, before: threading.Event, after: threading.Event) -> streams.Frame:
        try:
            frame = ticket.load()
            before.wait()
            pictures: Any = frame.image
            if len(pictures) == len(self.lut.rig):
                self.gains = self.lut.gains(pictures, previous=self.gains)
            self.of_frames[frame.index] = self.gains
            return frame
        finally:
            before.wait()
            after.set()

    def __call__(self, frame: streams.Frame) -> _WithGains:
        return _WithGains(self.lut, self.of_frames.pop(frame.index))


class _WithGains:
    """A table of a rig, with the gains of a moment."""

    def __init__(self, lut: ipm_rs.RigLut, gains: dict[str, NDArray[np.float32]] | None) -> None:
        self.lut, self.gains, self.mask = lut, gains, lut.mask

    def warp(self, image: Any, /, **options: Any) -> NDArray[Any]:
        """Make the view."""
        return self.lut.warp(image, gains=self.gains, **options)
