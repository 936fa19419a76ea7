"""What `streams.open` and `streams.warp` refuse, in words that name the argument."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses
from test_streams import LUT, folder, smooth, write_video

from ipm_rs import errors, streams

__all__ = ["folder"]


@pytest.mark.parametrize(
    ("name", "options", "phrases"),
    [
        ("frames", {"topic": "x"}, ("topic=", "no option", "'folder'")),
        ("a.mkv", {"rotatoin": "apply"}, ("rotatoin=", "rotation=, bits=", "'video'")),
    ],
)
def test_options_of_another_kind_are_named(folder, tmp_path, name, options, phrases):
    write_video(tmp_path / "a.mkv", [smooth(0)])
    with refuses(errors.ArgumentError, *phrases):
        streams.open(tmp_path / name, **options)


@pytest.mark.parametrize("wrong", [None, "text", {}, np.zeros(3), np.array([["a"]]), np.zeros((0, 4), np.uint8)])
def test_what_draw_returns_is_a_picture(folder, tmp_path, wrong):
    with refuses((errors.ArgumentTypeError, errors.ArgumentError), "draw: expected a function that returns a picture"):
        streams.warp(streams.open(folder), LUT, tmp_path / "out", draw=lambda view, table: wrong)
    assert not list((tmp_path / "out").iterdir())
