"""`out=` of calls that give rows of numbers: the same numbers, in the arrays that were given, and every mistake refused
before anything is written."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from helpers import refuses, same

import ipm_rs
from ipm_rs import errors

K = [[800.0, 0, 639.5], [0, 800, 359.5], [0, 0, 1]]
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(1280, 720), position=(1.5, 0, 1.4), pitch=0.1)
FISHEYE = ipm_rs.Camera.from_euler(
    [[1, 0, 639.5], [0, 1, 359.5], [0, 0, 1]],
    image_size=(1280, 720),
    position=(1.5, 0, 1.4),
    lens=ipm_rs.Ocam([-340.0, 0.0, 8e-4, -3e-7, 1.2e-9], affine=(1.0, 0.001, -0.0005)),
)
COUNT = 5000
POINTS = np.random.default_rng(3).uniform((-20, -20, -3), (60, 20, 3), (COUNT, 3))
PIXELS = np.random.default_rng(4).uniform((-200, -200), (1500, 900), (COUNT, 2))
ROAD = ipm_rs.HeightMap(np.outer(np.sin(np.arange(80)), np.ones(50)), origin=(-25, -25), spacing=1.0)

ROWS = {
    "unproject": lambda out=None, uv=PIXELS: CAMERA.unproject(uv, out=out),
    "unproject a fisheye": lambda out=None, uv=PIXELS: FISHEYE.unproject(uv, out=out),
    "ground_from_pixels": lambda out=None, uv=PIXELS: CAMERA.ground_from_pixels(uv, out=out),
    "ground_from_pixels on heights": lambda out=None, uv=PIXELS: CAMERA.ground_from_pixels(uv, ground=ROAD, out=out),
}
PROJECTIONS = {
    "points": lambda out=None, points=POINTS: CAMERA.project(points, out=out),
    "float32": lambda out=None, points=POINTS: CAMERA.project(points.astype(np.float32), out=out),
    "a fisheye": lambda out=None, points=POINTS: FISHEYE.project(points, out=out),
    "the road": lambda out=None, points=POINTS: CAMERA.project(points[:, :2], ground=ROAD, out=out),
}


def three(count: int = COUNT) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Arrays for a projection, whose bytes are no numbers and no bools."""
    out = (np.empty((count, 2)), np.empty(count), np.empty(count, bool))
    for array in out:
        array.view(np.uint8)[...] = 0xA5
    return out


@pytest.mark.parametrize("call", ROWS.values(), ids=ROWS)
def test_rows_go_where_they_are_wanted(call):
    out = np.full((COUNT, 3), 7.0)
    assert call(out) is out
    assert same(out, call()) and np.isfinite(out).any()


@pytest.mark.parametrize("call", PROJECTIONS.values(), ids=PROJECTIONS)
def test_projections_go_where_they_are_wanted(call):
    out = three()
    got = call(out)
    assert all(a is b for a, b in zip(got, out, strict=True))
    assert all(same(a, b) for a, b in zip(out, call(), strict=True)) and out[2].any()
    as_list = call(list(three()))
    assert isinstance(as_list, tuple) and same(as_list[0], out[0])


def test_none_is_as_if_not_given_and_no_points_are_fine():
    assert same(CAMERA.unproject(PIXELS, out=None), CAMERA.unproject(PIXELS))
    assert same(CAMERA.project(POINTS, out=None)[0], CAMERA.project(POINTS)[0])
    out = three(0)
    assert CAMERA.project(np.empty((0, 3)), out=out)[0] is out[0]
    assert CAMERA.unproject(np.empty((0, 2)), out=np.empty((0, 3))).shape == (0, 3)


def test_threads_of_unproject_change_nothing():
    assert same(CAMERA.unproject(PIXELS, threads=1), CAMERA.unproject(PIXELS, threads=3))
    with refuses(errors.ArgumentError, "threads", "0"):
        CAMERA.unproject(PIXELS, threads=0)


@pytest.mark.parametrize("call", ROWS.values(), ids=ROWS)
def test_wrong_rows_are_refused(call):
    def refused(error: type[Exception], *phrases: str, out: np.ndarray) -> None:
        with refuses(error, "out", *phrases, out=out):
            call(out)

    refused(errors.ArgumentError, "(5000, 3)", "(5000, 2)", out=np.zeros((COUNT, 2)))
    refused(errors.ArgumentError, "(5000, 3)", "(4999, 3)", out=np.zeros((COUNT - 1, 3)))
    refused(errors.ArgumentError, "(5000, 3)", "(3, 5000)", out=np.zeros((3, COUNT)))
    refused(errors.DtypeError, "float64", "float32", out=np.zeros((COUNT, 3), np.float32))
    refused(errors.DtypeError, "float64", ">f8", out=np.zeros((COUNT, 3), ">f8"))
    refused(errors.ArgumentError, "contiguous", "numpy.empty", out=np.zeros((3, COUNT)).T)
    refused(errors.ArgumentError, "contiguous", out=np.zeros((COUNT, 4))[:, :3])
    refused(errors.ArgumentError, "contiguous", out=np.zeros((2 * COUNT, 3))[::2])
    packed = np.zeros(COUNT * 24 + 1, np.uint8)[1:].view(np.float64).reshape(COUNT, 3)
    refused(errors.ArgumentError, "aligned", out=packed)
    fixed = np.zeros((COUNT, 3))
    fixed.flags.writeable = False
    refused(errors.ArgumentError, "read-only", out=fixed)
    with refuses(errors.ArgumentTypeError, "out"):
        call([[0.0, 0.0, 0.0]] * COUNT)
    with refuses(errors.ArgumentTypeError, "out"):
        call("here")


