"""Plain text calibration, ``KEY: numbers`` on each line, as the KITTI datasets have it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ipm_rs.calibration._checks import Section
from ipm_rs.calibration._files import Document, Source, open_document
from ipm_rs.errors import CalibrationError

__all__ = ["MAX_LINES", "Files", "first_words", "key_lines", "lines_missing", "nested_lines"]

MAX_LINES = 1000
"""Of a calibration file; those of KITTI have 8 to 40."""

_MAX_BYTES = 1 << 20

_SCIENTIFIC = re.compile(r"[0-9]\.[0-9]+e[+-][0-9]+")


def lines_missing(document: Document, *keys: str) -> str | None:
    """Say which lines ``KEY:`` a file lacks, None if it has them all: most of a recogniser.

    What stands in the lines is for the reader, and so is a line that is there twice.
    """
    if document.data.count(b"\n") > MAX_LINES or len(document.data) > _MAX_BYTES:
        return "too long a file"
    there = first_words(document)
    lacks = [f"{key}:" for key in keys if key not in there]
    return f"no line {', '.join(lacks)}" if lacks else None


def first_words(document: Document) -> set[str]:
    """Words that lines begin with, of the first that a calibration may have."""
    lines = document.text[:_MAX_BYTES].splitlines()[:MAX_LINES]
    return {first for first, *_ in filter(None, (line.replace(":", " ", 1).split(maxsplit=1) for line in lines))}


def key_lines(document: Document) -> Section:
    """Every line ``KEY: numbers`` (or ``KEY numbers``) of a file; empty lines are skipped.

    A value is a list; what is no number in it stays text, which `number` then refuses with its place. A line that
    begins with a number has the key "".
    """
    found: dict[str, Any] = {}
    lines = _lines(document)
    _check_end(document, lines, lines[-1].split() if lines else [])
    for row, line in enumerate(lines, 1):
        key, *values = line.replace(":", ": ", 1).split() or ("", "")
        if not line.strip():
            continue
        if isinstance(_token(key), float):
            key, values = "", [key, *values]
        key = key.removesuffix(":")
        if key in found:
            named = f"the key {key!r}" if key else "one line of numbers without a key"
            raise CalibrationError(f"{document.origin}: expected {named} once, got it again in line {row}; keep one")
        found[key] = [_token(value) for value in values]
    return Section(found, document.origin)


def nested_lines(document: Document) -> Section:
    """Lines ``key: value``, and below a bare ``key:`` indented ones: the little of YAML that KITTI-360's files use.

    ``%`` and ``#`` lines and ``---`` are skipped; a value is a number, or else text.
    """
    found: dict[str, Any] = {}
    inner: dict[str, Any] = {}
    lines = _lines(document)
    _check_end(document, lines, [line.partition(":")[2].strip() for line in lines])
    for row, line in enumerate(lines, 1):
        bare = line.split("#", 1)[0].strip()
        if not bare or bare.startswith(("%", "---")):
            continue
        key, colon, value = (part.strip() for part in bare.partition(":"))
        if not colon or not key:
            raise CalibrationError(
                f"{document.origin}: line {row}: expected 'key: value', got {bare[:60]!r}; check that the file is whole"
            )
        into = inner if line[:1].isspace() else found
        if key in into:
            raise CalibrationError(f"{document.origin}: expected {key!r} once, got it again in line {row}; keep one")
        if not line[:1].isspace():
            inner = {}
        into[key] = _token(value.strip("\"'")) if value else inner
    return Section(found, document.origin)


def _lines(document: Document) -> list[str]:
    if len(document.data) > _MAX_BYTES:
        raise CalibrationError(
            f"{document.origin}: expected at most {_MAX_BYTES >> 20} MB of text, got more; pass the calibration alone"
        )
    lines = document.text.splitlines()
    if len(lines) > MAX_LINES:
        raise CalibrationError(
            f"{document.origin}: expected at most {MAX_LINES} lines, got {len(lines)}; pass the calibration alone"
        )
    return lines


def _check_end(document: Document, lines: list[str], words: list[str]) -> None:
    """Refuse a file that ends within a number: 2.7 of 2.718000000000e-01, which would be read as it stands.

    It shows only where the two before have an exponent and as many digits as each other, as the datasets print them.
    """
    if len(words) < 3 or document.text.endswith(("\n", "\r")):
        return
    first, second, last = (word.lstrip("-") for word in words[-3:])
    alike = _SCIENTIFIC.fullmatch(first) and _SCIENTIFIC.fullmatch(second) and len(first) == len(second)
    if alike and len(last) < len(second):
        raise CalibrationError(
            f"{document.origin}: line {len(lines)}: expected complete numbers, got {words[-1]!r:.40}, the beginning of "
            "one; the file may be cut short, fetch it again"
        )


def _token(text: str) -> float | str:
    try:
        return text if "_" in text else float(text)  # Python reads 1_000 as a number
    except ValueError:
        return text


class Files:
    """The files of a calibration that come together in one directory, each read when it is asked for.

    Parameters
    ----------
    source : path or mapping
        The directory; or one file, the others are beside it; or a mapping of file names, without their extension, to
        their content.
    title : str
        The format, for messages.
    nearest : bool
        As of `Section`, for all of them.
    """

    def __init__(self, source: Source | Document, title: str, *, nearest: bool = False) -> None:
        self.title, self.nearest = title, nearest
        self.mapping: Section | None = None
        self.document: Document | None = None
        if isinstance(source, Mapping):
            self.mapping = Section(source, f"{title} calibration")
        else:
            self.document = open_document(source, title, or_mapping=True)

    def section(self, name: str, parse: Callable[[Document], Section] = key_lines) -> Section:
        """Content of one file; in a mapping, a list or an array stands for a file that has numbers only."""
        found = self._section(name, parse)
        found.nearest = self.nearest
        return found

    def _section(self, name: str, parse: Callable[[Document], Section]) -> Section:
        stem = name.partition(".")[0]
        if self.mapping is not None:
            value = self.mapping.value(stem)
            return (
                self.mapping.section(stem)
                if isinstance(value, Mapping)
                else Section({"": value}, self.mapping.where(stem))
            )
        assert self.document is not None
        path = self.document.path
        if self.document.is_directory:
            return parse(Document(str(path / name), self.title))
        # the file itself, or nothing, which reading it will say
        if path.name == name or not _is_file(path):
            return parse(self.document)
        return parse(Document(str(path.with_name(name)), self.title))


def _is_file(path: Path) -> bool:
    """Whether there is such a file; where its name is too long to ask, there is none."""
    try:
        return path.is_file()
    except OSError:
        return False
