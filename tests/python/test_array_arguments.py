"""Arrays as they come: packed, byte-swapped, masked, read-only, misshapen: taken as what they hold, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses, same, textured

import ipm_rs
from ipm_rs import errors, pointfile

K = np.array([[300.0, 0, 160], [0, 300, 120], [0, 0, 1]])
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(320, 240), position=(1.0, 0.2, 1.5), pitch=0.2)
POSE = CAMERA.camera_from_vehicle
GRID = ipm_rs.BevGrid(x=(4, 14), y=(-4, 4), resolution=0.5)
ROAD = ipm_rs.HeightMap(np.zeros((5, 6)), origin=(0, -5), spacing=4.0)
PIXELS = np.array([[150.0, 190], [20, 200], [310, 230], [160, 10]])
POINTS = np.array([[6.0, 1, 0.1], [9, -2, 0.3], [13, 0.5, 0], [7, 3, 1]])
GROUND = POINTS[:, :2].copy()
MAPS = np.mgrid[0:7, 0:9].astype(float) * 1.25
IMAGE = textured(12, 14)
DEPTH = np.linspace(0.01, 0.8, 12).reshape(3, 4)
LENS = ipm_rs.BrownConrady([0.1, -0.02, 0.001, 0.002])
HOMOGRAPHY = np.array([[1.1, 0.02, -3], [0.01, 0.9, 2], [1e-4, 0, 1]])
SQUARE = np.array([[5.0, -2], [9, -2], [9, 2], [5, 2]])
SEEN = CAMERA.project(SQUARE)[0]

# every argument of real numbers, with a value of float64
TAKEN = {
    "Camera": (lambda a: ipm_rs.Camera(a, image_size=(320, 240)).intrinsics, K),
    "Camera pose": (lambda a: ipm_rs.Camera(K, image_size=(9, 9), camera_from_vehicle=a).position, POSE),
    "vehicle_from_camera": (lambda a: ipm_rs.Camera(K, image_size=(9, 9), vehicle_from_camera=a).position, POSE),
    "with_pose": (lambda a: CAMERA.with_pose(a).position, POSE),
    "lens": (lambda a: ipm_rs.BrownConrady(a).coefficients, np.array([0.1, 0.2, 0, 0])),
    "Ocam": (lambda a: ipm_rs.Ocam(a).polynomial, np.array([200.0, 0, -1e-3])),
    "FTheta": (lambda a: ipm_rs.FTheta(a, "forward").polynomial, np.array([0.0, 200.0, -1e-3])),
    "project": (lambda a: CAMERA.project(a)[0], POINTS),
    "project on the road": (lambda a: CAMERA.project(a)[0], GROUND),
    "unproject": (CAMERA.unproject, PIXELS),
    "ground_from_pixels": (CAMERA.ground_from_pixels, PIXELS),
    "ground_range": (CAMERA.ground_range, PIXELS),
    "range_error": (lambda a: CAMERA.range_error(a)[0], PIXELS),
    "pixels_from_cells": (lambda a: CAMERA.pixels_from_cells(a, GRID)[0], PIXELS / 20),
    "cells_from_pixels": (lambda a: CAMERA.cells_from_pixels(a, GRID), PIXELS),
    "project_polyline": (lambda a: CAMERA.project_polyline(a)[0], POINTS),
    "cell_from_ground": (GRID.cell_from_ground, GROUND),
    "ground_from_cell": (GRID.ground_from_cell, GROUND),
    "HeightMap": (lambda a: ipm_rs.HeightMap(a, origin=(0, 0), spacing=1.0).heights, DEPTH),
    "on_grid": (lambda a: ipm_rs.HeightMap.on_grid(a, GRID).heights, np.zeros(GRID.shape)),
    "height_at": (ROAD.height_at, GROUND),
    "from_homography": (
        lambda a: ipm_rs.Lut.from_homography(a, size=(9, 7), source_size=(14, 12)).maps()[0],
        HOMOGRAPHY,
    ),
    "from_maps": (lambda a: ipm_rs.Lut.from_maps(a, MAPS[0], source_size=(14, 12)).maps()[0], MAPS[1]),
    "from_ground_points": (
        lambda a: ipm_rs.Lut.from_ground_points(SEEN, a, GRID, source_size=(320, 240)).maps()[0],
        SQUARE,
    ),
    "homography_from_points": (lambda a: ipm_rs.homography_from_points(a, SQUARE)[0], SEEN),
    "vanishing_point": (ipm_rs.vanishing_point, np.array([[[0.0, 9], [4, 5]], [[9, 9], [5, 5.5]]])),
    "remap": (lambda a: ipm_rs.remap(IMAGE, a, MAPS[0]), MAPS[1]),
    "warp_perspective": (lambda a: ipm_rs.warp_perspective(IMAGE, a, (9, 7)), HOMOGRAPHY),
    "flip_handedness": (ipm_rs.flip_handedness, POINTS),
    "flip_handedness_rotation": (ipm_rs.flip_handedness_rotation, POSE[:3, :3].copy()),
    "flip_handedness_pose": (ipm_rs.flip_handedness_pose, POSE),
    "rasterize": (lambda a: ipm_rs.rasterize(a, GRID)["max"], POINTS),
    "rasterize values": (lambda a: ipm_rs.rasterize(POINTS, GRID, a)["max"], np.array([1.0, 5, 2, 9])),
    "rasterize slices": (lambda a: ipm_rs.rasterize(POINTS, GRID, slices=a)["max"], np.array([-1.0, 0.2, 2])),
    "rasterize_boxes": (lambda a: ipm_rs.rasterize_boxes(a, GRID), np.array([[7.0, 0, 3, 2, 0.3]])),
    "rasterize_polygons": (lambda a: ipm_rs.rasterize_polygons([a], GRID), SQUARE),
    "depth_to_lidar": (lambda a: ipm_rs.depth_to_lidar(a, 4, 3, K)[1], DEPTH),
    "depth_to_local_point_cloud": (lambda a: ipm_rs.depth_to_local_point_cloud(a, 90), DEPTH),
    "points_from_depth K": (lambda a: ipm_rs.points_from_depth(DEPTH, a), K),
    "points_from_depth frame": (lambda a: ipm_rs.points_from_depth(DEPTH, K, frame=a), POSE),
    "render_points": (lambda a: ipm_rs.render_points(a, CAMERA)[0], POINTS),
    "render_points values": (lambda a: ipm_rs.render_points(POINTS, CAMERA, values=a)[2], np.array([1.0, 2, 3, 4])),
}


def packed(array: np.ndarray) -> np.ndarray:
    """The array at an odd address, contiguous: a field behind one of a byte."""
    row = np.zeros(1, [("tag", "u1"), ("value", array.dtype, array.shape)])
    row["value"] = array
    field = row["value"][0]
    assert field.flags.c_contiguous and not field.flags.aligned
    return field


def one_by_one(array: np.ndarray) -> np.ndarray:
    """The array in memory whose elements are 11 bytes apart."""
    records = np.zeros(array.shape, [("tag", "u1"), ("value", array.dtype), ("end", "u2")])
    records["value"] = array
    return records["value"]


FORMS = {
    "packed": packed,
    "packed one by one": one_by_one,
    "byte-swapped": lambda a: a.astype(a.dtype.newbyteorder()),
    "packed and byte-swapped": lambda a: packed(a.astype(a.dtype.newbyteorder())),
    "read-only": lambda a: np.frombuffer(a.tobytes(), a.dtype).reshape(a.shape),
    "fortran": np.asfortranarray,
    "backwards": lambda a: a[::-1].copy()[::-1],
    "every second": lambda a: np.repeat(a, 2, axis=0)[::2],
    "nothing masked": np.ma.MaskedArray,
    "subclass": lambda a: a.view(type("Sub", (np.ndarray,), {})),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", TAKEN)
def test_numbers_are_taken_as_what_they_hold(name, form):
    call, array = TAKEN[name]
    argument = FORMS[form](array)
    before = argument.tobytes()
    got = call(argument)
    assert np.array_equal(np.asarray(got), np.asarray(call(array)), equal_nan=True)
    assert argument.tobytes() == before, "the argument was written to"


@pytest.mark.parametrize("dtype", ["int16", "uint8", "float16", "float32", "longdouble", ">i4", "bool"])
@pytest.mark.parametrize("name", ["project", "unproject", "cell_from_ground", "height_at", "render_points"])
def test_other_real_dtypes_of_packed_points(name, dtype):
    call, array = TAKEN[name]
    array = array.astype(dtype)
    assert np.array_equal(np.asarray(call(one_by_one(array))), np.asarray(call(array)), equal_nan=True)


@pytest.mark.parametrize("name", TAKEN)
def test_a_mask_is_not_dropped(name):
    call, array = TAKEN[name]
    masked = np.ma.masked_equal(array, array.flat[0])
    with refuses(errors.IpmError, "masked", ".filled("):
        call(masked)


def test_a_mask_within_a_list_or_behind_another_object():
    rows = [np.ma.masked_equal(row, 1) for row in POINTS]
    with refuses(errors.ArgumentError, "points", "masked"):
        CAMERA.project(rows)
    with refuses(errors.ArgumentError, "uv", "masked"):
        CAMERA.unproject([[np.ma.masked, 3.0]])

    class Wrapper:
        def __array__(self, dtype=None, copy=None):
            return np.ma.masked_equal(POINTS, 1)

    with refuses(errors.ArgumentError, "points", "masked"):
        ipm_rs.flip_handedness(Wrapper())
    with refuses(errors.IpmError, "masked"):
        ipm_rs.rotation_from_euler(np.ma.masked, 0, 0)
    with refuses(errors.IpmError, "masked"):
        ipm_rs.BevGrid(x=np.ma.masked_equal([4.0, 9], 9), y=(0, 1), resolution=1)


LUT = ipm_rs.Lut.from_maps(MAPS[1], MAPS[0], source_size=(14, 12))
DEPTH_CODE = textured(6, 7, 4)
IMAGES = {
    "warp": (lambda a: LUT.warp(a), textured(12, 14, 3, "uint16")),
    "remap": (lambda a: ipm_rs.remap(a, MAPS[1], MAPS[0]), textured(12, 14, None, "float32")),
    "warp_perspective": (lambda a: ipm_rs.warp_perspective(a, HOMOGRAPHY, (9, 7)), textured(12, 14, None, "uint16")),
    "points_from_depth": (lambda a: ipm_rs.points_from_depth(a, K), DEPTH),
    "encode_carla_depth": (ipm_rs.encode_carla_depth, DEPTH),
}


@pytest.mark.parametrize("name", IMAGES)
def test_images_are_borrowed_or_refused(name):
    """Never copied: what cannot be read where it lies is refused, with what to do."""
    call, image = IMAGES[name]
    want = call(image)
    for mended, odd, words in (
        (lambda a: a.copy(), packed(image), ("packed", ".copy()")),
        (lambda a: a.copy(), one_by_one(image), ("packed", ".copy()")),
        (
            lambda a: a.astype(a.dtype.newbyteorder("=")),
            image.astype(image.dtype.newbyteorder()),
            ("byte order", "astype"),
        ),
        (np.ascontiguousarray, image[:, ::-1], ("adjacent", "ascontiguousarray")),
        (np.ascontiguousarray, np.broadcast_to(image[:1, :1], image.shape), ("adjacent", "ascontiguousarray")),
        (lambda a: a.filled(3), np.ma.masked_equal(image, image[2, 3].max()), ("masked", ".filled(")),
    ):
        with refuses(errors.IpmError, *words):
            call(odd)
        assert same(call(mended(odd)), call(mended(odd).copy())), "the advice does not help"
    assert same(call(np.frombuffer(image.tobytes(), image.dtype).reshape(image.shape)), want), "read-only"
    assert same(call(image[::-1].copy()[::-1]), want), "rows backwards"
    assert same(call(np.ma.MaskedArray(image)), want), "nothing masked"
    for nothing in (image[:0], image[:, :0], image[0, 0, ...].max(), np.array(3)):
        with pytest.raises(errors.IpmError):
            call(nothing)
    with refuses(errors.ArgumentTypeError, "None", "imread"):
        call(None)


def test_huge_images_of_one_pixel_are_refused():
    for shape in ((2**30, 2**30), (2**40, 1), (1, 2**40), (2**20, 2**20, 2**20)):
        for dtype in (np.uint8, np.float32):
            image = np.broadcast_to(np.zeros((), dtype), shape)
            with pytest.raises(errors.IpmError):
                LUT.warp(image)
            with pytest.raises(errors.IpmError):
                ipm_rs.remap(image, np.zeros((2, 2)), np.zeros((2, 2)))
    with pytest.raises(errors.IpmError):
        ipm_rs.points_from_depth(np.broadcast_to(np.float32(1), (2**40, 1)), K)


def test_two_views_of_one_element():
    """rust-numpy would divide by their strides' common divisor, which is 0."""
    memory = np.zeros(16, np.uint8)
    ones = [np.ndarray((1, 1), dtype, memory, strides=(0, 0)) for dtype in ("f4", "u1")]
    got = ipm_rs.points_from_depth(ones[0], K, mask=ones[1])
    assert got.shape == (1, 1, 3) and np.isnan(got).all()
    values = np.broadcast_to(memory[:1], (4,))
    points = np.broadcast_to(memory[:8].view("f8"), (4, 3))
    assert ipm_rs.rasterize(points, ipm_rs.BevGrid(x=(-1, 1), y=(-1, 1), resolution=1), values)["count"].sum() == 4


