"""What lies beyond the image: of a table's cells, of panoramas, and cells that keep what they hold."""

from __future__ import annotations

import pickle

import cv2
import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors

REPEATS = {
    "replicate": cv2.BORDER_REPLICATE,
    "reflect": cv2.BORDER_REFLECT,
    "reflect_101": cv2.BORDER_REFLECT_101,
    "wrap": cv2.BORDER_WRAP,
}
CV = {"bilinear": cv2.INTER_LINEAR, "nearest": cv2.INTER_NEAREST}
SIZE = (61, 47)
IMAGE = np.random.default_rng(1).integers(0, 256, (47, 61, 3), np.uint8)
BORDER = (7, 200, 90)


def maps(seed=2, shape=(90, 110)):
    """In the image, around it and far outside; no halves, of which a mirror turns even into odd."""
    rng = np.random.default_rng(seed)
    map_x, map_y = rng.uniform(-200, 260, shape), rng.uniform(-150, 200, shape)
    map_x[::2], map_y[::2] = rng.uniform(-5, 66, shape)[::2], rng.uniform(-5, 52, shape)[::2]
    map_x[3, :30], map_y[5, :30] = np.nan, np.inf
    return map_x.astype(np.float32), map_y.astype(np.float32)


def camera(**changes):
    """Right behind the near edge of its grid, looking down, so that cells lie on every side of its image."""
    k = [[60.0, 0, 30], [0, 60.0, 23], [0, 0, 1]]
    changes = {"position": (0, 0, 1.5), "pitch": 0.7, "lens": None, **changes}
    return ipm_rs.Camera.from_euler(changes.pop("K", k), image_size=changes.pop("image_size", SIZE), **changes)


GRID = ipm_rs.BevGrid(x=(-2, 6), y=(-3, 3), resolution=0.1)


@pytest.mark.parametrize("mode", REPEATS)
@pytest.mark.parametrize("interpolation", CV)
def test_a_table_of_maps_is_remap_and_opencv(mode, interpolation):
    map_x, map_y = maps()
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=SIZE, border_mode=mode)
    assert lut.border_mode == mode
    plain = ipm_rs.Lut.from_maps(map_x, map_y, source_size=SIZE)
    assert (lut.mask == plain.mask).all() and 0.1 < lut.mask.mean() < 0.9 and lut != plain
    for image in (IMAGE, IMAGE[..., 0].copy(), IMAGE.astype(np.int16) * 100, IMAGE[::-1].astype(np.float32)):
        border = BORDER if image.ndim == 3 else 7
        got = lut.warp(image, interpolation=interpolation, border_value=border)
        expected = ipm_rs.remap(image, map_x, map_y, interpolation=interpolation, border_mode=mode, border_value=border)
        tolerance = 0.02 if image.dtype == np.float32 else 2 if image.dtype == np.int16 else 1
        assert np.abs(got.astype(float) - expected).max() <= tolerance * (interpolation == "bilinear")
    theirs = cv2.remap(IMAGE, map_x, map_y, CV[interpolation], borderMode=REPEATS[mode])
    there = np.isfinite(map_x) & np.isfinite(map_y)
    got = lut.warp(IMAGE, interpolation=interpolation, border_value=BORDER)
    assert np.abs(got.astype(int) - theirs)[there].max() <= (interpolation == "bilinear")
    assert (got[~there] == BORDER).all()


@pytest.mark.parametrize("mode", REPEATS)
@pytest.mark.parametrize("lens", [None, ipm_rs.KannalaBrandt([0.02, -0.01, 0.002, 0])])
@pytest.mark.parametrize("ground", [0.0, ipm_rs.HeightMap(np.zeros((3, 3)), origin=(-3, -4), spacing=6.0)])
def test_a_table_of_a_camera_goes_on_beyond_its_image(mode, lens, ground):
    source = camera(lens=lens)
    lut = ipm_rs.Lut(source, GRID, ground=ground, border_mode=mode)
    xyz = np.concatenate([GRID.xy(), np.zeros((*GRID.shape, 1))], -1).reshape(-1, 3)
    pixels = source.project(xyz)[0].reshape(*GRID.shape, 2)
    got = lut.warp(IMAGE, border_value=BORDER)
    seen = np.isfinite(pixels).all(-1)
    near = seen & (np.abs(pixels) < 1e4).all(-1)  # far out a rounding of the coordinate is another pixel
    expected = ipm_rs.remap(IMAGE, pixels[..., 0], pixels[..., 1], border_mode=mode)
    assert np.abs(got.astype(int) - expected)[near].max() <= 1
    assert (lut.mask == ipm_rs.Lut(source, GRID, ground=ground).mask).all()
    assert (near & ~lut.mask).sum() > 500
    assert (got[~seen] == BORDER).all() and (lens is not None or (~seen).sum() > 100)


