"""Tiles: squares of integer accumulators, which frames are added to and which add up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import _mosaic_add, _mosaic_merge
from ipm_rs.errors import MosaicError

__all__ = ["Arrays", "Kind", "Shown", "Tile", "TileKey"]

TileKey = tuple[int, int]
"""Tile (i, j) spans x from i * side cells on, and y from j * side cells on."""


class Arrays(NamedTuple):
    """The layers of a tile, in the order in which the core takes them; see `src/mosaic/tile.rs`."""

    weights: NDArray[np.uint64]
    totals: NDArray[np.uint64]
    counts: NDArray[np.uint32]
    sums: NDArray[np.uint64]
    squares: NDArray[np.uint64]
    resolutions: NDArray[np.uint16]
    bests: NDArray[Any]
    keys: NDArray[np.uint32]
    samples: NDArray[Any]

    def part(self, rows: slice, columns: slice) -> Arrays:
        """Return the layers of some of the cells."""
        layers: Any = [layer[rows, columns] for layer in self]
        return Arrays(*layers)


@dataclass(frozen=True)
class Kind:
    """What all tiles of a mosaic have in common; `samples` and `labels` as of `Mosaic`."""

    side: int
    channels: int
    dtype: np.dtype[Any]
    samples: int = 0
    labels: bool = False

    @property
    def most_frames(self) -> int:
        """So many frames fit a cell's sums, whose weights have 31 bits, for certain."""
        return 1 << (32 - 8 * self.dtype.itemsize)

    def check_room(self, frames: int) -> None:
        """Refuse more frames than the sums hold."""
        if frames > self.most_frames:
            raise MosaicError(
                f"mosaic: expected at most {self.most_frames} frames over one tile of {self.dtype}, got more; use "
                "every so many-th frame"
            )

    def shapes(self) -> dict[str, tuple[tuple[int, ...], Any]]:
        """Return shape and dtype of each layer."""
        cells, numbers = (self.side, self.side), (self.side, self.side, self.channels)
        sums = (self.side, self.side, 0 if self.labels else self.channels)
        return {
            "weights": (cells, np.uint64),
            "totals": (sums, np.uint64),
            "counts": (cells, np.uint32),
            "sums": (sums, np.uint64),
            "squares": (sums, np.uint64),
            "resolutions": (cells, np.uint16),
            "bests": (numbers, self.dtype),
            "keys": ((*cells, self.samples), np.uint32),
            "samples": ((*cells, self.samples, self.channels), self.dtype),
        }

    def empty(self) -> Tile:
        """Return a tile that nothing has been added to."""
        return Tile(Arrays(*(np.zeros(shape, dtype) for shape, dtype in self.shapes().values())))

    @property
    def nbytes(self) -> int:
        """Bytes of a tile, with those of what waits for being added."""
        layers = sum(int(np.prod(shape)) * np.dtype(dtype).itemsize for shape, dtype in self.shapes().values())
        return layers + layers // _WAITING


Shown = tuple[tuple[int, int], NDArray[Any], NDArray[np.uint16], int, int]
"""What a frame shows of a tile, as the core gives and takes it.

Where its window begins, values, resolutions, weight, id."""

_WAITING = 8
"""What waits takes up to 1/8 of what the tile's layers do, and one frame's part: at 5 cm some ten frames.

A grey cell has 39 bytes of sums, which are read and written for 3 of a frame's. Where eight frames share that, adding
takes 5 ns a cell instead of 14, of colour 9 instead of 25."""


class Tile:
    """A tile's layers, how many frames were added, and whether they differ from what is stored.

    `refined` is the picture that `Mosaic.refine` made of them, until something is added. What frames show waits until
    there is enough of it, or until `arrays` is asked for.
    """

    def __init__(self, arrays: Arrays) -> None:
        self._arrays = arrays
        self._shown: list[Shown] = []
        self._waiting = 0
        self._most = sum(layer.nbytes for layer in arrays) // _WAITING
        self.frames = 0
        self.dirty = False
        self.refined: NDArray[Any] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: another process may have the layers read-only, so nothing may wait."""
        self._settle(None)
        return self.__dict__

    @property
    def arrays(self) -> Arrays:
        """The layers, with all that was added."""
        self._settle(None)
        return self._arrays

    def add(self, shown: Shown, threads: int | None) -> None:
        """Add what a frame shows, now or later."""
        self._shown.append(shown)
        self._waiting += shown[1].nbytes + shown[2].nbytes
        self.changed(1)
        if self._waiting > self._most:
            self._settle(threads)

    def _settle(self, threads: int | None) -> None:
        if self._shown:
            # which empties the list: whatever interrupts this, nothing is added twice or lost
            _mosaic_add(self._arrays, self._shown, threads)
        self._waiting = 0

    def changed(self, frames: int) -> None:
        """Note that so many frames were added."""
        self.frames, self.dirty, self.refined = self.frames + frames, True, None

    def merge(self, other: Tile) -> None:
        """Add another tile's sums: what comes out is what adding its frames would have given."""
        mine, theirs = self.arrays, other.arrays
        for name in ("weights", "totals", "counts", "sums", "squares"):
            layer = getattr(mine, name)
            np.add(layer, getattr(theirs, name), out=layer)
        higher = theirs.resolutions > mine.resolutions
        larger = larger_value(theirs.bests, mine.bests)
        better = higher | ((theirs.resolutions == mine.resolutions) & larger)
        mine.bests[better] = theirs.bests[better]
        np.maximum(mine.resolutions, theirs.resolutions, out=mine.resolutions)
        _mosaic_merge(mine, theirs.keys, theirs.samples)
        self.changed(other.frames)


def larger_value(one: NDArray[Any], other: NDArray[Any]) -> NDArray[np.bool_]:
    """Say where a colour comes after another, channel by channel, as the core orders equals."""
    larger = np.zeros(one.shape[:2], bool)
    decided = np.zeros(one.shape[:2], bool)
    for channel in range(one.shape[2]):
        differs = ~decided & (one[..., channel] != other[..., channel])
        larger |= differs & (one[..., channel] > other[..., channel])
        decided |= differs
    return larger
