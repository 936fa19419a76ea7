"""Poses from pictures, and from what is known of a scene: surveyed points, a projection matrix, an angle of view.

`Camera.from_ground_points`, `Camera.from_points`, `Camera.from_projection` and `Camera.from_fov` give the camera alone;
`from_ground_points` and `from_points` here also how far it can be trusted. `from_lines`, `height_from_width` and
`height_from_travel` mend a pose by what is marked in a picture or two. `from_drive` finds how a camera is really
mounted from the pictures of a drive and the vehicle's poses, `from_overlaps` the cameras of a ring from what two of
them see at once.
"""

from ipm_rs.refine._board import from_board
from ipm_rs.refine._drive import DriveFit, from_drive
from ipm_rs.refine._lines import from_lines, height_from_travel, height_from_width
from ipm_rs.refine._overlaps import RigFit, from_overlaps
from ipm_rs.refine._points import PoseFit, from_ground_points, from_points

__all__ = [
    "DriveFit",
    "PoseFit",
    "RigFit",
    "from_board",
    "from_drive",
    "from_ground_points",
    "from_lines",
    "from_overlaps",
    "from_points",
    "height_from_travel",
    "height_from_width",
]
