"""Samples of the data sets' formats and of our own, in their real layout, with made-up numbers of the usual size."""

from __future__ import annotations

from typing import Any

import golden
import numpy as np
from calibration_sample import Sample, as_json


def _lines(**keys: Any) -> bytes:
    """Lines `KEY: numbers` as KITTI prints them."""
    text = [f"{key}: {' '.join(f'{x:.12e}' for x in np.ravel(value))}\n" for key, value in keys.items()]
    return "".join(text).encode()


# KITTI: made-up numbers of the usual size. Rotations have seven digits, as in the files.
K = np.array([[720.5, 0.0, 610.25], [0.0, 720.5, 171.75], [0.0, 0.0, 1.0]])


def rotation(roll: float, pitch: float, yaw: float, digits: int = 7) -> np.ndarray:
    """Rz Ry Rx, printed and read back."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    Rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    Ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.round(Rz @ Ry @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]]), digits)


OPTICAL_FROM_FLU = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
STEREO = [(0.0, 0.0, 0.0), (-0.5372, 0.0, 0.0), (0.0598, -0.00036, 0.0027), (-0.4756, 0.0023, 0.0027)]
P = [K @ np.column_stack([np.eye(3), t]) for t in STEREO]
R0 = rotation(0.0043, -0.0074, -0.0099)
VELO_TO_CAM = np.column_stack(
    [np.round(rotation(0.0075, -0.0148, 0.0007) @ OPTICAL_FROM_FLU, 7), (-0.0041, -0.0763, -0.2718)]
)
IMU_TO_VELO = np.column_stack([rotation(0.0148, -0.002, -0.0008), (-0.8087, 0.3196, -0.7997)])
CAM_TO_ROAD = np.column_stack([rotation(0.0111, -0.0075, 0.0054, 12), (0.0096, -1.5971, 0.2789)])
DISTORTION = (-0.3692, 0.1969, 0.00135, 0.00068, -0.0677)

_KITTI = {
    **{f"P{i}": P[i] for i in range(4)},
    "R0_rect": R0,
    "Tr_velo_to_cam": VELO_TO_CAM,
    "Tr_imu_to_velo": IMU_TO_VELO,
}
_RAW = b"calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.950000e-02\n" + _lines(
    **{
        f"{key}_{i:02d}": value
        for i in range(4)
        for key, value in {
            "S": (1392, 512),
            "K": np.array([[959.8, 0, 696.0], [0, 956.9, 224.2], [0, 0, 1]]),
            "D": DISTORTION,
            "R": rotation(0.001 * i, -0.002 * i, 0.003 * i),
            "T": STEREO[i],
            "S_rect": (1242, 375),
            "R_rect": R0 if i == 0 else rotation(0.02, -0.01, 0.005 * i),
            "P_rect": P[i],
        }.items()
    }
)
KITTI_RAW_FILES = {
    "2011_09_26/calib_cam_to_cam.txt": _RAW,
    "2011_09_26/calib_velo_to_cam.txt": b"calib_time: 15-Mar-2012 11:37:16\n"
    + _lines(R=VELO_TO_CAM[:, :3], T=VELO_TO_CAM[:, 3], delta_f=(0, 0), delta_c=(0, 0)),
    "2011_09_26/calib_imu_to_velo.txt": b"calib_time: 25-May-2012 16:47:16\n"
    + _lines(R=IMU_TO_VELO[:, :3], T=IMU_TO_VELO[:, 3]),
}

# KITTI-360: made-up, but for the lens, whose numbers CALIBRATION's rays belong to.
_PLACES = [  # yaw and position of each camera
    (0.0379, (1.5753, 0.0044, -0.65)),
    (0.0205, (1.5977, 0.5981, -0.6488)),
    (-1.56, (0.7, -0.9, -0.85)),
    (1.55, (0.72, 1.0, -0.86)),
]
TO_POSE = [
    np.column_stack([rotation(0.01, 0.0988, yaw) @ np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), place])
    for yaw, place in _PLACES
]
CAM_TO_VELO = np.column_stack([rotation(0.01, 0.088, 0.044) @ OPTICAL_FROM_FLU.T, (0.8044, 0.2993, -0.177)])
_MEI = """%YAML:1.0
---
model_type: MEI
camera_name: image_0{number}
image_width: 1400
image_height: 1400
mirror_parameters:
   xi: 2.2134047507854890e+00
