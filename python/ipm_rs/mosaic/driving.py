"""Whether poses can be those of a vehicle on a road: a camera's own, taken for its, make a map of nothing sensible."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Drive"]

_STEP, _JUMP = 0.5, 50.0
"""Metres between which a motion is looked at: less is the noise of a receiver, more another drive."""

_ENOUGH = 2.0
"""Metres after which a drive is judged."""

_MEND = (
    "give the vehicle's poses (x ahead, y left, z up): of a camera's own, Trajectory.load(..., "
    "vehicle_from_sensor=camera.vehicle_from_camera) makes them, and on the command line --poses-of camera"
)


class Drive:
    """The poses of a drive one after another, and what is odd about them.

    KITTI's odometry has poses of the left camera, in the axes of the first one: z ahead and y down. Taken for a
    vehicle's, it stands upright at first and then climbs along the map's z. A camera's poses in a map with z up lie on
    their side from the first on.
    """

    def __init__(self) -> None:
        self._before: NDArray[np.float64] | None = None
        self._upright = 1.0
        self._level = self._climbed = self._ahead = self._aside = 0.0

    def goes_to(self, pose: NDArray[Any]) -> None:
        """Note where the vehicle is next."""
        self._upright = min(self._upright, float(pose[2, 2]))
        if self._before is None:
            self._before = pose
            return
        step = pose[:3, 3] - self._before[:3, 3]
        length = float(np.linalg.norm(step))
        if length < _STEP:
            return
        if length <= _JUMP:
            ahead, aside, _ = np.abs(self._before[:3, :3].T @ step)
            self._level += float(np.hypot(step[0], step[1]))
            self._climbed += abs(float(step[2]))
            self._ahead += float(ahead)
            self._aside += float(aside)
        self._before = pose

    def oddity(self, mend: str = _MEND) -> str | None:
        """Return what no road vehicle does, and how to mend it; None of a drive as others are."""
        if self._upright < 0.5:
            tilt = np.degrees(np.arccos(max(self._upright, -1.0)))
            return f"expected a vehicle that stands on the road, got one tilted by {tilt:.0f} degrees; {mend}"
        way = f"{self._level:.0f} m along"
        if self._climbed > self._level and self._climbed + self._level > _ENOUGH:
            return f"expected a drive along the road, got one that goes {way} and {self._climbed:.0f} m up; {mend}"
        if self._aside > self._ahead and self._aside + self._ahead > 2 * _ENOUGH:
            return (
                f"expected a drive along the vehicle's x axis, got {self._ahead:.0f} m along x and "
                f"{self._aside:.0f} m along y; {mend}"
            )
        return None
