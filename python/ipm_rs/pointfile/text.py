"""Numbers as text, of ascii PLY and PCD: each must be one that its type holds."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import FileError

_LINES = 1 << 14
"""Lines that are parsed at a time: words take thirty times the room of the numbers that they become."""


def read_rows(
    path: Path, file: BinaryIO, count: int, kinds: Sequence[tuple[str, str]], names: dict[str, str]
) -> list[NDArray[Any]]:
    """Read a line of numbers for each of ``count`` points.

    Parameters
    ----------
    kinds : sequence of (str, str)
        Name and dtype ("u1", "f4", ...) of each number of a line.
    names : dict
        What the format calls the dtypes, for messages.
    """
    # no more than the file can hold: a number and what parts it from the next
    room = path.stat().st_size - file.tell() + 1
    if count * 2 * max(len(kinds), 1) > room:
        raise FileError(
            f"{path}: expected {count} lines of {len(kinds)} numbers as its header says, got {room - 1} bytes; it is "
            "cut short or damaged"
        )
    columns = [np.empty(count, kind) for _, kind in kinds]
    for start in range(0, count, _LINES):
        end = min(start + _LINES, count)
        rows = [line.split() for line in islice(file, end - start)]
        if len(rows) < end - start:
            raise FileError(
                f"{path}: expected {count} points as its header says, got {start + len(rows)}; it is cut short"
            )
        for index, row in enumerate(rows, start):
            if len(row) != len(kinds):
                raise FileError(
                    f"{path}: expected {len(kinds)} numbers for each point, got {len(row)} for point {index}"
                )
        for (name, kind), column, words in zip(kinds, columns, zip(*rows, strict=True), strict=True):
            column[start:end] = _numbers(path, name, kind, words, names.get(kind, kind))
    return columns


def _numbers(path: Path, name: str, kind: str, words: Sequence[bytes], type_name: str) -> NDArray[Any]:
    if kind[0] == "f":
        values = [_parsed(path, name, float, word, "a number") for word in words]
        numbers = np.array(values, np.float64)
        with np.errstate(over="ignore"):
            narrow = numbers.astype(kind)
        lost = np.isinf(narrow) & np.isfinite(numbers)
        if lost.any():
            raise _misfit(path, name, type_name, words[int(np.argmax(lost))])
        return narrow
    wholes = [_parsed(path, name, int, word, f"a whole number ({type_name})") for word in words]
    limits = np.iinfo(kind)
    for whole, word in zip(wholes, words, strict=True):
        if not limits.min <= whole <= limits.max:
            raise _misfit(path, name, f"{type_name}, {limits.min} to {limits.max}", word)
    return np.array(wholes, kind)


def _parsed(path: Path, name: str, parse: Any, word: bytes, wanted: str) -> Any:
    try:
        if b"_" in word:  # Python's own, in no other language a number
            raise ValueError
        return parse(word)
    except ValueError:
        got = word[:40].decode("latin-1")
        raise FileError(f"{path}: {name}: expected {wanted}, got {got!r}; it may be damaged") from None


def _misfit(path: Path, name: str, type_name: str, word: bytes) -> FileError:
    got = word[:40].decode("latin-1")
    return FileError(f"{path}: {name}: expected what its type holds ({type_name}), got {got}; it may be damaged")
