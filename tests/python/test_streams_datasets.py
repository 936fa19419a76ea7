"""Drives in the layouts of KITTI raw and odometry, nuScenes, Argoverse 2 and DGP: what, when, from where."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from calibration_samples import SAMPLES
from helpers import refuses
from PIL import Image

import ipm_rs
from ipm_rs import errors, streams
from ipm_rs.cli import main


def picture(path: Path, number: int, size=(4, 3)) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.full((size[1], size[0], 3), number, np.uint8)).save(path)


def vehicle(k: float) -> np.ndarray:
    """Where the vehicle is at the k-th moment: it turns and climbs."""
    pose = np.eye(4)
    pose[:3, :3] = ipm_rs.rotation_from_euler(0.01 * k, -0.02 * k, 0.1 * k)
    pose[:3, 3] = (5 + 2 * k, 3 - k, 0.1 * k)
    return pose


def wxyz(R: np.ndarray) -> list[float]:
    w = math.sqrt(1 + np.trace(R)) / 2  # turns of less than half a circle
    return [w, (R[2, 1] - R[1, 2]) / 4 / w, (R[0, 2] - R[2, 0]) / 4 / w, (R[1, 0] - R[0, 1]) / 4 / w]


def poses_of(stream: streams.Stream) -> np.ndarray:
    return np.array([frame.map_from_vehicle for frame in stream])


@pytest.fixture
def raw(tmp_path) -> Path:
    """A drive of KITTI raw whose GPS/IMU goes straight east at 10 m/s, a packet 20 ms before each picture."""
    SAMPLES["kitti raw"].write(tmp_path)
    drive = tmp_path / "2011_09_26" / "2011_09_26_drive_0001_sync"
    degrees = math.degrees(1 / (6378137 * math.cos(math.radians(49))))
    stamps = {"oxts": "", "image_02": ""}
    for k in range(4):
        picture(drive / "image_02" / "data" / f"{k:010}.png", 10 + k)
        packet = [49.0, 8.4 + k * degrees, 115, 0, 0, 0, *[0.0] * 24]
        (drive / "oxts" / "data").mkdir(parents=True, exist_ok=True)
        (drive / "oxts" / "data" / f"{k:010}.txt").write_text(" ".join(map(repr, packet)))
        stamps["oxts"] += f"2011-09-26 13:02:25.{100 + 100 * k:03}000000\n"
        stamps["image_02"] += f"2011-09-26 13:02:25.{120 + 100 * k:03}000000\n"
    for name, text in stamps.items():
        (drive / name / "timestamps.txt").write_text(text)
    return drive


def test_kitti_raw(raw):
    stream = streams.open(raw)
    frames = list(stream)
    assert [int(frame.image[0, 0, 0]) for frame in frames] == [10, 11, 12, 13] and stream.rate == pytest.approx(10)
    assert [frame.name for frame in frames][:2] == ["0000000000", "0000000001"]
    assert np.allclose([frame.timestamp - stream.origin for frame in frames], [0, 0.1, 0.2, 0.3], atol=1e-6)
    day = raw.parent
    assert frames[0].camera == ipm_rs.Camera.from_kitti_raw(day, camera=2) == stream.camera
    for frame in ("velodyne", "imu", "camera"):
        found = streams.open(raw, frame=frame)
        velodyne_from_imu = found.camera.vehicle_from_camera @ (
            ipm_rs.Camera.from_kitti_raw(day, camera=2, frame="imu").camera_from_vehicle
        )
        for k, one in enumerate(list(found)[:3]):
            imu = one.map_from_vehicle @ velodyne_from_imu  # the IMU's own axes lie along the map's
            assert np.allclose(imu[:3, 3], [k + 0.2, 0, 0], atol=1e-5) and np.allclose(
                imu[:3, :3], np.eye(3), atol=1e-6
            )
    assert frames[3].map_from_vehicle is None  # after the last packet
    assert [frame.name[-1] for frame in streams.open(raw, start=0.05, end=0.25)] == ["1", "2"]
    (raw / "image_02" / "data" / "0000000001.png").unlink()  # some drives have holes
    times = [frame.timestamp - stream.origin for frame in streams.open(raw)]
    assert np.allclose(times, [0, 0.2, 0.3], atol=1e-6)
    with refuses(errors.MissingFileError, "image_00"):
        streams.open(raw, camera=0)
    with refuses(errors.ArgumentError, "camera"):
        streams.open(raw, camera=7)


@pytest.fixture
def odometry(tmp_path) -> Path:
    """A sequence of KITTI odometry, whose file of poses is of a camera that stands somewhere on the vehicle."""
    sequence = tmp_path / "sequences" / "04"
    sequence.mkdir(parents=True)
    P = "7.0e+00 0 2 {} 0 7.0e+00 1 0 0 0 1 0"
    lines = [f"P{k}: {P.format(-0.5 * k)}" for k in range(4)] + ["Tr: 0 -1 0 0.1 0 0 -1 -0.2 1 0 0 -0.3"]
    (sequence / "calib.txt").write_text("\n".join(lines))
    mount = ipm_rs.Camera.from_kitti(sequence / "calib.txt", camera=0, image_size=(4, 3)).vehicle_from_camera
    text = ""
    for k in range(3):
        picture(sequence / "image_2" / f"{k:06}.png", k)
        seen = np.linalg.inv(mount) @ np.linalg.inv(vehicle(0)) @ vehicle(k) @ mount
        text += " ".join(map(repr, seen[:3].ravel().tolist())) + "\n"
    (tmp_path / "poses").mkdir()
    (tmp_path / "poses" / "04.txt").write_text(text)
    (sequence / "times.txt").write_text("0.0e+00\n1.0e-01\n2.1e-01\n")
    return sequence


def test_kitti_odometry(odometry):
    stream = streams.open(odometry)
    assert [frame.timestamp for frame in stream] == [0, 0.1, 0.21] and stream.size == (4, 3)
    expected = [np.linalg.inv(vehicle(0)) @ vehicle(k) for k in range(3)]
    assert np.abs(poses_of(stream) - expected).max() < 1e-9
    assert stream.camera == ipm_rs.Camera.from_kitti(odometry / "calib.txt", camera=2, image_size=(4, 3))
    (odometry / "times.txt").unlink()
    assert [frame.timestamp for frame in streams.open(odometry)] == [None] * 3
    poses = odometry.parent.parent / "poses" / "04.txt"
    poses.write_text(poses.read_text().splitlines()[0])
    with refuses(errors.ArgumentError, "expected 1", "got 3"):
        streams.open(odometry)
    poses.unlink()
    assert [frame.map_from_vehicle for frame in streams.open(odometry)] == [None] * 3
    with refuses(errors.FileError, "image_1", "[2]"):
        streams.open(odometry, camera=1)


@pytest.fixture
def tables(tmp_path) -> Path:
    """Two scenes of nuScenes, two cameras, pictures between samples."""
    front = {"token": "f", "sensor_token": "s1", "translation": [1.7, 0, 1.5], "rotation": [0.5, -0.5, 0.5, -0.5]}
    K = [[5.0, 0, 2], [0, 5, 1], [0, 0, 1]]
    records = {
        "sensor": [{"token": "s1", "channel": "CAM_FRONT"}, {"token": "s2", "channel": "LIDAR_TOP"}],
        "calibrated_sensor": [{**front, "camera_intrinsic": K}, {**front, "token": "l", "sensor_token": "s2"}],
        "scene": [{"token": "a", "name": "scene-0001"}, {"token": "b", "name": "scene-0002"}],
        "sample": [{"token": f"{scene}{k}", "scene_token": scene} for scene in "ab" for k in range(3)],
        "ego_pose": [],
        "sample_data": [],
    }
    records["calibrated_sensor"][1]["camera_intrinsic"] = []
    for number, (scene, k, sweep) in enumerate((s, k, sweep) for s in "ba" for k in range(3) for sweep in (0, 1)):
        token, moment = f"{scene}{k}{sweep}", 1_532_402_927_612_460 + 1_000_000 * number
        pose = vehicle(number)
        records["ego_pose"].append(
            {"token": token, "timestamp": moment, "translation": [*pose[:3, 3]], "rotation": wxyz(pose[:3, :3])}
        )
        for channel, mount in (("CAM_FRONT", "f"), ("LIDAR_TOP", "l")):
            name = f"{'sweeps' if sweep else 'samples'}/{channel}/{token}.jpg"
            records["sample_data"].append(
                {
                    "token": token + mount,
                    "sample_token": f"{scene}{k}",
                    "ego_pose_token": token,
                    "calibrated_sensor_token": mount,
                    "timestamp": moment,
                    "is_key_frame": not sweep,
                    "width": 4,
                    "height": 3,
                    "filename": name,
                }
            )
            picture(tmp_path / name, number)
    records["sample_data"].reverse()
    (tmp_path / "v1.0-mini").mkdir()
    for name, table in records.items():
        (tmp_path / "v1.0-mini" / f"{name}.json").write_text(
            json.dumps(table, default=lambda x: x.tolist() if isinstance(x, np.ndarray) else x)
        )
    return tmp_path


def test_nuscenes(tables):
    for place in (tables, tables / "v1.0-mini"):
        stream = streams.open(place, scene="scene-0001")
        assert [frame.name for frame in stream] == ["a00", "a10", "a20"] and stream.rate == pytest.approx(0.5)
    assert np.abs(poses_of(stream) - [vehicle(k) for k in (6, 8, 10)]).max() < 1e-9
    assert stream.origin == pytest.approx(1532402933.61246, abs=1e-6)
    assert stream.camera.image_size == (4, 3) and np.allclose(stream.camera.position, [1.7, 0, 1.5])
    assert len(list(streams.open(tables, scene="a", sweeps=True))) == 6
    with refuses(errors.ArgumentError, "'scene-0001', 'scene-0002'"):
        streams.open(tables)
    for options, phrase in (({"camera": "LIDAR_TOP"}, "'CAM_FRONT'"), ({"scene": "scene-9"}, "'scene-9'")):
        with refuses(errors.ArgumentError, phrase):
            streams.open(tables, **{"scene": "a", **options})
    (tables / "v1.0-mini" / "sample.json").write_text("[{}]")
    with refuses(errors.FileError, "tables of nuScenes"):
        streams.open(tables, scene="a")
    (tables / "v1.0-mini" / "sample.json").unlink()
    with refuses(errors.MissingFileError, "sample.json"):
        streams.open(tables, scene="a")


def test_argoverse2(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import feather

    SAMPLES["argoverse2"].write(tmp_path)
    log = tmp_path / "log"
    nanoseconds = [315_969_904_949_927_217 + 50_000_000 * k for k in range(5)]
    rows = [{"timestamp_ns": t, **dict(zip(("qw", "qx", "qy", "qz"), wxyz(vehicle(k)[:3, :3]), strict=True)),
             **dict(zip(("tx_m", "ty_m", "tz_m"), vehicle(k)[:3, 3].tolist(), strict=True))}
            for k, t in enumerate(nanoseconds)]  # fmt: skip
    feather.write_feather(pyarrow.Table.from_pylist(rows), str(log / "city_SE3_egovehicle.feather"))
    for k in (1, 3):
        picture(log / "sensors" / "cameras" / "ring_front_center" / f"{nanoseconds[k]}.jpg", k)
    stream = streams.open(log)
    assert [frame.name for frame in stream] == [str(nanoseconds[k]) for k in (1, 3)]
    assert np.abs(poses_of(stream) - [vehicle(1), vehicle(3)]).max() < 1e-6
    assert stream.camera == ipm_rs.Camera.from_argoverse2(log)
    with refuses(errors.ArgumentError, "'ring_front_center'"):
        streams.open(log, camera="ring_rear_left")
    (log / "sensors" / "cameras" / "ring_front_center" / "first.jpg").write_bytes(b"")
    with refuses(errors.FileError, "nanoseconds"):
        streams.open(log)


def test_dgp(tmp_path):
    sample = SAMPLES["dgp"]
    (name,) = sample.files
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / "5f1c.json").write_bytes(sample.files[name])
    cameras = {one: ipm_rs.Camera.from_dgp(tmp_path / "calibration" / "5f1c.json", camera=one, image_size=(4, 3))
               for one in ("CAMERA_01", "CAMERA_05")}  # fmt: skip
    scene = {"data": [], "samples": [{"calibration_key": "5f1c", "datum_keys": []}]}
    for k in range(3):
        for one, camera in cameras.items():
            pose = vehicle(k) @ camera.vehicle_from_camera
            turn = dict(zip(("qw", "qx", "qy", "qz"), _turned(pose[:3, :3]), strict=True))
            where = {"rotation": turn, "translation": dict(zip("xyz", pose[:3, 3].tolist(), strict=True))}
            image = {"filename": f"rgb/{one}/{k}.png", "height": 3, "width": 4, "pose": where}
            moment = {"name": one, "timestamp": f"2464-11-12T01:04:0{k}.936530Z"}
            scene["data"].insert(0, {"datum": {"image": image}, "id": moment, "key": f"{one}{k}"})
            scene["samples"][0]["datum_keys"].append(f"{one}{k}")
            picture(tmp_path / "rgb" / one / f"{k}.png", k)
    (tmp_path / "scene_1.json").write_text(json.dumps(scene))
    for place in (tmp_path, tmp_path / "scene_1.json"):
        stream = streams.open(place, camera="CAMERA_05")
        assert [frame.name for frame in stream] == ["0", "1", "2"] and stream.rate == pytest.approx(1)
        assert np.abs(poses_of(stream) - [vehicle(k) for k in range(3)]).max() < 1e-5
        assert stream.camera == cameras["CAMERA_05"]
    with refuses(errors.ArgumentError, "'CAMERA_01', 'CAMERA_05'"):
        streams.open(tmp_path)
    scene["data"][0]["id"]["timestamp"] = "yesterday"
    (tmp_path / "scene_1.json").write_text(json.dumps(scene))
    with refuses(errors.FileError, "yesterday"):
        streams.open(tmp_path, camera="CAMERA_05")


def _turned(R: np.ndarray) -> list[float]:
    """The quaternion of any rotation: its axis is what R leaves alone."""
    K = np.array([
        [R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
        [R[1, 0] + R[0, 1], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
        [R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[2, 2] - R[0, 0] - R[1, 1], 0],
        [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)],
    ])  # fmt: skip
    x, y, z, w = np.linalg.eigh(K / 3)[1][:, -1]
    return [w, x, y, z]


def test_timestamps_that_go_back_are_refused(odometry):
    (odometry / "times.txt").write_text("0.0\n0.3\n0.2\n")
    with refuses(errors.FileError, "0.200000 of 000002.png", "after 0.300000"):
        streams.open(odometry)


def test_the_command_takes_a_drive_and_its_own_calibration(raw, tmp_path, capsys):
    size = streams.open(raw).size
    for k in range(4):
        picture(raw / "image_02" / "data" / f"{k:010}.png", 10 + k, size)
    grid = ["--x", "7", "20", "--y", "-4", "4", "--resolution", "0.5", "--ground", "-1.73"]
    assert main(["warp", str(raw), str(raw), "-o", str(tmp_path / "bevs"), *grid, "--every", "2"]) == 0
    assert "2 frames" in capsys.readouterr().out
    assert sorted(path.name for path in (tmp_path / "bevs").iterdir()) == ["0000000000_bev.png", "0000000002_bev.png"]
    for arguments, phrase in (
        (["--scene", "x"], "--scene"),
        (["--topic", "x"], "--topic"),
        (["--camera", "9"], "camera"),
    ):
        assert main(["warp", str(raw), str(raw), "-o", str(tmp_path / "x"), *grid, *arguments]) == 2
        assert phrase in capsys.readouterr().err and not (tmp_path / "x").exists()


def test_a_drive_knows_where_its_road_lies(raw, odometry, tmp_path, capsys):
    size = streams.open(raw).size
    for k in range(4):
        picture(raw / "image_02" / "data" / f"{k:010}.png", 10 + k, size)
    assert [streams.open(raw, frame=frame).ground for frame in ("velodyne", "imu", "camera")] == [-1.73, -0.93, -1.65]
    assert streams.open(odometry, every=2).ground == -1.73
    grid = ["--x", "7", "20", "--y", "-4", "4", "--resolution", "0.5"]
    for name, more in (("own", []), ("given", ["--ground", "-1.73"])):
        assert main(["warp", str(raw), str(raw), "-o", str(tmp_path / name), *grid, *more]) == 0
    told = capsys.readouterr().out.splitlines()
    assert "road at -1.73 m" in told[0] and "--ground" in told[0] and len(told) == 3
    own, given = (sorted((tmp_path / name).iterdir()) for name in ("own", "given"))
    assert [path.read_bytes() for path in own] == [path.read_bytes() for path in given] and len(own) == 4


def test_grey_cameras_without_a_lidar_see_the_road(tmp_path, capsys):
    """`calib.txt` of P0 and P1 alone: the vehicle frame is the camera's, 1.65 m above the road."""
    (tmp_path / "image_0").mkdir()
    (tmp_path / "calib.txt").write_text("".join(f"P{k}: 70 0 60 0 0 70 18 0 0 0 1 0\n" for k in range(2)))
    picture(tmp_path / "image_0" / "0.png", 1, (120, 37))
    grid = ["--x", "7", "20", "--y", "-4", "4", "--resolution", "0.5", "-o", str(tmp_path / "bevs")]
    assert main(["warp", str(tmp_path), str(tmp_path), *grid]) == 0
    assert "road at -1.65 m" in capsys.readouterr().out and (tmp_path / "bevs" / "0_bev.png").is_file()
    file = str(tmp_path / "calib.txt")
    options = ["--camera", "0", "--vehicle-frame", "camera", "--image-size", "120", "37"]
    assert main(["warp", file, str(tmp_path), *grid[:-1], str(tmp_path / "none"), *options]) == 2
    assert "edge-on" in (told := capsys.readouterr().err) and "here: --ground" in told
    assert not (tmp_path / "none").exists()


