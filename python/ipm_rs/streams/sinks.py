"""Where pictures go: files in a folder, a video, or shards of arrays.

A sink's `prepare` runs on any thread, several at a time; `put` on one, in order; `close` once after the last, `discard`
instead of it where the run does not end well. Nothing is half written: images and shards take their names when they are
whole, and a video when it is closed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ArgumentError, FileError, ImageError
from ipm_rs.files import images
from ipm_rs.files.atomic import atomically, reading
from ipm_rs.streams._frame import Ticket
from ipm_rs.streams.video import require_av

__all__ = ["Folder", "Shards", "Sink", "Video", "is_folder", "sink_for"]

VIDEO_CODECS = {
    ".mp4": ("libx264", "mpeg4"),
    ".mov": ("libx264", "mpeg4"),
    ".mkv": ("libx264", "mpeg4"),
    ".webm": ("libvpx-vp9", "libvpx"),
    ".avi": ("mpeg4",),
}
_TICKS = 90_000
"""Of a second, as MPEG has them: exact for 24, 25, 30, 50 and 60 frames a second, 5 us off for any other moment."""
_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG, errno.EROFS)


class Sink(Protocol):
    """What takes pictures."""

    def has(self, ticket: Ticket) -> bool:
        """Say whether a frame's picture is there already, whole."""

    def prepare(self, ticket: Ticket, picture: NDArray[Any]) -> Any:
        """Do what can be done on any thread; returns what `put` takes."""

    def put(self, ticket: Ticket, prepared: Any) -> None:
        """Take the next picture."""

    def close(self) -> None:
        """Finish."""

    def discard(self) -> None:
        """Stop: what is not whole is removed."""


class Folder:
    """A file for each picture, ``<name>_bev<ending>``: PNG, JPEG, TIFF, BMP, or ``.npy`` for arrays of any dtype."""

    def __init__(self, path: Path, ending: str = ".png", level: int = 1) -> None:
        if ending != ".npy" and ending not in images.FORMATS:
            known = ", ".join([*images.FORMATS, ".npy"])
            raise ArgumentError(f"ending: expected one of {known}, got {ending!r:.40}; choose one")
        self.path, self.ending, self.level = path, ending, level
        self.owners: dict[str, int] = {}  # of each file of this run the frame, by its number
        self.lock = threading.Lock()
        path.mkdir(parents=True, exist_ok=True)

    def target(self, ticket: Ticket) -> Path:
        """Return the file of a frame."""
        return self.path / f"{ticket.name}_bev{self.ending}"

    def has(self, ticket: Ticket) -> bool:
        """See `Sink.has`."""
        return self.target(ticket).exists() and self._owner(ticket) == ticket.index

    def _owner(self, ticket: Ticket) -> int:
        """Return the number of the frame that a file belongs to in this run: of the first one that asks."""
        with self.lock:
            return self.owners.setdefault(os.path.normcase(self.target(ticket)), ticket.index)

    def prepare(self, ticket: Ticket, picture: NDArray[Any]) -> None:
        """Write the file: encoding and writing are the frame's own, whatever the order."""
        target, owner = self.target(ticket), self._owner(ticket)
        if owner != ticket.index:
            raise FileError(
                f"{target}: expected a frame of its own name for each file, got it from frames {owner} and "
                f"{ticket.index}; warp them into folders of their own"
            )
        if self.ending == ".npy":
            with atomically(target) as file:
                np.save(file, picture)
            return
        images.write(target, picture, images.Look("L"), level=self.level)

    def put(self, ticket: Ticket, prepared: Any) -> None:
        """Do nothing more."""

    def close(self) -> None:
        """Do nothing more."""

    def discard(self) -> None:
        """Keep what is there: each file is whole."""


class Shards:
    """Files ``shard-00000.npz`` of so many pictures: ``images`` (N, rows, columns, ...), ``names``, ``timestamps``.

    A frame without a timestamp has NaN.
    """

    def __init__(self, path: Path, pictures: int = 64) -> None:
        self.path, self.pictures, self.number = path, pictures, 0
        self.held: list[tuple[Ticket, NDArray[Any]]] = []
        path.mkdir(parents=True, exist_ok=True)

    def has(self, ticket: Ticket) -> bool:
        """Say no: a shard is of several frames."""
        return False

    def prepare(self, ticket: Ticket, picture: NDArray[Any]) -> NDArray[Any]:
        """Pass the picture on."""
        return picture

    def put(self, ticket: Ticket, prepared: NDArray[Any]) -> None:
        """Hold the picture, and write a shard that is full."""
        self.held.append((ticket, prepared))
        if len(self.held) == self.pictures:
            self._write()

    def close(self) -> None:
        """Write the last shard."""
        if self.held:
            self._write()

    def discard(self) -> None:
        """Drop what is held; shards that are written are whole."""
        self.held.clear()

    def _write(self) -> None:
        times = [np.nan if ticket.timestamp is None else ticket.timestamp for ticket, _ in self.held]
        with atomically(self.path / f"shard-{self.number:05d}.npz") as file:
            np.savez(
                file,
                images=np.stack([picture for _, picture in self.held]),
                names=np.array([ticket.name for ticket, _ in self.held]),
                timestamps=np.array(times),
            )
        self.number += 1
        self.held.clear()


