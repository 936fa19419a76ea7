"""YAML as calibration files use it, read without trust.

PyYAML (extra ``yaml``) splits the text into events; everything after that is here.

Why not ``yaml.safe_load``: it refuses OpenCV's ``%YAML:1.0`` and ``!!opencv-matrix``, keeps the last of two equal keys,
turns ``1e-05`` into text, ``1:30`` into 90 and ``no`` into False, and lets a few lines of aliases stand for gigabytes.

Here a file is plain data: mappings with text keys, lists, text, numbers, booleans, None, and `Tagged` for OpenCV's
matrices. No other tag is accepted, so none can run anything. Depth and number of values are limited, and each use of an
alias counts as all that it stands for.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from types import ModuleType
from typing import Any, NamedTuple

from ipm_rs.errors import CalibrationError, MissingExtraError

__all__ = ["MAX_DEPTH", "MAX_VALUES", "Tagged", "parse_yaml", "parse_yaml_documents", "scalar"]

# PyYAML takes 10 microseconds for each value: a second in all.
MAX_CHARACTERS = 4 << 20
MAX_DEPTH = 32
MAX_VALUES = 100_000

_CORE = "tag:yaml.org,2002:"
_OPENCV_TAGS = ("opencv-matrix", "opencv-nd-matrix")
_PLAIN_TAGS = ("map", "seq", "str", "int", "float", "bool", "null")

_INTEGER = re.compile(r"[+-]?[0-9]{1,40}")
_FLOAT = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
_SPECIAL = re.compile(r"([+-]?)\.?(inf|nan)", re.IGNORECASE)
_HEADER = re.compile(r"\A%YAML:1\.[0-9]+[^\n]*")
_NO_SPACE = re.compile(r"^([ ]*[A-Za-z_][\w.-]*):(?=[^\s:])", re.MULTILINE)
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}


class Tagged(NamedTuple):
    """A mapping under one of OpenCV's tags."""

    tag: str
    content: dict[str, Any]


def parse_yaml(text: str, origin: str) -> Any:
    """Parse one YAML document into plain data; empty ones after it, as dumps end with, do not count.

    Raises
    ------
    MissingExtraError, CalibrationError
        As `parse_yaml_documents`, or there are several documents.
    """
    documents = parse_yaml_documents(text, origin)
    if len(documents) > 1:
        raise CalibrationError(
            f"{origin}: expected one document, got {len(documents)}, parted by '---'; keep the one that holds the "
            "camera"
        )
    return documents[0]


def parse_yaml_documents(text: str, origin: str) -> list[Any]:
    """Parse YAML into plain data, one value for each document that is not empty; ``[None]`` if all are.

    Parameters
    ----------
    text : str
        The content of the file. OpenCV's first line ``%YAML:1.0`` is accepted, and, under it, keys without a space
        after the colon, which old versions of OpenCV wrote.
    origin : str
        What messages call the file.

    Raises
    ------
    MissingExtraError
        PyYAML is not installed.
    CalibrationError
        The text is not YAML, holds a tag other than those of OpenCV's matrices, a key twice, or more depth or values
        than a calibration has.
    """
    if len(text) > MAX_CHARACTERS:
        raise CalibrationError(
            f"{origin}: expected at most {MAX_CHARACTERS >> 20} MB of YAML, got more; "
            "pass the calibration, not the recording"
        )
    yaml = _require_yaml(origin)
    header = _HEADER.match(text)
    if header:  # an empty line in its place keeps line numbers right
        text = _NO_SPACE.sub(r"\1: ", text[header.end() :])
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        events = yaml.parse(text, Loader=loader)
        return _Builder(yaml, events, origin).documents()
    except yaml.YAMLError as error:
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "cannot be parsed"
        where = _where(getattr(error, "problem_mark", None))
        if "nesting depth" in problem:  # libyaml looks ahead, and has a limit of its own
            raise CalibrationError(
                f"{origin}: expected at most {MAX_DEPTH} levels, got more{where}; no calibration file nests so deep"
            ) from error
        raise CalibrationError(
            f"{origin}: expected YAML, got text that is not{where}: {problem}; "
            "the file may be cut short or of another format, fetch it again"
        ) from error


