"""`interpolation="area"` and `"mode"` from Python: against a road whose truth is known, OpenCV, and every layout."""

from __future__ import annotations

import importlib.util
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import refuses, same, textured

import ipm_rs
from ipm_rs import errors

BENCH = Path(__file__).resolve().parents[2] / "benches" / "python" / "ground_truth.py"


@pytest.fixture(scope="module")
def ground_truth():
    """The harness of the benches."""
    spec = importlib.util.spec_from_file_location("ground_truth", BENCH)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def lut():
    """Cells of 20 cm, small enough an image for tests."""
    K = np.array([[700.0, 0, 319.5], [0, 700.0, 159.5], [0, 0, 1]])
    camera = ipm_rs.Camera.from_euler(K, image_size=(640, 320), position=(1.5, 0, 1.3), roll=0.08, pitch=0.05, yaw=0.4)
    return ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(5, 25), y=(-2, 14), resolution=0.2))


# The eight by eight samples that it is measured against take 64 times as long as bilinear; so images are of half the
# size, and rendered by 3 x 3 samples a pixel. These alias themselves, which counts where area is nearest to the bound,
# 0.47 dB short: there it is 6 x 6.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "cell", "samples"),
    [
        ("straight ahead", 0.1, 3),
        ("straight ahead", 0.2, 6),
        ("yaw 60, roll 5", 0.2, 3),
        ("roll 10", 0.1, 3),
        ("slope of 5 %", 0.2, 3),
        ("slope of -4 %, yaw -40, roll 6", 0.1, 3),
        ("fisheye", 0.1, 3),
        ("fisheye", 0.2, 3),
        ("fisheye, yaw 75, roll 8", 0.1, 3),
        ("fisheye, yaw 75, roll 8", 0.2, 3),
    ],
)
def test_area_is_as_near_the_truth_as_64_samples_a_cell(ground_truth, case, cell, samples):
    import dataclasses

    found = next(known for known in ground_truth.CASES if known.name == case)
    small = dataclasses.replace(found, image_size=(found.image_size[0] // 2, found.image_size[1] // 2))
    views = ground_truth.Trial(small, samples=samples).compare((cell, cell), ground_truth.own_views())
    best, plain, area = (np.array(views[name]) for name in ("8x8 supersampled", "ipm_rs bilinear", "ipm_rs area"))
    assert np.isfinite(area).all()
    assert (area > best - 0.5).all(), (area, best)
    assert (area > plain - 0.1).all(), (area, plain)
    assert area[0] > plain[0] + 5, "near cells of many pixels are what it is for"


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_every_layout_is_the_same(lut, dtype):
    batch = np.stack([textured(320, 640, 3, dtype, seed) for seed in range(2)])
    expected = np.stack([lut.warp(image, interpolation="area", border_value=7) for image in batch])
    planar = np.ascontiguousarray(batch.transpose(0, 3, 1, 2))
    for threads in (1, 2, 5):
        options = {"interpolation": "area", "border_value": 7, "threads": threads}
        assert same(lut.warp(batch, layout="NHWC", **options), expected)
        assert same(lut.warp(planar, layout="NCHW", **options), np.ascontiguousarray(expected.transpose(0, 3, 1, 2)))
        assert same(lut.warp(planar[0], layout="CHW", **options), np.ascontiguousarray(expected[0].transpose(2, 0, 1)))
    padded = np.zeros((320, 700, 3), dtype)
    padded[:, 20:660] = batch[0]
    assert same(lut.warp(padded[:, 20:660], interpolation="area", border_value=7), expected[0])
    out = np.empty_like(expected[0])
    assert lut.warp(batch[0], interpolation="area", border_value=7, out=out) is out
    assert same(out, expected[0])


def test_the_mask_is_that_of_bilinear(lut):
    ones = np.ones((320, 640), np.float32)
    area = lut.warp(ones, interpolation="area", border_value=-1)
    assert (area[lut.mask] == 1).all()
    outside = ~lut.mask
    assert same(area[outside], lut.warp(ones, border_value=-1)[outside])
    per_channel = lut.warp(np.zeros((320, 640, 3), np.uint8), interpolation="area", border_value=(1, 2, 3))
    assert (per_channel[~np.isfinite(lut.maps()[0])] == (1, 2, 3)).all()


def test_16_bit_and_float_agree_with_8_bit(lut):
    image = textured(320, 640, seed=3)
    narrow = lut.warp(image, interpolation="area").astype(float)
    wide = lut.warp(image.astype(np.uint16) * 256, interpolation="area") / 256
    real = lut.warp(image.astype(np.float32), interpolation="area")
    assert abs(wide - real)[lut.mask].max() < 0.05
    assert abs(narrow - real)[lut.mask].max() < 1.8
    assert abs((narrow - real)[lut.mask].mean()) < 0.2  # halves go up once more than down where a cell has one probe


def test_nan_stays_where_it_is_seen(lut):
    image = np.zeros((320, 640), np.float32)
    image[200, 300] = np.nan
    holes = np.isnan(lut.warp(image, interpolation="area"))
    assert 0 < holes.sum() < 400


def test_what_area_adds_is_counted_but_is_no_part_of_the_table(lut):
    fresh = pickle.loads(pickle.dumps(lut))
    before = fresh.nbytes
    fresh.warp(np.zeros((320, 640), np.uint8), interpolation="area")
    assert fresh.nbytes > before
    assert fresh == lut
    assert pickle.dumps(fresh) == pickle.dumps(lut)
    assert pickle.loads(pickle.dumps(fresh)).nbytes == before


def test_maps_and_homographies_have_footprints_too():
    image = textured(240, 320, seed=4)
    # cells of 4 x 4 pixels, their middles between pixels
    x, y = np.meshgrid(np.arange(80) * 4 + 1.5, np.arange(60) * 4 + 1.5)
    exact = image.reshape(60, 4, 80, 4).mean(axis=(1, 3))
    by_maps = ipm_rs.Lut.from_maps(x, y, source_size=(320, 240)).warp(image, interpolation="area")
    M = np.array([[4, 0, 1.5], [0, 4, 1.5], [0, 0, 1.0]])
    by_homography = ipm_rs.Lut.from_homography(M, size=(80, 60), source_size=(320, 240)).warp(
        image, interpolation="area"
    )
    assert same(by_maps, by_homography)
    inside = np.s_[1:-1, 1:-1]
    plain = ipm_rs.Lut.from_maps(x, y, source_size=(320, 240)).warp(image)
    assert abs(by_maps - exact)[inside].mean() < 0.3 * abs(plain - exact)[inside].mean()


# ---------------------------------------------------------------------------------------------------------------------
# mode


@pytest.mark.parametrize("dtype", ["bool", "uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64"])
def test_mode_is_the_majority_of_the_footprint(dtype):
    kind = np.dtype(dtype)
    rng = np.random.default_rng(5)
    low = 0 if kind.kind in "bu" else -3
    labels = rng.integers(low, 2 if kind.kind == "b" else 4, (64, 96)).astype(kind)
    x, y = np.meshgrid(np.arange(12) * 8 + 3.5, np.arange(8) * 8 + 3.5)
    got = ipm_rs.Lut.from_maps(x, y, source_size=(96, 64)).warp(labels, interpolation="mode")
    blocks = labels.reshape(8, 8, 12, 8).transpose(0, 2, 1, 3).reshape(8, 12, 64)
    expected = np.empty((8, 12), kind)
    for row, col in np.ndindex(8, 12):
        ids, counts = np.unique(blocks[row, col], return_counts=True)
        expected[row, col] = ids[counts.argmax()]  # unique sorts: the smallest of equals
    assert same(got, expected)


def test_mode_invents_no_id_and_is_nearest_where_magnified(lut):
    labels = np.kron(np.random.default_rng(6).integers(0, 200, (20, 40)), np.ones((16, 16))).astype(np.uint8)
    got = lut.warp(labels, interpolation="mode", border_value=255)
    assert set(np.unique(got)) <= set(np.unique(labels)) | {255}
    small = ~(lut.sampling_density() > 1).any(axis=-1) & lut.mask
    assert same(got[small], lut.warp(labels, interpolation="nearest")[small])
    channels = np.stack([labels, labels[::-1], labels], axis=-1)
    assert same(lut.warp(channels, interpolation="mode", border_value=255)[..., 0], got)


def test_wrong_dtypes_and_too_many_ids_are_told(lut):
    out = np.zeros(lut.shape, np.int32)
    with refuses(
        errors.DtypeError, "image", "uint8, int8, uint16, int16, float16, float32 or float64", "int32", "mode", out=out
    ):
        lut.warp(np.zeros((320, 640), np.int32), interpolation="area", out=out)
    with refuses(errors.DtypeError, "image", "integer or bool", "float32", "area"):
        lut.warp(np.zeros((320, 640), np.float32), interpolation="mode")
    with refuses(errors.ArgumentError, "mode", "256", "nearest", out=out):
        lut.warp(np.arange(320 * 640, dtype=np.int32).reshape(320, 640), interpolation="mode", out=out)
    for name in ("area", "mode"):
        with refuses(errors.ArgumentError, "interpolation", name, "Lut"):
            ipm_rs.remap(np.zeros((4, 4), np.uint8), np.zeros((2, 2)), np.zeros((2, 2)), interpolation=name)


# ---------------------------------------------------------------------------------------------------------------------
# density


def test_density_is_that_of_the_projection():
    K = np.array([[700.0, 0, 319.5], [0, 700.0, 159.5], [0, 0, 1]])
    camera = ipm_rs.Camera.from_euler(K, image_size=(640, 320), position=(1.5, 0, 1.3), roll=0.0, pitch=0.05, yaw=0.1)
    grid = ipm_rs.BevGrid(x=(5, 25), y=(-6, 6), resolution=(0.1, 0.05))
    lut = ipm_rs.Lut(camera, grid)
    density, mask = lut.sampling_density(), lut.mask
    assert density.dtype == np.float32
    assert density.shape == (*lut.shape, 2)
    assert np.isnan(density[~mask]).all()
    assert np.isfinite(density[mask]).all()
    xy = grid.xy()
    sides = []
    for axis, step in enumerate(((0.05, 0), (0, 0.025))):
        ahead, behind = (camera.project((xy + sign * np.array(step)).reshape(-1, 2))[0] for sign in (1, -1))
        sides.append((ahead - behind).reshape(*lut.shape, 2))
        assert abs(density[..., axis] / np.linalg.norm(sides[-1], axis=-1) - 1)[mask].max() < 0.05
    least = np.linalg.svd(np.nan_to_num(np.stack(sides, axis=-1)), compute_uv=False)[..., 1]
    sure = mask & (abs(least - 0.5) > 0.03)
    assert same(lut.resolved_mask(0.5)[sure], (least >= 0.5)[sure])
    assert not lut.resolved_mask(0.0)[~mask].any()
    assert lut.resolved_mask(0.2).sum() > lut.resolved_mask().sum() > lut.resolved_mask(2.0).sum()
