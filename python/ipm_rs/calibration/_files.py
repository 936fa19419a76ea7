"""Calibration files, read once, of bounded size, with every failure as one of our errors."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from ipm_rs.calibration._checks import Section, describe
from ipm_rs.errors import ArgumentTypeError, CalibrationError, FileError, MissingFileError

__all__ = [
    "MAX_BYTES",
    "Document",
    "Source",
    "keys_missing",
    "needs_size",
    "open_document",
    "parse_json",
    "read_json",
    "same_size",
]

Source = str | os.PathLike[str] | Mapping[str, Any]
"""What most readers take: a path, or the content of the file."""

MAX_BYTES = 64 << 20
"""The largest file that is read: calibration tables of whole datasets have 10 MB."""


class Document:
    """One file (or directory) of calibration; its content is read and parsed when first asked for, and kept.

    Parameters
    ----------
    path : str
        Where it is.
    title : str
        The format that is expected, for messages: ``"Cityscapes"``.
    """

    def __init__(self, path: str, title: str = "") -> None:
        self.origin = path
        self.title = title
        self.path = Path(path)
        self._article = f"a{'n' if title[:1] in 'AEIOU' and title else ''} {title} " if title else "a "

    @property
    def is_directory(self) -> bool:
        """Whether it is a directory, for datasets that have several files."""
        try:
            return bool(self.origin) and self.path.is_dir()
        except (OSError, ValueError):
            return False

    @cached_property
    def data(self) -> bytes:
        """Content of the file."""
        wanted = f"{self._article}calibration file"
        try:
            if self.origin and self.path.exists() and not self.path.is_dir() and not self.path.is_file():
                raise OSError("a device or a pipe")
            with self.path.open("rb") as file:
                data = file.read(MAX_BYTES + 1)
        except FileNotFoundError as error:
            raise MissingFileError(
                f"{self.origin}: expected {wanted}, found none; check the path (current directory: {Path.cwd()})"
            ) from error
        except (OSError, ValueError) as error:  # ValueError: a null byte in the name
            reason = getattr(error, "strerror", None) or error
            raise FileError(
                f"{self.origin!r}: expected a readable calibration file, got: {reason}; check the path and permissions"
            ) from error
        if len(data) > MAX_BYTES:
            raise CalibrationError(
                f"{self.origin}: expected {wanted} of at most {MAX_BYTES >> 20} MB, got more; pass the calibration, "
                "not the recording"
            )
        return data

    @cached_property
    def text(self) -> str:
        """Content as UTF-8 text; a byte order mark is no content."""
        try:
            return self.data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise CalibrationError(
                f"{self.origin}: expected text in UTF-8, got byte 0x{self.data[error.start]:02x} at offset "
                f"{error.start}; pass {self._article}calibration file, saved as UTF-8"
            ) from error

    @cached_property
    def json(self) -> Any:
        """Content as JSON; a key that is repeated in one object is refused."""
        return parse_json(self.text, self.origin)

    @property
    def is_json(self) -> bool:
        """Whether the content is JSON."""
        try:
            _ = self.json
        except CalibrationError:
            return False
        return True


def parse_json(text: str, origin: str) -> Any:
    """Content of JSON text; a key that is repeated in one object is refused."""
    try:
        return json.loads(text, object_pairs_hook=_object)
    except CalibrationError as error:
        raise CalibrationError(f"{origin}: {error}") from None
    except (ValueError, RecursionError) as error:
        size = len(text.encode(errors="replace"))
        raise CalibrationError(
            f"{origin}: expected JSON, got {size} byte{'' if size == 1 else 's'} that are not: {str(error)[:200]}; "
            "the file may be cut short, fetch it again"
        ) from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """One JSON object; a repeated key is refused, where ``json`` would keep the last silently."""
    content = dict(pairs)
    if len(content) != len(pairs):
        counts = Counter(key for key, _ in pairs)
        repeated = sorted(key for key, count in counts.items() if count > 1)
        raise CalibrationError(f"expected every key once, got {', '.join(map(repr, repeated))} repeated; keep one")
    return content


def open_document(source: Any, title: str, *, or_mapping: bool = False, argument: str = "source") -> Document:
    """Return the document of a path; the file itself is read when its content is asked for.

    Raises
    ------
    ArgumentTypeError
        `source` is no path.
    """
    if not isinstance(source, (str, os.PathLike)):
        wanted = "a path or a mapping" if or_mapping else "a path"
        mend = "pass the file's name" + (", or the mapping that json.load() returns" if or_mapping else "")
        raise ArgumentTypeError(f"{argument}: expected {wanted}, got {type(source).__name__}; {mend}")
    path = os.fspath(source)
    if not isinstance(path, str):
        raise ArgumentTypeError(f"{argument}: expected a text path, got {path!r}; decode it with os.fsdecode()")
    return Document(path, title)


def read_json(source: Any, title: str) -> Section:
    """Content of a JSON file that must hold one object, or of a mapping given in its place."""
    if isinstance(source, Mapping):
        return Section(source, f"{title} calibration")
    document = open_document(source, title, or_mapping=True)
    if not isinstance(document.json, Mapping):
        raise CalibrationError(
            f"{document.origin}: expected a JSON object, got {describe(document.json)}; pass {document._article}"
            "calibration file"
        )
    return Section(document.json, document.origin)


def keys_missing(document: Document, *keys: str) -> str | None:
    """Say which keys a JSON document lacks, None if it has them all: most of a recogniser.

    ``"extrinsic.pitch"`` is the key ``pitch`` in the object of the key ``extrinsic``.
    """
    if not document.is_json:
        return "not JSON"
    if not isinstance(document.json, Mapping):
        return "no JSON object"
    lacks = [repr(key) for key in keys if not _has(document.json, key.split("."))]
    return f"no key {', '.join(lacks)}" if lacks else None


def _has(content: Any, keys: list[str]) -> bool:
    if not keys:
        return True
    return isinstance(content, Mapping) and keys[0] in content and _has(content[keys[0]], keys[1:])


def same_size(given: Any, found: tuple[int, int], origin: str) -> None:
    """Check an ``image_size=`` argument, if there is one, against the size that the file itself states."""
    if given is None:
        return
    try:
        same = tuple(given) == found
    except TypeError:
        same = False
    if not same:
        raise CalibrationError(
            f"{origin}: expected image_size ({found[0]}, {found[1]}), which the file states, got {describe(given)}; "
            "drop the argument, and follow with camera.resized() or camera.cropped() if your images are smaller"
        )


def needs_size(given: Any, origin: str, hint: str) -> Any:
    """Return the ``image_size=`` argument of a format whose files hold none; `hint` says which sizes are usual."""
    if given is None:
        raise CalibrationError(
            f"{origin}: expected image_size=(width, height), which this format does not state, got none; {hint}"
        )
    return given
