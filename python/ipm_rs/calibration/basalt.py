"""basalt's ``calibration.json``, also of the Monado headset tools.

The format, after basalt-headers' serialisation; everything is in ``value0``, a list entry for each camera:

* ``T_imu_cam``: points of the camera to the IMU; ``px py pz`` in metres, quaternion ``qx qy qz qw``.
* ``intrinsics``: ``camera_type`` with ``intrinsics`` by name, so their order (basalt puts xi and alpha **last**, Kalibr
  first) does not matter: ``pinhole``, ``kb4`` (k1 to k4), ``ds`` (xi, alpha), ``eucm`` (alpha, beta), ``ucm`` (alpha:
  EUCM with beta = 1), ``pinhole-radtan8`` (k1, k2, p1, p2, k3 to k6; its ``rpmax`` limits what basalt uses of the
  image, and is not kept, since our lens finds where it folds by itself).
* ``resolution``: [width, height]. Pixel (0, 0) is a pixel's centre, axes optical (x right, y down, z forward).

The file knows no road and no vehicle: ``vehicle_from_imu=`` says how the IMU stands on the vehicle (x forward, y left,
z up); without it the first camera is at the origin and looks along +x, and ``ground=`` is minus its height.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, DoubleSphere, Eucm, KannalaBrandt
from ipm_rs.calibration._bodies import on_body, pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Matrix, Section, blame, pinhole, quaternion, rigid
from ipm_rs.calibration._files import Document, Source, keys_missing, read_json, same_size

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "basalt"
KEYS = ("value0", "T_imu_cam", "intrinsics", "resolution", "camera_type", "vignette", "calib_accel_bias")

_TERMS = {
    "pinhole": (),
    "kb4": ("k1", "k2", "k3", "k4"),
    "ds": ("xi", "alpha"),
    "eucm": ("alpha", "beta"),
    "ucm": ("alpha",),
    "pinhole-radtan8": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    return keys_missing(document, "value0.T_imu_cam", "value0.intrinsics", "value0.resolution")


def cameras(document: Document) -> list[str]:
    """Numbers of the cameras, as ``camera=`` takes them."""
    return [str(index) for index, _ in enumerate(read_json(document, TITLE).section("value0").sections("intrinsics"))]


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: Source,
    *,
    camera: int | str | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_imu: ArrayLike | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of a basalt calibration.

    Parameters
    ----------
    source : str, path or mapping
        The JSON file, or its content as a mapping.
    camera : int, optional
        Its number from 0; needed if the file holds more than one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_imu : (4, 4) array, optional
        Pose of the IMU in the vehicle frame.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        Where ``vehicle_from_imu`` and the file put it, else as seen from the first, which looks along +x.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing, a value cannot be right, or the camera's type has no lens here.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    """
    check_word("camera", camera)
    content = read_json(source, TITLE)
    content.nearest = nearest_rotation
    value = content.section("value0")
    poses, cameras = value.sections("T_imu_cam"), value.sections("intrinsics")
    index = pick([str(number) for number in range(len(cameras))], camera, content.origin)
    place = cameras[index]
    kind = place.text("camera_type", among=tuple(_TERMS))
    values = place.section("intrinsics")
    values.require("fx", "fy", "cx", "cy", *_TERMS[kind])
    sizes = value.listed("resolution", len(cameras))
    size = Section({"resolution": sizes[index]}, content.origin, f"value0[{index}]").pair("resolution")
    same_size(image_size, size, content.origin)
    lens = _lens(kind, [values.number(term) for term in _TERMS[kind]], place.where())
    value.listed("T_imu_cam", len(cameras))
    pose = on_body(_pose(poses[index]), _pose(poses[0]), vehicle_from_imu, "vehicle_from_imu", nearest=nearest_rotation)
    K = pinhole(*(values.number(key, unit="pixels") for key in ("fx", "fy", "cx", "cy")))
    return build(place.where(), K, image_size=size, camera_from_vehicle=pose, lens=lens)


def _lens(kind: str, terms: list[float], where: str) -> Any:
    with blame(where):
        if kind == "kb4":
            return KannalaBrandt(terms)
        if kind == "ds":
            return DoubleSphere(*terms)
        if kind in ("eucm", "ucm"):
            return Eucm(terms[0], terms[1] if kind == "eucm" else 1.0)
        return BrownConrady(terms) if any(terms) else None


def _pose(place: Section) -> Matrix:
    q = [place.number(key) for key in ("qx", "qy", "qz", "qw")]
    t = [place.number(key, unit="metres") for key in ("px", "py", "pz")]
    return rigid(quaternion(q, place.where("qx qy qz qw"), "xyzw", nearest=place.nearest), t)
