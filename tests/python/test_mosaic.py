"""Mosaics: sums that know no order, views of them, windows, and what is refused."""

from __future__ import annotations

import itertools
import math
import pickle

import numpy as np
import pytest
from mosaic_drive import HEIGHT, WIDTH, K, camera, standing_at

import ipm_rs
from ipm_rs.mosaic._placing import placed, windows


def road(x, y):
    """Grey levels of a road with nothing finer than the cells, away from edges of the range."""
    return 120 + 50 * np.sin(1.3 * x + 0.4) + 40 * np.cos(1.7 * y - 0.6 * x)


def seen_from(lens, pose, ground=0.0):
    """The picture of the road, the mean of what each pixel sees."""
    placed_lens = lens.with_pose(lens.camera_from_vehicle @ np.linalg.inv(pose))
    total = np.zeros((HEIGHT, WIDTH))
    for du, dv in itertools.product((-0.25, 0.25), repeat=2):
        u, v = np.meshgrid(np.arange(WIDTH) + du, np.arange(HEIGHT) + dv)
        points = placed_lens.ground_from_pixels(np.stack([u.ravel(), v.ravel()], 1), ground=ground)
        total += np.nan_to_num(road(points[:, 0], points[:, 1]), nan=128.0).reshape(HEIGHT, WIDTH)
    return np.rint(total / 4).clip(0, 255).astype(np.uint8)


POSES = [standing_at(1.1 * i, 0.05 * i * i, 0.05 * i) for i in range(6)]


@pytest.fixture(scope="module")
def frames():
    return [(seen_from(camera(), pose), pose) for pose in POSES]


def mosaic_of(frames, threads=None, **options):
    mosaic = ipm_rs.Mosaic(0.1, tile=64, **options)
    for image, pose in frames:
        assert mosaic.add(camera(), image, map_from_vehicle=pose, distance=(2, 20), threads=threads) > 1000
    return mosaic


def everything(mosaic):
    names = ("weighted", "best", "mean", "std", "count", "density", "mask")
    return {"bounds": np.array(mosaic.bounds), **mosaic.layers(names=names)}


def assert_same(one, other):
    one, other = everything(one), everything(other)
    for name, layer in one.items():
        assert layer.dtype == other[name].dtype
        np.testing.assert_array_equal(layer, other[name], name)


def test_a_map_shows_the_road(frames):
    mosaic = mosaic_of(frames)
    grid = mosaic.window()
    xy = grid.xy()
    truth = road(xy[..., 0], xy[..., 1])
    layers = mosaic.layers(names=("weighted", "best", "mean", "density", "count", "mask"))
    well = layers["density"] > 0.5
    assert well.sum() > 5000
    np.testing.assert_array_equal(layers["mask"], layers["count"] > 0)
    assert layers["count"].max() == len(frames)
    for blend in ("weighted", "best", "mean"):
        error = (layers[blend].astype(float) - truth)[well]
        assert np.abs(error).mean() < 2.5, blend
        assert (layers[blend][~layers["mask"]] == 0).all()
    np.testing.assert_array_equal(mosaic.image(), layers["weighted"])


def test_the_order_of_frames_and_threads_change_nothing(frames):
    expected = mosaic_of(frames, threads=1)
    assert_same(expected, mosaic_of(frames[::-1], threads=2))
    shuffled = [frames[i] for i in (3, 0, 5, 1, 4, 2)]
    assert_same(expected, mosaic_of(shuffled))


def test_a_merge_is_what_adding_all_would_have_given(frames):
    expected = mosaic_of(frames)
    for cut in (1, 3):
        one, other = mosaic_of(frames[:cut]), mosaic_of(frames[cut:])
        one.merge(other)
        assert one.frames == len(frames)
        assert_same(expected, one)


def test_equals_are_decided_by_the_value():
    """Two pictures from one place: which of them is the best must not depend on which came first."""
    rng = np.random.default_rng(3)
    pictures = [rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8) for _ in range(2)]
    both = [[(picture, POSES[0]) for picture in order] for order in (pictures, pictures[::-1])]
    assert_same(*(mosaic_of(frames) for frames in both))
    one, other = (mosaic_of(frames[:1]) for frames in both)
    one.merge(other)
    assert_same(mosaic_of(both[1]), one)
    best, mean = (mosaic_of(both[0]).layers(names=("best", "mean"))[name] for name in ("best", "mean"))
    assert (best[..., 0] >= mean[..., 0]).all()


