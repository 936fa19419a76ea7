"""Kalibr camera chains: ``camchain.yaml``, ``camchain-imucam.yaml``, and OpenVINS's ``kalibr_imucam_chain.yaml``.

The format, after Kalibr's ``ConfigReader.py``. One section ``cam0``, ``cam1``, ... for each camera:

* ``intrinsics``: ``pinhole`` [fu, fv, pu, pv]; ``omni`` [xi, fu, fv, pu, pv]; ``ds`` [xi, alpha, fu, fv, pu, pv];
  ``eucm`` [alpha, beta, fu, fv, pu, pv]. (basalt, whose files are JSON, puts xi and alpha last.)
* ``distortion_model`` ``radtan`` [k1, k2, p1, p2], ``equidistant`` [k1, k2, k3, k4] and ``fov`` [omega] for pinhole,
  ``radtan`` for omni, ``none`` for all.
* ``resolution`` [width, height]; pixel (0, 0) is a pixel's centre; axes optical (x right, y down, z forward).
* ``T_cam_imu`` takes points of the IMU to the camera; OpenVINS writes the inverse, ``T_imu_cam``. ``T_cn_cnm1`` takes
  points of the camera before to this camera (``baseline_last_to_this_cam`` in old files).

The file knows no road and no vehicle. How the chain stands on the vehicle is the caller's: ``vehicle_from_cam0=`` or
``vehicle_from_imu=``, into x forward, y left, z up. With neither, ``cam0`` is at the origin and looks along +x, the
others stand beside it, and ``ground=`` is minus the height of ``cam0`` over the road.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, DoubleSphere, Eucm, Fov, KannalaBrandt, Mei
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import OPTICAL_FROM_FLU, Section, blame, coefficients, inverse, listed, pinhole, rigid
from ipm_rs.calibration._files import Document, Source, open_document, same_size
from ipm_rs.calibration._lenswords import FOREIGN, plain_word, refuse_foreign
from ipm_rs.calibration._mount import rigid_argument
from ipm_rs.errors import ArgumentError, CalibrationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "cameras", "missing", "read"]

TITLE = "Kalibr camchain"
KEYS = (
    "cam0", "camera_model", "intrinsics", "distortion_model", "distortion_coeffs", "resolution", "T_cam_imu",
    "T_cn_cnm1", "cam_overlaps", "rostopic",
)  # fmt: skip

_CAMERA = re.compile(r"cam([0-9]{1,3})")
_MODELS = {"pinhole": 0, "omni": 1, "ds": 2, "eucm": 2}  # numbers before fu, fv, pu, pv
_DISTORTIONS = {
    "pinhole": {"radtan": 4, "equidistant": 4, "fov": 1, "none": 0},
    "omni": {"radtan": 4, "none": 0},
    "ds": {"none": 0},
    "eucm": {"none": 0},
}
_BEFORE = ("T_cn_cnm1", "baseline_last_to_this_cam")

Matrix = NDArray[np.float64]


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if document.is_directory:
        return "a directory"
    tree = document.tree
    if not isinstance(tree, Mapping):
        return "no section cam0"
    if isinstance(tree.get("value0"), Mapping) and "intrinsics" in tree["value0"]:
        return "basalt's calibration.json, whose numbers stand in another order"
    cameras = [value for key, value in tree.items() if _CAMERA.fullmatch(key) and isinstance(value, Mapping)]
    if not cameras:
        return "no section cam0"
    lacks = [key for key in ("camera_model", "intrinsics") if not any(key in value for value in cameras)]
    return f"no key {', '.join(map(repr, lacks))} in cam0" if lacks else None


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    return sorted((key for key in document.tree if isinstance(key, str) and _CAMERA.fullmatch(key)), key=_index)


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: str | int | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_cam0: ArrayLike | None = None,
    vehicle_from_imu: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of a Kalibr chain.

    Parameters
    ----------
    source : str, path or mapping
        A camchain file (needs the extra ``yaml``), or its content as a mapping.
    camera : str or int, optional
        ``"cam1"`` or 1; needed if the file holds more than one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_cam0 : (4, 4) array, optional
        Pose of the chain's first camera (optical axes) in the vehicle frame; the others follow through the chain.
    vehicle_from_imu : (4, 4) array, optional
        Pose of the IMU in the vehicle frame, for files with ``T_cam_imu``. An IMU's axes are rarely those of the
        vehicle, so it is never assumed.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        In the vehicle frame that the caller's pose means; with no pose, ``cam0`` is the origin and looks along +x.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        The content is no camera chain, a value in it cannot be right, or its lens has no model here.
    ArgumentError, ArgumentTypeError
        There is no such camera; both poses are given; an argument has the wrong type.
    MissingExtraError
        PyYAML is not installed.
    """
    check_word("camera", camera)
    chain = _content(source)
    chain.nearest = nearest_rotation
    names = sorted((key for key in chain.content if isinstance(key, str) and _CAMERA.fullmatch(key)), key=_index)
    name = _choose(names, camera, chain.origin)
    section = chain.section(name)
    section.require("camera_model", "intrinsics", "distortion_model", "distortion_coeffs", "resolution")
    if section.value("distortion_coeffs") is None:  # an empty value instead of []
        section = Section(
            {**section.content, "distortion_coeffs": []}, section.origin, section.path, nearest=nearest_rotation
        )
    model = section.text("camera_model", among=tuple(_MODELS))
    values = section.numbers("intrinsics", 4 + _MODELS[model])
    own, (fu, fv, pu, pv) = values[:-4], values[-4:]
    resolution = section.numbers("resolution", 2, unit="pixels")
    size = Section({"width": resolution[0], "height": resolution[1]}, section.origin, f"{name}.resolution").image_size(
        "width", "height"
    )
    same_size(image_size, size, chain.origin)
    coefficients = _distortion(section, model)
    pose = _pose(chain, names, name, vehicle_from_cam0, vehicle_from_imu)
    with blame(f"{chain.origin}: {name}"):
        lens: Any = None
        if model == "omni":
            lens = Mei(own[0], coefficients if len(coefficients) else np.zeros(4))
        elif model == "ds":
            lens = DoubleSphere(own[0], own[1])
        elif model == "eucm":
            lens = Eucm(own[0], own[1])
        elif section.content["distortion_model"] == "equidistant":
            lens = KannalaBrandt(coefficients)
        elif section.content["distortion_model"] == "fov":
            lens = Fov(coefficients[0]) if len(coefficients) else None
        elif coefficients.any():
            lens = BrownConrady(coefficients)
    return build(
        f"{chain.origin}: {name}", pinhole(fu, fv, pu, pv), image_size=size, camera_from_vehicle=pose, lens=lens
    )


