"""`rasterize` against the NumPy reference, at the edges, and over threads."""

from __future__ import annotations

import copy
import itertools
import pickle

import numpy as np
import pytest
from helpers import refuses, same
from hypothesis import given
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors, reference

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


@given(
    points=st.lists(st.tuples(*[st.integers(-8, 70).map(lambda i: i / 4)] * 3), min_size=0, max_size=60),
    channels=st.integers(0, 3),
    sliced=st.booleans(),
)
def test_whatever_points(points, channels, sliced):
    """Quarters of metres, so that cell edges, the grid's edges and equal heights are common."""
    points = np.array(points, dtype=np.float64).reshape(-1, 3)
    values = None if channels == 0 else np.arange(len(points) * channels, dtype=np.int16).reshape(-1, channels) % 7
    slices = (-1, 0, 2.5, 10) if sliced else None
    layers = ipm_rs.rasterize(points, GRID, values, ALL, slices=slices)
    agree(layers, reference.rasterize(points, X, Y, RESOLUTION, values, ALL, slices))


@pytest.mark.parametrize("kind", "bool uint8 int8 uint16 int16 int32 uint32 int64 uint64 float32 float64".split())
def test_values_of_every_dtype(kind):
    points = cloud(5000)
    values = (np.random.default_rng(1).random((5000, 2)) * 100).astype(kind)
    layers = ipm_rs.rasterize(points, GRID, values, ALL)
    agree(layers, reference.rasterize(points, X, Y, RESOLUTION, values.astype("u1") if kind == "bool" else values, ALL))
    wide = kind in ("int32", "uint32", "int64", "uint64", "float64")
    assert layers["last"].dtype == (np.float64 if wide else np.float32)


def test_values_that_are_not_finite_take_their_point_along():
    points = np.array([[1.1, 0.1, 5.0], [1.1, 0.1, 1.0], [99.0, 0.0, 0.0]], dtype=np.float32)
    values = np.array([[1.0, np.nan], [2.0, 3.0], [np.nan, np.nan]], dtype=np.float32)
    layers = ipm_rs.rasterize(points, GRID, values, ALL)
    assert (layers.inside, layers.outside, layers.ignored) == (1, 1, 1)
    row, column = np.argwhere(layers["count"])[0]
    assert layers["count"].sum() == 1
    assert layers["top"][row, column].tolist() == [2.0, 3.0], "the higher point is not there at all"


def test_strides_and_views_without_a_copy():
    base = cloud(4000, columns=6)
    for view in (
        base[::3],
        base[::-1],
        base[:, [5, 4, 3, 2, 1]],
        np.asfortranarray(base),
        base[:, ::-1][:, ::-1],
        base[1000:1001],
        base.reshape(40, 100, 6),
    ):
        flat = view.reshape(-1, view.shape[-1])
        values = view[..., 3:]
        layers = ipm_rs.rasterize(view, GRID, values, ALL)
        agree(layers, reference.rasterize(flat, X, Y, RESOLUTION, flat[:, 3:], ALL))
        one = ipm_rs.rasterize(view, GRID, view[..., 4], ALL)
        agree(one, reference.rasterize(flat, X, Y, RESOLUTION, flat[:, 4], ALL))
    frozen = base.copy()
    frozen.flags.writeable = False
    before = base.copy()
    ipm_rs.rasterize(frozen, GRID)
    assert same(frozen, before)


def test_lists_and_points_without_z():
    layers = ipm_rs.rasterize([[1.2, 0.3, 7.0]], GRID)
    assert layers["max"].max(initial=0, where=layers["count"] > 0) == 7
    flat = ipm_rs.rasterize(cloud(1000)[:, :2], GRID, reduce=("count", "density"))
    assert flat["count"].sum() == flat.inside > 0
    with refuses(errors.ArgumentError, "3 columns", "got 2"):
        ipm_rs.rasterize(cloud(10)[:, :2], GRID)
    with refuses(errors.ArgumentError, "3 columns"):
        ipm_rs.rasterize(cloud(10)[:, :2], GRID, reduce="count", slices=(0, 1))


# ---------------------------------------------------------------------------------------------------------------------
# Edges


@pytest.mark.parametrize("sample_at", ["center", "corner"])
def test_edges_of_cells_and_of_the_grid(sample_at):
    """The far and the left edge of a cell are its own, whatever the grid samples."""
    grid = ipm_rs.BevGrid(x=(0, 2), y=(-1, 1), resolution=(1, 0.5), sample_at=sample_at)

    def cell(x, y):
        found = np.argwhere(ipm_rs.rasterize(np.array([[x, y, 0.0]]), grid)["count"])
        return tuple(found[0].tolist()) if len(found) else None

    assert cell(2, 1) == (0, 0), "x_max and y_max are in"
    assert cell(1, 0.5) == (1, 1), "an edge between cells is the nearer one's far edge"
    assert cell(np.nextafter(1, 2), np.nextafter(0.5, 1)) == (0, 0)
    assert cell(0, 0) is None and cell(1, -1) is None, "x_min and y_min are out"
    assert cell(1e-9, -1 + 1e-9) == (1, 3)
    assert cell(np.nextafter(2, 3), 0) is None and cell(1, np.nextafter(1, 2)) is None


