"""Tables as files of other programs: maps for ``cv2.remap`` and its like, in float32 pixels of the source image.

Cells without an image get -9 in every format: a pixel that no image has, so that a constant border gives its value
there, whichever program samples.
"""

from __future__ import annotations

import io
import re
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Lut
from ipm_rs.errors import ArgumentError, FileError, LutError
from ipm_rs.files.atomic import atomically, reading
from ipm_rs.files.luts import storage

__all__ = ["WRITERS", "read_npz", "read_storage"]

_OUTSIDE = -9.0
_MOST_BYTES = 1 << 32


def _write_opencv(lut: Lut, path: Path) -> None:
    map_x, map_y = lut.maps(outside=_OUTSIDE)
    storage.write(path, {**_size(lut), "map_x": map_x, "map_y": map_y})


def _write_lanenet(lut: Lut, path: Path) -> None:
    map_x, map_y = lut.maps(outside=_OUTSIDE)
    storage.write(path, {**_size(lut), "remap_ipm_x": map_x, "remap_ipm_y": map_y})


def _write_cv16sc2(lut: Lut, path: Path) -> None:
    """Write what ``cv2.convertMaps(map_x, map_y, cv2.CV_16SC2)`` gives: whole pixels, and 1/32 of them in a table."""
    if max(lut.source_size) > 32_000:
        raise LutError(
            f"{path}: expected images of at most 32000 pixels a side for 16-bit maps, got {lut.source_size}; "
            'export format="opencv"'
        )
    fixed = [np.rint(one * np.float32(32)).astype(np.int32) for one in lut.maps(outside=_OUTSIDE)]
    whole = np.stack([one >> 5 for one in fixed], axis=-1).astype(np.int16)
    table = ((fixed[1] & 31) * 32 + (fixed[0] & 31)).astype(np.uint16)
    storage.write(path, {**_size(lut), "map1": whole, "map2": table})


def _write_npz(lut: Lut, path: Path) -> None:
    map_x, map_y = lut.maps(outside=_OUTSIDE)
    with atomically(path) as file:
        np.savez_compressed(file, map_x=map_x, map_y=map_y, mask=lut.mask, source_size=np.array(lut.source_size))


def _write_torch_grid(lut: Lut, path: Path) -> None:
    """Write the grid of ``torch.nn.functional.grid_sample(..., align_corners=True)``: (1, rows, columns, 2) float32."""
    if min(lut.source_size) < 2:
        raise LutError(f"{path}: expected images of at least 2 x 2 pixels for grid_sample, got {lut.source_size}")
    maps = lut.maps(outside=_OUTSIDE)
    grid = np.stack([2 * one / np.float32(size - 1) - 1 for one, size in zip(maps, lut.source_size, strict=True)], -1)
    with atomically(path) as file:
        np.save(file, grid[None].astype(np.float32))


def _write_c_header(lut: Lut, path: Path) -> None:
    """Write the maps as C arrays of floats, with their sizes as macros."""
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    name = f"lut_{name}" if not name[:1].isalpha() else name
    (rows, columns), (width, height) = lut.shape, lut.source_size
    sizes = {"ROWS": rows, "COLUMNS": columns, "SOURCE_WIDTH": width, "SOURCE_HEIGHT": height}
    with atomically(path) as file:
        guard = f"{name.upper()}_H"
        file.write(
            f"/* Written by ipm_rs: source pixels of each cell, row by row; {_OUTSIDE} where none. */\n".encode()
        )
        file.write(f"#ifndef {guard}\n#define {guard}\n\n".encode())
        for word, number in sizes.items():
            file.write(f"#define {name.upper()}_{word} {number}\n".encode())
        for suffix, values in zip("xy", lut.maps(outside=_OUTSIDE), strict=True):
            file.write(f"\nstatic const float {name}_map_{suffix}[{rows * columns}] = {{\n".encode())
            # C has no float literal without a point or an exponent
            texts = (text if "." in text or "e" in text else f"{text}." for text in storage.number_texts(values))
            file.write(",\n".join(storage.lines_of(f"{text}f" for text in texts)).encode())
            file.write(b"};\n")
        file.write(b"\n#endif\n")


WRITERS: dict[str, Callable[[Lut, Path], None]] = {
    "opencv": _write_opencv,
    "lanenet": _write_lanenet,
    "cv16sc2": _write_cv16sc2,
    "npz": _write_npz,
    "torch_grid": _write_torch_grid,
    "c_header": _write_c_header,
}


def read_storage(path: Path, data: bytes, source_size: Any) -> Lut:
    """Read a FileStorage file with ``map_x, map_y`` or LaneNet's ``remap_ipm_x, remap_ipm_y``.

    Raises
    ------
    LutError
        It holds no such pair, or its matrices are not what they say.
    ArgumentError
        It does not say what images it is for, and `source_size` is not given.
    """
    values = storage.read(path, data)
    for names in (("map_x", "map_y"), ("remap_ipm_x", "remap_ipm_y"), ("map1", "map2")):
        pair = [one for one in map(values.get, names) if isinstance(one, np.ndarray)]
        if len(pair) == 2:
            break
    else:
        found = ", ".join(values)[:200] or "nothing"
        raise LutError(f"{path}: expected matrices map_x and map_y, or remap_ipm_x and remap_ipm_y, got {found}")
    if any(one.dtype.kind != "f" or one.ndim != 2 for one in pair):
        raise LutError(
            f"{path}: expected maps of floats, got {', '.join(f'{one.dtype} {one.shape}' for one in pair)}; maps of "
            'whole pixels and tables hold 1/32 of a pixel only: export format="opencv"'
        )
    size = (values.get("source_width"), values.get("source_height"))
    return _of_maps(path, pair[0], pair[1], None if None in size else size, source_size)


def read_npz(path: Path, data: bytes, source_size: Any) -> Lut:
    """Read an ``.npz`` with ``map_x`` and ``map_y``; raises as `read_storage` does."""
    with reading(path, "an .npz with map_x and map_y"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what NumPy says of odd headers
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(member.file_size for member in archive.infolist()) > _MOST_BYTES:
                raise FileError(f"{path}: expected maps, got arrays that claim more than 4 GB; fetch it again")
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            if not {"map_x", "map_y"} <= set(arrays.files):
                raise LutError(f"{path}: expected arrays map_x and map_y, got {', '.join(arrays.files)[:200]}")
            map_x, map_y = arrays["map_x"], arrays["map_y"]
            size = arrays["source_size"].tolist() if "source_size" in arrays.files else None
    return _of_maps(path, map_x, map_y, size, source_size)


def _of_maps(path: Path, map_x: NDArray[Any], map_y: NDArray[Any], own: Any, given: Any) -> Lut:
    if own is None and given is None:
        raise ArgumentError(
            f"{path}: expected the size of the images that the maps are for, got none, and the file does not say it; "
            "give source_size=(width, height)"
        )
    try:
        return Lut.from_maps(map_x, map_y, source_size=own if given is None else given)
    except (ValueError, TypeError) as error:
        raise LutError(f"{path}: {error}") from error


def _size(lut: Lut) -> dict[str, int]:
    width, height = lut.source_size
    return {"source_width": width, "source_height": height}
