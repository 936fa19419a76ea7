"""The analytic road is what it says, and the demo's numbers would show half a pixel of error."""

from __future__ import annotations

import copy
import math
import re
from pathlib import Path

import numpy as np
import pytest
from helpers import refuses
from PIL import Image

import ipm_rs
from ipm_rs import cli, demo, scene
from ipm_rs.draw import _style as style


@pytest.fixture(scope="module")
def result() -> demo.Result:
    """The demo as a user gets it, run once."""
    return demo.run()


def small_camera(divisor: int = 16, **pose: float) -> ipm_rs.Camera:
    """The demo's camera at 2048 / divisor pixels, with some of its pose changed."""
    numbers = copy.deepcopy(demo.CALIBRATION)
    numbers["extrinsic"] |= pose
    for key, value in numbers["intrinsic"].items():
        numbers["intrinsic"][key] = value / divisor if key in ("fx", "fy") else (value + 0.5) / divisor - 0.5
    return ipm_rs.Camera.from_cityscapes(numbers, image_size=(2048 // divisor, 1024 // divisor))


# ---------------------------------------------------------------------------------------------------------------------
# The scene


@pytest.mark.parametrize(
    ("x", "y", "material"),
    [
        (8.5, 9.5, scene.GRASS),
        (8.5, -8.5, scene.GRASS),
        (8.5, 7.3, scene.PAVEMENT),
        (8.4, 0.8, scene.ASPHALT),
        (30.5, 3.5, scene.PATCH),
        (13.5, -2.4, scene.CYCLE_LANE),
        (8.5, -1.8, scene.WHITE),  # the lane line on the right, nothing at its mirror image
        (7.5, 1.75, scene.YELLOW),
        (10.5, 1.75, scene.ASPHALT),  # a gap of the dashed line
        (18.5, 1.9, scene.WHITE),  # a bar of the zebra, and the gap beside it
        (18.5, 2.5, scene.ASPHALT),
        (10.1, 0.7, scene.WHITE),  # the arrow's head to the left, nothing to the right
        (10.1, -0.7, scene.ASPHALT),
        (11.4, 2.9, scene.IRON),
    ],
)
def test_colour_of_known_places(x: float, y: float, material: int) -> None:
    mean, grain = (np.array(values) for values in scene.MATERIALS[material])
    assert np.all(np.abs(scene.colour(x, y) - mean) <= 1.6 * grain + 1e-3)


def test_metre_grid_lines_stand_on_whole_metres() -> None:
    x = np.arange(8.0, 13.0, 0.01, dtype=np.float32)
    blue = scene.colour(x, -0.6)[:, 2]
    on_line = np.abs(x - np.rint(x)) < 0.012
    on_five = np.abs(x - 10.0) < 0.024
    assert blue[on_five].min() > blue[on_line & ~on_five].max() > np.median(blue[~on_line])
    assert blue[on_line].min() > blue[(np.abs(x - np.rint(x)) > 0.03)].max()


def test_channels_differ_and_nothing_is_symmetric() -> None:
    view = scene.truth(ipm_rs.BevGrid(x=(7, 50), y=(-5, 5), resolution=0.25))
    for other in (view[..., ::-1], view[:, ::-1], view[::-1], view[..., [1, 0, 2]], view[..., [0, 2, 1]]):
        assert np.abs(view - other).mean() > 5


def test_truth_is_the_mean_over_each_cell() -> None:
    grid = ipm_rs.BevGrid(x=(9, 12), y=(-1, 2), resolution=(0.5, 0.25))
    truth = scene.truth(grid, samples=10)
    assert truth.shape == (*grid.shape, 3)
    assert truth.dtype == np.float32
    offsets = (np.arange(10) + 0.5) / 10 - 0.5
    for row, col in ((0, 0), (2, 7), (5, 11)):
        x, y = grid.xy()[row, col]
        fine = scene.colour(x + 0.5 * offsets[:, None], y + 0.25 * offsets[None, :])
        np.testing.assert_allclose(truth[row, col], fine.mean(axis=(0, 1)), atol=1e-2)


@pytest.mark.slow
def test_render_puts_road_points_where_the_camera_sees_them(seed_camera: ipm_rs.Camera) -> None:
    """The renderer's own arithmetic against ``project``: the middles of large plain patches."""
    image = scene.render(seed_camera)
    assert image.shape == (1024, 2048, 3)
    assert image.dtype == np.uint8
    for xy, material in (((18.5, 1.9), scene.WHITE), ((13.5, -2.3), scene.CYCLE_LANE), ((30.5, 8.7), scene.GRASS)):
        uv, _, valid = seed_camera.project(np.array([xy]))
        assert valid.all()
        column, row = np.rint(uv[0]).astype(int)
        mean, grain = (np.array(values) for values in scene.MATERIALS[material])
        assert np.all(np.abs(image[row, column] - mean) <= 1.6 * grain + 1)
    assert np.abs(image[0].astype(float) - scene.ZENITH_SKY).max() < 30


def test_render_repeats_itself_and_follows_the_ground() -> None:
    camera = small_camera()
    assert np.array_equal(scene.render(camera), scene.render(camera))
    # Camera and road lifted together see the same picture.
    lifted = small_camera(z=demo.CALIBRATION["extrinsic"]["z"] + 2.0)
    difference = np.abs(scene.render(lifted, ground=2.0).astype(int) - scene.render(camera).astype(int))
    assert difference.mean() < 0.1
    assert np.abs(scene.render(lifted).astype(int) - scene.render(camera).astype(int)).mean() > 2


def test_render_refuses_a_camera_below_the_road_and_a_lens() -> None:
    camera = small_camera()
    with refuses(ipm_rs.errors.ArgumentError, "above the road", "check ground"):
        scene.render(camera, ground=5.0)

    class Lensed:
        lens = "fisheye"

    with refuses(ipm_rs.errors.ArgumentError, "pinhole", "fisheye"):
        scene.render(Lensed())


@pytest.mark.parametrize("pose", [{"pitch": 1.2, "z": 12.0}, {"yaw": 2.5}, {"roll": 0.4}, {"pitch": -0.8}])
def test_render_copes_with_any_attitude(pose: dict[str, float]) -> None:
    image = scene.render(small_camera(**pose))
    assert image.std() > 3


# ---------------------------------------------------------------------------------------------------------------------
# The measurement


def test_error_is_small_and_half_a_pixel_would_show(result: demo.Result) -> None:
    """Measured: 30.01 dB near, 27.40 dB far; the mildest shift of half a pixel costs 0.23 dB of the far range."""
    assert result.near.psnr > 29.9
    assert result.far.psnr > 27.3
    assert result.near.median < 1.2
    assert result.far.median < 2.6
    truth, far = scene.truth(result.grid), result.grid.xy()[..., 0] >= demo.NEAR
    map_x, map_y = result.lut.maps()
    for du, dv in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5), (0.5, 0.5), (-0.5, -0.5)):
        moved = ipm_rs.Lut.from_maps(map_x + du, map_y + dv, source_size=result.camera.image_size)
        error = demo.Error.between(moved.warp(result.image), truth, moved.mask & far)
        assert error.psnr < 27.25, f"a shift of {du}, {dv} pixels goes unnoticed"


