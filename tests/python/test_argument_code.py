"""Python code of arguments (`__array__`, `__float__`, iterators): what it may do, and what comes of what it raises."""

from __future__ import annotations

import inspect
import itertools

import numpy as np
import pytest
from helpers import refuses, same, textured

import ipm_rs
from ipm_rs import errors, pointfile
from ipm_rs.calibration import FORMATS

K = np.array([[300.0, 0, 160], [0, 300, 120], [0, 0, 1]])
CAMERA = ipm_rs.Camera.from_euler(K, image_size=(320, 240), position=(1.0, 0.2, 1.5), pitch=0.2)
GRID = ipm_rs.BevGrid(x=(4, 14), y=(-4, 4), resolution=0.5)
LUT = ipm_rs.Lut(CAMERA, GRID)
IMAGE = textured(240, 320)
MAP = np.zeros((4, 5))
POINTS = np.ones((8, 3))
DEPTH = np.ones((240, 320), np.float32)
SQUARE = np.array([[5.0, -2], [9, -2], [9, 2], [5, 2]])


class Acts:
    """Does something whenever Python code of it runs, and answers as a number, an array or a sequence would."""

    def __init__(self, act, answer):
        self.act, self.answer = act, answer

    def __array__(self, *args, **options):
        self.act()
        return np.asarray(self.answer)

    def __float__(self):
        self.act()
        return float(self.answer)

    def __index__(self):
        self.act()
        return int(self.answer)

    def __iter__(self):
        self.act()
        return iter(self.answer)


class ActsAsArray(Acts):
    """Likewise, but an image and not a number."""

    __float__ = __index__ = __iter__ = None


# calls of an array `a` that other arguments `x` may change while they are read, with a value for each of these
CALLS = {
    "warp border_value": (lambda a, x: LUT.warp(a, border_value=x), IMAGE, 3),
    "warp threads": (lambda a, x: LUT.warp(a, threads=x), IMAGE, 1),
    "warp out": (lambda a, x: LUT.warp(a, out=x), IMAGE, None),
    "remap border_value": (lambda a, x: ipm_rs.remap(a, MAP, MAP, border_value=x), IMAGE, 3),
    "remap map": (lambda a, x: ipm_rs.remap(IMAGE, a, a, border_value=x), np.zeros((40, 50)), 3),
    "warp_perspective M": (lambda a, x: ipm_rs.warp_perspective(a, x, (9, 9)), IMAGE, np.eye(3)),
    "warp_perspective border_value": (
        lambda a, x: ipm_rs.warp_perspective(a, np.eye(3), (9, 9), border_value=x),
        IMAGE,
        3,
    ),
    "project ground": (lambda a, x: CAMERA.project(a[:, :2], ground=x), POINTS, 0.5),
    "project_polyline margin": (lambda a, x: CAMERA.project_polyline(a, margin=x), POINTS, 0.5),
    "project_polyline ground": (lambda a, x: CAMERA.project_polyline(a, ground=x), SQUARE, 0.5),
    "ground_from_pixels ground": (lambda a, x: CAMERA.ground_from_pixels(a, ground=x), SQUARE, 0.5),
    "range_error pitch_deg": (lambda a, x: CAMERA.range_error(a, pitch_deg=x), SQUARE, 0.5),
    "homography": (lambda a, x: ipm_rs.homography_from_points(a, x), SQUARE * 20, SQUARE),
    "from_ground_points": (
        lambda a, x: ipm_rs.Lut.from_ground_points(a, x, GRID, source_size=(320, 240)),
        SQUARE * 20,
        SQUARE,
    ),
    "from_maps": (lambda a, x: ipm_rs.Lut.from_maps(a, a, source_size=(x, 9)), np.zeros((40, 50)), 9),
    "height map origin": (lambda a, x: ipm_rs.HeightMap(a, origin=(x, 0), spacing=1), MAP, 0.5),
    "rasterize density_full": (lambda a, x: ipm_rs.rasterize(a, GRID, density_full=x), POINTS, 9.0),
    "rasterize slices": (lambda a, x: ipm_rs.rasterize(a, GRID, slices=x), POINTS, [0.0, 2]),
    "boxes labels": (lambda a, x: ipm_rs.rasterize_boxes(a, GRID, [x]), np.array([[7.0, 0, 3, 2, 0.3]]), 3),
    "boxes background": (
        lambda a, x: ipm_rs.rasterize_boxes(a, GRID, background=x),
        np.array([[7.0, 0, 3, 2, 0.3]]),
        3,
    ),
    "boxes out": (
        lambda a, x: ipm_rs.rasterize_boxes([[7, 0, 3, 2, 0]], GRID, [x], out=a),
        np.zeros(GRID.shape, "i4"),
        3,
    ),
    "depth K": (lambda a, x: ipm_rs.points_from_depth(a, x), DEPTH, K),
    "depth frame": (lambda a, x: ipm_rs.points_from_depth(a, K, frame=x), DEPTH, np.eye(4)),
    "depth max_depth": (lambda a, x: ipm_rs.points_from_depth(a, K, x), DEPTH, 9),
    "depth depth_scale": (lambda a, x: ipm_rs.points_from_depth(a, K, depth_scale=x), DEPTH, 1.0),
    "depth stride": (lambda a, x: ipm_rs.points_from_depth(a, K, stride=x), DEPTH, 2),
    "depth mask": (lambda a, x: ipm_rs.points_from_depth(DEPTH, K, mask=a, stride=x), np.ones((240, 320), "u1"), 2),
    "depth values": (
        lambda a, x: ipm_rs.points_from_depth(DEPTH, K, values=a, stride=x, compact=True),
        np.ones((240, 320), "u1"),
        2,
    ),
    "lidar K": (lambda a, x: ipm_rs.depth_to_lidar(a, 320, 240, x), DEPTH, K),
    "local cloud fov": (lambda a, x: ipm_rs.depth_to_local_point_cloud(a, x), DEPTH, 90),
    "local cloud color": (
        lambda a, x: ipm_rs.depth_to_local_point_cloud(x, 90, color=a),
        np.ones((240, 320), "u1"),
        DEPTH,
    ),
    "decode threads": (lambda a, x: ipm_rs.decode_carla_depth(a, threads=x), textured(240, 320, 4), 1),
    "encode threads": (lambda a, x: ipm_rs.encode_carla_depth(a, threads=x), DEPTH, 1),
    "render radius": (lambda a, x: ipm_rs.render_points(a, CAMERA, radius=x), POINTS, 1),
    "render border_value": (lambda a, x: ipm_rs.render_points(a, CAMERA, values=np.ones(8), border_value=x), POINTS, 1),
    "render values": (lambda a, x: ipm_rs.render_points(POINTS, CAMERA, values=a, border_value=x), np.ones(8), 1),
}


