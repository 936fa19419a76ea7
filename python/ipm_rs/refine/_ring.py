"""Cameras of a ring made to agree about the road that two of them see at once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, Lut, Plane
from ipm_rs.refine._loss import CUT, correlation, exposed, in_threads, weights_of
from ipm_rs.refine._motion import angles_of, axes_of_angles
from ipm_rs.refine._road import Pose, pose_of_camera, square
from ipm_rs.refine._solve import Normal, inverse_of, minimise, patched, scatter_of

__all__ = ["Ring", "State"]

Matrix = NDArray[np.float64]
State = dict[str, Pose]
Cells = Mapping[tuple[str, str], NDArray[np.bool_]]

_LEVELS = (8, 4, 2, 1)
"""Cells that the views are compared in, in finest ones: half a height of the camera first."""
_FEWEST_CELLS = 100
_RESOLVED = 0.5
"""Pixels a cell in the worse direction: what is resolved less is smear."""
_SAMPLED = 0.15
"""Pixels by which sampling puts all views off alike: see `_alignment`. Chosen on seed 0 of `scripts/try_refine.py ring
pinhole6`, whose narrow overlaps are looked at from the edges of two pictures; of fisheyes it is too much."""
_UNLIKE = 0.75
"""Of the median of all pairs: a camera whose views agree less than this part of it, with each neighbour, is misplaced.
In two of three synthetic rings one of five was, by 1 to 3 degrees, with 0.47 and 0.60 where others had 0.98."""


class View(NamedTuple):
    """Pictures of one camera from above, instant by instant, and their derivatives by its four parameters."""

    pictures: list[Matrix]
    slopes: list[Matrix]
    """(M, 4) of each instant, of the cells that are compared."""
    rows: NDArray[np.intp]
    """(rows, columns): which row of the slopes is a cell's."""


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
        self.start: State = {name: pose_of_camera(camera) for name, camera in cameras.items()}
        self.levels = _LEVELS
        self.grids = {level: self._coarser(level) for level in _LEVELS}
        self.pairs = [pair for pair, cells in self.overlaps(self.start, 1).items() if cells.sum() >= _FEWEST_CELLS]
        told, more = {fixed}, True
        while more:
            reached = {name for pair in self.pairs if told & set(pair) for name in pair}
            told, more = told | reached, not reached <= told
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

    def overlaps(self, state: State, level: int) -> dict[tuple[str, str], NDArray[np.bool_]]:
        """Return which cells two cameras see and resolve, with their neighbours, for each two."""

        def seen(name: str) -> NDArray[np.bool_]:
            lut = self.lut(state, name, level)
            mask = lut.mask & lut.resolved_mask(_RESOLVED)
            inner = np.zeros_like(mask)
            inner[1:-1, 1:-1] = mask[1:-1, 1:-1] & mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
            return inner

        masks = dict(zip(self.cameras, in_threads(seen, self.cameras), strict=True))
        names = list(self.cameras)
        return {(a, b): masks[a] & masks[b] for k, b in enumerate(names) for a in names[:k]}

    # ------------------------------------------------------------------------------------------------------------------

    def hold(self, name: str, state: State) -> State:
        """Leave a camera as it was given, and return the state with it so."""
        self.free.remove(name)
        return {**state, name: self.start[name]}

    def astray(
        self, before: Mapping[tuple[str, str], float], after: Mapping[tuple[str, str], float], worse: float
    ) -> tuple[str, tuple[str, str]] | None:
        """Return the free camera of the pair that agrees so much less than before, and the pair; None if none does."""
        lost = {
            pair: before.get(pair, -1.0) - after.get(pair, -1.0)
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

    def solved(self, state: State, levels: Sequence[int]) -> State:
        """Return the poses near others with which the views agree, from coarse cells to fine ones."""
        for level in levels:
            for _ in range(2):  # the second time with the cells, and the spread, of better poses
                chosen = self._chosen(state, level)
                spread = self._spread(state, chosen, level)
                if not (chosen and spread > 0):
                    break
                evaluate = partial(self._normal, chosen, spread, level)
                state, _ = minimise(evaluate, state, self._moved, iterations=10, tolerance=1e-5 if level > 1 else 1e-6)
        return state

    def _chosen(self, state: State, level: int) -> Cells:
        cells = self.overlaps(state, level)
        return {pair: cells[pair] for pair in self.pairs if cells[pair].sum() >= 20}

    def _moved(self, state: State, step: Matrix) -> State:
        moved = dict(state)
        for index, name in enumerate(self.free):
            moved[name] = state[name].moved(step[4 * index : 4 * index + 4], range(4))
        return moved

    def views(self, state: State, level: int, chosen: Cells) -> dict[str, View]:
        """Return what the cameras see from above, and the derivatives by roll, pitch, yaw and height where chosen."""
        grid = self.grids[level]
        xy = grid.xy()
        normal = self.ground.normal

        def view(name: str) -> View:
            at = np.zeros(grid.shape, bool)
            for pair, cells in chosen.items():
                at |= cells if name in pair else False
            rows = (np.cumsum(at) - 1).reshape(grid.shape)
            points = np.column_stack([xy[at], self.ground.height_at(xy[at])])
            pose, lut = state[name], self.lut(state, name, level)
            pictures = [
                np.asarray(lut.warp(images[name], interpolation="area", threads=1), dtype=np.float64)
                for images in self.instants
            ]
            if name not in self.free:
                return View(pictures, [], rows)
            away = points - pose.position
            _, pitch, yaw = angles_of(square(pose.rotation))
            axes = axes_of_angles(pitch, yaw)
            # What a pixel shows goes with its ray: where that meets the road after a turn, or a lift, of the camera.
            leads = [np.cross(axes[:, k], away) for k in range(3)]
            leads.append(np.broadcast_to([0.0, 0.0, 1.0], away.shape))
            under = np.einsum("nj,j->n", away, normal)
            flows = []
            for lead in leads:
                share = np.einsum("nj,j->n", lead, normal) / under
                flows.append(lead[:, :2] - share[:, None] * away[:, :2])
            slopes = []
            for picture in pictures:
                # rows go back along x, columns along y
                down, right = (np.gradient(picture, cell, axis=k)[at] for k, cell in enumerate(grid.resolution))
                slopes.append(np.stack([down * flow[:, 0] + right * flow[:, 1] for flow in flows], axis=-1))
            return View(pictures, slopes, rows)

        names = [name for name in self.cameras if any(name in pair for pair in chosen)]
        return dict(zip(names, in_threads(view, names), strict=True))

    def _differences(
        self, views: Mapping[str, View], pair: tuple[str, str], cells: NDArray[np.bool_], spread: float | None
    ) -> list[tuple[Matrix, Matrix, float, NDArray[np.bool_]]]:
        """Return for each instant how two views differ, the derivatives (N, 8), what part is seen, and where."""
        found = []
        for instant in range(len(self.instants)):
            one, other = (views[name].pictures[instant] for name in pair)
            both = cells & np.isfinite(one) & np.isfinite(other)
            if both.sum() < 10:
                continue
            there, values = one[both], other[both]
            ratio = float(np.clip(values.std() / max(there.std(), 1e-9), 0.5, 2.0))
            J = np.zeros((len(values), 8))
            for column, (name, sign) in enumerate(zip(pair, (-ratio, 1.0), strict=True)):
                if name in self.free:
                    J[:, 4 * column : 4 * column + 4] = sign * views[name].slopes[instant][views[name].rows[both]]
            off, J = exposed(values, there, spread, J if spread is not None else None)
            found.append((off, J, float(cells.sum()) / len(off), both))
        return found

    def _spread(self, state: State, chosen: Cells, level: int) -> float:
        views = self.views(state, level, chosen)
        off = [each[0] for pair, cells in chosen.items() for each in self._differences(views, pair, cells, None)]
        return 1.4826 * float(np.median(np.abs(np.concatenate(off)))) if off else math.nan

    def _columns(self, pair: tuple[str, str]) -> list[int]:
        """Return where the eight derivatives of a pair belong; those of the fixed camera nowhere, -1."""
        columns = []
        for name in pair:
            first = 4 * self.free.index(name) if name in self.free else -9
            columns += [first + k if first >= 0 else -1 for k in range(4)]
        return columns

    def _normal(self, chosen: Cells, spread: float, level: int, state: State) -> Normal:
        size = 4 * len(self.free)
        views = self.views(state, level, chosen)
        cost, gradient, hessian = 0.0, np.zeros(size), np.zeros((size, size))
        most = CUT**2 / 6.0 * spread**2
        for pair, cells in chosen.items():
            columns = self._columns(pair)
            kept = [k for k, column in enumerate(columns) if column >= 0]
            where = [columns[k] for k in kept]
            for off, J, whole, _ in self._differences(views, pair, cells, spread):
                J = J[:, kept]
                share = np.minimum((off / (CUT * spread)) ** 2, 1.0)
                weighted = weights_of(off, spread)[:, None] * J
                cost += whole * float((most * (1.0 - (1.0 - share) ** 3)).sum())
                gradient[where] += whole * np.einsum("np,n->p", weighted, off)
                hessian[np.ix_(where, where)] += whole * np.einsum("np,nq->pq", weighted, J)
        for index, name in enumerate(self.free):
            turned = np.array(angles_of(square(state[name].rotation))) - angles_of(square(self.start[name].rotation))
            turned = (turned + math.pi) % (2.0 * math.pi) - math.pi
            away = np.array([*turned, state[name].position[2] - self.start[name].position[2]])
            strength = (spread / self.likely) ** 2
            at = slice(4 * index, 4 * index + 4)
            cost += 0.5 * float((strength * away**2).sum())
            gradient[at] += strength * away
            hessian[at, at] += np.diag(strength)
        return Normal(cost, gradient, hessian)

    # ------------------------------------------------------------------------------------------------------------------

    def covariance(self, state: State) -> Matrix:
        """(4 N, 4 N) of roll, pitch, yaw and height of the free cameras: from how much patches of the road disagree."""
        chosen = self._chosen(state, 1)
        spread, views = self._spread(state, chosen, 1), self.views(state, 1, chosen)
        normal = self._normal(chosen, spread, 1, state)
        size = 4 * len(self.free)
        likely = np.tile(self.likely, len(self.free))
        inverse = inverse_of(normal.hessian)
        if inverse is None:
            return np.diag(likely**2)
        middle = np.zeros((size, size))
        xy = self.grids[1].xy()
        for pair, cells in chosen.items():
            columns = self._columns(pair)
            kept = [k for k, column in enumerate(columns) if column >= 0]
            places, pulls = [], []
            for off, J, whole, both in self._differences(views, pair, cells, spread):
                places.append(np.column_stack([xy[both], np.zeros(len(off))]))
                pulls.append(whole * (weights_of(off, spread) * off)[:, None] * J[:, kept])
            if places:
                where = [columns[k] for k in kept]
                together = patched(np.concatenate(places), np.concatenate(pulls), size=self.height)
                middle[np.ix_(where, where)] += scatter_of(together)
        angles = [_SAMPLED / float(self.cameras[name].intrinsics[0, 0]) for name in self.free]
        least = np.concatenate([[a, a, a, 5.0 * a * self.height] for a in angles])
        return np.asarray(inverse @ middle @ inverse + np.diag(least**2), dtype=np.float64)

    def agreement(self, state: State) -> dict[tuple[str, str], float]:
        """Return the correlation of the views of each pair, the mean of the instants."""
        chosen = self._chosen(state, 1)
        views = self.views(state, 1, chosen)
        found = {}
        for pair, cells in chosen.items():
            scores = []
            for instant in range(len(self.instants)):
                one, other = (views[name].pictures[instant] for name in pair)
                scores.append(correlation(one[cells], other[cells]))
            found[pair] = float(np.mean(scores))
        return found
