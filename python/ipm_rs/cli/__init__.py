"""The command line ``ipm-rs``: warp images, make point clouds of depth, see a demo, ask what is installed.

Exit status: 0 when all went well, 2 after a mistake of the user or a damaged file (one line on stderr says what was
expected, what came and how to mend it), 130 after Ctrl-C, 143 after SIGTERM. Nothing is written before every argument,
every image header and every output name has been checked, and a file is written whole or not at all. Among several
images a damaged one is told of, left out, and stops none of the others; the exit status is 2 all the same.

One module for each command, with ``add(commands)`` for its arguments and ``run(args)`` for its work.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import ipm_rs
from ipm_rs.cli import cloud, completion, demo, doctor, info, lut, mosaic, rig, signals, warp
from ipm_rs.cli.arguments import Parser
from ipm_rs.cli.printing import discard, emit, emit_error
from ipm_rs.errors import ArgumentError, CalibrationWarning, IpmError


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
        with signals.raising(), _warnings_in_a_line():
            if any("\0" in word for word in argv or ()):  # no shell passes one on
                raise ArgumentError("expected arguments without null bytes, got one; leave it out")
            args = _parser().parse_args(argv)
            args.run(args)
        return 0
    except SystemExit as stop:  # --help and --version
        return int(stop.code or 0)
    except KeyboardInterrupt:
        emit("ipm-rs: interrupted", sys.stderr)
        return 130
    except signals.Terminated as stop:
        emit("ipm-rs: terminated", sys.stderr)
        return 128 + stop.number
    except (IpmError, CalibrationWarning) as error:  # a warning that the caller's filters made an error
        emit_error(error)
        return 2
    except BrokenPipeError:  # argparse of Python 3.10 prints without a guard; our own printing is in emit
        discard(sys.stdout)
        return 0
    except OSError as error:  # the file system's own refusals, such as a name that is too long
        reason = error.strerror or str(error)
        emit_error(f"{error.filename}: expected a usable path, got: {reason}; check it")
        return 2
    except MemoryError:
        emit_error("expected enough memory, got too little; use a coarser --resolution")
        return 2
    finally:
        with contextlib.suppress(ValueError):  # a closed stream
            emit("", sys.stdout, end="")


@contextlib.contextmanager
def _warnings_in_a_line() -> Iterator[None]:
    """Print what is odd about a calibration as a line of our own, without the place in the code that Python shows."""
    with warnings.catch_warnings():
        shown = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
            if issubclass(category, CalibrationWarning):
                emit(f"ipm-rs: warning: {message}", sys.stderr)
            else:
                shown(message, category, *where, **more)

        warnings.showwarning = show
        yield


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="ipm-rs",
        description="""\
Metric bird's-eye views from camera images and their calibration.

Exit status: 0 when all went well; 2 after a mistake or where a file was damaged, also if the other images of a batch
were made; 130 after Ctrl-C, 143 after SIGTERM. Files are written whole or not at all.""",
        examples="""\
  ipm-rs demo                                      # a synthetic road, nothing needed
  ipm-rs warp camera.json frame.png -o bev.png     # your own image
  ipm-rs rig rig.json front=f.png left=l.png -o bev.png   # one view of several cameras
  ipm-rs mosaic camera.json drive.mp4 --poses poses.tum -o map/  # a map of the road from a drive
  ipm-rs cloud camera.json depth.png -o cloud.ply  # a point cloud of a depth image
  ipm-rs lut camera.json -o front.yml              # maps for cv::remap
  ipm-rs doctor camera.json frame.png -o report.png       # what is wrong with a calibration
  ipm-rs info                                      # what is installed
  ipm-rs completion bash                           # for the shell""",
    )
    parser.add_argument("--version", action="version", version=f"ipm-rs {ipm_rs.__version__}")
    parser.set_defaults(run=lambda _: emit(parser.format_help(), end=""))
    commands = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    for command in (demo, warp, rig, mosaic, cloud, lut, doctor, info, completion):
        command.add(commands)
    return parser
