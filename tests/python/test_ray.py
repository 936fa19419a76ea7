"""`ipm_rs.ray`: workers, tried in this process; which partitions are done; one small cluster, where Ray is."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import pickle
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from helpers import refuses, textured
from PIL import Image

import ipm_rs
from ipm_rs import cli, errors, streams
from ipm_rs.ray import _cluster, _files, _places

pytest.importorskip("pyarrow")

K = [[55.0, 0, 31.2], [0, 55, 23.6], [0, 0, 1]]
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(64, 48), position=(1.0, 0.2, 1.5), pitch=0.3)
LUT = ipm_rs.Lut(CAMERA, ipm_rs.BevGrid(x=(2, 14), y=(-5, 5), resolution=(0.25, 0.5)))
PICTURES = np.stack([textured(48, 64, 3, seed=k) for k in range(3)])
VIEWS = np.stack([LUT.warp(picture) for picture in PICTURES])
HAS_FSSPEC = importlib.util.find_spec("fsspec") is not None
NO_SUCH_STORE = (errors.ArgumentError, "a path or a URI") if HAS_FSSPEC else (errors.MissingExtraError, "fsspec")


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "frames").mkdir()
    for number in range(7):
        Image.fromarray(textured(48, 64, 3, seed=number)).save(tmp_path / "frames" / f"{number}.png")
    return tmp_path / "frames"


@pytest.fixture
def here(monkeypatch) -> None:
    """Ray's place taken by this process: partitions one after another, through the pickle that a worker would get."""

    class Rows:
        def __init__(self, rows):
            self.rows = rows

        def map(self, worker, *, fn_constructor_args, compute, num_cpus):
            made = worker(*pickle.loads(pickle.dumps(fn_constructor_args)))
            return Rows(made(row) for row in self.rows)

        def iter_rows(self):
            return iter(self.rows)

    data = types.SimpleNamespace(
        DataContext=types.SimpleNamespace(get_current=lambda: types.SimpleNamespace(enable_progress_bars=True)),
        from_items=lambda rows, override_num_blocks: Rows(rows),
        ActorPoolStrategy=lambda **_: None,
    )
    module = types.SimpleNamespace(data=data, put=lambda value: value)
    monkeypatch.setattr(_files, "require_ray", lambda: module)
    monkeypatch.setattr(_files, "connected", lambda address: contextlib.nullcontext(module))


def files(place: Path) -> dict[str, bytes]:
    return {str(path.relative_to(place)): path.read_bytes() for path in place.rglob("*_bev.*")}


def png(picture: np.ndarray, path: Path) -> bytes:
    Image.fromarray(picture).save(path, "PNG")
    return path.read_bytes()


def column(*values) -> np.ndarray:
    found = np.empty(len(values), object)
    found[:] = values
    return found


# --------------------------------------------------------------------------------------------------------- batches


def test_batches_of_arrays(tmp_path):
    made = ipm_rs.ray.Warp(LUT)({"image": PICTURES, "name": np.array(["a", "b", "c"])})
    assert np.array_equal(made["bev"], VIEWS) and made["image"] is PICTURES and list(made) == ["image", "name", "bev"]
    replaced = ipm_rs.ray.Warp(LUT, "image", "image", interpolation="area", border_value=[1, 2, 3])
    wanted = [LUT.warp(picture, interpolation="area", border_value=[1, 2, 3]) for picture in PICTURES]
    assert np.array_equal(pickle.loads(pickle.dumps(replaced))({"image": PICTURES})["image"], wanted)
    grey = textured(48, 64, None)
    mixed = ipm_rs.ray.Warp(LUT)({"image": column(PICTURES[0], grey)})["bev"]
    assert mixed.dtype == object and np.array_equal(mixed[1], LUT.warp(grey)) and mixed[0].shape == (*LUT.shape, 3)


def test_batches_of_files(tmp_path):
    data = [png(picture, tmp_path / f"{k}") for k, picture in enumerate(PICTURES)]
    Path(tmp_path / "c d.png").write_bytes(data[2])
    rows = column(data[0], {"bytes": data[1], "path": None}, str(tmp_path / "c d.png"))
    assert np.array_equal(ipm_rs.ray.Warp(LUT)({"image": rows})["bev"], VIEWS)
    encoded = ipm_rs.ray.Warp(LUT, "image", "out", encode=".png")({"image": rows})["out"]
    streams.warp(streams.open(tmp_path / "c d.png"), LUT, tmp_path / "one")
    assert encoded[2] == (tmp_path / "one" / "c d_bev.png").read_bytes()


