"""Where there is no memory: a MemoryError, never the end of the process.

Each call is in a process of its own, forked from one that has made the arguments, which takes half a second.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of memory as Linux has them"),
]

SETUP = """if True:
    import pickle, resource, sys, numpy as np, ipm_rs
    ipm_rs.set_num_threads(THREADS)
    K = [[900, 0, 1023.5], [0, 900, 767.5], [0, 0, 1]]
    camera = ipm_rs.Camera.from_euler(K, image_size=(2048, 1536), position=(0, 0, 1.5), pitch=0.1)
    bent = ipm_rs.Camera.from_euler(K, image_size=(2048, 1536), position=(0, 0, 1.5), pitch=0.1,
                                    lens=ipm_rs.KannalaBrandt([0.02, -0.004, 0, 0]))
    grid = ipm_rs.BevGrid(x=(4, 24), y=(-8, 8), resolution=0.01)
    small = ipm_rs.BevGrid(x=(4, 24), y=(-8, 8), resolution=0.1)
    lut = ipm_rs.Lut(camera, grid)
    image = np.full((1536, 2048, 3), 5, np.uint8)
    depth = np.full((1536, 2048), 5, np.float32)
    pixels = np.zeros((1_500_000, 2)) + 700.0
    points = np.zeros((1_500_000, 3)) + 5.0
    flat = points[:, :2].copy()
    maps = np.zeros((2000, 2000), np.float32)
    heights = np.zeros((1200, 1200))
    road = ipm_rs.HeightMap(np.zeros((4, 4)), origin=(0, -20), spacing=(20, 20))
    tall = ipm_rs.Camera([[9e5, 0, 1], [0, 9e5, 1e6], [0, 0, 1]], image_size=(2, 2_000_000))
    noise = np.random.default_rng(0).random((200_000, 2))
    layers = ("count", "density", "min", "max", "mean", "last", "top")
    out = np.empty((*lut.shape, 3), np.uint8)
    lut.warp(image, out=out)  # what is made once, is made
    def short(call):
        used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + ROOM, resource.getrlimit(resource.RLIMIT_AS)[1]))
        try:
            call()
            said = "done"
        except MemoryError as error:
            said = type(error).__name__
        resource.setrlimit(resource.RLIMIT_AS, [resource.getrlimit(resource.RLIMIT_AS)[1]] * 2)
        return said
