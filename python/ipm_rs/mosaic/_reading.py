"""What is read from a map: windows, pictures and layers of them, and files for other programs."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import array_of, names_of
from ipm_rs._core import BevGrid
from ipm_rs.errors import ArgumentError, ArgumentTypeError
from ipm_rs.files.atomic import as_path
from ipm_rs.mosaic._cache import Tiles
from ipm_rs.mosaic._checks import overlap, range_of
from ipm_rs.mosaic._lock import Turn, in_turn
from ipm_rs.mosaic._placing import cells_grid
from ipm_rs.mosaic._samples import feathered
from ipm_rs.mosaic._tiles import Kind, TileKey
from ipm_rs.mosaic._views import BLENDS, LAYERS, check_kept, layer_names, view_of

__all__ = ["Blend", "Readable"]

_FEATHER = 0.5
"""Metres across which seams of "feathered" are mixed, as a ring's."""

_MOST_CELLS = 1 << 28
"""Cells of one window that is read: 16 000 by 16 000."""

_FARTHEST = 1e9
"""Metres of an origin: numbers of zones before eastings fit, and a cell of 1 mm is still told from the next."""

Blend = Literal["refined", "weighted", "best", "mean", "robust", "feathered", "labels"]


class Readable(ABC):
    """The part of a `Mosaic` that reads its tiles."""

    _resolution: float
    _side: int
    _asked: tuple[int | None, np.dtype[Any] | None]
    _samples: int
    _labels: bool
    _kind: Kind | None
    _tiles: Tiles
    _turn: Turn

    @abstractmethod
    def _check_whole(self) -> None:
        """Refuse a map that was closed, or interrupted half-way."""

    @abstractmethod
    def _check_changeable(self) -> None:
        """Refuse these, and one that another process opened."""

    @property
    def resolution(self) -> float:
        """Metres a cell."""
        return self._resolution

    @property
    def tile(self) -> int:
        """Cells along a tile's side."""
        return self._side

    @property
    def channels(self) -> int | None:
        """Channels of the pictures; None before the first one."""
        return self._asked[0] if self._kind is None else self._kind.channels

    @property
    def dtype(self) -> np.dtype[Any] | None:
        """The pictures' dtype; None before the first one."""
        return self._asked[1] if self._kind is None else self._kind.dtype

    @property
    def samples(self) -> int:
        """Of how many frames, those that resolve it best, a cell keeps the values."""
        return self._samples

    @property
    def labels(self) -> bool:
        """Whether it is a map of labels."""
        return self._labels

    @property
    @in_turn
    def tiles(self) -> list[TileKey]:
        """Which tiles there are, in order: (i, j) begins at x = i * tile * resolution and y = j * tile * resolution."""
        return self._tiles.keys()

    @property
    @in_turn
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """((x min, x max), (y min, y max)) around all tiles, metres; None where there is none."""
        if not self._tiles.keys():
            return None
        # no grid's, which has fewer cells than lie around two far apart
        (first_x, end_x), (first_y, end_y) = self._extent()
        r = self._resolution
        return (first_x * r, end_x * r), (first_y * r, end_y * r)

    @property
    @in_turn
    def nbytes(self) -> int:
        """Bytes of the tiles in memory."""
        return 0 if self._kind is None else self._tiles.loaded() * self._kind.nbytes

    @in_turn
    def window(self, x: Sequence[float] | None = None, y: Sequence[float] | None = None) -> BevGrid:
        """Return the grid of the map's cells in a range of x and of y, all tiles by default.

        Raises
        ------
        GridError
            A range is not whole cells of the map; the message names the nearest that is.
        ArgumentError
            There is no tile yet, and a range is not given.
        """
        return self._grid(*self._cells(x, y))

    @in_turn
    def image(
        self, x: Sequence[float] | None = None, y: Sequence[float] | None = None, *, blend: Blend | None = None
    ) -> NDArray[Any]:
        """Return the picture of a window: (rows, columns) or (rows, columns, C) of the map's dtype, 0 where nothing is.

        Row 0 has the largest x and column 0 the largest y, as in a `BevGrid`; `window` gives the grid.

        Parameters
        ----------
        x, y : (min, max), optional
            Metres, whole cells; by default all that there is.
        blend : {"refined", "weighted", "best", "mean", "robust", "feathered", "labels"}
            "refined", the default of pictures: what `refine` made, where it did, else "weighted": all frames that
            resolve the cell share it, otherwise the best one counts most. "best": the one frame that resolved it best.
            "mean": all frames alike. Of a map that keeps samples, "robust": as "weighted", of the samples that agree
            with most, so that what stood there for few frames is not seen; and "feathered": "best" with frames mixed
            along seams, across half a metre. "labels", of a map of labels and its default: the label with most votes.

        Raises
        ------
        GridError, ArgumentError, ArgumentTypeError
            As `window`; `blend` is none of these.
        MosaicError
            The map does not keep what `blend` is made of.
        """
        return self.layers(x, y, names=(wanted := self._blend_of(blend)))[wanted]

    @in_turn
    def layers(
        self,
        x: Sequence[float] | None = None,
        y: Sequence[float] | None = None,
        *,
        names: str | Iterable[str] | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Return layers of a window by their names; by default the view, the count and, of pictures, the deviation.

        ============= ====================================================================================
        ``weighted``  as `image`, likewise its other words
        ``std``       float32: the standard deviation of the frames' values, which is large where things moved
        ``count``     uint32: how many frames saw the cell
        ``density``   float32: pixels a cell, in the worse direction, of the frame that resolved it best; up to 16
        ``mask``      bool: whether any frame saw it
        ``agreement`` float32, of labels: the share of the votes that the label has
        ============= ====================================================================================

        Raises
        ------
        GridError, ArgumentError, ArgumentTypeError
            As `window`; a name is none of these.
        MosaicError
            The map does not keep what a layer is made of.
        """
        own = ("labels", "count") if self._labels else ("weighted", "count", "std")
        wanted = layer_names("names", names_of("names", own if names is None else names), LAYERS)
        self._check_whole()
        return self._read(*self._cells(x, y), wanted)

    def _read(self, x: tuple[int, int], y: tuple[int, int], wanted: list[str]) -> dict[str, NDArray[Any]]:
        """Return layers of a window that is given in cells."""
        (first_x, end_x), (first_y, end_y) = x, y
        if self._kind is None:
            raise ArgumentError("mosaic: expected frames to read a picture of, got none; add some")
        check_kept(wanted, self._kind)
        blank, all_of_it = replace(self._kind, side=1).empty(), slice(None)
        found: dict[str, NDArray[Any]] = {}
        for name in wanted:
            pattern = view_of(name, blank, all_of_it, all_of_it)
            found[name] = np.zeros((end_x - first_x, end_y - first_y, *pattern.shape[2:]), pattern.dtype)
        side = self._side
        for i in range(first_x // side, (end_x - 1) // side + 1):
            for j in range(first_y // side, (end_y - 1) // side + 1):
                tile = self._tiles.get((i, j), self._kind)
                if tile is None:
                    continue
                rows, into_rows = overlap(i, side, first_x, end_x)
                columns, into_columns = overlap(j, side, first_y, end_y)
                for name, layer in found.items():
                    if name != "feathered":
                        layer[into_rows, into_columns] = view_of(name, tile, rows, columns)
                        continue
                    part = (max(first_x, i * side), min(end_x, (i + 1) * side))
                    mixed = self._feathered(part, (max(first_y, j * side), min(end_y, (j + 1) * side)))
                    layer[into_rows, into_columns] = mixed[..., 0] if layer.ndim == 2 else mixed
        return found

    def _feathered(self, x: tuple[int, int], y: tuple[int, int]) -> NDArray[Any]:
        """Return a window in cells whose seams are mixed, whatever tiles they and their neighbours lie in."""
        assert self._kind is not None
        radius, side = max(1, round(_FEATHER / 2 / self._resolution)), self._side
        x, y = ((first - radius, end + radius) for first, end in (x, y))
        blank = replace(self._kind, side=1).empty().arrays
        shape = x[1] - x[0], y[1] - y[0]
        keys, samples = (np.zeros((*shape, *layer.shape[2:]), layer.dtype) for layer in (blank.keys, blank.samples))
        for i in range(x[0] // side, (x[1] - 1) // side + 1):
            for j in range(y[0] // side, (y[1] - 1) // side + 1):
                tile = self._tiles.get((i, j), self._kind)
                if tile is not None:
                    (rows, into_rows), (columns, into_columns) = overlap(i, side, *x), overlap(j, side, *y)
                    keys[into_rows, into_columns] = tile.arrays.keys[rows, columns]
                    samples[into_rows, into_columns] = tile.arrays.samples[rows, columns]
        return feathered(keys, samples, radius)

    @in_turn
    def export_tiles(self, directory: str | os.PathLike[str], *, blend: Blend | None = None) -> int:
        """Write the map as picture tiles of 256 pixels, ``<z>/<x>/<y>.png``, and a page that shows them.

        ``index.html`` needs no internet and no program on the server; opened as a file it works as well. x points up.
        16-bit maps lose their lower byte. Tiles of an older export in the directory are replaced or removed; until that
        is done, the page says that the map is being written.

        Returns
        -------
        int
            How many tiles.

        Raises
        ------
        FileError
            The directory cannot be written to.
        ArgumentError, ArgumentTypeError, MissingExtraError
            There is nothing to write; `blend` is none of `image`; Pillow is not installed (extra ``cli``).
        MosaicError
            The map does not keep what `blend` is made of.
        """
        from ipm_rs.mosaic._slippy import write_tiles

        place, wanted = as_path(directory, "directory"), self._blend_of(blend)
        (_, end_x), (_, end_y) = bounds = self._whole(wanted)

        def read(top: int, bottom: int, left: int, right: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
            return self._picture((end_x - bottom, end_x - top), (end_y - right, end_y - left), wanted)

        return write_tiles(place, read, bounds, self._resolution, (self._tiles.keys(), self._side))

    @in_turn
    def export_geotiff(
        self,
        path: str | os.PathLike[str],
        *,
        crs: Any,
        origin: Sequence[float] = (0.0, 0.0),
        blend: Blend | None = None,
    ) -> None:
        """Write the map as a cloud-optimised GeoTIFF: x to the east, y to the north, cells that nobody saw transparent.

        Parameters
        ----------
        path : str or path
            An existing file is replaced once the new one is whole.
        crs : str or whatever rasterio takes
            The coordinate system, projected and in metres, such as ``"EPSG:32632"`` (UTM 32 north).
        origin : (east, north)
            Metres, which are added to the map's coordinates.
        blend : str, optional
            As in `image`.

        Raises
        ------
        FileError
            It cannot be written.
        ArgumentError, ArgumentTypeError, MissingExtraError
            There is nothing to write; an argument is wrong; rasterio is not installed (extra ``geo``).
        MosaicError
            The map does not keep what `blend` is made of.
        """
        from ipm_rs.mosaic._geotiff import write_geotiff

        place, wanted = as_path(path), self._blend_of(blend)
        values = array_of("origin", origin)
        if values.shape != (2,) or values.dtype.kind not in "iuf" or not np.isfinite(values).all():
            raise ArgumentError(f"origin: expected two finite numbers (east, north), got shape {values.shape}")
        if np.abs(values.astype(np.float64)).max() > _FARTHEST:
            raise ArgumentError(
                f"origin: expected metres within {_FARTHEST:g} of the coordinate system's own origin, got "
                f"({values[0]:g}, {values[1]:g}); correct the unit"
            )
        bounds = self._whole(wanted)
        assert self.channels is not None
        assert self.dtype is not None
        write_geotiff(
            place,
            lambda x, y: self._picture(x, y, wanted),
            bounds,
            (self._tiles.keys(), self._side),
            resolution=self._resolution,
            channels=self.channels,
            dtype=self.dtype,
            crs=crs,
            origin=(float(values[0]), float(values[1])),
            labels=self._labels,
        )

    def _blend_of(self, blend: Any) -> str:
        if blend is None:
            return "labels" if self._labels else "refined"
        if not isinstance(blend, str):
            got = type(blend).__name__
            raise ArgumentTypeError(f"blend: expected {', '.join(BLENDS)}, got {got}; choose one of them")
        return layer_names("blend", [blend], BLENDS)[0]

    def _picture(self, x: tuple[int, int], y: tuple[int, int], blend: str) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return a picture and its mask of a window in cells."""
        layers = self._read(x, y, [blend, "mask"])
        return layers[blend], layers["mask"]

    def _whole(self, blend: str) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return the cells around all tiles, as many as they may be: for a picture that is written in parts."""
        self._check_whole()
        if self._kind is None or not self._tiles.keys():
            raise ArgumentError("mosaic: expected frames to write a picture of, got none; add some")
        check_kept([blend], self._kind)  # before anything is written
        return self._extent()

    def _extent(self) -> tuple[tuple[int, int], tuple[int, int]]:
        keys = np.array(self._tiles.keys())
        (low_i, low_j), (high_i, high_j) = keys.min(0) * self._side, (keys.max(0) + 1) * self._side
        return (int(low_i), int(high_i)), (int(low_j), int(high_j))

    def _grid(self, x: tuple[int, int], y: tuple[int, int]) -> BevGrid:
        return cells_grid(x, y, self._resolution)

    def _cells(self, x: Any, y: Any) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return the cells of a window: the first and the one behind the last along each axis."""
        tiles = bool(self._tiles.keys())
        if (x is None or y is None) and not tiles:
            raise ArgumentError("x, y: expected ranges, for there is no tile yet, got none; add frames, or give both")
        extent = self._extent() if tiles else ((0, 1), (0, 1))
        cells = [range_of(name, given, self._resolution) for name, given in (("x", x), ("y", y))]
        (first_x, end_x), (first_y, end_y) = (own or whole for own, whole in zip(cells, extent, strict=True))
        if (end_x - first_x) * (end_y - first_y) > _MOST_CELLS:
            raise ArgumentError(
                f"x, y: expected a window of at most {_MOST_CELLS} cells, got {end_x - first_x} x {end_y - first_y}; "
                "read it in parts, or write files of the whole with export_tiles and export_geotiff"
            )
        return (first_x, end_x), (first_y, end_y)
