"""`RigLut.save` and `RigLut.load`: a file with all that a table is built from."""

from __future__ import annotations

import json

import numpy as np
import pytest
from helpers import refuses, textured

import ipm_rs
from ipm_rs import errors

K = [[60.0, 0, 63.5], [0, 60.0, 47.5], [0, 0, 1]]
GRID = ipm_rs.BevGrid(x=(-5, 5), y=(-5, 5), resolution=0.2, sample_at="corner")


def camera(yaw) -> ipm_rs.Camera:
    return ipm_rs.Camera.from_euler(K, image_size=(128, 96), position=(0, 0, 1.4), pitch=0.6, yaw=yaw)


RIG = ipm_rs.Rig({"front": camera(0).masked(hide=[[0, 0], [40, 0], [0, 60]]), "left": camera(1.2), "back": camera(3.1)})
HILL = ipm_rs.HeightMap(np.add.outer(np.linspace(0, 0.3, 7), np.zeros(5)), origin=(-6, -6), spacing=(2, 3))
CASES = {
    "plain": {},
    "options": {"blend": "priority", "feather": 1.25, "exclude": [[-1, -1], [1, -1], [0.5, 1]], "ground": -0.1},
    "masks": {
        "masks": {"left": textured(96, 128) > 3, "back": None},
        "ground": ipm_rs.Plane.from_angles(slope=0.01, bank=0.02),
    },
    "bowl": {"ground": ipm_rs.Bowl((4, 3), 2.5, center=(0.5, 0)), "blend": "feather"},
    "hill": {"ground": HILL},
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_saved_is_what_is_loaded(case, tmp_path):
    lut = ipm_rs.RigLut(RIG, GRID, **CASES[case])
    lut.save(tmp_path / "ring.ipmlut")
    again = ipm_rs.RigLut.load(tmp_path / "ring.ipmlut")
    assert again == lut and again.ground == lut.ground and list(again.rig) == list(RIG) and again.rig == RIG
    images = [textured(96, 128, 3, seed=seed) for seed in range(3)]
    np.testing.assert_array_equal(again.warp(images), lut.warp(images))
    fewer = lut.without(["left"], missing="border")
    fewer.save(tmp_path / "fewer.ipmlut")
    assert ipm_rs.RigLut.load(tmp_path / "fewer.ipmlut") == fewer
    for one in (fewer.without(["back"], missing="border"), fewer.without(["back"], missing="next")):
        one.save(tmp_path / "one.ipmlut")
        again = ipm_rs.RigLut.load(tmp_path / "one.ipmlut")
        assert again == one
        np.testing.assert_array_equal(again.mask, one.mask)


def test_damaged_and_other_files_are_refused(tmp_path):
    path = tmp_path / "ring.ipmlut"
    ipm_rs.RigLut(RIG, GRID, **CASES["masks"]).save(path)
    data = path.read_bytes()
    rng = np.random.default_rng(0)
    for at in rng.integers(0, len(data), 60):
        path.write_bytes(data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :])
        with pytest.raises(errors.LutError):
            ipm_rs.RigLut.load(path)
    for cut in (0, 3, 40, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:cut])
        with pytest.raises(errors.LutError):
            ipm_rs.RigLut.load(path)
    path.write_text(json.dumps({"format": "ipm_rs rig"}))
    with refuses(errors.LutError, "ring.ipmlut"):
        ipm_rs.RigLut.load(path)
    ipm_rs.Lut(camera(0), GRID).save(path)
    with refuses(errors.LutError, "RigLut"):
        ipm_rs.RigLut.load(path)
    with pytest.raises(errors.MissingFileError):
        ipm_rs.RigLut.load(tmp_path / "none.ipmlut")
    with refuses(errors.ArgumentTypeError, "path"):
        ipm_rs.RigLut.load(3)
