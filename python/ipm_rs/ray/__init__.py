"""Warps on many machines, with Ray (extra ``ray``): of a dataset of Ray Data, or of files from wherever to wherever.

    dataset = ipm_rs.ray.warp(ray.data.read_images("s3://bucket/frames"), lut)        # a dataset of views
    summary = ipm_rs.ray.warp_files("s3://bucket/frames", lut, "s3://bucket/bevs")    # files to files, resumable

Both give what one process gives, to the last bit, however many workers there are and whichever of them die.
"""

from ipm_rs.ray._batches import Warp, warp
from ipm_rs.ray._files import warp_files

__all__ = ["Warp", "warp", "warp_files"]
