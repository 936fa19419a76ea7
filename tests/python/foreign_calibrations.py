"""Small files that are no calibration of a format read here: other tools' calibrations, and settings.

`FOREIGN` maps a name to the file's name, its text, and the format that comes nearest to it.
"""

from __future__ import annotations

import json

OPENCV_HEADER = "%YAML:1.0\n---\n"
POSE = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]

CAMODOCAL = OPENCV_HEADER + (
    "model_type: PINHOLE\ncamera_name: front\nimage_width: 640\nimage_height: 400\n"
    "distortion_parameters:\n   k1: -0.29\n   k2: 0.08\n   p1: 0.0002\n   p2: -1e-05\n"
    "projection_parameters:\n   fx: 401.5\n   fy: 402.5\n   cx: 321.25\n   cy: 198.5\n"
)
CAMODOCAL_MEI = OPENCV_HEADER + (
    "model_type: MEI\ncamera_name: side\nimage_width: 640\nimage_height: 400\nmirror_parameters:\n   xi: 1.2\n"
    "distortion_parameters:\n   k1: 0.1\n   k2: -0.08\n   p1: 0.0002\n   p2: -1e-05\n"
    "projection_parameters:\n   gamma1: 401.5\n   gamma2: 402.5\n   u0: 321.25\n   v0: 198.5\n"
)
CAMODOCAL_FISHEYE = OPENCV_HEADER + (
    "model_type: KANNALA_BRANDT\ncamera_name: up\nimage_width: 640\nimage_height: 400\nprojection_parameters:\n"
    "   k2: 0.01\n   k3: -0.002\n   k4: 0.001\n   k5: 0.0\n   mu: 201.5\n   mv: 202.5\n   u0: 321.25\n   v0: 198.5\n"
)
EUROC = (
    "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0, 0, 0, 0, 1]\n"
    "resolution: [640, 400]\ncamera_model: pinhole\nintrinsics: [401.5, 402.5, 321.25, 198.5]\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 1e-05]\n"
)
ORB_SLAM = (
    "%YAML:1.0\n\nCamera.fx: 401.5\nCamera.fy: 402.5\nCamera.cx: 321.25\nCamera.cy: 198.5\nCamera.k1: 0.26\n"
    "Camera.k2: -0.95\nCamera.p1: -0.005\nCamera.p2: 0.002\nCamera.width: 640\nCamera.height: 400\nCamera.fps: 30.0\n"
    "LEFT.D: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [-0.28, 0.07, 0.0002, 1e-05, 0.0]\n"
)
OKVIS = (
    "%YAML:1.0\ncameras:\n  - {T_SC: [1, 0, 0, 0, 0, 1, 0, 0.01, 0, 0, 1, 0, 0, 0, 0, 1],\n"
    "     image_dimension: [640, 400], distortion_coefficients: [-0.284, 0.0745, -0.0001, -3.5e-05],\n"
    "     distortion_type: radialtangential, focal_length: [401.5, 402.5], principal_point: [321.0, 198.5]}\n"
)
NCAMERA = (
    "label: rig\ncameras:\n- camera:\n    label: cam0\n    image_height: 400\n    image_width: 640\n    type: pinhole\n"
    "    intrinsics: {cols: 1, rows: 4, data: [401.5, 402.5, 321.25, 198.5]}\n"
    "    distortion:\n      type: equidistant\n      parameters: {cols: 1, rows: 4, data: [-0.29, 0.08, 0.0002, 0.0]}\n"
)
BASALT = {
    "value0": {
        "T_imu_cam": [{"px": 0, "qw": 1}],
        "intrinsics": [{"camera_type": "ds", "intrinsics": {"fx": 351.0, "fy": 350.5, "xi": -0.21, "alpha": 0.58}}],
        "resolution": [[752, 480]],
    }
}
DEPTHAI = {
    "boardName": "OAK",
    "cameraData": [
        [
            0,
            {
                "width": 1280,
                "height": 800,
                "intrinsicMatrix": [[795.5, 0, 645], [0, 794, 402], [0, 0, 1]],
                "distortionCoeff": [0.4, -0.6, 0, 0, 0.2],
            },
        ]
    ],
}
NERFSTUDIO = {
    "w": 1920, "h": 1080, "fl_x": 1402.5, "fl_y": 1399.0, "cx": 957.0, "cy": 544.5, "k1": 0.03, "k2": -0.05,
    "camera_model": "OPENCV", "frames": [{"file_path": "a.png", "transform_matrix": POSE}],
}  # fmt: skip
OPEN3D = {"width": 640, "height": 480, "intrinsic_matrix": [571.5, 0, 0, 0, 570.25, 0, 317.5, 241.5, 1]}
WAYMO_SHAPED = {"extrinsic": POSE, "width": 1280, "height": 720}
HOMOGRAPHY = OPENCV_HEADER + (
    "H: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 1.1, 0.02, -30., 0.01, 1.2, 4., 0.0001, 0.0002, 1. ]\n"
)

