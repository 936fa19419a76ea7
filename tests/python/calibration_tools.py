"""Samples of calibration files that tools of robotics write: numbers are ours, their layout that of real files."""

from __future__ import annotations

import struct

from calibration_sample import Sample, as_json

OPENCV_HEADER = b"%YAML:1.0\n---\n"

CAMODOCAL = OPENCV_HEADER + (
    b"model_type: PINHOLE\ncamera_name: front\nimage_width: 752\nimage_height: 480\n"
    b"distortion_parameters:\n   k1: -2.917e-01\n   k2: 8.228e-02\n   p1: 5.333e-05\n   p2: -1.578e-04\n"
    b"projection_parameters:\n   fx: 4.616e+02\n   fy: 4.603e+02\n   cx: 3.630e+02\n   cy: 2.481e+02\n"
)
CAMODOCAL_MEI = OPENCV_HEADER + (
    b"model_type: MEI\ncamera_name: side\nimage_width: 1400\nimage_height: 1400\nmirror_parameters:\n   xi: 2.2134\n"
    b"distortion_parameters:\n   k1: 1.6798e-02\n   k2: 1.6548\n   p1: 4.2223e-04\n   p2: 4.2462e-04\n"
    b"projection_parameters:\n   gamma1: 1.3363e+03\n   gamma2: 1.3357e+03\n   u0: 7.1694e+02\n   v0: 7.0576e+02\n"
)
CAMODOCAL_FISHEYE = OPENCV_HEADER + (
    b"model_type: KANNALA_BRANDT\ncamera_name: up\nimage_width: 512\nimage_height: 510\nprojection_parameters:\n"
    b"   k2: 0.0034823\n   k3: 0.00071503\n   k4: -0.0020532\n   k5: 0.00020293\n   mu: 190.978\n   mv: 190.973\n"
    b"   u0: 254.931\n   v0: 256.897\n"
)
CAMODOCAL_PANORAMA = OPENCV_HEADER + (
    b"model_type: scaramuzza\ncamera_name: pal\nimage_width: 1280\nimage_height: 960\npoly_parameters:\n"
    b"   p0: -2.445e+02\n   p1: 0.\n   p2: 1.7486e-03\n   p3: -1.7578e-06\n   p4: 4.476e-09\ninv_poly_parameters:\n"
    b"   p0: 376.8\n   p1: 246.7\n   p2: 19.0\naffine_parameters:\n   ac: 1.0002\n   ad: 0.0011\n   ae: -0.0007\n"
    b"   cx: 645.1\n   cy: 486.02\n"
)


def _opencv_matrix(name: str, numbers: str) -> bytes:
    return f"{name}: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   data: [{numbers}]\n".encode()


VINS = (
    b'%YAML:1.0\n\nimu: 1\nnum_of_cam: 2\nimu_topic: "/imu0"\nimage_width: 752\nimage_height: 480\n'
    b'cam0_calib: "cam0.yaml"\ncam1_calib: "cam1.yaml"\nestimate_extrinsic: 0\n'
    + _opencv_matrix("body_T_cam0", "0., -1., 0., -0.021, 1., 0., 0., -0.064, 0., 0., 1., 0.009, 0., 0., 0., 1.")
    + _opencv_matrix("body_T_cam1", "0., -1., 0., -0.019, 0.8, 0., 0.6, 0.045, -0.6, 0., 0.8, 0.007, 0., 0., 0., 1.")
    + b"max_cnt: 150\n"
)
VINS_MONO = (
    CAMODOCAL.replace(b"---\n", b"\n")
    + b"estimate_extrinsic: 0\nextrinsicRotation: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    b"   data: [0., -1., 0., 1., 0., 0., 0., 0., 1.]\nextrinsicTranslation: !!opencv-matrix\n   rows: 3\n   cols: 1\n"
    b"   dt: d\n   data: [-0.021, -0.064, 0.009]\n"
)

