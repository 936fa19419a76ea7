"""A mosaic on disk: a directory that is, at every moment, the map of a certain set of frames.

    mosaic.json          what the map is, how many frames it holds, and which file each tile is in
    frames.txt           the names of the frames, one JSON string a line, as far as mosaic.json says
    tiles/3_-1.17.npz    tile (3, -1), as it was written the 17th time: the rows and columns that hold something
    lock                 locked by the process that has the map open

No file is changed: a tile is written anew under its next number, and `mosaic.json` is replaced once all that it names
is on the disk. Whoever is killed in between leaves files that nobody names, which the next one removes.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ipm_rs.errors import FileError, MosaicError
from ipm_rs.files.atomic import as_path, atomically, check_source, reading
from ipm_rs.mosaic._lock import DirectoryLock
from ipm_rs.mosaic._tiles import Kind, Tile, TileKey

__all__ = ["Store", "cells_of", "check_same"]

_FORMAT, _VERSION = "ipm_rs.Mosaic", 1
_HEADER, _NAMES, _TILES, _LOCK = "mosaic.json", "frames.txt", "tiles", "lock"
_TILE_FILE = re.compile(r"(-?\d+)_(-?\d+)\.(\d+)\.npz")


class Store:
    """The directory of one mosaic, open to this process alone until `close`.

    Attributes
    ----------
    resolution, side : float, int or None
        What the map is made of; None of a directory without a map.
    kind : Kind or None
        Of its tiles, once there are some.
    samples, labels : int, bool
        What its tiles keep, as of `Mosaic`.
    frames : int
        How many it holds.
    names : list of str
        Of those that had one.
    """

    def __init__(self, path: Any) -> None:
        self.path = as_path(path)
        self.resolution: float | None = None
        self.side: int | None = None
        self.kind: Kind | None = None
        self.samples, self.labels = 0, False
        self.frames, self.names = 0, list[str]()
        self._numbers: dict[TileKey, tuple[int, int]] = {}  # of each tile the number of its file, and its frames
        self._written: dict[TileKey, tuple[int, int]] = {}  # the same of tiles that mosaic.json does not name yet
        self._size = 0  # bytes of frames.txt that count
        self._make()
        self._lock = DirectoryLock(self.path / _LOCK)
        try:
            if (self.path / _HEADER).exists():
                self._read()
            self._remove_unnamed()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let others open it; what was not committed is lost."""
        self._lock.release()

    @property
    def ours(self) -> bool:
        """Whether this process opened it; one that was forked from that may read, and nothing else."""
        return self._lock.ours

    def check_ours(self) -> None:
        """Refuse changes by a forked process, of which the one that opened it would not know."""
        if not self.ours:
            raise MosaicError(
                f"{self.path}: expected changes by the process that opened the mosaic, got some by one that was forked "
                "from it; make them there, or build a map of its own here and merge that"
            )

    @property
    def keys(self) -> set[TileKey]:
        """Which tiles there are."""
        return {*self._numbers, *self._written}

    def frames_of(self, key: TileKey) -> int:
        """Return how many frames a tile holds."""
        return (self._written.get(key) or self._numbers[key])[1]

    def read(self, key: TileKey, kind: Kind) -> Tile:
        """Read a tile.

        Raises
        ------
        FileError
            It is damaged, or not there.
        """
        number, frames = self._written.get(key) or self._numbers[key]
        path = self._file(key, number)
        check_source(path, "a tile of the mosaic")
        tile = kind.empty()
        # opened here: of a damaged file np.load leaves its own open
        with (
            reading(path, "a tile of a mosaic"),
            path.open("rb") as opened,
            np.load(opened, allow_pickle=False) as file,
        ):
            top, left = (int(edge) for edge in file["at"])
            layers: Any = tile.arrays._asdict()
            if "refined" in file.files:
                tile.refined = layers["refined"] = np.zeros_like(tile.arrays.bests)
            for name, layer in layers.items():
                part: Any = file[name]
                rows, columns = part.shape[:2]
                window = layer[top : top + rows, left : left + columns]
                if min(top, left) < 0 or part.dtype != layer.dtype or part.shape != window.shape:
                    raise FileError(f"{path}: expected a tile of {kind.side} cells, got another; restore the file")
                window[...] = part
        tile.frames = frames
        return tile

    def write(self, key: TileKey, tile: Tile) -> None:
        """Write a tile under its next number; it counts from the next `commit` on."""
        self.check_ours()
        number = max(self._numbers.get(key, (0, 0))[0], self._written.get(key, (0, 0))[0]) + 1
        seen = tile.arrays.counts > 0
        rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
        box = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)) if len(rows) else (slice(0), slice(0))
        at = np.array([rows[0], columns[0]] if len(rows) else [0, 0])
        layers: dict[str, Any] = tile.arrays.part(*box)._asdict()
        if tile.refined is not None:
            layers["refined"] = tile.refined[box]
        with atomically(self._file(key, number)) as file:
            np.savez(file, at=at, **layers)
        before = self._written.get(key)
        self._written[key] = number, tile.frames
        if before is not None:
            self._file(key, before[0]).unlink(missing_ok=True)
        tile.dirty = False

    def commit(self, resolution: float, kind: Kind | None, frames: int, names: Iterable[str]) -> None:
        """Make what was written, and these further names, the map.

        Raises
        ------
        FileError
            It cannot be written; the map is the one before.
        """
        self.check_ours()
        text = "".join(json.dumps(name) + "\n" for name in names).encode()
        with _written_to(self.path / _NAMES), (self.path / _NAMES).open("r+b" if self._size else "wb") as file:
            file.seek(self._size)
            file.write(text)
            file.truncate()
            file.flush()
            os.fsync(file.fileno())
        numbers = {**self._numbers, **self._written}
        header = {
            "format": _FORMAT,
            "version": _VERSION,
            "resolution": resolution,
            "tile": self.side,
            "channels": None if kind is None else kind.channels,
            "dtype": None if kind is None else kind.dtype.name,
            "samples": self.samples,
            "labels": self.labels,
            "frames": frames,
            "names_size": self._size + len(text),
            "tiles": {f"{i}_{j}": value for (i, j), value in sorted(numbers.items())},
        }
        with atomically(self.path / _HEADER) as file:
            file.write(json.dumps(header).encode())
        for key in self._written.keys() & self._numbers.keys():
            with contextlib.suppress(OSError):
                self._file(key, self._numbers[key][0]).unlink()
        self.resolution, self.kind, self.frames = resolution, kind, frames
        self._numbers, self._written, self._size = numbers, {}, self._size + len(text)

    def _file(self, key: TileKey, number: int) -> Path:
        return self.path / _TILES / f"{key[0]}_{key[1]}.{number}.npz"

    def _make(self) -> None:
        try:
            others = (
                self.path.exists()
                and not (self.path / _HEADER).exists()
                and any(entry.name not in (_LOCK, _TILES, _NAMES) for entry in self.path.iterdir())
            )
            if not others:
                (self.path / _TILES).mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise FileError(
                f"path: expected a directory for a mosaic, got: {reason} ({self.path}); give another"
            ) from error
        if others:
            raise FileError(f"{self.path}: expected a mosaic or an empty directory, got other files; give another")

    def _read(self) -> None:
        path = self.path / _HEADER
        check_source(path, "the header of a mosaic")
        with reading(path, "the header of a mosaic"):
            header = json.loads(path.read_bytes())
            if header["format"] != _FORMAT:
                raise FileError(f"{path}: expected the header of a mosaic, got another file; check the path")
            if header["version"] != _VERSION:
                raise FileError(
                    f"{path}: expected version {_VERSION} of a mosaic, got another; use the ipm_rs that made it"
                )
            self.resolution, self.side = float(header["resolution"]), int(header["tile"])
            self.samples, self.labels = int(header.get("samples", 0)), bool(header.get("labels", False))
            if header["channels"] is not None:
                dtype = {"uint8": np.uint8, "uint16": np.uint16}[header["dtype"]]
                self.kind = Kind(self.side, int(header["channels"]), np.dtype(dtype), self.samples, self.labels)
            self.frames, self._size = int(header["frames"]), int(header["names_size"])
            for name, (number, frames) in header["tiles"].items():
                i, j = name.split("_")
                self._numbers[int(i), int(j)] = int(number), int(frames)
            counts = [self.frames, self._size, *(count for pair in self._numbers.values() for count in pair)]
            channels = 1 if self.kind is None else self.kind.channels
            # the limits of Mosaic's own arguments
            good = 1e-6 < self.resolution < 100 and self.side in range(64, 4097, 64) and channels in range(1, 17)
            good &= self.samples in range(int(self.labels), 65) and not (self.labels and channels != 1)
            if not good or min(counts) < 0:
                raise FileError(
                    f"{path}: expected cells, tiles, channels and counts that a mosaic can have, got others; the file "
                    "is damaged, restore it"
                )
        if self._size:
            path = self.path / _NAMES
            check_source(path, "the names of a mosaic's frames")
            with reading(path, "the names of a mosaic's frames"), path.open("rb") as file:
                text = file.read(self._size)
                if len(text) < self._size:
                    raise FileError(f"{path}: expected {self._size} bytes, got {len(text)}; restore the file")
                self.names = [json.loads(line) for line in text.splitlines()]

    def _remove_unnamed(self) -> None:
        with contextlib.suppress(OSError):
            for entry in list((self.path / _TILES).iterdir()):
                match = _TILE_FILE.fullmatch(entry.name)
                if match is None:
                    continue
                i, j, number = map(int, match.groups())
                if self._numbers.get((i, j), (0, 0))[0] != number:
                    entry.unlink()