def test_quarter_size_error_is_least_without_a_shift() -> None:
    camera, grid = small_camera(4), ipm_rs.BevGrid(**demo.GRID)
    image, truth, lut = scene.render(camera), scene.truth(grid), ipm_rs.Lut(camera, grid)
    map_x, map_y = lut.maps()
    psnr = {}
    for du, dv in ((0, 0), (0.25, 0), (-0.25, 0), (0, 0.25), (0, -0.25)):
        moved = ipm_rs.Lut.from_maps(map_x + du, map_y + dv, source_size=camera.image_size)
        psnr[du, dv] = demo.Error.between(moved.warp(image), truth, moved.mask & lut.mask).psnr
    assert max(psnr, key=psnr.get) == (0, 0)


def test_result_holds_what_was_warped(result: demo.Result, seed_camera: ipm_rs.Camera) -> None:
    assert result.camera == seed_camera
    assert result.grid.shape == (860, 400)
    assert np.array_equal(result.bev, result.lut.warp(result.image))
    assert np.array_equal(result.mask, result.lut.mask)
    assert result.coverage == pytest.approx(0.852, abs=0.002)
    assert 0 < result.warp_time < 1
    assert 0 < result.build_time < 10


def test_error_between() -> None:
    bev = np.array([[[10, 20, 30], [40, 50, 60]]], np.uint8)
    truth = bev.astype(np.float32) + np.array([[[1], [9]]], np.float32)
    both = np.array([[True, True]])
    error = demo.Error.between(bev, truth, both)
    assert (error.median, error.mean) == (5.0, 5.0)
    assert error.psnr == pytest.approx(10 * math.log10(255**2 / 41))
    assert demo.Error.between(bev, truth, np.array([[True, False]])).mean == 1.0
    assert demo.Error.between(bev, bev.astype(np.float32), both).psnr == math.inf
    assert math.isnan(demo.Error.between(bev, truth, ~both).psnr)


