"""Cameras of a ring made to agree about the road that two of them see at once."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, Lut, Plane
from ipm_rs.refine._loss import exposed, in_threads, likeness, normal_of
from ipm_rs.refine._motion import axes_of_angles
from ipm_rs.refine._road import Pose, pose_of_camera
from ipm_rs.refine._solve import Normal, minimise

__all__ = ["Ring", "State"]

Matrix = NDArray[np.float64]
State = dict[str, Pose]
Cells = Mapping[tuple[str, str], NDArray[np.bool_]]
Masks = tuple[NDArray[np.bool_], NDArray[np.bool_]]

_LEVELS = (8, 4, 2, 1)
"""Cells that the views are compared in, in finest ones: half a height of the camera first."""
_FEWEST_CELLS = 100
_RESOLVED, _SMEARED = 0.5, 0.2
"""Pixels a cell in the worse direction: what is resolved less is smear, which is better than nothing."""
_NARROW_CELLS = 400
"""Below which an overlap is narrow, and what it shows smeared is looked at too."""
_FARTHEST = 3.0
"""Standard deviations of what cameras are likely to be off by, beyond which none is sought: on a real ring views that
are alike by chance led one 17 degrees away."""
_UNLIKE = 0.75
"""Of the median of all pairs: a camera whose views agree less than this part of it, with each neighbour, is misplaced.
In two of three synthetic rings one of five was, by 1 to 3 degrees, with 0.47 and 0.60 where others had 0.98."""


class View(NamedTuple):
    """Pictures of one camera from above, instant by instant, and their derivatives by its four parameters."""

    pictures: list[Matrix]
    steeps: list[Matrix]
    """(M, 2) of each instant: how brightness falls along x and y, in the cells that are compared."""
    flows: Matrix
    """(M, 2, P): how what a cell shows moves along x and y with each parameter, and with a pixel right and down."""
    rows: NDArray[np.intp]
    """(rows, columns): which row of these is a cell's."""

    def slopes(self, instant: int) -> Matrix:
        """(M, P) derivatives of an instant's brightness by the parameters."""
        return _along(self.flows, self.steeps[instant])


