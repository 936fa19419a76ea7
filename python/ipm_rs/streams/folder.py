"""Images in a folder, of a pattern, or in a list: decoded by Pillow (extra ``cli``), each on the thread that wants it.

Frames come in the order of their names, numbers in them by value (``2.png`` before ``10.png``); those of a list in its
own order. Paths of a list are relative to the folder that it is in; empty lines and lines that begin with ``#`` are
passed over. Hidden files are no frames.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from glob import glob, has_magic
from pathlib import Path

from ipm_rs.errors import FileError, MissingFileError
from ipm_rs.files import images
from ipm_rs.files.atomic import check_source, reading
from ipm_rs.streams._frame import Frame, Stream, Ticket

__all__ = ["TITLE", "paths_of", "read", "recognises"]

TITLE = "a folder, a pattern or a .txt list of images"
ENDINGS = {*images.FORMATS, ".webp", ".ppm", ".pgm", ".pnm", ".jp2"}


def recognises(path: str) -> bool:
    """Say whether a path is a folder, a pattern, a list or one image."""
    place = Path(path)
    return place.is_dir() or place.suffix.lower() in {".txt", *ENDINGS} or (has_magic(path) and not place.exists())


def is_several(path: str) -> bool:
    """Say whether a path is a folder, a pattern or a list, and not one image."""
    place = Path(path)
    is_pattern = has_magic(path) and not place.exists()
    return is_pattern or place.is_dir() or place.suffix.lower() == ".txt"


def read(path: str) -> Stream:
    """Open the images.

    Raises
    ------
    MissingFileError, FileError
        There are none.
    """
    paths = paths_of(path)
    return Stream(path, functools.partial(_tickets, paths), count=len(paths))


def paths_of(path: str) -> list[Path]:
    """Return the images of a folder, a pattern or a list, in order; raises as `read` does."""
    place = Path(path)
    if place.is_dir():
        found = [entry for entry in place.iterdir() if entry.suffix.lower() in ENDINGS and entry.name[0] != "."]
        if not found:
            raise FileError(
                f"{path}: expected a directory with images ({', '.join(sorted(ENDINGS))}), found none in it"
            )
        return sorted(found, key=order)
    if place.suffix.lower() in ENDINGS and place.exists():
        return [place]
    if has_magic(path) and not place.exists():
        # Path.glob, which the linter asks for, takes no absolute pattern and finds hidden files
        found = [Path(name) for name in glob(path, recursive=True)]  # noqa: PTH207
        if not found:
            raise MissingFileError(f"{path}: expected images that fit the pattern, found none; check it")
        return sorted(found, key=order)
    check_source(place, "a folder, a pattern or a list of images")
    with reading(place, "a list of images, a path in each line"):
        lines = [line.strip() for line in place.read_text(encoding="utf-8").splitlines()]
    found = [place.parent / line for line in lines if line and not line.startswith("#")]
    if not found:
        raise FileError(f"{path}: expected a path in each line, got an empty list")
    return found


def order(path: Path | str) -> list[tuple[int, str]]:
    """Return what numbers in names are sorted by their value with."""
    words = re.split(r"(\d+)", str(path))
    return [(int(word), word) if word.isdecimal() else (-1, word) for word in words]


def _tickets(paths: list[Path]) -> Iterator[Ticket]:
    for index, path in enumerate(paths):
        yield Ticket(path.stem, index, None, functools.partial(_load, path, index), path)


def _load(path: Path, index: int) -> Frame:
    pixels, _ = images.read(path)
    return Frame(pixels, path.stem, index)
