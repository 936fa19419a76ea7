"""What the documentation promises of the formats: a page each, in the navigation, and drawings that are up to date."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from ipm_rs import calibration

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", calibration.FORMATS)
def test_every_format_has_a_page(name):
    page = (ROOT / "docs" / "datasets" / f"{name}.md").read_text(encoding="utf-8")
    for part in ("```python", "## Traps", f"::: ipm_rs.calibration.{name}.read", "BevGrid(", "lut.warp("):
        assert part in page, part
    assert f"from_{name}(" in page or name == "json"
    assert f"datasets/{name}.md" in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert f"({name}.md)" in (ROOT / "docs" / "datasets" / "index.md").read_text(encoding="utf-8")


def test_frames_are_drawn_by_their_script(tmp_path):
    subprocess.run([sys.executable, ROOT / "scripts" / "draw_frames.py", tmp_path / "frames.svg"], check=True)
    assert (tmp_path / "frames.svg").read_text() == (ROOT / "docs" / "images" / "frames.svg").read_text()