"""

CALLS = {
    "Lut": "ipm_rs.Lut(camera, grid)",
    "Lut behind a lens": "ipm_rs.Lut(bent, grid)",
    "Lut on a height map": "ipm_rs.Lut(camera, grid, ground=road)",
    "Lut of one long row": "ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(4, 4.01), y=(-8, 8), resolution=(0.01, 0.00001)))",
    "Lut of one long column": "ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(4, 24), y=(0, 0.01), resolution=(0.00001, 0.01)))",
    "Lut.from_maps": "ipm_rs.Lut.from_maps(maps, maps, source_size=(64, 64))",
    "Lut.from_homography": "ipm_rs.Lut.from_homography(np.eye(3), size=(3000, 2000), source_size=(64, 64))",
    "Lut.from_ground_points": "ipm_rs.Lut.from_ground_points([[0, 0], [9, 0], [2, 9], [7, 9]],"
    " [[9, 5], [9, -5], [4, 2], [4, -2]], grid, source_size=(64, 64))",
    "lut.warp": "lut.warp(image)",
    "lut.warp, nearest": "lut.warp(image, interpolation='nearest')",
    "lut.warp, area": "lut.warp(image, interpolation='area', out=out)",
    "lut.warp, mode": "lut.warp(image, interpolation='mode')",
    "lut.warp, a batch": "lut.warp(np.broadcast_to(image, (2000, *image.shape)), layout='NHWC')",
    "lut.mask": "lut.mask",
    "lut.maps": "lut.maps()",
    "lut.sampling_density": "lut.sampling_density()",
    "lut.resolved_mask": "lut.resolved_mask()",
    "pickle": "pickle.dumps(lut)",
    "remap": "ipm_rs.remap(image, maps, maps)",
    "remap of one long row": "ipm_rs.remap(image[:1, :, 0].copy(), maps.reshape(1, -1), maps.reshape(1, -1))",
    "warp_perspective": "ipm_rs.warp_perspective(image, np.eye(3), (3000, 3000))",
    "project": "camera.project(points)",
    "project on the ground": "camera.project(flat)",
    "unproject": "camera.unproject(pixels)",
    "ground_from_pixels": "camera.ground_from_pixels(pixels)",
    "ground_range": "camera.ground_range(pixels)",
    "range_error": "camera.range_error(pixels)",
    "row_ranges": "tall.row_ranges()",
    "pixels_from_cells": "camera.pixels_from_cells(pixels, grid)",
    "cells_from_pixels": "camera.cells_from_pixels(pixels, grid)",
    "project_polyline": "camera.project_polyline(points)",
    "project_polyline on the ground": "camera.project_polyline(flat, closed=True)",
    "grid.xy": "grid.xy()",
    "grid.cell_from_ground": "grid.cell_from_ground(flat)",
    "grid.ground_from_cell": "grid.ground_from_cell(flat)",
    "HeightMap": "ipm_rs.HeightMap(heights, origin=(0, 0), spacing=(1, 1))",
    "HeightMap.height_at": "road.height_at(flat)",
    "homography_from_points": "ipm_rs.homography_from_points(noise, noise)",
    "vanishing_point": "ipm_rs.vanishing_point(noise.reshape(-1, 2, 2))",
    "flip_handedness": "ipm_rs.flip_handedness(points)",
    "decode_carla_depth": "ipm_rs.decode_carla_depth(image, order='rgb')",
    "encode_carla_depth": "ipm_rs.encode_carla_depth(depth)",
    "points_from_depth": "ipm_rs.points_from_depth(depth, camera)",
    "points_from_depth behind a lens": "ipm_rs.points_from_depth(depth, bent)",
    "points_from_depth, compact": "ipm_rs.points_from_depth(depth, camera, compact=True, values=image)",
    "PixelRays": "ipm_rs.PixelRays(bent)",
    "depth_to_lidar": "ipm_rs.depth_to_lidar(depth, 2048, 1536, K)",
    "depth_to_local_point_cloud": "ipm_rs.depth_to_local_point_cloud(depth / 10, 90, color=image)",
    "render_points": "ipm_rs.render_points(points, camera, values=points)",
    "rasterize": "ipm_rs.rasterize(points, grid)",
    "rasterize, many layers": "ipm_rs.rasterize(points, grid, reduce=layers)",
    "rasterize, many channels": "ipm_rs.rasterize(points[:1000], small, values=np.zeros((1000, 3000), np.float32))",
    "rasterize_boxes": "ipm_rs.rasterize_boxes(np.ones((200_000, 5)), grid)",
    "rasterize_polygons": "ipm_rs.rasterize_polygons([flat], grid)",
}

#: Bytes above what is in use: next to nothing, and enough for the outputs of some and the scratch of others.
ROOMS = [1 << 20, 8 << 20, 24 << 20]

#: Forks for each name that it reads, and prints how the child ended and what it said. The child makes its pool of
#: threads before memory is short.
SERVE = """
    import os
    for name in sys.stdin:
        reader, writer = os.pipe()
        child = os.fork()
        if not child:
            lut.warp(image, out=out)
            os.write(writer, short(lambda: eval(CALLS[name.strip()])).encode())
            os._exit(0)
        os.close(writer)
        status, said = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), os.read(reader, 100).decode()
        os.close(reader)
        print(status, said, flush=True)
"""


@pytest.fixture(scope="module")
def servers() -> Iterator[dict[str, Callable[[str], str]]]:
    """Processes by threads and room, each a function from a call's name to how its child ended."""
    processes = {}
    try:
        for threads, room in [(1, ROOMS[0]), (4, ROOMS[1]), (4, ROOMS[2])]:
            setup = SETUP.replace("THREADS", str(threads)).replace("ROOM", str(room))
            command = [sys.executable, "-c", f"{setup}\n    CALLS = {CALLS}\n{SERVE}"]
            processes[f"{threads} threads, {room} bytes"] = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
        yield {name: lambda call, process=process: ask(process, call) for name, process in processes.items()}
    finally:
        for process in processes.values():
            process.communicate(timeout=60)


FINE = {f"0 {said}" for said in ("done", "MemoryError", "OutOfMemoryError", "_ArrayMemoryError")}


def ask(process: subprocess.Popen, call: str) -> str:
    process.stdin.write(f"{call}\n")
    process.stdin.flush()
    return process.stdout.readline().strip()


@pytest.mark.parametrize("call", CALLS)
def test_a_memory_error_or_the_result(servers, call):
    for server, answer in servers.items():
        said = answer(call)
        assert said in FINE, f"{server}: {said}"


def test_what_needs_more_than_there_is_says_so():
    """Not all of the calls above may just succeed."""
    for call in ("unproject", "row_ranges", "lut.maps", "render_points", "pickle"):
        setup = SETUP.replace("THREADS", "2").replace("ROOM", str(ROOMS[0]))
        code = f"{setup}\n    print(short(lambda: {CALLS[call]}))\n"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip().endswith("MemoryError"), (call, done.stdout)


def test_threads_that_cannot_be_had_are_done_without():
    """No memory for a pool's stacks: fewer threads or none help, and the result is the same."""
    setup = SETUP.replace("THREADS", "48").replace("ROOM", str(6 << 20)).replace("lut.warp(image, out=out)", "pass")
    code = f"""{setup}
    expected = out.copy()
    lut.warp(image, out=expected, threads=1)
    ipm_rs.set_num_threads(47)
    print(short(lambda: lut.warp(image, out=out)), (out == expected).all())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "done True"
