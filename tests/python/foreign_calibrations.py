"""Small files that are no calibration of a format read here: other tools' calibrations, and settings.

`FOREIGN` maps a name to the file's name, its text, and the format that comes nearest to it.
"""

from __future__ import annotations

import json

OPENCV_HEADER = "%YAML:1.0\n---\n"
POSE = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]

WAYMO_SHAPED = {"extrinsic": POSE, "width": 1280, "height": 720}
HOMOGRAPHY = OPENCV_HEADER + (
    "H: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 1.1, 0.02, -30., 0.01, 1.2, 4., 0.0001, 0.0002, 1. ]\n"
)

FOREIGN: dict[str, tuple[str, str, str]] = {
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
