"""`Lut.warp_adjoint`: the transpose of a warp, to the rounding of float64, whatever lies on rims and outside."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors

WIDTH, HEIGHT = 37, 23
KINDS = pytest.mark.parametrize("interpolation", ["bilinear", "nearest", "area"])


def ragged(seed: int = 0, rows: int = 30, cols: int = 41) -> ipm_rs.Lut:
    """Cells inside, on rims, in the halo and far outside; some at whole and at half pixels."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(-3, WIDTH + 2, (rows, cols)), rng.uniform(-3, HEIGHT + 2, (rows, cols))
    u[::3], v[:, ::4] = np.round(u[::3]), np.round(2 * v[:, ::4]) / 2
    u[5, :7], v[5, :7] = WIDTH - 1, np.linspace(-0.9, HEIGHT - 0.1, 7)
    u[6, 3], v[7, 2] = np.nan, np.inf
    return ipm_rs.Lut.from_maps(u, v, source_size=(WIDTH, HEIGHT))


def coarse(seed: int = 0) -> ipm_rs.Lut:
    """Cells of some pixels each, several patterns and levels of area, some of them over the image's edges."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:30, :41]
    turn = rng.uniform(-0.5, 0.5)
    u = (column - 20) * (1.2 + 0.13 * row) * np.cos(turn) + row * np.sin(turn) + 18
    v = 0.9 * row - 2 + 0.02 * row**1.6 + 0.2 * column * np.sin(turn)
    return ipm_rs.Lut.from_maps(u, v, source_size=(WIDTH, HEIGHT))


LUTS = pytest.mark.parametrize("make", [ragged, coarse])


def matrix(lut: ipm_rs.Lut, interpolation: str) -> np.ndarray:
    """The warp as a matrix, column by column: what it makes of each pixel alone."""
    basis = np.eye(WIDTH * HEIGHT).reshape(HEIGHT, WIDTH, -1)
    return lut.warp(np.ascontiguousarray(basis), interpolation=interpolation).reshape(-1, WIDTH * HEIGHT)


@LUTS
@KINDS
def test_it_is_the_transposed_matrix(interpolation, make):
    lut = make()
    grad = np.random.default_rng(1).normal(size=lut.shape)
    wanted = matrix(lut, interpolation).T @ grad.ravel()
    got = lut.warp_adjoint(grad, interpolation=interpolation)
    assert got.shape == (HEIGHT, WIDTH) and got.dtype == np.float64
    np.testing.assert_allclose(got.ravel(), wanted, rtol=0, atol=1e-13)
    assert (got != 0).any() and ((got == 0).any() or interpolation == "area")


@LUTS
@KINDS
@pytest.mark.parametrize("channels", [(), (1,), (3,), (7,), (33,)])
def test_products_are_the_same(interpolation, channels, make):
    for seed in range(4):
        rng, lut = np.random.default_rng(seed), make(seed)
        image, grad = rng.normal(size=(HEIGHT, WIDTH, *channels)), rng.normal(size=(*lut.shape, *channels))
        there = np.vdot(lut.warp(image, interpolation=interpolation), grad)
        back = np.vdot(image, lut.warp_adjoint(grad, interpolation=interpolation))
        assert abs(there - back) <= 1e-12 * np.abs(image).max() * np.abs(grad).sum()
    # float32 sums are taken in float64 and rounded once
    single = lut.warp_adjoint(grad.astype(np.float32), interpolation=interpolation)
    exact = lut.warp_adjoint(grad.astype(np.float32).astype(np.float64), interpolation=interpolation)
    assert single.dtype == np.float32 and np.array_equal(single, exact.astype(np.float32))


@KINDS
def test_threads_and_layouts_change_nothing(interpolation):
    # large enough to be shared out
    u, v = np.random.default_rng(3).uniform(-2, 600, (2, 300, 400))
    if interpolation == "area":  # cells that are torn apart are averaged from hundreds of pixels each
        row, column = np.mgrid[:300, :400]
        u, v = 1.7 * column - 0.1 * row - 20, 2.1 * row - 9
    lut = ipm_rs.Lut.from_maps(u, v, source_size=(600, 590))
    grad = np.random.default_rng(2).normal(size=(300, 400, 3)).astype(np.float32)
    wanted = lut.warp_adjoint(grad, interpolation=interpolation, threads=1)
    planes = np.ascontiguousarray(grad.transpose(2, 0, 1))
    again = ipm_rs.Lut.from_maps(*lut.maps(), source_size=(600, 590))
    for threads in (2, 3, 8):
        assert np.array_equal(lut.warp_adjoint(grad, interpolation=interpolation, threads=threads), wanted)
    chw = lut.warp_adjoint(planes, interpolation=interpolation, layout="CHW", threads=2)
    assert np.array_equal(chw.transpose(1, 2, 0), wanted)
    assert again.warp_adjoint(grad[::-1][::-1], interpolation=interpolation).shape == wanted.shape
    for count in (2, 5, 27):  # planes side by side, in groups of several sizes
        many = np.concatenate([planes] * 9)[:count]
        got = lut.warp_adjoint(many, interpolation=interpolation, layout="CHW", threads=2)
        assert all(np.array_equal(plane, chw[index % 3]) for index, plane in enumerate(got))
    both = lut.warp_adjoint(np.stack([grad, 2 * grad]), interpolation=interpolation, layout="NHWC")
    assert np.array_equal(both[0], wanted) and np.array_equal(both[1], 2 * wanted)
    wide = np.zeros((300, 500, 3), np.float32)
    wide[:, :400] = grad
    out = np.full((590, 700, 3), 9, np.float32)
    assert lut.warp_adjoint(wide[:, :400], interpolation=interpolation, out=out[:, :600]) is not None
    assert np.array_equal(out[:, :600], wanted) and (out[:, 600:] == 9).all()


@LUTS
@KINDS
def test_what_cells_outside_hold_goes_nowhere(interpolation, make):
    lut = make()
    grad = lut.mask.astype(float)
    # each cell inside gives away one in all
    back = lut.warp_adjoint(grad, interpolation=interpolation)
    np.testing.assert_allclose(back.sum(), lut.mask.sum(), rtol=1e-12)
    grad[np.isnan(lut.maps()[0])] = np.nan  # cells without an image
    assert np.isnan(grad).any()
    assert np.array_equal(lut.warp_adjoint(grad, interpolation=interpolation), back)


def test_the_table_turned_round_is_kept():
    lut = ragged()
    before = lut.nbytes
    lut.warp_adjoint(np.ones(lut.shape))
    once = lut.nbytes
    lut.warp_adjoint(np.ones(lut.shape))
    assert before < once == lut.nbytes
    lut.warp(np.zeros((HEIGHT, WIDTH), np.uint8), interpolation="area")
    lut.warp(np.zeros((HEIGHT, WIDTH), np.uint8), interpolation="nearest")
    lut.warp_adjoint(np.ones(lut.shape), interpolation="nearest")
    assert lut.nbytes > once


@pytest.mark.parametrize(
    ("arguments", "error", "phrase"),
    [
        ({"grad": np.zeros((30, 40))}, errors.ImageError, "30 rows of 41 cells"),
        ({"grad": np.zeros((HEIGHT, WIDTH))}, errors.ImageError, f"got {HEIGHT} of {WIDTH}"),
        ({"grad": np.zeros((30, 41), np.uint8)}, errors.DtypeError, "float32 or float64, got uint8"),
        ({"grad": np.zeros((30, 41), np.float16)}, errors.DtypeError, "float32 or float64, got float16"),
        ({"interpolation": "mode"}, errors.ArgumentError, "no adjoint"),
        ({"interpolation": "cubic"}, errors.ArgumentError, "interpolation"),
        ({"threads": 0}, errors.ArgumentError, "threads"),
        ({"layout": "CHW"}, errors.ImageError, "CHW"),
        ({"out": np.zeros((HEIGHT, WIDTH + 1))}, errors.ImageError, "out: expected shape"),
        ({"out": np.zeros((HEIGHT, WIDTH), np.float32)}, errors.DtypeError, "out"),
        ({"grad": [1, 2]}, errors.ArgumentTypeError, "grad"),
    ],
)
def test_wrong_calls(arguments, error, phrase):
    lut = ragged()
    with refuses(error, phrase):
        lut.warp_adjoint(**{"grad": np.zeros(lut.shape), **arguments})


# ---------------------------------------------------------------------------------------------------------------------
# rings


def ring() -> ipm_rs.RigLut:
    cameras = {
        name: ipm_rs.Camera.from_euler(
            [[40, 0, 31.2], [0, 40, 23.7], [0, 0, 1]], image_size=(64, 48), position=(1, 0, 1.4), pitch=0.4, yaw=yaw
        )
        for name, yaw in (("front", 0.0), ("left", 1.0), ("right", -0.9))
    }
    return ipm_rs.RigLut(cameras, ipm_rs.BevGrid(x=(-2, 4), y=(-5, 5), resolution=0.2), feather=0.8)


@KINDS
@pytest.mark.parametrize("layout", ["HWC", "CHW"])
def test_a_ring_gives_each_camera_its_share(interpolation, layout):
    lut, rng = ring(), np.random.default_rng(5)
    shape = (lambda rows, cols: (rows, cols, 3)) if layout == "HWC" else (lambda rows, cols: (3, rows, cols))
    images = {name: rng.normal(size=shape(48, 64)) for name in lut.rig}
    grad = rng.normal(size=shape(*lut.shape))
    there = np.vdot(lut.warp(images, interpolation=interpolation, layout=layout), grad)
    back = lut.warp_adjoint(grad, interpolation=interpolation, layout=layout)
    assert list(back) == list(lut.rig)
    assert all(np.any(one != 0) and one.shape == images[name].shape for name, one in back.items())
    assert abs(there - sum(np.vdot(images[name], one) for name, one in back.items())) <= 1e-12 * np.abs(grad).sum() * 5
    again = lut.warp_adjoint(grad, interpolation=interpolation, layout=layout, threads=1)
    assert all(np.array_equal(one, again[name]) for name, one in back.items())


def test_what_a_ring_does_not_show_goes_nowhere():
    lut = ring()
    grad = np.where(lut.mask, 1.0, np.nan)
    assert not lut.mask.all() and ((lut.weights("front") > 0) & (lut.weights("left") > 0)).any()
    for interpolation in ("bilinear", "nearest", "area"):
        back = lut.warp_adjoint(grad, interpolation=interpolation)
        np.testing.assert_allclose(sum(one.sum() for one in back.values()), lut.mask.sum(), rtol=1e-9)
    with refuses(errors.ImageError, "30 rows of 50 cells, as this RigLut has"):
        lut.warp_adjoint(grad[:-1])
    with refuses(errors.ArgumentError, "not linear"):
        lut.warp_adjoint(grad, interpolation="mode")
