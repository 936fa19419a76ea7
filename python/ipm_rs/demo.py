"""The demo of the command line: a synthetic road through a real camera's calibration, and back to metres.

:func:`run` renders the road of :mod:`ipm_rs.scene`, warps it and measures; :func:`report` puts the result in words and
:func:`picture` draws it. Only :func:`picture` needs Pillow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs import BevGrid, Camera, Lut, scene
from ipm_rs.draw import _style as style
from ipm_rs.draw._axes import around, hatched
from ipm_rs.draw._style import text
from ipm_rs.files.images import require_pillow

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

CALIBRATION = {
    "extrinsic": {
        "x": 1.7,
        "y": 0.026239999999999368,
        "z": 1.212400000000026,
        "roll": 0.0,
        "pitch": 0.03842560000000292,
        "yaw": -0.009726800000000934,
    },
    "intrinsic": {
        "fx": 2263.54773399985,
        "fy": 2250.3728170599807,
        "u0": 1079.0175620000632,
        "v0": 515.006600600019,
    },
}
"""A front camera of the Cityscapes data set, 2048 x 1024 pixels: metres, radians, pixels."""

GRID: dict[str, Any] = {"x": (7.0, 50.0), "y": (-10.0, 10.0), "resolution": 0.05}

NEAR = 20.0
"""Where the near range ends and the far one begins, metres forward."""


@dataclass(frozen=True)
class Error:
    """How far a bird's-eye view is from the truth: absolute difference in grey levels of 255, and PSNR in dB."""

    median: float
    mean: float
    psnr: float

    @classmethod
    def between(cls, bev: NDArray[np.uint8], truth: NDArray[np.float32], cells: NDArray[np.bool_]) -> Error:
        """Return the error over the cells that are True, all channels alike; NaN without any."""
        if not cells.any():
            return cls(math.nan, math.nan, math.nan)
        difference = np.abs(bev[cells] - truth[cells].astype(np.float64))
        mean_square = np.mean(difference**2)
        psnr = 10.0 * math.log10(255.0**2 / mean_square) if mean_square > 0 else math.inf
        return cls(float(np.median(difference)), float(difference.mean()), psnr)


@dataclass(frozen=True)
class Result:
    """What the demo made and measured; times in seconds, errors against the analytic truth of the valid cells."""

    camera: Camera
    grid: BevGrid
    lut: Lut
    image: NDArray[np.uint8]
    bev: NDArray[np.uint8]
    mask: NDArray[np.bool_]
    build_time: float
    warp_time: float
    near: Error
    far: Error
    area_time: float
    near_area: Error
    far_area: Error

    @property
    def coverage(self) -> float:
        """Fraction of the cells that the camera sees."""
        return float(self.mask.mean())


def run(camera: Camera | None = None, grid: BevGrid | None = None) -> Result:
    """Render the road, warp it to the grid and compare with the truth.

    Parameters
    ----------
    camera : Camera, optional
        A pinhole; by default the one of :data:`CALIBRATION`.
    grid : BevGrid, optional
        The cells; by default those of :data:`GRID`.

    Returns
    -------
    Result
        The images and what was measured.
    """
    camera = Camera.from_cityscapes(CALIBRATION) if camera is None else camera
    grid = BevGrid(**GRID) if grid is None else grid
    image = scene.render(camera)
    lut, build_time = _timed(lambda: Lut(camera, grid), 5)
    bev, warp_time = _timed(lambda: lut.warp(image), 15)
    area, area_time = _timed(lambda: lut.warp(image, interpolation="area"), 15)
    truth, mask = scene.truth(grid), lut.mask
    is_near = grid.xy()[..., 0] < NEAR
    return Result(
        camera=camera,
        grid=grid,
        lut=lut,
        image=image,
        bev=bev,
        mask=mask,
        build_time=build_time,
        warp_time=warp_time,
        near=Error.between(bev, truth, mask & is_near),
        far=Error.between(bev, truth, mask & ~is_near),
        area_time=area_time,
        near_area=Error.between(area, truth, mask & is_near),
        far_area=Error.between(area, truth, mask & ~is_near),
    )


def report(result: Result) -> list[str]:
    """Say what was made, how long it took and how good it is, line by line."""
    (width, height), (rows, cols), (dx, dy) = result.camera.image_size, result.grid.shape, result.grid.resolution
    (x_min, x_max), (y_min, y_max) = result.grid.x, result.grid.y
    lines = [
        f"image     {width} x {height} pixels, 3 channels, uint8",
        f"grid      {rows} x {cols} cells of {dx:g} x {dy:g} m, x {x_min:g} to {x_max:g} m, y {y_min:g} to {y_max:g} m",
        f"Lut       built in {1e3 * result.build_time:.2f} ms",
        f"warp      {1e3 * result.warp_time:.2f} ms, bilinear (median of 15)",
        f"coverage  {100 * result.coverage:.1f} % of the cells are seen by the camera",
    ]
    for name, where, error in (
        ("near", f"x below {NEAR:g} m", result.near),
        ("far", f"x from {NEAR:g} m", result.far),
    ):
        lines.append(
            f"error     {name + ',':5} {where}: median {error.median:.2f}, mean {error.mean:.2f} grey levels, "
            f"PSNR {error.psnr:.1f} dB"
        )
    lines.append(
        f"area      {1e3 * result.area_time:.2f} ms, the mean of all that a cell covers: PSNR near "
        f"{result.near_area.psnr:.1f} dB, far {result.far_area.psnr:.1f} dB"
    )
    lines.append("          against the analytic road, averaged over each cell; far cells are blurred by the camera")
    return lines


