"""OpenCV's FileStorage in its three forms, YAML, JSON and XML, as one plain mapping.

A matrix becomes a float64 array of shape (rows, cols), or (rows, cols, channels) where its ``dt`` says so ("3d"):

* YAML: ``!!opencv-matrix`` over ``rows, cols, dt, data``;
* JSON: an object with ``"type_id": "opencv-matrix"`` (OpenCV 3.2 and newer);
* XML: an element with ``type_id="opencv-matrix"`` below ``<opencv_storage>``.

OpenCV 5 writes arrays of one dimension as ``opencv-nd-matrix``, with ``sizes`` in place of rows and cols.

A mapping with ``rows``, ``cols`` and ``data`` without a tag, as ROS writes it, counts as a matrix too. Plain lists stay
lists. Nothing else of the file is interpreted. XML with a DOCTYPE, which is where entities come from, is refused.
"""

from __future__ import annotations

import math
import re
import xml.parsers.expat
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs.calibration._checks import forgotten_commas
from ipm_rs.calibration._jsontext import parse_json
from ipm_rs.calibration._yaml import MAX_DEPTH, MAX_VALUES, Tagged, parse_yaml_documents, scalar
from ipm_rs.errors import CalibrationError

__all__ = ["parse_documents", "parse_storage", "plain"]

_TYPES = ("opencv-matrix", "opencv-nd-matrix")
_WORD = re.compile(r'"([^"]*)"|([^\s"]+)')
_COMMENT = re.compile(r"^[ \t]*//.*$", re.MULTILINE)
_SPECIAL = re.compile(r"(?<=[\s:,\[])(-?)\.(?:(Nan)|Inf)(?=\s*[,\]}])")
_DT = re.compile(r"\s*([0-9]{0,2})([ucwsifdh])\s*")


def parse_storage(text: str, origin: str) -> dict[str, Any]:
    """Parse a FileStorage file of any form; the first character decides which.

    Raises
    ------
    CalibrationError
        It is none of the three, or a matrix in it has not the size that it says.
    MissingExtraError
        It is YAML, and PyYAML is not installed.
    """
    documents = parse_documents(text, origin)
    if len(documents) > 1:
        raise CalibrationError(f"{origin}: expected one document, got {len(documents)}; keep the one of the camera")
    content = documents[0]
    if not isinstance(content, dict):
        raise CalibrationError(
            f"{origin}: expected named values at the top, got {type(content).__name__}; "
            "pass the file that cv2.FileStorage wrote"
        )
    result: dict[str, Any] = plain(content, origin)
    return result


def parse_documents(text: str, origin: str) -> list[Any]:
    """Parse the text of any form into plain data, matrices as they are written; YAML may have several documents."""
    start = text.lstrip()[:2]
    if start.startswith("<"):
        return [_parse_xml(text, origin)]
    if start.startswith("{"):
        try:
            return [_parse_json(text, origin)]
        except CalibrationError:
            if not start[1:].isalpha():  # {K: [...]}, YAML all in braces
                raise
    return parse_yaml_documents(text, origin)


def plain(value: Any, origin: str, name: str = "", depth: int = 0) -> Any:
    """Replace every matrix in `value` by its array; `name` is where we are, for messages."""
    if depth > MAX_DEPTH:
        raise CalibrationError(
            f"{origin}: {name[:60]}...: expected at most {MAX_DEPTH} levels, got more; no calibration nests so deep"
        )
    if isinstance(value, Tagged):
        return _matrix(value.content, f"{origin}: {name}")
    if isinstance(value, Mapping):
        if value.get("type_id") in _TYPES or {"rows", "cols", "data"} <= value.keys():
            return _matrix(value, f"{origin}: {name}")
        return {
            str(key): plain(item, origin, f"{name}.{key}" if name else str(key), depth + 1)
            for key, item in value.items()
        }
    if isinstance(value, (list, tuple)):
        return [plain(item, origin, f"{name}[{index}]", depth + 1) for index, item in enumerate(value)]
    return value


