"""`Lut.between` and `Camera.undistorted`: against OpenCV, against rays, turned, fitted, masked."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from helpers import refuses, textured

import ipm_rs
from ipm_rs.views._between import exact_maps

K = np.array([[430.0, 0, 331.2], [0, 425.0, 236.7], [0, 0, 1]])
SIZE = (640, 480)
KITTI = [-3.691481e-01, 1.968681e-01, 1.353473e-03, 5.677587e-04, -6.770705e-02]
BROWN = ipm_rs.BrownConrady(KITTI, max_angle=0.85)
FISHEYE = ipm_rs.KannalaBrandt([0.04, -0.015, 0.003, -0.0005])
POSE = {"position": (1.5, 0.3, 1.4), "roll": 0.05, "pitch": 0.2, "yaw": -0.3}


def camera(lens=None, **pose):
    return ipm_rs.Camera.from_euler(K, image_size=SIZE, lens=lens, **{**POSE, **pose})


def grid(size):
    width, height = size
    return np.stack(np.meshgrid(np.arange(float(width)), np.arange(float(height))), -1).reshape(-1, 2)


def turned(rotation):
    """`camera()`'s pose, turned about its own position."""
    pose = camera().camera_from_vehicle.copy()
    return rotation @ pose


# ---------------------------------------------------------------------------------------------------------------------
# OpenCV


@pytest.mark.parametrize("rotation", [np.zeros(3), np.array([0.1, -0.2, 0.05])])
@pytest.mark.parametrize("size", [SIZE, (500, 410)])
def test_is_opencvs_undistortion(rotation, size):
    """In float64, which OpenCV's maps, in float32, are the rounding of."""
    source = camera(BROWN)
    new = np.array([[400.0, 0, 250.5], [0, 410.0, 205.5], [0, 0, 1]])
    turn = np.eye(4)
    turn[:3, :3] = cv2.Rodrigues(rotation)[0]
    target = ipm_rs.Camera(new, image_size=size, camera_from_vehicle=turned(turn))
    map_x, map_y = exact_maps(source, target)
    rays = np.column_stack([grid(size), np.ones(size[0] * size[1])]) @ (turn[:3, :3].T @ np.linalg.inv(new)).T
    expected = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array(KITTI))[0][:, 0]
    seen = ~np.isnan(map_x.ravel())
    assert seen.mean() > 0.7
    assert np.abs(map_x.ravel() - expected[:, 0])[seen].max() < 1e-6
    assert np.abs(map_y.ravel() - expected[:, 1])[seen].max() < 1e-6
    theirs = cv2.initUndistortRectifyMap(K, np.array(KITTI), turn[:3, :3], new, size, cv2.CV_32FC1)
    lut = ipm_rs.Lut.between(source, target)
    assert lut.shape == (size[1], size[0]) and lut.source_size == SIZE
    assert lut.camera is None and lut.grid is None
    for own, their in zip(lut.maps(), theirs, strict=True):
        inside = lut.mask
        assert np.abs(own - their)[inside].max() < 1e-4  # float32, and 1/32768 of a pixel
    image = textured(480, 640, 3)
    view, undistorted = lut.warp(image), cv2.remap(image, *theirs, cv2.INTER_LINEAR)
    assert np.abs(view.astype(int) - undistorted)[lut.mask].max() <= 1


def test_the_default_is_cv2_undistort():
    source, image = camera(BROWN), textured(480, 640, 3)
    target = source.undistorted()
    assert target.lens is None and np.array_equal(target.intrinsics, K) and target.image_size == SIZE
    assert np.array_equal(target.camera_from_vehicle, source.camera_from_vehicle)
    lut = ipm_rs.Lut.between(source, target)
    theirs = cv2.undistort(image, K, np.array(KITTI))
    # its maps count in 1/32 pixel
    assert np.abs(lut.warp(image).astype(int) - theirs)[lut.mask].max() <= 16


