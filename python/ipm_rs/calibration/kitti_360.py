"""KITTI-360: the directory ``calibration`` with one file for each relation, metres and pixels.

* ``perspective.txt``: cameras 00 and 01 (rectified, 1408 x 376): ``S_rect_xx`` width and height, ``R_rect_xx`` camera
  xx to rectified camera xx, ``P_rect_xx`` whose left 3x3 is K. Its fourth column is the stereo offset from camera 00,
  which the camera's own pose replaces here.
* ``image_02.yaml``, ``image_03.yaml``: side fisheyes (1400 x 1400), model MEI: ``xi``, ``k1 k2 p1 p2``,
  ``gamma1 gamma2 u0 v0``. All of it is used; the dataset's own devkit leaves ``p1, p2`` out, up to 0.96 px.
* ``calib_cam_to_pose.txt``: ``image_0x: 3x4``, camera (not rectified) to the GPS/IMU pose frame: the opposite direction
  of KITTI's. The pose frame has x forward, y right, z down.
* ``calib_cam_to_velo.txt``: 3x4, camera 00 (not rectified) to the Velodyne, x forward, y left, z up.

Camera axes: x right, y down, z forward. Pixel (0, 0) is read as the centre of the first.

The vehicle frame, x forward, y left, z up after reading, is

* ``frame="velodyne"``: ``ground=-1.73``, nominal;
* ``frame="pose"``: the GPS/IMU frame with y and z turned around, ``ground=-0.9``, nominal: camera 00 is 0.65 m above
  it, and 1.55 m above the road.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera, Mei
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, image_size, inverse, pinhole, rigid
from ipm_rs.calibration._files import Document, Source
from ipm_rs.calibration._lines import Files, lines_missing, nested_lines
from ipm_rs.calibration.kitti import camera_number, one_of, projection

__all__ = ["KEYS", "TITLE", "Frame", "cameras", "missing", "read"]

TITLE = "KITTI-360"
KEYS = (
    "S_rect_00", "R_rect_00", "P_rect_00", "mirror_parameters", "distortion_parameters", "projection_parameters", "xi",
    "gamma1", "gamma2", "u0", "v0",
)  # fmt: skip

_FISHEYES = ("image_02", "image_03")

Frame = Literal["velodyne", "pose"]

_PERSPECTIVE, _TO_POSE, _TO_VELODYNE = "perspective.txt", "calib_cam_to_pose.txt", "calib_cam_to_velo.txt"

_FLU_FROM_POSE = np.diag([1.0, -1.0, -1.0, 1.0])


@np.errstate(all="ignore")  # what overflows is for the camera to refuse, not for NumPy to warn of
def read(
    source: Source, *, camera: int | str | None = None, frame: Frame = "velodyne", nearest_rotation: bool = False
) -> Camera:
    """Read a camera of a KITTI-360 calibration.

    Parameters
    ----------
    source : str, path or mapping
        The directory ``calibration``, or one of its files (the others are looked for beside it), or a mapping of the
        names of the files, without extension, to their content (``calib_cam_to_velo``: 12 numbers).
    camera : int or str, optional
        0 and 1 are the rectified perspective cameras, 2 (left) and 3 (right) the fisheyes. Without it, 0, or that of an
        ``image_0x.yaml`` given as `source`.
    frame : {"velodyne", "pose"}
        Which frame the camera's vehicle frame is; see above for each one's ``ground``.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        A pinhole, or with a `Mei` lens; its image size is the file's.

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
    files = Files(source, TITLE, nearest=nearest_rotation)
    if camera is None:
        stem = files.document.path.stem if files.document else ""
        camera = stem if stem in _FISHEYES else 0
    number = camera_number(camera, (0, 1, 2, 3))
    if number in (0, 1):
        place = files.section(_PERSPECTIVE)
        width, height = place.numbers(f"S_rect_0{number}", 2, unit="pixels")
        size = image_size(float(width), float(height), place.where(f"S_rect_0{number}"))
        K, _ = projection(place, f"P_rect_0{number}")
        rectification = place.rotation(f"R_rect_0{number}")
        lens = None
    else:
        place = files.section(f"image_0{number}.yaml", nested_lines)
        size, K, lens = _fisheye(place)
        rectification = np.eye(3)
    camera_from_vehicle = rigid(rectification, (0.0, 0.0, 0.0)) @ _pose(files, number, frame)
    return build(place.origin, K, image_size=size, camera_from_vehicle=camera_from_vehicle, lens=lens)


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format."""
    if document.is_directory:
        absent = [name for name in (_PERSPECTIVE, _TO_POSE) if not (document.path / name).is_file()]
        return f"no {' and no '.join(absent)} in it" if absent else None
    if document.path.suffix == ".yaml":
        lacks = lines_missing(document, "mirror_parameters", "distortion_parameters", "projection_parameters")
        if lacks is None and document.path.stem not in _FISHEYES:
            lacks = f"another file's name than {' and '.join(_FISHEYES)}"
        # The same lens file comes with other tools (camodocal), alone.
        if lacks is None and not document.path.with_name(_TO_POSE).is_file():
            lacks = f"no {_TO_POSE} beside it"
        return lacks
    lacks = lines_missing(document, *KEYS[:3])
    if lacks is None and lines_missing(document, "P_rect_02") is None:
        lacks = "a line P_rect_02:, so KITTI's raw data"
    return lacks


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    files = Files(document, TITLE)
    perspective = files.section(_PERSPECTIVE)
    folder = document.path if document.is_directory else document.path.parent
    fisheyes = [name for name in _FISHEYES if (folder / f"{name}.yaml").is_file()]
    return [f"image_0{index}" for index in (0, 1) if f"P_rect_0{index}" in perspective] + fisheyes


def _fisheye(place: Section) -> tuple[tuple[int, int], Matrix, Mei]:
    if "model_type" in place:
        place.text("model_type", among=("MEI",))
    mirror, distortion = place.section("mirror_parameters"), place.section("distortion_parameters")
    focal = place.section("projection_parameters")
    distortion.require("k1", "k2", "p1", "p2")
    focal.require("gamma1", "gamma2", "u0", "v0")
    with blame(place.origin):
        lens = Mei(mirror.number("xi"), [distortion.number(key) for key in ("k1", "k2", "p1", "p2")])
    K = pinhole(
        focal.number("gamma1", unit="pixels", positive=True),
        focal.number("gamma2", unit="pixels", positive=True),
        focal.number("u0", unit="pixels"),
        focal.number("v0", unit="pixels"),
    )
    return place.image_size("image_width", "image_height"), K, lens


def _pose(files: Files, number: int, frame: Frame) -> Matrix:
    """(4, 4) transform from a frame, in axes x forward, y left, z up, to a camera, not rectified."""
    to_pose = files.section(_TO_POSE)
    camera_from_pose = inverse(to_pose.pose(f"image_0{number}"))
    if frame == "pose":
        return camera_from_pose @ _FLU_FROM_POSE
    velodyne = files.section(_TO_VELODYNE)
    camera0_from_velodyne = inverse(velodyne.pose(""))
    if number == 0:
        return camera0_from_velodyne
    return camera_from_pose @ to_pose.pose("image_00") @ camera0_from_velodyne
