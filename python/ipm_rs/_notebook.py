"""What notebooks show of our objects: a line or two of text, and a small picture where Pillow is there.

A notebook asks `_repr_html_` of whatever stands last in a cell; an exception there would hide the object behind a
traceback, so nothing here raises.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["attach", "html_of"]

_WIDEST = 900
_SMALL = 320


def html_of(words: Callable[[], str], draw: Callable[[], Image | None] | None = None, *, widest: int = _WIDEST) -> str:
    """Return text as HTML, with what is drawn below it if it can be drawn."""
    try:
        text = words()
    except Exception:  # an object that somebody has filled with what cannot be printed
        text = "(cannot be shown)"
    import html  # with the others, when a notebook asks: `import ipm_rs` is not to wait for them

    shown = f"<pre>{html.escape(text)}</pre>"
    if draw is None:
        return shown
    try:
        import base64
        import io

        picture = draw()
        if picture is None:
            return shown
        if picture.width > widest:
            picture = picture.resize((widest, max(1, round(picture.height * widest / picture.width))))
        file = io.BytesIO()
        picture.save(file, "PNG")
    except Exception:  # no Pillow, no memory, a folder of fonts that is gone: the text is there all the same
        return shown
    data = base64.b64encode(file.getvalue()).decode("ascii")
    return f'{shown}<img src="data:image/png;base64,{data}" alt="{html.escape(text[:80], quote=True)}">'


def attach() -> None:
    """Give the compiled classes their `_repr_html_`."""
    from ipm_rs._core import BevGrid, Camera, Lut

    for kind, draw in ((Camera, _camera), (BevGrid, None), (Lut, _lut)):
        setattr(kind, "_repr_html_", _shown(draw))  # noqa: B010, the stub does not know it


def _shown(draw: Callable[[Any], Image | None] | None) -> Callable[[Any], str]:
    def _repr_html_(self: Any) -> str:
        return html_of(lambda: repr(self), None if draw is None else lambda: draw(self), widest=_SMALL)

    return _repr_html_


def _camera(camera: Any) -> Image | None:
    """Draw what the camera would see of a level road: its horizon and metres up to 50 m around."""
    from ipm_rs import draw

    width, height = camera.image_size
    times = min(1.0, _SMALL / max(width, height))
    small = camera.resized(max(1, round(width * times)), max(1, round(height * times)))
    x, y, z = (float(value) for value in small.position)
    if not 0.05 < z < 50:
        return None
    from ipm_rs._core import BevGrid

    grid = BevGrid(x=(round(x) - 50, round(x) + 50), y=(round(y) - 50, round(y) + 50), resolution=1.0)
    canvas = np.full((small.image_size[1], small.image_size[0]), 110, np.uint8)
    return draw.overlay(canvas, small, grid, spacing=10, outline=False, labels=False)


def _lut(lut: Any) -> Image | None:
    return mask_picture(lut.mask, lut.resolved_mask())


def mask_picture(seen: Any, resolved: Any) -> Image | None:
    """Draw which cells are seen, green, and resolved, dark green."""
    from PIL import Image

    step = max(1, max(seen.shape) // _SMALL)
    seen, resolved = seen[::step, ::step], resolved[::step, ::step]
    colours = np.full((*seen.shape, 3), 233, np.uint8)
    colours[seen], colours[resolved] = (208, 224, 160), (124, 179, 110)
    return Image.fromarray(colours)


def cloud_picture(points: Any) -> Image | None:
    """Draw how many points there are from above, x up, y to the left."""
    from ipm_rs import draw

    xy = np.asarray(points)[:, :2]
    xy = xy[np.isfinite(xy).all(axis=1)]
    if not len(xy):
        return None
    low, high = np.percentile(xy, (1, 99), axis=0)
    size = float(max(*(high - low), 1e-6))
    edges = [np.linspace(middle - size / 2, middle + size / 2, 201) for middle in (low + high) / 2]
    counts, _, _ = np.histogram2d(xy[:, 0], xy[:, 1], bins=edges)
    return draw.to_image(np.log1p(counts)[::-1, ::-1])


def layer_picture(layer: Any) -> Image | None:
    """Draw a layer of numbers, stretched."""
    from ipm_rs import draw

    step = max(1, max(layer.shape[:2]) // _SMALL)
    return draw.to_image(layer[::step, ::step])
