"""The documents' own job on the real image: every cell against OpenCV and the reference."""

from __future__ import annotations

import cv2
import golden
import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors, reference


@pytest.fixture(scope="module")
def image(shared_data) -> np.ndarray:
    pillow = pytest.importorskip("PIL.Image")
    return np.asarray(pillow.open(shared_data / "cityscapes" / "stuttgart_01_000000_003715_leftImg8bit.png"))


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_every_cell(image, shared_data, interpolation):
    camera = ipm_rs.Camera.from_cityscapes(shared_data / "cityscapes" / "camera.json")
    grid = ipm_rs.BevGrid(x=(7, 50), y=(-10, 10), resolution=(0.05, 0.025), sample_at="corner")
    lut = ipm_rs.Lut(camera, grid)
    bev = lut.warp(image, interpolation=interpolation)
    assert bev.shape == (860, 800, 3) and bev.dtype == np.uint8

    flag = {"nearest": cv2.INTER_NEAREST, "bilinear": cv2.INTER_LINEAR}[interpolation]
    theirs = cv2.remap(image, *lut.maps(outside=-9), flag, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
    assert np.abs(bev.astype(int) - theirs).max() <= 1

    xy = reference.grid_xy((7, 50), (-10, 10), (0.05, 0.025), "corner")
    maps = reference.maps(camera.intrinsics, camera.camera_from_vehicle, camera.image_size, xy)
    remap = {"nearest": reference.remap_nearest, "bilinear": reference.remap_bilinear}[interpolation]
    expected = remap(image, *maps)
    assert np.abs(bev.astype(int) - expected)[lut.mask].max() <= 1
    assert lut.mask.sum() == 586_241
    assert bev[lut.mask].std() > 10


def test_lane_markings_run_straight_ahead(image, seed_camera):
    """Brightness summed along the road has the markings as narrow peaks; a wrong pitch smears them."""

    def sharpness(camera):
        lut = ipm_rs.Lut(camera, ipm_rs.BevGrid(x=(8, 28), y=(-6, 6), resolution=(0.05, 0.025)))
        bev = lut.warp(image.mean(axis=2).astype(np.float32), border_value=np.nan)
        across = np.nanmean(bev, axis=0)
        return np.abs(np.diff(across)).max()

    wrong = ipm_rs.Camera.from_euler(
        golden.K, image_size=golden.IMAGE_SIZE, position=golden.POSITION, pitch=golden.PITCH * 0.5, yaw=golden.YAW
    )
    assert sharpness(seed_camera) > 1.3 * sharpness(wrong)


def test_an_image_of_another_size_is_refused_with_the_mend(image, seed_lut):
    with refuses(errors.ImageError, "1024x512", "2048x1024", "camera.resized()"):
        seed_lut.warp(np.ascontiguousarray(image[::2, ::2]))


def test_half_the_image_gives_half_the_detail(image, seed_camera, seed_grid, seed_lut):
    half = cv2.resize(image, (1024, 512), interpolation=cv2.INTER_AREA)
    lut = ipm_rs.Lut(seed_camera.resized(1024, 512), seed_grid)
    both = lut.mask & seed_lut.mask
    difference = np.abs(lut.warp(half).astype(int) - seed_lut.warp(image))[both]
    assert difference.mean() < 2.5
    shifted = ipm_rs.Lut(
        ipm_rs.Camera(np.diag([0.5, 0.5, 1.0]) @ golden.K, image_size=(1024, 512), camera_from_vehicle=golden.RT),
        seed_grid,
    )
    wrong = np.abs(shifted.warp(half).astype(int) - seed_lut.warp(image))[both & shifted.mask]
    assert wrong.mean() > difference.mean(), "forgetting the half pixel is worse"
