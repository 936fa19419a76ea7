"""What all drawings share: colours, text, and where ticks stand."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

Colour = str | tuple[int, int, int]

PAPER, INK, MUTED, RULE, ACCENT = "#fbfbf9", "#1c232b", "#5d6873", "#d5dade", "#e8590c"
UNSEEN, HATCH = (233, 236, 239), (216, 221, 225)
"""Of cells that no camera sees: the ground of the hatching, and its stripes."""

METRES, HORIZON = "#ffd43b", "#4dd2ff"
"""Of lines at whole metres on a photo, and of its horizon."""


def text(
    draw: ImageDraw,
    position: tuple[float, float],
    words: str,
    size: float,
    fill: Colour | int = INK,
    anchor: str = "ls",
    halo: Colour | None = None,
) -> None:
    """Write at a position, that of the anchor as Pillow names it; with a halo it can be read on any photo."""
    from PIL import ImageFont

    stroke = 0 if halo is None else max(1, round(size / 9))
    font = ImageFont.load_default(size)
    draw.text(position, words, fill=fill, font=font, anchor=anchor, stroke_width=stroke, stroke_fill=halo)


def width_of(words: str, size: float) -> float:
    """Return how wide a line of text is, pixels."""
    from PIL import ImageFont

    return float(ImageFont.load_default(size).getlength(words))


def upright(words: str, size: float) -> Image:
    """Return a line of text that reads from the bottom to the top, as a mask."""
    from PIL import Image, ImageDraw

    label = Image.new("L", (math.ceil(width_of(words, size)) + 2, math.ceil(1.4 * size)))
    text(ImageDraw.Draw(label), (label.width / 2, label.height / 2), words, size, 255, anchor="mm")
    return label.rotate(90, expand=True)


def ticks(low: float, high: float, step: float = 5.0) -> list[float]:
    """Return the multiples of a step between two numbers, both included."""
    return [step * k for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def nice_step(metres: float, most: float) -> float:
    """Return the least of 1, 2 or 5 times a power of ten that divides a length into at most so many parts."""
    least = metres / max(most, 1.0)
    power: float = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-9))


def tick_label(value: float) -> str:
    """Return what stands beside a tick: no digits that rounding left, no minus before a zero."""
    return f"{round(value, 9) + 0.0:g}"
