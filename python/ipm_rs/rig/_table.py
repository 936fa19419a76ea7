"""`RigLut`: one bird's-eye view of all cameras of a rig."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of, names_of, number_of
from ipm_rs._core import BevGrid, Camera, HeightMap, Plane, _RigTable
from ipm_rs.errors import ArgumentError, ArgumentTypeError
from ipm_rs.rig._agreement import Agreement, PairView, pair_views
from ipm_rs.rig._bowl import Bowl
from ipm_rs.rig._cameras import Rig, check_names
from ipm_rs.rig._excluded import polygons_of

__all__ = ["RigLut"]

Images = Mapping[str, Any] | Sequence[Any]
Missing = Literal["next", "border"]


class RigLut:
    """Where every cell of one bird's-eye view samples the images of a rig's cameras, and by which weights.

    Built once, used for every set of images. A view depends neither on the number of threads nor on the order of the
    cameras. Comparable, picklable (a pickle builds it again).

    Parameters
    ----------
    rig : Rig or mapping of str to Camera
        The cameras.
    grid : BevGrid
        The grid on the road.
    ground : float, Plane, HeightMap or Bowl
        The road, as for `Lut`, or a bowl around the car.
    masks : mapping of str to (H, W) array, optional
        For some of the cameras, which pixels show the road, True or not 0, beside what their own masks hide
        (`Camera.masked`). The own bonnet, the rim of a fisheye's circle, mirrors. A cell whose footprint touches any
        other pixel is not seen by that camera.
    exclude : sequence of (M, 2) arrays, optional
        Polygons on the ground, metres, whose cells are not shown: the own car. One polygon may be given as it is.
    blend : {"best", "feather", "priority"}
        Who shows a cell that several see. "best": the camera that resolves it best in its worse direction; "priority":
        the first in the rig's order; both are mixed along seams. "feather": all that see it, the more the farther it is
        from the edge of what they see.
    feather : float
        Metres across which cameras are mixed along a seam; 0 is a hard one.

    Raises
    ------
    ArgumentError, ArgumentTypeError, ImageError
        An argument is of another kind, a name is none of the rig's, a mask has another size than its images.
    OutOfMemoryError
        There is not enough memory for the tables.
    """

    def __init__(
        self,
        rig: Rig | Mapping[str, Camera],
        grid: BevGrid,
        *,
        ground: float | Plane | HeightMap | Bowl = 0.0,
        masks: Mapping[str, ArrayLike | None] | None = None,
        exclude: Sequence[ArrayLike] | ArrayLike | None = None,
        blend: Literal["best", "feather", "priority"] = "best",
        feather: float = 0.5,
    ) -> None:
        self._rig = rig if isinstance(rig, Rig) else Rig(rig)
        if not isinstance(grid, BevGrid):
            raise ArgumentTypeError(f"grid: expected an ipm_rs.BevGrid, got {type(grid).__name__}")
        if masks is not None and not isinstance(masks, Mapping):
            raise ArgumentTypeError(f"masks: expected a mapping of names to masks, got {type(masks).__name__}")
        check_names(self._rig, "masks", masks or ())
        if not isinstance(blend, str) or blend not in ("best", "feather", "priority"):
            got = repr(blend) if isinstance(blend, str) else type(blend).__name__
            raise ArgumentError(f'blend: expected "best", "feather" or "priority", got {got:.60}')
        self._grid, self._ground = grid, ground
        # copies: who changes a mask later must not change what a pickle builds
        given = {
            name: None if mask is None else array_of(f"masks[{name!r}]", mask).copy()
            for name, mask in (masks or {}).items()
        }
        self._options: dict[str, Any] = {
            "masks": given,
            "exclude": polygons_of(exclude),
            "blend": blend,
            "feather": feather,
        }
        self._left_out: dict[tuple[frozenset[str], Missing], RigLut] = {}
        self._pairs: tuple[float, dict[tuple[str, str], PairView]] | None = None
        # whose table this is, without the cameras that are not in the list
        self._of: tuple[RigLut, list[str]] | None = None
        self._table = _RigTable(
            list(self._rig),
            list(self._rig.values()),
            grid,
            ground=_surface(ground, grid),
            masks=[given.get(name) for name in self._rig],
            exclude=self._options["exclude"],
            blend=blend,
            feather=feather,
        )

    @property
    def rig(self) -> Rig:
        """The cameras."""
        return self._rig

    @property
    def grid(self) -> BevGrid:
        """The grid of the cells."""
        return self._grid

    @property
    def ground(self) -> float | Plane | HeightMap | Bowl:
        """The road, as it was given."""
        return self._ground

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self._grid.shape

    @property
    def nbytes(self) -> int:
        """Bytes that tables and weights hold."""
        return self._table.nbytes

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Which cells a camera shows, (rows, columns) bool."""
        return self._table.mask()

    @property
    def source(self) -> NDArray[np.int16]:
        """The camera that counts most in each cell, (rows, columns) int16: its place in the rig, or -1 for none."""
        return self._table.source()

    def weights(self, name: str) -> NDArray[np.float32]:
        """Return the weight of a camera in each cell, (rows, columns) float32; those of all cameras sum to 1 or 0.

        Raises
        ------
        ArgumentError
            The name is none of the rig's.
        """
        check_names(self._rig, "name", names_of("name", [name]))
        return self._table.weights(list(self._rig).index(name))

    def warp(
        self,
        images: Images,
        *,
        interpolation: Literal["nearest", "bilinear", "cubic", "lanczos4", "area", "mode"] = "bilinear",
        gains: Mapping[str, ArrayLike] | None = None,
        missing: Missing | None = None,
        border_value: float | Sequence[float] = 0,
        out: Any = None,
        threads: int | None = None,
        layout: Literal["HWC", "CHW", "NHWC", "NCHW"] = "HWC",
    ) -> NDArray[Any]:
        """Make one bird's-eye view of the images of all cameras.

        Parameters
        ----------
        images : mapping of str to array, or sequence
            The cameras' images by their names, or in the rig's order; each as `Lut.warp` takes it, of its camera's
            size, all of one dtype and number of channels.
        interpolation : {"nearest", "bilinear", "cubic", "lanczos4", "area", "mode"}
            As for `Lut.warp`. Bilinear and area mix along seams; nearest and mode take the camera that counts most, so
            that ids stay what they are.
        gains : mapping of str to float or (channels,) array, optional
            Factors by which the images are multiplied; those of `gains`. A camera that is not in it is left as it is.
        missing : {"next", "border"}, optional
            What becomes of images that are None or not in the mapping, a dropped frame: "next" gives their cells to
            the next best camera that sees them, "border" the border value; by default they are refused. `without`
            returns the table that is then used, with its mask; it is made at the first such call.
        border_value : float or sequence of float
            What cells get that no camera shows; one, or one for each channel.
        out : array, optional
            Where to write; of the result's shape and dtype.
        threads : int, optional
            At most so many.
        layout : {"HWC", "CHW", "NHWC", "NCHW"}
            The order of the images' axes, and of the result's.

        Returns
        -------
        ndarray
            (rows, columns) or (rows, columns, channels), of the images' dtype; or `out`.

        Raises
        ------
        ImageError, DtypeError
            Images have other sizes than their cameras', or differ in dtype or channels.
        ArgumentError, ArgumentTypeError
            Images are missing or too many; another argument is wrong.
        """
        _check_missing(missing)
        if gains is not None:
            self._check_gains("gains", gains)
        given = self._by_name(images)
        dropped = [name for name in self._rig if given.get(name) is None]
        if dropped and missing is None:
            raise ArgumentError(
                f"images: expected one for each camera, got none for {', '.join(map(repr, dropped))}; "
                'missing="next" gives their cells to other cameras, missing="border" leaves them out'
            )
        if len(dropped) == len(self._rig):
            raise ArgumentError("images: expected one of at least one camera, got none; leave this moment out")
        if dropped:
            fewer = self.without(dropped, missing=missing or "next")
            known = None if gains is None else {name: gains[name] for name in gains if name not in dropped}
            return fewer.warp(
                {name: given[name] for name in fewer.rig},
                interpolation=interpolation,
                gains=known,
                border_value=border_value,
                out=out,
                threads=threads,
                layout=layout,
            )
        return self._table.warp(
            [given[name] for name in self._rig],
            interpolation=interpolation,
            gains=None if gains is None else self._gain_rows("gains", gains),
            border_value=border_value,
            out=out,
            threads=threads,
            layout=layout,
        )

    def warp_adjoint(
        self,
        grad: Any,
        *,
        interpolation: Literal["nearest", "bilinear", "area"] = "bilinear",
        threads: int | None = None,
        layout: Literal["HWC", "CHW", "NHWC", "NCHW"] = "HWC",
    ) -> dict[str, NDArray[Any]]:
        """Carry a value for each cell back to the pixels of all cameras: the transpose of `warp` without gains.

        What `Lut.warp_adjoint` is to one camera: the gradient of a loss goes back through it, and it splats a
        bird's-eye view into the images. Of a cell that several cameras show, each gets its weight's share; of nearest,
        the camera that is shown gets all. The first call turns the tables round, and keeps that.

        Parameters
        ----------
        grad : array
            (rows, columns) or (rows, columns, C) of `shape`, or what `layout` says; float32 or float64.
        interpolation : {"bilinear", "nearest", "area"}
            Of the warp whose transpose it is.
        threads : int, optional
            At most so many. The result does not depend on it.
        layout : {"HWC", "CHW", "NHWC", "NCHW"}
            The order of the axes of `grad`, and of the results'.

        Returns
        -------
        dict of str to ndarray
            For each camera an array of its images' size, of the grad's dtype.

        Raises
        ------
        ImageError, DtypeError, ArgumentError, ArgumentTypeError
            As for `Lut.warp_adjoint`.
        OutOfMemoryError
            There is not enough memory for the tables turned round.
        """
        found = self._table.warp_adjoint(grad, interpolation=interpolation, threads=threads, layout=layout)
        return dict(zip(self._rig, found, strict=True))

    def without(self, names: Iterable[str], *, missing: Missing = "next") -> RigLut:
        """Return the table for the other cameras, where images of some are missing.

        Parameters
        ----------
        names : iterable of str
            Cameras of the rig, not all of them.
        missing : {"next", "border"}
            Whether their cells go to the next best camera that sees them, or to nobody. What cameras see that were
            left out with "border" before stays nobody's.

        Raises
        ------
        ArgumentError
            A name is none of the rig's, or no camera is left; `missing` is something else.
        """
        dropped = frozenset(names_of("names", names))
        check_names(self._rig, "names", dropped)
        _check_missing(missing)
        missing = missing or "next"
        left = [name for name in self._rig if name not in dropped]
        if not left:
            raise ArgumentError("names: expected at least one camera whose image is there, got none")
        key: tuple[frozenset[str], Missing] = (dropped, missing)
        found = self._left_out.get(key)
        if found is None:
            found = self._without(left, missing)
            if len(self._left_out) >= 8:  # as many tables as frames drop together; a table may have 50 MB
                self._left_out.pop(next(iter(self._left_out)))
            self._left_out[key] = found
        return found

    def _without(self, left: list[str], missing: Missing) -> RigLut:
        if self._of is not None:  # from the whole rig, or what was dropped before would be forgotten
            whole, shown = self._of
            if missing == "border":
                return whole.without([name for name in whole._rig if name not in left], missing="border")
            others = whole.without([name for name in shown if name not in left], missing="next")
            return others.without([name for name in whole._rig if name not in shown], missing="border")
        masks = {name: mask for name, mask in self._options["masks"].items() if name in left}
        options = {**self._options, "masks": masks}
        rig = self._rig.subset(left)
        if missing == "next":
            return RigLut(rig, self._grid, ground=self._ground, **options)
        fewer = RigLut.__new__(RigLut)
        fewer._rig, fewer._grid, fewer._ground = rig, self._grid, self._ground
        fewer._options, fewer._left_out, fewer._of, fewer._pairs = options, {}, (self, left), None
        fewer._table = self._table.without([k for k, name in enumerate(self._rig) if name not in left])
        return fewer

    def gains(self, images: Images, previous: Mapping[str, ArrayLike] | None = None) -> dict[str, NDArray[np.float32]]:
        """Measure how bright the cameras are beside each other, from what two of them see of the same road.

        Gains are the least-squares solution for the medians of the ratios of all pairs in up to 4096 cells, of
        geometric mean 1 for each channel. Pairs whose ratios spread, because what they see is not on the road, count
        little; saturated samples and zeros do not count; a camera that shares nothing keeps 1.

        Parameters
        ----------
        images : mapping of str to array, or sequence
            As for `warp`, (H, W) or (H, W, C).
        previous : mapping of str to (channels,) array, optional
            The gains of the frame before: the result goes a tenth of the way from them to those of these images, so
            that nothing flickers.

        Returns
        -------
        dict of str to (channels,) float32
            The factors that `warp` takes.

        Raises
        ------
        ImageError, DtypeError, ArgumentError, ArgumentTypeError
            As for `warp`; all images are needed.
        """
        given = self._by_name(images)
        dropped = [name for name in self._rig if given.get(name) is None]
        if dropped:
            raise ArgumentError(f"images: expected one for each camera, got none for {', '.join(map(repr, dropped))}")
        rows = None if previous is None else self._gain_rows("previous", previous)
        found = self._table.gains([given[name] for name in self._rig], rows)
        return dict(zip(self._rig, found, strict=True))

    def agreement(self, images: Images, *, farthest: float = 0.5) -> dict[tuple[str, str], Agreement]:
        """Measure how alike each pair of cameras shows the road that both see: what a wrong extrinsic looks like.

        Where two cameras are posed right their pictures lie on each other: the shift is a small part of a cell, the
        correlation high. What stands on the road, and a road that is not flat, move pictures too.

        Parameters
        ----------
        images : mapping of str to array, or sequence
            As for `warp`, (H, W) or (H, W, C); pairs of which one is missing are left out.
        farthest : float
            The largest shift that is looked for, metres along x and along y. Pictures are compared in cells of a tenth
            of it, or the grid's if those are larger.

        Returns
        -------
        dict of (str, str) to Agreement
            For each pair that shares at least 64 cells that both resolve: difference, correlation, best shift.

        Raises
        ------
        ImageError, DtypeError, ArgumentError, ArgumentTypeError
            As for `warp`; `farthest` is no number above 0.
        """
        given = self._by_name(images)
        reach = number_of("farthest", farthest)
        if not 0 < reach <= 100:
            raise ArgumentError(f"farthest: expected metres above 0, up to 100, got {reach:g}")
        if self._pairs is None or self._pairs[0] != reach:
            seen = {name: self._table.seen(place) for place, name in enumerate(self._rig)}
            surface = _surface(self._ground, self._grid)
            self._pairs = reach, pair_views(self._rig, seen, self._grid, surface, reach)
        there = {name: image for name, image in given.items() if image is not None}
        return {
            pair: view.compare((there[pair[0]], there[pair[1]]))
            for pair, view in self._pairs[1].items()
            if pair[0] in there and pair[1] in there
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all that the table is built from as one file, whole or not at all; `load` gives an equal one.

        Raises
        ------
        FileError
            The file cannot be written.
        ArgumentTypeError
            `path` is no path.
        """
        from ipm_rs.files.atomic import as_path
        from ipm_rs.files.luts import rigs

        whole, left = self._of if self._of is not None else (self, list(self._rig))
        dropped = [name for name in whole._rig if name not in left]
        rigs.save(whole, whole._options, dropped, as_path(path))

    @staticmethod
    def load(path: str | os.PathLike[str]) -> RigLut:
        """Read what `save` wrote; the table is built again.

        Raises
        ------
        MissingFileError, FileError
            The file cannot be read.
        LutError
            It is none of a `RigLut`, or damaged.
        """
        from ipm_rs.files.atomic import as_path, check_source, reading
        from ipm_rs.files.luts import rigs

        name = as_path(path)
        check_source(name, "a table", "name the file that RigLut.save wrote")
        with reading(name, "a table"), name.open("rb") as file:
            return rigs.load(name, file)

    def _by_name(self, images: Images) -> dict[str, Any]:
        if isinstance(images, Mapping):
            check_names(self._rig, "images", images)
            return dict(images)
        if isinstance(images, np.ndarray) or not isinstance(images, Sequence) or isinstance(images, (str, bytes)):
            raise ArgumentTypeError(
                f"images: expected a mapping of names to images, or a list of them, got {type(images).__name__}; "
                f"write {{{next(iter(self._rig))!r}: image, ...}}"
            )
        if len(images) != len(self._rig):
            raise ArgumentError(
                f"images: expected {len(self._rig)}, one for each of {list(self._rig)}, got {len(images)}; "
                "give None for one that is missing"
            )
        return dict(zip(self._rig, images, strict=True))

    def _check_gains(self, what: str, gains: Any) -> None:
        if not isinstance(gains, Mapping):
            raise ArgumentTypeError(f"{what}: expected a mapping of names to factors, got {type(gains).__name__}")
        check_names(self._rig, what, gains)

    def _gain_rows(self, what: str, gains: Mapping[str, ArrayLike]) -> NDArray[np.float64]:
        """One row for each camera, of one number or of one for each channel."""
        self._check_gains(what, gains)
        arrays = [array_of(f"{what}[{name!r}]", gains.get(name, 1.0)) for name in self._rig]
        for name, row in zip(self._rig, arrays, strict=True):
            if row.dtype.kind in "cmM":  # NumPy makes numbers of them, and drops what else they say
                raise ArgumentTypeError(f"{what}[{name!r}]: expected real factors, got {row.dtype}; pass floats")
        try:
            rows = [np.atleast_1d(row.astype(float)) for row in arrays]
            return np.stack(np.broadcast_arrays(*rows)).reshape(len(rows), -1)
        except (TypeError, ValueError, OverflowError) as error:
            raise ArgumentError(
                f"{what}: expected a factor for each camera, or one for each of its channels ({error})"[:300]
            ) from error

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, RigLut):
            return NotImplemented
        return self._rig == other._rig and self._grid == other._grid and self._table == other._table

    def __hash__(self) -> int:
        return hash((self._rig, self._grid))

    def __reduce__(self) -> tuple[Any, ...]:
        if self._of is not None:
            whole, left = self._of
            return _rebuilt_without, (whole, [name for name in whole._rig if name not in left])
        return _rebuilt, (self._rig, self._grid, self._ground, self._options)

    def _repr_html_(self) -> str:
        from ipm_rs._notebook import html_of, mask_picture

        return html_of(lambda: repr(self), lambda: mask_picture(self.mask, self.mask))

    def __repr__(self) -> str:
        rows, columns = self.shape
        megabytes = self.nbytes / 1e6
        return f"RigLut({rows} rows x {columns} columns of {len(self._rig)} cameras, {megabytes:.2f} MB)"


def _surface(ground: float | Plane | HeightMap | Bowl, grid: BevGrid) -> float | Plane | HeightMap:
    """Return the road as the core knows it."""
    return ground.height_map(grid) if isinstance(ground, Bowl) else ground


def _check_missing(missing: Any) -> None:
    if missing is not None and (not isinstance(missing, str) or missing not in ("next", "border")):
        got = repr(missing) if isinstance(missing, str) else type(missing).__name__
        raise ArgumentError(f'missing: expected "next" or "border", got {got:.60}')


def _rebuilt(rig: Rig, grid: BevGrid, ground: Any, options: dict[str, Any]) -> RigLut:
    return RigLut(rig, grid, ground=ground, **options)


def _rebuilt_without(whole: RigLut, dropped: list[str]) -> RigLut:
    return whole.without(dropped, missing="border")
