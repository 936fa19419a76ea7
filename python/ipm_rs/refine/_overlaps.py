"""The poses of a ring's cameras from what two of them see of the same road at once.

Their bird's-eye views agree there if the poses are right. Brightness in the one view less brightness in the other is
minimised over roll, pitch, yaw and height of all cameras but one together, from coarse cells to fine ones, with Tukey's
loss, which counts for nothing what stands higher than the road and looks different from the two sides.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ipm_rs._arguments import number_of
from ipm_rs._core import BevGrid, Plane
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError, CalibrationWarning, ImageError
from ipm_rs.refine._inputs import guarded, numbers_of
from ipm_rs.refine._pictures import grey_of
from ipm_rs.refine._ring import Ring, State
from ipm_rs.refine._ringcovariance import covariance_of
from ipm_rs.refine._ringsearch import searched, searched_again
from ipm_rs.refine._road import PARAMETERS
from ipm_rs.rig import Rig, RigLut

__all__ = ["RigFit", "from_overlaps"]

_MOST_INSTANTS = 16
_REACH = 10.0
"""How far around the cameras road is compared, in heights: beyond it a pixel shows metres of it."""
_FINEST = 16.0
"""Cells in a height: 6 cm below a fisheye at 0.9 m."""
_LEAST_CORRELATION = 0.2
"""Below which two views show no road alike."""
_WORSE = 0.1
"""So much less alike than before: the fit has gone astray. Fits that end well gain, or lose 0.01; on a real ring whose
verge is no plane a pair went from 0.85 to -0.22 while others gained 0.06."""
_MOST_CELLS = 4_000_000


@dataclass(frozen=True, eq=False)
class RigFit:
    """A rig whose poses were found from overlaps, and how well the pictures tell them."""

    rig: Rig
    """The rig with the poses with which the views agree, in the order of the given one."""
    parameters: tuple[tuple[str, str], ...]
    """What was found: (camera, parameter), of "roll", "pitch", "yaw" (radians, as `Camera.from_euler` takes them) and
    "height" (metres)."""
    covariance: NDArray[np.float64]
    """(P, P) of the parameters."""
    kept: dict[str, str]
    """Cameras that stay as they were, and why: the fixed one, those that share no road with the others, and those for
    which no pose was found that suits their pairs."""
    before: dict[tuple[str, str], float]
    """Correlation of the views of each pair with the rig as it was given, the mean of the instants. What differs by
    far, moving things and what stands up, is left out by Tukey's weights."""
    after: dict[tuple[str, str], float]
    """The same with the rig that was found."""
    gains: dict[str, NDArray[np.float32]]
    """How bright the cameras are beside each other, as `RigLut.warp` takes them, of the first instant."""
    grid: BevGrid
    """The road on which they were compared."""

    @property
    def deviations(self) -> dict[tuple[str, str], float]:
        """Standard deviation of each parameter, in its unit."""
        return {key: math.sqrt(max(v, 0.0)) for key, v in zip(self.parameters, np.diag(self.covariance), strict=True)}

    def __str__(self) -> str:
        off = self.deviations
        lines = []
        for name in dict.fromkeys(name for name, _ in self.parameters):
            angles = ", ".join(f"{angle} +- {math.degrees(off[name, angle]):.3f}" for angle in PARAMETERS[:3])
            lines.append(f"{name}: {angles} deg, height +- {off[name, 'height']:.3f} m")
        lines += [f"{name} left as it was: {why}" for name, why in self.kept.items()]
        for pair, score in self.after.items():
            before = f", {self.before[pair]:.3f} before" if pair in self.before else ""
            lines.append(f"{pair[0]} and {pair[1]} correlate with {score:.3f}{before}")
        return "\n".join(lines)


