"""KITTI calibration in one text file: object, tracking, odometry and road benchmark.

``calib/NNNNNN.txt``, odometry's ``calib.txt``; lines ``KEY: numbers``, in any order:

* ``P0`` to ``P3``: 3x4 projection matrices ``K [I | t]`` of the grey left and right (0, 1) and the colour left and
  right camera (2, 3), which take points of the rectified camera 0 to pixels. The fourth column is the stereo offset
  ``K t``: ``t = K^-1 p4`` is kept whole (with z: 3 mm; dropping it costs up to 0.6 px, dropping the column 7 px).
* ``R0_rect`` (tracking: ``R_rect``): rotation of the rectification, camera 0 to rectified camera 0.
* ``Tr_velo_to_cam`` (``Tr_velo_cam``): Velodyne to camera 0. Odometry's ``Tr`` goes to the rectified camera 0.
* ``Tr_imu_to_velo`` (``Tr_imu_velo``): GPS/IMU to Velodyne.
* ``Tr_cam_to_road``: camera 0 to the road, road benchmark only.

Metres and pixels; images are rectified, without distortion, and pixel (0, 0) is read as the centre of the first
(un-truncated labels agree). The matrices have 6 or 7 digits and are taken as they are, not made orthonormal. The files
do not hold the image size, which differs from day to day.

The vehicle frame is one of four; all are x forward, y left, z up after reading:

=============  ======================================================  ===========================================
``frame=``     origin and axes in the file                             road
=============  ======================================================  ===========================================
``velodyne``   laser scanner, x forward, y left, z up                  ``ground=-1.73``, nominal; fitted planes give
                                                                       -1.65 to -1.77
``imu``        GPS/IMU unit, x forward, y left, z up                   ``ground=-0.93``, nominal
``camera``     rectified camera 0, x right, y down, z forward          ``ground=-1.65``, nominal; measured 1.58 to 1.70
``road``       on the road below the scanner, x right, y down,         ``ground=0``, measured for each frame
               z forward
=============  ======================================================  ===========================================
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import OPTICAL_FROM_FLU, Matrix, Section, describe, inverse, listed, rigid
from ipm_rs.calibration._files import Document, Source, needs_size, open_document
from ipm_rs.calibration._lines import key_lines, lines_missing
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = ["GROUND", "KEYS", "TITLE", "Frame", "camera_number", "cameras", "missing", "projection", "read"]

TITLE = "KITTI"
KEYS = ("P0", "P3", "R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo", "Tr", "R_rect", "Tr_velo_cam")

Frame = Literal["velodyne", "imu", "camera", "road"]

GROUND: dict[Frame, float] = {"velodyne": -1.73, "imu": -0.93, "camera": -1.65, "road": 0.0}
"""Height of the road in each frame in metres, nominal."""

_SIZES = (
    "KITTI's rectified images are 1242x375, on some days 1241x376, 1238x374, 1226x370 or 1224x370: take the image's"
)


@np.errstate(all="ignore")  # what overflows is for the camera to refuse, not for NumPy to warn of
def read(
    source: Source,
    *,
    camera: int | str = 2,
    image_size: Sequence[int] | None = None,
    frame: Frame = "velodyne",
    nearest_rotation: bool = False,
) -> Camera:
    """Read a camera of a KITTI calibration file (object, tracking, odometry, road).

    Parameters
    ----------
    source : str, path or mapping
        The text file, or a mapping of its keys to lists of numbers or matrices.
    camera : int or str
        0 to 3, or "P2"; 2 is the left colour camera, whose images are ``image_2``.
    image_size : (int, int)
        Width and height in pixels; the file does not say it, and it differs: 1242x375, 1241x376, 1238x374, 1226x370,
        1224x370.
    frame : {"velodyne", "imu", "camera", "road"}
        Which frame the camera's vehicle frame is; see the table above for each one's ``ground``.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Pinhole, ``camera_from_vehicle = [I | K^-1 p4] R0_rect Tr``.

    Raises
    ------
    MissingFileError, FileError
        There is no such file, or it cannot be read.
    CalibrationError
        A key is missing, or its numbers cannot be right; or `image_size` was not given.
    ArgumentError, ArgumentTypeError
        `camera` or `frame` is none of those above, or an argument has the wrong type.
    """
    check_word("camera", camera)
    frame = one_of("frame", frame, get_args(Frame))
    index = camera_number(camera, (0, 1, 2, 3))
    if isinstance(source, Mapping):
        place = Section(source, f"{TITLE} calibration")
    else:
        place = key_lines(open_document(source, TITLE, or_mapping=True))
    place.nearest = nearest_rotation
    held = [str(k) for k in range(4) if f"P{k}" in place]
    if held and str(index) not in held:
        raise CalibrationError(
            f"{place.origin}: expected P{index} for camera={index}, got a file of cameras {', '.join(held)}; pass "
            f"camera={held[0]}, and the images of that camera"
        )
    K, offset = projection(place, f"P{index}")
    rectified_from_vehicle = _pose(place, frame)
    size = needs_size(image_size, place.origin, _SIZES)
    pose = rigid(np.eye(3), offset) @ rectified_from_vehicle
    return build(place.where(f"P{index}"), K, image_size=size, camera_from_vehicle=pose)


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format: sequences of grey cameras have P0 and P1 alone."""
    keys = ("P0", "P1", "P2", "P3")
    some = any(lines_missing(document, key) is None for key in keys)
    return None if some else lines_missing(document, *keys)


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    place = key_lines(document)
    return [f"P{index}" for index in range(4) if f"P{index}" in place]


