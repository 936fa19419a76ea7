"""Tables that differ from frame to frame, masks beside the views, drawings on them; videos that ask to be turned."""

from __future__ import annotations

import errno
import struct
from pathlib import Path

import numpy as np
import pytest
from helpers import refuses, textured
from PIL import Image

import ipm_rs
from ipm_rs import errors, streams
from ipm_rs.cli import main

K = [[55.0, 0, 31.2], [0, 55, 23.6], [0, 0, 1]]
POSE = {"position": (1.0, 0.2, 1.5), "roll": 0.02, "pitch": 0.3, "yaw": -0.1}
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(64, 48), **POSE)
GRID = ipm_rs.BevGrid(x=(2, 14), y=(-5, 5), resolution=(0.25, 0.5))
WORDS = ["--x", "2", "14", "--y", "-5", "5", "--resolution", "0.25", "0.5"]
PICTURES = [textured(48, 64, 3, seed=k) for k in range(3)]


def table(road_from_vehicle: np.ndarray | None = None, **changes) -> ipm_rs.Lut:
    camera = ipm_rs.Camera.from_euler(K, image_size=(64, 48), **{**POSE, **changes})
    if road_from_vehicle is not None:
        camera = camera.with_pose(np.linalg.inv(road_from_vehicle @ camera.vehicle_from_camera))
    return ipm_rs.Lut(camera, GRID)


def alike(one: ipm_rs.Lut, other: ipm_rs.Lut) -> bool:
    """Maps to a thousandth of a pixel: the pose went through angles and back."""
    first, second = (np.stack(lut.maps(outside=-9)) for lut in (one, other))
    return bool(np.abs(first - second).max() < 1e-3)


@pytest.fixture
def frames(tmp_path) -> Path:
    (tmp_path / "frames").mkdir()
    for k, pixels in enumerate(PICTURES):
        Image.fromarray(pixels).save(tmp_path / "frames" / f"f{k}.png")
    CAMERA.save(tmp_path / "camera.json")
    return tmp_path / "frames"


def frame(index: int = 0, name: str = "f0", time: float | None = None) -> streams.Frame:
    return streams.Frame(PICTURES[0], name, index, time)


def test_a_line_says_how_the_camera_stood(tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text("name,pitch_deg,z\nf0,12,1.4\nf1,15.5,1.6\n")
    tables = streams.per_frame(CAMERA, GRID, path)
    assert alike(tables(frame(9, "f0")), table(pitch=np.radians(12), position=(1.0, 0.2, 1.4)))
    assert alike(tables(frame(9, "f1")), table(pitch=np.radians(15.5), position=(1.0, 0.2, 1.6)))
    assert tables(frame(9, "f1")) is tables(frame(7, "f1"))  # built once for equal numbers
    with refuses(errors.FileError, "poses.csv", "frame f2"):
        tables(frame(2, "f2"))
    path.write_text("frame,roll,yaw,x,y\n0,-0.1,0.2,1.5,-0.3\n")
    expected = table(roll=-0.1, yaw=0.2, position=(1.5, -0.3, 1.5))
    assert alike(streams.per_frame(CAMERA, GRID, path)(frame(0, "a")), expected)


def test_a_vehicle_that_nods_and_leans_on_its_springs(tmp_path):
    """Against the rotation written out: nose down by positive pitch, left side up by positive roll."""
    (tmp_path / "a.csv").write_text("index,vehicle_pitch_deg,vehicle_roll,vehicle_z\n0,2,0.03,-0.05\n")
    p, r = np.radians(2), 0.03
    road_from_vehicle = np.eye(4)
    Ry = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    Rx = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    road_from_vehicle[:3, :3], road_from_vehicle[2, 3] = Ry @ Rx, -0.05
    found = streams.per_frame(CAMERA, GRID, tmp_path / "a.csv")(frame())
    assert alike(found, table(road_from_vehicle)) and not alike(found, table())


def test_moments_between_lines(tmp_path):
    (tmp_path / "a.csv").write_text("timestamp,pitch\n0.0,0.30\n0.5,0.34\n3.0,0.30\n")
    tables = streams.per_frame(CAMERA, GRID, tmp_path / "a.csv")
    assert alike(tables(frame(time=0.5)), table(pitch=0.34)) and alike(tables(frame(time=0.125)), table(pitch=0.31))
    for moment in (-0.1, 1.0, 3.1):
        with refuses(errors.FileError, f"{moment:.6f} s", "at most 1 s apart"):
            tables(frame(time=moment))
    with refuses(errors.FileError, "without"):
        tables(frame())
    wide = streams.per_frame(CAMERA, GRID, tmp_path / "a.csv", max_gap=3)
    assert alike(wide(frame(time=1.75)), table(pitch=0.32))


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("", "a column name"),
        ("name\nf0\n", "a column name"),
        ("name,frame,pitch\n", "a column name"),
        ("name,pitch,pitch_deg\n", "a column name"),
        ("name,tilt\n", "a column name"),
        ("name,pitch\n", "cut short"),
        ("name,pitch\nf0\n", "line 2"),
        ("name,pitch\nf0,steep\n", "line 2"),
        ("frame,pitch\n0,0.1\n1,nan\n", "line 3"),
        ("frame,pitch\n0,0.1\n0,0.2\n", "one line for each frame"),
        ("time,pitch\n1,0.1\n0,0.2\n", "grow"),
    ],
)
def test_files_of_poses_that_are_none(tmp_path, text, phrase):
    (tmp_path / "a.csv").write_text(text)
    with refuses(errors.FileError, "a.csv", phrase):
        streams.per_frame(CAMERA, GRID, tmp_path / "a.csv")


