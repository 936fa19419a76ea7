"""Poses of a ring's cameras that are near enough for least squares, one camera after the other."""

from __future__ import annotations

import math
from copy import copy
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Lut
from ipm_rs.refine._loss import in_threads, likeness
from ipm_rs.refine._ring import Ring, State
from ipm_rs.refine._ringcovariance import covariance_of
from ipm_rs.refine._road import Pose

__all__ = ["searched", "searched_again"]

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
_CLOSE_LEVEL, _CLOSE_WIDTH = 2, 400
"""Cells and pictures in which narrow strips are looked at."""
_CLOSE_PITCHES, _CLOSE_HEIGHTS, _CLOSE_STEPS = (
    np.linspace(-2.0, 2.0, 33),
    np.array([-0.5, 0.5]),
    np.linspace(-0.1, 0.1, 3),
)
"""What is tried there: pitches that stand for rolls too, so up to 1.4 times as large."""
_WELL = 0.06
"""Of what a camera is likely to be off by: one that is told worse by those that are placed waits until more are. A
strip at one side tells pitch and roll together only, and would lead the next cameras astray."""
_AGREEING = 0.6
"""Below which views are taken to be misplaced still."""
_CLEAR = 0.9
"""Below which views may agree better with another pose, and are looked at closer: with the right ones they
correlate with 0.91 and more on synthetic rings, with the wrong ones that coarse cells led to with up to 0.76."""
_GAINED = 0.05
"""So much more alike than as given the views of a found pose must be: else the given one stays."""


def searched(ring: Ring) -> State:
    """Return a state whose views agree on coarse cells.

    Least squares lead home from half a cell of what is seen. The cameras that share most road with the fixed one come
    first: each is moved about as it was given, and compared with those that are placed already.
    """
    state, placed = dict(ring.start), [name for name in ring.cameras if name not in ring.free]
    cells = {pair: int(seen.sum()) for pair, seen in ring.overlaps(ring.start, _LEVEL).items() if pair in ring.pairs}
    waiting, small = list(ring.free), _Small(ring, _LEVEL, _WIDTH)
    late: dict[str, _Late] = {}
    while waiting:
        beside = {
            name: [pair for pair in cells if name in pair and set(pair) - {name} <= set(placed)] for name in waiting
        }
        ready = [name for name in waiting if beside[name]]
        if not ready:
            break
        soon = [name for name in ready if name not in late or late[name].told_by != len(beside[name])]
        if soon:
            name = max(soon, key=lambda each: sum(cells[pair] for pair in beside[each]))
        else:
            name = min(ready, key=lambda each: late[each].off)
        others = [one if other == name else other for one, other in beside[name]]
        alone = copy(ring)
        alone.free, alone.pairs = [name], beside[name]
        if soon:
            near = _placed(ring, small, state, name, others)
            # at once down to the finest cells: what the next are compared with must be right
            found = alone.solved({**state, name: near[0]}, alone.levels)
            found = _closest(alone, found, name, others, near)
            off = float(np.sqrt(np.diag(covariance_of(alone, found))[:3].max()))
            if not (_alike(alone, found) >= _AGREEING and off < _WELL * ring.likely[:3].max()):
                late[name] = _Late(len(others), off, found[name], near)
                continue
            near = []
        else:
            found, near = {**state, name: late[name].pose}, late[name].near
        if _alike(alone, found) < _CLEAR:
            near = [*_along_strips(alone, ring.start, found, name, others), *near]
            found = _closest(alone, found, name, others, near)
        state = found
        waiting.remove(name)
        placed.append(name)
    return state


def searched_again(ring: Ring, state: State, name: str) -> State | None:
    """Return a state with a camera where its views agree with those of all others, as they are placed by now.

    When it was placed some of them were not, or not well: of one strip at the end of a picture no pose follows.
    """
    alone = copy(ring)
    alone.free, alone.pairs = [name], [pair for pair in ring.pairs if name in pair]
    others = [one if other == name else other for one, other in alone.pairs]
    near = _along_strips(alone, ring.start, state, name, others)
    best = max(_looked_closer(alone, state, name, others, near), key=partial(_alike, alone), default=None)
    return best if best is not None and _alike(alone, best) >= _AGREEING else None


