"""The doctor looks at one camera."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, HeightMap, Plane
from ipm_rs.diagnosis import _mistakes as mistakes
from ipm_rs.diagnosis._coverage import Coverage, cover
from ipm_rs.diagnosis._findings import Finding, worst_first
from ipm_rs.diagnosis._lanes import straightness_of
from ipm_rs.diagnosis._report import Report
from ipm_rs.diagnosis._stand import Stand, stand_of
from ipm_rs.diagnosis._words import metres_of, percent
from ipm_rs.errors import IpmError

__all__ = ["examine", "fitting"]


def examine(camera: Camera, grid: BevGrid, ground: float | Plane | HeightMap, image: NDArray[Any] | None) -> Report:
    """Return the report of a camera; `image` has passed `Lut.warp`'s checks but that of its size."""
    stand, coverage = stand_of(camera, ground), cover(camera, grid, ground)
    findings = [Finding("warning", "implausible", text, "") for text in _warned_of(camera)]
    findings += [Finding("error", "sees-no-road", text, "") for text in coverage.warned]
    findings += mistakes.of_intrinsics(camera)
    findings += mistakes.of_pose(camera, grid, ground)
    findings += _of_stand(stand)
    findings += _of_coverage(coverage)
    usable = image
    if image is not None:
        of_size, usable = _of_size(camera, image)
        findings += of_size
    if usable is not None:
        findings += _of_pixels(camera, ground, usable)
    return Report(
        camera=camera,
        grid=grid,
        ground=ground,
        position=stand.position,
        height=stand.height,
        heading_deg=stand.heading_deg,
        pitch_deg=stand.pitch_deg,
        roll_deg=stand.roll_deg,
        view_deg=stand.view_deg,
        horizon_row=stand.horizon_row,
        bottom_range=stand.bottom_range,
        rows=stand.rows,
        seen=float(coverage.seen.mean()),
        resolved=float(coverage.resolved.mean()),
        shares=coverage.shares,
        far=coverage.far,
        findings=worst_first(findings),
        _coverage=coverage,
        _image=image,
        _sees=stand.sees,
    )


def fitting(camera: Camera, image: NDArray[Any]) -> Camera | None:
    """Return the camera of an image's size: itself, or resized where the image has the same proportions."""
    height, width = image.shape[:2]
    if (width, height) == camera.image_size:
        return camera
    across, down = width / camera.image_size[0], height / camera.image_size[1]
    if abs(across / down - 1) > 0.01:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return camera.resized(width, height)


