"""Tiles of pictures for web maps, and the page that shows them: files alone, from any file server, no internet."""

from __future__ import annotations

import contextlib
import json
import math
import re
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import FileError
from ipm_rs.files import images
from ipm_rs.files.atomic import atomically
from ipm_rs.mosaic._tiles import TileKey

__all__ = ["write_tiles"]

SIDE = 256
"""Pixels along a tile's side, as every web map has it."""

_DEEPEST = 40
"""The last level that a page may say: a cell of a micrometre, and all of Earth."""

_NUMBER = re.compile(r"0|[1-9][0-9]{0,12}")
_ABOUT = re.compile(r"^const about = (\{.*\});$", re.MULTILINE)

_UNFINISHED = """<!doctype html>
<meta charset="utf-8">
<title>Map of the road</title>
<p>This map is being written. If it stays like this, that was interrupted: export it again.</p>
<script>
const about = /*ABOUT*/;
</script>
"""

Read = Callable[[int, int, int, int], tuple[NDArray[Any], NDArray[np.bool_]]]
Bounds = tuple[tuple[int, int], tuple[int, int]]


def write_tiles(
    directory: Path, read: Read, bounds: Bounds, resolution: float, tiles: tuple[list[TileKey], int]
) -> int:
    """Write ``<z>/<x>/<y>.png`` and ``index.html``, remove the tiles of an older map there; returns how many tiles.

    The map's x points up the page and its y to the left, as in every view of this package. Column 0 and row 0 are those
    of the map's largest y and x. Level 0 is one tile; each further one doubles the resolution, the last is the map's
    own.

    `read` takes a first and an end of rows and of columns, counted from there, and returns picture and mask. `tiles`
    are the map's own, and their side in cells: where none is, nothing is read.
    """
    (first_x, end_x), (first_y, end_y) = bounds
    rows, columns = end_x - first_x, end_y - first_y
    levels = max(0, math.ceil(math.log2(max(rows, columns, SIDE) / SIDE)))
    images.require_pillow()  # if it is not there, nothing is begun
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{directory}: expected a directory for tiles, got: {error.strerror}; give another") from error
    page = directory / "index.html"
    # a page whose tiles are being replaced would show some of both maps; this one also says what is to be removed
    deepest = max(levels, _levels_of(page))
    with atomically(page) as file:
        file.write(_UNFINISHED.replace("/*ABOUT*/", json.dumps({"levels": deepest})).encode())
    written, side = set[tuple[int, int, int]](), tiles[1]
    # of each tile of the map its first row and column
    corners = [(end_x - (i + 1) * side, end_y - (j + 1) * side) for i, j in tiles[0]]

    def picture(z: int, column: int, row: int, near: list[tuple[int, int]]) -> NDArray[np.uint8] | None:
        """Return RGBA of a tile, written on the way, from the four below it; None where there is nothing."""
        size = SIDE << (levels - z)
        top, left = row * size, column * size
        near = [(down, across) for down, across in near if -side < down - top < size and -side < across - left < size]
        if not near:
            return None
        whole = np.zeros((SIDE, SIDE, 4), np.uint8)
        if z == levels:
            bottom, right = min(top + size, rows), min(left + size, columns)
            values, mask = read(top, bottom, left, right)
            if mask.any():
                whole[: bottom - top, : right - left, :3] = _rgb(values)
                whole[: bottom - top, : right - left, 3] = np.where(mask, 255, 0)
        else:
            half = SIDE // 2
            for down in (0, 1):
                for across in (0, 1):
                    part = picture(z + 1, 2 * column + across, 2 * row + down, near)
                    if part is not None:
                        whole[down * half : (down + 1) * half, across * half : (across + 1) * half] = _halved(part)
        if not whole[..., 3].any():
            return None
        place = directory / str(z) / str(column)
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"{place}: expected to make it, got: {error.strerror}; check the free space") from error
        images.write(place / f"{row}.png", whole, images.Look("RGBA"))
        written.add((z, column, row))
        return whole

    picture(0, 0, 0, corners)
    _remove_others(directory, deepest, written)
    about = {
        "levels": levels,
        "side": SIDE,
        "rows": rows,
        "columns": columns,
        "resolution": resolution,
        "x": end_x * resolution,
        "y": end_y * resolution,
    }
    text = resources.files("ipm_rs.mosaic").joinpath("page.html").read_text("utf-8")
    with atomically(page) as file:
        file.write(text.replace("/*ABOUT*/", json.dumps(about)).encode())
    return len(written)


def _levels_of(page: Path) -> int:
    """Return the last level of the export that a page is of; -1 where there is none, or another page."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        text = page.read_text("utf-8")
        found = _ABOUT.search(text) if "<title>Map of the road</title>" in text else None
        levels = json.loads(found[1]).get("levels") if found else None
        if isinstance(levels, int):
            return min(levels, _DEEPEST)
    return -1


def _remove_others(directory: Path, levels: int, written: set[tuple[int, int, int]]) -> None:
    """Remove the tiles of an older map up to a level that the new one does not have, and folders that get empty."""
    for z in range(levels + 1):
        for folder in _numbered(directory / str(z), z, ""):
            others = [
                file for file in _numbered(folder, z, ".png") if (z, int(folder.name), int(file.stem)) not in written
            ]
            for file in others:
                try:
                    file.unlink()
                except OSError as error:
                    raise FileError(
                        f"{file}: expected to remove it, a tile of an older map, got: {error.strerror}; remove it, or "
                        "give another directory"
                    ) from error
            if others:
                with contextlib.suppress(OSError):  # something else is in them
                    folder.rmdir()
                    folder.parent.rmdir()


def _numbered(folder: Path, z: int, ending: str) -> list[Path]:
    """Return what a folder has under the name of a tile's column or row on a level."""
    with contextlib.suppress(OSError):
        return [
            entry
            for entry in folder.iterdir()
            if _NUMBER.fullmatch(entry.name.removesuffix(ending)) is not None
            and entry.suffix == ending
            and int(entry.stem) < 1 << z
            and not entry.is_symlink()
            and entry.is_dir() == (not ending)
        ]
    return []


def _rgb(values: NDArray[Any]) -> NDArray[np.uint8]:
    if values.dtype == np.uint16:
        values = (values >> 8).astype(np.uint8)
    if values.ndim == 2 or values.shape[2] < 3:
        values = np.repeat((values if values.ndim == 2 else values[..., 0])[..., None], 3, 2)
    return np.asarray(values[..., :3], np.uint8)


def _halved(tile: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a tile at half the resolution: the mean of what is there of each four pixels."""
    four = tile.reshape(SIDE // 2, 2, SIDE // 2, 2, 4).astype(np.uint32)
    seen = four[..., 3:] > 0
    count = seen.sum((1, 3))
    mean = (four[..., :3] * seen).sum((1, 3)) / np.maximum(count, 1)
    return np.concatenate([np.rint(mean), np.where(count > 0, 255, 0)], 2).astype(np.uint8)
