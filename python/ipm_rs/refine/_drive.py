"""The pose of a camera from a drive: the one with which consecutive bird's-eye views of the road agree.

Two pictures and the motion between them say where the second shows what the first shows, if the road is a plane whose
place below the camera is known. Brightness at the one place less brightness at the other is minimised over roll, pitch,
yaw and height: from coarse pictures to fine ones, with Tukey's loss, which counts moving things for nothing, and with
analytic derivatives (a direct method, as Lucas and Kanade 1981 or Engel et al. 2018 have it).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of, flag_of, number_of
from ipm_rs._core import BevGrid, Camera, Plane
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError, ImageError
from ipm_rs.refine._alignment import Alignment
from ipm_rs.refine._inputs import camera_of, guarded, numbers_of
from ipm_rs.refine._motion import angles_of
from ipm_rs.refine._nodding import Nodding
from ipm_rs.refine._pictures import grey_of
from ipm_rs.refine._road import PARAMETERS, SWAYING, Pose, pose_of_camera

__all__ = ["DriveFit", "from_drive"]

Matrix = NDArray[np.float64]

_FEWEST_HEIGHTS, _MOST_HEIGHTS = 0.4, 5.0
"""How far apart two pictures are at least and at most, in heights of the camera: nearer ones show too little parallax,
farther ones too little of the same road."""
_WORSE = 0.05
"""So much less alike than before: the fit has gone astray. Fits that end well lose 0.01 at most."""
_FAR_TURN, _FAR_HEIGHT = math.radians(5.0), 0.25
"""Farther off than starts that are promised to be found, and so looked at twice."""
_GAINED = 0.1
"""So much more alike the views of a pose far off must be. Pictures in the wrong order gain 0.03; the right pose gains
0.19 even where moving blobs leave no more than 0.40 alike."""
_MOST_PAIRS = 60
_MOST_PAIRS_NODDING = 400


@dataclass(frozen=True, eq=False)
class DriveFit:
    """A camera whose pose was found from a drive, and how well the pictures tell it."""

    camera: Camera
    """The camera in the pose with which the pictures agree."""
    parameters: tuple[str, ...]
    """What was found: of "roll", "pitch", "yaw" (radians, as `Camera.from_euler` takes them) and "height" (metres)."""
    covariance: NDArray[np.float64]
    """(P, P) of the parameters."""
    kept: dict[str, str]
    """What the pictures do not tell and was left as it was, and why."""
    before: float
    """Mean correlation of consecutive bird's-eye views with the camera as it was given."""
    after: float
    """The same with the camera that was found."""
    pairs: tuple[tuple[int, int], ...]
    """Which pictures were compared, by their numbers."""
    grid: BevGrid
    """The road on which they were."""
    nodding: float = 0.0
    """Standard deviation of the pitches of the single pictures, radians: how much the vehicle nods, of which its poses
    know nothing. 0 where one pitch suits all pictures."""
    pitches: NDArray[np.float64] | None = None
    """(N,) radians, of each picture, where `per_frame` was asked for: how the vehicle nods against its poses."""
    heights: NDArray[np.float64] | None = None
    """(N,) metres, of the camera at each picture, beside `pitches`: a vehicle that nods also springs."""

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviation of each parameter, in its unit."""
        return {name: math.sqrt(max(v, 0.0)) for name, v in zip(self.parameters, np.diag(self.covariance), strict=True)}

    def camera_at(self, index: int) -> Camera:
        """Return the camera as it was at a picture: with its pitch and height, where `per_frame` was asked for.

        Raises
        ------
        ArgumentError
            There is no such picture, or the pitches were not asked for.
        """
        if self.pitches is None or self.heights is None:
            raise ArgumentError("index: expected pitches of each picture, got none; call from_drive(per_frame=True)")
        if not isinstance(index, (int, np.integer)) or not -len(self.pitches) <= index < len(self.pitches):
            raise ArgumentError(f"index: expected the number of one of {len(self.pitches)} pictures, from 0 on")
        nod = self.pitches[index] - angles_of(self.camera.vehicle_from_camera)[1]
        sway = np.array([nod, self.heights[index] - self.camera.position[2]])
        return self.camera.with_pose(pose_of_camera(self.camera).moved(sway, SWAYING).camera_from_vehicle)

    def __str__(self) -> str:
        values = dict(
            zip(PARAMETERS, (*angles_of(self.camera.vehicle_from_camera), self.camera.position[2]), strict=True)
        )
        words = []
        for name, off in self.deviations.items():
            if name == "height":
                words.append(f"height {values[name]:.3f} +- {off:.3f} m")
            else:
                words.append(f"{name} {math.degrees(values[name]):.3f} +- {math.degrees(off):.3f} deg")
        lines = [", ".join(words)]
        if self.nodding:
            each = "" if self.pitches is not None else "; per_frame=True tells each picture's pitch"
            lines.append(f"the vehicle nods by {math.degrees(self.nodding):.3f} deg (standard deviation){each}")
        lines += [f"{name} left as it was: {why}" for name, why in self.kept.items()]
        lines.append(
            f"consecutive views of the road correlate with {self.after:.3f}, {self.before:.3f} before "
            f"({len(self.pairs)} pairs)"
        )
        return "\n".join(lines)


@guarded
def from_drive(
    camera: Camera,
    images: Iterable[Any],
    poses: ArrayLike,
    *,
    poses_of: Literal["vehicle", "camera"] = "vehicle",
    grid: BevGrid | None = None,
    ground: float | Plane = 0.0,
    per_frame: bool = False,
) -> DriveFit:
    """Find roll, pitch, yaw and height of a camera from a drive: those with which consecutive views of the road agree.

    Parameters
    ----------
    camera : Camera
        The camera, its pose up to 3 degrees of pitch and 20 % of height off. What it masks is not looked at.
    images : iterable of (H, W) or (H, W, 3) arrays
        The raw pictures, in the order of the drive; two or more. Of a long drive 60 pairs are compared; with
        `per_frame` all, up to 400.
    poses : (N, 4, 4) or (N, 3, 4) array_like
        Where each picture was taken, rigid, metres: ``map_from_vehicle``, or ``map_from_camera``.
    poses_of : {"vehicle", "camera"}
        Whose they are. Of the vehicle's, how the camera is mounted on it is found. Of the camera's own (optical axes,
        as KITTI's odometry has them) only the road's plane below the camera is: roll, pitch and height.
    grid : BevGrid, optional
        The road that is compared, in the vehicle frame. By default what the camera sees of it within 12 heights ahead
        and 2 m (of low cameras 3 heights) to either side: the own lane with its markings. What stands higher than the
        road, a kerb or a verge, would tilt it.
    ground : float or Plane
        The road in the vehicle frame.
    per_frame : bool
        Give each picture's own pitch and height, of up to 400 pairs of pictures. They are found in any case where the
        pictures show that the vehicle nods against its poses, for without them the mounting would be wrong.

    Returns
    -------
    DriveFit
        ``.camera``, ``.deviations``, ``.covariance``, ``.before``, ``.after``, ``.kept``, ``.nodding``, ``.pitches``.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Fewer than two pictures, another number of poses, poses that do not move or jump too far; a grid that the camera
        does not see.
    ImageError, DtypeError
        A picture has another size than the camera's, or no contrast on the road, or all are the same.
    CalibrationError
        A pose is not rigid, the camera is not above the road, the pictures do not tell the pitch, or they agree less
        than as given, or hardly more and with a pose far off: in the wrong order, say.
    """
    road_plane = _plane(ground)
    camera_of("camera", camera)
    if not isinstance(poses_of, str) or poses_of not in ("vehicle", "camera"):
        got = repr(poses_of)[:40] if isinstance(poses_of, str) else type(poses_of).__name__
        raise ArgumentError(f'poses_of: expected "vehicle" or "camera", got {got}; say whose poses they are')
    per_picture = flag_of("per_frame", per_frame)
    height = camera.position[2] - float(road_plane.height_at(camera.position[None, :2])[0])
    if not height > 0:
        raise CalibrationError(
            f"camera: expected it above the road, got {height:.3g} m above; give its height, or ground= the road's"
        )
    where = _poses(poses)
    chosen = _chosen_pairs(where, height, per_picture)
    area = _area(camera, road_plane, height) if grid is None else grid
    if not isinstance(area, BevGrid):
        raise ArgumentTypeError(f"grid: expected an ipm_rs.BevGrid, got {type(area).__name__}")
    greys = _greys(images, len(where), camera, {index for pair in chosen for index in pair})
    chosen = _different(chosen, greys)
    drive = Alignment(camera, greys, where, chosen, road_plane, area, poses_of == "camera", height)
    solved, nodding = Nodding(drive).solved(drive.solved(), always=per_picture)
    before, after = drive.agreement(drive.start), drive.agreement(solved.pose)
    _check_near(drive, solved.pose, before, after)
    found = camera.with_pose(solved.pose.camera_from_vehicle)
    pitch, high = angles_of(found.vehicle_from_camera)[1], found.position[2]
    return DriveFit(
        camera=found,
        parameters=tuple(PARAMETERS[index] for index in solved.free),
        covariance=solved.covariance,
        kept=solved.kept,
        before=before,
        after=after,
        pairs=tuple(chosen),
        grid=area,
        nodding=nodding,
        pitches=pitch + solved.pose.sways[:, 0] if per_picture else None,
        heights=high + solved.pose.sways[:, 1] if per_picture else None,
    )


def _plane(ground: float | Plane) -> Plane:
    if isinstance(ground, Plane):
        return ground
    return Plane(normal=(0.0, 0.0, 1.0), point=(0.0, 0.0, number_of("ground", ground, what=", metres, or a Plane")))


def _poses(poses: ArrayLike) -> Matrix:
    array = array_of("poses", poses)
    rows = array.shape[1] if array.ndim == 3 else 4
    matrices = numbers_of("poses", array, (None, 3 if rows == 3 else 4, 4), "a rigid transform for each picture")
    if rows == 3:
        matrices = np.concatenate([matrices, np.broadcast_to([[[0.0, 0.0, 0.0, 1.0]]], (len(matrices), 1, 4))], axis=1)
    off = np.abs(np.einsum("nij,nik->njk", matrices[:, :3, :3], matrices[:, :3, :3]) - np.eye(3)).max((1, 2), initial=0)
    wrong = np.flatnonzero(
        (off > 1e-3) | (np.linalg.det(matrices[:, :3, :3]) < 0) | (matrices[:, 3] != (0, 0, 0, 1)).any(1)
    )
    if len(wrong):
        raise CalibrationError(
            f"poses[{wrong[0]}]: expected a rigid transform, |R^T R - I| <= 1e-3 and the last row 0 0 0 1, got "
            f"{off[wrong[0]]:.3g}; check the order of the numbers"
        )
    return matrices


def _chosen_pairs(poses: Matrix, height: float, every: bool) -> list[tuple[int, int]]:
    """Return pairs of pictures that are far enough apart, and not too far."""
    if len(poses) < 2:
        raise ArgumentError(
            f"poses: expected two or more, got {len(poses)}; a drive takes pictures that can be compared"
        )
    places = poses[:, :3, 3]
    least, most = _FEWEST_HEIGHTS * height, _MOST_HEIGHTS * height
    pairs, nearest = [], math.inf
    for first in range(len(places) - 1):
        away = np.linalg.norm(places[first + 1 : first + 400] - places[first], axis=1)
        far = np.flatnonzero(away >= least)
        if len(far):
            nearest = min(nearest, float(away[far[0]]))
            if away[far[0]] <= most:
                pairs.append((first, first + 1 + int(far[0])))
    if not pairs:
        total = float(np.linalg.norm(places - places[0], axis=1).max())
        if math.isinf(nearest):
            raise ArgumentError(
                f"poses: expected a drive, but they stay within {total:.3g} m of the first, and {least:.2g} m at least "
                "are needed between two pictures; drive on, and give metres"
            )
        raise ArgumentError(
            f"poses: expected pictures at most {most:.2g} m apart, got {nearest:.3g} m and more; take more pictures, "
            "and give metres"
        )
    if every and len(pairs) > _MOST_PAIRS_NODDING:
        raise ArgumentError(
            f"images: expected at most {_MOST_PAIRS_NODDING} pairs of pictures with per_frame=True, got {len(pairs)}; "
            "pass parts of the drive"
        )
    if not every and len(pairs) > _MOST_PAIRS:
        pairs = [pairs[index] for index in np.linspace(0, len(pairs) - 1, _MOST_PAIRS).round().astype(int)]
    return pairs


def _different(pairs: Sequence[tuple[int, int]], greys: Mapping[int, NDArray[np.float32]]) -> list[tuple[int, int]]:
    """Return the pairs without those of a picture that was handed out again, as by a camera that hangs."""

    def is_same(first: int, second: int) -> bool:
        picture = greys[first]  # without contrast none differs: that is said later
        return np.array_equal(picture, greys[second]) and bool(picture.min() < picture.max())

    different = [pair for pair in pairs if not is_same(*pair)]
    if not different:
        first, second = pairs[0]
        raise ImageError(
            f"images[{second}]: expected what the camera sees after it has moved on, got the same picture as "
            f"images[{first}]; check how pictures are read"
        )
    return different


def _check_near(drive: Alignment, pose: Pose, before: float, after: float) -> None:
    """Refuse a pose that makes views agree less, or that is far off and makes them agree hardly more.

    Pictures in the wrong order agree best, with 0.3, where the camera is 6 degrees and half its height away.
    """
    turn = 0.5 * (float(np.trace(pose.rotation.T @ drive.start.rotation)) - 1.0)
    turned = math.acos(min(max(turn, -1.0), 1.0))
    lifted = float(pose.position[2] - drive.start.position[2])
    is_far = turned > _FAR_TURN or abs(lifted) > _FAR_HEIGHT * drive.height
    if after < before - _WORSE or (is_far and after < before + _GAINED):
        raise CalibrationError(
            f"images: expected pictures that agree about the road with a pose near the given one, but they correlate "
            f"with {after:.2f}, {before:.2f} before, with the camera turned by {math.degrees(turned):.1f} deg and "
            f"lifted by {lifted:.2f} m; check the order of pictures and poses, metres, poses_of= and ground="
        )


def _greys(images: Iterable[Any], count: int, camera: Camera, wanted: set[int]) -> dict[int, NDArray[np.float32]]:
    """Return the pictures that are compared, by their numbers."""
    try:
        listed = iter(images)
    except TypeError:
        raise ArgumentTypeError(f"images: expected a list of pictures, got {type(images).__name__}") from None
    greys, number = {}, 0
    for number, image in enumerate(islice(listed, count + 1), 1):
        if number <= count and number - 1 in wanted:
            greys[number - 1] = grey_of(f"images[{number - 1}]", image, camera)
    if number != count:
        more = "more" if number > count else str(number)
        raise ArgumentError(f"images: expected as many as poses, {count}, got {more}; give a pose for each picture")
    return greys


def _area(camera: Camera, ground: Plane, height: float) -> BevGrid:
    """Return the road ahead of a camera, wherever it looks."""
    width, rows = camera.image_size
    u, v = np.meshgrid(np.linspace(0, width - 1, 41), np.linspace(0, rows - 1, 81))
    pixels = np.stack([u, v], -1).reshape(-1, 2)
    if camera.mask is not None:
        at = np.rint(pixels).astype(int)
        pixels = pixels[camera.mask[at[:, 1], at[:, 0]]]
    seen = camera.ground_from_pixels(pixels, ground=ground)[:, :2]
    away = seen - camera.position[:2]
    away = away[np.isfinite(away).all(1) & (np.hypot(away[:, 0], away[:, 1]) < 12.0 * height)]
    if len(away) < 10:
        raise ArgumentError(
            f"camera: expected one that sees road within {12 * height:.3g} m, got none; it looks elsewhere: check its "
            "pose, or pass grid="
        )
    middle = np.median(away, axis=0)
    main = int(abs(middle[1]) > abs(middle[0]))
    sign = 1.0 if middle[main] > 0 else -1.0
    lane = away[(np.abs(away[:, 1 - main]) < min(3.0 * height, 2.0)) & (sign * away[:, main] > 0)]
    lane = away if len(lane) < 10 else lane
    low, high = lane.min(0) + camera.position[:2], lane.max(0) + camera.position[:2]
    cell = height / 16.0
    counts = np.maximum(np.round((high - low) / cell), 4).astype(int)
    ends = low + counts * cell
    return BevGrid(x=(low[0], ends[0]), y=(low[1], ends[1]), resolution=cell)
