"""The doctor: numbers against projections, every typical mistake found by its name, nothing found where all is well."""

from __future__ import annotations

import json
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
from helpers import refuses
from PIL import Image

import ipm_rs
from ipm_rs import cli, diagnosis, scene

SIZE = (640, 360)
K = np.array([[550.0, 0, 319.5], [0, 550, 179.5], [0, 0, 1]])
GRID = ipm_rs.BevGrid(x=(6, 30), y=(-7, 5), resolution=0.2)
POSE = {"position": (1.5, 0.1, 1.4), "pitch": 0.08, "yaw": 0.02, "roll": 0.01}
REASONS = list(diagnosis.REASONS)


def camera(matrix: np.ndarray = K, lens: object = None, size: tuple[int, int] = SIZE, **pose: object) -> ipm_rs.Camera:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # cameras that cannot be right are what this is about
        return ipm_rs.Camera.from_euler(matrix, image_size=size, lens=lens, **{**POSE, **pose})


GOOD = camera()
V, T = GOOD.vehicle_from_camera, GOOD.camera_from_vehicle
OPTICAL = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
HALF = np.diag([1.0, -1, -1])


def posed(rotation: np.ndarray, position: np.ndarray) -> ipm_rs.Camera:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return ipm_rs.Camera(K, image_size=SIZE, vehicle_from_camera=pose)


def with_quaternion_misread() -> ipm_rs.Camera:
    """A camera to the left, its quaternion w x y z read as x y z w."""
    R = camera(yaw=1.2).vehicle_from_camera[:3, :3]
    w = np.sqrt(1 + np.trace(R)) / 2
    x, y, z = (R[[2, 0, 1], [1, 2, 0]] - R[[1, 2, 0], [2, 0, 1]]) / (4 * w)
    a, b, c, d = z, w, x, y  # w, x, y, z now
    read = [
        [1 - 2 * (c * c + d * d), 2 * (b * c - d * a), 2 * (b * d + c * a)],
        [2 * (b * c + d * a), 1 - 2 * (b * b + d * d), 2 * (c * d - b * a)],
        [2 * (b * d - c * a), 2 * (c * d + b * a), 1 - 2 * (b * b + c * c)],
    ]
    return posed(np.array(read), V[:3, 3])


SIDE_GRID = ipm_rs.BevGrid(x=(-2, 12), y=(2, 16), resolution=0.2)
MISTAKES = {
    "inverse-pose": lambda: ipm_rs.Camera(K, image_size=SIZE, vehicle_from_camera=T),
    "rotation-transposed": lambda: posed(V[:3, :3].T, V[:3, 3]),
    "position-as-translation": lambda: posed(V[:3, :3], -V[:3, :3] @ V[:3, 3]),
    "camera-axes": lambda: posed(V[:3, :3] @ OPTICAL, V[:3, 3]),
    "opengl-axes": lambda: posed(V[:3, :3] @ HALF, V[:3, 3]),
    "vehicle-z-down": lambda: posed(HALF @ V[:3, :3], HALF @ V[:3, 3]),
    "quaternion-order": with_quaternion_misread,
    "degrees": lambda: camera(pitch=4.6, yaw=1.2, roll=0.5),
    "pitch-sign": lambda: camera(pitch=-0.35),
    "millimetres": lambda: camera(position=(1500.0, 100.0, 1400.0)),
    "centimetres": lambda: camera(position=(150.0, 10.0, 140.0)),
    "upside-down": lambda: camera(roll=np.pi),
    "intrinsics-of-another-size": lambda: camera(np.diag([2.0, 2, 1]) @ K),
    "sides-swapped": lambda: camera(size=SIZE[::-1]),
}


def codes(report: diagnosis.Report | diagnosis.RigReport) -> list[str]:
    return [finding.code for finding in report.findings]


@pytest.mark.parametrize("code", MISTAKES)
def test_a_typical_mistake_is_the_first_that_is_named(code: str):
    report = ipm_rs.doctor(MISTAKES[code](), SIDE_GRID if code == "quaternion-order" else GRID)
    named = [each for each in codes(report) if each in MISTAKES]
    assert named and named[0] == code, report
    assert not report.ok and report.findings[0].severity == "error"


