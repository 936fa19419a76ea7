"""Right calls of every public name, for the API fuzzer to spoil.

An argument's value comes from its name (`PARAMETERS`); where arguments must fit each other, a recipe makes them
together (`RECIPES`). A new name needs an entry only where neither says what its arguments are.
"""

from __future__ import annotations

import inspect
import pathlib
import pickle
import random
from collections.abc import Callable
from typing import Any

import numpy as np
from bags import Bag
from calibration_samples import SAMPLES
from helpers import textured
from PIL import Image
from test_streams import write_video

import ipm_rs
from ipm_rs import calibration, draw, pointfile, refine, scene, streams

WIDTH, HEIGHT = 64, 48
K = np.array([[50.0, 0, 31.5], [0, 50, 23.5], [0, 0, 1]])
SQUARE = np.array([[5.0, -2], [9, -2], [9, 2], [5, 2]])
LENSES = {
    "BrownConrady": ipm_rs.BrownConrady([0.1, -0.02, 0.001, 0.002]),
    "KannalaBrandt": ipm_rs.KannalaBrandt([0.01, -0.002, 0.0, 0.0]),
    "Mei": ipm_rs.Mei(0.9, [0.01, 0, 0, 0]),
    "DoubleSphere": ipm_rs.DoubleSphere(-0.2, 0.55),
    "Eucm": ipm_rs.Eucm(0.6, 1.1),
    "Fov": ipm_rs.Fov(0.9),
    "Division": ipm_rs.Division(-0.2),
    "InverseBrownConrady": ipm_rs.InverseBrownConrady([0.1, -0.02, 0.001, 0.002]),
    "ThinPrismFisheye": ipm_rs.ThinPrismFisheye([0.01, -0.002, 1e-3, 2e-3, 0, 0, 1e-3, 0]),
    "Cylindrical": ipm_rs.Cylindrical(),
    "Equirectangular": ipm_rs.Equirectangular(max_angle=2.0),
}
POSE = {"position": (1.0, 0.2, 1.5), "pitch": 0.3}
CAMERAS = [
    ipm_rs.Camera.from_euler(K, image_size=(WIDTH, HEIGHT), lens=lens, **POSE) for lens in (None, *LENSES.values())
]
GRIDS = [
    ipm_rs.BevGrid(x=(4, 14), y=(-4, 4), resolution=0.5),
    ipm_rs.BevGrid(x=(2, 8), y=(-3, 3), resolution=(0.25, 0.5), sample_at="corner"),
    ipm_rs.BevGrid(x=(5, 6), y=(0, 1), resolution=1),
]
ROADS: list[Any] = [
    0.0,
    -0.2,
    ipm_rs.Plane(normal=(0.01, 0, 1)),
    ipm_rs.HeightMap(np.random.default_rng(1).normal(0, 0.05, (9, 9)), origin=(0, -8), spacing=2.0),
]
LUTS = [ipm_rs.Lut(camera, grid) for camera in CAMERAS[:3] for grid in GRIDS]
RIG = ipm_rs.Rig({"front": CAMERAS[1], "left": CAMERAS[0], "back": CAMERAS[5]})
BOWL = ipm_rs.Bowl(5)
TRAJECTORY = ipm_rs.Trajectory(
    [0.0, 1, 2, 3], [ipm_rs.Camera.from_euler(K, image_size=(2, 2), yaw=0.1 * k).vehicle_from_camera for k in range(4)]
)


def _drive() -> tuple[ipm_rs.Camera, list[np.ndarray], np.ndarray]:
    """Two small pictures of a road 1.3 m apart, from a camera that looks a little lower than it says."""
    intrinsics = [[160.0, 0, 79.5], [0, 160, 30], [0, 0, 1]]
    camera = ipm_rs.Camera.from_euler(intrinsics, image_size=(160, 96), position=(0, 0, 1.4), pitch=0.08)
    poses = np.array([np.eye(4), np.eye(4)])
    poses[1, 0, 3] = 1.3
    seen = [scene.render(camera.with_pose(camera.camera_from_vehicle @ np.linalg.inv(pose))) for pose in poses]
    given = ipm_rs.Camera.from_euler(intrinsics, image_size=(160, 96), position=(0, 0, 1.4), pitch=0.07)
    return given, seen, poses


DRIVE = _drive()
OVERLAP = ipm_rs.Rig(
    {
        name: ipm_rs.Camera.from_euler(K, image_size=(WIDTH, HEIGHT), position=(0, 0, 1.5), pitch=0.5, yaw=yaw)
        for name, yaw in (("left", 0.2), ("right", -0.2))
    }
)
LIFTED = np.array([[0, 0, 0.0], [0, 0, 0.5], [0, 0, 1], [0, 0, 0.2], [0, 0, 1.2]])
MARKS = np.array([[(6.0, 1.0, 0.0), (12.0, 1.0, 0.0)], [(6.0, -1.0, 0.0), (12.0, -1.0, 0.0)]])
STOPS = np.array([[(6.0, 1.0, 0.0), (6.0, -1.0, 0.0)], [(9.0, 1.0, 0.0), (9.0, -1.0, 0.0)]])
GROUND_POINTS = np.array([[5.0, 1, 0], [6, -1, 0], [9, 2, 0], [12, -2, 0], [8, 0, 0]])
HOMOGRAPHY = ipm_rs.Homography.from_points(CAMERAS[0].project(GROUND_POINTS)[0], GROUND_POINTS[:, :2])
RIG_LUTS = [ipm_rs.RigLut(RIG, grid, blend=blend) for grid, blend in zip(GRIDS, ("best", "feather"), strict=False)]
BOARD = np.pad(np.kron((np.indices((4, 6)).sum(axis=0) % 2) * 200, np.ones((16, 16))), 24, constant_values=230).astype(
    "u1"
)
REPORTS: list[Any] = [ipm_rs.doctor(CAMERAS[0], GRIDS[0]), ipm_rs.doctor(RIG, GRIDS[0])]
FILES = ("cloud.bin", "cloud.npy", "cloud.ply", "cloud.pcd", "cloud.las", "cloud.laz")

