"""Our own file of a `RigLut`: everything that it was built from.

A `container` of kind ``"RigLut"``. The header holds ``grid`` and ``ground`` as that of a `Lut` does, and

* ``cameras``: name to what `Camera.to_json` writes, in the rig's order;
* ``bowl``: the five numbers of a `Bowl`, or null;
* ``blend``, ``feather``, ``exclude``: as they were given;
* ``masked``: names that ``masks=`` was given for; each has a block ``mask 0``, ``mask 1``, ... of bits;
* ``dropped``: names of the cameras whose cells go to nobody.

The tables are built again when it is loaded: of six cameras and 1.4 million cells that takes 13 ms, and the file stays
small.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ipm_rs._core import Camera
from ipm_rs.errors import IpmError, LutError
from ipm_rs.files.luts import container
from ipm_rs.files.luts.native import scene_content, scene_of
from ipm_rs.rig import Bowl, Rig, RigLut

__all__ = ["load", "save"]


def save(lut: RigLut, options: dict[str, Any], dropped: list[str], path: Path) -> None:
    """Write a table by its options; raises as `container.write` does."""
    ground = lut.ground
    bowl = ground if isinstance(ground, Bowl) else None
    scene, blocks = scene_content(None, lut.grid, None if isinstance(ground, Bowl) else ground)
    masks = {name: np.asarray(mask) != 0 for name, mask in options["masks"].items() if mask is not None}
    header = {
        **scene,
        "cameras": {name: json.loads(camera.to_json()) for name, camera in lut.rig.items()},
        "bowl": None if bowl is None else bowl.__reduce__()[1],
        "blend": options["blend"],
        "feather": float(options["feather"]),
        "exclude": [np.asarray(polygon, dtype=float).tolist() for polygon in options["exclude"]],
        "masked": list(masks),
        "dropped": dropped,
    }
    for place, mask in enumerate(masks.values()):
        blocks[f"mask {place}"] = np.packbits(mask).tobytes()
    container.write(path, "RigLut", header, blocks)


def load(path: Path, file: BinaryIO) -> RigLut:
    """Build the table of a file that is open at its start.

    Raises
    ------
    LutError
        The file is damaged, or none of a `RigLut`.
    """
    content = container.read(path, file, "RigLut")
    header = content.header
    try:
        _, grid, ground = scene_of(content)
        rig = Rig({name: Camera.from_json(camera) for name, camera in header["cameras"].items()})
        masks = {}
        for place, name in enumerate(header["masked"]):
            width, height = rig[name].image_size
            bits = np.frombuffer(content.block(f"mask {place}"), np.uint8)
            if len(bits) != (width * height + 7) // 8:
                raise LutError(f"{path}: expected {width * height} bits of a mask, got {len(bits)} bytes")
            masks[name] = np.unpackbits(bits, count=width * height).reshape(height, width)
        if grid is None:
            raise LutError(f"{path}: expected a grid, got none")
        lut = RigLut(
            rig,
            grid,
            ground=ground if header["bowl"] is None else Bowl(*header["bowl"]),
            masks=masks,
            exclude=header["exclude"],
            blend=header["blend"],
            feather=header["feather"],
        )
        return lut.without(header["dropped"], missing="border") if header["dropped"] else lut
    except (AttributeError, KeyError, TypeError, ValueError) as error:  # a header of another shape, or IpmError's kinds
        if isinstance(error, IpmError) and not isinstance(error, LutError):
            raise LutError(f"{path}: expected what a RigLut is built from, got: {error}") from error
        if isinstance(error, LutError):
            raise
        raise LutError(f"{path}: expected the header of a RigLut, got one without: {error}") from error