def projection(place: Section, key: str) -> tuple[Matrix, Matrix]:
    """K, (3, 3), and the offset ``K^-1 p4``, (3,), of a projection matrix ``K [I | t]``."""
    P = place.matrix(key, (3, 4))
    K = P[:, :3]
    if not (K[0, 0] > 0 and K[1, 1] > 0 and K[1, 0] == 0 and np.array_equal(K[2], (0, 0, 1))):
        raise CalibrationError(
            f"{place.where(key)}: expected K [I | t] with K = [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] and fx, fy > 0, "
            f"got rows {' / '.join(' '.join(f'{x:g}' for x in row) for row in K)}; check the order of the numbers"
        )
    offset = np.asarray(np.linalg.solve(K, P[:, 3]), dtype=np.float64)
    return K, offset


def one_of(name: str, value: Any, words: Sequence[str]) -> Any:
    """Check a word among few."""
    if not isinstance(value, str):
        raise ArgumentTypeError(f"{name}: expected one of {listed(words)}, got {describe(value)}; pass one of these")
    if value not in words:
        raise ArgumentError(f"{name}: expected one of {listed(words)}, got {value!r}; pass one of these")
    return value


def camera_number(camera: Any, among: Sequence[int]) -> int:
    """Check a camera's number: 2, "2", "02", "P2", "image_02"."""
    wanted = f"camera: expected one of {', '.join(map(str, among))}, got"
    number = camera
    if isinstance(camera, str):
        digits = re.fullmatch(r"(?:P|cam_?|image_?)?0?([0-9])", camera)
        number = int(digits[1]) if digits else None
    elif isinstance(camera, bool) or not isinstance(camera, (int, np.integer)):
        raise ArgumentTypeError(f"{wanted} {describe(camera)}; pass its number")
    if number not in among:
        raise ArgumentError(f"{wanted} {camera!r}; pass its number")
    return int(number)


def _pose(place: Section, frame: Frame) -> Matrix:
    """(4, 4) transform from a frame, in axes x forward, y left, z up, to the rectified camera 0."""
    optical_from_flu = rigid(OPTICAL_FROM_FLU, (0.0, 0.0, 0.0))
    if frame == "camera":
        return optical_from_flu
    _require_frame(place, frame)
    if frame == "road":
        road_from_camera = place.pose("Tr_cam_to_road")
        return _rectification(place) @ inverse(road_from_camera) @ optical_from_flu
    if "Tr" in place:  # odometry: to the rectified camera already
        rectified_from_velodyne = place.pose("Tr")
    else:
        rectified_from_velodyne = _rectification(place) @ place.pose(_alias(place, "Tr_velo_to_cam", "Tr_velo_cam"))
    if frame == "velodyne":
        return rectified_from_velodyne
    return rectified_from_velodyne @ place.pose(_alias(place, "Tr_imu_to_velo", "Tr_imu_velo"))


def _require_frame(place: Section, frame: Frame) -> None:
    """Refuse a file without a way to the frame: odometry's often hold projection matrices alone."""
    if not any(key.startswith("Tr") for key in place.content if isinstance(key, str)):
        raise CalibrationError(
            f"{place.origin}: expected Tr, or R0_rect and Tr_velo_to_cam, for frame={frame!r}, missing; add them, or "
            'pass frame="camera" for the frame of the rectified camera 0, which needs neither'
        )


def _rectification(place: Section) -> Matrix:
    return rigid(place.rotation(_alias(place, "R0_rect", "R_rect")), (0.0, 0.0, 0.0))


def _alias(place: Section, *keys: str) -> str:
    """Return the first of the keys that is there, the first of all if none is."""
    return next((key for key in keys if key in place), keys[0])