distortion_parameters:
   k1: 1.6798235660113681e-02
   k2: 1.6548773243373522e+00
   p1: 4.2223943394772046e-04
   p2: 4.2462134260997584e-04
projection_parameters:
   gamma1: 1.3363220825849971e+03
   gamma2: 1.3357883350012958e+03
   u0: 7.1694323510126321e+02
   v0: 7.0576498308221585e+02

"""
_P360 = [np.column_stack([[[552.5, 0, 682.0], [0, 552.5, 238.75], [0, 0, 1]], (x, 0, 0)]) for x in (0.0, -328.3)]
KITTI_360_FILES = {
    "calibration/perspective.txt": b"calib_time: 16-Jul-2020 21:20:55\ncorner_dist: 5.000000e-02\n"
    + _lines(
        S_rect_00=(1408, 376), R_rect_00=rotation(0.0032, -0.0001, 0.0071, 6), P_rect_00=_P360[0],
        S_rect_01=(1408, 376), R_rect_01=rotation(0.0012, 0.0103, 0.0049, 6), P_rect_01=_P360[1],
    ),
    "calibration/calib_cam_to_pose.txt": _lines(**{f"image_0{i}": TO_POSE[i] for i in range(4)}),
    "calibration/calib_cam_to_velo.txt": " ".join(f"{x:.10g}" for x in CAM_TO_VELO.ravel()).encode() + b"\n",
    "calibration/image_02.yaml": _MEI.format(number=2).encode(),
    "calibration/image_03.yaml": _MEI.format(number=3).encode(),
}  # fmt: skip

# nuScenes: a front camera and a side camera, whose quaternion reads otherwise when its order is mistaken; a lidar.
FRONT_RECORD = {
    "token": "0123456789abcdef0123456789abcdef",
    "sensor_token": "725903f5b62f56118f4094b46a4470d8",
    "translation": [1.70079118954, 0.0159456324149, 1.51095763913],
    "rotation": [0.4998015430569128, -0.5030316162024876, 0.4997798114386805, -0.49737083824542755],
    "camera_intrinsic": [
        [1266.417203046554, 0.0, 816.2670197447984],
        [0.0, 1266.417203046554, 491.50706579294757],
        [0.0, 0.0, 1.0],
    ],
}
SIDE_RECORD = {
    "token": "1123456789abcdef0123456789abcdef",
    "sensor_token": "ec4b5d41840a509984f7ec36419d4c09",
    "translation": [1.5, 0.5, 1.5],
    "rotation": [0.6754265, -0.6736266, 0.21214022, -0.2112188],
    "camera_intrinsic": [[1272.5, 0.0, 826.5], [0.0, 1272.5, 479.75], [0.0, 0.0, 1.0]],
}
LIDAR_RECORD = {
    "token": "2123456789abcdef0123456789abcdef",
    "sensor_token": "dc8b396651c05aedbb9cdaae573bb567",
    "translation": [0.94, 0.0, 1.84],
    "rotation": [0.7077955, -0.0064922, 0.0106462, -0.7063073],
    "camera_intrinsic": [],
}
NUIMAGES_RECORD = {**SIDE_RECORD, "camera_distortion": [-0.3, 0.12, 0.0004, -0.0002, -0.03]}
SENSORS = [
    {"token": FRONT_RECORD["sensor_token"], "channel": "CAM_FRONT", "modality": "camera"},
    {"token": SIDE_RECORD["sensor_token"], "channel": "CAM_FRONT_LEFT", "modality": "camera"},
    {"token": LIDAR_RECORD["sensor_token"], "channel": "LIDAR_TOP", "modality": "lidar"},
]
NUSCENES_TABLE = [FRONT_RECORD, SIDE_RECORD, LIDAR_RECORD]

# Argoverse 2: the front camera of the log that CALIBRATION's pixels belong to.
AV2_INTRINSICS = {
    "sensor_name": "ring_front_center", "fx_px": 1776.0414843455, "fy_px": 1776.0414843455,
    "cx_px": 777.9905731522801, "cy_px": 1013.5243245107571,
    "k1": -0.24073199487285743, "k2": -0.21224344364217385, "k3": 0.32590167193407427,
    "height_px": 2048, "width_px": 1550,
}  # fmt: skip
AV2_POSE = {
    "sensor_name": "ring_front_center",
    "qw": 0.5016454083000883, "qx": -0.49861992463738697, "qy": 0.5010700093854159, "qz": -0.4986570973931321,
    "tx_m": 1.6350176513238963, "ty_m": 0.0026764466473251165, "tz_m": 1.3979667966613305,
}  # fmt: skip


def _feather(rows: list[dict[str, Any]]) -> bytes:
    try:
        import pyarrow
        from pyarrow import feather
    except ImportError:
        return b""
    sink = pyarrow.BufferOutputStream()
    feather.write_feather(pyarrow.Table.from_pylist(rows), sink)
    return sink.getvalue().to_pybytes()


def argoverse2_files() -> dict[str, bytes]:
    """A log's directory; no bytes without pyarrow."""
    lidar = {**AV2_POSE, "sensor_name": "up_lidar", "tz_m": 1.6}
    side = {**AV2_INTRINSICS, "sensor_name": "ring_side_left", "height_px": 1550, "width_px": 2048}
    return {
        "log/calibration/intrinsics.feather": _feather([side, AV2_INTRINSICS]),
        "log/calibration/egovehicle_SE3_sensor.feather": _feather(
            [lidar, AV2_POSE, {**AV2_POSE, "sensor_name": "ring_side_left"}]
        ),
    }


