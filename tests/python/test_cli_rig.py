"""``ipm-rs rig`` writes what `RigLut` computes, and refuses every mistake before any work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers import textured
from PIL import Image

import ipm_rs
from ipm_rs import cli

K = [[60.0, 0, 63.5], [0, 60.0, 47.5], [0, 0, 1]]
GRID = ["--x", "-6", "6", "--y", "-6", "6", "--resolution", "0.1"]


def camera(yaw) -> ipm_rs.Camera:
    return ipm_rs.Camera.from_euler(K, image_size=(128, 96), position=(0, 0, 1.4), pitch=0.6, yaw=yaw)


RIG = ipm_rs.Rig({"front": camera(0), "left": camera(1.2), "back": camera(3.1)})
IMAGES = {name: textured(96, 128, 3, seed=seed) for seed, name in enumerate(RIG)}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    RIG.save("rig.json")
    for name, image in IMAGES.items():
        Image.fromarray(image).save(f"{name}.png")
        Path(name).mkdir()
        for frame in range(3):
            Image.fromarray(np.roll(image, frame, axis=1)).save(f"{name}/{frame}.png")
    return tmp_path


def words(names=tuple(RIG), ending=".png") -> list[str]:
    return [f"{name}={name}{ending}" for name in names]


def run(*arguments: str) -> int:
    return cli.main(["rig", "rig.json", *arguments, *GRID])


def lut(**options) -> ipm_rs.RigLut:
    return ipm_rs.RigLut(RIG, ipm_rs.BevGrid(x=(-6, 6), y=(-6, 6), resolution=0.1), **options)


def read(path: str) -> np.ndarray:
    return np.asarray(Image.open(path))


def test_one_view_with_its_maps(here, capsys):
    box = ["--exclude", "-1", "1.5", "-0.8", "0.8"]
    assert run(*words(), "-o", "bev.png", "--mask", "mask.png", "--source", "source.png", *box, "--gains") == 0
    table = lut(exclude=[[[-1, -0.8], [1.5, -0.8], [1.5, 0.8], [-1, 0.8]]])
    np.testing.assert_array_equal(read("bev.png"), table.warp(IMAGES, interpolation="area", gains=table.gains(IMAGES)))
    np.testing.assert_array_equal(read("mask.png") > 0, table.mask)
    colours = {tuple(colour) for colour in read("source.png").reshape(-1, 3)}
    assert len(colours) == 4 and (0, 0, 0) in colours
    assert "front: #e66101" in capsys.readouterr().out


def test_options_are_those_of_the_table(here):
    options = ["--blend", "feather", "--feather", "1", "--bowl", "4", "3", "--interpolation", "bilinear"]
    assert run(*words(), "-o", "bev.png", "--border-value", "9", *options) == 0
    table = lut(blend="feather", feather=1, ground=ipm_rs.Bowl(4, 3))
    np.testing.assert_array_equal(read("bev.png"), table.warp(IMAGES, border_value=9))


def test_directories_are_gone_through_side_by_side(here):
    assert run(*words(ending=""), "-o", "bevs/", "--quiet") == 0
    assert sorted(path.name for path in Path("bevs").iterdir()) == ["0_bev.png", "1_bev.png", "2_bev.png"]
    rolled = {name: np.roll(image, 2, axis=1) for name, image in IMAGES.items()}
    np.testing.assert_array_equal(read("bevs/2_bev.png"), lut().warp(rolled, interpolation="area"))


def test_a_missing_or_damaged_image(here, capsys):
    assert run(*words(["front", "left"]), "-o", "bev.png", "--missing", "next") == 0
    expected = lut().warp({**IMAGES, "back": None}, interpolation="area", missing="next")
    np.testing.assert_array_equal(read("bev.png"), expected)
    Path("left/1.png").write_bytes(b"\x89PNG\r\n\x1a\nno")
    assert run(*words(ending=""), "-o", "bevs/") == 2
    assert "1 of 3 views" in capsys.readouterr().err and not Path("bevs/1_bev.png").exists()
    assert run(*words(ending=""), "-o", "bevs/", "--force", "--missing", "border") == 0
    assert Path("bevs/1_bev.png").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["front.png", "-o", "bev.png"], "expected NAME=IMAGE"),
        (["rear=front.png", "-o", "bev.png"], "expected a camera of the rig, got 'rear'"),
        (["front=front.png", "front=left.png", "-o", "bev.png"], "'front' twice"),
        ([*words(["front", "left"]), "-o", "bev.png"], "got none for back"),
        ([*words(["front", "left"]), "back=back", "-o", "bev.png"], "all directories"),
        ([*words(), "-o", "front.png", "--force"], "got an input"),
        ([*words(), "-o", "bev.xyz"], "bev.xyz"),
        ([*words(), "-o", "bev.png", "--mask", "bev.png"], "got it twice"),
        ([*words(), "-o", "rig.json"], "rig.json"),
        ([*words(), "-o", "bev.png", "--feather", "-1"], "feather"),
        ([*words(), "-o", "bev.png", "--bowl", "0", "3"], "flat"),
        (["front=none.png", *words(["left", "back"]), "-o", "bev.png"], "none.png"),
        ([*words(["left", "back"]), "front=small.png", "-o", "bev.png"], "expected 128x96 pixels"),
        ([*words(["left", "back"]), "front=grey.png", "-o", "bev.png"], "mode"),
        (["front=front", "left=left", "back=few", "-o", "bevs/"], "back 1"),
        ([*words(), "-o", "bev.png", "--image-size", "3", "4"], "no options"),
    ],
)
def test_mistakes_are_told_in_a_line_and_write_nothing(here, capsys, arguments, said):
    Image.fromarray(textured(9, 12, 3)).save("small.png")
    Image.fromarray(textured(96, 128)).save("grey.png")
    Path("few").mkdir()
    Image.fromarray(IMAGES["back"]).save("few/0.png")
    before = sorted(Path().rglob("*"))
    assert run(*arguments) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1, error
    assert sorted(Path().rglob("*")) == before