def shrink(array: np.ndarray) -> None:
    """Leaves one element: what pointed at the others points at freed memory."""
    array.resize((1,) * array.ndim, refcheck=False)


@pytest.mark.parametrize("name", [name for name in CALLS if CALLS[name][2] is not None])
@pytest.mark.parametrize("kind", [Acts, ActsAsArray])
def test_an_array_that_shrinks_while_another_argument_is_read(name, kind):
    """A result for one of its two shapes, or one of our errors."""
    call, array, value = CALLS[name]
    array = np.repeat(array, 40, axis=0)[: len(array)].copy() if array.ndim < 2 else array.copy()
    try:
        call(array, kind(lambda: shrink(array), value))
    except errors.IpmError:
        pass


@pytest.mark.parametrize("name", [name for name in CALLS if CALLS[name][2] is not None])
@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, GeneratorExit, MemoryError])
def test_interrupts_pass_through(name, error):
    call, array, value = CALLS[name]

    def interrupt():
        raise error("from within")

    for kind in (Acts, ActsAsArray):
        hostile = kind(interrupt, value)
        try:
            call(array.copy(), hostile)
        except errors.IpmError:
            assert kind is ActsAsArray, "no Python code of it ran"
        except error as caught:
            assert caught.args == ("from within",)


@pytest.mark.parametrize("name", [name for name in CALLS if CALLS[name][2] is not None])
@pytest.mark.parametrize("error", [ValueError, OSError, ZeroDivisionError, RecursionError, StopIteration])
def test_what_an_argument_raises_is_told_in_our_words(name, error):
    call, array, value = CALLS[name]

    def fail():
        raise error("from within")

    with pytest.raises(errors.IpmError) as caught:
        call(array.copy(), Acts(fail, value))
    assert caught.value.__cause__ is None or isinstance(caught.value.__cause__, (error, RuntimeError, TypeError))