def test_is_opencvs_fisheye():
    source = camera(FISHEYE)
    target = source.undistorted(focal=200.0)
    new = target.intrinsics
    assert np.array_equal(new, [[200, 0, 319.5], [0, 200, 239.5], [0, 0, 1]])
    map_x, map_y = exact_maps(source, target)
    rays = np.column_stack([grid(SIZE), np.ones(640 * 480)]) @ np.linalg.inv(new).T
    none = np.zeros(3)
    expected = cv2.fisheye.projectPoints(rays[:, None], none, none, K, np.array(FISHEYE.coefficients))[0][:, 0]
    assert np.abs(map_x.ravel() - expected[:, 0]).max() < 1e-6
    assert np.abs(map_y.ravel() - expected[:, 1]).max() < 1e-6
    coefficients = np.array(FISHEYE.coefficients)
    theirs = cv2.fisheye.initUndistortRectifyMap(K, coefficients, np.eye(3), new, SIZE, cv2.CV_32FC1)
    assert np.abs(map_x - theirs[0]).max() < 1e-4 and np.abs(map_y - theirs[1]).max() < 1e-4


@pytest.mark.parametrize("alpha", [0.0, 0.4, 1.0])
def test_alpha_is_opencvs(alpha):
    """Which looks at nine points of each side, and we at two hundred."""
    source = camera(ipm_rs.BrownConrady([-0.25, 0.06, 1e-3, -5e-4]))
    target = source.undistorted(alpha=alpha)
    theirs, _ = cv2.getOptimalNewCameraMatrix(K, np.array([-0.25, 0.06, 1e-3, -5e-4]), SIZE, alpha, SIZE)
    assert np.abs(target.intrinsics - theirs).max() < 3.0
    mask = ipm_rs.Lut.between(source, target).mask
    if alpha == 0:
        assert mask[1:-1, 1:-1].all(), "all of it is picture"
    elif alpha == 1:
        back = ipm_rs.Lut.between(target, source).mask
        assert back[1:-1, 1:-1].all(), "all of the picture is in it"
    else:
        assert 0.5 < mask.mean() < 1


# ---------------------------------------------------------------------------------------------------------------------
# Any lens to any other


@pytest.mark.parametrize(
    "lens",
    [
        ipm_rs.Mei(0.9, [0.01, 0, 0, 0]),
        ipm_rs.DoubleSphere(-0.2, 0.55),
        ipm_rs.Fov(0.9),
        ipm_rs.Division(-0.3),
        FISHEYE,
        BROWN,
    ],
    ids=repr,
)
def test_undistorted_keeps_the_scale_in_the_middle_and_straight_lines(lens):
    source = camera(lens)
    target = source.undistorted()
    ahead = source.unproject([[331.2, 236.7], [332.2, 236.7], [331.2, 237.7]])
    uv = target.project(target.position + ahead)[0]
    assert np.abs(uv[0] - [331.2, 236.7]).max() < 1e-6
    assert np.abs(uv[1:] - uv[0] - np.eye(2)).max() < 1e-4
    line = source.position + source.unproject([[200.0, 150]]) * 4 + np.linspace(0, 2, 40)[:, None] * [[0.1, -0.7, 0.3]]
    seen = target.project(line)[0]
    direction = seen[-1] - seen[0]
    off = (seen - seen[0]) @ [-direction[1], direction[0]] / np.linalg.norm(direction)
    assert np.abs(off).max() < 1e-9


@pytest.mark.parametrize("other", [ipm_rs.Cylindrical(), ipm_rs.Equirectangular(), FISHEYE], ids=repr)
def test_every_pixel_looks_where_the_target_does(other):
    source = camera(FISHEYE)
    target = source.undistorted(size=(320, 200), focal=(150.0, 140.0), level=True, lens=other)
    assert target.lens == other
    map_x, map_y = exact_maps(source, target)
    rays = target.unproject(grid((320, 200)))
    back = source.unproject(np.column_stack([map_x.ravel(), map_y.ravel()]))
    seen = ~np.isnan(back[:, 0])
    assert seen.mean() > 0.9 and np.abs(back - rays)[seen].max() < 1e-10
    lut = ipm_rs.Lut.between(source, target)
    expected = source.project(source.position + rays)[2].reshape(200, 320)
    assert (lut.mask == expected).mean() > 0.9999  # rounding decides at the very edge
    there = ipm_rs.Lut.between(target, source)
    assert there.shape == (480, 640) and there.source_size == (320, 200)