def scalar(text: str) -> Any:
    """Value of a word without quotes: None, a boolean, a number, or the text itself."""
    lower = text.lower()
    if lower in _WORDS:
        return _WORDS[lower]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    special = _SPECIAL.fullmatch(text)
    if special:
        return float(special[1] + special[2])
    return text


def _require_yaml(origin: str) -> ModuleType:
    try:
        return importlib.import_module("yaml")
    except ImportError as error:
        raise MissingExtraError(
            f'{origin}: YAML files need PyYAML, which is not installed; pip install "ipm-rs[yaml]"'
        ) from error


def _where(mark: Any) -> str:
    return "" if mark is None else f" in line {mark.line + 1}"


class _Builder:
    """Builds values from events; recursion is bounded by `MAX_DEPTH`, work by `MAX_VALUES`."""

    def __init__(self, yaml: ModuleType, events: Iterator[Any], origin: str) -> None:
        self.yaml, self.events, self.origin = yaml, events, origin
        self.anchors: dict[str, tuple[Any, int]] = {}
        self.count = 0

    def documents(self) -> list[Any]:
        values = []
        for event in self.events:
            if isinstance(event, self.yaml.DocumentStartEvent):
                self.anchors.clear()  # they end with their document
                value = self.value(next(self.events), 0)
                if value is not None:
                    values.append(value)
        return values or [None]

    def value(self, event: Any, depth: int) -> Any:
        yaml = self.yaml
        value: Any
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self.anchors:  # also an alias inside of what it names
                raise self.error(event, "an alias of something above", f"*{event.anchor}", "write the value out")
            value, size = self.anchors[event.anchor]
            self.spend(event, size)
            return value
        if depth > MAX_DEPTH:
            raise self.error(event, f"at most {MAX_DEPTH} levels", "more", "no calibration file nests so deep")
        before = self.count
        self.spend(event, 1)
        tag = self.tag(event)
        if isinstance(event, yaml.ScalarEvent):
            # A quoted word is text; so is one under the tag !!str.
            value = event.value if tag == "str" or not (event.implicit[0] or tag) else scalar(event.value)
        elif isinstance(event, yaml.SequenceStartEvent):
            value = [self.value(item, depth + 1) for item in self.until(yaml.SequenceEndEvent)]
        else:
            value = self.mapping(depth)
        if tag in _OPENCV_TAGS:
            if not isinstance(value, dict):
                raise self.error(event, f"dt, data and a size under !!{tag}", "no mapping", "write it as OpenCV does")
            value = Tagged(tag, value)
        if event.anchor is not None:
            self.anchors[event.anchor] = value, self.count - before
        return value

    def mapping(self, depth: int) -> dict[str, Any]:
        content: dict[str, Any] = {}
        for event in self.until(self.yaml.MappingEndEvent):
            if not isinstance(event, self.yaml.ScalarEvent):
                raise self.error(event, "plain words as keys", "something else", "write the key out")
            if event.value in content:
                raise self.error(event, "every key once", f"{event.value!r} repeated", "keep one")
            self.tag(event)
            content[event.value] = self.value(next(self.events), depth + 1)
        return content

    def until(self, end: type) -> Iterator[Any]:
        for event in self.events:
            if isinstance(event, end):
                return
            yield event

    def tag(self, event: Any) -> str | None:
        """Return the tag's name; refuse what is neither plain data nor a matrix of OpenCV."""
        tag = event.tag
        if tag is None or tag == "!":
            return None
        name = str(tag).removeprefix(_CORE)
        if tag != name and (name in _PLAIN_TAGS or name in _OPENCV_TAGS):
            return name
        written = f"!!{name}" if tag != name else name
        raise self.error(
            event,
            "plain values and OpenCV's matrices",
            f"the tag {written[:60]}",
            "write the values out; no tag is run",
        )

    def spend(self, event: Any, values: int) -> None:
        self.count += values
        if self.count > MAX_VALUES:
            raise self.error(
                event,
                f"at most {MAX_VALUES} values",
                "more",
                "pass the calibration, not the recording; aliases count as what they stand for, write values out",
            )

    def error(self, event: Any, expected: str, got: str, mend: str) -> CalibrationError:
        return CalibrationError(f"{self.origin}: expected {expected}, got {got}{_where(event.start_mark)}; {mend}")
