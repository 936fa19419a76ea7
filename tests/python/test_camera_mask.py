"""Masks of images: they travel with the camera, and no cell shows what they hide."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from helpers import refuses, textured

import ipm_rs
from ipm_rs import errors

K = [[120.0, 0, 79.5], [0, 120.0, 59.5], [0, 0, 1]]
GRID = ipm_rs.BevGrid(x=(2, 10), y=(-4, 4), resolution=0.1)


@pytest.fixture
def camera() -> ipm_rs.Camera:
    return ipm_rs.Camera.from_euler(K, image_size=(160, 120), position=(0, 0, 1.2), pitch=0.3)


@pytest.fixture
def mask() -> np.ndarray:
    mask = np.ones((120, 160), bool)
    mask[90:, 30:110] = False
    mask[:70, :50] = False
    return mask


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear", "area", "mode"])
def test_no_cell_shows_a_hidden_pixel(camera, mask, interpolation):
    image = np.where(mask, 200, 9).astype(np.uint8)
    plain, masked = ipm_rs.Lut(camera, GRID), ipm_rs.Lut(camera.masked(mask), GRID)
    seen = masked.warp(image, interpolation=interpolation, border_value=7)
    assert set(np.unique(seen[masked.mask])) == {200}
    taken = plain.mask & ~masked.mask
    assert set(np.unique(seen[taken])) == {7}
    # nothing else was taken
    shown = ipm_rs.Lut(camera, GRID).warp(image, interpolation="area")
    assert (shown[taken] < 200).all() and 100 < taken.sum() < plain.mask.sum() / 2
    np.testing.assert_array_equal(masked.warp(image)[masked.mask], plain.warp(image)[masked.mask])


def test_a_mask_that_hides_nothing_changes_nothing(camera):
    assert ipm_rs.Lut(camera.masked(np.ones((120, 160))), GRID) == ipm_rs.Lut(camera, GRID)
    assert camera.mask is None and camera.masked(np.ones((120, 160), np.uint8)).mask.all()


def test_it_goes_where_the_camera_goes(camera, mask, tmp_path):
    masked = camera.masked(mask)
    np.testing.assert_array_equal(masked.mask, mask)
    assert masked != camera and masked == camera.masked(mask * 3)
    lut = ipm_rs.Lut(masked, GRID)
    masked.save(tmp_path / "camera.json")
    same = [
        pickle.loads(pickle.dumps(masked)),
        ipm_rs.Camera.from_json(masked.to_json()),
        ipm_rs.Camera.load(tmp_path / "camera.json"),
        lut.camera,
        pickle.loads(pickle.dumps(lut)).camera,
        masked.with_pose(masked.camera_from_vehicle),
        ipm_rs.Rig({"front": masked}).moved(np.eye(4))["front"],
    ]
    for other in same:
        np.testing.assert_array_equal(other.mask, mask)
    assert same[:5] == [masked] * 5 and pickle.loads(pickle.dumps(lut)) == lut
    assert "of it hidden by its mask" in repr(masked) and "mask" not in camera.to_json()


def test_it_follows_the_image(camera, mask):
    masked = camera.masked(mask)
    np.testing.assert_array_equal(masked.rotated180().mask, mask[::-1, ::-1])
    np.testing.assert_array_equal(masked.mirrored().mask, mask[:, ::-1])
    np.testing.assert_array_equal(masked.cropped(20, 30, 90, 70).mask, mask[30:100, 20:110])
    blocks = mask[:120, :159].reshape(40, 3, 53, 3).all(axis=(1, 3))
    np.testing.assert_array_equal(masked.binned(3).mask, blocks)
    np.testing.assert_array_equal(masked.resized(80, 60).mask, mask.reshape(60, 2, 80, 2).all(axis=(1, 3)))
    np.testing.assert_array_equal(masked.resized(320, 240).mask, mask.repeat(2, 0).repeat(2, 1))


def test_polygons_hide_the_pixels_inside(camera):
    masked = camera.masked(hide=[[29.5, 89.5], [109.5, 89.5], [109.5, 200], [29.5, 200]])
    expected = np.ones((120, 160), bool)
    expected[90:, 30:110] = False
    np.testing.assert_array_equal(masked.mask, expected)
    both = camera.masked(expected, hide=[[(-1, -1), (5.2, -1), (5.2, 3.2), (-1, 3.2)], [(80, 2), (90, 2), (85, 12)]])
    assert not both.mask[:4, :6].any() and both.mask[:4, 6].all() and not both.mask[4, 85] and not both.mask[100, 50]
    np.testing.assert_array_equal(both.mask, masked.masked(both.mask).mask)  # masks add up


def test_a_rig_honours_it(camera, mask):
    image = textured(120, 160)
    lut = ipm_rs.RigLut({"front": camera.masked(mask)}, GRID)
    np.testing.assert_array_equal(lut.mask, ipm_rs.Lut(camera.masked(mask), GRID).mask)
    other = ipm_rs.RigLut({"front": camera}, GRID, masks={"front": mask})
    np.testing.assert_array_equal(lut.warp([image]), other.warp([image]))
    upper = np.arange(120)[:, None] > np.full(160, 75)
    both = ipm_rs.RigLut({"front": camera.masked(mask)}, GRID, masks={"front": upper})
    np.testing.assert_array_equal(both.mask, ipm_rs.Lut(camera.masked(mask & upper), GRID).mask)


def test_wrong_masks_are_refused(camera):
    with refuses(errors.ImageError, "mask: expected (120, 160)", "got (160, 120)"):
        camera.masked(np.ones((160, 120)))
    with refuses(errors.ArgumentError, "got neither"):
        camera.masked()
    with refuses(errors.ArgumentError, "fewer than 3 corners"):
        camera.masked(hide=[[1, 2], [3, 4]])
    with refuses(errors.ArgumentTypeError, "hide: expected an (M, 2) polygon"):
        camera.masked(hide=3)
    with refuses(errors.IpmError, "hide[1]"):
        camera.masked(hide=[[[1, 2], [3, 4], [5, 9]], [[1, 2, 3]]])
    text = camera.masked(hide=[[1, 2], [3, 4], [9, 1]]).to_json()
    for wrong in ("[5]", "[-1, 19201]", "[0.5, 19199.5]", '"all"', "[[19200]]"):
        start, end = text.index('"mask": ') + 8, text.rindex("\n}")
        with refuses(errors.CalibrationError, "mask"):
            ipm_rs.Camera.from_json(text[:start] + wrong + text[end:])
