"""Mutated calibration files of every format, and the real ones where they are: a camera or one of our errors."""

from __future__ import annotations

import pytest
from calibration_mutations import mutate, real
from calibration_samples import SAMPLES

pytestmark = pytest.mark.slow


@pytest.mark.filterwarnings("ignore::ipm_rs.CalibrationWarning")  # any numbers make odd cameras
def test_mutated_samples(tmp_path):
    assert not [f"{title}: {problem}: {data!r}" for title, problem, data in mutate(SAMPLES, 1500, 1, tmp_path)]


@pytest.mark.filterwarnings("ignore::ipm_rs.CalibrationWarning")  # any numbers make odd cameras
def test_mutated_real_files(tmp_path, shared_data):
    assert shared_data
    samples = real()
    if not samples:
        pytest.skip("no real calibrations")
    assert not [f"{title}: {problem}: {data!r}" for title, problem, data in mutate(samples, 500, 2, tmp_path)]
