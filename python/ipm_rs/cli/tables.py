"""Tables of the command line: one that sees nothing is refused, because its files would be of one colour."""

from __future__ import annotations

import warnings

import ipm_rs
from ipm_rs.errors import CalibrationError, CalibrationWarning

__all__ = ["check_sees", "table_of"]


def table_of(camera: ipm_rs.Camera, grid: ipm_rs.BevGrid, ground: float, *, may_be_empty: bool = False) -> ipm_rs.Lut:
    """Build the table; what is odd about it is warned of as ever.

    Parameters
    ----------
    camera, grid, ground
        As `Lut` takes them.
    may_be_empty : bool
        Whether other poses than the calibration's may still make views of it.

    Raises
    ------
    CalibrationError
        It has no valid cell. The message is the warning that says why.
    """
    with warnings.catch_warnings(record=True) as odd:
        warnings.simplefilter("always", CalibrationWarning)
        lut = ipm_rs.Lut(camera, grid, ground=ground)
    if not (may_be_empty or lut.mask.any()):
        why = "; ".join(str(each.message) for each in odd if issubclass(each.category, CalibrationWarning))
        here = "; here: --ground HEIGHT" if "ground=" in why else ""
        raise CalibrationError(
            f"{why or 'expected a grid that the camera sees, got one of which it sees no cell'}{here}"
        )
    for each in odd:
        warnings.warn(each.message, each.category, stacklevel=2)
    return lut


def check_sees(lut: ipm_rs.RigLut) -> None:
    """Refuse the table of a rig that sees no cell.

    Raises
    ------
    CalibrationError
        No camera sees any.
    """
    if not lut.mask.any():
        raise CalibrationError(
            "expected a grid that some camera of the rig sees, got one that none sees; give another --x, --y "
            "or --ground"
        )
