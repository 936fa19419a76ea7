"""Calibration files with a few bytes, lines, numbers or names changed: a camera or one of our errors, whatever comes.

    python tests/python/calibration_mutations.py [MUTATIONS [SEED]]

runs over the samples, and over the real files where they are.
"""

from __future__ import annotations

import collections
import random
import re
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from calibration_samples import SAMPLES, Sample

import ipm_rs
from ipm_rs import errors

ODD = getattr(ipm_rs, "CalibrationWarning", None)
SHARED = Path(__file__).parents[3] / "shared" / "data"
LINES = ("camodocal", "orbslam", "ocamcalib")  # whose last line may be a number
NUMBER = re.compile(rb"[-+]?[0-9]+(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?")
WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9]{1,}")
NUMBERS = (
    b"nan",
    b"inf",
    b"-1",
    b"0",
    b"1e999",
    b"1e308",
    b"5e-324",
    b"1_0",
    b"0x10",
    b"",
    b"9" * 400,
    b"[]",
    b"null",
    b"~",
)


def flip(data: bytes, rng: random.Random) -> bytes:
    """Some bytes are others."""
    content = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 3, 10))):
        content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    return bytes(content)


def cut(data: bytes, rng: random.Random) -> bytes:
    """The file ends too early."""
    return data[: rng.randrange(len(data))]


def lines(data: bytes, rng: random.Random) -> bytes:
    """Two lines change places, one is there twice, or one is gone."""
    content = data.splitlines(keepends=True)
    i, j = rng.randrange(len(content)), rng.randrange(len(content))
    what = rng.randrange(3)
    if what == 0:
        content[i], content[j] = content[j], content[i]
    elif what == 1:
        content.insert(j, content[i])
    else:
        del content[i]
    return b"".join(content)


def number(data: bytes, rng: random.Random) -> bytes:
    """A number is another, or none."""
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    match = rng.choice(found)
    new = rng.choice((*NUMBERS, b"%.6g" % rng.uniform(-1e4, 1e4), match[0].replace(b".", b"."), b"-" + match[0]))
    return data[: match.start()] + new + data[match.end() :]


def name(data: bytes, rng: random.Random) -> bytes:
    """A word is another one of the file, or misspelt, wherever it stands."""
    found = sorted({match[0] for match in WORD.finditer(data)})
    if not found:
        return data
    old = rng.choice(found)
    new = rng.choice((old + b"x", old.upper(), old[1:], rng.choice(found), b"K", b"camera_matrix"))
    return re.sub(rb"\b" + re.escape(old) + rb"\b", new, data, count=rng.choice((0, 1)))


MUTATIONS: tuple[Callable[[bytes, random.Random], bytes], ...] = (flip, cut, lines, number, name)


def real() -> dict[str, Sample]:
    """Real calibrations of each format, with the options that they need; empty where there are none."""
    every = {
        "ros": ("calibration_files/ros_camera_info.yaml", "ros", {}),
        "ros ini": ("calibration_files/ros_calib8.ini", "ros", {}),
        "opencv": ("calibration_files/opencv_filestorage.yml", "opencv", {}),
        "kalibr": ("calibration_files/kalibr_pinhole_equidistant.yaml", "kalibr", {}),
        "kalibr ds": ("calibration_files/kalibr_ds.yaml", "kalibr", {"camera": 1}),
        "matlab": ("calibration_files/matlab_monocamera.json", "matlab", {}),
        "nuscenes record": ("calibration_files/nuscenes_calibrated_sensor_record.json", "nuscenes", {}),
        "cityscapes": ("cityscapes/camera.json", "cityscapes", {}),
        "cityscapes nested": ("cityscapes/frankfurt_style_camera_nested.json", "cityscapes", {}),
        "kitti": ("kitti/000114_calib.txt", "kitti", {"image_size": (1242, 375)}),
        "nuscenes table": (
            "calibration_files/nuscenes_schema_calibrated_sensor.json",
            "nuscenes",
            {"camera": "18908cc236587364dfac3766d0a410ef598e41a417e1cf17e3043bf50b7d600f", "image_size": (1224, 1024)},
        ),
        "rig": ("ring_drive/rig.json", "opencv", {"camera": "CAMERA_05", "lens": "pinhole"}),
        **{
            f"ring {side}": ("ring_fisheye/calibration.json", "opencv", {"camera": side, "lens": "fisheye"})
            for side in ("front", "left", "right", "back")
        },
        **{
            f"fisheye {side}": (f"fisheye_surround/{side}.yaml", "opencv", {"lens": "fisheye"})
            for side in ("front", "left", "right", "back")
        },
    }
    found = {}
    for title, (path, form, options) in every.items():
        if (SHARED / path).is_file():
            files = {Path(path).name: (SHARED / path).read_bytes()}
            found[f"real {title}"] = Sample(form, files, options=options)
    return found


