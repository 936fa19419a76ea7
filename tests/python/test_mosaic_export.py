"""Files of maps for other programs: of what lies far apart, over older ones, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest
from PIL import Image
from test_mosaic import POSES, camera, mosaic_of, seen_from, standing_at

import ipm_rs

FAR = 1750.0  # 17 500 cells, the square of which is more than 2^28


@pytest.fixture(scope="module")
def frames():
    return [(seen_from(camera(), pose), pose) for pose in POSES]


@pytest.fixture(scope="module")
def wide(frames):
    mosaic = mosaic_of(frames[:2])
    mosaic.add(camera(), frames[0][0], map_from_vehicle=standing_at(FAR, FAR, 0.7), distance=(2, 20))
    return mosaic


def parts_of(mosaic):
    """The picture and the mask of each tile, and where it lies: x up to and y up to."""
    side = mosaic.tile * mosaic.resolution
    for i, j in mosaic.tiles:
        layers = mosaic.layers((i * side, (i + 1) * side), (j * side, (j + 1) * side), names=("refined", "mask"))
        yield layers["refined"], layers["mask"], ((i + 1) * side, (j + 1) * side)


def test_a_map_of_far_places_has_bounds_and_no_picture(wide):
    side = wide.tile * wide.resolution
    edges = [(min(keys) * side, (max(keys) + 1) * side) for keys in zip(*wide.tiles, strict=True)]
    np.testing.assert_allclose(wide.bounds, edges)
    for call in (wide.image, wide.layers):
        with pytest.raises(ipm_rs.ArgumentError, match="read it in parts"):
            call()


def test_tiles_of_far_places_are_the_map(tmp_path, wide):
    count = wide.export_tiles(tmp_path)
    files = {tuple(map(int, re.findall(r"\d+", str(path.relative_to(tmp_path))))) for path in tmp_path.rglob("*.png")}
    assert len(files) == count < 100
    levels = max(z for z, _, _ in files)
    (_, x_max), (_, y_max) = wide.bounds
    pixels = 0
    for picture, mask, (x, y) in parts_of(wide):
        top, left = round((x_max - x) / 0.1), round((y_max - y) / 0.1)
        name = tmp_path / f"{levels}/{left // 256}/{top // 256}.png"
        page = np.asarray(Image.open(name)) if name.exists() else np.zeros((256, 256, 4), np.uint8)
        part = page[top % 256 : top % 256 + 64, left % 256 : left % 256 + 64]  # 64 is a part of 256
        np.testing.assert_array_equal(part[..., 0] * mask, picture)
        np.testing.assert_array_equal(part[..., 3] > 0, mask)
        pixels += mask.sum()
    finest = [np.asarray(Image.open(path)) for path in (tmp_path / str(levels)).rglob("*.png")]
    assert sum((page[..., 3] > 0).sum() for page in finest) == pixels


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of affine, by rasterio
def test_a_geotiff_of_far_places_is_the_map(tmp_path, wide):
    rasterio = pytest.importorskip("rasterio")
    path = tmp_path / "map.tif"
    wide.export_geotiff(path, crs="EPSG:32632", origin=(1000, 2000))
    assert path.stat().st_size < 3e6, "what nobody saw takes no room"
    with rasterio.open(path) as file:
        for picture, mask, (x, y) in parts_of(wide):
            row, column = file.index(x - 6.35 + 1000, y - 0.05 + 2000)  # north up: the smallest x is on the left
            values, alpha = file.read(window=((row, row + 64), (column, column + 64)))
            np.testing.assert_array_equal(values, picture[::-1].T)
            np.testing.assert_array_equal(alpha > 0, mask[::-1].T)
        seen = file.read(2, out_shape=(file.height // 128, file.width // 128))
        assert 0 < (seen > 0).sum() < 30


def test_a_map_too_wide_for_a_geotiff_is_refused(tmp_path, frames):
    pytest.importorskip("rasterio")
    mosaic = mosaic_of(frames[:1])
    mosaic.add(camera(), frames[0][0], map_from_vehicle=standing_at(9e6, 9e6), distance=(2, 20))
    with pytest.raises(ipm_rs.ArgumentError, match="export_tiles"):
        mosaic.export_geotiff(tmp_path / "map.tif", crs="EPSG:32632")
    assert mosaic.export_tiles(tmp_path) > 20
    assert not (tmp_path / "map.tif").exists()


def tiles_in(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.png")}


def test_an_older_map_s_tiles_go_and_nothing_else(tmp_path, frames, wide):
    small = mosaic_of(frames[:1])
    small.export_tiles(tmp_path / "alone")
    site = tmp_path / "site"
    wide.export_tiles(site)
    others = [
        "0/notes.txt",
        "3/1/01.png",
        "3/1/x.png",
        "4/99/0.png",
        "5/0/-1.png",
        "30/0/0.png",
        "photo.png",
        "0/0.png",
    ]
    for name in others:
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_bytes(b"mine")
    small.export_tiles(site)
    kept = tiles_in(tmp_path / "alone")
    found = {path.relative_to(site).as_posix(): path.read_bytes() for path in site.rglob("*") if path.is_file()}
    page = found.pop("index.html")
    assert page == (tmp_path / "alone" / "index.html").read_bytes()
    assert found == {**kept, **dict.fromkeys(others, b"mine")}
    assert not (site / "6").exists(), "nor empty folders"


def test_tiles_without_a_page_are_not_taken_for_a_map_s(tmp_path, frames):
    (tmp_path / "1/0").mkdir(parents=True)
    (tmp_path / "1/0/1.png").write_bytes(b"mine")
    (tmp_path / "index.html").write_text('<title>Mine</title>\nconst about = {"levels": 9};\n', "utf-8")
    mosaic_of(frames[:1]).export_tiles(tmp_path)
    assert (tmp_path / "1/0/1.png").read_bytes() == b"mine"


def test_an_interrupted_export_says_so_and_is_made_good(tmp_path, monkeypatch, frames, wide):
    small = mosaic_of(frames[:1])
    small.export_tiles(tmp_path / "alone")
    site = tmp_path / "site"
    wide.export_tiles(site)
    before = tiles_in(site)
    with pytest.raises(ipm_rs.MosaicError, match="samples"):
        small.export_tiles(site, blend="robust")
    assert "columns" in (site / "index.html").read_text("utf-8") and tiles_in(site) == before

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("ipm_rs.mosaic._slippy._remove_others", interrupted)
        with pytest.raises(KeyboardInterrupt):
            small.export_tiles(site)
    page = (site / "index.html").read_text("utf-8")
    assert "being written" in page and "<img" not in page and "columns" not in page
    small.export_tiles(site)
    assert tiles_in(site) == tiles_in(tmp_path / "alone")
    assert (site / "index.html").read_bytes() == (tmp_path / "alone" / "index.html").read_bytes()


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of affine, by rasterio
def test_a_geotiff_is_in_metres(tmp_path, frames):
    pytest.importorskip("rasterio")
    mosaic = mosaic_of(frames[:1])
    feet = 'LOCAL_CS["hall",UNIT["foot",0.3048]]'
    for crs, words in {
        "EPSG:4326": "longitude",
        "EPSG:4978": "Earth",
        "EPSG:2263": "US survey foot",
        feet: "foot",
    }.items():
        with pytest.raises(ipm_rs.ArgumentError, match=f"(?s)EPSG:32632.*{words}"):
            mosaic.export_geotiff(tmp_path / "map.tif", crs=crs)
    for origin in ((1e300, 0), (0, -2e9)):
        with pytest.raises(ipm_rs.ArgumentError, match="origin"):
            mosaic.export_geotiff(tmp_path / "map.tif", crs="EPSG:32632", origin=origin)
    assert not list(tmp_path.iterdir())
    for crs in ("EPSG:3857", 25832, 'LOCAL_CS["hall",UNIT["metre",1]]'):
        mosaic.export_geotiff(tmp_path / "map.tif", crs=crs, origin=(-5, 32_500_000))


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of affine, by rasterio
def test_a_full_disk_leaves_the_older_geotiff(tmp_path, frames, monkeypatch):
    rasterio = pytest.importorskip("rasterio")
    resource = pytest.importorskip("resource")
    noise = np.random.default_rng(0).integers(0, 256, frames[0][0].shape, dtype=np.uint8)
    mosaic = ipm_rs.Mosaic(0.05, tile=64)
    mosaic.add(camera(), noise, map_from_vehicle=POSES[0], distance=(2, 20))
    path = tmp_path / "map.tif"
    mosaic.export_geotiff(path, crs="EPSG:32632")
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    for room in (100, len(before) // 2, len(before) * 9 // 10, len(before) - 1000, len(before) - 1):
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))
        try:
            with pytest.raises(ipm_rs.FileError, match="free space"):
                mosaic.export_geotiff(path, crs="EPSG:32632")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert [entry.name for entry in tmp_path.iterdir()] == ["map.tif"] and path.read_bytes() == before

    def full(*_, **__):
        raise rasterio._err.CPLE_AppDefinedError(3, 1, "No space left on device")

    monkeypatch.setattr("rasterio.shutil.copy", full)
    with pytest.raises(ipm_rs.FileError, match="No space left"):
        mosaic.export_geotiff(path, crs="EPSG:32632")
    assert path.read_bytes() == before