def test_level_is_level():
    target = camera(FISHEYE).undistorted(focal=200, level=True)
    horizon = target.horizon_line()
    assert np.abs(np.array(horizon[:2]) - [0, 1]).max() < 1e-12 and horizon[2] == pytest.approx(-239.5)
    upright = target.project(target.position + np.array([[9.0, -2, -1], [9, -2, 0], [9, -2, 2]]))[0]
    assert np.ptp(upright[:, 0]) < 1e-9, "upright lines stand upright"
    assert np.allclose(target.position, POSE["position"], rtol=0, atol=1e-12)
    looks = target.unproject([[319.5, 239.5]])[0]
    assert np.allclose(looks, [np.cos(0.3), -np.sin(0.3), 0], atol=1e-12), "the same way"


def test_a_view_of_a_bevs_camera_makes_the_same_bev():
    """Undistorted first or at once: the same pixels of the same road, to what interpolating twice takes."""
    source = camera(BROWN)
    target = source.undistorted()
    y, x = np.mgrid[0:480, 0:640]
    image = (128 + 60 * np.sin(x / 23) + 50 * np.cos(y / 19)).astype(np.uint8)
    road = ipm_rs.BevGrid(x=(4, 12), y=(-3, 3), resolution=0.1)
    once, twice = ipm_rs.Lut(source, road), ipm_rs.Lut(target, road)
    view = ipm_rs.Lut.between(source, target).warp(image)
    both = once.mask & twice.mask
    assert both.mean() > 0.3
    assert np.abs(once.warp(image).astype(int) - twice.warp(view))[both].max() <= 3


def test_masks_travel(tmp_path):
    hidden = np.ones((480, 640), bool)
    hidden[300:, 200:400] = False
    source = camera(FISHEYE).masked(hidden)
    target = source.undistorted(size=(160, 120), focal=50)
    lut = ipm_rs.Lut.between(source, target)
    bare = ipm_rs.Lut.between(camera(FISHEYE), target)
    map_x, map_y = exact_maps(source, target)
    on = bare.mask
    middle = np.zeros_like(on)
    middle[on] = ~hidden[np.rint(map_y[on]).astype(int), np.rint(map_x[on]).astype(int)]
    assert middle.sum() > 100 and not lut.mask[middle].any()
    assert (on & ~lut.mask).sum() < 2 * middle.sum(), "and little more than what is hidden"


# ---------------------------------------------------------------------------------------------------------------------
# Wrong input


def test_what_has_no_view_is_refused():
    source = camera(FISHEYE)
    elsewhere = source.with_pose(camera(position=(1.5, 0.4, 1.4)).camera_from_vehicle)
    with refuses(ipm_rs.ArgumentError, "target", "0.1 m", "Lut(camera, grid)"):
        ipm_rs.Lut.between(source, elsewhere)
    with refuses(ipm_rs.ArgumentTypeError, "target", "Camera"):
        ipm_rs.Lut.between(source, source.intrinsics)
    with refuses(ipm_rs.ArgumentError, "focal", "alpha"):
        source.undistorted(focal=200, alpha=0)
    with refuses(ipm_rs.ArgumentError, "alpha", "0 to 1", "1.5"):
        source.undistorted(alpha=1.5)
    wide = ipm_rs.Camera([[180.0, 0, 319.5], [0, 180, 239.5], [0, 0, 1]], image_size=SIZE, lens=FISHEYE)
    with refuses(ipm_rs.CalibrationError, "alpha", "85 degrees", "Cylindrical"):
        wide.undistorted(alpha=1)
    assert wide.undistorted(alpha=1, lens=ipm_rs.Cylindrical()).lens == ipm_rs.Cylindrical()
    for size in [(0, 5), (2.5, 3), 7, "wide"]:
        with refuses(ipm_rs.ArgumentError, "size"):
            source.undistorted(size=size)
    for focal in [0, -3, np.nan, (1, 2, 3), "long"]:
        with refuses(ipm_rs.ArgumentError, "focal"):
            source.undistorted(focal=focal)
    down = camera(pitch=np.pi / 2, roll=0.0)
    with refuses(ipm_rs.ArgumentError, "level", "straight"):
        down.undistorted(level=True)
    with refuses(ipm_rs.ArgumentTypeError, "lens"):
        source.undistorted(lens="cylinder")
