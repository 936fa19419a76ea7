"""`Trajectory`: poses between poses, and the files that hold them."""

from __future__ import annotations

import json
import math
import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors

AXIS = np.array([0.3, -0.8, 0.52]) / np.linalg.norm([0.3, -0.8, 0.52])


FIRST_MOMENT = np.datetime64("2011-09-26T13:02:25.964389445").astype("i8") / 1e9


def posed(rotation: np.ndarray, position) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose


def spun(angle: float, position=(0.0, 0.0, 0.0)) -> np.ndarray:
    """A turn about `AXIS` after one that is no symmetry of anything."""
    return posed(cv2.Rodrigues(AXIS * angle)[0] @ cv2.Rodrigues(np.array([0.2, 0.1, -2.9]))[0], position)


def drive(count: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Poses that turn and climb, at moments that are not even."""
    times = 100 + np.cumsum([0.1 + 0.02 * k for k in range(count)])
    poses = [spun(0.3 * k, (2.0 * k, 0.5 * k * k, 0.1 * k)) for k in range(count)]
    return times, np.array(poses)


def quaternion(R: np.ndarray) -> np.ndarray:
    """w x y z, from the axis and the angle."""
    vector = cv2.Rodrigues(R)[0].ravel()
    angle = np.linalg.norm(vector)
    return np.array([math.cos(angle / 2), *(math.sin(angle / 2) * vector / angle)])


@pytest.mark.parametrize("angle", [1e-6, 0.4, 2.0, 3.1])
def test_it_turns_evenly_about_one_axis_and_moves_straight(angle):
    trajectory = ipm_rs.Trajectory([2.0, 2.5], [spun(0, (1, 2, 3)), spun(angle, (2, 0, 3.5))])
    for share in (0.1, 0.5, 0.93):
        expected = spun(share * angle, (1 + share, 2 - 2 * share, 3 + 0.5 * share))
        assert np.abs(trajectory.at(2 + 0.5 * share) - expected).max() < 1e-12


def test_the_poses_themselves_come_back_as_they_are():
    times, poses = drive()
    poses[2, :3, :3] *= 1 + 3e-6  # within the tolerance, and kept
    trajectory = ipm_rs.Trajectory(times, poses)
    assert np.array_equal(trajectory.at(times[::-1]), poses[::-1])
    assert np.array_equal(trajectory.at(times[3]), poses[3]) and trajectory.at([]).shape == (0, 4, 4)
    assert len(trajectory) == 5 and (trajectory.start, trajectory.end) == (times[0], times[-1])
    assert not trajectory.poses.flags.writeable and "5 poses" in repr(trajectory)


def test_many_turns_take_the_shorter_way():
    """Quaternions of two signs mean one rotation; a whole turn and more passes every change of sign."""
    angles = np.linspace(0, 9 * np.pi, 90)
    trajectory = ipm_rs.Trajectory(angles, [spun(a) for a in angles])
    for angle in np.linspace(0, 9 * np.pi, 71):
        assert np.abs(trajectory.at(angle) - spun(angle)).max() < 1e-9


def test_gaps_ends_and_clocks():
    trajectory = ipm_rs.Trajectory([0, 0.5, 4, 4.5], [np.eye(4)] * 4)
    assert trajectory.covers([-0.1, 0, 0.2, 0.5, 0.6, 3.9, 4.0, 4.5, 4.6]).tolist() == (
        [False, True, True, True, False, False, True, True, False]
    )
    assert trajectory.covers(0.2) is True and trajectory.at(4.0).shape == (4, 4)
    with refuses(errors.ArgumentError, "a gap of 3.500 s", "max_gap"):
        trajectory.at([0.1, 1.0])
    for moment in (-0.1, 4.6):
        with refuses(errors.ArgumentError, "0.000000 to 4.500000", "offset"):
            trajectory.at(moment)
    wide = ipm_rs.Trajectory([0, 0.5, 4, 4.5], [np.eye(4)] * 4, max_gap=math.inf)
    assert wide.covers(1.0)
    late = ipm_rs.Trajectory(*drive(), offset=-0.25)
    assert np.array_equal(late.at(drive()[0][1] - 0.25), drive()[1][1])


def test_it_is_a_value():
    one, other = ipm_rs.Trajectory(*drive()), ipm_rs.Trajectory(*drive(), max_gap=2)
    assert one == ipm_rs.Trajectory(*drive()) and one != other and one != 3
    assert pickle.loads(pickle.dumps(one)) == one and hash(one) == hash(ipm_rs.Trajectory(*drive()))


@pytest.mark.parametrize(
    ("times", "poses", "error", "phrase"),
    [
        ([0, 0], [np.eye(4)] * 2, errors.ArgumentError, "grow"),
        ([0, -1], [np.eye(4)] * 2, errors.ArgumentError, "grow"),
        ([0], [np.eye(4)] * 2, errors.ArgumentError, "as many"),
        ([], np.zeros((0, 4, 4)), errors.ArgumentError, "at least one"),
        ([np.nan], [np.eye(4)], errors.ArgumentError, "finite"),
        (["a"], [np.eye(4)], errors.ArgumentTypeError, "seconds"),
        ([0], [np.eye(3)], errors.ArgumentError, "(N, 4, 4)"),
        ([0], [np.diag([1, 1, -1, 1])], errors.CalibrationError, "rigid"),
        ([0, 1], [np.eye(4), np.diag([1, 1.1, 1, 1])], errors.CalibrationError, "number 1"),
        ([0], [np.full((4, 4), np.nan)], errors.CalibrationError, "rigid"),
    ],
)
def test_what_is_no_trajectory(times, poses, error, phrase):
    with refuses(error, phrase):
        ipm_rs.Trajectory(times, poses)


def test_other_arguments_that_are_wrong():
    for options in ({"max_gap": 0}, {"max_gap": math.nan}, {"offset": math.inf}, {"max_gap": "long"}):
        with refuses(errors.ArgumentError, next(iter(options))):
            ipm_rs.Trajectory(*drive(), **options)
    trajectory = ipm_rs.Trajectory(*drive())
    for value, error in (
        (np.nan, errors.ArgumentError),
        ("now", errors.ArgumentTypeError),
        ([[1.0]], errors.ArgumentError),
    ):
        with refuses(error, "timestamps"):
            trajectory.at(value)


def write(path: Path, kind: str) -> Path:
    """The poses of `drive` in a format."""
    times, poses = drive()
    turns = [quaternion(pose[:3, :3]) for pose in poses]
    rows = list(zip(times, poses[:, :3, 3], turns, strict=True))
    if kind == "tum":
        text = "# t tx ty tz qx qy qz qw\n" + "".join(
            " ".join(map(repr, map(float, (t, *place, *q[1:], q[0])))) + "\n" for t, place, q in rows
        )
    elif kind == "csv":
        text = "timestamp,x,y,z,qx,qy,qz,qw,speed\n" + "".join(
            ",".join(map(repr, map(float, (t, *place, *q[1:], q[0], 7)))) + "\n" for t, place, q in rows
        )
    elif kind == "euroc":
        text = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n"
        text += "".join(f"{round(t * 1e9)},{','.join(map(repr, map(float, (*place, *q))))}\n" for t, place, q in rows)
    elif kind == "nuscenes":
        records = [
            {"token": f"{k}", "timestamp": round(t * 1e6), "translation": [*place], "rotation": [*q]}
            for k, (t, place, q) in enumerate(rows)
        ]
        text = json.dumps([*records[2:], *records[:2], records[3]])  # no order, and two sensors at one moment
    elif kind == "argoverse2":
        pyarrow = pytest.importorskip("pyarrow")
        from pyarrow import feather

        names = ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")
        values = np.array([[*q, *place] for _, place, q in rows])
        table = {"timestamp_ns": np.round(times * 1e9).astype("i8"), **dict(zip(names, values.T, strict=True))}
        feather.write_feather(pyarrow.table(table), str(path), compression="uncompressed")
        return path
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("a.txt", "tum"),
        ("a.tum", "tum"),
        ("a.csv", "csv"),
        ("b.csv", "euroc"),
        ("ego_pose.json", "nuscenes"),
        ("city_SE3_egovehicle.feather", "argoverse2"),
    ],
)
def test_files_hold_what_was_written(tmp_path, name, kind):
    times, poses = drive()
    path = write(tmp_path / name, kind)
    for source in (path, tmp_path) if kind in ("nuscenes", "argoverse2") else (path,):
        found = ipm_rs.Trajectory.load(source)
        assert np.abs(found.timestamps - times).max() < 1e-6
        assert np.abs(found.poses - poses).max() < 1e-9
    mount = posed(cv2.Rodrigues(np.array([0.1, 0.7, -0.3]))[0], (1.5, 0.2, 1.1))
    moved = ipm_rs.Trajectory.load(path, vehicle_from_sensor=mount, offset=3)
    assert np.abs(moved.poses @ mount - poses).max() < 1e-9 and moved.start == pytest.approx(times[0] + 3)


def test_angles_in_a_table_are_ours(tmp_path):
    (tmp_path / "a.csv").write_text(
        "time_ms,tx,ty,tz,roll_deg,pitch_deg,yaw_deg\n1000,1,2,3,5,-10,90\n2000,1,2,3,5,-10,90\n"
    )
    found = ipm_rs.Trajectory.load(tmp_path / "a.csv")
    assert found.timestamps.tolist() == [1, 2]
    assert np.allclose(found.poses[0, :3, :3], ipm_rs.rotation_from_euler(*np.radians([5, -10, 90])), atol=1e-15)


def test_kitti_odometry_becomes_a_drive_of_the_vehicle(tmp_path):
    """A camera 1.65 m up and 0.5 m ahead, pitched: where the vehicle goes is where it was made to go."""
    camera = ipm_rs.Camera.from_euler(np.eye(3), image_size=(9, 9), position=(0.5, 0.1, 1.65), pitch=0.1)
    vehicle = [posed(ipm_rs.rotation_from_euler(0, 0, 0.2 * k), (k, 0.1 * k, 0)) for k in range(4)]
    seen = [camera.camera_from_vehicle @ pose @ camera.vehicle_from_camera for pose in vehicle]
    (tmp_path / "poses.txt").write_text("\n".join(" ".join(map(repr, p[:3].ravel().tolist())) for p in seen))
    with refuses(errors.ArgumentError, "times.txt", "timestamps="):
        ipm_rs.Trajectory.load(tmp_path / "poses.txt")
    times = 0.1 * np.arange(4)
    found = ipm_rs.Trajectory.load(
        tmp_path / "poses.txt", timestamps=times, vehicle_from_sensor=camera.vehicle_from_camera
    )
    assert np.abs(found.poses - vehicle).max() < 1e-12
    (tmp_path / "times.txt").write_text("0.0\n1e-1\n2.0e-01\n0.3\n")
    ahead = ipm_rs.Trajectory.load(tmp_path / "poses.txt")
    assert np.allclose(ahead.timestamps, times)
    step = ahead.poses[1, :3, 3]
    assert step[0] > 0.9 and abs(step[1]) < 0.3  # x is ahead, whatever the camera's own axes are
    (tmp_path / "times.txt").write_text("0.0\n0.1\n")
    with refuses(errors.ArgumentError, "expected 4", "got 2"):
        ipm_rs.Trajectory.load(tmp_path / "poses.txt")


def test_oxts_of_kitti_raw(tmp_path):
    """A degree of latitude has 111.3 km on this sphere, one of longitude the cosine of the latitude times that."""
    (tmp_path / "oxts" / "data").mkdir(parents=True)
    stamps, degrees = [], 1e-5
    for k in range(3):
        numbers = [49.0 + k * degrees, 8.4 + 2 * k * degrees, 112 + 0.5 * k, 0.01, 0.02 * k, 0.3, *[0] * 24]
        (tmp_path / "oxts" / "data" / f"{k:010}.txt").write_text(" ".join(map(repr, numbers)))
        stamps.append(f"2011-09-26 13:02:25.{964389445 + k * 1000000}\n")
    (tmp_path / "oxts" / "timestamps.txt").write_text("".join(stamps))
    for place in (tmp_path, tmp_path / "oxts"):
        found = ipm_rs.Trajectory.load(place)
        assert found.start == pytest.approx(FIRST_MOMENT, abs=1e-6) and np.allclose(
            np.diff(found.timestamps), 1e-3, atol=1e-6
        )
        metres = math.radians(degrees) * 6378137
        east, north, up = found.poses[2, :3, 3]
        assert (east, up) == (pytest.approx(4 * metres * math.cos(math.radians(49)), rel=1e-9), pytest.approx(1.0))
        assert north == pytest.approx(2 * metres, rel=1e-6)
        assert np.allclose(found.poses[1, :3, :3], ipm_rs.rotation_from_euler(0.01, 0.02, 0.3))
    (tmp_path / "oxts" / "data" / "0000000001.txt").unlink()
    with refuses(errors.FileError, "3 timestamps", "got 2"):
        ipm_rs.Trajectory.load(tmp_path)


@pytest.mark.parametrize(
    ("name", "text", "phrase"),
    [
        ("a.txt", "1 2 3\n", "known are"),
        ("a.txt", "", "known are"),
        ("a.txt", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0\n", "line 2"),
        ("a.txt", "0 0 0 0 0 0 0 1\n1 0 0 nan 0 0 0 1\n", "line 2"),
        ("a.txt", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 3 1\n", "pose 2"),
        ("a.txt", "0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n", "grow"),
        ("a.csv", "0,0,0,0,0,0,0,1\n", "write timestamp,x,y,z"),
        ("a.csv", "timestamp,x,y,z\n0,1,2,3\n", "roll, pitch, yaw"),
        ("a.csv", "when,x,y,z,qx,qy,qz,qw\n1,2,3,4,0,0,0,1\n", "'when"),
        ("a.csv", "t,time,x,y,z,qx,qy,qz,qw\n", "one column t"),
        ("a.csv", "t,x,y,z,qx,qy,qz,qw\n", "below the names"),
        ("a.csv", "t,x,y,z,qx,qy,qz,qw\n1,2,3\n", "line 2"),
        ("a.csv", "t,x,y,z,roll,pitch,yaw\n1,2,3,4,5,6,7,8\n", "line 2"),
        ("a.json", "{}", "list of records"),
        ("a.json", "[{}]", "record 0"),
        ("a.json", "[", "cut short"),
        ("a.feather", "x", "a feather file"),
    ],
)
def test_files_that_are_none(tmp_path, name, text, phrase):
    (tmp_path / name).write_text(text)
    with refuses((errors.FileError, errors.ArgumentError), phrase):
        ipm_rs.Trajectory.load(tmp_path / name)


def test_paths_and_formats_that_are_none(tmp_path):
    with refuses(errors.MissingFileError, "poses"):
        ipm_rs.Trajectory.load(tmp_path / "none.txt")
    with refuses(errors.FileError, "ego_pose.json"):
        ipm_rs.Trajectory.load(tmp_path)
    path = write(tmp_path / "a.txt", "tum")
    for options, phrase in (
        ({"format": "gpx"}, "tum, kitti"),
        ({"timestamps": [1.0]}, "none for tum"),
        ({"vehicle_from_sensor": np.eye(3)}, "(4, 4)"),
    ):
        with refuses(errors.ArgumentError, phrase):
            ipm_rs.Trajectory.load(path, **options)