def test_an_undone_mistake_is_told_with_the_pose_that_was_meant():
    report = ipm_rs.doctor(MISTAKES["camera-axes"](), GRID)
    (finding,) = (each for each in report.findings if each.code == "camera-axes")
    for part in ("(1.50, 0.10, 1.40) m", "4.6 degrees down", "1.1 degrees to the left", "[[0, -1, 0]"):
        assert part in str(finding)


@pytest.mark.parametrize(
    "good",
    [
        GOOD,
        camera(yaw=1.6),
        camera(yaw=np.pi),
        camera(pitch=0.7),
        camera(np.diag([1.06, 0.94, 1.0]) @ K),
        camera(position=(1.5, 0.1, 3.2)),
        camera(lens=ipm_rs.KannalaBrandt([0.03, 0, 0, 0])),
    ],
)
def test_cameras_of_vehicles_have_no_mistakes_of_pose(good: ipm_rs.Camera):
    assert [code for code in codes(ipm_rs.doctor(good, GRID)) if code in MISTAKES] == []
    assert ipm_rs.doctor(GOOD, GRID).ok


def test_numbers_are_those_of_the_camera():
    report = ipm_rs.doctor(GOOD, GRID, -0.1)
    assert report.height == pytest.approx(1.5) and report.position == pytest.approx((1.5, 0.1, 1.4))
    angles = (report.roll_deg, report.pitch_deg, report.heading_deg)
    assert angles == pytest.approx(tuple(np.degrees((0.01, 0.08, 0.02))), abs=1e-9)
    assert report.view_deg[0] == pytest.approx(2 * np.degrees(np.arctan(320 / 550)))
    a, b, c = GOOD.horizon_line()
    assert report.horizon_row == pytest.approx(-(a * 319.5 + c) / b)
    for metres, row in report.rows.items():
        assert GOOD.ground_range([[319.5, row]], ground=-0.1)[0] == pytest.approx(metres, rel=2e-2)
    assert set(report.rows) >= {5.0, 10.0, 20.0, 50.0}
    far = report.far
    uv = GOOD.project([(*far.place, -0.1)])[0]
    by_pixel, by_pitch = GOOD.range_error(uv, ground=-0.1)
    assert (far.by_pixel, far.by_pitch) == (by_pixel[0], by_pitch[0])
    assert far.distance == pytest.approx(np.hypot(far.place[0] - 1.5, far.place[1] - 0.1)) and far.place[0] > 29.5


def test_every_cell_has_its_reason():
    mask = np.ones(SIZE[::-1], bool)
    mask[300:] = False
    seen_by = GOOD.masked(mask)
    grid = ipm_rs.BevGrid(x=(-4, 30), y=(-14, 10), resolution=0.25)
    report = ipm_rs.doctor(seen_by, grid)
    uv, depth, valid = seen_by.project(grid.xy().reshape(-1, 2))
    lut = ipm_rs.Lut(seen_by, grid)
    why = np.array(REASONS)[report.why.ravel()]
    assert np.array_equal(np.isin(why, ["resolved", "unresolved"]), lut.mask.ravel())
    assert np.array_equal(why == "resolved", lut.resolved_mask().ravel())
    assert np.array_equal(why == "behind", depth <= 0)
    assert np.array_equal(why == "masked", valid & ~lut.mask.ravel()) and (why == "masked").sum() > 20
    for reason, wrong in (("left", uv[:, 0] >= 0), ("right", uv[:, 0] <= 639), ("below", uv[:, 1] <= 359)):
        assert (why == reason).sum() > 50 and not wrong[why == reason].any()
    assert sum(report.shares.values()) == pytest.approx(1) and list(report.shares.values()) == sorted(
        report.shares.values(), reverse=True
    )


