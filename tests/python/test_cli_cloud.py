"""``ipm-rs cloud``: what it writes is what the library computes, and every mistake is refused before any work."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import same, textured
from PIL import Image

import ipm_rs
from ipm_rs import cli, pointfile

WIDTH, HEIGHT = 64, 48
K = [[40.0, 0, 31.5], [0, 40, 23.5], [0, 0, 1]]
GRID = ["--x", "0", "20", "--y", "-8", "8", "--resolution", "0.5"]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """``camera.json``, ``depth.npy`` of a road with a wall on it, ``rgb.png``."""
    monkeypatch.chdir(tmp_path)
    camera().save("camera.json")
    np.save("depth.npy", depth())
    Image.fromarray(textured(HEIGHT, WIDTH, 3)).save("rgb.png")
    return tmp_path


def camera() -> ipm_rs.Camera:
    return ipm_rs.Camera.from_euler(K, image_size=(WIDTH, HEIGHT), position=(1.0, 0.0, 1.5), pitch=0.1)


def depth() -> np.ndarray:
    """The road at z = 0 up to a wall 12 m ahead, and the sky, at 1000, beyond 3 m of height."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    ground = camera().ground_from_pixels(np.stack([u, v], -1).reshape(-1, 2).astype(float))
    z = np.einsum("ij,nj->ni", camera().camera_from_vehicle[:3], np.c_[ground, np.ones(len(ground))])[:, 2]
    z = np.where(np.isfinite(z) & (z < 11), z, 11).reshape(HEIGHT, WIDTH)
    z[:6] = 1000
    return z.astype(np.float32)


def cloud(*arguments: str) -> int:
    return cli.main(["cloud", "camera.json", *arguments])


def expected(**options) -> tuple[np.ndarray, np.ndarray]:
    return ipm_rs.points_from_depth(depth(), camera(), compact=True, **({"frame": "vehicle"} | options))


def test_cloud_and_picture(here, capsys):
    assert cloud("depth.npy", "--rgb", "rgb.png", "--max-depth", "100", "-o", "a.ply", "--bev", "a.png", *GRID) == 0
    points, index = expected(max_depth=100)
    colours = textured(HEIGHT, WIDTH, 3).reshape(-1, 3)[index]
    back = pointfile.read("a.ply")
    assert same(back.points, points)
    assert [back.values[name].tolist() for name in ("red", "green", "blue")] == colours.T.tolist()
    grid = ipm_rs.BevGrid(x=(0, 20), y=(-8, 8), resolution=0.5)
    layers = ipm_rs.rasterize(points, grid, colours, ("count", "top"))
    picture = np.asarray(Image.open("a.png"))
    assert same(picture, np.nan_to_num(layers["top"]).astype(np.uint8))
    out, err = capsys.readouterr()
    assert out.split("\n")[0].startswith(f"a.ply  {len(points)} points") and f"{layers.inside} of" in out and not err


def test_heights_without_colours(here, capsys):
    assert cloud("depth.npy", "--bev", "a.png", "--max-depth", "100", "--heights", "0", "3", "--quiet", *GRID) == 0
    picture = np.asarray(Image.open("a.png")).astype(int)
    road, wall = picture[40 - 8], picture[40 - 25]  # rows of x = 4 m and of x about 12 m
    assert picture[road.any(axis=1).nonzero()[0]].size and wall.sum(axis=1).max() > 600 > road.sum(axis=1).max() > 0
    assert (picture[:10] == 0).all(), "nothing behind the wall"
    assert capsys.readouterr().out == ""


