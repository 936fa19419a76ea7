"""A dataset of Ray Data through a table: the images of a column, decoded where they are not yet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Lut
from ipm_rs.errors import ArgumentError, ArgumentTypeError, ImageError, IpmError
from ipm_rs.files import images
from ipm_rs.ray._cluster import pool, require_ray, resolved, share, whole
from ipm_rs.ray._places import place_of

if TYPE_CHECKING:
    from ray.data import Dataset

__all__ = ["Warp", "checked_options", "checked_table", "image_of", "refuse_labels", "warp"]

_BATCH = 16
"""Rows at a time: 16 frames of 2048 x 1024 are 100 MB, and of fewer the calls of Ray Data begin to be seen."""


class Warp:
    """What warps the images of a batch: for ``dataset.map_batches(Warp, fn_constructor_args=(reference,), ...)``.

    `warp` does that; use the class itself where the pool of actors, the resources or the batches are to be others. It
    is made once in each actor and keeps the table there.

    Parameters
    ----------
    lut : Lut or ObjectRef
        The table, or ``ray.put(lut)`` of it: put once, it is fetched once by each machine.
    column : str
        The images: arrays (H, W) or (H, W, C) as `ray.data.read_images` gives them, the bytes of image files, structs
        with such under ``bytes``, or paths and URIs of image files.
    output : str
        Where the views go; other columns stay as they are. The same as `column` takes the images' place.
    interpolation, border_value
        Of `Lut.warp`.
    encode : str, optional
        The bytes of ``".png"``, ``".jpg"``, ``".tif"`` or ``".bmp"`` files in place of arrays: a tenth of the bytes on
        the way to wherever the views are written.
    level : int
        Of PNG's compression, 0 to 9.
    threads : int
        Of a warp. 1, because the actors of a machine are enough work for its CPUs.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    """

    def __init__(
        self,
        lut: Any,
        column: str = "image",
        output: str = "bev",
        *,
        interpolation: Literal["nearest", "bilinear", "cubic", "lanczos4", "area", "mode"] = "bilinear",
        border_value: float | list[float] = 0,
        encode: str | None = None,
        level: int = 1,
        threads: int = 1,
    ) -> None:
        self.lut = checked_table(resolved(lut))
        self.column, self.output = _name("column", column), _name("output", output)
        self.options = checked_options(self.lut, interpolation, border_value, threads)
        if encode is not None and (not isinstance(encode, str) or encode not in images.FORMATS):
            raise ArgumentError(
                f"encode: expected {', '.join(images.FORMATS)}, or None for arrays, got another; choose one"
            )
        self.encode, self.level = encode, whole("level", level, 0, 9)

    def __call__(self, batch: dict[str, Any]) -> dict[str, Any]:
        """Warp a batch of columns.

        Raises
        ------
        ArgumentError
            There is no such column.
        ImageError, FileError, DtypeError
            An image does not fit the table or cannot be read; the message says which row of the batch.
        """
        if self.column not in batch:
            raise ArgumentError(
                f"column: expected one of {', '.join(map(str, batch))}, got {self.column}; name the one with the images"
            )
        views = [self._view(number, value) for number, value in enumerate(batch[self.column])]
        return {**batch, self.output: _column(views)}

    def _view(self, number: int, value: Any) -> Any:
        try:
            pixels, look = image_of(value)
            if look is not None:
                refuse_labels(look, self.options)
            view = self.lut.warp(pixels, **self.options)
            if self.encode is None:
                return view
            return images.encode(self.encode, view, look or images.Look("L"), self.level)
        except IpmError as error:
            raise type(error)(f"row {number} of a batch: {error}") from error


def warp(
    dataset: Dataset,
    lut: Lut,
    *,
    column: str = "image",
    output: str = "bev",
    workers: int | None = None,
    interpolation: Literal["nearest", "bilinear", "cubic", "lanczos4", "area", "mode"] = "bilinear",
    border_value: float | list[float] = 0,
    encode: str | None = None,
    level: int = 1,
    batch_size: int = _BATCH,
    **ray_options: Any,
) -> Dataset:
    """Return a dataset with the bird's-eye view of every image of a dataset.

    Nothing runs before the result is used: ``write_parquet``, ``write_images``, ``iter_batches``, another
    ``map_batches``. Then images stream through, as many at a time as there is memory for; the table goes to each
    machine once. A worker that dies is replaced and its batch warped again, with the same result.

    Parameters
    ----------
    dataset : ray.data.Dataset
        With images in one of its columns.
    lut : Lut
        The table.
    column : str
        The images: arrays, as `ray.data.read_images` gives them; the bytes of files, as `read_binary_files` gives them
        and Parquet files hold them, also as structs with such under ``bytes``; or paths and URIs, which the worker that
        warps opens itself, so that no picture travels from one machine to another.
    output : str
        The column of the views; the same as `column` takes the images' place.
    workers : int, optional
        Actors, each of half a CPU, or less where none would be left for reading. By default as many as there is work
        and room for, from 1 on: an autoscaling cluster grows.
    interpolation, border_value
        Of `Lut.warp`.
    encode : str, optional
        ``".png"``, ``".jpg"``, ``".tif"`` or ``".bmp"``: the bytes of such files in place of arrays.
    level : int
        Of PNG's compression, 0 to 9.
    batch_size : int
        Rows that an actor takes at a time.
    **ray_options
        Of `map_batches`: ``num_cpus=``, ``memory=``, ``resources=``, ``runtime_env=``, ...

    Returns
    -------
    ray.data.Dataset

    Raises
    ------
    MissingExtraError
        Ray is not installed.
    ArgumentError, ArgumentTypeError
        An argument is wrong.
    """
    ray = require_ray()
    if not isinstance(dataset, ray.data.Dataset):
        raise ArgumentTypeError(
            f"dataset: expected a ray.data.Dataset, got {type(dataset).__name__}; read one with "
            "ray.data.read_images(), or pass files to ipm_rs.ray.warp_files()"
        )
    options: dict[str, Any] = {
        "interpolation": interpolation,
        "border_value": border_value,
        "encode": encode,
        "level": level,
    }
    Warp(lut, column, output, **options)  # refuses here what every worker would refuse
    strategy = pool(ray, workers)
    ray_options.setdefault("num_cpus", share(ray, workers))
    return dataset.map_batches(
        Warp,
        fn_constructor_args=(ray.put(lut), column, output),
        fn_constructor_kwargs=options,
        compute=strategy,
        batch_size=whole("batch_size", batch_size, 1, 1_000_000),
        **ray_options,
    )


def checked_table(lut: Any) -> Lut:
    """Return a table, or raise ArgumentTypeError for anything else."""
    if not isinstance(lut, Lut):
        raise ArgumentTypeError(f"lut: expected a Lut, got {type(lut).__name__}; build one of a camera and a grid")
    return lut


def checked_options(lut: Lut, interpolation: Any, border_value: Any, threads: Any) -> dict[str, Any]:
    """Return the options of `Lut.warp`, tried on one pixel, so that they are refused before any work."""
    if isinstance(border_value, Iterable) and not isinstance(border_value, (str, bytes, Mapping)):
        border_value = list(border_value)
    options = {"interpolation": interpolation, "border_value": border_value, "threads": threads}
    channels = (len(border_value),) if isinstance(border_value, list) else ()
    one = Lut.from_maps(np.zeros((1, 1)), np.zeros((1, 1)), source_size=(1, 1))
    dtype = np.uint8 if interpolation == "mode" else np.float32
    one.warp(np.zeros((1, 1, *channels), dtype), **options)
    return options


def image_of(value: Any) -> tuple[NDArray[Any], images.Look | None]:
    """Return the pixels of a value of a column, and of a file how they were stored.

    Raises
    ------
    ArgumentTypeError
        It is no image.
    FileError, ImageError
        It is one that cannot be read.
    """
    if isinstance(value, Mapping):
        inner = value.get("bytes")
        value = value.get("path") if inner is None else inner
    if isinstance(value, (bytes, bytearray, memoryview)):
        return images.decode(bytes(value), "an image of the dataset")
    if isinstance(value, str):
        return images.decode(place_of("a path of the dataset", value).read(), value)
    if isinstance(value, np.ndarray):
        return value, None
    raise ArgumentTypeError(
        f"column: expected arrays, bytes of image files, or paths, got {type(value).__name__}; name another column"
    )


def refuse_labels(look: images.Look, options: dict[str, Any]) -> None:
    """Refuse a label image for an interpolation that would mix its values.

    Raises
    ------
    ImageError
    """
    if look.mode in ("P", "1") and options["interpolation"] not in ("nearest", "mode"):
        kind = "an image with a palette" if look.mode == "P" else "a 1-bit image"
        raise ImageError(
            f"expected interpolation nearest or mode for {kind}, got {options['interpolation']}, which would mix its "
            "values; choose one, or convert the image to RGB or grey"
        )


def _name(argument: str, value: Any) -> str:
    if not isinstance(value, str):
        raise ArgumentTypeError(f"{argument}: expected the name of a column, got {type(value).__name__}")
    return value


def _column(views: list[Any]) -> NDArray[Any]:
    """Return values as a column: a stack of arrays that are alike, else one object for each."""
    if views and isinstance(views[0], np.ndarray) and len({(view.shape, view.dtype) for view in views}) == 1:
        return np.stack(views)
    column = np.empty(len(views), object)
    for number, view in enumerate(views):
        column[number] = view
    return column
