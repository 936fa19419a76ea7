"""Readers of calibration files: one module for each format, and how a file's format is recognised.

How to add a format
-------------------
1. A module ``ipm_rs/calibration/<format>.py`` with

   * a docstring that states the dataset's axes, units, angle signs, quaternion order, transform direction, pixel base
     and road height, with the ``ground=`` to use;
   * ``TITLE``: its name in messages, ``"KITTI"``;
   * ``read(source, *, ...) -> Camera``. `source` is a path or the content as a mapping; ``image_size=None`` if the
     files do not hold the size, ``camera=None`` (or a default) if a file holds several, others as the format needs;
   * ``missing(document) -> str | None``: what the `Document` lacks to be of this format, in a few words ("no key
     'intrinsic'"); None if nothing. It may raise `CalibrationError`, which counts as missing.

   Checks come from ``_checks`` (`Section`, `number`, `matrix`, `quaternion`, `pose`, `blame`), files from ``_files``
   (`read_json`, `Document`); nothing but errors of ``ipm_rs.errors`` may leave a reader, whatever the bytes.
2. Its name in `FORMATS`, before any format whose files it could be taken for.
3. A line in ``src/python/camera_readers.rs`` and the method in ``_core.pyi``: ``Camera.from_<format>``.
4. A sample in ``tests/python/calibration_datasets.py`` or ``calibration_samples.py``: the tests of all formats
   then mutate it, cut it short, and hold that no other format claims it.
"""

from __future__ import annotations

import inspect
import logging
import os
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Protocol, cast

from ipm_rs._core import Camera
from ipm_rs.calibration._files import Document, open_document, same_size
from ipm_rs.errors import ArgumentError, CalibrationError, FileError, MissingExtraError

__all__ = ["FORMATS", "load", "reader", "recognise"]

FORMATS: tuple[str, ...] = (
    "json",
    "cityscapes",
    "kitti_raw",
    "kitti_360",
    "kitti",
    "argoverse2",
    "nuscenes",
    "waymo",
    "carla",
    "woodscape",
    "matlab",
    "kalibr",
    "ros",
    "opencv",
    "colmap",
)
"""Names of the formats, in the order in which they are tried; each is a module here and a ``Camera.from_<name>``."""

_log = logging.getLogger("ipm_rs.calibration")


class Reader(Protocol):
    """What a module of a format provides."""

    TITLE: str

    def read(self, source: Any, **options: Any) -> Camera: ...

    def missing(self, document: Document) -> str | None: ...


def reader(name: str) -> Reader:
    """Return the module of a format."""
    if name not in FORMATS:
        raise ArgumentError(f"name: expected one of {', '.join(FORMATS)}, got {name!r}; pass one of these")
    return cast(Reader, import_module(f"ipm_rs.calibration.{name}"))


def recognise(path: str | os.PathLike[str]) -> str:
    """Name the format of a calibration file or directory, one of `FORMATS`.

    Raises
    ------
    CalibrationError
        It is of no known format; the message lists every format and what the file lacks to be of it.
    FileError, MissingFileError
        The file cannot be read.
    """
    document = open_document(path, "")
    if not document.is_directory:
        _ = document.data  # a file that cannot be read is no matter of formats
    problem = _problem(document)
    tried = []
    for name in FORMATS:
        try:
            lacks = reader(name).missing(document)
        except MissingExtraError:
            raise
        except CalibrationError as error:
            lacks = str(error).removeprefix(f"{document.origin}: ")
            lacks = "not text" if lacks == problem else lacks  # said once is enough
        except FileError as error:  # a directory, where a format has one file
            lacks = "a directory" if document.is_directory else str(error)
        if lacks is None:
            return name
        tried.append(f"\n  {name}: {lacks}")
    raise CalibrationError(
        f"{document.origin}: expected a calibration of a known format, got one of none"
        f"{f' ({problem})' if problem else ''}; "
        "call Camera.from_<format> to learn what is wrong with a file, or build Camera(K, ...) yourself; tried"
        + "".join(tried)
    )


def _problem(document: Document) -> str:
    """Say what is wrong with a file of whatever format: no text, or JSON that breaks off; empty if nothing."""
    try:
        if document.is_directory:
            return ""
        if not document.text.strip():
            return "it is empty"
        if document.text.lstrip()[:1] in ("{", "["):
            _ = document.json
    except CalibrationError as error:
        return str(error).removeprefix(f"{document.origin}: ")
    return ""


def load(
    path: str | os.PathLike[str],
    image_size: Sequence[int] | None = None,
    camera: str | int | None = None,
    *,
    lens: str | None = None,
) -> Camera:
    """Read a calibration file of any known format.

    Which format was taken is logged at level INFO by the logger ``ipm_rs.calibration``; `recognise` returns it.

    Parameters
    ----------
    path : str or path
        A file, or the directory of a dataset's calibration.
    image_size : (int, int), optional
        Width and height in pixels, for formats that do not hold them. Where the file does, the two must agree.
    camera : str or int, optional
        Which camera, where the file holds several: a name or a number, as the format has it.
    lens : str, optional
        Which lens, where an OpenCV file does not say it: "fisheye", "brown_conrady", "omnidir" or "pinhole"; see
        `ipm_rs.calibration.opencv.read`.

    Returns
    -------
    Camera
        As ``Camera.from_<format>`` reads it. A format without a pose gives a camera at the origin that looks along +x.

    Raises
    ------
    CalibrationError
        The format is not known, the content is wrong, or something that the file lacks was not given.
    ArgumentError
        `camera` was given, and the file holds one camera only; `lens` was given, and the format states the lens, or it
        is needed.
    FileError, MissingFileError
        The file cannot be read.
    """
    name = recognise(path)
    module = reader(name)
    accepted = inspect.signature(module.read).parameters
    options: dict[str, Any] = {}
    if camera is not None:
        if "camera" not in accepted:
            raise ArgumentError(
                f"camera: expected none, since a {module.TITLE} file holds one camera, got {camera!r}; drop it"
            )
        options["camera"] = camera
    if lens is not None:
        if "lens" not in accepted:
            raise ArgumentError(
                f"lens: expected none, since a {module.TITLE} file leaves no choice, got {lens!r:.60}; drop it"
            )
        options["lens"] = lens
    if image_size is not None and "image_size" in accepted:
        options["image_size"] = image_size
    result = module.read(path, **options)
    same_size(image_size, result.image_size, os.fspath(path))
    _log.info("%s: read as %s (%s): %r", os.fspath(path), name, module.TITLE, result)
    return result
