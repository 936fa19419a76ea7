"""What `streams.open` and `streams.warp` refuse, in words that name the argument."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import refuses
from test_streams import CAMERA, LUT, folder, smooth, write_video

from ipm_rs import errors, streams
from ipm_rs.cli import main

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


def test_masks_of_the_command_replace_no_input(folder, tmp_path, capsys):
    CAMERA.save(tmp_path / "camera.json")
    write_video(tmp_path / "a.mp4", [smooth(0)])
    before = (tmp_path / "a.mp4").read_bytes(), (folder / "1.png").read_bytes()
    grid = ["--x", "2", "14", "--y", "-5", "5", "--resolution", "0.25", "--force", "-o", str(tmp_path / "b.mp4")]
    for source, option, target in (("a.mp4", "--mask-video", "a.mp4"), ("frames", "--mask", "frames/1.png")):
        words = [str(tmp_path / "camera.json"), str(tmp_path / source), option, str(tmp_path / target)]
        assert main(["warp", *words, *grid]) == 2
        assert "got an input" in capsys.readouterr().err
    assert before == ((tmp_path / "a.mp4").read_bytes(), (folder / "1.png").read_bytes())
