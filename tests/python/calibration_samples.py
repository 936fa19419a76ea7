"""One small file of every calibration format, in its real layout; the tests of all readers mutate these.

`SAMPLES` maps a name to a `Sample`: files to write, which one (or the directory) to read, and the options it needs.
"""

from __future__ import annotations

from calibration_datasets import DATASETS
from calibration_fleets import FLEETS
from calibration_sample import Sample, as_json
from calibration_tools import COLMAP_BINARY, TOOLS

SAMPLES: dict[str, Sample] = {**DATASETS, **TOOLS, **FLEETS}

# ---------------------------------------------------------------------------------------------------------------------
# Calibration tools

ROS_YAML = b"""image_width: 640
image_height: 480
camera_name: narrow_stereo/left
camera_matrix:
  rows: 3
  cols: 3
  data: [438.783367, 0.000000, 305.593336, 0.000000, 437.302876, 243.738352, 0.000000, 0.000000, 1.000000]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361976, 0.110510, 0.001014, 0.000505, 0.000000]
rectification_matrix:
  rows: 3
  cols: 3
  data: [0.999978, 0.002789, -0.006046, -0.002816, 0.999986, -0.004401, 0.006034, 0.004417, 0.999972]
projection_matrix:
  rows: 3
  cols: 4
  data: [393.653800, 0.000000, 322.797939, -31.5, 0.000000, 393.653800, 241.090902, 0.0, 0.0, 0.0, 1.0, 0.0]
"""

ROS_INI = b"""# oST version 5.0 parameters

[image]

width
640

height
480

[narrow_stereo/left]

camera matrix
438.783367 0.000000 305.593336
0.000000 437.302876 243.738352
0.000000 0.000000 1.000000

distortion
-0.361976 0.110510 0.001014 0.000505 0.000000

rectification
0.999978 0.002789 -0.006046
-0.002816 0.999986 -0.004401
0.006034 0.004417 0.999972

projection
393.653800 0.000000 322.797939 -31.5
0.000000 393.653800 241.090902 0.0
0.000000 0.000000 1.000000 0.0
"""

OPENCV_YAML = b"""%YAML:1.0
---
calibration_time: "Tue 01 Jan 2013 12:00:00 PM"
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.3591573396163199e+02, 0., 3.4228315473308373e+02, 0.,
       5.3591573396163199e+02, 2.3557082909788173e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.6637260909660682e-01, -3.8588898922304653e-02,
       1.7831947042852964e-03, -2.8122100441115472e-04,
       2.3839153080878486e-01 ]
rvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 1.2, -1.2, 1.2 ]
tvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 0.1, 1.4, 0.3 ]
"""

OPENCV_STEREO_XML = b"""<?xml version="1.0"?>
<opencv_storage>
<imageSize>
  1280 720</imageSize>
<M1 type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    700. 0. 640.5 0. 701. 360.25 0. 0. 1.</data></M1>
<D1 type_id="opencv-matrix">
  <rows>1</rows>
  <cols>5</cols>
  <dt>d</dt>
  <data>
    -0.1 0.02 1e-3 -2e-3 0.</data></D1>
<M2 type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    710. 0. 630.5 0. 711. 350.25 0. 0. 1.</data></M2>
<D2 type_id="opencv-matrix">
  <rows>1</rows>
  <cols>5</cols>
  <dt>d</dt>
  <data>
    -0.2 0.03 1e-3 -3e-3 0.</data></D2>
<R type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    1. 0. 0. 0. 1. 0. 0. 0. 1.</data></R>
<T type_id="opencv-matrix">
  <rows>3</rows>
  <cols>1</cols>
  <dt>d</dt>
  <data>
    -0.12 0. 0.</data></T>
</opencv_storage>
"""

KALIBR_CHAIN = b"""cam0:
  T_cam_imu:
  - [0.01486554, -0.99988093, 0.00414030, -0.02164015]
  - [0.99955725, 0.01496721, 0.02571553, -0.06467699]
  - [-0.02577444, 0.00375619, 0.99966073, 0.00981073]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.0
cam1:
  T_cn_cnm1:
  - [0.99999726, -0.00231214, -0.00037628, -0.11007381]
  - [0.00231714, 0.99989805, 0.01408998, 0.00039912]
  - [0.00034367, -0.01409081, 0.99990066, -0.00085370]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: omni
  distortion_coeffs: [-0.2, 0.05, 1.0e-04, -2e-04]
  distortion_model: radtan
  intrinsics: [1.2, 900.5, 901.25, 380.0, 255.5]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
cam2:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: ds
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [-0.18, 0.59, 317.5, 316.2, 724.9, 546.6]
  resolution: [1440, 1080]
"""

# The front camera of WoodScape whose pixels are in `golden.WOODSCAPE_UV`.
WOODSCAPE = {
    "extrinsic": {
        "quaternion": [0.5941767906169857, -0.5878843193897473, 0.3873184109007999, -0.3890121040340926],
        "translation": [3.7484, 0.0, 0.66017],
    },
    "intrinsic": {
        "aspect_ratio": 1.0,
        "cx_offset": 3.942,
        "cy_offset": -3.093,
        "height": 966.0,
        "k1": 339.749,
        "k2": -31.988,
        "k3": 48.275,
        "k4": -7.201,
        "model": "radial_poly",
        "poly_order": 4,
        "width": 1280.0,
    },
    "name": "FV",
}

# The example of MATLAB's vehicleToImage.
MATLAB = {
    "Intrinsics": {"FocalLength": [800, 800], "PrincipalPoint": [320, 240], "ImageSize": [480, 640]},
    "Height": 2.18,
    "Pitch": 14,
    "Yaw": 0,
    "Roll": 0,
    "SensorLocation": [0, 0],
    "WorldUnits": "meters",
}

COLMAP_CAMERAS = b"""# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 3
1 SIMPLE_PINHOLE 3072 2304 2559.81 1536 1152
2 OPENCV 3072 2304 2560.56 2561.5 1536.25 1152.75 -0.02 0.01 0.001 -0.002
3 OPENCV_FISHEYE 1280 960 400.5 401.5 640.5 480.5 0.01 -0.002 0.0003 -0.00004
"""

COLMAP_IMAGES = b"""# Image list with two lines of data per image:
#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME
#   POINTS2D[] as (X, Y, POINT3D_ID)
1 0.5 0.5 -0.5 0.5 0.25 1.5 -0.75 2 left/frame 1.jpg
2362.39 248.498 58396 1784.7 268.254 59027
2 0.851773 0.0165051 0.503764 -0.142941 -0.737434 1.02973 3.74354 3 right.jpg

"""

SAMPLES |= {
    "ros": Sample("ros", {"left.yaml": ROS_YAML}),
    "ros ini": Sample("ros", {"ost.txt": ROS_INI}),
    "opencv": Sample("opencv", {"out_camera_data.yml": OPENCV_YAML}),
    "opencv stereo": Sample("opencv", {"stereo.xml": OPENCV_STEREO_XML}, options={"camera": "right"}),
    "kalibr": Sample("kalibr", {"camchain-imucam.yaml": KALIBR_CHAIN}, options={"camera": "cam1"}),
    "woodscape": Sample("woodscape", {"00001_FV.json": as_json(WOODSCAPE)}),
    "matlab": Sample("matlab", {"sensor.json": as_json(MATLAB)}),
    "colmap": Sample("colmap", {"cameras.txt": COLMAP_CAMERAS}, options={"camera": 2}),
    "colmap binary": Sample("colmap", {"cameras.bin": COLMAP_BINARY}, options={"camera": 3}),
}
