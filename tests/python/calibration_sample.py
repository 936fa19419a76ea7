"""What one sample of a calibration format is."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Sample:
    """Files of one calibration."""

    format: str
    """Its name in ipm_rs.calibration.FORMATS."""
    files: dict[str, bytes]
    """Relative path to content."""
    source: str = ""
    """What is passed to the reader, relative; empty for the only file, "." for the directory."""
    options: dict[str, Any] = field(default_factory=dict)
    """Keywords that Camera.load() needs: image_size, camera."""

    def write(self, directory: Path) -> Path:
        """Write the files below a directory; returns what to read."""
        for name, data in self.files.items():
            path = directory / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return directory / (self.source or next(iter(self.files)))


def as_json(content: Any) -> bytes:
    """Content of a JSON file."""
    return json.dumps(content, indent=2).encode()