def _warned_of(camera: Camera) -> list[str]:
    """Return what the camera itself warns of, by making it again."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        Camera(
            camera.intrinsics,
            image_size=camera.image_size,
            camera_from_vehicle=camera.camera_from_vehicle,
            lens=camera.lens,
        )
    return [str(each.message) for each in caught]


def _of_stand(stand: Stand) -> list[Finding]:
    found = []
    if stand.height > 20:
        found.append(
            Finding(
                "warning",
                "very-high",
                f"the camera is {stand.height:.0f} m above the road",
                "are lengths in millimetres? divide the translation by 1000; or ground= is another height",
            )
        )
    elif 0 < stand.height < 0.2:
        found.append(
            Finding(
                "warning",
                "very-low",
                f"the camera is {100 * stand.height:.0f} cm above the road",
                "pass ground=, the height of the road in the vehicle frame: minus the camera's height where that is "
                "the origin",
            )
        )
    if abs(stand.roll_deg) > 20 and stand.pitch_deg < 60:
        found.append(
            Finding(
                "warning",
                "rolled",
                f"the camera is rolled by {stand.roll_deg:.0f} degrees",
                "is the order of the angles right (Rz Ry Rx), and are the images upright?",
            )
        )
    if stand.pitch_deg < -8:
        found.append(
            Finding(
                "warning",
                "looks-up",
                f"the camera looks {-stand.pitch_deg:.1f} degrees up",
                "positive pitch looks down; and a pose without the optical axes looks at the sky",
            )
        )
    return found


def _of_coverage(coverage: Coverage) -> list[Finding]:
    shares, far = coverage.shares, coverage.far
    seen = shares.get("resolved", 0.0) + shares.get("unresolved", 0.0)
    found = []
    if shares.get("horizon", 0.0) > 0:
        found.append(
            Finding(
                "error",
                "sky",
                "the road is above the camera, so the view would show the sky, upside down",
                "pass ground=, the height of the road in the vehicle frame",
            )
        )
    if 0 < seen < 0.02:
        found.append(
            Finding(
                "error",
                "nearly-black",
                f"the camera sees {percent(seen)} of the grid; the view is nearly black",
                "move the grid to where the camera looks, or mend the pose",
            )
        )
    if seen > 0 and shares.get("unresolved", 0.0) > 0.3 * seen:
        to = "nowhere" if far is None or far.resolved_to is None else f"up to {far.resolved_to:.0f} m ahead"
        found.append(
            Finding(
                "note",
                "streaks",
                f"{percent(shares['unresolved'] / seen)} of what is seen is below one pixel for two cells (resolved "
                f"{to}): there the view is made up between pixels, and shows streaks",
                "use larger cells, a nearer grid, or Lut.resolved_mask()",
            )
        )
    if seen == 0:
        return found
    density = coverage.lut.sampling_density()
    with np.errstate(invalid="ignore"):
        coarse = float((density.max(axis=2) > 2).mean())
    if coarse > 0.1:
        found.append(
            Finding(
                "note",
                "aliasing",
                f"{percent(coarse)} of the cells are larger than two pixels: bilinear sees a part of each",
                'warp with interpolation="area"',
            )
        )
    if far is not None and not far.by_pitch < 0.15 * far.distance:
        found.append(
            Finding(
                "note",
                "trees",
                f"a tenth of a degree of pitch is {metres_of(far.by_pitch)} at {far.distance:.0f} m: a nod of the car "
                "moves the far end, and what stands there, cars and trees, falls away from the camera in long smears",
                "end the grid nearer, or follow the pitch frame by frame with camera.with_pose()",
            )
        )
    return found


def _of_size(camera: Camera, image: NDArray[Any]) -> tuple[list[Finding], NDArray[Any] | None]:
    """Return what is wrong with an image's size, and the image if it fits the camera."""
    height, width = image.shape[:2]
    if (width, height) == camera.image_size:
        return [], image
    text = f"the image has {width}x{height} pixels, the camera {camera.image_size[0]}x{camera.image_size[1]}"
    if (height, width) == camera.image_size:
        mend = "the sides are swapped: image_size is (width, height), and images must not be turned"
    elif fitting(camera, image) is not None:
        mend = f"the image was resized: use camera.resized({width}, {height})"
    else:
        mend = "the image was cropped, or is another camera's: use camera.cropped(), or the original"
    return [Finding("error", "image-size", text, mend)], None


def _of_pixels(camera: Camera, ground: float | Plane | HeightMap, image: NDArray[Any]) -> list[Finding]:
    found = []
    some = np.asarray(image[:: max(1, image.shape[0] // 64), :: max(1, image.shape[1] // 64)], dtype=np.float64)
    known = some[np.isfinite(some)]
    if known.size == 0 or known.min() == known.max():
        return [
            Finding("error", "blank-image", "the image has one value everywhere", "is it the right file, and decoded?")
        ]
    try:
        lanes = straightness_of(camera, ground, image)
    except IpmError:
        lanes = None
    if lanes is not None and lanes.best > 0.15 and lanes.best > 1.5 * lanes.now and abs(lanes.pitch_deg) >= 0.5:
        splayed = "converge" if lanes.pitch_deg > 0 else "diverge"
        less = "less" if lanes.pitch_deg > 0 else "more"
        found.append(
            Finding(
                "warning",
                "splayed",
                f"lines along the road {splayed} ahead: with {abs(lanes.pitch_deg):g} degrees {less} pitch they would "
                "be parallel (a hint from one picture)",
                "find the pose: ipm_rs.refine, Camera.from_vanishing_point; the road may also climb, or the car brake",
            )
        )
    return found
