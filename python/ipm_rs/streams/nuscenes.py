"""A scene of nuScenes or Lyft: the directory that holds ``v1.0-mini``, ``samples`` and ``sweeps``.

The tables ``sample_data``, ``sample``, ``scene``, ``calibrated_sensor``, ``sensor`` and ``ego_pose`` say which pictures
there are. Each has its own pose, at its own timestamp (seconds since 1970), which is taken as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ipm_rs._arguments import flag_of
from ipm_rs._core import Camera
from ipm_rs.calibration import nuscenes
from ipm_rs.errors import FileError
from ipm_rs.files.atomic import reading
from ipm_rs.streams._dataset import Shot, chosen_name, stream_of
from ipm_rs.streams._frame import Stream
from ipm_rs.trajectory._tables import json_records
from ipm_rs.trajectory._text import assembled

__all__ = ["TITLE", "read", "recognises"]

TITLE = "a scene of nuScenes"
_DATA = "sample_data.json"


def recognises(path: str) -> bool:
    """Say whether a path is the directory of the dataset or of its tables."""
    return bool(_tables(Path(path)))


def read(path: str, camera: Any = "CAM_FRONT", scene: Any = None, sweeps: bool = False) -> Stream:
    """Open a scene.

    Parameters
    ----------
    path : str
        The directory of the dataset, or that of the tables in it.
    camera : str
        The name of the sensor.
    scene : str, optional
        ``"scene-0061"`` or its token; needed where the tables have several.
    sweeps : bool
        All pictures, 12 a second, and not only the annotated ones, 2 a second.

    Raises
    ------
    MissingFileError, FileError, CalibrationError
        A table is missing or damaged, or its numbers cannot be right.
    ArgumentError, ArgumentTypeError
        There is no such camera or scene; or several scenes, and none is given.
    """
    flag_of("sweeps", sweeps)
    found = _tables(Path(path))
    if len(found) != 1:
        got = ", ".join(place.name for place in found) or "none"
        raise FileError(f"{path}: expected one directory with {_DATA}, got {got}; pass one")
    tables = found[0]
    root = tables.parent if (tables.parent / "samples").is_dir() or not (tables / "samples").is_dir() else tables
    with reading(tables, "tables of nuScenes"):
        scenes = {one["token"]: one["name"] for one in json_records(tables / "scene.json")}
        wanted = scene if isinstance(scene, str) and scene in scenes else None
        if wanted is None:
            named = chosen_name("scene", scene, sorted(scenes.values()), str(tables))
            wanted = next(token for token, other in scenes.items() if other == named)
        samples = {one["token"] for one in json_records(tables / "sample.json") if one["scene_token"] == wanted}
        channels = {one["token"]: one["channel"] for one in json_records(tables / "sensor.json")}
        mounted = json_records(tables / "calibrated_sensor.json")
        names = {one["token"]: channels.get(one["sensor_token"], "") for one in mounted if one.get("camera_intrinsic")}
        chosen = chosen_name("camera", camera, sorted(set(names.values())), str(tables))
        records = [
            one
            for one in json_records(tables / _DATA)
            if one["sample_token"] in samples
            and names.get(one["calibrated_sensor_token"]) == chosen
            and (sweeps or one["is_key_frame"])
        ]
        records.sort(key=lambda one: one["timestamp"])
        poses = _poses(tables / "ego_pose.json", [one["ego_pose_token"] for one in records])
        cameras: dict[str, Camera] = {}
        shots = []
        for record, pose in zip(records, poses, strict=True):
            token = record["calibrated_sensor_token"]
            if token not in cameras:
                size = (int(record["width"]), int(record["height"]))
                cameras[token] = nuscenes.read(mounted, camera=token, image_size=size)
            shots.append(Shot(root / record["filename"], record["timestamp"] * 1e-6, cameras[token], pose))
    return stream_of(path, shots, ground=0.0)


def _tables(path: Path) -> list[Path]:
    """Return the directories of tables: the one that is given, or those in it."""
    if (path / _DATA).is_file():
        return [path]
    return sorted(place.parent for place in path.glob(f"*/{_DATA}")) if path.is_dir() else []


def _poses(path: Path, tokens: list[str]) -> list[Any]:
    """Return ``map_from_vehicle`` of some records of the table, in their order."""
    wanted = set(tokens)
    found: dict[str, Mapping[str, Any]] = {one["token"]: one for one in json_records(path) if one["token"] in wanted}
    places = np.array([found[token]["translation"] for token in tokens], float).reshape(-1, 3)
    turns = np.array([found[token]["rotation"] for token in tokens], float).reshape(-1, 4)
    return list(assembled(str(path), places, turns))
