"""``ipm-rs demo``: a synthetic road, warped and measured."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from ipm_rs.cli.arguments import Commands, check_output
from ipm_rs.cli.printing import emit
from ipm_rs.files import images

DEMO_NAME = "ipm_demo.png"


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    demo = commands.add_parser(
        "demo",
        help="warp a synthetic road and measure the error",
        description="""\
Render a synthetic road through a Cityscapes calibration, warp it to a bird's-eye view, draw both side by side, and
print sizes, times, coverage and the error against the analytic truth.""",
        examples="""\
  ipm-rs demo                    # writes ./ipm_demo.png
  ipm-rs demo road.png --force   # another name; replaces an existing file""",
    )
    demo.add_argument(
        "out", metavar="OUT", nargs="?", help=f"the picture; without it ./{DEMO_NAME}, which is replaced if it exists"
    )
    demo.add_argument("--force", action="store_true", help="replace an existing OUT")
    demo.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    """Draw the demo, and print what was measured."""
    from ipm_rs import demo

    images.require_pillow()
    path = Path(DEMO_NAME if args.out is None else args.out)
    images.check_format(path, "RGB", "the picture")
    check_output(path, may_exist=args.force or args.out is None)
    result = demo.run()
    images.write(path, np.asarray(demo.picture(result)), images.Look("RGB"))
    for line in demo.report(result):
        emit(line)
    emit(f"picture   {path}")