# Waymo: the calibration of the dataset's own unit test of its camera model.
WAYMO = {
    "name": "FRONT",
    "intrinsic": [
        2055.55614936, 2055.55614936, 939.657469886, 641.072182194,
        0.032316008498, -0.321412482553, 0.000793258395371, -0.000625749354133, 0.0,
    ],
    "extrinsic": {
        "transform": [
            0.999892684989, -0.00599320840002, 0.0133678704017, 1.53891424471,
            0.00604223652133, 0.999975156055, -0.0036302411765, -0.0236339408393,
            -0.0133457814992, 0.00371062343188, 0.999904056092, 2.11527057298,
            0.0, 0.0, 0.0, 1.0,
        ]
    },
    "width": 1920,
    "height": 1280,
    "rollingShutterDirection": "LEFT_TO_RIGHT",
}  # fmt: skip

CARLA = {
    "image_size_x": "960", "image_size_y": "540", "fov": "90.0", "sensor_tick": "0.0",
    "transform": {
        "location": {"x": 1.5, "y": 0.25, "z": 2.4},
        "rotation": {"pitch": -15.0, "yaw": 7.0, "roll": 4.0},
    },
}  # fmt: skip
ROS_BRIDGE = {
    "objects": [
        {"type": "sensor.pseudo.traffic_lights", "id": "traffic_lights"},
        {
            "type": "vehicle.tesla.model3", "id": "ego_vehicle",
            "sensors": [
                {"type": "sensor.lidar.ray_cast", "id": "lidar", "spawn_point": {"x": 0, "y": 0, "z": 2}, "range": 50},
                {
                    "type": "sensor.camera.rgb", "id": "rgb_view",
                    "spawn_point": {"x": -4.5, "y": 0.0, "z": 2.8, "roll": 0.0, "pitch": 20.0, "yaw": 0.0},
                    "image_size_x": 800, "image_size_y": 600, "fov": 90.0,
                },
            ],
        },
    ]
}  # fmt: skip

OWN = {
    "format": "ipm_rs.Camera",
    "version": 1,
    "image_size": [1280, 720],
    "intrinsics": [[900.5, 0.25, 640.125], [0.0, 901.75, 359.5], [0.0, 0.0, 1.0]],
    "lens": {"model": "BrownConrady", "coefficients": [-0.3, 0.1, 0.001, -0.0005, 0.01], "max_angle": 0.9},
    "camera_from_vehicle": [[0.0, -1.0, 0.0, 0.1], [0.0, 0.0, -1.0, 1.5], [1.0, 0.0, 0.0, -1.75], [0.0, 0.0, 0.0, 1.0]],
}
_SIZE = {"image_size": (1242, 375)}

