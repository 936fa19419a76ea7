#!/usr/bin/env python3
"""Show what maps of the road are worth, where the truth is known, and what they cost.

    .venv/bin/python scripts/try_mosaic.py sharp [--seeds 5] [--cells 0.05] [--nearest 5] [--nods 0.3] [--cars]
    .venv/bin/python scripts/try_mosaic.py ring pinhole6 [--seeds 2]
    .venv/bin/python scripts/try_mosaic.py kitti --path FOLDER [--picture map.png]
    .venv/bin/python scripts/try_mosaic.py kills [--times 20]
    .venv/bin/python scripts/try_mosaic.py ray
    .venv/bin/python scripts/try_mosaic.py long [--frames 5000] [--step 1.0]
    .venv/bin/python scripts/try_mosaic.py city [--frames 1000000]

`sharp` maps a painted road from a drive along a bend and compares every view with the road averaged over each cell:
`--cars` lets something dark stand there in a quarter of the frames, `--nods` lets the vehicle nod by so many degrees
(standard deviation), which the poses do not know and `refine.from_drive(per_frame=True)` has to find.
`ring` maps the same road with a ring of cameras and measures how far the map steps where another camera is the best.
`kitti` maps a folder with `image_l/*.png`, `calib.txt` and `poses.txt` of a sequence of KITTI's odometry, after
`refine.from_drive`. `kills` ends a run at random moments and starts it again. `ray` (extra ``ray``) maps a drive on
clusters of one, two and four workers, and on one that loses a worker, and compares with one process. `long` tells
milliseconds a frame and the memory of the process as a drive goes on. `city` measures the stages of a run and says what
they are for a city.
"""

from __future__ import annotations

import argparse
import io
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image
from process_memory import resident
from try_ray import workers_of_mine
from try_refine import Road, photographed, ring_of

import ipm_rs
from ipm_rs import refine

X, Y = (8.0, 26.0), (-4.0, 6.0)


def bend(number: int, nod: float = 0.0, step: float = 1.3) -> np.ndarray:
    """Return where a vehicle is on a bend of 80 m."""
    way = step * number
    pose = np.eye(4)
    pose[:3, :3] = ipm_rs.rotation_from_euler(0.0, nod, way / 80)
    pose[:2, 3] = 80 * np.sin(way / 80), 80 * (1 - np.cos(way / 80))
    return pose


def averaged(road: Road, grid: ipm_rs.BevGrid) -> np.ndarray:
    """Return the road over each cell, from 8 x 8 places in it."""
    xy = grid.xy()
    size = grid.resolution[0]
    steps = (np.arange(8) + 0.5) / 8 - 0.5
    return sum(road(xy + np.array([a, b]) * size) for a in steps for b in steps) / 64


def decibels(view: np.ndarray, truth: np.ndarray, where: np.ndarray) -> float:
    """Return the signal to noise ratio of some cells."""
    return 10 * np.log10(255**2 / np.mean((view.astype(float) - truth)[where] ** 2))


