"""Samples of data sets of cars and of reconstructions: numbers are ours, their layout that of real files."""

from __future__ import annotations

from calibration_sample import Sample, as_json

_OPTICAL = [
    [0.0, -0.28, 0.96],
    [-1.0, 0.0, 0.0],
    [0.0, -0.96, -0.28],
]  # x forward, y left, z up from a camera that looks down

# The lidar's x points left and its y back: a camera that looks ahead looks along -y.
ONCE = {
    "meta_info": {"weather": "sunny", "period": "morning", "image_list": ["cam01", "cam03"]},
    "calib": {
        "cam01": {
            "cam_to_velo": [[-1.0, 0.0, 0.0, 0.02], [0.0, 0.28, -0.96, -0.45], [0.0, -0.96, -0.28, -0.3], [0, 0, 0, 1]],
            "cam_intrinsic": [[939.5, 0.0, 965.25], [0.0, 938.75, 523.5], [0.0, 0.0, 1.0]],
            "distortion": [-0.311, 0.104, -0.00021, 0.00043, -0.0147],
        },
        "cam05": {
            "cam_to_velo": [[0.0, 0.6, 0.8, 0.4], [1.0, 0.0, 0.0, -0.1], [0.0, 0.8, -0.6, -0.25], [0, 0, 0, 1]],
            "cam_intrinsic": [[472.0, 0.0, 955.5], [0.0, 471.5, 511.0], [0.0, 0.0, 1.0]],
            "distortion": [-0.015, 0.003, 0.0001, -0.0002, 0.0],
        },
    },
    "frames": [{"frame_id": "1616343527200", "pose": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]}],
}

ZOD = {
    "FC": {
        "extrinsics": [[*_OPTICAL[0], 1.975], [*_OPTICAL[1], 0.0088], [*_OPTICAL[2], 1.147], [0.0, 0.0, 0.0, 1.0]],
        "intrinsics": [[1747.3, 0.0, 1926.1, 0.0], [0.0, 1747.2, 1081.4, 0.0], [0.0, 0.0, 1.0, 0.0]],
        "lidar_extrinsics": [[0.0, 1.0, 0.0, 1.11], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.74], [0.0, 0.0, 0.0, 1.0]],
        "image_dimensions": [3848, 2168],
        "distortion": [-0.0508, 0.0895, -0.0915, 0.0338],
        "undistortion": [0.052, -0.0933, 0.0989, -0.0378],
        "field_of_view": [119.51, 66.67],
        "xi": None,
    }
}

OPENLANE = {
    "extrinsic": [[0.96, 0.0, 0.28, 1.54], [0.0, 1.0, 0.0, -0.023], [-0.28, 0.0, 0.96, 2.115], [0.0, 0.0, 0.0, 1.0]],
    "intrinsic": [[2059.05, 0.0, 935.125], [0.0, 2059.05, 635.05], [0.0, 0.0, 1.0]],
    "lane_lines": [{"category": 2, "visibility": [1.0], "uv": [[900.0], [800.0]], "xyz": [[12.0], [0.1], [-1.9]]}],
    "file_path": "training/segment-1/152268801497018700.jpg",
}
OPENLANE_V2 = {
    "version": "OpenLane-V2_v2.0",
    "segment_id": "00000",
    "meta_data": {"source": "av2", "source_id": "0a"},
    "timestamp": 315969904359876000,
    "sensor": {
        "ring_front_center": {
            "image_path": "train/00000/image/ring_front_center/315969904349927217.jpg",
            "extrinsic": {"rotation": _OPTICAL, "translation": [1.63, -0.002, 1.43]},
            "intrinsic": {
                "K": [[1686.5, 0.0, 775.4], [0.0, 1686.5, 1014.1], [0, 0, 1]],
                "distortion": [-0.24, -0.21, 0.33],
            },
        },
        "ring_side_left": {
            "image_path": "train/00000/image/ring_side_left/315969904349927217.jpg",
            "extrinsic": {"rotation": [[1, 0, 0], [0, 0, 1], [0, -1, 0]], "translation": [1.31, 0.27, 1.44]},
            "intrinsic": {
                "K": [[1682.0, 0.0, 1029.0], [0.0, 1682.0, 776.0], [0, 0, 1]],
                "distortion": [-0.25, -0.2, 0.3],
            },
        },
    },
    "pose": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "translation": [10.0, 20.0, 1.0]},
}