FOREIGN: dict[str, tuple[str, str, str]] = {
    "camodocal": ("cam0.yaml", CAMODOCAL, "opencv"),
    "camodocal mei": ("cam0.yaml", CAMODOCAL_MEI, "kitti_360"),
    "camodocal mei, named as KITTI-360's": ("image_02.yaml", CAMODOCAL_MEI, "kitti_360"),
    "camodocal fisheye": ("up.yaml", CAMODOCAL_FISHEYE, "opencv"),
    "EuRoC": ("sensor.yaml", EUROC, "kalibr"),
    "ORB-SLAM": ("webcam.yaml", ORB_SLAM, "opencv"),
    "okvis": ("config.yaml", OKVIS, "opencv"),
    "ncamera": ("ncamera.yaml", NCAMERA, "opencv"),
    "basalt": ("calibration.json", json.dumps(BASALT), "kalibr"),
    "DepthAI": ("oak.json", json.dumps(DEPTHAI), "opencv"),
    "nerfstudio": ("transforms.json", json.dumps(NERFSTUDIO), ""),
    "Open3D": ("intrinsic.json", json.dumps(OPEN3D), "opencv"),
    "matrix by rows, as Waymo never has it": (
        "camera.json",
        json.dumps({"intrinsic": [[700, 0, 640], [0, 700, 360], [0, 0, 1]], **WAYMO_SHAPED}),
        "waymo",
    ),
    "nine numbers of a matrix, as Waymo never has them": (
        "camera.json",
        json.dumps({"intrinsic": [700, 0, 640, 0, 700, 360, 0, 0, 1], **WAYMO_SHAPED}),
        "waymo",
    ),
    "sizes that look like MATLAB's, and are not": (
        "camera.json",
        json.dumps({"imageSize": [1280, 720], "focalLength": [700, 700], "principalPoint": [640, 360]}),
        "matlab",
    ),
    "corner tracker": ("tracker.yaml", OPENCV_HEADER + "max_corners: 150\nk: 0.06\nd: 5\n", "opencv"),
    "network": ("net.yaml", "model: yolo\nimgsz: 640\nk: [1, 2, 3]\nd: [0.1, 0.2]\nsize: [640, 480]\n", "opencv"),
    "nine anchors": ("net.yaml", "k: [10, 13, 16, 30, 33, 23, 30, 61, 62]\nd: [1, 2, 3, 4, 5]\n", "opencv"),
    "homography": ("h.yml", HOMOGRAPHY, "opencv"),
    "package": ("package.json", json.dumps({"name": "x", "version": "1.0", "type": "module"}), "json"),
    "robot": ("robot.urdf", '<?xml version="1.0"?>\n<robot name="r"><link name="camera_matrix"/></robot>\n', "opencv"),
    "sensor poses": ("sensors.yaml", "base_link:\n  kit: {x: 0.9, roll: -0.001, pitch: 0.015, yaw: -0.03}\n", ""),
    "poses": ("poses.txt", "1.0 0.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 0.0 1.0 0.0\n" * 3, ""),
    "TOML": ("c.toml", '[cam_0]\nname = "A"\nmatrix = [[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0, 0, 1]]\n', ""),
    "prose about calibrations": (
        "README.md",
        "# Calibration\n\n- camera_matrix: in `ost.yaml`\n- K, D: see below\n",
        "",
    ),
}