def test_the_command_tilts_each_frame(frames, tmp_path, capsys):
    poses = tmp_path / "poses.csv"
    poses.write_text("frame,pitch_deg\n0,12\n1,14\n2,16\n")
    run = ["warp", str(tmp_path / "camera.json"), str(frames), "--poses", str(poses), *WORDS]
    assert main([*run, "-o", str(tmp_path / "bevs"), "--every", "2"]) == 0
    for k in (0, 2):
        found = np.asarray(Image.open(tmp_path / "bevs" / f"f{k}_bev.png")).astype(int)
        assert np.abs(found - table(pitch=np.radians(12 + 2 * k)).warp(PICTURES[k])).max() <= 1
    poses.write_text("name,pitch_deg\nf0,12\nf2,16\n")
    capsys.readouterr()
    assert main([*run, "-o", str(tmp_path / "some")]) == 2
    assert "frame f1" in capsys.readouterr().err
    assert sorted(path.name for path in (tmp_path / "some").iterdir()) == ["f0_bev.png", "f2_bev.png"]


def test_the_mask_of_each_frame_becomes_a_video(frames, tmp_path, capsys):
    pytest.importorskip("av")
    (tmp_path / "poses.csv").write_text("frame,pitch_deg\n0,12\n1,20\n2,30\n")
    run = ["warp", str(tmp_path / "camera.json"), str(frames), *WORDS, "--poses", str(tmp_path / "poses.csv")]
    seen = tmp_path / "seen.mp4"
    assert main([*run, "-o", str(tmp_path / "bev.mp4"), "--mask-video", str(seen)]) == 0
    masks = [one.image[..., 0] > 127 for one in streams.open(seen)]
    for degrees, mask in zip((12, 20, 30), masks, strict=True):
        assert (mask == table(pitch=np.radians(degrees)).mask).mean() > 0.97  # the edge, after a codec
    assert (masks[0] != masks[2]).any()
    capsys.readouterr()
    for arguments, phrase in (
        (["--mask-video", str(tmp_path / "seen.png")], "ends in .mp4"),
        (["--mask-video", str(seen)], "--force"),
        (["--mask-video", str(tmp_path / "x.mp4")], "a name of its own"),
    ):
        assert main([*run, "-o", str(tmp_path / "x.mp4"), *arguments]) == 2
        assert phrase in capsys.readouterr().err and not (tmp_path / "x.mp4").exists()
    one = ["warp", str(tmp_path / "camera.json"), str(frames / "f0.png"), "-o", str(tmp_path / "x.png"), *WORDS]
    assert main([*one, "--mask-video", str(tmp_path / "y.mp4")]) == 2
    assert "--mask" in capsys.readouterr().err


def test_views_can_be_drawn_on(frames, tmp_path):
    def draw(view, lut):
        assert lut.grid == GRID
        return np.pad(view, [(1, 1), (2, 2), (0, 0)], constant_values=9)

    lut = table()
    summary = streams.warp(streams.open(frames), lut, tmp_path / "out", draw=draw)
    found = np.asarray(Image.open(tmp_path / "out" / "f1_bev.png"))
    assert summary.done == 3 and np.array_equal(found[1:-1, 2:-2], lut.warp(PICTURES[1])) and (found[0] == 9).all()
    with refuses(errors.ArgumentTypeError, "draw"):
        streams.warp(streams.open(frames), lut, tmp_path / "other", draw="axes")


