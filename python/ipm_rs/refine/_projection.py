"""Points of the optical frame to pixels, with the derivatives, through any lens."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ipm_rs._core import Camera

__all__ = ["Eye"]

Matrix = NDArray[np.float64]

# Of a point's distance: how far beside it a lens is looked at for its slope. The error of a central difference is the
# square of this, 1e-10 of the slope, and that of rounding 1e-11.
_BESIDE = 1e-5


class Eye:
    """A camera without its pose: what its lens makes of points (x right, y down, z forward)."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera.with_pose(np.eye(4))
        self._K = None if camera.lens is not None else camera.intrinsics

    def rays(self, pixels: Matrix) -> Matrix:
        """(N, 3) unit vectors that pixels (N, 2) look along; NaN beyond the lens."""
        return self.camera.unproject(pixels)

    def pixels(self, points: Matrix) -> Matrix:
        """(N, 2) pixels of points (N, 3); NaN where there are none."""
        if self._K is None:
            return self.camera.project(np.ascontiguousarray(points))[0]
        with np.errstate(all="ignore"):
            flat = np.where(points[:, 2:] > 0, points[:, :2] / points[:, 2:], np.nan)
            return flat @ self._K[:2, :2].T + self._K[:2, 2]

    def slopes(self, points: Matrix) -> tuple[Matrix, Matrix]:
        """Pixels (N, 2), and their derivatives by the point (N, 2, 3)."""
        pixels = self.pixels(points)
        if self._K is not None:
            inverse = 1.0 / points[:, 2]
            slopes = np.zeros((len(points), 2, 3))
            slopes[:, 0, 0] = self._K[0, 0] * inverse
            slopes[:, 0, 1] = self._K[0, 1] * inverse
            slopes[:, 1, 1] = self._K[1, 1] * inverse
            slopes[:, :, 2] = (self._K[:2, 2] - pixels) * inverse[:, None]
            return pixels, slopes
        step = _BESIDE * np.linalg.norm(points, axis=1)
        offsets = step[:, None, None] * np.concatenate([np.eye(3), -np.eye(3)])  # (N, 6, 3)
        around = self.pixels((points[:, None] + offsets).reshape(-1, 3)).reshape(-1, 2, 3, 2)
        slopes = (around[:, 0] - around[:, 1]) / (2.0 * step[:, None, None])
        return pixels, slopes.transpose(0, 2, 1)
