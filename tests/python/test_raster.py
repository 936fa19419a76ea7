"""`rasterize` against the NumPy reference, at the edges, and over threads."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import same

import ipm_rs
from ipm_rs import reference

ALL = ("count", "density", "min", "max", "mean", "last", "top")
X, Y, RESOLUTION = (0.0, 30.0), (-10.0, 10.0), (0.5, 0.25)
GRID = ipm_rs.BevGrid(x=X, y=Y, resolution=RESOLUTION)


def cloud(count: int, dtype: str = "float32", columns: int = 4, seed: int = 0) -> np.ndarray:
    """Seeded points, a quarter of them beyond the grid of this module, some on its cell edges, some not finite."""
    random = np.random.default_rng(seed)
    points = random.uniform(-4, 34, (count, columns)) - [0, 15, 0, 0, 0, 0][:columns]
    points[:, 2] = np.round(random.normal(0, 1, count), 1)  # so that there are ties
    points[::7, 0] = np.round(points[::7, 0] * 2) / 2
    points[::11, 1] = np.round(points[::11, 1] * 4) / 4
    bad = random.integers(0, count, max(count // 50, 3))
    points[bad, random.integers(0, 3, len(bad))] = random.choice([np.nan, np.inf, -np.inf], len(bad))
    return points.astype(dtype)


def agree(layers: ipm_rs.Layers, expected: dict[str, np.ndarray]) -> None:
    """Counts, extrema and single values exactly, means to 1e-6, density to one float32 step."""
    assert list(layers) == list(expected)
    for name, layer in layers.items():
        truth = expected[name]
        assert (layer.shape, layer.dtype) == (truth.shape, truth.dtype), name
        if name == "mean":
            np.testing.assert_allclose(layer, truth, rtol=1e-6, atol=1e-6)
        elif name == "density":
            np.testing.assert_allclose(layer, truth, rtol=2e-7)
        else:
            np.testing.assert_array_equal(layer, truth, err_msg=name)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("columns", [3, 4, 5, 6])
def test_equals_the_reference(dtype, columns):
    points = cloud(20_000, dtype, columns)
    layers = ipm_rs.rasterize(points, GRID, reduce=ALL)
    agree(layers, reference.rasterize(points, X, Y, RESOLUTION, reduce=ALL))
    assert layers["max"].dtype == dtype
    assert layers.inside == layers["count"].sum() > 5000
    assert layers.ignored == (~np.isfinite(points[:, :3]).all(axis=1)).sum() > 300
    assert layers.inside + layers.outside + layers.ignored == len(points)
    assert np.isnan(layers["max"]).sum() == np.isnan(layers["mean"]).sum() == (layers["count"] == 0).sum() > 0


@pytest.mark.parametrize("threads", [2, 3, 8])
@pytest.mark.parametrize("count", [100_000, 700_000])
def test_the_threads_change_nothing(count, threads):
    points = cloud(count)
    points[: count // 3, :2] = [7.1, 2.2]  # a crowd in one cell: the order of its sum shows
    one = ipm_rs.rasterize(points, GRID, reduce=ALL, threads=1)
    many = ipm_rs.rasterize(points, GRID, reduce=ALL, threads=threads)
    assert all(same(one[name], many[name]) for name in ALL)
    assert (one.inside, one.outside, one.ignored) == (many.inside, many.outside, many.ignored)
    channels = ipm_rs.rasterize(points, GRID, points[:, 1:], ALL, slices=(-1, 0, 1), threads=threads)
    again = ipm_rs.rasterize(points, GRID, points[:, 1:], ALL, slices=(-1, 0, 1), threads=1)
    assert all(same(channels[name], again[name]) for name in ALL)
