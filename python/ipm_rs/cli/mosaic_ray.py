"""``ipm-rs mosaic ... --ray``: the frames are added on a cluster instead of in this process."""

from __future__ import annotations

import argparse
import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

import ipm_rs
from ipm_rs import streams
from ipm_rs.cli.drive import Poses
from ipm_rs.cli.mosaic_names import Names
from ipm_rs.cli.printing import emit
from ipm_rs.errors import ArgumentError, ImageError, IpmError

if TYPE_CHECKING:
    from ipm_rs.cli.mosaic import Done

__all__ = ["add_all", "check"]

_HERE_ALONE = ("video", "bag")
"""Streams whose frames are decoded one after another, which workers cannot share."""


def check(args: argparse.Namespace, sources: Mapping[str, Path], poses: Poses) -> None:
    """Refuse what a cluster does not do."""
    if args.gains:
        raise ArgumentError("--gains: expected none with --ray, got both; gains follow the map frame by frame")
    if poses.trajectory is None:
        raise ArgumentError("--ray: expected --poses with it, got none; frames are decoded by the workers")
    for path in sources.values():
        if streams.recognise(path) in _HERE_ALONE:
            raise ArgumentError(f"--ray: expected images or a dataset, got {path}; leave --ray out")


def add_all(
    mosaic: ipm_rs.Mosaic,
    stream: streams.Stream,
    cameras: Any,
    poses: Poses,
    names: Names,
    ground: Any,
    args: argparse.Namespace,
    done: Done,
) -> None:
    """Add all frames that the map does not hold."""
    begin, sent = perf_counter(), set[str]()
    each = {"": cameras} if isinstance(cameras, ipm_rs.Camera) else cameras
    sizes = {name: camera.image_size for name, camera in each.items()}

    def report(_: int, failed: list[IpmError]) -> None:
        for error in failed:
            done.fails(error, emit)

    def frames() -> Iterator[tuple[Any, ...]]:
        for ticket in stream.tickets():
            pose = poses.at(ticket, None)
            done.goes_to(pose)
            name = names.of(ticket)
            if name in sent or names.has(ticket, name):
                done.there += 1
                done.bare += name not in sent and name not in mosaic
                continue
            sent.add(name)
            if len(done.track) > 1:
                done.metres += float(np.hypot(*(done.track[-1] - done.track[-2])))
            yield cameras, functools.partial(_image_of, stream.path, ticket, sizes), pose, name

    done.added = ipm_rs.ray.mosaic(
        frames(),
        mosaic,
        ground=ground,
        distance=args.distance,
        strict=args.strict,
        address=args.ray or None,
        report=report,
    )
    done.seconds["add"] += perf_counter() - begin


def _image_of(path: str, ticket: streams.Ticket, sizes: dict[str, tuple[int, int]]) -> Any:
    """Decode a frame, and say its name where it is of another size than its camera."""
    image = ticket.load().image
    for name, picture in image.items() if isinstance(image, Mapping) else [("", image)]:
        size = picture.shape[1], picture.shape[0]
        if size != sizes[name]:
            raise ImageError(
                f"{path}: frame {ticket.name}: expected {sizes[name][0]}x{sizes[name][1]} pixels, as its camera has, "
                f"got {size[0]}x{size[1]}; leave it out, or use the original"
            )
    return image
