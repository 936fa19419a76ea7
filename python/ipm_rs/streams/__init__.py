"""Frames of a drive, one after another: from folders, videos, bags, datasets; and pictures back to such.

    for frame in ipm_rs.streams.open("drive.mp4"):
        bev = lut.warp(frame.image)

`open` recognises what a path is. `warp` runs a whole stream through a table, with decoding, warping and encoding on
threads of their own, in order, and in memory that does not grow.

How to add a source
-------------------
A module ``ipm_rs/streams/<kind>.py`` with ``TITLE``, ``recognises(path) -> bool``, which looks at names and first bytes
only, and ``read(path, **options) -> Stream``; and its name in `FORMATS`.
"""

from __future__ import annotations

import inspect
import os
from importlib import import_module
from typing import Any, Protocol, cast

from ipm_rs._arguments import number_of, path_text
from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError
from ipm_rs.files.atomic import reading
from ipm_rs.streams._attitudes import per_frame
from ipm_rs.streams._frame import Frame, Stream, Ticket
from ipm_rs.streams._pipeline import Summary, warp
from ipm_rs.streams._together import together

__all__ = ["FORMATS", "Frame", "Stream", "Summary", "Ticket", "open", "per_frame", "recognise", "together", "warp"]

FORMATS: tuple[str, ...] = (
    "bag",
    "kitti_raw",
    "kitti_odometry",
    "nuscenes",
    "argoverse2",
    "dgp",
    "folder",
    "video",
)
"""Kinds of sources, in the order in which they are tried."""

_MOST = 10**9
"""A larger ``every=`` is a slip."""


class Source(Protocol):
    """What a module of a kind of source holds."""

    TITLE: str

    def recognises(self, path: str) -> bool:
        """Say whether a path is of this kind."""

    def read(self, path: str, **options: Any) -> Stream:
        """Open it."""


def open(
    path: str | os.PathLike[str],
    *,
    kind: str | None = None,
    every: int = 1,
    start: float | None = None,
    end: float | None = None,
    **options: Any,
) -> Stream:
    """Open a stream of frames.

    Parameters
    ----------
    path : str or path
        A folder of images, a pattern (``"frames/*.png"``), a ``.txt`` list with an image's path in each line, a video,
        a ROS bag, or a drive of a dataset in its own layout.
    kind : str, optional
        One of `FORMATS`; recognised by default.
    every : int
        Only every so many-th frame.
    start, end : float, optional
        Seconds from the beginning: frames from `start` on and before `end`. Folders, whose frames have no timestamps,
        refuse them.
    **options
        Of the kind. Videos: ``rotation="refuse"``, ``"ignore"`` or ``"apply"`` for a file that asks for its pictures to
        be turned; ``bits=8``, or 16 for what the file holds beyond 8. Bags: ``topic=``, ``camera_info=``,
        ``vehicle_frame=``, ``map_frame=``, ``clock=``, ``max_gap=``, ``poses=``, see `ipm_rs.streams.bag`. Datasets:
        ``camera=``, and what `ipm_rs.streams.kitti_raw`, `kitti_odometry`, `nuscenes`, `argoverse2` and `dgp` say.

    Returns
    -------
    Stream
        Iterate over it for `Frame`.

    Raises
    ------
    MissingFileError, FileError
        There is nothing of that name, or nothing that is known.
    ArgumentError, ArgumentTypeError
        An argument is wrong, or none of this kind's.
    MissingExtraError
        What reads this kind is not installed; the message names the extra.
    """
    text = path_text("path", path)
    if isinstance(every, bool) or not isinstance(every, int):
        raise ArgumentTypeError(
            f"every: expected a whole number, got {type(every).__name__}; 2 takes every other frame"
        )
    if not 1 <= every <= _MOST:
        raise ArgumentError(f"every: expected 1 to {_MOST}, got another number; 2 takes every other frame")
    first, last = (_seconds(name, moment) for name, moment in (("start", start), ("end", end)))
    if kind is None:
        kind = recognise(text)
    elif not isinstance(kind, str):
        raise ArgumentTypeError(f"kind: expected a name, got {type(kind).__name__}; leave it out")
    elif kind not in FORMATS:
        raise ArgumentError(f"kind: expected {', '.join(map(repr, FORMATS))}, got {kind!r:.80}; choose one")
    _check_options(kind, options)
    with reading(text, "a stream of frames"):  # what the file system says of a name that no file can have
        return _source(kind).read(text, **options).chosen(every=every, start=first, end=last)


def _check_options(kind: str, options: dict[str, Any]) -> None:
    """Refuse options that a kind of stream does not have."""
    known = list(inspect.signature(_source(kind).read).parameters)[1:]
    for name in options:
        if name not in known:
            takes = f"one of {', '.join(f'{each}=' for each in known)}" if known else "no option"
            raise ArgumentError(f"{name}=: expected {takes} for a stream of kind {kind!r}, got {name}=; leave it out")


def _seconds(name: str, moment: Any) -> float | None:
    if moment is None:
        return None
    seconds = number_of(name, moment)
    if seconds < 0:
        raise ArgumentError(f"{name}: expected seconds from 0 on, got {seconds:g}")
    return seconds


def recognise(path: str | os.PathLike[str]) -> str:
    """Return the kind of source that a path is, one of `FORMATS`.

    Raises
    ------
    FileError
        It is none of them.
    ArgumentTypeError
        It is no path.
    """
    text = path_text("path", path)
    with reading(text, "a stream of frames"):
        found = next((name for name in FORMATS if _source(name).recognises(text)), None)
    if found is not None:
        return found
    known = "; ".join(_source(name).TITLE for name in FORMATS)
    raise FileError(
        f"{text}: expected a stream of frames, got none that is known ({known}); give kind= or another path"
    )


def _source(name: str) -> Source:
    return cast(Source, import_module(f"ipm_rs.streams.{name}"))