def test_masked_outputs_are_refused():
    out = np.ma.masked_equal(np.zeros((7, 9), np.uint8), 0)
    with refuses(errors.ArgumentError, "out", "masked"):
        LUT.warp(IMAGE, out=out)
    with refuses(errors.ArgumentError, "out", "masked"):
        ipm_rs.rasterize_boxes([], GRID, out=np.ma.masked_equal(np.zeros(GRID.shape, np.int32), 0))


def test_labels_are_drawn_on_aligned_arrays_only():
    with refuses(errors.ArgumentError, "out", "aligned"):
        ipm_rs.rasterize_boxes([[7, 0, 3, 2, 0]], GRID, out=packed(np.zeros(GRID.shape, np.int32)))
    with refuses(errors.DtypeError, "out", "int32"):
        ipm_rs.rasterize_boxes([[7, 0, 3, 2, 0]], GRID, out=np.zeros(GRID.shape, ">i4"))


def test_a_cloud_where_its_points_are_meant():
    cloud = pointfile.Cloud(POINTS, {})
    for call in (
        lambda: ipm_rs.rasterize(cloud, GRID),
        lambda: CAMERA.project(cloud),
        lambda: ipm_rs.render_points(cloud, CAMERA),
        lambda: ipm_rs.flip_handedness(cloud),
        lambda: CAMERA.project_polyline(cloud),
    ):
        with refuses(errors.ArgumentTypeError, "points", "Cloud", ".points"):
            call()


