"""What docs/limits.md says is refused is refused, and tables hold what it says."""

from __future__ import annotations

import itertools
import re
import time
import zipfile
from collections.abc import Callable
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
    "1e12 m": (
        lambda: ipm_rs.Camera.from_euler(K, image_size=(64, 64), position=(7e11, -7e11, 1e11)),
        lambda: ipm_rs.Camera.from_euler(K, image_size=(64, 64), position=(0.0, 1.1e12, 0.0)),
    ),
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
    assert lut.nbytes - before == (4 * cells if ipm_rs.cpu_info()["isa"] == "avx2" else 0)
    before = lut.nbytes
    lut.warp(image, interpolation="area")
    assert 0.5 * cells < lut.nbytes - before < 1.5 * cells


# the slowest of 12700 lenses of chance: to make, on the way back to the road, and a cell of a table
FOLDED = [-9.9e-6, -0.024, -0.031, -0.015, 0.0, -0.046, -0.1, -0.041, -0.078, -0.089, 0.054, 0.0057, 0.017, 0.0]
PRISM = [-0.0008, -27.5, -0.0005, 0.00036, -0.00078, -0.0005, 4.5e-5, -0.0007, 0.0005, 0.0007, 0.0005, 0.0]
STEEP = [0.0, 0.02026665576935671, -0.004695225366383449, 0.0, -0.9296875, -0.5801856707490187, -0.4795894789572386]
STEEP += [-9.0, 44.0, 0.7265625, 0.007626838857394347, 4022575572.809377]
SLOW_LENSES = {
    "fold": lambda: ipm_rs.BrownConrady(FOLDED),
    "pole": lambda: ipm_rs.BrownConrady([0.0, 0.602, 0.849, 0.153, 0.547, 0.832, -47.0, 0.133]),
    "prism": lambda: ipm_rs.ThinPrismFisheye(PRISM),
    "steep": lambda: ipm_rs.FTheta(STEEP, form="backward", linear=(1.075, 0.046, 0.059)),
    "inverse": lambda: ipm_rs.InverseBrownConrady([-0.6078465344570387, 9.9e18, -0.445, 0.8268, -0.6796875]),
}


@pytest.mark.filterwarnings("ignore::ipm_rs.errors.CalibrationWarning")
@pytest.mark.parametrize("name", SLOW_LENSES)
def test_a_lens_of_hostile_coefficients_costs_what_is_stated(name: str) -> None:
    stated = re.findall(r"(\d+) (?:ms to make|us for a pixel's|us a cell)", PAGE)
    make, to_road, cell = map(float, stated)
    focal = 1.0 if name == "steep" else 30.0
    matrix = [[focal, 0.0, 32.0], [0.0, focal, 32.0], [0.0, 0.0, 1.0]]
    small = ipm_rs.BevGrid(x=(-3.0, 9.0), y=(-4.0, 4.0), resolution=0.25)
    pixels = np.random.default_rng(3).uniform(-0.5, 63.5, (500, 2))

    def cost(work: Callable[[], object]) -> float:
        """Microseconds of the processor, the least of three: other programs run too."""
        took = []
        for _ in range(3):
            began = time.process_time()
            work()
            took.append(time.process_time() - began)
        return 1e6 * min(took)

    lens = SLOW_LENSES[name]()
    camera = ipm_rs.Camera.from_euler(matrix, image_size=(64, 64), position=(0, 0, 1.5), pitch=0.8, lens=lens)
    # no measure of speed: a search without an end, or with a thousand times as many steps, is what this finds
    assert cost(SLOW_LENSES[name]) < 100 * 1e3 * make
    assert cost(lambda: camera.ground_from_pixels(pixels)) < 100 * to_road * len(pixels)
    assert cost(lambda: ipm_rs.Lut(camera, small)) < 100 * cell * small.shape[0] * small.shape[1]


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
