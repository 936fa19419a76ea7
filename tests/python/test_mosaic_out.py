"""What leaves a mosaic: tiles for a page, GeoTIFF; and ``ipm-rs mosaic``."""

from __future__ import annotations

import json
import pickle
import re
import shutil
import sys
import types

import numpy as np
import pytest
from PIL import Image
from test_mosaic import HEIGHT, POSES, WIDTH, assert_same, camera, mosaic_of, seen_from, standing_at

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
        assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.tif"]
    with pytest.raises(ipm_rs.ArgumentError, match="crs"):
        mosaic.export_geotiff(tmp_path / "other.tif", crs="nowhere")
    with pytest.raises(ipm_rs.FileError):
        mosaic.export_geotiff(tmp_path / "nowhere" / "map.tif", crs="EPSG:32632")
    with pytest.raises(ipm_rs.ArgumentError, match="origin"):
        mosaic.export_geotiff(tmp_path / "other.tif", crs="EPSG:32632", origin=(1, np.nan))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.tif"]


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of affine, by rasterio
def test_overviews_of_labels_have_no_labels_that_are_none(tmp_path):
    rasterio = pytest.importorskip("rasterio")
    mosaic = ipm_rs.Mosaic(0.02, labels=True)
    picture = np.where(np.indices((HEIGHT, WIDTH)).sum(0) // 7 % 2, 10, 200).astype(np.uint8)
    mosaic.add(camera(), picture, map_from_vehicle=np.eye(4), distance=(0, 15))
    mosaic.export_geotiff(tmp_path / "map.tif", crs="EPSG:32632")
    with rasterio.open(tmp_path / "map.tif") as file:
        factors = file.overviews(1)
        assert factors
    with rasterio.open(tmp_path / "map.tif", overview_level=0) as file:
        values, alpha = file.read()
        assert set(np.unique(values[alpha == 255])) == {10, 200}


@pytest.fixture
def drive(tmp_path, frames):
    """A calibration, a folder of pictures and poses of the camera, as KITTI has them."""
    camera().save(tmp_path / "camera.json")
    (tmp_path / "frames").mkdir()
    for number, (image, _) in enumerate(frames):
        Image.fromarray(image).save(tmp_path / "frames" / f"{number:06d}.png")
    write_poses(tmp_path, [pose for _, pose in frames])
    return tmp_path


def write_poses(folder, poses):
    mount = camera().vehicle_from_camera
    rows = [(np.linalg.inv(mount) @ pose @ mount)[:3].ravel() for pose in poses]  # the map is the first camera
    np.savetxt(folder / "poses.txt", rows)


def run(folder, *more, streams=None, calibration="camera.json"):
    words = [str(folder / calibration), *(streams or [str(folder / "frames")]), "--poses", str(folder / "poses.txt")]
    options = ["-o", str(folder / "map"), "--resolution", "0.1", "--tile", "64"]
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


def test_drives_whose_files_are_called_alike_are_both_added(drive, frames, capsys):
    """In a second run, in one run, and the first again from where it was moved to."""
    lift = np.eye(4)
    lift[1, 3] = 2.0
    others = [(seen_from(camera(), lift @ pose), lift @ pose) for _, pose in frames]
    (drive / "second" / "frames").mkdir(parents=True)
    for number, (image, _) in enumerate(others):
        Image.fromarray(image).save(drive / "second" / "frames" / f"{number:06d}.png")
    mount = camera().vehicle_from_camera
    rows = [(np.linalg.inv(mount) @ pose @ mount)[:3].ravel() for _, pose in [*frames, *others]]
    assert run(drive) == 0
    np.savetxt(drive / "poses.txt", rows[6:])
    assert run(drive, streams=[str(drive / "second" / "frames")]) == 0
    out = capsys.readouterr().out
    assert out.count(" 6 frames") == 2 and "were there" not in out
    with ipm_rs.Mosaic.load(drive / "map") as mosaic:
        assert mosaic.frames == 12
    (drive / "second").rename(drive / "moved")
    assert run(drive, streams=[str(drive / "moved" / "frames")]) == 0
    assert "0 frames (6 were there)" in capsys.readouterr().out

    (drive / "map").rename(drive / "in turn")
    np.savetxt(drive / "poses.txt", rows)
    both = drive / "both.txt"
    both.write_text("\n".join(f"{place}/{n:06d}.png" for place in ("frames", "moved/frames") for n in range(6)))
    assert run(drive, "--max-step", "100", streams=[str(both)]) == 0
    assert " 12 frames  " in capsys.readouterr().out
    with ipm_rs.Mosaic.load(drive / "map") as one, ipm_rs.Mosaic.load(drive / "in turn") as other:
        assert one.frames == 12
        assert_same(one, other)


def test_a_map_with_bare_names_is_gone_on_with_and_that_is_said(drive, frames, capsys):
    with ipm_rs.Mosaic(0.1, tile=64, path=drive / "map") as mosaic:
        image, pose = frames[0]
        mosaic.add(camera(), image, map_from_vehicle=pose, distance=(2, 20), name="000000")
    assert run(drive) == 0
    told = capsys.readouterr()
    assert "5 frames (1 were there)" in told.out and "1 frames were taken for those of the same file names" in told.err


def test_the_command_takes_rigs(drive, frames, capsys):
    """Two cameras whose pictures were taken at once; where one lacks its picture, the other is added."""
    rig = ipm_rs.Rig({"front": camera(), "left": camera(yaw=0.6), "unused": camera(yaw=-2.0)})
    rig.save(drive / "rig.json")
    (drive / "left").mkdir()
    sides = [seen_from(camera(yaw=0.6), pose) for _, pose in frames]
    for number, image in enumerate(sides):
        Image.fromarray(image).save(drive / "left" / f"{number:06d}.png")
    streams = [f"front={drive / 'frames'}", f"left={drive / 'left'}"]
    assert run(drive, "--samples", "4", "--blend", "robust", calibration="rig.json", streams=streams) == 0
    assert "6 frames" in capsys.readouterr().out
    expected = ipm_rs.Mosaic(0.1, tile=64, samples=4)
    for number, ((image, pose), side) in enumerate(zip(frames, sides, strict=True)):
        both = {"front": image, "left": side}
        seen = ipm_rs.Rig({name: rig[name] for name in both})
        expected.add(seen, both, map_from_vehicle=pose, distance=(2, 20), name=f"{number:06d}")
    with ipm_rs.Mosaic.load(drive / "map") as mosaic:
        one, other = (each.layers(names=("count", "robust")) for each in (expected, mosaic))
        assert mosaic.samples == 4
    assert (one["count"] != other["count"]).mean() < 1e-3
    assert (np.abs(one["robust"].astype(int) - other["robust"]) > 2).mean() < 1e-3
    assert run(drive, "--quiet", calibration="rig.json", streams=streams) == 0, "what the map keeps is known"
    assert run(drive, calibration="rig.json", streams=[f"rear={drive / 'left'}"]) == 2
    assert "camera of the rig" in capsys.readouterr().err


def test_the_command_draws_evens_out_and_votes(drive, frames, capsys):
    assert run(drive, "--gains", "--picture", str(drive / "map.png")) == 0
    assert run(drive, "--picture", str(drive / "plain.png"), "--no-track") == 0
    capsys.readouterr()
    with Image.open(drive / "map.png") as drawn, Image.open(drive / "plain.png") as plain:
        changed = np.flatnonzero((np.asarray(drawn) != np.asarray(plain)).any(2).any(0))
        assert 2 <= len(changed) < drawn.size[0] / 2, "the way of the vehicle"
    (drive / "map").rename(drive / "with-gains")
    assert run(drive, "--labels", "--quiet") == 0
    with ipm_rs.Mosaic.load(drive / "map") as mosaic:
        assert mosaic.labels and mosaic.frames == 6


def test_the_command_on_a_cluster(drive, monkeypatch, capsys):
    """The frames go to `ipm_rs.ray.mosaic` as what reads them, with the names that a run here gives them."""
    assert run(drive, "--quiet") == 0
    (drive / "map").rename(drive / "here")
    assert run(drive, "--quiet", "--every", "2") == 0

    def mosaic(frames, into, *, ground, distance, strict, address, report):
        frames = pickle.loads(pickle.dumps(list(frames)))
        assert address == "auto" and not strict and [name[:6] for *_, name in frames] == ["000001", "000003", "000005"]
        for lens, read, pose, name in frames:
            into.add(lens, read(), map_from_vehicle=pose, ground=ground, distance=distance, name=name)
        report(len(frames), [])
        return len(frames)

    monkeypatch.setitem(sys.modules, "ipm_rs.ray", types.SimpleNamespace(mosaic=mosaic))
    monkeypatch.setattr(ipm_rs, "ray", types.SimpleNamespace(mosaic=mosaic), raising=False)
    assert run(drive, "--ray", "auto") == 0
    assert "3 frames (3 were there)" in capsys.readouterr().out
    with ipm_rs.Mosaic.load(drive / "here") as one, ipm_rs.Mosaic.load(drive / "map") as other:
        assert_same(one, other)


def test_a_track_is_drawn_where_it_is():
    grid = ipm_rs.BevGrid(x=(0, 10), y=(-5, 5), resolution=0.1)
    view = np.zeros(grid.shape, np.uint8)
    page = np.asarray(ipm_rs.draw.axes(view, grid)).astype(int)
    track = [[2.0, 3.0], [8.0, 3.0], [np.nan, np.nan], [5.0, -4.0], [5.0, -2.0], [1e9, 1e9]]
    drawn = np.asarray(ipm_rs.draw.axes(view, grid, track=track)).astype(int)
    rows, columns = np.nonzero(np.abs(drawn - page).sum(2) > 200)
    top, left = rows.min(), columns.min()  # of (8, 3)
    assert rows.max() - top == pytest.approx(60, abs=4) and columns.max() - left == pytest.approx(70, abs=4)
    for wrong in ([1, 2], [[1, 2, 3]], [["a", "b"]]):
        with pytest.raises(ipm_rs.ArgumentTypeError, match="track"):
            ipm_rs.draw.axes(view, grid, track=wrong)


def test_mistakes_are_told_in_a_line(drive, capsys, frames):
    def told(*more):
        assert run(drive, *more) == 2
        err = capsys.readouterr().err
        assert err.startswith("ipm-rs: error: ") and err.count("\n") == 1
        return err

    np.savetxt(drive / "poses.txt", [pose[:3].ravel() for _, pose in frames])  # the vehicle's, where a camera's belong
    assert "--poses-of vehicle" in told()
    assert run(drive, "--poses-of", "vehicle", "--quiet") == 0
    shutil.rmtree(drive / "map")
    write_poses(drive, [pose for _, pose in frames])  # a camera's, where the vehicle's belong
    assert "--poses-of camera" in told("--poses-of", "vehicle")
    assert not (drive / "map" / "tiles").exists() or not list((drive / "map" / "tiles").iterdir()), "nothing was added"
    assert "--geotiff with it" in told("--crs", "EPSG:32632")
    assert "--crs with it" in told("--geotiff", str(drive / "map.tif"))
    assert "brightness" in told("--labels", "--gains")
    assert "--ray, got both" in told("--ray", "--gains")
    assert "map of labels, got one of pictures" in told("--blend", "labels")
    assert not (drive / "map").exists()
    ipm_rs.Mosaic(0.1, tile=64, path=drive / "map").close()
    assert "keeps samples" in told("--blend", "robust")
    assert "wheels" in told("--ground", "low")
    assert "below the camera" in told("--ground", "9")
    assert "--picture" in told("--x", "0", "5")
    jump = [pose for _, pose in frames[:3]] + [standing_at(500.0 + k) for k in range(3)]
    write_poses(drive, jump)
    assert "at most 50 m apart" in told()
    write_poses(drive, jump[:2])
    assert "a pose for each frame" in told("--max-step", "1000")
    (drive / "poses.txt").write_text("not numbers\n")
    assert "poses.txt" in told()
    (drive / "poses.txt").unlink()
    assert "poses.txt" in told()
