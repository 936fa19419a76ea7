"""Videos, bags and datasets in ``ipm-rs warp``: a whole stream instead of images one by one."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ipm_rs
from ipm_rs import draw, streams
from ipm_rs.cli.arguments import check_not_input, check_output, load_camera_sized
from ipm_rs.cli.frames import check_destination, conclude, files_of, warped
from ipm_rs.cli.printing import emit
from ipm_rs.cli.tables import table_of
from ipm_rs.errors import ArgumentError, CalibrationError, FileError, ImageError
from ipm_rs.files import images
from ipm_rs.streams import folder
from ipm_rs.streams.sinks import VIDEO_CODECS


def concerns(args: argparse.Namespace) -> bool:
    """Say whether the input is another stream than images, or the output a video."""
    kinds = [_kind(str(source)) for source in args.images]
    other = next(
        (source for source, kind in zip(args.images, kinds, strict=True) if kind not in (None, "folder")), None
    )
    if other is not None and len(kinds) > 1:
        raise ArgumentError(f"{other}: expected it alone, got {len(kinds)} inputs; warp one of it at a time")
    for option, kind in (("topic", "bag"), ("scene", "nuscenes")):
        if getattr(args, option) is not None and kinds != [kind]:
            raise ArgumentError(f"--{option}: expected an input of {kind}, got another; leave it out")
    several = len(kinds) == 1 and folder.is_several(str(args.images[0]))
    to_video = args.mask_video is not None or Path(args.output).suffix.lower() in VIDEO_CODECS
    if args.mask_video is not None and other is None and not several:
        raise ArgumentError("--mask-video: expected a video or another stream to warp, got images; give --mask")
    return other is not None or (to_video and several)


def with_axes(view: NDArray[Any], lut: ipm_rs.Lut) -> NDArray[np.uint8]:
    """Return a view with axes in metres around it, and what the camera does not see hatched."""
    assert lut.grid is not None
    return np.asarray(draw.axes(view, lut.grid, mask=lut.mask))


def _kind(source: str) -> str | None:
    try:
        return streams.recognise(source)
    except FileError:
        return None


def _opened(args: argparse.Namespace, source: str) -> streams.Stream:
    """Open the input with the options of its kind."""
    kind = streams.recognise(source)
    more: dict[str, Any] = {"video": {"rotation": args.rotation}, "bag": {"topic": args.topic, "poses": False}}.get(
        kind, {}
    )
    if kind not in ("video", "bag", "folder") and args.camera is not None:
        more["camera"] = args.camera
    if kind.startswith("kitti") and args.vehicle_frame is not None:
        more["frame"] = args.vehicle_frame
    if kind == "nuscenes":
        more["scene"] = args.scene
    return streams.open(source, kind=kind, every=args.every, start=args.start, end=args.end, **more)


def run(args: argparse.Namespace, grid: ipm_rs.BevGrid, options: dict[str, Any]) -> None:
    """Check the input's header and the output's name, then warp frame after frame."""
    output = Path(args.output)
    source = str(args.images[0])
    own = os.path.realpath(args.calibration) == os.path.realpath(source)
    camera = None if own else load_camera_sized(args)
    stream = _opened(args, source)
    camera = camera or stream.camera
    if camera is None:
        raise CalibrationError(
            f"{source}: expected a calibration in it, as it is named for CALIBRATION too, found none; give a file"
        )
    if stream.size is not None and stream.size != tuple(camera.image_size):
        width, height = camera.image_size
        raise ImageError(
            f"{source}: expected {width}x{height} pixels, as the calibration was made for, got "
            f"{stream.size[0]}x{stream.size[1]}; if it was made for these, give --image-size {stream.size[0]} "
            f"{stream.size[1]}"
        )
    check_destination(output, [source], force=args.force, skip_existing=args.skip_existing)
    inputs, may_exist = [args.calibration, *files_of(source)], args.force or args.skip_existing
    if args.mask is not None:
        images.check_format(args.mask, "L", "the mask")
        check_output(args.mask, may_exist=may_exist)
        check_not_input(args.mask, inputs)
    if args.mask_video is not None:
        if args.mask_video.suffix.lower() not in VIDEO_CODECS:
            known = ", ".join(VIDEO_CODECS)
            raise ArgumentError(f"--mask-video: expected a name that ends in {known}, got {args.mask_video}; rename it")
        check_output(args.mask_video, may_exist=may_exist)
        check_not_input(args.mask_video, inputs)
        if os.path.realpath(args.mask_video) == os.path.realpath(output):
            raise ArgumentError(f"{output}: expected a name of its own for --mask-video, got the output's; rename one")
    ground = args.ground
    if ground is None and own and stream.ground is not None:
        ground = stream.ground
        if not args.quiet:
            emit(f"{source}  road at {ground:g} m, as the dataset has it; --ground gives another height")
    ground = ground or 0.0
    lut = table_of(camera, grid, ground, may_be_empty=args.poses is not None)
    tables = lut if args.poses is None else streams.per_frame(camera, grid, args.poses, ground=ground)
    summary = warped(
        stream,
        tables,
        output,
        quiet=args.quiet,
        jobs=args.jobs,
        skip_existing=args.skip_existing,
        strict=args.strict,
        level=args.png_level,
        mask=args.mask_video,
        draw=with_axes if args.axes else None,
        **options,
    )
    if args.mask is not None:
        images.write(args.mask, np.where(lut.mask, np.uint8(255), np.uint8(0)), images.Look("L"))
    conclude(output, lut, summary, quiet=args.quiet)