class _Late(NamedTuple):
    """A camera that waits until more others are placed."""

    told_by: int
    """How many others were, when it was told badly."""
    off: float
    """Standard deviation of its angles then, radians."""
    pose: Pose
    near: list[Pose]
    """Where its views agreed best on coarse cells."""


def _alike(ring: Ring, state: State) -> float:
    """Return the mean correlation of the pairs; of one that sees no road in common any more it is 0."""
    scores = ring.agreement(state)
    return sum(scores.values()) / len(ring.pairs) if scores else -1.0


class _Strips:
    """What a camera and others see of the same road, in finer cells than the search's."""

    def __init__(self, alone: Ring, placed: State, name: str, others: list[str], poses: list[Pose]) -> None:
        """Look where one of some poses sees what the others do."""
        self.name, self.small = name, _Small(alone, _CLOSE_LEVEL, _CLOSE_WIDTH)
        small = self.small
        reach = np.logical_or.reduce([small.seen(name, pose)[1] for pose in poses])
        strips = {other: small.seen(other, placed[other])[1] & reach for other in others}
        self.cells = {other: strip for other, strip in strips.items() if strip.sum() >= _FEWEST}
        """Of each strip, in the whole grid."""
        if self.cells:
            small.look_at(np.logical_or.reduce(list(self.cells.values())))
        self.seen = {other: small.seen(other, placed[other]) for other in self.cells}

    def scores(self, pose: Pose) -> list[float]:
        """Return how alike the views of each strip are."""
        pictures, mask = self.small.seen(self.name, pose)
        found = []
        for there, shown in self.seen.values():
            both = mask & shown
            each = [likeness(a[both], b[both]) for a, b in zip(pictures, there, strict=True)]
            found.append(float(np.mean(each)) if both.sum() >= _FEWEST else -1.0)
        return found

    def best(self, poses: list[Pose]) -> list[Pose]:
        """Return those whose views are most alike, the best first."""
        means = [float(np.mean(each)) for each in in_threads(self.scores, poses)]
        return [poses[index] for index in np.argsort(means)[::-1][:_KEPT]]


def _turned(alone: Ring, pose: Pose) -> list[Pose]:
    return [pose.moved(np.array([yaw * alone.likely[2]]), (2,)) for yaw in _YAWS[::3]]


def _along_strips(alone: Ring, start: State, placed: State, name: str, others: list[str]) -> list[Pose]:
    """Return poses of a camera with which narrow strips of road, at the far ends of its picture, agree best.

    Coarse cells show nothing of a strip half a metre wide, and it lies far away, where a quarter of a degree of pitch
    is half a metre. What it tells is how far down the camera looks there, be that its pitch or its roll; so each strip
    is looked at alone, and of two of them pitch and roll follow.
    """
    given, likely = start[name], alone.likely
    strips = _Strips(alone, placed, name, others, _turned(alone, given))
    if not strips.cells:
        return []
    steps = np.stack(np.meshgrid(_YAWS, _CLOSE_HEIGHTS, _CLOSE_PITCHES, indexing="ij"), -1).reshape(-1, 3)
    told = in_threads(strips.scores, [given.moved(step * likely[[2, 3, 1]], (2, 3, 1)) for step in steps])
    by_pitch = np.array(told).reshape(-1, len(_CLOSE_PITCHES), len(strips.cells))
    ahead = [strips.small.direction(strip, given) for strip in strips.cells.values()]
    down = np.array([[np.cos(angle), -np.sin(angle)] for angle in ahead])  # by pitch and roll, which lifts the left
    poses = []
    for index in np.argsort(by_pitch.max(1).mean(-1))[::-1][: 2 * _KEPT]:
        yaw, height, _ = steps[index * len(_CLOSE_PITCHES)]
        pitches = _CLOSE_PITCHES[by_pitch[index].argmax(0)]
        pitch, roll = np.linalg.pinv(down, rcond=0.1) @ (down[:, 0] * pitches)
        poses.append(given.moved(np.array([roll, pitch, yaw, height]) * likely, range(4)))
    return strips.best(poses)


def _closest(alone: Ring, found: State, name: str, others: list[str], near: list[Pose]) -> State:
    """Return a state, or one near some poses if the views agree better there."""
    if _alike(alone, found) >= _CLEAR:
        return found
    return max((found, *_looked_closer(alone, found, name, others, near)), key=partial(_alike, alone))


