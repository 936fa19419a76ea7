"""Cubic and Lanczos: against OpenCV and the reference, of every dtype, border and layout."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors, reference

CV = {"cubic": cv2.INTER_CUBIC, "lanczos4": cv2.INTER_LANCZOS4}
REFERENCE = {"cubic": reference.remap_cubic, "lanczos4": reference.remap_lanczos4}
BORDERS = {
    "constant": cv2.BORDER_CONSTANT,
    "replicate": cv2.BORDER_REPLICATE,
    "reflect": cv2.BORDER_REFLECT,
    "reflect_101": cv2.BORDER_REFLECT_101,
    "wrap": cv2.BORDER_WRAP,
}
SIZE = (61, 47)
BORDER = (7, 200, 90, 33)


def noise(channels, dtype=np.uint8):
    values = np.random.default_rng(channels).integers(0, 256, (47, 61, channels)).squeeze()
    return values.astype(dtype) * dtype(257 if dtype == np.uint16 else 1)


def maps(seed=1, shape=(60, 80)):
    """Around the image and in it, in 32nds of a pixel: OpenCV's own steps."""
    rng = np.random.default_rng(seed)
    map_x, map_y = rng.uniform(-9, 70, shape), rng.uniform(-9, 56, shape)
    map_x[::2], map_y[::2] = rng.uniform(0, 60, shape)[::2], rng.uniform(0, 46, shape)[::2]
    map_x[:3] = np.round(map_x[:3])
    return tuple((np.round(entries * 32) / 32 + 0.0).astype(np.float32) for entries in (map_x, map_y))  # no -0


@pytest.mark.parametrize("interpolation", CV)
@pytest.mark.parametrize("mode", BORDERS)
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_is_opencv_to_one_grey_level_in_every_border_mode(interpolation, mode, channels):
    image, (map_x, map_y) = noise(channels), maps()
    options = {"borderMode": BORDERS[mode], "borderValue": BORDER[:channels]}
    theirs = cv2.remap(image, map_x, map_y, CV[interpolation], **options)
    ours = ipm_rs.remap(
        image, map_x, map_y, interpolation=interpolation, border_mode=mode, border_value=BORDER[:channels]
    )
    assert np.abs(ours.astype(int) - theirs).max() <= 1 and len(np.unique(ours)) > 200
    floats = image.astype(np.float32)
    theirs = cv2.remap(floats, map_x, map_y, CV[interpolation], **options)
    ours = ipm_rs.remap(
        floats, map_x, map_y, interpolation=interpolation, border_mode=mode, border_value=BORDER[:channels]
    )
    assert np.abs(ours - theirs).max() < 2e-3

    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=SIZE, border_mode=mode)
    by_table = lut.warp(floats, interpolation=interpolation, border_value=BORDER[:channels])
    # a table holds no place that is a pixel or more outside the image, but where it has the same elsewhere
    near = (map_x > -1) & (map_x < 61) & (map_y > -1) & (map_y < 47)
    same = near | (mode not in ("constant", "replicate")) | ((mode == "replicate") & (interpolation == "cubic"))
    assert np.abs(by_table - theirs)[same].max() < 2e-3 and 0.3 < same.mean()
    if mode == "constant":
        assert (by_table[~near] == BORDER[:channels]).all()


def test_maps_in_fixed_point_are_read():
    image, (map_x, map_y) = noise(3), maps(2)
    fixed = cv2.convertMaps(map_x, map_y, cv2.CV_16SC2)
    expected = ipm_rs.remap(image, map_x, map_y)
    assert (ipm_rs.remap(image, *fixed) == expected).all()
    lut = ipm_rs.Lut.from_maps(*fixed, source_size=SIZE)
    assert lut == ipm_rs.Lut.from_maps(map_x, map_y, source_size=SIZE)
    assert (ipm_rs.remap(image, fixed[0], fixed[1].view(np.int16)) == expected).all()
    whole = cv2.convertMaps(map_x, map_y, cv2.CV_16SC2, nninterpolation=True)[0]
    got = ipm_rs.remap(image, whole, None, interpolation="nearest")
    assert (got == cv2.remap(image, whole, None, cv2.INTER_NEAREST)).all()
    with refuses(errors.DtypeError, "map_y", "uint16", "convertMaps"):
        ipm_rs.remap(image, fixed[0], map_y)
    with refuses(errors.LutError, "map_y", "(60, 80)", "(59, 80)"):
        ipm_rs.Lut.from_maps(fixed[0], fixed[1][1:], source_size=SIZE)
    with refuses(errors.ArgumentTypeError, "map_y", "None"):
        ipm_rs.remap(image, map_x, None)
    with refuses(errors.DtypeError, "map_x", "int16 pairs"):
        ipm_rs.remap(image, fixed[0][..., 0], map_y)


