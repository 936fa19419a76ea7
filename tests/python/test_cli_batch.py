"""Batches of the command line: a damaged file, a signal or a wrong name of the output spoils nothing else."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers import textured
from PIL import Image

import ipm_rs
from ipm_rs import cli, pointfile

WIDTH, HEIGHT = 160, 96
GRID = ["--x", "2", "22", "--y", "-8", "8", "--resolution"]


@pytest.fixture
def frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Current directory with ``camera.json`` and six pictures, whose names are returned."""
    monkeypatch.chdir(tmp_path)
    K = [[150, 0, 79.5], [0, 150, 47.5], [0, 0, 1]]
    ipm_rs.Camera.from_euler(K, image_size=(WIDTH, HEIGHT), position=(0, 0, 1.4), pitch=0.15).save("camera.json")
    names = [f"f{i}.png" for i in range(6)]
    for seed, name in enumerate(names):
        Image.fromarray(textured(HEIGHT, WIDTH, 3, seed=seed)).save(name)
    return names


def names(folder: str) -> list[str]:
    return sorted(path.name for path in Path(folder).iterdir())


def test_empty_and_damaged_pictures_do_not_stop_the_others(frames, capsys):
    Path("f1.png").write_bytes(b"")
    Path("f2.png").write_bytes(Path("f2.png").read_bytes()[:700])
    Path("f4.png").write_text("no picture")
    assert cli.main(["warp", "camera.json", *frames, "-o", "out", *GRID, "0.5", "--mask", "mask.png"]) == 2
    assert names("out") == ["f0_bev.png", "f3_bev.png", "f5_bev.png"]
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert len(lines) == 4 and all(line.startswith("ipm-rs: error: ") for line in lines)
    assert [line.split()[2] for line in lines[:3]] == ["f1.png:", "f4.png:", "f2.png:"]
    assert "an empty file" in lines[0] and "3 of 6 images" in lines[3]
    assert len(captured.out.splitlines()) == 4


def test_a_batch_of_which_nothing_can_be_read(frames, capsys):
    for name in frames:
        Path(name).write_bytes(b"")
    assert cli.main(["warp", "camera.json", *frames, "-o", "out", *GRID, "0.5"]) == 2
    assert "none can be read" in capsys.readouterr().err.splitlines()[-1]
    assert not Path("out").exists()