def same(one: ipm_rs.Camera, other: ipm_rs.Camera) -> bool:
    """Whether two cameras are equal but for the last bits of their poses."""
    return (
        one.lens == other.lens
        and one.image_size == other.image_size
        and bool(np.allclose(one.intrinsics, other.intrinsics, rtol=0, atol=0))
        and bool(np.allclose(one.camera_from_vehicle, other.camera_from_vehicle, rtol=0, atol=1e-12))
    )


def unseen(sample: Sample, file: str, end: int) -> bool:
    """Whether a file that ends there is a whole one of its format.

    Plain lines may end within a number, which shows only where all are printed with as many digits; OpenCV's pose comes
    last, and is not in every file.
    """
    if sample.format == "opencv":
        return sample.files[file][end:].lstrip().startswith(b"rvec")
    plain = sample.format in ("kitti", "kitti_raw", "kitti_360", "colmap", *LINES)
    return plain and re.fullmatch(rb"[0-9.][0-9.eE]|[0-9.]-", sample.files[file][end - 1 : end + 1]) is not None


def mutate(samples: dict[str, Sample], count: int, seed: int, directory: Path) -> Iterator[tuple[str, str, bytes]]:
    """Read `count` mutated files, by ``Camera.load`` and by the format's own reader.

    Yields what went wrong: which sample, how, and the file: an error that is none of ours, a message without end, more
    than 5 s, or another camera out of a file whose end is missing.
    """
    rng = random.Random(seed)
    folders = {title: directory / str(number) for number, title in enumerate(samples)}  # readers look beside a file
    for folder in folders.values():
        folder.mkdir(exist_ok=True)
    wholes = {
        title: ipm_rs.Camera.load(sample.write(folders[title]), **sample.options) for title, sample in samples.items()
    }
    for index in range(count):
        title = rng.choice(list(samples))
        sample = samples[title]
        file = rng.choice(list(sample.files))
        data = sample.files[file]
        mutation = rng.choice(MUTATIONS)
        for _ in range(1 if mutation is cut else rng.choice((1, 1, 2, 4))):
            data = mutation(data, rng) or data
        path = Sample(sample.format, {**sample.files, file: data}, sample.source, sample.options).write(folders[title])
        readers = [ipm_rs.Camera.load, getattr(ipm_rs.Camera, f"from_{sample.format}")]
        start = time.perf_counter()
        try:
            with warnings.catch_warnings():
                if ODD is not None:  # a camera that is read, and looks odd, as a changed number makes it
                    warnings.simplefilter("ignore", ODD)
                camera = readers[index % 2](path, **sample.options)
            if mutation is cut and not same(camera, wholes[title]) and not unseen(sample, file, len(data)):
                yield title, f"{mutation.__name__}: another camera: {camera!r}", data
        except errors.IpmError as error:
            if len(str(error)) > 8000:
                yield title, f"{mutation.__name__}: a message of {len(str(error))} characters", data
        except Exception as error:
            yield title, f"{mutation.__name__}: {type(error).__name__}: {error}", data
        if time.perf_counter() - start > 5:
            yield title, f"{mutation.__name__}: {time.perf_counter() - start:.1f} s", data


def main() -> None:
    """Run many mutations, and print each kind of failure once."""
    count, seed = (
        (int(word) for word in (*sys.argv[1:], "100000", "0")[:2]) if len(sys.argv) < 3 else map(int, sys.argv[1:3])
    )
    kinds: collections.Counter[str] = collections.Counter()
    with tempfile.TemporaryDirectory() as directory:
        for title, problem, data in mutate({**SAMPLES, **real()}, count, seed, Path(directory)):
            kind = f"{title}: {problem[:160]}"
            if not kinds[kind]:
                print(f"{kind}\n    {data[-160:]!r}", flush=True)
            kinds[kind] += 1
    print(f"{count} mutations, {sum(kinds.values())} wrong")
    sys.exit(bool(kinds))


if __name__ == "__main__":
    main()