def test_sums_are_those_of_views_of_the_whole_window():
    """One frame, one big table: the map of tiles holds its view, cell by cell."""
    pose = standing_at(3.0, -2.0, 0.4)
    image = seen_from(camera(), pose)
    mosaic = mosaic_of([(image, pose)])
    grid = mosaic.window()
    in_map = camera().with_pose(camera().camera_from_vehicle @ np.linalg.inv(pose))
    lut = ipm_rs.Lut(in_map, grid)
    view, resolved = lut.warp(image, interpolation="area"), lut.resolved_mask(1 / 16)
    far = np.hypot(*np.moveaxis(grid.xy() - pose[:2, 3], -1, 0))
    expected = resolved & (far >= 2) & (far < 20)
    layers = mosaic.layers(names=("mask", "weighted", "best", "mean", "std"))
    # a window's own table tells footprints beside its edge from one side only
    assert (layers["mask"] != expected).mean() < 2e-3
    both = layers["mask"] & expected
    for blend in ("weighted", "best", "mean"):
        assert np.abs(layers[blend][both].astype(int) - view[both]).max() <= 1
    assert layers["std"].max() == 0


def test_a_frame_that_resolves_a_cell_outweighs_one_that_does_not():
    near, far = standing_at(0.0), standing_at(-9.0)
    mosaic = ipm_rs.Mosaic(0.1, tile=64)
    mosaic.add(camera(), np.full((HEIGHT, WIDTH), 200, np.uint8), map_from_vehicle=near)
    mosaic.add(camera(), np.full((HEIGHT, WIDTH), 100, np.uint8), map_from_vehicle=far)
    layers = mosaic.layers((4, 6), (-1, 1), names=("weighted", "mean", "best", "count", "std"))
    assert (layers["count"] == 2).all()
    assert (layers["weighted"] >= 199).all()
    assert (layers["mean"] == 150).all()
    assert (layers["best"] == 200).all()
    np.testing.assert_allclose(layers["std"], 50, atol=1e-4)


def test_ground_under_the_wheels_and_in_the_map():
    """A vehicle on a ramp: its own plane, and the same plane given in the map."""
    pose = standing_at(5.0, 1.0, 0.3, 2.0)
    pose[:3, :3] = pose[:3, :3] @ ipm_rs.rotation_from_euler(0.02, -0.05, 0.0)
    plane = ipm_rs.Plane(normal=(0, 0, 1)).transformed(pose)
    image = seen_from(camera(), pose, plane)
    maps = []
    for ground in ("wheels", plane):
        maps.append(ipm_rs.Mosaic(0.1, tile=64))
        maps[-1].add(camera(), image, map_from_vehicle=pose, ground=ground, distance=(2, 12))
    assert_same(*maps)
    layers = maps[0].layers(names=("weighted", "density"))
    xy = maps[0].window().xy()
    well = layers["density"] > 0.5
    assert np.abs(layers["weighted"] - road(xy[..., 0], xy[..., 1]))[well].mean() < 3