def test_reasons_of_lenses_hills_and_roads_above():
    fisheye = camera(np.diag([0.3, 0.3, 1]) @ K, lens=ipm_rs.KannalaBrandt([0, 0, 0, 0], max_angle=1.0))
    wide = ipm_rs.BevGrid(x=(-4, 8), y=(-8, 8), resolution=0.5)
    assert ipm_rs.doctor(fisheye, wide).shares["lens"] > 0.1
    heights = np.where(abs(np.arange(31.0) - 14) < 2, 0.8, 0.0)[:, None] * np.ones(31)
    heights[-3:] = np.nan
    hill = ipm_rs.HeightMap(heights, origin=(0, -15), spacing=1.0)
    shares = ipm_rs.doctor(GOOD, GRID, hill).shares
    assert shares["hidden"] > 0.05 and shares["unknown"] > 0.05
    under = ipm_rs.doctor(GOOD, GRID, 2.0)
    assert under.shares["horizon"] > 0.5 and under.seen == 0 and "sky" in codes(under)
    edge = ipm_rs.doctor(GOOD, GRID, 1.4)
    assert edge.seen == 0 and "sees-no-road" in codes(edge)


def test_a_grid_of_any_size_takes_no_longer():
    fine = ipm_rs.BevGrid(x=(6, 30), y=(-6, 6), resolution=0.002)  # 72 million cells
    begun = time.process_time()
    report = ipm_rs.doctor(GOOD, fine)
    assert time.process_time() - begun < 2
    coarse = ipm_rs.doctor(GOOD, ipm_rs.BevGrid(x=(6, 30), y=(-6, 6), resolution=0.02))
    assert report.why.size < 700_000 and report.seen == pytest.approx(coarse.seen, abs=0.01)
    assert report.resolved == 0 and coarse.resolved > 0.001


@pytest.fixture(scope="module")
def photo() -> np.ndarray:
    return scene.render(camera(roll=0.0, yaw=0.0))


@pytest.mark.parametrize("off", [-2.0, -1.0, 0.0, 1.5])
def test_lanes_say_by_how_much_the_pitch_is_off(photo: np.ndarray, off: float):
    told = camera(roll=0.0, yaw=0.0, pitch=0.08 + np.radians(off))
    report = ipm_rs.doctor(told, GRID, image=photo)
    found = [finding for finding in report.findings if finding.code == "splayed"]
    if off == 0:
        assert not found
        return
    (finding,) = found
    number = float(finding.text.split("with ")[1].split(" degrees")[0])
    assert number == pytest.approx(abs(off), abs=0.26)
    assert ("converge" in finding.text) == (off > 0) and ("less pitch" in finding.text) == (off > 0)


def test_noise_has_no_lanes():
    noise = np.random.default_rng(0).integers(0, 256, (*SIZE[::-1], 3), dtype=np.uint8)
    assert "splayed" not in codes(ipm_rs.doctor(GOOD, GRID, image=noise))


def test_images_that_do_not_fit(photo: np.ndarray):
    half = ipm_rs.doctor(GOOD, GRID, image=photo[::2, ::2])
    (finding,) = (each for each in half.findings if each.code == "image-size")
    assert "320x180" in finding.text and "camera.resized(320, 180)" in finding.mend
    half.draw()
    turned = ipm_rs.doctor(GOOD, GRID, image=photo.transpose(1, 0, 2))
    assert "swapped" in next(each.mend for each in turned.findings if each.code == "image-size")
    assert "cropped" in next(
        each.mend for each in ipm_rs.doctor(GOOD, GRID, image=photo[:200]).findings if each.code == "image-size"
    )
    assert "blank-image" in codes(ipm_rs.doctor(GOOD, GRID, image=np.zeros_like(photo)))
    assert "blank-image" in codes(ipm_rs.doctor(GOOD, GRID, image=np.full(SIZE[::-1], np.nan, np.float32)))


