"""Real depth and real lidar: the road is a plane, points land on the objects, the datasets' own formulae agree."""

from __future__ import annotations

import json

import numpy as np
import pytest

import ipm_rs


def plane_fit(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(a, b, c) of z = a x + b y + c, and what is left over."""
    design = np.c_[points[:, :2], np.ones(len(points))]
    plane = np.linalg.lstsq(design, points[:, 2], rcond=None)[0]
    return plane, points[:, 2] - design @ plane


# ---------------------------------------------------------------- CARLA


@pytest.fixture(scope="module")
def depth(shared_data) -> np.ndarray:
    return np.load(shared_data / "carla" / "depth_metres_1024x768_fov90.npz")["depth"]


def test_carla_depth_survives_its_code(depth):
    coded = ipm_rs.encode_carla_depth(depth)
    decoded = ipm_rs.decode_carla_depth(coded)
    half_a_step = 500 / (2**24 - 1)
    assert np.abs(decoded.astype(float) - depth).max() <= half_a_step + np.spacing(np.float32(1000)) / 2
    assert (coded[depth >= 1000] == 255).all() and (depth >= 1000).mean() > 0.2, "the sky"


def test_the_road_is_a_plane(depth):
    decoded = ipm_rs.decode_carla_depth(ipm_rs.encode_carla_depth(depth))
    height, width = depth.shape
    corner = np.array([[width / 2, 0, width / 2], [0, width / 2, height / 2], [0, 0, 1.0]])  # CARLA's, 90 degrees
    centre = corner - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])

    def road(matrix):
        points, _ = ipm_rs.points_from_depth(decoded, matrix, max_depth=30, frame="flu", compact=True, dtype="float64")
        ahead = points[(np.abs(points[:, 1]) < 1.2) & (np.abs(points[:, 2] + 1.989) < 0.1)]
        return ahead, *plane_fit(ahead)

    points, plane, rest = road(centre)
    print(f"\nroad: z = {plane[0]:+.5f} x {plane[1]:+.5f} y {plane[2]:+.4f}, {len(points)} points from "
          f"{points[:, 0].min():.1f} to {points[:, 0].max():.1f} m, rms {rest.std() * 1e3:.2f} mm, "
          f"max {np.abs(rest).max() * 1e3:.2f} mm")  # fmt: skip
    assert len(points) > 50_000 and np.ptp(points[:, 0]) > 12
    assert rest.std() < 1e-3 and np.abs(rest).max() < 5e-3
    # the half pixel is a tilt of the whole cloud: 0.5 / f
    tilt = road(corner)[1][0] - plane[0]
    assert abs(tilt - 0.5 / 512) < 1e-5


# ---------------------------------------------------------------- KITTI


@pytest.fixture(scope="module")
def kitti(shared_data):
    matrices = {}
    for line in (shared_data / "kitti" / "000114_calib.txt").read_text().splitlines():
        name, _, numbers = line.partition(":")
        if numbers:
            matrices[name] = np.array(numbers.split(), float)
    rectified, camera0_from_velo = np.eye(4), np.eye(4)
    rectified[:3, :3] = matrices["R0_rect"].reshape(3, 3)
    camera0_from_velo[:3] = matrices["Tr_velo_to_cam"].reshape(3, 4)
    P, velo = matrices["P2"].reshape(3, 4), rectified @ camera0_from_velo
    sweep = np.fromfile(shared_data / "kitti" / "000114.bin", np.float32).reshape(-1, 4)
    pose = velo.copy()
    pose[:3, 3] += np.linalg.inv(P[:, :3]) @ P[:, 3]
    camera = ipm_rs.Camera(P[:, :3], image_size=(1242, 375), camera_from_vehicle=pose)
    return camera, P, velo, sweep


def test_kitti_pixels_are_those_of_the_dataset_formula(kitti):
    camera, P, velo, sweep = kitti
    uv, depth, valid = camera.project(sweep[:, :3])
    homogeneous = np.c_[sweep[:, :3].astype(float), np.ones(len(sweep))] @ (P @ velo).T
    expected = homogeneous[:, :2] / homogeneous[:, 2:]
    assert np.abs(uv - expected)[depth > 0.5].max() < 1e-6
    assert valid.sum() == 19_396


def test_kitti_points_of_an_object_land_in_its_box(kitti, shared_data):
    """Those inside a labelled 3D box, in the labelled 2D box: two annotations that know nothing of our projection."""
    camera, _, velo, sweep = kitti
    in_camera0 = sweep[:, :3] @ velo[:3, :3].T + velo[:3, 3]
    c, s = np.cos(np.radians(1.5)), np.sin(np.radians(1.5))
    turn_left = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    turned = camera.with_pose(camera.camera_from_vehicle @ turn_left)
    hits, misplaced = [], []
    for line in (shared_data / "kitti" / "000114_label.txt").read_text().splitlines():
        kind, *numbers = line.split()
        truncated, _, _, left, top, right, bottom, height, width, length, x, y, z, yaw = map(float, numbers[:14])
        if kind == "DontCare" or truncated > 0.05:
            continue
        offset = in_camera0 - (x, y, z)
        along = np.cos(yaw) * offset[:, 0] - np.sin(yaw) * offset[:, 2]
        across = np.sin(yaw) * offset[:, 0] + np.cos(yaw) * offset[:, 2]
        inside = (np.abs(along) < length / 2) & (np.abs(across) < width / 2)
        inside &= (offset[:, 1] < -0.2) & (offset[:, 1] > -height)  # without the road under it
        if inside.sum() < 30:
            continue
        for which, found in ((camera, hits), (turned, misplaced)):
            pixel, _, _ = which.project(sweep[inside, :3])
            found.append(((pixel >= (left - 2, top - 2)) & (pixel <= (right + 2, bottom + 2))).all(1).mean())
    print(f"\n{len(hits)} objects: {min(hits):.1%} or more in their boxes; turned by 1.5 deg {np.mean(misplaced):.0%}")
    assert len(hits) >= 3 and min(hits) > 0.97 and np.mean(misplaced) < 0.9


# ---------------------------------------------------------------- nuScenes


@pytest.fixture(scope="module")
def nuscenes(shared_data):
    folder = shared_data / "nuscenes"
    calibration = json.loads((folder / "calibration.json").read_text())
    sweep = np.fromfile(next(folder.glob("*LIDAR_TOP*")), np.float32).reshape(-1, 5)
    cameras = {
        name: (entry, ipm_rs.Camera(entry["cam2img"], image_size=(1600, 900), camera_from_vehicle=entry["lidar2cam"]))
        for name, entry in calibration.items()
        if "cam2img" in entry
    }
    return folder, cameras, sweep


def test_nuscenes_pixels_are_those_of_view_points(nuscenes):
    _, cameras, sweep = nuscenes
    for entry, camera in cameras.values():
        uv, depth, _ = camera.project(sweep[:, :3])
        in_camera = np.array(entry["lidar2cam"]) @ np.c_[sweep[:, :3].astype(float), np.ones(len(sweep))].T
        view = np.array(entry["cam2img"]) @ in_camera[:3]
        front = depth > 1
        assert np.abs(uv - (view[:2] / view[2]).T)[front].max() < 1e-6


def test_six_cameras_colour_the_sweep(nuscenes):
    pillow = pytest.importorskip("PIL.Image")
    folder, cameras, sweep = nuscenes
    assert len(cameras) == 6
    colors, seen, before = np.zeros((len(sweep), 3)), np.zeros(len(sweep), bool), []
    for entry, camera in cameras.values():
        image = np.asarray(pillow.open(folder / entry["file"]).convert("RGB"))
        _, index = ipm_rs.render_points(sweep, camera, min_depth=1)  # of points in one pixel the nearest is coloured
        visible = np.flatnonzero(index.ravel() >= 0)
        points, pixels = index.ravel()[visible], image.reshape(-1, 3)[visible].astype(float)
        both = seen[points]
        if both.sum() > 50:  # exposure differs from camera to camera: compare the pattern
            before.append((np.corrcoef(colors[points[both]].mean(1), pixels[both].mean(1))[0, 1], both.sum()))
        colors[points], seen[points] = pixels, True
    agreement = np.average([r for r, _ in before], weights=[n for _, n in before])
    print(f"\n{seen.mean():.0%} of {len(sweep)} points coloured, {sum(n for _, n in before)} by two cameras, whose "
          f"brightness correlates by {agreement:.2f}")  # fmt: skip
    assert 0.5 < seen.mean() < 0.7, "the lidar sees above and below the cameras"
    assert len(before) >= 4 and agreement > 0.65
