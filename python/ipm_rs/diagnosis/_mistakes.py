"""Typical mistakes of calibrations, each undone to see whether the camera then sees its grid."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, HeightMap, Plane, rotation_from_euler
from ipm_rs.diagnosis._coverage import seen_share
from ipm_rs.diagnosis._findings import Finding
from ipm_rs.diagnosis._stand import FLU_TO_OPTICAL, angles_of, height_at
from ipm_rs.diagnosis._words import heading, percent, pitch, roll
from ipm_rs.errors import IpmError

__all__ = ["of_intrinsics", "of_pose"]

_ENOUGH = 0.2
"""Of the grid: what a camera whose mistake is undone must see, and half of what it sees as it is."""
_HEIGHTS = (0.3, 6.0)
_STEEP = 45.0  # degrees down, from which a camera that sees nothing of its grid is asked too
_DOWN, _UP = 75.0, 12.0
_ROLL = 30.0

Matrix = NDArray[np.float64]


def of_pose(camera: Camera, grid: BevGrid, ground: float | Plane | HeightMap) -> list[Finding]:
    """Return the mistake that, undone, makes a camera see its grid; nothing where it stands and looks as cameras do."""
    before = seen_share(camera, grid, ground)
    steep = -camera.vehicle_from_camera[2, 2] > math.sin(math.radians(_STEEP))
    if _plausible(camera, ground) and not (steep and before == 0):
        return []  # a side camera, or another grid: why it is not seen is said by its cells
    found: list[tuple[float, Finding]] = []
    for order, (code, text, mend, pose) in enumerate(_undone(camera.vehicle_from_camera)):
        other = _with(camera, pose)
        if other is None or not _plausible(other, ground):
            continue
        share = seen_share(other, grid, ground)
        if share >= max(_ENOUGH, before / 2):
            rolled, down, left = (math.degrees(angle) for angle in angles_of(pose))
            x, y, z = (round(float(value), 2) + 0.0 for value in pose[:3, 3])
            then = (
                f"{text}: undone, the camera stands at ({x:.2f}, {y:.2f}, {z:.2f}) m, looks {heading(left)}, "
                f"{pitch(down)}, {roll(rolled)}, and sees {percent(share)} of the grid"
            )
            # what is simpler comes first, unless it sees much less, or is rolled; degrees are seldom found by chance
            merit = share - 0.02 * order - abs(rolled) / 100 + (1.0 if code == "degrees" else 0.0)
            found.append((merit, Finding("error", code, then, mend)))
    found.sort(key=lambda each: -each[0])
    return [finding for _, finding in found[:2]]


def of_intrinsics(camera: Camera) -> list[Finding]:
    """Return what is odd about K beside what the camera itself warns of: made for another size of the image."""
    K, (width, height) = camera.intrinsics, camera.image_size
    ratios = (K[0, 2] + 0.5) / (width / 2), (K[1, 2] + 0.5) / (height / 2)
    times = math.sqrt(ratios[0] * ratios[1]) if min(ratios) > 0 else 0.0
    if 0.02 < times and not 0.8 < times < 1.25 and abs(ratios[0] / ratios[1] - 1) < 0.12:
        size = round(width * times), round(height * times)
        return [
            Finding(
                "error",
                "intrinsics-of-another-size",
                f"the principal point ({K[0, 2]:.1f}, {K[1, 2]:.1f}) is the middle of an image of about "
                f"{size[0]}x{size[1]}, not of {width}x{height}: K belongs to images {times:.2g} times as large",
                "give image_size= as K was calibrated, then camera.resized() to the images' size",
            )
        ]
    swapped = K[0, 2] / (height / 2), K[1, 2] / (width / 2)
    if all(abs(ratio - 1) < 0.1 for ratio in swapped) and not 0.8 < width / height < 1.25:
        return [
            Finding(
                "error",
                "sides-swapped",
                f"the principal point ({K[0, 2]:.1f}, {K[1, 2]:.1f}) is the middle of a {height}x{width} image: the "
                "sides of image_size are swapped",
                "image_size is (width, height); an array's shape is (rows, columns)",
            )
        ]
    return []


def _plausible(camera: Camera, ground: float | Plane | HeightMap) -> bool:
    """Whether a camera stands and looks as those of vehicles do."""
    rolled, down, _ = (math.degrees(angle) for angle in angles_of(camera.vehicle_from_camera))
    x, y, z = camera.position
    height = z - height_at(ground, x, y)
    level = abs(rolled) < _ROLL or down > 60
    return _HEIGHTS[0] < height < _HEIGHTS[1] and -_UP < down < _DOWN + 15 and level and max(abs(x), abs(y)) < 15


def _with(camera: Camera, vehicle_from_camera: Matrix) -> Camera | None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return Camera(
                camera.intrinsics,
                image_size=camera.image_size,
                vehicle_from_camera=vehicle_from_camera,
                lens=camera.lens,
                nearest_rotation=True,
            )
    except IpmError:
        return None


def _posed(R: Matrix, position: Matrix) -> Matrix:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R, position
    return pose


def _undone(given: Matrix) -> Iterator[tuple[str, str, str, Matrix]]:
    """Yield code, words, what to do, and the pose (vehicle_from_camera) that was meant."""
    R, C = given[:3, :3], given[:3, 3]
    inverse = _posed(R.T, -R.T @ C)
    t = inverse[:3, 3]  # camera_from_vehicle's fourth column
    optical = FLU_TO_OPTICAL
    axes = "a rotation without the optical axes (x right, y down, z forward)"
    make = "multiply by [[0, -1, 0], [0, 0, -1], [1, 0, 0]], which takes forward-left-up to optical axes"
    yield "inverse-pose", "the pose is the inverse", "swap camera_from_vehicle= and vehicle_from_camera=", inverse
    for unit, name in ((1000.0, "millimetres"), (100.0, "centimetres")):
        if np.abs(C).max() > 15:
            mend = f"divide the translation by {unit:g}"
            yield name, f"the position is in {name}", mend, _posed(R, C / unit)
    yield "camera-axes", axes, make, _posed(R @ optical.T, C)
    yield "camera-axes", f"{axes}, and the inverse pose", make, _posed(R.T @ optical.T, inverse[:3, 3])
    yield (
        "opengl-axes",
        "camera axes of OpenGL (x right, y up, z backward)",
        "negate y and z of the camera",
        _posed(R @ np.diag([1.0, -1, -1]), C),
    )
    yield (
        "vehicle-z-down",
        "a vehicle frame with y right and z down (aerospace, IMU)",
        "negate y and z of the vehicle",
        (_posed(np.diag([1.0, -1, -1]) @ R, np.diag([1.0, -1, -1]) @ C)),
    )
    yield (
        "rotation-transposed",
        "the rotation is the inverse, the position is not",
        "transpose the rotation",
        _posed(R.T, C),
    )
    yield (
        "position-as-translation",
        "the camera's position was given as the translation of camera_from_vehicle",
        ("the translation is -R @ position; or give vehicle_from_camera="),
        _posed(R, t),
    )
    for name, wxyz in _quaternions(R):
        yield "quaternion-order", f"a quaternion {name}", "say which order the file has", _posed(_rotation(wxyz), C)
    for name, wxyz in _quaternions(R.T):
        yield "quaternion-order", f"a quaternion {name}", "say which order the file has", _posed(_rotation(wxyz).T, C)
    for angles in _degrees(given):
        words = ", ".join(f"{math.degrees(angle):g}" for angle in angles)
        meant = rotation_from_euler(*angles) @ optical.T
        mend = "angles are in radians: np.radians(...)"
        yield "degrees", f"degrees taken for radians (roll, pitch, yaw {words})", mend, _posed(meant, C)
    rolled, down, left = angles_of(given)
    if down < 0:
        meant = rotation_from_euler(rolled, -down, left) @ optical.T
        yield "pitch-sign", "the sign of pitch", "positive pitch looks down", _posed(meant, C)
    turned = _posed(R @ np.diag([-1.0, -1, 1]), C)
    yield (
        "upside-down",
        "the camera hangs upside down",
        "turn the images: camera.rotated180(), image[::-1, ::-1]",
        turned,
    )


def _quaternions(R: Matrix) -> Iterator[tuple[str, Matrix]]:
    """Yield what was meant by the four numbers of a rotation, had they been read in the other order; w x y z."""
    w, x, y, z = _quaternion(R)
    yield "w x y z read as x y z w", np.array([x, y, z, w])
    yield "x y z w read as w x y z", np.array([z, w, x, y])


def _quaternion(R: Matrix) -> Matrix:
    """Return w, x, y, z of a rotation: the largest column of 4 q q^T (Shepperd 1978)."""
    trace = np.trace(R)
    outer = np.empty((4, 4))
    outer[0, 0] = 1 + trace
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        outer[k + 1, k + 1] = 1 + 2 * R[k, k] - trace
        outer[0, k + 1] = outer[k + 1, 0] = R[j, i] - R[i, j]
        outer[i + 1, j + 1] = outer[j + 1, i + 1] = R[i, j] + R[j, i]
    column = outer[:, int(np.argmax(np.diag(outer)))]
    return np.asarray(column / np.linalg.norm(column))


def _rotation(wxyz: Matrix) -> Matrix:
    w, x, y, z = wxyz / max(float(np.linalg.norm(wxyz)), 1e-300)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _degrees(pose: Matrix) -> Iterator[tuple[float, float, float]]:
    """Yield roll, pitch, yaw in radians, had their degrees been taken for radians.

    Any rotation is that of some such angles; so only those are that have no more than three decimals, as people write
    degrees, and of which one is more than half a radian.
    """
    rolled, down, left = angles_of(pose)
    for angles in ((rolled, down, left), (rolled + math.pi, math.pi - down, left + math.pi)):
        written = [_as_written(angle) for angle in angles]
        if None not in written and max(abs(number or 0.0) for number in written) > 0.5:
            a, b, c = (math.radians(number or 0.0) for number in written)
            yield a, b, c


def _as_written(angle: float) -> float | None:
    """Return the number with up to three decimals, within a turn, that has this angle in radians; None without one."""
    for turns in (0, -1, 1):
        number = math.remainder(angle, 2 * math.pi) + turns * 2 * math.pi
        if abs(number) <= 2 * math.pi and abs(number - round(number, 3)) < 1e-7:
            return round(number, 3) + 0.0
    return None
