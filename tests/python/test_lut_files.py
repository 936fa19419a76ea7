"""Tables as files: our own comes back equal and every spoiled byte is refused; other programs read the exports."""

from __future__ import annotations

import io
import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers import refuses, textured

import ipm_rs
from ipm_rs import errors
from ipm_rs._core import _checksum
from ipm_rs.cli import main
from ipm_rs.files.luts import container

K = [[55.0, 0, 31.2], [0, 55, 23.6], [0, 0, 1]]
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(64, 48), position=(1.0, 0.2, 1.5), pitch=0.3, yaw=0.1)
GRID = ipm_rs.BevGrid(x=(2, 14), y=(-5, 5), resolution=(0.25, 0.5))
ROADS = {
    "flat": -0.2,
    "plane": ipm_rs.Plane.from_angles(slope=0.02, bank=-0.01, height=0.1),
    "map": ipm_rs.HeightMap([[0.0, 0.1, np.nan], [0.2, -0.1, 0.0]], origin=(0, -6), spacing=(15, 6)),
}
IMAGE = textured(48, 64, 3)


def of_maps(map_x, map_y, size) -> ipm_rs.Lut:
    return ipm_rs.Lut.from_maps(np.array(map_x), np.array(map_y), source_size=size)


@pytest.fixture
def lut() -> ipm_rs.Lut:
    return ipm_rs.Lut(CAMERA, GRID)


@pytest.mark.parametrize("road", ROADS.values(), ids=ROADS)
def test_a_table_comes_back_with_all_that_it_was_built_from(road, tmp_path):
    lut = ipm_rs.Lut(CAMERA, GRID, ground=road)
    path = tmp_path / "front.ipmlut"
    lut.save(path)
    again = ipm_rs.Lut.load(path, expect=(CAMERA, GRID))
    assert again == lut and (again.camera, again.grid, again.ground) == (CAMERA, GRID, road)
    assert np.array_equal(again.warp(IMAGE, interpolation="area"), lut.warp(IMAGE, interpolation="area"))
    lut.save(path)  # an existing one is replaced
    assert [entry.name for entry in tmp_path.iterdir()] == ["front.ipmlut"]


def test_a_table_of_maps_has_no_calibration_and_none_is_expected(tmp_path):
    lut = of_maps([[0.5, 70.0]], [[0.25, 3.0]], (4, 3))
    lut.save(tmp_path / "a.ipmlut")
    again = ipm_rs.Lut.load(tmp_path / "a.ipmlut", source_size=(4, 3))
    assert again == lut and again.camera is None and again.grid is None and again.ground is None
    with refuses(errors.LutError, "of no Camera"):
        ipm_rs.Lut.load(tmp_path / "a.ipmlut", expect=CAMERA)
    with refuses(errors.ArgumentError, "source_size", "(4, 3)"):
        ipm_rs.Lut.load(tmp_path / "a.ipmlut", source_size=(4, 4))


def test_another_calibration_is_refused_and_what_differs_is_named(lut, tmp_path):
    path = tmp_path / "front.ipmlut"
    lut.save(path)
    with refuses(errors.LutError, "another camera_from_vehicle;", "front.ipmlut"):
        ipm_rs.Lut.load(path, expect=CAMERA.with_pose(np.eye(4)))
    with refuses(errors.LutError, "another image_size, intrinsics"):
        ipm_rs.Lut.load(path, expect=CAMERA.resized(128, 96))
    with refuses(errors.LutError, "another resolution"):
        ipm_rs.Lut.load(path, expect=(CAMERA, ipm_rs.BevGrid(x=(2, 14), y=(-5, 5), resolution=0.5)))
    with refuses(errors.ArgumentTypeError, "expect", "float"):
        ipm_rs.Lut.load(path, expect=1.5)


def test_every_flipped_bit_and_every_cut_is_refused(tmp_path):
    lut = ipm_rs.Lut(CAMERA, ipm_rs.BevGrid(x=(5, 7), y=(-2, -1), resolution=1), ground=ROADS["map"])
    path = tmp_path / "small.ipmlut"
    lut.save(path)
    data = path.read_bytes()
    from ipm_rs.files.luts import native

    assert native.load(path, io.BytesIO(data), None, None) == lut
    for bit in range(len(container.MAGIC) * 8, len(data) * 8):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << bit % 8
        with pytest.raises(errors.LutError):
            native.load(path, io.BytesIO(damaged), None, None)
    for length in range(len(container.MAGIC), len(data)):
        with pytest.raises(errors.LutError, match="cut short"):
            native.load(path, io.BytesIO(data[:length]), None, None)
    path.write_bytes(data + b"\0")
    with refuses(errors.LutError, "damaged"):
        ipm_rs.Lut.load(path)