EUROC = b"""# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)

# Sensor extrinsics wrt. the body-frame.
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -0.8, -0.6, -0.0216,
         1.0, 0.0, 0.0, -0.0647,
         0.0, -0.6, 0.8, 0.0098,
         0.0, 0.0, 0.0, 1.0]

# Camera specific definitions.
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.6, 457.3, 367.2, 248.4] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.2834, 0.07396, 0.000194, 1.762e-05]
"""

NCAMERA = b"""label: "rig"
id: 412eab8e4058621f7036b5e765dfe812
cameras:
- camera:
    label: cam0
    id: 54812562fa109c40fe90b29a59dd7798
    line-delay-nanoseconds: 0
    image_height: 480
    image_width: 752
    type: pinhole
    intrinsics:
      cols: 1
      rows: 4
      data: [461.2, 459.8, 363.1, 248.7]
    distortion:
      type: radial-tangential
      parameters:
        cols: 1
        rows: 4
        data: [-0.29, 0.083, 0.0002, 1.5e-05]
  T_B_C:
    cols: 4
    rows: 4
    data: [0, -1, 0, 0.01, 1, 0, 0, -0.06, 0, 0, 1, 0.02, 0, 0, 0, 1]
- camera:
    label: cam1
    id: 54812562fa109c40fe90b29a59dd7723
    image_height: 480
    image_width: 752
    type: pinhole
    intrinsics:
      cols: 1
      rows: 4
      data: [250.5, 251.25, 317.0, 241.5]
    distortion:
      type: equidistant
      parameters:
        cols: 1
        rows: 4
        data: [-0.018, 0.012, -0.009, 0.0021]
  T_B_C:
    cols: 4
    rows: 4
    data: [0, -1, 0, 0.011, 0.8, 0, 0.6, 0.05, -0.6, 0, 0.8, 0.02, 0, 0, 0, 1]
"""

OKVIS = b"""%YAML:1.0
cameras:
     - {T_SC:
        [ 0.0, -1.0, 0.0, -0.0216,
          1.0, 0.0, 0.0, -0.0647,
          0.0, 0.0, 1.0, 0.0098,
          0.0, 0.0, 0.0, 1.0],
        image_dimension: [752, 480],
        distortion_coefficients: [-0.2834, 0.0740, 0.0001936, 1.7619e-05],
        distortion_type: radialtangential,
        focal_length: [458.65, 457.3],
        principal_point: [367.2, 248.4]}

     - {T_SC:
        [ 0.0, -1.0, 0.0, -0.0198,
          1.0, 0.0, 0.0, 0.0454,
          0.0, 0.0, 1.0, 0.0079,
          0.0, 0.0, 0.0, 1.0],
        image_dimension: [752, 480],
        distortion_coefficients: [0.01, -0.004, 0.0006, 0.0002],
        distortion_type: equidistant,
        focal_length: [357.6, 356.1],
        principal_point: [379.9, 255.2]}

camera_params:
    camera_rate: 20
imu_params:
    g: 9.81007
"""

BASALT = {
    "value0": {
        "T_imu_cam": [
            {"px": 0.045, "py": -0.071, "pz": -0.047, "qx": 0.6, "qy": 0.0, "qz": 0.0, "qw": 0.8},
            {"px": -0.056, "py": -0.069, "pz": -0.044, "qx": 0.0, "qy": 0.28, "qz": 0.0, "qw": 0.96},
            {"px": 0.0, "py": 0.0, "pz": 0.0, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0},
        ],
        "intrinsics": [
            {
                "camera_type": "ds",
                "intrinsics": {"fx": 158.3, "fy": 158.2, "cx": 254.9, "cy": 257.0, "xi": -0.172, "alpha": 0.593},
            },
            {
                "camera_type": "kb4",
                "intrinsics": {
                    "fx": 190.9, "fy": 190.8, "cx": 252.6, "cy": 255.0, "k1": 0.0037, "k2": 0.0012, "k3": -0.0024,
                    "k4": 0.0003,
                },
            },
            {
                "camera_type": "eucm",
                "intrinsics": {"fx": 191.0, "fy": 191.1, "cx": 250.5, "cy": 251.5, "alpha": 0.62, "beta": 1.05},
            },
        ],
        "resolution": [[512, 512], [512, 512], [512, 512]],
        "calib_accel_bias": [0.0] * 9,
        "imu_update_rate": 200.0,
    }
}  # fmt: skip

