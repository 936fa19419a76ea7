"""Files of users: written whole or not at all, and read with every failure as one of our errors.

A file is written under a temporary name in its own directory, ``.ipm-rs-<letters>.tmp``, brought to the disk, and then
given its name: whoever opens that sees the file as it was before or as it is now, whatever happens meanwhile. A process
that is killed leaves its temporary file behind; the next one that writes into the directory removes it. It tells it
from one that is being written by the lock that a writer holds on its temporary file as long as it lives.

Behind a symbolic link, its target is written and the link stays. What is no regular file (a directory, a device, a
pipe, a socket) is refused: renaming would replace it.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from ipm_rs._arguments import path_text
from ipm_rs.errors import FileError, IpmError, MissingFileError

try:
    import fcntl
except ImportError:  # Windows, where a file that is open cannot be removed: that tells as much as a lock
    fcntl = None  # type: ignore[assignment]

__all__ = ["as_path", "atomically", "check_source", "check_target", "reading", "remove_leftovers"]

_PREFIX, _SUFFIX = ".ipm-rs-", ".tmp"
_FAILURES = (OSError, ValueError, OverflowError, EOFError, SystemError, struct.error)
_SHARE = 100
"""Leftovers are looked for again after so many times what the last look took, so that large directories cost little."""

_next_look: dict[str, float] = {}


@contextlib.contextmanager
def atomically(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a temporary file that takes its final name when the block ends well, and is removed when it does not.

    Its permissions are those of any new file: the umask decides.

    Raises
    ------
    FileError
        The file cannot be written, or is no regular file, or what is to be written failed to be encoded in the block.
    """
    final = check_target(Path(path))
    remove_leftovers(final.parent)
    # named before it is made, so that no signal that comes in between leaves it behind
    temporary = final.parent / f"{_PREFIX}{os.urandom(8).hex()}{_SUFFIX}"
    try:
        with _new_file(temporary) as file:
            yield file
            file.flush()
            _to_disk(file.fileno())
            if fcntl is not None:  # renamed while it is locked, so that nobody takes it for a leftover
                temporary.replace(final)
        if fcntl is None:
            temporary.replace(final)
        _directory_to_disk(final.parent)
    except IpmError:
        raise
    except _FAILURES as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(
            f"{path}: expected to write it, got: {reason}; check the directory, its permissions and the free space"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def as_path(path: object, argument: str = "path") -> Path:
    """Return a path as one; raises as `path_text` does."""
    return Path(path_text(argument, path))


def check_target(path: Path) -> Path:
    """Return where a path leads, or refuse what no file can be written to.

    Raises
    ------
    FileError
        It is something else than a regular file, or one that must not be written.
    """
    try:
        final = Path(os.path.realpath(path))
        mode = path.stat().st_mode  # of /dev/stdout too, which leads to no name
    except FileNotFoundError:
        return final
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{str(path)!r}: expected the name of a file, got: {reason}; give another") from error
    if not stat.S_ISREG(mode):
        raise FileError(f"{path}: expected a file to write, got {_kind(mode)}; give another name")
    if not os.access(final, os.W_OK):
        raise FileError(f"{path}: expected a file to replace, got one that is read-only; give another name")
    return final


def check_source(path: Path, wanted: str, mend: str = "check the path") -> None:
    """Refuse a path that names no regular file; ``wanted`` and ``mend`` are words of the message.

    Raises
    ------
    MissingFileError, FileError
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError) as error:
        raise MissingFileError(f"{path}: expected {wanted}, found none; check the path") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{str(path)!r}: expected {wanted}, got: {reason}; check the path") from error
    if not stat.S_ISREG(mode):
        raise FileError(f"{path}: expected {wanted}, got {_kind(mode)}; {mend}")


@contextlib.contextmanager
def reading(path: str | os.PathLike[str], wanted: str) -> Iterator[None]:
    """Make a FileError of whatever goes wrong in reading a file in the block, but for our own errors.

    Of a damaged file, decoders raise what they like: ``zlib.error``, ``zipfile.BadZipFile``, ``tokenize.TokenError``,
    NotImplementedError, EOFError, ``struct.error``, SyntaxError, RecursionError, ... Memory is the caller's to bound; a
    MemoryError passes.
    """
    try:
        yield
    except (IpmError, MemoryError):
        raise
    except OSError as error:
        if error.errno is None:  # a decoder's own, about the content
            raise _damaged(path, wanted, error) from error
        raise FileError(f"{path}: expected a readable file, got: {error.strerror or error}; check it") from error
    except Exception as error:
        raise _damaged(path, wanted, error) from error


def remove_leftovers(directory: Path) -> None:
    """Remove the temporary files of processes that are gone; what cannot be removed stays, without a word."""
    name, now = str(directory), time.monotonic()
    if now < _next_look.get(name, 0.0):
        return
    with contextlib.suppress(OSError), os.scandir(directory) as entries:
        for entry in entries:
            if entry.name.startswith(_PREFIX) and entry.name.endswith(_SUFFIX):
                with contextlib.suppress(OSError):
                    _remove_if_left(entry.path)
    if len(_next_look) > 1000:
        _next_look.clear()
    end = time.monotonic()
    _next_look[name] = end + _SHARE * (end - now)


def _remove_if_left(path: str) -> None:
    if fcntl is None:
        Path(path).unlink()
        return
    # neither through a link nor waiting for the other end of a pipe
    descriptor = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        if stat.S_ISREG(os.fstat(descriptor).st_mode):
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # refused as long as its writer lives
            Path(path).unlink()
    finally:
        os.close(descriptor)


def _new_file(path: Path) -> BinaryIO:
    """Create and lock a temporary file."""
    while True:
        file = path.open("xb")  # a plain open, so that the umask decides the permissions
        try:
            if fcntl is not None:
                with contextlib.suppress(OSError):  # a file system without locks: nobody else gets one there either
                    fcntl.flock(file, fcntl.LOCK_EX)
            if os.fstat(file.fileno()).st_nlink > 0:
                return file
        except BaseException:
            file.close()
            raise
        file.close()  # somebody took it for a leftover before the lock was there: again


def _to_disk(descriptor: int) -> None:
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EROFS):  # a file system that has no such thing
            raise


def _directory_to_disk(directory: Path) -> None:
    """Bring the new name to the disk too, where directories can be opened."""
    with contextlib.suppress(OSError):
        descriptor = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _kind(mode: int) -> str:
    kinds = {
        stat.S_IFDIR: "a directory",
        stat.S_IFIFO: "a pipe, no regular file",
        stat.S_IFSOCK: "a socket, no regular file",
        stat.S_IFCHR: "a device, no regular file",
        stat.S_IFBLK: "a device, no regular file",
    }
    return kinds.get(stat.S_IFMT(mode), "no regular file")


def _damaged(path: str | os.PathLike[str], wanted: str, error: Exception) -> FileError:
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return FileError(f"{path}: expected {wanted}, got: {reason}; it may be cut short or damaged, fetch it again")