class Spoiled(io.BytesIO):
    """A file that does not give what it promised: from a place on it ends, or raises."""

    def __init__(self, data: bytes, end: int, error: BaseException | None = None) -> None:
        super().__init__(data)
        self.end, self.error = end, error

    def read(self, count=-1, /):
        if self.error is not None and self.tell() + count > self.end:
            raise self.error
        return super().read(min(count, self.end - self.tell()))


def test_files_that_end_or_fail_while_they_are_read(lut):
    data = lut.__reduce__()[1][0]
    assert ipm_rs.Lut._read_from(io.BytesIO(data + b"next"), len(data)) == lut
    for end in (0, 3, 20, 60, len(data) // 2, len(data) - 1):
        with refuses(errors.LutError, "cut short"):
            ipm_rs.Lut._read_from(Spoiled(data, end), len(data))
        with pytest.raises(OSError, match="device is gone"):
            ipm_rs.Lut._read_from(Spoiled(data, end, OSError("device is gone")), len(data))
    with pytest.raises(KeyboardInterrupt):
        ipm_rs.Lut._read_from(Spoiled(data, 0, KeyboardInterrupt()), len(data))
    for length in (0, len(data) - 1, len(data) + 1, 1 << 60):
        with refuses(errors.LutError, "damaged"):
            ipm_rs.Lut._read_from(io.BytesIO(data), length)
    with pytest.raises(AttributeError, match="read"):
        ipm_rs.Lut._read_from(3, len(data))


def forged(path: Path, **changes: object) -> None:
    """Write the file again with another header and right checksums."""
    content = container.read(path, io.BytesIO(path.read_bytes()), "Lut")
    header = {**content.header, **changes}
    blocks = {name: content.block(name) for name in content.blocks}
    kind = header.pop("kind")
    del header["blocks"], header["written_by"]
    container.write(path, kind, header, blocks)


def test_forged_headers_are_refused_in_words(lut, tmp_path):
    path = tmp_path / "a.ipmlut"
    for changes, phrase in (
        ({"grid": {"x": [2, 14], "y": [-5, 5], "resolution": 1.0, "sample_at": "center"}}, "not the table of"),
        ({"camera": None, "grid": 3}, "header"),
        ({"camera": {"format": "ipm_rs.Camera"}}, "intrinsics"),
        ({"ground": {"plane": [0, 0]}}, "header"),
        ({"ground": {"shape": [9, 9], "origin": [0, 0], "spacing": [1, 1]}}, "heights"),
        ({"ground": "level"}, "ground"),
        ({"kind": "RigLut"}, "RigLut"),
    ):
        lut.save(path)
        forged(path, **changes)
        with refuses(errors.LutError, phrase, "a.ipmlut"):
            ipm_rs.Lut.load(path)


def test_newer_files_are_read_if_they_say_so_and_named_if_not(lut, tmp_path):
    path = tmp_path / "a.ipmlut"
    lut.save(path)
    forged(path, colour="unknown to this version")
    data = bytearray(path.read_bytes())
    data[16:18] = (7).to_bytes(2, "little")
    header = int.from_bytes(data[20:24], "little")
    data[8:16] = _checksum(bytes(data[16 : 32 + header])).to_bytes(8, "little")
    path.write_bytes(data)
    assert ipm_rs.Lut.load(path) == lut
    data[18:20] = (2).to_bytes(2, "little")
    path.write_bytes(data)
    with refuses(errors.LutError, "version 7", "newer ipm_rs"):
        ipm_rs.Lut.load(path)


def test_files_that_are_no_tables(lut, tmp_path):
    for name, content, phrase in (
        ("empty.ipmlut", b"", "empty file"),
        ("picture.png", b"\x89PNG\r\n\x1a\n" + bytes(50), "something else"),
        ("text.yml", b"%YAML:1.0\n---\nmap_x: 3\n", "map_x and map_y"),
        ("short.yml", b"%YAML:1.0\n---\nmap_x: !!opencv-matrix\n rows: 2\n cols: 2\n dt: f\n data: [1, 2]\n", "got 2"),
        ("damaged.npz", b"PK\x03\x04" + bytes(30), "npz"),
    ):
        (tmp_path / name).write_bytes(content)
        with refuses((errors.LutError, errors.FileError), name, phrase):
            ipm_rs.Lut.load(tmp_path / name)
    with refuses(errors.MissingFileError, "found none"):
        ipm_rs.Lut.load(tmp_path / "none.ipmlut")
    with refuses(errors.FileError, "directory"):
        ipm_rs.Lut.load(tmp_path)
    with refuses(errors.FileError, "directory"):
        lut.save(tmp_path)
    with refuses(errors.ArgumentTypeError, "path"):
        lut.save(3)


def test_blocks_are_aligned_and_nothing_else_is_in_the_file(lut, tmp_path):
    path = tmp_path / "a.ipmlut"
    container.write(path, "Other", {"note": "x"}, {"one": b"12345", "none": b"", "two": bytes(range(200))})
    content = container.read(path, io.BytesIO(path.read_bytes()), "Other", own_checksums=("two",))
    assert [content.block(name) for name in content.blocks] == [b"12345", b"", bytes(range(200))]
    assert all(block["start"] % 64 == 0 for block in content.header["blocks"]) and content.header["note"] == "x"
    file, length = content.open("two")
    assert (file.read(3), length) == (bytes(range(3)), 200)
    file, length = content.open("one")
    assert (file.read(), length) == (b"12345", 5)
    with refuses(errors.LutError, "block 'three'"):
        content.block("three")


def exported(lut: ipm_rs.Lut, path: Path, format: str, *names: str) -> list[np.ndarray]:
    lut.export(path, format=format)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    return [storage.getNode(name).mat() for name in names]


def one_grey_level(a: np.ndarray, b: np.ndarray) -> bool:
    return np.abs(a.astype(int) - b).max() <= 1


@pytest.mark.parametrize("interpolation", ["bilinear", "nearest"])
def test_opencv_warps_with_the_exported_maps_as_we_do(lut, interpolation, tmp_path):
    flag = {"bilinear": cv2.INTER_LINEAR, "nearest": cv2.INTER_NEAREST}[interpolation]
    maps = exported(lut, tmp_path / "maps.yml", "opencv", "map_x", "map_y")
    assert all(np.array_equal(a, b) for a, b in zip(maps, lut.maps(outside=-9), strict=True))  # to the bit
    there = cv2.remap(IMAGE, *maps, flag, borderMode=cv2.BORDER_CONSTANT, borderValue=(7, 7, 7))
    assert one_grey_level(there, lut.warp(IMAGE, interpolation=interpolation, border_value=7))


def test_lanenet_reads_its_maps(lut, tmp_path):
    lut.export(tmp_path / "remap.yml", format="lanenet")
    # LaneNet's own three lines
    fs = cv2.FileStorage(str(tmp_path / "remap.yml"), cv2.FILE_STORAGE_READ)
    remap_to_ipm_x = fs.getNode("remap_ipm_x").mat()
    remap_to_ipm_y = fs.getNode("remap_ipm_y").mat()
    assert one_grey_level(
        cv2.remap(IMAGE, remap_to_ipm_x, remap_to_ipm_y, cv2.INTER_NEAREST), lut.warp(IMAGE, interpolation="nearest")
    )


def test_fixed_point_maps_are_those_of_opencv(lut, tmp_path):
    maps = exported(lut, tmp_path / "maps.yml", "cv16sc2", "map1", "map2")
    for ours, theirs in zip(maps, cv2.convertMaps(*lut.maps(outside=-9), cv2.CV_16SC2), strict=True):
        assert ours.dtype == theirs.dtype and np.array_equal(ours, theirs)
    with refuses(errors.LutError, "32000"):
        of_maps([[0.0]], [[0.0]], (40_000, 3)).export(tmp_path / "m.yml", format="cv16sc2")


def test_the_torch_grid_is_in_units_of_the_image(lut, tmp_path):
    lut.export(tmp_path / "grid.npy")
    grid = np.load(tmp_path / "grid.npy")
    assert grid.shape == (1, *lut.shape, 2) and grid.dtype == np.float32
    # grid_sample's own formula for align_corners=True
    pixels = (grid[0] + 1) / 2 * (np.array(lut.source_size) - 1)
    assert np.abs(pixels - np.stack(lut.maps(outside=-9), -1)).max() < 1e-4


@pytest.mark.parametrize(("name", "format"), [("a.yml", "opencv"), ("a.yaml", "lanenet"), ("a.npz", None)])
def test_maps_come_back(lut, name, format, tmp_path):
    lut.export(tmp_path / name, format=format)
    again = ipm_rs.Lut.load(tmp_path / name)
    assert again.source_size == lut.source_size
    for there, here in zip(again.maps(), lut.maps(), strict=True):
        assert np.allclose(there, here, rtol=0, atol=2**-14, equal_nan=True)
    assert np.array_equal(again.mask, lut.mask)
    with refuses(errors.LutError, "expect"):
        ipm_rs.Lut.load(tmp_path / name, expect=CAMERA)


@pytest.mark.parametrize("name", ["a.yml", "a.xml", "a.json"])
def test_maps_that_opencv_wrote_are_read(lut, name, tmp_path):
    storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_WRITE)
    for key, values in zip(("map1", "map2"), lut.maps(outside=np.nan), strict=True):
        storage.write(key, values)
    storage.release()
    with refuses(errors.ArgumentError, "source_size="):
        ipm_rs.Lut.load(tmp_path / name)
    again = ipm_rs.Lut.load(tmp_path / name, source_size=(64, 48))
    assert np.array_equal(again.mask, lut.mask) and one_grey_level(again.warp(IMAGE), lut.warp(IMAGE))