def test_depth_of_every_kind(here):
    z = np.round(depth() * 200) / 200
    np.save("metres.npy", z)
    np.savez_compressed("metres.npz", depth=z, other=np.zeros(3))
    Image.fromarray(z).save("metres.tif")
    Image.fromarray((np.minimum(z, 300) * 200).round().astype(np.uint16)).save("units.png")
    code = ipm_rs.encode_carla_depth(z, order="rgba")
    Image.fromarray(code).save("code.png")
    Image.fromarray(code[..., :3]).save("code3.png")
    for name, more in {
        "metres.npy": [],
        "metres.npz": [],
        "metres.tif": [],
        "units.png": ["--depth-scale", "0.005"],
        "code.png": [],
        "code3.png": [],
    }.items():
        assert cloud(name, *more, "--max-depth", "100", "-o", "a.ply", "--force") == 0, name
        points, _ = ipm_rs.points_from_depth(z, camera(), frame="vehicle", max_depth=100, compact=True)
        np.testing.assert_allclose(pointfile.read("a.ply").points, points, atol=2e-4)


@pytest.mark.parametrize("frame", ["vehicle", "flu", "camera"])
def test_options_reach_the_library(here, frame):
    arguments = ["--frame", frame, "--stride", "3", "--min-depth", "4", "--max-depth", "9", "--kind", "ray"]
    assert cloud("depth.npy", *arguments, "--threads", "1", "-o", "a.npy") == 0
    points, _ = expected(frame=frame, stride=3, min_depth=4, max_depth=9, kind="ray")
    assert same(np.load("a.npy"), points)


def test_several_into_directories(here, capsys, monkeypatch):
    for i in range(3):
        np.save(f"d{i}.npy", depth() + np.float32(i))
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    names = [f"d{i}.npy" for i in range(3)]
    assert cloud(*names, "--rgb", *["rgb.png"] * 3, "-o", "clouds/", "--bev", "bevs/", *GRID) == 0
    assert sorted(path.name for path in Path("clouds").iterdir()) == ["d0.ply", "d1.ply", "d2.ply"]
    assert sorted(path.name for path in Path("bevs").iterdir()) == ["d0_bev.png", "d1_bev.png", "d2_bev.png"]
    assert "3/3" in capsys.readouterr().err, "the bar"
    Path("d1.npy").write_bytes(Path("d1.npy").read_bytes()[:-8])
    assert cloud(*names, "-o", "again/") == 2
    assert sorted(path.name for path in Path("again").iterdir()) == ["d0.ply", "d2.ply"], "the others are made"


def test_a_damaged_image_does_not_stop_the_others(here, capsys):
    for i in range(3):
        Image.fromarray(textured(HEIGHT, WIDTH, None, "uint16")).save(f"d{i}.png")
    Path("d1.png").write_bytes(Path("d1.png").read_bytes()[:-2000])
    assert cloud("d0.png", "d1.png", "d2.png", "--depth-scale", "0.001", "-o", "out/") == 2
    assert sorted(path.name for path in Path("out").iterdir()) == ["d0.ply", "d2.ply"]
    message = capsys.readouterr().err.splitlines()
    assert len(message) == 2 and "d1.png" in message[0] and "1 of 3" in message[1]


