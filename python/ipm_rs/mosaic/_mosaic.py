"""`Mosaic`: a map of the road from the frames of a drive."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

from ipm_rs._arguments import number_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError, FileError, MosaicError
from ipm_rs.mosaic._adding import Addable
from ipm_rs.mosaic._cache import Tiles
from ipm_rs.mosaic._checks import bool_of, dtype_of, whole_of
from ipm_rs.mosaic._lock import Turn, in_turn
from ipm_rs.mosaic._store import Store, cells_of, check_same
from ipm_rs.mosaic._tiles import Kind
from ipm_rs.mosaic.driving import Drive

__all__ = ["Mosaic"]

_COMMIT = 200
"""Frames from one commit to the next: it rewrites some ten tiles, 10 MB each, which is a part of what adding costs."""


class Mosaic(Addable):
    """A map of the road, of square tiles, which frames of cameras anywhere in it are added to.

    The map's axes are those of the poses, x and y level, z up. A cell holds integer sums over all frames that saw it,
    so the map does not depend on the order of frames, on threads, or on how many machines shared the work, to the last
    bit. What is made of the sums is chosen at reading: see `image`.

    Threads may share it: their calls wait for each other, those that read as well, whatever a call does meanwhile. Only
    while it is copied or pickled no other thread may add to it. A process that was forked from the one that opened a
    `path` may read.

    Parameters
    ----------
    resolution : float
        Metres a cell.
    tile : int
        Cells along a tile's side, a multiple of 64.
    path : str or path, optional
        A directory where the tiles live, made if need be; memory then stays bounded, and a run that was killed goes on
        from its last `commit`. One process at a time has it open. By default all is in memory.
    channels, dtype : optional
        Of the pictures: 1 to 16; uint8 or uint16. By default those of the first one added.
    samples : int, optional
        Of each cell, keep the values of so many frames, up to 64, those that resolve it best, for `image` with "robust"
        and "feathered"; each takes 4 bytes more than its value. By default 8 of labels, and none of pictures.
    labels : bool
        Pictures are of labels, of one channel: a cell gets the most frequent one of what it covers, labels are never
        mixed, and each of the frames that are kept has votes for its own.
    memory : int
        With `path`, bytes of tiles that are kept in memory.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    MosaicError
        The mosaic at `path` has another resolution, tile size, dtype or number of channels, or keeps something else.
    FileError
        `path` is no place for a mosaic, holds a damaged one, or another process has it open.
    """

    def __init__(
        self,
        resolution: float,
        *,
        tile: int = 512,
        path: str | os.PathLike[str] | None = None,
        channels: int | None = None,
        dtype: Any = None,
        samples: int | None = None,
        labels: bool = False,
        memory: int = 1 << 30,
    ) -> None:
        self._turn = Turn()
        self._resolution = number_of("resolution", resolution, low=1e-6, high=100.0, what=" of metres a cell")
        self._side = whole_of("tile", tile, 64, 4096)
        if self._side % 64:
            raise ArgumentError(f"tile: expected a multiple of 64 cells, got {self._side}; use 512")
        self._asked = (
            None if channels is None else whole_of("channels", channels, 1, 16),
            None if dtype is None else dtype_of(dtype),
        )
        self._labels = bool_of("labels", labels)
        self._samples = 8 * self._labels if samples is None else whole_of("samples", samples, int(self._labels), 64)
        if self._labels and self._asked[0] not in (None, 1):
            raise ArgumentError(f"channels: expected 1 of labels, got {self._asked[0]}; give each its map")
        memory = whole_of("memory", memory, 0, 1 << 50)
        self._kind: Kind | None = None
        if self._asked[0] is not None and self._asked[1] is not None:
            self._kind = self._kind_of(self._asked[0], self._asked[1])
        self._frames, self._names, self._new_names = 0, set[str](), list[str]()
        self._uncommitted, self._broken, self._closed = 0, False, False
        self._drive: Drive | None = Drive()
        store = None if path is None else Store(path)
        if store is not None:
            try:
                check_same(store, self._resolution, self._side, self._asked)
                if store.resolution is not None and (store.samples, store.labels) != (self._samples, self._labels):
                    raise MosaicError(
                        f"{store.path}: expected {_kept_words(self._samples, self._labels)}, got a mosaic of "
                        f"{_kept_words(store.samples, store.labels)}; give these, or another path"
                    )
                store.side, store.samples, store.labels = self._side, self._samples, self._labels
                if store.resolution is None:
                    store.commit(self._resolution, self._kind, 0, ())
            except BaseException:
                store.close()
                raise
            self._kind = store.kind or self._kind
            self._frames, self._names = store.frames, set(store.names)
        self._tiles = Tiles(store, memory)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, memory: int = 1 << 30) -> Mosaic:
        """Open the mosaic of a directory.

        Raises
        ------
        MissingFileError, FileError
            There is none, or it is damaged, or another process has it open.
        """
        return cls(path=path, memory=memory, **cells_of(path))

    @in_turn
    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map to a directory of its own, which `load` opens.

        Raises
        ------
        FileError
            It cannot be written, or is no empty directory.
        """
        self._check_whole()
        store = Store(path)
        try:
            if store.resolution is not None:
                raise FileError(
                    f"{store.path}: expected an empty directory, got a mosaic; give another, or merge into it"
                )
            store.side, store.kind = self._side, self._kind
            store.samples, store.labels = self._samples, self._labels
            if self._kind is not None:
                for key in self._tiles.keys():
                    tile = self._tiles.get(key, self._kind)
                    assert tile is not None
                    store.write(key, tile)
                    tile.dirty = self._tiles.store is not None
            store.commit(self._resolution, self._kind, self._frames, sorted(self._names))
        finally:
            store.close()

    @in_turn
    def commit(self) -> None:
        """With a `path`, make all that was added so far last, whatever happens to the process from now on.

        `add` does it now and then, and `close` at the end.

        Raises
        ------
        FileError
            It cannot be written; the map on disk is that of the last commit.
        """
        self._check_changeable()
        if self._tiles.store is not None:
            self._tiles.flush()
            self._tiles.store.commit(self._resolution, self._kind, self._frames, self._new_names)
            self._new_names, self._uncommitted = [], 0

    @in_turn
    def close(self) -> None:
        """With a `path`, commit and let others open it; the mosaic cannot be used any more.

        After an `add` that was interrupted half-way nothing is committed, nor by a process that was forked from the one
        that opened it. A mosaic that is collected without `close` lets others open it as it was at the last commit.
        """
        if self._tiles.store is None or self._closed:
            return
        try:
            if not self._broken and self._tiles.store.ours:
                self.commit()
        finally:
            self._tiles.store.close()
            self._closed = True

    @in_turn
    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled, or refuse: two objects that write one directory would lose each other's frames."""
        store = self._tiles.store
        if store is not None:
            raise MosaicError(
                f"mosaic: expected one in memory to copy or pickle, got one that lives in {store.path}, which one at a "
                "time has open; close it and open it there with Mosaic.load, or `save` it elsewhere and load that"
            )
        return {name: value for name, value in self.__dict__.items() if name != "_turn"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what was pickled; whose turn it is, is told in each process anew."""
        self.__dict__.update(state, _turn=Turn())

    def __enter__(self) -> Mosaic:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __contains__(self, name: object) -> bool:
        """Say whether a frame of this name was added."""
        return name in self._names

    @property
    def frames(self) -> int:
        """How many calls of `add` the map holds."""
        return self._frames

    @in_turn
    def __repr__(self) -> str:
        tiles = f"{len(self._tiles.keys())} tiles of {self._side} cells"
        return f"Mosaic({self._resolution:g} m, {tiles}, {self._frames} frames)"

    def merge(self, other: Mosaic) -> None:
        """Add all that another map holds: exactly what adding its frames would have given.

        Raises
        ------
        MosaicError
            It has another resolution, tile size, dtype or number of channels, or keeps something else, or it is this
            map.
        FileError
            A tile of either map cannot be read. In all of these cases nothing has been added.
        ArgumentTypeError
            It is no mosaic.
        """
        if not isinstance(other, Mosaic):
            raise ArgumentTypeError(f"other: expected an ipm_rs.Mosaic, got {type(other).__name__}")
        if other is self:
            raise MosaicError("other: expected another map, got this one, whose frames would be added twice")
        first, second = sorted((self, other), key=id)  # always in this order, or two might wait for each other
        with first._turn.lock, second._turn.lock:
            self._merge(other)

    def _merge(self, other: Mosaic) -> None:
        self._check_changeable()
        other._check_whole()
        if (self._resolution, self._side) != (other._resolution, other._side):
            raise MosaicError(
                f"other: expected cells of {self._resolution:g} m in tiles of {self._side}, got "
                f"{other._resolution:g} m in tiles of {other._side}; make both alike"
            )
        if (self._samples, self._labels) != (other._samples, other._labels):
            raise MosaicError(
                f"other: expected {_kept_words(self._samples, self._labels)}, got "
                f"{_kept_words(other._samples, other._labels)}; make both alike"
            )
        if other._kind is None:
            return
        if (self.channels or other.channels, self.dtype or other.dtype) != (other.channels, other.dtype):
            raise MosaicError(
                f"other: expected {self.channels} channels of {self.dtype}, got {other.channels} of {other.dtype}"
            )
        twice = self._names & other._names
        if twice:
            raise MosaicError(
                f"other: expected frames that this map does not hold, got {len(twice)} of both, such as "
                f"{min(twice)!r:.80}; build the parts from different frames"
            )
        kind = self._kind or other._kind
        for key in other.tiles:
            kind.check_room(self._tiles.frames(key) + other._tiles.frames(key))
        for key in other.tiles:  # one that cannot be read is found out here: nothing has been added yet
            other._tiles.get(key, kind), self._tiles.get(key, kind)
        self._kind, self._broken = kind, True
        for key in other.tiles:
            theirs, mine = other._tiles.get(key, kind), self._tiles.get(key, kind)
            assert theirs is not None
            if mine is None:
                mine = kind.empty()
                self._tiles.put(key, mine, kind)
            mine.merge(theirs)
        self._broken = False
        self._count(other._frames, other._names)

    def _empty(self, path: str | None) -> Mosaic:
        return type(self)(self._resolution, tile=self._side, path=path)

    def _count(self, frames: int, names: Iterable[str]) -> None:
        added = sorted(names)
        self._frames, self._uncommitted = self._frames + frames, self._uncommitted + frames
        self._names.update(added)
        self._new_names += added if self._tiles.store is not None else []
        if self._uncommitted >= _COMMIT:
            try:
                self.commit()
            except FileError as error:
                raise FileError(f"{error}; what was added is in the map, so then call commit() again") from error

    def _check_changeable(self) -> None:
        self._check_whole()
        if self._tiles.store is not None:
            self._tiles.store.check_ours()

    def _check_whole(self) -> None:
        if self._closed:
            raise MosaicError("mosaic: expected one that is open, got one that was closed; Mosaic.load opens it again")
        if self._broken:
            raise MosaicError(
                "mosaic: expected a map whose last frame was added whole, got one that was interrupted half-way; build "
                "it again, or load it from its path as it was at the last commit"
            )


def _kept_words(samples: int, labels: bool) -> str:
    return f"{samples} samples a cell of {'labels' if labels else 'pictures'}"