def test_words_json_and_picture(photo: np.ndarray):
    report = ipm_rs.doctor(GOOD, GRID, image=photo)
    text = str(report)
    for part in (
        "1.50 m ahead",
        "0.10 m to the left",
        "1.40 m above",
        "4.6 degrees down",
        "left side up",
        "row 13",
        "m",
    ):
        assert part in text
    data = json.loads(report.to_json())
    assert data == report.to_dict() and data["position"] == pytest.approx([1.5, 0.1, 1.4]) and data["ok"] is True
    assert json.loads(ipm_rs.doctor(MISTAKES["millimetres"](), GRID).to_json())["far"] is None
    picture, blank = report.draw(), ipm_rs.doctor(GOOD, GRID).draw()
    assert picture.width > blank.width > 1000 and picture.mode == "RGB"
    assert "<img" in report._repr_html_() and "row 13" in report._repr_html_()


@pytest.mark.parametrize(("dtype", "channels"), [(np.uint16, None), (np.float32, 7), (np.bool_, None), (np.uint8, 4)])
def test_any_image_is_looked_at(dtype: type, channels: int | None):
    shape = SIZE[::-1] if channels is None else (*SIZE[::-1], channels)
    image = (np.random.default_rng(1).random(shape) * 200).astype(dtype)
    assert ipm_rs.doctor(GOOD, GRID, image=image).draw().width > 1000


# ---------------------------------------------------------------------------------------------------------------------
# Rigs

AROUND = ipm_rs.BevGrid(x=(-8, 12), y=(-10, 10), resolution=0.25)


def ring(**turned: float) -> dict[str, ipm_rs.Camera]:
    wide = np.diag([0.45, 0.45, 1]) @ K
    wide[:2, 2] = K[:2, 2]
    yaws = {"front": 0.0, "left": 1.4, "back": np.pi, "right": -1.4} | turned
    return {name: camera(wide, yaw=yaw, pitch=0.3, roll=0.0, position=(1, 0, 1.5)) for name, yaw in yaws.items()}


def test_a_rig_and_its_parts():
    cameras = ring()
    report = ipm_rs.doctor(cameras, AROUND)
    lut = ipm_rs.RigLut(cameras, AROUND)
    assert report.seen == pytest.approx(lut.mask.mean())
    each = [report.cameras[name].seen for name in cameras]
    assert all(one < report.seen for one in each) and sum(each) > report.seen
    assert sum(report.shows.values()) == pytest.approx(report.seen) and 0 < report.overlap < 0.7
    assert report.ok and report.draw().width > 1000 and json.loads(report.to_json())["ok"] is True
    for part in ("front: ahead", "back: back", "left: to the left", "4 cameras"):
        assert part in str(report)


def test_a_camera_that_looks_away_from_the_grid_is_no_mistake_of_a_rig():
    report = ipm_rs.doctor(ring(), ipm_rs.BevGrid(x=(4, 12), y=(-3, 3), resolution=0.25))
    assert report.ok and report.cameras["back"].seen == 0
    assert [str(each) for each in report.findings] == ["note: back sees nothing of the grid"]
    under = ipm_rs.doctor({"front": camera(position=(0, 0, -1.0))}, AROUND)
    assert "sees-no-road" in codes(under) and not under.ok


def test_names_of_a_mirrored_rig():
    report = ipm_rs.doctor(ring(left=-1.4, right=1.4), AROUND)
    (finding,) = (each for each in report.findings if each.code == "mirrored")
    assert "left (-80 degrees" in finding.text and "right (80" in finding.text
    assert "other-direction" in codes(ipm_rs.doctor(ring(front=np.pi), AROUND))


def test_a_pair_that_is_apart(photo: np.ndarray):
    """Two cameras that see the same; one is told to stand a quarter of a metre aside."""
    true = camera(roll=0.0, yaw=0.0)
    told = {"one": true, "other": camera(roll=0.0, yaw=0.0, position=(1.5, -0.2, 1.4))}
    near = ipm_rs.BevGrid(x=(6, 14), y=(-4, 4), resolution=0.05)
    images = {"one": photo, "other": photo}
    report = ipm_rs.doctor(told, near, image=images)
    (finding,) = (each for each in report.findings if each.code == "pair-apart")
    assert "other" in finding.text and report.agreement["one", "other"].shift[1] == pytest.approx(0.3, abs=0.05)
    assert ipm_rs.doctor({"one": true, "other": true}, near, image=images).agreement["one", "other"].correlation > 0.99
    assert report.draw().width > 1000