@guarded
def from_overlaps(
    rig: Rig,
    images: Mapping[str, Any] | Iterable[Mapping[str, Any]],
    *,
    fixed: str | None = None,
    grid: BevGrid | None = None,
    ground: float | Plane = 0.0,
    prior: tuple[float, float] | None = None,
) -> RigFit:
    """Find roll, pitch, yaw and height of the cameras of a ring: those with which overlapping views of the road agree.

    Parameters
    ----------
    rig : Rig
        The cameras, up to 2 degrees and 10 % of the height off. What they mask, the own car above all, is
        not looked at.
    images : mapping of str to (H, W) or (H, W, 3) array, or an iterable of such mappings
        The raw pictures of all cameras, of one instant or of up to 16: several tell more, on other road.
    fixed : str, optional
        The camera that stays and that the others are fitted to; the first if not given. What it is off by, all are in
        the end.
    grid : BevGrid, optional
        The road that is compared, in the vehicle frame, in square cells, the finest. By default 10 heights around
        the cameras, and cells of a sixteenth of the height.
    ground : float or Plane
        The road in the vehicle frame.
    prior : (float, float), optional
        How far off the cameras are likely to be as given, as standard deviations: of roll, pitch and yaw in degrees,
        and of the height in metres. What the overlaps do not tell is held to it, and poses are searched within
        one and a half of it. By default (2, a tenth of the height); pass less for a ring that was calibrated well.

    Returns
    -------
    RigFit
        ``.rig``, ``.deviations``, ``.covariance``, ``.before``, ``.after``, ``.kept``, ``.gains``.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        An unknown `fixed`, pictures that lack a camera, no two cameras that see the same road.
    ImageError, DtypeError
        A picture has another size than its camera's, or the road has no contrast.
    CalibrationError
        A camera is not above the road, no two views agree whatever the poses, or all cameras stay because a pair would
        agree less than before, as where what they see is not flat.
    """
    if not isinstance(rig, Rig):
        raise ArgumentTypeError(f"rig: expected an ipm_rs.Rig, got {type(rig).__name__}; write Rig({{name: camera}})")
    names = list(rig)
    held = names[0] if fixed is None else fixed
    if not isinstance(held, str) or held not in names:
        raise ArgumentError(f"fixed: expected the name of one of the cameras, {', '.join(names)}")
    plane = ground if isinstance(ground, Plane) else Plane(
        normal=(0.0, 0.0, 1.0), point=(0.0, 0.0, number_of("ground", ground, what=", metres, or a Plane"))
    )  # fmt: skip
    places = np.array([camera.position for camera in rig.values()])
    heights = places[:, 2] - plane.height_at(places[:, :2])
    if not (heights > 0).all():
        low = names[int(np.argmin(heights))]
        raise CalibrationError(
            f"rig: expected cameras above the road, got {low!r} {heights.min():.3g} m above; give its height, "
            "or ground= the road's"
        )
    height = float(np.median(heights))
    area = _area(places, height) if grid is None else grid
    if not isinstance(area, BevGrid):
        raise ArgumentTypeError(f"grid: expected an ipm_rs.BevGrid, got {type(area).__name__}")
    if area.shape[0] * area.shape[1] > _MOST_CELLS:
        raise ArgumentError(f"grid: expected at most {_MOST_CELLS} cells, got {area.shape}; take larger ones")
    if abs(area.resolution[0] - area.resolution[1]) > 1e-9 * area.resolution[0]:
        raise ArgumentError(f"grid: expected square cells, got {area.resolution[0]:g} m x {area.resolution[1]:g} m")
    given = _instants(images)
    instants = [
        {name: grey_of(f"images[{name!r}]", _picture(instant, name), camera) for name, camera in rig.items()}
        for instant in given
    ]
    with warnings.catch_warnings():
        # a camera that sees no cell, or stands oddly on the way, is none that the caller made
        warnings.simplefilter("ignore", CalibrationWarning)
        return _fitted(rig, Ring(rig, instants, held, plane, area, height, _likely(prior, height)))


def _fitted(rig: Rig, ring: Ring) -> RigFit:
    names = list(rig)
    if not ring.pairs:
        raise ArgumentError(
            f"rig: expected cameras that see the same road as {ring.fixed!r}, got none that share 100 cells of it; "
            "check their poses, or pass a grid= farther out or of larger cells"
        )
    before = ring.agreement(ring.start)
    held: dict[str, str] = {}
    again: set[str] = set()
    every = ring.pairs
    state = placed = searched(ring)
    while True:
        state = ring.solved(state, ring.levels[-1:])
        after = ring.agreement(state)
        if not max(after.values(), default=0.0) >= _LEAST_CORRELATION:
            _none_agree(ring, after)
        astray = ring.astray(before, after, _WORSE)
        unlike = ring.unlike(after) if len(ring.free) > 1 else None
        if astray is None and unlike is None:
            covariance = covariance_of(ring, state)
            untold = ring.untold(state, covariance)
            if untold is None:
                break
            name = untold
            pair = max((each for each in after if name in each), key=lambda each: after[each], default=(name, name))
            held[name] = "what it shows of the same road as the others tells nothing of its pose"
        elif astray is not None:
            name, pair = astray
            beside = pair[0] if pair[1] == name else pair[1]
            held[name] = f"its view and that of {beside} would agree less than as given"
        else:
            assert unlike is not None
            name = unlike
            if name not in again:  # once, for it takes as long as all cameras together
                again.add(name)
                better = searched_again(ring, state, name)
                if better is not None:
                    state = placed = better
                    continue
            pair = max((each for each in after if name in each), key=lambda each: after[each], default=(name, name))
            held[name] = "no pose was found with which its views agree as those of the others do"
        state = placed = _without_cut_off(ring, ring.hold(name, placed), held)  # nor with what it has led others to
        if not ring.free:
            raise CalibrationError(
                f"images: expected views that agree better with other poses, but those of {pair[0]!r} and {pair[1]!r} "
                f"correlate with {after.get(pair, 0.0):.2f}, {before.get(pair, math.nan):.2f} before; hide the own car "
                "with camera.masked(), pass a grid= of road that is flat, more instants, or a smaller prior="
            )
    ring.pairs = every  # those of cameras that stay are told of too
    after = ring.agreement(state)
    moved = {name: rig[name].with_pose(state[name].camera_from_vehicle) for name in ring.free}
    found = Rig({name: moved.get(name, camera) for name, camera in rig.items()})
    kept = {ring.fixed: "the others are fitted to it"} | held
    kept |= {name: "it shares no road with the others" for name in names if name not in (*kept, *ring.free)}
    return RigFit(
        rig=found,
        parameters=tuple((name, parameter) for name in ring.free for parameter in PARAMETERS),
        covariance=covariance,
        kept=kept,
        before=before,
        after=after,
        gains=RigLut(found, ring.grids[2], ground=ring.ground).gains(ring.instants[0]),
        grid=ring.area,
    )