def _looked_closer(alone: Ring, placed: State, name: str, others: list[str], near: list[Pose]) -> list[State]:
    """Return states with a camera where its views agree best on finer cells, near some poses.

    Where a moving thing hides half of a narrow strip, the rest of it agrees within a tenth of a degree only: least
    squares from where coarse cells agree lead away from there.
    """
    if not near:
        return []
    strips = _Strips(alone, placed, name, others, near)
    if not strips.cells:
        return []
    poses = near
    for part in (1.0, 0.5, 0.25):
        axes = [part * step for step in (_CLOSE_STEPS, _CLOSE_STEPS, 2.0 * _CLOSE_STEPS, 2.0 * _CLOSE_STEPS)]
        around = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 4) * alone.likely
        poses = strips.best([pose.moved(step, range(4)) for pose in poses for step in around])
    return [alone.solved({**placed, name: pose}, alone.levels[-2:]) for pose in poses[:2]]


def _placed(ring: Ring, small: _Small, state: State, name: str, others: list[str]) -> list[Pose]:
    """Return poses of a camera with which its views agree best with those of others, the best first."""
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
            found += [likeness(a[both], b[both]) for a, b in zip(pictures, there, strict=True)]
        return float(np.mean(found))

    def best(poses: list[Pose], count: int) -> list[tuple[float, Pose]]:
        # steps from several poses lead to the same ones
        poses = list({(*np.round(pose.angles, 9), round(pose.position[2], 9)): pose for pose in poses}.values())
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
        found = best(around, _KEPT)
        fine = _PITCHES[5:8] / 2.0
        around = [near for _, pose in found for near in tried(pose, zero, fine, fine, _LIFTS / 2.0)]
        found = best(around, _KEPT)
    return [pose for _, pose in found] if found[0][0] > score(start) + _GAINED else [start]


class _Small:
    """Cameras and pictures an eighth or a quarter as wide: coarse cells need no more, and no averaging."""

    def __init__(self, ring: Ring, level: int, most: int) -> None:
        self.ring, self.grid = ring, ring.grids[level]
        self.cameras, self.pictures = {}, {}
        for name, camera in ring.cameras.items():
            width, height = camera.image_size
            times = max(1, width // most)
            columns, rows = width // times, height // times
            self.cameras[name] = camera.cropped(0, 0, columns * times, rows * times).resized(columns, rows)
            self.pictures[name] = [
                np.ascontiguousarray(_halved(images[name], times, rows, columns)) for images in ring.instants
            ]

    def seen(self, name: str, pose: Pose) -> tuple[list[Picture], NDArray[np.bool_]]:
        """Return what a camera in a pose sees from above at each instant, and where."""
        ring = self.ring
        lut = Lut(self.cameras[name].with_pose(pose.camera_from_vehicle), self.grid, ground=ring.ground)
        return [np.asarray(lut.warp(picture, threads=1)) for picture in self.pictures[name]], lut.mask

    def look_at(self, cells: NDArray[np.bool_]) -> None:
        """Leave the rows and columns of the grid out that hold none of some cells."""
        rows, columns = (np.flatnonzero(cells.any(axis)) for axis in (1, 0))
        cell, x, y = self.grid.resolution[0], self.grid.x[1], self.grid.y[1]
        self.grid = BevGrid(
            x=(x - (rows[-1] + 1) * cell, x - rows[0] * cell),
            y=(y - (columns[-1] + 1) * cell, y - columns[0] * cell),
            resolution=cell,
        )

    def direction(self, cells: NDArray[np.bool_], pose: Pose) -> float:
        """Return how far to the left of where a camera looks the middle of some cells of the whole grid is, radians."""
        x, y = self.ring.grids[_CLOSE_LEVEL].xy()[cells].mean(0) - pose.position[:2]
        return math.remainder(math.atan2(y, x) - pose.angles[2], 2.0 * math.pi)


def _halved(picture: Picture, times: int, rows: int, columns: int) -> Picture:
    whole = picture[: rows * times, : columns * times]
    return whole.reshape(rows, times, columns, times).mean((1, 3), dtype=np.float32)