class Ring:
    """The cameras of a ring, and pictures that they took at the same instants.

    Parameters
    ----------
    cameras : mapping of str to Camera
        As they were given.
    instants : sequence of mappings of str to (H, W) float32
        Their pictures.
    fixed : str
        The camera that stays.
    ground : Plane
        The road.
    area : BevGrid
        The finest grid that is compared.
    height : float
        Of the cameras above the road, metres: the size of things.
    likely : (4,)
        Standard deviations of what roll, pitch, yaw (radians) and height (metres) of the cameras are off by: what no
        overlap tells is held to them.
    """

    def __init__(
        self,
        cameras: Mapping[str, Camera],
        instants: Sequence[Mapping[str, NDArray[np.float32]]],
        fixed: str,
        ground: Plane,
        area: BevGrid,
        height: float,
        likely: Matrix,
    ) -> None:
        self.cameras, self.instants, self.fixed = dict(cameras), instants, fixed
        self.ground, self.area, self.height, self.likely = ground, area, height, likely
        self._seen_last: dict[str, tuple[tuple[Pose, int, Cells, bool], View]] = {}
        self.start: State = {name: pose_of_camera(camera) for name, camera in cameras.items()}
        self.levels = _LEVELS
        self.grids = {level: self._coarser(level) for level in _LEVELS}
        self.pairs = self._possible()
        told = self._reached()
        self.free = [name for name in self.cameras if name in told and name != fixed]
        self.pairs = [pair for pair in self.pairs if pair[0] in told]

    def _coarser(self, level: int) -> BevGrid:
        (x0, x1), (y0, y1) = self.area.x, self.area.y
        cell = self.area.resolution[0] * level
        rows, columns = math.ceil((x1 - x0) / cell - 1e-6), math.ceil((y1 - y0) / cell - 1e-6)
        return BevGrid(x=(x1 - rows * cell, x1), y=(y1 - columns * cell, y1), resolution=cell)

    def lut(self, state: State, name: str, level: int) -> Lut:
        """Return the table of a camera in a pose."""
        camera = self.cameras[name].with_pose(state[name].camera_from_vehicle)
        return Lut(camera, self.grids[level], ground=self.ground)

    def _possible(self) -> list[tuple[str, str]]:
        """Return pairs that see the same road as given, or turned by what they are likely to be off by."""
        names, turn = list(self.cameras), float(self.likely[2])

        def turned(name: str) -> list[Masks]:
            poses = [self.start[name].moved(np.array([yaw]), (2,)) for yaw in (0.0, -turn, turn)]
            return [self._seen({name: pose}, name, 1) for pose in poses]

        masks = dict(zip(names, in_threads(turned, names), strict=True))
        found = []
        for a, b in ((a, b) for k, b in enumerate(names) for a in names[:k]):
            tried = itertools.product(masks[a], masks[b])
            if any(int(_shared(one, other, 1).sum()) >= _FEWEST_CELLS for one, other in tried):
                found.append((a, b))
        return found

    def _seen(self, state: State, name: str, level: int) -> Masks:
        """Return which cells a camera resolves, and which it shows at least smeared, with their neighbours."""
        lut = self.lut(state, name, level)
        return _inner(lut.mask & lut.resolved_mask(_RESOLVED)), _inner(lut.mask & lut.resolved_mask(_SMEARED))

    def overlaps(self, state: State, level: int) -> dict[tuple[str, str], NDArray[np.bool_]]:
        """Return which cells two cameras see and resolve, with their neighbours, for each two."""
        names = list(self.cameras)
        masks = dict(zip(names, in_threads(lambda name: self._seen(state, name, level), names), strict=True))
        return {(a, b): _shared(masks[a], masks[b], level) for k, b in enumerate(names) for a in names[:k]}

    # ------------------------------------------------------------------------------------------------------------------

    def hold(self, name: str, state: State) -> State:
        """Leave a camera as it was given, and return the state with it so.

        What it sees says nothing about the others any more, and is fitted no longer.
        """
        self.free.remove(name)
        self.pairs = [pair for pair in self.pairs if name not in pair]
        return {**state, name: self.start[name]}

    def cut_off(self) -> list[str]:
        """Return the free cameras that no pair leads to from the fixed one."""
        reached = self._reached()
        return [name for name in self.free if name not in reached]

    def _reached(self) -> set[str]:
        told, more = {self.fixed}, True
        while more:
            reached = {name for pair in self.pairs if told & set(pair) for name in pair}
            told, more = told | reached, not reached <= told
        return told

    def astray(
        self, before: Mapping[tuple[str, str], float], after: Mapping[tuple[str, str], float], worse: float
    ) -> tuple[str, tuple[str, str]] | None:
        """Return the free camera of the pair that agrees so much less than before, and the pair; None if none does."""
        lost = {
            # of views that show no road together any more nothing is known: as if they had nothing in common
            pair: before.get(pair, -1.0) - after.get(pair, 0.0)
            for pair in {*before, *after}
            if set(pair) & set(self.free) and pair in self.pairs
        }
        pair = max(lost, key=lambda each: lost[each], default=None)
        if pair is None or lost[pair] <= worse:
            return None
        # of two the one that agrees less with the rest
        scores = {
            name: max((score for each, score in after.items() if name in each and each != pair), default=-1.0)
            for name in pair
            if name in self.free
        }
        return min(scores, key=lambda name: scores[name]), pair

    def unlike(self, after: Mapping[tuple[str, str], float]) -> str | None:
        """Return the free camera whose views agree far less with each neighbour's than pairs usually do."""
        best = {name: max((score for pair, score in after.items() if name in pair), default=-1.0) for name in self.free}
        name = min(best, key=lambda each: best[each], default=None)
        usual = float(np.median(list(after.values()))) if len(after) > 2 else -1.0
        return name if name is not None and best[name] < _UNLIKE * usual else None

    def untold(self, state: State, covariance: Matrix) -> str | None:
        """Return a free camera that has been led away, of which all is as uncertain as before; None if none is."""
        off = np.sqrt(np.diag(covariance)).reshape(-1, 4) / self.likely
        led = [float(np.abs(self._away(state, name) / self.likely).max()) for name in self.free]
        return next(
            (n for n, each, far in zip(self.free, off, led, strict=True) if each.min() > 0.9 and far > 0.5), None
        )

    def _away(self, state: State, name: str) -> Matrix:
        """Return roll, pitch, yaw and height beside those that were given."""
        turned = np.array(state[name].angles) - self.start[name].angles
        turned = (turned + math.pi) % (2.0 * math.pi) - math.pi
        return np.array([*turned, state[name].position[2] - self.start[name].position[2]])

    def solved(self, state: State, levels: Sequence[int]) -> State:
        """Return the poses near others with which the views agree, from coarse cells to fine ones."""
        for level in levels:
            for _ in range(2):  # the second time with the cells, and the spread, of better poses
                chosen = self.chosen(state, level)
                spreads = self.spreads(state, chosen, level)
                if not spreads:
                    break
                evaluate = partial(self.normal, chosen, spreads, level)
                state, _ = minimise(evaluate, state, self._moved, iterations=10, tolerance=1e-5 if level > 1 else 1e-6)
        return state

    def chosen(self, state: State, level: int) -> Cells:
        cells = self.overlaps(state, level)
        return {pair: cells[pair] for pair in self.pairs if cells[pair].sum() >= 20}

    def _moved(self, state: State, step: Matrix) -> State:
        moved = dict(state)
        for index, name in enumerate(self.free):
            moved[name] = state[name].moved(step[4 * index : 4 * index + 4], range(4))
        return moved

    def views(self, state: State, level: int, chosen: Cells, shifted: bool = False) -> dict[str, View]:
        """Return what the cameras see from above, and how it moves with roll, pitch, yaw and height where chosen.

        Where `shifted` is asked for also with the picture, by a pixel to the right and by one down.
        """
        grid = self.grids[level]
        xy = grid.xy()

        def view(name: str) -> View:
            at = np.zeros(grid.shape, bool)
            for pair, cells in chosen.items():
                at |= cells if name in pair else False
            rows = (np.cumsum(at) - 1).reshape(grid.shape)
            points = np.column_stack([xy[at], self.ground.height_at(xy[at])])
            pose, lut = state[name], self.lut(state, name, level)
            camera = self.cameras[name].with_pose(pose.camera_from_vehicle)
            pictures = [
                np.asarray(lut.warp(images[name], interpolation="area", threads=1), dtype=np.float64)
                for images in self.instants
            ]
            steeps = []
            for picture in pictures:
                # rows go back along x, columns along y
                down, right = (np.gradient(picture, cell, axis=k)[at] for k, cell in enumerate(grid.resolution))
                steeps.append(np.stack([down, right], axis=-1))
            flows = np.zeros((len(points), 2, 6 if shifted else 4))
            if name in self.free:
                flows[:, :, :4] = self._flows(points, pose)
            if shifted:
                flows[:, :, 4:] = self._shifts(points, camera, grid.resolution[0])
            return View(pictures, steeps, flows, rows)

        def cached(name: str) -> View:
            # what placed cameras see does not change while one is fitted to them: a third of the time. Which are free,
            # and so have flows, changes with what is chosen.
            key = (state[name], level, chosen, shifted)
            known = self._seen_last.get(name)
            if known is None or not all(a is b for a, b in zip(known[0], key, strict=True)):
                known = self._seen_last[name] = (key, view(name))
            return known[1]

        names = [name for name in self.cameras if any(name in pair for pair in chosen)]
        return dict(zip(names, in_threads(cached, names), strict=True))

    def _flows(self, points: Matrix, pose: Pose) -> Matrix:
        """(N, 2, 4): how what a camera shows at points of the road moves with its roll, pitch, yaw and height."""
        away, normal = points - pose.position, self.ground.normal
        axes = axes_of_angles(*pose.angles[1:])
        # What a pixel shows goes with its ray: where that meets the road after a turn, or a lift, of the camera.
        leads = [np.cross(axes[:, k], away) for k in range(3)]
        leads.append(np.broadcast_to([0.0, 0.0, 1.0], away.shape))
        under = np.einsum("nj,j->n", away, normal)
        shares = [np.einsum("nj,j->n", lead, normal) / under for lead in leads]
        return np.stack(
            [lead[:, :2] - share[:, None] * away[:, :2] for lead, share in zip(leads, shares, strict=True)], -1
        )

    def _shifts(self, points: Matrix, camera: Camera, cell: float) -> Matrix:
        """(N, 2, 2): how far apart along x and y the road is that two pixels beside, and below, each other show."""
        ends = []
        for step in 0.5 * cell * np.eye(2):
            either = [points[:, :2] + sign * step for sign in (1.0, -1.0)]
            pixels = [camera.project(np.column_stack([xy, self.ground.height_at(xy)]))[0] for xy in either]
            ends.append((pixels[0] - pixels[1]) / cell)
        (a, c), (b, d) = (np.nan_to_num(end).T for end in ends)  # [[a, b], [c, d]]: pixels by metres
        whole = a * d - b * c
        inverse = np.stack([np.stack([d, -b], -1), np.stack([-c, a], -1)], -2)
        return np.where(np.abs(whole) > 1e-9, 1.0 / whole, 0.0)[:, None, None] * inverse

    def differences(
        self, views: Mapping[str, View], pair: tuple[str, str], cells: NDArray[np.bool_], spread: float | None
    ) -> list[tuple[Matrix, Matrix, float, NDArray[np.bool_]]]:
        """Return for each instant how two views differ, the derivatives (N, 2, 2 P), what part is seen, and where.

        The derivatives are told by the brightness of the one view, and by that of the other: what both have in common
        is the road, what they do not is noise. By their own views alone it would be taken for road, and the poses for
        better known than they are: by five times, in a narrow overlap.
        """
        found = []
        for instant in range(len(self.instants)):
            one, other = (views[name].pictures[instant] for name in pair)
            both = cells & np.isfinite(one) & np.isfinite(other)
            if both.sum() < 10:
                continue
            there, values = one[both], other[both]
            J = None
            if spread is not None:
                ratio = float(np.clip(values.std() / max(there.std(), 1e-9), 0.5, 2.0))
                at = [views[name].rows[both] for name in pair]
                flows = [views[name].flows[rows] for name, rows in zip(pair, at, strict=True)]
                steeps = [views[name].steeps[instant][rows] for name, rows in zip(pair, at, strict=True)]
                by_either = [
                    (-_along(flows[0], steep), _along(flows[1], steep)) for steep in (ratio * steeps[0], steeps[1])
                ]
                J = np.concatenate([*by_either[0], *by_either[1]], axis=1)
            off, J, both[both] = exposed(values, there, spread, J)
            J = np.zeros((len(off), 2, 0)) if J is None else J.reshape(len(off), 2, -1)
            found.append((off, J, float(cells.sum()) / len(off), both))
        return found

    def spreads(self, state: State, chosen: Cells, level: int) -> dict[tuple[str, str], float]:
        """Return the standard deviation of how two views differ, of each pair that can be compared.

        Each pair has its own: what two cameras show smeared differs more, and by the others' it would count as much as
        what they show clearly, and put all of them off. None is below a third of the usual: a road may have no grain.
        """
        views = self.views(state, level, chosen)
        found = {}
        for pair, cells in chosen.items():
            off = [each[0] for each in self.differences(views, pair, cells, None)]
            if off:
                found[pair] = 1.4826 * float(np.median(np.abs(np.concatenate(off))))
        least = float(np.median(list(found.values()))) / 3.0 if found else 0.0
        return {pair: max(spread, least) for pair, spread in found.items() if max(spread, least) > 0.0}

    def columns(self, pair: tuple[str, str]) -> list[int]:
        """Return where the eight derivatives of a pair belong; those of the fixed camera nowhere, -1."""
        columns = []
        for name in pair:
            first = 4 * self.free.index(name) if name in self.free else -9
            columns += [first + k if first >= 0 else -1 for k in range(4)]
        return columns

    def normal(self, chosen: Cells, spreads: Mapping[tuple[str, str], float], level: int, state: State) -> Normal:
        """Return the normal equations of Tukey's loss, in standard deviations."""
        size = 4 * len(self.free)
        views = self.views(state, level, chosen)
        cost, gradient, hessian = 0.0, np.zeros(size), np.zeros((size, size))
        for pair, spread in spreads.items():
            columns = self.columns(pair)
            kept = [k for k, column in enumerate(columns) if column >= 0]
            where = [columns[k] for k in kept]
            for off, J, whole, _ in self.differences(views, pair, chosen[pair], spread):
                seen, weight = normal_of(off, J.mean(1)[:, kept], spread), whole / spread**2
                cost += weight * seen.cost
                gradient[where] += weight * seen.gradient
                hessian[np.ix_(where, where)] += weight * seen.hessian
        for index, name in enumerate(self.free):
            away = self._away(state, name)
            if (np.abs(away) > _FARTHEST * self.likely).any():
                return Normal(math.inf, np.zeros(size), np.eye(size))
            strength = self.likely**-2
            at = slice(4 * index, 4 * index + 4)
            cost += 0.5 * float((strength * away**2).sum())
            gradient[at] += strength * away
            hessian[at, at] += np.diag(strength)
        return Normal(cost, gradient, hessian)

    # ------------------------------------------------------------------------------------------------------------------

    def agreement(self, state: State) -> dict[tuple[str, str], float]:
        """Return the correlation of what the views of each pair have in common, the mean of the instants."""
        chosen = self.chosen(state, 1)
        views = self.views(state, 1, chosen)
        found = {}
        for pair, cells in chosen.items():
            scores = []
            for instant in range(len(self.instants)):
                one, other = (views[name].pictures[instant] for name in pair)
                scores.append(likeness(one[cells], other[cells]))
            found[pair] = float(np.mean(scores))
        return found


def _along(flows: Matrix, steeps: Matrix) -> Matrix:
    """(N, P) change of brightness (N, 2) steep along flows (N, 2, P)."""
    return np.asarray(np.einsum("ni,nip->np", steeps, flows), dtype=np.float64)


def _shared(one: Masks, other: Masks, level: int) -> NDArray[np.bool_]:
    """Return what two cameras see: where that is little, also what they show smeared."""
    clear = one[0] & other[0]
    return one[1] & other[1] if int(clear.sum()) * level**2 < _NARROW_CELLS else clear


def _inner(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells whose four neighbours are in a mask too."""
    inner = np.zeros_like(mask)
    inner[1:-1, 1:-1] = mask[1:-1, 1:-1] & mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
    return inner
