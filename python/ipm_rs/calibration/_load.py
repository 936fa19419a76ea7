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
from ipm_rs.calibration._sections import choose
from ipm_rs.errors import ArgumentError, CalibrationError, FileError, MissingExtraError

__all__ = ["RIG_FORMAT", "RIG_VERSION", "load", "load_all", "recognise", "rig_content"]

RIG_FORMAT, RIG_VERSION = "ipm_rs rig", 1

_FOLDERS = ("kitti_raw", "kitti_360", "argoverse2", "nuscenes")  # a directory of theirs is one calibration
_SUFFIXES = (".json", ".yaml", ".yml", ".txt", ".xml", ".npz")
_MOST_FILES = 100

_WITHOUT = {
    "camera": "holds one camera",
    "lens": "leaves no choice",
    "frame": "has one frame",
    "metres_per_unit": "counts in metres",
    "nearest_rotation": "holds no rotation matrix",
}

# A file that is written otherwise than a format is not near to it, whatever its keys.
_OTHER_FORMS = ("not JSON", NOT_ROS)

_MOST_LINES = 9  # of what an unknown file lacks: more are not read

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
    told = [(", ".join(names), lacks) for lacks, names in lines.items()]
    if len(told) > _MOST_LINES:
        others = ", ".join(names for names, _ in told[_MOST_LINES - 1 :])
        told = [*told[: _MOST_LINES - 1], (others, "lacks more")]
    return "".join(f"\n  {names}: {lacks}" for names, lacks in told)


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
    given = {"camera": camera, "lens": lens, "frame": frame, "metres_per_unit": metres_per_unit}
    rig = rig_content(document)
    if rig is not None:
        return reader("json").read(rig[choose(rig, camera, document.origin)])
    return _load(document, _recognise(document), image_size, {**given, "nearest_rotation": nearest_rotation or None})


def _load(
    document: Document, name: str, image_size: Sequence[int] | None, given: Mapping[str, str | int | float | None]
) -> Camera:
    """Read a document of a format with the options that were given."""
    module = reader(name)
    accepted = inspect.signature(module.read).parameters
    options: dict[str, Any] = {}
    for option, value in given.items():
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


def load_all(
    path: str | os.PathLike[str],
    image_size: Sequence[int] | None = None,
    *,
    lens: str | None = None,
    frame: str | None = None,
    metres_per_unit: float | None = None,
    nearest_rotation: bool = False,
) -> dict[str, Camera]:
    """Read every camera of a calibration file or directory: what `Rig` is made of.

    Parameters
    ----------
    path : str or path
        A file or a dataset's directory that holds several cameras: nuScenes, Argoverse 2, Waymo, KITTI, KITTI-360,
        CARLA, a Kalibr chain, an OpenCV stereo pair or a section for each camera, COLMAP, what `Rig.save` wrote. Or a
        directory with a calibration file for each camera (at most 100), whose names are then the cameras'. A file of
        one camera gives one, by the file's name.
    image_size : (int, int), optional
        As for `load`; it and the options go for every camera.
    lens : str, optional
        As for `load`.
    frame : str, optional
        As for `load`.
    metres_per_unit : float, optional
        As for `load`.
    nearest_rotation : bool
        As for `load`.

    Returns
    -------
    dict of str to Camera
        In the order of the file; names as `load` takes them by ``camera=``. All stand in one vehicle frame where the
        format has poses; files of their own are taken to be in one.

    Raises
    ------
    CalibrationError
        As `load`, and a directory in which no file is a calibration.
    ArgumentError
        An option was given that the format does not have.
    FileError, MissingFileError
        A file cannot be read.
    """
    given: dict[str, Any] = {"lens": lens, "frame": frame, "metres_per_unit": metres_per_unit}
    given["nearest_rotation"] = nearest_rotation or None
    document = open_document(path, "", argument="path")
    rig = rig_content(document)
    if rig is not None:
        if image_size is not None or any(value is not None for value in given.values()):
            raise ArgumentError(f"{document.origin}: expected no options for what Rig.save wrote, got some; drop them")
        return {name: reader("json").read(camera) for name, camera in rig.items()}
    if document.is_directory and all(reader(name).missing(document) is not None for name in _FOLDERS):
        return _each_file(document, image_size, given)
    name = _recognise(document)
    names: list[str] = getattr(reader(name), "cameras", lambda _: [])(document)
    if not names:
        return {document.path.stem or "camera": _load(document, name, image_size, given)}
    return {camera: _load(document, name, image_size, {**given, "camera": camera}) for camera in names}


def _each_file(
    folder: Document, image_size: Sequence[int] | None, given: Mapping[str, str | int | float | None]
) -> dict[str, Camera]:
    """Read the camera of each file of a directory that may be a calibration; texts that are none are passed over."""
    paths = sorted(path for path in folder.path.iterdir() if path.suffix.lower() in _SUFFIXES and path.is_file())
    if len(paths) > _MOST_FILES:
        raise CalibrationError(
            f"{folder.origin}: expected at most {_MOST_FILES} calibration files, got {len(paths)}; pass the directory "
            "of one vehicle"
        )
    found: dict[str, Camera] = {}
    for path in paths:
        document = open_document(path, "", argument="path")
        try:
            name = _recognise(document)
        except CalibrationError:
            if path.suffix.lower() == ".txt":  # a licence, a list of images
                continue
            raise
        if path.stem in found:
            raise CalibrationError(f"{folder.origin}: expected one file for {path.stem!r}, got two; keep one")
        found[path.stem] = _load(document, name, image_size, given)
    if not found:
        raise CalibrationError(
            f"{folder.origin}: expected a dataset's directory, or one with a calibration file for each camera, got "
            "none; pass the file"
        )
    return found


def rig_content(document: Document) -> Mapping[str, Any] | None:
    """Return the cameras of what `Rig.save` wrote; None for anything else.

    Raises
    ------
    CalibrationError
        It is of another version, or holds no cameras.
    """
    content = None if document.is_directory or not document.is_json else document.json
    if not isinstance(content, Mapping) or content.get("format") != RIG_FORMAT:
        return None
    if content.get("version") != RIG_VERSION:
        raise CalibrationError(
            f"{document.origin}: expected version {RIG_VERSION}, got {content.get('version')!r:.20}; "
            "install a newer ipm_rs"
        )
    cameras = content.get("cameras")
    if not isinstance(cameras, Mapping) or not cameras:
        raise CalibrationError(f"{document.origin}: expected cameras by their names, got {type(cameras).__name__}")
    return {str(name): camera for name, camera in cameras.items()}
