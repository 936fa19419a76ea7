"""A board on the road to a pose: rendered through lenses, counted either way, markers, and what is no board."""

from __future__ import annotations

import builtins

import cv2
import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import refine

SIZE = (800, 500)
K = np.array([[560.0, 0, 407], [0, 556, 237], [0, 0, 1]])
POSE = {"position": (1.6, 0.2, 1.3), "pitch": 0.3, "yaw": 0.05, "roll": -0.03}
CAMERA = ipm_rs.Camera.from_euler(K, image_size=SIZE, **POSE)
FISHEYE = ipm_rs.Camera.from_euler(
    np.diag([0.8, 0.8, 1]) @ K,
    image_size=SIZE,
    lens=ipm_rs.KannalaBrandt([0.03, -0.01, 0, 0]),
    **POSE,
)
AT, HEADING, SQUARE = (4.5, 0.4), 0.2, 0.25


def photograph(camera: ipm_rs.Camera, board: np.ndarray, counts: tuple[int, int], ground: float = 0.0) -> np.ndarray:
    """A picture of a print, 40 pixels a square and a margin of one, that lies on the road with its top ahead."""
    width, height = SIZE
    total = np.full((height, width), 4 * 110.0)
    # only the part that shows the board is looked at: a fifth of the picture
    half = (np.array(counts)[::-1] + 3) / 2 * SQUARE
    corners = np.array([(x, y) for x in (-half[0], half[0]) for y in (-half[1], half[1])])
    turn = np.array([[np.cos(HEADING), np.sin(HEADING)], [-np.sin(HEADING), np.cos(HEADING)]])
    seen = camera.project(np.column_stack([AT + corners @ turn, np.full(4, ground)]))[0]
    (left_end, top), (right_end, bottom) = seen.min(0).astype(int) - 20, seen.max(0).astype(int) + 20
    rows, columns = slice(max(top, 0), min(bottom, height)), slice(max(left_end, 0), min(right_end, width))
    u, v = np.meshgrid(np.arange(width)[columns], np.arange(height)[rows])
    part = np.zeros(u.size)
    for du, dv in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):
        uv = np.stack([u + du, v + dv], -1).reshape(-1, 2).astype(float)
        away = camera.ground_from_pixels(uv, ground=ground)[:, :2] - AT
        ahead = (away @ [np.cos(HEADING), np.sin(HEADING)]) / SQUARE
        left = (away @ [-np.sin(HEADING), np.cos(HEADING)]) / SQUARE
        column = ((counts[0] - 1) / 2 - left + 2) * 40
        row = ((counts[1] - 1) / 2 - ahead + 2) * 40
        with np.errstate(invalid="ignore"):
            there = (column >= 0) & (row >= 0) & (column < board.shape[1]) & (row < board.shape[0])
        shown = board[np.where(there, row, 0).astype(int), np.where(there, column, 0).astype(int)]
        part += np.where(there, shown, 110)
    total[rows, columns] = part.reshape(u.shape)
    noise = np.random.default_rng(0).normal(0, 1.5, total.shape)
    return (total / 4 + noise).clip(0, 255).reshape(height, width).astype(np.uint8)


def chessboard(counts: tuple[int, int]) -> np.ndarray:
    """Squares, one more than corners each way, in a white margin of one."""
    rows, columns = np.mgrid[: (counts[1] + 3) * 40, : (counts[0] + 3) * 40] // 40
    inside = (rows > 0) & (columns > 0) & (rows < counts[1] + 2) & (columns < counts[0] + 2)
    return np.where(inside & ((rows + columns) % 2 == 0), 20, 235)


def off(fit: refine.PoseFit, camera: ipm_rs.Camera) -> tuple[float, float]:
    """By how many metres and degrees a pose is off."""
    turn = fit.camera.vehicle_from_camera[:3, :3].T @ camera.vehicle_from_camera[:3, :3]
    angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    return float(np.linalg.norm(fit.camera.position - camera.position)), float(angle)


