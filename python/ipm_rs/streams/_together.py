"""Streams of several cameras as one, whose frames hold a picture of each."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from ipm_rs._arguments import flag_of, number_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError, ImageError
from ipm_rs.streams._frame import Frame, Stream, Ticket

__all__ = ["together"]

_TOLERANCE = 0.05
"""Seconds, of streams that do not say how many frames a second they have: half of what 10 a second are apart."""


def together(streams: Mapping[str, Stream], *, tolerance: float | None = None, partial: bool = False) -> Stream:
    """Return one stream of several cameras, for `RigLut`: the `image` of its frames maps names to pictures.

    The first stream leads: each of its frames makes one, with its name and timestamp. Where all streams have
    timestamps, of each other one the picture that is nearest in time belongs to it; otherwise, pictures of the same
    number belong together.

    Parameters
    ----------
    streams : mapping of str to Stream
        By the names of the rig's cameras.
    tolerance : float, optional
        Seconds that pictures of one moment may lie apart; by default half of what the first stream's frames do.
    partial : bool
        Leave out what a camera lacks at a moment, and what cannot be decoded, for ``warp(..., missing="next")``; by
        default such a frame is an error of its own.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        There is no stream, or something else in its place; streams without timestamps differ in their numbers of
        frames.
    """
    if not isinstance(streams, Mapping) or not all(isinstance(one, Stream) for one in streams.values()):
        raise ArgumentTypeError("streams: expected a mapping of names to streams; streams.open makes one")
    if not streams:
        raise ArgumentError("streams: expected at least one, got none")
    flag_of("partial", partial)
    lead = next(iter(streams.values()))
    if tolerance is None:
        tolerance = 0.5 / lead.rate if lead.rate else _TOLERANCE
    elif not number_of("tolerance", tolerance) >= 0:
        raise ArgumentError(f"tolerance: expected seconds from 0 on, got {tolerance:g}")
    counts = {name: one.count for name, one in streams.items() if one.rate is None and one.count is not None}
    if len(counts) == len(streams) and len(set(counts.values())) > 1:
        text = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise ArgumentError(f"streams: expected as many frames of each camera, got {text}; leave some out")
    make = functools.partial(_tickets, dict(streams), float(tolerance), partial)
    return replace(lead, make=make, size=None, camera=None)


def _tickets(streams: dict[str, Stream], tolerance: float, partial: bool) -> Iterator[Ticket]:
    (leader, lead), *others = streams.items()
    with contextlib.ExitStack() as stack:
        first = _opened(stack, lead)
        followers = {name: _Follower(_opened(stack, one)) for name, one in others}
        for number, ticket in enumerate(first):
            found = {leader: ticket}
            for name, follower in followers.items():
                near = follower.near(number, ticket.timestamp, tolerance)
                if near is not None:
                    found[name] = near
            load = functools.partial(_load, lead.path, ticket, list(streams), found, tolerance, partial)
            yield replace(ticket, load=load)


def _opened(stack: contextlib.ExitStack, stream: Stream) -> Iterator[Ticket]:
    tickets = stream.tickets()
    close = getattr(tickets, "close", None)
    if close is not None:
        stack.callback(close)
    return tickets


class _Follower:
    """A stream of which the tickets that are nearest to growing moments are taken, or those of a number."""

    def __init__(self, tickets: Iterator[Ticket]) -> None:
        self.tickets, self.now, self.following, self.number = tickets, None, next(tickets, None), -1

    now: Ticket | None
    following: Ticket | None

    def near(self, number: int, moment: float | None, tolerance: float) -> Ticket | None:
        """Return the ticket that belongs to a moment, or where there are none to a number."""
        if moment is None or (self.now is None and self.following is not None and self.following.timestamp is None):
            while self.number < number:
                self._step()
            return self.now
        while self.following is not None:
            time = self.following.timestamp
            if time is not None and self.now is not None and self.now.timestamp is not None:
                if abs(time - moment) > abs(self.now.timestamp - moment):
                    break
            if time is None:  # a frame that cannot be read
                self.following = next(self.tickets, None)
                continue
            self._step()
            if time >= moment:
                break
        held = self.now
        if held is None or held.timestamp is None or abs(held.timestamp - moment) > tolerance:
            return None
        return held

    def _step(self) -> None:
        self.now, self.following, self.number = self.following, next(self.tickets, None), self.number + 1


def _load(
    path: str, ticket: Ticket, names: list[str], found: dict[str, Ticket], tolerance: float, partial: bool
) -> Frame:
    pictures: dict[str, Any] = {}
    lead: Frame | None = None
    for name in names:
        if name not in found:
            if partial:
                continue
            raise FileError(
                f"{path}: frame {ticket.name}: expected a picture of {name} within {tolerance:.3g} s, got none; give a "
                "wider tolerance, or partial=True (--missing)"
            )
        try:
            frame = found[name].load()
        except (FileError, ImageError):
            if not partial:
                raise
            continue
        pictures[name] = frame.image
        lead = frame if lead is None else lead
    if lead is None:
        raise FileError(f"{path}: frame {ticket.name}: expected a picture of some camera, got none that can be read")
    return Frame(pictures, ticket.name, ticket.index, ticket.timestamp, None, lead.map_from_vehicle)