@contextlib.contextmanager
def _written_to(path: Path) -> Any:
    try:
        yield
    except OSError as error:
        raise FileError(
            f"{path}: expected to write it, got: {error.strerror or error}; check permissions and the free space"
        ) from error


def check_same(store: Store, resolution: float, side: int, asked: tuple[int | None, np.dtype[Any] | None]) -> None:
    """Refuse a store of other cells, channels or numbers than are asked for."""
    if store.resolution is not None and (store.resolution, store.side) != (resolution, side):
        raise MosaicError(
            f"{store.path}: expected cells of {resolution:g} m in tiles of {side}, got a mosaic of "
            f"{store.resolution:g} m in tiles of {store.side}; give these, or another path"
        )
    channels, dtype = asked
    kind = store.kind
    if kind is not None and (channels or kind.channels, dtype or kind.dtype) != (kind.channels, kind.dtype):
        raise MosaicError(
            f"{store.path}: expected {channels or kind.channels} channels of {dtype or kind.dtype}, got a mosaic of "
            f"{kind.channels} of {kind.dtype}; give these, or another path"
        )


def cells_of(path: Any) -> dict[str, Any]:
    """Return what a stored mosaic was made with: resolution, tile size, and what it keeps.

    Raises
    ------
    MissingFileError, FileError
    """
    header = as_path(path) / _HEADER
    check_source(header, "the header of a mosaic", "give the directory of one")
    store = Store(path)
    try:
        assert store.resolution is not None
        assert store.side is not None
        return {
            "resolution": store.resolution,
            "tile": store.side,
            "samples": store.samples,
            "labels": store.labels,
        }
    finally:
        store.close()
