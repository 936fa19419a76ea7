"""Camera, BevGrid and Lut as values: immutable, comparable, hashable, and whole after a copy or a pickle."""

from __future__ import annotations

import copy
import pickle

import golden
import numpy as np
import pytest
from helpers import same, textured

import ipm_rs
from ipm_rs import errors

PROTOCOLS = range(pickle.HIGHEST_PROTOCOL + 1)


def camera(**changes) -> ipm_rs.Camera:
    arguments = {"image_size": golden.IMAGE_SIZE, "camera_from_vehicle": golden.ORDER_RT, **changes}
    return ipm_rs.Camera(arguments.pop("K", golden.K), **arguments)


def grid(**changes) -> ipm_rs.BevGrid:
    return ipm_rs.BevGrid(**{"x": (7, 12), "y": (-2, 2), "resolution": (0.5, 0.25), "sample_at": "corner", **changes})


def lut(**changes) -> ipm_rs.Lut:
    map_x, map_y = np.meshgrid(np.linspace(-2.0, 9.3, 12), np.linspace(-2.0, 5.1, 9))
    arguments = {"map_x": map_x, "map_y": map_y, "source_size": (8, 4), **changes}
    return ipm_rs.Lut.from_maps(arguments["map_x"], arguments["map_y"], source_size=arguments["source_size"])


MAKERS = {"Camera": camera, "BevGrid": grid, "Lut": lut}
EACH = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)


def moved(by: float) -> np.ndarray:
    pose = golden.ORDER_RT.copy()
    pose[0, 3] += by
    return pose


def nudged_map() -> np.ndarray:
    map_x = np.meshgrid(np.linspace(-2.0, 9.3, 12), np.linspace(-2.0, 5.1, 9))[0].copy()
    map_x[4, 5] += 0.001
    return map_x


OTHERS = {
    "camera: intrinsics": (camera, {"K": golden.K + np.diag([1e-12 * golden.FX, 0, 0])}),
    "camera: size": (camera, {"image_size": (2048, 1025)}),
    "camera: pose": (camera, {"camera_from_vehicle": moved(1e-12)}),
    "grid: x": (grid, {"x": (7.5, 12)}),
    "grid: y": (grid, {"y": (-2, 2.25)}),
    "grid: shifted": (grid, {"y": (-2.25, 1.75)}),
    "grid: resolution": (grid, {"resolution": (0.25, 0.25)}),
    "grid: sampling": (grid, {"sample_at": "center"}),
    "lut: source": (lut, {"source_size": (9, 4)}),
    "lut: maps": (lut, {"map_x": nudged_map()}),
}


@EACH
def test_equal_if_made_alike(make):
    one, other = make(), make()
    assert one is not other
    assert one == other and not one != other
    assert one == one


@pytest.mark.parametrize("name", OTHERS)
def test_different_in_any_part(name):
    make, changes = OTHERS[name]
    one, other = make(), make(**changes)
    assert one != other and not one == other


@EACH
@pytest.mark.parametrize("other", [None, 3, "x", object(), (1, 2), golden.K[0, 0]])
def test_never_equal_to_something_else(make, other):
    one = make()
    assert one != other and not one == other
    assert other != one


def test_never_equal_to_one_another():
    assert camera() != grid() and grid() != lut() and lut() != camera()


@EACH
def test_no_order(make):
    with pytest.raises(TypeError):
        _ = make() < make()


@pytest.mark.parametrize("make", [camera, grid], ids=["Camera", "BevGrid"])
def test_hash_goes_with_equality(make):
    assert hash(make()) == hash(make())
    others = [m(**changes) for m, changes in OTHERS.values() if m is make]
    assert len(others) >= 3
    assert len({make(), make(), *others}) == 1 + len(others)
    assert {make(): "found"}[make()] == "found"


def test_zeros_of_both_signs_are_one_value():
    plus, minus = grid(y=(0.0, 2.0)), grid(y=(-0.0, 2.0))
    assert plus == minus and hash(plus) == hash(minus)
    pose = golden.RT.copy()
    pose[0, 2] = -0.0
    plus, minus = camera(camera_from_vehicle=golden.RT), camera(camera_from_vehicle=pose)
    assert plus == minus and hash(plus) == hash(minus)


