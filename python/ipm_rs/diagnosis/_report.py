"""The diagnosis of one camera: numbers, findings, words, JSON, picture."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import BevGrid, Camera, HeightMap, Plane
from ipm_rs.diagnosis._coverage import REASONS, Coverage, FarEnd
from ipm_rs.diagnosis._findings import Finding
from ipm_rs.diagnosis._words import heading, metres_of, offset, percent, pitch, roll

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["Report", "plain"]


@dataclass(frozen=True, eq=False)
class Report:
    """What the doctor says of a camera. ``print(report)`` says it in words, `draw` shows it.

    Metres are those of the vehicle frame. Angles are degrees: heading to the left, pitch down, roll left side up.
    """

    camera: Camera
    grid: BevGrid
    """The grid, as it was given."""
    ground: float | Plane | HeightMap
    position: tuple[float, float, float]
    height: float
    """Of the camera above the road under it, metres."""
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    view_deg: tuple[float, float]
    """Angle of view through the principal point, across and down."""
    horizon_row: float | None
    """The horizon's row in the middle column; None where the image does not have it."""
    bottom_range: float
    """Metres to the road at the bottom of the middle column; NaN where the image ends above it."""
    rows: dict[float, float]
    """Rows of the middle column that see the road at 5, 10, 20, 30, 50, 100 m, as far as there are such."""
    seen: float
    """Part of the grid's cells that the camera sees."""
    resolved: float
    """Part of them all that it sees with at least one pixel for two cells."""
    shares: dict[str, float]
    """Part of the cells by what is to be said of them: see `REASONS`."""
    far: FarEnd | None
    """What a pixel and a tenth of a degree cost where it sees farthest; None where it sees nothing."""
    findings: tuple[Finding, ...]
    """Errors first."""
    _coverage: Coverage = field(repr=False)
    _image: NDArray[Any] | None = field(repr=False)
    _sees: str = field(repr=False)

    @property
    def why(self) -> NDArray[np.uint8]:
        """For each cell the place of its reason in `REASONS`: (rows, columns), coarser above 600 000."""
        return self._coverage.why.copy()

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong: there are notes at most."""
        return all(finding.severity == "note" for finding in self.findings)

    def lines(self) -> list[str]:
        """Return the numbers in words, line by line, without the findings."""
        width, height = self.camera.image_size
        lens = "pinhole" if self.camera.lens is None else type(self.camera.lens).__name__
        x, y, _ = self.position
        rows, cols = self.grid.shape
        dx, dy = self.grid.resolution
        (x0, x1), (y0, y1) = self.grid.x, self.grid.y
        found = [
            f"camera   {width} x {height} pixels, {lens}, sees {self.view_deg[0]:.0f} x {self.view_deg[1]:.0f} degrees",
            f"stands   {offset(x, 'ahead', 'behind')}, {offset(y, 'to the left', 'to the right')} of the vehicle's "
            f"origin, {self.height:.2f} m above the road" + (" (that is below it)" if self.height < 0 else ""),
            f"looks    {heading(self.heading_deg)}, {pitch(self.pitch_deg)}, {roll(self.roll_deg)}",
            f"horizon  {self._horizon()}",
            f"road     {self._road()}",
            f"grid     {rows} x {cols} cells of {dx:g} x {dy:g} m, x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m",
            f"seen     {percent(self.seen)} of the cells, {percent(self.resolved)} with a pixel for two cells or more",
        ]
        unseen = [f"{percent(share)} {REASONS[name]}" for name, share in self.shares.items() if name in _UNSEEN]
        if unseen:
            found.append(f"unseen   {', '.join(unseen)}")
        if self.far is not None:
            found.append(f"far end  {self._far(self.far)}")
        return found

    def __str__(self) -> str:
        verdicts = [str(finding) for finding in self.findings] or ["nothing odd was found"]
        return "\n".join([*self.lines(), *verdicts])

    def to_dict(self) -> dict[str, Any]:
        """Return everything as numbers, texts, lists and dicts; what is not known or infinite is None."""
        (x0, x1), (y0, y1) = self.grid.x, self.grid.y
        return plain(
            {
                "image_size": self.camera.image_size,
                "position": self.position,
                "height": self.height,
                "heading_deg": self.heading_deg,
                "pitch_deg": self.pitch_deg,
                "roll_deg": self.roll_deg,
                "view_deg": self.view_deg,
                "horizon_row": self.horizon_row,
                "bottom_range": self.bottom_range,
                "rows": {f"{metres:g}": row for metres, row in self.rows.items()},
                "grid": {"x": (x0, x1), "y": (y0, y1), "resolution": self.grid.resolution, "shape": self.grid.shape},
                "seen": self.seen,
                "resolved": self.resolved,
                "shares": self.shares,
                "far": None if self.far is None else asdict(self.far),
                "ok": self.ok,
                "findings": [asdict(finding) for finding in self.findings],
            }
        )

    def to_json(self) -> str:
        """Return `to_dict` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False) + "\n"

    def draw(self) -> Image:
        """Draw the photo with the road's metres, the bird's-eye view, and which cells are not seen and why.

        Returns
        -------
        PIL.Image.Image
            RGB, about 1900 pixels wide; without an image the photo is grey and the view shows the reasons alone.

        Raises
        ------
        MissingExtraError
            Pillow is not installed.
        """
        from ipm_rs.diagnosis._picture import picture

        return picture(self, self._coverage, self._image)

    def _repr_html_(self) -> str:
        from ipm_rs._notebook import html_of

        return html_of(self.__str__, self.draw)

    def _horizon(self) -> str:
        height = self.camera.image_size[1]
        if self.horizon_row is None:
            return {"road": "above the image: all of the middle column shows the road", "sky": "below the image"}.get(
                self._sees, "not in the middle column"
            )
        return f"row {self.horizon_row:.0f} of {height}, {percent(self.horizon_row / height)} from the top"

    def _road(self) -> str:
        if self._sees == "sky":
            return "not seen in the middle column"
        begins = f"from {self.bottom_range:.1f} m at the bottom" if math.isfinite(self.bottom_range) else "seen"
        known = ", ".join(f"{metres:g} m is row {row:.0f}" for metres, row in self.rows.items())
        return f"{begins}{'; ' if known else ''}{known} (middle column)"

    def _far(self, far: FarEnd) -> str:
        where = f"at ({far.place[0]:.1f}, {far.place[1]:.1f}) m, {far.distance:.0f} m away,"
        cost = f"a pixel is {metres_of(far.by_pixel)}, a tenth of a degree of pitch {metres_of(far.by_pitch)}"
        to = "no cell on the way is resolved" if far.resolved_to is None else f"resolved to {far.resolved_to:.0f} m"
        return f"{where} {cost}; {to}"


_UNSEEN = tuple(REASONS)[2:]


def plain(value: Any) -> Any:
    """Return a value as JSON has it: lists for tuples, None for what is no finite number."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value
