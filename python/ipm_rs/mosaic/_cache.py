"""The tiles of a mosaic: all in memory, or those used last, and the others on disk."""

from __future__ import annotations

from collections import OrderedDict

from ipm_rs.mosaic._store import Store
from ipm_rs.mosaic._tiles import Kind, Tile, TileKey

__all__ = ["Tiles"]

_FEWEST = 8
"""Tiles in memory at least: a frame's own, so that none is written twice for one frame."""


class Tiles:
    """Tiles by their keys.

    Parameters
    ----------
    store : Store or None
        Where those are that memory has no room for.
    memory : int
        Bytes of tiles that are kept in memory, where there is a store.
    """

    def __init__(self, store: Store | None, memory: int) -> None:
        self.store = store
        self._memory = memory
        self._loaded: OrderedDict[TileKey, Tile] = OrderedDict()

    def __contains__(self, key: TileKey) -> bool:
        return key in self._loaded or (self.store is not None and key in self.store.keys)

    def keys(self) -> list[TileKey]:
        """Return which tiles there are, in order."""
        return sorted({*self._loaded, *(self.store.keys if self.store else ())})

    def loaded(self) -> int:
        """Return how many are in memory."""
        return len(self._loaded)

    def frames(self, key: TileKey) -> int:
        """Return how many frames a tile holds, 0 where there is none."""
        if key in self._loaded:
            return self._loaded[key].frames
        return self.store.frames_of(key) if self.store is not None and key in self.store.keys else 0

    def get(self, key: TileKey, kind: Kind) -> Tile | None:
        """Return a tile, from the disk if need be; None where there is none."""
        if key in self._loaded:
            self._loaded.move_to_end(key)
            return self._loaded[key]
        if self.store is None or key not in self.store.keys:
            return None
        self.put(key, self.store.read(key, kind), kind)
        return self._loaded[key]

    def put(self, key: TileKey, tile: Tile, kind: Kind) -> None:
        """Keep a tile; those that were not used for longest make room."""
        self._loaded[key] = tile
        self._loaded.move_to_end(key)
        if self.store is None:
            return
        while len(self._loaded) > max(_FEWEST, self._memory // kind.nbytes):
            oldest = next(iter(self._loaded))
            if self._loaded[oldest].dirty:
                self.store.write(oldest, self._loaded[oldest])
            del self._loaded[oldest]

    def flush(self) -> None:
        """Write all that is not on the disk."""
        if self.store is not None:
            for key, tile in self._loaded.items():
                if tile.dirty:
                    self.store.write(key, tile)
