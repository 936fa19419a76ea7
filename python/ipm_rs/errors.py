"""Exceptions: `IpmError` and its kin, each also the built-in exception that a caller would expect; and one warning."""

from __future__ import annotations

__all__ = [
    "ArgumentError",
    "ArgumentTypeError",
    "CalibrationError",
    "CalibrationWarning",
    "DtypeError",
    "FileError",
    "GridError",
    "ImageError",
    "IpmError",
    "LutError",
    "MissingExtraError",
    "MissingFileError",
    "MosaicError",
    "OutOfMemoryError",
]


class IpmError(Exception):
    """Base of every error that this package raises on purpose."""


class CalibrationError(IpmError, ValueError):
    """A camera, a pose or the content of a calibration file that cannot be right."""


class CalibrationWarning(UserWarning):
    """A camera, or what a table sees of its road, that is possible and yet usually a mistake.

    The text says what is odd, what usually causes it and how to mend it. ``warnings.filterwarnings("ignore",
    category=ipm_rs.CalibrationWarning)`` where it is meant so; ``"error"`` makes it an exception.
    """


class GridError(IpmError, ValueError):
    """A range or a cell size that makes no grid."""


class LutError(IpmError, ValueError):
    """Maps, a homography or stored bytes that make no table."""


class ImageError(IpmError, ValueError):
    """An image or an output of the wrong shape, size or memory layout."""


class ArgumentError(IpmError, ValueError):
    """Any other argument of the right type with a wrong value."""


class ArgumentTypeError(IpmError, TypeError):
    """An argument of the wrong type."""


class DtypeError(ArgumentTypeError):
    """An array of a dtype that the operation does not take."""


class FileError(IpmError, OSError):
    """A file that cannot be read or written."""


class MissingFileError(FileError, FileNotFoundError):
    """A file that does not exist."""


class MissingExtraError(IpmError, ImportError):
    """An optional dependency that is not installed; the message names the extra to install."""


class MosaicError(IpmError, ValueError):
    """Maps or tiles that do not belong together, or that hold all they can."""


class OutOfMemoryError(IpmError, MemoryError):
    """A table or an output larger than the memory that there is."""
