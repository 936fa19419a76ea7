"""What the commands share that warp whole streams: where views may go, progress, what is told at the end."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import ipm_rs
from ipm_rs import streams
from ipm_rs.cli.arguments import check_not_input, check_output
from ipm_rs.cli.printing import emit, error_line, no_progress, progress_bar
from ipm_rs.errors import ArgumentError, FileError, IpmError
from ipm_rs.streams import folder
from ipm_rs.streams.sinks import VIDEO_CODECS

_TOLD = 5
"""So many errors of frames are printed; the summary counts the others."""


def check_destination(output: Path, sources: Iterable[str], *, force: bool, skip_existing: bool) -> None:
    """Refuse an output that exists, is an input, or is a file where a folder is wanted."""
    if output.suffix.lower() in VIDEO_CODECS:
        if not skip_existing:
            check_output(output, may_exist=force)
        check_not_input(output, sources)
    elif output.exists() and not output.is_dir():
        raise ArgumentError(f"-o: expected a folder or a video, got {output}, which is a file; give another name")
    elif output.is_dir() and any(output.iterdir()) and not (force or skip_existing):
        raise FileError(f"{output}: expected an empty folder, got files; give --skip-existing, --force or another name")


def files_of(source: str | os.PathLike[str]) -> list[Path]:
    """Return what a source is read from, as far as its name says: of a folder or pattern its images too."""
    text = os.fspath(source)
    found = [Path(text), Path(text.partition(":/")[0])]  # run.mcap:/topic of a rig
    with contextlib.suppress(FileError):  # a topic is no stream by its name
        if streams.recognise(text) == "folder" and folder.is_several(text):
            found += folder.paths_of(text)
    return found


def warped(stream: streams.Stream, table: Any, output: Path, *, quiet: bool, **options: Any) -> streams.Summary:
    """Warp the stream with a bar on a terminal; the first errors of frames are printed."""
    show = not quiet and sys.stderr.isatty()
    told = 0
    with (progress_bar("frame") if show else no_progress)(Counted(stream.count)) as (bar, say):
        steps = iter(bar)

        def report(_: streams.Ticket, error: IpmError | None) -> None:
            nonlocal told
            next(steps, None)
            if error is not None:
                told += 1
                if told <= _TOLD:
                    say(error_line(error), sys.stderr)

        return streams.warp(stream, table, output, report=report, **options)


def conclude(output: Path, lut: ipm_rs.Lut | ipm_rs.RigLut, summary: streams.Summary, *, quiet: bool) -> None:
    """Tell in a line what was done.

    Raises
    ------
    FileError
        Some frames failed.
    """
    if not quiet and (summary.done or summary.skipped or not summary.failed):
        skipped = f", {summary.skipped} were there" if summary.skipped else ""
        rows, cols = lut.shape
        emit(
            f"{output}  {cols} x {rows}  {summary.done} frames{skipped}  {100 * lut.mask.mean():.1f} % valid  "
            f"{summary.seconds:.1f} s, {summary.rate:.1f} frames/s"
        )
    if summary.failed:
        total = summary.done + summary.skipped + len(summary.failed)
        raise FileError(f"{len(summary.failed)} of {total} frames could not be warped, see above")


class Counted:
    """Steps of a progress bar, whose number may not be known."""

    def __init__(self, count: int | None) -> None:
        self.count = count

    def __iter__(self) -> Iterator[int]:
        return iter(int, 1)  # endless

    def __len__(self) -> int:
        if self.count is None:
            raise TypeError
        return self.count
