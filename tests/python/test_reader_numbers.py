"""Numbers at the ends of float64 in the place of any number of any format's file: a camera or one of our errors."""

from __future__ import annotations

import re

import pytest
from calibration_samples import SAMPLES, Sample
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ipm_rs
from ipm_rs import errors

NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?(?![\w.])")
EXTREMES = [b"1e308", b"-1e308", b"1.7e+154", b"1e-200", b"5e-324", b"-0.0", b"0", b"1e999", b"99999999999999999999"]
TEXTS = {name: sample for name, sample in SAMPLES.items() if all(b"\0" not in data for data in sample.files.values())}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ipm_rs.CalibrationWarning")  # any numbers make odd cameras
@pytest.mark.parametrize("sample", TEXTS.values(), ids=TEXTS.keys())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_number_is_extreme(sample, data, tmp_path):
    numeric = [name for name, content in sample.files.items() if NUMBER.search(content)]
    name = data.draw(st.sampled_from(numeric))
    content = sample.files[name]
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.sampled_from(list(NUMBER.finditer(content))))
        content = content[: place.start()] + data.draw(st.sampled_from(EXTREMES)) + content[place.end() :]
    changed = Sample(sample.format, {**sample.files, name: content}, sample.source, sample.options)
    try:
        camera = ipm_rs.Camera.load(changed.write(tmp_path), **sample.options)
    except errors.IpmError as error:
        assert len(str(error)) < 8000
    else:
        camera.project([[10.0, 1.0, 0.0]])


@pytest.mark.parametrize("sample", TEXTS.values(), ids=TEXTS.keys())
def test_line_ends_and_byte_order_marks_do_not_matter(sample, tmp_path):
    dos = {name: b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n") for name, data in sample.files.items()}
    plain = ipm_rs.Camera.load(sample.write(tmp_path / "plain"), **sample.options)
    changed = Sample(sample.format, dos, sample.source, sample.options)
    assert ipm_rs.Camera.load(changed.write(tmp_path / "dos"), **sample.options) == plain