def _content(source: Source) -> Section:
    if isinstance(source, Mapping):
        return Section(source, f"{TITLE} calibration")
    document = open_document(source, TITLE, or_mapping=True)
    chain = Section(document.tree, document.origin)
    if "value0" in chain:
        raise CalibrationError(
            f"{document.origin}: expected a Kalibr camchain, got basalt's calibration.json, whose numbers stand in "
            "another order; read it with Camera.from_basalt"
        )
    return chain


def _index(name: str) -> int:
    return int(name[3:])


def _choose(names: list[str], camera: str | int | None, origin: str) -> str:
    if not names:
        raise CalibrationError(f"{origin}: expected a section cam0, found none; pass the camchain file of Kalibr")
    if camera is None:
        if len(names) > 1:
            raise ArgumentError(f"{origin}: camera: expected one of {listed(names)}, got None; say which to read")
        return names[0]
    name = f"cam{camera}" if isinstance(camera, (int, np.integer)) and not isinstance(camera, bool) else camera
    if not isinstance(name, str) or name not in names:
        raise ArgumentError(
            f"{origin}: camera: expected one of {listed(names)}, got {camera!r:.60}; choose one of them"
        )
    return name


def _distortion(section: Section, model: str) -> Matrix:
    kind = section.text("distortion_model")
    terms = section.numbers("distortion_coeffs")
    if len(terms) and not terms.any() and plain_word(kind) in FOREIGN:
        refuse_foreign({"distortion_model": kind}, section.where(), bends=False, known="radtan or equidistant")
        return np.zeros(0)
    if kind == "equi":  # the name on Kalibr's command line
        raise CalibrationError(
            f"{section.where('distortion_model')}: expected 'equidistant', got 'equi', its name on the command line; "
            "write equidistant"
        )
    counts = _DISTORTIONS[model]
    section.text("distortion_model", among=tuple(counts))
    return coefficients(terms, section.where("distortion_coeffs"), (counts[kind],))


def _pose(
    chain: Section, names: list[str], name: str, vehicle_from_cam0: ArrayLike | None, vehicle_from_imu: ArrayLike | None
) -> Matrix:
    """``camera_from_vehicle`` of the camera `name`."""
    if vehicle_from_imu is not None:
        if vehicle_from_cam0 is not None:
            raise ArgumentError("vehicle_from_cam0, vehicle_from_imu: expected one of them, got both; leave one out")
        camera_from_imu = _camera_from_imu(chain.section(name))
        if camera_from_imu is None:
            raise CalibrationError(
                f"{chain.where(name)}: expected T_cam_imu, which vehicle_from_imu= needs, missing; "
                "pass vehicle_from_cam0="
            )
        return camera_from_imu @ inverse(rigid_argument(vehicle_from_imu, "vehicle_from_imu", nearest=chain.nearest))
    if vehicle_from_cam0 is None:
        cam0_from_vehicle = rigid(OPTICAL_FROM_FLU, np.zeros(3))
    else:
        cam0_from_vehicle = inverse(rigid_argument(vehicle_from_cam0, "vehicle_from_cam0", nearest=chain.nearest))
    camera_from_cam0 = _camera_from_cam0(chain, names, name)
    return cam0_from_vehicle if camera_from_cam0 is None else camera_from_cam0 @ cam0_from_vehicle


def _camera_from_imu(section: Section) -> Matrix | None:
    both = [key for key in ("T_cam_imu", "T_imu_cam") if key in section]
    if len(both) == 2:
        raise CalibrationError(
            f"{section.where()}: expected T_cam_imu or its inverse T_imu_cam, got both; remove one, they may disagree"
        )
    if not both:
        return None
    T = section.pose(both[0])
    return T if both == ["T_cam_imu"] else inverse(T)


def _camera_from_cam0(chain: Section, names: list[str], name: str) -> Matrix | None:
    """From the first camera to this one: along the chain, or through the IMU; None for the first itself."""
    if name == names[0]:
        return None
    T = np.eye(4)
    for previous, this in pairwise(names):
        section = chain.section(this)
        key = next((key for key in _BEFORE if key in section), None)
        if key is None or _index(this) != _index(previous) + 1:
            break
        T = section.pose(key) @ T
        if this == name:
            return T
    first, own = (_camera_from_imu(chain.section(camera)) for camera in (names[0], name))
    if first is None or own is None:
        raise CalibrationError(
            f"{chain.where(name)}: expected T_cn_cnm1 from camera to camera, or T_cam_imu here and in {names[0]}, "
            "missing; add them, or read the camera from a file of its own"
        )
    return own @ inverse(first)
