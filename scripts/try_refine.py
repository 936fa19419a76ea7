#!/usr/bin/env python3
"""Show how well `ipm_rs.refine` finds poses, where the truth is known and on real pictures.

    .venv/bin/python scripts/try_refine.py drive [--seeds 20] [--frames 6] [--nods 0.15] [--blobs] [--per-frame]
    .venv/bin/python scripts/try_refine.py ring pinhole6 [--seeds 10] [--instants 2] [--blobs]
    .venv/bin/python scripts/try_refine.py kitti FOLDER [--frames 51] [--per-frame]
    .venv/bin/python scripts/try_refine.py real-ring FOLDER [--save DIRECTORY]

`drive` photographs a painted road along a bend, starts 2 degrees and a tenth of the height off, and prints for each
seed what the pose that was found is off by, and of all how many errors lie within one and two of the stated standard
deviations. `--nods` lets the vehicle nod by so many degrees (standard deviation), of which the poses know nothing.
`ring` does the same with a ring of cameras, of which the first is held. `kitti` takes a folder with `image_l/*.png`,
`calib.txt` and `poses.txt` of a sequence of KITTI's odometry. `real-ring` takes a folder with pictures
`CAMERA_INSTANT.jpg` and `rig.json` (`cameras`, each with `K`, `image_size`, `vehicle_from_camera`), or with pictures
`INSTANT_CAMERA.jpg` and `calibration.json` of fisheyes (`K`, `D`, `rotation_camera_from_ground`,
`translation_camera_from_ground` in units of 0.09 m), and saves views from above before and after. Figures in the
documentation come from here.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import Image

import ipm_rs
from ipm_rs import refine
from ipm_rs.refine._motion import angles_of

DEGREES = np.array([180 / np.pi] * 3 + [1.0])
"""Of roll, pitch and yaw in radians, and the height in metres."""
NAMES = ("roll", "pitch", "yaw", "height")
OWN_CAR = ((-1.0, 3.8), (-0.95, 0.95))
"""What the own car covers of the road, x and y in metres."""


class Road:
    """A road of asphalt, whose grain no pixel far away resolves, with dashes, edge lines, zebras and arrows."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self._fine = self._grain(random, 0.03, 14.0)
        self._broad = self._grain(random, 0.75, 10.0)

    @staticmethod
    def _grain(random: np.random.Generator, size: float, contrast: float, cell: float = 0.025) -> np.ndarray:
        """Return noise of a size in metres, as a tile that repeats itself."""
        count = 2048
        waves = np.hypot(np.fft.fftfreq(count)[:, None], np.fft.rfftfreq(count)) * 2 * np.pi
        spectrum = np.fft.rfft2(random.normal(size=(count, count))) * np.exp(-0.5 * (waves * size / cell) ** 2)
        noise = np.fft.irfft2(spectrum, s=(count, count))
        return (noise / noise.std() * contrast).astype(np.float32)

    def __call__(self, xy: np.ndarray) -> np.ndarray:
        """Return the brightness of points (..., 2) of the road."""
        x, y = xy[..., 0], xy[..., 1]
        # turned against the axes, so that no pattern is in step with cells or pixels
        across, along = (0.9938 * x + 0.1112 * y) / 0.025, (0.9938 * y - 0.1112 * x) / 0.025
        at = tuple(np.floor(each).astype(np.int64) % 2048 for each in (across, along))
        value = 95.0 + self._fine[at] + self._broad[at]
        value[(np.abs(np.abs(y) - 1.75) < 0.07) & (x % 3.1 < 2.0)] = 222.0
        value[np.abs(np.abs(y) - 5.3) < 0.1] = 214.0
        value[(x % 16.3 < 2.6) & (np.abs(y) < 5.0) & (np.floor(y / 0.45) % 2 == 0)] = 232.0
        value[(np.abs(np.abs(y) - 3.5) < 0.8) & (x % 10.7 < 1.9) & (np.floor((x + y) / 0.31) % 2 == 0)] = 203.0
        value[(x % 7.3 < 0.7) & (np.abs(y - 0.2) < 0.45) & (np.floor(x / 0.12) % 2 == 0)] = 219.0
        return value