def _matrix(content: Mapping[Any, Any], where: str) -> NDArray[np.float64]:
    shape = []
    if "sizes" in content:
        sizes = content["sizes"]
        counts = [("sizes", count) for count in (sizes if isinstance(sizes, list) and sizes else [sizes])]
    else:
        counts = [(key, content.get(key)) for key in ("rows", "cols")]
    for key, count in counts:
        if isinstance(count, bool) or not isinstance(count, int) or not 0 <= count <= MAX_VALUES:
            raise CalibrationError(f"{where}: {key}: expected a count, got {count!r:.60}; write the number of {key}")
        shape.append(count)
    if "dt" in content:
        dt = _DT.fullmatch(content["dt"]) if isinstance(content["dt"], str) else None
        if dt is None:
            raise CalibrationError(
                f'{where}: dt: expected one type such as d or "3d", got {content["dt"]!r:.60}; correct it'
            )
        shape.extend([int(dt[1])] if dt[1] and dt[1] != "1" else [])
    data = content.get("data")
    if isinstance(data, np.ndarray):
        data = data.tolist()
    if not isinstance(data, (list, tuple)):
        raise CalibrationError(
            f"{where}: data: expected a list of numbers, got {data!r:.60}; write the matrix's numbers"
        )
    forgotten_commas(data, f"{where}: data")
    if len(shape) == 2 and len(data) == shape[0] and all(isinstance(row, (list, tuple)) for row in data):
        # row by row, as aslam_cv2 reads it too; a row of another length is none of this matrix
        data = [value for row in data if len(row) == shape[1] for value in row]
    for value in data:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise CalibrationError(f"{where}: data: expected numbers, got {value!r:.60}; correct it")
    count = math.prod(shape)
    if len(shape) == 2 and 1 in shape and _padded(data, count):
        # Coefficients in a row: zeros beyond what the header says are those of a longer model, which change nothing.
        data = [*data, *[0.0] * count][:count]
    if len(data) != count or len(shape) > 8:
        sizes = "sizes" if "sizes" in content else "rows and cols"
        raise CalibrationError(
            f"{where}: data: expected {' x '.join(map(str, shape[:9]))} numbers, got {len(data)}; "
            f"correct {sizes}, or fetch the file again"
        )
    return np.array([_float(value) for value in data], dtype=np.float64).reshape(shape)


def _padded(data: Sequence[float], count: int) -> bool:
    """Whether a list of another length than stated says the same: more numbers, all zero, or too few, all zero."""
    return bool(data) and not any(data[count:] if len(data) > count else data)


def _float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:  # an integer beyond float64 is no better than infinity, which the readers refuse
        return math.inf


def _parse_json(text: str, origin: str) -> Any:
    # OpenCV's own additions to JSON: lines that are comments, and .Nan and .Inf.
    text = _SPECIAL.sub(lambda word: "NaN" if word[2] else f"{word[1]}Infinity", _COMMENT.sub("", text))
    return parse_json(text, origin)


class _Xml:
    """Elements below ``<opencv_storage>`` as mappings, lists (elements named ``_``), arrays and scalars."""

    def __init__(self, origin: str) -> None:
        self.origin = origin
        self.stack: list[tuple[str, dict[str, str], dict[str, Any], list[Any], list[str]]] = []
        self.root: Any = None
        self.count = 0

    def start(self, name: str, attributes: dict[str, str]) -> None:
        if not self.stack and name != "opencv_storage":
            raise CalibrationError(
                f"{self.origin}: expected <opencv_storage>, got <{name[:40]}>; pass a file that cv2.FileStorage wrote"
            )
        self.count += 1
        if len(self.stack) > MAX_DEPTH or self.count > MAX_VALUES:
            raise CalibrationError(
                f"{self.origin}: expected at most {MAX_DEPTH} levels and {MAX_VALUES} values, got more; "
                "no calibration file is so large"
            )
        self.stack.append((name, attributes, {}, [], []))

    def text(self, text: str) -> None:
        self.stack[-1][4].append(text)

    def end(self, _name: str) -> None:
        name, attributes, children, items, texts = self.stack.pop()
        value: Any
        if children:
            value = children
            if attributes.get("type_id") in _TYPES:
                data = children.get("data", [])
                data = data if isinstance(data, list) else [data]
                value = {**children, "type_id": attributes["type_id"], "data": data}
        elif items:
            value = items
        else:
            words = [word[1] if word[2] is None else scalar(word[2]) for word in _WORD.finditer("".join(texts))]
            value = words[0] if len(words) == 1 else words
        if not self.stack:
            self.root = value
            return
        _, _, siblings, listed, _ = self.stack[-1]
        if name == "_":
            listed.append(value)
        elif name in siblings:
            raise CalibrationError(f"{self.origin}: expected every key once, got <{name[:40]}> repeated; keep one")
        else:
            siblings[name] = value

    def doctype(self, *_: Any) -> None:
        raise CalibrationError(
            f"{self.origin}: expected plain elements, got a DOCTYPE; remove it, calibration files need no entities"
        )


def _parse_xml(text: str, origin: str) -> Any:
    # The text is decoded already; the encoding that its first line may claim is passed over.
    parser = xml.parsers.expat.ParserCreate(encoding="utf-8")
    parser.buffer_text = True
    builder = _Xml(origin)
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.text
    parser.StartDoctypeDeclHandler = builder.doctype
    try:
        parser.Parse(text.encode("utf-8"), True)
    except xml.parsers.expat.ExpatError as error:
        raise CalibrationError(
            f"{origin}: expected XML, got text that is not: {error}; the file may be cut short, fetch it again"
        ) from error
    return builder.root
