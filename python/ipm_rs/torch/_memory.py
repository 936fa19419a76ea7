"""Memory of a layer's last results, used again once nobody holds the result."""

from __future__ import annotations

import sys
import threading

import numpy as np
from numpy.typing import NDArray

__all__ = ["ResultMemory"]

#: Less than that the allocator keeps at hand by itself.
_LEAST_BYTES = 1 << 20


class ResultMemory:
    """The memory of the last large result of each kind.

    The system clears each page before a process has it: of 64 x 860 x 800 float32 that takes 17 of 63 ms with large
    pages (NumPy asks for them), and 100 of 187 with those of 4 KiB that `torch.empty` has.
    """

    def __init__(self) -> None:
        self._last: dict[str, NDArray[np.uint8]] = {}
        self._lock = threading.Lock()

    def room(self, kind: str, nbytes: int) -> NDArray[np.uint8]:
        """Return so many bytes that nobody else holds, of any content.

        What is made of them, tensors and views, must hold the array that is returned: by that it is known to be in use.
        """
        # where another thread is at it, or was when the process forked, there is fresh memory too
        if nbytes < _LEAST_BYTES or not self._lock.acquire(blocking=False):
            return np.empty(nbytes, np.uint8)
        try:
            if not self._is_free(kind) or self._last[kind].nbytes != nbytes:
                self._last.pop(kind, None)  # before there is more
                self._last[kind] = np.empty(nbytes, np.uint8)
            return self._last[kind]
        finally:
            self._lock.release()

    def _is_free(self, kind: str) -> bool:
        return kind in self._last and sys.getrefcount(self._last[kind]) <= _COUNT_OF_FREE


def _count_of_free() -> int:
    """Return how many references there are to an array that only the dictionary holds: versions of Python differ."""
    memory = ResultMemory()
    memory._last["any"] = np.empty(1, np.uint8)
    return sys.getrefcount(memory._last["any"])


_COUNT_OF_FREE = _count_of_free()
