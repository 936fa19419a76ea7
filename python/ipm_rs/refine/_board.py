"""The pose of a camera from one picture of a chessboard or ChArUco board that lies on the road.

OpenCV finds the corners (extra ``board``); the pose is that of `from_ground_points`. A chessboard looks the same
when it is turned by half a turn, a square one by a quarter, so its corners allow several poses around it: the camera is
taken to stand on the vehicle's side of the board. A ChArUco board says itself how it lies.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ipm_rs._arguments import array_of, number_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError, DtypeError, ImageError, MissingExtraError
from ipm_rs.refine._points import PoseFit, from_ground_points

__all__ = ["from_board"]

_MOST = 100
#: Pixels along the shorter side of the smallest picture that may show four squares; OpenCV 5's finder fails up to 12.
_SMALLEST = 16
_FEWEST_CHARUCO = 6


def from_board(
    image: ArrayLike,
    *,
    corners: Sequence[int],
    square: float,
    at: Sequence[float],
    K: ArrayLike,
    lens: Any = None,
    heading: float = 0.0,
    ground: float = 0.0,
    dictionary: str | None = None,
    marker: float | None = None,
    tolerance: float = 4.0,
) -> PoseFit:
    """Find the pose of a camera from a picture of a board that lies flat on the road.

    The larger the board in the picture, and the farther it reaches ahead, the better: `ground_deviation` of the result
    says what the pose is worth at a distance. Several boards' corners go into `from_ground_points` together.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        The raw picture, uint8 or uint16.
    corners : (int, int)
        How many inner corners, where four squares meet, it has across and along: one less than squares. "Along" is the
        direction of `heading`, away from the vehicle; of a ChArUco board from the bottom of its print to the top.
    square : float
        Side of a square, metres.
    at : (float, float)
        (x, y) of the board's middle in the vehicle frame, metres.
    K : (3, 3) array_like
        Intrinsic matrix, pixels.
    lens : lens, optional
        The lens; a pinhole if not given.
    heading : float
        By how much the board is turned to the left, radians.
    ground : float
        z of the board, metres.
    dictionary : str, optional
        The markers of a ChArUco board, by OpenCV's name: "DICT_4X4_50". A chessboard if not given.
    marker : float, optional
        Side of a ChArUco marker, metres; 0.75 of a square if not given.
    tolerance : float
        Corners that are farther off than this, pixels, are taken for mistakes.

    Returns
    -------
    PoseFit
        The camera, of the image's size; residuals in the order of the corners as they were found.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        The board is not found; another argument is wrong.
    ImageError, DtypeError
        The image is none.
    CalibrationError
        `K` or the lens cannot be right.
    MissingExtraError
        OpenCV is not installed.
    """
    cv2 = _opencv()
    grey = _grey(image)
    across, along = _counts(corners)
    size, turned = _length("square", square), number_of("heading", heading)
    middle = array_of("at", at)
    if middle.shape != (2,) or middle.dtype.kind not in "iuf" or not np.isfinite(middle).all():
        raise ArgumentError(f"at: expected (x, y) in metres, got {middle.dtype} of shape {middle.shape}")
    if dictionary is None:
        found, places = _chessboard(cv2, grey, (across, along)), _places(across, along)
        orders = list(_orders(across, along))
    else:
        side = 0.75 * size if marker is None else _length("marker", marker)
        if not side < size:
            raise ArgumentError(f"marker: expected less than a square, {size:g} m, got {side:g} m")
        found, places = _charuco(cv2, grey, (across, along), size, side, dictionary)
        orders = [np.arange(len(found))]
    c, s = math.cos(turned), math.sin(turned)
    ground_points = middle + size * places @ np.array([[c, s], [-s, c]])
    fits: list[PoseFit] = []
    refused: ArgumentError | None = None
    for order in orders:
        try:
            fits.append(
                from_ground_points(
                    found,
                    ground_points[order],
                    K=K,
                    image_size=(grey.shape[1], grey.shape[0]),
                    lens=lens,
                    ground=ground,
                    tolerance=tolerance,
                )
            )
        except ArgumentError as error:  # a mirror image: the other way to count
            if len(orders) == 1:
                raise
            refused = error
    if refused is not None and not fits:
        raise refused
    # those of turned boards fit as well; the vehicle is on its own side of the board
    best = max(int(fit.used.sum()) for fit in fits)
    return min(
        (fit for fit in fits if fit.used.sum() == best), key=lambda fit: float(np.hypot(*fit.camera.position[:2]))
    )


def _opencv() -> ModuleType:
    try:
        import cv2
    except ImportError as error:
        raise MissingExtraError(
            "expected OpenCV, which finds the corners of a board, found none; install it with: "
            "pip install 'ipm-rs[board]'"
        ) from error
    return cv2


def _grey(image: ArrayLike) -> NDArray[np.uint8]:
    pixels = array_of("image", image)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise DtypeError(f"image: expected uint8 or uint16, got {pixels.dtype}")
    if pixels.ndim not in (2, 3) or 0 in pixels.shape or (pixels.ndim == 3 and pixels.shape[2] > 4):
        raise ImageError(f"image: expected shape (H, W) or (H, W, C) of up to 4 channels, got {pixels.shape}")
    if pixels.ndim == 3:
        colours = pixels[..., : 1 if pixels.shape[2] < 3 else 3]
        pixels = np.rint(colours.mean(axis=2)).astype(pixels.dtype)
    if pixels.dtype == np.uint16:
        pixels = (pixels / max(1.0, float(pixels.max()) / 255)).astype(np.uint8)
    return np.ascontiguousarray(pixels, dtype=np.uint8)


def _counts(corners: Sequence[int]) -> tuple[int, int]:
    counts = array_of("corners", corners)
    if counts.shape != (2,) or counts.dtype.kind not in "iu":
        raise ArgumentTypeError(
            f"corners: expected two whole numbers, (across, along), got {counts.dtype} of shape {counts.shape}"
        )
    if counts.min() < 2 or counts.max() > _MOST:
        raise ArgumentError(f"corners: expected 2 to {_MOST} each way, got {tuple(counts.tolist())}")
    return int(counts[0]), int(counts[1])


def _length(name: str, value: float) -> float:
    length = number_of(name, value)
    if not 1e-4 < length < 100:
        raise ArgumentError(f"{name}: expected metres, 0.0001 to 100, got {length:g}; is it in millimetres?")
    return length


def _places(across: int, along: int) -> NDArray[np.float64]:
    """Return the corners row by row, the far row first and the left one of each first, in squares from the middle."""
    rows, columns = np.mgrid[:along, :across].reshape(2, -1)
    return np.stack([(along - 1) / 2 - rows, (across - 1) / 2 - columns], axis=1)


def _orders(across: int, along: int) -> Iterator[NDArray[np.intp]]:
    """Yield in which orders a finder may have counted the corners, mirror images among them."""
    grid = np.arange(across * along).reshape(along, across)
    turns = (grid, grid[::-1, ::-1], grid[::-1], grid[:, ::-1])
    yield from (turn.ravel() for turn in turns)
    if across == along:
        yield from (turn.T.ravel() for turn in turns)


def _chessboard(cv2: ModuleType, grey: NDArray[np.uint8], counts: tuple[int, int]) -> NDArray[np.float64]:
    if min(counts) < 3:
        raise ArgumentError(f"corners: expected at least 3 each way of a chessboard, got {counts}")
    found = _detected(cv2, grey, counts)
    if found is None:
        fewer = (counts[0] - 1, counts[1] - 1)
        if min(fewer) >= 3 and _detected(cv2, grey, fewer) is not None:
            raise ArgumentError(
                f"corners: expected inner corners, got {counts} of a board that has {fewer}: those are its squares; "
                f"pass corners={fewer}"
            )
        raise ArgumentError(
            f"image: expected a chessboard of {counts[0]} x {counts[1]} inner corners, found none; it must be seen "
            "whole, with a white margin, larger than 10 pixels a square; corners are one less than squares"
        )
    return found


def _detected(cv2: ModuleType, grey: NDArray[np.uint8], counts: tuple[int, int]) -> NDArray[np.float64] | None:
    if min(grey.shape) < _SMALLEST:
        return None
    # not CALIB_CB_EXHAUSTIVE: it took 6 s where there is no board, and found none that the older finder does not
    found, corners = cv2.findChessboardCornersSB(
        grey, counts, flags=cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
    )
    if not found:  # what lies flat and far away the older finder sees more often
        found, corners = cv2.findChessboardCorners(
            grey, counts, flags=cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
        )
        if found:
            stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
            corners = cv2.cornerSubPix(grey, corners, (3, 3), (-1, -1), stop)
    return np.asarray(corners, dtype=np.float64).reshape(-1, 2) if found else None


def _charuco(
    cv2: ModuleType, grey: NDArray[np.uint8], counts: tuple[int, int], size: float, side: float, dictionary: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if not isinstance(dictionary, str):
        raise ArgumentTypeError(f"dictionary: expected a name such as DICT_4X4_50, got {type(dictionary).__name__}")
    number = getattr(cv2.aruco, dictionary, None) if dictionary.startswith("DICT_") else None
    if not isinstance(number, int):
        raise ArgumentError(f"dictionary: expected one of OpenCV's, such as DICT_4X4_50, got {dictionary!r:.60}")
    squares = (counts[0] + 1, counts[1] + 1)
    try:
        board = cv2.aruco.CharucoBoard(squares, size, side, cv2.aruco.getPredefinedDictionary(number))
        corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(grey)
    except cv2.error as error:  # more squares than the dictionary has markers
        raise ArgumentError(f"dictionary: OpenCV refuses this board: {str(error)!r:.120}") from error
    count = 0 if ids is None else len(ids)
    if count < _FEWEST_CHARUCO:
        raise ArgumentError(
            f"image: expected a ChArUco board of {squares[0]} x {squares[1]} squares of {dictionary}, found {count} of "
            "its corners; check corners= (one less than squares) and the dictionary"
        )
    return np.asarray(corners, dtype=np.float64).reshape(-1, 2), _places(*counts)[np.asarray(ids).ravel()]