def photographed(
    camera: ipm_rs.Camera, road: Road, map_from_vehicle: np.ndarray, random: np.random.Generator, *, noise: float = 2.0,
    gain: float = 1.0, own_car: bool = False, samples: int = 2,
) -> np.ndarray:  # fmt: skip
    """Return a grey picture of the road from where a vehicle is; what is not road is 150."""
    width, height = camera.image_size
    total = np.zeros((height, width))
    for a, b in np.ndindex(samples, samples):
        u, v = np.arange(width) + (a + 0.5) / samples - 0.5, np.arange(height) + (b + 0.5) / samples - 0.5
        pixels = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
        seen = camera.ground_from_pixels(pixels)
        near = np.hypot(*(seen[:, :2] - camera.position[:2]).T) < 120.0
        value = np.full(len(pixels), 150.0)
        value[near] = road((seen[near] @ map_from_vehicle[:3, :3].T + map_from_vehicle[:3, 3])[:, :2])
        if own_car:
            value[within(seen, OWN_CAR)] = 15.0
        total += value.reshape(height, width)
    total = total / samples**2 * gain + random.normal(0, noise, total.shape)
    return np.clip(np.rint(total), 0, 255).astype(np.uint8)


def within(points: np.ndarray, box: tuple[tuple[float, float], tuple[float, float]], margin: float = 0.0) -> np.ndarray:
    """Return which points (N, 2 or 3) lie in a box of x and y; NaN lies in none."""
    ok = np.ones(len(points), bool)
    for k, (low, high) in enumerate(box):
        ok &= (points[:, k] > low - margin) & (points[:, k] < high + margin)
    return ok


def covered(images: list[np.ndarray], random: np.random.Generator, top: float, count: int = 7) -> list[np.ndarray]:
    """Return pictures with blobs that move by themselves over a tenth of what is below a part of their height."""
    height, width = images[0].shape
    v, u = np.mgrid[:height, :width]
    blobs = [
        (random.uniform(0.08, 0.92) * width, random.uniform(top, 0.97) * height, random.uniform(0.013, 0.048) * width,
         random.uniform(-6, 6), random.uniform(0, 2.4))
        for _ in range(count)
    ]  # fmt: skip
    found = []
    for index, image in enumerate(images):
        image = image.copy()
        for at_u, at_v, radius, du, dv in blobs:
            image[((u - at_u - du * index) / 1.6) ** 2 + (v - at_v - dv * index) ** 2 < radius**2] = random.integers(
                30, 230
            )
        found.append(image)
    return found


def along_a_bend(frames: int, step: float = 1.3, curvature: float = 0.012) -> list[np.ndarray]:
    """Return map_from_vehicle of each picture of a drive."""
    poses = []
    for s in step * np.arange(frames):
        pose = np.eye(4)
        pose[:3, :3] = ipm_rs.rotation_from_euler(0.0, 0.0, curvature * s)
        pose[:2, 3] = np.sin(curvature * s) / curvature, (1.0 - np.cos(curvature * s)) / curvature
        poses.append(pose)
    return poses


def values(camera: ipm_rs.Camera) -> np.ndarray:
    """Return roll, pitch, yaw in degrees and the height in metres."""
    return np.array([*angles_of(camera.vehicle_from_camera), camera.position[2]]) * DEGREES


def moved(camera: ipm_rs.Camera, degrees: Iterable[float], height: float) -> ipm_rs.Camera:
    """Return a camera turned by roll, pitch, yaw, and at so many times its height."""
    roll, pitch, yaw = np.array(angles_of(camera.vehicle_from_camera)) + np.radians(list(degrees))
    x, y, z = camera.position
    turned = ipm_rs.Camera.from_euler(
        camera.intrinsics, image_size=camera.image_size, position=(x, y, z * height), roll=roll, pitch=pitch, yaw=yaw,
        lens=camera.lens,
    )  # fmt: skip
    return turned if camera.mask is None else turned.masked(camera.mask)


def tell(errors: list[np.ndarray], deviations: list[np.ndarray]) -> None:
    """Print the largest errors (N, 4), and how many of them lie within their deviations."""
    off = np.array(errors)
    times = off / np.array(deviations)
    print("largest", dict(zip(NAMES, np.abs(off).max(0).round(4).tolist(), strict=True)))
    print("r.m.s. ", dict(zip(NAMES, np.sqrt((off**2).mean(0)).round(4).tolist(), strict=True)))
    for most in (1, 2, 3):
        each = (np.abs(times) < most).mean(0)
        print(f"within {most} deviation(s): {(np.abs(times) < most).mean():.2f}, each {each.round(2).tolist()}")


