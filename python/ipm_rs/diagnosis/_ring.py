"""The diagnosis of a rig: every camera, who sees what, and how pairs of cameras agree."""

from __future__ import annotations

import json
import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, HeightMap, Plane
from ipm_rs.diagnosis._camera import examine
from ipm_rs.diagnosis._coverage import coarser
from ipm_rs.diagnosis._findings import Finding, worst_first
from ipm_rs.diagnosis._report import Report, plain
from ipm_rs.diagnosis._words import percent
from ipm_rs.errors import IpmError
from ipm_rs.rig import Agreement, Bowl, Rig, RigLut

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["RigReport", "examine_rig"]

_MOST_CELLS = 250_000  # of the table for pairs and seams
_FARTHEST = 0.5
_APART = 0.15  # metres that two pictures may lie beside each other: the road is not flat, and cars stand on it
_ALIKE = 0.5  # correlation from which a shift says something

_SIDES = {"front": 0.0, "left": 90.0, "right": -90.0, "back": 180.0, "rear": 180.0}


@dataclass(frozen=True, eq=False)
class RigReport:
    """What the doctor says of a rig. ``print(report)`` says it in words, `draw` shows it."""

    rig: Rig
    grid: BevGrid
    ground: float | Plane | HeightMap | Bowl
    cameras: dict[str, Report]
    """The report of each camera alone, on the same grid."""
    seen: float
    """Part of the grid that some camera sees."""
    overlap: float
    """Part of the grid that two or more see."""
    shows: dict[str, float]
    """Part of the grid that each camera shows in a fused view: what it resolves best."""
    seams: float
    """Part of the grid where cameras are mixed."""
    agreement: dict[tuple[str, str], Agreement]
    """Of each pair that shares road and has images: see `RigLut.agreement`."""
    findings: tuple[Finding, ...]
    """Errors first; those of a camera begin with its name."""
    _lut: RigLut = field(repr=False)
    _images: dict[str, NDArray[Any]] = field(repr=False)

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong: there are notes at most."""
        return all(finding.severity == "note" for finding in self.findings)

    def lines(self) -> list[str]:
        """Return the numbers in words, line by line, without the findings."""
        rows, cols = self.grid.shape
        (x0, x1), (y0, y1) = self.grid.x, self.grid.y
        found = [
            f"rig      {len(self.rig)} cameras; grid {rows} x {cols} cells, x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m",
            f"seen     {percent(self.seen)} of the grid by some camera, {percent(self.overlap)} by two or more; seams "
            f"{percent(self.seams)}",
        ]
        for name, report in self.cameras.items():
            looks = report.lines()[2].removeprefix("looks").strip()
            share = f"sees {percent(report.seen)}, shows {percent(self.shows[name])}"
            found.append(f"{name}: {looks}; {report.height:.2f} m above the road; {share}")
        for (one, other), pair in self.agreement.items():
            x, y = pair.shift
            told = pair.shifted_correlation > _ALIKE
            shift = f"{x:+.2f} m in x, {y:+.2f} m in y apart" if told else "too unlike to say how far apart"
            found.append(f"{one} and {other}: correlation {pair.correlation:.2f}; {shift} ({pair.cells} cells)")
        return found

    def __str__(self) -> str:
        verdicts = [str(finding) for finding in self.findings] or ["nothing odd was found"]
        return "\n".join([*self.lines(), *verdicts])

    def to_dict(self) -> dict[str, Any]:
        """Return everything as numbers, texts, lists and dicts; what is not known or infinite is None."""
        return plain(
            {
                "cameras": {name: report.to_dict() for name, report in self.cameras.items()},
                "seen": self.seen,
                "overlap": self.overlap,
                "shows": self.shows,
                "seams": self.seams,
                "agreement": [{"pair": list(pair), **asdict(each)} for pair, each in self.agreement.items()],
                "ok": self.ok,
                "findings": [asdict(finding) for finding in self.findings],
            }
        )

    def to_json(self) -> str:
        """Return `to_dict` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False) + "\n"

    def draw(self) -> Image:
        """Draw the photos with the road's metres, the fused view, and which camera shows each cell.

        Raises
        ------
        MissingExtraError
            Pillow is not installed.
        """
        from ipm_rs.diagnosis._ringpicture import picture

        return picture(self, self._lut, self._images)

    def _repr_html_(self) -> str:
        from ipm_rs._notebook import html_of

        return html_of(self.__str__, self.draw)


