"""A short run of the mutations of files; `python tests/python/file_mutations.py 100000` is a long one."""

from __future__ import annotations

import json

import numpy as np
import pytest
from file_mutations import mutate

import ipm_rs
from ipm_rs.errors import ArgumentError, FileError


def test_damaged_files_are_read_or_refused_in_words(tmp_path):
    assert list(mutate(120, 3, tmp_path)) == []


@pytest.mark.parametrize(
    "wrong",
    [
        {"tile": -64},
        {"tile": 1 << 30},
        {"tile": 65},
        {"channels": -1},
        {"channels": 1 << 40},
        {"resolution": -0.1},
        {"resolution": float("nan")},
        {"resolution": 1e-308},
        {"frames": -1},
        {"names_size": -5},
        {"tiles": {"0_0": [-1, 3]}},
    ],
)
def test_a_map_whose_header_claims_what_no_map_has_is_refused(tmp_path, wrong):
    with ipm_rs.Mosaic(0.25, tile=64, path=tmp_path) as mosaic:
        camera = ipm_rs.Camera.from_euler(
            [[32.0, 0, 31.5], [0, 32.0, 23.5], [0, 0, 1]], image_size=(64, 48), position=(0, 0, 1.5), pitch=0.4
        )
        mosaic.add(camera, np.zeros((48, 64), np.uint8), map_from_vehicle=np.eye(4))
    header = tmp_path / "mosaic.json"
    header.write_text(json.dumps({**json.loads(header.read_text()), **wrong}))
    with pytest.raises(FileError, match="mosaic"):
        ipm_rs.Mosaic.load(tmp_path)
    with pytest.raises(FileError, match="mosaic"):
        ipm_rs.Mosaic(0.25, tile=64, path=tmp_path)


def test_cells_that_are_nothing_are_refused():
    """Metres by such a cell were no number of cells, but an OverflowError in the middle of `image`."""
    with pytest.raises(ArgumentError, match="resolution"):
        ipm_rs.Mosaic(1e-308)


def test_numbers_that_float32_has_none_for_are_nowhere(tmp_path):
    maps = np.array([[0.0, 1.0], [2.0, 3.0]], np.float32)
    ipm_rs.Lut.from_maps(maps, maps, source_size=(4, 4)).export(tmp_path / "a.yml")
    text = (tmp_path / "a.yml").read_text()
    (tmp_path / "a.yml").write_text(text.replace("2, 3 ]", "2, 1e308 ]", 1))
    assert ipm_rs.Lut.load(tmp_path / "a.yml", source_size=(4, 4)).mask.sum() == 3


def test_a_quaternion_whose_norm_is_beyond_float64_is_refused(tmp_path):
    (tmp_path / "a.tum").write_text("0 0 0 0 0 0 0 1\n1 0 0 0 1e308 1e308 0 1\n")
    with pytest.raises(FileError, match="norm inf in pose 2"):
        ipm_rs.Trajectory.load(tmp_path / "a.tum")