def sharp(args: argparse.Namespace) -> None:
    """Compare views of a drive with the road."""
    camera = ipm_rs.Camera.from_euler(
        [[905, 0, 431], [0, 900, 206], [0, 0, 1]], image_size=(820, 410), position=(1.7, 0.02, 1.21), pitch=0.038
    )
    rows: list[dict[str, float]] = []
    for seed in range(args.seeds):
        road, random = Road(seed), np.random.default_rng(seed)
        nods = np.deg2rad(args.nods) * random.normal(size=16)
        true = [bend(number, nod) for number, nod in enumerate(nods)]
        pictures = [photographed(camera, road, pose, random, samples=3) for pose in true]
        for picture in pictures if args.cars else ():
            left = int(random.integers(0, 600))
            if random.random() < 0.25:
                picture[180:, left : left + 200] = 20
        level = [bend(number) for number in range(16)]
        cameras = [camera] * 16
        if args.nods:
            found = refine.from_drive(camera, pictures, level, per_frame=True)
            cameras = [found.camera_at(number) for number in range(16)]
        frames = list(zip(cameras, pictures, level, strict=True))
        mosaic = ipm_rs.Mosaic(args.cells, samples=8)
        for number, (lens, picture, pose) in enumerate(frames):
            mosaic.add(lens, picture, map_from_vehicle=pose, distance=(args.nearest, 60), name=str(number))
        grid = mosaic.window(X, Y)
        truth, seen = averaged(road, grid), mosaic.layers(X, Y, names="count")["count"] >= 3
        row = {
            blend: decibels(mosaic.image(X, Y, blend=blend), truth, seen)
            for blend in ("mean", "best", "feathered", "weighted", "robust")
        }
        mosaic.refine(frames, distance=(args.nearest, 60))
        row["refined"] = decibels(mosaic.image(X, Y), truth, seen)
        rows.append(row)
        print(f"seed {seed}  " + "  ".join(f"{blend} {value:.2f}" for blend, value in row.items()), flush=True)
    print("mean    " + "  ".join(f"{blend} {np.mean([row[blend] for row in rows]):.2f}" for blend in rows[0]))


def ring(args: argparse.Namespace) -> None:
    """Measure the seams between cameras."""
    cameras = ring_of(args.kind)
    for seed in range(args.seeds):
        road, random = Road(seed), np.random.default_rng(seed)
        mosaic = ipm_rs.Mosaic(args.cells)
        alone = {name: ipm_rs.Mosaic(args.cells) for name in cameras}
        for number in range(8):
            pose = bend(number)
            images = {}
            for name, camera in cameras.items():
                images[name] = photographed(camera, road, pose, random, own_car=True)
                alone[name].add(camera, images[name], map_from_vehicle=pose, distance=(0, 15))
            mosaic.add(cameras, images, map_from_vehicle=pose, distance=(0, 15))
        x, y = (-6.0, 18.0), (-7.0, 8.0)
        grid = mosaic.window(x, y)
        layers = mosaic.layers(x, y, names=("weighted", "mask"))
        residual = layers["weighted"] - averaged(road, grid)
        best = np.stack([one.layers(x, y, names="density")["density"] for one in alone.values()]).argmax(0)
        sizes = round(0.25 / args.cells), round(1.0 / args.cells)
        beside = np.roll(best, 2 * [round(1.5 / args.cells)], (0, 1))  # lines like the seams, where there is none
        for where, owner in (("of seams", best), ("beside them", beside)):
            steps = steps_at_seams(residual, owner, layers["mask"], *sizes)
            print(
                f"{args.kind} seed {seed}  {len(steps)} metres {where}  step {np.sqrt(np.mean(steps**2)):.2f} rms, "
                f"{np.quantile(np.abs(steps), 0.95):.2f} at 95 %, {np.abs(steps).max():.2f} at most",
                flush=True,
            )