def test_masks_weights_gains_and_rigs(frames):
    image, pose = frames[0]
    shown = np.ones((HEIGHT, WIDTH), bool)
    shown[:, : WIDTH // 2] = False
    masked, own = ipm_rs.Mosaic(0.1, tile=64), ipm_rs.Mosaic(0.1, tile=64)
    assert masked.add(camera(), image, map_from_vehicle=pose, mask=shown) > 100
    own.add(camera().masked(shown), image, map_from_vehicle=pose)
    assert_same(masked, own)
    assert masked.layers((4, 5), (0.5, 2), names="count")["count"].max() == 0, "left of the car is hidden"
    light, dark = ipm_rs.Mosaic(0.1, tile=64), ipm_rs.Mosaic(0.1, tile=64)
    half = np.full((HEIGHT, WIDTH), 60, np.uint8)
    light.add(camera(), half * 2, map_from_vehicle=pose)
    dark.add(camera(), half, map_from_vehicle=pose, gain=2.0)
    assert_same(light, dark)
    dark.add(camera(), half * 0, map_from_vehicle=pose, weight=0.5)
    assert dark.image((4, 5), (-1, 1)).mean() == pytest.approx(80, abs=1)
    rig = ipm_rs.Rig({"front": camera(), "left": camera(yaw=math.pi / 2, position=(0.5, 0.4, 1.4))})
    whole, alone = ipm_rs.Mosaic(0.1, tile=64), ipm_rs.Mosaic(0.1, tile=64)
    images = {"left": image, "front": frames[1][0]}
    whole.add(rig, images, map_from_vehicle=pose)
    for name, one in rig.items():
        alone.add(one, images[name], map_from_vehicle=pose)
    assert (whole.frames, alone.frames) == (1, 2)
    assert_same(whole, alone)
    assert whole.add(rig, {"left": None}, map_from_vehicle=pose) == 0


def test_far_from_the_origin_it_is_the_same(frames):
    """At UTM coordinates, tiles of other numbers: the same picture but for roundings of coordinates."""
    shift = np.array([51.2 * 10_000, 6.4 * 850_000])
    moved = []
    for image, pose in frames:
        pose = pose.copy()
        pose[:2, 3] += shift
        moved.append((image, pose))
    here, there = mosaic_of(frames), mosaic_of(moved)
    np.testing.assert_allclose(np.array(there.bounds) - shift[:, None], here.bounds, atol=1e-6)
    one, other = here.layers(), there.layers()
    assert (one["count"] != other["count"]).mean() < 1e-3
    assert np.abs(one["weighted"].astype(int) - other["weighted"])[one["count"] == other["count"]].max() <= 2


def test_16_bits_and_labels_of_sizes():
    wide = ipm_rs.Mosaic(0.1, tile=64)
    picture = np.full((HEIGHT, WIDTH, 2), (300, 65535), np.uint16)
    for _ in range(3):
        wide.add(camera(), picture, map_from_vehicle=np.eye(4))
    assert (wide.channels, wide.dtype) == (2, np.uint16)
    layers = wide.layers((4, 6), (-1, 1), names=("weighted", "mean", "best", "std"))
    for name in ("weighted", "mean", "best"):
        assert layers[name].shape == (20, 20, 2)
        assert np.abs(layers[name].astype(int) - (300, 65535)).max() <= 1
    assert layers["std"].max() < 0.1


def test_windows_hold_all_that_a_frame_sees():
    for yaw, pitch, limits in ((0.3, 0.15, (0.0, math.inf)), (-2.0, 0.5, (3.0, 9.0)), (1.2, 0.02, (0.0, 30.0))):
        pose = standing_at(-7.0, 12.0, yaw)
        frame = placed(camera(pitch=pitch), pose, 0.0, limits, 1.0)
        grid = ipm_rs.BevGrid(x=(-44.8, 32.0), y=(-25.6, 51.2), resolution=0.1)
        lut = ipm_rs.Lut(frame.camera, grid)
        far = np.hypot(*np.moveaxis(grid.xy() - pose[:2, 3], -1, 0))
        seen = lut.resolved_mask(1 / 16) & (far >= limits[0]) & (far < limits[1])
        left = seen.copy()
        cells = 0
        for window in windows(frame, 0.1, 64):
            (row, column), (rows, columns) = (
                (round((32.0 - window.grid.x[1]) / 0.1), round((51.2 - window.grid.y[1]) / 0.1)),
                window.grid.shape,
            )
            left[row : row + rows, column : column + columns] = False
            cells += rows * columns
            i, j = window.key
            assert window.at == (
                round(((i + 1) * 6.4 - window.grid.x[1]) / 0.1),
                round(((j + 1) * 6.4 - window.grid.y[1]) / 0.1),
            )
        assert seen.sum() > 1000
        assert left.sum() == 0
        assert cells < 4 * seen.sum() + 64 * 64


def test_no_more_frames_than_the_sums_hold(monkeypatch, frames):
    from ipm_rs.mosaic import _tiles

    monkeypatch.setattr(_tiles.Kind, "most_frames", property(lambda _: 3))
    mosaic = mosaic_of(frames[:1] * 3)
    before = everything(mosaic)
    with pytest.raises(ipm_rs.MosaicError, match="at most 3 frames"):
        mosaic_of(frames[:1] * 4)
    with pytest.raises(ipm_rs.MosaicError, match="at most 3 frames"):
        mosaic.merge(mosaic_of(frames[:1]))
    for name, layer in everything(mosaic).items():
        np.testing.assert_array_equal(layer, before[name])


def test_a_map_is_not_merged_into_itself(frames):
    mosaic = mosaic_of(frames[:1])
    before = everything(mosaic)
    with pytest.raises(ipm_rs.MosaicError, match="this one"):
        mosaic.merge(mosaic)
    for name, layer in everything(mosaic).items():
        np.testing.assert_array_equal(layer, before[name])


def test_frames_wait_for_their_tile_and_it_does_not_matter(frames):
    """Read after every frame, pickled in between, or neither: the same map."""
    at_once, looked_at, sent = (ipm_rs.Mosaic(0.1, tile=64) for _ in range(3))
    waited = 0
    for image, pose in frames:
        for mosaic in (at_once, looked_at, sent):
            mosaic.add(camera(), image, map_from_vehicle=pose, distance=(0, 12))
        waited = max(waited, max(len(tile._shown) for tile in at_once._tiles._loaded.values()))
        everything(looked_at)
        assert not any(tile._shown for tile in looked_at._tiles._loaded.values())
        sent = pickle.loads(pickle.dumps(sent))
    assert waited > 1
    for other in (looked_at, sent):
        assert_same(at_once, other)


IMAGE = np.zeros((HEIGHT, WIDTH), np.uint8)
NAN_POSE = np.full((4, 4), np.nan)
REFUSED = [
    ({"image": IMAGE[:-1]}, ipm_rs.ImageError, "expected shape"),
    ({"image": IMAGE.astype(np.float32)}, ipm_rs.DtypeError, "uint8 or uint16"),
    ({"image": IMAGE.astype(np.uint16)}, ipm_rs.DtypeError, "as the map has"),
    ({"image": np.zeros((HEIGHT, WIDTH, 3), np.uint8)}, ipm_rs.ImageError, "1 channels"),
    ({"image": None}, ipm_rs.IpmError, "image"),
    ({"map_from_vehicle": NAN_POSE}, ipm_rs.CalibrationError, "finite|NaN"),
    ({"map_from_vehicle": np.eye(3)}, ipm_rs.ArgumentError, "4, 4"),
    ({"map_from_vehicle": np.diag([2.0, 2, 2, 1])}, ipm_rs.CalibrationError, "rotation"),
    ({"map_from_vehicle": standing_at(3e7)}, ipm_rs.CalibrationError, "within"),
    ({"ground": 2.0}, ipm_rs.CalibrationError, "0.60 m above"),
    ({"ground": float("nan")}, ipm_rs.ArgumentError, "finite"),
    ({"ground": "road"}, ipm_rs.ArgumentError, "wheels"),
    ({"ground": [1]}, ipm_rs.ArgumentTypeError, "wheels"),
    ({"mask": np.ones((3, 3))}, ipm_rs.ImageError, "mask"),
    ({"weight": 0}, ipm_rs.ArgumentError, "above 0"),
    ({"weight": 1.5}, ipm_rs.ArgumentError, "up to 1"),
    ({"gain": -1}, ipm_rs.ArgumentError, "gain"),
    ({"distance": (5, 5)}, ipm_rs.ArgumentError, "min < max"),
    ({"distance": (-1, 5)}, ipm_rs.ArgumentError, "min < max"),
    ({"distance": 7}, ipm_rs.ArgumentTypeError, "distance"),
    ({"threads": 0}, ipm_rs.ArgumentError, "threads"),
    ({"name": 7}, ipm_rs.ArgumentTypeError, "name"),
    ({"camera": K}, ipm_rs.ArgumentTypeError, "Camera or Rig"),
    ({"camera": ipm_rs.Rig({"a": camera()})}, ipm_rs.ArgumentTypeError, "mapping"),
    ({"camera": ipm_rs.Rig({"a": camera()}), "image": {"b": IMAGE}}, ipm_rs.ArgumentError, "b"),
]


@pytest.mark.parametrize(("wrong", "error", "words"), REFUSED, ids=str)
def test_wrong_frames_are_refused_and_nothing_is_added(frames, wrong, error, words):
    mosaic = mosaic_of(frames[:1])
    call = {"camera": camera(), "image": IMAGE, "map_from_vehicle": POSES[0], **wrong}
    before = everything(mosaic)
    with pytest.raises(error, match=words):
        mosaic.add(call.pop("camera"), call.pop("image"), **call)
    assert mosaic.frames == 1
    for name, layer in everything(mosaic).items():
        np.testing.assert_array_equal(layer, before[name])


def test_wrong_maps_and_windows_are_refused(frames):
    for wrong in ({"resolution": 0}, {"resolution": math.nan}, {"tile": 100}, {"tile": 0}, {"channels": 0}):
        with pytest.raises(ipm_rs.ArgumentError):
            ipm_rs.Mosaic(**{"resolution": 0.1, **wrong})
    with pytest.raises(ipm_rs.ArgumentError, match="uint8 or uint16"):
        ipm_rs.Mosaic(0.1, dtype="float32")
    empty = ipm_rs.Mosaic(0.1)
    assert empty.bounds is None
    with pytest.raises(ipm_rs.ArgumentError, match="no tile"):
        empty.image()
    with pytest.raises(ipm_rs.ArgumentError, match="add some"):
        empty.image((0, 1), (0, 1))
    mosaic = mosaic_of(frames[:1])
    with pytest.raises(ipm_rs.GridError, match=r"nearest is \(0, 1\)"):
        mosaic.image((0.03, 1.0), (0, 1))
    with pytest.raises(ipm_rs.GridError, match="low to high"):
        mosaic.image((2, 1), (0, 1))
    with pytest.raises(ipm_rs.ArgumentError, match="at most"):
        mosaic.image((0, 1e5), (0, 1e5))
    with pytest.raises(ipm_rs.ArgumentError, match="blend"):
        mosaic.image(blend="median")
    with pytest.raises(ipm_rs.ArgumentError, match="names"):
        mosaic.layers(names=("weighted", "height"))
    for other in (ipm_rs.Mosaic(0.2, tile=64), ipm_rs.Mosaic(0.1, tile=128)):
        with pytest.raises(ipm_rs.MosaicError, match="expected cells"):
            mosaic.merge(other)
    with pytest.raises(ipm_rs.MosaicError, match="channels"):
        mosaic.merge(ipm_rs.Mosaic(0.1, tile=64, channels=3, dtype="uint8"))
    with pytest.raises(ipm_rs.ArgumentTypeError):
        mosaic.merge(None)


def of_the_camera(pose):
    """Poses as KITTI's odometry has them: of the camera, in the axes of the first one."""
    optical = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    return optical @ pose @ np.linalg.inv(optical)


def with_z_up(pose):
    """The same in a map with z up: the camera's own axes."""
    return pose @ np.linalg.inv(np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]))