DATASETS: dict[str, Sample] = {
    "cityscapes": Sample("cityscapes", {"aachen_000000_000019_camera.json": as_json(golden.CALIBRATION)}),
    "cityscapes flat": Sample(
        "cityscapes",
        {"camera.json": as_json({**golden.CALIBRATION["extrinsic"], **golden.CALIBRATION["intrinsic"]})},
    ),
    "cityscapes 3d": Sample(
        "cityscapes",
        {
            "aachen_000000_000019_gtBbox3d.json": as_json(
                {
                    "imgWidth": 2048,
                    "imgHeight": 1024,
                    "sensor": {
                        "sensor_T_ISO_8855": golden.SENSOR_T_ISO_8855.tolist(),
                        "fx": 2262.52,
                        "fy": 2265.3017905988554,
                        "u0": 1096.98,
                        "v0": 513.137,
                        "baseline": 0.209313,
                    },
                    "objects": [],
                }
            )
        },
    ),
    "json": Sample("json", {"camera.json": as_json(OWN)}),
    "kitti object": Sample("kitti", {"000000.txt": _lines(**_KITTI) + b"\n"}, options=_SIZE),
    "kitti odometry": Sample(
        "kitti", {"calib.txt": _lines(**{f"P{i}": P[i] for i in range(4)}, Tr=VELO_TO_CAM)}, options=_SIZE
    ),
    "kitti road": Sample("kitti", {"um_000000.txt": _lines(**_KITTI, Tr_cam_to_road=CAM_TO_ROAD)}, options=_SIZE),
    "kitti tracking": Sample(
        "kitti",
        {
            "0000.txt": _lines(**{f"P{i}": P[i] for i in range(4)})
            + _lines(R_rect=R0, Tr_velo_cam=VELO_TO_CAM, Tr_imu_velo=IMU_TO_VELO).replace(b":", b"")
        },
        options=_SIZE,
    ),
    "kitti raw": Sample("kitti_raw", KITTI_RAW_FILES, "2011_09_26"),
    "kitti raw file": Sample("kitti_raw", KITTI_RAW_FILES, "2011_09_26/calib_cam_to_cam.txt"),
    "kitti-360": Sample("kitti_360", KITTI_360_FILES, "calibration"),
    "kitti-360 file": Sample("kitti_360", KITTI_360_FILES, "calibration/perspective.txt"),
    "kitti-360 fisheye": Sample("kitti_360", KITTI_360_FILES, "calibration/image_03.yaml"),
    "nuscenes": Sample(
        "nuscenes",
        {"calibrated_sensor.json": as_json(NUSCENES_TABLE), "sensor.json": as_json(SENSORS)},
        options={"camera": "CAM_FRONT_LEFT"},
    ),
    "nuscenes directory": Sample(
        "nuscenes",
        {"v1.0-mini/calibrated_sensor.json": as_json(NUSCENES_TABLE)},
        "v1.0-mini",
        {"camera": FRONT_RECORD["token"]},
    ),
    "nuscenes record": Sample("nuscenes", {"record.json": as_json(FRONT_RECORD)}),
    "nuimages": Sample("nuscenes", {"calibrated_sensor.json": as_json([NUIMAGES_RECORD])}),
    "waymo": Sample("waymo", {"front.json": as_json(WAYMO)}),
    "waymo context": Sample(
        "waymo",
        {"context.json": as_json({"cameraCalibrations": [WAYMO, {**WAYMO, "name": "SIDE_LEFT"}]})},
        options={"camera": "SIDE_LEFT"},
    ),
    "carla": Sample("carla", {"camera.json": as_json(CARLA)}),
    "carla ros bridge": Sample("carla", {"objects.json": as_json(ROS_BRIDGE)}),
}
if argoverse2_files()["log/calibration/intrinsics.feather"]:
    DATASETS["argoverse2"] = Sample("argoverse2", argoverse2_files(), "log")
    DATASETS["argoverse2 file"] = Sample("argoverse2", argoverse2_files(), "log/calibration/intrinsics.feather")