def test_no_point_on_the_grid_is_said(here, capsys):
    assert cloud("depth.npy", "--bev", "a.png", "--x", "500", "520", "--max-depth", "100") == 0
    assert "no point is on the grid" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "phrases"),
    [
        ("depth.npy", ["expected -o or --bev"]),
        ("none.npy -o a.ply", ["none.npy", "found none"]),
        ("rgb.txt -o a.ply", ["rgb.txt"]),
        ("depth.npy -o a.obj", ["a.obj", ".ply"]),
        ("depth.npy --bev a.gif", ["a.gif", ".png"]),
        ("depth.npy -o camera.json", ["camera.json", "input"]),
        ("depth.npy -o there.ply", ["there.ply", "exists", "--force"]),
        ("depth.npy -o no/where/a.ply", ["directory"]),
        ("depth.npy depth.npy -o a.ply", ["a directory for 2"]),
        ("depth.npy depth.npy -o out/", ["got it twice"]),
        ("depth.npy --bev a.png --frame camera", ["--frame", "vehicle or flu"]),
        ("depth.npy --bev a.png --heights 3 1", ["--heights", "MIN < MAX"]),
        ("depth.npy --rgb rgb.png rgb.png -o a.ply", ["--rgb", "1 images", "got 2"]),
        ("depth.npy --rgb small.png -o a.ply", ["small.png", "64x48", "8x8"]),
        ("small.npy -o a.ply", ["64x48", "8x8"]),
        ("units.png -o a.ply", ["--depth-scale", "0.001"]),
        ("rgb.png --depth-scale 0.1 -o a.ply", ["no --depth-scale", "CARLA"]),
        ("grey.png -o a.ply", ["mode L"]),
        ("flat.npy -o a.ply", ["(H, W)", "(7,)"]),
        ("objects.npy -o a.ply", ["objects.npy", "damaged"]),
        ("bomb.npy -o a.ply", ["bomb.npy", "damaged"]),
        ("depth.npy -o a.ply --stride 0", ["--stride", "at least 1"]),
        ("depth.npy -o a.ply --max-depth x", ["--max-depth", "number"]),
        ("depth.npy -o a.ply --min-depth 5 --max-depth 2", ["depth"]),
        ("depth.npy -o a.ply --camera left", ["camera"]),
        ("depth.npy -o a.ply --resolution 0", ["resolution"]),
    ],
)
def test_mistakes(here, capsys, arguments, phrases):
    Path("there.ply").write_bytes(b"mine")
    Image.fromarray(textured(8, 8, 3)).save("small.png")
    np.save("small.npy", np.ones((8, 8), np.float32))
    Image.fromarray(np.ones((HEIGHT, WIDTH), np.uint16)).save("units.png")
    Image.fromarray(np.ones((HEIGHT, WIDTH), np.uint8)).save("grey.png")
    Path("rgb.txt").write_text("no image")
    np.save("flat.npy", np.ones(7, np.float32))
    np.save("objects.npy", np.array([[None]]), allow_pickle=True)
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (9999999, 9999999), }"
    Path("bomb.npy").write_bytes(b"\x93NUMPY\x01\x00v\x00" + header.ljust(117) + b"\n")
    before = {path.name: path.read_bytes() for path in here.iterdir()}
    assert cloud(*arguments.split()) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("ipm-rs: error: "), err
    assert all(phrase in err for phrase in phrases), err
    assert {path.name: path.read_bytes() for path in here.iterdir()} == before


def test_help_ends_with_examples(here, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    assert cli.main(["cloud", "--help"]) == 0
    text = capsys.readouterr().out
    assert "\nExamples:\n" in text and text.rstrip().split("\n")[-1].startswith("  ipm-rs cloud ")
    for line in text.split("Examples:\n")[1].splitlines():
        arguments = line.split("#")[0].split()
        assert cli._parser().parse_args(arguments[1:]).run is not None


def test_the_road_of_carla(shared_data, here):
    """CARLA's own depth image through its code: the road is a plane at z = 0."""
    folder = shared_data / "carla"
    metres = np.load(folder / "depth_metres_1024x768_fov90.npz")["depth"]
    Image.fromarray(ipm_rs.encode_carla_depth(metres, order="rgb")).save("code.png")
    K = [[512.0, 0, 511.5], [0, 512, 383.5], [0, 0, 1]]
    ipm_rs.Camera.from_euler(K, image_size=(1024, 768), position=(0, 0, 1.8)).save("carla.json")
    rgb = str(folder / "depth_rgb_1024x768.png")
    grid = ["--x", "2", "22", "--y", "-8", "8", "--resolution", "0.1", "--max-depth", "60"]
    assert cli.main(["cloud", "carla.json", "code.png", "--rgb", rgb, "-o", "a.ply", "--bev", "a.png", *grid]) == 0
    points = pointfile.read("a.ply").points
    near = points[(points[:, 0] < 12) & (np.abs(points[:, 1]) < 1)]
    slope, residual, *_ = np.linalg.lstsq(np.c_[near[:, :2], np.ones(len(near))], near[:, 2], rcond=None)
    assert len(near) > 20_000 and np.abs(slope[:2]).max() < 0.02
    assert np.sqrt(residual[0] / len(near)) < 0.01