@pytest.mark.parametrize(
    ("value", "options", "error", "phrase"),
    [
        (b"no picture", {}, errors.FileError, "row 1 of a batch: an image of the dataset"),
        (b"", {}, errors.FileError, "an empty file"),
        ("/nowhere/a.png", {}, errors.MissingFileError, "row 1 of a batch: /nowhere/a.png"),
        (None, {}, errors.ArgumentTypeError, "got NoneType"),
        ({"path": None}, {}, errors.ArgumentTypeError, "got NoneType"),
        ("nosuch://a/b.png", {}, *NO_SUCH_STORE),
        (PICTURES[0][:40], {}, errors.ImageError, "64x40"),
        (PICTURES[0].astype("f8"), {"encode": ".png"}, errors.ImageError, "PNG"),
    ],
)
def test_images_that_are_none(value, options, error, phrase):
    with refuses(error, phrase):
        ipm_rs.ray.Warp(LUT, **options)({"image": column(PICTURES[0], value)})


def test_label_images_are_not_mixed(tmp_path):
    labels = Image.fromarray(textured(48, 64, None) // 64).convert("P")
    labels.save(tmp_path / "labels.png")
    rows = {"image": column((tmp_path / "labels.png").read_bytes())}
    with refuses(errors.ImageError, "nearest or mode"):
        ipm_rs.ray.Warp(LUT)(rows)
    assert ipm_rs.ray.Warp(LUT, interpolation="mode")(rows)["bev"].dtype == np.uint8


def test_arguments(folder, tmp_path, monkeypatch, here):
    Warp = ipm_rs.ray.Warp
    for make, error, phrase in (
        (lambda: Warp(CAMERA), errors.ArgumentTypeError, "expected a Lut, got Camera"),
        (lambda: Warp(LUT, 3), errors.ArgumentTypeError, "column: expected the name"),
        (lambda: Warp(LUT, interpolation="cubist"), errors.ArgumentError, "interpolation"),
        (lambda: Warp(LUT, border_value="x"), errors.IpmError, "border_value"),
        (lambda: Warp(LUT, encode=".gif"), errors.ArgumentError, ".png"),
        (lambda: Warp(LUT, level=10), errors.ArgumentError, "0 to 9"),
        (lambda: Warp(LUT)({"picture": PICTURES}), errors.ArgumentError, "expected one of picture, got image"),
        (lambda: ipm_rs.ray.warp_files(folder, None, tmp_path), errors.ArgumentTypeError, "lut"),
        (lambda: ipm_rs.ray.warp_files(folder, LUT, tmp_path, ending=".gif"), errors.ArgumentError, "ending"),
        (lambda: ipm_rs.ray.warp_files(folder, LUT, tmp_path, partition=0), errors.ArgumentError, "partition"),
        (lambda: ipm_rs.ray.warp_files(folder, LUT, tmp_path / "x", workers=0), errors.ArgumentError, "workers"),
        (lambda: ipm_rs.ray.warp_files(folder, LUT, tmp_path, strict=1), errors.ArgumentTypeError, "strict"),
    ):
        with refuses(error, phrase):
            make()
    assert not (tmp_path / "x").exists()
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.delitem(sys.modules, "ray.data", raising=False)
    monkeypatch.setattr(_files, "require_ray", _cluster.require_ray)
    for missing in (lambda: ipm_rs.ray.warp_files(folder, LUT, tmp_path / "x"), lambda: ipm_rs.ray.warp([], LUT)):
        with refuses(errors.MissingExtraError, "ipm-rs[ray]"):
            missing()
    assert not (tmp_path / "x").exists()


def test_a_cpu_is_left_for_reading():
    def of(cpus: float, nodes: int, workers: int | None) -> float:
        ray = types.SimpleNamespace(cluster_resources=lambda: {"CPU": cpus}, nodes=lambda: [None] * nodes)
        return _cluster.share(ray, workers)

    assert of(1, 1, None) == of(1, 1, 3) == 0
    assert of(2, 1, 2) == 0.5 and of(2, 1, 4) == 0.25 and of(4, 1, 8) == 0.37
    assert of(0, 1, 100) == of(8, 4, 100) == 0.5  # an autoscaler's head, and its first machines


# ----------------------------------------------------------------------------------------------------------- files


def test_files_are_those_of_one_process(folder, tmp_path, here):
    streams.warp(streams.open(folder), LUT, tmp_path / "one", interpolation="area")
    told = []
    summary = ipm_rs.ray.warp_files(
        folder, LUT, tmp_path / "all", partition=3, interpolation="area", report=lambda *done: told.append(done)
    )
    assert (summary.done, summary.skipped, summary.failed) == (7, 0, []) and told == [(3, []), (3, []), (1, [])]
    assert files(tmp_path / "all") == files(tmp_path / "one") and len(files(tmp_path / "all")) == 7
    listed = [str(folder / f"{number}.png") for number in range(7)]
    for source, more in (
        (listed, {}),
        (folder.as_uri(), {}),
        (folder.as_uri() + "/?.png", {}),
        ([f"file://{path}" for path in listed], {}),
        (folder.parent / "frames" / "*.png", {}),
        (folder.parent, {"recursive": True}),
    ):
        out = tmp_path / f"out{len(list(tmp_path.iterdir()))}"
        if more:
            (folder.parent / "out-of-frames").mkdir()
            source = folder
        assert ipm_rs.ray.warp_files(source, LUT, out, interpolation="area", **more).done == 7
        assert files(out) == files(tmp_path / "one")


def test_what_was_stopped_goes_on(folder, tmp_path, here, monkeypatch):
    out, count = tmp_path / "out", 0
    whole, decode = tmp_path / "whole", _files.images.decode
    ipm_rs.ray.warp_files(folder, LUT, whole, partition=2)

    def dying(data, name):
        nonlocal count
        count += 1
        if count == 4:
            raise KeyboardInterrupt
        return decode(data, name)

    monkeypatch.setattr(_files.images, "decode", dying)
    with pytest.raises(KeyboardInterrupt):
        ipm_rs.ray.warp_files(folder, LUT, out, partition=2)
    assert len(files(out)) == 3 and len(list((out / "_ipm_rs").glob("part-*"))) == 1
    monkeypatch.setattr(_files.images, "decode", decode)
    Image.fromarray(textured(48, 64, 3, seed=9)).save(folder / "9.png")  # added at the end meanwhile
    summary = ipm_rs.ray.warp_files(folder, LUT, out, partition=2)
    assert (summary.done, summary.skipped) == (6, 2)
    assert {name: data for name, data in files(out).items() if name != "9_bev.png"} == files(whole)
    again = ipm_rs.ray.warp_files(folder, LUT, out, partition=2)
    assert (again.done, again.skipped, again.seconds < 1) == (0, 8, True)


def test_an_output_is_of_one_table(folder, tmp_path, here):
    out = tmp_path / "out"
    ipm_rs.ray.warp_files(folder, LUT, out)
    other = ipm_rs.Lut(CAMERA.with_pose(camera_from_vehicle=CAMERA.camera_from_vehicle), LUT.grid, ground=0.1)
    for lut, options, phrase in (
        (other, {}, "one of another table;"),
        (LUT, {"interpolation": "nearest", "border_value": 7}, "another interpolation, border_value;"),
    ):
        with refuses(errors.FileError, phrase):
            ipm_rs.ray.warp_files(folder, lut, out, **options)
    before = files(out)
    assert ipm_rs.ray.warp_files(folder, other, out, overwrite=True).done == 7
    assert files(out).keys() == before.keys() and files(out) != before
    (out / "_ipm_rs" / "run.json").write_text("[half")
    with refuses(errors.FileError, "one of another table"):
        ipm_rs.ray.warp_files(folder, other, out)


def test_damaged_images_are_told_of_and_tried_again(folder, tmp_path, here):
    good = (folder / "3.png").read_bytes()
    (folder / "3.png").write_bytes(good[:200])
    Image.fromarray(textured(30, 64, 3)).save(folder / "5.png")
    with refuses(errors.FileError, "3.png"):
        ipm_rs.ray.warp_files(folder, LUT, tmp_path / "strict", strict=True)
    summary = ipm_rs.ray.warp_files(folder, LUT, tmp_path / "out", partition=2)
    assert summary.done == 5 and [type(error) for error in summary.failed] == [errors.FileError, errors.ImageError]
    assert "5.png: " in str(summary.failed[1]) and len(files(tmp_path / "out")) == 5
    (folder / "3.png").write_bytes(good)
    summary = ipm_rs.ray.warp_files(folder, LUT, tmp_path / "out", partition=2)
    assert (summary.done, summary.skipped, len(summary.failed)) == (3, 3, 1)


def test_names(folder, tmp_path, here):
    (folder / "deep").mkdir()
    (folder / "0.png").rename(folder / "deep" / "1.png")
    assert ipm_rs.ray.warp_files(folder, LUT, tmp_path / "out", recursive=True, ending=".jpg").done == 7
    assert sorted(files(tmp_path / "out"))[-2:] == ["6_bev.jpg", "deep/1_bev.jpg"]
    Image.open(folder / "1.png").save(folder / "1.bmp")
    with refuses(errors.ArgumentError, "would both become"):
        ipm_rs.ray.warp_files(folder, LUT, tmp_path / "twice")
    for source, error, phrase in (
        ([], errors.ArgumentError, "empty list"),
        (7, errors.ArgumentTypeError, "got int"),
        ([folder / "1.png", 7], errors.ArgumentTypeError, "got int"),
        ("nosuch://bucket/frames", *NO_SUCH_STORE),
        (tmp_path.as_uri() + "/*.png", errors.FileError, "found none"),
        (tmp_path / "none", errors.MissingFileError, "found none"),
    ):
        with refuses(error, phrase):
            ipm_rs.ray.warp_files(source, LUT, tmp_path / "bad")
    (tmp_path / "file").write_text("")
    with refuses(errors.FileError, "file"):
        ipm_rs.ray.warp_files(folder / "1.png", LUT, tmp_path / "file" / "below")


def test_other_filesystems(folder, tmp_path, here):
    local = pytest.importorskip("fsspec.implementations.local").LocalFileSystem()
    out = tmp_path / "far"
    summary = ipm_rs.ray.warp_files(str(folder), LUT, str(out), filesystem=local, partition=3)
    ipm_rs.ray.warp_files(folder, LUT, tmp_path / "near")
    assert summary.done == 7 and files(out) == files(tmp_path / "near")
    assert not [path for path in out.rglob("*") if path.name.startswith(".ipm-rs")]
    assert ipm_rs.ray.warp_files(str(folder), LUT, str(out), filesystem=local, partition=3).skipped == 7
    with refuses(errors.ArgumentTypeError, "of pyarrow.fs or of fsspec"):
        ipm_rs.ray.warp_files(str(folder), LUT, str(out), filesystem=7)
    place = _places.place_of("path", str(out / "a.bin"), local)
    place.write(b"12"), place.write(b"3")
    assert place.read() == b"3"
    place.remove()
    for work in (place.read, place.remove):
        with refuses(errors.FileError, "a.bin"):
            work()


def test_command_line(folder, tmp_path, here, capsys, monkeypatch):
    CAMERA.save(tmp_path / "camera.json")
    monkeypatch.chdir(tmp_path)
    base = ["warp", "camera.json", "frames", "--x", "2", "14", "--y", "-5", "5", "--resolution", "0.25", "0.5"]
    assert cli.main([*base, "-o", "one"]) == 0
    assert cli.main([*base, "-o", "all", "--ray", "--mask", "mask.png"]) == 0
    assert files(Path("all")) == files(Path("one")) and Path("mask.png").exists()
    assert "7 images" in capsys.readouterr().out.splitlines()[-1]
    assert cli.main([*base, "-o", "all", "--ray"]) == 0 and "0 images, 7 were there" in capsys.readouterr().out
    Path("frames/2.png").write_bytes(b"x")
    for arguments, phrase in (
        (["-o", "all2", "--ray"], "1 of 7 images could not be warped"),
        (["-o", "one", "--ray"], "expected an empty folder, or one that --ray began"),
        (["-o", "bev.mp4", "--ray"], "got bev.mp4, a video"),
        (["-o", "x", "--ray", "auto", "--poses", "p.csv"], "--poses"),
        (["-o", "x", "--ray", "auto", "--start", "3"], "--start"),
        (["-o", "x", "--ray", "auto", "--every", "3"], "--every"),
        (["-o", "all", "--ray", "auto", "--interpolation", "area"], "another interpolation"),
    ):
        assert cli.main([*base, *arguments]) == 2
        assert phrase in capsys.readouterr().err.splitlines()[-1]
    assert cli.main(["warp", "camera.json", "s3://bucket/frames", "-o", "x"]) == 2
    assert "give --ray" in capsys.readouterr().err


# --------------------------------------------------------------------------------------------------------- cluster


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("ignore")
def test_a_cluster(folder, tmp_path):
    """The whole way through Ray itself, as far as 20 seconds go: the rest is in scripts/try_ray.py."""
    ray = pytest.importorskip("ray", reason="needs the extra ray")
    streams.warp(streams.open(folder), LUT, tmp_path / "one")
    (tmp_path / "more").mkdir()
    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
    try:
        ray.data.DataContext.get_current().enable_progress_bars = False
        summary = ipm_rs.ray.warp_files(folder, LUT, tmp_path / "all", workers=1, partition=4)
        assert summary.done == 7 and not summary.failed and files(tmp_path / "all") == files(tmp_path / "one")
        assert json.loads((tmp_path / "all" / "_ipm_rs" / "run.json").read_text())["interpolation"] == "bilinear"
        rows = ipm_rs.ray.warp(ray.data.read_images(str(folder), include_paths=True), LUT, workers=1).take_all()
        assert len(rows) == 7
        for row in rows:
            assert np.array_equal(row["bev"], LUT.warp(np.asarray(Image.open(row["path"]))))
        with refuses(errors.ArgumentError, "uses a cluster already"):
            ipm_rs.ray.warp_files(folder, LUT, tmp_path / "x", address="127.0.0.1:1")
    finally:
        ray.shutdown()