def test_tables_of_homographies_and_views_take_it():
    matrix = np.array([[1.4, 0.1, -20], [-0.1, 1.3, -9], [1e-3, 5e-4, 1]])
    lut = ipm_rs.Lut.from_homography(matrix, size=(80, 70), source_size=SIZE, border_mode="reflect_101")
    expected = ipm_rs.warp_perspective(IMAGE, matrix, (80, 70), inverse_map=True, border_mode="reflect_101")
    assert (lut.warp(IMAGE) == expected).all() and not lut.mask.all()

    on_ground = camera().camera_from_vehicle[:3, [0, 1, 3]]
    ground_matrix = camera().intrinsics @ on_ground
    by_matrix = ipm_rs.Lut.from_homography(ground_matrix, grid=GRID, source_size=SIZE, border_mode="replicate")
    by_camera = ipm_rs.Lut(camera(), GRID, border_mode="replicate")
    assert np.abs(by_matrix.warp(IMAGE).astype(int) - by_camera.warp(IMAGE)).max() <= 1

    view = ipm_rs.Lut.between(camera(), camera().undistorted(focal=30), border_mode="replicate")
    filled = view.warp(IMAGE)
    assert not view.mask.all() and (filled[0, 0] == IMAGE[0, 0]).all() and (filled[-1, -1] == IMAGE[-1, -1]).all()


@pytest.mark.parametrize("interpolation", ["area", "mode"])
def test_what_is_averaged_does_not_depend_on_what_lies_beyond(interpolation):
    """Cells that are whole and lie apart from the rim see their footprint as ever; those beyond take a pixel."""
    plain, lut = ipm_rs.Lut(camera(), GRID), ipm_rs.Lut(camera(), GRID, border_mode="reflect")
    ids = IMAGE[..., 0] // 64 if interpolation == "mode" else IMAGE
    a, b = (one.warp(ids, interpolation=interpolation, border_value=9) for one in (plain, lut))
    inner = cv2.erode(plain.mask.astype(np.uint8), np.ones((9, 9), np.uint8), borderValue=0).astype(bool)
    assert inner.sum() > 200 and (a[inner] == b[inner]).all()
    beyond = np.isfinite(lut.maps()[0]) & ~lut.mask
    assert beyond.sum() > 500 and (b[beyond] != 9).any()


def test_tables_are_pickled_and_saved_with_it(tmp_path):
    for lut in (
        ipm_rs.Lut(camera(), GRID, border_mode="wrap"),
        ipm_rs.Lut.from_maps(*maps(), source_size=SIZE, border_mode="reflect", source_wraps=True),
    ):
        again = pickle.loads(pickle.dumps(lut))
        assert again == lut and again.border_mode == lut.border_mode and again.source_wraps == lut.source_wraps
        assert (again.warp(IMAGE) == lut.warp(IMAGE)).all()
        lut.save(tmp_path / "a.ipmlut")
        loaded = ipm_rs.Lut.load(tmp_path / "a.ipmlut")
        assert loaded == lut and (loaded.warp(IMAGE) == lut.warp(IMAGE)).all()


@pytest.mark.parametrize("interpolation", ["bilinear", "nearest", "area", "mode"])
def test_transparent_writes_the_mask_and_nothing_else(interpolation):
    held = np.random.default_rng(4).integers(0, 256, (*GRID.shape, 3), np.uint8)
    image = IMAGE // 64
    for lut in (ipm_rs.Lut(camera(), GRID), ipm_rs.Lut(camera(), GRID, border_mode="wrap")):
        for dtype in (np.uint8, np.int16):
            out = held.astype(dtype)
            view = lut.warp(image.astype(dtype), interpolation=interpolation, border_mode="transparent", out=out)
            assert view is out
            assert (view[lut.mask] == lut.warp(image.astype(dtype), interpolation=interpolation)[lut.mask]).all()
            assert (view[~lut.mask] == held[~lut.mask]).all()
    planes = np.ascontiguousarray(held.transpose(2, 0, 1)).astype(np.float32)
    before = planes.copy()
    lut.warp(
        np.ascontiguousarray(IMAGE.transpose(2, 0, 1)).astype(np.float32),
        interpolation="bilinear",
        layout="CHW",
        border_mode="transparent",
        out=planes,
    )
    assert (planes[:, ~lut.mask] == before[:, ~lut.mask]).all() and (planes[:, lut.mask] != before[:, lut.mask]).any()


