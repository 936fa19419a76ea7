"""Rings of cameras: one view of all of them, held against each camera's own `Lut`."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from helpers import refuses, same, textured

import ipm_rs
from ipm_rs import errors

SIZE = (160, 120)
GRID = ipm_rs.BevGrid(x=(-5, 8), y=(-6, 6), resolution=0.1)
CAR = np.array([[-1.0, -0.9], [3.7, -0.9], [3.7, 0.9], [-1.0, 0.9]])


def fisheye(yaw: float, x: float, y: float) -> ipm_rs.Camera:
    lens = ipm_rs.KannalaBrandt([0.02, -0.01, 0.002, 0.0], max_angle=1.5)
    K = [[60, 0, 80.3], [0, 61, 58.8], [0, 0, 1]]
    return ipm_rs.Camera.from_euler(
        K, image_size=SIZE, position=(x, y, 0.9 + 0.05 * np.cos(yaw)), roll=0.01, pitch=0.6, yaw=yaw, lens=lens
    )


RIG = ipm_rs.Rig(
    {
        "left": fisheye(1.55, 1.9, 0.9),
        "front": fisheye(0.02, 3.7, 0.0),
        "right": fisheye(-1.6, 1.9, -0.95),
        "back": fisheye(3.1, -0.9, 0.1),
    }
)
RLUT = ipm_rs.RigLut(RIG, GRID, feather=0.8)
LUTS = {name: ipm_rs.Lut(camera, GRID) for name, camera in RIG.items()}


def images(channels: int = 3, dtype: type = np.uint8) -> dict[str, np.ndarray]:
    found = {}
    for k, name in enumerate(RIG):
        image = np.roll(textured(SIZE[1], SIZE[0], channels), 7 * k, axis=0).astype(float) * (0.9 - 0.1 * k)
        found[name] = image.astype(dtype)
    return found


# ---------------------------------------------------------------------------------------------------------------------
# Rig


def test_a_rig_is_a_mapping_in_the_order_given():
    assert list(RIG) == ["left", "front", "right", "back"] and len(RIG) == 4 and "front" in RIG
    assert RIG["front"] == RIG.cameras["front"] == dict(RIG)["front"]
    assert RIG.subset(["back", "left"]) == ipm_rs.Rig({"back": RIG["back"], "left": RIG["left"]})
    assert RIG != ipm_rs.Rig(dict(reversed(list(RIG.items())))) and RIG != "rig"
    assert hash(RIG) == hash(ipm_rs.Rig(RIG.cameras))
    assert "front: 160x120" in repr(RIG)
    with pytest.raises(KeyError, match="'rear' is none of 'left'"):
        RIG["rear"]
    with pytest.raises(AttributeError):
        RIG.cameras = {}


def test_a_rig_survives_pickle_copy_and_file(tmp_path):
    RIG.save(tmp_path / "rig.json")
    for again in (pickle.loads(pickle.dumps(RIG)), copy.deepcopy(RIG), ipm_rs.Rig.load(tmp_path / "rig.json")):
        assert again == RIG and list(again) == list(RIG)


def test_a_moved_rig_sees_the_same_from_elsewhere():
    pose = np.eye(4)
    pose[:3, :3] = ipm_rs.rotation_from_euler(0.0, 0.0, 0.7)
    pose[:3, 3] = (12.0, -3.0, 0.4)
    points = np.array([[6.0, 1.0, 0.0], [2.0, 4.0, 0.1], [-4.0, -1.0, 0.0]])
    for name, camera in RIG.moved(pose).items():
        expected, _, valid = RIG[name].project(points)
        got, _, seen = camera.project(points @ pose[:3, :3].T + pose[:3, 3])
        assert same(valid, seen)
        np.testing.assert_allclose(got, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{}", "known format"),
        ('{"format": "ipm_rs rig", "version": 9, "cameras": {}}', "expected version 1, got 9"),
        ('{"format": "ipm_rs rig", "version": 1, "cameras": {}}', "expected cameras by their names"),
        ('{"format": "ipm_rs rig", "version": 1, "cameras": {"front": {}}}', "format"),
        ('{"format": "ipm_rs rig", "versi', "rig.json"),
    ],
)
def test_other_files_are_refused(content, words, tmp_path):
    path = tmp_path / "rig.json"
    path.write_text(content)
    with refuses(errors.CalibrationError, words):
        ipm_rs.Rig.load(path)
    with pytest.raises(errors.MissingFileError):
        ipm_rs.Rig.load(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("cameras", "error", "words"),
    [
        ([RIG["front"]], errors.ArgumentTypeError, "expected a mapping"),
        ({}, errors.ArgumentError, "at least one"),
        ({1: RIG["front"]}, errors.ArgumentTypeError, "names that are text"),
        ({"front": "front.json"}, errors.ArgumentTypeError, "cameras['front']: expected an ipm_rs.Camera, got str"),
    ],
)
def test_what_is_no_rig_is_refused(cameras, error, words):
    with refuses(error, words):
        ipm_rs.Rig(cameras)
    with refuses(error, words):
        ipm_rs.RigLut(cameras, GRID)


# ---------------------------------------------------------------------------------------------------------------------
# Views


def test_every_cell_that_a_camera_sees_is_shown():
    seen = {name: lut.mask for name, lut in LUTS.items()}
    assert same(RLUT.mask, np.any(list(seen.values()), axis=0))
    weights = {name: RLUT.weights(name) for name in RIG}
    total = sum(weights.values())
    assert same(total, RLUT.mask.astype(np.float32))
    for k, name in enumerate(RIG):
        assert not weights[name][~seen[name]].any()
        assert (weights[name][RLUT.source == k] >= 0.25).all()
    assert RLUT.shape == GRID.shape and RLUT.rig == RIG and RLUT.grid == GRID and RLUT.ground == 0.0


@pytest.mark.parametrize("interpolation", ["bilinear", "area"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int16, np.float16, np.float32, np.float64])
@pytest.mark.parametrize("channels", [1, 2, 3])
def test_a_view_is_the_mean_of_the_cameras_own_by_their_weights(interpolation, dtype, channels):
    own = images(channels, dtype)
    got = RLUT.warp(own, interpolation=interpolation, border_value=7).reshape(*RLUT.shape, channels)
    expected = np.full(got.shape, 7.0)
    views = {name: LUTS[name].warp(own[name], interpolation=interpolation) for name in RIG}
    mean = sum(
        RLUT.weights(name).astype(float)[..., None] * views[name].reshape(got.shape).astype(float) for name in RIG
    )
    expected[RLUT.mask] = mean[RLUT.mask]
    # area: beside a seam a camera's footprints are those of the cells that it shows
    rounding = 0.51 if np.dtype(dtype).kind != "f" else 0.2
    tolerance = rounding if interpolation == "bilinear" else 6.0
    close = np.abs(got.astype(float) - expected) <= tolerance
    assert close.all() if interpolation == "bilinear" else close.mean() > 0.98
    assert got.dtype == dtype


@pytest.mark.parametrize("interpolation", ["nearest", "mode"])
@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.bool_])
def test_labels_are_those_of_the_camera_that_counts_most(interpolation, dtype):
    own = {name: (image[..., 0] // 64).astype(dtype) for name, image in images().items()}
    got = RLUT.warp(own, interpolation=interpolation, border_value=0)
    for k, name in enumerate(RIG):
        view = LUTS[name].warp(own[name], interpolation=interpolation)
        agree = got[RLUT.source == k] == view[RLUT.source == k]
        assert agree.all() if interpolation == "nearest" else agree.mean() > 0.98
    assert set(np.unique(got)) <= {0, *(value for image in own.values() for value in np.unique(image))}


def test_images_in_the_rigs_order_in_any_layout_into_out_on_any_thread():
    own = images()
    expected = RLUT.warp(own, border_value=(1, 2, 3))
    assert same(RLUT.warp(list(own.values()), border_value=(1, 2, 3), threads=1), expected)
    out = np.zeros_like(expected)
    assert RLUT.warp(own, border_value=(1, 2, 3), out=out) is out and same(out, expected)
    planes = {name: np.ascontiguousarray(image.transpose(2, 0, 1)) for name, image in own.items()}
    assert same(RLUT.warp(planes, border_value=(1, 2, 3), layout="CHW"), expected.transpose(2, 0, 1))
    batch = {name: np.stack([image, image[::-1]]) for name, image in own.items()}
    got = RLUT.warp(batch, border_value=(1, 2, 3), layout="NHWC")
    assert same(got[0], expected)
    assert same(
        got[1],
        RLUT.warp({name: np.ascontiguousarray(image[::-1]) for name, image in own.items()}, border_value=(1, 2, 3)),
    )
    gains = {"front": [0.5, 1.0, 2.0]}
    planar = RLUT.warp(planes, layout="CHW", gains=gains)
    assert same(planar, RLUT.warp(own, gains=gains).transpose(2, 0, 1))


def test_the_order_of_the_cameras_changes_nothing():
    own = images()
    turned = ipm_rs.Rig(dict(reversed(list(RIG.items()))))
    other = ipm_rs.RigLut(turned, GRID, feather=0.8)
    for interpolation in ("bilinear", "area", "nearest"):
        assert same(other.warp(own, interpolation=interpolation), RLUT.warp(own, interpolation=interpolation))


def test_a_ring_of_cameras_of_different_sizes_with_a_pinhole():
    pinhole = ipm_rs.Camera.from_euler(
        [[200, 0, 159.5], [0, 200, 99.5], [0, 0, 1]], image_size=(320, 200), position=(1.7, 0, 1.4), pitch=0.2
    )
    lut = ipm_rs.RigLut({"front": pinhole, "left": RIG["left"]}, GRID, blend="priority", feather=0.0)
    own = {"front": textured(200, 320, 3), "left": images()["left"]}
    got, front = lut.warp(own), ipm_rs.Lut(pinhole, GRID)
    assert same(got[front.mask], front.warp(own["front"])[front.mask])
    assert same(lut.source == 0, front.mask)


def test_masks_and_exclude_take_cells_away():
    shown = np.ones(SIZE[::-1], dtype=bool)
    shown[70:] = False
    for mask in (shown, shown.astype(np.uint8) * 255):
        lut = ipm_rs.RigLut(RIG, GRID, masks={"front": mask}, exclude=[CAR])
        assert 0 < (lut.weights("front") > 0).sum() < (RLUT.weights("front") > 0).sum()
        x, y = np.moveaxis(GRID.xy(), -1, 0)
        in_car = (x > -1) & (x < 3.7) & (np.abs(y) < 0.9)
        assert not lut.mask[in_car].any() and lut.mask.sum() > 0.9 * (RLUT.mask & ~in_car).sum()
    one = ipm_rs.RigLut(RIG, GRID, exclude=CAR)
    assert same(one.mask, ipm_rs.RigLut(RIG, GRID, exclude=[CAR]).mask)
    nothing = ipm_rs.RigLut(RIG, GRID, exclude=[[[-9, -9], [9, -9], [9, 9], [-9, 9]]])
    assert not nothing.mask.any() and (nothing.warp(images(), border_value=3) == 3).all()


def test_a_missing_image_is_refused_or_made_up_for():
    own = images()
    for dropped in ({**own, "front": None}, {name: image for name, image in own.items() if name != "front"}):
        with refuses(errors.ArgumentError, "none for 'front'", 'missing="next"'):
            RLUT.warp(dropped)
        fewer, bare = RLUT.without("front"), RLUT.without(["front"], missing="border")
        assert same(RLUT.warp(dropped, missing="next"), fewer.warp({n: own[n] for n in fewer.rig}))
        assert fewer == ipm_rs.RigLut(RIG.subset(["left", "right", "back"]), GRID, feather=0.8)
        view = RLUT.warp(dropped, missing="border", border_value=5)
        only_front = RLUT.weights("front") == 1
        assert only_front.sum() > 500 and (view[only_front] == 5).all() and not bare.mask[only_front].any()
        assert same(bare.mask, RLUT.mask & ~only_front)
        assert fewer.mask.sum() > bare.mask.sum()
        assert same(pickle.loads(pickle.dumps(bare)).mask, bare.mask)
    with refuses(errors.ArgumentError, "at least one camera"):
        RLUT.warp(dict.fromkeys(own), missing="next")
    with refuses(errors.ArgumentError, "missing: expected"):
        RLUT.without("front", missing="black")


def test_cameras_may_be_left_out_one_after_the_other():
    own = images()
    one = RLUT.without(["front"], missing="border")
    both = one.without(["left"], missing="border")
    only_these = RLUT.weights("front") + RLUT.weights("left") > 0.9999
    assert list(both.rig) == ["right", "back"] and same(both.mask, RLUT.mask & ~only_these)
    assert both == RLUT.without(["left", "front"], missing="border") == pickle.loads(pickle.dumps(both))

    # with "next", nobody shows what the front camera would show of the three that are left in the whole rig
    moved = one.without(["left"], missing="next")
    three = ipm_rs.RigLut(RIG.subset(["front", "right", "back"]), GRID, feather=0.8)
    assert list(moved.rig) == ["right", "back"] and same(moved.mask, three.mask & (three.weights("front") < 0.9999))
    assert not (both.mask & ~moved.mask).any() and (moved.mask & ~both.mask).any()
    assert not moved.mask[three.weights("front") == 1].any() and moved == pickle.loads(pickle.dumps(moved))
    view = one.warp({**{name: own[name] for name in one.rig}, "left": None}, missing="next", border_value=5)
    assert same(view, moved.warp([own["right"], own["back"]], border_value=5))


# ---------------------------------------------------------------------------------------------------------------------
# Gains


def road(camera: ipm_rs.Camera, gain: np.ndarray) -> np.ndarray:
    """An image of a smooth road, brightened."""
    u, v = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    xyz = camera.ground_from_pixels(np.stack([u, v], -1).reshape(-1, 2)).reshape(SIZE[1], SIZE[0], 3)
    grey = 110 + 40 * np.sin(0.7 * xyz[..., 0]) * np.cos(0.5 * xyz[..., 1] + 0.3)
    return np.clip(np.rint(np.nan_to_num(grey, nan=180.0)[..., None] * gain), 0, 255).astype(np.uint8)


def test_gains_undo_what_brightened_the_images():
    factors = dict(zip(RIG, np.array([[0.8, 1, 1.1], [1.2, 1.1, 1], [1.05, 0.9, 1], [0.95, 1, 0.9]]), strict=True))
    own = {name: road(camera, factors[name]) for name, camera in RIG.items()}
    gains = RLUT.gains(own)
    mean = np.exp(np.mean([np.log(factor) for factor in factors.values()], axis=0))
    for name in RIG:
        np.testing.assert_allclose(gains[name] * factors[name] / mean, 1, atol=0.02)
    plain = {name: road(camera, mean) for name, camera in RIG.items()}
    corrected = RLUT.warp(own, gains=gains).astype(int)
    assert np.abs(corrected - RLUT.warp(plain))[RLUT.mask].mean() < 1.5
    assert np.abs(RLUT.warp(own).astype(int) - RLUT.warp(plain))[RLUT.mask].mean() > 5
    slow = RLUT.gains(own, previous={name: 1.0 for name in RIG})
    np.testing.assert_allclose(np.log(slow["left"]), 0.1 * np.log(gains["left"]), atol=2e-3)
    assert RLUT.gains({name: np.zeros_like(image) for name, image in own.items()})["left"] == pytest.approx([1, 1, 1])


def test_gains_say_little_where_cameras_see_nothing_in_common():
    """Images of noise, one twice as bright: medians of such ratios are as often those of trees and walls."""
    rng = np.random.default_rng(3)
    own = {name: rng.integers(10, 110, (SIZE[1], SIZE[0])).astype(np.uint8) for name in RIG}
    own["left"] = own["left"] * 2
    gains = RLUT.gains(own)
    assert 1.02 < gains["right"][0] / gains["left"][0] < 1.75


def test_gains_brighten_nearest_too_and_leave_labels():
    own = images()
    bright = RLUT.warp(own, interpolation="nearest", gains={name: 2.0 for name in RIG})
    expected = np.minimum(2 * RLUT.warp(own, interpolation="nearest").astype(int), 255)
    assert same(bright, expected.astype(np.uint8))
    with refuses(errors.ArgumentError, "gains: expected none"):
        RLUT.warp(own, interpolation="mode", gains={"front": 1.5})


# ---------------------------------------------------------------------------------------------------------------------
# Mistakes


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"rear": textured(120, 160, 3)}, errors.ArgumentError, ["'rear'", "'left'"]),
        ({"front": textured(120, 161, 3)}, errors.ImageError, ['images["front"]', "161x120"]),
        ({"front": textured(120, 160, 1)}, errors.ImageError, ["as many channels"]),
        ({"front": textured(120, 160, 3).astype(np.uint16)}, errors.DtypeError, ["expected uint8", "uint16"]),
        ({"front": "front.png"}, errors.ArgumentTypeError, ['images["front"]']),
    ],
)
def test_images_that_do_not_fit_are_refused(change, error, words):
    with refuses(error, *words):
        RLUT.warp({**images(), **change})


def test_arguments_that_do_not_fit_are_refused():
    own = images()
    with refuses(errors.ArgumentTypeError, "images: expected a mapping"):
        RLUT.warp(np.stack(list(own.values())))
    with refuses(errors.ArgumentError, "expected 4"):
        RLUT.warp(list(own.values())[:3])
    for gains in ({"front": [1, 2]}, {"front": -1.0}, {"front": np.nan}, {"rear": 1.0}, {"front": "bright"}):
        with pytest.raises((errors.ArgumentError, errors.ImageError)):
            RLUT.warp(own, gains=gains)
    with refuses(errors.ArgumentTypeError, "gains: expected a mapping"):
        RLUT.warp(own, gains=[1, 1, 1, 1])
    with refuses(errors.ImageError, 'masks["front"]: expected (120, 160)'):
        ipm_rs.RigLut(RIG, GRID, masks={"front": np.ones((160, 120), bool)})
    with refuses(errors.ArgumentError, "'rear'"):
        ipm_rs.RigLut(RIG, GRID, masks={"rear": np.ones((120, 160), bool)})
    for gain in (2j, [np.complex64(1)], np.datetime64("2020")):
        with refuses(errors.ArgumentTypeError, "gains['front']: expected real factors"):
            RLUT.warp(own, gains={"front": gain})
        with refuses(errors.ArgumentTypeError, "previous['front']: expected real factors"):
            RLUT.gains(own, previous={"front": gain})
    for missing in ("next", "border"):
        for nothing in ({}, dict.fromkeys(own), [None] * 4):
            with refuses(errors.ArgumentError, "images: expected one of at least one camera"):
                RLUT.warp(nothing, missing=missing)
    with refuses(errors.ArgumentError, "blend: expected", "got 'mean'"):
        ipm_rs.RigLut(RIG, GRID, blend="mean")
    for feather in (-1.0, np.nan, 1e9):
        with pytest.raises(errors.IpmError):
            ipm_rs.RigLut(RIG, GRID, feather=feather)
    for corner, words in (([], "got 2"), ([[np.nan, 1]], "not finite"), ([[2e9, 1]], "farther")):
        polygon = [[0, 0], [1, 1], *corner]
        for exclude, name in ((polygon, "exclude: "), ([polygon], "exclude[0]: "), (np.array(polygon), "exclude: ")):
            with refuses(errors.ArgumentError, name, words, "metres"):
                ipm_rs.RigLut(RIG, GRID, exclude=exclude)
    with refuses(errors.ArgumentTypeError, "grid: expected"):
        ipm_rs.RigLut(RIG, (100, 100))
    with refuses(errors.ArgumentError, "'rear'"):
        RLUT.weights("rear")
    out = own["front"]
    with pytest.raises(errors.IpmError):
        RLUT.warp(own, out=out)


def test_a_rig_lut_is_a_value():
    again = pickle.loads(pickle.dumps(RLUT))
    assert again == RLUT and again != ipm_rs.RigLut(RIG, GRID, feather=0.2) and RLUT != "rlut"
    assert "4 cameras" in repr(RLUT) and again.nbytes > 100_000
    assert hash(again) == hash(RLUT)
    assert same(again.warp(images()), RLUT.warp(images()))
