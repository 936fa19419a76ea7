"""A scene of DGP (DDAD, Parallel Domain): ``scene_<hash>.json`` with ``calibration`` and ``rgb`` beside it.

Each picture has its camera's pose at its own timestamp, which becomes the vehicle's, and seconds since 1970 (DDAD's
timestamps are of the year 2464; their differences are right).
"""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

from ipm_rs._core import Camera
from ipm_rs.calibration import dgp
from ipm_rs.calibration._checks import Section
from ipm_rs.calibration._files import read_json
from ipm_rs.calibration._values import items_of
from ipm_rs.errors import FileError
from ipm_rs.streams._dataset import Shot, chosen_name, stream_of
from ipm_rs.streams._frame import Stream

__all__ = ["TITLE", "read", "recognises"]

TITLE = "a scene of DGP"


def recognises(path: str) -> bool:
    """Say whether a path is the file of a scene, or its directory."""
    return len(_scenes(Path(path))) == 1


def read(path: str, camera: Any = None) -> Stream:
    """Open a scene.

    Parameters
    ----------
    path : str
        ``scene_<hash>.json`` or its directory.
    camera : str, optional
        The name of the camera, "CAMERA_01"; needed where there are several.

    Raises
    ------
    MissingFileError, FileError, CalibrationError
        A file is missing, damaged or cannot be right.
    ArgumentError, ArgumentTypeError
        There is no such camera; or several, and none is given.
    """
    files = _scenes(Path(path))
    if len(files) != 1:
        raise FileError(f"{path}: expected one scene_<hash>.json, got {len(files)}; pass the file itself")
    scene = read_json(files[0], "DGP")
    scene.require("data", "samples")
    calibrations = {
        str(key): str(sample.value("calibration_key"))
        for sample in scene.sections("samples")
        for key in items_of(sample.value("datum_keys")) or ()
    }
    pictures = [one for one in scene.sections("data") if "image" in one.section("datum")]
    names = sorted({one.section("id").text("name") for one in pictures})
    name = chosen_name("camera", camera, names, str(files[0]))
    cameras: dict[tuple[str, tuple[int, int]], Camera] = {}
    shots = []
    for one in pictures:
        if one.section("id").text("name") != name:
            continue
        image = one.section("datum").section("image")
        size = image.image_size("width", "height")
        key = calibrations.get(one.text("key"), "")
        if (key, size) not in cameras:
            file = files[0].parent / "calibration" / f"{key}.json"
            cameras[key, size] = dgp.read(file, camera=name, image_size=size)
        mounted = cameras[key, size]
        pose = dgp.pose_of(image.section("pose")) @ mounted.camera_from_vehicle
        pose[3] = (0, 0, 0, 1)
        moment = _moment(one.section("id"))
        shots.append(Shot(files[0].parent / image.text("filename"), moment, mounted, pose))
    return stream_of(path, sorted(shots, key=lambda shot: shot.timestamp or 0.0))


def _scenes(path: Path) -> list[Path]:
    if path.is_dir():
        return sorted(path.glob("scene*.json"))
    return [path] if path.name.startswith("scene") and path.suffix == ".json" and path.is_file() else []


def _moment(place: Section) -> float:
    text = place.text("timestamp")
    try:
        return datetime.datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()
    except ValueError as error:
        raise FileError(
            f"{place.where('timestamp')}: expected a moment such as 2018-11-12T01:04:09.936530Z, got {text!r:.60}"
        ) from error
