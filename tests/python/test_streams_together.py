"""Streams of several cameras as one: which pictures belong together, and the rig's views of them."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from time import sleep

import numpy as np
import pytest
from helpers import refuses, textured
from PIL import Image

import ipm_rs
from ipm_rs import cli, errors, streams
from ipm_rs.cli import rig_stream

K = [[30.0, 0, 31.5], [0, 30.0, 23.5], [0, 0, 1]]
GRID = ipm_rs.BevGrid(x=(-6, 6), y=(-6, 6), resolution=0.25)
WORDS = ["--x", "-6", "6", "--y", "-6", "6", "--resolution", "0.25"]


def camera(yaw: float) -> ipm_rs.Camera:
    return ipm_rs.Camera.from_euler(K, image_size=(64, 48), position=(0, 0, 1.4), pitch=0.6, yaw=yaw)


RIG = ipm_rs.Rig({"front": camera(0), "back": camera(3.1)})


def made(times: list[float | None], shade: int = 0, bad: int = -1) -> streams.Stream:
    """A stream whose pictures say their number; one of them cannot be read."""

    def load(number: int) -> streams.Frame:
        if number == bad:
            raise errors.FileError(f"frame {number}: damaged")
        return streams.Frame(np.full((48, 64), shade + number, np.uint8), f"{number}", number, times[number])

    def tickets():
        for number, time in enumerate(times):
            yield streams.Ticket(f"{number}", number, time, lambda number=number: load(number))

    return streams.Stream("made", tickets, count=len(times), rate=None if None in times else 10.0)


def numbers(joined: streams.Stream) -> list[list[int]]:
    return [[int(picture[0, 0]) for picture in frame.image.values()] for frame in joined]


def test_pictures_that_are_nearest_in_time_belong_together():
    front = made([1.0, 1.1, 1.2, 1.3])
    back = made([0.9, 0.98, 1.07, 1.16, 1.25, 1.4], 100)
    assert numbers(streams.together({"front": front, "back": back}, tolerance=0.11)) == (
        [[0, 101], [1, 102], [2, 103], [3, 104]]
    )
    slow = made([1.0, 1.19], 100)  # one picture for two moments
    assert numbers(streams.together({"front": front, "back": slow}, tolerance=0.12)) == (
        [[0, 100], [1, 101], [2, 101], [3, 101]]
    )
    ends = streams.together({"front": front, "back": made([1.0], 100)}, partial=True)
    assert numbers(ends) == [[0, 100], [1], [2], [3]]
    joined = streams.together({"front": front, "back": back}, tolerance=0.035, partial=True)
    assert numbers(joined) == [[0, 101], [1, 102], [2], [3]]
    assert [frame.timestamp for frame in joined] == [1.0, 1.1, 1.2, 1.3] and joined.count == 4
    with refuses(errors.FileError, "frame 2", "back", "0.035 s"):
        list(streams.together({"front": front, "back": back}, tolerance=0.035))


def test_pictures_without_timestamps_belong_together_by_their_number():
    front, back = made([None] * 3), made([None] * 3, 100)
    assert numbers(streams.together({"front": front, "back": back})) == [[0, 100], [1, 101], [2, 102]]
    with refuses(errors.ArgumentError, "front 3, back 2"):
        streams.together({"front": front, "back": made([None] * 2)})
    for wrong, error in (
        ({}, errors.ArgumentError),
        ([front], errors.ArgumentTypeError),
        ({"a": 1}, errors.ArgumentTypeError),
    ):
        with refuses(error, "streams"):
            streams.together(wrong)
    with refuses(errors.ArgumentError, "tolerance"):
        streams.together({"front": front}, tolerance=-1)


def test_a_rig_of_streams_has_a_view_of_each_moment(tmp_path):
    lut = ipm_rs.RigLut(RIG, GRID)
    front, back = made([0.0, 0.1, 0.2]), made([0.0, 0.1, 0.2], 100, bad=1)
    joined = streams.together({"front": front, "back": back})
    summary = streams.warp(joined, lut, tmp_path / "strict", jobs=2)
    assert summary.done == 2 and "damaged" in str(summary.failed[0])
    joined = streams.together({"front": front, "back": back}, partial=True)
    assert streams.warp(joined, lut, tmp_path / "all", missing="next").done == 3
    for number in range(3):
        pictures = {"front": np.full((48, 64), number, np.uint8), "back": np.full((48, 64), 100 + number, np.uint8)}
        if number == 1:
            del pictures["back"]
        found = np.asarray(Image.open(tmp_path / "all" / f"{number}_bev.png"))
        assert np.array_equal(found, lut.warp(pictures, missing="next"))


def test_the_command_takes_videos_and_topics(tmp_path, capsys):
    pytest.importorskip("av")
    pytest.importorskip("rosbags")
    from bags import Bag
    from test_streams import smooth, write_video

    RIG.save(tmp_path / "rig.json")
    run = ["rig", str(tmp_path / "rig.json")]
    for name, first in (("front", 0), ("back", 5)):
        write_video(tmp_path / f"{name}.mp4", [smooth(first + k) for k in range(4)])
        (tmp_path / name).mkdir()
        for k in range(2):
            Image.fromarray(smooth(first + k)).save(tmp_path / name / f"{k}.png")
    with Bag(tmp_path / "run.bag", "bag") as bag:
        for k in range(3):
            bag.image("/front/image", textured(48, 64, 3, seed=k), "rgb8", 5 + 0.1 * k)
            bag.image("/back/image", textured(48, 64, 3, seed=10 + k), "rgb8", 5.02 + 0.1 * k)

    def sources(text: str) -> list[str]:
        return [f"{name}={tmp_path}/{text.format(name=name)}" for name in RIG]

    lut = ipm_rs.RigLut(RIG, GRID)
    assert main(*run, *sources("{name}.mp4"), "-o", str(tmp_path / "bev.mp4"), "--every", "2") == 0
    assert "2 frames" in capsys.readouterr().out
    shown = [frame.image for frame in streams.open(tmp_path / "bev.mp4")]
    for k, image in zip((0, 2), shown, strict=True):
        expected = lut.warp({"front": smooth(k), "back": smooth(5 + k)}, interpolation="area")
        assert np.median(np.abs(image.astype(int) - expected)[lut.mask]) <= 4
    assert main(*run, *sources("run.bag:/{name}/image"), "-o", str(tmp_path / "bevs"), "--gains") == 0
    pictures = {"front": textured(48, 64, 3, seed=0), "back": textured(48, 64, 3, seed=10)}
    expected = lut.warp(pictures, interpolation="area", gains=lut.gains(pictures))
    assert np.array_equal(np.asarray(Image.open(tmp_path / "bevs" / "000000_bev.png")), expected)
    assert main(*run, *sources("{name}"), "-o", str(tmp_path / "folders.mkv")) == 0
    capsys.readouterr()
    video = sources("{name}.mp4")
    for arguments, phrase in (
        ([*video[:1], "-o", str(tmp_path / "x.mp4")], "none for back"),
        ([video[0], f"back={tmp_path}/run.bag", "-o", str(tmp_path / "x.mp4")], "run.bag:/the/topic"),
        ([*video, "-o", str(tmp_path / "bev.mp4")], "--force"),
        ([*video, "-o", str(tmp_path / "front.mp4"), "--force"], "got an input"),
        ([*video, "-o", str(tmp_path / "x.mp4"), "--mask", str(tmp_path / "front" / "0.png")], "--force"),
        (
            [*sources("{name}"), "-o", f"{tmp_path}/x.mp4", "--mask", f"{tmp_path}/back/0.png", "--force"],
            "got an input",
        ),
        (
            [*video, "-o", f"{tmp_path}/x.mp4", "--mask", f"{tmp_path}/x.png", "--source", f"{tmp_path}/x.png"],
            "of its own",
        ),
        ([*sources("{name}"), "-o", str(tmp_path / "x"), "--start", "1"], "--start"),
        ([*sources("{name}.mp4")[:1], f"back={tmp_path}/none.mp4", "-o", str(tmp_path / "x.mp4")], "none.mp4"),
    ):
        assert main(*run, *arguments) == 2
        assert phrase in capsys.readouterr().err, phrase
    assert not list(Path(tmp_path).glob("x*"))


def test_the_maps_of_a_rig_of_streams_replace_nothing_unasked(tmp_path, capsys):
    pytest.importorskip("av")
    from test_streams import smooth, write_video

    RIG.save(tmp_path / "rig.json")
    (tmp_path / "folder").mkdir()
    for name, first in (("front", 0), ("back", 5)):
        write_video(tmp_path / f"{name}.mp4", [smooth(first + k) for k in range(2)])
        Image.fromarray(smooth(first)).save(tmp_path / "folder" / f"{name}.png")
    (tmp_path / "seen.png").write_bytes(b"mine")
    videos = [f"{name}={tmp_path}/{name}.mp4" for name in RIG]
    folders = [f"{name}={tmp_path}/folder" for name in RIG]
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}

    def run(sources: list[str], output: str, *options: str) -> int:
        words = [f"{tmp_path}/{word}" if word[0] != "-" else word for word in options]
        return main("rig", str(tmp_path / "rig.json"), *sources, "-o", f"{tmp_path}/{output}", *words)

    for sources, output, options, phrase in (
        (videos, "x.mp4", ["--mask", "seen.png"], "--force"),
        (videos, "x.mp4", ["--source", "seen.png"], "--force"),
        (videos, "x.mp4", ["--source", "rig.json"], "'.json'; rename"),
        (videos, "x.mp4", ["--mask", "none/m.png"], "make"),
        (videos, "x.mp4", ["--mask", "m.png", "--source", "m.png"], "twice"),
        (videos, "x.mp4", ["--mask", "x.mp4"], "twice"),
        (folders, "x.mp4", ["--mask", "folder/back.png", "--force"], "got an input"),
    ):
        assert run(sources, output, *options) == 2
        assert phrase in capsys.readouterr().err, phrase
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == before
    assert run(videos, "x.mp4", "--mask", "seen.png", "--force") == 0
    assert run(videos, "bevs", "--mask", "bevs/m.png") == 0
    for mask in ("seen.png", "bevs/m.png"):
        assert np.array_equal(np.asarray(Image.open(tmp_path / mask)) > 0, ipm_rs.RigLut(RIG, GRID).mask)


def test_gains_follow_the_frames_whatever_the_threads_do(tmp_path, capsys, monkeypatch):
    pytest.importorskip("av")
    from test_streams import smooth, write_video

    rig = ipm_rs.Rig({"front": camera(0), "left": camera(0.9)})  # which see much of the same road
    rig.save(tmp_path / "rig.json")
    for name, shade in (("front", 0.9), ("left", 0.5)):
        pictures = [(smooth(0) * (shade if k % 2 else 1 - 0.5 * shade)).astype(np.uint8) for k in range(8)]
        write_video(tmp_path / f"{name}.mp4", pictures)
    opened, damaged = rig_stream.opened, 2

    def uneven(path: Path, name: str) -> streams.Stream:
        """Every third frame takes long, so that those after it are there first; one cannot be read."""
        stream = opened(path, name)

        def load(ticket: streams.Ticket) -> streams.Frame:
            sleep(0.05 if ticket.index % 3 == 0 else 0)
            if ticket.index == damaged:
                raise errors.FileError("frame 2: damaged")
            return ticket.load()

        def tickets():
            for ticket in stream.tickets():
                yield dataclasses.replace(ticket, load=functools.partial(load, ticket))

        return dataclasses.replace(stream, make=tickets)

    monkeypatch.setattr(rig_stream, "opened", uneven)
    videos = {name: tmp_path / f"{name}.mp4" for name in rig}
    words = [f"{name}={path}" for name, path in videos.items()]
    for jobs in ("1", "4"):
        assert main("rig", f"{tmp_path}/rig.json", *words, "-o", f"{tmp_path}/{jobs}", "--gains", "--jobs", jobs) == 2
        assert "1 of 8 frames" in capsys.readouterr().err
    lut, gains = ipm_rs.RigLut(rig, GRID), None
    for frame in streams.together({name: streams.open(path) for name, path in videos.items()}):
        if frame.index == damaged:
            continue
        gains = lut.gains(frame.image, previous=gains)
        assert abs(gains["front"] - gains["left"]).max() > 0.05
        view = lut.warp(frame.image, interpolation="area", gains=gains)
        for jobs in ("1", "4"):
            assert np.array_equal(np.asarray(Image.open(tmp_path / jobs / f"{frame.name}_bev.png")), view)


def main(*arguments: str) -> int:
    return cli.main([*arguments, *WORDS])
