"""What docs/limits.md says is refused is refused, and tables hold what it says."""

from __future__ import annotations

import itertools
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

import ipm_rs
from ipm_rs import errors

K = [[1000.0, 0.0, 959.5], [0.0, 1000.0, 539.5], [0.0, 0.0, 1.0]]
PAGE = (Path(__file__).resolve().parents[2] / "docs" / "limits.md").read_text(encoding="utf-8")


def camera(image_size: tuple[int, int] = (1920, 1080)) -> ipm_rs.Camera:
    """A camera 1.5 m above the road."""
    return ipm_rs.Camera.from_euler(K, image_size=image_size, position=(0.0, 0.0, 1.5), pitch=0.1)


def grid(resolution: float = 0.1) -> ipm_rs.BevGrid:
    """A small one ahead."""
    return ipm_rs.BevGrid(x=(5.0, 25.0), y=(-10.0, 10.0), resolution=resolution)


# what is stated, the largest that is accepted or None where it would take too long, and what is too large
REFUSED = {
    "268435456 (2^28; 16384": (
        lambda: ipm_rs.BevGrid(x=(0.0, 16384.0), y=(0.0, 16384.0), resolution=1.0),
        lambda: ipm_rs.BevGrid(x=(0.0, 16384.0), y=(0.0, 16385.0), resolution=1.0),
    ),
    "65533 x 65533": (
        lambda: ipm_rs.Camera(K, image_size=(65533, 65533)),
        lambda: ipm_rs.Camera(K, image_size=(65534, 65534)),
    ),
    "1048575 pixels": (None, lambda: ipm_rs.Lut(camera((1048576, 1080)), grid()).sampling_density()),
    "64 |": (
        lambda: ipm_rs.RigLut(
            {f"c{index}": camera() for index in range(64)}, ipm_rs.BevGrid(x=(5, 6), y=(0, 1), resolution=0.5)
        ),
        lambda: ipm_rs.RigLut(
            {f"c{index}": camera() for index in range(65)}, ipm_rs.BevGrid(x=(5, 6), y=(0, 1), resolution=0.5)
        ),
    ),
    "2147483647": (None, lambda: ipm_rs.rasterize(np.broadcast_to(np.float32(1.0), (1 << 31, 3)), grid())),
    "1024": (None, lambda: ipm_rs.set_num_threads(1025)),
    "1000": (
        lambda: camera((64, 64)).masked(hide=[[(0, 0), (1, 0), (1, 1)]] * 1000),
        lambda: camera((64, 64)).masked(hide=[[(0, 0), (1, 0), (1, 1)]] * 1001),
    ),
}


@pytest.mark.filterwarnings("ignore::ipm_rs.errors.CalibrationWarning")
@pytest.mark.parametrize("stated", REFUSED)
def test_what_is_too_large_is_refused_by_the_stated_error(stated: str) -> None:
    accepted, refused = REFUSED[stated]
    row = next(line for line in PAGE.splitlines() if stated in line and line.startswith("|"))
    expected = getattr(errors, re.findall(r"`(\w+Error)`", row)[-1])
    if accepted:
        accepted()
    with pytest.raises(expected):
        refused()


def test_a_calibration_file_of_more_than_32_mib_is_not_read(tmp_path) -> None:
    assert "| a calibration file | 32 MiB | `CalibrationError` |" in PAGE
    path = tmp_path / "huge.yaml"
    with path.open("wb") as file:
        file.truncate((32 << 20) + 1)
    with pytest.raises(errors.CalibrationError, match="at most 32 MB"):
        ipm_rs.Camera.load(path)


def test_tables_hold_the_stated_bytes_a_cell() -> None:
    lut = ipm_rs.Lut(camera(), ipm_rs.BevGrid(x=(8.0, 40.0), y=(-4.0, 4.0), resolution=0.025))
    image = np.zeros((1080, 1920, 3), np.uint8)
    cells = lut.mask.sum()
    assert cells == lut.mask.size, "all of it is seen"
    assert 8 * cells <= lut.nbytes < 8.05 * cells
    before = lut.nbytes
    lut.warp(image, interpolation="nearest")
    assert lut.nbytes - before == 4 * cells
    before = lut.nbytes
    lut.warp(image, interpolation="area")
    assert 0.5 * cells < lut.nbytes - before < 1.5 * cells


@pytest.mark.parametrize("name", ["values.json", "aliases.yaml", "entities.xml", "zeros.npz"])
def test_files_that_multiply_are_refused(tmp_path, name: str) -> None:
    path = tmp_path / name
    letters = "abcdefghijkl"
    if name == "values.json":
        path.write_text('{"a":[' + "1," * 600_000 + "1]}")
    elif name == "aliases.yaml":
        lines = [f"{one}: &{one} [{','.join(['*' + before] * 9)}]" for before, one in itertools.pairwise(letters)]
        path.write_text("a: &a [1,1,1]\n" + "\n".join(lines))
    elif name == "entities.xml":
        entities = [f'<!ENTITY {one} "{("&" + before + ";") * 10}">' for before, one in itertools.pairwise(letters)]
        path.write_text(f'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "aaaa">{"".join(entities)}]><l>&l;</l>')
    else:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("K.npy", bytes(32 << 20))
    with pytest.raises(errors.CalibrationError):
        ipm_rs.Camera.load(path)