Arguments = dict[str, Any]


class Values:
    """Right values, chosen by a random number generator; files are in `folder`."""

    def __init__(self, rng: random.Random, folder: pathlib.Path) -> None:
        self.rng, self.folder = rng, folder

    def numbers(self, *shape: int, low: float = -5.0, high: float = 15.0, dtype: str = "f8") -> np.ndarray:
        return np.random.default_rng(self.rng.getrandbits(32)).uniform(low, high, shape).astype(dtype)

    def count(self) -> int:
        return self.rng.choice([0, 1, 2, 5, 40])

    def points(self, columns: int = 3) -> np.ndarray:
        return self.numbers(self.count(), columns, dtype=self.rng.choice(["f8", "f4"]))

    def image(self, *channels: int, dtypes: str = "u1 u2 f4") -> np.ndarray:
        dtype = np.dtype(self.rng.choice(dtypes.split())).name
        return textured(HEIGHT, WIDTH, self.rng.choice([None, *channels]), dtype, self.rng.randrange(8))

    def rig_images(self, dtypes: str) -> dict[str, np.ndarray]:
        dtype = np.dtype(self.rng.choice(dtypes.split())).name
        return {name: textured(HEIGHT, WIDTH, None, dtype, k) for k, name in enumerate(RIG)}

    def depth(self) -> np.ndarray:
        return self.numbers(HEIGHT, WIDTH, low=0, high=9, dtype=self.rng.choice(["f4", "f8"]))

    def maps(self) -> Arguments:
        shape, dtype = (self.rng.choice([1, 5, 30]), self.rng.choice([1, 7, 40])), self.rng.choice(["f4", "f8"])
        return {f"map_{axis}": self.numbers(*shape, low=-5, high=70, dtype=dtype) for axis in "xy"}


P = Callable[[Values], Any]
BORDERS = ["constant", "replicate", "reflect", "reflect_101", "wrap"]

PARAMETERS: dict[str, P] = {
    "border_mode": lambda v: v.rng.choice(BORDERS),
    "K": lambda v: K.copy(),
    "M": lambda v: np.array([[1.1, 0.02, -3], [0.01, 0.9, 2], [1e-4, 0, 1]]),
    "R": lambda v: CAMERAS[0].camera_from_vehicle[:3, :3].copy(),
    "T": lambda v: CAMERAS[0].camera_from_vehicle,
    "camera": lambda v: v.rng.choice(CAMERAS),
    "grid": lambda v: v.rng.choice(GRIDS),
    "cameras": lambda v: RIG.cameras,
    "rig": lambda v: v.rng.choice([RIG, RIG.cameras]),
    "masks": lambda v: {"front": textured(HEIGHT, WIDTH, None) > 60},
    "exclude": lambda v: v.rng.choice([SQUARE.copy(), [SQUARE[:3] + 1]]),
    "blend": lambda v: v.rng.choice(["best", "feather", "priority"]),
    "feather": lambda v: v.rng.choice([0, 0.5, 2.0]),
    "map_from_vehicle": lambda v: CAMERAS[0].vehicle_from_camera,
    "names": lambda v: v.rng.choice([["front"], ["left", "back"]]),
    "name": lambda v: "front",
    "ground": lambda v: v.rng.choice(ROADS),
    "camera_from_vehicle": lambda v: CAMERAS[0].camera_from_vehicle,
    "points": lambda v: v.points(),
    "uv": lambda v: v.numbers(v.count(), 2, low=-3, high=66),
    "xy": lambda v: v.points(2),
    "rc": lambda v: v.points(2),
    "threads": lambda v: v.rng.choice([1, 2]),
    "n": lambda v: v.rng.choice([1, 2]),
    "image_size": lambda v: (WIDTH, HEIGHT),
    "source_size": lambda v: (WIDTH, HEIGHT),
    "size": lambda v: (20, 10),
    "position": lambda v: (1.0, 0.0, 1.5),
    "normal": lambda v: (0.0, 0.01, 1.0),
    "point": lambda v: (0.0, 0.0, 0.1),
    "lens": lambda v: v.rng.choice(list(LENSES.values())),
    "coefficients": lambda v: [0.1, -0.02, 0.001, 0.002],
    "polynomial": lambda v: np.array([200.0, 0, -1e-3]),
    "affine": lambda v: (1.0, 0.0, 0.0),
    "max_angle": lambda v: 1.0,
    "vanishing_point": lambda v: (31.0, 15.0),
    "focal_length": lambda v: v.rng.choice([50.0, (50.0, 51.0)]),
    "principal_point": lambda v: (31.0, 23.0),
    "resolution": lambda v: v.rng.choice([0.5, (0.25, 0.5)]),
    "sample_at": lambda v: v.rng.choice(["center", "corner"]),
    "lines": lambda v: np.array([[[0.0, 9], [4, 5]], [[9, 9], [5, 5.5]]]),
    "image_points": lambda v: CAMERAS[0].project(SQUARE)[0],
    "ground_points": lambda v: SQUARE.copy(),
    "heights": lambda v: v.numbers(6, 7, low=-0.1, high=0.1),
    "origin": lambda v: (0.0, -5.0),
    "spacing": lambda v: v.rng.choice([2.0, (1.0, -2.0)]),
    "boxes": lambda v: np.array([[7.0, 0, 3, 2, 0.3], [9, 1, 4, 2, 1]]),
    "polygons": lambda v: [SQUARE.copy(), SQUARE[:3] + 1],
    "labels": lambda v: [3, 4],
    "rule": lambda v: v.rng.choice(["area", "first_pixel"]),
    "closed": lambda v: v.rng.choice([True, False]),
    "path": lambda v: v.folder / "camera.json",
    **{name: lambda v: v.rng.choice([0.1, -0.2]) for name in ("roll", "pitch", "yaw", "slope", "bank", "a", "b", "c")},
    **{name: lambda v: v.rng.choice([0.3, 0.6]) for name in ("xi", "alpha", "beta", "minimum", "outside", "margin")},
    **{name: lambda v: v.rng.choice([0.5, 1.5]) for name in ("height", "tolerance", "pixel", "pitch_deg", "column")},
    **{name: lambda v: v.rng.choice([1, 2]) for name in ("width", "x", "y")},
}


