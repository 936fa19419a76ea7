"""What the frames of ``ipm-rs mosaic`` are called in the map: the same after a stop, and another in each drive."""

from __future__ import annotations

import contextlib
import hashlib
import os
from pathlib import Path

import numpy as np

import ipm_rs
from ipm_rs import streams
from ipm_rs.cli.drive import Poses
from ipm_rs.errors import IpmError

__all__ = ["Names"]

_TAIL = 4096
"""Bytes from a file's end: checksums of PNG, the last rows of others. Reading all would cost what decoding does."""


class Names:
    """Names that tell frames of several drives apart, though their files are called alike.

    A name is the ticket's, and a digest of where and when the picture was taken, by which cameras, and of the file's
    size and end. Where the file lies is not in it: a drive that was moved keeps its names. Drives whose poses come with
    the frames have them at decoding alone, so these are not in it either.
    """

    def __init__(
        self, mosaic: ipm_rs.Mosaic, stream: streams.Stream, cameras: ipm_rs.Camera | ipm_rs.Rig, poses: Poses
    ):
        self.mosaic, self.poses = mosaic, poses
        mounts = {"": cameras} if isinstance(cameras, ipm_rs.Camera) else dict(cameras)
        self.same = b"".join(
            name.encode("utf-8", "surrogatepass") + _rounded(camera.vehicle_from_camera)
            for name, camera in sorted(mounts.items())
        )
        self.whole = _end_of(Path(stream.path))

    def of(self, ticket: streams.Ticket) -> str:
        """Return the name of a frame."""
        pose = None
        with contextlib.suppress(IpmError):  # told of where the frame is added
            pose = self.poses.given(ticket)
        digest = hashlib.blake2b(self.same, digest_size=6)
        digest.update(b"" if pose is None else _rounded(pose))
        digest.update(b"" if ticket.timestamp is None else f"{ticket.timestamp:.6f}".encode())
        digest.update(self.whole if ticket.path is None else _end_of(ticket.path))
        return f"{ticket.name} {digest.hexdigest()}"

    def has(self, ticket: streams.Ticket, name: str) -> bool:
        """Say whether the map holds a frame."""
        return name in self.mosaic or self.has_bare(ticket)

    def has_bare(self, ticket: streams.Ticket) -> bool:
        """Say whether it holds one of that file's name alone, as earlier versions and callers of `Mosaic.add` do."""
        return ticket.name in self.mosaic


def _rounded(pose: np.typing.NDArray[np.float64]) -> bytes:
    """Return a pose to the micrometre: another processor may interpolate it with another last bit."""
    return (np.round(pose, 6) + 0.0).astype("<f8").tobytes()


def _end_of(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - _TAIL))
            return size.to_bytes(8, "little") + file.read()
    except (OSError, ValueError):  # a directory, or not there: what reads it says so
        return b""