PANDASET = b"""back_camera:
  extrinsic:
    transform:
      rotation: {w: 0.7, x: 0.7, y: -0.1, z: -0.1}
      translation: {x: -0.0004, y: -0.2168, z: -1.0553}
  intrinsic:
    D: [-0.1619, 0.0113, -0.00028815, -7.9827e-05, 0.0067]
    K: [933.4667, 0, 896.4692, 0, 934.6754, 507.3557, 0, 0, 1]
front_camera:
  extrinsic:
    transform:
      rotation: {w: 0.0, x: 0.0, y: 0.8, z: -0.6}
      translation: {x: 0.00026, y: -0.0391, z: -0.044}
  intrinsic:
    D: [-0.5894, 0.66, 0.0011, -0.001, -1.0088]
    K: [1970.0131, 0, 970.0002, 0, 1970.0091, 483.2988, 0, 0, 1]
front_gt:
  extrinsic:
    transform:
      rotation: {w: 0.0, x: 0.0, y: 0.0, z: 1.0}
      translation: {x: -0.00045, y: -0.6056, z: -0.3015}
main_pandar64:
  extrinsic:
    transform:
      rotation: {w: 1.0, x: 0.0, y: 0.0, z: 0.0}
      translation: {x: 0.0, y: 0.0, z: 0.0}
"""

# Axes as measured: not unit, and not quite perpendicular.
A2D2 = {
    "lidars": {"front_center": {"view": {"origin": [1.7, 0.0, 1.12], "x-axis": [1, 0, 0], "y-axis": [0, 1, 0]}}},
    "vehicle": {
        "view": {"origin": [0.0, 0.5, 0.0], "x-axis": [0.0, -1.0, 0.0], "y-axis": [1.0, 0.0, 0.0]},
        "ego-dimensions": {"x-range": [-1.5, 3.5], "y-range": [-1.0, 1.0], "z-range": [-0.5, 1.3]},
    },
    "cameras": {
        "front_center": {
            "tstamp_delay": 0,
            "view": {"origin": [1.711, -0.01, 0.943], "x-axis": [0.96, 0.0, -0.28], "y-axis": [0.0001, 1.0, 0.0002]},
            "Lens": "Telecam",
            "CamMatrix": [[1687.3369, 0.0, 965.4341], [0.0, 1783.4285, 684.4194], [0.0, 0.0, 1.0]],
            "CamMatrixOriginal": [[1844.1774, 0.0, 964.4299], [0.0, 1841.5212, 679.5332], [0.0, 0.0, 1.0]],
            "Distortion": [[-0.2611, 0.0012, 0.0003, -0.0002, 0.01]],
            "Resolution": [1920, 1208],
        },
        "side_left": {
            "tstamp_delay": 0,
            "view": {"origin": [0.58, 0.58, 0.94], "x-axis": [0.0, 2.0, 0.0], "y-axis": [-1.0, 0.0, 0.0]},
            "Lens": "Fisheye",
            "CamMatrix": [[679.5, 0.0, 960.6], [0.0, 754.5, 604.2], [0.0, 0.0, 1.0]],
            "CamMatrixOriginal": [[1003.2, 0.0, 957.1], [0.0, 1002.8, 603.8], [0.0, 0.0, 1.0]],
            "Distortion": [0.014, -0.011, 0.0102, -0.0062],
            "Resolution": [1920, 1208],
        },
    },
}

PJLAB = {
    "center_camera-intrinsic": {
        "sensor_name": "center_camera",
        "target_sensor_name": "center_camera",
        "device_type": "camera",
        "param_type": "intrinsic",
        "param": {
            "img_dist_w": 1392,
            "img_dist_h": 512,
            "cam_K": {
                "rows": 3, "cols": 3, "type": 6, "continuous": True,
                "data": [[903.7596, 0, 695.7519], [0, 901.9653, 224.2509], [0, 0, 1]],
            },
            "cam_dist": {
                "rows": 1, "cols": 4, "type": 6, "continuous": True,
                "data": [[-0.364, 0.1789, 0.0006, -0.0004, -0.0538]],
            },
        },
    }
}  # fmt: skip
PJLAB_EXTRINSIC = {
    "top_center_lidar-to-center_camera-extrinsic": {
        "sensor_name": "top_center_lidar",
        "target_sensor_name": "center_camera",
        "device_type": "relational",
        "param_type": "extrinsic",
        "param": {
            "time_lag": 0,
            "sensor_calib": {
                "rows": 4, "cols": 4, "type": 6, "continuous": True,
                "data": [[0, -1, 0, -0.0322], [-0.28, 0, -0.96, -0.3521], [0.96, 0, -0.28, -0.5745], [0, 0, 0, 1]],
            },
        },
    }
}  # fmt: skip

