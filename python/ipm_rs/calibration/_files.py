"""Calibration files, read once, of bounded size, with every failure as one of our errors."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from ipm_rs._arguments import path_text
from ipm_rs.calibration._checks import Section, describe
from ipm_rs.calibration._filestorage import parse_documents
from ipm_rs.calibration._jsontext import parse_json
from ipm_rs.calibration._kinds import is_zip, kind_of
from ipm_rs.calibration._npz import read_npz
from ipm_rs.errors import ArgumentTypeError, CalibrationError, FileError, MissingExtraError, MissingFileError

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

MAX_BYTES = 32 << 20
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

    @property
    def _article(self) -> str:
        return f"a{'n' if self.title[:1] in 'AEIOU' else ''} {self.title} " if self.title else "a "

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
        kind = kind_of(self.data)
        if kind is None and self.is_npz:
            kind = f"a zip archive; pass {self._article}calibration file out of it"
        if kind is not None:
            raise CalibrationError(f"{self.origin}: expected text in UTF-8, got {kind}")
        try:
            return self.data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise CalibrationError(
                f"{self.origin}: expected text in UTF-8, got byte 0x{self.data[error.start]:02x} at offset "
                f"{error.start}; pass {self._article}calibration file, saved as UTF-8"
            ) from error

    @property
    def json(self) -> Any:
        """Content as JSON; a key that is repeated in one object is refused."""
        content, error = self._json
        if error is not None:
            raise error
        return content

    @property
    def is_json(self) -> bool:
        """Whether the content is JSON."""
        return self._json[1] is None

    @property
    def is_npz(self) -> bool:
        """Whether the content is a zip archive, as ``numpy.savez`` writes."""
        return is_zip(self.data)

    @property
    def documents(self) -> list[Any]:
        """Content as plain data, from JSON, XML, YAML or an .npz: YAML has one or more documents, the others one."""
        documents, error = self._documents
        if error is not None:
            raise error
        return documents

    @property
    def tree(self) -> Any:
        """Content as plain data; YAML of several documents is refused."""
        documents = self.documents
        if len(documents) > 1:
            raise CalibrationError(
                f"{self.origin}: expected one document, got {len(documents)}, parted by '---'; keep the one that holds "
                "the camera"
            )
        return documents[0]

    @cached_property
    def keys(self) -> Mapping[str, Any]:
        """Named values at the top; empty where there are none, or nothing is named."""
        try:
            tree = self.documents[0]
        except (CalibrationError, MissingExtraError):
            return {}
        return tree if isinstance(tree, Mapping) else {}

    # Each is parsed once, also where that fails: a recogniser asks for every format.
    @cached_property
    def _json(self) -> tuple[Any, CalibrationError | None]:
        try:
            return parse_json(self.text, self.origin), None
        except CalibrationError as error:
            return None, error

    @cached_property
    def _documents(self) -> tuple[list[Any], CalibrationError | MissingExtraError | None]:
        try:
            if self.is_npz:
                return [read_npz(self.data, self.origin)], None
            start = self.text.lstrip()[:1]
            if start in ("{", "[") and self.is_json:
                return [self.json], None
            return parse_documents(self.text, self.origin), None
        except (CalibrationError, MissingExtraError) as error:
            return [], error


def open_document(source: Any, title: str, *, or_mapping: bool = False, argument: str = "source") -> Document:
    """Return the document of a path; the file itself is read when its content is asked for.

    Raises
    ------
    ArgumentTypeError
        `source` is no path.
    """
    if isinstance(source, Document):  # of Camera.load, which has looked at it already
        source.title = title
        return source
    if not isinstance(source, (str, os.PathLike)):
        wanted = "a path or a mapping" if or_mapping else "a path"
        mend = "pass the file's name" + (", or the mapping that json.load() returns" if or_mapping else "")
        raise ArgumentTypeError(f"{argument}: expected {wanted}, got {type(source).__name__}; {mend}")
    return Document(path_text(argument, source), title)


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
        same, swapped = tuple(given) == found, tuple(given) == found[::-1]
    except (TypeError, ValueError):  # no sequence, or one of arrays
        same = swapped = False
    if not same:
        order = "it is (width, height), not (height, width): swap them, or " if swapped else ""
        raise CalibrationError(
            f"{origin}: expected image_size ({found[0]}, {found[1]}), which the file states, got {describe(given)}; "
            f"{order}drop the argument, and follow with camera.resized() or camera.cropped() if your images are smaller"
        )


def needs_size(given: Any, origin: str, hint: str) -> Any:
    """Return the ``image_size=`` argument of a format whose files hold none; `hint` says which sizes are usual."""
    if given is None:
        raise CalibrationError(
            f"{origin}: expected image_size=(width, height), which this format does not state, got none; {hint}"
        )
    return given
