"""What leaves a mosaic: tiles for a page, GeoTIFF; and ``ipm-rs mosaic``."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from PIL import Image
from test_mosaic import POSES, assert_same, camera, mosaic_of, seen_from, standing_at

import ipm_rs
from ipm_rs.cli import main


@pytest.fixture(scope="module")
def frames():
    return [(seen_from(camera(), pose), pose) for pose in POSES]


def test_tiles_are_the_map(tmp_path, frames):
    mosaic = mosaic_of(frames)
    picture, mask = mosaic.image(), mosaic.layers(names="mask")["mask"]
    rows, columns = picture.shape
    levels = int(np.ceil(np.log2(max(rows, columns) / 256)))
    count = mosaic.export_tiles(tmp_path / "site")
    files = sorted(path.relative_to(tmp_path / "site").as_posix() for path in (tmp_path / "site").rglob("*.png"))
    assert len(files) == count > 0
    assert "0/0/0.png" in files
    seen = np.zeros_like(mask)
    for name in files:
        z, column, row = map(int, re.findall(r"\d+", name))
        tile = np.asarray(Image.open(tmp_path / "site" / name))
        assert tile.shape == (256, 256, 4) and tile[..., 3].any()
        if z == levels:
            part = picture[row * 256 : (row + 1) * 256, column * 256 : (column + 1) * 256]
            shown = tile[: part.shape[0], : part.shape[1]]
            np.testing.assert_array_equal(shown[..., 0], part)
            seen[row * 256 : (row + 1) * 256, column * 256 : (column + 1) * 256] = shown[..., 3] > 0
    np.testing.assert_array_equal(seen, mask)
    page = (tmp_path / "site" / "index.html").read_text("utf-8")
    about = json.loads(re.search(r"const about = (\{.*\});", page)[1])
    assert about["x"] == pytest.approx(mosaic.bounds[0][1]) and about["y"] == pytest.approx(mosaic.bounds[1][1])
    assert (about["levels"], about["rows"], about["columns"]) == (levels, rows, columns)
    assert "http" not in page
    with pytest.raises(ipm_rs.FileError):
        mosaic.export_tiles(tmp_path / "site" / "index.html")
    with pytest.raises(ipm_rs.ArgumentError):
        ipm_rs.Mosaic(0.1).export_tiles(tmp_path / "none")


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of affine, by rasterio
def test_a_geotiff_has_north_up(tmp_path, frames):
    rasterio = pytest.importorskip("rasterio")
    mosaic = mosaic_of(frames)
    origin = (500_000.0, 5_400_000.0)
    mosaic.export_geotiff(tmp_path / "map.tif", crs="EPSG:32632", origin=origin)
    layers, xy = mosaic.layers(names=("weighted", "mask")), mosaic.window().xy()
    with rasterio.open(tmp_path / "map.tif") as file:
        assert file.crs.to_epsg() == 32632 and file.count == 2 and file.dtypes == ("uint8", "uint8")
        values, alpha = file.read()
        for row, column in np.argwhere(layers["mask"])[::97]:
            at = file.index(*(xy[row, column] + origin))
            assert values[at] == layers["weighted"][row, column] and alpha[at] == 255
        assert (alpha > 0).sum() == layers["mask"].sum()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.tif"]
    with pytest.raises(ipm_rs.ArgumentError, match="crs"):
        mosaic.export_geotiff(tmp_path / "other.tif", crs="nowhere")
    with pytest.raises(ipm_rs.FileError):
        mosaic.export_geotiff(tmp_path / "nowhere" / "map.tif", crs="EPSG:32632")
    with pytest.raises(ipm_rs.ArgumentError, match="origin"):
        mosaic.export_geotiff(tmp_path / "other.tif", crs="EPSG:32632", origin=(1, np.nan))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.tif"]


@pytest.fixture
def drive(tmp_path, frames):
    """A calibration, a folder of pictures and poses of the camera, as KITTI has them."""
    camera().save(tmp_path / "camera.json")
    (tmp_path / "frames").mkdir()
    for number, (image, _) in enumerate(frames):
        Image.fromarray(image).save(tmp_path / "frames" / f"{number:06d}.png")
    mount = camera().vehicle_from_camera
    poses = [np.linalg.inv(mount) @ pose @ mount for _, pose in frames]  # the map is the first camera
    np.savetxt(tmp_path / "poses.txt", [pose[:3].ravel() for pose in poses])
    return tmp_path


def run(folder, *more):
    words = [str(folder / "camera.json"), str(folder / "frames"), "--poses", str(folder / "poses.txt")]
    options = ["--poses-of", "camera", "-o", str(folder / "map"), "--resolution", "0.1", "--tile", "64"]
    return main(["mosaic", *words, *options, "--distance", "2", "20", "--ground", "0", *more])


def test_the_command_makes_the_map(drive, frames, capsys):
    assert run(drive, "--picture", str(drive / "map.png"), "--tiles", str(drive / "site")) == 0
    told = capsys.readouterr().out
    assert "6 frames" in told and "ms a frame" in told
    with ipm_rs.Mosaic.load(drive / "map") as mosaic:
        names = ("weighted", "count")
        expected, got = mosaic_of(frames).layers(names=names), mosaic.layers(names=names)
        # poses that went through a file of the camera's own frame are off by roundings
        assert (expected["count"] != got["count"]).mean() < 1e-3
        assert "000003" in mosaic
    with Image.open(drive / "map.png") as page:
        assert page.size[0] > 100
    assert (drive / "site" / "index.html").exists()
    assert run(drive, "--force") == 0
    assert "0 frames (6 were there)" in capsys.readouterr().out


def test_a_run_may_be_in_parts(drive, capsys):
    assert run(drive, "--every", "2", "--quiet") == 0
    assert run(drive, "--quiet") == 0
    (drive / "map").rename(drive / "parts")
    assert run(drive, "--quiet") == 0
    assert capsys.readouterr().out == ""
    with ipm_rs.Mosaic.load(drive / "map") as whole, ipm_rs.Mosaic.load(drive / "parts") as parts:
        assert whole.frames == parts.frames == 6
        assert_same(whole, parts)


def test_mistakes_are_told_in_a_line(drive, capsys, frames):
    def told(*more):
        assert run(drive, *more) == 2
        err = capsys.readouterr().err
        assert err.startswith("ipm-rs: error: ") and err.count("\n") == 1
        return err

    assert "wheels" in told("--ground", "low")
    assert "below the camera" in told("--ground", "9")
    assert "--picture" in told("--x", "0", "5")
    jump = [pose for _, pose in frames[:3]] + [standing_at(500.0 + k) for k in range(3)]
    np.savetxt(drive / "poses.txt", [pose[:3].ravel() for pose in jump])
    assert "at most 50 m apart" in told()
    np.savetxt(drive / "poses.txt", [pose[:3].ravel() for pose in jump[:2]])
    assert "a pose for each frame" in told("--max-step", "1000")
    (drive / "poses.txt").write_text("not numbers\n")
    assert "poses.txt" in told()
    (drive / "poses.txt").unlink()
    assert "poses.txt" in told()
