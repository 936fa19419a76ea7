"""Metric bird's-eye views from calibrated cameras: inverse perspective mapping, fast.

    camera = ipm_rs.Camera.from_cityscapes("camera.json")
    grid = ipm_rs.BevGrid(x=(7, 50), y=(-10, 10), resolution=0.05)
    lut = ipm_rs.Lut(camera, grid)          # built once
    bev = lut.warp(image)                   # for every frame

Frames: vehicle ISO 8855 (x forward, y left, z up, metres), camera optical (x right, y down, z forward), pixel (0, 0)
the centre of the top-left pixel. Transforms are named `dst_from_src`; angles are in radians, positive pitch looks down.
"""

import importlib
from typing import TYPE_CHECKING

from ipm_rs import _notebook, calibration, errors
from ipm_rs._core import (
    BevGrid,
    BrownConrady,
    Camera,
    Cylindrical,
    Division,
    DoubleSphere,
    Equirectangular,
    Eucm,
    Fov,
    FTheta,
    HeightMap,
    InverseBrownConrady,
    KannalaBrandt,
    Lut,
    Mei,
    Ocam,
    PixelRays,
    Plane,
    RadialPolynomial,
    ThinPrismFisheye,
    __version__,
    cpu_info,
    decode_carla_depth,
    depth_to_lidar,
    depth_to_local_point_cloud,
    encode_carla_depth,
    flip_handedness,
    flip_handedness_euler,
    flip_handedness_pose,
    flip_handedness_rotation,
    get_num_threads,
    homography_from_points,
    points_from_depth,
    rasterize,
    rasterize_boxes,
    rasterize_polygons,
    remap,
    render_points,
    rotation_from_euler,
    set_num_threads,
    vanishing_point,
    warp_perspective,
)
from ipm_rs.errors import (
    ArgumentError,
    ArgumentTypeError,
    CalibrationError,
    CalibrationWarning,
    DtypeError,
    FileError,
    GridError,
    ImageError,
    IpmError,
    LutError,
    MissingExtraError,
    MissingFileError,
    MosaicError,
    OutOfMemoryError,
)
from ipm_rs.ground.homography import Homography
from ipm_rs.layers import Layers
from ipm_rs.rig import Bowl, Rig, RigLut
from ipm_rs.trajectory import Trajectory

if TYPE_CHECKING:
    from ipm_rs import diagnosis, draw, pointfile, reference, refine, streams
    from ipm_rs import ray as ray
    from ipm_rs import torch as torch
    from ipm_rs.diagnosis import doctor
    from ipm_rs.mosaic import Mosaic

__all__ = [
    "ArgumentError",
    "ArgumentTypeError",
    "BevGrid",
    "Bowl",
    "BrownConrady",
    "CalibrationError",
    "CalibrationWarning",
    "Camera",
    "Cylindrical",
    "Division",
    "DoubleSphere",
    "DtypeError",
    "Equirectangular",
    "Eucm",
    "FTheta",
    "FileError",
    "Fov",
    "GridError",
    "HeightMap",
    "Homography",
    "ImageError",
    "InverseBrownConrady",
    "IpmError",
    "KannalaBrandt",
    "Layers",
    "Lut",
    "LutError",
    "Mei",
    "MissingExtraError",
    "MissingFileError",
    "Mosaic",
    "MosaicError",
    "Ocam",
    "OutOfMemoryError",
    "PixelRays",
    "Plane",
    "RadialPolynomial",
    "Rig",
    "RigLut",
    "ThinPrismFisheye",
    "Trajectory",
    "__version__",
    "calibration",
    "cpu_info",
    "decode_carla_depth",
    "depth_to_lidar",
    "depth_to_local_point_cloud",
    "diagnosis",
    "doctor",
    "draw",
    "encode_carla_depth",
    "errors",
    "flip_handedness",
    "flip_handedness_euler",
    "flip_handedness_pose",
    "flip_handedness_rotation",
    "get_num_threads",
    "homography_from_points",
    "pointfile",
    "points_from_depth",
    "rasterize",
    "rasterize_boxes",
    "rasterize_polygons",
    "reference",
    "refine",
    "remap",
    "render_points",
    "rotation_from_euler",
    "set_num_threads",
    "streams",
    "vanishing_point",
    "warp_perspective",
]


def __getattr__(name: str) -> object:
    # When they are asked for: few programs need them. `ray` and `torch` are not in __all__, for they would hide the
    # names of those packages.
    if name in ("diagnosis", "draw", "pointfile", "ray", "reference", "refine", "streams", "torch"):
        return importlib.import_module(f"ipm_rs.{name}")
    if name == "doctor":
        return importlib.import_module("ipm_rs.diagnosis").doctor
    if name == "Mosaic":
        return importlib.import_module("ipm_rs.mosaic").Mosaic
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


_notebook.attach()


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
