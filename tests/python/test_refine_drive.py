"""`refine.from_drive`: roll, pitch, yaw and height from a drive, and what it says where the pictures tell none."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from helpers import refuses
from PIL import Image

import ipm_rs
from ipm_rs import errors, refine, scene
from ipm_rs.refine import _alignment
from ipm_rs.refine._motion import angles_of
from ipm_rs.refine._pictures import Pyramid
from ipm_rs.refine._projection import Eye
from ipm_rs.refine._road import Pair, Pose, Road

K = np.array([[480.0, 0, 319.5], [0, 478, 120.0], [0, 0, 1]])
SIZE = (640, 280)
GRID = ipm_rs.BevGrid(x=(4, 16), y=(-2.6, 2.6), resolution=0.1)
TRUE = ipm_rs.Camera.from_euler(K, image_size=SIZE, position=(0.8, 0.1, 1.4), roll=0.01, pitch=0.06, yaw=-0.012)


@pytest.fixture(autouse=True)
def fewer_places(monkeypatch):
    """Compare a third of the places: as much is found, within the same bounds, in a third of the time."""
    monkeypatch.setattr(_alignment, "_POINTS", 12_000)


@cache
def drive(frames: int = 4, nods: tuple[float, ...] = ()) -> tuple[list[np.ndarray], np.ndarray]:
    """Pictures of the scene from a bend, with noise of two grey levels, and the vehicle's poses."""
    random = np.random.default_rng(7)
    images, poses = [], []
    for index in range(frames):
        pose = np.eye(4)
        yaw = 0.01 * 1.3 * index
        pose[:3, :3] = ipm_rs.rotation_from_euler(0.0, 0.0, yaw)
        pose[:2, 3] = 1.3 * index, 0.5 * 0.01 * (1.3 * index) ** 2
        camera = TRUE if not nods else turned(TRUE, pitch=nods[index])
        seen = scene.render(camera.with_pose(camera.camera_from_vehicle @ np.linalg.inv(pose)))
        images.append(np.clip(np.rint(seen + random.normal(0, 2, seen.shape)), 0, 255).astype(np.uint8))
        poses.append(pose)
    return images, np.array(poses)


def values(camera: ipm_rs.Camera) -> np.ndarray:
    """Roll, pitch, yaw in degrees, and the height."""
    return np.array([*np.degrees(angles_of(camera.vehicle_from_camera)), camera.position[2]])


def turned(camera: ipm_rs.Camera, roll=0.0, pitch=0.0, yaw=0.0, height=1.0) -> ipm_rs.Camera:
    angles = angles_of(camera.vehicle_from_camera) + np.array([roll, pitch, yaw])
    x, y, z = camera.position
    return ipm_rs.Camera.from_euler(
        camera.intrinsics,
        image_size=camera.image_size,
        position=(x, y, z * height),
        lens=camera.lens,
        **dict(zip(("roll", "pitch", "yaw"), angles, strict=True)),
    )


START = turned(TRUE, roll=np.radians(-1), pitch=np.radians(2), yaw=np.radians(1), height=0.9)


@cache
def straightforward() -> refine.DriveFit:
    return refine.from_drive(START, *drive(), grid=GRID)


def test_two_degrees_and_a_tenth_of_the_height_are_found():
    found = straightforward()
    off = values(found.camera) - values(TRUE)
    assert np.abs(off[:3]).max() < 0.03 and abs(off[3]) < 0.01 * 1.4, off
    assert found.parameters == ("roll", "pitch", "yaw", "height") and not found.kept
    assert found.after > 0.95 > 0.7 > found.before
    assert found.pairs == ((0, 1), (1, 2), (2, 3)) and found.grid == GRID and found.pitches is None
    np.testing.assert_allclose(found.camera.position[:2], TRUE.position[:2], err_msg="where it stands is not sought")
    deviations = np.array(list(found.deviations.values())) * ([180 / np.pi] * 3 + [1.0])
    assert (np.abs(off) < 4 * deviations).all() and deviations[1] < 0.01
    assert "pitch" in str(found) and "correlate" in str(found)


