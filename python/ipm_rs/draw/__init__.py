"""Drawings: metre axes around a bird's-eye view, and a metric grid, the horizon and outlines on a photo.

    draw.axes(bev, grid).save("bev.png")
    draw.overlay(image, camera, grid).save("frame.png")

Both return images of Pillow (extra ``cli``), which is imported when something is drawn.
"""

from ipm_rs.draw._axes import axes
from ipm_rs.draw._overlay import overlay
from ipm_rs.draw._pixels import to_image

__all__ = ["axes", "overlay", "to_image"]
