"""What notebooks show: never an exception, text always, a picture where Pillow is there."""

from __future__ import annotations

import base64
import io
import re
import sys

import numpy as np
import pytest
from PIL import Image

import ipm_rs
from ipm_rs.pointfile import Cloud

CAMERA = ipm_rs.Camera.from_euler(
    [[300.0, 0, 159.5], [0, 300, 99.5], [0, 0, 1]], image_size=(320, 200), position=(1.0, 0, 1.5), pitch=0.2
)
GRID = ipm_rs.BevGrid(x=(3, 13), y=(-4, 4), resolution=0.1)
POINTS = np.random.default_rng(0).uniform((3, -4, 0), (13, 4, 2), (500, 3))
SHOWN = {
    "Camera": (CAMERA, True),
    "BevGrid": (GRID, False),
    "Lut": (ipm_rs.Lut(CAMERA, GRID), True),
    "Rig": (ipm_rs.Rig({"front <1>": CAMERA}), False),
    "RigLut": (ipm_rs.RigLut({"front": CAMERA}, GRID), True),
    "Layers": (ipm_rs.rasterize(POINTS, GRID), True),
    "Cloud": (Cloud(POINTS, {"intensity": POINTS[:, 0]}), True),
}


@pytest.mark.parametrize("name", SHOWN)
def test_text_and_picture(name: str, monkeypatch: pytest.MonkeyPatch):
    thing, drawn = SHOWN[name]
    shown = thing._repr_html_()
    assert shown.startswith(f"<pre>{name}") and "front <1>" not in shown
    pictures = re.findall(r'src="data:image/png;base64,([^"]+)"', shown)
    assert len(pictures) == drawn
    for data in pictures:
        with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
            assert 10 < picture.width <= 400 and np.asarray(picture.convert("L")).std() > 1
    monkeypatch.setitem(sys.modules, "PIL", None)
    assert thing._repr_html_() == shown.partition("<img")[0]


def test_nothing_raises():
    odd = [
        ipm_rs.Layers({"a": 3}, 1, 2, 3),
        ipm_rs.Layers({}, 0, 0, 0),
        Cloud(np.zeros((0, 3))),
        Cloud(np.full((4, 3), np.nan)),
        Cloud(None),
        ipm_rs.Camera(CAMERA.intrinsics, image_size=(320, 200)),  # in the road
        ipm_rs.Lut.from_maps(np.zeros((3, 4)), np.zeros((3, 4)), source_size=(8, 8)),
    ]
    for thing in odd:
        assert thing._repr_html_().startswith("<pre>")


def test_clouds_and_layers_are_short():
    assert repr(SHOWN["Cloud"][0]) == "Cloud(500 points float64, intensity)"
    assert "count 100x80 int32" in SHOWN["Layers"][0]._repr_html_()
