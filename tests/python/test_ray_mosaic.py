"""`ipm_rs.ray.mosaic`: stretches that come back in any order make the map of one process."""

from __future__ import annotations

import contextlib
import pickle
import types

import numpy as np
import pytest
from PIL import Image
from test_mosaic import HEIGHT, WIDTH, assert_same, camera, standing_at

import ipm_rs
from ipm_rs.cli import main

pytest.importorskip("pyarrow")


@pytest.fixture
def here(monkeypatch):
    """Ray's place taken by this process: all goes through pickle, and the last stretch is ready first."""
    from ipm_rs.ray import _mosaic

    def remote(function):
        return types.SimpleNamespace(
            remote=lambda *arguments: pickle.loads(pickle.dumps(function(*pickle.loads(pickle.dumps(arguments)))))
        )

    module = types.SimpleNamespace(
        remote=remote,
        put=lambda value: value,
        get=lambda value: value,
        wait=lambda pending, num_returns: (pending[-1:], pending[:-1]),
        cluster_resources=lambda: {"CPU": 2.0},
    )
    monkeypatch.setattr(_mosaic, "connected", lambda address: contextlib.nullcontext(module))


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Files of noise and where they were taken."""
    folder = tmp_path_factory.mktemp("frames")
    frames = []
    for number in range(11):
        path = folder / f"{number}.png"
        Image.fromarray(np.random.default_rng(number).integers(0, 256, (HEIGHT, WIDTH), np.uint8)).save(path)
        frames.append((camera(), path, standing_at(1.5 * number, 0.2 * number)))
    return frames


def alone(drive):
    mosaic = ipm_rs.Mosaic(0.1, tile=64)
    for lens, path, pose in drive:
        with Image.open(path) as picture:
            mosaic.add(lens, np.asarray(picture), map_from_vehicle=pose, distance=(1, 9))
    return mosaic


def test_it_is_the_map_of_one_process(here, drive, tmp_path):
    expected = alone(drive)
    for stretch in (1, 3, 50):
        mosaic = ipm_rs.Mosaic(0.1, tile=64)
        assert ipm_rs.ray.mosaic(iter(drive), mosaic, distance=(1, 9), stretch=stretch) == len(drive)
        assert_same(expected, mosaic)
    with ipm_rs.Mosaic(0.1, tile=64, path=tmp_path, memory=1 << 22) as mosaic:
        assert ipm_rs.ray.mosaic(drive[:4], mosaic, distance=(1, 9), stretch=2) == 4
    with ipm_rs.Mosaic.load(tmp_path, memory=1 << 22) as mosaic:
        assert ipm_rs.ray.mosaic(drive, mosaic, distance=(1, 9), stretch=2) == len(drive) - 4
        assert_same(expected, mosaic)


def test_mistakes_come_back_as_they_are(here, drive, tmp_path):
    mosaic = ipm_rs.Mosaic(0.1, tile=64)
    missing = [*drive[:3], (camera(), tmp_path / "none.png", np.eye(4))]
    with pytest.raises(ipm_rs.FileError, match=r"none\.png"):
        ipm_rs.ray.mosaic(missing, mosaic, stretch=1)
    with pytest.raises(ipm_rs.CalibrationError, match="above"):
        ipm_rs.ray.mosaic(drive, mosaic, ground=3.0)
    for frames in (7, [7], [drive[0][:2]]):
        with pytest.raises(ipm_rs.ArgumentTypeError, match="camera, image"):
            ipm_rs.ray.mosaic(frames, mosaic)
    with pytest.raises(ipm_rs.ArgumentTypeError, match="Mosaic"):
        ipm_rs.ray.mosaic(drive, 0.05)
    with pytest.raises(ipm_rs.ArgumentError, match="stretch"):
        ipm_rs.ray.mosaic(drive, mosaic, stretch=0)


def test_frames_that_cannot_be_read_are_left_out_and_told_of(here, drive, tmp_path):
    torn = tmp_path / "torn.png"
    torn.write_bytes(drive[0][1].read_bytes()[:200])
    frames = [*drive[:3], (camera(), torn, standing_at(3.0)), *drive[3:]]
    told = []
    mosaic = ipm_rs.Mosaic(0.1, tile=64)
    added = ipm_rs.ray.mosaic(
        frames, mosaic, distance=(1, 9), stretch=2, strict=False, report=lambda *words: told.append(words)
    )
    assert added == len(drive)
    assert_same(alone(drive), mosaic)
    assert sum(done for done, _ in told) == len(drive)
    (error,) = [error for _, failed in told for error in failed]
    assert isinstance(error, ipm_rs.FileError)
    assert "torn.png" in str(error)
    with pytest.raises(ipm_rs.FileError, match="torn"):
        ipm_rs.ray.mosaic(frames, ipm_rs.Mosaic(0.1, tile=64), distance=(1, 9))
    with pytest.raises(ipm_rs.ArgumentTypeError, match="strict"):
        ipm_rs.ray.mosaic(frames, mosaic, strict="no")


def test_the_command_leaves_out_damaged_frames_here_and_on_a_cluster(here, drive, tmp_path, capsys):
    (tmp_path / "frames").mkdir()
    for number, (_, path, _) in enumerate(drive[:5]):
        data = path.read_bytes()
        (tmp_path / "frames" / f"{number:06d}.png").write_bytes(data[:200] if number == 3 else data)
    camera().save(tmp_path / "camera.json")
    poses = ["1 0 0 {} 0 1 0 {} 0 0 1 0".format(*pose[:2, 3]) for _, _, pose in drive[:5]]
    (tmp_path / "poses.txt").write_text("\n".join(poses))

    def run(name, *more):
        given = [
            tmp_path / "camera.json",
            tmp_path / "frames",
            "--poses",
            tmp_path / "poses.txt",
            "-o",
            tmp_path / name,
        ]
        words = ["--poses-of", "vehicle", "--resolution", "0.1", "--tile", "64", "--distance", "1", "9", *more]
        code = main(["mosaic", *map(str, given), *words])
        assert "000003.png" in capsys.readouterr().err
        if not (tmp_path / name).exists():  # no frame came into it
            return code, 0, None
        with ipm_rs.Mosaic.load(tmp_path / name) as mosaic:
            return code, mosaic.frames, mosaic.layers(names=("weighted", "count")) if mosaic.frames else None

    (code, frames, layers), (other_code, other_frames, other) = run("one"), run("other", "--ray", "auto")
    assert (code, frames) == (other_code, other_frames) == (2, 4)
    assert all((layers[name] == other[name]).all() for name in layers)
    assert run("strict", "--strict")[:2] == (2, 3)
    assert run("strict on a cluster", "--strict", "--ray", "auto")[:2] == (2, 0)
