r"""Header and blocks in one file: what `Lut.save` writes, and any other object whose bulk is tables and arrays.

All numbers are little-endian.

=========  ======================================================================================================
bytes      content
=========  ======================================================================================================
0 to 8     ``89 49 50 4d 52 53 0d 0a``, "\x89IPMRS\r\n": a file that was copied as text does not begin so any more
8 to 16    XXH3-64 of all from byte 16 to the end of the header
16 to 18   version of the format that wrote the file
18 to 20   oldest version of the format that can read it
20 to 24   length of the header
24 to 32   length of the file
32 to ...  header: JSON (UTF-8) with ``kind``, ``written_by``, ``blocks`` and what the kind adds
then       the blocks, each from a multiple of 64 on, zeros between them
=========  ======================================================================================================

``blocks`` is a list of ``{"name", "start", "length", "xxh3"}`` in the order of the file, the checksum as 16 hexadecimal
digits. A block that begins at a multiple of 64 is aligned for every number and vector type where the file is mapped to
memory. We read instead of mapping: a table is proved before it is used, and in a mapped file, other processes could
change it afterwards. A block that checks itself is read where it is taken apart, piece by piece.

A later version may add keys and blocks without another "oldest version": what a reader does not know it passes over.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import ipm_rs._core as core
from ipm_rs.errors import LutError
from ipm_rs.files.atomic import atomically

__all__ = ["MAGIC", "Content", "read", "write"]

MAGIC = b"\x89IPMRS\r\n"
VERSION = 1
_PREFIX = struct.Struct("<8sQHHIQ")
_ALIGNED = 64
_MOST_BLOCKS = 10_000


@dataclass(frozen=True)
class Content:
    """A file whose checksums are right: its header and its blocks, but for those that check themselves."""

    path: Path
    header: dict[str, Any]
    file: BinaryIO
    blocks: dict[str, bytes | tuple[int, int]]

    def block(self, name: str) -> bytes:
        """Return the bytes of a block.

        Raises
        ------
        LutError
            There is none of this name.
        """
        found = self._find(name)
        if isinstance(found, bytes):
            return found
        self.file.seek(found[0])
        return self.file.read(found[1])

    def open(self, name: str) -> tuple[BinaryIO, int]:
        """Return the file where a block that checks itself begins, and how long that is; raises as `block` does."""
        found = self._find(name)
        if isinstance(found, bytes):
            return io.BytesIO(found), len(found)
        self.file.seek(found[0])
        return self.file, found[1]

    def _find(self, name: str) -> bytes | tuple[int, int]:
        if name not in self.blocks:
            raise LutError(f"{self.path}: expected a block {name!r}, found none; the file is damaged, write it again")
        return self.blocks[name]


def write(path: Path, kind: str, header: Mapping[str, Any], blocks: Mapping[str, bytes]) -> None:
    """Write a file, whole or not at all.

    Parameters
    ----------
    path : Path
        The file; an existing one is replaced.
    kind : str
        What it holds: ``"Lut"``.
    header : mapping
        What JSON holds: the keys that the kind adds. No key ``kind``, ``written_by`` or ``blocks``.
    blocks : mapping of bytes
        Name and content of each block.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    entries: list[dict[str, Any]] = [
        {"name": name, "start": 0, "length": len(block), "xxh3": f"{core._checksum(block):016x}"}
        for name, block in blocks.items()
    ]
    full = {"kind": kind, "written_by": f"ipm_rs {core.__version__}", **header, "blocks": entries}
    # Where the blocks begin depends on the length of the header, and that on the digits of the numbers in it. The room
    # of twenty digits for each is blank at the header's end.
    length = len(json.dumps(full, allow_nan=False).encode()) + 20 * len(entries)
    end = _PREFIX.size + length
    for entry in entries:
        entry["start"] = -(-end // _ALIGNED) * _ALIGNED
        end = entry["start"] + entry["length"]
    text = json.dumps(full, allow_nan=False).encode().ljust(length)
    covered = _PREFIX.pack(MAGIC, 0, VERSION, 1, length, end)[16:] + text
    with atomically(path) as file:
        file.write(MAGIC + struct.pack("<Q", core._checksum(covered)) + covered)
        written = _PREFIX.size + length
        for entry, block in zip(entries, blocks.values(), strict=True):
            file.write(bytes(entry["start"] - written))
            file.write(block)
            written = entry["start"] + len(block)


def read(path: Path, file: BinaryIO, kind: str, own_checksums: Collection[str] = ()) -> Content:
    """Take a file apart and check every byte of it.

    Parameters
    ----------
    path : Path
        Where `file` is, for messages.
    file : BinaryIO
        The file, at its start and open as long as the result is used. It begins with `MAGIC`.
    kind : str
        What it must hold.
    own_checksums : collection of str
        Blocks whose content brings a checksum of all its bytes, which whoever takes it apart looks at: they are left in
        the file (`Content.open`).

    Raises
    ------
    LutError
        It is cut short or damaged, a newer version wrote it, or it holds something else.
    """
    prefix = file.read(_PREFIX.size)
    if len(prefix) < _PREFIX.size:
        raise _cut(path, _PREFIX.size, len(prefix))
    _, checksum, version, oldest, length, total = _PREFIX.unpack(prefix)
    if oldest > VERSION:
        raise LutError(
            f"{path}: expected a file of version {VERSION} or older, got version {version}, which a newer ipm_rs "
            "wrote; install that, or write the file again"
        )
    there = file.seek(0, io.SEEK_END)
    file.seek(_PREFIX.size)
    if there < total:
        raise _cut(path, total, there)
    end = _PREFIX.size + length
    text = file.read(length) if end <= total else b""
    if there != total or end > total or core._checksum(prefix[16:] + text) != checksum:
        raise _damaged(path, "its header")
    try:
        header = json.loads(text)
        found, entries = header["kind"], header["blocks"]
        parts = [
            (str(e["name"]), int(e["start"]), int(e["length"]), int(e["xxh3"], 16)) for e in entries[:_MOST_BLOCKS]
        ]
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise _damaged(path, "its header") from error
    if found != kind:
        raise LutError(f"{path}: expected a {kind}, got a {found!r:.40}; load it as what it is")
    blocks: dict[str, bytes | tuple[int, int]] = {}
    for name, start, size, expected in parts:
        if not end <= start < end + _ALIGNED or size < 0 or start + size > total or any(file.read(start - end)):
            raise _damaged(path, "its header")
        end = start + size
        if name in own_checksums:
            blocks[name] = (start, size)
            file.seek(end)
            continue
        block = file.read(size)
        if core._checksum(block) != expected:
            raise _damaged(path, f"its block {name!r:.40}")
        blocks[name] = block
    if end != total:
        raise _damaged(path, "its end")
    return Content(path, header, file, blocks)


def _cut(path: Path, wanted: int, got: int) -> LutError:
    return LutError(f"{path}: expected {wanted} bytes, got {got}; it is cut short: fetch or write it again")


def _damaged(path: Path, what: str) -> LutError:
    return LutError(
        f"{path}: expected a file as it was written, got one whose checksum or layout of {what} is wrong; "
        "it is damaged: fetch or write it again"
    )