def drive(arguments: argparse.Namespace) -> None:
    """Drives whose truth is known."""
    K = [[905.4, 0, 431.3], [0, 900.1, 205.7], [0, 0, 1]]
    true = ipm_rs.Camera.from_euler(K, image_size=(820, 410), position=(1.7, 0.026, 1.21), pitch=0.0384, yaw=-0.0097)
    errors, deviations = [], []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        road, random = Road(seed), np.random.default_rng(seed)
        poses = along_a_bend(arguments.frames)
        nods = random.normal(0.0, arguments.nods, len(poses)) if arguments.nods else np.zeros(len(poses))
        images = []
        for pose, nod in zip(poses, nods, strict=True):
            images.append(photographed(nodding(true, rotated(nod)), road, pose, random))
        if arguments.of_camera:
            poses = [
                pose @ nodding(true, rotated(nod)).vehicle_from_camera for pose, nod in zip(poses, nods, strict=True)
            ]
        if arguments.blobs:
            images = covered(images, random, 0.5)
        signs = np.random.default_rng(seed + 7).choice([-1, 1], 4)
        start = moved(true, signs[:3] * [2, 2, 0 if arguments.of_camera else 1], 1.0 + 0.1 * signs[3])
        if arguments.save:
            Image.fromarray(images[0]).save(arguments.save / f"drive_{seed}.png")
        begun, spent = time.perf_counter(), time.process_time()
        found = refine.from_drive(
            start, images, poses, poses_of="camera" if arguments.of_camera else "vehicle", per_frame=arguments.per_frame
        )
        begun, spent = time.perf_counter() - begun, time.process_time() - spent
        off = values(found.camera) - values(true)
        deviation = np.array([found.deviations.get(name, np.nan) for name in NAMES]) * DEGREES
        errors.append(off)
        deviations.append(deviation)
        nodded = (
            ""
            if found.pitches is None
            else f" nods {np.abs(np.degrees(found.pitches) - values(true)[1] - nods).max():.3f}"
        )
        print(
            f"seed {seed}: off {off.round(4).tolist()} deviations {deviation.round(4).tolist()} correlation "
            f"{found.before:.3f} {found.after:.4f}{nodded} {begun:.1f} s, {spent:.1f} s of CPU", flush=True,
        )  # fmt: skip
    tell(errors, deviations)


def rotated(degrees: float) -> np.ndarray:
    """Return a vehicle's nod."""
    turn = np.eye(4)
    turn[:3, :3] = ipm_rs.rotation_from_euler(0.0, np.radians(degrees), 0.0)
    return turn


def nodding(camera: ipm_rs.Camera, turn: np.ndarray) -> ipm_rs.Camera:
    """Return a camera on a vehicle that has turned about its own origin."""
    return camera.with_pose(camera.camera_from_vehicle @ np.linalg.inv(turn))


def ring_of(kind: str) -> dict[str, ipm_rs.Camera]:
    """Return six pinholes with narrow overlaps, or four fisheyes, each with the own car masked."""
    if kind == "pinhole6":
        places = {"front": (0, 1.7, 0.0), "front_left": (55, 1.5, 0.5), "front_right": (-56, 1.5, -0.5),
                  "back": (180, 0.0, 0.0), "back_left": (109, 1.0, 0.5), "back_right": (-110, 1.0, -0.5)}  # fmt: skip
        cameras = {}
        for index, (name, (yaw, x, y)) in enumerate(places.items()):
            f = 404.0 if name == "back" else 633.0  # it sees 89 degrees, the others 65
            roll, pitch = np.radians(0.3 * index - 0.7), np.radians(1.5 + 0.2 * index)
            cameras[name] = ipm_rs.Camera.from_euler(
                [[f, 0, 399.5], [0, f, 224.5], [0, 0, 1]], image_size=(800, 450), position=(x, y, 1.5 + 0.02 * index),
                roll=roll, pitch=pitch, yaw=np.radians(yaw),
            )  # fmt: skip
    else:
        lens = ipm_rs.KannalaBrandt([0.05, -0.012, 0.003, -0.0006], max_angle=np.radians(95))
        places = {"front": (0, 3.7, 0.0, 0.7), "left": (90, 1.9, 0.95, 1.0), "back": (180, -0.9, 0.0, 0.9),
                  "right": (-90, 1.9, -0.95, 1.0)}  # fmt: skip
        cameras = {
            name: ipm_rs.Camera.from_euler(
                [[300, 0, 479.5], [0, 302, 319.5], [0, 0, 1]], image_size=(960, 640), position=(x, y, z), lens=lens,
                roll=np.radians(0.5 * index - 0.8), pitch=np.radians(35 + index), yaw=np.radians(yaw),
            )
            for index, (name, (yaw, x, y, z)) in enumerate(places.items())
        }  # fmt: skip
    return {name: camera.masked(road_of(camera)) for name, camera in cameras.items()}