def test_shapes_that_are_nearly_right_say_the_mend():
    wide = np.zeros((5, 3))
    with refuses(errors.ArgumentError, "uv", "(N, 2)", "uv[:, :2]"):
        CAMERA.unproject(wide)
    with refuses(errors.ArgumentError, "xy", "xy[:, :2]"):
        GRID.cell_from_ground(wide)
    with refuses(errors.ArgumentError, "image_points[:, :2]"):
        ipm_rs.homography_from_points(wide, wide)
    with refuses(errors.ArgumentError, "points", "(N, 3)", "points[:, :3]"):
        CAMERA.project(np.zeros((5, 4)))
    with refuses(errors.ArgumentError, "points", "(N, 3)", "column_stack"):
        ipm_rs.flip_handedness(np.zeros((5, 2)))
    with refuses(errors.ArgumentError, "points", "column_stack"):
        ipm_rs.render_points(np.zeros((5, 2)), CAMERA)
    with refuses(errors.ArgumentError, "uv.reshape(-1, 2)"):
        CAMERA.unproject(np.zeros((5, 1, 2)))
    with refuses(errors.ArgumentError, "points", "points.T"):
        ipm_rs.flip_handedness(np.zeros((3, 7)))
    with refuses(errors.ArgumentError, "points", "points[None]"):
        CAMERA.project([1.0, 2, 3])
    with refuses(errors.ArgumentError, "polygons[0][:, :2]"):
        ipm_rs.rasterize_polygons([np.zeros((4, 3))], GRID)