@pytest.mark.parametrize("interpolation", CV)
def test_homographies_are_opencvs(interpolation):
    image = cv2.GaussianBlur(noise(3), (0, 0), 1.5)  # OpenCV rounds coordinates to 1/32 pixel
    matrix = np.array([[1.1, 0.05, -4], [-0.04, 1.2, -5], [1e-3, -5e-4, 1]])
    theirs = cv2.warpPerspective(image, matrix, (70, 60), flags=CV[interpolation])
    ours = ipm_rs.warp_perspective(image, matrix, (70, 60), interpolation=interpolation)
    lut = ipm_rs.Lut.from_homography(np.linalg.inv(matrix), size=(70, 60), source_size=SIZE)
    assert np.abs(ours.astype(int) - theirs)[lut.mask].max() <= 2
    assert np.abs(ours.astype(int) - lut.warp(image, interpolation=interpolation))[lut.mask].max() <= 1


@pytest.mark.parametrize("interpolation", CV)
@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.uint16, np.int16, np.float16, np.float32, np.float64])
def test_every_dtype_is_the_reference(interpolation, dtype):
    for channels in (1, 2, 5, 11):
        image = noise(channels, np.uint16).astype(np.float64)
        image = image - 32768 if np.issubdtype(dtype, np.signedinteger) else image
        image = (image / (257 if np.dtype(dtype).itemsize == 1 or dtype == np.float16 else 1)).astype(dtype)
        map_x, map_y = (entries.astype(np.float64) + 0.003 for entries in maps(channels))
        exact = REFERENCE[interpolation](image, map_x, map_y, border_value=9)
        assert exact.dtype == dtype
        ours = ipm_rs.remap(image, map_x, map_y, interpolation=interpolation, border_value=9)
        assert ours.dtype == dtype
        allowed = {"f2": 0.13, "f4": 65535 / 2**18, "f8": 1e-9}.get(np.dtype(dtype).str[1:], 1)
        assert np.abs(ours.astype(np.float64) - exact.astype(np.float64)).max() <= allowed
        if allowed == 1:  # where the exact value lies beside a half
            assert (ours == exact).mean() > 0.98


@pytest.mark.parametrize("interpolation", CV)
def test_layouts_threads_and_rings_agree(interpolation):
    image, (map_x, map_y) = noise(3), maps(4)
    lut = ipm_rs.Lut.from_maps(map_x, map_y, source_size=SIZE)
    whole = lut.warp(image, interpolation=interpolation)
    planes = lut.warp(image.transpose(2, 0, 1).copy(), interpolation=interpolation, layout="CHW")
    assert (planes.transpose(1, 2, 0) == whole).all()
    assert (lut.warp(np.stack([image, image]), interpolation=interpolation, layout="NHWC", threads=2) == whole).all()
    padded = np.zeros((47, 70, 3), np.uint8)
    padded[:, :61] = image
    assert (lut.warp(padded[:, :61], interpolation=interpolation) == whole).all()

    camera = ipm_rs.Camera.from_euler(
        [[60.0, 0, 30], [0, 60, 23], [0, 0, 1]], image_size=SIZE, position=(0, 0, 1.5), pitch=0.5
    )
    grid = ipm_rs.BevGrid(x=(1, 5), y=(-2, 2), resolution=0.1)
    ring = ipm_rs.RigLut(ipm_rs.Rig({"front": camera}), grid)
    alone = ipm_rs.Lut(camera, grid)
    a = ring.warp({"front": image}, interpolation=interpolation)
    assert (a[alone.mask] == alone.warp(image, interpolation=interpolation)[alone.mask]).all()
