"""Tables as files: our own (`native`, in a `container`), and those that other programs read (`foreign`, `storage`).

`Lut.save`, `Lut.load` and `Lut.export` are the face of it.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from ipm_rs._arguments import check_word
from ipm_rs._core import Lut
from ipm_rs.errors import ArgumentError, LutError
from ipm_rs.files.atomic import as_path, check_source, reading

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

__all__ = ["FORMATS", "export", "format_of", "load", "save"]

FORMATS: dict[str, tuple[str, ...]] = {
    "opencv": (".yml", ".yaml"),
    "lanenet": (".yml", ".yaml"),
    "cv16sc2": (".yml", ".yaml"),
    "npz": (".npz",),
    "torch_grid": (".npy",),
    "c_header": (".h", ".hpp"),
}
"""Formats of other programs and the endings of their files; of an ending without ``format=``, the first is meant."""


def save(lut: Lut, path: str | os.PathLike[str]) -> None:
    """Write a table as our own file; see `Lut.save`."""
    from ipm_rs.files.luts import native

    native.save(lut, as_path(path))


def load(path: str | os.PathLike[str], expect: Any = None, source_size: Any = None) -> Lut:
    """Read a table of any format that can be read back; see `Lut.load`."""
    from ipm_rs.files.luts import container

    name = as_path(path)
    check_source(name, "a table", "name the file that Lut.save or Lut.export wrote")
    with reading(name, "a table"), name.open("rb") as file:
        if file.peek(len(container.MAGIC)).startswith(container.MAGIC):
            from ipm_rs.files.luts import native

            return native.load(name, file, expect, source_size)
        data = file.read()
    reader = _foreign(data)
    if reader is None:
        what = "an empty file" if not data else "something else"
        raise LutError(
            f"{name}: expected a table (.ipmlut), maps of OpenCV's FileStorage or an .npz with map_x and map_y, got "
            f"{what}; write one with Lut.save or Lut.export"
        )
    if expect is not None:
        raise LutError(
            f"{name}: expected a table that says what calibration it is of, got plain maps, which do not; leave out "
            "expect=, or use a file of Lut.save"
        )
    return reader(name, data, source_size)


def export(lut: Lut, path: str | os.PathLike[str], format: Any = None) -> None:
    """Write a table for another program; see `Lut.export`."""
    from ipm_rs.files.luts import foreign

    name = as_path(path)
    check_word("format", format)
    foreign.WRITERS[format_of(name, format)](lut, name)


def format_of(path: Path, format: Any) -> str:
    """Return the format of an export: the one given, or the one that the file's ending says.

    Raises
    ------
    ArgumentError
        There is no such format, or its files have other endings.
    """
    ending = path.suffix.lower()
    if format is None:
        found = next((name for name, endings in FORMATS.items() if ending in endings), None)
        if found is None:
            endings = sorted({ending for endings in FORMATS.values() for ending in endings})
            raise ArgumentError(
                f"{path}: expected a name that ends in {', '.join(endings)}, got {ending or 'no ending'}; rename it, "
                "or use Lut.save for our own format"
            )
        return found
    if not isinstance(format, str) or format not in FORMATS:
        raise ArgumentError(f"format: expected {', '.join(map(repr, FORMATS))}, got {format!r:.80}; choose one")
    if ending not in FORMATS[format]:
        raise ArgumentError(
            f"{path}: expected a name that ends in {' or '.join(FORMATS[format])} for {format!r}, got "
            f"{ending or 'no ending'}; rename it"
        )
    return format


def _foreign(data: bytes) -> Callable[[Path, bytes, Any], Lut] | None:
    """Return what reads a file of another format, if it is one."""
    from ipm_rs.files.luts import foreign

    start = data[:64].lstrip(b"\xef\xbb\xbf \r\n\t")
    if data.startswith(b"PK"):
        return foreign.read_npz
    if start.startswith((b"%YAML", b"---", b"<?xml", b"<opencv_storage", b"{")):
        return foreign.read_storage
    return None
