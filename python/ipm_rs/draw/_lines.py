"""Lines that are seen on any picture."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from ipm_rs.draw import _style as style

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.ImageDraw import ImageDraw

__all__ = ["polylines"]


def polylines(draw: ImageDraw, pieces: Iterable[NDArray[Any]], colour: style.Colour, width: float) -> None:
    """Draw polylines of pixels with a dark rim, so that they are seen on a bright road and on a dark one."""
    # Pillow cuts fractions off, which would move a line by half a pixel: here a whole number is a pixel's centre
    flat = [[(round(u), round(v)) for u, v in piece.tolist()] for piece in pieces]
    thick = max(1, round(width))
    for points in flat:
        draw.line(points, fill="#101418", width=thick + 2 * max(1, round(width / 3)), joint="curve")
    for points in flat:
        draw.line(points, fill=colour, width=thick, joint="curve")
