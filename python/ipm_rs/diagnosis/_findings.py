"""What a diagnosis finds: one thing that is odd, what usually causes it, how it is mended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding"]


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
