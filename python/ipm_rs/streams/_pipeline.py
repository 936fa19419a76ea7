"""A stream through a table: decode, warp and encode on threads of their own, in order, in memory that does not grow."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import array_of, flag_of, path_text
from ipm_rs._core import Lut
from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError, ImageError, IpmError
from ipm_rs.rig import RigLut
from ipm_rs.streams._frame import Frame, Stream, Ticket, tickets_of
from ipm_rs.streams.ordered import cpus, ordered
from ipm_rs.streams.sinks import VIDEO_CODECS, Sink, is_folder, sink_for

__all__ = ["Summary", "warp"]


class Table(Protocol):
    """What makes a view of a frame's image, or of a mapping of images."""

    mask: NDArray[np.bool_]

    def warp(self, image: Any, /, **options: Any) -> NDArray[Any]:
        """Make the view."""


@dataclass
class Summary:
    """What a run did: frames `done`, `skipped` because their outputs were there, and the errors of those that `failed`.

    `seconds` is the time that it took.
    """

    done: int = 0
    skipped: int = 0
    failed: list[IpmError] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def rate(self) -> float:
        """Frames a second."""
        return self.done / self.seconds if self.seconds else 0.0


def warp(
    stream: Stream,
    lut: Lut | RigLut | Callable[[Frame], Table],
    output: str | os.PathLike[str],
    *,
    jobs: int | None = None,
    skip_existing: bool = False,
    strict: bool = False,
    ending: str | None = None,
    level: int = 1,
    mask: str | os.PathLike[str] | None = None,
    draw: Callable[[NDArray[Any], Any], NDArray[Any]] | None = None,
    report: Callable[[Ticket, IpmError | None], None] | None = None,
    **options: Any,
) -> Summary:
    """Warp every frame of a stream and write what comes of it.

    Frames are decoded, warped and encoded on `jobs` threads and written in order. A frame that cannot be decoded or
    does not fit is left out and told of; the others are made. Every file is whole or is not there, whatever happens: a
    folder keeps the frames that were made, a video that does not end well is removed.

    Parameters
    ----------
    stream : Stream
        From `open`.
    lut : Lut or RigLut, or a function that takes a `Frame` and returns one
        The table, a `RigLut` for streams `together`; a function for tables that differ from frame to frame, called on
        several threads.
    output : path
        A video (``.mp4``, ``.mov``, ``.mkv``, ``.webm``, ``.avi``), else a folder, which is made and takes no two
        frames of one name.
    jobs : int, optional
        Threads; by default the CPUs that the process may use.
    skip_existing : bool
        Leave out frames whose files are in the folder already: goes on after a stop. A video is made again only if it
        or that of `mask` is not there.
    strict : bool
        Stop at the first frame that fails.
    ending : str, optional
        Of the files in a folder: ``".png"`` (default), ``".jpg"``, ``".tif"``, ``".bmp"``, ``".npy"``, or ``".npz"``
        for shards of 64 pictures.
    level : int
        Of PNG's compression, 0 to 9. 1 takes a third of the time of 6, Pillow's own, and makes files a sixth larger.
    mask : path, optional
        A second video or folder, of the cells that each frame sees, 255, or does not, 0.
    draw : callable, optional
        Takes a view and the table that made it, and returns the picture to write; called on several threads.
    report : callable, optional
        Called with each frame's ticket, and its error or None, in order.
    **options
        Of `Lut.warp`: interpolation, border_value.

    Returns
    -------
    Summary

    Raises
    ------
    FileError, ImageError
        The stream or the output cannot be used, or with ``strict=True`` a frame.
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    """
    if not isinstance(stream, Stream):
        raise ArgumentTypeError(f"stream: expected a Stream, got {type(stream).__name__}; make one with streams.open()")
    if not isinstance(lut, (Lut, RigLut)) and (not callable(lut) or isinstance(lut, type)):
        raise ArgumentTypeError(f"lut: expected a Lut, a RigLut or a function, got {type(lut).__name__}; build one")
    path = Path(path_text("output", output))
    if ending is not None and not isinstance(ending, str):
        raise ArgumentTypeError(f"ending: expected text, got {type(ending).__name__}; '.png' is one")
    if draw is not None and (not callable(draw) or isinstance(draw, type)):
        raise ArgumentTypeError(f"draw: expected a function, got {type(draw).__name__}; leave it out")
    for name, flag in (("skip_existing", skip_existing), ("strict", strict)):
        flag_of(name, flag)
    jobs = cpus() if jobs is None else _whole("jobs", jobs, 1, 1000)
    level = _whole("level", level, 0, 9)
    place = None if mask is None else Path(path_text("mask", mask))
    if place is not None and os.path.realpath(place) == os.path.realpath(path):
        raise ArgumentError(f"mask: expected a name of its own, got the output's, {path}; rename one")
    with _placing(path):
        is_there = path.suffix.lower() in VIDEO_CODECS and path.exists()  # a video is there only if it is whole
        if skip_existing and is_there and (place is None or place.exists()):
            return Summary()
        if is_folder(path, ending) or (place is not None and is_folder(place)):
            _check_names(stream)
        sinks = [sink_for(path, rate=stream.rate, ending=ending, level=level)]
    if place is not None:
        with _placing(place):
            sinks.append(sink_for(place, rate=stream.rate, level=level))
    # More than one job: a warp takes one thread, because its frames are enough work for all CPUs.
    if options.get("threads") is None and jobs > 1:
        options["threads"] = 1
    work = _work(stream, lut, sinks, skip_existing, draw, options)
    return _run(stream, work, sinks, jobs=jobs, strict=strict, report=report)