OPENSFM = [
    {
        "cameras": {
            "v2 apple iphone4,1 3264 2448 perspective 0.9722": {
                "projection_type": "perspective", "width": 3264, "height": 2448, "focal": 0.8697, "k1": 0.0885,
                "k2": -0.2324,
            },
            "v2 dji fc7203 4000 3000 brown 0.6666": {
                "projection_type": "brown", "width": 3000, "height": 4000, "focal_x": 0.7301, "focal_y": 0.7312,
                "c_x": 0.0015, "c_y": -0.0021, "k1": 0.0312, "k2": -0.081, "p1": 0.0004, "p2": -0.0006, "k3": 0.043,
            },
        },
        "shots": {
            "03.jpg": {
                "rotation": [1.0038, -0.3228, 0.5357],
                "translation": [0.5087, 24.7819, -20.532],
                "camera": "v2 apple iphone4,1 3264 2448 perspective 0.9722",
                "orientation": 1,
            },
            "DJI_0001.JPG": {
                "rotation": [1.6, 0.0, 0.0],
                "translation": [0.25, 1.5, -0.75],
                "camera": "v2 dji fc7203 4000 3000 brown 0.6666",
                "orientation": 1,
            },
        },
        "points": {"1": {"color": [1.0, 2.0, 3.0], "coordinates": [0.1, 0.2, 0.3]}},
    }
]  # fmt: skip

METASHAPE = b"""<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0">
  <chunk label="Chunk 1" enabled="true">
    <sensors next_id="2">
      <sensor id="0" label="M3M (12.29mm)" type="frame">
        <resolution width="5280" height="3956"/>
        <property name="pixel_width" value="0.0033582"/>
        <calibration type="frame" class="adjusted">
          <resolution width="5280" height="3956"/>
          <f>3705.4728</f>
          <cx>11.6738</cx>
          <cy>-27.7497</cy>
          <b1>0.5262</b1>
          <b2>-0.3058</b2>
          <k1>-0.0919</k1>
          <k2>-0.0112</k2>
          <k3>0.0062</k3>
          <p1>-0.0003134</p1>
          <p2>0.0001164</p2>
        </calibration>
        <covariance><params>f cx</params><coeffs>1 0 0 1</coeffs></covariance>
      </sensor>
      <sensor id="1" label="unknown" type="frame">
        <resolution width="640" height="480"/>
      </sensor>
    </sensors>
    <components next_id="1" active_id="0">
      <component id="0" label="Component 1">
        <transform>
          <rotation locked="true">0 -1 0 1 0 0 0 0 1</rotation>
          <translation locked="true">-2.5e6 -4.2e6 4.0e6</translation>
          <scale locked="true">12.5</scale>
        </transform>
      </component>
    </components>
    <cameras next_id="3" next_group_id="0">
      <camera id="0" sensor_id="0" component_id="0" label="DJI_0001_D">
        <transform>0 -0.28 0.96 0.25 -1 0 0 0.5 0 -0.96 -0.28 0.125 0 0 0 1</transform>
        <orientation>1</orientation>
      </camera>
      <camera id="1" sensor_id="0" component_id="0" label="DJI_0002_D">
        <transform>0 -0.28 0.96 0.75 -1 0 0 0.5 0 -0.96 -0.28 0.125 0 0 0 1</transform>
      </camera>
      <camera id="2" sensor_id="0" label="DJI_0003_D"/>
    </cameras>
    <reference>LOCAL_CS["Local Coordinates (m)"]</reference>
  </chunk>
</document>
"""

