"""Numbers that were computed and confirmed outside this package, typed in; nothing here is derived from its code."""

from __future__ import annotations

import numpy as np

# Cityscapes camera of the Stuttgart sequence. The vehicle matrix and the pixels agree with cv2.projectPoints to
# 4e-12 px, the sign of pitch and yaw with the dataset's own sensor_T_ISO_8855.
PITCH, ROLL, YAW = 0.03842560000000292, 0.0, -0.009726800000000934
POSITION = (1.7, 0.026239999999999368, 1.212400000000026)
FX, FY, U0, V0 = 2263.54773399985, 2250.3728170599807, 1079.0175620000632, 515.006600600019
IMAGE_SIZE = (2048, 1024)

K = np.array([[FX, 0.0, U0], [0.0, FY, V0], [0.0, 0.0, 1.0]])
RT = np.array(
    [
        [-0.009726646624267145, -0.9999526950538443, 0.0, 0.04277405797946639],
        [-0.038414327353478654, 0.00037366026345484946, -0.9992618274666492, 1.276799591276192],
        [0.9992145574397054, -0.009719466680887502, -0.03841614462713175, -1.651833975095857],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
POINTS = np.array(
    [
        [10.0, 0.0, 0.0],
        [10.0, 3.0, 0.0],
        [10.0, -3.0, 0.0],
        [20.0, 0.0, 0.0],
        [50.0, 10.0, 0.0],
        [50.0, -10.0, 0.0],
        [7.0, 10.0, 0.0],
        [7.0, -10.0, 0.0],
    ]
)
UV = np.array(
    [
        [1064.2284062502101, 755.8620516829769],
        [247.16330874797774, 757.0105787363667],
        [1875.600356880362, 754.7215273373536],
        [1060.2795688741342, 577.4283436844538],
        [588.712879283372, 485.12497261212667],
        [1525.870259408624, 484.8975460926834],
        [-3246.941493537947, 949.0108977698844],
        [5229.326545036534, 930.4105558745827],
    ]
)
DEPTH = np.array(
    [
        8.340311599301199,
        8.311153199258536,
        8.369469999343861,
        18.332457173698252,
        48.21169923008054,
        48.40608856369829,
        5.245473260173206,
        5.439862593790956,
    ]
)
VALID = np.array([True, True, True, True, True, True, False, False])

# The camera file, nested as the dataset has it.
CALIBRATION = {
    "extrinsic": {
        "baseline": 0.21409619719999115,
        "pitch": PITCH,
        "roll": ROLL,
        "yaw": YAW,
        "x": POSITION[0],
        "y": POSITION[1],
        "z": POSITION[2],
    },
    "intrinsic": {"fx": FX, "fy": FY, "u0": U0, "v0": V0},
}

# (X, Y, 1) on the road to pixel times depth, same camera.
GROUND_HOMOGRAPHY = np.array(
    [
        [1056.153326757786, -2273.928132238124, -1685.536746623405],
        [428.155534435163, -4.164714595275, 2022.569692771502],
        [0.99921455744, -0.009719466681, -1.651833975096],
    ]
)
VANISHING_POINT = (1056.983526605, 428.492090360)  # of the vehicle's x axis
AXIS_MEETS_ROAD = (33.235, -0.281)  # where the optical axis meets z = 0

# Same place and intrinsics, an attitude with all three angles: tells Rz Ry Rx from every other order.
ORDER_ROLL, ORDER_PITCH, ORDER_YAW = 0.1, 0.2, 0.3
ORDER_RT = np.array(
    [
        [0.2750958473182437, -0.9564250858492325, -0.09784339500725571, -0.3239410140815317],
        [-0.21835066314633444, 0.03695701352462508, -0.975170327201816, 1.5525228800133895],
        [0.9362933635841992, 0.28962947762551555, -0.19866933079506122, -1.3584318989300945],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
ORDER_POINTS = np.array([[10.0, 2.0, 0.0], [15.0, 6.0, 1.0], [12.0, 4.0, -0.5]])
ORDER_UV = np.array(
    [
        [1214.6040770527538, 368.9616897554047],
        [755.3761697285918, 123.2832047967763],
        [916.4784245545552, 427.6444098233928],
    ]
)

# CARLA's Transform.get_matrix() for roll 10, pitch 20, yaw 30 degrees, and its mirror image in forward-left-up axes.
CARLA_ROLL_PITCH_YAW_DEG = (10.0, 20.0, 30.0)
CARLA_ROTATION = np.array(
    [
        [0.8137976813493738, -0.44096961052988237, -0.37852230636979245],
        [0.46984631039295416, 0.8825641192593856, -0.018028311236297247],
        [0.3420201433256687, -0.16317591116653482, 0.9254165783983234],
    ]
)
FLU_ROLL_PITCH_YAW_DEG = (10.0, -20.0, -30.0)
FLU_ROTATION = np.array(
    [
        [0.8137976813493738, 0.44096961052988237, -0.37852230636979245],
        [-0.46984631039295416, 0.8825641192593856, 0.018028311236297247],
        [0.3420201433256687, 0.16317591116653482, 0.9254165783983234],
    ]
)

# The documents' grid: 860 rows x 800 columns, row i at X = 50 - 0.05 i, column j at Y = 10 - 0.025 j.
GRID_X, GRID_Y, GRID_RESOLUTION = (7.0, 50.0), (-10.0, 10.0), (0.05, 0.025)
GRID_SHAPE = (860, 800)

# The documents' 26 sample points: grid corners, one lane to each side, the axis from 6 m to 25 m.
SAMPLE_POINTS = np.array(
    [(x, y, 0.0) for x in (50, 7) for y in (10, -10)]
    + [(10, -3, 0.0), (10, 3, 0.0)]
    + [(x, 0, 0.0) for x in range(6, 26)],
    dtype=np.float64,
)
SAMPLE_OFF_IMAGE = [(7.0, 10.0), (7.0, -10.0), (6.0, 0.0)]

# Vehicle to camera in the camera's own forward-left-up axes, for pitch 0.038, yaw -0.0195, position (1.7, 0.1, 1.22):
# the example of the dataset's own notebook on 3D boxes.
SENSOR_T_ISO_8855 = np.array(
    [
        [0.9990881051503779, -0.01948468779721943, -0.03799085532693703, -1.6501524664770573],
        [0.019498764210995674, 0.9998098810245096, 0.0, -0.1331288872611436],
        [0.03798363254444427, -0.0007407747301939942, 0.9992780868764849, -1.2836173638418473],
    ]
)
