"""Reading a calibration file of any format, and telling which format it is of."""

from __future__ import annotations

import inspect
import logging
import os
import re
from collections.abc import Mapping, Sequence
from typing import Any

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera
from ipm_rs.calibration import FORMATS, reader
from ipm_rs.calibration._files import Document, open_document, same_size
from ipm_rs.calibration._kinds import kind_of
from ipm_rs.calibration._lines import first_words
from ipm_rs.calibration._names import spelled
from ipm_rs.calibration._rosinfo import NOT_ROS
from ipm_rs.calibration._rosini import looks_like_ini
from ipm_rs.errors import ArgumentError, CalibrationError, FileError, MissingExtraError

__all__ = ["load", "recognise"]

_WITHOUT = {
    "camera": "holds one camera",
    "lens": "leaves no choice",
    "frame": "has one frame",
    "metres_per_unit": "counts in metres",
    "nearest_rotation": "holds no rotation matrix",
}

# A file that is written otherwise than a format is not near to it, whatever its keys.
_OTHER_FORMS = ("not JSON", NOT_ROS)

_KEY = re.compile(r"^\s*[\w.-]+\s*:", re.MULTILINE)

_log = logging.getLogger("ipm_rs.calibration")


def recognise(path: str | os.PathLike[str]) -> str:
    """Name the format of a calibration file or directory, one of `FORMATS`.

    Raises
    ------
    CalibrationError
        It is of no known format; the message lists every format and what the file lacks to be of it.
    FileError, MissingFileError
        The file cannot be read.
    """
    return _recognise(open_document(path, ""))


def _recognise(document: Document) -> str:
    kind = None if document.is_directory else kind_of(document.data)  # a file must be readable, whatever its format
    if kind is not None:
        raise CalibrationError(f"{document.origin}: expected a calibration, got {kind}")
    problem = _problem(document)
    needed: MissingExtraError | None = None
    lacking: dict[str, str] = {}
    for name in FORMATS:
        try:
            lacks = reader(name).missing(document)
        except MissingExtraError as error:
            needed, lacks = error, "PyYAML is not installed"
        except CalibrationError as error:
            lacks = str(error).removeprefix(f"{document.origin}: ")
            lacks = "not text" if lacks == problem else lacks.partition("; ")[0]  # said once is enough
        except FileError as error:  # a directory, where a format has one file
            lacks = "a directory" if document.is_directory else str(error)
        if lacks is None:
            return name
        lacking[name] = lacks
    if needed is not None and not problem and _KEY.search(document.text[:100_000]):
        raise needed
    raise CalibrationError(
        f"{document.origin}: expected a calibration of a known format, got one of none"
        f"{f' ({problem})' if problem else ''}; "
        "call Camera.from_<format> to learn what is wrong with a file, or build Camera(K, ...) yourself; tried"
        f"{_tried(document, lacking)}"
    )


def _tried(document: Document, lacking: dict[str, str]) -> str:
    """Say what the file lacks to be of each format, the nearest first; formats that lack the same share a line."""
    depths = _depths(document)
    near = {name: sum(1 / (1 + depths[word]) for word in _spelled_keys(name) & depths.keys()) for name in FORMATS}
    if not document.is_directory and (document.is_npz or document.data[:6] in (b"%YAML:", b"<?xml ")):
        near["opencv"] += 0.5
    lines: dict[str, list[str]] = {}
    for name in sorted(FORMATS, key=lambda name: (lacking[name] in _OTHER_FORMS, -near[name])):
        far = not document.is_directory and bool(document.keys) and not near[name]  # what each lacks is then no help
        lines.setdefault("none of its keys" if far else lacking[name], []).append(name)
    return "".join(f"\n  {', '.join(names)}: {lacks}" for lacks, names in lines.items())


def _spelled_keys(name: str) -> set[str]:
    return {spelled(key) for key in reader(name).KEYS}


def _depths(document: Document) -> dict[str, int]:
    """Keys of a file, each with how deep it stands; of a file without any, the words that its lines begin with."""
    found: dict[str, int] = {}
    try:
        level = [] if document.is_directory else [(value, 0) for value in document.documents[:1]]
    except (CalibrationError, MissingExtraError):
        level = []
    for _ in range(6):
        inner: list[tuple[Any, int]] = []
        for value, depth in level[:1000]:
            if isinstance(value, Mapping):
                for key in list(value)[:1000]:
                    found.setdefault(spelled(key), depth)
                inner.extend((item, depth + 1) for item in value.values())
            elif isinstance(value, list):
                inner.extend((item, depth) for item in value[:100])
        level = inner
    try:
        lines = set() if found or document.is_directory else first_words(document)
    except CalibrationError:
        lines = set()
    return found or {spelled(word): 0 for word in lines}


def _problem(document: Document) -> str:
    """Say what is wrong with a file of whatever format: no text, or JSON that breaks off; empty if nothing."""
    try:
        if document.is_directory or document.is_npz:
            return ""
        if not document.text.strip():
            return "it is empty"
        if document.text.lstrip()[:1] in ("{", "[") and not looks_like_ini(document.text):
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
    frame: str | None = None,
    metres_per_unit: float | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read a calibration file of any known format.

    Which format was taken is logged at level INFO by the logger ``ipm_rs.calibration``; `recognise` returns it.

    Parameters
    ----------
    path : str or path
        A file, or the directory of a dataset's calibration. Files of up to 32 MB are read, YAML of up to 4 MB.
    image_size : (int, int), optional
        Width and height in pixels, for formats that do not hold them. Where the file does, the two must agree.
    camera : str or int, optional
        Which camera, where the file holds several: a name or a number, as the format has it.
    lens : str, optional
        Which lens, where an OpenCV file does not say it: "fisheye", "brown_conrady", "omnidir" or "pinhole"; see
        `ipm_rs.calibration.opencv.read`.
    frame : str, optional
        Which of the dataset's frames the vehicle frame is, for the KITTI formats: "camera" for files that hold
        projection matrices only.
    metres_per_unit : float, optional
        Length of the file's unit in metres, for OpenCV, ROS and COLMAP: 0.001 for millimetres.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        As ``Camera.from_<format>`` reads it. A format without a pose gives a camera at the origin that looks along +x.

    Raises
    ------
    CalibrationError
        The format is not known, the content is wrong, or something that the file lacks was not given.
    ArgumentError
        `camera`, `lens`, `frame` or `metres_per_unit` was given, and the format leaves no choice, or one of them is
        needed.
    FileError, MissingFileError
        The file cannot be read.
    """
    check_word("camera", camera)
    document = open_document(path, "", argument="path")
    name = _recognise(document)
    module = reader(name)
    accepted = inspect.signature(module.read).parameters
    options: dict[str, Any] = {}
    given = {"camera": camera, "lens": lens, "frame": frame, "metres_per_unit": metres_per_unit}
    for option, value in {**given, "nearest_rotation": nearest_rotation or None}.items():
        if value is None:
            continue
        if option not in accepted:
            raise ArgumentError(
                f"{option}: expected none, since a {module.TITLE} file {_WITHOUT[option]}, got {value!r:.60}; drop it"
            )
        options[option] = value
    if image_size is not None and "image_size" in accepted:
        options["image_size"] = image_size
    result = module.read(document, **options)
    same_size(image_size, result.image_size, document.origin)
    _log.info("%s: read as %s (%s): %r", document.origin, name, module.TITLE, result)
    return result