ORB_SLAM3 = b"""%YAML:1.0

File.version: "1.0"

Camera.type: "KannalaBrandt8"

# Left Camera calibration and distortion parameters (OpenCV)
Camera1.fx: 190.978
Camera1.fy: 190.973
Camera1.cx: 254.932
Camera1.cy: 256.897
Camera1.k1: 0.0034824
Camera1.k2: 0.00071504
Camera1.k3: -0.0020532
Camera1.k4: 0.00020294

Camera2.fx: 190.442
Camera2.fy: 190.434
Camera2.cx: 252.597
Camera2.cy: 254.917
Camera2.k1: 0.0034003
Camera2.k2: 0.0017669
Camera2.k3: -0.0026631
Camera2.k4: 0.00032995

Camera.width: 512
Camera.height: 512
Camera.fps: 20
Camera.RGB: 1
Stereo.ThDepth: 40.0
Stereo.T_c1_c2: !!opencv-matrix
  rows: 4
  cols: 4
  dt: f
  data: [0.8, 0.0, 0.6, 0.101,
         0.0, 1.0, 0.0, 0.002,
         -0.6, 0.0, 0.8, -0.001,
         0.0, 0.0, 0.0, 1.0]
IMU.T_b_c1: !!opencv-matrix
  rows: 4
  cols: 4
  dt: f
  data: [-1.0, 0.0, 0.0, 0.045,
         0.0, 0.6, 0.8, -0.072,
         0.0, 0.8, -0.6, -0.046,
         0.0, 0.0, 0.0, 1.0]
ORBextractor.nFeatures: 1500
"""

ORB_SLAM2 = b"""%YAML:1.0

# Camera calibration and distortion parameters (OpenCV)
Camera.fx: 517.306
Camera.fy: 516.469
Camera.cx: 318.643
Camera.cy: 255.314

Camera.k1: 0.262
Camera.k2: -0.953
Camera.p1: -0.0054
Camera.p2: 0.0026
Camera.k3: 1.163

Camera.width: 640
Camera.height: 480
Camera.fps: 30.0
ORBextractor.nFeatures: 1000
"""

# A car's camera 1.4 m above the road, 0.2 rad down and 0.3 to the left, with OpenGL's axes.
NERFSTUDIO = {
    "w": 1920,
    "h": 1080,
    "fl_x": 1402.5,
    "fl_y": 1399.0,
    "cx": 957.0,
    "cy": 544.5,
    "k1": 0.0312,
    "k2": -0.0521,
    "p1": 0.0004,
    "p2": -0.0007,
    "camera_model": "OPENCV",
    "applied_transform": [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]],
    "frames": [
        {
            "file_path": "images/frame_00001.png",
            "transform_matrix": [[0.0, 0.28, -0.96, 2.0], [-1.0, 0.0, 0.0, -1.0], [0.0, 0.96, 0.28, 1.4], [0, 0, 0, 1]],
            "colmap_im_id": 1,
        },
        {
            "file_path": "images/frame_00002.png",
            "transform_matrix": [[0.0, 0.28, -0.96, 3.1], [-1.0, 0.0, 0.0, -1.1], [0.0, 0.96, 0.28, 1.4], [0, 0, 0, 1]],
            "colmap_im_id": 2,
        },
    ],
}
BLENDER = {
    "camera_angle_x": 0.6911112070083618,
    "frames": [
        {
            "file_path": "./train/r_0",
            "rotation": 0.012566370614359171,
            "transform_matrix": [[0.0, 0.28, -0.96, 2.0], [-1.0, 0.0, 0.0, -1.0], [0.0, 0.96, 0.28, 1.4], [0, 0, 0, 1]],
        }
    ],
}

