"""``ipm-rs mosaic``: what is refused before the drive is gone through, and what does not end a run."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses
from PIL import Image
from test_mosaic import HEIGHT, WIDTH, camera, standing_at
from test_mosaic_out import drive, frames, run

import ipm_rs
from ipm_rs import streams
from ipm_rs.cli import main, mosaic_ray

__all__ = ["drive", "frames"]


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "words",
    [
        ["--picture", "frames/000000.png"],
        ["--picture", "link.png"],
        ["--geotiff", "poses.txt", "--crs", "EPSG:32632"],
        ["--geotiff", "camera.json", "--crs", "EPSG:32632"],
        ["--geotiff", "map/mosaic.json", "--crs", "EPSG:32632"],
    ],
)
def test_force_replaces_no_input(drive, monkeypatch, capsys, words):
    monkeypatch.chdir(drive)
    pytest.importorskip("rasterio")
    assert run(drive, "--quiet", "--every", "5") == 0
    (drive / "link.png").symlink_to(drive / "frames" / "000001.png")
    before = contents(drive)
    assert run(drive, *words, "--force") == 2
    assert "expected an output, got an input" in capsys.readouterr().err
    assert contents(drive) == before


def test_force_replaces_nothing_of_a_dataset(drive, capsys):
    """A sequence whose own folder is named, and not its pictures."""
    sequence = drive / "sequences" / "00"
    sequence.mkdir(parents=True)
    (drive / "frames").rename(sequence / "image_0")
    (sequence / "calib.txt").write_text("P0: 120 0 79.5 0 0 120 44.5 0 0 0 1 0\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n")
    for name in ("calib.txt", "image_0/000003.png"):
        words = ["--picture", str(sequence / name)] if name.endswith("png") else ["--geotiff", str(sequence / name)]
        more = [] if name.endswith("png") else ["--crs", "EPSG:32632"]
        code = run(drive, "--force", *words, *more, streams=[str(sequence)])
        assert code == 2
        assert "got an input" in capsys.readouterr().err


def test_two_outputs_are_two_files(drive, capsys):
    same = str(drive / "same.tif")
    assert run(drive, "--picture", same, "--geotiff", same, "--crs", "EPSG:32632", "--force") == 2
    assert "a name of its own for each output" in capsys.readouterr().err
    assert not (drive / "map").exists()


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of affine, by rasterio
def test_what_is_wrong_is_told_of_before_frames_are_added(drive, capsys):
    pytest.importorskip("rasterio")
    picture = ["--picture", str(drive / "map.png")]
    for words, phrase in (
        (["--geotiff", str(drive / "map.tif"), "--crs", "junk"], "--crs"),
        (["--geotiff", str(drive / "map.tif"), "--crs", "EPSG:4326"], "--crs: expected a projected"),
        ([*picture, "--x", "5", "1"], "--x"),
        ([*picture, "--y", "0", "0.123"], "--y"),
    ):
        assert run(drive, *words) == 2
        assert phrase in capsys.readouterr().err
        assert not (drive / "map").exists()


def test_a_run_that_adds_nothing_leaves_no_map(drive, capsys):
    words = ["mosaic", str(drive / "camera.json"), str(drive / "frames"), "-o", str(drive / "map")]
    assert main(words) == 2
    assert "expected poses" in capsys.readouterr().err and not (drive / "map").exists()
    (drive / "map").mkdir()
    (drive / "map" / "notes.txt").write_text("mine")
    assert main(words) == 2
    assert [path.name for path in (drive / "map").iterdir()] == ["notes.txt"]
    (drive / "map" / "notes.txt").unlink()
    assert main(words) == 2
    assert (drive / "map").exists() and not list((drive / "map").iterdir()), "the folder was there"
    assert run(drive, "--distance", "300", "301") == 2
    assert "see the road" in capsys.readouterr().err and not list((drive / "map").iterdir())
    assert run(drive) == 0
    assert " 6 frames  " in capsys.readouterr().out


def test_a_map_that_is_too_large_for_a_picture_is_made(drive, capsys):
    for number in (2, 3, 4, 5):
        (drive / "frames" / f"{number:06d}.png").unlink()
    far = [standing_at(0.0), standing_at(2000.0, 2000.0)]
    np.savetxt(drive / "poses.txt", [pose[:3].ravel() for pose in far])
    options = ["--poses-of", "vehicle", "--max-step", "1e4", "--picture", str(drive / "map.png")]
    assert run(drive, *options) == 0
    told = capsys.readouterr()
    assert "2 frames" in told.out and "--x MIN MAX and --y MIN MAX" in told.err and not (drive / "map.png").exists()
    assert run(drive, *options, "--x", "2000", "2020", "--y", "1990", "2010") == 0
    assert (drive / "map.png").exists() and capsys.readouterr().err == ""


def test_kittis_poses_are_by_number_also_with_times_beside_them(drive, capsys):
    np.savetxt(drive / "times.txt", 0.1 * np.arange(6))
    assert run(drive) == 0
    assert "6 frames" in capsys.readouterr().out
    (drive / "times.txt").unlink()
    assert run(drive) == 0
    assert "(6 were there)" in capsys.readouterr().out


def test_a_frame_of_another_size_is_named_and_left_out(drive, capsys):
    Image.fromarray(np.zeros((HEIGHT, WIDTH // 2), np.uint8)).save(drive / "frames" / "000002.png")
    Image.fromarray(np.zeros((HEIGHT, WIDTH, 3), np.uint8)).save(drive / "frames" / "000004.png")
    assert run(drive) == 2
    told = capsys.readouterr()
    assert "frame 000002: " in told.err and "frame 000004: " in told.err and "2 of 6 frames" in told.err
    assert " 4 frames" in told.out
    with ipm_rs.Mosaic.load(drive / "map") as mosaic:
        assert mosaic.frames == 4
    assert run(drive, "--strict") == 2
    assert capsys.readouterr().err.startswith(f"ipm-rs: error: {drive / 'frames'}: frame 000002: ")


def test_the_doctor_replaces_no_input(drive, monkeypatch, capsys):
    monkeypatch.chdir(drive)
    ipm_rs.Rig({"front": camera()}).save("rig.json")
    before = contents(drive)
    for words in (["camera.json", "frames/000000.png"], ["rig.json", "front=frames/000000.png"]):
        assert main(["doctor", *words, "-o", "frames/000000.png", "--force"]) == 2
        assert "got an input" in capsys.readouterr().err
    assert contents(drive) == before


def test_a_worker_names_a_frame_of_another_size():
    picture = np.zeros((HEIGHT, WIDTH // 2), np.uint8)
    ticket = streams.Ticket("000002", 2, None, lambda: streams.Frame(picture, "000002", 2))
    with refuses(ipm_rs.ImageError, "frames/: frame 000002: expected", f"got {WIDTH // 2}x{HEIGHT}"):
        mosaic_ray._image_of("frames/", ticket, {"": (WIDTH, HEIGHT)})
    both = streams.Ticket("7", 7, None, lambda: streams.Frame({"left": picture}, "7", 7))
    assert mosaic_ray._image_of("frames/", both, {"left": (WIDTH // 2, HEIGHT)})["left"] is picture
