"""What is read from accumulators: pictures and layers of a window."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import check_word
from ipm_rs.errors import ArgumentError, MosaicError
from ipm_rs.mosaic._samples import robust, voted
from ipm_rs.mosaic._tiles import Arrays, Kind, Tile

__all__ = ["BLENDS", "LAYERS", "check_kept", "layer_names", "view_of"]


def _rounded(total: NDArray[np.uint64], by: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    by = np.maximum(by.astype(np.uint64), 1)[..., None]
    return ((total + by // 2) // by).astype(dtype)


def _weighted(arrays: Arrays) -> NDArray[Any]:
    return _rounded(arrays.totals, arrays.weights, arrays.bests.dtype)


def _mean(arrays: Arrays) -> NDArray[Any]:
    return _rounded(arrays.sums, arrays.counts, arrays.bests.dtype)


def _best(arrays: Arrays) -> NDArray[Any]:
    return arrays.bests.copy()


def _std(arrays: Arrays) -> NDArray[Any]:
    count = np.maximum(arrays.counts, 1).astype(np.float64)[..., None]
    mean = arrays.sums / count
    return np.sqrt(np.maximum(arrays.squares / count - mean * mean, 0.0)).astype(np.float32)


def _refined(arrays: Arrays) -> NDArray[Any]:
    return _weighted(arrays)  # where a tile has no refined picture


BLENDS: dict[str, Callable[[Arrays], NDArray[Any]]] = {
    "refined": _refined,
    "weighted": _weighted,
    "best": _best,
    "mean": _mean,
    "robust": lambda arrays: robust(arrays.keys, arrays.samples),
    "feathered": _best,  # and mixed along seams, for which neighbours are needed: see `Readable`
    "labels": lambda arrays: voted(arrays.keys, arrays.samples)[0],
}
LAYERS: dict[str, Callable[[Arrays], NDArray[Any]]] = {
    **BLENDS,
    "std": _std,
    "count": lambda arrays: arrays.counts.copy(),
    "density": lambda arrays: (arrays.resolutions / 4096).astype(np.float32),
    "mask": lambda arrays: arrays.counts > 0,
    "agreement": lambda arrays: voted(arrays.keys, arrays.samples)[1],
}
_OF_CELLS = {"count", "density", "mask", "agreement"}
_OF_SUMS = {"refined", "weighted", "mean", "std"}
_OF_SAMPLES = {"robust", "feathered"}
_OF_LABELS = {"labels", "agreement"}


def check_kept(wanted: list[str], kind: Kind) -> None:
    """Refuse layers of what the tiles do not keep."""
    for word in wanted:
        if word in _OF_LABELS and not kind.labels:
            raise MosaicError(f'mosaic: expected labels for "{word}", got pictures; make the map with labels=True')
        if kind.labels and word in _OF_SUMS | _OF_SAMPLES:
            raise MosaicError(f'mosaic: expected pictures for "{word}", got labels; choose "labels" or "best"')
        if word in _OF_SAMPLES and not kind.samples:
            raise MosaicError(f'mosaic: expected one that keeps samples for "{word}", got none; make it with samples=8')


def layer_names(name: str, wanted: list[str], known: dict[str, Any]) -> list[str]:
    """Return the names, or refuse one that no layer has."""
    for word in wanted:
        check_word(name, word)
        if word not in known:
            raise ArgumentError(f"{name}: expected {', '.join(known)}, got {word!r:.40}; choose one of them")
    return wanted


def view_of(name: str, tile: Tile, rows: slice, columns: slice) -> NDArray[Any]:
    """Return a layer of some cells of a tile; of one channel without an axis for it."""
    own = tile.refined if name == "refined" else None
    view = LAYERS[name](tile.arrays.part(rows, columns)) if own is None else own[rows, columns]
    return view[..., 0] if name not in _OF_CELLS and view.shape[2] == 1 else view
