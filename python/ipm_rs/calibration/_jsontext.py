"""JSON text, of bounded size, without repeated keys."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

from ipm_rs.errors import CalibrationError

__all__ = ["MAX_VALUES", "parse_json"]

MAX_VALUES = 500_000
"""Of one file, counted by its brackets and commas: the tables of whole datasets have half of that."""


def parse_json(text: str, origin: str) -> Any:
    """Content of JSON text; a key that is repeated in one object is refused."""
    if sum(text.count(mark) for mark in ",[{") > MAX_VALUES:
        raise CalibrationError(
            f"{origin}: expected at most {MAX_VALUES} values of JSON, got more; pass the calibration, not the recording"
        )
    try:
        return json.loads(text, object_pairs_hook=_object)
    except CalibrationError as error:
        raise CalibrationError(f"{origin}: {error}") from None
    except (ValueError, RecursionError) as error:
        size = len(text.encode(errors="replace"))
        raise CalibrationError(
            f"{origin}: expected JSON, got {size} byte{'' if size == 1 else 's'} that are not: {str(error)[:200]}; "
            f"{_mend(error, text)}"
        ) from error


def _mend(error: Exception, text: str) -> str:
    """Say what to do about text that does not parse: it ends too early, or something in it is wrong."""
    at = error.pos if isinstance(error, json.JSONDecodeError) else len(text)
    if not text[at:].strip():
        return "the file may be cut short, fetch it again"
    if isinstance(error, json.JSONDecodeError) and "',' delimiter" in error.msg:
        return "write commas between the values"
    return "correct it there, or fetch the file again"


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """One JSON object; a repeated key is refused, where ``json`` would keep the last silently."""
    content = dict(pairs)
    if len(content) != len(pairs):
        counts = Counter(key for key, _ in pairs)
        repeated = [repr(key[:60]) for key, count in counts.items() if count > 1]
        more = f" and {len(repeated) - 12} more" if len(repeated) > 12 else ""
        raise CalibrationError(f"expected every key once, got {', '.join(repeated[:12])}{more} repeated; keep one")
    return content
