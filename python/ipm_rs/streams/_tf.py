"""ROS's tf: transforms between named frames, some fixed, some at moments of their own."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import ArgumentError, CalibrationError
from ipm_rs.trajectory import Trajectory
from ipm_rs.trajectory._quaternions import to_matrices

__all__ = ["Transforms"]

Pose = NDArray[np.float64]


class Transforms:
    """A tree of frames: each knows where it stands in its parent, for good or at many moments."""

    def __init__(self, max_gap: float = 1.0) -> None:
        self.max_gap = max_gap
        self.fixed: dict[str, tuple[str, Pose]] = {}
        self.moving: dict[str, tuple[str, dict[float, Pose]]] = {}
        self.made: dict[str, Trajectory] = {}

    def add(self, message: Any, *, fixed: bool) -> None:
        """Take the transforms of a TFMessage; what is no rotation is passed over."""
        for one in message.transforms:
            parent, child = (name.strip("/") for name in (one.header.frame_id, one.child_frame_id))
            q = np.array([[getattr(one.transform.rotation, axis) for axis in "wxyz"]])
            norm = float(np.linalg.norm(q))
            place = [getattr(one.transform.translation, axis) for axis in "xyz"]
            if not (abs(norm - 1) < 1e-2 and np.isfinite(place).all()) or child == parent:
                continue
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = to_matrices(q / norm)[0], place
            if fixed:
                self.fixed[child] = (parent, pose)
                continue
            stamp = one.header.stamp
            moment = (stamp.sec * 1_000_000_000 + stamp.nanosec) / 1e9  # rounded as the pictures' moments are
            self.moving.setdefault(child, (parent, {}))[1][moment] = pose

    def parents(self, frame: str) -> list[str]:
        """Return a frame and the frames above it, up to the root."""
        chain = [frame.strip("/")]
        while (above := self._parent(chain[-1])) is not None and above not in chain:
            chain.append(above)
        return chain

    def frames(self) -> list[str]:
        """Return the names of all frames."""
        parents = [parent for table in (self.fixed, self.moving) for parent, _ in table.values()]
        return sorted({*self.fixed, *self.moving, *parents})

    def between(self, target: str, source: str, moment: float | None = None) -> Pose | None:
        """Return ``target_from_source``, at a moment where something between moves; None where no way leads there.

        Raises
        ------
        CalibrationError
            Something between moves, and no moment is given.
        """
        up, down = self.parents(source), self.parents(target)
        shared = next((frame for frame in up if frame in down), None)
        if shared is None:
            return None
        first = self._climbed(up[: up.index(shared)], moment)
        second = self._climbed(down[: down.index(shared)], moment)
        return None if first is None or second is None else np.linalg.inv(second) @ first

    def _parent(self, frame: str) -> str | None:
        entry = self.fixed.get(frame) or self.moving.get(frame)
        return None if entry is None else entry[0]

    def _climbed(self, frames: Iterable[str], moment: float | None) -> Pose | None:
        """Return ``top_from_first`` of a chain of frames, each in its parent."""
        pose = np.eye(4)
        for frame in frames:
            if frame in self.fixed:
                pose = self.fixed[frame][1] @ pose
                continue
            if moment is None:
                raise CalibrationError(f"tf: expected {frame} to stand still in {self.moving[frame][0]}, got it moving")
            if frame not in self.made:
                stamps = sorted(self.moving[frame][1].items())
                self.made[frame] = Trajectory(
                    [time for time, _ in stamps], [one for _, one in stamps], max_gap=self.max_gap
                )
            try:
                pose = self.made[frame].at(moment) @ pose
            except ArgumentError:
                return None
        return pose
