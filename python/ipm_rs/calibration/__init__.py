"""Readers of calibration files, one module per format; each has a function ``read`` that returns a camera."""

from __future__ import annotations

from ipm_rs.calibration import cityscapes

__all__ = ["cityscapes"]
