"""One small file of every calibration format, in its real layout; the tests of all readers mutate these.

`SAMPLES` maps a name to a `Sample`: files to write, which one (or the directory) to read, and the options it needs.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import golden


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


def _json(content: Any) -> bytes:
    return json.dumps(content, indent=2).encode()


SAMPLES: dict[str, Sample] = {
    "cityscapes": Sample("cityscapes", {"aachen_000000_000019_camera.json": _json(golden.CALIBRATION)}),
    "cityscapes flat": Sample(
        "cityscapes",
        {"camera.json": _json({**golden.CALIBRATION["extrinsic"], **golden.CALIBRATION["intrinsic"]})},
    ),
    "cityscapes 3d": Sample(
        "cityscapes",
        {
            "aachen_000000_000019_gtBbox3d.json": _json(
                {
                    "imgWidth": 2048,
                    "imgHeight": 1024,
                    "sensor": {
                        "sensor_T_ISO_8855": golden.SENSOR_T_ISO_8855.tolist(),
                        "fx": 2262.52,
                        "fy": 2265.3017905988554,
                        "u0": 1096.98,
                        "v0": 513.137,
                        "baseline": 0.209313,
                    },
                    "objects": [],
                }
            )
        },
    ),
}