def test_the_command_draws_axes(frames, tmp_path, capsys):
    run = ["warp", str(tmp_path / "camera.json"), *WORDS, "--axes"]
    assert main([*run[:2], str(frames), *run[2:], "-o", str(tmp_path / "bevs")]) == 0
    lut = table()
    for k, pixels in enumerate(PICTURES):
        found = np.asarray(Image.open(tmp_path / "bevs" / f"f{k}_bev.png"))
        assert np.array_equal(found, np.asarray(ipm_rs.draw.axes(lut.warp(pixels), GRID, mask=lut.mask)))
    pytest.importorskip("av")
    assert main([*run[:2], str(frames), *run[2:], "-o", str(tmp_path / "bev.mp4")]) == 0
    shown = next(iter(streams.open(tmp_path / "bev.mp4"))).image
    whole = np.asarray(ipm_rs.draw.axes(lut.warp(PICTURES[0]), GRID, mask=lut.mask))
    rows, cols = whole.shape[:2]
    assert shown.shape[0] - rows in (0, 1)
    assert np.median(np.abs(shown[:rows, :cols].astype(int) - whole)) <= 4  # after a codec
    Image.fromarray(PICTURES[0][..., 0], "L").convert("P").save(tmp_path / "ids.png")
    labels = [str(tmp_path / "ids.png"), "-o", str(tmp_path / "x.png"), "--interpolation", "nearest"]
    assert main([*run[:2], *labels, *run[2:]]) == 2 and "--axes" in capsys.readouterr().err


@pytest.mark.parametrize("output", ["out", "out.mp4"])
def test_a_full_disk_is_one_clear_line(frames, tmp_path, monkeypatch, output):
    """Where a write fails for want of space, the run stops, and what is not whole is gone."""
    pytest.importorskip("av")
    from ipm_rs.files import atomic

    class Full:
        def __init__(self, file) -> None:
            self.file, self.left = file, 300

        def write(self, data) -> int:
            self.left -= len(data)
            if self.left < 0:
                raise OSError(errno.ENOSPC, "No space left on device")
            return self.file.write(data)

        def __getattr__(self, name):
            return getattr(self.file, name)

        def __enter__(self):
            self.file.__enter__()
            return self

        def __exit__(self, *error):
            return self.file.__exit__(*error)

    new = atomic._new_file
    monkeypatch.setattr(atomic, "_new_file", lambda path: Full(new(path)))
    with refuses(errors.FileError, output, "No space left on device"):
        streams.warp(streams.open(frames), table(), tmp_path / output)
    left = [path.name for path in tmp_path.rglob("*") if path.is_file() and "frames" not in path.parts]
    assert left == ["camera.json"]


def turned_video(path: Path, quarter_turns: int) -> None:
    """A video whose track header asks for its pictures to be turned, as phones write it."""
    from test_streams import smooth, write_video

    write_video(path, [smooth(k) for k in range(2)])
    data = bytearray(path.read_bytes())
    place = data.index(b"tkhd") + 4 + 40  # a version 0 box: its matrix comes after 40 bytes
    one = 1 << 16
    matrix = {1: (0, one, -one, 0), 2: (-one, 0, 0, -one), 3: (0, -one, one, 0)}[quarter_turns]
    a, b, c, d = matrix
    data[place : place + 36] = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(data)


@pytest.mark.parametrize("quarter_turns", [1, 2, 3])
def test_videos_that_ask_to_be_turned(tmp_path, quarter_turns):
    """Clockwise by so many quarter turns, as every player shows it."""
    pytest.importorskip("av")
    from test_streams import smooth

    turned_video(tmp_path / "phone.mp4", quarter_turns)
    with refuses(errors.FileError, "turned by", "--rotation"):
        streams.open(tmp_path / "phone.mp4")
    stored = streams.open(tmp_path / "phone.mp4", rotation="ignore")
    assert stored.size == (64, 48) and next(iter(stored)).image.shape == (48, 64, 3)
    shown = streams.open(tmp_path / "phone.mp4", rotation="apply")
    expected = np.rot90(smooth(0), -quarter_turns)
    image = next(iter(shown)).image
    assert shown.size == (expected.shape[1], expected.shape[0]) and image.shape == expected.shape
    assert np.abs(image.astype(int) - expected).max() <= 6