def _without_cut_off(ring: Ring, state: State, held: dict[str, str]) -> State:
    """Leave cameras as given that share road with such alone, and say so."""
    for name in ring.cut_off():
        state = ring.hold(name, state)
        held[name] = "it shares road only with cameras that stay as they were"
    return state


def _none_agree(ring: Ring, after: Mapping[tuple[str, str], float]) -> NoReturn:
    pictures = ring.instants[0].values()
    if all(float(picture.std()) < 1e-3 * max(abs(float(picture.mean())), 1e-9) for picture in pictures):
        raise ImageError("images: expected pictures with contrast, got the same brightness everywhere")
    raise CalibrationError(
        f"images: expected views that agree with some poses, but they correlate with "
        f"{max(after.values(), default=0.0):.2f} at best; check the names, the instants and ground="
    )


def _likely(prior: tuple[float, float] | None, height: float) -> NDArray[np.float64]:
    """Return the standard deviations of roll, pitch, yaw (radians) and height (metres) of a camera as it was given."""
    if prior is None:
        return np.array([math.radians(2.0)] * 3 + [0.1 * height])
    degrees, metres = numbers_of("prior", prior, (2,), "degrees and metres that cameras are likely to be off by")
    if not (0.0 < degrees <= 10.0 and 0.0 < metres <= height):
        raise ArgumentError(
            f"prior: expected up to 10 degrees and {height:.3g} metres, both above 0, got ({degrees:g}, {metres:g}); "
            "leave it out for 2 degrees and a tenth of the height"
        )
    return np.array([math.radians(degrees)] * 3 + [metres])


def _area(places: NDArray[np.float64], height: float) -> BevGrid:
    cell, reach = height / _FINEST, _REACH * height
    low = places[:, :2].min(0) - reach
    counts = np.round((places[:, :2].max(0) + reach - low) / cell)
    if not float(counts.prod()) <= _MOST_CELLS:
        raise ArgumentError("rig: expected cameras of one vehicle, got some that are far apart; pass grid=")
    high = low + counts * cell
    return BevGrid(x=(low[0], high[0]), y=(low[1], high[1]), resolution=cell)


def _instants(images: Any) -> list[Mapping[str, Any]]:
    if isinstance(images, Mapping):
        return [images]
    try:
        listed = list(islice(images, _MOST_INSTANTS + 1))
    except MemoryError:
        raise
    except Exception as error:  # `__iter__` raises what it likes
        raise ArgumentTypeError(
            f"images: expected pictures by the cameras' names, or a list of such, got {type(images).__name__}"
        ) from error
    if not 1 <= len(listed) <= _MOST_INSTANTS:
        raise ArgumentError(f"images: expected 1 to {_MOST_INSTANTS} instants, got {len(listed)}; choose some")
    for instant in listed:
        if not isinstance(instant, Mapping):
            raise ArgumentTypeError(
                f"images: expected pictures by the cameras' names, got {type(instant).__name__}; pass a list of dicts"
            )
    return listed


def _picture(instant: Mapping[str, Any], name: str) -> Any:
    try:
        return instant[name]
    except KeyError:
        raise ArgumentError(
            f"images: expected a picture of every camera, got none of {name!r}; leave the camera out with rig.subset()"
        ) from None
