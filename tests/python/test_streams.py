"""Streams: every frame once, in order, from folders, lists and videos; what is damaged is told of and stops nothing."""

from __future__ import annotations

import errno
import functools
import threading
import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from helpers import refuses, textured
from PIL import Image

import ipm_rs
from ipm_rs import errors, streams
from ipm_rs.cli import main
from ipm_rs.streams import sinks
from ipm_rs.streams.ordered import ordered

av = pytest.importorskip("av")

K = [[55.0, 0, 31.2], [0, 55, 23.6], [0, 0, 1]]
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(64, 48), position=(1.0, 0.2, 1.5), pitch=0.3)
LUT = ipm_rs.Lut(CAMERA, ipm_rs.BevGrid(x=(2, 14), y=(-5, 5), resolution=(0.25, 0.5)))


def smooth(number: int, rows: int = 48, cols: int = 64) -> np.ndarray:
    """A picture without edges that no codec changes much, another for each number."""
    y, x = np.mgrid[:rows, :cols]
    return np.stack([x + 8 * number, 2 * y + 20, 200 - x - y], -1).astype(np.uint8)


def write_video(path: Path, pictures, ticks=None, codec="libx264", rate=10, form="yuv420p", options=None) -> None:
    with av.open(str(path), "w", options=options or {}) as container:
        stream = container.add_stream(codec, rate=rate)
        stream.height, stream.width, stream.pix_fmt = *pictures[0].shape[:2], form
        stream.codec_context.time_base = Fraction(1, 1000)
        stream.options = {"crf": "4"}
        for number, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format=form, dst_colorspace=5)
            frame.pts, frame.time_base = (ticks or range(0, 10**6, 1000 // rate))[number], Fraction(1, 1000)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "frames").mkdir()
    for number in (1, 2, 10):
        Image.fromarray(textured(48, 64, 3, seed=number)).save(tmp_path / "frames" / f"{number}.png")
    (tmp_path / "frames" / "notes.md").write_text("no frame")
    return tmp_path / "frames"


def names(stream) -> list[str]:
    return [frame.name for frame in stream]


def test_folders_patterns_and_lists(folder):
    stream = streams.open(folder)
    assert names(stream) == names(stream) == ["1", "2", "10"] and stream.count == 3
    assert all(np.array_equal(f.image, textured(48, 64, 3, seed=int(f.name))) for f in stream)
    assert names(streams.open(str(folder / "*.png"), every=2)) == ["1", "10"]
    (folder / "list.txt").write_text("# mine\n10.png\n\n1.png\n")
    assert names(streams.open(folder / "list.txt")) == ["10", "1"]
    with refuses(errors.ArgumentError, "without timestamps"):
        names(streams.open(folder, start=1.0))
    for path, error, phrase in (
        (folder / "*.jpg", errors.MissingFileError, "pattern"),
        (folder / "none", errors.FileError, "none that is known"),
        (folder / "none.mp4", errors.MissingFileError, "a video"),
    ):
        with refuses(error, phrase):
            streams.open(path)
    (folder / "list.txt").write_text("\n")
    with refuses(errors.FileError, "empty list"):
        streams.open(folder / "list.txt")
    for arguments, phrase in (({"every": 0}, "every"), ({"kind": "tape"}, "'folder'"), ({"end": -1}, "end")):
        with refuses(errors.ArgumentError, phrase):
            streams.open(folder, **arguments)


def test_a_video_has_its_frames_and_its_own_timestamps(tmp_path):
    ticks = [500, 600, 650, 900, 1900]  # variable, and not from zero
    write_video(tmp_path / "a.mkv", [smooth(n) for n in range(5)], ticks)
    stream = streams.open(tmp_path / "a.mkv")
    frames = list(stream)
    assert [frame.timestamp for frame in frames] == [0, 0.1, 0.15, 0.4, 1.4]
    assert stream.size == (64, 48) and [frame.index for frame in frames] == [0, 1, 2, 3, 4]
    for number, frame in enumerate(frames):
        assert np.abs(frame.image.astype(int) - smooth(number)).max() <= 6
    assert names(streams.open(tmp_path / "a.mkv", start=0.1, end=1.0)) == ["000001", "000002", "000003"]


def test_ten_bits_become_sixteen_if_wanted(tmp_path):
    write_video(tmp_path / "a.mkv", [smooth(n) for n in range(2)], form="yuv420p10le")
    deep = next(iter(streams.open(tmp_path / "a.mkv", bits=16))).image
    flat = next(iter(streams.open(tmp_path / "a.mkv"))).image
    assert deep.dtype == np.uint16 and flat.dtype == np.uint8
    assert np.abs(deep / 257.0 - flat).mean() < 2 and len(np.unique(deep)) > 256


def test_a_video_that_does_not_say_how_many_frames_it_has(tmp_path):
    """Matroska says how long it lasts."""
    write_video(tmp_path / "drive.mkv", [textured(48, 64, 3, seed=n) for n in range(20)])
    data = (tmp_path / "drive.mkv").read_bytes()
    (tmp_path / "cut.mkv").write_bytes(data[: len(data) // 2])
    whole = streams.warp(streams.open(tmp_path / "drive.mkv"), LUT, tmp_path / "whole")
    cut = streams.warp(streams.open(tmp_path / "cut.mkv"), LUT, tmp_path / "cut")
    assert whole.done == 20 and not whole.failed
    assert 0 < cut.done < 20 and len(cut.failed) == 1 and "as its header says" in str(cut.failed[0])


def test_a_disk_without_room_for_a_video_is_told_of_as_such(tmp_path):
    sink = sinks.Video(tmp_path / "bev.mp4")
    with refuses(errors.FileError, "expected to write it", "No space left", "free space"), sink._writing():
        raise OSError(errno.ENOSPC, "No space left on device")


def test_videos_that_are_none_or_cut_short(tmp_path):
    write_video(tmp_path / "a.mp4", [smooth(n) for n in range(12)])
    data = (tmp_path / "a.mp4").read_bytes()
    (tmp_path / "cut.mp4").write_bytes(data[: len(data) // 2])
    (tmp_path / "text.mp4").write_text("no video")
    (tmp_path / "empty.mkv").write_bytes(b"")
    for name in ("cut.mp4", "text.mp4", "empty.mkv"):
        with refuses(errors.FileError, name, "a video"):
            streams.open(tmp_path / name)
    with refuses(errors.ArgumentError, "rotation", "'apply'"):
        streams.open(tmp_path / "a.mp4", rotation="left")


def test_a_stream_that_ends_early_says_so(tmp_path):
    pictures = [textured(48, 64, 3, seed=n) for n in range(12)]
    write_video(tmp_path / "a.mp4", pictures, options={"movflags": "faststart"})  # its index comes first
    data = (tmp_path / "a.mp4").read_bytes()
    (tmp_path / "cut.mp4").write_bytes(data[: len(data) // 2])
    summary = streams.warp(streams.open(tmp_path / "cut.mp4"), LUT, tmp_path / "out")
    assert 0 < summary.done < 12 and summary.failed
    assert "12 frames as its header says" in str(summary.failed[-1])


def test_a_folder_goes_through_a_table(folder, tmp_path):
    for jobs in (1, 3):
        summary = streams.warp(streams.open(folder), LUT, tmp_path / str(jobs), jobs=jobs)
        assert (summary.done, summary.skipped, summary.failed) == (3, 0, [])
        for name in ("1", "2", "10"):
            bev = np.asarray(Image.open(tmp_path / str(jobs) / f"{name}_bev.png"))
            assert np.array_equal(bev, LUT.warp(textured(48, 64, 3, seed=int(name))))


def test_damaged_frames_are_told_of_in_order_and_stop_nothing(folder, tmp_path):
    (folder / "3.png").write_bytes((folder / "2.png").read_bytes()[:900])
    Image.fromarray(textured(9, 9, 3)).save(folder / "4.png")  # of another size
    told = []
    summary = streams.warp(
        streams.open(folder),
        LUT,
        tmp_path / "out",
        report=lambda ticket, error: told.append((ticket.name, bool(error))),
    )
    assert told == [("1", False), ("2", False), ("3", True), ("4", True), ("10", False)]
    assert summary.done == 3 and ["3.png" in str(summary.failed[0]), "9x9" in str(summary.failed[1])] == [True, True]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["10_bev.png", "1_bev.png", "2_bev.png"]
    with refuses(errors.FileError, "3.png"):
        streams.warp(streams.open(folder), LUT, tmp_path / "strict", strict=True)


def test_it_goes_on_where_it_stopped(folder, tmp_path):
    streams.warp(streams.open(folder, every=2), LUT, tmp_path / "out")
    before = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "out").iterdir()}
    summary = streams.warp(streams.open(folder), LUT, tmp_path / "out", skip_existing=True)
    assert (summary.done, summary.skipped) == (1, 2)
    assert all((tmp_path / "out" / name).stat().st_mtime_ns == stamp for name, stamp in before.items())


@pytest.mark.parametrize("ending", sinks.VIDEO_CODECS)
def test_every_kind_of_video_has_every_frame(folder, tmp_path, ending):
    summary = streams.warp(streams.open(folder), LUT, tmp_path / f"a{ending}")
    assert (summary.done, summary.failed) == (3, [])
    assert [frame.timestamp for frame in streams.open(tmp_path / f"a{ending}")] == pytest.approx(
        [0, 0.04, 0.08], abs=2e-3
    )
    write_video(tmp_path / "uneven.mkv", [smooth(n) for n in range(5)], [0, 100, 101, 400, 530])
    assert streams.warp(streams.open(tmp_path / "uneven.mkv"), LUT, tmp_path / f"b{ending}").failed == []
    with av.open(str(tmp_path / f"b{ending}")) as container:
        assert sum(1 for _ in container.decode(video=0)) == 5


def test_frames_of_one_name_are_refused_before_anything_is_written(folder, tmp_path):
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "2.png").write_bytes((folder / "10.png").read_bytes())
    pattern = str(tmp_path / "[fm]*" / "*.png")
    for out, more in (("out", {}), ("out", {"skip_existing": True}), ("a.mp4", {"mask": tmp_path / "out"})):
        with refuses(errors.ArgumentError, "2.png"):
            streams.warp(streams.open(pattern), LUT, tmp_path / out, **more)
    for out, more in (("out", {"mask": tmp_path / "more" / ".." / "out"}), ("a.mp4", {"mask": tmp_path / "a.mp4"})):
        with refuses(errors.ArgumentError, "mask"):
            streams.warp(streams.open(folder), LUT, tmp_path / out, **more)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frames", "more"]
    assert streams.warp(streams.open(pattern), LUT, tmp_path / "a.mp4").done == 4
    shards = streams.warp(streams.open(pattern), LUT, tmp_path / "shards", ending=".npz")
    assert shards.done == 4


def test_a_second_frame_of_a_name_never_replaces_the_first(folder, tmp_path):
    """Of a stream whose frames have no files of their own."""
    pictures = [textured(48, 64, 3, seed=n) for n in range(3)]

    def tickets():
        for index, picture in enumerate(pictures):
            frame = streams.Frame(picture, "same" if index < 2 else "other", index)
            yield streams.Ticket(frame.name, index, None, lambda frame=frame: frame)

    for skip in (False, True):
        out = tmp_path / str(skip)
        summary = streams.warp(streams.Stream("made", tickets), LUT, out, jobs=1, skip_existing=skip)
        assert (summary.done, len(summary.failed)) == (2, 1) and "same_bev.png" in str(summary.failed[0])
        assert np.array_equal(np.asarray(Image.open(out / "same_bev.png")), LUT.warp(pictures[0]))
    again = streams.warp(streams.Stream("made", tickets), LUT, out, jobs=1, skip_existing=True)
    assert (again.done, again.skipped, len(again.failed)) == (0, 2, 1)


def test_a_video_becomes_a_video_with_the_same_timestamps(tmp_path):
    ticks = [0, 100, 150, 400]
    write_video(tmp_path / "a.mkv", [smooth(n) for n in range(4)], ticks)
    summary = streams.warp(streams.open(tmp_path / "a.mkv"), LUT, tmp_path / "bev.mp4", jobs=2)
    assert summary.done == 4
    frames = list(streams.open(tmp_path / "bev.mp4"))
    assert [frame.timestamp for frame in frames] == pytest.approx([tick / 1000 for tick in ticks], abs=1e-4)
    inside = LUT.mask
    for number, frame in enumerate(frames):
        difference = np.abs(frame.image.astype(int) - LUT.warp(smooth(number)))
        assert np.median(difference[inside]) <= 4  # two lossy codecs; the edge of the mask rings
    assert streams.warp(streams.open(tmp_path / "a.mkv"), LUT, tmp_path / "bev.mp4", skip_existing=True).done == 0


def test_a_video_is_made_again_where_that_of_its_mask_is_not_there(tmp_path):
    write_video(tmp_path / "a.mkv", [smooth(n) for n in range(3)])
    bev, mask = tmp_path / "bev.mp4", tmp_path / "mask.mp4"
    streams.warp(streams.open(tmp_path / "a.mkv"), LUT, bev)
    for done in (3, 0):
        summary = streams.warp(streams.open(tmp_path / "a.mkv"), LUT, bev, skip_existing=True, mask=mask)
        assert summary.done == done and len(list(streams.open(bev))) == 3
        shown = [np.atleast_3d(frame.image)[..., 0] > 127 for frame in streams.open(mask)]
        assert len(shown) == 3 and (shown[0][: LUT.shape[0], : LUT.shape[1]] == LUT.mask).mean() > 0.98  # a lossy codec


def test_nothing_half_is_left_of_a_video(tmp_path):
    write_video(tmp_path / "a.mkv", [smooth(n) for n in range(4)])

    def failing(frame):
        if frame.index == 2:
            raise errors.ImageError("no table for this frame")
        return LUT

    with refuses(errors.ImageError, "no table"):
        streams.warp(streams.open(tmp_path / "a.mkv"), failing, tmp_path / "bev.mp4", strict=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mkv"]
    assert streams.warp(streams.open(tmp_path / "a.mkv"), failing, tmp_path / "bev.mp4").done == 3


def test_shards_and_arrays(folder, tmp_path):
    streams.warp(streams.open(folder), LUT, tmp_path / "shards", ending=".npz")
    with np.load(tmp_path / "shards" / "shard-00000.npz") as shard:
        assert shard["names"].tolist() == ["1", "2", "10"] and np.isnan(shard["timestamps"]).all()
        assert np.array_equal(shard["images"][2], LUT.warp(textured(48, 64, 3, seed=10)))
    streams.warp(streams.open(folder), LUT, tmp_path / "arrays", ending=".npy", interpolation="area")
    area = LUT.warp(textured(48, 64, 3, seed=1), interpolation="area")
    assert np.array_equal(np.load(tmp_path / "arrays" / "1_bev.npy"), area)
    with refuses(errors.ArgumentError, ".gif"):
        streams.warp(streams.open(folder), LUT, tmp_path / "x", ending=".gif")


def test_a_folder_that_vanishes_stops_the_run(folder, tmp_path):
    def removing(frame):
        for path in (tmp_path / "out").iterdir():
            path.unlink()
        (tmp_path / "out").rmdir()
        return LUT

    with refuses(errors.FileError, "expected to write"):
        streams.warp(streams.open(folder), removing, tmp_path / "out", jobs=1)


def test_names_that_no_output_can_have(folder, tmp_path):
    (tmp_path / "file").write_text("")
    for name in ("x" * 300, "file", "file/below"):
        with refuses(errors.FileError, name[:20], "expected to write"):
            streams.warp(streams.open(folder), LUT, tmp_path / name)


def test_results_are_in_order_and_bounded():
    under_way, most, lock = 0, 0, threading.Lock()

    def items():
        nonlocal under_way, most
        for number in range(60):
            with lock:
                under_way += 1
                most = max(most, under_way)
            yield number

    def work(number):
        time.sleep(0.001 * (number % 3))
        return number * number

    seen = []
    for number, future in ordered(items(), work, jobs=3):
        seen.append((number, future.result()))
        with lock:
            under_way -= 1
    assert seen == [(number, number * number) for number in range(60)] and most <= 6


def test_errors_of_the_source_come_after_the_results_before_them_and_closing_ends_all():
    def items():
        yield 1
        raise errors.FileError("gone")

    results = ordered(items(), lambda number: number, 2)
    assert next(results)[0] == 1
    with pytest.raises(errors.FileError, match="gone"):
        next(results)
    before = threading.active_count()
    endless = ordered(iter(functools.partial(int, 7), None), lambda number: number, 2)
    next(endless)
    endless.close()
    assert threading.active_count() == before


GRID = ["--x", "2", "14", "--y", "-5", "5", "--resolution", "0.25", "0.5"]


@pytest.fixture
def calibration(tmp_path) -> str:
    CAMERA.save(tmp_path / "camera.json")
    return str(tmp_path / "camera.json")


def test_the_command_takes_a_folder_and_goes_on(folder, tmp_path, calibration, capsys):
    out = tmp_path / "bevs"
    assert main(["warp", calibration, str(folder), "-o", str(out), "--jobs", "2", *GRID]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == [
        str(out / f"{name}_bev.png") for name in ("1", "2", "10")
    ]
    (out / "2_bev.png").unlink()
    stamp = (out / "1_bev.png").stat().st_mtime_ns
    assert main(["warp", calibration, str(folder), "-o", str(out), *GRID]) == 2
    assert "exists" in capsys.readouterr().err and not (out / "2_bev.png").exists()
    assert main(["warp", calibration, str(folder), "-o", str(out), "--skip-existing", *GRID]) == 0
    assert "1 images, 2 were there" in capsys.readouterr().out
    assert np.array_equal(np.asarray(Image.open(out / "2_bev.png")), LUT.warp(textured(48, 64, 3, seed=2)))
    assert (out / "1_bev.png").stat().st_mtime_ns == stamp


def test_many_images_are_told_of_in_one_line(tmp_path, calibration, capsys):
    (tmp_path / "many").mkdir()
    for number in range(21):
        Image.fromarray(textured(48, 64, seed=number)).save(tmp_path / "many" / f"{number}.png")
    assert main(["warp", calibration, str(tmp_path / "many"), "-o", str(tmp_path / "bevs"), *GRID]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 and "21 images" in lines[0]


def test_the_command_takes_videos(folder, tmp_path, calibration, capsys):
    write_video(tmp_path / "a.mp4", [smooth(n) for n in range(6)])
    video, bev, mask = (str(tmp_path / name) for name in ("a.mp4", "bev.mp4", "mask.png"))
    assert main(["warp", calibration, video, "-o", bev, "--mask", mask, "--every", "2", *GRID]) == 0
    assert "3 frames" in capsys.readouterr().out
    assert [frame.timestamp for frame in streams.open(bev)] == pytest.approx([0, 0.2, 0.4], abs=1e-4)
    assert np.array_equal(np.asarray(Image.open(mask)) > 0, LUT.mask)
    again = ["--mask", mask, "--mask-video", str(tmp_path / "mask.mp4"), "--skip-existing"]
    for frames in ("2 frames", "0 frames"):  # then nothing is left to do
        assert main(["warp", calibration, video, "-o", bev, "--every", "3", *again, *GRID]) == 0
        assert frames in capsys.readouterr().out
    frames = str(tmp_path / "bevs")
    assert main(["warp", calibration, video, "-o", frames, "--start", "0.2", "--end", "0.5", *GRID]) == 0
    assert len(list(Path(frames).iterdir())) == 3
    assert main(["warp", calibration, str(folder), "-o", str(tmp_path / "c.mkv"), *GRID]) == 0
    assert len(list(streams.open(tmp_path / "c.mkv"))) == 3
    capsys.readouterr()
    write_video(tmp_path / "b.mp4", [smooth(0, 32, 32)])
    (tmp_path / "d.mp4").write_text("no video")
    before = sorted(tmp_path.iterdir())
    for arguments, phrase in (
        ([video, "-o", bev], "--force"),
        ([video, "-o", video, "--force"], "got an input"),
        ([video, "-o", frames], "--skip-existing"),
        ([str(tmp_path / "b.mp4"), "-o", str(tmp_path / "x.mp4")], "32x32"),
        ([str(tmp_path / "d.mp4"), "-o", str(tmp_path / "x.mp4")], "d.mp4"),
        ([str(folder), "-o", str(tmp_path / "x"), "--start", "1"], "no time"),
        ([video, "-o", str(tmp_path / "x.mp4"), "--mask", mask], "--force"),
        ([str(folder), "-o", str(tmp_path / "x.mp4"), "--mask", f"{folder}/1.png", "--skip-existing"], "an input"),
    ):
        assert main(["warp", calibration, *arguments, *GRID]) == 2
        assert phrase in capsys.readouterr().err, phrase
    assert sorted(tmp_path.iterdir()) == before
