"""`Layers`: what `rasterize` returns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

__all__ = ["Layers"]


class Layers(dict[str, NDArray[Any]]):
    """The layers of a cloud by their names, and what became of its points.

    Parameters
    ----------
    layers : mapping
        Arrays by name.
    inside, outside, ignored : int
        See the attributes.

    Attributes
    ----------
    inside : int
        Points that found a cell.
    outside : int
        Finite points beyond the grid, or in none of the slices.
    ignored : int
        Points with a coordinate that is NaN or infinite, and points on the grid with such a value.
    """

    def __init__(self, layers: Mapping[str, NDArray[Any]], inside: int, outside: int, ignored: int) -> None:
        super().__init__(layers)
        self.inside = inside
        self.outside = outside
        self.ignored = ignored

    def _repr_html_(self) -> str:
        from ipm_rs._notebook import html_of, layer_picture

        return html_of(self._words, lambda: layer_picture(next(iter(self.values()))))

    def _words(self) -> str:
        layers = ", ".join(f"{name} {'x'.join(map(str, layer.shape))} {layer.dtype}" for name, layer in self.items())
        return f"Layers({layers}); {self.inside} points inside, {self.outside} outside, {self.ignored} ignored"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self), self.inside, self.outside, self.ignored)