@EACH
def test_attributes_cannot_be_set(make):
    one = make()
    public = [name for name in dir(one) if not name.startswith("_")]
    assert len(public) >= 4
    for name in [*public, "anything"]:
        with pytest.raises((AttributeError, TypeError)):
            setattr(one, name, 1)
        with pytest.raises((AttributeError, TypeError)):
            delattr(one, name)
    assert one == make()


@EACH
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_pickle(make, protocol):
    one = make()
    other = pickle.loads(pickle.dumps(one, protocol))
    assert type(other) is type(one)
    assert other == one and repr(other) == repr(one)


@EACH
@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy])
def test_copy(make, duplicate):
    one = make()
    assert duplicate(one) == one


def test_a_pickled_camera_is_the_same_bit_for_bit():
    one = ipm_rs.Camera.from_cityscapes(golden.CALIBRATION)
    other = pickle.loads(pickle.dumps(one))
    for name in ("intrinsics", "camera_from_vehicle", "vehicle_from_camera", "position"):
        assert same(getattr(one, name), getattr(other, name))
    for ours, theirs in zip(one.project(golden.SAMPLE_POINTS), other.project(golden.SAMPLE_POINTS), strict=True):
        assert same(ours, theirs)


def test_a_camera_given_the_other_way_round_survives_too():
    one = ipm_rs.Camera(golden.K, image_size=golden.IMAGE_SIZE, vehicle_from_camera=np.linalg.inv(golden.ORDER_RT))
    other = pickle.loads(pickle.dumps(one))
    assert other == one
    assert same(other.camera_from_vehicle, one.camera_from_vehicle)
    assert same(other.vehicle_from_camera, one.vehicle_from_camera)


def test_a_pickled_grid_keeps_its_cells():
    one = grid(sample_at="center")
    other = pickle.loads(pickle.dumps(one))
    assert other.shape == one.shape and same(other.xy(), one.xy()) and other.sample_at == "center"


def test_a_pickled_lut_warps_alike():
    one = lut()
    other = pickle.loads(pickle.dumps(one))
    image = textured(4, 8, 3)
    assert same(one.warp(image, border_value=9), other.warp(image, border_value=9))
    assert same(one.mask, other.mask)
    assert other.source_size == (8, 4) and other.shape == (9, 12) and other.nbytes == one.nbytes


def test_a_pickled_lut_is_no_larger_than_its_table(seed_lut):
    data = pickle.dumps(seed_lut, pickle.HIGHEST_PROTOCOL)
    assert len(data) < seed_lut.nbytes + 10_000
    assert pickle.loads(data) == seed_lut


# ---------------------------------------------------------------------------------------------------------------------
# Damage


def parts(one: ipm_rs.Lut):
    """(callable, arguments, place of the bytes) of the pickle."""
    rebuild, arguments, *state = one.__reduce__()
    assert not [s for s in state if s is not None], "a Lut is rebuilt whole, not filled in later"
    places = [index for index, value in enumerate(arguments) if isinstance(value, bytes)]
    assert len(places) == 1
    return rebuild, list(arguments), places[0]


def test_damaged_tables_are_refused_or_at_least_harmless():
    """Every byte of a small table, several bits each: a typed error, or a table that still keeps its promises."""
    one = lut()
    rebuild, arguments, place = parts(one)
    good = arguments[place]
    assert rebuild(*arguments) == one
    image = textured(4, 8, 3)
    refused = 0
    for index in range(len(good)):
        for flip in (0x01, 0x80, 0xFF):
            bad = bytearray(good)
            bad[index] ^= flip
            arguments[place] = bytes(bad)
            try:
                other = rebuild(*arguments)
            except errors.LutError as error:
                assert "damaged" in str(error)
                refused += 1
                continue
            assert other != one
            if other.source_size == (8, 4):
                assert other.warp(image, interpolation="nearest").shape[:2] == other.shape
                assert other.warp(image).shape[:2] == other.shape
    assert refused > len(good) // 2


def test_truncated_and_foreign_tables_are_refused():
    rebuild, arguments, place = parts(lut())
    good = arguments[place]
    bad = [good[:length] for length in range(len(good))]
    bad += [good + b"\0", good * 2, b"\0" * len(good), b"\xff" * len(good), good[::-1], b"PK\x03\x04" + good]
    for data in bad:
        arguments[place] = data
        with pytest.raises(errors.LutError, match="damaged"):
            rebuild(*arguments)


