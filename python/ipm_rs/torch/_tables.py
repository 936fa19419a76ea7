"""Tables by their names: operators of PyTorch take tensors, numbers and text, and so a table goes by its hash."""

from __future__ import annotations

import hashlib
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs import HeightMap, Lut, Plane
from ipm_rs.errors import ArgumentError, ArgumentTypeError
from ipm_rs.rig import Bowl, RigLut
from ipm_rs.torch._memory import ResultMemory

__all__ = ["Table", "luts_of", "table_named", "table_of"]


class Table:
    """A table and its name, by which operators find it as long as somebody holds it: a module, the graph of a loss."""

    def __init__(self, lut: Lut | RigLut, key: str) -> None:
        self.lut, self.key = lut, key
        self.memory = ResultMemory()
        self.shape: tuple[int, int] = lut.shape
        sizes = [camera.image_size for camera in lut.rig.values()] if isinstance(lut, RigLut) else [lut.source_size]
        #: (rows, columns) of the images of each camera
        self.sources: list[tuple[int, int]] = [(rows, columns) for columns, rows in sizes]

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """Be named again where the pickle is read."""
        return table_of, (self.lut,)


_TABLES: weakref.WeakValueDictionary[str, Table] = weakref.WeakValueDictionary()


def table_of(lut: Lut | RigLut) -> Table:
    """Return the table of that name, the same one for equal tables.

    Raises
    ------
    ArgumentTypeError
        It is neither a `Lut` nor a `RigLut`.
    """
    if not isinstance(lut, (Lut, RigLut)):
        raise ArgumentTypeError(f"lut: expected an ipm_rs.Lut or an ipm_rs.RigLut, got {type(lut).__name__}")
    digest = hashlib.sha256()
    if isinstance(lut, Lut):
        digest.update(_bytes_of(lut))
    else:
        for name, own in zip(lut.rig, luts_of(lut), strict=True):
            digest.update(name.encode())
            digest.update(_bytes_of(own))
            digest.update(lut.weights(name).tobytes())
    key = digest.hexdigest()
    found = _TABLES.get(key)
    if found is None:
        found = _TABLES[key] = Table(lut, key)
    return found


def table_named(key: str) -> Table:
    """Return the table of that name.

    Raises
    ------
    ArgumentError
        Nobody holds such a table in this process.
    """
    found = _TABLES.get(key)
    if found is None:
        raise ArgumentError(
            f"table: expected the name of a table that a Warp of this process holds, got {key[:12]}...; make or "
            "unpickle the Warp before its operators run"
        )
    return found


def luts_of(lut: Lut | RigLut) -> list[Lut]:
    """Return the table of each camera, whether or not others show its cells."""
    if isinstance(lut, Lut):
        return [lut]
    ground: float | Plane | HeightMap = lut.ground.height_map(lut.grid) if isinstance(lut.ground, Bowl) else lut.ground
    return [Lut(camera, lut.grid, ground=ground) for camera in lut.rig.values()]


def nearest_pixels(lut: Lut) -> NDArray[np.int64]:
    """Return for each cell the number of its nearest pixel, row by row; -1 where it has none."""
    width, height = lut.source_size
    numbers = np.arange(width * height, dtype=np.int64).reshape(height, width)
    return lut.warp(numbers, interpolation="nearest", border_value=-1)


def _bytes_of(lut: Lut) -> bytes:
    return lut.__reduce__()[1][0]
