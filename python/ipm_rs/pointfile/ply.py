"""PLY (the polygon file format of Stanford): the scalars of its vertices.

Read by our own lines: of the libraries, plyfile is under the GPL and trimesh hides what points carry.
Format: http://paulbourke.net/dataformats/ply/.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ipm_rs.errors import FileError
from ipm_rs.pointfile import text

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float32": "f4", "float64": "f8"},
}
NAMES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint", "f4": "float"}
NAMES["f8"] = "double"
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}

_HEADER_BYTES = 1 << 16


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)
    has_list: bool = False

    def dtype(self, order: str) -> np.dtype[Any]:
        return np.dtype([(name, order + kind) for name, kind in self.properties])


def read(path: Path) -> dict[str, NDArray[Any]]:
    """Read the scalars of the vertices."""
    with path.open("rb") as file:
        order, elements = _header(path, file)
        for element in elements:
            if element.has_list and element.count > 0:
                raise FileError(
                    f"{path}: expected numbers before and in the vertices, got a list in {element.name}, whose length "
                    "nobody knows; write the points alone"
                )
            if element.name == "vertex":
                return _values(path, file, element, order)
            _skip(path, file, element, order)
    raise FileError(f"{path}: expected vertices, got {', '.join(element.name for element in elements) or 'nothing'}")


def _skip(path: Path, file: BinaryIO, element: _Element, order: str) -> None:
    if order:
        _check_room(path, file, element, element.count * element.dtype(order).itemsize)
        file.seek(element.count * element.dtype(order).itemsize, 1)
        return
    _check_room(path, file, element, element.count)  # a line has a byte at least
    for _ in range(element.count):
        file.readline()


def _check_room(path: Path, file: BinaryIO, element: _Element, least: int) -> None:
    room = path.stat().st_size - file.tell()
    if least > room:
        raise FileError(
            f"{path}: expected {element.count} of {element.name} as its header says, got {room} bytes; it is cut short "
            "or damaged"
        )


def _header(path: Path, file: BinaryIO) -> tuple[str, list[_Element]]:
    lines: list[list[str]] = []
    while not lines or lines[-1] != ["end_header"]:
        line = file.readline(_HEADER_BYTES)
        if not line or file.tell() > _HEADER_BYTES or (not lines and line.strip() != b"ply"):
            raise FileError(f"{path}: expected a PLY file with a header, got none; is it one?")
        lines.append(line.decode("latin-1").split() or ["comment"])
    order, elements = None, list[_Element]()
    for words in lines[1:-1]:
        match words:
            case ["format", name, _] if name in ORDERS:
                order = ORDERS[name]
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count)))
            case ["property", "list", _, _, _] if elements:
                elements[-1].has_list = True
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append((name, TYPES[kind]))
            case ["comment" | "obj_info", *_]:
                pass
            case _:
                raise FileError(f"{path}: expected a line of a PLY header, got {' '.join(words)[:80]!r}")
    if order is None:
        raise FileError(f"{path}: expected a line with the format (ascii or binary) in its header, got none")
    return order, elements


def _values(path: Path, file: BinaryIO, element: _Element, order: str) -> dict[str, NDArray[Any]]:
    names = [name for name, _ in element.properties]
    if not {"x", "y", "z"} <= set(names):
        raise FileError(f"{path}: expected vertices with x, y and z, got {', '.join(names) or 'no property'}")
    if len(set(names)) != len(names):
        raise FileError(f"{path}: expected each property once, got {', '.join(names)}")
    if not order:
        columns = text.read_rows(path, file, element.count, element.properties, NAMES)
        return dict(zip(names, columns, strict=True))
    dtype = element.dtype(order)
    _check_room(path, file, element, element.count * dtype.itemsize)
    records = np.frombuffer(file.read(element.count * dtype.itemsize), dtype=dtype, count=element.count)
    return {name: records[name].astype(kind) for name, kind in element.properties}


def write(file: BinaryIO, table: dict[str, NDArray[Any]]) -> None:
    """Write a binary file, little-endian."""
    kinds = {name: column.dtype.str[1:] for name, column in table.items()}
    properties = "".join(f"property {NAMES[kind]} {name}\n" for name, kind in kinds.items())
    count = len(table["x"])
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    records = np.empty(count, dtype=[(name, "<" + kind) for name, kind in kinds.items()])
    for name, column in table.items():
        records[name] = column
    file.write(header.encode("ascii"))
    file.write(records.tobytes())