def test_headers_that_ask_for_the_whole_memory_are_refused():
    rebuild, arguments, place = parts(lut())
    good = arguments[place]
    refused = 0
    for offset in range(0, 40):
        for value in (0, 0x7FFFFFFF, 0xFFFFFFFF):
            bad = good[:offset] + value.to_bytes(4, "little") + good[offset + 4 :]
            arguments[place] = bad
            try:
                rebuild(*arguments)
            except errors.LutError:
                refused += 1
    assert refused > 60


@pytest.mark.parametrize("data", [None, 3, "text", [1, 2]], ids=repr)
def test_states_that_are_no_bytes(data):
    rebuild, arguments, place = parts(lut())
    arguments[place] = data
    with pytest.raises((TypeError, errors.LutError)):
        rebuild(*arguments)


# ---------------------------------------------------------------------------------------------------------------------
# What a table was built from

SLOPE = ipm_rs.Plane.from_angles(slope=0.03, bank=-0.01, height=-0.2)
BUMPS = ipm_rs.HeightMap(0.05 * np.sin(np.arange(13.0))[:, None] * np.ones(11), origin=(0.0, -10.0), spacing=(5.0, 2.0))


@pytest.mark.parametrize("ground", [0.0, -0.3, SLOPE, BUMPS], ids=["0", "number", "plane", "height map"])
def test_a_lut_knows_its_camera_grid_and_ground(ground):
    camera, grid = (
        ipm_rs.Camera.from_cityscapes(golden.CALIBRATION),
        ipm_rs.BevGrid(x=(6, 46), y=(-7, 9), resolution=0.5),
    )
    lut = ipm_rs.Lut(camera, grid, ground=ground)
    for one in (lut, pickle.loads(pickle.dumps(lut)), copy.deepcopy(lut)):
        assert (one.camera, one.grid, one.ground) == (camera, grid, ground)
        assert type(one.ground) is type(ground)
        assert ipm_rs.Lut(one.camera, one.grid, ground=one.ground) == lut


def test_a_lut_of_maps_knows_no_camera():
    assert [lut().camera, lut().grid, lut().ground] == [None] * 3
    matrix = ipm_rs.Lut.from_homography(np.eye(3), size=(4, 3), source_size=(8, 6))
    for one in (matrix, pickle.loads(pickle.dumps(matrix))):
        assert [one.camera, one.grid, one.ground] == [None] * 3


def test_a_lut_of_pairs_of_points_knows_its_grid_alone():
    camera, grid = (
        ipm_rs.Camera.from_cityscapes(golden.CALIBRATION),
        ipm_rs.BevGrid(x=(6, 46), y=(-7, 9), resolution=0.5),
    )
    road = np.array([[10.0, -3.0], [10.0, 3.0], [30.0, 4.0], [28.0, -5.0]])
    one = ipm_rs.Lut.from_ground_points(camera.project(road)[0], road, grid, source_size=camera.image_size)
    for again in (one, pickle.loads(pickle.dumps(one))):
        assert (again.camera, again.grid, again.ground) == (None, grid, None)


def test_luts_that_sample_alike_are_equal_whatever_they_are_of():
    near = ipm_rs.BevGrid(x=(-9, -6), y=(-2, 2), resolution=0.5)
    cameras = [ipm_rs.Camera.from_euler(golden.K, image_size=(2048, 1024), position=(0, 0, z)) for z in (1.0, 2.0)]
    with pytest.warns(ipm_rs.CalibrationWarning, match="no cell"):
        one, other = (ipm_rs.Lut(camera, near) for camera in cameras)
    assert one == other and one.camera != other.camera


def test_a_forged_pickle_does_not_join_a_table_to_another_camera():
    camera, grid = (
        ipm_rs.Camera.from_cityscapes(golden.CALIBRATION),
        ipm_rs.BevGrid(x=(6, 46), y=(-7, 9), resolution=0.5),
    )
    restore, (data, *scene) = ipm_rs.Lut(camera, grid).__reduce__()
    assert scene == [camera, grid, 0.0] and restore(data, *scene).camera == camera
    for wrong in (
        (camera.resized(512, 256), grid, 0.0),
        (camera, ipm_rs.BevGrid(x=(6, 46), y=(-7, 9), resolution=1.0), 0.0),
    ):
        with pytest.raises(errors.LutError, match="not the table of its camera"):
            restore(data, *wrong)