def _timed(call: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """Return the answer of a call, and the median of its times in seconds after one call to warm up."""
    answer, times = call(), []
    for _ in range(repeats):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return answer, median(times)


# ---------------------------------------------------------------------------------------------------------------------
# The picture. Positions and sizes are pixels of the picture; its parts stand in fixed places.

_SIZE = (1920, 1172)
_LEFT, _PHOTO_TOP, _PHOTO_WIDTH = 56, 196, 1224
_BEV_LEFT, _BEV_TOP, _BEV_SIZE = 1446, 196, (400, 860)


def picture(result: Result) -> Image:
    """Draw the camera image and bird's-eye view side by side, with metre axes and what was measured.

    Parameters
    ----------
    result : Result
        From :func:`run`.

    Returns
    -------
    PIL.Image.Image
        RGB, 1920 x 1172 pixels.
    """
    require_pillow()
    from PIL import Image, ImageDraw

    page = Image.new("RGB", _SIZE, style.PAPER)
    draw = ImageDraw.Draw(page)
    text(draw, (_LEFT, 82), "From the camera image to a metric bird's-eye view", 46)
    text(draw, (_LEFT, 128), _subtitle(result), 25, style.MUTED)

    photo = _photo(result)
    text(draw, (_LEFT, _PHOTO_TOP - 14), "Camera image, the edge of the grid in orange", 27)
    page.paste(photo, (_LEFT, _PHOTO_TOP))
    _facts(draw, result, top=_PHOTO_TOP + photo.height + 52)

    text(draw, (_BEV_LEFT, _BEV_TOP - 14), "Bird's-eye view", 27)
    page.paste(_top_view(result), (_BEV_LEFT, _BEV_TOP))
    around(page, result.grid, (_BEV_LEFT, _BEV_TOP, *_BEV_SIZE), 5.0, 23)
    return page


def _subtitle(result: Result) -> str:
    x, y, z = result.camera.vehicle_from_camera[:3, 2]
    down = math.degrees(math.atan2(-z, math.hypot(x, y)))
    return (
        f"A synthetic road, rendered through a Cityscapes calibration ({result.camera.position[2]:.2f} m above the "
        f"road, looking {down:.1f}\N{DEGREE SIGN} down) and warped back by ipm_rs"
    )


def _photo(result: Result) -> Image:
    """Draw the camera image, scaled down, with the edge of the grid drawn in."""
    from PIL import Image, ImageDraw

    photo = Image.fromarray(result.image)
    (x_min, x_max), (y_min, y_max) = result.grid.x, result.grid.y
    corners = [(x_min, y_min), (x_min, y_max), (x_max, y_max), (x_max, y_min)]
    draw = ImageDraw.Draw(photo)
    for piece in result.camera.project_polyline(corners, ground=0.0, closed=True):
        draw.line([(u, v) for u, v in piece.tolist()], fill=style.ACCENT, width=5)
    width, height = photo.size
    return photo.resize((_PHOTO_WIDTH, round(_PHOTO_WIDTH * height / width)), Image.Resampling.LANCZOS)


def _top_view(result: Result) -> Image:
    """Draw the bird's-eye view at the size it has on the page, unseen cells hatched."""
    from PIL import Image, ImageDraw

    view = Image.fromarray(hatched(result.bev, result.mask)).resize(_BEV_SIZE, Image.Resampling.LANCZOS)
    ImageDraw.Draw(view).rectangle((0, 0, _BEV_SIZE[0] - 1, _BEV_SIZE[1] - 1), outline=style.ACCENT, width=3)
    return view


def _facts(draw: ImageDraw, result: Result, top: int) -> None:
    """Draw the table of what was measured, three columns under the camera image."""
    (width, height), (rows, cols), (dx, dy) = result.camera.image_size, result.grid.shape, result.grid.resolution
    giga = rows * cols / result.warp_time / 1e9
    facts = (
        ("Camera image", f"{width} x {height}", "RGB, 8 bit"),
        ("Grid", f"{rows} x {cols}", f"cells of {100 * dx:g} x {100 * dy:g} cm"),
        ("Seen by the camera", f"{100 * result.coverage:.1f} %", "of the cells; the rest is hatched"),
        ("Warp, bilinear", f"{1e3 * result.warp_time:.2f} ms", f"{giga:.2f} billion cells per second"),
        *(
            (
                f"Error, x {where}",
                f"{error.median:.1f} grey levels",
                f"PSNR {error.psnr:.1f} dB, by area {area.psnr:.1f} dB",
            )
            for where, error, area in (
                (f"below {NEAR:g} m", result.near, result.near_area),
                (f"from {NEAR:g} m", result.far, result.far_area),
            )
        ),
    )
    columns, gap, pitch = 3, 36, 148
    step = (_PHOTO_WIDTH + gap) // columns
    for index, (label, value, note) in enumerate(facts):
        left = _LEFT + index % columns * step
        level = top + index // columns * pitch
        draw.line((left, level - 14, left + step - gap, level - 14), fill=style.RULE, width=2)
        text(draw, (left, level + 18), label, 23, style.MUTED)
        text(draw, (left, level + 66), value, 40)
        text(draw, (left, level + 104), note, 23, style.MUTED)
