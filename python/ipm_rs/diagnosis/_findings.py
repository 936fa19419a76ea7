"""What a diagnosis finds: one thing that is odd, what usually causes it, how it is mended."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding", "worst_first"]

_SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True)
class Finding:
    """One thing that the doctor found."""

    severity: Literal["error", "warning", "note"]
    """"error": no view comes of it, or a wrong one; "warning": possible and usually a mistake; "note": good to know."""
    code: str
    """A name that does not change, for programs: "inverse-pose", "streaks"."""
    text: str
    """What is odd."""
    mend: str
    """What to do about it; empty where the text says it."""

    def __str__(self) -> str:
        return f"{self.severity}: {self.text}{f'; {self.mend}' if self.mend else ''}"


def worst_first(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings by their severity, those of one in the order that they have."""
    return tuple(sorted(findings, key=lambda finding: _SEVERITIES.index(finding.severity)))
