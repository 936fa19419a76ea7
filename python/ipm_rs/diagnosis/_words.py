"""Numbers of a diagnosis in words."""

from __future__ import annotations

import math

__all__ = ["heading", "metres_of", "offset", "percent", "pitch", "roll"]


def percent(share: float) -> str:
    """Return a part of a whole in words: nothing that is there is called 0 %."""
    return "under 0.1 %" if 0 < share < 0.0005 else f"{100 * share:.1f} %"


def metres_of(length: float) -> str:
    """Return a length in words; an infinite one passes the horizon."""
    return f"{length:.2f} m" if math.isfinite(length) else "everything (it passes the horizon)"


def offset(value: float, plus: str, minus: str) -> str:
    """Return a signed length in words."""
    return f"{abs(value):.2f} m {plus if value >= 0 else minus}"


def heading(degrees: float) -> str:
    """Return where an angle to the left points, in words."""
    side = "left" if degrees > 0 else "right"
    names = {0: "ahead", 45: f"ahead to the {side}", 90: f"to the {side}", 135: f"back to the {side}", 180: "back"}
    nearest = min(names, key=lambda angle: abs(abs(degrees) - angle))
    return f"{names[nearest]} ({abs(degrees):.1f} degrees to the {side})" if abs(degrees) >= 0.05 else "ahead"


def pitch(degrees: float) -> str:
    """Return an angle down in words."""
    return "level" if abs(degrees) < 0.05 else f"{abs(degrees):.1f} degrees {'down' if degrees > 0 else 'up'}"


def roll(degrees: float) -> str:
    """Return a roll in words."""
    if abs(degrees) < 0.05:
        return "not rolled"
    return f"rolled by {abs(degrees):.1f} degrees, {'left' if degrees > 0 else 'right'} side up"
