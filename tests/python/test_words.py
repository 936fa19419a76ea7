"""Claims of the README and of the documentation that nothing else tests, each repeated here."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

import ipm_rs

ROOT = Path(__file__).resolve().parents[2]
K = np.array([[1100.0, 0, 639.5], [0, 1100, 359.5], [0, 0, 1]])
SIZE = (1280, 720)
GRID = ipm_rs.BevGrid(x=(6, 40), y=(-8, 8), resolution=0.2)
POSE = {"position": (1.5, 0.0, 1.4), "pitch": 0.08}
GOOD = ipm_rs.Camera.from_euler(K, image_size=SIZE, **POSE)


def words(name: str) -> str:
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())


# ---------------------------------------------------------------------------------------------------------------------
# README: within 0.52 grey level of exact arithmetic, and of cv2.remap


def exact_bilinear(image: np.ndarray, map_x: np.ndarray, map_y: np.ndarray) -> np.ndarray:
    x, y = np.floor(map_x).astype(int), np.floor(map_y).astype(int)
    fx, fy = (map_x - x)[..., None].astype(np.float64), (map_y - y)[..., None].astype(np.float64)
    pixels = image.astype(np.float64)
    top = pixels[y, x] * (1 - fx) + pixels[y, x + 1] * fx
    return top * (1 - fy) + (pixels[y + 1, x] * (1 - fx) + pixels[y + 1, x + 1] * fx) * fy


@pytest.mark.parametrize("channels", [1, 2, 3, 4, 5, 6])
def test_grey_levels_from_exact_arithmetic_and_from_opencv(channels):
    rng = np.random.default_rng(channels)
    image = rng.integers(0, 256, (90, 130, channels), dtype=np.uint8)
    map_x, map_y = rng.uniform(0, 128.9, (60, 70)).astype(np.float32), rng.uniform(0, 88.9, (60, 70)).astype(np.float32)
    exact = exact_bilinear(image, map_x, map_y)
    table = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(130, 90)).warp(image)
    assert abs(table - exact).max() <= 0.52
    theirs = cv2.remap(image, map_x, map_y, cv2.INTER_LINEAR).reshape(table.shape)
    if channels in (1, 3, 4):
        assert abs(table.astype(int) - theirs).max() <= 1
    elif cv2.__version__.startswith("5.0."):  # what the README says of them
        assert 4 < abs(theirs - exact).max() < 8


# ---------------------------------------------------------------------------------------------------------------------
# docs/datasets/index.md: why a bird's-eye view is black, or otherwise wrong


def camera(matrix: np.ndarray = K, **pose: object) -> ipm_rs.Camera:
    return ipm_rs.Camera.from_euler(matrix, image_size=SIZE, **{**POSE, **pose})


def posed(**pose: np.ndarray) -> ipm_rs.Camera:
    return ipm_rs.Camera(K, image_size=SIZE, **pose)


def without_optical_axes() -> np.ndarray:
    pose = GOOD.camera_from_vehicle.copy()
    pose[:3, :3] = np.eye(3)
    return pose


BLACK: dict[str, Callable[[], ipm_rs.Camera]] = {
    "looks away from the grid": lambda: camera(yaw=np.pi),
    "degrees where radians are meant": lambda: camera(pitch=5.0),
    "the wrong sign of pitch": lambda: camera(pitch=-0.35),
    "the inverse pose": lambda: posed(vehicle_from_camera=GOOD.camera_from_vehicle),
    "a rotation without the optical axes": lambda: posed(camera_from_vehicle=without_optical_axes()),
    "millimetres where metres are meant": lambda: camera(position=(1500.0, 0.0, 1400.0)),
    "K of an image four times as large": lambda: camera(np.diag([4.0, 4.0, 1.0]) @ K),
}


def table(seen_by: ipm_rs.Camera, **options: object) -> ipm_rs.Lut:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a camera that cannot be right is what this is about
        return ipm_rs.Lut(seen_by, GRID, **options)


def wrong(make: Callable[[], ipm_rs.Camera]) -> ipm_rs.Camera:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return make()


@pytest.mark.parametrize("reason", BLACK)
def test_reasons_of_a_black_view(reason):
    assert reason in words("docs/datasets/index.md")
    assert table(GOOD).mask.mean() > 0.8
    assert not table(wrong(BLACK[reason])).mask.any()


def test_a_resized_image_is_an_error_and_not_black():
    with pytest.raises(ipm_rs.ImageError, match=r"resized\(\)"):
        table(GOOD).warp(np.zeros((360, 640, 3), np.uint8))


def test_a_road_above_the_camera_shows_the_sky():
    lut = table(GOOD, ground=2.0)
    assert lut.mask.mean() > 0.8
    (horizon,) = GOOD.horizon()
    assert lut.maps()[1][lut.mask].max() < horizon[:, 1].min()


LINES = np.array([[8.0, 1.75], [30.0, 1.75], [8.0, -1.75], [30.0, -1.75]])
"""Near and far points of the line on the left, then of the one on the right."""


def read_by(other: ipm_rs.Camera, **options: float) -> np.ndarray:
    """Where a wrong camera puts them: (4, 2)."""
    return other.ground_from_pixels(GOOD.project(LINES)[0], **options)[:, :2]


def test_signs_of_what_is_wrong():
    """The other rows of the table, by where lane lines 1.75 m to either side end up."""
    left_near, left_far, right_near, right_far = read_by(camera(pitch=0.09))[:, 1]
    assert left_near - left_far > 0.1 and right_far - right_near > 0.1  # too much pitch: they converge
    left_near, left_far, right_near, right_far = read_by(camera(pitch=0.07))[:, 1]
    assert left_far - left_near > 0.1 and right_near - right_far > 0.1  # too little: they diverge
    near_far = read_by(camera(yaw=0.03))
    assert near_far[1, 1] - near_far[0, 1] > 0.3 and near_far[3, 1] - near_far[2, 1] > 0.3  # both lean to the left
    halves = read_by(wrong(lambda: camera(np.diag([0.5, 0.5, 1.0]) @ K)))
    assert (halves[:, 1] < LINES[:, 1]).all()  # K of another size: all of it aside
    far_off = read_by(GOOD, ground=-0.3)
    assert (far_off[:, 0] > LINES[:, 0]).all() and (abs(far_off[:, 1]) > 2).all()  # too far, too wide
    rolled = read_by(camera(roll=0.05))[:, 0]
    assert rolled[1] - rolled[3] > 0.5  # one side nearer than the other


@pytest.mark.parametrize("yaw", [0.0, 0.9, -0.9])
def test_a_quaternion_read_in_the_wrong_order(yaw):
    rotation = camera(yaw=yaw).vehicle_from_camera[:3, :3]
    w = np.sqrt(1 + np.trace(rotation)) / 2
    x, y, z = (rotation[[2, 0, 1], [1, 2, 0]] - rotation[[1, 2, 0], [2, 0, 1]]) / (4 * w)
    w, x, y, z = z, w, x, y  # the four numbers w x y z, read as x y z w
    axis = np.array([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)])
    if yaw == 0:
        np.testing.assert_allclose(axis, [np.cos(0.08), -np.sin(0.08), 0], atol=1e-12)  # its pitch became yaw
    else:
        assert axis[2] * np.sign(yaw) < -0.5  # the left one looks down, the right one up