def road_of(camera: ipm_rs.Camera) -> np.ndarray:
    """Return which pixels do not show the own car."""
    width, height = camera.image_size
    pixels = np.stack(np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float)), -1)
    return ~within(camera.ground_from_pixels(pixels.reshape(-1, 2)), OWN_CAR, 0.15).reshape(height, width)


def ring_scene(
    kind: str, seed: int, instants: int, blobs: bool
) -> tuple[dict[str, ipm_rs.Camera], ipm_rs.Rig, list[dict[str, np.ndarray]]]:
    """Return the true cameras, the rig as it is given, and the pictures of all instants."""
    true, road, random = ring_of(kind), Road(seed), np.random.default_rng(seed)
    gains = {name: random.uniform(0.9, 1.1) for name in true}
    poses = along_a_bend(instants)
    series = {
        # with two samples a pixel edges are put off by a quarter of a pixel, which no camera's are
        name: [photographed(camera, road, pose, random, gain=gains[name], own_car=True, samples=3) for pose in poses]
        for name, camera in true.items()
    }
    if blobs:
        series = {name: covered(images, random, 0.55, 4) for name, images in series.items()}
    given = {}
    for name, camera in true.items():
        off = random.choice([-1, 1], 4) * (0.0 if name == "front" else 1.0)
        given[name] = moved(camera, off[:3] * [2, 2, 2], 1.0 + 0.1 * off[3])
    return true, ipm_rs.Rig(given), [{name: images[k] for name, images in series.items()} for k in range(instants)]


def ring(arguments: argparse.Namespace) -> None:
    """Rings whose truth is known."""
    errors, deviations = [], []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        true, given, images = ring_scene(arguments.kind, seed, arguments.instants, arguments.blobs)
        begun, spent = time.perf_counter(), time.process_time()
        try:
            found = refine.from_overlaps(given, images, fixed="front")
        except ipm_rs.IpmError as error:
            print(f"seed {seed}: {error}", flush=True)
            continue
        begun, spent = time.perf_counter() - begun, time.process_time() - spent
        print(f"seed {seed}: {begun:.1f} s, {spent:.1f} s of CPU")
        for name in dict.fromkeys(name for name, _ in found.parameters):
            off = values(found.rig[name]) - values(true[name])
            off[:3] = (off[:3] + 180.0) % 360.0 - 180.0
            deviation = np.array([found.deviations[name, each] for each in NAMES]) * DEGREES
            errors.append(off)
            deviations.append(deviation)
            print(f"  {name}: off {off.round(4).tolist()} deviations {deviation.round(4).tolist()}")
        for name, why in found.kept.items():
            print(f"  {name} stays: {why}")
        print("  after", {"/".join(pair): round(score, 3) for pair, score in found.after.items()}, flush=True)
    if errors:
        tell(errors, deviations)


def kitti(arguments: argparse.Namespace) -> None:
    """Find the pose of a real drive, from a nominal mounting: level, 1.65 m high."""
    count, folder = arguments.frames, arguments.folder
    K = np.loadtxt(folder / "calib.txt")[0].reshape(3, 4)[:, :3]
    poses = np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)[:count]
    images = [np.asarray(Image.open(folder / "image_l" / f"{index:06d}.png")) for index in range(count)]
    nominal = ipm_rs.Camera.from_euler(K, image_size=images[0].shape[1::-1], position=(0, 0, 1.65))
    begun, spent = time.perf_counter(), time.process_time()
    found = refine.from_drive(nominal, images, poses, poses_of="camera", per_frame=arguments.per_frame)
    print(found, f"\n{time.perf_counter() - begun:.1f} s, {time.process_time() - spent:.1f} s of CPU")
    for x, y in (((6, 18), (-2, 2)), ((6, 20), (-4, 4)), ((7, 25), (-5, 5))):
        grid = ipm_rs.BevGrid(x=x, y=y, resolution=0.1)
        scores = [agreement(camera, grid, images, poses, found.pairs) for camera in (nominal, found.camera)]
        print(f"x {x}, y {y}: {scores[0]:.3f} before, {scores[1]:.3f} after")


