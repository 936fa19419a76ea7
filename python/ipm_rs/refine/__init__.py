"""Poses from what is known of a scene: points that were surveyed, a projection matrix, an angle of view.

`Camera.from_ground_points`, `Camera.from_points`, `Camera.from_projection` and `Camera.from_fov` give the camera alone;
`from_ground_points` and `from_points` here also how far it can be trusted.
"""

from ipm_rs.refine._points import PoseFit, from_ground_points, from_points

__all__ = ["PoseFit", "from_ground_points", "from_points"]
