"""How much memory this process has, for scripts that watch it."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["resident"]


def resident() -> float:
    """Return the resident memory in MB, as Linux tells it."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