def raising(error, *methods):
    """An object whose methods raise."""

    def method(self, *args, **options):
        raise error("from within")

    return type("Raising", (), dict.fromkeys(methods, method))()


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, MemoryError])
def test_interrupts_pass_through_every_protocol(error):
    for call in (
        lambda: LUT.warp(raising(error, "__dlpack__", "__dlpack_device__")),
        lambda: LUT.warp(raising(error, "__dlpack_device__")),
        lambda: LUT.warp(raising(error, "__array__")),
        lambda: LUT.warp(raising(error, "__getattr__")),
        lambda: LUT.warp(IMAGE, out=raising(error, "__array__")),
        lambda: ipm_rs.BevGrid(x=raising(error, "__iter__"), y=(0, 1), resolution=1),
        lambda: ipm_rs.BevGrid(x=(0, 1), y=(0, 1), resolution=raising(error, "__float__")),
        lambda: ipm_rs.Camera(K, image_size=raising(error, "__iter__")),
        lambda: ipm_rs.Camera(K, image_size=(raising(error, "__index__"), 4)),
        lambda: ipm_rs.warp_perspective(IMAGE, np.eye(3), (4, 4), inverse_map=raising(error, "__bool__")),
        lambda: ipm_rs.rasterize(POINTS, GRID, reduce=raising(error, "__iter__")),
        lambda: ipm_rs.rasterize_polygons(raising(error, "__iter__"), GRID),
        lambda: ipm_rs.rasterize_polygons(_steps(error), GRID),
        lambda: ipm_rs.rasterize_boxes([[7, 0, 3, 2, 0]], GRID, raising(error, "__iter__")),
        lambda: LUT.warp(IMAGE, border_value=raising(error, "__repr__")),
        lambda: ipm_rs.points_from_depth(DEPTH, K, dtype=raising(error, "__repr__")),
        lambda: ipm_rs.HeightMap(MAP, origin=(0, 0), spacing=raising(error, "__float__")),
        lambda: CAMERA.save(raising(error, "__fspath__")),
        lambda: ipm_rs.Camera.load(raising(error, "__fspath__")),
    ):
        try:
            call()
        except error as caught:
            assert caught.args == ("from within",)
        except errors.IpmError as caught:
            # `bool` of NumPy's only: a method that is not asked is not raised from
            assert "inverse_map" in str(caught), caught
        else:
            raise AssertionError("lost")


def _steps(error):
    yield SQUARE
    raise error("from within")


def test_an_image_that_is_another_at_each_look():
    """The first answer counts, or none."""
    looks = itertools.count()

    class Moving:
        @property
        def __array_interface__(self):
            image = (IMAGE, IMAGE[:100], IMAGE[:, :50].copy(), np.zeros(3))[next(looks) % 4]
            self.kept = image
            return image.__array_interface__

    for _ in range(8):
        try:
            assert same(LUT.warp(Moving()), LUT.warp(IMAGE))
        except errors.IpmError:
            pass


def test_a_height_map_is_read_once():
    answers = iter([np.zeros(GRID.shape), np.zeros((2, 2))])

    class Changing:
        def __array__(self, *args, **options):
            return next(answers)

    assert ipm_rs.HeightMap.on_grid(Changing(), GRID).shape == GRID.shape


def test_iterators_without_an_end():
    with refuses(errors.ArgumentError, "x", "at least 100"):
        ipm_rs.BevGrid(x=itertools.count(), y=(0, 1), resolution=1)
    with refuses(errors.ArgumentError, "image_size", "at least 100"):
        ipm_rs.Camera(K, image_size=itertools.count(5))
    with refuses(errors.ArgumentError, "labels", "at least"):
        ipm_rs.rasterize_boxes([[7, 0, 3, 2, 0]], GRID, itertools.count())
    with refuses(errors.ArgumentError, "polygons", "ends"):
        ipm_rs.rasterize_polygons(itertools.cycle([SQUARE]), GRID)
    with refuses(errors.IpmError, "reduce"):
        ipm_rs.rasterize(POINTS, GRID, reduce=itertools.repeat("max"))
    with refuses(errors.IpmError, "border_value"):
        LUT.warp(IMAGE, border_value=itertools.count())
    with refuses(errors.ArgumentTypeError, "border_value"):
        LUT.warp(IMAGE, border_value=np.broadcast_to(np.uint8(0), (1 << 40,)))


def test_sets_have_no_order():
    for call in (
        lambda: ipm_rs.Camera(K, image_size={320, 240}),
        lambda: ipm_rs.BevGrid(x={4, 14}, y=(-4, 4), resolution=1),
        lambda: ipm_rs.Camera(K, image_size={320: 1, 240: 2}),
    ):
        with pytest.raises(errors.ArgumentTypeError, match=r"set|dict"):
            call()


def test_numbers_beyond_every_size():
    huge = 10**5000  # Python refuses to print it
    for call in (
        lambda: ipm_rs.Camera(K, image_size=(huge, 4)),
        lambda: ipm_rs.set_num_threads(huge),
        lambda: ipm_rs.rasterize_boxes([[7, 0, 3, 2, 0]], GRID, [huge]),
        lambda: LUT.warp(IMAGE, border_value=huge),
        lambda: LUT.warp(IMAGE, border_value=[huge]),
        lambda: ipm_rs.BevGrid(x=(0, huge), y=(0, 1), resolution=1),
        lambda: CAMERA.resized(huge, 1),
    ):
        with pytest.raises(errors.IpmError):
            call()
    with refuses(errors.ArgumentError, "4294967296"):
        CAMERA.resized(1 << 32, 1)


