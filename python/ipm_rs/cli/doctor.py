"""``ipm-rs doctor``: what a calibration sees, and what is wrong with it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import ipm_rs
from ipm_rs.cli.arguments import (
    Commands,
    add_camera,
    add_grid,
    add_ground,
    add_image_size,
    check_not_input,
    check_output,
    load_camera,
    load_camera_sized,
    load_rig,
    resolution,
)
from ipm_rs.cli.printing import emit
from ipm_rs.errors import ArgumentError, CalibrationError
from ipm_rs.files import images

_AHEAD = (7.0, 50.0)
_AROUND = [-10.0, 10.0]


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    doctor = commands.add_parser(
        "doctor",
        help="say what a calibration sees, and what is wrong with it",
        description="""\
Say in words where a camera stands and looks, which part of a grid it sees and why not the rest, what a pixel costs at
the far end, and which mistakes its calibration is likely to have: an inverse pose, another unit, a rotation without the
optical axes, K of another size, degrees for radians, lanes that are not parallel.

With an image, -o draws the road's metres on it and the bird's-eye view beside it. NAME=IMAGE for some of the cameras of
a rig, or --all without images, looks at all cameras: who sees what, and how well pairs of them agree.""",
        examples="""\
  ipm-rs doctor camera.json
  ipm-rs doctor camera.json frame.png -o report.png
  ipm-rs doctor calib/000114.txt 000114.png --ground -1.73 -o report.png
  ipm-rs doctor rig.json front=f.png left=l.png back=b.png right=r.png -o report.png
  ipm-rs doctor camera.json --json --strict > report.json   # exit status 2 if anything is odd""",
    )
    doctor.add_argument("calibration", metavar="CALIBRATION", help="camera calibration, a file or directory")
    doctor.add_argument(
        "images", metavar="IMAGE", nargs="*", help="an image of the camera; or NAME=IMAGE for cameras of a rig"
    )
    doctor.add_argument("-o", "--output", metavar="PICTURE", type=Path, help="also draw the report")
    grid = add_grid(doctor, "where a cell is sampled", x=_AHEAD)
    add_ground(grid)
    camera = doctor.add_argument_group("calibration")
    camera.add_argument("--all", action="store_true", help="look at all cameras, as a rig (then --x is -10 10)")
    add_camera(camera)
    add_image_size(camera)
    running = doctor.add_argument_group("run")
    running.add_argument("--json", action="store_true", help="print the report as JSON")
    running.add_argument(
        "--strict", action="store_true", help="exit status 2 after an error or a warning of the report"
    )
    running.add_argument("--force", action="store_true", help="replace an existing PICTURE")
    doctor.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Read, look, print, draw."""
    if args.output is not None:
        images.check_format(args.output, "RGB", "the picture")
        check_output(args.output, may_exist=args.force)
    named = [text for text in args.images if "=" in text and not Path(text).exists()]
    if args.output is not None:
        pictures = [text.partition("=")[2] if text in named else text for text in args.images]
        check_not_input(args.output, [args.calibration, *pictures])
    report: Any
    if named or args.all:
        report = _rig(args, named)
    else:
        report = _camera(args)
    if args.output is not None:
        picture = np.asarray(report.draw())
        images.write(args.output, picture, images.Look("RGB"))
    emit(report.to_json() if args.json else str(report), end="" if args.json else "\n")
    if args.output is not None and not args.json:
        emit(f"picture  {args.output}")
    if args.strict and not report.ok:
        raise SystemExit(2)


def _camera(args: argparse.Namespace) -> Any:
    if len(args.images) > 1:
        raise ArgumentError(
            f"IMAGE: expected one image of the camera, got {len(args.images)}; write NAME=IMAGE for those of a rig"
        )
    pixels = None if not args.images else images.read(Path(args.images[0]))[0]
    if pixels is None:
        camera = load_camera_sized(args)
    else:
        try:
            camera = load_camera(args, args.image_size)
        except CalibrationError as error:
            if args.image_size is not None or "image_size" not in str(error):
                raise
            camera = load_camera(args, (pixels.shape[1], pixels.shape[0]))
    return ipm_rs.doctor(camera, _grid(args, around=False), args.ground, pixels)


def _rig(args: argparse.Namespace, named: list[str]) -> Any:
    if args.camera is not None:
        raise ArgumentError("--camera: expected all cameras of a rig, got the name of one; leave it or NAME= out")
    stray = [text for text in args.images if text not in named]
    if stray:
        raise ArgumentError(f"NAME=IMAGE: expected the name of a camera with each image, got {stray[0]}; write NAME=")
    args.rig = args.calibration
    rig = load_rig(args, args.image_size)
    pixels = {}
    for text in named:
        name, _, path = text.partition("=")
        if name not in rig:
            raise ArgumentError(f"NAME=IMAGE: expected one of {', '.join(rig)}, got {name!r}")
        if name in pixels:
            raise ArgumentError(f"NAME=IMAGE: expected one image for each camera, got two for {name}; leave one out")
        pixels[name] = images.read(Path(path))[0]
    return ipm_rs.doctor(rig, _grid(args, around=True), args.ground, pixels)


def _grid(args: argparse.Namespace, *, around: bool) -> ipm_rs.BevGrid:
    x = _AROUND if around and args.x == list(_AHEAD) else args.x
    return ipm_rs.BevGrid(x=x, y=args.y, resolution=resolution(args.resolution), sample_at=args.sample_at)
