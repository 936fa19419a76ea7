"""Large matrices in OpenCV's FileStorage: written as YAML, read from YAML, XML and JSON.

`ipm_rs.calibration` reads these files too, whole and through PyYAML, which takes minutes for the million numbers of a
map. Here only matrices and whole numbers at the top are looked for, by what FileStorage writes.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import LutError
from ipm_rs.files.atomic import atomically

__all__ = ["lines_of", "number_texts", "read", "write"]

_TYPES = {"u": np.uint8, "c": np.int8, "w": np.uint16, "s": np.int16, "i": np.int32, "f": np.float32, "d": np.float64}
_BLOCK = 1 << 16

_YAML = re.compile(
    r"^(?P<name>\w+):\s*!!opencv-matrix\s+rows:\s*(?P<rows>\d{1,9})\s+cols:\s*(?P<cols>\d{1,9})\s+"
    r'dt:\s*"?(?P<dt>\w{1,3})"?\s+data:\s*\[(?P<data>[^\]]*)\]',
    re.MULTILINE,
)
_XML = re.compile(
    r'<(?P<name>\w+)\s+type_id="opencv-matrix">\s*<rows>(?P<rows>\d{1,9})</rows>\s*<cols>(?P<cols>\d{1,9})</cols>\s*'
    r'<dt>"?(?P<dt>\w{1,3})"?</dt>\s*<data>(?P<data>[^<]*)</data>'
)
_JSON = re.compile(
    r'"(?P<name>\w+)":\s*\{\s*"type_id":\s*"opencv-matrix",\s*"rows":\s*(?P<rows>\d{1,9}),\s*"cols":\s*(?P<cols>\d{1,9}),'
    r'\s*"dt":\s*"(?P<dt>\w{1,3})",\s*"data":\s*\[(?P<data>[^\]]*)\]'
)
_NUMBER = re.compile(r'(?:^|["<\s])(source_width|source_height)"?[:>]\s*(\d{1,9})\b')


def write(path: Path, values: Mapping[str, int | NDArray[Any]]) -> None:
    """Write numbers and matrices as YAML that ``cv2.FileStorage`` reads, whole or not at all.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    letters = {np.dtype(kind): letter for letter, kind in _TYPES.items()}
    with atomically(path) as file:
        file.write(b"%YAML:1.0\n---\n")
        for name, value in values.items():
            if isinstance(value, int):
                file.write(f"{name}: {value}\n".encode())
                continue
            channels = value.shape[2] if value.ndim == 3 else 1
            letter = letters[value.dtype]
            dt = letter if channels == 1 else f'"{channels}{letter}"'
            rows, cols = value.shape[:2]
            file.write(f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: {dt}\n   data: [ ".encode())
            # OpenCV's parser takes no line of more than some kilobytes
            for index, line in enumerate(lines_of(number_texts(value))):
                file.write(f"{',' if index else ''}{chr(10) if index else ''}       {line}".encode())
            file.write(b" ]\n")


def number_texts(values: NDArray[Any]) -> Iterator[str]:
    """Return the numbers of an array as text, float32 with the nine digits that bring the same bits back."""
    flat = values.ravel()
    form = "%.9g" if flat.dtype == np.float32 else "%.17g" if flat.dtype.kind == "f" else "%d"
    for start in range(0, flat.size, _BLOCK):
        block = flat[start : start + _BLOCK].tolist()
        yield from (",".join([form] * len(block)) % tuple(block)).split(",")


def lines_of(texts: Iterable[str]) -> Iterator[str]:
    """Join texts to lines of eight, with commas between them and none at the ends."""
    iterator = iter(texts)
    while line := ", ".join(islice(iterator, 8)):
        yield line


def read(path: Path, data: bytes) -> dict[str, Any]:
    """Read the matrices of a file, and the source's size if it has one.

    Raises
    ------
    LutError
        A matrix has not the numbers that it says.
    """
    text = data.decode("utf-8", "replace")
    values: dict[str, Any] = {name: int(number) for name, number in _NUMBER.findall(text)}
    for pattern in (_YAML, _XML, _JSON):
        for found in pattern.finditer(text):
            values[found["name"]] = _matrix(path, found)
    return values


def _matrix(path: Path, found: re.Match[str]) -> NDArray[Any]:
    name, dt = found["name"], found["dt"]
    channels, kind = int(dt[:-1]) if dt[:-1].isdecimal() else 1, _TYPES.get(dt[-1])
    shape = (int(found["rows"]), int(found["cols"]), *([channels] if channels > 1 else []))
    words = found["data"].replace(",", " ").replace(".Nan", "nan").replace(".Inf", "inf").split()
    if kind is None or len(words) != int(found["rows"]) * int(found["cols"]) * channels:
        raise LutError(
            f"{path}: {name}: expected {' x '.join(map(str, shape))} numbers, got {len(words)} of type {dt}; the "
            "file is damaged, fetch or write it again"
        )
    try:
        with np.errstate(over="ignore"):  # what float32 has no number for is infinite, and so nowhere
            return np.array(words, np.float64).astype(kind).reshape(shape)
    except (ValueError, OverflowError) as error:
        raise LutError(f"{path}: {name}: expected numbers, got: {error!s:.80}; the file is damaged") from error
