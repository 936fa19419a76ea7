"""Fixtures of the documents' own job, and the Hypothesis profiles."""

from __future__ import annotations

import os
from pathlib import Path

import golden
import pytest
from hypothesis import settings

import ipm_rs

# Deterministic by default, so a red run is red again; HYPOTHESIS_PROFILE=thorough looks further, at random.
settings.register_profile("default", derandomize=True, deadline=None, max_examples=60, database=None)
settings.register_profile("thorough", deadline=None, max_examples=2000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))

# Modules that take more than 3.5 seconds of a core, 550 of 640 together; `make check` leaves them out as it does tests
# that are marked slow themselves. Measured by the sums of `pytest --durations=0 -vv`.
SLOW_MODULES = frozenset(
    """
    api_fuzz area board borders calibration_formats camera_geometry cli cli_batch demo doctor interrupts lenses
    lut_files mosaic_out mosaic_refine mosaic_store out_of_memory pointfile_damage processes raster reader_kalibr
    reader_mutations reader_npz reader_numbers reader_recognition reference_footprints refine_drive refine_overlaps
    refine_points stacks streams_bags threads warp
    """.split()
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of slow modules."""
    for item in items:
        if item.path.stem.removeprefix("test_") in SLOW_MODULES:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real images and calibrations beside the checkout; they are not part of the project."""
    folder = Path(__file__).resolve().parents[3] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("needs ../shared/data beside the checkout")
    return folder


@pytest.fixture(scope="session")
def seed_camera() -> ipm_rs.Camera:
    """Cityscapes camera of the documents."""
    return ipm_rs.Camera.from_cityscapes(golden.CALIBRATION)


@pytest.fixture(scope="session")
def seed_grid() -> ipm_rs.BevGrid:
    """The documents' grid, 860 x 800, corner sampled."""
    return ipm_rs.BevGrid(x=golden.GRID_X, y=golden.GRID_Y, resolution=golden.GRID_RESOLUTION, sample_at="corner")


@pytest.fixture(scope="session")
def seed_lut(seed_camera: ipm_rs.Camera, seed_grid: ipm_rs.BevGrid) -> ipm_rs.Lut:
    """The documents' table: 2048 x 1024 pixels to 860 x 800 cells."""
    return ipm_rs.Lut(seed_camera, seed_grid)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say how many tests were left out for want of real data: a green run without it has seen less."""
    skipped = terminalreporter.stats.get("skipped", [])
    count = sum("shared/data" in str(report.longrepr) for report in skipped)
    if count:
        terminalreporter.write_line(f"{count} tests of real data were left out: there is no ../shared/data here")
