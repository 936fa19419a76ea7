"""KITTI raw data: ``calib_cam_to_cam.txt`` and its neighbours ``calib_velo_to_cam.txt``, ``calib_imu_to_velo.txt``.

For cameras 00 to 03 (grey left and right, colour left and right) ``calib_cam_to_cam.txt`` has, in metres and pixels:

* rectified images (``image_02/data`` of the *synced+rectified* drives): ``S_rect_xx`` width and height, ``P_rect_xx`` =
  ``K [I | t]``, to be used with ``R_rect_00`` (of camera 00, whichever camera is meant);
* the raw images: ``S_xx``, ``K_xx``, the lens ``D_xx = k1 k2 p1 p2 k3`` (Brown-Conrady), and ``R_xx, T_xx``, camera 00
  to camera xx.

``calib_velo_to_cam.txt`` (``R``, ``T``) goes from the Velodyne to camera 00, ``calib_imu_to_velo.txt`` from the GPS/IMU
unit to the Velodyne. Matrices are taken as printed. Pixel (0, 0) is read as the centre of the first.

The vehicle frame is one of three; all are x forward, y left, z up after reading. (A copy of the dataset's readme says
"x forward, y right, z down" of the GPS/IMU unit; the data say otherwise: its rotation to the Velodyne is within one
degree of none.)

* ``frame="velodyne"``: ``ground=-1.73``, nominal; fitted planes give -1.65 to -1.77;
* ``frame="imu"``: ``ground=-0.93``, nominal;
* ``frame="camera"``: rectified camera 00, ``ground=-1.65``, nominal; measured 1.58 to 1.70.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import (
    OPTICAL_FROM_FLU,
    Matrix,
    Section,
    blame,
    coefficients,
    image_size,
    inverse,
    rigid,
)
from ipm_rs.calibration._files import Document, Source
from ipm_rs.calibration._lines import Files, lines_missing
from ipm_rs.calibration.kitti import camera_number, one_of, projection

__all__ = ["KEYS", "TITLE", "Frame", "cameras", "missing", "read"]

TITLE = "KITTI raw"
KEYS = ("R_rect_00", "P_rect_00", "K_00", "P_rect_02", "S_00", "D_00", "R_00", "T_00", "S_rect_00")

Frame = Literal["velodyne", "imu", "camera"]

_CAMERAS, _VELODYNE, _IMU = "calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt"


@np.errstate(all="ignore")  # what overflows is for the camera to refuse, not for NumPy to warn of
def read(
    source: Source,
    *,
    camera: int | str = 2,
    rectified: bool = True,
    frame: Frame = "velodyne",
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera of a KITTI raw calibration.

    Parameters
    ----------
    source : str, path or mapping
        The day's directory, or the ``calib_cam_to_cam.txt`` in it (the others are looked for beside it), or a mapping
        of the names of the files, without ``.txt``, to mappings of their keys to numbers.
    camera : int or str
        0 to 3; 2 is the left colour camera.
    rectified : bool
        The camera of the rectified images, a pinhole; False: of the raw images, with their lens.
    frame : {"velodyne", "imu", "camera"}
        Which frame the camera's vehicle frame is; see above for each one's ``ground``.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Its image size is the file's.

    Raises
    ------
    MissingFileError, FileError
        A file is missing or cannot be read.
    CalibrationError
        A key is missing, or its numbers cannot be right.
    ArgumentError, ArgumentTypeError
        `camera` or `frame` is none of those above, or an argument has the wrong type.
    """
    check_word("camera", camera)
    frame = one_of("frame", frame, get_args(Frame))
    name = f"{camera_number(camera, (0, 1, 2, 3)):02d}"
    files = Files(source, TITLE, nearest=nearest_rotation)
    cameras = files.section(_CAMERAS)
    rectification = rigid(cameras.rotation("R_rect_00"), (0.0, 0.0, 0.0))
    camera0_from_vehicle = _pose(files, frame, rectification)
    lens = None
    if rectified:
        size = _size(cameras, f"S_rect_{name}")
        K, offset = projection(cameras, f"P_rect_{name}")
        pose = rigid(np.eye(3), offset) @ rectification @ camera0_from_vehicle
    else:
        size = _size(cameras, f"S_{name}")
        K = cameras.matrix(f"K_{name}", (3, 3))
        pose = _transform(cameras, f"R_{name}", f"T_{name}") @ camera0_from_vehicle
        with blame(cameras.where(f"D_{name}")):
            lens = BrownConrady(coefficients(cameras.value(f"D_{name}"), cameras.where(f"D_{name}"), (5,)))
    where = cameras.where(f"P_rect_{name}" if rectified else f"K_{name}")
    return build(where, K, image_size=size, camera_from_vehicle=pose, lens=lens)


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format."""
    if document.is_directory:
        return None if (document.path / _CAMERAS).is_file() else f"no {_CAMERAS} in it"
    return lines_missing(document, *KEYS[:4])


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    place = Files(document, TITLE).section(_CAMERAS)
    return [f"image_0{index}" for index in range(4) if f"P_rect_0{index}" in place]


def _pose(files: Files, frame: Frame, rectification: Matrix) -> Matrix:
    """(4, 4) transform from a frame, in axes x forward, y left, z up, to camera 00, not rectified."""
    if frame == "camera":
        return inverse(rectification) @ rigid(OPTICAL_FROM_FLU, (0.0, 0.0, 0.0))
    camera0_from_velodyne = _transform(files.section(_VELODYNE), "R", "T")
    if frame == "velodyne":
        return camera0_from_velodyne
    return camera0_from_velodyne @ _transform(files.section(_IMU), "R", "T")


def _transform(place: Section, R: str, t: str) -> Matrix:
    place.require(R, t)
    return rigid(place.rotation(R), place.numbers(t, 3, unit="metres"))


def _size(place: Section, key: str) -> tuple[int, int]:
    width, height = place.numbers(key, 2, unit="pixels")
    return image_size(float(width), float(height), place.where(key))