def ring_files(folder: Path) -> tuple[ipm_rs.Rig, list[dict[str, np.ndarray]]]:
    """Return a real ring and the pictures of all its instants."""
    cameras = {}
    if (folder / "rig.json").exists():
        for name, told in json.loads((folder / "rig.json").read_text())["cameras"].items():
            cameras[name] = ipm_rs.Camera(
                told["K"], image_size=told["image_size"], vehicle_from_camera=told["vehicle_from_camera"]
            )
        named = "{name}_{instant}.jpg"
    else:
        ground_from_vehicle = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        for name, told in json.loads((folder / "calibration.json").read_text()).items():
            pose = np.eye(4)
            pose[:3, :3] = np.array(told["rotation_camera_from_ground"]) @ ground_from_vehicle
            pose[:3, 3] = 0.09 * np.array(told["translation_camera_from_ground"])
            lens = ipm_rs.KannalaBrandt(told["D"], max_angle=np.radians(80.0))
            cameras[name] = ipm_rs.Camera(
                told["K"], image_size=told["image_size"], camera_from_vehicle=pose, nearest_rotation=True, lens=lens
            )
        named = "{instant}_{name}.jpg"
    instants = []
    for instant in range(9):
        files = {name: folder / named.format(name=name, instant=instant) for name in cameras}
        if all(file.exists() for file in files.values()):
            instants.append({name: np.asarray(Image.open(file)) for name, file in files.items()})
    return ipm_rs.Rig(cameras), instants


def real_ring(arguments: argparse.Namespace) -> None:
    """Find the poses of a real ring from what pairs of its cameras see."""
    given, instants = ring_files(arguments.folder)
    begun, spent = time.perf_counter(), time.process_time()
    found = refine.from_overlaps(given, instants, prior=arguments.prior)
    print(found, f"\n{time.perf_counter() - begun:.1f} s, {time.process_time() - spent:.1f} s of CPU")
    for name, camera in found.rig.items():
        off = values(camera) - values(given[name])
        print(f"{name} moved by {off.round(3).tolist()} (roll, pitch, yaw in degrees, height in metres)")
    if arguments.save:
        grid = ipm_rs.BevGrid(x=(-12, 18), y=(-12, 12), resolution=0.03)
        for when, rig in (("before", given), ("after", found.rig)):
            view = ipm_rs.RigLut(rig, grid, blend="feather").warp(instants[0], interpolation="area", gains=found.gains)
            Image.fromarray(view).save(arguments.save / f"{arguments.folder.name}_{when}.png")


def agreement(
    camera: ipm_rs.Camera, grid: ipm_rs.BevGrid, images: list[np.ndarray], poses: np.ndarray,
    pairs: Iterable[tuple[int, int]],
) -> float:  # fmt: skip
    """Return the mean correlation of consecutive views of a grid."""
    scores = []
    for first, second in pairs:
        whole = [np.vstack([poses[index], [0, 0, 0, 1]]) for index in (first, second)]
        later = camera.with_pose(np.linalg.inv(whole[1]) @ whole[0] @ camera.camera_from_vehicle)
        luts = [ipm_rs.Lut(each, grid) for each in (camera, later)]
        both = luts[0].mask & luts[1].mask
        views = [lut.warp(images[index]) for lut, index in zip(luts, (first, second), strict=True)]
        scores.append(np.corrcoef(views[0][both], views[1][both])[0, 1])
    return float(np.mean(scores))


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("drive")
    command.add_argument("--seeds", type=int, default=20)
    command.add_argument("--first", type=int, default=0, help="the first seed")
    command.add_argument("--frames", type=int, default=6)
    command.add_argument("--nods", type=float, default=0.0, help="degrees, standard deviation")
    command.add_argument("--blobs", action="store_true", help="cover a tenth of the road by what moves")
    command.add_argument("--per-frame", action="store_true")
    command.add_argument("--of-camera", action="store_true")
    command.add_argument("--save", type=Path)
    command.set_defaults(run=drive)
    command = commands.add_parser("ring")
    command.add_argument("kind", choices=("pinhole6", "fisheye4"))
    command.add_argument("--seeds", type=int, default=10)
    command.add_argument("--first", type=int, default=0, help="the first seed")
    command.add_argument("--instants", type=int, default=2)
    command.add_argument("--blobs", action="store_true", help="cover a tenth of the road by what moves")
    command.set_defaults(run=ring)
    command = commands.add_parser("kitti")
    command.add_argument("folder", type=Path)
    command.add_argument("--frames", type=int, default=51)
    command.add_argument("--per-frame", action="store_true")
    command.set_defaults(run=kitti)
    command = commands.add_parser("real-ring")
    command.add_argument("folder", type=Path)
    command.add_argument("--prior", type=float, nargs=2, help="degrees and metres that the cameras may be off by")
    command.add_argument("--save", type=Path)
    command.set_defaults(run=real_ring)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
