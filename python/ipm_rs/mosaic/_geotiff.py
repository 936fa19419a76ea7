"""A mosaic as a cloud-optimised GeoTIFF, north up, in a coordinate system that others know (extra ``geo``)."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ArgumentError, FileError, IpmError, MissingExtraError
from ipm_rs.files.atomic import check_target
from ipm_rs.mosaic._tiles import TileKey

__all__ = ["metric_system", "write_geotiff"]

Read = Callable[[tuple[int, int], tuple[int, int]], tuple[NDArray[Any], NDArray[np.bool_]]]


_BLOCK = 1024
"""Cells along a side of what is read and written at once."""

_MOST_CELLS = 1 << 38
"""Cells of the rectangle around the map, which takes GDAL's overviews an hour although most of it is empty."""


def write_geotiff(
    path: Path,
    read: Read,
    bounds: tuple[tuple[int, int], tuple[int, int]],
    tiles: tuple[list[TileKey], int],
    *,
    resolution: float,
    channels: int,
    dtype: np.dtype[Any],
    crs: Any,
    origin: tuple[float, float],
    labels: bool,
) -> None:
    """Write block after block, so that memory stays bounded, and overviews; the file appears when it is whole.

    Blocks in which no one of the map's `tiles`, so many cells long, lies are left out of the file.
    The map's x is taken as east and its y as north, both from `origin`. Overviews never mix `labels`.
    """
    system = metric_system(crs)
    import rasterio
    import rasterio.shutil
    from rasterio.enums import ColorInterp
    from rasterio.windows import Window

    (first_x, end_x), (first_y, end_y) = bounds
    width, height = end_x - first_x, end_y - first_y
    if width * height > _MOST_CELLS:
        raise ArgumentError(
            f"mosaic: expected at most {_MOST_CELLS:.3g} cells around all tiles for a GeoTIFF, got {width} x {height}; "
            "leave out frames that lie far away, or use export_tiles"
        )
    check_target(path)
    # GDAL lays out a cloud-optimised file, overviews first, from a whole one
    temporary, laid_out = (path.with_name(f".{path.name}.{part}.tif") for part in ("part", "cog"))
    profile: dict[str, Any] = {
        "driver": "GTiff",
        "width": width,
        "height": height,
        "count": channels + 1,
        "dtype": dtype.name,
        "crs": system,
        "transform": rasterio.Affine(
            resolution, 0.0, origin[0] + first_x * resolution, 0.0, -resolution, origin[1] + end_y * resolution
        ),
        "tiled": True,
        "blockxsize": 256,
        "blockysize": 256,
        "compress": "deflate",
        "bigtiff": "if_safer",
        "sparse_ok": True,
    }
    try:
        try:
            with rasterio.open(temporary, "w", **profile) as file:
                colours = {1: ["gray"], 3: ["red", "green", "blue"]}.get(channels, ["undefined"] * channels)
                file.colorinterp = [ColorInterp[colour] for colour in [*colours, "alpha"]]
                sums = []
                for left, low in _blocks(bounds, tiles):
                    right, high = min(left + _BLOCK, end_x), min(low + _BLOCK, end_y)
                    values, mask = read((left, right), (low, high))
                    # x up and y left become east to the right and north up
                    values, mask = (np.swapaxes(layer[::-1], 0, 1) for layer in (values, mask))
                    bands = values[None] if values.ndim == 2 else np.moveaxis(values, 2, 0)
                    alpha = np.where(mask, np.iinfo(dtype).max, 0).astype(dtype)
                    window = Window(left - first_x, end_y - high, right - left, high - low)
                    whole = np.concatenate([bands, alpha[None]])
                    file.write(whole, window=window)
                    sums.append((window, zlib.crc32(whole.tobytes())))
            rasterio.shutil.copy(
                temporary,
                laid_out,
                driver="COG",
                blocksize=256,
                compress="deflate",
                overview_resampling="nearest" if labels else "average",
                bigtiff="if_safer",
                sparse_ok=True,
            )
            with rasterio.open(laid_out) as file:
                # a disk that gets full at the end makes GDAL say so to the log alone; overviews lie before this
                for window, known in sums:
                    if zlib.crc32(file.read(window=window).tobytes()) != known:
                        raise OSError("other pixels in the file than were written")
            laid_out.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
            laid_out.unlink(missing_ok=True)
    except IpmError:
        raise
    except Exception as error:
        # UnicodeError is of names, which GDAL takes in UTF-8; of GDAL's own errors rasterio keeps some private
        if not isinstance(error, (OSError, UnicodeError)) and not type(error).__module__.startswith("rasterio."):
            raise
        raise FileError(
            f"{path}: expected to write it, got: {error}; check the directory and the free space"
        ) from error


def metric_system(crs: Any) -> Any:
    """Return rasterio's coordinate system, whose axes are in metres, or raise ArgumentError or MissingExtraError."""
    try:
        from rasterio.crs import CRS
    except ImportError as error:
        raise MissingExtraError(
            'expected rasterio, which writes GeoTIFF, found none; install it with: pip install "ipm-rs[geo]"'
        ) from error
    try:
        system = CRS.from_user_input(crs)
    except (ValueError, TypeError) as error:  # CRSError is a ValueError
        raise ArgumentError('crs: expected a coordinate system such as "EPSG:32632", got none that is known') from error
    unit, metres = system.units_factor
    around_the_earth = system.is_geographic or system.to_wkt().startswith("GEOCCS")  # axes of a building are fine
    if not around_the_earth and abs(metres - 1) < 1e-9:
        return system
    got = "one of the whole Earth, such as longitude and latitude" if around_the_earth else f"one in {unit}"
    raise ArgumentError(
        'crs: expected a projected coordinate system in metres, such as "EPSG:32632" (UTM 32 north), got '
        f"{got}; take the UTM zone of the place, and an `origin` in it"
    )


def _blocks(bounds: tuple[tuple[int, int], tuple[int, int]], tiles: tuple[list[TileKey], int]) -> list[tuple[int, int]]:
    """Return where the blocks begin in which a tile lies."""
    (first_x, _), (first_y, _), (keys, side) = *bounds, tiles
    found = set()
    for key in keys:
        rows, columns = (
            range((index * side - first) // _BLOCK, ((index + 1) * side - 1 - first) // _BLOCK + 1)
            for index, first in zip(key, (first_x, first_y), strict=True)
        )
        found |= {(first_x + row * _BLOCK, first_y + column * _BLOCK) for row in rows for column in columns}
    return sorted(found)
