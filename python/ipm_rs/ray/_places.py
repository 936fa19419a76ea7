"""Where files are: on this machine, or in a store that pyarrow or fsspec knows (S3, GCS, Azure, HDFS, ...)."""

from __future__ import annotations

import contextlib
import os
import posixpath
from collections.abc import Sequence
from fnmatch import fnmatch
from glob import has_magic
from pathlib import Path
from typing import Any

from ipm_rs._arguments import path_text
from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError, IpmError, MissingExtraError, MissingFileError
from ipm_rs.files.atomic import atomically, check_source
from ipm_rs.streams import folder

__all__ = ["Place", "listed", "place_of"]

_WHOLE = ("s3", "gcs", "gs", "abfs", "az", "oss")
"""Stores in which an object is there when all of it has come, and a change of its name is a copy."""


class Place:
    """A folder or a file of a filesystem; picklable, so that workers open it themselves."""

    def __init__(self, filesystem: Any, path: str) -> None:
        self.filesystem, self.path = filesystem, path

    @property
    def is_local(self) -> bool:
        """Say whether it is this machine's own filesystem, as every machine of a cluster must have it mounted."""
        return bool(self.filesystem.type_name == "local")

    def at(self, path: str) -> Place:
        """Return another path of the same filesystem."""
        return Place(self.filesystem, path)

    def __truediv__(self, name: str) -> Place:
        return Place(self.filesystem, posixpath.join(self.path, name))

    def read(self) -> bytes:
        """Return a file's content.

        Raises
        ------
        MissingFileError, FileError
        """
        if self.is_local:
            check_source(Path(self.path), "a file")  # opening a pipe would wait for ever
        try:
            with self.filesystem.open_input_stream(self.path) as file:
                data: bytes = file.read()
                return data
        except FileNotFoundError as error:
            raise MissingFileError(f"{self.path}: expected a file, found none; check the path") from error
        except (OSError, ValueError) as error:  # ValueError: pyarrow's ArrowInvalid
            raise FileError(f"{self.path}: expected a readable file, got: {_reason(error)}; check it") from error

    def write(self, data: bytes) -> None:
        """Write a file, whole or not at all; one that is there is replaced.

        Raises
        ------
        FileError
        """
        if self.is_local:
            try:
                Path(self.path).parent.mkdir(parents=True, exist_ok=True)
            except (OSError, ValueError) as error:
                raise FileError(
                    f"{self.path}: expected to write it, got: {_reason(error)}; check the folder"
                ) from error
            with atomically(self.path) as file:
                file.write(data)
            return
        kinds = self.filesystem.type_name.lower().replace("'", "+").split("+")
        temporary = self if any(kind in _WHOLE for kind in kinds) else self.at(_hidden(self.path))
        try:
            self.filesystem.create_dir(posixpath.dirname(self.path), recursive=True)
            with self.filesystem.open_output_stream(temporary.path) as file:
                file.write(data)
            if temporary is not self:
                self.filesystem.move(temporary.path, self.path)
        except (OSError, ValueError) as error:
            if temporary is not self:
                with contextlib.suppress(OSError, ValueError):
                    self.filesystem.delete_file(temporary.path)
            raise FileError(
                f"{self.path}: expected to write it, got: {_reason(error)}; check the store, its permissions and space"
            ) from error

    def remove(self) -> None:
        """Remove a file.

        Raises
        ------
        FileError
        """
        try:
            self.filesystem.delete_file(self.path)
        except (OSError, ValueError) as error:
            raise FileError(f"{self.path}: expected to remove it, got: {_reason(error)}; check it") from error

    def files(self, recursive: bool = False) -> list[str]:
        """Return the paths of the files in a folder; none where there is no folder.

        Raises
        ------
        FileError
            The folder cannot be listed.
        """
        import pyarrow.fs

        selector = pyarrow.fs.FileSelector(self.path, allow_not_found=True, recursive=recursive)
        try:
            found = self.filesystem.get_file_info(selector)
        except (OSError, ValueError) as error:
            raise FileError(f"{self.path}: expected a folder, got: {_reason(error)}; check it") from error
        return [entry.path for entry in found if entry.type == pyarrow.fs.FileType.File]

    def is_folder(self) -> bool:
        """Say whether it is a folder.

        Raises
        ------
        FileError
            The store does not answer.
        """
        import pyarrow.fs

        try:
            return bool(self.filesystem.get_file_info(self.path).type == pyarrow.fs.FileType.Directory)
        except (OSError, ValueError) as error:
            raise FileError(f"{self.path}: expected a folder or files, got: {_reason(error)}; check it") from error


