"""Small stacks: a thread of 32 KiB, the least that Python allows, is enough for every call."""

from __future__ import annotations

import subprocess
import sys

import pytest
from test_interrupts import SETUP

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="stacks of 32 KiB as Linux has them"),
]

CALLS = {
    "Lut": "ipm_rs.Lut(camera, small)",
    "Lut behind a lens": "[ipm_rs.Lut(camera_behind(lens), small) for lens in lenses]",
    "Lut on a height map": "ipm_rs.Lut(bent, small, ground=road)",
    "Lut.from_homography": "ipm_rs.Lut.from_homography(np.eye(3), size=(300, 200), source_size=(64, 64))",
    "Lut.from_ground_points": "ipm_rs.Lut.from_ground_points(*pairs, small, source_size=(64, 64))",
    "pickle": "pickle.loads(pickle.dumps(lut))",
    "arrays of a table": "lut.mask, lut.maps(), lut.sampling_density(), lut.resolved_mask()",
    **{
        f"warp, {kind}": "[lut.warp(image[..., :c].astype(t), interpolation=KIND, border_value=1)"
        " for c in (1, 2, 3) for t in TYPES], lut.warp(many, interpolation=KIND)".replace("KIND", repr(kind)).replace(
            "TYPES", "('uint8', 'uint16')" if kind == "mode" else "('uint8', 'int16', 'float16', 'float32', 'float64')"
        )
        for kind in ("nearest", "bilinear", "area", "mode")
    },
    "warp, planes": "lut.warp(np.ascontiguousarray(image.transpose(2, 0, 1)), layout='CHW', threads=4)",
    "remap": "[ipm_rs.remap(image, maps, maps, interpolation=k, border_mode=m)"
    " for k in ('nearest', 'bilinear', 'cubic', 'lanczos4')"
    " for m in ('constant', 'replicate', 'reflect', 'reflect_101', 'wrap')]",
    "warp_perspective": "ipm_rs.warp_perspective(image, np.eye(3), (300, 200))",
    "project": "[camera_behind(lens).project(points) for lens in lenses], camera.project(points[::2])",
    "project on the ground": "camera.project(points[:, :2].copy(), ground=road)",
    "unproject": "[camera_behind(lens).unproject(points[:, :2].copy()) for lens in lenses]",
    "pixels": "bent.ground_from_pixels(uv), bent.ground_range(uv), bent.range_error(uv), bent.row_ranges()",
    "pixels on heights": "bent.ground_from_pixels(uv, ground=road), bent.cells_from_pixels(uv, small, ground=road)",
    "cells": "camera.pixels_from_cells(uv, small), small.xy(), small.cell_from_ground(uv), small.ground_from_cell(uv)",
    "project_polyline": "[camera_behind(lens).project_polyline(points[:99]) for lens in lenses]",
    "project_polyline on a height map": "bent.project_polyline(points[:9, :2].copy(), ground=road)",
    "horizon": "[camera_behind(lens).horizon() for lens in lenses], camera.horizon_line()",
    "cameras": "camera.resized(320, 240).cropped(9, 9, 99, 99).binned(3).rotated180().mirrored()",
    "from_vanishing_point": "ipm_rs.Camera.from_vanishing_point((320, 200), **vanishing)",
    "points of the ground": "ipm_rs.homography_from_points(*pairs), ipm_rs.vanishing_point(rng.random((9, 2, 2)))",
    "HeightMap": "road.height_at(uv), ipm_rs.HeightMap(depth[:9], origin=(0, 0), spacing=(1, 1))",
    "geometry": "ipm_rs.flip_handedness(points), ipm_rs.flip_handedness_pose(np.eye(4))",
    "carla depth": "ipm_rs.decode_carla_depth(image, order='rgb'), ipm_rs.encode_carla_depth(depth)",
    "points_from_depth": "[ipm_rs.points_from_depth(depth, camera_behind(lens), kind=k, compact=c) for lens in lenses"
    " for k in ('z', 'ray') for c in (True, False)]",
    "PixelRays": "ipm_rs.points_from_depth(depth, ipm_rs.PixelRays(bent))",
    "depth_to_lidar": "ipm_rs.depth_to_lidar(depth, 640, 480, K), ipm_rs.depth_to_local_point_cloud(depth, 90)",
    "render_points": "[ipm_rs.render_points(p, camera_behind(lens), radius=r, values=points) for lens in lenses"
    " for r in (0, 2) for p in (points, points[::-1], points.astype('f4'))], ipm_rs.render_points(wide_points, bent)",
    "rasterize": "ipm_rs.rasterize(points, small, reduce=layers, slices=(0, 1, 2)),"
    " ipm_rs.rasterize(points, small, values=points, threads=4)",
    "rasterize_boxes": "ipm_rs.rasterize_boxes(np.ones((9, 5)), small), ipm_rs.rasterize_polygons([flat], small)",
    "cpu_info": "ipm_rs.cpu_info()",
}


@pytest.mark.parametrize("call", CALLS)
def test_a_stack_of_32_kib_is_enough(call):
    code = f"""{SETUP}
    import pickle, threading
    ipm_rs.set_num_threads(4)
    lenses = [None, ipm_rs.BrownConrady([-0.1, 0.02, 1e-3, -1e-3, 1e-3]), ipm_rs.KannalaBrandt([0.02, -0.004, 0, 0]),
              ipm_rs.Mei(0.8, [-0.1, 0.01, 0, 0]), ipm_rs.DoubleSphere(-0.2, 0.5), ipm_rs.Eucm(0.6, 1.1),
              ipm_rs.BrownConrady([0.1, 0.02, 1e-3, -1e-3, 1e-3, 0.2, 0.01, 0.01])]
    camera_behind = lambda lens: ipm_rs.Camera.from_euler(K, image_size=(640, 480), position=(0, 0, 1.5), pitch=0.1,
                                                          lens=lens)
    small = ipm_rs.BevGrid(x=(4, 24), y=(-8, 8), resolution=0.05)
    lut = ipm_rs.Lut(camera, small)
    many = np.zeros((480, 640, 9), np.uint8)
    maps = np.linspace(-9, 700, 40000).reshape(200, 200)
    points = rng.uniform((4, -3, 0), (20, 3, 2), (50_000, 3))
    wide_points = rng.uniform((4, -3, 0, 0, 0, 0, 0), (20, 3, 2, 1, 1, 1, 1), (9_000, 7))
    uv = rng.uniform(0, 470, (3000, 2))
    layers = ("count", "density", "min", "max", "mean", "last", "top")
    vanishing = dict(image_size=(640, 480), focal_length=500, height=1)
    flat = points[:99, :2].copy()
    depth = np.full((480, 640), 0.5, np.float32)
    road = ipm_rs.HeightMap(rng.uniform(-.1, .1, (60, 60)), origin=(3, -10), spacing=(0.4, 0.4))
    pairs = [[0, 0], [9, 0], [2, 9], [7, 9]], [[9, 5], [9, -5], [4, 2], [4, -2]]
    said = []
    def work():
        try:
            {CALLS[call]}
            said.append("done")
        except BaseException as error:
            said.append(repr(error))
    work()  # what Python itself does once (imports, say) may need more
    threading.stack_size(32 * 1024)
    worker = threading.Thread(target=work)
    worker.start()
    worker.join()
    print(said)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, f"{done.returncode} {done.stderr}"
    assert done.stdout.strip() == "['done', 'done']", done.stdout
