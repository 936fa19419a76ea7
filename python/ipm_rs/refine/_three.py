"""The poses from which three points are seen along three rays: the minimal problem, for many triples at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["poses_of_triples"]

Matrix = NDArray[np.float64]


def poses_of_triples(rays: Matrix, points: Matrix) -> tuple[Matrix, Matrix]:
    """Return the poses of triples of points that are seen along triples of rays.

    The distances of the points from the camera follow from the law of cosines in the three triangles that two points
    make with the camera: Grunert's quartic, in the form of Haralick et al. 1994 ("Review and analysis of solutions of
    the three point perspective pose estimation problem"), polished by Newton's method. Rays may look in any direction,
    so that every lens is served alike.

    Parameters
    ----------
    rays : (M, 3, 3)
        Three unit vectors of the optical frame for each triple.
    points : (M, 3, 3)
        The points, in any frame; no three on a line.

    Returns
    -------
    rotations : (L, 3, 3)
        From the frame of the points to the optical one, up to four for each triple.
    translations : (L, 3)
        The frame's origin in the optical frame.
    """
    # squared sides opposite the points, and cosines of the angles between the rays to the same two points
    a, b, c = (((points[:, i] - points[:, j]) ** 2).sum(-1) for i, j in ((1, 2), (0, 2), (0, 1)))
    alpha, beta, gamma = ((rays[:, i] * rays[:, j]).sum(-1) for i, j in ((1, 2), (0, 2), (0, 1)))
    roots = _quartic_roots(*_grunert(a, b, c, alpha, beta, gamma))  # (M, 4): third distance over the first
    first = np.sqrt(b[:, None] / (1.0 + roots**2 - 2.0 * roots * beta[:, None]))
    third = roots * first
    # Grunert's fraction for the second distance is 0 / 0 where two rays are alike; the quadratic never is
    under = np.sqrt(np.maximum(gamma[:, None] ** 2 - 1.0 + c[:, None] / first**2, 0.0))
    seconds = np.stack([first * (gamma[:, None] + sign * under) for sign in (1.0, -1.0)])
    off = np.abs(seconds**2 + third**2 - 2.0 * seconds * third * alpha[:, None] - a[:, None])
    second = np.where(off[0] <= off[1], seconds[0], seconds[1])
    distances = _polished(np.stack([first, second, third], -1), (a, b, c), (alpha, beta, gamma))
    good = np.isfinite(distances).all(-1) & (distances > 0).all(-1)
    triple, _ = np.nonzero(good)
    seen = distances[good][:, :, None] * rays[triple]
    there, here = _axes(points[triple]), _axes(seen)
    rotations = here @ there.transpose(0, 2, 1)
    translations = seen[:, 0] - np.einsum("lij,lj->li", rotations, points[triple, 0])
    fine = np.isfinite(rotations).all((1, 2)) & np.isfinite(translations).all(1)
    return rotations[fine], translations[fine]


def _grunert(
    a: Matrix, b: Matrix, c: Matrix, alpha: Matrix, beta: Matrix, gamma: Matrix
) -> tuple[Matrix, Matrix, Matrix, Matrix, Matrix]:
    """Coefficients of the quartic, highest power first."""
    less, more, cb, ab = (a - c) / b, (a + c) / b, c / b, a / b
    return (
        (less - 1.0) ** 2 - 4.0 * cb * alpha**2,
        4.0 * (less * (1.0 - less) * beta - (1.0 - more) * alpha * gamma + 2.0 * cb * alpha**2 * beta),
        2.0
        * (
            less**2
            - 1.0
            + 2.0 * less**2 * beta**2
            + 2.0 * (1.0 - cb) * alpha**2
            - 4.0 * more * alpha * beta * gamma
            + 2.0 * (1.0 - ab) * gamma**2
        ),
        4.0 * (-less * (1.0 + less) * beta + 2.0 * ab * gamma**2 * beta - (1.0 - more) * alpha * gamma),
        (1.0 + less) ** 2 - 4.0 * ab * gamma**2,
    )


def _quartic_roots(*coefficients: Matrix) -> Matrix:
    """(M, 4) real parts of the roots of quartics; NaN for those that are not nearly real."""
    lead = np.where(np.abs(coefficients[0]) < 1e-14, 1e-14, coefficients[0])
    companion = np.zeros((len(lead), 4, 4))
    companion[:, 0] = np.stack([-coefficient / lead for coefficient in coefficients[1:]], -1)
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    companion[~np.isfinite(companion).all((1, 2))] = 0.0
    roots = np.linalg.eigvals(companion)
    # double roots, of points on the danger cylinder, come out as a pair with imaginary parts of rounding's square root
    nearly = np.abs(roots.imag) < 1e-3 * (1.0 + np.abs(roots.real))
    return np.where(nearly & (roots.real > 0), roots.real, np.nan)


def _polished(distances: Matrix, sides: tuple[Matrix, ...], cosines: tuple[Matrix, ...]) -> Matrix:
    """Three steps of Newton's method on the laws of cosines; NaN where they are not met after it."""
    pairs = ((1, 2), (0, 2), (0, 1))
    wrong = np.full(distances.shape[:2], np.inf)
    for _ in range(3):
        s = distances
        jacobian = np.zeros((*s.shape[:2], 3, 3))
        values = np.empty_like(s)
        for row, (i, j) in enumerate(pairs):
            cosine, side = cosines[row][:, None], sides[row][:, None]
            values[..., row] = s[..., i] ** 2 + s[..., j] ** 2 - 2.0 * s[..., i] * s[..., j] * cosine - side
            jacobian[..., row, i] = 2.0 * (s[..., i] - s[..., j] * cosine)
            jacobian[..., row, j] = 2.0 * (s[..., j] - s[..., i] * cosine)
        wrong = np.abs(values / np.stack(sides, -1)[:, None]).max(-1)
        # a little damping: where two solutions meet, the matrix is singular
        damped = np.einsum("mrij,mrik->mrjk", jacobian, jacobian)
        damped[..., [0, 1, 2], [0, 1, 2]] += 1e-13 * np.trace(damped, axis1=2, axis2=3)[..., None] + 1e-300
        right = np.einsum("mrij,mri->mrj", jacobian, values)
        usable = np.isfinite(damped).all((2, 3)) & np.isfinite(right).all(2)
        damped[~usable], right[~usable] = np.eye(3), np.nan
        distances = s - np.linalg.solve(damped, right[..., None])[..., 0]
    return np.where((wrong < 1e-2)[..., None], distances, np.nan)


def _axes(triangles: Matrix) -> Matrix:
    """(M, 3, 3) rotations whose columns are axes of triangles (M, 3, 3): along a side, in the plane, normal to it."""
    along = triangles[:, 1] - triangles[:, 0]
    normal = np.cross(along, triangles[:, 2] - triangles[:, 0])
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.stack([along, np.cross(normal, along), normal], -1)