def place_of(name: str, path: Any, filesystem: Any = None) -> Place:
    """Return the place that a path or a URI names; `name` is the argument's.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        It is no path, no filesystem, or of a kind of URI that neither pyarrow nor fsspec knows.
    MissingExtraError
        pyarrow, or what fsspec needs for this kind, is not installed.
    """
    text = path_text(name, path)
    fs = _pyarrow_fs()
    if filesystem is not None:
        if not isinstance(filesystem, fs.FileSystem):
            if not all(hasattr(filesystem, method) for method in ("protocol", "ls", "open")):
                raise ArgumentTypeError(
                    f"filesystem: expected one of pyarrow.fs or of fsspec, got {type(filesystem).__name__}; leave it "
                    "out for paths and URIs"
                )
            filesystem = fs.PyFileSystem(fs.FSSpecHandler(filesystem))
        return Place(filesystem, text.partition("://")[2] or text)
    if "://" not in text:
        return Place(fs.LocalFileSystem(), Path(text).absolute().as_posix())
    try:
        found, inner = fs.FileSystem.from_uri(text)
        return Place(found, inner)
    except (OSError, ValueError) as error:
        if "Unrecognized filesystem type" not in str(error):
            raise ArgumentError(f"{name}: expected a URI that pyarrow opens, got {text!r:.200}: {error}") from error
    try:
        import fsspec

        other, inner = fsspec.core.url_to_fs(text)
    except ImportError as error:
        raise MissingExtraError(f"{name}: expected what opens {text!r:.200}, found none: {error}") from error
    except Exception as error:  # a store's own
        raise ArgumentError(
            f"{name}: expected a path or a URI that pyarrow or fsspec opens, got {text!r:.200}: {_reason(error)}"
        ) from error
    return Place(fs.PyFileSystem(fs.FSSpecHandler(other)), inner)


def listed(source: Any, filesystem: Any, recursive: bool) -> list[Place]:
    """Return the images of a folder, of a pattern, of a list in a file, or of a sequence of paths.

    Raises
    ------
    MissingFileError, FileError
        There are none.
    ArgumentError, ArgumentTypeError
        See `place_of`.
    """
    if isinstance(source, (str, os.PathLike)):
        text = path_text("source", source)
        is_local = filesystem is None and "://" not in text
        if is_local and not recursive:
            root = place_of("source", ".")
            return [root.at(path.absolute().as_posix()) for path in folder.paths_of(text)]
        head, _, last = text.rpartition("/")
        pattern = last if has_magic(last) and not is_local else None
        root = place_of("source", head if pattern else source, filesystem)
        if pattern is None and not root.is_folder():
            return [root]
        found = [path for path in root.files(recursive) if _is_image(path, pattern)]
        if not found:
            raise FileError(f"{text}: expected a folder with images, found none in it; check it")
        return [root.at(path) for path in sorted(found, key=folder.order)]
    if isinstance(source, Sequence) and not isinstance(source, (bytes, bytearray)):
        if not source:
            raise ArgumentError("source: expected paths of images, got an empty list; give at least one")
        first = place_of("source", source[0], filesystem)
        places = [place_of("source", path, filesystem or _known(source[0], first, path)) for path in source]
        if any(place.filesystem != first.filesystem for place in places):
            raise ArgumentError("source: expected paths of one filesystem, got several; warp each by itself")
        return places
    raise ArgumentTypeError(f"source: expected a path, a URI or a list of them, got {type(source).__name__}")


def _known(sample: Any, place: Place, path: Any) -> Any:
    """Return the filesystem of the first URI for another of the same bucket: asking anew for each takes long."""
    one, other = path_text("source", sample), path_text("source", path)
    is_plain = "://" in other and not {"%", "?", "#"} & {*one, *other}
    return place.filesystem if is_plain and one.split("/")[:3] == other.split("/")[:3] else None


def _is_image(path: str, pattern: str | None) -> bool:
    name = posixpath.basename(path)
    if name.startswith("."):
        return False
    return fnmatch(name, pattern) if pattern else posixpath.splitext(name)[1].lower() in folder.ENDINGS


def _hidden(path: str) -> str:
    head, last = posixpath.split(path)
    return posixpath.join(head, f".ipm-rs-{os.urandom(8).hex()}-{last}.tmp")


def _reason(error: BaseException) -> str:
    if isinstance(error, IpmError):
        return str(error)
    return " ".join(str(getattr(error, "strerror", None) or error).split())[:200] or type(error).__name__


def _pyarrow_fs() -> Any:
    try:
        import pyarrow.fs
    except ImportError as error:
        raise MissingExtraError(
            'expected pyarrow, which opens files near and far, found none; install it with: pip install "ipm-rs[ray]"'
        ) from error
    return pyarrow.fs
