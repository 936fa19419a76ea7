"""Maps of the road from the frames of a drive: `Mosaic`."""

from ipm_rs.mosaic._mosaic import Mosaic

__all__ = ["Mosaic"]
