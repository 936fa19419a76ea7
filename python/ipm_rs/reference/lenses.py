"""Lens models in plain NumPy: each formula as its source prints it.

A formula takes directions in the optical camera frame (x right, y down, z forward), of any length, and gives what K
takes to pixels: ``pixel = K @ (m, 1)``. None knows where its image folds back: :func:`image_of` adds that.

Where the formula itself has no value (behind a plane, outside a sphere's view) there is NaN.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "brown_conrady",
    "cylindrical",
    "division",
    "double_sphere",
    "equirectangular",
    "eucm",
    "fold_angle",
    "fov",
    "ftheta",
    "image_of",
    "inverse_brown_conrady",
    "kannala_brandt",
    "mei",
    "ocam",
    "radial_polynomial",
    "thin_prism_fisheye",
]

_Plane = NDArray[np.float64]


def _xyz(directions: ArrayLike) -> tuple[_Plane, _Plane, _Plane]:
    directions = np.asarray(directions, dtype=np.float64)
    return directions[..., 0], directions[..., 1], directions[..., 2]


def _bend(x: _Plane, y: _Plane, coefficients: ArrayLike) -> _Plane:
    """Radial, tangential, thin prism and tilt, on the plane z = 1."""
    given = np.asarray(coefficients, dtype=np.float64)
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = np.pad(given, (0, 14 - len(given)))
    r2 = x**2 + y**2
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2) + s1 * r2 + s2 * r2**2
    v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y + s3 * r2 + s4 * r2**2
    cos_x, sin_x, cos_y, sin_y = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    about_x = np.array([[1, 0, 0], [0, cos_x, sin_x], [0, -sin_x, cos_x]])
    about_y = np.array([[cos_y, 0, -sin_y], [0, 1, 0], [sin_y, 0, cos_y]])
    turned = about_y @ about_x
    onto = np.array([[turned[2, 2], 0, -turned[0, 2]], [0, turned[2, 2], -turned[1, 2]], [0, 0, 1]])
    tilted = np.stack([u, v, np.ones_like(u)], axis=-1) @ (onto @ turned).T
    plane: _Plane = tilted[..., :2] / tilted[..., 2:]
    return plane


def brown_conrady(directions: ArrayLike, coefficients: ArrayLike) -> _Plane:
    """OpenCV's model (plumb_bob, radtan), from 4 to 14 coefficients in OpenCV's order; NaN for z <= 0.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame.
    coefficients : array_like
        k1, k2, p1, p2[, k3[, k4, k5, k6[, s1, s2, s3, s4[, tau_x, tau_y]]]].

    Returns
    -------
    ndarray, shape (..., 2), float64

    Notes
    -----
    OpenCV, calib3d, "Detailed Description".
    """
    x, y, z = _xyz(directions)
    with np.errstate(all="ignore"):
        z = np.where(z > 0, z, np.nan)
        return _bend(x / z, y / z, coefficients)


def _by_angle(directions: ArrayLike, radius: Callable[[_Plane], _Plane]) -> _Plane:
    """Apply the model whose image is at ``radius(theta)`` from the centre."""
    x, y, z = _xyz(directions)
    theta = np.arctan2(np.hypot(x, y), z)
    azimuth = np.arctan2(y, x)
    rho = radius(theta)
    return np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth)], axis=-1)


def _halved(growing: Callable[[_Plane], _Plane], values: _Plane, last: float) -> _Plane:
    """Find where a function that grows from 0 to `last` has `values`, by halving."""
    low, high = np.zeros_like(values), np.full_like(values, last)
    for _ in range(80):
        middle = (low + high) / 2
        short = growing(middle) < values
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return (low + high) / 2


def kannala_brandt(directions: ArrayLike, coefficients: ArrayLike) -> _Plane:
    """Kannala-Brandt (equidistant, fisheye): ``theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)``.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame, also behind it.
    coefficients : array_like, shape (4,)
        k1 to k4.

    Returns
    -------
    ndarray, shape (..., 2), float64

    Notes
    -----
    OpenCV, calib3d, "Fisheye camera model", with atan2 for its atan.
    """
    k1, k2, k3, k4 = np.asarray(coefficients, dtype=np.float64)
    return _by_angle(directions, lambda t: t * (1 + k1 * t**2 + k2 * t**4 + k3 * t**6 + k4 * t**8))


def radial_polynomial(directions: ArrayLike, coefficients: ArrayLike) -> _Plane:
    """WoodScape: ``k1 theta + k2 theta^2 + k3 theta^3 + k4 theta^4`` pixels.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame, also behind it.
    coefficients : array_like, shape (4,)
        k1 to k4.

    Returns
    -------
    ndarray, shape (..., 2), float64
        Pixels from the principal point; K is ``[[1, 0, cx], [0, aspect, cy], [0, 0, 1]]``.
    """
    k1, k2, k3, k4 = np.asarray(coefficients, dtype=np.float64)
    return _by_angle(directions, lambda t: k1 * t + k2 * t**2 + k3 * t**3 + k4 * t**4)


def mei(directions: ArrayLike, xi: float, coefficients: ArrayLike) -> _Plane:
    """Unified omnidirectional camera: onto the unit sphere, shifted by xi, pinhole, radtan; NaN for ``Z <= -w |P|``.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame.
    xi : float
        Distance of the projection centre from the sphere's.
    coefficients : array_like, shape (4,)
        k1, k2, p1, p2.

    Returns
    -------
    ndarray, shape (..., 2), float64

    Notes
    -----
    Mei and Rives 2007; w is 1 / xi if xi > 1 else xi.
    """
    x, y, z = _xyz(directions)
    length = np.sqrt(x**2 + y**2 + z**2)
    with np.errstate(all="ignore"):
        seen = z > -(1 / xi if xi > 1 else xi) * length
        depth = np.where(seen, z + xi * length, np.nan)
        return _bend(x / depth, y / depth, coefficients)


def double_sphere(directions: ArrayLike, xi: float, alpha: float) -> _Plane:
    """Double sphere; NaN for ``Z <= -w2 d1``.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame.
    xi, alpha : float
        Distance of the spheres, shift of the pinhole.

    Returns
    -------
    ndarray, shape (..., 2), float64

    Notes
    -----
    Usenko, Demmel and Cremers 2018, equations (40) to (45).
    """
    x, y, z = _xyz(directions)
    with np.errstate(all="ignore"):
        d1 = np.sqrt(x**2 + y**2 + z**2)
        d2 = np.sqrt(x**2 + y**2 + (xi * d1 + z) ** 2)
        w1 = alpha / (1 - alpha) if alpha <= 0.5 else (1 - alpha) / alpha
        w2 = (w1 + xi) / np.sqrt(2 * w1 * xi + xi**2 + 1)
        depth = np.where(z > -w2 * d1, alpha * d2 + (1 - alpha) * (xi * d1 + z), np.nan)
        return np.stack([x / depth, y / depth], axis=-1)


def eucm(directions: ArrayLike, alpha: float, beta: float) -> _Plane:
    """Enhanced unified camera model; NaN for ``Z <= -w d``.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame.
    alpha, beta : float
        Shift of the pinhole, shape of the ellipsoid.

    Returns
    -------
    ndarray, shape (..., 2), float64

    Notes
    -----
    Khomutenko, Garcia and Martinet 2016.
    """
    x, y, z = _xyz(directions)
    with np.errstate(all="ignore"):
        d = np.sqrt(beta * (x**2 + y**2) + z**2)
        w = alpha / (1 - alpha) if alpha <= 0.5 else (1 - alpha) / alpha
        depth = np.where(z > -w * d, alpha * d + (1 - alpha) * z, np.nan)
        return np.stack([x / depth, y / depth], axis=-1)


def ocam(directions: ArrayLike, polynomial: ArrayLike, affine: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> _Plane:
    """Scaramuzza's model, its forward polynomial inverted by halving; NaN where no pixel looks along a direction.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame, also behind it.
    polynomial : array_like
        a0, a1, a2, ... of ``f(rho)``; a0 < 0 in OCamCalib's files, > 0 in MATLAB's.
    affine : (float, float, float)
        c, d, e.

    Returns
    -------
    ndarray, shape (..., 2), float64
        Pixels from the centre of distortion; K is ``[[1, 0, yc], [0, 1, xc], [0, 0, 1]]``.

    Notes
    -----
    OCamCalib's ``cam2world``: its x counts rows, its y columns.
    """
    a = np.asarray(polynomial, dtype=np.float64)
    forward = np.polynomial.Polynomial(a * np.sign(a[0]))
    radii = np.linspace(0, 1e5, 2_000_001)
    angles = np.arctan2(radii, forward(radii))
    folds = np.flatnonzero(np.diff(angles) <= 0)
    last = radii[folds[0]] if len(folds) else radii[-1]

    def radius(theta: _Plane) -> _Plane:
        rho = _halved(lambda rho: np.arctan2(rho, forward(rho)), theta, last)
        return np.where(theta <= np.arctan2(last, forward(last)), rho, np.nan)

    across, down = np.moveaxis(_by_angle(directions, radius), -1, 0)
    c, d, e = affine
    return np.stack([across + e * down, d * across + c * down], axis=-1)


def ftheta(
    directions: ArrayLike, polynomial: ArrayLike, form: str, linear: tuple[float, float, float] = (1.0, 0.0, 0.0)
) -> _Plane:
    """NVIDIA's f-theta, its backward form inverted by halving; NaN where no pixel looks along a direction.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame, also behind it.
    polynomial : array_like
        a0 = 0, a1, a2, ...
    form : str
        "forward", from radians to pixels, or "backward", from pixels to radians.
    linear : (float, float, float)
        c, d, e.

    Returns
    -------
    ndarray, shape (..., 2), float64
        Pixels from the principal point; K is ``[[1, 0, cx], [0, 1, cy], [0, 0, 1]]``.

    Notes
    -----
    DriveWorks' rig format; the linear map is ``[[c, d], [e, 1]]``.
    """
    curve = np.polynomial.Polynomial(np.asarray(polynomial, dtype=np.float64))
    if form == "forward":
        radius: Callable[[_Plane], _Plane] = curve
    else:
        radii = np.linspace(0, 1e5, 2_000_001)
        folds = np.flatnonzero(np.diff(curve(radii)) <= 0)
        last = radii[folds[0]] if len(folds) else radii[-1]

        def radius(theta: _Plane) -> _Plane:
            return np.where(theta <= curve(last), _halved(curve, theta, last), np.nan)

    c, d, e = linear
    offset: _Plane = _by_angle(directions, radius) @ np.array([[c, d], [e, 1.0]]).T
    return offset


def fov(directions: ArrayLike, omega: float) -> _Plane:
    """Field of view: ``atan(2 r tan(omega / 2)) / omega``; NaN for z <= 0.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame.
    omega : float
        Radians.

    Returns
    -------
    ndarray, shape (..., 2), float64

    Notes
    -----
    Devernay and Faugeras 2001, equation (13).
    """
    x, y, z = _xyz(directions)
    with np.errstate(all="ignore"):
        z = np.where(z > 0, z, np.nan)
        r = np.hypot(x / z, y / z)
        scale = np.where(r > 0, np.arctan(2 * r * np.tan(omega / 2)) / omega / r, 1.0)
        return np.stack([x / z * scale, y / z * scale], axis=-1)


def division(directions: ArrayLike, k: float) -> _Plane:
    """Division: what is seen at m looks along ``(m, 1 + k |m|^2)``.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame, also behind it.
    k : float
        The parameter.

    Returns
    -------
    ndarray, shape (..., 2), float64

    Notes
    -----
    Fitzgibbon 2001.
    """
    x, y, z = _xyz(directions)
    with np.errstate(all="ignore"):
        r = np.hypot(x, y)
        root = np.sqrt(z**2 - 4 * k * r**2)
        # k r rho^2 - z rho + r = 0; of its two roots the one that is 0 on the axis
        rho = np.where(z > 0, 2 * r / (z + root), (z - root) / (2 * k * r))
        scale = np.where(r > 0, rho / r, np.where(z > 0, 1 / z, np.nan))
        return np.stack([x * scale, y * scale], axis=-1)


def inverse_brown_conrady(directions: ArrayLike, coefficients: ArrayLike) -> _Plane:
    """Brown-Conrady from the image to the ray, inverted by Newton's steps; NaN for z <= 0.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame.
    coefficients : array_like
        k1, k2, p1, p2[, k3].

    Returns
    -------
    ndarray, shape (..., 2), float64

    Notes
    -----
    librealsense, ``rs_types.h``: such coefficients undistort. The steps find the image of every ray of a lens that
    bends moderately; where they do not come to rest there is NaN.
    """
    x, y, z = _xyz(directions)
    with np.errstate(all="ignore"):
        z = np.where(z > 0, z, np.nan)
        target = np.stack([x / z, y / z], axis=-1)
        # from where the radial terms alone have it
        k1, k2, _, _, k3 = np.pad(np.asarray(coefficients, dtype=np.float64), (0, 1))[:5]
        radii = np.concatenate([[0.0], np.geomspace(1e-6, 1e6, 20_001)])
        folds = np.flatnonzero(np.diff(radii * (1 + k1 * radii**2 + k2 * radii**4 + k3 * radii**6)) <= 0)
        last = radii[folds[0]] if len(folds) else radii[-1]
        length = np.hypot(target[..., 0], target[..., 1])
        r = _halved(lambda r: r * (1 + k1 * r**2 + k2 * r**4 + k3 * r**6), length, last)
        m, tiny = target * np.where(length > 0, r / length, 1.0)[..., np.newaxis], 1e-7
        for _ in range(16):
            left = _bend(m[..., 0], m[..., 1], coefficients) - target
            along_x = (_bend(m[..., 0] + tiny, m[..., 1], coefficients) - left - target) / tiny
            along_y = (_bend(m[..., 0], m[..., 1] + tiny, coefficients) - left - target) / tiny
            det = along_x[..., 0] * along_y[..., 1] - along_x[..., 1] * along_y[..., 0]
            m[..., 0] -= (along_y[..., 1] * left[..., 0] - along_y[..., 0] * left[..., 1]) / det
            m[..., 1] -= (along_x[..., 0] * left[..., 1] - along_x[..., 1] * left[..., 0]) / det
        off = np.abs(_bend(m[..., 0], m[..., 1], coefficients) - target).max(axis=-1)
        return np.where((off < 1e-9)[..., np.newaxis], m, np.nan)


def thin_prism_fisheye(directions: ArrayLike, coefficients: ArrayLike) -> _Plane:
    """Fisheye with tangential and thin prism terms, of 8 or 12 coefficients.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame, also behind it.
    coefficients : array_like, shape (8,) or (12,)
        k1, k2, p1, p2, k3, k4, sx1, sy1 (COLMAP's THIN_PRISM_FISHEYE), or k0 to k5, p0, p1, s0 to s3 (its
        RAD_TAN_THIN_PRISM_FISHEYE, Project Aria's FISHEYE624).

    Returns
    -------
    ndarray, shape (..., 2), float64

    Notes
    -----
    COLMAP, ``sensor/models.h``, with atan2 for its atan.
    """
    given = np.asarray(coefficients, dtype=np.float64)
    u, v = np.moveaxis(_by_angle(directions, lambda t: t), -1, 0)
    t2 = u**2 + v**2
    if len(given) == 8:
        k1, k2, p1, p2, k3, k4, sx1, sy1 = given
        radial = k1 * t2 + k2 * t2**2 + k3 * t2**3 + k4 * t2**4
        du = u * radial + 2 * p1 * u * v + p2 * (t2 + 2 * u**2) + sx1 * t2
        dv = v * radial + 2 * p2 * u * v + p1 * (t2 + 2 * v**2) + sy1 * t2
        return np.stack([u + du, v + dv], axis=-1)
    p0, p1, s0, s1, s2, s3 = given[6:]
    radial = 1 + sum(k * t2 ** (power + 1) for power, k in enumerate(given[:6]))
    u, v = u * radial, v * radial
    r2 = u**2 + v**2
    du = (2 * u**2 + r2) * p0 + 2 * u * v * p1 + s0 * r2 + s1 * r2**2
    dv = (2 * v**2 + r2) * p1 + 2 * u * v * p0 + s2 * r2 + s3 * r2**2
    return np.stack([u + du, v + dv], axis=-1)


def cylindrical(directions: ArrayLike) -> _Plane:
    """Cylinder around the y axis: ``(atan2(X, Z), Y / sqrt(X^2 + Z^2))``; NaN straight up and down.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame, to all sides.

    Returns
    -------
    ndarray, shape (..., 2), float64
    """
    x, y, z = _xyz(directions)
    with np.errstate(all="ignore"):
        level = np.hypot(x, z)
        return np.stack([np.arctan2(x, z), y / np.where(level > 0, level, np.nan)], axis=-1)


def equirectangular(directions: ArrayLike) -> _Plane:
    """Sphere: ``(atan2(X, Z), atan2(Y, sqrt(X^2 + Z^2)))``, longitude and latitude, the latter downwards.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame, to all sides.

    Returns
    -------
    ndarray, shape (..., 2), float64
    """
    x, y, z = _xyz(directions)
    m = np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))], axis=-1)
    return np.where((x**2 + y**2 + z**2 > 0)[..., np.newaxis], m, np.nan)


def image_of(directions: ArrayLike, lens: Any) -> _Plane:
    """Compute what K takes to pixels, for a lens object such as ``ipm_rs.BrownConrady``.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Directions in the camera frame.
    lens : lens or None
        Its parameters and its ``max_angle`` are read; None is a pinhole.

    Returns
    -------
    ndarray, shape (..., 2), float64
        NaN beyond ``max_angle`` and where the formula has no value.
    """
    directions = np.asarray(directions, dtype=np.float64)
    if lens is None:
        return brown_conrady(directions, [])
    formulas: dict[str, Callable[[], _Plane]] = {
        "BrownConrady": lambda: brown_conrady(directions, lens.coefficients),
        "KannalaBrandt": lambda: kannala_brandt(directions, lens.coefficients),
        "RadialPolynomial": lambda: radial_polynomial(directions, lens.coefficients),
        "Mei": lambda: mei(directions, lens.xi, lens.coefficients),
        "DoubleSphere": lambda: double_sphere(directions, lens.xi, lens.alpha),
        "Eucm": lambda: eucm(directions, lens.alpha, lens.beta),
        "Ocam": lambda: ocam(directions, lens.polynomial, lens.affine),
        "FTheta": lambda: ftheta(directions, lens.polynomial, lens.form, lens.linear),
        "Fov": lambda: fov(directions, lens.omega),
        "Division": lambda: division(directions, lens.k),
        "InverseBrownConrady": lambda: inverse_brown_conrady(directions, lens.coefficients),
        "ThinPrismFisheye": lambda: thin_prism_fisheye(directions, lens.coefficients),
        "Cylindrical": lambda: cylindrical(directions),
        "Equirectangular": lambda: equirectangular(directions),
    }
    m = formulas[type(lens).__name__]()
    angle = np.arctan2(np.hypot(directions[..., 0], directions[..., 1]), directions[..., 2])
    return np.where((angle <= lens.max_angle)[..., np.newaxis], m, np.nan)


def fold_angle(formula: Callable[[NDArray[np.float64]], NDArray[np.float64]], step: float = 1e-4) -> float:
    """First angle from the axis at which a lens's image folds back or ends, by looking in every direction.

    The image of a small step outwards and of one sideways must turn the same way round as the steps do; where their
    cross product is no longer positive, the image has folded.

    Parameters
    ----------
    formula : callable
        From directions (..., 3) to the plane (..., 2).
    step : float
        Radians between the angles that are tried.

    Returns
    -------
    float
        Radians, to within `step`; pi if the image never folds.
    """
    theta = np.arange(step, np.pi, step)[:, np.newaxis]
    phi = np.linspace(0, 2 * np.pi, 72, endpoint=False)[np.newaxis]
    tiny = 1e-6

    def seen(theta: NDArray[np.float64], phi: NDArray[np.float64]) -> NDArray[np.float64]:
        theta, phi = np.broadcast_arrays(theta, phi)
        return formula(np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1))

    outwards = seen(theta + tiny, phi) - seen(theta - tiny, phi)
    sideways = seen(theta, phi + tiny) - seen(theta, phi - tiny)
    cross = outwards[..., 0] * sideways[..., 1] - outwards[..., 1] * sideways[..., 0]
    good = (cross > 0).all(axis=1)
    return float(np.pi if good.all() else theta[np.argmin(good), 0])