def _layout(v: Values, image: np.ndarray) -> Arguments:
    layout = v.rng.choice(["HWC", "CHW", "NHWC", "NCHW"] if image.ndim == 3 else ["HWC"])
    array = image.transpose(2, 0, 1) if "C" in layout[:2] else image
    array = np.stack([array] * 2) if "N" in layout else np.ascontiguousarray(array)
    return {"image": array, "layout": layout}


def _warp(v: Values) -> tuple[Callable[..., Any], Arguments]:
    interpolation = v.rng.choice(["bilinear", "nearest", "cubic", "lanczos4", "area", "mode"])
    dtypes = {"nearest": "bool u1 i4 f8", "mode": "u1 i2 u4"}.get(interpolation, "u1 u2 f4")
    lut, arguments = v.rng.choice(LUTS), _layout(v, v.image(1, 3, 4, dtypes=dtypes))
    more = {"interpolation": interpolation, "threads": 2, "border_value": v.rng.choice([0, 1, 1.0])}
    if v.rng.random() < 0.5:
        image, layout = arguments["image"], arguments["layout"]
        rows, columns = (layout.index("H"), layout.index("W")) if image.ndim > 2 else (0, 1)
        shape = list(image.shape)
        shape[rows], shape[columns] = lut.shape
        more["out"] = np.zeros(shape, image.dtype)
        more["border_mode"] = v.rng.choice([None, "constant", "transparent"])
    return lut.warp, arguments | more


def _warp_adjoint(v: Values) -> tuple[Callable[..., Any], Arguments]:
    lut, channels = v.rng.choice(LUTS), v.rng.choice([(), (1,), (3,)])
    grad = v.numbers(*lut.shape, *channels, dtype=v.rng.choice(["f4", "f8"]))
    arguments: Arguments = {
        "grad": grad,
        "interpolation": v.rng.choice(["bilinear", "nearest", "area"]),
        "threads": 2,
        "layout": "HWC",
    }
    if v.rng.random() < 0.5:
        arguments["out"] = np.zeros((HEIGHT, WIDTH, *channels), grad.dtype)
    return lut.warp_adjoint, arguments


def _rig_warp_adjoint(v: Values) -> tuple[Callable[..., Any], Arguments]:
    lut, channels = v.rng.choice(RIG_LUTS), v.rng.choice([(), (1,), (3,)])
    arguments: Arguments = {
        "grad": v.numbers(*lut.shape, *channels, dtype=v.rng.choice(["f4", "f8"])),
        "interpolation": v.rng.choice(["bilinear", "nearest", "area"]),
        "threads": 2,
        "layout": "HWC",
    }
    return lut.warp_adjoint, arguments


def _direct(v: Values, arguments: Arguments, shape: tuple[int, int]) -> Arguments:
    arguments |= {
        "interpolation": v.rng.choice(["bilinear", "nearest", "cubic", "lanczos4"]),
        "border_mode": v.rng.choice(["constant", "replicate", "reflect", "reflect_101", "wrap"]),
        "border_value": v.rng.choice([0, 7]),
        "threads": 1,
    }
    if v.rng.random() < 0.5:
        image = arguments["image"]
        arguments["out"] = np.zeros((*shape, *image.shape[2:]), image.dtype)
    return arguments


def _remap(v: Values) -> tuple[Callable[..., Any], Arguments]:
    arguments = {"image": v.image(1, 3), **v.maps()}
    return ipm_rs.remap, _direct(v, arguments, arguments["map_x"].shape)


def _warp_perspective(v: Values) -> tuple[Callable[..., Any], Arguments]:
    arguments = {
        "image": v.image(1, 3),
        "M": PARAMETERS["M"](v),
        "dsize": (20, 10),
        "inverse_map": v.rng.choice([True, False]),
    }
    return ipm_rs.warp_perspective, _direct(v, arguments, (10, 20))


