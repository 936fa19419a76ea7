"""`doctor`: the arguments, checked; one camera or a rig."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import array_of
from ipm_rs._core import BevGrid, Camera, HeightMap, Plane
from ipm_rs.diagnosis._camera import examine
from ipm_rs.diagnosis._report import Report
from ipm_rs.diagnosis._ring import RigReport, examine_rig
from ipm_rs.errors import ArgumentError, ArgumentTypeError, DtypeError, ImageError
from ipm_rs.rig import Bowl, Rig

__all__ = ["doctor"]


@overload
def doctor(camera: Camera, grid: BevGrid, ground: float | Plane | HeightMap = 0.0, image: Any = None) -> Report: ...
@overload
def doctor(
    camera: Rig | Mapping[str, Camera],
    grid: BevGrid,
    ground: float | Plane | HeightMap | Bowl = 0.0,
    image: Mapping[str, Any] | None = None,
) -> RigReport: ...
def doctor(camera: Any, grid: BevGrid, ground: Any = 0.0, image: Any = None) -> Report | RigReport:
    """Say what a camera sees of a grid on the road, why it does not see the rest, and what is wrong with it.

    In words where it stands and looks, the horizon, which rows see the road at which distance, the share of the grid
    that is seen and resolved, what a pixel and a tenth of a degree cost at the far end; and findings: typical mistakes
    of intrinsics and pose, each of which was undone to see whether it explains what is odd, images of another size,
    streaks, lanes that are not parallel. Of a rig every camera, who sees what, and how well pairs of cameras agree.

    It looks at a calibration as it is and changes nothing. That it finds nothing is no proof: a pose that is a tenth of
    a degree off looks right to it; `ipm_rs.refine` measures.

    Parameters
    ----------
    camera : Camera, Rig or mapping of str to Camera
        What is looked at.
    grid : BevGrid
        The grid that a bird's-eye view is to have.
    ground : float, Plane or HeightMap
        The road, as for `Lut`; of a rig also a `Bowl`.
    image : array, optional
        An image of the camera, as `Lut.warp` takes it, (H, W) or (H, W, C); of a rig a mapping of names to images, some
        of which may be missing. It is drawn on, and looked at for what a calibration alone does not show.

    Returns
    -------
    Report or RigReport
        ``print(report)``, ``report.findings``, ``report.to_json()``, ``report.draw()`` (needs Pillow).

    Raises
    ------
    ArgumentError, ArgumentTypeError, DtypeError, ImageError
        An argument is of another kind; an image is no image. One of another size than the camera's is a finding.
    OutOfMemoryError
        There is not enough memory.
    """
    if not isinstance(grid, BevGrid):
        raise ArgumentTypeError(f"grid: expected an ipm_rs.BevGrid, got {type(grid).__name__}")
    if isinstance(camera, Camera):
        if isinstance(ground, Bowl):
            ground = ground.height_map(grid)
        return examine(camera, grid, _road_of(ground), None if image is None else _image_of("image", image))
    if not isinstance(camera, Mapping):
        raise ArgumentTypeError(
            f"camera: expected an ipm_rs.Camera, a Rig or a mapping of names to cameras, got {type(camera).__name__}; "
            "Camera.load reads one"
        )
    rig = camera if isinstance(camera, Rig) else Rig(camera)
    if image is not None and not isinstance(image, Mapping):
        raise ArgumentTypeError(f"image: expected a mapping of names to images for a rig, got {type(image).__name__}")
    images: dict[str, NDArray[Any]] = {}
    for name, pixels in (image or {}).items():
        if not isinstance(name, str) or name not in rig:
            raise ArgumentError(f"image: expected names of {rig!r}, got another; pass one of {list(rig)}")
        if pixels is not None:
            images[name] = _image_of(f"image[{name!r}]", pixels)
    return examine_rig(rig, grid, ground if isinstance(ground, Bowl) else _road_of(ground), images)


def _road_of(ground: Any) -> float | Plane | HeightMap:
    if isinstance(ground, (Plane, HeightMap)):
        return ground
    array = array_of("ground", ground)
    if array.shape != () or array.dtype.kind not in "iuf":
        raise ArgumentTypeError(
            f"ground: expected a height in metres, a Plane or a HeightMap, got {type(ground).__name__}"
        )
    if not np.isfinite(array) or abs(float(array)) > 1e5:
        raise ArgumentError("ground: expected a height up to 100 km, got one that is larger or not finite")
    return float(array)


def _image_of(name: str, image: Any) -> NDArray[Any]:
    pixels = array_of(name, image)
    if pixels.dtype.kind not in "buif" or pixels.dtype.itemsize > 8:
        raise DtypeError(f"{name}: expected an image of numbers, got {pixels.dtype}; pass uint8, uint16 or float32")
    if pixels.ndim not in (2, 3) or 0 in pixels.shape:
        raise ImageError(f"{name}: expected shape (H, W) or (H, W, C) with at least one pixel, got {pixels.shape}")
    if pixels.ndim == 3 and pixels.shape[2] > 64:
        raise ImageError(f"{name}: expected (H, W, C) of up to 64 channels, got {pixels.shape}; is it (C, H, W)?")
    return np.ascontiguousarray(pixels)