def test_endings_and_formats_go_together(lut, tmp_path):
    for name, format, phrase in (("a.png", None, ".yml"), ("a.npz", "opencv", ".yaml"), ("a.yml", "cv2", "'opencv'")):
        with refuses(errors.ArgumentError, phrase):
            lut.export(tmp_path / name, format=format)
    assert list(tmp_path.iterdir()) == []


def compiler() -> str:
    found = shutil.which("c++") or shutil.which("g++")
    if found is None:
        pytest.skip("needs a C++ compiler")
    return found


def test_the_c_header_compiles_and_holds_the_maps(lut, tmp_path):
    lut.export(tmp_path / "front view.h")
    program = """
    #include <cstdio>
    #include "front view.h"
    int main() {
      for (int i = 0; i < LUT_FRONT_VIEW_ROWS * LUT_FRONT_VIEW_COLUMNS; ++i)
        std::printf("%.9g %.9g\\n", lut_front_view_map_x[i], lut_front_view_map_y[i]);
      return LUT_FRONT_VIEW_SOURCE_WIDTH == 64 && LUT_FRONT_VIEW_SOURCE_HEIGHT == 48 ? 0 : 1;
    }"""
    (tmp_path / "main.cpp").write_text(program.replace("LUT_FRONT", "FRONT").replace("lut_front", "front"))
    subprocess.run([compiler(), "main.cpp", "-o", "main"], cwd=tmp_path, check=True)
    lines = subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout.split()
    there = np.array(lines, np.float32).reshape(-1, 2)
    assert np.array_equal(there, np.stack(lut.maps(outside=-9), -1).reshape(-1, 2))


