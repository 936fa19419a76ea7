"""Depth images as files: CARLA's colour code, 16-bit images with a scale, and float metres."""

from __future__ import annotations

import math
import warnings
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ipm_rs
from ipm_rs.errors import ArgumentError, FileError, ImageError
from ipm_rs.files import images
from ipm_rs.files.atomic import check_source, reading
from ipm_rs.pointfile.rows import check_header, mapped

ARRAYS = (".npy", ".npz")
_MOST_PIXELS = 1 << 28


@dataclass(frozen=True)
class Header:
    """What is known of a depth image before it is decoded: ``size`` is (width, height), ``scale`` metres per unit."""

    path: Path
    size: tuple[int, int]
    kind: str
    scale: float | None


def probe(path: Path, scale: float | None) -> Header:
    """Read the header of a depth image, and check that its kind and the scale go together.

    Raises
    ------
    MissingFileError, FileError, ImageError
        There is no such file, or it is no depth image.
    ArgumentError
        A scale is missing, or there is nothing to scale.
    """
    if path.suffix.lower() in ARRAYS:
        array = _array(path)
        kind, size = array.dtype.name, (array.shape[1], array.shape[0])
    else:
        header = images.probe(path)
        kind, size = {"RGB": "rgb", "RGBA": "rgba", "I;16": "uint16", "F": "float32"}.get(header.mode, ""), header.size
        if not kind:
            raise ImageError(
                f"{path}: expected depth: RGB or RGBA in CARLA's code, a 16-bit image or a float TIFF, got "
                f"mode {header.mode}"
            )
    if kind == "uint16" and scale is None:
        raise ArgumentError(
            f"{path}: expected --depth-scale for a 16-bit image, got none; 0.001 if it holds millimetres, 0.00390625 "
            "(1 / 256) for KITTI"
        )
    if kind in ("rgb", "rgba") and scale is not None:
        raise ArgumentError(
            f"{path}: expected no --depth-scale for CARLA's colour code, which is in metres, got {scale:g}"
        )
    return Header(path, size, kind, scale if kind not in ("rgb", "rgba") else None)


def read(header: Header) -> NDArray[Any]:
    """Decode a depth image: (H, W) float32 or float64 metres, or uint16 units.

    Raises as :func:`probe` does.
    """
    if header.path.suffix.lower() in ARRAYS:
        return np.ascontiguousarray(_array(header.path))
    pixels, _ = images.read(header.path)
    if header.kind == "rgb":
        return ipm_rs.decode_carla_depth(pixels, order="rgb")
    if header.kind == "rgba":
        return ipm_rs.decode_carla_depth(pixels, order="rgba")
    return pixels


def _array(path: Path) -> NDArray[Any]:
    """Return the array of a ``.npy`` file, mapped, or the only one (or "depth") of an ``.npz``."""
    check_source(path, "a depth image")
    with reading(path, "an array of depth"):
        array = _packed(path) if path.suffix.lower() == ".npz" else mapped(path)
    if array.ndim != 2 or array.size == 0 or array.dtype.name not in ("float32", "float64", "uint16"):
        raise ImageError(
            f"{path}: expected (H, W) float32 or float64 metres, or uint16 with --depth-scale, got {array.shape} "
            f"{array.dtype}"
        )
    return array


def _packed(path: Path) -> NDArray[Any]:
    """Unpack an array of an ``.npz``; what its header claims is held against the bytes that there are."""
    with zipfile.ZipFile(path) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
        name = "depth" if "depth" in names else names[0] if len(names) == 1 else None
        if name is None:
            raise FileError(f'{path}: expected one array, or one named "depth", got {", ".join(names)[:200]}')
        member = archive.getinfo(f"{name}.npy")
        if member.file_size > 8 * _MOST_PIXELS:
            raise FileError(f"{path}: expected a depth image, got an array that claims {member.file_size} bytes")
        with archive.open(member) as file:
            check_header(path, file.read(12))
            file.seek(0)
            version = np.lib.format.read_magic(file)
            read_header = {
                (1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0,
            }[version]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what NumPy and Python say of odd headers
                shape, fortran, dtype = read_header(file)
            if dtype.hasobject or math.prod(shape) * dtype.itemsize != member.file_size - file.tell():
                raise FileError(
                    f"{path}: expected {shape} of {dtype} as its header says, got {member.file_size} bytes; damaged"
                )
            return np.frombuffer(file.read(), dtype).reshape(shape, order="F" if fortran else "C")
