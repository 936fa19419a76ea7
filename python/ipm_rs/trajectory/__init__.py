"""`Trajectory`: where the vehicle was, and between two poses where it must have been."""

from ipm_rs.trajectory._trajectory import Trajectory

__all__ = ["Trajectory"]
