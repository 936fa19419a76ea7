"""Metric bird's-eye views from calibrated cameras: inverse perspective mapping, fast.

    camera = ipm_rs.Camera.from_cityscapes("camera.json")
    grid = ipm_rs.BevGrid(x=(7, 50), y=(-10, 10), resolution=0.05)
    lut = ipm_rs.Lut(camera, grid)          # built once
    bev = lut.warp(image)                   # for every frame

Frames: vehicle ISO 8855 (x forward, y left, z up, metres), camera optical (x right, y down, z forward), pixel (0, 0)
the centre of the top-left pixel. Transforms are named `dst_from_src`; angles are in radians, positive pitch looks down.
"""

from ipm_rs import errors, reference
from ipm_rs._core import (
    BevGrid,
    BrownConrady,
    Camera,
    DoubleSphere,
    Eucm,
    HeightMap,
    KannalaBrandt,
    Lut,
    Mei,
    Ocam,
    Plane,
    RadialPolynomial,
    __version__,
    cpu_info,
    flip_handedness,
    flip_handedness_euler,
    flip_handedness_pose,
    flip_handedness_rotation,
    get_num_threads,
    remap,
    rotation_from_euler,
    set_num_threads,
    warp_perspective,
)
from ipm_rs.errors import (
    ArgumentError,
    ArgumentTypeError,
    CalibrationError,
    DtypeError,
    FileError,
    GridError,
    ImageError,
    IpmError,
    LutError,
    MissingExtraError,
    MissingFileError,
    OutOfMemoryError,
)

__all__ = [
    "ArgumentError",
    "ArgumentTypeError",
    "BevGrid",
    "BrownConrady",
    "CalibrationError",
    "Camera",
    "DoubleSphere",
    "DtypeError",
    "Eucm",
    "FileError",
    "GridError",
    "HeightMap",
    "ImageError",
    "IpmError",
    "KannalaBrandt",
    "Lut",
    "LutError",
    "Mei",
    "MissingExtraError",
    "MissingFileError",
    "Ocam",
    "OutOfMemoryError",
    "Plane",
    "RadialPolynomial",
    "__version__",
    "cpu_info",
    "errors",
    "flip_handedness",
    "flip_handedness_euler",
    "flip_handedness_pose",
    "flip_handedness_rotation",
    "get_num_threads",
    "reference",
    "remap",
    "rotation_from_euler",
    "set_num_threads",
    "warp_perspective",
]
