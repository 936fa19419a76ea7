"""Videos, through PyAV (extra ``video``): any container and codec that FFmpeg knows.

* Timestamps are the file's own, in seconds from its first frame: exact for a variable frame rate too.
* A file that asks players to turn its pictures (phones write this) is refused by default, because a calibration belongs
  to the stored pixels or to the turned ones, and only the caller knows: ``rotation="ignore"`` takes them as stored,
  ``"apply"`` as they are shown.
* More than 8 bits a channel become 8, or 16 with ``bits=16``.
* Colours are converted by the matrix that the file names; where it names none, BT.709 for 720 rows and more, BT.601
  for less, as players do.
* A frame that cannot be decoded is an error of that frame, and the next one follows. A file that ends before the number
  of frames that its header promises is one error at the end.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ipm_rs.errors import ArgumentError, FileError, ImageError, MissingExtraError
from ipm_rs.files.atomic import check_source, reading
from ipm_rs.streams._frame import Frame, Stream, Ticket, bad_ticket

__all__ = ["TITLE", "colorspace", "read", "recognises", "require_av"]

TITLE = "a video"
ENDINGS = set(".mp4 .mov .m4v .mkv .webm .avi .ts .mts .mpg .mpeg .wmv .flv .3gp .ogv .h264 .h265 .hevc .gif".split())
_ROTATIONS = ("refuse", "ignore", "apply")
_HD_ROWS = 720
_STILL = 0.1
"""Seconds by which a file may say that it lasts longer than twice the longest time between two of its frames."""


def require_av() -> ModuleType:
    """Import and return PyAV, or raise MissingExtraError when it is not installed."""
    try:
        import av
    except ImportError as error:
        raise MissingExtraError(
            'expected PyAV, which reads and writes videos, found none; install it with: pip install "ipm-rs[video]"'
        ) from error
    module: ModuleType = av
    return module


def recognises(path: str) -> bool:
    """Say whether a path ends as videos do."""
    return Path(path).suffix.lower() in ENDINGS


def read(path: str, rotation: str = "refuse", bits: int = 8) -> Stream:
    """Open a video, and look at its header.

    Raises
    ------
    MissingFileError, FileError
        There is no such file, it is no video, its codec is unknown, or it asks for its pictures to be turned.
    ArgumentError
        `rotation` or `bits` is none of the choices.
    MissingExtraError
        PyAV is not installed.
    """
    if not isinstance(rotation, str) or rotation not in _ROTATIONS:
        raise ArgumentError(f"rotation: expected {', '.join(map(repr, _ROTATIONS))}, got another; choose one")
    if isinstance(bits, bool) or not isinstance(bits, int) or bits not in (8, 16):
        raise ArgumentError("bits: expected 8 or 16, got another; choose one")
    place = Path(path)
    check_source(place, "a video")
    av = require_av()
    with reading(place, "a video"), av.open(path) as container:
        stream = _video_stream(path, container)
        context = stream.codec_context
        if context is None:
            raise FileError(f"{path}: expected a codec that FFmpeg knows, got another; convert the video")
        size = (context.width, context.height)
        rate = float(stream.average_rate) if stream.average_rate else None
        count = stream.frames or None
        if count is None and rate and container.duration:
            count = max(1, round(rate * container.duration / 1e6))
    tickets = functools.partial(_tickets, path, rotation, bits)
    turn = _first_rotation(path)
    if turn and rotation == "refuse":
        raise FileError(
            f"{path}: expected pictures as they are stored, got a video that asks to be turned by {turn} degrees; give "
            'rotation="ignore" if the calibration is of the stored pixels, "apply" if of the turned ones (--rotation)'
        )
    if turn in (90, -90, 270, -270) and rotation == "apply":
        size = size[::-1]
    return Stream(path, tickets, count=count, rate=rate, size=size)


def colorspace(tagged: int, rows: int) -> int:
    """Return the number of the matrix of a picture, in swscale's own numbers: what its tag says, or what is usual."""
    same = {6: 5, 10: 9}.get(tagged, tagged)  # tags of the same matrix
    return same if same in (1, 4, 5, 7, 9) else 1 if rows >= _HD_ROWS else 5