def _points_from_depth(v: Values) -> tuple[Callable[..., Any], Arguments]:
    arguments: Arguments = {
        "depth": v.depth(),
        "K": v.rng.choice([K.copy(), CAMERAS[0], CAMERAS[1], ipm_rs.PixelRays(CAMERAS[2])]),
        "max_depth": 8.0,
        "frame": v.rng.choice(["camera", "flu", np.eye(4)]),
        "min_depth": 0.5,
        "kind": v.rng.choice(["z", "ray"]),
        "depth_scale": 1.0,
        "stride": v.rng.choice([1, 2, 7]),
        "mask": v.image(dtypes="bool u1"),
        "dtype": v.rng.choice(["float32", "float64"]),
    }
    if v.rng.random() < 0.3:
        order = v.rng.choice(["bgra", "rgb"])
        arguments |= {"depth": textured(HEIGHT, WIDTH, len(order)), "order": order}
    if v.rng.random() < 0.4:
        values = [v.image(3), v.image(dtypes="i8 bool")]
        return ipm_rs.points_from_depth, arguments | {"compact": True, "values": v.rng.choice([values, values[0]])}
    if v.rng.random() < 0.5:
        shape = (*(-(-n // arguments["stride"]) for n in (HEIGHT, WIDTH)), 3)
        arguments["out"] = np.zeros(shape, arguments["dtype"])
    return ipm_rs.points_from_depth, arguments


def _rasterize(v: Values) -> tuple[Callable[..., Any], Arguments]:
    points = v.points(v.rng.choice([3, 4]))
    dtype = v.rng.choice("bool u1 i2 u4 i8 f4 f8".split())
    return ipm_rs.rasterize, {
        "points": points,
        "grid": v.rng.choice(GRIDS),
        "values": v.numbers(len(points), *v.rng.choice([(), (2,)]), low=0).astype(dtype),
        "reduce": v.rng.choice(["max", ("count", "density", "min", "max", "mean", "last", "top")]),
        "slices": [0.0, 2, 9],
        "density_full": 9.0,
        "threads": 2,
    }


def _render_points(v: Values) -> tuple[Callable[..., Any], Arguments]:
    points = v.points(v.rng.choice([3, 5]))
    return ipm_rs.render_points, {
        "points": points,
        "camera": v.rng.choice(CAMERAS),
        "values": v.numbers(len(points), *v.rng.choice([(), (3,)]), low=0).astype(v.rng.choice(["u1", "f4", "i8"])),
        "radius": v.rng.choice([0.0, 0.05, 2.0]),
        "kind": v.rng.choice(["z", "ray"]),
        "min_depth": 0.1,
        "max_depth": 50.0,
        "border_value": 0,
        "threads": 2,
    }


def _reader(v: Values) -> tuple[Callable[..., Any], Arguments]:
    name = v.rng.choice(sorted(SAMPLES))
    sample, source = SAMPLES[name], v.folder / name
    path = source / (sample.source or next(iter(sample.files)))
    if v.rng.random() < 0.3:
        return ipm_rs.Camera.load, {"path": path, **sample.options}
    return calibration.reader(sample.format).read, {"source": path, **sample.options}


def _on_grid(v: Values) -> tuple[Callable[..., Any], Arguments]:
    grid = v.rng.choice(GRIDS)
    return ipm_rs.HeightMap.on_grid, {"heights": v.numbers(*grid.shape, low=0, high=0.2), "grid": grid}


def _write(v: Values) -> tuple[Callable[..., Any], Arguments]:
    points = v.points()
    values = {
        "intensity": v.numbers(len(points), low=0, high=1, dtype="f4"),
        "ring": np.arange(len(points), dtype="u2"),
    }
    file = v.rng.choice(FILES)
    steps = {"scale": 0.001, "offset": (1.0, 2.0, 0.0)} if file.endswith((".las", ".laz")) else {}
    return pointfile.write, {
        "path": v.folder / f"written-{file}",
        "points": points,
        "values": values,
        "force": True,
        **steps,
    }


def _project(v: Values) -> tuple[Callable[..., Any], Arguments]:
    points = v.points(v.rng.choice([2, 3]))
    count = len(points)
    arguments: Arguments = {"points": points, "out": (np.zeros((count, 2)), np.zeros(count), np.zeros(count, bool))}
    if points.shape[1] == 2:
        arguments["ground"] = v.rng.choice(ROADS)
    return v.rng.choice(CAMERAS).project, arguments | {"threads": 2}


def _rows_of_pixels(name: str, **more: P) -> Callable[[Values], tuple[Callable[..., Any], Arguments]]:
    def make(v: Values) -> tuple[Callable[..., Any], Arguments]:
        uv = PARAMETERS["uv"](v)
        others = {key: value(v) for key, value in more.items()}
        return getattr(v.rng.choice(CAMERAS), name), {"uv": uv, "out": np.zeros((len(uv), 3)), "threads": 1} | others

    return make


def _rig_warp(v: Values) -> tuple[Callable[..., Any], Arguments]:
    interpolation = v.rng.choice(["nearest", "bilinear", "area", "mode"])
    arguments = {
        "images": v.rig_images("u1 i4" if interpolation == "mode" else "u1 u2 f4"),
        "interpolation": interpolation,
        "threads": v.rng.choice([1, 2]),
        "missing": v.rng.choice([None, "next", "border"]),
    }
    if interpolation != "mode" and v.rng.random() < 0.5:
        arguments["gains"] = {"front": 1.1, "left": 0.9}
    return v.rng.choice(RIG_LUTS).warp, arguments


def _doctor(v: Values) -> tuple[Callable[..., Any], Arguments]:
    arguments = {"grid": v.rng.choice(GRIDS[:2]), "ground": v.rng.choice(ROADS)}
    if v.rng.random() < 0.3:
        return ipm_rs.doctor, {"camera": RIG, "image": v.rig_images("u1 f4"), **arguments}
    return ipm_rs.doctor, {"camera": v.rng.choice(CAMERAS), "image": v.image(1, 3), **arguments}


def _pickled(v: Values) -> tuple[Callable[..., Any], Arguments]:
    return pickle.loads, {"data": pickle.dumps(v.rng.choice(OBJECTS))}


def _streams_open(v: Values) -> tuple[Callable[..., Any], Arguments]:
    kind, more = v.rng.choice(
        [
            ("folder", {}),
            ("video", {"rotation": "refuse", "bits": v.rng.choice([8, 16])}),
            ("bag", {"topic": "/image", "vehicle_frame": "base_link", "clock": "log", "max_gap": 1.0, "poses": True}),
        ]
    )
    path = v.folder / {"folder": v.rng.choice(["frames", "frames/list.txt"]), "video": "a.mkv", "bag": "a.bag"}[kind]
    if kind != "folder":
        more |= {"start": 0.0, "end": 9.0}
    return lambda **options: list(streams.open(**options)), {"path": path, "kind": kind, "every": 2, **more}


def _streams_warp(v: Values) -> tuple[Callable[..., Any], Arguments]:
    return streams.warp, {
        "stream": streams.open(v.folder / "frames"),
        "lut": LUTS[0],
        "output": v.folder / v.rng.choice(["bevs", "bevs-of-npy"]),
        "jobs": v.rng.choice([1, 2]),
        "skip_existing": v.rng.choice([True, False]),
        "strict": True,
        "ending": v.rng.choice([".png", ".npy", ".npz"]),
        "level": 0,
        "mask": v.folder / "masks",
        "draw": lambda view, lut: view,
        "interpolation": "nearest",
    }


def _mosaic_add(v: Values) -> tuple[Callable[..., Any], Arguments]:
    camera = CAMERAS[0]
    picture = v.rng.choice([np.zeros((HEIGHT, WIDTH), np.uint8), np.full((HEIGHT, WIDTH, 3), 9, np.uint16)])
    return ipm_rs.Mosaic(0.25, tile=64).add, {
        "camera": camera,
        "image": picture,
        "map_from_vehicle": np.eye(4),
        "ground": v.rng.choice([0.0, "wheels", ROADS[2]]),
        "mask": np.ones((HEIGHT, WIDTH), bool),
        "weight": 0.5,
        "distance": (1.0, 9.0),
        "gain": v.rng.choice([1.5, {"": 1.5}]),
        "name": "frame",
        "threads": 1,
    }


def _mosaic() -> ipm_rs.Mosaic:
    mosaic = ipm_rs.Mosaic(0.25, tile=64)
    mosaic.add(CAMERAS[0], np.full((HEIGHT, WIDTH), 7, np.uint8), map_from_vehicle=np.eye(4), distance=(1, 9))
    return mosaic


MOSAIC = _mosaic()


def _with(function: Callable[..., Any], make: Callable[[Values], Arguments]) -> Callable[[Values], Any]:
    return lambda v: (function, make(v))


RECIPES: dict[str, Callable[[Values], tuple[Callable[..., Any], Arguments]]] = {
    "Lut.warp": _warp,
    "streams.open": _streams_open,
    "streams.warp": _streams_warp,
    "streams.recognise": lambda v: (streams.recognise, {"path": v.folder / v.rng.choice(["frames", "a.mkv", "a.bag"])}),
    "streams.together": lambda v: (
        lambda **options: list(streams.together(**options)),
        {
            "streams": {name: streams.open(v.folder / name) for name in ("a.mkv", "a.bag")},
            "tolerance": 0.5,
            "partial": v.rng.choice([True, False]),
        },
    ),
    "streams.per_frame": lambda v: (
        streams.per_frame,
        {"camera": CAMERAS[0], "grid": GRIDS[0], "path": v.folder / "pitch.csv", "ground": 0.0, "max_gap": 1.0},
    ),
    "Lut.warp_adjoint": _warp_adjoint,
    "RigLut.warp": _rig_warp,
    "RigLut.warp_adjoint": _rig_warp_adjoint,
    "RigLut.gains": lambda v: (v.rng.choice(RIG_LUTS).gains, {"images": v.rig_images("u1 f4")}),
    "Lut.save": lambda v: (LUTS[0].save, {"path": v.folder / "written.ipmlut"}),
    "Lut.export": lambda v: (LUTS[1].export, {"path": v.folder / "written.yml", "format": "lanenet"}),
    "Lut.load": lambda v: (
        ipm_rs.Lut.load,
        {"path": v.folder / "front.ipmlut", "expect": (CAMERAS[0], GRIDS[0]), "source_size": (WIDTH, HEIGHT)},
    ),
    "RigLut.agreement": lambda v: (
        v.rng.choice(RIG_LUTS).agreement,
        {"images": v.rig_images("u1 f4"), "farthest": 0.5},
    ),
    "RigLut.save": lambda v: (RIG_LUTS[0].save, {"path": v.folder / "rig-written.ipmlut"}),
    "RigLut.load": lambda v: (ipm_rs.RigLut.load, {"path": v.folder / "ring.ipmlut"}),
    "Mosaic": lambda v: (
        ipm_rs.Mosaic,
        {
            "resolution": 0.25,
            "tile": 64,
            "channels": 1,
            "dtype": "uint8",
            "samples": v.rng.choice([3, None]),
            "labels": v.rng.choice([True, False]),
            "memory": 1 << 20,
        },
    ),
    "Mosaic.add": _mosaic_add,
    "Mosaic.gain": lambda v: (
        MOSAIC.gain,
        {
            "camera": CAMERAS[0],
            "image": np.full((HEIGHT, WIDTH), 9, np.uint8),
            "map_from_vehicle": np.eye(4),
            "ground": v.rng.choice([0.0, "wheels"]),
            "mask": np.ones((HEIGHT, WIDTH), bool),
            "distance": (1.0, 9.0),
            "threads": 1,
        },
    ),
    "Mosaic.refine": lambda v: (
        _mosaic().refine,
        {
            "frames": [(CAMERAS[0], np.full((HEIGHT, WIDTH), 9, np.uint8), np.eye(4))],
            "iterations": 1,
            "ground": v.rng.choice([0.0, "wheels"]),
            "distance": (1, 9),
            "threads": 1,
        },
    ),
    "Mosaic.merge": lambda v: (_mosaic().merge, {"other": MOSAIC}),
    "Mosaic.window": lambda v: (MOSAIC.window, {"x": (2.0, 6.0), "y": (-1, 1)}),
    "Mosaic.image": lambda v: (MOSAIC.image, {"x": (2.0, 6.0), "y": (-1, 1), "blend": "best"}),
    "Mosaic.layers": lambda v: (MOSAIC.layers, {"x": (2.0, 6.0), "y": (-1, 1), "names": ("std", "count")}),
    "Mosaic.save": lambda v: (MOSAIC.save, {"path": v.folder / f"mosaic-{v.rng.random()}"}),
    "Mosaic.export_tiles": lambda v: (MOSAIC.export_tiles, {"directory": v.folder / "site", "blend": "mean"}),
    "Mosaic.export_geotiff": lambda v: (
        MOSAIC.export_geotiff,
        {"path": v.folder / "map.tif", "crs": "EPSG:32632", "origin": (5e5, 5e6), "blend": "mean"},
    ),
    "Mosaic.load": lambda v: (ipm_rs.Mosaic.load, {"path": v.folder / "mosaic", "memory": 1 << 20}),
    "Mosaic.commit": lambda v: (_mosaic().commit, {}),
    "Mosaic.close": lambda v: (_mosaic().close, {}),
    "Trajectory": _with(
        ipm_rs.Trajectory,
        lambda v: {"timestamps": [0.0, 0.5, 2], "poses": TRAJECTORY.poses[:3].copy(), "max_gap": 2.0, "offset": 0.1},
    ),
    "Trajectory.load": lambda v: (
        ipm_rs.Trajectory.load,
        {"path": v.folder / "poses.txt", "timestamps": np.arange(4) * 0.1, "vehicle_from_sensor": np.eye(4)},
    ),
    "Trajectory.at": lambda v: (TRAJECTORY.at, {"timestamps": v.rng.choice([0.5, [0.0, 1.5]])}),
    "Trajectory.covers": lambda v: (TRAJECTORY.covers, {"timestamps": v.rng.choice([0.5, [0.0, 99]])}),
    "Bowl": _with(ipm_rs.Bowl, lambda v: {"flat": 4.0, "radius": 3.0, "center": (1.0, 0.0), "steepest": 50}),
    "Bowl.height_at": lambda v: (BOWL.height_at, {"xy": np.arange(18.0).reshape(9, 2)}),
    "Bowl.height_map": lambda v: (BOWL.height_map, {"grid": GRIDS[0]}),
    "Rig.save": lambda v: (RIG.save, {"path": v.folder / "rig-written.json"}),
    "Rig.load": lambda v: (ipm_rs.Rig.load, {"path": v.folder / "rig.json"}),
    "doctor": _doctor,
    "diagnosis.reports": lambda v: (getattr(v.rng.choice(REPORTS), v.rng.choice(["to_json", "draw", "__str__"])), {}),
    "draw.axes": _with(
        draw.axes,
        lambda v: {
            "view": textured(*GRIDS[0].shape, 3),
            "grid": GRIDS[0],
            "mask": textured(*GRIDS[0].shape) > 60,
            "track": np.array([[8.0, 2.0], [np.nan, 0.0], [20.0, -1.0], [30.0, 0.0]]),
            "step": 2.0,
            "scale": v.rng.choice([None, 5.0]),
            "font_size": 12,
            "title": "front",
        },
    ),
    "draw.overlay": lambda v: (
        draw.overlay,
        {
            "image": v.image(1, 3),
            "camera": v.rng.choice(CAMERAS),
            "grid": v.rng.choice(GRIDS),
            "ground": v.rng.choice(ROADS),
            "spacing": 2.0,
            "outline": True,
            "line_width": 1.5,
        },
    ),
    "draw.to_image": lambda v: (draw.to_image, {"pixels": v.image(1, 2, 3, 5)}),
    "remap": _remap,
    "warp_perspective": _warp_perspective,
    "points_from_depth": _points_from_depth,
    "rasterize": _rasterize,
    "render_points": _render_points,
    "readers": _reader,
    "HeightMap.on_grid": _on_grid,
    "pointfile.write": _write,
    "pointfile.read": _with(pointfile.read, lambda v: {"path": v.folder / v.rng.choice(FILES)}),
    "Camera.project": _project,
    "Camera.unproject": _rows_of_pixels("unproject"),
    "Camera.ground_from_pixels": _rows_of_pixels("ground_from_pixels", ground=PARAMETERS["ground"]),
    "Camera.resized": lambda v: (v.rng.choice(CAMERAS).resized, {"width": 32, "height": 24}),
    "Camera.cropped": lambda v: (v.rng.choice(CAMERAS).cropped, {"x": 3, "y": 4, "width": 32, "height": 24}),
    "Camera.from_ground_points": lambda v: (
        ipm_rs.Camera.from_ground_points,
        {
            "pixels": CAMERAS[0].project(GROUND_POINTS)[0],
            "ground_points": GROUND_POINTS[:, :2],
            "K": K.copy(),
            "image_size": (WIDTH, HEIGHT),
            "lens": CAMERAS[0].lens,
            "ground": v.rng.choice([0.0, ipm_rs.Plane(normal=(0, 0, 1))]),
            "tolerance": 4.0,
        },
    ),
    "refine.from_board": lambda v: (
        refine.from_board,
        {
            "image": BOARD.copy(),
            "corners": (5, 3),
            "square": 0.2,
            "at": (2.0, 0.0),
            "K": np.array([[90.0, 0, 71.5], [0, 90, 55.5], [0, 0, 1]]),
            "heading": 0.1,
            "tolerance": 4.0,
        },
    ),
    "refine.from_lines": lambda v: (
        refine.from_lines,
        {
            "camera": CAMERAS[0],
            "along": CAMERAS[0].project(MARKS.reshape(-1, 3))[0].reshape(-1, 2, 2),
            "across": v.rng.choice([None, CAMERAS[0].project(STOPS.reshape(-1, 3))[0].reshape(-1, 2, 2)]),
            "horizon": v.rng.choice([None, CAMERAS[0].project([(1e6, -1e5, 0), (1e6, 1e5, 0)])[0]]),
        },
    ),
    "refine.height_from_width": lambda v: (
        refine.height_from_width,
        {
            "camera": CAMERAS[0],
            "left": CAMERAS[0].project(MARKS[0])[0],
            "right": CAMERAS[0].project(MARKS[1])[0],
            "width": 2.0,
            "ground": 0.0,
        },
    ),
    "refine.height_from_travel": lambda v: (
        refine.height_from_travel,
        {
            "camera": CAMERAS[0],
            "before": CAMERAS[0].project(MARKS[:, 0])[0],
            "after": CAMERAS[0].project(MARKS[:, 0] - (0.5, 0, 0))[0],
            "distance": 0.5,
            "ground": 0.0,
        },
    ),
    "refine.from_overlaps": lambda v: (
        refine.from_overlaps,
        {
            "rig": OVERLAP,
            "images": {name: scene.render(camera) for name, camera in OVERLAP.items()},
            "fixed": v.rng.choice([None, "left"]),
            "prior": v.rng.choice([None, (1.0, 0.05)]),
            "grid": ipm_rs.BevGrid(x=(1, 7), y=(-3, 3), resolution=0.2),
            "ground": 0.0,
        },
    ),
    "refine.from_drive": lambda v: (
        refine.from_drive,
        {
            "camera": DRIVE[0],
            "images": [image.copy() for image in DRIVE[1]],
            "poses": DRIVE[2].copy(),
            "poses_of": v.rng.choice(["vehicle", "camera"]),
            "grid": ipm_rs.BevGrid(x=(4, 12), y=(-2, 2), resolution=0.1),
            "ground": 0.0,
        },
    ),
    "Camera.from_points": lambda v: (
        ipm_rs.Camera.from_points,
        {
            "pixels": CAMERAS[1].project(GROUND_POINTS + LIFTED)[0],
            "points": GROUND_POINTS + LIFTED,
            "K": v.rng.choice([K.copy(), None]),
            "image_size": (WIDTH, HEIGHT),
            "lens": CAMERAS[1].lens,
            "tolerance": 4.0,
        },
    ),
    "Camera.from_projection": lambda v: (
        ipm_rs.Camera.from_projection,
        {"P": K @ CAMERAS[0].camera_from_vehicle[:3], "image_size": (WIDTH, HEIGHT)},
    ),
    "Camera.from_fov": lambda v: (
        ipm_rs.Camera.from_fov,
        {"fov": 1.2, "image_size": (WIDTH, HEIGHT), "vertical": False, "pitch": 0.1, "lens": None},
    ),
    "Camera.masked": lambda v: (
        v.rng.choice(CAMERAS).masked,
        {"mask": textured(HEIGHT, WIDTH, 1)[..., 0] > 99, "hide": [[3, 4], [9, 4], [5, 9]]},
    ),
    "Camera.undistorted": lambda v: (
        v.rng.choice(CAMERAS[:5]).undistorted,
        {"size": (WIDTH, 24), "focal": v.rng.choice([30.0, (30, 25)]), "level": True, "lens": None},
    ),
    "Camera.project_polygon": lambda v: (
        v.rng.choice(CAMERAS).project_polygon,
        {"points": SQUARE.copy(), "ground": v.rng.choice([0.0, -0.2]), "margin": 1.0},
    ),
    "Camera.ground_polygon": lambda v: (
        CAMERAS[0].ground_polygon,
        {"pixels": [[4.0, 4], [60, 6], [50, 40]], "ground": 0.0, "max_distance": 50.0},
    ),
    "Plane.transformed": lambda v: (ROADS[2].transformed, {"T": CAMERAS[0].vehicle_from_camera @ np.eye(4)}),
    "Plane.from_camera": lambda v: (
        ipm_rs.Plane.from_camera,
        {"camera": CAMERAS[0], "normal": (0.0, -1.0, 0.1), "point": (0.0, 1.5, 0.0)},
    ),
    "Homography": lambda v: (
        ipm_rs.Homography,
        {"matrix": HOMOGRAPHY.matrix, "errors": HOMOGRAPHY.errors, "used": HOMOGRAPHY.used},
    ),
    "Homography.from_points": lambda v: (
        ipm_rs.Homography.from_points,
        {
            "image_points": CAMERAS[0].project(GROUND_POINTS)[0],
            "ground_points": GROUND_POINTS[:, :2],
            "tolerance": v.rng.choice([None, 3.0]),
        },
    ),
    "Homography.from_matrix": lambda v: (
        ipm_rs.Homography.from_matrix,
        {"M": HOMOGRAPHY.matrix.copy(), "seen": (5.0, 1.0)},
    ),
    "Homography.pixels_from_ground": lambda v: (HOMOGRAPHY.pixels_from_ground, {"xy": GROUND_POINTS[:, :2]}),
    "Homography.ground_from_pixels": lambda v: (HOMOGRAPHY.ground_from_pixels, {"uv": [[3.0, 40], [9, 4]]}),
    "Lut.between": lambda v: (
        ipm_rs.Lut.between,
        {"source": v.rng.choice(CAMERAS), "target": CAMERAS[0], "border_mode": v.rng.choice(BORDERS)},
    ),
    "Lut.from_maps": _with(
        ipm_rs.Lut.from_maps,
        lambda v: {
            **v.maps(),
            "source_size": (WIDTH, HEIGHT),
            "border_mode": v.rng.choice(BORDERS),
            "source_wraps": v.rng.choice([False, True]),
        },
    ),
    "Lut._from_bytes": _with(ipm_rs.Lut._from_bytes, lambda v: {"data": LUTS[0].__reduce__()[1][0]}),
    "BevGrid": _with(ipm_rs.BevGrid, lambda v: {"x": (4, 14), "y": (-4, 4), "resolution": PARAMETERS["resolution"](v)}),
    "RadialPolynomial": _with(ipm_rs.RadialPolynomial, lambda v: {"coefficients": [50.0, 0.1, 0, 0], "max_angle": 1.0}),
    "Fov": _with(ipm_rs.Fov, lambda v: {"omega": 0.9, "max_angle": 1.0}),
    "Division": _with(ipm_rs.Division, lambda v: {"k": -0.2, "max_angle": 1.0}),
    "ThinPrismFisheye": _with(
        ipm_rs.ThinPrismFisheye, lambda v: {"coefficients": [0.01, 0, 1e-3, 0, 0, 0, 0, 1e-3], "max_angle": 1.0}
    ),
    "FTheta": _with(
        ipm_rs.FTheta,
        lambda v: {"polynomial": [0, 50.0, 0.1], "form": "forward", "linear": (1, 0, 0), "max_angle": 1.0},
    ),
    "decode_carla_depth": _with(
        ipm_rs.decode_carla_depth,
        lambda v: {"image": textured(HEIGHT, WIDTH, 4), "order": "bgra", "normalized": True, "threads": 1},
    ),
    "encode_carla_depth": _with(
        ipm_rs.encode_carla_depth,
        lambda v: {
            "depth": v.depth(),
            "order": "rgb",
            "normalized": False,
            "out": np.zeros((HEIGHT, WIDTH, 3), np.uint8),
            "threads": 1,
        },
    ),
    "depth_to_lidar": _with(
        ipm_rs.depth_to_lidar, lambda v: {"normalized_depth": v.depth() / 10, "w": WIDTH, "h": HEIGHT, "K": K.copy()}
    ),
    "depth_to_local_point_cloud": _with(
        ipm_rs.depth_to_local_point_cloud,
        lambda v: {"normalized_depth": v.depth() / 10, "fov": 90.0, "color": v.image(3), "max_depth": 0.8},
    ),
    "Layers": _with(
        ipm_rs.Layers, lambda v: {"layers": {"max": np.zeros((2, 2))}, "inside": 1, "outside": 2, "ignored": 3}
    ),
}
OBJECTS = [
    HOMOGRAPHY,
    BOWL,
    TRAJECTORY,
    *CAMERAS,
    *GRIDS,
    *ROADS[2:],
    *LUTS,
    *LENSES.values(),
    ipm_rs.PixelRays(CAMERAS[1]),
    RIG,
    *RIG_LUTS,
]
SKIPPED = {
    "Camera.load",
    "Camera.load_all",
    "Rig.get",
}  # "readers" loads, with samples of every format; a mapping's own method
CLASSES = [item for item in vars(ipm_rs).values() if inspect.isclass(item) and not issubclass(item, (Exception, dict))]


def names() -> dict[str, Callable[[Values], tuple[Callable[..., Any], Arguments]]]:
    """Every public name that can be called, and how."""
    found = dict(RECIPES)
    for name in ipm_rs.__all__:
        item = getattr(ipm_rs, name)
        if callable(item) and not (inspect.isclass(item) and issubclass(item, Exception)):
            found.setdefault(name, _by_name(lambda v, item=item: item, item))
    for kind in CLASSES:
        own = [each for each in OBJECTS if type(each) is kind] or [_one_of(kind)]
        for name, member in inspect.getmembers(kind):
            full = f"{kind.__name__}.{name}"
            if (
                name.startswith("_")
                or full in SKIPPED
                or (
                    name.startswith("from_")
                    and hasattr(calibration, "reader")
                    and (name.removeprefix("from_") in calibration.FORMATS)
                )
            ):
                continue
            if callable(member):
                found.setdefault(full, _by_name(lambda v, own=own, name=name: getattr(v.rng.choice(own), name), member))
            else:
                found.setdefault(full, lambda v, own=own, name=name: (lambda: getattr(v.rng.choice(own), name), {}))
        for name in ("__repr__", "__reduce__", *(["__hash__"] if kind.__hash__ else [])):
            found[f"{kind.__name__}.{name}"] = lambda v, own=own, name=name: (getattr(v.rng.choice(own), name), {})
        found[f"{kind.__name__}.__eq__"] = lambda v, own=own: (
            _equal(v.rng.choice(own)),
            {"other": v.rng.choice(own)},
        )
    return found


def _equal(one: Any) -> Callable[[Any], Any]:
    """Compare by the method itself, for ``==`` asks the other object too, which may raise what it likes."""
    return lambda other: (type(one).__eq__(one, other), type(one).__ne__(one, other))


def _one_of(kind: type) -> Any:
    if kind is ipm_rs.RadialPolynomial:
        return ipm_rs.RadialPolynomial([50.0, 0.1, 0, 0])
    if kind is ipm_rs.FTheta:
        return ipm_rs.FTheta([0.0, 0.02, 1e-5], "backward")
    return ipm_rs.Ocam([200.0, 0, -1e-3])


def _by_name(function: Callable[[Values], Any], like: Any) -> Callable[[Values], tuple[Callable[..., Any], Arguments]]:
    """Arguments by the names of the parameters: those that are needed, and half of those that are not."""

    def call(v: Values) -> tuple[Callable[..., Any], Arguments]:
        arguments = {}
        for name, parameter in inspect.signature(like).parameters.items():
            needed = parameter.default is inspect.Parameter.empty
            if name != "self" and (needed or (name in PARAMETERS and v.rng.random() < 0.5)):
                arguments[name] = PARAMETERS[name](v)
        return function(v), arguments

    return call


def write_files(folder: pathlib.Path) -> None:
    """Write what the values read."""
    CAMERAS[1].save(folder / "camera.json")
    RIG.save(folder / "rig.json")
    LUTS[0].save(folder / "front.ipmlut")
    RIG_LUTS[0].save(folder / "ring.ipmlut")
    (folder / "frames").mkdir()
    for number in range(2):
        Image.fromarray(textured(HEIGHT, WIDTH, 3, seed=number)).save(folder / "frames" / f"{number}.png")
    (folder / "frames" / "list.txt").write_text("1.png\n0.png\n")
    (folder / "pitch.csv").write_text("frame,pitch_deg,vehicle_roll\n0,10,0.01\n1,11,0\n")
    write_video(folder / "a.mkv", [textured(HEIGHT, WIDTH, 3, seed=number) for number in range(3)])
    with Bag(folder / "a.bag", "bag") as bag:
        for number in range(3):
            bag.tf([("map", "base_link", (number, 0, 0), (1, 0, 0, 0))], float(number))
            bag.image("/image", textured(HEIGHT, WIDTH, seed=number), "mono8", float(number))
    np.savetxt(folder / "poses.txt", TRAJECTORY.poses[:, :3].reshape(-1, 12))
    MOSAIC.save(folder / "mosaic")
    points = np.random.default_rng(2).uniform(-5, 15, (50, 3)).astype("f4")
    for name in FILES:
        pointfile.write(folder / name, points, {"intensity": (points[:, 0] + 5) / 20})
    for name, sample in SAMPLES.items():
        sample.write(folder / name)
