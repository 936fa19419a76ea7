"""The command line ``ipm-rs``: warp images, make point clouds of depth, see a demo, ask what is installed.

Exit status: 0 when all went well, 2 after a mistake of the user or a damaged file (one line on stderr says what was
expected, what came and how to mend it), 130 after Ctrl-C. Nothing is written before every argument, every image header
and every output name has been checked, and a file is written whole or not at all.

One module for each command, with ``add(commands)`` for its arguments and ``run(args)`` for its work.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Sequence

import ipm_rs
from ipm_rs.cli import cloud, demo, info, warp
from ipm_rs.cli.arguments import Parser
from ipm_rs.cli.printing import discard, emit
from ipm_rs.errors import IpmError


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        The arguments, without the program's name; by default those of the process.

    Returns
    -------
    int
        The exit status.
    """
    try:
        args = _parser().parse_args(argv)
        args.run(args)
        return 0
    except SystemExit as stop:  # --help and --version
        return int(stop.code or 0)
    except KeyboardInterrupt:
        emit("ipm-rs: interrupted", sys.stderr)
        return 130
    except IpmError as error:
        emit(f"ipm-rs: error: {error}", sys.stderr)
        return 2
    except BrokenPipeError:  # argparse of Python 3.10 prints without a guard; our own printing is in emit
        discard(sys.stdout)
        return 0
    except OSError as error:  # the file system's own refusals, such as a name that is too long
        reason = error.strerror or str(error)
        emit(f"ipm-rs: error: {error.filename}: expected a usable path, got: {reason}; check it", sys.stderr)
        return 2
    except MemoryError:
        emit("ipm-rs: error: expected enough memory, got too little; use a coarser --resolution", sys.stderr)
        return 2
    finally:
        with contextlib.suppress(ValueError):  # a closed stream
            emit("", sys.stdout, end="")


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="ipm-rs",
        description="Metric bird's-eye views from camera images and their calibration.",
        examples="""\
  ipm-rs demo                                      # a synthetic road, nothing needed
  ipm-rs warp camera.json frame.png -o bev.png     # your own image
  ipm-rs cloud camera.json depth.png -o cloud.ply  # a point cloud of a depth image
  ipm-rs info                                      # what is installed""",
    )
    parser.add_argument("--version", action="version", version=f"ipm-rs {ipm_rs.__version__}")
    parser.set_defaults(run=lambda _: emit(parser.format_help(), end=""))
    commands = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    for command in (demo, warp, cloud, info):
        command.add(commands)
    return parser
