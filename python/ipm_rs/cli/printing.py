"""What the command line prints: lines that no terminal and no closed pipe breaks, and progress on stderr."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol, TextIO, TypeVar

from ipm_rs.errors import MissingExtraError

T = TypeVar("T")
Say = Callable[[str, TextIO], None]


_MARK = re.compile(r"^ipm-rs: (error|warning):")
_COLOURS = {"error": 31, "warning": 33}  # red, yellow


class Progress(Protocol):
    """What goes through jobs and meanwhile prints lines."""

    def __call__(self, jobs: Iterable[T], /) -> contextlib.AbstractContextManager[tuple[Iterable[T], Say]]:
        """Return the jobs, and what prints a line."""


def emit(line: str, stream: TextIO | None = None, *, end: str = "\n") -> None:
    """Print now; a name that the terminal cannot show is escaped, and a reader who has gone away is no error."""
    stream = sys.stdout if stream is None else stream
    encoding = getattr(stream, "encoding", None) or "utf-8"
    if _shows_colours(stream):
        line = _MARK.sub(lambda mark: f"\x1b[1;{_COLOURS[mark[1]]}m{mark[0]}\x1b[0m", line)
    try:
        print(line.encode(encoding, "backslashreplace").decode(encoding), end=end, file=stream, flush=True)
    except BrokenPipeError:
        discard(stream)


def _shows_colours(stream: TextIO) -> bool:
    """Say whether a stream is a terminal that shows colours, and nobody has asked for none (https://no-color.org)."""
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or os.name == "nt":
        return False
    try:
        return stream.isatty()
    except (AttributeError, ValueError):  # something else that is written to, or closed
        return False


def error_line(error: object) -> str:
    """Return what is said of an error: one line, whatever its text or a file's name in it."""
    lines = [line.strip() for line in str(error).splitlines()]
    return f"ipm-rs: error: {'; '.join(filter(None, lines)).replace(':; ', ': ')}"


def emit_error(error: object) -> None:
    """Print an error on stderr."""
    emit(error_line(error), sys.stderr)


def discard(stream: TextIO) -> None:
    """Send what is still to come on a stream to nowhere, so that the interpreter's last flush does not fail either."""
    with contextlib.suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)


@contextlib.contextmanager
def no_progress(jobs: Iterable[T]) -> Iterator[tuple[Iterable[T], Say]]:
    """Go through the jobs without a bar: the jobs, and what prints a line meanwhile."""
    yield jobs, emit


def progress_bar(unit: str) -> Progress:
    """Return what shows a bar on stderr while the jobs are gone through, and prints lines above it."""
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise MissingExtraError(
            'expected tqdm, which shows the progress, found none; install it with: pip install "ipm-rs[cli]", or give '
            "--quiet"
        ) from error

    @contextlib.contextmanager
    def progress(jobs: Iterable[T]) -> Iterator[tuple[Iterable[T], Say]]:
        with tqdm(jobs, unit=unit, file=sys.stderr) as bar:

            def say(line: str, stream: TextIO) -> None:
                with tqdm.external_write_mode(file=stream):
                    emit(line, stream)

            yield bar, say

    return progress