def test_a_real_drive_of_kitti(shared_data, tmp_path):
    """51 frames of 60 m with their poses, laid out as the dataset has them."""
    source, place = shared_data / "drive_kitti", tmp_path / "sequences" / "07"
    place.mkdir(parents=True)
    (place / "image_0").symlink_to(source / "image_l")
    (place / "poses.txt").symlink_to(source / "poses.txt")
    numbers = [line.split() for line in (source / "calib.txt").read_text().splitlines() if line.strip()]
    rows = [[word for word in words if not word.endswith(":")] for words in numbers]
    (place / "calib.txt").write_text("\n".join(f"P{k}: {' '.join(rows[min(k, len(rows) - 1)])}" for k in range(4)))
    stream = streams.open(place)
    poses = poses_of(stream)
    way = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum()
    assert len(poses) == 51 and way == pytest.approx(59.9, abs=0.1)
    assert poses[-1, 0, 3] > 59 and abs(poses[-1, 2, 3]) < 2  # ahead, and level
    assert stream.size == (1226, 370) and stream.camera.image_size == (1226, 370)


def test_a_real_scene_of_dgp(shared_data, tmp_path):
    """Three instants of DDAD: the vehicle's pose is the one that the lidar's own gives."""
    source = shared_data / "ring_drive"
    scene = json.loads((source / "scene_dgp.json").read_text())
    key = scene["samples"][0]["calibration_key"]
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / f"{key}.json").symlink_to(source / "calibration_dgp.json")
    (tmp_path / "scene_1.json").symlink_to(source / "scene_dgp.json")
    frames = [one for one in json.loads((source / "frames.json").read_text()) if one["camera"] == "CAMERA_05"]
    for one, name in zip(frames, [d["datum"]["image"]["filename"] for d in scene["data"]
                                  if d["id"]["name"] == "CAMERA_05"], strict=True):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).symlink_to(source / one["file"])
    stream = streams.open(tmp_path, camera="CAMERA_05")
    assert np.abs(poses_of(stream) - [one["world_from_vehicle"] for one in frames]).max() < 1e-5
    assert [frame.image.shape for frame in stream] == [(1216, 1936, 3)] * 3