def test_the_answer_is_the_same_on_any_number_of_threads():
    images, poses = drive(3, tuple(np.radians([0.2, -0.2, 0.1])))
    before = ipm_rs.get_num_threads()
    found = []
    try:
        for threads in (1, 3):
            ipm_rs.set_num_threads(threads)
            found.append(refine.from_drive(turned(TRUE, pitch=0.01), images, poses, grid=GRID))
    finally:
        ipm_rs.set_num_threads(before)
    for other in found[1:]:
        assert other.camera == found[0].camera and (other.before, other.after) == (found[0].before, found[0].after)
        np.testing.assert_array_equal(other.covariance, found[0].covariance)


def test_the_default_road_is_the_own_lane():
    images, poses = drive()
    found = refine.from_drive(START, images[:2], poses[:2])
    (x0, x1), (y0, y1) = found.grid.x, found.grid.y
    assert 2 < x0 < 5 and 14 < x1 < 19 and -2 < y0 < -1.8 and 1.8 < y1 < 2.2
    assert np.abs(values(found.camera) - values(TRUE))[1:].max() < 0.03


def test_moving_things_count_for_nothing():
    images, poses = drive()
    random = np.random.default_rng(3)
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    covered = []
    for index, image in enumerate(images):
        blobs = np.zeros(image.shape[:2], bool)
        for _ in range(5):
            at = random.uniform((60, 150), (580, 270))
            blobs |= ((u - at[0] - 4 * index) / 1.6) ** 2 + (v - at[1]) ** 2 < random.uniform(10, 24) ** 2
        covered.append(np.where(blobs[..., None], random.integers(30, 230), image).astype(np.uint8))
    seen = ipm_rs.Lut(TRUE, GRID).warp((np.abs(covered[1].astype(int) - images[1]) > 30).astype(np.uint8).max(2) * 255)
    assert 0.05 < (seen > 127).mean() < 0.2
    found = refine.from_drive(START, covered, poses, grid=GRID)
    off = values(found.camera) - values(TRUE)
    assert np.abs(off[:3]).max() < 0.03 and abs(off[3]) < 0.01 * 1.4, off


def test_poses_of_the_camera_itself_tell_the_road_below_it():
    images, poses = drive()
    own = poses @ TRUE.vehicle_from_camera
    found = refine.from_drive(turned(TRUE, pitch=0.03, height=1.08), images, own, poses_of="camera", grid=GRID)
    off = values(found.camera) - values(TRUE)
    assert found.parameters == ("roll", "pitch", "height") and "yaw" in found.kept
    # the plane alone moves the pictures much less than the mounting does: pitch and height are told together
    assert np.abs(off[:2]).max() < 0.15 and abs(off[3]) < 0.01 * 1.4, off
    assert abs(off[2]) < 0.01, "the heading stays"


def test_a_fisheye_and_a_road_that_climbs():
    lens = ipm_rs.KannalaBrandt([0.03, -0.01, 0.002, -0.0004])
    images, poses = drive()[0][:3], drive()[1][:3]
    fish = ipm_rs.Camera([[300.0, 0, 319.5], [0, 300, 139.5], [0, 0, 1]], image_size=SIZE, lens=lens,
                         camera_from_vehicle=TRUE.camera_from_vehicle)  # fmt: skip
    pixels = np.stack(np.meshgrid(np.arange(640.0), np.arange(280.0)), -1).reshape(-1, 2)
    eye = TRUE.with_pose(np.eye(4))
    uv = eye.project(fish.with_pose(np.eye(4)).unproject(pixels))[0].reshape(280, 640, 2)
    bent = [ipm_rs.remap(image, uv[..., 0].copy(), uv[..., 1].copy()) for image in images]
    # the vehicle frame turned by 2 degrees: the same pictures of a road that climbs
    turn = np.eye(4)
    turn[:3, :3] = ipm_rs.rotation_from_euler(0.0, np.radians(2), 0.0)
    fish = fish.with_pose(fish.camera_from_vehicle @ turn)
    poses = poses @ turn
    climb = ipm_rs.Plane.from_angles(slope=np.radians(2))
    shown = (np.isfinite(uv).all(2) & (uv > 1).all(2) & (uv < (638, 278)).all(2))  # fmt: skip
    start = turned(fish, pitch=0.02, yaw=-0.01, height=1.05).masked(shown)
    found = refine.from_drive(start, bent, poses, ground=climb, grid=GRID)
    off = values(found.camera) - values(fish)
    assert np.abs(off[:3]).max() < 0.05 and abs(off[3]) < 0.01 * 1.4, off
    np.testing.assert_array_equal(found.camera.mask, shown)


