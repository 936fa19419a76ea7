"""Content of YAML, JSON or XML as a `Section`, and what a recogniser asks of its keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ipm_rs.calibration._checks import Section, describe
from ipm_rs.calibration._files import Document, Source, open_document
from ipm_rs.calibration._filestorage import plain
from ipm_rs.errors import CalibrationError

__all__ = ["has", "plain_content", "plain_section", "tree_missing"]


def plain_content(source: Any, title: str) -> tuple[str, Any]:
    """Return what to call a source, and its content, matrices as arrays."""
    if isinstance(source, (Mapping, list, tuple)):
        origin = f"{title} calibration"
        return origin, plain(source, origin)
    document = open_document(source, title, or_mapping=True)
    return document.origin, plain(document.tree, document.origin)


def plain_section(source: Source | Document, title: str) -> Section:
    """Content of a file that must hold named values, or of a mapping given in its place."""
    origin, content = plain_content(source, title)
    if not isinstance(content, Mapping):
        raise CalibrationError(
            f"{origin}: expected named values at the top, got {describe(content)}; pass a {title} file"
        )
    return Section(content, origin)


def has(content: Any, *keys: str) -> bool:
    """Whether it is a mapping with all of these keys."""
    return isinstance(content, Mapping) and all(key in content for key in keys)


def tree_missing(document: Document, *keys: str) -> str | None:
    """Say which keys a document lacks at its top; None if it has them all."""
    if document.is_directory:
        return "a directory"
    tree = document.tree
    if not isinstance(tree, Mapping):
        return "no named values"
    lacks = [repr(key) for key in keys if key not in tree]
    return f"no key {', '.join(lacks)}" if lacks else None
