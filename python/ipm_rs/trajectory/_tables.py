"""Poses in tables of datasets: nuScenes' ``ego_pose.json``, Argoverse 2's ``city_SE3_egovehicle.feather``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ipm_rs.errors import FileError, MissingExtraError
from ipm_rs.files.atomic import check_source, reading
from ipm_rs.trajectory._quaternions import Array
from ipm_rs.trajectory._text import assembled

__all__ = ["argoverse2", "feather", "json_records", "nuscenes"]

_MAX_BYTES = 2 << 30  # the whole of nuScenes has 0.7 GB of poses


def nuscenes(path: Path) -> tuple[Array, Array]:
    """Read ``ego_pose.json``: records with ``timestamp`` in microseconds, ``translation``, ``rotation`` w x y z."""
    file = path / "ego_pose.json" if path.is_dir() else path
    records = json_records(file)
    times, places, turns = [], [], []
    for index, record in enumerate(records):
        try:
            times.append(int(record["timestamp"]) * 1e-6)
            places.append([float(x) for x in record["translation"]])
            turns.append([float(x) for x in record["rotation"]])
            if len(places[-1]) != 3 or len(turns[-1]) != 4:
                raise ValueError
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise FileError(
                f"{file}: record {index}: expected timestamp, translation (3) and rotation (4), got others; pass "
                "ego_pose.json"
            ) from error
    return np.array(times), assembled(str(file), np.array(places), np.array(turns))


def argoverse2(path: Path) -> tuple[Array, Array]:
    """Read ``city_SE3_egovehicle.feather``: ``timestamp_ns, qw, qx, qy, qz, tx_m, ty_m, tz_m``."""
    file = path / "city_SE3_egovehicle.feather" if path.is_dir() else path
    table = feather(file)
    names = ("timestamp_ns", "tx_m", "ty_m", "tz_m", "qw", "qx", "qy", "qz")
    lacking = [name for name in names if name not in table]
    if lacking:
        raise FileError(f"{file}: expected columns {', '.join(names)}, got none named {', '.join(lacking)}")
    columns = np.stack([np.asarray(table[name], np.float64) for name in names[1:]], -1)
    if not len(columns):
        raise FileError(f"{file}: expected poses, got an empty table; fetch it again")
    return np.asarray(table["timestamp_ns"], np.float64) * 1e-9, assembled(str(file), columns[:, :3], columns[:, 3:])


def json_records(path: Path) -> list[Mapping[str, Any]]:
    """Return the records of a table of nuScenes."""
    check_source(path, "a table of nuScenes")
    if path.stat().st_size > _MAX_BYTES:
        raise FileError(f"{path}: expected a table of at most {_MAX_BYTES >> 30} GB, got more; pass another")
    with reading(path, "a table of nuScenes, JSON"):
        content = json.loads(path.read_bytes())
    if not isinstance(content, list) or not content or not all(isinstance(record, dict) for record in content):
        raise FileError(f"{path}: expected a list of records, got other JSON; pass a table of the dataset")
    return content


def feather(path: Path) -> dict[str, Any]:
    """Return the columns of a feather file as lists."""
    check_source(path, "a feather file")
    try:
        from pyarrow import ipc, memory_map
    except ImportError as error:
        raise MissingExtraError(
            f"{path}: expected pyarrow, which reads feather files, found none; install it with: "
            'pip install "ipm-rs[arrow]"'
        ) from error
    with reading(path, "a feather file"), memory_map(str(path)) as source:
        table = ipc.open_file(source).read_all()
        return {name: table.column(name).to_numpy(zero_copy_only=False) for name in table.column_names}