def test_transparent_without_a_table():
    map_x, map_y = maps()
    inside = (map_x >= 0) & (map_x <= 60) & (map_y >= 0) & (map_y <= 46)
    for interpolation in CV:
        for dtype in (np.uint8, np.float32, np.float64):
            out = np.full((*map_x.shape, 3), 77, dtype)
            image = IMAGE.astype(dtype)
            ipm_rs.remap(image, map_x, map_y, interpolation=interpolation, border_mode="transparent", out=out)
            assert (out[~inside] == 77).all()
            assert (out[inside] == ipm_rs.remap(image, map_x, map_y, interpolation=interpolation)[inside]).all()


# ---------------------------------------------------------------------------------------------------------------------
# Panoramas


def sphere(width=128, centre=63.5):
    k = [[width / (2 * np.pi), 0, centre], [0, width / (2 * np.pi), 31.5], [0, 0, 1]]
    return camera(K=k, image_size=(width, 64), lens=ipm_rs.Equirectangular(), pitch=0.0)


def smooth(width=128):
    """Without an edge where the panorama begins again."""
    columns = 128 + 100 * np.sin(2 * np.pi * np.arange(width) / width * 3)
    return np.repeat(columns[None], 64, 0).astype(np.float32)


@pytest.mark.parametrize("centre", [63.5, 40.0])
@pytest.mark.parametrize("interpolation", ["bilinear", "nearest", "area"])
def test_a_panorama_has_no_seam(centre, interpolation):
    """The road all around, also straight behind, where its last column is followed by its first."""
    source = sphere(centre=centre)
    assert source.is_panorama and not camera().is_panorama and not source.cropped(0, 0, 100, 64).is_panorama
    grid = ipm_rs.BevGrid(x=(-6, 6), y=(-6, 6), resolution=0.05)
    lut = ipm_rs.Lut(source, grid)
    xy = grid.xy()
    distance = np.hypot(xy[..., 0], xy[..., 1])
    # straight below, the last half pixel of the last row has no pixel on its other side
    assert lut.source_wraps and (lut.mask | (distance < 0.05)).all()
    got = lut.warp(smooth(), interpolation=interpolation, border_value=-1e4)
    u = centre + 128 / (2 * np.pi) * np.arctan2(-xy[..., 1], xy[..., 0])
    exact = 128 + 100 * np.sin(2 * np.pi * u / 128 * 3)
    assert np.abs(got - exact)[distance > 1].max() < (8 if interpolation == "nearest" else 2)


def test_views_out_of_a_panorama_have_no_seam():
    source = sphere()
    behind = camera(K=[[60.0, 0, 30], [0, 60.0, 23], [0, 0, 1]], image_size=(61, 47), pitch=0.0, yaw=np.pi)
    lut = ipm_rs.Lut.between(source, behind)
    assert lut.source_wraps and lut.mask.all()
    row = lut.warp(smooth())[23]
    assert np.abs(np.diff(row)).max() < 12 and row.std() > 5
    upside = ipm_rs.Lut.between(source, source.with_pose(np.diag([1.0, 1, 1, 1]) @ source.camera_from_vehicle))
    assert upside.mask.all()
    cylinder = camera().undistorted(size=(100, 47), focal=100 / (2 * np.pi), lens=ipm_rs.Cylindrical())
    assert cylinder.is_panorama


# ---------------------------------------------------------------------------------------------------------------------
# Mistakes


@pytest.mark.parametrize(
    ("call", "error", "phrases"),
    [
        (
            lambda lut: lut.warp(IMAGE, border_mode="transparent"),
            errors.ArgumentError,
            ["out", "transparent", "pass out="],
        ),
        (lambda lut: lut.warp(IMAGE, border_mode="wrap"), errors.ArgumentError, ['"constant"', '"wrap"', "build it"]),
        (lambda lut: lut.warp(IMAGE, border_mode="mirror"), errors.ArgumentError, ["replicate", "mirror"]),
        (lambda lut: ipm_rs.Lut(camera(), GRID, border_mode=3), errors.ArgumentTypeError, ["border_mode", "int"]),
        (lambda lut: ipm_rs.Lut(camera(), GRID, border_mode="transparent"), errors.ArgumentError, ["lut.warp", "out="]),
        (
            lambda lut: ipm_rs.Lut.from_maps(*maps(), source_size=SIZE, source_wraps=1),
            errors.ArgumentTypeError,
            ["source_wraps", "True or False"],
        ),
        (lambda lut: ipm_rs.remap(IMAGE, *maps(), border_mode="transparent"), errors.ArgumentError, ["pass out="]),
    ],
)
def test_mistakes_are_told(call, error, phrases):
    lut = ipm_rs.Lut(camera(), GRID)
    assert (lut.warp(IMAGE, border_mode="constant") == lut.warp(IMAGE)).all()
    with refuses(error, *phrases):
        call(lut)