def test_the_nodding_of_each_picture():
    """Without the nods, of which the poses do not know, one pitch for all would be 1.4 degrees off."""
    nods = tuple(np.radians([0.2, -0.2, 0.1, -0.1, 0.25, -0.1]))
    images, poses = drive(6, nods)
    found = refine.from_drive(turned(TRUE, pitch=0.01), images, poses, grid=GRID, per_frame=True)
    off = np.degrees(found.pitches) - values(TRUE)[1] - np.degrees(nods)
    # a pitch of all and the height share what the pairs tell: how the nods differ they tell better
    assert np.abs(off - off.mean()).max() < 0.03 and abs(off.mean()) < 0.06, off
    assert found.after > 0.97
    at = found.camera_at(3)
    assert abs(values(at)[1] - np.degrees(found.pitches[3])) < 1e-9
    assert abs(at.position[2] - found.heights[3]) < 1e-9
    with refuses(errors.ArgumentError, "one of 6"):
        found.camera_at(6)
    with refuses(errors.ArgumentError, "per_frame=True"):
        straightforward().camera_at(0)


def test_nods_are_noticed_without_being_asked_for():
    nods = tuple(np.radians([0.2, -0.2, 0.1, -0.1, 0.25, -0.1]))
    found = refine.from_drive(turned(TRUE, pitch=0.01), *drive(6, nods), grid=GRID)
    off = values(found.camera) - values(TRUE)
    deviations = np.array(list(found.deviations.values())) * ([180 / np.pi] * 3 + [1.0])
    assert np.abs(off[:3]).max() < 0.1 and abs(off[3]) < 0.01 * 1.4, off
    assert (np.abs(off) < 4 * deviations).all() and deviations[1] > 0.03, (off, deviations)
    assert 0.1 < np.degrees(found.nodding) < 0.3 and found.pitches is None
    assert "nods by" in str(found) and "per_frame=True" in str(found)
    assert straightforward().nodding == 0.0 and "nods" not in str(straightforward())


@pytest.mark.parametrize("of_camera", [False, True])
@pytest.mark.parametrize("lens", [None, ipm_rs.KannalaBrandt([0.03, -0.01, 0.002, -0.0004])])
def test_derivatives_are_those_of_the_pictures(of_camera, lens):
    """On a picture whose brightness is linear, sampling and its slope are exact: what remains is the geometry."""
    eye = Eye(ipm_rs.Camera(K, image_size=SIZE, lens=lens))
    v, u = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float32)
    pyramids = [Pyramid(0.3 * u + 0.2 * v), Pyramid(0.1 * u - 0.4 * v)]
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = ipm_rs.rotation_from_euler(0.01, -0.02, 0.05), (-1.3, 0.1, 0.02)
    if of_camera:
        motion = TRUE.camera_from_vehicle @ motion @ TRUE.vehicle_from_camera
    climb = ipm_rs.Plane.from_angles(slope=0.02, bank=0.01)
    road = Road(eye, pyramids, [Pair(0, 1, motion, np.eye(4))], climb, of_camera)
    pose = Pose(TRUE.vehicle_from_camera[:3, :3], TRUE.position, np.array([[0.004, 0.02], [-0.006, -0.01]]))
    (sight,) = road.sights(pose.still, GRID, 0, 300)
    values, slopes = road.residuals(pose, road.pairs[0], sight, 0, slopes=True)
    both = np.isfinite(values) & np.isfinite(slopes).all(1)
    assert both.sum() > 150
    for column in range(8):
        step = np.zeros(8)
        step[column] = 3e-4  # values of 100 grey levels in float32 are good for 1e-5
        ends = [
            road.residuals(pose.moved(sign * step, range(4)), road.pairs[0], sight, 0, slopes=False)[0]
            for sign in (1, -1)
        ]
        differences = (ends[0] - ends[1]) / 6e-4
        inside = both & np.isfinite(differences)
        np.testing.assert_allclose(slopes[inside, column], differences[inside], rtol=1e-3, atol=0.05)