# ---------------------------------------------------------------------------------------------------------------------
# Words and picture


def test_report_names_every_number(result: demo.Result) -> None:
    text = "\n".join(demo.report(result))
    for part in ("2048 x 1024", "860 x 400", "0.05 x 0.05 m", "x 7 to 50 m", "y -10 to 10 m"):
        assert part in text
    assert f"PSNR {result.near.psnr:.1f} dB" in text
    assert f"median {result.far.median:.2f}, mean {result.far.mean:.2f} grey levels" in text
    assert re.search(r"built in \d+\.\d\d ms", text)


def test_picture_shows_camera_image_and_view(result: demo.Result) -> None:
    picture = np.asarray(demo.picture(result))
    assert picture.shape == (1172, 1920, 3)
    left, top, (width, height) = demo._BEV_LEFT, demo._BEV_TOP, demo._BEV_SIZE
    view = picture[top : top + height, left : left + width]
    inner = np.zeros(result.mask.shape, bool)
    inner[4:-4, 4:-4] = True  # without the frame
    assert np.array_equal(view[inner & result.mask], result.bev[inner & result.mask])
    unseen = {tuple(pixel) for pixel in view[inner & ~result.mask].tolist()}
    assert unseen == {style.UNSEEN, style.HATCH}
    sky = picture[demo._PHOTO_TOP + 10, demo._LEFT + 600].astype(int)
    assert np.abs(sky - scene.ZENITH_SKY).max() < 30


# ---------------------------------------------------------------------------------------------------------------------
# The command


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, result: demo.Result) -> Path:
    """An empty current directory, and a demo that has already run."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(demo, "run", lambda: result)
    return tmp_path


def test_command_writes_the_picture_and_prints_the_report(
    here: Path, result: demo.Result, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["demo"]) == 0
    assert [path.name for path in here.iterdir()] == ["ipm_demo.png"]
    with Image.open("ipm_demo.png") as image:
        assert np.array_equal(np.asarray(image), np.asarray(demo.picture(result)))
    printed = capsys.readouterr().out
    assert printed == "\n".join([*demo.report(result), "picture   ipm_demo.png", ""])


def test_command_replaces_its_own_default_only(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("ipm_demo.png", "other.png"):
        (here / name).write_bytes(b"mine")
    assert cli.main(["demo", "other.png"]) == 2
    assert "--force" in capsys.readouterr().err
    assert (here / "other.png").read_bytes() == b"mine"
    assert cli.main(["demo"]) == 0
    assert cli.main(["demo", "other.png", "--force"]) == 0
    assert (here / "ipm_demo.png").read_bytes() == (here / "other.png").read_bytes() != b"mine"


@pytest.mark.parametrize("out", ["demo.xyz", "demo", "missing/demo.png", "."])
def test_command_refuses_what_it_cannot_write(here: Path, out: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["demo", out]) == 2
    assert capsys.readouterr().err.startswith("ipm-rs: error: ")
    assert list(here.iterdir()) == []