def test_near_edge_is_out_also_where_the_division_falls_short():
    grid = ipm_rs.BevGrid(x=(0.0, 0.3), y=(0.0, 0.3), resolution=0.1)
    assert np.floor((0.3 - 0.0) / 0.1) == 2, "the case: 0.3 / 0.1 is below 3"
    layers = ipm_rs.rasterize(np.array([[0.0, 0.1, 0.0], [0.1, 0.0, 0.0]]), grid)
    assert (layers.inside, layers.outside) == (0, 2)


def test_the_cell_is_where_the_grid_says():
    points = np.array([[12.3, -4.5, 1.0]])
    rc = GRID.cell_from_ground(points[:, :2])
    row, column = np.round(rc[0]).astype(int)
    assert ipm_rs.rasterize(points, GRID)["count"][row, column] == 1


def test_density():
    points = np.repeat([[1.1, 0.1, 0.0], [2.1, 0.1, 0.0], [3.1, 0.1, 0.0]], [1, 10, 5000], axis=0)
    density = ipm_rs.rasterize(points, GRID, reduce="density")["density"]
    assert sorted(density[density > 0].tolist()) == pytest.approx(
        [np.log(2) / np.log(64), np.log(11) / np.log(64), 1.0]
    )
    half = ipm_rs.rasterize(points, GRID, reduce="density", density_full=4096)["density"]
    assert sorted(half[half > 0].tolist())[:2] == pytest.approx([np.log(2) / np.log(4096), np.log(11) / np.log(4096)])
    assert (density == 0).sum() == density.size - 3


def test_slices_are_rasters_of_their_heights():
    points = cloud(30_000)
    edges = (-2.0, -0.5, 0.0, 1.5)
    layers = ipm_rs.rasterize(points, GRID, reduce=ALL, slices=edges)
    assert layers["max"].shape == (3, *GRID.shape)
    for s, (low, high) in enumerate(itertools.pairwise(edges)):
        alone = points[(points[:, 2] >= low) & (points[:, 2] < high)]
        agree(ipm_rs.rasterize(alone, GRID, reduce=ALL), {name: layer[s] for name, layer in layers.items()})


# ---------------------------------------------------------------------------------------------------------------------
# What is odd, and what is wrong


def test_empty_clouds():
    for shape in ((0, 3), (0, 7), (0, 5, 3), (5, 0, 3)):
        layers = ipm_rs.rasterize(np.empty(shape, np.float32), GRID, reduce=ALL)
        assert (layers["count"] == 0).all() and (layers["density"] == 0).all()
        assert all(np.isnan(layers[name]).all() for name in ("min", "max", "mean", "last", "top"))
        assert (layers.inside, layers.outside, layers.ignored) == (0, 0, 0)


def test_far_huge_and_infinite():
    huge = np.array([[1e308, -1e308, 0], [-1e308, 1e300, 0], [1e9, 0, 0], [1, 1, 1e308], [1, 1, 2e308]])
    layers = ipm_rs.rasterize(huge, GRID, reduce=ALL)
    assert (layers.inside, layers.outside, layers.ignored) == (1, 3, 1)
    assert np.nanmax(layers["max"]) == 1e308
    f32 = np.array([[3e38, 3e38, 3e38], [-3e38, 0, 0], [np.inf, 0, 0], [0, -np.inf, 0], [1, 1, np.nan]], np.float32)
    layers = ipm_rs.rasterize(f32, GRID, reduce=ALL)
    assert (layers.inside, layers.outside, layers.ignored) == (0, 2, 3)


