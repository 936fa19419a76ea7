"""Warps and maps on many machines, with Ray (extra ``ray``): of datasets of Ray Data, of files, of drives.

    dataset = ipm_rs.ray.warp(ray.data.read_images("s3://bucket/frames"), lut)        # a dataset of views
    summary = ipm_rs.ray.warp_files("s3://bucket/frames", lut, "s3://bucket/bevs")    # files to files, resumable
    ipm_rs.ray.mosaic(frames, mosaic)                                                 # a map of the road

All give what one process gives, to the last bit, however many workers there are and whichever of them die.
"""

from ipm_rs.ray._batches import Warp, warp
from ipm_rs.ray._files import warp_files
from ipm_rs.ray._mosaic import mosaic

__all__ = ["Warp", "mosaic", "warp", "warp_files"]