SURROGATE, NUL = "\ud800", "bilinear\0"


@pytest.mark.parametrize("text", [SURROGATE, NUL, "a\udcff", ""])
def test_words_that_are_no_text(text):
    for call in (
        lambda: LUT.warp(IMAGE, interpolation=text),
        lambda: LUT.warp(IMAGE, layout=text),
        lambda: ipm_rs.remap(IMAGE, MAP, MAP, border_mode=text),
        lambda: ipm_rs.remap(IMAGE, MAP, MAP, interpolation=text),
        lambda: ipm_rs.decode_carla_depth(textured(4, 5, 4), order=text),
        lambda: ipm_rs.encode_carla_depth(DEPTH, order=text),
        lambda: ipm_rs.points_from_depth(DEPTH, K, frame=text),
        lambda: ipm_rs.points_from_depth(DEPTH, K, kind=text),
        lambda: ipm_rs.points_from_depth(DEPTH, K, dtype=text),
        lambda: ipm_rs.render_points(POINTS, CAMERA, kind=text),
        lambda: ipm_rs.rasterize(POINTS, GRID, reduce=text),
        lambda: ipm_rs.rasterize(POINTS, GRID, reduce=["max", text]),
        lambda: ipm_rs.BevGrid(x=(0, 1), y=(0, 1), resolution=1, sample_at=text),
        lambda: CAMERA.binned(2, rule=text),
        lambda: LUT.warp(IMAGE, border_value=text),
        lambda: LUT.warp(text),
        lambda: CAMERA.project(text),
    ):
        with pytest.raises(errors.IpmError):
            call()


NOT_OF_A_PATH = (
    "from_euler",
    "from_fov",
    "from_ground_points",
    "from_points",
    "from_projection",
    "from_vanishing_point",
    "from_waymo",
)
PATHS = ["a\0b", "\ud800", "\0"]


@pytest.mark.parametrize("stem", PATHS, ids=ascii)
def test_paths_that_no_file_can_have(stem, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for call in (
        lambda: CAMERA.save(f"{stem}.json"),
        lambda: ipm_rs.Camera.load(f"{stem}.json"),
        *(
            lambda read=read: getattr(ipm_rs.Camera, read)(f"{stem}.json")
            for read in dir(ipm_rs.Camera)
            if read.startswith("from_") and read not in NOT_OF_A_PATH
        ),
        lambda: pointfile.read(f"{stem}.bin"),
        lambda: pointfile.write(f"{stem}.ply", POINTS),
        lambda: pointfile.write(f"{stem}.bin", POINTS, force=True),
    ):
        with pytest.raises(errors.IpmError):
            call()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("path", [None, 3, b"a.json", ["a.json"], raising(ValueError, "__fspath__")])
def test_paths_that_are_none(path):
    for call in (CAMERA.save, ipm_rs.Camera.load, pointfile.read, lambda path: pointfile.write(path, POINTS)):
        with refuses(errors.ArgumentTypeError, "path"):
            call(path)


def test_masked_points_are_not_written(tmp_path):
    masked = np.ma.masked_equal(np.arange(6.0).reshape(2, 3), 4)
    with refuses(errors.ArgumentError, "points", "masked", ".filled("):
        pointfile.write(tmp_path / "a.ply", masked)
    with refuses(errors.ArgumentError, "values", "masked"):
        pointfile.write(tmp_path / "a.ply", POINTS, {"i": np.ma.masked_equal(np.arange(8.0), 4)})
    for error in (KeyboardInterrupt, MemoryError):
        with pytest.raises(error):
            pointfile.write(tmp_path / "a.ply", raising(error, "__array__"))
    with refuses(errors.ArgumentTypeError, "points"):
        pointfile.write(tmp_path / "a.ply", raising(ValueError, "__array__"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("force", [None, 1, "yes", np.zeros(0), raising(ValueError, "__bool__")])
def test_force_is_true_or_false(force, tmp_path):
    with refuses(errors.ArgumentTypeError, "force", "True or False"):
        pointfile.write(tmp_path / "a.ply", POINTS, force=force)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "camera", [10**5000, 1.5, True, [1], object(), raising(ValueError, "__repr__", "__str__")], ids=type
)
def test_cameras_of_a_file_have_names_or_numbers(camera, tmp_path):
    """The message shows what came, so it must be of a kind that can be shown."""
    path = tmp_path / "a.json"
    path.write_text("{}")
    for name in FORMATS:
        read = getattr(ipm_rs.Camera, f"from_{name}")
        if "camera" in inspect.signature(read).parameters:
            with pytest.raises(errors.IpmError):
                read(path, camera=camera)
    with pytest.raises(errors.IpmError):
        ipm_rs.Camera.load(path, camera=camera)