@pytest.mark.slow
def test_a_hundred_million_points_of_one_place():
    """A broadcast array of 1.2 GB that is 12 bytes: read, not copied."""
    resource = pytest.importorskip("resource")
    points = np.broadcast_to(np.array([10.0, 1.0, 0.1], np.float32), (100_000_000, 3))
    small = ipm_rs.BevGrid(x=(0, 20), y=(-10, 10), resolution=1.0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    layers = ipm_rs.rasterize(points, small, points[:, 2], threads=2)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert layers["count"].max() == layers.inside == 100_000_000
    assert layers["mean"].max(initial=0, where=layers["count"] > 0) == pytest.approx(0.1)
    assert grown < 300_000, "kilobytes: 64 MiB of points at a time, and what the allocator keeps"


def test_more_points_than_can_be_counted():
    points = np.broadcast_to(np.zeros(3, np.float32), (2**31, 3))
    with refuses(errors.ArgumentError, "at most 2147483647", "got 2147483648"):
        ipm_rs.rasterize(points, GRID)


def test_more_cells_than_there_may_be():
    grid = ipm_rs.BevGrid(x=(0, 16384), y=(0, 16384), resolution=1.0)
    with refuses(errors.ArgumentError, "rasterize"):
        ipm_rs.rasterize(cloud(10), grid, slices=(0, 1, 2))


@pytest.mark.parametrize(
    ("error", "call", "phrases"),
    [
        (errors.DtypeError, lambda p: ipm_rs.rasterize(p.astype(int), GRID), ["float32 or float64", "int64", "astype"]),
        (errors.DtypeError, lambda p: ipm_rs.rasterize(p, GRID, p[:, 0].astype("f2")), ["values", "float16"]),
        (errors.DtypeError, lambda p: ipm_rs.rasterize(p, GRID, p[:, 0].astype(complex)), ["values", "complex"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p[:, 0], GRID), ["(N, 3)", "(9,)"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p[:, :1], GRID), ["(N, 3)", "(9, 1)"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p[None, None], GRID), ["(H, W, 3)", "(1, 1, 9, 4)"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, p[1:, 0]), ["values", "(9,)", "(8,)"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, p[:, :0]), ["values", "at least one"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, p[:, :, None]), ["values", "(9, 4, 1)"]),
        (errors.ArgumentTypeError, lambda p: ipm_rs.rasterize("cloud.bin", GRID), ["points", "str"]),
        (errors.ArgumentTypeError, lambda p: ipm_rs.rasterize(None, GRID), ["points", "NoneType"]),
        (errors.ArgumentTypeError, lambda p: ipm_rs.rasterize([[1, 2, "3"]], GRID), ["points"]),
        (errors.ArgumentTypeError, lambda p: ipm_rs.rasterize(p, (0, 1)), ["grid", "BevGrid", "tuple"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, reduce="median"), ["reduce", "median", '"mean"']),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, reduce=()), ["reduce", "none"]),
        (errors.ArgumentTypeError, lambda p: ipm_rs.rasterize(p, GRID, reduce=3), ["reduce", "int"]),
        (errors.ArgumentTypeError, lambda p: ipm_rs.rasterize(p, GRID, reduce=[b"max"]), ["reduce", "bytes"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, slices=(1,)), ["slices", "two"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, slices=()), ["slices"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, slices=(0, 2, 1)), ["slices", "ascending"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, slices=(0, np.inf)), ["slices", "finite"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, slices=((0, 1),)), ["slices", "shape (1, 2)"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, density_full=1), ["density_full", "above 1"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, density_full=np.nan), ["density_full"]),
        (errors.ArgumentTypeError, lambda p: ipm_rs.rasterize(p, GRID, density_full="x"), ["density_full", "str"]),
        (errors.ArgumentError, lambda p: ipm_rs.rasterize(p, GRID, threads=0), ["threads", "at least 1"]),
    ],
)
def test_mistakes(error, call, phrases):
    with refuses(error, *phrases):
        call(np.ones((9, 4), np.float32))


def test_gaps_that_no_stride_can_say():
    organised = cloud(48 * 2).reshape(6, 16, -1)[:, ::2][:, :5, :3]
    records = np.zeros(5, dtype=[("x", "f4"), ("y", "f4"), ("z", "f4"), ("label", "u1")])
    packed = np.ndarray((5, 3), np.float32, records, strides=(13, 4))
    packed[:] = cloud(5)[:, :3]
    for points in (organised, packed):
        got, expected = (ipm_rs.rasterize(each, GRID) for each in (points, points.copy()))
        assert all(same(got[name], expected[name]) for name in expected)


def test_layers_are_a_dict_that_remembers():
    layers = ipm_rs.rasterize(cloud(1000), GRID, reduce=("max", "count"))
    assert list(layers) == ["max", "count"] and isinstance(layers, dict)
    for again in (pickle.loads(pickle.dumps(layers)), copy.copy(layers), copy.deepcopy(layers)):
        assert (again.inside, again.outside, again.ignored) == (layers.inside, layers.outside, layers.ignored)
        assert same(again["max"], layers["max"])


# ---------------------------------------------------------------------------------------------------------------------
# Real sweeps


def test_kitti_and_nuscenes(shared_data):
    grid = ipm_rs.BevGrid(x=(0, 70), y=(-40, 40), resolution=0.1)
    files = ["kitti/000114.bin", *(f"nuscenes/{path.name}" for path in (shared_data / "nuscenes").glob("*.pcd.bin"))]
    for name in files:
        width = 5 if name.endswith(".pcd.bin") else 4
        points = np.fromfile(shared_data / name, np.float32).reshape(-1, width)
        layers = ipm_rs.rasterize(points, grid, points[:, 2:4], ALL, slices=(-3, -1, 1, 3))
        agree(layers, reference.rasterize(points, (0, 70), (-40, 40), 0.1, points[:, 2:4], ALL, (-3, -1, 1, 3)))
        assert layers.inside > 5000 and layers.ignored == 0
