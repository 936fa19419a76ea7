"""WoodScape fisheye calibrations: ``calibration/<id>_<camera>.json`` (also the SynWoodScape files).

The format, after the dataset's own readme and ``projection.py``:

* ``extrinsic``: ``quaternion`` **[x, y, z, w]** and ``translation`` (metres) take the camera's optical axes (x right,
  y down, z forward) to the vehicle. Read as w, x, y, z the front camera would look to the left.
* The vehicle frame is ISO 8855 (x forward, y left, z up), its origin on the ground below the rear axle: the road is at
  ``z = 0``, the default ``ground=``.
* ``intrinsic``: model ``radial_poly``; a ray at the angle theta from the axis lies
  ``rho = k1 theta + k2 theta^2 + k3 theta^3 + k4 theta^4`` **pixels** from the principal point, times ``aspect_ratio``
  in v. The model holds beyond 90 degrees.
* Pixel (0, 0) is a pixel's centre; the principal point is ``(width / 2 - 0.5 + cx_offset, height / 2 - 0.5 +
  cy_offset)``.
"""

from __future__ import annotations

import numpy as np

from ipm_rs._core import Camera, RadialPolynomial
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import blame, rigid
from ipm_rs.calibration._files import Document, Source, keys_missing, read_json, same_size
from ipm_rs.errors import CalibrationError

__all__ = ["KEYS", "missing", "read"]

TITLE = "WoodScape"
KEYS = (
    "extrinsic", "intrinsic", "quaternion", "translation", "poly_order", "k1", "k2", "k3", "k4", "cx_offset",
    "cy_offset", "aspect_ratio",
)  # fmt: skip

_LEAST_FOCAL = 0.01  # of the width: a fisheye of 180 degrees has 0.3


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    lacking = keys_missing(document, "extrinsic", "intrinsic")
    if lacking:
        return lacking
    intrinsic = document.json["intrinsic"]
    return None if isinstance(intrinsic, dict) and "poly_order" in intrinsic else "no key 'poly_order' in intrinsic"


def read(source: Source, *, image_size: tuple[int, int] | None = None, nearest_rotation: bool = False) -> Camera:
    """Read a WoodScape camera.

    Parameters
    ----------
    source : str, path or mapping
        A JSON file of the dataset, or its content as a mapping.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        With a `RadialPolynomial` lens, in the vehicle frame of the dataset: x forward, y left, z up, the road at z = 0.

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        A key is missing or cannot be right, or the model is none of `radial_poly` with four coefficients.
    ArgumentTypeError
        `source` is neither a path nor a mapping.
    """
    content = read_json(source, TITLE)
    content.nearest = nearest_rotation
    content.require("extrinsic", "intrinsic")
    extrinsic, intrinsic = content.section("extrinsic"), content.section("intrinsic")
    extrinsic.require("quaternion", "translation")
    intrinsic.require(
        "model", "poly_order", "k1", "k2", "k3", "k4", "cx_offset", "cy_offset", "width", "height", "aspect_ratio"
    )
    intrinsic.text("model", among=("radial_poly",))
    if intrinsic.whole("poly_order") != 4:
        raise CalibrationError(
            f"{intrinsic.where('poly_order')}: expected 4, k1 to k4, got {intrinsic.whole('poly_order')}; "
            "no other order is known"
        )
    size = intrinsic.image_size("width", "height")
    same_size(image_size, size, content.origin)
    cx = size[0] / 2 - 0.5 + intrinsic.number("cx_offset", unit="pixels")
    cy = size[1] / 2 - 0.5 + intrinsic.number("cy_offset", unit="pixels")
    aspect = intrinsic.number("aspect_ratio", positive=True)
    coefficients = [intrinsic.number(key, unit="pixels") for key in ("k1", "k2", "k3", "k4")]
    if coefficients[0] < _LEAST_FOCAL * size[0]:
        raise CalibrationError(
            f"{intrinsic.where('k1')}: expected k1 to k4 in pixels, k1 near the focal length, got k1 = "
            f"{coefficients[0]:g} for an image {size[0]} pixels wide; k1 to k4 of cv2.fisheye have no unit: build "
            "Camera(K, image_size=..., lens=KannalaBrandt([k1, k2, k3, k4])) with the focal lengths in K"
        )
    pose = rigid(extrinsic.quaternion("quaternion", "xyzw"), extrinsic.numbers("translation", 3, unit="metres"))
    with blame(content.origin):
        lens = RadialPolynomial(coefficients)
    K = np.array([[1.0, 0.0, cx], [0.0, aspect, cy], [0.0, 0.0, 1.0]])
    return build(content.origin, K, image_size=size, vehicle_from_camera=pose, lens=lens)
