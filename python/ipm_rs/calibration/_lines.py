"""Plain text calibration, ``KEY: numbers`` on each line, as the KITTI datasets have it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ipm_rs.calibration._checks import Section
from ipm_rs.calibration._files import Document, Source, open_document
from ipm_rs.errors import CalibrationError

__all__ = ["MAX_LINES", "Files", "key_lines", "nested_lines"]

MAX_LINES = 1000
"""Of a calibration file; those of KITTI have 8 to 40."""

_MAX_BYTES = 1 << 20


def key_lines(document: Document) -> Section:
    """Every line ``KEY: numbers`` (or ``KEY numbers``) of a file; empty lines are skipped.

    A value is a list; what is no number in it stays text, which `number` then refuses with its place. A line that
    begins with a number has the key "".
    """
    found: dict[str, Any] = {}
    for row, line in enumerate(_lines(document), 1):
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
    for row, line in enumerate(_lines(document), 1):
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
    """

    def __init__(self, source: Source, title: str) -> None:
        self.title = title
        self.mapping: Section | None = None
        self.document: Document | None = None
        if isinstance(source, Mapping):
            self.mapping = Section(source, f"{title} calibration")
        else:
            self.document = open_document(source, title, or_mapping=True)

    def section(self, name: str, parse: Callable[[Document], Section] = key_lines) -> Section:
        """Content of one file; in a mapping, a list or an array stands for a file that has numbers only."""
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
