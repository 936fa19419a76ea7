"""`Trajectory`: timestamps and poses of the vehicle, and its pose at any moment between."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of, number_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError
from ipm_rs.trajectory._quaternions import of_matrices, to_matrices, turned

__all__ = ["Trajectory", "poses_of"]

Array = NDArray[np.float64]
T = TypeVar("T")

_ROTATION_TOLERANCE = 1e-4  # of |R^T R - I|, as of a camera's pose


class Trajectory:
    """Where the vehicle was: timestamps and poses. Immutable, comparable, picklable.

    `at` gives the pose at any moment between two: the rotation turns evenly about one axis (slerp), the position moves
    in a straight line. A gap between two poses is not guessed across.

    Parameters
    ----------
    timestamps : (N,) array_like
        Seconds, growing.
    poses : (N, 4, 4) array_like
        ``map_from_vehicle``: rigid transforms, metres.
    max_gap : float
        Seconds: between two poses that are further apart, `at` refuses. ``math.inf`` for none.
    offset : float
        Seconds that are added to the timestamps: what the clock of the images shows, less what the clock of the poses
        shows at the same moment.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        The timestamps do not grow, there are none, or not as many as poses; an argument is no number.
    CalibrationError
        A pose is not rigid.
    """

    def __init__(self, timestamps: ArrayLike, poses: ArrayLike, *, max_gap: float = 1.0, offset: float = 0.0) -> None:
        times = array_of("timestamps", timestamps)
        if times.dtype.kind not in "iuf":
            raise ArgumentTypeError(f"timestamps: expected seconds, got {times.dtype}; pass numbers")
        if times.ndim != 1 or len(times) == 0:
            raise ArgumentError(f"timestamps: expected shape (N,), at least one, got {times.shape}")
        times = times.astype(np.float64) + number_of("offset", offset)
        if not np.isfinite(times).all():
            raise ArgumentError("timestamps: expected finite seconds, got NaN or infinite ones; leave them out")
        back = np.flatnonzero(np.diff(times) <= 0)
        if len(back):
            first = int(back[0])
            raise ArgumentError(
                f"timestamps: expected seconds that grow, got {times[first + 1]:.6f} after {times[first]:.6f} at "
                f"number {first + 1}; sort them, and keep one pose for each"
            )
        rigid = poses_of("poses", poses)
        if len(rigid) != len(times):
            raise ArgumentError(
                f"poses: expected one for each of {len(times)} timestamps, got {len(rigid)}; give as many"
            )
        times.flags.writeable = rigid.flags.writeable = False
        self._times, self._poses, self._max_gap = times, rigid, _gap(max_gap)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        format: str | None = None,
        timestamps: str | os.PathLike[str] | ArrayLike | None = None,
        vehicle_from_sensor: ArrayLike | None = None,
        max_gap: float = 1.0,
        offset: float = 0.0,
    ) -> Trajectory:
        """Read a file of poses.

        ============== ================================================================================================
        ``tum``        lines ``timestamp tx ty tz qx qy qz qw``: TUM, evo, ORB-SLAM, most SLAM and odometry programs
        ``kitti``      lines of 12 numbers, 3x4 by rows, of the left camera, optical axes: KITTI odometry. Its
                       timestamps are in ``times.txt`` beside it or in `timestamps`. The map is the frame in which the
                       vehicle stood at the first pose
        ``csv``        a line of names, then ``timestamp`` (or ``time``; ``_us``, ``_ns`` and ``[ns]`` are known), ``x y
                       z``, and ``qw qx qy qz`` or ``roll pitch yaw`` (radians; ``roll_deg`` ... in degrees); EuRoC's
                       ground truth is one
        ``oxts``       a drive of KITTI raw, or its directory ``oxts``. The map is east, north, up from the first pose
        ``nuscenes``   ``ego_pose.json`` or the directory that it is in: nuScenes, Lyft
        ``argoverse2`` ``city_SE3_egovehicle.feather`` or the log that it is in (extra ``arrow``)
        ============== ================================================================================================

        Parameters
        ----------
        path : str or path
            The file or the directory.
        format : str, optional
            One of the names above; recognised by default.
        timestamps : path or (N,) array_like, optional
            For ``kitti``: seconds, or the file that has them, one in each line.
        vehicle_from_sensor : (4, 4) array_like, optional
            Where on the vehicle what the poses are of is mounted, a camera's ``vehicle_from_camera`` or an IMU's; by
            default it is the vehicle's own frame, and for ``kitti`` a vehicle frame whose origin is the camera.
        max_gap, offset : float
            See the class.

        Raises
        ------
        MissingFileError, FileError
            There is no such file, or its content cannot be right; the message names the line.
        ArgumentError, ArgumentTypeError, CalibrationError
            An argument is wrong, or there are no timestamps.
        MissingExtraError
            pyarrow is not installed.
        """
        from ipm_rs.trajectory._files import read  # few programs need it

        mount = None
        if vehicle_from_sensor is not None:
            one = array_of("vehicle_from_sensor", vehicle_from_sensor)
            if one.shape != (4, 4):
                raise ArgumentError(f"vehicle_from_sensor: expected shape (4, 4), got {one.shape}")
            mount = poses_of("vehicle_from_sensor", one[None])[0]
        gap, shift = _gap(max_gap), number_of("offset", offset)
        times, poses = read(path, format, timestamps, mount)
        return cls(times, poses, max_gap=gap, offset=shift)

    @property
    def timestamps(self) -> Array:
        """Seconds, (N,) float64, read-only, `offset` included."""
        return self._times

    @property
    def poses(self) -> Array:
        """``map_from_vehicle``, (N, 4, 4) float64, read-only."""
        return self._poses

    @property
    def max_gap(self) -> float:
        """Seconds that two poses may lie apart for `at` to answer between them."""
        return self._max_gap

    @property
    def start(self) -> float:
        """The first timestamp, seconds."""
        return float(self._times[0])

    @property
    def end(self) -> float:
        """The last timestamp, seconds."""
        return float(self._times[-1])

    def __len__(self) -> int:
        return len(self._times)

    def covers(self, timestamps: ArrayLike) -> Any:
        """Say whether `at` answers: bool for a number, an array of bool for an array.

        Parameters
        ----------
        timestamps : float or (M,) array_like
            Seconds.

        Raises
        ------
        ArgumentError, ArgumentTypeError
            They are no seconds.
        """
        return self._asked(timestamps, lambda times: self._place(times)[2])

    def at(self, timestamps: ArrayLike) -> Array:
        """Return where the vehicle was.

        Parameters
        ----------
        timestamps : float or (M,) array_like
            Seconds, in any order.

        Returns
        -------
        (4, 4) or (M, 4, 4) float64
            ``map_from_vehicle``. At a timestamp of the trajectory, its pose as given.

        Raises
        ------
        ArgumentError
            A moment is before the first pose or after the last, or between two that are more than `max_gap` apart.
        """
        return self._asked(timestamps, self._at)

    def _at(self, times: Array) -> Array:
        before, share, covered = self._place(times)
        if not covered.all():
            raise ArgumentError(self._uncovered(float(times[np.flatnonzero(~covered)[0]])))
        after = np.minimum(before + 1, len(self._times) - 1)
        result = np.zeros((len(times), 4, 4))
        result[:, :3, :3] = to_matrices(turned(self._turns[before], self._turns[after], share))
        first, second = self._poses[before, :3, 3], self._poses[after, :3, 3]
        result[:, :3, 3] = first + share[:, None] * (second - first)
        result[:, 3, 3] = 1.0
        exact = share == 0
        result[exact] = self._poses[before[exact]]
        return result

    @cached_property
    def _turns(self) -> Array:
        return of_matrices(self._poses[:, :3, :3])

    def _place(self, times: Array) -> tuple[NDArray[np.intp], Array, NDArray[np.bool_]]:
        """Return the pose before each moment, the share of the way to the next one, and whether `at` answers."""
        before = np.clip(np.searchsorted(self._times, times, "right") - 1, 0, None)
        after = np.minimum(before + 1, len(self._times) - 1)
        passed, gap = times - self._times[before], self._times[after] - self._times[before]
        share = np.divide(passed, gap, out=np.zeros(len(times)), where=gap > 0)
        inside = (times >= self._times[0]) & (times <= self._times[-1])
        return before, share, inside & ((gap <= self._max_gap) | (passed == 0))

    def _uncovered(self, moment: float) -> str:
        if not self.start <= moment <= self.end:
            return (
                f"timestamps: expected moments of the trajectory, {self.start:.6f} to {self.end:.6f} s, got "
                f"{moment:.6f}; leave it out, or give offset= where the clocks differ"
            )
        after = int(np.searchsorted(self._times, moment, "right"))
        first, second = self._times[after - 1 : after + 1]
        return (
            f"timestamps: expected poses at most {self._max_gap:g} s apart, got a gap of {second - first:.3f} s around "
            f"{moment:.6f} ({first:.6f} to {second:.6f}); leave it out, or allow it with max_gap="
        )

    def _asked(self, timestamps: Any, answer: Callable[[Array], Any]) -> Any:
        times = array_of("timestamps", timestamps)
        if times.dtype.kind not in "iuf":
            raise ArgumentTypeError(f"timestamps: expected seconds, got {times.dtype}; pass numbers")
        if times.ndim > 1:
            raise ArgumentError(f"timestamps: expected a number or shape (M,), got {times.shape}")
        flat = np.atleast_1d(times).astype(np.float64)
        if not np.isfinite(flat).all():
            raise ArgumentError("timestamps: expected finite seconds, got NaN or infinite; leave them out")
        found = answer(flat)
        if times.ndim == 1:
            return found
        return bool(found[0]) if found.ndim == 1 else found[0]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Trajectory):
            return NotImplemented
        return (
            self._max_gap == other._max_gap
            and np.array_equal(self._times, other._times)
            and np.array_equal(self._poses, other._poses)
        )

    def __hash__(self) -> int:
        return hash((self._times.tobytes(), self._poses.tobytes(), self._max_gap))

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (np.array(self._times), np.array(self._poses), self._max_gap)

    def __repr__(self) -> str:
        way = float(np.linalg.norm(np.diff(self._poses[:, :3, 3], axis=0), axis=1).sum())
        return f"Trajectory({len(self)} poses, {self.start:.3f} to {self.end:.3f} s, {way:.1f} m)"


def _restored(times: Array, poses: Array, max_gap: float) -> Trajectory:
    return Trajectory(times, poses, max_gap=max_gap)


def _gap(value: Any) -> float:
    """Return the seconds of ``max_gap=``; infinity is allowed."""
    array = array_of("max_gap", value)
    if array.shape != () or array.dtype.kind not in "iuf" or not array > 0:
        got = f"{float(array):g}" if array.shape == () and array.dtype.kind in "iuf" else f"an array of {array.dtype}"
        raise ArgumentError(f"max_gap: expected seconds above 0, got {got}; math.inf allows any gap")
    return float(array)


def poses_of(name: str, values: Any) -> Array:
    """Return (N, 4, 4) rigid transforms, checked, as a copy.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        They have another shape or are no numbers.
    CalibrationError
        One is not rigid.
    """
    array = array_of(name, values)
    if array.dtype.kind not in "iuf":
        raise ArgumentTypeError(f"{name}: expected 4x4 transforms, got {array.dtype}; pass numbers")
    if array.ndim != 3 or array.shape[1:] != (4, 4):
        raise ArgumentError(f"{name}: expected shape (N, 4, 4), got {array.shape}")
    poses = array.astype(np.float64)
    rotations = poses[:, :3, :3]
    with np.errstate(all="ignore"):
        off = np.abs(np.einsum("nji,njk->nik", rotations, rotations) - np.eye(3)).max(axis=(1, 2))
        wrong = ~(off <= _ROTATION_TOLERANCE) | ~(np.linalg.det(rotations) > 0)
    wrong |= ~np.isfinite(poses).all(axis=(1, 2)) | (poses[:, 3] != (0, 0, 0, 1)).any(axis=1)
    if wrong.any():
        raise CalibrationError(
            f"{name}: expected rigid transforms, a rotation of det +1 and a last row 0 0 0 1, got another at number "
            f"{int(np.flatnonzero(wrong)[0])}; check the order of its numbers"
        )
    return poses