def test_damaged_depth_or_colours_do_not_stop_the_others(frames, capsys):
    depths = [f"d{i}.npz" for i in range(4)]
    for name in depths:
        np.savez_compressed(name, depth=textured(HEIGHT, WIDTH, dtype="float32") + 120)
    data = bytearray(Path("d1.npz").read_bytes())
    data[len(data) // 2] ^= 0x55
    Path("d1.npz").write_bytes(bytes(data))
    Path("f3.png").write_bytes(b"")
    assert cli.main(["cloud", "camera.json", *depths, "--rgb", *frames[:4], "-o", "clouds"]) == 2
    assert names("clouds") == ["d0.ply", "d2.ply"]
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3 and "d1.npz" in lines[0] and "f3.png" in lines[1] and "2 of 4" in lines[2]


def test_arrays_that_claim_what_they_do_not_hold(frames, capsys):
    np.savez("depth.npz", depth=np.full((HEIGHT, WIDTH), 5, np.float32))
    good = Path("depth.npz").read_bytes()
    shape = f"({HEIGHT}, {WIDTH})".encode()
    hostile = good.replace(shape, b"(9999, 999)"[: len(shape)].ljust(len(shape)))
    assert hostile != good
    for name, content in {
        "a.npz": hostile,
        "b.npz": b"",
        "c.npz": good[:-30],
        "d.npy": b"\x93NUMPY\x01\x00\x40\x00" + b"(" * 64,
        "e.npy": b"\x93NUMPY\x01\x00\x76\x00"
        + b"{'descr': '<f4', 'fortran_order': False, 'shape': (4000000000, 4)}".ljust(118),
        "f.npy": good,
    }.items():
        Path(name).write_bytes(content)
        assert cli.main(["cloud", "camera.json", name, "-o", "cloud.ply"]) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert line.startswith(f"ipm-rs: error: {name}: ")
    assert not Path("cloud.ply").exists()


@pytest.mark.parametrize("command", ["warp", "cloud"])
@pytest.mark.parametrize("out", ["bev.mp4", "bev.gif", "bev.xyz", "new/bev.webm"])
def test_the_name_of_a_file_is_no_directory(frames, capsys, command, out):
    if command == "cloud":
        np.save("a.npy", np.full((HEIGHT, WIDTH), 5, np.float32))
        np.save("b.npy", np.full((HEIGHT, WIDTH), 6, np.float32))
        frames = ["a.npy", "b.npy"]
    before = names(".")
    for several in (frames[:2], frames[:1]):
        assert cli.main([command, "camera.json", *several, "-o", out]) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert out in line
    assert names(".") == before
    assert cli.main([command, "camera.json", *frames[:2], "-o", f"{out}/", "--quiet", *GRID, "1"]) == 0
    assert len(names(out)) == 2


@pytest.mark.parametrize("heights", [("0", "inf"), ("-inf", "0"), ("0", "1e300"), ("nan", "1"), ("2", "1")])
def test_heights_of_the_picture_are_metres(frames, capsys, heights):
    np.save("a.npy", np.full((HEIGHT, WIDTH), 5, np.float32))
    assert cli.main(["cloud", "camera.json", "a.npy", "--bev", "b.png", "--heights", *heights]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "--heights" in line and not Path("b.png").exists()


def test_null_bytes_are_refused(frames, capsys):
    for words in (["-o", "a\0b.png"], ["-o", "b.png", "--mask", "a\0.png"]):
        assert cli.main(["warp", "camera.json", frames[0], *words]) == 2
        assert "null bytes" in capsys.readouterr().err


#: `python -m ipm_rs`, which heeds Ctrl-C also where the tests are a shell's background job, whose children ignore it.
HEEDING = """if True:
    import runpy, signal
    signal.signal(signal.SIGINT, signal.default_int_handler)
    runpy.run_module("ipm_rs", run_name="__main__", alter_sys=True)
"""


def start(frames: list[str], *more: str) -> subprocess.Popen[str]:
    """Start a batch of pictures that take a while to be written, and wait until it writes one."""
    arguments = ["warp", "camera.json", *frames, "-o", "out", *GRID, "0.01", "--quiet", *more]
    command = [sys.executable, "-c", HEEDING, *arguments]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while process.poll() is None and not list(Path().glob("out/.*.tmp")):
        time.sleep(0.001)
    return process


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
@pytest.mark.parametrize(("number", "status", "word"), [("SIGTERM", 143, "terminated"), ("SIGINT", 130, "interrupted")])
def test_a_signal_leaves_whole_pictures(frames, number, status, word):
    with start(frames) as process:
        process.send_signal(getattr(signal, number))
        message = process.communicate()[1]
    assert (process.returncode, message) == (status, f"ipm-rs: {word}\n")
    for name in names("out"):
        with Image.open(f"out/{name}") as image:
            image.load()
    assert not list(Path().glob("out/.*"))


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_what_a_killed_batch_leaves_is_tidied_up_by_the_next(frames):
    for wait in (0.0, 0.02, 0.05):
        with start(frames, "--force") as process:
            time.sleep(wait)
            process.kill()
        for path in Path().glob("out/*.png"):
            with Image.open(path) as image:
                image.load()
    assert cli.main(["warp", "camera.json", *frames, "-o", "out", *GRID, "0.5", "--quiet", "--force"]) == 0
    assert names("out") == [f"f{i}_bev.png" for i in range(6)]


def test_the_cloud_of_a_name_that_exists(frames, capsys):
    np.save("a.npy", np.full((HEIGHT, WIDTH), 5, np.float32))
    assert cli.main(["cloud", "camera.json", "a.npy", "-o", "a.ply", "--quiet"]) == 0
    assert cli.main(["cloud", "camera.json", "a.npy", "-o", "a.ply"]) == 2
    assert "--force" in capsys.readouterr().err
    assert len(pointfile.read("a.ply").points) == WIDTH * HEIGHT