def _video_stream(path: str, container: Any) -> Any:
    if not container.streams.video:
        raise FileError(f"{path}: expected a video, got a file without pictures; check it")
    stream = container.streams.video[0]
    stream.thread_type = "AUTO"
    return stream


def _first_rotation(path: str) -> int:
    """Return by how many degrees the first frame that can be decoded wants to be turned, counter-clockwise."""
    av = require_av()
    with reading(path, "a video"), av.open(path) as container:
        _video_stream(path, container)
        for packet in container.demux(video=0):
            try:
                for frame in packet.decode():
                    return int(frame.rotation)
            except av.FFmpegError:
                continue
    raise FileError(f"{path}: expected a video, got one of whose frames none can be decoded; fetch it again")


def _tickets(path: str, rotation: str, bits: int) -> Iterator[Ticket]:
    av = require_av()
    index, first, last, now = 0, None, None, 0.0
    with reading(path, "a video"), av.open(path) as container:
        stream = _video_stream(path, container)
        # of the containers that list every frame; the header of AVI counts ticks in which nothing comes
        promised = stream.frames if "mp4" in container.format.name else 0
        until, gap = _promised_end(container, stream), 0.0
        packets = container.demux(stream)
        while True:
            try:
                packet = next(packets)
                frames = packet.decode()
            except StopIteration:
                break
            except (av.FFmpegError, ValueError) as error:
                yield bad_ticket(path, f"{index:06d}", index, f"a frame that can be decoded, got: {error}")
                index += 1
                continue
            for frame in frames:
                ticks, time = frame.pts, None
                if ticks is not None:
                    first = ticks if first is None else first
                    if last is not None and ticks <= last:
                        time, before = (float((one - first) * frame.time_base) for one in (ticks, last))
                        yield bad_ticket(
                            path, f"{index:06d}", index, f"timestamps that grow, got {time:.6f} s after {before:.6f} s"
                        )
                        index += 1
                        continue
                    if last is not None:
                        gap = max(gap, float((ticks - last) * frame.time_base))
                    last, now = ticks, float(ticks * frame.time_base)
                    time = float((ticks - first) * frame.time_base)  # rounded once
                load = functools.partial(_load, path, frame, index, time, rotation, bits)
                yield Ticket(f"{index:06d}", index, time, load)
                index += 1
    if promised and index < promised:
        yield bad_ticket(
            path, f"{index:06d}", index, f"{promised} frames as its header says, got {index}: it is cut short"
        )
    elif until is not None and until - now > 2 * gap + _STILL:
        yield bad_ticket(
            path, f"{index:06d}", index, f"{until:.2f} s as its header says, got {now:.2f}: it is cut short"
        )


def _promised_end(container: Any, stream: Any) -> float | None:
    """Return when a file of Matroska or WebM ends by its own words, in seconds: it does not say how many frames it has.

    FFmpeg tags each stream with it; the duration of the whole file may be that of its sound.
    """
    if "matroska" not in container.format.name:
        return None
    clock = re.fullmatch(r"(\d+):(\d+):(\d+(?:\.\d+)?)", str(stream.metadata.get("DURATION", "")))
    if clock is not None:
        hours, minutes, seconds = (float(part) for part in clock.groups())
        return 3600 * hours + 60 * minutes + seconds
    return container.duration / 1e6 if container.duration and len(container.streams) == 1 else None


def _load(path: str, frame: Any, index: int, time: float | None, rotation: str, bits: int) -> Frame:
    form = "gray" if bits == 8 and frame.format.name == "gray" else "rgb24" if bits == 8 else "rgb48le"
    try:
        if form == "gray":
            image = frame.to_ndarray()
        else:
            image = frame.reformat(format=form, src_colorspace=colorspace(frame.colorspace, frame.height)).to_ndarray()
    except (ValueError, OSError, MemoryError) as error:
        raise ImageError(f"{path}: frame {index}: expected a picture, got: {error}; convert the video") from error
    if rotation == "apply" and frame.rotation:
        image = np.ascontiguousarray(np.rot90(image, round(frame.rotation / 90)))
    return Frame(image, f"{index:06d}", index, time)
