"""Frames are added to a map, measured against it, and gone through again to make it sharper."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import number_of
from ipm_rs._core import Camera, HeightMap, Plane, _mosaic_shown
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationWarning, MosaicError
from ipm_rs.mosaic._checks import each_of, whole_of
from ipm_rs.mosaic._exposure import gain_of
from ipm_rs.mosaic._frames import Wanted, again_of, checked_pictures, id_of
from ipm_rs.mosaic._lock import in_turn
from ipm_rs.mosaic._placing import Placed, Window, distance_of, ground_in_map, placed, pose_of, windows
from ipm_rs.mosaic._reading import Readable
from ipm_rs.mosaic._refining import refined
from ipm_rs.mosaic._tiles import Kind
from ipm_rs.mosaic.driving import Drive
from ipm_rs.rig import Rig

__all__ = ["Addable"]


class Addable(Readable):
    """The part of a `Mosaic` that takes frames."""

    _names: set[str]
    _broken: bool
    _drive: Drive | None

    @abstractmethod
    def _empty(self, path: str | None) -> Any:
        """Return a map of the same cells, of any pictures, for a while."""

    @abstractmethod
    def _count(self, frames: int, names: Iterable[str]) -> None:
        """Note that frames were added, and make them last now and then."""

    @in_turn
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
        gain: float | Mapping[str, float] = 1.0,
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
        gain : float, or mapping of them by camera
            What the picture is multiplied by, above 0 and up to 16: see `gain`, the method.
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
        FileError
            With a `path`: a tile cannot be read or written; or a commit, which is made now and then, fails. Of a commit
            the error says that the frame is in the map, and `commit` can be called again.

        Warns
        -----
        CalibrationWarning
            The vehicle lies on its side, or the drive goes up more than along, or sideways: poses of a camera, or of
            other axes. Once for each map.
        """
        self._check_changeable()
        pose = pose_of(map_from_vehicle)
        road, limits = ground_in_map(ground, pose), distance_of(distance)
        share = number_of("weight", weight, low=0.0, what=" up to 1")
        if share > 1:
            raise ArgumentError(f"weight: expected a number up to 1, got {share:g}; divide all weights by the largest")
        threads = None if threads is None else whole_of("threads", threads, 1, 1024)
        if name is not None and not isinstance(name, str):
            raise ArgumentTypeError(f"name: expected text, got {type(name).__name__}; use str(...)")
        pictures = checked_pictures(camera, image, mask, self._wanted(), gain)
        if name is not None and name in self._names:
            return 0
        shown = [(picture, placed(picture.camera, pose, road, limits, share)) for picture in pictures]
        if self._samples:
            shown = [(picture, replace(frame, id=id_of(name, picture, pose))) for picture, frame in shown]
        if not shown:
            return 0
        self._watch(pose)
        array = pictures[0].image
        kind = self._kind or self._kind_of(1 if array.ndim == 2 else array.shape[2], array.dtype)
        plan = [(picture.image, frame, windows(frame, self._resolution, self._side)) for picture, frame in shown]
        for key in {window.key for _, _, parts in plan for window in parts}:
            kind.check_room(self._tiles.frames(key) + len(plan))
        self._kind = kind
        cells = self._accumulate(plan, threads)
        self._count(1, () if name is None else (name,))
        return cells

    @in_turn
    def gain(
        self,
        camera: Camera | Rig | Mapping[str, Camera],
        image: Any,
        *,
        map_from_vehicle: ArrayLike,
        ground: float | Plane | HeightMap | Literal["wheels"] = 0.0,
        mask: Any = None,
        distance: Sequence[float] | None = None,
        threads: int | None = None,
    ) -> Any:
        """Return what makes a frame as bright as the map so far, for `add(..., gain=)`; nothing is added.

        The median over the cells that both show of how much brighter the map is, of which 95 % are made up for: what
        changes from frame to frame is evened out, and the map follows what changes over hundreds. Cars and shadows that
        one of both shows do not matter while they are fewer than half. The gains depend on what was added before; with
        the same gains the map does not.

        Parameters
        ----------
        camera, image, map_from_vehicle, ground, mask, distance, threads
            As for `add`.

        Returns
        -------
        float, or dict of them by camera for a rig
            1 where the frame and the map have too little in common; 1/4 to 4.

        Raises
        ------
        ImageError, DtypeError, CalibrationError, ArgumentError, ArgumentTypeError, MosaicError
            As `add`; or it is a map of labels.
        """
        self._check_whole()
        if self._labels:
            raise MosaicError("mosaic: expected a map of pictures for gains, got one of labels")
        pose = pose_of(map_from_vehicle)
        road, limits = ground_in_map(ground, pose), distance_of(distance)
        threads = None if threads is None else whole_of("threads", threads, 1, 1024)
        found = {}
        for picture in checked_pictures(camera, image, mask, self._wanted(), 1.0):
            frame = placed(picture.camera, pose, road, limits, 1.0)
            parts = [] if self._kind is None else windows(frame, self._resolution, self._side)
            kind = self._kind or self._kind_of(1, np.dtype(np.uint8))
            found[picture.name] = gain_of(self._tiles, kind, picture.image, frame, parts, threads)
        return found[""] if isinstance(camera, Camera) else found

    @in_turn
    def refine(
        self,
        frames: Iterable[Sequence[Any]],
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
        frames : iterable of (camera, image, map_from_vehicle) or (camera, image, map_from_vehicle, options)
            Those that were added, as `add` takes them. `options` is a mapping with the ``"gain"`` and the ``"mask"``
            that the frame was added with: without them, what the mask hid is brought back, and the frame's own
            exposure. Gone through once for each iteration, so no generator.
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
        self._check_changeable()
        steps, limits = whole_of("iterations", iterations, 1, 20), distance_of(distance)
        threads = None if threads is None else whole_of("threads", threads, 1, 1024)
        kind = self._kind
        if kind is None or not self._tiles.keys():
            raise MosaicError("mosaic: expected a map of frames to refine, got an empty one; add them first")
        if self._labels:
            raise MosaicError("mosaic: expected a map of pictures to refine, got one of labels, which are never mixed")

        def shown() -> Iterator[tuple[NDArray[Any], Placed, list[Window]]]:
            for frame in each_of("frames", frames, again=True):
                given = again_of(frame)
                pose = pose_of(given.map_from_vehicle)
                for picture in checked_pictures(given.camera, given.image, given.mask, self._wanted(), given.gain):
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
        kind = self._kind = self._kind or self._kind_of(1 if image.ndim == 2 else image.shape[2], image.dtype)
        found = [
            (window.key, *_mosaic_shown(frame, picture, window.grid, window.at, kind.labels, threads))
            for picture, frame, parts in plan
            for window in parts
        ]
        shown = [(key, part) for key, seen, part in found if seen]
        for key, _ in shown:
            self._tiles.get(key, kind)  # one that cannot be read is found out here: nothing has been added yet
        self._broken = True
        for key, part in shown:
            tile = self._tiles.get(key, kind)
            if tile is None:
                tile = kind.empty()
                self._tiles.put(key, tile, kind)
            tile.add(part, threads)
        self._broken = False
        return sum(seen for _, seen, _ in found)

    def _kind_of(self, channels: int, dtype: np.dtype[Any]) -> Kind:
        return Kind(self._side, channels, dtype, self._samples, self._labels)

    def _wanted(self) -> Wanted:
        """Return what pictures must be like."""
        return Wanted(1 if self._labels else self.channels, self.dtype, self._labels)

    def _watch(self, pose: NDArray[np.float64]) -> None:
        """Warn, once, of poses that hardly are a vehicle's."""
        if self._drive is not None:
            self._drive.goes_to(pose)
            oddity = self._drive.oddity()
            if oddity is not None:
                self._drive = None
                # of whoever called `add`
                warnings.warn(f"map_from_vehicle: {oddity}", CalibrationWarning, stacklevel=4)
