"""``ipm-rs lut``: a calibration to a table, for our own use or another program's."""

from __future__ import annotations

import argparse
from pathlib import Path

import ipm_rs
from ipm_rs.cli.arguments import (
    Commands,
    add_camera,
    add_grid,
    add_ground,
    add_image_size,
    check_not_input,
    check_output,
    load_camera_sized,
    resolution,
)
from ipm_rs.cli.printing import emit
from ipm_rs.cli.tables import table_of
from ipm_rs.errors import ArgumentError
from ipm_rs.files import luts

_OWN = ".ipmlut"


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    lut = commands.add_parser(
        "lut",
        help="a calibration to a look-up table for OpenCV, LaneNet, PyTorch, C",
        description="""\
Write the look-up table of a calibration and a grid: for each cell, which pixel of the image it shows.

The ending of the output decides the format: .ipmlut is our own, for Lut.load; .yml is OpenCV's FileStorage with map_x
and map_y for cv::remap (--format lanenet: remap_ipm_x and remap_ipm_y; cv16sc2: fixed point); .npz; .npy, the grid of
PyTorch's grid_sample; .h, arrays for C.""",
        examples="""\
  ipm-rs lut camera.json -o front.ipmlut
  ipm-rs lut camera.json -o front.yml --x 7 50 --y -10 10 --resolution 0.05
  ipm-rs lut camera.json -o remap.yml --format lanenet --resolution 0.1
  ipm-rs lut calib/000114.txt -o front.h --image-size 1242 375 --ground -1.73""",
    )
    lut.add_argument("calibration", metavar="CALIBRATION", help="camera calibration, a file or directory")
    lut.add_argument(
        "-o", "--output", metavar="OUT", required=True, type=Path, help="the file; its ending says its format"
    )
    lut.add_argument("--format", choices=tuple(luts.FORMATS), help="which format, where an ending is that of several")
    grid = add_grid(lut, "where a cell is sampled")
    add_ground(grid)
    camera = lut.add_argument_group("calibration")
    add_camera(camera)
    add_image_size(camera)
    running = lut.add_argument_group("run")
    running.add_argument("--force", action="store_true", help="replace an existing output")
    running.add_argument("--quiet", action="store_true", help="print nothing but warnings and errors")
    lut.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Check the output's name, build the table, write it."""
    own = args.output.suffix.lower() == _OWN and args.format is None
    if not own:
        try:
            luts.format_of(args.output, args.format)
        except ArgumentError as error:
            if args.format is None:
                raise ArgumentError(
                    str(error).replace("use Lut.save for our own format", f"end it in {_OWN}")
                ) from error
            raise
    check_output(args.output, may_exist=args.force)
    check_not_input(args.output, [args.calibration])
    camera = load_camera_sized(args)
    grid = ipm_rs.BevGrid(x=args.x, y=args.y, resolution=resolution(args.resolution), sample_at=args.sample_at)
    lut = table_of(camera, grid, args.ground)
    if own:
        lut.save(args.output)
    else:
        lut.export(args.output, format=args.format)
    if not args.quiet:
        rows, cols = lut.shape
        emit(f"{args.output}  {cols} x {rows}  {100 * lut.mask.mean():.1f} % valid  {args.output.stat().st_size} bytes")
