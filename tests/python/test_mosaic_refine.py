"""Refined mosaics: nearer to the road than any frame, in any order of frames, and never in the way of the sums."""

from __future__ import annotations

import collections
import itertools

import numpy as np
import pytest
from test_mosaic import HEIGHT, WIDTH, assert_same, camera, standing_at

import ipm_rs
from ipm_rs.errors import DtypeError

POSES = [standing_at(0.7 * i, 0.1 * i, 0.03 * i) for i in range(10)]
DISTANCE = (6, 14)  # where no pixel is as fine as a cell of 5 cm
RANGES = (8.0, 16.0), (-2.0, 2.4)


def road(x, y):
    """Grain half as long as a pixel is there, and a line."""
    grain = sum(np.sin(a * x + b * y + a * b) for a, b in ((11, 3), (-8, 9), (5, -12), (13, -6), (3, 14)))
    return np.where(np.abs(y - 0.03 * x) < 0.1, 220.0, 110 + 22 * grain)


def picture(pose, rng, samples=5):
    placed = camera().with_pose(camera().camera_from_vehicle @ np.linalg.inv(pose))
    steps = (np.arange(samples) + 0.5) / samples - 0.5
    total = np.zeros((HEIGHT, WIDTH))
    for du, dv in itertools.product(steps, repeat=2):
        u, v = np.meshgrid(np.arange(WIDTH) + du, np.arange(HEIGHT) + dv)
        points = placed.ground_from_pixels(np.stack([u.ravel(), v.ravel()], 1))
        total += np.nan_to_num(road(points[:, 0], points[:, 1]), nan=128.0).reshape(HEIGHT, WIDTH)
    return (total / samples**2 + rng.normal(0, 1, total.shape)).round().clip(0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def frames():
    rng = np.random.default_rng(0)
    return [(camera(), picture(pose, rng), pose) for pose in POSES]


def mosaic_of(frames, **options):
    mosaic = ipm_rs.Mosaic(0.05, tile=64, **options)
    for lens, image, pose in frames:
        mosaic.add(lens, image, map_from_vehicle=pose, distance=DISTANCE)
    return mosaic


@pytest.fixture(scope="module")
def refined(frames):
    mosaic = mosaic_of(frames)
    mosaic.refine(frames, distance=DISTANCE, threads=1)
    return mosaic


def off(view, mosaic):
    """The root of the mean square of what is wrong, where the map is."""
    grid, steps = mosaic.window(*RANGES), (np.arange(4) + 0.5) / 4 - 0.5
    xy = grid.xy()
    truth = sum(road(xy[..., 0] + 0.05 * a, xy[..., 1] + 0.05 * b) for a in steps for b in steps) / 16
    seen = mosaic.layers(*RANGES, names="count")["count"] >= 4
    assert seen.mean() > 0.5
    return np.sqrt(np.mean((view.astype(float) - truth)[seen] ** 2))


def test_it_is_nearer_to_the_road_than_what_was_blended(refined):
    layers = refined.layers(*RANGES, names=("refined", "weighted", "best", "mean"))
    wrong = {name: off(view, refined) for name, view in layers.items()}
    assert wrong["refined"] < 0.93 * min(wrong["weighted"], wrong["best"], wrong["mean"]), wrong
    np.testing.assert_array_equal(refined.image(*RANGES), layers["refined"])


def test_sums_stay_and_the_order_of_frames_changes_nothing(refined, frames):
    plain = mosaic_of(frames)
    assert_same(plain, refined)
    other = mosaic_of(frames[::-1])
    other.refine([frames[i] for i in (7, 2, 9, 0, 4, 1, 8, 3, 6, 5)], distance=DISTANCE, threads=2)
    np.testing.assert_array_equal(other.image(), refined.image())
    assert (other.image() != plain.image()).mean() > 0.2


def test_it_is_stored_and_ends_with_the_next_frame(tmp_path, refined, frames):
    with mosaic_of(frames, path=tmp_path, memory=1 << 22) as stored:
        stored.refine(frames, distance=DISTANCE)
        np.testing.assert_array_equal(stored.image(), refined.image())
    with ipm_rs.Mosaic.load(tmp_path, memory=1 << 22) as stored:
        np.testing.assert_array_equal(stored.image(), refined.image())
        lens, image, pose = frames[0]
        stored.add(lens, image, map_from_vehicle=pose, distance=DISTANCE)
        one, other = stored.layers(names=("refined", "weighted")).values()
        assert (one != other).sum() < (refined.image() != refined.image(blend="weighted")).sum()
        keys = stored.layers((6.4, 9.6), (-1.6, 0.0), names=("refined", "weighted"))
        np.testing.assert_array_equal(keys["refined"], keys["weighted"])


def test_what_is_resolved_stays(frames):
    coarse = ipm_rs.Mosaic(0.5, tile=64)
    for lens, image, pose in frames:
        coarse.add(lens, image, map_from_vehicle=pose, distance=(3, 7))
    before, resolved = coarse.image(), coarse.layers(names="density")["density"] > 1.6
    coarse.refine(frames, distance=(3, 7))
    assert resolved.sum() > 20
    np.testing.assert_array_equal(coarse.image()[resolved], before[resolved])


def test_colours_are_refined_alike(frames, refined):
    coloured = [(lens, np.repeat(image[..., None], 3, 2), pose) for lens, image, pose in frames]
    mosaic = mosaic_of(coloured)
    mosaic.refine(coloured, distance=DISTANCE)
    for channel in range(3):
        assert np.abs(mosaic.image()[..., channel].astype(int) - refined.image()).max() <= 2


def test_exposures_are_those_that_frames_were_added_with(frames, refined):
    gains = [1 / 0.6 if i % 2 else 1.0 for i in range(len(frames))]
    darker = [
        (lens, np.rint(image / gain).astype(np.uint8), pose, {"gain": gain})
        for (lens, image, pose), gain in zip(frames, gains, strict=True)
    ]
    mosaic = ipm_rs.Mosaic(0.05, tile=64)
    for lens, image, pose, options in darker:
        mosaic.add(lens, image, map_from_vehicle=pose, distance=DISTANCE, **options)
    mosaic.refine(darker, distance=DISTANCE)
    # 255 / 0.6 is more than a byte has, and dark frames are rounded: nearly what the frames themselves give
    assert off(mosaic.image(*RANGES), mosaic) < 1.03 * off(refined.image(*RANGES), refined)
    assert off(mosaic.image(*RANGES), mosaic) < 0.95 * off(mosaic.image(*RANGES, blend="weighted"), mosaic)


def test_what_a_mask_hid_stays_hidden(frames, refined):
    shown = np.ones((HEIGHT, WIDTH), bool)
    shown[:, WIDTH // 3 : WIDTH // 2] = False
    lorry = [(lens, np.where(shown, image, 5).astype(np.uint8), pose) for lens, image, pose in frames]
    mosaic = ipm_rs.Mosaic(0.05, tile=64)
    for lens, image, pose in lorry:
        mosaic.add(lens, image, map_from_vehicle=pose, distance=DISTANCE, mask=shown)
    mosaic.refine([(*frame, {"mask": shown}) for frame in lorry], distance=DISTANCE)
    hidden, clean = mosaic.image(*RANGES), ipm_rs.Mosaic(0.05, tile=64)
    for lens, image, pose in frames:
        clean.add(lens, image, map_from_vehicle=pose, distance=DISTANCE, mask=shown)
    clean.refine([(lens.masked(shown), image, pose) for lens, image, pose in frames], distance=DISTANCE)
    np.testing.assert_array_equal(hidden, clean.image(*RANGES))
    # a ring takes them by camera, as `add` does
    ring = ipm_rs.Rig({"front": camera()})
    mosaic.refine(
        [(ring, {"front": image}, pose, {"mask": {"front": shown}, "gain": {"front": 1}}) for _, image, pose in lorry],
        distance=DISTANCE,
    )
    np.testing.assert_array_equal(mosaic.image(*RANGES), hidden)


class Hostile(collections.UserDict):
    def __getitem__(self, key):
        raise RuntimeError(key)


def test_mistakes_leave_the_picture_as_it_was(frames):
    mosaic = mosaic_of(frames[:2])
    before = mosaic.image()
    with pytest.raises(ipm_rs.MosaicError, match="empty"):
        ipm_rs.Mosaic(0.1).refine(frames)
    with pytest.raises(ipm_rs.ArgumentTypeError, match="several times"):
        mosaic.refine(frame for frame in frames)
    with pytest.raises(ipm_rs.ArgumentTypeError, match="camera, image"):
        mosaic.refine([frames[0], frames[1][:2]])
    with pytest.raises(ipm_rs.ArgumentTypeError, match="camera, image"):
        mosaic.refine([7])
    with pytest.raises(ipm_rs.ArgumentTypeError, match="fourth"):
        mosaic.refine([(*frames[0], "name")])
    with pytest.raises(ipm_rs.ArgumentTypeError, match="cannot be read"):
        mosaic.refine([(*frames[0], Hostile(gain=1))])
    with pytest.raises(ipm_rs.ArgumentError, match="'weight' too"):
        mosaic.refine([(*frames[0], {"weight": 1})])
    with pytest.raises(ipm_rs.ArgumentError, match="gain"):
        mosaic.refine([(*frames[0], {"gain": -1})])
    for elsewhere in ([], [(camera(), frames[0][1], standing_at(500))]):
        with pytest.raises(ipm_rs.ArgumentError, match="frames: expected some that show"):
            mosaic.refine(elsewhere)
    with pytest.raises(ipm_rs.ArgumentError, match="iterations"):
        mosaic.refine(frames, iterations=0)
    with pytest.raises(DtypeError):
        mosaic.refine([(camera(), frames[0][1].astype(np.uint16), POSES[0])])
    with pytest.raises(ipm_rs.CalibrationError):
        mosaic.refine([(camera(), frames[0][1], np.zeros((4, 4)))])
    np.testing.assert_array_equal(mosaic.image(), before)