def _check_names(stream: Stream) -> None:
    """Refuse frames of one name before anything is written, where their files, and so their names, are known."""
    named: dict[str, Path] = {}
    with contextlib.closing(tickets_of(stream)) as tickets:
        for ticket in tickets:
            if ticket.path is None:
                return  # a video or a bag, which would be read for it: the folder refuses the second one
            other = named.setdefault(os.path.normcase(ticket.name), ticket.path)
            if other is not ticket.path:
                raise ArgumentError(
                    f"stream: expected frames of different names, as each names a file, got {ticket.name!r:.80} of "
                    f"{other} and {ticket.path}; warp them into folders of their own"
                )


@contextlib.contextmanager
def _placing(path: Path) -> Iterator[None]:
    """Make one of our errors of what the file system says of an output's name."""
    try:
        yield
    except OSError as error:
        if isinstance(error, IpmError):
            raise
        raise FileError(f"{path}: expected to write it, got: {error.strerror or error}; give another name") from error


def _work(
    stream: Stream,
    lut: Any,
    sinks: list[Sink],
    skip_existing: bool,
    draw: Callable[[NDArray[Any], Any], NDArray[Any]] | None,
    options: dict[str, Any],
) -> Callable[[Ticket], list[Any] | None]:
    """Return what is done to a ticket on one of the threads: what each sink puts, or None where all have it already."""

    def work(ticket: Ticket) -> list[Any] | None:
        if skip_existing and all(sink.has(ticket) for sink in sinks):
            return None
        frame = ticket.load()
        pictures: Any = frame.image
        table = lut if isinstance(lut, (Lut, RigLut)) else lut(frame)
        if not callable(getattr(table, "warp", None)):
            raise ArgumentTypeError(f"lut: expected a function that returns a Lut, got {type(table).__name__} from it")
        try:
            view = table.warp(pictures, **options)
        except ImageError as error:
            raise ImageError(f"{stream.path}: frame {ticket.name}: {error}") from error
        shown = [view if draw is None else _drawn(draw(view, table))]
        if len(sinks) > 1:
            shown.append(np.where(table.mask, np.uint8(255), np.uint8(0)))
        return [sink.prepare(ticket, picture) for sink, picture in zip(sinks, shown, strict=True)]

    return work


def _drawn(picture: Any) -> NDArray[Any]:
    """Return what `draw` made as an array."""
    wanted = "draw: expected a function that returns a picture, (H, W) or (H, W, C) numbers,"
    array = None if picture is None else array_of("draw", picture)
    if array is None or array.dtype.kind not in "buif":
        got = type(picture).__name__ if array is None else f"{type(picture).__name__} of {array.dtype}"
        raise ArgumentTypeError(f"{wanted} got {got} from it; return the picture")
    if array.ndim not in (2, 3) or array.size == 0:
        raise ArgumentError(f"{wanted} got shape {array.shape} from it; return the picture")
    return array


def _run(
    stream: Stream,
    work: Callable[[Ticket], list[Any] | None],
    sinks: list[Sink],
    *,
    jobs: int,
    strict: bool,
    report: Callable[[Ticket, IpmError | None], None] | None,
) -> Summary:
    """Do the work of `warp`, its arguments checked."""
    summary, begin = Summary(), perf_counter()
    with contextlib.ExitStack() as stack:
        for sink in sinks:
            stack.callback(sink.discard)
        with contextlib.closing(ordered(stream.tickets(), work, jobs)) as results:
            for ticket, future in results:
                error: IpmError | None = None
                try:
                    made = future.result()
                    if made is None:
                        summary.skipped += 1
                    else:
                        for sink, prepared in zip(sinks, made, strict=True):
                            sink.put(ticket, prepared)
                        summary.done += 1
                except (FileError, ImageError) as problem:
                    if strict or _is_fatal(problem):
                        raise
                    error = problem
                    summary.failed.append(problem)
                except CancelledError:  # pragma: no cover - only where the interpreter is ending
                    break
                if report is not None:
                    report(ticket, error)
        if summary.done or not summary.failed:
            for sink in sinks:
                sink.close()
            stack.pop_all()
    summary.seconds = perf_counter() - begin
    return summary


def _is_fatal(problem: IpmError) -> bool:
    """Say whether the next frame would fail alike: no space, no folder, no permission."""
    cause = problem.__cause__
    return isinstance(cause, OSError) and cause.errno is not None and "expected to write" in str(problem)


def _whole(name: str, value: Any, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ArgumentTypeError(f"{name}: expected a whole number, got {type(value).__name__}")
    if not low <= value <= high:
        raise ArgumentError(f"{name}: expected {low} to {high}, got {value}")
    return value
