"""`Mosaic`: a map of the road from the frames of a drive."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import number_of
from ipm_rs._core import Camera, HeightMap, Plane, _mosaic_add
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationWarning, FileError, MosaicError
from ipm_rs.mosaic._cache import Tiles
from ipm_rs.mosaic._checks import dtype_of, each_of, whole_of
from ipm_rs.mosaic._frames import checked_pictures
from ipm_rs.mosaic._placing import Placed, Window, distance_of, ground_in_map, placed, pose_of, windows
from ipm_rs.mosaic._reading import Readable
from ipm_rs.mosaic._refining import refined
from ipm_rs.mosaic._store import Store, cells_of, check_same
from ipm_rs.mosaic._tiles import Kind
from ipm_rs.mosaic.driving import Drive
from ipm_rs.rig import Rig

__all__ = ["Mosaic"]

_COMMIT = 200
"""Frames from one commit to the next: it rewrites some ten tiles, 10 MB each, which is a part of what adding costs."""


class Mosaic(Readable):
    """A map of the road, of square tiles, which frames of cameras anywhere in it are added to.

    The map's axes are those of the poses, x and y level, z up. A cell holds integer sums over all frames that saw it,
    so the map does not depend on the order of frames, on threads, or on how many machines shared the work, to the last
    bit. What is made of the sums is chosen at reading: see `image`.

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
    memory : int
        With `path`, bytes of tiles that are kept in memory.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    MosaicError
        The mosaic at `path` has another resolution, tile size, dtype or number of channels.
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
        memory: int = 1 << 30,
    ) -> None:
        self._resolution = number_of("resolution", resolution, low=1e-6, high=100.0, what=" of metres a cell")
        self._side = whole_of("tile", tile, 64, 4096)
        if self._side % 64:
            raise ArgumentError(f"tile: expected a multiple of 64 cells, got {self._side}; use 512")
        self._asked = (
            None if channels is None else whole_of("channels", channels, 1, 16),
            None if dtype is None else dtype_of(dtype),
        )
        memory = whole_of("memory", memory, 0, 1 << 50)
        self._kind: Kind | None = None
        if self._asked[0] is not None and self._asked[1] is not None:
            self._kind = Kind(self._side, self._asked[0], self._asked[1])
        self._frames, self._names, self._new_names = 0, set[str](), list[str]()
        self._uncommitted, self._broken, self._closed = 0, False, False
        self._drive: Drive | None = Drive()
        store = None if path is None else Store(path)
        if store is not None:
            try:
                check_same(store, self._resolution, self._side, self._asked)
                store.side = self._side
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
        resolution, side = cells_of(path)
        return cls(resolution, tile=side, path=path, memory=memory)

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
            if self._kind is not None:
                for key in self._tiles.keys():
                    tile = self._tiles.get(key, self._kind)
                    assert tile is not None
                    store.write(key, tile)
                    tile.dirty = self._tiles.store is not None
            store.commit(self._resolution, self._kind, self._frames, sorted(self._names))
        finally:
            store.close()

    def commit(self) -> None:
        """With a `path`, make all that was added so far last, whatever happens to the process from now on.

        `add` does it now and then, and `close` at the end.

        Raises
        ------
        FileError
            It cannot be written; the map on disk is that of the last commit.
        """
        self._check_whole()
        if self._tiles.store is not None:
            self._tiles.flush()
            self._tiles.store.commit(self._resolution, self._kind, self._frames, self._new_names)
            self._new_names, self._uncommitted = [], 0

    def close(self) -> None:
        """With a `path`, commit and let others open it; the mosaic cannot be used any more.

        After an `add` that was interrupted half-way nothing is committed.
        """
        if self._tiles.store is None or self._closed:
            return
        try:
            if not self._broken:
                self.commit()
        finally:
            self._tiles.store.close()
            self._closed = True

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

    def __repr__(self) -> str:
        tiles = f"{len(self._tiles.keys())} tiles of {self._side} cells"
        return f"Mosaic({self._resolution:g} m, {tiles}, {self._frames} frames)"

    def add(
        self,
        camera: Camera | Rig | Mapping[str, Camera],
        image: Any,
        *,
        map_from_vehicle: ArrayLike,
        ground: float | Plane | HeightMap | Literal["wheels"] = 0.0,
        mask: Any = None,
        weight: float = 1.0,
        distance: Sequence[float] | None = None,
        gain: float = 1.0,
        name: str | None = None,
        threads: int | None = None,
    ) -> int:
        """Add a frame of a camera, or of a rig.

        Every cell gets the mean of what it covers of the picture (`Lut.warp` with "area"), weighed by how well the
        frame resolves it: by the eighth power of the pixels a cell in the worse direction, level from one pixel on.
        Cells of which more than 16 share a pixel are left out.

        Parameters
        ----------
        camera : Camera, Rig or mapping of str to Camera
            Posed on the vehicle. What its mask hides (`Camera.masked`) is not seen.
        image : (H, W) or (H, W, C) array, or mapping of them by camera
            As `Lut.warp` takes it. A rig's cameras whose picture is missing add nothing.
        map_from_vehicle : (4, 4) array_like
            Where the vehicle was.
        ground : float, Plane, HeightMap or "wheels"
            The road in the map: its height, a plane, heights; "wheels" is the plane z = 0 of the vehicle at this pose.
        mask : (H, W) array_like, optional
            True, or not 0, where this frame shows the road: nothing that moves, no sky, no bonnet. Of a rig a mapping.
        weight : float
            How much this frame counts, above 0 and up to 1.
        distance : (min, max), optional
            Metres from the vehicle's origin, level: cells nearer or farther are left out.
        gain : float
            What the picture is multiplied by, above 0 and up to 16: exposure that differs from frame to frame.
        name : str, optional
            Of the frame. One that the map holds already is not added again: a run that was killed may begin anew.
        threads : int, optional
            At most how many; the map does not depend on it.

        Returns
        -------
        int
            How many cells it has seen, of all its cameras together.

        Raises
        ------
        ImageError, DtypeError
            A picture has another size than its camera, or other channels or another dtype than the map.
        CalibrationError
            The pose is not rigid, not finite or far out, or the camera is below the road.
        ArgumentError, ArgumentTypeError
            Another argument is wrong. In all of these cases nothing has been added.
        MosaicError
            A tile has as many frames as its sums hold; or an earlier call was interrupted half-way.

        Warns
        -----
        CalibrationWarning
            The vehicle lies on its side, or the drive goes up more than along, or sideways: poses of a camera, or of
            other axes. Once for each map.
        """
        self._check_whole()
        pose = pose_of(map_from_vehicle)
        road, limits = ground_in_map(ground, pose), distance_of(distance)
        share = number_of("weight", weight, low=0.0, what=" up to 1")
        if share > 1:
            raise ArgumentError(f"weight: expected a number up to 1, got {share:g}; divide all weights by the largest")
        factor = number_of("gain", gain, low=0.0, high=16.0 + 1e-9)
        threads = None if threads is None else whole_of("threads", threads, 1, 1024)
        if name is not None and not isinstance(name, str):
            raise ArgumentTypeError(f"name: expected text, got {type(name).__name__}; use str(...)")
        pictures = checked_pictures(camera, image, mask, self.channels, self.dtype, factor)
        if name is not None and name in self._names:
            return 0
        shown = [(picture, placed(picture.camera, pose, road, limits, share)) for picture in pictures]
        if not shown:
            return 0
        self._watch(pose)
        array = pictures[0].image
        kind = self._kind or Kind(self._side, 1 if array.ndim == 2 else array.shape[2], array.dtype)
        plan = [(picture.image, frame, list(windows(frame, self._resolution, self._side))) for picture, frame in shown]
        for key in {window.key for _, _, parts in plan for window in parts}:
            kind.check_room(self._tiles.frames(key) + len(plan))
        self._kind = kind
        cells = self._accumulate(plan, threads)
        self._count(1, () if name is None else (name,))
        if self._uncommitted >= _COMMIT:
            self.commit()
        return cells

    def refine(
        self,
        frames: Iterable[tuple[Camera | Rig | Mapping[str, Camera], Any, ArrayLike]],
        iterations: int = 2,
        *,
        ground: float | Plane | HeightMap | Literal["wheels"] = 0.0,
        distance: Sequence[float] | None = None,
        threads: int | None = None,
    ) -> None:
        """Make the picture sharper than any frame, where none resolves a cell: the road that explains all frames.

        What each frame shows beyond the map, as its camera would see that, is brought back to the cells and added, in
        few and damped steps. Cells that a frame resolves with 1.6 pixels or more stay as they are. `image` shows the
        result from then on, until a frame is added to a tile; the sums are not touched. Takes some ten bytes for each
        cell of the map in memory.

        Parameters
        ----------
        frames : iterable of (camera, image, map_from_vehicle)
            Those that were added, as `add` takes them. Gone through once for each iteration, so no generator.
        iterations : int
            1 to 20. After two or three, noise grows.
        ground, distance, threads
            As for `add`.

        Raises
        ------
        MosaicError
            There is no frame in the map.
        ArgumentError, ArgumentTypeError, ImageError, DtypeError, CalibrationError
            As `add`; the picture stays as it was.
        """
        self._check_whole()
        steps, limits = whole_of("iterations", iterations, 1, 20), distance_of(distance)
        threads = None if threads is None else whole_of("threads", threads, 1, 1024)
        kind = self._kind
        if kind is None or not self._tiles.keys():
            raise MosaicError("mosaic: expected a map of frames to refine, got an empty one; add them first")

        def shown() -> Iterator[tuple[NDArray[Any], Placed, list[Window]]]:
            for frame in each_of("frames", frames, again=True):
                if not isinstance(frame, (tuple, list)) or len(frame) != 3:
                    raise ArgumentTypeError(
                        f"frames: expected (camera, image, map_from_vehicle), got {type(frame).__name__}"
                    )
                pose = pose_of(frame[2])
                for picture in checked_pictures(frame[0], frame[1], None, kind.channels, kind.dtype, 1.0):
                    camera = placed(picture.camera, pose, ground_in_map(ground, pose), limits, 1.0)
                    parts = [part for part in windows(camera, self._resolution, self._side) if part.key in self._tiles]
                    yield picture.image, camera, parts

        for key, picture in refined(self, shown, steps, threads, self._tiles.store is not None).items():
            tile = self._tiles.get(key, kind)
            assert tile is not None
            tile.refined, tile.dirty = picture, True

    def _accumulate(self, plan: list[tuple[NDArray[Any], Placed, list[Window]]], threads: int | None) -> int:
        """Add placed pictures to windows of tiles, all checked; returns how many cells were seen."""
        image = plan[0][0]
        kind = self._kind = self._kind or Kind(self._side, 1 if image.ndim == 2 else image.shape[2], image.dtype)
        self._broken, cells = True, 0
        for picture, frame, parts in plan:
            for window in parts:
                kept = self._tiles.get(window.key, kind)
                tile = kind.empty() if kept is None else kept
                seen = _mosaic_add(frame, picture, window.grid, tile.arrays, window.at, threads)
                if seen:
                    tile.changed(1)
                    if kept is None:
                        self._tiles.put(window.key, tile, kind)
                cells += seen
        self._broken = False
        return cells

    def merge(self, other: Mosaic) -> None:
        """Add all that another map holds: exactly what adding its frames would have given.

        Raises
        ------
        MosaicError
            It has another resolution, tile size, dtype or number of channels; nothing has been added then.
        """
        if not isinstance(other, Mosaic):
            raise ArgumentTypeError(f"other: expected an ipm_rs.Mosaic, got {type(other).__name__}")
        self._check_whole()
        other._check_whole()
        if (self._resolution, self._side) != (other._resolution, other._side):
            raise MosaicError(
                f"other: expected cells of {self._resolution:g} m in tiles of {self._side}, got "
                f"{other._resolution:g} m in tiles of {other._side}; make both alike"
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
        if self._uncommitted >= _COMMIT:
            self.commit()

    def _watch(self, pose: NDArray[np.float64]) -> None:
        """Warn, once, of poses that hardly are a vehicle's."""
        if self._drive is not None:
            self._drive.goes_to(pose)
            oddity = self._drive.oddity()
            if oddity is not None:
                self._drive = None
                warnings.warn(f"map_from_vehicle: {oddity}", CalibrationWarning, stacklevel=3)

    def _count(self, frames: int, names: Iterable[str]) -> None:
        added = sorted(names)
        self._frames, self._uncommitted = self._frames + frames, self._uncommitted + frames
        self._names.update(added)
        self._new_names += added if self._tiles.store is not None else []

    def _check_whole(self) -> None:
        if self._closed:
            raise MosaicError("mosaic: expected one that is open, got one that was closed; Mosaic.load opens it again")
        if self._broken:
            raise MosaicError(
                "mosaic: expected a map whose last frame was added whole, got one that was interrupted half-way; build "
                "it again, or load it from its path as it was at the last commit"
            )
