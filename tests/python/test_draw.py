"""Metre axes and overlays: every line stands where the calibration says, and the view itself is not touched."""

from __future__ import annotations

import builtins

import numpy as np
import pytest
from helpers import refuses
from PIL import Image

import ipm_rs
from ipm_rs import draw
from ipm_rs.draw import _style as style

SIZE = (320, 200)
CAMERA = ipm_rs.Camera.from_euler(
    [[260.0, 0, 150], [0, 255, 90], [0, 0, 1]], image_size=SIZE, position=(1.0, 0.2, 1.5), pitch=0.2, roll=0.03
)
FISHEYE = ipm_rs.Camera.from_euler(
    [[90.0, 0, 150], [0, 90, 99], [0, 0, 1]],
    image_size=SIZE,
    position=(1.0, 0.2, 1.5),
    pitch=0.5,
    lens=ipm_rs.KannalaBrandt([0.05, 0, 0, 0]),
)
GRID = ipm_rs.BevGrid(x=(4, 24), y=(-6, 4), resolution=0.1)
VIEW = np.random.default_rng(0).integers(0, 256, (*GRID.shape, 3), dtype=np.uint8)


def colour(name: str) -> tuple[int, ...]:
    return tuple(int(name[k : k + 2], 16) for k in (1, 3, 5))


def where(picture: Image.Image, name: str) -> np.ndarray:
    return (np.asarray(picture) == colour(name)).all(axis=2)


def corner_of(page: Image.Image, view: np.ndarray) -> tuple[int, int]:
    """Where on a page a view stands: (row, column), found by its pixels."""
    pixels = np.asarray(page)
    for row in range(pixels.shape[0] - view.shape[0] + 1):
        for column in range(pixels.shape[1] - view.shape[1] + 1):
            if (pixels[row, column] == view[0, 0]).all() and np.array_equal(
                pixels[row : row + view.shape[0], column : column + view.shape[1]], view
            ):
                return row, column
    raise AssertionError("the view is not on the page")


def test_axes_leave_the_view_as_it_is_and_tick_whole_metres():
    page = draw.axes(VIEW, GRID, step=5)
    top, left = corner_of(page, VIEW)
    ink = where(page, style.INK)
    beside = ink[:, left - 4]  # what crosses the column just left of the view are ticks
    rows = [top + round((24 - x) / 0.1) for x in (20, 15, 10, 5)]
    assert beside[rows].all() and not beside[[row + 10 for row in rows]].any()
    below = ink[top + VIEW.shape[0] + 3]
    columns = [left + round((4 - y) / 0.1) for y in (0, -5)]
    assert below[columns].all() and not below[[column + 10 for column in columns]].any()


def test_a_frame_of_a_video_is_not_drawn_on_by_the_next():
    one, other = draw.axes(VIEW, GRID), draw.axes(VIEW[::-1].copy(), GRID)
    assert np.array_equal(np.asarray(one), np.asarray(draw.axes(VIEW, GRID)))
    assert not np.array_equal(np.asarray(one), np.asarray(other))


def test_axes_of_cells_that_are_not_square_have_equal_metres():
    grid = ipm_rs.BevGrid(x=(0, 8), y=(-2, 2), resolution=(0.2, 0.1))
    margins = np.subtract(draw.axes(np.zeros((40, 40), np.uint8), grid).size, (40, 80))
    other = np.subtract(draw.axes(np.zeros((40, 40), np.uint8), grid, scale=25).size, (100, 200))
    assert (margins == other).all() and (margins > 20).all() and (margins < 150).all()


def test_masks_hatch_and_veil():
    mask, resolved = np.ones(GRID.shape, bool), np.ones(GRID.shape, bool)
    mask[:50], resolved[50:100] = False, False
    page = np.asarray(draw.axes(VIEW, GRID, mask=mask, resolved=resolved))
    top, left = corner_of(Image.fromarray(page), VIEW[100:])
    view = page[top - 100 : top + 100, left : left + 100].astype(int)
    assert {tuple(pixel) for row in view[:50].tolist() for pixel in row} == {style.UNSEEN, style.HATCH}
    assert 0 < abs(view[50:100] - VIEW[50:100]).mean() < 90
    assert np.corrcoef(view[50:100].ravel(), VIEW[50:100].ravel())[0, 1] > 0.8  # still to be seen


@pytest.mark.parametrize("camera", [CAMERA, FISHEYE])
def test_overlay_draws_the_metres_where_the_camera_sees_them(camera: ipm_rs.Camera):
    photo = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    seen = draw.overlay(photo, camera, GRID, spacing=5, labels=False, horizon=False, outline=False)
    yellow = where(seen, style.METRES)
    lines = [np.column_stack([np.full(400, x), np.linspace(-6, 4, 400)]) for x in (5, 10, 15, 20)]
    lines += [np.column_stack([np.linspace(4, 24, 400), np.full(400, y)]) for y in (-5, 0)]
    near = np.zeros(yellow.shape, bool)
    for line in lines:
        uv, _, valid = camera.project(line)
        u, v = np.rint(uv[valid]).astype(int).T
        beside = sum(np.roll(yellow, (dv, du), (0, 1)) for dv in (-1, 0, 1) for du in (-1, 0, 1)) > 0
        assert beside[v, u].mean() > 0.98
        for dv in (-1, 0, 1):
            for du in (-1, 0, 1):
                near[np.clip(v + dv, 0, SIZE[1] - 1), np.clip(u + du, 0, SIZE[0] - 1)] = True
    assert yellow.sum() > 200 and near[yellow].mean() > 0.97


