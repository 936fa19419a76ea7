"""Mosaics on disk: bounded memory, kills at any moment, damage, and two processes."""

from __future__ import annotations

import itertools
import json
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from mosaic_drive import LENGTH, add, camera, frame, on_disk
from test_mosaic import assert_same, everything

import ipm_rs
from ipm_rs.errors import FileError


@pytest.fixture(scope="module")
def whole():
    mosaic = ipm_rs.Mosaic(0.1, tile=64)
    add(mosaic, range(LENGTH))
    return mosaic


def files(path):
    return {
        entry.relative_to(path).as_posix(): entry.read_bytes() for entry in Path(path).rglob("*") if entry.is_file()
    }


def test_tiles_on_disk_are_those_in_memory(tmp_path, whole):
    with on_disk(tmp_path / "map") as mosaic:
        add(mosaic, range(LENGTH))
        assert len(mosaic.tiles) > 12
        assert mosaic.nbytes <= 8 * (whole.nbytes // len(whole.tiles)), "memory is bounded"
        assert_same(whole, mosaic)
    with pytest.raises(ipm_rs.MosaicError, match="closed"):
        mosaic.image()
    with ipm_rs.Mosaic.load(tmp_path / "map") as again:
        assert (again.resolution, again.tile, again.frames) == (0.1, 64, LENGTH)
        assert "frame 7" in again and "frame 99" not in again
        assert_same(whole, again)
    whole.save(tmp_path / "saved")
    with ipm_rs.Mosaic.load(tmp_path / "saved") as again:
        assert_same(whole, again)
        assert "frame 7" in again
    assert_same(whole, pickle.loads(pickle.dumps(whole)))


def test_frames_of_one_name_are_added_once(tmp_path, whole):
    for part in (range(10), range(5, LENGTH), range(LENGTH)):
        with on_disk(tmp_path) as mosaic:
            add(mosaic, part)
    with on_disk(tmp_path) as mosaic:
        assert mosaic.frames == LENGTH
        assert_same(whole, mosaic)
        image, pose = frame(3)
        assert mosaic.add(camera(), image, map_from_vehicle=pose, name="frame 3") == 0


def test_merges_on_disk(tmp_path, whole):
    with on_disk(tmp_path / "one") as one, on_disk(tmp_path / "other") as other:
        add(one, range(0, LENGTH, 2))
        add(other, range(1, LENGTH, 2))
        one.merge(other)
        assert_same(whole, one)
        with pytest.raises(ipm_rs.MosaicError, match="12 of both, such as 'frame 1'"):
            one.merge(other)
    with ipm_rs.Mosaic.load(tmp_path / "one") as one:
        assert one.frames == LENGTH
        assert_same(whole, one)


@pytest.mark.parametrize("damaged", ["one", "other"])
def test_a_merge_of_a_damaged_map_changes_nothing(tmp_path, damaged):
    for name, numbers in (("one", range(0, LENGTH, 2)), ("other", range(1, LENGTH, 2))):
        with on_disk(tmp_path / name) as mosaic:
            add(mosaic, numbers)
    with on_disk(tmp_path / "one") as one, on_disk(tmp_path / "other") as other:
        assert len(other.tiles) > 8, "more than are kept in memory"
        before = everything(one)
        i, j = sorted({*one.tiles} & {*other.tiles})[-1]
        (path,) = (tmp_path / damaged / "tiles").glob(f"{i}_{j}.*.npz")
        text = path.read_bytes()
        path.write_bytes(text[:-100])
        with pytest.raises(FileError, match="tile"):
            one.merge(other)
        path.write_bytes(text)
        assert one.frames == LENGTH // 2
        for name, layer in everything(one).items():
            np.testing.assert_array_equal(layer, before[name])
        one.merge(other)
        assert one.frames == LENGTH


def test_what_was_not_committed_is_as_if_it_had_not_been(tmp_path, whole):
    mosaic = on_disk(tmp_path)
    add(mosaic, range(8))
    mosaic.commit()
    committed = files(tmp_path)
    add(mosaic, range(8, LENGTH))
    assert len(files(tmp_path)) > len(committed), "tiles that memory had no room for"
    mosaic._tiles.store.close()  # as the end of the process does
    with on_disk(tmp_path) as again:
        assert again.frames == 8
        now = files(tmp_path)
        assert now == committed
        add(again, range(LENGTH))
        assert_same(whole, again)


def interrupted(function, at):
    """The function, interrupted when it is called for the `at`-th time."""
    calls = itertools.count()

    def wrapped(*arguments):
        if next(calls) == at:
            raise KeyboardInterrupt
        return function(*arguments)

    return wrapped


def test_a_frame_interrupted_while_it_is_looked_at_leaves_the_map_whole(tmp_path, monkeypatch, whole):
    from ipm_rs.mosaic import _adding

    with on_disk(tmp_path) as mosaic:
        with monkeypatch.context() as patch:
            patch.setattr(_adding, "_mosaic_shown", interrupted(_adding._mosaic_shown, 20))
            with pytest.raises(KeyboardInterrupt):
                add(mosaic, range(LENGTH))
        assert 0 < mosaic.frames < LENGTH
        add(mosaic, range(LENGTH))
        assert_same(whole, mosaic)


def test_an_interrupted_frame_is_not_committed(tmp_path, monkeypatch, whole):
    from ipm_rs.mosaic import _tiles

    monkeypatch.setattr(_tiles.Tile, "add", interrupted(_tiles.Tile.add, 20))
    with pytest.raises(KeyboardInterrupt), on_disk(tmp_path) as mosaic:
        add(mosaic, range(3))
        mosaic.commit()
        add(mosaic, range(3, LENGTH))
    with on_disk(tmp_path) as again:
        assert again.frames == 3
        add(again, range(LENGTH))
        assert_same(whole, again)


SCRIPT = """
    import sys
    sys.path.insert(0, {folder!r})
    from mosaic_drive import LENGTH, add, on_disk
    mosaic = on_disk({path!r})
    print("open", flush=True)
    for number in range(LENGTH):
        add(mosaic, [number])
        if number % 3 == 2:
            mosaic.commit()
        print(number, flush=True)
    mosaic.close()
"""


@pytest.mark.skipif(os.name == "nt", reason="needs SIGKILL")
def test_a_run_that_is_killed_goes_on(tmp_path, whole):
    script = textwrap.dedent(SCRIPT).format(folder=str(Path(__file__).parent), path=str(tmp_path))
    rng = np.random.default_rng(0)
    for kill in range(4):
        process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        for _ in range(3 + 4 * kill):
            assert process.stdout.readline()
        if kill == 0:
            with pytest.raises(FileError, match="in use"):
                on_disk(tmp_path)
        time.sleep(rng.uniform(0, 0.02))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
    with on_disk(tmp_path) as mosaic:
        assert 0 < mosaic.frames <= LENGTH
        add(mosaic, range(LENGTH))
        assert mosaic.frames == LENGTH
        assert_same(whole, mosaic)


def test_two_at_once_and_other_maps_are_refused(tmp_path):
    with on_disk(tmp_path / "map") as mosaic:
        add(mosaic, range(2))
        with pytest.raises(FileError, match="in use"):
            ipm_rs.Mosaic.load(tmp_path / "map")
    before = files(tmp_path)
    for wrong in ({"resolution": 0.2}, {"tile": 128}, {"channels": 3}, {"dtype": np.uint16}):
        with pytest.raises(ipm_rs.MosaicError, match="got a mosaic of"):
            ipm_rs.Mosaic(**{"resolution": 0.1, "tile": 64, "path": tmp_path / "map", **wrong})
    with pytest.raises(ipm_rs.MissingFileError):
        ipm_rs.Mosaic.load(tmp_path / "nothing")
    with pytest.raises(FileError, match="other files"):
        ipm_rs.Mosaic(0.1, path=tmp_path)
    with pytest.raises(FileError):
        ipm_rs.Mosaic(0.1, path=tmp_path / "map" / "mosaic.json")
    with pytest.raises(FileError, match="empty directory"):
        ipm_rs.Mosaic(0.1, tile=64).save(tmp_path / "map")
    assert files(tmp_path) == before


def test_damage_is_told(tmp_path):
    with on_disk(tmp_path) as mosaic:
        add(mosaic, range(6))
    tiles = sorted((tmp_path / "tiles").iterdir())
    data = tiles[0].read_bytes()
    for damaged in (data[: len(data) // 2], data[:200] + bytes([data[200] ^ 1]) + data[201:], b""):
        tiles[0].write_bytes(damaged)
        with ipm_rs.Mosaic.load(tmp_path) as mosaic, pytest.raises(FileError, match="npz"):
            mosaic.image()
    tiles[0].unlink()
    with ipm_rs.Mosaic.load(tmp_path) as mosaic, pytest.raises(ipm_rs.MissingFileError, match="npz"):
        mosaic.image()
    tiles[0].write_bytes(data)
    header = tmp_path / "mosaic.json"
    good = json.loads(header.read_bytes())
    for wrong in ({"format": "x"}, {"version": 9}, {"dtype": "float32"}, {"tiles": {"a": 1}}, {"names_size": 10**6}):
        header.write_text(json.dumps({**good, **wrong}))
        with pytest.raises(FileError):
            ipm_rs.Mosaic.load(tmp_path)
    header.write_bytes(b"{")
    with pytest.raises(FileError):
        ipm_rs.Mosaic.load(tmp_path)
    header.write_text(json.dumps(good))
    with ipm_rs.Mosaic.load(tmp_path) as mosaic:
        assert mosaic.image().any()


def test_a_commit_that_fails_while_frames_are_added_can_be_made_again(tmp_path, monkeypatch, whole):
    from ipm_rs.mosaic import _mosaic, _store

    def full(file, **layers):
        raise OSError(28, "No space left on device")

    mosaic = on_disk(tmp_path)
    monkeypatch.setattr(_mosaic, "_COMMIT", 4)
    with monkeypatch.context() as patch:
        patch.setattr(_store.np, "savez", full)
        add(mosaic, range(3))
        with pytest.raises(FileError, match=r"No space left.*is in the map.*commit\(\) again"):
            add(mosaic, [3])
    assert mosaic.frames == 4 and "frame 3" in mosaic
    mosaic.commit()
    add(mosaic, range(3, LENGTH))
    mosaic.close()
    with on_disk(tmp_path) as again:
        assert_same(whole, again)


def test_a_full_disk_leaves_the_last_commit(tmp_path, monkeypatch, whole):
    from ipm_rs.mosaic import _store

    mosaic = on_disk(tmp_path)
    add(mosaic, range(4))
    mosaic.commit()
    good = everything(mosaic)

    def full(file, **layers):
        file.write(b"some")
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(_store.np, "savez", full)
        with pytest.raises(FileError, match="No space left"):
            add(mosaic, range(4, LENGTH))
            mosaic.commit()
        with pytest.raises((FileError, ipm_rs.MosaicError)):
            add(mosaic, range(4, LENGTH))
            mosaic.commit()
    mosaic._tiles.store.close()
    with on_disk(tmp_path) as again:
        assert again.frames == 4
        for name, layer in everything(again).items():
            np.testing.assert_array_equal(layer, good[name])
        add(again, range(LENGTH))
        assert_same(whole, again)