def steps_at_seams(residual: np.ndarray, owner: np.ndarray, mask: np.ndarray, depth: int, length: int) -> np.ndarray:
    """Return by how much the error's mean differs between the two sides of each metre of seams, `depth` cells deep."""
    found: dict[tuple[int, int, int], list[float]] = {}
    for axis in (0, 1):
        owners, errors, known = (np.moveaxis(array, axis, 0) for array in (owner, residual, mask))
        for at in range(depth, len(owners) - depth):
            here = (owners[at] != owners[at - 1]) & known[at - depth : at + depth].all(0)
            for column in np.flatnonzero(here):
                step = errors[at : at + depth, column].mean() - errors[at - depth : at, column].mean()
                place = (at, column) if axis == 0 else (column, at)
                sign = 1 if owners[at, column] > owners[at - 1, column] else -1
                found.setdefault((axis, place[0] // length, place[1] // length), []).append(sign * step)
    return np.array([np.mean(steps) for steps in found.values() if len(steps) >= length // 2])


def kitti(args: argparse.Namespace) -> None:
    """Map a real drive."""
    folder = Path(args.path)
    K = np.loadtxt(folder / "calib.txt")[0].reshape(3, 4)[:, :3]
    poses = np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)[:51]
    images = [np.asarray(Image.open(folder / "image_l" / f"{index:06d}.png")) for index in range(len(poses))]
    nominal = ipm_rs.Camera.from_euler(K, image_size=images[0].shape[1::-1], position=(0, 0, 1.65))
    found = refine.from_drive(nominal, images, poses, poses_of="camera", per_frame=True)
    whole = [np.vstack([pose, [0, 0, 0, 1]]) for pose in poses]
    # the first camera's axes become a vehicle's, below it on the road
    upright = nominal.with_pose(nominal.camera_from_vehicle).vehicle_from_camera
    vehicles = [upright @ pose @ np.linalg.inv(upright) for pose in whole]
    frames = [(found.camera_at(number), images[number], vehicles[number]) for number in range(len(poses))]
    mosaic = ipm_rs.Mosaic(0.05)
    for camera, image, pose in frames:
        mosaic.add(camera, image, map_from_vehicle=pose, ground="wheels", distance=(4, 25))
    scores = []
    for camera, image, pose in frames[:40]:
        x, y, _ = pose[:3, 3]
        (x, y) = np.round((pose @ [7.0, 0, 0, 1])[:2] / 0.05) * 0.05
        limits = (x - 3, x + 3), (y - 2, y + 2)
        grid = mosaic.window(*limits)
        there = camera.with_pose(camera.camera_from_vehicle @ np.linalg.inv(pose), nearest_rotation=True)
        plane = ipm_rs.Plane(normal=(0, 0, 1)).transformed(pose)
        table = ipm_rs.Lut(there, grid, ground=plane)
        both = table.mask & mosaic.layers(*limits, names="mask")["mask"]
        view, known = table.warp(image, interpolation="area"), mosaic.image(*limits)
        scores.append(np.corrcoef(view[both], known[both])[0, 1])
    print(f"frames and map, 4 to 10 m ahead: mean correlation {np.mean(scores):.3f}, least {np.min(scores):.3f}")
    layers = mosaic.layers(names=("refined", "mask"))
    page = ipm_rs.draw.axes(
        layers["refined"], mosaic.window(), mask=layers["mask"], track=[pose[:2, 3] for pose in vehicles]
    )
    if args.picture:
        page.save(args.picture)


def noise_frame(number: int) -> tuple[ipm_rs.Camera, np.ndarray, np.ndarray]:
    """Return a camera, a picture of noise, and where it was taken."""
    camera = ipm_rs.Camera.from_euler(
        [[240, 0, 159.5], [0, 240, 89.5], [0, 0, 1]], image_size=(320, 180), position=(1, 0, 1.4), pitch=0.15
    )
    return camera, np.random.default_rng(number).integers(0, 256, (180, 320), np.uint8), bend(number, step=2.0)


def add_noise(path: str | None, frames: int, *, aloud: bool = False) -> ipm_rs.Mosaic:
    """Add frames of noise to a map, and say which."""
    mosaic = ipm_rs.Mosaic(0.1, tile=64, path=path, memory=0, samples=4)
    for number in range(frames):
        camera, image, pose = noise_frame(number)
        mosaic.add(camera, image, map_from_vehicle=pose, distance=(1, 12), name=f"{number:06d}")
        if number % 4 == 3:
            mosaic.commit()
        if aloud:
            print(number, flush=True)
    return mosaic


def kills(args: argparse.Namespace) -> None:
    """Kill a run again and again, and compare its map with that of one without a break."""
    frames, random = 120, np.random.default_rng(0)
    whole = add_noise(None, frames)
    with tempfile.TemporaryDirectory() as folder:
        killed = there = 0
        while killed < args.times:
            child = subprocess.Popen(
                [sys.executable, __file__, "child", "--path", folder, "--frames", str(frames)], stdout=subprocess.PIPE
            )
            assert child.stdout is not None
            reached = there + random.integers(1, 9)
            while (line := child.stdout.readline()) and int(line) < min(reached, frames - 1):
                pass
            time.sleep(random.uniform(0, 0.03))
            if child.poll() is None:
                child.send_signal(signal.SIGKILL)
                killed += 1
            child.wait()
            child.stdout.close()
            with ipm_rs.Mosaic.load(folder) as mosaic:
                there = mosaic.frames
            print(f"killed {killed} times: {there} frames are there", flush=True)
        with add_noise(folder, frames) as mosaic:
            names = ("weighted", "best", "mean", "robust", "feathered", "std", "count", "density")
            one, other = (each.layers(names=names) for each in (whole, mosaic))
            assert mosaic.frames == frames
            assert all((one[name] == other[name]).all() for name in names)
    print(f"the map is the one of a run without a break, to the last bit, of {frames} frames and {len(names)} layers")


def ray(args: argparse.Namespace) -> None:
    """Map a drive on clusters."""
    import ray

    frames, names = (
        min(args.frames, 200),
        ("weighted", "best", "mean", "robust", "feathered", "std", "count", "density"),
    )
    whole = add_noise(None, frames).layers(names=names)

    def shown() -> Iterator[tuple[ipm_rs.Camera, Callable[[], np.ndarray], np.ndarray, str]]:
        for number in range(frames):
            camera, picture, pose = noise_frame(number)
            yield camera, partial(late, picture), pose, f"{number:06d}"

    for workers, lost in ((1, False), (2, False), (4, False), (2, True)):
        ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
        mosaic, killer = ipm_rs.Mosaic(0.1, tile=64, samples=4), Killer(frames // 3 if lost else frames + 1)
        begin = time.perf_counter()
        added = ipm_rs.ray.mosaic(shown(), mosaic, distance=(1, 12), stretch=5, report=killer.report)
        took = time.perf_counter() - begin
        found = mosaic.layers(names=names)
        assert added == mosaic.frames == frames and bool(killer.killed) == lost
        assert all((whole[name] == found[name]).all() for name in names)
        what = f"{workers} worker{'s' * (workers > 1)}{', one killed in the middle' * lost}"
        print(f"{what}: {frames} frames in {took:.1f} s, {len(names)} layers equal those of one process", flush=True)
        ray.shutdown()


class Killer:
    """Kills a worker, once, when so many frames are merged."""

    def __init__(self, after: int) -> None:
        self.left, self.killed = after, 0

    def report(self, count: int, _: list[ipm_rs.IpmError]) -> None:
        """Note a stretch that is merged."""
        self.left -= count
        if self.left <= 0 and not self.killed:
            self.killed = workers_of_mine("_added")[0]
            os.kill(self.killed, signal.SIGKILL)


def late(picture: np.ndarray) -> np.ndarray:
    """Return a picture as a slow disk does."""
    time.sleep(0.05)
    return picture


def kitti_frame() -> tuple[ipm_rs.Camera, np.ndarray]:
    """Return a camera and a grey picture of the size of KITTI's."""
    camera = ipm_rs.Camera.from_euler(
        [[707, 0, 602], [0, 707, 183], [0, 0, 1]], image_size=(1226, 370), position=(0, 0, 1.65), pitch=0.02
    )
    rough = np.random.default_rng(0).integers(0, 256, (93, 307), np.uint8)
    return camera, np.asarray(Image.fromarray(rough).resize((1226, 370), Image.Resampling.BICUBIC))


def long(args: argparse.Namespace) -> None:
    """Drive on and on."""
    camera, picture = kitti_frame()
    with tempfile.TemporaryDirectory() as folder:
        mosaic = ipm_rs.Mosaic(0.05, path=folder, memory=128 << 20)
        begin, since, marks = time.process_time(), 0, {10**k * m for k in range(2, 7) for m in (1, 2, 5)}
        for number in range(1, args.frames + 1):
            pose = np.eye(4)
            pose[:2, 3] = args.step * number, 20 * np.sin(args.step * number / 300)
            mosaic.add(camera, picture, map_from_vehicle=pose, distance=(4, 20), name=f"{number:08d}")
            if number in marks or number == args.frames:
                spent = 1e3 * (time.process_time() - begin) / (number - since)
                held = f"{resident():.0f} MB resident, {mosaic.nbytes / 1e6:.0f} of them tiles"
                print(
                    f"{number} frames  {args.step * number / 1000:.2f} km  {spent:.2f} ms of CPU a frame  {held}",
                    flush=True,
                )
                begin, since = time.process_time(), number
        mosaic.close()
        size = sum(entry.stat().st_size for entry in Path(folder).rglob("*") if entry.is_file())
        print(f"on disk {size / 1e6:.0f} MB, {size / args.step / args.frames * 1000 / 1e6:.0f} MB a kilometre")


def cheapest(work: Callable[[], object], times: int) -> float:
    """Return the least milliseconds of CPU time."""
    spent = []
    for _ in range(times):
        begin = time.process_time()
        work()
        spent.append(time.process_time() - begin)
    return 1e3 * min(spent)


def city(args: argparse.Namespace) -> None:
    """Time the stages of a run by stretches, and say what they are for a city."""
    camera, picture = kitti_frame()
    png = io.BytesIO()
    Image.fromarray(picture).save(png, "PNG")
    decode = cheapest(lambda: np.asarray(Image.open(io.BytesIO(png.getvalue()))), 20)
    tasks, stretch = 6, 50
    with tempfile.TemporaryDirectory() as folder:
        whole = ipm_rs.Mosaic(0.05, path=folder, memory=512 << 20)
        add = merge = 0.0
        for task in range(tasks):
            part = ipm_rs.Mosaic(0.05)
            for number in range(task * stretch, (task + 1) * stretch):
                pose = np.eye(4)
                pose[0, 3] = float(number)
                begin = time.process_time()
                part.add(camera, picture, map_from_vehicle=pose, distance=(4, 20), name=f"{number:08d}")
                add += time.process_time() - begin
            begin = time.process_time()
            whole.merge(part)
            whole.commit()
            merge += time.process_time() - begin
            sent = part.nbytes
        whole.close()
        size = sum(entry.stat().st_size for entry in Path(folder).rglob("*") if entry.is_file())
    add, merge = (1e3 * spent / tasks / stretch for spent in (add, merge))
    hours = args.frames * (decode + add + merge) / 3.6e6
    metre = size / tasks / stretch
    print(f"a frame: decode {decode:.1f} ms, add {add:.1f} ms, merge and write {merge:.1f} ms of CPU")
    print(
        f"a stretch of {stretch} frames sends {sent / 1e6:.0f} MB; the map has {metre / 1e3:.0f} kB a metre of street"
    )
    merging = args.frames * merge / 3.6e6
    print(
        f"{args.frames} frames, one for each metre of street: {hours:.1f} hours of one core, {60 * hours / 64:.0f} min "
        f"of 64; {merging:.1f} hours of it are merging; {metre * args.frames / 1e9:.0f} GB"
    )


def child(args: argparse.Namespace) -> None:
    """Be the run that is killed."""
    add_noise(args.path, args.frames, aloud=True).close()


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = {
        "sharp": sharp,
        "ring": ring,
        "kitti": kitti,
        "kills": kills,
        "ray": ray,
        "long": long,
        "city": city,
        "child": child,
    }
    parser.add_argument("what", choices=kinds)
    parser.add_argument("kind", nargs="?", default="pinhole6", choices=("pinhole6", "fisheye4"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--cells", type=float, default=0.05)
    parser.add_argument("--nearest", type=float, default=5.0)
    parser.add_argument("--nods", type=float, default=0.0)
    parser.add_argument("--cars", action="store_true")
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--frames", type=int, default=5000)
    parser.add_argument("--step", type=float, default=1.0)
    parser.add_argument("--path")
    parser.add_argument("--picture")
    args = parser.parse_args()
    if args.what == "city" and args.frames == 5000:
        args.frames = 1_000_000
    kinds[args.what](args)


if __name__ == "__main__":
    main()
