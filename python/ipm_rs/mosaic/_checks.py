"""Arguments of mosaics, checked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ipm_rs._arguments import array_of, number_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError, GridError, IpmError

__all__ = ["bool_of", "dtype_of", "each_of", "overlap", "range_of", "whole_of"]


def overlap(index: int, side: int, first: int, end: int) -> tuple[slice, slice]:
    """Return the rows of a tile and those of a window where both have the same cells; both begin at the far end."""
    low, high = max(first, index * side), min(end, (index + 1) * side)
    top = (index + 1) * side
    return slice(top - high, top - low), slice(end - high, end - low)


def range_of(name: str, given: Any, resolution: float) -> tuple[int, int] | None:
    if given is None:
        return None
    values = array_of(name, given)
    if values.shape != (2,) or values.dtype.kind not in "iuf":
        raise ArgumentTypeError(f"{name}: expected (min, max) in metres, got {values.dtype} of shape {values.shape}")
    low, high = (number_of(name, value, low=-1e9, high=1e9, what=" of metres") for value in values)
    first, end = round(low / resolution), round(high / resolution)
    if max(abs(first - low / resolution), abs(end - high / resolution)) > 1e-4 or first >= end:
        raise GridError(
            f"{name}: expected whole cells of {resolution:g} m of the map, from low to high, got ({low:.12g}, "
            f"{high:.12g}); the nearest is ({first * resolution:.12g}, {max(end, first + 1) * resolution:.12g})"
        )
    return first, end


def whole_of(name: str, value: Any, low: int, high: int) -> int:
    number = number_of(name, value, low=low - 1, high=high + 1)
    if number != round(number) or isinstance(value, bool):
        raise ArgumentError(f"{name}: expected a whole number from {low} to {high}, got {number:g}")
    return round(number)


def bool_of(name: str, value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise ArgumentTypeError(f"{name}: expected True or False, got {type(value).__name__}")
    return bool(value)


def dtype_of(value: Any) -> np.dtype[Any]:
    try:
        dtype = np.dtype(value)
    except MemoryError:
        raise
    except Exception as error:
        raise ArgumentTypeError(f"dtype: expected uint8 or uint16, got {type(value).__name__}") from error
    if dtype not in (np.uint8, np.uint16):
        raise ArgumentError(f"dtype: expected uint8 or uint16, got {dtype}; scale the pictures to one of them")
    return dtype


def each_of(name: str, values: Any, *, again: bool = False) -> Iterator[Any]:
    """Yield the items of an iterable; with `again` it must be one that can be gone through several times.

    Raises
    ------
    ArgumentTypeError
        It is none, or raises what is no error of ours.
    """
    wanted = f"{name}: expected a list of (camera, image, map_from_vehicle)"
    try:
        items = iter(values)
        if again and items is values:
            raise ArgumentTypeError(f"{wanted}, got {type(values).__name__}; it is gone through several times")
        yield from items
    except (IpmError, MemoryError):
        raise
    except Exception as error:  # `__iter__` raises what it likes
        raise ArgumentTypeError(f"{wanted}, got {type(values).__name__} that cannot be gone through") from error