OPEN3D = {"width": 640, "height": 480, "intrinsic_matrix": [571.5, 0, 0, 0, 570.25, 0, 317.5, 241.5, 1]}
OPEN3D_TRAJECTORY = {
    "class_name": "PinholeCameraTrajectory",
    "parameters": [
        {
            "class_name": "PinholeCameraParameters",
            "extrinsic": [1, 0, 0, 0, 0, 0.96, 0.28, 0, 0, -0.28, 0.96, 0, x, 0.2, 0.3, 1],
            "intrinsic": OPEN3D,
            "version_major": 1,
            "version_minor": 0,
        }
        for x in (0.0, 0.1)
    ],
    "version_major": 1,
    "version_minor": 0,
}


def _oak(extrinsics: dict, width: int, height: int, K: list, D: list, kind: int = 0) -> dict:
    return {
        "cameraType": kind,
        "distortionCoeff": D,
        "extrinsics": extrinsics,
        "height": height,
        "intrinsicMatrix": K,
        "lensPosition": 0,
        "specHfovDeg": 71.86,
        "width": width,
    }


def _oak_pose(x: float, target: int) -> dict:
    turn = [[0.96, 0.0, 0.28], [0.0, 1.0, 0.0], [-0.28, 0.0, 0.96]]
    spec = {"x": -7.5, "y": 0.0, "z": 0.0}
    return {
        "rotationMatrix": turn, "specTranslation": spec, "toCameraSocket": target,
        "translation": {"x": x, "y": 0.03, "z": 0.04},
    }  # fmt: skip