def examine_rig(
    rig: Rig, grid: BevGrid, ground: float | Plane | HeightMap | Bowl, images: Mapping[str, NDArray[Any]]
) -> RigReport:
    """Return the report of a rig."""
    road = ground.height_map(grid) if isinstance(ground, Bowl) else ground
    lut = _table(rig, grid, ground)
    reports = {name: examine(camera, lut.grid, road, images.get(name)) for name, camera in rig.items()}
    weights = np.stack([lut.weights(name) for name in rig])
    count = np.sum([report._coverage.seen for report in reports.values()], axis=0)
    source = lut.source
    fits = {name: image for name, image in images.items() if image.shape[1::-1] == rig[name].image_size}
    agreement: dict[tuple[str, str], Agreement] = {}
    odd = []
    if len(fits) > 1:
        try:
            agreement = lut.agreement(fits, farthest=_FARTHEST)
        except IpmError as error:  # images of different kinds
            odd.append(Finding("warning", "images-differ", f"pairs cannot be compared: {error}", ""))
    findings = [*odd, *_of_names(reports), *_of_pairs(agreement)]
    for name, report in reports.items():
        # each camera has streaks somewhere on a grid around the car, and one that looks back sees nothing of one ahead
        aside = report.height > 0 and report.seen == 0
        findings += [
            Finding(each.severity, each.code, f"{name}: {each.text}", each.mend)
            for each in report.findings
            if each.severity != "note" and not (aside and each.code == "sees-no-road")
        ]
        if aside:
            findings.append(Finding("note", "sees-nothing", f"{name} sees nothing of the grid", ""))
    return RigReport(
        rig=rig,
        grid=grid,
        ground=ground,
        cameras=reports,
        seen=float((source >= 0).mean()),
        overlap=float((count > 1).mean()),
        shows={name: float((source == place).mean()) for place, name in enumerate(rig)},
        seams=float(((weights > 0).sum(axis=0) > 1).mean()),
        agreement=agreement,
        findings=worst_first(findings),
        _lut=lut,
        _images=dict(fits),
    )


def _table(rig: Rig, grid: BevGrid, ground: float | Plane | HeightMap | Bowl) -> RigLut:
    grid, _ = coarser(grid, _MOST_CELLS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # each camera's report says them
        return RigLut(rig, grid, ground=ground)


def _of_names(reports: Mapping[str, Report]) -> list[Finding]:
    """Return cameras that look elsewhere than their names say: all left and right ones swapped are a mirrored world."""
    swapped: list[str] = []
    other: list[str] = []
    for name, report in reports.items():
        words = [word for word in re.split(r"[^a-z]+", name.lower()) if word in _SIDES]
        if not words or report.pitch_deg > 70:
            continue
        told = _mean_direction([_SIDES[word] for word in words])
        if told is None:
            continue
        off = abs(math.remainder(report.heading_deg - told, 360))
        if off <= 75:
            continue
        sided = any(word in ("left", "right") for word in words)
        mirrored = sided and abs(math.remainder(-report.heading_deg - told, 360)) <= 75
        (swapped if mirrored else other).append(f"{name} ({report.heading_deg:.0f} degrees to the left)")
    found = []
    if swapped:
        found.append(
            Finding(
                "error",
                "mirrored",
                f"cameras of one side look to the other: {', '.join(swapped)}; the view would be mirrored",
                "a left-handed world (CARLA, Unreal: y to the right) was read as a right-handed one: use "
                "flip_handedness_pose",
            )
        )
    if other:
        found.append(
            Finding(
                "warning",
                "other-direction",
                f"cameras look elsewhere than their names say: {', '.join(other)}",
                "are names and poses of the same camera, and is x forward?",
            )
        )
    return found


def _mean_direction(degrees: list[float]) -> float | None:
    x, y = (sum(f(math.radians(angle)) for angle in degrees) for f in (math.cos, math.sin))
    return math.degrees(math.atan2(y, x)) if math.hypot(x, y) > 0.5 else None


def _of_pairs(agreement: Mapping[tuple[str, str], Agreement]) -> list[Finding]:
    found = []
    for (one, other), pair in agreement.items():
        apart = math.hypot(*pair.shift)
        if pair.shifted_correlation > _ALIKE and apart > _APART and pair.shifted_correlation > pair.correlation + 0.1:
            found.append(
                Finding(
                    "warning",
                    "pair-apart",
                    f"{other} lies {apart:.2f} m beside {one} on the road that both see (x {pair.shift[0]:+.2f}, y "
                    f"{pair.shift[1]:+.2f}; correlation {pair.correlation:.2f}, moved so "
                    f"{pair.shifted_correlation:.2f})",
                    "one of their poses is off, or the road is not flat: ipm_rs.refine",
                )
            )
    return found
