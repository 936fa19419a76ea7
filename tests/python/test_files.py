"""Files of users: written whole or not at all, never in place of a device, and without anything left behind."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors, pointfile
from ipm_rs.files import atomic, images

POSIX = pytest.mark.skipif(os.name != "posix", reason="needs POSIX")

CAMERA = ipm_rs.Camera.from_euler(
    [[300, 0, 99.5], [0, 300, 49.5], [0, 0, 1]], image_size=(200, 100), position=(0, 0, 1.4), pitch=0.1
)

WRITERS: dict[str, Callable[[Path], None]] = {
    "camera.json": lambda path: CAMERA.save(path),
    "cloud.ply": lambda path: pointfile.write(path, np.ones((5, 3)), force=True),
    "cloud.pcd": lambda path: pointfile.write(path, np.ones((5, 3)), force=True),
    "picture.png": lambda path: images.write(path, np.zeros((4, 5), np.uint8), images.Look("L")),
}


@POSIX
@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("kind", ["pipe", "socket", "directory", "link to a pipe"])
def test_what_is_no_file_is_not_replaced(tmp_path, monkeypatch, name, kind):
    monkeypatch.chdir(tmp_path)  # a socket's path may not be long
    path = Path(name)
    if kind == "socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(name)
            assert_kept(path, name, "socket")
        return
    if kind == "directory":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        os.mkfifo("pipe")
        path.symlink_to("pipe")
    assert_kept(path, name, kind.split()[-1])


def assert_kept(path: Path, name: str, word: str) -> None:
    before = path.lstat()
    with refuses(errors.FileError, name, word):
        WRITERS[name](path)
    assert (path.lstat().st_mode, path.lstat().st_ino) == (before.st_mode, before.st_ino)
    assert not list(Path().glob(".*.tmp"))


@POSIX
def test_points_are_written_through_a_link(tmp_path):
    real, link, broken = tmp_path / "real.ply", tmp_path / "link.ply", tmp_path / "broken.ply"
    real.write_bytes(b"old")
    link.symlink_to(real)
    broken.symlink_to(tmp_path / "new.ply")
    for path in (link, broken):
        pointfile.write(path, np.ones((2, 3)), force=True)
        assert path.is_symlink() and len(pointfile.read(path).points) == 2
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["broken.ply", "link.ply", "new.ply", "real.ply"]


@pytest.mark.parametrize("path", ["a\0b.json", "folder/that/is/not/there.json", "", "x" * 300 + ".json"])
def test_names_that_are_none(tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(errors.FileError):
        CAMERA.save(path)
    with pytest.raises(errors.IpmError):
        pointfile.write(path, np.ones((2, 3)))
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("path", [None, 3, b"a.ply", ["a.ply"]])
def test_what_is_no_path(path):
    for call in (
        lambda: pointfile.read(path),
        lambda: pointfile.write(path, np.ones((2, 3))),
        lambda: CAMERA.save(path),
    ):
        with refuses(errors.ArgumentTypeError, "path", "expected a"):
            call()


def test_bytes_are_on_the_disk_before_the_name(tmp_path, monkeypatch):
    done = []
    fsync, replace = os.fsync, Path.replace
    monkeypatch.setattr(os, "fsync", lambda descriptor: (done.append("fsync"), fsync(descriptor))[1])
    monkeypatch.setattr(Path, "replace", lambda old, new: (done.append("rename"), replace(old, new))[1])
    CAMERA.save(tmp_path / "camera.json")
    assert done[:2] == ["fsync", "rename"]
    assert ipm_rs.Camera.load(tmp_path / "camera.json") == CAMERA


def test_a_full_disk_is_told_of(tmp_path, monkeypatch):
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    (tmp_path / "camera.json").write_text("old")
    with refuses(errors.FileError, "camera.json", "No space left"):
        CAMERA.save(tmp_path / "camera.json")
    assert [entry.read_text() for entry in tmp_path.iterdir()] == ["old"]


@POSIX
def test_leftovers_of_the_dead_go_and_those_of_the_living_stay(tmp_path):
    code = (
        "import sys, time; from ipm_rs.files import atomic\n"
        "with atomic.atomically(sys.argv[1]) as file:\n"
        "    file.write(b'half'); file.flush(); print('there', flush=True); time.sleep(600)\n"
    )

    def writer(name: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-c", code, str(tmp_path / name)], stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None and process.stdout.readline() == "there\n"
        return process

    with contextlib.ExitStack() as stack:
        alive = stack.enter_context(writer("alive.bin"))
        stack.callback(alive.kill)
        with writer("dead.bin") as dead:
            dead.kill()
        (tmp_path / ".ipm-rs-mine.txt").write_text("not of ours")
        os.mkfifo(tmp_path / ".ipm-rs-pipe.tmp")
        assert len(list(tmp_path.glob(".ipm-rs-*.tmp"))) == 3
        CAMERA.save(tmp_path / "camera.json")
        assert len([path for path in tmp_path.glob(".ipm-rs-*.tmp") if path.is_file()]) == 1
    time.sleep(0.5)  # a while after the last look, which is not repeated for each file
    CAMERA.save(tmp_path / "camera.json")
    assert sorted(path.name for path in tmp_path.iterdir()) == [".ipm-rs-mine.txt", ".ipm-rs-pipe.tmp", "camera.json"]


def test_an_interrupt_right_after_a_file_was_made_leaves_none(tmp_path, monkeypatch):
    make = atomic._new_file

    def interrupted(path: Path):
        make(path).close()
        raise KeyboardInterrupt

    monkeypatch.setattr(atomic, "_new_file", interrupted)
    with pytest.raises(KeyboardInterrupt):
        CAMERA.save(tmp_path / "camera.json")
    assert list(tmp_path.iterdir()) == []


def test_whatever_a_decoder_raises_becomes_ours(tmp_path):
    import tokenize
    import zipfile
    import zlib

    path = tmp_path / "a.npy"
    decoders = (
        zlib.error,
        zipfile.BadZipFile,
        tokenize.TokenError,
        NotImplementedError,
        EOFError,
        OverflowError,
        KeyError,
    )
    for failure in (*(kind("x") for kind in decoders), EOFError(), OSError("x"), OSError(5, "x")):
        with refuses(errors.FileError, "a.npy"), atomic.reading(path, "an array"):
            raise failure
    for failure in (MemoryError(), KeyboardInterrupt(), errors.ImageError("x")):
        with pytest.raises(type(failure)), atomic.reading(path, "an array"):
            raise failure


def test_the_package_imports_what_is_used_and_no_more():
    """Readers, point files and the reference were half of the time that `import ipm_rs` takes."""
    code = (
        "import sys, ipm_rs\n"
        "names = ('ipm_rs.calibration.', 'ipm_rs.pointfile', 'ipm_rs.reference')\n"
        "late = [module for module in sys.modules if module.startswith(names)]\n"
        "assert late == ['ipm_rs.calibration._attached'], late\n"
        "assert {'calibration', 'pointfile', 'reference'} <= set(dir(ipm_rs))\n"
        "try: ipm_rs.nonsense\n"
        "except AttributeError as error: assert 'nonsense' in str(error)\n"
        "else: raise SystemExit('found')\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_point_files_without_an_import_of_their_own():
    done = subprocess.run(
        [sys.executable, "-c", "import ipm_rs; ipm_rs.pointfile.read; ipm_rs.reference; ipm_rs.calibration.load"],
        check=False,
    )
    assert done.returncode == 0