def test_the_page_for_cpp_compiles_and_warps_as_we_do(lut, tmp_path):
    folders = (Path("/usr/include/opencv5"), Path("/usr/include/opencv4"), Path("/usr/local/include/opencv4"))
    include = next((folder for folder in folders if (folder / "opencv2" / "imgproc.hpp").exists()), None)
    if include is None:
        pytest.skip("needs OpenCV's C++ headers: apt-get install libopencv-dev")
    page = (Path(__file__).resolve().parents[2] / "docs" / "cpp.md").read_text(encoding="utf-8")
    (tmp_path / "main.cpp").write_text(page.split("```cpp\n")[1].split("```")[0])
    libraries = ["-lopencv_core", "-lopencv_imgproc", "-lopencv_imgcodecs"]
    subprocess.run([compiler(), "main.cpp", f"-I{include}", *libraries, "-o", "main"], cwd=tmp_path, check=True)
    lut.export(tmp_path / "front.yml")
    # OpenCV 4 rounds its coordinates to 1/32 of a pixel, which shows on noise and not on slopes
    y, x = np.mgrid[:48, :64]
    image = np.stack([2 * x + y, 200 - 3 * x, 5 * y], -1).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "frame.png"), image)
    subprocess.run([tmp_path / "main", "front.yml", "frame.png", "bev.png"], cwd=tmp_path, check=True)
    bev, inside = cv2.imread(str(tmp_path / "bev.png")), lut.mask
    assert one_grey_level(bev[inside], lut.warp(image)[inside]) and not bev[np.isnan(lut.maps()[0])].any()


def test_the_command_makes_each(tmp_path, capsys):
    CAMERA.save(tmp_path / "camera.json")
    grid = ["--x", "2", "14", "--y", "-5", "5", "--resolution", "0.25", "0.5"]
    for name, more in (("a.ipmlut", []), ("a.yml", ["--format", "lanenet"]), ("a.npz", []), ("a.h", [])):
        assert main(["lut", str(tmp_path / "camera.json"), "-o", str(tmp_path / name), *grid, *more]) == 0
        assert "48 x 20" in capsys.readouterr().out.replace("20 x 48", "48 x 20")
    lut = ipm_rs.Lut.load(tmp_path / "a.ipmlut", expect=(CAMERA, GRID))
    assert lut == ipm_rs.Lut(CAMERA, GRID)
    before = (tmp_path / "a.npz").read_bytes()
    for name, more, phrase in (
        ("a.npz", [], "--force"),
        ("b.png", [], ".ipmlut"),
        ("b.ipmlut", ["--format", "opencv"], ".yml"),
        ("none/b.npz", [], "directory"),
    ):
        assert main(["lut", str(tmp_path / "camera.json"), "-o", str(tmp_path / name), *grid, *more]) == 2
        assert phrase in capsys.readouterr().err
    assert (tmp_path / "a.npz").read_bytes() == before and not (tmp_path / "b.png").exists()
