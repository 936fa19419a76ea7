"""Damaged point files: eight kinds, mutated at random, are read right or refused, in no time and in no memory.

``python tests/python/point_mutations.py 100000`` for a long run; `test_pointfile_damage` makes a short one.
"""

from __future__ import annotations

import sys
import time
import tracemalloc
from collections import Counter
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ipm_rs import errors, pointfile

COUNT = 60
LONGEST = 5.0
"""Seconds of the processor, so that a busy machine proves nothing."""
MOST_MEMORY = 8 << 20


def samples(folder: Path) -> dict[str, bytes]:
    """One good file of each kind."""
    random = np.random.default_rng(11)
    points = random.normal(0, 20, (COUNT, 3)).astype(np.float32)
    values = {
        "intensity": random.random(COUNT).astype(np.float32),
        "ring": random.integers(0, 64, COUNT).astype(np.uint16),
        "red": random.integers(0, 256, COUNT).astype(np.uint8),
    }
    for name in ("a.ply", "a.npy", "a.pcd"):
        pointfile.write(folder / name, points, values)
    if find_spec("laspy") is not None:
        for name in ("a.las", "a.laz"):
            pointfile.write(folder / name, points, values)
    pointfile.write(folder / "a.bin", points, {"intensity": values["intensity"]})
    rows = [
        f"{x} {y} {z} {i} {n}"
        for (x, y, z), i, n in zip(points.tolist(), values["intensity"].tolist(), values["ring"].tolist(), strict=True)
    ]
    body = "\n".join(rows) + "\n"
    ply = (
        f"ply\nformat ascii 1.0\ncomment by hand\nelement camera 1\nproperty float f\nelement vertex {COUNT}\n"
        "property float x\nproperty float y\nproperty float z\nproperty float intensity\nproperty ushort ring\n"
        "end_header\n0.5\n"
    )
    pcd = (
        "VERSION 0.7\nFIELDS x y z intensity ring\nSIZE 4 4 4 4 2\nTYPE F F F F U\nCOUNT 1 1 1 1 1\n"
        f"WIDTH {COUNT}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {COUNT}\nDATA ascii\n"
    )
    kinds = {path.suffix: path.read_bytes() for path in folder.iterdir()}
    return kinds | {"ascii.ply": (ply + body).encode(), "ascii.pcd": (pcd + body).encode()}


NASTY = [
    b"999999999999",
    b"-1",
    b"0",
    b"nan",
    b"1e400",
    b"300",
    b"(",
    b"'",
    b"\n",
    b" ",
    b"\0" * 4,
    b"\xff" * 8,
    b"list",
]


def mutated(data: bytes, random: np.random.Generator) -> bytes:
    """Some of: bytes flipped, cut, taken out, doubled, numbers and words of harm put in, mostly in the header."""
    result = bytearray(data)
    for _ in range(int(random.integers(1, 4))):
        end = len(result) if random.random() < 0.3 else min(len(result), 400)
        at = int(random.integers(0, max(end, 1)))
        match int(random.integers(0, 6)):
            case 0 if result:
                result[min(at, len(result) - 1)] ^= 1 << int(random.integers(0, 8))
            case 1:
                del result[at:]
            case 2:
                del result[at : at + int(random.integers(1, 20))]
            case 3:
                result[at:at] = result[at : at + int(random.integers(1, 60))]
            case 4:
                result[at:at] = NASTY[int(random.integers(0, len(NASTY)))]
            case _:
                result[at : at + 4] = NASTY[int(random.integers(0, len(NASTY)))]
    return bytes(result)


def run(count: int, seed: int, folder: Path) -> Counter[str]:
    """Read so many damaged files; returns what became of them, and raises for what must not be."""
    random, outcomes = np.random.default_rng(seed), Counter[str]()
    kinds = samples(folder)
    names = sorted(kinds)
    tracemalloc.start()
    try:
        for index in range(count):
            kind = names[index % len(names)]
            path = folder / f"damaged{Path(kind).suffix or kind}"
            path.write_bytes(mutated(kinds[kind], random))
            columns = ["x", "y", "z", "i"] if kind == ".bin" and random.random() < 0.5 else None
            tracemalloc.reset_peak()
            start, before = time.process_time(), tracemalloc.get_traced_memory()[0]
            try:
                cloud = pointfile.read(path, columns=columns)
                assert cloud.points.ndim == 2 and cloud.points.shape[1] == 3
                assert all(len(column) == len(cloud.points) for column in cloud.values.values())
                assert cloud.points.nbytes <= 8 * 100 * path.stat().st_size + 64
                outcomes[f"{kind} read"] += 1
            except errors.FileError:
                outcomes[f"{kind} refused"] += 1
            took, peak = time.process_time() - start, tracemalloc.get_traced_memory()[1] - before
            assert took < LONGEST, f"{kind}, number {index} of seed {seed}: {took:.1f} s"
            assert peak < MOST_MEMORY, f"{kind}, number {index} of seed {seed}: {peak} bytes"
    finally:
        tracemalloc.stop()
    return outcomes


if __name__ == "__main__":
    with TemporaryDirectory() as name:
        begun = time.perf_counter()
        for what, times in sorted(run(int(sys.argv[1]), int((sys.argv[2:] or ["0"])[0]), Path(name)).items()):
            print(f"{times:8} {what}")
        print(f"{time.perf_counter() - begun:.0f} s")