def test_overlay_draws_horizon_and_outline():
    photo = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    blue = where(draw.overlay(photo, CAMERA), style.HORIZON)
    (line,) = CAMERA.horizon()
    for u, v in line:
        row = np.flatnonzero(blue[:, round(np.clip(u, 1, SIZE[0] - 2))])
        assert abs(row.mean() - v) < 1.5
    orange = where(draw.overlay(photo, CAMERA, GRID), style.ACCENT)
    uv, _, valid = CAMERA.project([(24.0, 0.0), (4.0, 0.0)])
    for (u, v), inside in zip(uv, valid, strict=True):
        assert inside and orange[round(v) - 2 : round(v) + 3, round(u)].any()
    assert np.array_equal(photo, np.full_like(photo, 90))


def test_overlay_follows_a_road_of_any_shape():
    photo = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    hill = ipm_rs.HeightMap(np.linspace(0, 1, 30)[:, None] * np.ones(30), origin=(0, -15), spacing=1.0)
    pictures = [
        np.asarray(draw.overlay(photo, CAMERA, GRID, ground=g))
        for g in (0.0, ipm_rs.Plane.from_angles(slope=0.05), hill)
    ]
    assert not np.array_equal(pictures[0], pictures[1]) and not np.array_equal(pictures[1], pictures[2])
    under = ipm_rs.Camera.from_euler(CAMERA.intrinsics, image_size=SIZE, position=(1.0, 0.2, 0.0), pitch=0.1)
    draw.overlay(photo, under, GRID)  # a road through the camera has an image without end


@pytest.mark.parametrize(
    ("pixels", "expected"),
    [
        (np.array([[0, 7, 255]], np.uint8), [[[0] * 3, [7] * 3, [255] * 3]]),
        (np.array([[True, False]]), [[[255] * 3, [0] * 3]]),
        (np.array([[[1, 2, 3, 4]]], np.uint8), [[[1, 2, 3]]]),
        (np.array([[[9, 4]]], np.uint8), [[[9, 9, 9]]]),
        (np.array([[0.0, np.nan, 2.0]]), [[[0] * 3, [0] * 3, [255] * 3]]),
        (np.array([[1000, 3000]], np.uint16), [[[0] * 3, [255] * 3]]),
        (np.full((1, 1), np.nan), [[[0] * 3]]),
        (np.array([[-1.7e308, 1.7e308]]), None),
    ],
)  # fmt: skip
def test_to_image(pixels, expected):
    found = np.asarray(draw.to_image(pixels))
    assert found.shape == (*pixels.shape[:2], 3)
    assert expected is None or np.abs(found.astype(int) - expected).max() <= 5


def test_an_image_of_pillow_is_taken_too():
    image = Image.fromarray(VIEW)
    assert np.array_equal(np.asarray(draw.to_image(image)), VIEW)
    assert np.array_equal(np.asarray(draw.axes(image, GRID)), np.asarray(draw.axes(VIEW, GRID)))


def test_wrong_arguments_are_told():
    with refuses(ipm_rs.ImageError, "200 rows x 100 columns", "100 x 200"):
        draw.axes(VIEW.transpose(1, 0, 2), GRID)
    with refuses(ipm_rs.ImageError, "mask", "a single value"):
        draw.axes(VIEW, GRID, mask=np.True_)
    with refuses(ipm_rs.DtypeError, "mask", "float64"):
        draw.axes(VIEW, GRID, mask=np.ones(GRID.shape))
    with refuses(ipm_rs.ImageError, "320x200", "64x48", "resized"):
        draw.overlay(np.zeros((48, 64), np.uint8), CAMERA)
    for wrong in ({"scale": 0}, {"scale": 1e9}, {"scale": np.nan}, {"step": 0}, {"step": 1e-9}, {"font_size": 1}):
        with refuses(ipm_rs.ArgumentError, next(iter(wrong)), "expected"):
            draw.axes(VIEW, GRID, **wrong)
    for wrong in ({"spacing": -1}, {"spacing": 1e-6}, {"line_width": 0}, {"line_width": np.inf}):
        with refuses(ipm_rs.ArgumentError, next(iter(wrong)), "expected"):
            draw.overlay(np.zeros(SIZE[::-1], np.uint8), CAMERA, GRID, **wrong)
    with refuses(ipm_rs.ArgumentTypeError, "title"):
        draw.axes(VIEW, GRID, title=7)
    with refuses(ipm_rs.ArgumentTypeError, "grid", "tuple"):
        draw.axes(VIEW, (1, 2))
    with refuses(ipm_rs.ArgumentTypeError, "camera"):
        draw.overlay(VIEW, GRID)
    with refuses(ipm_rs.DtypeError, "pixels"):
        draw.to_image([["a"]])
    with refuses(ipm_rs.ImageError, "pixels"):
        draw.to_image(np.zeros((0, 4)))


def test_without_pillow_the_extra_is_named(monkeypatch: pytest.MonkeyPatch):
    found = builtins.__import__

    def without(name, *args, **kwargs):
        if name.startswith("PIL"):
            raise ImportError(name)
        return found(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    for call in (lambda: draw.axes(VIEW, GRID), lambda: draw.overlay(VIEW, CAMERA), lambda: draw.to_image(VIEW)):
        with refuses(ipm_rs.MissingExtraError, "ipm-rs[cli]"):
            call()


def test_ticks():
    assert style.ticks(7, 50) == [10, 15, 20, 25, 30, 35, 40, 45, 50]
    assert style.ticks(-10, 10) == [-10, -5, 0, 5, 10]
    assert [style.nice_step(43, 10), style.nice_step(20, 10), style.nice_step(0.3, 4)] == [5, 2, 0.1]
    assert [style.tick_label(v) for v in (-0.0, 0.1 * 3, 10.0)] == ["0", "0.3", "10"]