def with_y_ahead(pose):
    return pose @ standing_at(0, yaw=-math.pi / 2)


@pytest.mark.parametrize(
    ("spoiled", "words"),
    [(of_the_camera, r"m up; give the vehicle's"), (with_z_up, "tilted by 90 deg"), (with_y_ahead, "m along y")],
)
def test_poses_of_something_else_are_told_of_once(spoiled, words):
    mosaic = ipm_rs.Mosaic(0.1, tile=64)
    lens = camera(position=(1.0, 0.0, 40.0), pitch=1.2)  # far above, so that no frame is refused for its height
    poses = [spoiled(standing_at(1.1 * number, 0.05 * number)) for number in range(8)]
    with pytest.warns(ipm_rs.CalibrationWarning, match=words) as told:
        for pose in poses:
            mosaic.add(lens, IMAGE, map_from_vehicle=pose, ground=-30.0, distance=(0, 4))
    assert len(told) == 1
    assert told[0].filename == __file__


def test_drives_that_only_look_odd_are_fine():
    """Back and forth, uphill, on the spot, another drive far away and higher, a lane change: no warning."""
    mosaic = ipm_rs.Mosaic(0.1, tile=64)
    hill = [standing_at(1.5 * number, z=0.4 * number) for number in range(6)]
    jitter = [standing_at(0.02 * number, 0.3 * (-1) ** number, z=0.3 * number % 2) for number in range(6)]
    change = [standing_at(2.0 * number, 1.2 * number) for number in range(6)]
    for pose in [*hill, *hill[::-1], *jitter, standing_at(0, 90, z=400.0), *change]:
        mosaic.add(camera(), IMAGE, map_from_vehicle=pose, ground="wheels", distance=(2, 4))
    assert mosaic.frames > 20


def test_a_frame_that_sees_nothing_adds_nothing(frames):
    mosaic = mosaic_of(frames[:1])
    before = everything(mosaic)
    assert mosaic.add(camera(pitch=-1.0), IMAGE, map_from_vehicle=POSES[0]) == 0
    assert mosaic.frames == 2
    for name, layer in everything(mosaic).items():
        np.testing.assert_array_equal(layer, before[name])