class Video:
    """One video: H.264 in ``.mp4``, ``.mov`` and ``.mkv``, VP9 in ``.webm``, MPEG-4 in ``.avi``.

    Pictures are (H, W) or (H, W, 3) uint8, all of one size; one of an odd number of rows or columns has its last one
    twice, because chroma is stored for two by two pixels. Frames keep their timestamps, in ``.avi`` to the next of
    `rate` a second; where they have none, they come at `rate`.
    """

    def __init__(self, path: Path, rate: float | None = None, quality: int = 20) -> None:
        self.path, self.rate, self.quality = path, rate or 25.0, quality
        self.first: float | None = None
        self.last = -1
        self.count = 0
        self.base = Fraction(1, _TICKS)
        self.container: Any = None
        self.stream: Any = None
        self.stack = contextlib.ExitStack()

    def has(self, ticket: Ticket) -> bool:
        """Say no: a video is whole or is not there."""
        return False

    def prepare(self, ticket: Ticket, picture: NDArray[Any]) -> Any:
        """Make a frame in the encoder's own colours."""
        if picture.dtype != np.uint8 or (picture.ndim == 3 and picture.shape[2] != 3) or picture.ndim not in (2, 3):
            raise ImageError(
                f"{self.path}: expected (H, W) or (H, W, 3) uint8 pictures for a video, got {picture.shape} "
                f"{picture.dtype}; write a folder instead"
            )
        rows, cols = picture.shape[:2]
        if rows % 2 or cols % 2:
            sides = [(0, rows % 2), (0, cols % 2), (0, 0)]
            picture = np.pad(picture, sides[: picture.ndim], mode="edge")
        av = require_av()
        frame = av.VideoFrame.from_ndarray(
            np.ascontiguousarray(picture), format="gray" if picture.ndim == 2 else "rgb24"
        )
        frame = frame.reformat(format="yuv420p", dst_colorspace=1)
        frame.colorspace, frame.color_range = 1, 1
        return frame

    def put(self, ticket: Ticket, prepared: Any) -> None:
        """Encode the next frame."""
        if self.container is None:
            self._open(prepared.width, prepared.height)
        if (prepared.width, prepared.height) != (self.stream.width, self.stream.height):
            raise ImageError(f"{self.path}: expected pictures of one size, got another at {ticket.name}")
        if ticket.timestamp is None:
            tick = round(self.count / self.rate / self.base)
        else:
            self.first = ticket.timestamp if self.first is None else self.first
            tick = round((ticket.timestamp - self.first) / self.base)
        prepared.pts, prepared.time_base = max(tick, self.last + 1), self.base
        self.last = prepared.pts
        self._encode(prepared)
        self.count += 1

    def close(self) -> None:
        """Write what the encoder still holds, and give the file its name."""
        if self.container is None:
            self.stack.close()
            raise FileError(f"{self.path}: expected pictures for a video, got none; nothing was written")
        with self.stack:
            self._encode(None)
            with self._writing():
                self.container.close()
                self.container = None

    def discard(self) -> None:
        """Remove what was written."""
        if self.container is not None:
            with contextlib.suppress(Exception):
                self.container.close()
        self.container = None
        with contextlib.suppress(_Discarded), self.stack:
            raise _Discarded  # the temporary file is removed where its block ends with an exception

    def _open(self, width: int, height: int) -> None:
        av = require_av()
        ending = self.path.suffix.lower()
        codec = next((name for name in VIDEO_CODECS[ending] if name in av.codecs_available), None)
        if codec is None:
            raise FileError(
                f"{self.path}: expected an encoder ({', '.join(VIDEO_CODECS[ending])}), found none in this FFmpeg; "
                "write another kind of file"
            )
        file = self.stack.enter_context(atomically(self.path))
        form = {".mkv": "matroska", ".m4v": "mp4"}.get(ending, ending[1:])
        with self._writing():
            self.container = av.open(file, "w", format=form)
            rate = Fraction(self.rate).limit_denominator(1001)
            self.stream = self.container.add_stream(codec, rate=rate)
            self.stream.width, self.stream.height, self.stream.pix_fmt = width, height, "yuv420p"
            context = self.stream.codec_context
            if codec == "mpeg4":  # which counts in 16 bits, and has no time base before it is opened
                self.base = 1 / rate
            context.time_base = self.base
            context.thread_type = "AUTO"
            context.colorspace, context.color_range = 1, 1
            if codec == "libx264":
                self.stream.options = {"crf": str(self.quality), "preset": "veryfast"}
            else:
                context.bit_rate = width * height * 4

    def _encode(self, frame: Any) -> None:
        with self._writing():
            for packet in self.stream.encode(frame):
                self.container.mux(packet)

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Make one of our errors of FFmpeg's: the disk's own says so, which ends the run."""
        try:
            with reading(self.path, "to write a video"):
                yield
        except FileError as error:
            if not isinstance(error.__cause__, OSError) or error.__cause__.errno not in _DISK:
                raise
            raise FileError(
                f"{self.path}: expected to write it, got: {error.__cause__.strerror}; check the free space"
            ) from error.__cause__


class _Discarded(FileError):
    """Ends the block of a temporary file."""


def is_folder(path: Path, ending: str | None = None) -> bool:
    """Say whether a path gets a file for each frame, by the frame's name."""
    return ending != ".npz" and (path.suffix.lower() not in VIDEO_CODECS or path.is_dir())


def sink_for(path: Path, *, rate: float | None = None, ending: str | None = None, level: int = 1) -> Sink:
    """Return what writes to a path: a video where it ends as one does, else a folder of images or of ``.npz`` shards.

    Raises
    ------
    ArgumentError
        The ending of the images is unknown.
    """
    if path.suffix.lower() in VIDEO_CODECS and not path.is_dir():
        return Video(path, rate)
    return Folder(path, ending or ".png", level) if is_folder(path, ending) else Shards(path)
