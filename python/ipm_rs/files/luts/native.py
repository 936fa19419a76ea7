"""Our own file of a `Lut`: its table, and what it was built from.

A `container` of kind ``"Lut"``. The header adds

* ``shape``: [rows, columns], ``source_size``: [width, height];
* ``camera``: as `Camera.to_json` writes it, or null;
* ``grid``: ``{"x", "y", "resolution", "sample_at"}``, or null;
* ``ground``: a height, ``{"plane": [a, b, c]}`` for z = a + b x + c y, ``{"origin", "spacing", "shape"}`` of a height
  map whose float64 heights are the block ``heights``, or null where there is no camera;
* ``scene_sha256``: SHA-256 of these three (and the heights), to tell calibrations apart without reading them.

The block ``table`` is what the pickle of a `Lut` holds; each cell of it is proved again.
"""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ipm_rs._core import BevGrid, Camera, HeightMap, Lut, Plane
from ipm_rs.errors import ArgumentError, ArgumentTypeError, IpmError, LutError
from ipm_rs.files.luts import container

__all__ = ["load", "save", "scene_content", "scene_of"]


def save(lut: Lut, path: Path) -> None:
    """Write a table; raises as `container.write` does."""
    table = lut.__reduce__()[1][0]
    scene, blocks = scene_content(lut.camera, lut.grid, lut.ground)
    header = {"shape": list(lut.shape), "source_size": list(lut.source_size), **scene}
    container.write(path, "Lut", header, {"table": table, **blocks})


def load(path: Path, file: BinaryIO, expect: Any, source_size: Any) -> Lut:
    """Read the table of a file that is open at its start, and hold it against what is expected of it.

    Raises
    ------
    LutError
        The file is damaged, or of another calibration.
    ArgumentTypeError, ArgumentError
        `expect` is neither a Camera, a BevGrid nor several of them, or `source_size` is another than the file's.
    """
    wanted = _wanted(expect)
    content = container.read(path, file, "Lut", own_checksums=("table",))
    try:
        camera, grid, ground = scene_of(content)
        lut = Lut._read_from(*content.open("table"), camera, grid, ground)
    except IpmError as error:
        raise LutError(f"{path}: expected a table and its calibration, got: {error}") from error
    for other in wanted:
        _check(path, other, camera if isinstance(other, Camera) else grid)
    if source_size is not None:
        # the core's own check of such an argument
        given = Lut.from_maps(np.zeros((1, 1)), np.zeros((1, 1)), source_size=source_size).source_size
        if given != lut.source_size:
            raise ArgumentError(f"source_size: expected {lut.source_size} of {path}, got {given}; leave it out")
    return lut


def scene_content(
    camera: Camera | None, grid: BevGrid | None, ground: float | Plane | HeightMap | None
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Return what a header holds of a scene, and its blocks."""
    blocks: dict[str, bytes] = {}
    road: Any = ground
    if isinstance(ground, Plane):
        road = {"plane": list(ground.coefficients)}
    elif isinstance(ground, HeightMap):
        road = {"origin": list(ground.origin), "spacing": list(ground.spacing), "shape": list(ground.shape)}
        blocks["heights"] = np.ascontiguousarray(ground.heights, "<f8").tobytes()
    content = {
        "camera": None if camera is None else json.loads(camera.to_json()),
        "grid": None
        if grid is None
        else {"x": grid.x, "y": grid.y, "resolution": grid.resolution, "sample_at": grid.sample_at},
        "ground": road,
    }
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    digest = hashlib.sha256(text + b"".join(blocks.values()))
    return {**content, "scene_sha256": digest.hexdigest()}, blocks


def scene_of(content: container.Content) -> tuple[Camera | None, BevGrid | None, Any]:
    """Return camera, grid and ground of a header.

    Raises
    ------
    IpmError
        They are of a kind that this version does not know, or cannot be.
    """
    header = content.header
    try:
        camera = None if header["camera"] is None else Camera.from_json(header["camera"])
        grid = None if header["grid"] is None else BevGrid(**header["grid"])
        ground: Any = header["ground"]
        if isinstance(ground, dict) and "plane" in ground:
            ground = Plane.from_coefficients(*ground["plane"])
        elif isinstance(ground, dict):
            shape, heights = ground["shape"], content.block("heights")
            if math.prod(shape) * 8 != len(heights):
                raise LutError(f"{content.path}: expected {shape} heights, got {len(heights)} bytes; it is damaged")
            values = np.frombuffer(heights, "<f8").reshape(shape)
            ground = HeightMap(values, origin=ground["origin"], spacing=ground["spacing"])
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, IpmError):
            raise
        raise LutError(f"{content.path}: expected camera, grid and ground, got a header without: {error}") from error
    return camera, grid, ground


def _wanted(expect: Any) -> tuple[Camera | BevGrid, ...]:
    several = tuple(expect) if isinstance(expect, (tuple, list)) else () if expect is None else (expect,)
    for one in several:
        if not isinstance(one, (Camera, BevGrid)):
            raise ArgumentTypeError(
                f"expect: expected a Camera, a BevGrid or a tuple of them, got {type(one).__name__}; pass what the "
                "table should be of"
            )
    return several


def _check(path: Path, expected: Camera | BevGrid, found: Camera | BevGrid | None) -> None:
    """Refuse a table of something else, and say in what it differs."""
    if found == expected:
        return
    kind = type(expected).__name__
    if found is None:
        got = f"one that is of no {kind}: it was made of maps or of a homography"
    else:
        names = (
            ("image_size", "intrinsics", "lens", "camera_from_vehicle")
            if isinstance(expected, Camera)
            else ("x", "y", "resolution", "sample_at")
        )
        differ = [name for name in names if not _same(getattr(found, name), getattr(expected, name))]
        got = f"one of another, with another {', '.join(differ) or 'mask'}"
    raise LutError(f"{path}: expected the table of the {kind} that was given, got {got}; build and save it again")


def _same(one: Any, other: Any) -> bool:
    return bool(np.array_equal(one, other)) if isinstance(one, np.ndarray) else bool(one == other)