# ---------------------------------------------------------------------------------------------------------------------
# Wrong arguments, and the command


def test_wrong_arguments_are_told():
    for wrong in ((7, GRID), (GOOD, 7), ({"front": 7}, GRID)):
        with refuses(ipm_rs.ArgumentTypeError, "expected", "got"):
            ipm_rs.doctor(*wrong)
    with refuses(ipm_rs.ArgumentError, "at least one"):
        ipm_rs.doctor({}, GRID)
    with refuses(ipm_rs.ArgumentTypeError, "ground", "str"):
        ipm_rs.doctor(GOOD, GRID, "0")
    with refuses(ipm_rs.ArgumentError, "ground"):
        ipm_rs.doctor(GOOD, GRID, np.nan)
    with refuses(ipm_rs.ImageError, "(C, H, W)"):
        ipm_rs.doctor(GOOD, GRID, image=np.zeros((3, *SIZE[::-1]), np.uint8))
    with refuses(ipm_rs.DtypeError, "image"):
        ipm_rs.doctor(GOOD, GRID, image=np.zeros(SIZE[::-1], "U3"))
    with refuses(ipm_rs.ArgumentError, "names"):
        ipm_rs.doctor({"front": GOOD}, GRID, image={"back": None})
    with refuses(ipm_rs.ArgumentTypeError, "mapping"):
        ipm_rs.doctor({"front": GOOD}, GRID, image=np.zeros(SIZE[::-1]))


def test_the_module_does_not_hide_the_function():
    import ipm_rs.diagnosis

    assert ipm_rs.doctor is ipm_rs.diagnosis.doctor and callable(ipm_rs.doctor)


def test_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], photo: np.ndarray
):
    monkeypatch.chdir(tmp_path)
    GOOD.save("camera.json")
    MISTAKES["inverse-pose"]().save("wrong.json")
    Image.fromarray(photo).save("frame.png")
    grid = ["--x", "6", "30", "--y", "-7", "5", "--resolution", "0.2"]
    assert cli.main(["doctor", "camera.json", "frame.png", "-o", "report.png", *grid]) == 0
    assert "4.6 degrees down" in capsys.readouterr().out
    with Image.open("report.png") as picture:
        assert picture.width > 1000
    assert cli.main(["doctor", "camera.json", "frame.png", "-o", "report.png", *grid]) == 2  # it exists
    assert "--force" in capsys.readouterr().err
    assert cli.main(["doctor", "camera.json", "--json", *grid]) == 0
    assert json.loads(capsys.readouterr().out) == ipm_rs.doctor(GOOD, GRID).to_dict()
    assert [cli.main(["doctor", name, "--strict", *grid]) for name in ("camera.json", "wrong.json")] == [0, 2]
    assert "inverse" in capsys.readouterr().out


def test_command_of_a_rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.chdir(tmp_path)
    ipm_rs.Rig(ring()).save("rig.json")
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (*SIZE[::-1], 3), dtype=np.uint8)).save("f.png")
    options = ["--resolution", "0.25"]
    assert cli.main(["doctor", "rig.json", "front=f.png", "-o", "report.png", *options]) == 0
    assert "x -10 to 10 m" in capsys.readouterr().out and Path("report.png").exists()
    assert cli.main(["doctor", "rig.json", "--all", "--json", *options]) == 0
    assert set(json.loads(capsys.readouterr().out)["cameras"]) == {"front", "left", "back", "right"}
    for wrong in (["f.png"], ["up=f.png"], ["front=f.png", "f.png"], ["front=f.png", "front=f.png"], []):
        assert cli.main(["doctor", "rig.json", *wrong, *options]) == 2
        assert capsys.readouterr().err.startswith("ipm-rs: error: ")
    assert cli.main(["doctor", "rig.json", "--camera", "left", *options]) == 0