def test_what_the_pictures_do_not_tell():
    images, poses = drive()
    with refuses(errors.ArgumentError, "two or more"):
        refine.from_drive(TRUE, images[:1], poses[:1])
    with refuses(errors.ArgumentError, "drive on"):
        refine.from_drive(TRUE, images, np.tile(np.eye(4), (4, 1, 1)))
    with refuses(errors.ArgumentError, "m apart"):
        far = poses.copy()
        far[:, :3, 3] *= 100
        refine.from_drive(TRUE, images, far)
    with refuses(errors.ImageError, "contrast"):
        refine.from_drive(TRUE, [np.full_like(image, 80) for image in images], poses)
    with refuses(errors.ImageError, "images[1]", "same picture as images[0]"):
        refine.from_drive(TRUE, [images[0]] * 4, poses)
    with refuses(errors.CalibrationError, "order of pictures and poses"):
        refine.from_drive(TRUE, images[:3], poses[2::-1])
    random = np.random.default_rng(0)
    with refuses(errors.CalibrationError, "agree"):
        refine.from_drive(TRUE, [random.integers(0, 255, image.shape, dtype=np.uint8) for image in images], poses)
    with refuses(errors.ArgumentError, "as many as poses"):
        refine.from_drive(TRUE, images[:3], poses)
    with refuses(errors.ImageError, "images[2]", "640x280"):
        refine.from_drive(TRUE, [*images[:2], images[2][:-1], images[3]], poses)
    with refuses(errors.ImageError, "finite"):
        refine.from_drive(TRUE, [image * np.float32("nan") for image in images], poses)
    with refuses(errors.CalibrationError, "poses", "finite"):
        refine.from_drive(TRUE, images, poses * np.where(np.arange(4) == 2, np.nan, 1.0)[:, None, None])
    with refuses(errors.CalibrationError, "poses[1]", "rigid"):
        wrong = poses.copy()
        wrong[1, :3, :3] *= 2
        refine.from_drive(TRUE, images, wrong)
    with refuses(errors.ArgumentError, "poses_of"):
        refine.from_drive(TRUE, images, poses, poses_of="imu")
    with refuses(errors.CalibrationError, "above the road"):
        refine.from_drive(TRUE, images, poses, ground=3.0)
    with refuses(errors.ArgumentError, "sees road"):
        refine.from_drive(turned(TRUE, pitch=-1.0), images, poses)
    with refuses(errors.ArgumentError, "grid"):
        refine.from_drive(TRUE, images, poses, grid=ipm_rs.BevGrid(x=(-9, -4), y=(-2, 2), resolution=0.1))
    with refuses(errors.ArgumentTypeError, "camera"):
        refine.from_drive("front", images, poses)


def test_a_real_drive(shared_data):
    """KITTI's nominal mounting, level at 1.65 m, is 0.7 degrees off; left of the lane grass stands higher."""
    folder = shared_data / "drive_kitti"
    matrix = np.loadtxt(folder / "calib.txt")[0].reshape(3, 4)[:, :3]
    poses = np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)[:16]
    images = [np.asarray(Image.open(folder / "image_l" / f"{index:06d}.png")) for index in range(16)]
    nominal = ipm_rs.Camera.from_euler(matrix, image_size=(1226, 370), position=(0, 0, 1.65))
    found = refine.from_drive(nominal, images, poses, poses_of="camera")
    roll, pitch, yaw, height = values(found.camera)
    assert 0.4 < pitch < 1.0 and abs(roll) < 1 and abs(yaw) < 1e-6 and 1.55 < height < 1.7
    assert found.before < 0.95 < found.after