@pytest.mark.parametrize("name", ["unproject", "ground_from_pixels"])
def test_rows_over_the_pixels_are_refused(name):
    memory = np.zeros(COUNT * 5)
    uv = memory[: COUNT * 2].reshape(COUNT, 2)
    uv[...] = PIXELS
    apart, across = memory[COUNT * 2 :].reshape(COUNT, 3), memory[1 : COUNT * 3 + 1].reshape(COUNT, 3)
    assert same(ROWS[name](apart, uv), ROWS[name]())
    with refuses(errors.ArgumentError, "out", "memory", "uv", out=memory):
        ROWS[name](across, uv)


@pytest.mark.parametrize("call", PROJECTIONS.values(), ids=PROJECTIONS)
def test_wrong_projections_are_refused(call):
    def refused(error: type[Exception], *phrases: str, **wrong: np.ndarray) -> None:
        """One of the three is wrong; none of them may be written to."""
        uv, depth, valid = three()
        out = {"uv": uv, "depth": depth, "valid": valid} | wrong
        before = [array.tobytes() for array in out.values()]
        with refuses(error, f"out[{list(out).index(next(iter(wrong)))}]", *phrases):
            call(tuple(out.values()))
        assert before == [array.tobytes() for array in out.values()], "a refused call wrote to out"

    refused(errors.ArgumentError, "(5000, 2)", "(5000, 3)", uv=np.zeros((COUNT, 3)))
    refused(errors.ArgumentError, "(5000,)", "(5000, 1)", depth=np.zeros((COUNT, 1)))
    refused(errors.ArgumentError, "(5000,)", "(1,)", valid=np.zeros(1, bool))
    refused(errors.DtypeError, "float64", "float32", uv=np.zeros((COUNT, 2), np.float32))
    refused(errors.DtypeError, "float64", "float32", depth=np.zeros(COUNT, np.float32))
    refused(errors.DtypeError, "bool", "uint8", valid=np.zeros(COUNT, np.uint8))
    refused(errors.ArgumentError, "contiguous", uv=np.zeros((2, COUNT)).T)
    refused(errors.ArgumentError, "contiguous", depth=np.zeros(2 * COUNT)[::2])
    for name, array in (("uv", np.zeros((COUNT, 2))), ("depth", np.zeros(COUNT)), ("valid", np.zeros(COUNT, bool))):
        array.flags.writeable = False
        refused(errors.ArgumentError, "read-only", **{name: array})


def test_a_projection_s_arrays_share_no_memory():
    uv, depth, valid = three()
    with refuses(errors.ArgumentError, "out[1]", "memory", "out[0]", out=uv):
        CAMERA.project(POINTS, out=(uv, uv.reshape(-1)[:COUNT], valid))
    with refuses(errors.ArgumentError, "out[2]", "memory", "out[1]", out=depth):
        CAMERA.project(POINTS, out=(uv, depth, depth.view(bool)[:COUNT]))
    memory = np.zeros(COUNT * 5)
    points = memory[: COUNT * 3].reshape(COUNT, 3)
    points[...] = POINTS
    over = memory[COUNT * 3 - 1 : COUNT * 5 - 1].reshape(COUNT, 2)
    with refuses(errors.ArgumentError, "out[0]", "memory", "points", out=memory):
        CAMERA.project(points, out=(over, depth, valid))
    beside = memory[COUNT * 3 :].reshape(COUNT, 2)
    assert same(CAMERA.project(points, out=(beside, depth, valid))[0], CAMERA.project(POINTS)[0])


@pytest.mark.parametrize("out", [np.zeros((COUNT, 2)), three()[:2], (*three(), None), "uvd", 5, {}, (1, 2, 3)])
def test_what_is_no_three_arrays_is_refused(out):
    with refuses(errors.ArgumentTypeError, "out"):
        CAMERA.project(POINTS, out=out)


def test_two_threads_do_not_write_to_one_array():
    out = np.zeros((200_000, 3))
    uv = np.random.default_rng(1).uniform(0, 700, (200_000, 2))
    problems: list[str] = []

    def work() -> None:
        for _ in range(5):
            try:
                FISHEYE.ground_from_pixels(uv, ground=ROAD, out=out, threads=1)
            except errors.ArgumentError as error:
                problems.append(str(error))

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all("another call" in problem for problem in problems)
    assert same(out, FISHEYE.ground_from_pixels(uv, ground=ROAD))
