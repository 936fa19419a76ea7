"""Other files than calibrations and points, damaged: tables, rings, trajectories, maps. They are read, or refused.

    python tests/python/file_mutations.py [MUTATIONS [SEED]]

Tables' own files are also forged: their checksums fit what was changed, so that what lies behind them is tried.
"""

from __future__ import annotations

import io
import random
import sys
import tempfile
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import test_trajectory
from calibration_mutations import MUTATIONS

import ipm_rs
from ipm_rs import errors
from ipm_rs.files.luts import container

LONGEST = 5.0
"""Seconds of the processor for one file."""
MOST_MEMORY = 64 << 20
"""Bytes for one file, of Python's and NumPy's own."""
IMAGE = np.random.default_rng(1).integers(0, 256, (48, 64, 3), dtype=np.uint8)


def use_lut(path: Path) -> None:
    """Read a table, and warp through it if it is one."""
    lut = ipm_rs.Lut.load(path)
    if lut.source_size == (64, 48) and lut.shape[0] * lut.shape[1] < 1 << 16:
        for interpolation in ("nearest", "bilinear", "area"):
            lut.warp(IMAGE, interpolation=interpolation)


def use_mosaic(path: Path) -> None:
    """Open the map beside the file, and look at it."""
    with ipm_rs.Mosaic.load(path.parent if path.name == "mosaic.json" else path.parent.parent) as mosaic:
        mosaic.image(x=(0, 12), y=(-6, 6))


def samples(folder: Path) -> dict[Path, Callable[[Path], object]]:
    """Write one good file of each kind; returns what reads it."""
    intrinsics = [[32.0, 0, 31.5], [0, 32.0, 23.5], [0, 0, 1]]
    camera = ipm_rs.Camera.from_euler(intrinsics, image_size=(64, 48), position=(0, 0, 1.5), pitch=0.4)
    grid = ipm_rs.BevGrid(x=(1, 9), y=(-3, 3), resolution=0.5)
    heights = ipm_rs.HeightMap(np.arange(12.0).reshape(3, 4) / 30, origin=(0, -4), spacing=(5, 3))
    found: dict[Path, Callable[[Path], object]] = {}
    for name, ground in (("flat.ipmlut", 0.0), ("map.ipmlut", heights)):
        ipm_rs.Lut(camera, grid, ground=ground).save(folder / name)
        found[folder / name] = use_lut
    lut = ipm_rs.Lut(camera, grid)
    for name, form in (("a.npz", None), ("a.yml", "opencv")):
        lut.export(folder / name, format=form)
        found[folder / name] = use_lut
    rig = ipm_rs.Rig({"front": camera, "left": camera.with_pose(camera.camera_from_vehicle)})
    rig.save(folder / "rig.json")
    found[folder / "rig.json"] = ipm_rs.Rig.load
    camera.save(folder / "camera.json")
    found[folder / "camera.json"] = ipm_rs.Camera.load
    for name, kind in (("a.tum", "tum"), ("a.csv", "csv"), ("b.csv", "euroc"), ("ego_pose.json", "nuscenes")):
        found[test_trajectory.write(folder / name, kind)] = ipm_rs.Trajectory.load
    with ipm_rs.Mosaic(0.25, tile=64, path=folder / "map") as mosaic:
        mosaic.add(camera, IMAGE, map_from_vehicle=np.eye(4))
    found[folder / "map" / "mosaic.json"] = use_mosaic
    found[sorted((folder / "map" / "tiles").iterdir())[0]] = use_mosaic
    return found


def forge(path: Path, data: bytes, rng: random.Random) -> bytes:
    """A table's file with a value of its header or a byte of its blocks changed, and checksums that fit."""
    content = container.read(path, io.BytesIO(data), "Lut")
    header = dict(content.header)
    kind, _ = header.pop("kind"), (header.pop("blocks"), header.pop("written_by"))
    blocks = {name: bytearray(content.block(name)) for name in content.blocks}
    if rng.random() < 0.5:
        block = blocks[rng.choice(sorted(blocks))]
        for _ in range(rng.choice((1, 1, 3))):
            block[rng.randrange(len(block))] ^= 1 << rng.randrange(8)
        if "table" in blocks:  # it has a checksum of its own inside
            table = blocks["table"]
            table[8:16] = ipm_rs._core._checksum(bytes(table[16:])).to_bytes(8, "little")
    else:
        key = rng.choice(sorted(header))
        header[key] = rng.choice((None, -1, 0, 1e308, "x", [], {}, [1] * 9, header[key], [header[key]]))
    container.write(path, kind, header, {name: bytes(block) for name, block in blocks.items()})
    return path.read_bytes()


def mutate(count: int, seed: int, folder: Path) -> Iterator[tuple[str, str]]:
    """Read so many mutated files; yields which was wrong, and how."""
    rng = random.Random(seed)
    found = samples(folder)
    whole = {path: path.read_bytes() for path in found}
    for read, path in ((read, path) for path, read in found.items()):
        read(path)
    for _ in range(count):
        path = rng.choice(list(found))
        data, what = whole[path], "forged"
        if path.suffix == ".ipmlut" and rng.random() < 0.5:
            data = forge(path, data, rng)
        else:
            mutation = rng.choice(MUTATIONS)
            data, what = mutation(data, rng) or data, mutation.__name__
        path.write_bytes(data)
        start = time.process_time()
        tracemalloc.start()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")  # of NumPy too: a number that is too large is refused in words
                warnings.simplefilter("ignore", ipm_rs.CalibrationWarning)
                found[path](path)
        except errors.IpmError as error:
            if len(str(error)) > 8000:
                yield path.name, f"{what}: a message of {len(str(error))} characters"
        except Exception as error:
            yield path.name, f"{what}: {type(error).__name__}: {error}"[:300]
        memory = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        if time.process_time() - start > LONGEST or memory > MOST_MEMORY:
            yield path.name, f"{what}: {time.process_time() - start:.1f} s, {memory >> 20} MB"
        path.write_bytes(whole[path])


def main() -> int:
    """Run many, and print each kind of failure once."""
    count, seed = map(int, [*sys.argv[1:], *("20000", "0")[len(sys.argv) - 1 :]][:2])
    with tempfile.TemporaryDirectory() as folder:
        problems = {problem for problem in mutate(count, seed, Path(folder))}
    for name, problem in sorted(problems)[:50]:
        print(f"{name}: {problem}")
    print(f"{count} files, {len(problems)} kinds of problems")
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