OAK_BROWN = [-1.27, -12.7, 0.0008, -0.0012, 74.5, -1.41, -12.1, 72.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
OAK = {
    "boardName": "DM9098",
    "boardRev": "R4M1E3",
    "cameraData": [
        [1, _oak(_oak_pose(-7.56, 2), 1280, 800, [[799.7, 0.0, 662.9], [0.0, 799.4, 382.2], [0, 0, 1]], OAK_BROWN)],
        [2, _oak(_oak_pose(3.79, 0), 1280, 800, [[802.1, 0.0, 640.5], [0.0, 801.9, 397.3], [0, 0, 1]], OAK_BROWN)],
        [
            0,
            _oak(
                {"rotationMatrix": [], "toCameraSocket": -1, "translation": {"x": 0.0, "y": 0.0, "z": 0.0}}, 1280, 720,
                [[1010.5, 0.0, 640.2], [0.0, 1009.8, 361.7], [0, 0, 1]], [0.01, -0.002, 0.0003, -0.0001], kind=1,
            ),
        ],
    ],
    "stereoRectificationData": {"leftCameraSocket": 1, "rightCameraSocket": 2, "rectifiedRotationLeft": []},
    "version": 7,
}  # fmt: skip

OCAM = b"""#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB)

 5 -1.790000e+02 0.000000e+00 1.530000e-03 -2.400000e-06 9.100000e-09

#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB)

 6 291.0 162.0 -5.0 15.0 3.5 1.25

#center: "row" and "column", starting from 0 (C convention)

 388.25 521.5

#affine parameters "c", "d", "e"

 1.000150 0.000080 -0.000210

#image size: "height" and "width"

 768 1024

"""
OCAM_INVERSE = b"""# polynomial, inverse polynomial, centre, affine, size
0
12 323.8265 220.1402 -12.7813 13.3857 37.0089 -3.6102 -9.3902 8.5561 3.6315 -1.0591 0.8942 0.6238
383.5 511.5
1.0 0.0 0.0
768 1024
"""

COLMAP_BINARY = struct.pack(
    "<QiiQQ8d", 2, 3, 4, 1600, 1200, 1260.5, 1258.0, 803.5, 596.0, -0.06, 0.021, 0.0003, -0.0005
)
COLMAP_BINARY += struct.pack("<iiQQ4d", 7, 1, 640, 480, 500.5, 501.0, 320.0, 240.25)
COLMAP_BINARY_IMAGES = (
    struct.pack("<Qi7di", 2, 11, 0.5, 0.5, -0.5, 0.5, 0.25, 1.5, -0.75, 3)
    + b"left/frame 1.jpg\0"
    + struct.pack("<QddqddQ", 2, 10.5, 20.25, 7, 30.0, 40.0, 2**64 - 1)
    + struct.pack("<i7di", 12, 0.6, 0.0, 0.8, 0.0, 0.1, 0.2, 0.3, 7)
    + b"right.jpg\0"
    + struct.pack("<Q", 0)
)

_TURN = {"qw": 0.5, "qx": -0.5, "qy": 0.5, "qz": -0.5}  # a camera that looks along +x of the vehicle
_AHEAD = {"rotation": _TURN, "translation": {"x": 1.7, "y": 0.2, "z": 1.35}}
_SIDEWAYS = {
    "rotation": {"qw": 0.1, "qx": -0.1, "qy": 0.7, "qz": -0.7}, "translation": {"x": 1.5, "y": -0.4, "z": 1.3}
}  # fmt: skip
DGP = {
    "names": ["LIDAR", "CAMERA_01", "CAMERA_05"],
    "extrinsics": [
        {"rotation": {"qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}, "translation": {"x": 0.0, "y": 0.0, "z": 0.0}},
        _AHEAD,
        _SIDEWAYS,
    ],
    "intrinsics": [
        {"fx": 0.0, "fy": 0.0, "cx": 0.0, "cy": 0.0, "skew": 0.0},
        {"fx": 2181.5, "fy": 2181.7, "cx": 928.0, "cy": 615.9, "skew": 0.0},
        {"fx": 1059.3, "fy": 1060.1, "cx": 960.5, "cy": 606.2, "skew": 0.25, "k1": -0.02, "k2": 0.003, "p1": 0.0001},
    ],
}


def _argoverse(name: str, focal: float, coefficients: list[float], translation: list[float]) -> dict:
    return {
        "key": f"image_raw_{name}",
        "value": {
            "focal_length_x_px_": focal,
            "focal_length_y_px_": focal + 0.5,
            "focal_center_x_px_": 969.5,
            "focal_center_y_px_": 604.75,
            "skew_": 0,
            "distortion_coefficients_": [-0.172, 0.11, -0.02],
            "vehicle_SE3_camera_": {"rotation": {"coefficients": coefficients}, "translation": translation},
        },
    }


ARGOVERSE1 = {
    "camera_data_": [
        _argoverse("ring_front_center", 1392.1, [0.5, -0.5, 0.5, -0.5], [1.64, 0.0, 1.37]),
        _argoverse("ring_side_left", 1398.4, [0.7, -0.7, 0.1, -0.1], [1.31, 0.25, 1.38]),
    ],
    "vehicle_SE3_up_lidar_": {"rotation": {"coefficients": [1, 0, 0, 0]}, "translation": [1.35, 0.0, 1.64]},
}

MMDET3D = {
    "sample_idx": 8,
    "images": {
        "CAM2": {
            "img_path": "000008.png",
            "height": 375,
            "width": 1242,
            "cam2img": [
                [721.5377, 0.0, 609.5593, 44.85728],
                [0.0, 721.5377, 172.854, 0.2163791],
                [0.0, 0.0, 1.0, 0.002745884],
                [0.0, 0.0, 0.0, 1.0],
            ],
            "lidar2cam": [
                [0.0, -1.0, 0.0, 0.02],
                [0.0, 0.0, -1.0, -0.07],
                [1.0, 0.0, 0.0, -0.29],
                [0.0, 0.0, 0.0, 1.0],
            ],
        },
        "CAM_FRONT": {
            "img_path": "n015.jpg",
            "cam2img": [[1266.4, 0.0, 816.3], [0.0, 1266.4, 491.5], [0.0, 0.0, 1.0]],
            "cam2ego": [[0.0, 0.0, 1.0, 1.7], [-1.0, 0.0, 0.0, 0.02], [0.0, -1.0, 0.0, 1.5], [0.0, 0.0, 0.0, 1.0]],
            "lidar2cam": [[1.0, 0.0, 0.0, 0.01], [0.0, 0.0, -1.0, -0.3], [0.0, 1.0, 0.0, -0.8], [0.0, 0.0, 0.0, 1.0]],
        },
    },
}

TOOLS = {
    "dgp": Sample("dgp", {"5f1c.json": as_json(DGP)}, options={"camera": "CAMERA_01", "image_size": (1936, 1216)}),
    "dgp side": Sample("dgp", {"5f1c.json": as_json(DGP)}, options={"camera": "CAMERA_05", "image_size": (1936, 1216)}),
    "argoverse1": Sample(
        "argoverse1",
        {"vehicle_calibration_info.json": as_json(ARGOVERSE1)},
        options={"camera": "ring_front_center", "image_size": (1920, 1200)},
    ),
    "argoverse1 side": Sample(
        "argoverse1",
        {"vehicle_calibration_info.json": as_json(ARGOVERSE1)},
        options={"camera": "image_raw_ring_side_left", "image_size": (1920, 1200)},
    ),
    "mmdet3d": Sample("mmdet3d", {"frame.json": as_json(MMDET3D)}, options={"camera": "CAM2"}),
    "mmdet3d ego": Sample(
        "mmdet3d", {"frame.json": as_json(MMDET3D)}, options={"camera": "CAM_FRONT", "image_size": (1600, 900)}
    ),
    "camodocal": Sample("camodocal", {"cam0.yaml": CAMODOCAL}),
    "camodocal mei": Sample("camodocal", {"image_02.yaml": CAMODOCAL_MEI}),
    "camodocal fisheye": Sample("camodocal", {"fisheye.yaml": CAMODOCAL_FISHEYE}),
    "camodocal panorama": Sample("camodocal", {"pal.yaml": CAMODOCAL_PANORAMA}),
    "camodocal vins": Sample(
        "camodocal",
        {"vins.yaml": VINS, "cam0.yaml": CAMODOCAL, "cam1.yaml": CAMODOCAL.replace(b"4.616e+02", b"4.571e+02")},
        options={"camera": 1},
    ),
    "camodocal vins-mono": Sample("camodocal", {"euroc_config.yaml": VINS_MONO}),
    "euroc": Sample("euroc", {"sensor.yaml": EUROC}),
    "ncamera": Sample("ncamera", {"ncamera.yaml": NCAMERA}, options={"camera": "cam1"}),
    "okvis": Sample("okvis", {"config.yaml": OKVIS}, options={"camera": 1}),
    "basalt": Sample("basalt", {"calibration.json": as_json(BASALT)}, options={"camera": 1}),
    "orbslam": Sample("orbslam", {"EuRoC.yaml": ORB_SLAM3}, options={"camera": 2}),
    "orbslam 2": Sample("orbslam", {"TUM1.yaml": ORB_SLAM2}),
    "nerfstudio": Sample(
        "nerfstudio", {"transforms.json": as_json(NERFSTUDIO)}, options={"camera": "images/frame_00001.png"}
    ),
    "nerfstudio blender": Sample(
        "nerfstudio", {"transforms_train.json": as_json(BLENDER)}, options={"image_size": (800, 600)}
    ),
    "open3d": Sample("open3d", {"intrinsic.json": as_json(OPEN3D)}),
    "open3d trajectory": Sample("open3d", {"trajectory.json": as_json(OPEN3D_TRAJECTORY)}, options={"camera": 1}),
    "depthai": Sample("depthai", {"depthai_calib.json": as_json(OAK)}, options={"camera": 1}),
    "ocamcalib": Sample("ocamcalib", {"calib_results.txt": OCAM}),
    "ocamcalib inverse": Sample("ocamcalib", {"calib_inverse.txt": OCAM_INVERSE}),
}
