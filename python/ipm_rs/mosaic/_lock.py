"""Who may use a mosaic: one process at a time its directory, and one thread at a time the object."""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import threading
import weakref
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from ipm_rs.errors import FileError

__all__ = ["DirectoryLock", "Turn", "in_turn"]

P = ParamSpec("P")
Result = TypeVar("Result")
Shared = TypeVar("Shared", bound="_Shared")


class DirectoryLock:
    """A file that is locked until `release`, until this object is collected, or until the process ends.

    Raises
    ------
    FileError
        It cannot be opened, or another one has it locked.
    """

    def __init__(self, path: Path) -> None:
        descriptor, self._process = _locked(path), os.getpid()
        self._end = weakref.finalize(self, _release, descriptor, self._process)
        # whatever else runs at the end of the process may still use the map; the end itself unlocks it
        self._end.atexit = False

    @property
    def ours(self) -> bool:
        """Whether this process took it, and not one that it was forked from."""
        return self._process == os.getpid()

    def release(self) -> None:
        """Let others have it; of a forked process this leaves the lock to the one that took it."""
        self._end()


class Turn:
    """Whose turn it is: a lock that one thread at a time holds, as often as it likes."""

    def __init__(self) -> None:
        self._lock, self._process = threading.RLock(), os.getpid()

    @property
    def lock(self) -> AbstractContextManager[bool]:
        """The lock; of a forked process a free one, for who held it may not be in this process to release it."""
        if self._process != os.getpid():
            self._lock, self._process = threading.RLock(), os.getpid()
        return self._lock


class _Shared(Protocol):
    @property
    def _turn(self) -> Turn: ...


def in_turn(method: Callable[Concatenate[Shared, P], Result]) -> Callable[Concatenate[Shared, P], Result]:
    """Let calls of an object's methods from several threads wait for each other."""

    @functools.wraps(method)
    def waiting(self: Shared, /, *args: P.args, **kwargs: P.kwargs) -> Result:
        with self._turn.lock:
            return method(self, *args, **kwargs)

    return waiting


def _locked(path: Path) -> int:
    """Return the descriptor of a file that is now locked."""
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
    except OSError as error:
        raise FileError(
            f"{path}: expected to open it, got: {error.strerror or error}; check the permissions"
        ) from error
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise FileError(
            f"{path.parent}: expected a mosaic that nobody else has open, got one that is in use; close it there first"
        ) from error
    return descriptor


def _release(descriptor: int, process: int) -> None:
    if process == os.getpid():
        # closing alone would leave it locked as long as a forked process has the descriptor too
        with contextlib.suppress(OSError):
            if sys.platform == "win32":
                import msvcrt

                msvcrt.locking(descriptor, msvcrt.LK_UNLCK, 1)
            else:
                import fcntl

                fcntl.flock(descriptor, fcntl.LOCK_UN)
    with contextlib.suppress(OSError):
        os.close(descriptor)