REALSENSE = {
    "color": {
        "width": 1280, "height": 720, "fx": 912.7766, "fy": 912.6449, "ppx": 641.7411, "ppy": 369.6803,
        "model": "distortion.inverse_brown_conrady", "coeffs": [0.0, 0.0, 0.0, 0.0, 0.0],
    },
    "depth": {
        "width": 848, "height": 480, "fx": 425.0078, "fy": 425.0079, "ppx": 428.6284, "ppy": 241.7116,
        "model": "distortion.brown_conrady", "coeffs": [0.11, -0.21, 0.0007, -0.0003, 0.08],
    },
}  # fmt: skip
REALSENSE_TEXT = b"""Device info:
    Name                          : \tIntel RealSense D435I
    Serial Number                 : \t218622278781

 Intrinsic of "Depth" / 640x480 / {Z16}
  Width:      \t640
  Height:     \t480
  PPX:        \t324.033264160156
  PPY:        \t233.439270019531
  Fx:         \t390.25830078125
  Fy:         \t390.5
  Distortion: \tBrown Conrady
  Coeffs:     \t0  \t0  \t0  \t0  \t0
  FOV (deg):  \t78.7 x 63.17

 Intrinsic of "Color" / 1280x720 / {YUYV/RGB8/BGR8/RGBA8/BGRA8/Y8}
  Width:      \t1280
  Height:     \t720
  PPX:        \t641.741088867188
  PPY:        \t369.680297851562
  Fx:         \t912.776611328125
  Fy:         \t912.644897460938
  Distortion: \tModified Brown Conrady
  Coeffs:     \t0.05  \t-0.02  \t0  \t0  \t0.01
  FOV (deg):  \t70.07 x 43.05

Extrinsic from "Color"\t  To\t  "Depth" :
 Rotation Matrix:
   0.999749        -0.021599        -0.00590855
   0.021574         0.999758        -0.00426594
   0.00599926       0.0041374        0.999973

 Translation Vector: -0.0146005274727941  -0.000270371703663841  -0.000890049617737532
"""

CAM2BEV = b"""# camera calibration matrix K
fx: 278.283
fy: 408.1295
px: 482.0
py: 302.0

# rotation matrix R (in deg)
yaw:    20.0
pitch:  8.0
roll:   -3.0

# vehicle coords of camera origin
XCam: 1.7
YCam: -0.25
ZCam: 1.4
"""

AUTOWARE = b"""%YAML:1.0
---
CameraExtrinsicMat: !!opencv-matrix
   rows: 4
   cols: 4
   dt: d
   data: [ 0., -0.28, 0.96, 1.0245, -1., 0., 0., -0.0389, 0., -0.96, -0.28, -0.9366,
       0., 0., 0., 1. ]
CameraMat: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 350.51, 0., 312.36, 0., 349.93, 228.73, 0., 0., 1. ]
DistCoeff: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.3096, 0.0848, 0.0004, -0.0012, 0. ]
ImageSize: [ 640, 480 ]
ReprojectionError: 0.
DistModel: plumb_bob
"""

FLEETS = {
    "once": Sample("once", {"000027.json": as_json(ONCE)}, options={"camera": "cam01", "image_size": (1920, 1020)}),
    "zod": Sample("zod", {"calibration.json": as_json(ZOD)}),
    "openlane": Sample(
        "openlane", {"152268801497018700.json": as_json(OPENLANE)}, options={"image_size": (1920, 1280)}
    ),
    "openlane v2": Sample(
        "openlane",
        {"315969904359876000-ls.json": as_json(OPENLANE_V2)},
        options={"camera": "ring_side_left", "image_size": (2048, 1550)},
    ),
    "pandaset": Sample(
        "pandaset",
        {"static_extrinsic_calibration.yaml": PANDASET},
        options={"camera": "front_camera", "image_size": (1920, 1080)},
    ),
    "a2d2": Sample("a2d2", {"cams_lidars.json": as_json(A2D2)}, options={"camera": "front_center"}),
    "pjlab": Sample("pjlab", {"center_camera-intrinsic.json": as_json(PJLAB)}),
    "opensfm": Sample("opensfm", {"reconstruction.json": as_json(OPENSFM)}, options={"camera": "DJI_0001.JPG"}),
    "metashape": Sample("metashape", {"cameras.xml": METASHAPE}, options={"camera": "DJI_0002_D"}),
    "realsense text": Sample("realsense", {"devices.txt": REALSENSE_TEXT}, options={"camera": "Color 1280x720"}),
    "realsense": Sample("realsense", {"intrinsics.json": as_json(REALSENSE)}, options={"camera": "depth"}),
    "cam2bev": Sample("cam2bev", {"front.yaml": CAM2BEV}, options={"image_size": (964, 604)}),
    "autoware": Sample("autoware", {"20191211_autoware_lidar_camera_calibration.yaml": AUTOWARE}),
}