@pytest.mark.parametrize(
    ("camera", "counts"), [(CAMERA, (8, 5)), (FISHEYE, (8, 5)), (CAMERA, (6, 6)), (CAMERA, (5, 8))]
)
def test_a_chessboard(camera: ipm_rs.Camera, counts: tuple[int, int]):
    image = photograph(camera, chessboard(counts), counts)
    fit = refine.from_board(
        np.repeat(image[..., None], 3, axis=2),
        corners=counts,
        square=SQUARE,
        at=AT,
        heading=HEADING,
        K=camera.intrinsics,
        lens=camera.lens,
    )
    metres, degrees = off(fit, camera)
    assert fit.used.all() and np.abs(fit.residuals).max() < 1
    assert metres < 0.02 and degrees < 0.15
    assert fit.camera.image_size == SIZE and (fit.ground_deviation([(10.0, 0.0)]) < 0.2).all()


def test_a_charuco_board_half_of_which_is_hidden():
    counts = (7, 5)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard((8, 6), SQUARE, 0.75 * SQUARE, dictionary)
    print_of_it = np.pad(board.generateImage((320, 240)), 40, constant_values=255)
    image = photograph(CAMERA, print_of_it, counts)
    arguments = {"corners": counts, "square": SQUARE, "at": AT, "heading": HEADING, "K": K, "dictionary": "DICT_4X4_50"}
    fit = refine.from_board(image, **arguments)
    metres, degrees = off(fit, CAMERA)
    assert metres < 0.03 and degrees < 0.3 and len(fit.used) > 20
    image[:, :350] = 110
    fit = refine.from_board(image.astype(np.uint16) * 200, **arguments)
    metres, degrees = off(fit, CAMERA)
    assert metres < 0.1 and degrees < 1 and 6 <= len(fit.used) < 20


def test_what_is_no_board():
    counts = (8, 5)
    image = photograph(CAMERA, chessboard(counts), counts)
    right = {"corners": counts, "square": SQUARE, "at": AT, "K": K}
    with refuses(ipm_rs.ArgumentError, "squares", "corners=(8, 5)"):
        refine.from_board(image[100:450, 150:700], **right | {"corners": (9, 6)})
    with refuses(ipm_rs.ArgumentError, "found none", "margin"):
        refine.from_board(np.full((60, 80), 90, np.uint8), **right)
    for size in ((1, 1), (12, 300), (300, 15)):
        with refuses(ipm_rs.ArgumentError, "found none"):
            refine.from_board(np.full(size, 90, np.uint8), **right)
    with refuses(ipm_rs.ArgumentError, "found 0 of its corners"):
        refine.from_board(image[::4, ::4], **right, dictionary="DICT_4X4_50")
    for wrong in ({"square": 250}, {"square": 0}, {"corners": (1, 5)}, {"corners": (200, 5)}, {"at": (1, 2, 3)}):
        with refuses(ipm_rs.ArgumentError, next(iter(wrong)), "expected"):
            refine.from_board(image, **right | wrong)
    for name in ("DICT_9X9", "error", "DICT_ARUCO_ORIGINAL\0"):
        with refuses(ipm_rs.ArgumentError, "dictionary"):
            refine.from_board(image, **right, dictionary=name)
    with refuses(ipm_rs.ArgumentError, "marker"):
        refine.from_board(image, **right, dictionary="DICT_4X4_50", marker=SQUARE)
    with refuses(ipm_rs.ArgumentError, "dictionary"):
        refine.from_board(image, **right | {"corners": (20, 20)}, dictionary="DICT_4X4_50")
    with refuses(ipm_rs.ArgumentTypeError, "corners"):
        refine.from_board(image, **right | {"corners": (8.5, 5)})
    with refuses(ipm_rs.DtypeError, "float64"):
        refine.from_board(image.astype(float), **right)
    with refuses(ipm_rs.ImageError, "shape"):
        refine.from_board(image[0], **right)


def test_without_opencv_the_extra_is_named(monkeypatch: pytest.MonkeyPatch):
    found = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "cv2":
            raise ImportError(name)
        return found(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with refuses(ipm_rs.MissingExtraError, "ipm-rs[board]"):
        refine.from_board(np.zeros((9, 9), np.uint8), corners=(3, 3), square=1, at=(1, 0), K=K)
