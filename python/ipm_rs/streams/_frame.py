"""What a stream is made of."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Camera
from ipm_rs.errors import ArgumentError, FileError

__all__ = ["Frame", "Stream", "Ticket", "bad_ticket", "tickets_of"]


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture of a stream.

    Attributes
    ----------
    image : ndarray
        (H, W), (H, W, 3) or (H, W, 4), colours in the order red, green, blue. Of several cameras `together`, a dict of
        their pictures by name.
    name : str
        Of a file without its ending, or the number of the frame in its video with six digits.
    index : int
        Its number in the stream, from 0, frames that were left out by ``every=`` included.
    timestamp : float or None
        Seconds, of the stream's own clock.
    camera : Camera or None
        The calibration that the stream has for it.
    map_from_vehicle : (4, 4) float64 or None
        Where the vehicle was.
    """

    image: Any
    name: str
    index: int
    timestamp: float | None = None
    camera: Camera | None = None
    map_from_vehicle: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Ticket:
    """A frame that is still to be decoded: `load` does it, on whatever thread calls it.

    `load` raises FileError or ImageError where this one frame is damaged; the stream goes on after it. `path` is the
    picture's file, where it has one of its own.
    """

    name: str
    index: int
    timestamp: float | None
    load: Callable[[], Frame]
    path: Path | None = None


@dataclass(frozen=True)
class Stream:
    """Frames in order. Iterate over it for frames, as often as you like; each time it begins anew.

    Attributes
    ----------
    path : str
        What it was opened from.
    make : callable
        Returns an iterator over the tickets. Closing the iterator frees what it holds.
    count : int or None
        How many frames there are, as far as is known before they are read.
    rate : float or None
        Frames a second.
    size : (width, height) or None
        Of the pictures, where the stream says it.
    camera : Camera or None
        The calibration of all its frames, where the stream has one.
    origin : float
        The timestamp from which ``start=`` and ``end=`` count.
    ground : float or None
        Height of the road in the vehicle frame in metres, for ``Lut(..., ground=)``, where the dataset has one: KITTI's
        nominal heights, Argoverse 2's and nuScenes' own.
    """

    path: str
    make: Callable[[], Iterator[Ticket]]
    count: int | None = None
    rate: float | None = None
    size: tuple[int, int] | None = None
    camera: Camera | None = None
    origin: float = 0.0
    ground: float | None = None

    def tickets(self) -> Iterator[Ticket]:
        """Return an iterator over the frames that are still to be decoded."""
        return self.make()

    def __iter__(self) -> Iterator[Frame]:
        for ticket in self.make():
            yield ticket.load()

    def chosen(self, every: int = 1, start: float | None = None, end: float | None = None) -> Stream:
        """Return the stream of every so many-th frame, of those from `start` on and before `end`, from its `origin`."""
        if every == 1 and start is None and end is None:
            return self
        count, rate = self.count, self.rate
        if count is not None and rate and (start is not None or end is not None):
            first, last = (start or 0.0) * rate, count if end is None else min(end * rate, count)
            count = max(0, round(last - first))
        count = None if count is None else -(-count // every)
        return replace(
            self,
            make=lambda: _chosen(self, every, start, end),
            count=count,
            rate=None if rate is None else rate / every,
        )


def _chosen(stream: Stream, every: int, start: float | None, end: float | None) -> Iterator[Ticket]:
    taken = 0
    tickets = stream.tickets()
    try:
        for ticket in tickets:
            if start is not None or end is not None:
                if ticket.timestamp is None:
                    raise ArgumentError(
                        f"{stream.path}: expected no start and end, got them for frames without timestamps; "
                        "leave them out"
                    )
                passed = ticket.timestamp - stream.origin
                if end is not None and passed >= end:
                    return
                if start is not None and passed < start:
                    continue
            if taken % every == 0:
                yield ticket
            taken += 1
    finally:
        close = getattr(tickets, "close", None)
        if close is not None:
            close()


def tickets_of(stream: Stream) -> Generator[Ticket, None, None]:
    """Give a stream's tickets as a generator, whose `close` frees what it holds."""
    yield from stream.tickets()


def bad_ticket(path: str, name: str, index: int, problem: str) -> Ticket:
    """Return the ticket of a frame that cannot be read: its `load` raises what is wrong."""

    def load() -> Frame:
        raise FileError(f"{path}: frame {index}: expected {problem}; fetch it again")

    return Ticket(name, index, None, load)
