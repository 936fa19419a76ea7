"""What several test modules share: scenes with texture, oracles that are not the package's, and `refuses`."""

from __future__ import annotations

import contextlib
import copy
import re
from collections.abc import Iterator

import numpy as np
import pytest


def textured(height: int, width: int, channels: int | None = None, dtype: str = "uint8", seed: int = 0) -> np.ndarray:
    """Seeded noise over the dtype's whole range: a wrong pixel anywhere shows."""
    random = np.random.default_rng(seed)
    shape = (height, width) if channels is None else (height, width, channels)
    kind = np.dtype(dtype)
    if kind.kind == "b":
        return random.integers(0, 2, shape).astype(bool)
    if kind.kind == "f":
        return (random.random(shape) * 200 - 100).astype(kind)
    limits = np.iinfo(kind)
    return random.integers(limits.min, limits.max, shape, dtype=kind, endpoint=True)


def double_loop(K, camera_from_vehicle, xs, ys, ground=0.0) -> tuple[np.ndarray, np.ndarray]:
    """Source pixel of every (x, y), the documents' way: one cell at a time, no culling."""
    map_x, map_y = np.zeros((len(xs), len(ys))), np.zeros((len(xs), len(ys)))
    P = np.asarray(K) @ np.asarray(camera_from_vehicle)[:3]
    for i, x in enumerate(xs):
        for j, y in enumerate(ys):
            u, v, w = P @ np.array([x, y, ground, 1.0])
            map_x[i, j], map_y[i, j] = u / w, v / w
    return map_x, map_y


def exact_bilinear(image, map_x, map_y, border_value=0.0) -> tuple[np.ndarray, np.ndarray]:
    """Unrounded float64 blend and the range of its four taps; coordinates must be finite."""
    image = np.asarray(image, dtype=np.float64)
    height, width = image.shape[:2]
    padded = np.empty((height + 2, width + 2, *image.shape[2:]))
    padded[...] = border_value
    padded[1:-1, 1:-1] = image
    inside = (map_x > -1) & (map_x < width) & (map_y > -1) & (map_y < height)
    x, y = np.where(inside, map_x, 0.0) + 1, np.where(inside, map_y, 0.0) + 1
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    x1, y1 = np.minimum(x0 + 1, width + 1), np.minimum(y0 + 1, height + 1)
    taps = np.stack([padded[y0, x0], padded[y0, x1], padded[y1, x0], padded[y1, x1]])
    a, b = x - x0, y - y0
    weights = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b])
    if image.ndim == 3:
        weights, inside = weights[..., np.newaxis], inside[..., np.newaxis]
    value = np.where(inside, (weights * taps).sum(axis=0), border_value)
    spread = np.where(inside, taps.max(axis=0) - taps.min(axis=0), 0.0)
    return value, spread


@contextlib.contextmanager
def refuses(error: type[Exception], *phrases: str, out: np.ndarray | None = None) -> Iterator[None]:
    """The body must raise `error`, name every phrase (any case), and leave `out` as it was, bit for bit."""
    assert phrases, "say what the message must name"
    before = None if out is None else copy.deepcopy(out).tobytes()
    with pytest.raises(error) as caught:
        yield
    message = str(caught.value)
    for phrase in phrases:
        assert re.search(re.escape(phrase), message, re.IGNORECASE), f"{phrase!r} is not in {message!r}"
    assert "Err(" not in message and "Some(" not in message, f"a debug dump is no message: {message}"
    if out is not None:
        assert out.tobytes() == before, "a refused call wrote to out"


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal shape, dtype and bytes."""
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()
