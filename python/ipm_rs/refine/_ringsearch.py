"""Poses of a ring's cameras that are near enough for least squares, one camera after the other."""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Lut
from ipm_rs.refine._loss import correlation, in_threads
from ipm_rs.refine._ring import Ring, State
from ipm_rs.refine._road import Pose

__all__ = ["searched"]

Steps = NDArray[np.float64]
Picture = NDArray[np.float32]

_LEVEL = 4
"""Of the grids: cells of a quarter of the height. Two degrees move road 6 heights away by four of them."""
_FEWEST = 30
_REACH = 8.0
"""How far from a camera road is compared, in heights: farther out coarse cells show less than pixels do."""
_WIDTH = 160
"""Pixels of the pictures' width, at least."""
_KEPT = 4
_PITCHES, _YAWS, _HEIGHTS = np.linspace(-1.5, 1.5, 13), np.linspace(-1.5, 1.5, 7), np.linspace(-1.5, 1.5, 4)
_ROLLS, _LIFTS = np.linspace(-1.5, 1.5, 5), np.linspace(-0.5, 0.5, 3)
"""What is tried, in standard deviations of what a mounting is likely to be off by."""
_GAINED = 0.05
"""So much more alike than as given the views of a found pose must be: else the given one stays."""


def searched(ring: Ring) -> State:
    """Return a state whose views agree on coarse cells.

    Least squares lead home from half a cell of what is seen. The cameras that share most road with the fixed one come
    first: each is moved about as it was given, and compared with those that are placed already.
    """
    state, placed = dict(ring.start), [name for name in ring.cameras if name not in ring.free]
    cells = {pair: int(seen.sum()) for pair, seen in ring.overlaps(ring.start, _LEVEL).items() if pair in ring.pairs}
    waiting, small = list(ring.free), _Small(ring)
    while waiting:
        beside = {
            name: [pair for pair in cells if name in pair and set(pair) - {name} <= set(placed)] for name in waiting
        }
        name = max(waiting, key=lambda each: sum(cells[pair] for pair in beside[each]))
        waiting.remove(name)
        others = [one if other == name else other for one, other in beside[name]]
        if others:
            state[name] = _placed(ring, small, state, name, others)
            # at once down to the finest cells: what the next are compared with must be right
            alone = copy(ring)
            alone.free, alone.pairs = [name], beside[name]
            state = alone.solved(state, alone.levels)
        placed.append(name)
    return state


def _placed(ring: Ring, small: _Small, state: State, name: str, others: list[str]) -> Pose:
    """Return the pose of a camera with which its views agree best with those of others."""
    xy = ring.grids[_LEVEL].xy()
    near = np.hypot(*np.moveaxis(xy - state[name].position[:2], -1, 0)) < _REACH * ring.height
    seen = {other: small.seen(other, state[other]) for other in others}
    start = state[name]
    shown = small.seen(name, start)[1] & near
    least = {other: 0.3 * int((shown & seen[other][1]).sum()) for other in others}

    def score(pose: Pose) -> float:
        pictures, mask = small.seen(name, pose)
        found = []
        for other, (there, shown) in seen.items():
            both = mask & shown & near
            if both.sum() < max(_FEWEST, least[other]):
                found.append(-1.0)
                continue
            found += [correlation(a[both], b[both]) for a, b in zip(pictures, there, strict=True)]
        return float(np.mean(found))

    def best(poses: list[Pose], count: int) -> list[tuple[float, Pose]]:
        scores = in_threads(score, poses)
        return [(scores[index], poses[index]) for index in np.argsort(scores)[::-1][:count]]

    likely = ring.likely

    def tried(pose: Pose, rolls: Steps, pitches: Steps, yaws: Steps, heights: Steps) -> list[Pose]:
        axes = np.meshgrid(rolls, pitches, yaws, heights, indexing="ij")
        return [pose.moved(step * likely, range(4)) for step in np.stack(axes, -1).reshape(-1, 4)]

    zero = np.zeros(1)
    found = best([start, *tried(start, zero, _PITCHES, _YAWS, _HEIGHTS)], _KEPT)
    for _ in range(2):
        around = [near for _, pose in found for near in tried(pose, _ROLLS, zero, zero, _LIFTS)]
        found = best([pose for _, pose in found] + around, _KEPT)
        fine = _PITCHES[5:8] / 2.0
        around = [near for _, pose in found for near in tried(pose, zero, fine, fine, _LIFTS / 2.0)]
        found = best([pose for _, pose in found] + around, _KEPT)
    return found[0][1] if found[0][0] > score(start) + _GAINED else start


class _Small:
    """Cameras and pictures an eighth or a quarter as wide: coarse cells need no more, and no averaging."""

    def __init__(self, ring: Ring) -> None:
        self.ring = ring
        self.cameras, self.pictures = {}, {}
        for name, camera in ring.cameras.items():
            width, height = camera.image_size
            times = max(1, width // _WIDTH)
            columns, rows = width // times, height // times
            self.cameras[name] = camera.cropped(0, 0, columns * times, rows * times).resized(columns, rows)
            self.pictures[name] = [
                np.ascontiguousarray(_halved(images[name], times, rows, columns)) for images in ring.instants
            ]

    def seen(self, name: str, pose: Pose) -> tuple[list[Picture], NDArray[np.bool_]]:
        """Return what a camera in a pose sees from above at each instant, and where."""
        ring = self.ring
        lut = Lut(self.cameras[name].with_pose(pose.camera_from_vehicle), ring.grids[_LEVEL], ground=ring.ground)
        return [np.asarray(lut.warp(picture, threads=1)) for picture in self.pictures[name]], lut.mask


def _halved(picture: Picture, times: int, rows: int, columns: int) -> Picture:
    whole = picture[: rows * times, : columns * times]
    return whole.reshape(rows, times, columns, times).mean((1, 3), dtype=np.float32)
