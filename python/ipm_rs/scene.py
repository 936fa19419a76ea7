"""A painted road whose colour is known at every point: ground truth for the demo, the tests and the benches.

The road is the plane z = ``ground`` of the vehicle frame (x forward, y left, metres). :func:`colour` gives the
colour of any point, :func:`render` photographs the road through a pinhole camera, and :func:`truth` averages it over
the cells of a bird's-eye grid. The camera arithmetic is written out here, on purpose: a picture that came from the
code under test could not show a mistake in it.

The scene has no mirror image and no two equal channels, so that a flipped axis or swapped channels are seen. Colours
are averaged as they are stored (8-bit display values, not linear light), which is also what a warp interpolates.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ipm_rs.errors import ArgumentError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ipm_rs import BevGrid, Camera


class Material(NamedTuple):
    """A surface: its mean colour (RGB, 0 to 255) and how strongly the grain darkens and brightens each channel."""

    colour: tuple[float, float, float]
    grain: tuple[float, float, float]


MATERIALS = (
    Material((96, 122, 62), (24, 26, 15)),  # 0 grass
    Material((164, 158, 146), (9, 9, 9)),  # 1 pavement
    Material((188, 184, 178), (7, 7, 7)),  # 2 kerb
    Material((86, 89, 96), (15, 15, 16)),  # 3 asphalt
    Material((74, 77, 84), (10, 10, 11)),  # 4 asphalt, a newer patch
    Material((142, 66, 54), (17, 11, 10)),  # 5 cycle lane
    Material((232, 233, 228), (9, 9, 9)),  # 6 white paint
    Material((232, 184, 44), (10, 9, 7)),  # 7 yellow paint
    Material((62, 60, 58), (9, 9, 9)),  # 8 iron
)
GRASS, PAVEMENT, KERB, ASPHALT, PATCH, CYCLE_LANE, WHITE, YELLOW, IRON = range(len(MATERIALS))

GRID_COLOUR = (40.0, 196.0, 255.0)
GRID_LINES = ((1.0, 0.025, 0.28), (5.0, 0.05, 0.60))
"""Lines of the metre grid: spacing (m), width (m), opacity."""

ROAD = (-3.6, 5.6)
"""The carriageway between the kerbs, y in metres, right then left."""

ZEBRA = (17.2, 19.8)
"""The zebra crossing, x in metres."""

LABEL_Y = -2.72
"""Centre of the painted distances, y in metres."""

ZENITH_SKY, HORIZON_SKY, HILLS = (112.0, 160.0, 214.0), (220.0, 230.0, 238.0), (136.0, 160.0, 172.0)

HAZE = (60.0, 240.0)
"""Ground distance (m) at which the haze begins, and where nothing else is left."""

_DIGITS = (
    "01110 10001 10001 10001 10001 10001 01110",
    "00100 01100 00100 00100 00100 00100 01110",
    "01110 10001 00001 00110 01000 10000 11111",
    "11110 00001 00001 01110 00001 00001 11110",
    "00010 00110 01010 10010 11111 00010 00010",
    "11111 10000 11110 00001 00001 10001 01110",
)
_PIXEL = (0.24, 0.115)  # one font pixel on the road in x and y, metres: stretched, as real road lettering is
_SAMPLES_PER_CHUNK = 400_000  # keeps the temporaries of a chunk within a few MB; larger chunks measured no faster


def colour(x: ArrayLike, y: ArrayLike) -> NDArray[np.float32]:
    """Return the colour of the road at ground points.

    Parameters
    ----------
    x, y : array_like
        Metres forward and metres left, of shapes that broadcast.

    Returns
    -------
    ndarray, shape (..., 3), float32
        RGB from 0 to 255.
    """
    x, y = np.asarray(x, np.float32), np.asarray(y, np.float32)
    material = _material(x, y)
    mean, amplitude = (np.array(column, np.float32) for column in zip(*MATERIALS, strict=True))
    rgb = mean.take(material, axis=0)
    rgb += amplitude.take(material, axis=0) * _grain(x, y)[..., None]
    for spacing, width, opacity in GRID_LINES:
        line = _near_multiple(x, spacing, width) | _near_multiple(y, spacing, width)
        rgb[line] += np.float32(opacity) * (np.array(GRID_COLOUR, np.float32) - rgb[line])
    return np.clip(rgb, 0.0, 255.0, out=rgb)


def render(camera: Camera, *, ground: float = 0.0) -> NDArray[np.uint8]:
    """Photograph the road through a pinhole camera.

    Every pixel is the mean over its area, from a regular pattern that gets denser where a pixel covers more road.

    Parameters
    ----------
    camera : Camera
        A pinhole above the road.
    ground : float
        Height of the road in the vehicle frame, metres.

    Returns
    -------
    ndarray, shape (height, width, 3), uint8
        RGB, pixel (0, 0) centred on image coordinates (0, 0).

    Raises
    ------
    ArgumentError
        The camera has a lens model, or does not stand above the road.
    """
    if camera.lens is not None:
        raise ArgumentError(f"camera: expected a pinhole (lens None), got lens {camera.lens!r}; render its pinhole")
    view = _View(camera, ground)
    if not view.position[2] > 0:
        raise ArgumentError(f"camera: expected it above the road, got {view.position[2]} m above; check ground")
    image = np.empty((view.height, view.width, 3), np.uint8)

    def paint(rows: slice) -> None:
        image[rows] = view.mean_colour(rows)

    _run_all(paint, view.chunks())
    return image


def truth(grid: BevGrid, *, samples: int = 5) -> NDArray[np.float32]:
    """Return what a perfect bird's-eye view shows: the mean road colour around each sample of the grid.

    The mean is over a rectangle of one cell's size with the cell's sample in its middle; with ``sample_at="center"``
    that is the cell itself.

    Parameters
    ----------
    grid : BevGrid
        The cells.
    samples : int
        Points along each side of the rectangle.

    Returns
    -------
    ndarray, shape (rows, cols, 3), float32
        RGB from 0 to 255.
    """
    xy = np.asarray(grid.xy())
    rows, cols = xy.shape[:2]
    # Rows have one x and columns one y, so that colour() can be given two thin arrays instead of two full ones.
    x, y = (
        (centre[:, None] + size * _offsets(samples)).ravel()
        for centre, size in zip((xy[:, 0, 0], xy[0, :, 1]), grid.resolution, strict=True)
    )
    mean = np.empty((rows, cols, 3), np.float32)

    def average(chunk: slice) -> None:
        fine = colour(x[chunk.start * samples : chunk.stop * samples, None], y[None, :])
        mean[chunk] = _box_mean(fine, samples, samples)

    step = max(1, _SAMPLES_PER_CHUNK // (cols * samples**2))
    _run_all(average, (slice(row, min(row + step, rows)) for row in range(0, rows, step)))
    return mean


class _View:
    """Rays of a pinhole camera onto the road, for blocks of image rows."""

    def __init__(self, camera: Camera, ground: float) -> None:
        self.width, self.height = camera.image_size
        vehicle_from_camera = np.asarray(camera.vehicle_from_camera, np.float64)
        self.ray_from_pixel = vehicle_from_camera[:3, :3] @ np.linalg.inv(camera.intrinsics)
        self.position = vehicle_from_camera[:3, 3] - (0.0, 0.0, ground)

    def rays(self, u: NDArray[np.float64], v: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Return components x, y and z of the rays through pixels (u, v), in the vehicle frame, not normalised."""
        x, y, z = (a * u + b * v + c for a, b, c in self.ray_from_pixel)
        return x, y, z

    def chunks(self) -> Iterator[slice]:
        """Yield blocks of rows of about equal work."""
        row = 0
        while row < self.height:
            across, down = self.density(row)
            stop = min(self.height, row + max(1, _SAMPLES_PER_CHUNK // (self.width * across * down)))
            yield slice(row, stop)
            row = stop

    def density(self, row: int) -> tuple[int, int]:
        """Return samples per pixel across and down an image row: one per 6 cm of road, at least 2, at most 4 and 16."""
        u = np.linspace(0.0, self.width - 1.0, 5)
        x, y, z = self.rays(np.stack([u, u + 1.0, u]), np.array([[row], [row], [row + 1.0]]))
        if not (z < 0).any():
            return 2, 2
        with np.errstate(invalid="ignore"):
            hit = (x + 1j * y) * (self.position[2] / np.where(z < 0, -z, np.nan))
        across, down = (np.nan_to_num(abs(hit[i] - hit[0]), nan=np.inf).max() / 0.06 for i in (1, 2))
        return int(np.clip(np.ceil(across), 2, 4)), int(np.clip(np.ceil(down), 2, 16))

    def mean_colour(self, rows: slice) -> NDArray[np.uint8]:
        """Return the pixels of some rows, (rows, width, 3) uint8."""
        across, down = self.density(rows.start)
        u = (np.arange(self.width)[:, None] + _offsets(across)).reshape(1, -1)
        v = (np.arange(rows.start, rows.stop)[:, None] + _offsets(down)).reshape(-1, 1)
        x, y, z = self.rays(u, v)
        road = z < 0
        if road.all():  # most rows: spare them the copies that masks make
            rgb = self._road(x, y, z)
        else:
            rgb = np.empty((*z.shape, 3), np.float32)
            rgb[road] = self._road(x[road], y[road], z[road])
            rgb[~road] = _sky(x[~road], y[~road], z[~road])
        return np.rint(_box_mean(rgb, down, across)).astype(np.uint8)

    def _road(self, x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float32]:
        scale = self.position[2] / -z
        along, across = x * scale, y * scale
        start, end = HAZE
        haze = ((np.hypot(along, across) - start) / (end - start)).astype(np.float32)
        np.clip(haze, 0.0, 1.0, out=haze)
        # Beyond the haze the points may be kilometres away: bring them near, they are invisible.
        hidden = haze >= 1.0
        along[hidden] = across[hidden] = 0.0
        rgb = colour(along + self.position[0], across + self.position[1])
        if haze.any():
            rgb += np.sqrt(haze)[..., None] * (np.array(HORIZON_SKY, np.float32) - rgb)
        return rgb


def _material(x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the index into MATERIALS at each point, later paint over earlier."""
    material = np.full(np.broadcast_shapes(x.shape, y.shape), GRASS, np.uint8)

    def paint(what: int, where: NDArray[np.bool_]) -> None:
        np.copyto(material, np.uint8(what), where=where)

    right, left = ROAD
    paint(PAVEMENT, _between(y, right - 2.4, left + 2.2))
    paint(KERB, _between(y, right - 0.2, left + 0.2))
    paint(ASPHALT, _between(y, right, left))
    paint(PATCH, _between(x, 27.4, 33.1) & _between(y, 2.3, 4.6))
    paint(CYCLE_LANE, _between(y, right, -1.85))
    for cover_x, cover_y in ((11.4, 2.9), (23.5, -0.7), (37.5, 3.4)):
        square = (x - cover_x) ** 2 + (y - cover_y) ** 2
        paint(IRON, square < 0.42**2)
        paint(ASPHALT, _between(square, 0.28**2, 0.34**2))

    start, end = ZEBRA
    clear = (x < start - 1.0) | (x > end + 0.5)
    paint(WHITE, _between(y, -1.9, -1.7) & clear)
    paint(WHITE, _between(y, 5.3, 5.42) & clear)
    paint(YELLOW, _between(y, 1.68, 1.83) & clear & (np.mod(x, 6.0) < 3.0))
    paint(WHITE, _between(x, start - 1.0, start - 0.6) & _between(y, -1.7, 1.68))
    paint(
        WHITE, _between(x, start, end) & _between(y, right + 0.35, left - 0.35) & (np.mod(y - right - 0.35, 1.0) < 0.5)
    )
    for arrow_x in (8.8, 26.0, 41.0):
        paint(WHITE, _arrow(x - np.float32(arrow_x), y))
    paint(WHITE, _label(x, y))
    return material


def _arrow(x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Tell where a straight-on-or-left arrow, 5 m long from x = 0, is painted."""
    ahead = (_between(x, 0.0, 3.2) & (abs(y) < 0.12)) | _between(x, 3.2, 5.0) & (abs(y) < 0.25 * (5.0 - x))
    branch = _between(x, 1.1, 1.5) & _between(y, 0.0, 0.5)
    head = _between(y, 0.5, 1.1) & (abs(x - 1.3) < 1.2 * (1.1 - y))
    return ahead | branch | head


def _label(x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Tell where the painted distances are: 10, 15, ... 50, each just beyond its grid line, upright to the driver."""
    glyphs = np.array([[list(row) for row in digit.split()] for digit in _DIGITS]) == "1"
    rows, columns = glyphs.shape[1], 2 * glyphs.shape[2] + 1
    step_x, step_y = np.float32(_PIXEL[0]), np.float32(_PIXEL[1])
    five = np.floor(x / np.float32(5.0)).astype(np.int32)
    row = rows - 1 - np.floor((x - five * np.float32(5.0) - np.float32(0.25)) / step_x).astype(np.int32)
    column = np.floor((np.float32(LABEL_Y) - y) / step_y + np.float32(columns / 2)).astype(np.int32)
    inside = _between(five, 2, 11) & _between(row, 0, rows) & _between(column, 0, columns)
    if not inside.any():
        return inside
    painted = np.zeros((11, rows, columns), bool)
    for number in range(2, 11):
        tens, units = divmod(5 * number, 10)
        painted[number] = np.hstack([glyphs[tens], np.zeros((rows, 1), bool), glyphs[units]])
    five, row, column = np.broadcast_arrays(five, row, column)
    inside[inside] = painted[five[inside], row[inside], column[inside]]
    return inside


def _grain(x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the surface texture, about -1 to 1: grain of some 3 cm, wear of some metres, tyre tracks."""
    tile = _tile()
    mask = tile.shape[0] - 1

    def look_up(per_metre: float) -> NDArray[np.float32]:
        # The offset makes every index positive, so that the integer cast is a floor.
        column = ((x + 512.0) * np.float32(per_metre)).astype(np.int32) & mask
        row = ((y + 512.0) * np.float32(per_metre)).astype(np.int32) & mask
        return tile.take(column * np.int32(tile.shape[0]) + row)

    grain = np.float32(0.6) * look_up(100.0)
    grain += np.float32(0.45) * look_up(9.7)
    off_track = abs(abs(y - np.where(y > 1.75, np.float32(3.5), np.float32(0.0))) - np.float32(0.8))
    grain -= (
        np.float32(0.5) * np.clip(np.float32(1.0) - off_track / np.float32(0.35), 0.0, 1.0) * _between(y, -1.7, 5.0)
    )
    return grain


@cache
def _tile() -> NDArray[np.float32]:
    """Make a smooth, periodic noise tile, (1024, 1024) float32 within -1 to 1; at 100 per metre it spans 10 m."""
    size = 1024
    index = np.arange(size * size, dtype=np.uint32)
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):  # an integer hash: the same on every machine
        index ^= index >> np.uint32(shift)
        index *= np.uint32(factor)
    index ^= index >> np.uint32(16)
    noise = index.reshape(size, size).astype(np.float32) / np.float32(2**31) - np.float32(1.0)
    spectrum = np.fft.rfft2(noise)
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    spectrum *= np.exp(-((frequency / 0.16) ** 2))  # wavelengths below about 5 samples are gone
    spectrum[0, 0] = 0.0
    smooth = np.fft.irfft2(spectrum, s=(size, size))
    return np.clip(smooth / (2.5 * smooth.std()), -1.0, 1.0).astype(np.float32)


def _sky(x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the colour of rays above the horizon: a gradient behind a line of hills."""
    elevation = (z / np.hypot(x, y)).astype(np.float32)[..., None]
    azimuth = np.arctan2(y, x)
    hills = (
        0.012 + 0.006 * np.sin(9.0 * azimuth + 1.0) + 0.004 * np.sin(23.0 * azimuth) + 0.002 * np.sin(61.0 * azimuth)
    )
    low, high = np.array(HORIZON_SKY, np.float32), np.array(ZENITH_SKY, np.float32)
    rgb = low + np.clip(elevation / 0.22, 0.0, 1.0) * (high - low)
    height = elevation / hills[..., None].astype(np.float32)
    misty = low + np.clip(height, 0.0, 1.0) * (np.array(HILLS, np.float32) - low)
    return np.where(height < 1.0, misty, rgb)


def _between(value: NDArray[Any], low: float, high: float) -> NDArray[np.bool_]:
    return (value >= low) & (value < high)


def _near_multiple(value: NDArray[np.float32], spacing: float, width: float) -> NDArray[np.bool_]:
    half = np.float32(0.5 * width)
    return np.mod(value + half, np.float32(spacing)) < np.float32(2.0) * half


def _offsets(samples: int) -> NDArray[np.float64]:
    """Return the middles of ``samples`` equal parts of the interval from -0.5 to 0.5."""
    return (np.arange(samples) + 0.5) / samples - 0.5


def _box_mean(fine: NDArray[np.float32], down: int, across: int) -> NDArray[np.float32]:
    rows, columns, channels = fine.shape
    return fine.reshape(rows // down, down, columns // across, across, channels).mean(axis=(1, 3))


def _run_all(work: Callable[[slice], None], chunks: Iterator[slice]) -> None:
    """Call ``work`` on each chunk, on the CPUs there are: NumPy releases the interpreter lock in its loops."""
    with ThreadPoolExecutor(max_workers=min(8, os.cpu_count() or 1)) as pool:
        for _ in pool.map(work, chunks):
            pass
