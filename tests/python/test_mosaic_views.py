"""Views of samples: what stood there for few frames, seams, votes of labels; and gains."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from test_mosaic import HEIGHT, POSES, WIDTH, camera, road, seen_from, standing_at

import ipm_rs
from ipm_rs.mosaic._samples import feathered, robust, voted

K = 6
SEES = (2, 20)


def key(resolution, frame):
    """The key of a sample, as the core makes it: octaves from 1/16 pixel on, 512 steps each, then the frame."""
    octave = int(np.floor(np.log2(resolution * 16)))
    return ((octave << 9 | int((resolution * 16 / 2**octave - 1) * 512)) << 20) | frame


def cell(*samples):
    """Arrays of one cell of (resolution, value) or (resolution, value, frame), best first."""
    keys, values = np.zeros((1, 1, 8), np.uint32), np.zeros((1, 1, 8, 1), np.uint8)
    for number, (resolution, value, *frame) in enumerate(samples):
        keys[0, 0, number], values[0, 0, number] = key(resolution, frame[0] if frame else number + 1), value
    return keys, values


@pytest.mark.parametrize(
    ("samples", "value"),
    [
        ([(2, 90), (1.5, 92), (1.2, 94), (1.1, 200), (1, 210)], 92),  # level from one pixel on, two cars
        ([(2, 220), (1.5, 100), (1.2, 101), (1, 102)], 101),  # a car in front in the best one
        ([(0.5, 100), (0.45, 104), (0.4, 180)], 101.2),  # weighed by the eighth power
        ([(2, 50), (1.5, 150)], 100),  # two that disagree: nobody knows
        ([(1, 77)], 77),
        ([(1, 80), (0.4, 200), (0.4, 200), (0.4, 200)], 80),  # too blurred to be asked
        ([], 0),
    ],
)
def test_robust_values_are_of_those_that_agree(samples, value):
    assert robust(*cell(*samples))[0, 0, 0] == pytest.approx(value, abs=0.6)


def test_votes_are_as_a_cell_is_resolved_and_the_best_decides_a_tie():
    labels, share = voted(*cell((2, 7), (1, 3), (0.5, 3)))
    assert (labels[0, 0, 0], share[0, 0]) == (3, pytest.approx(1.5 / 2.5))
    labels, share = voted(*cell((2, 7), (1, 3)))
    assert (labels[0, 0, 0], share[0, 0]) == (7, 0.5)
    labels, share = voted(*cell((2, 0), (2, 0), (1, 5)))
    assert (labels[0, 0, 0], share[0, 0]) == (0, pytest.approx(2 / 3))
    labels, share = voted(*cell())
    assert (labels[0, 0, 0], share[0, 0]) == (0, 0)


def test_seams_are_ramps():
    """Left of a seam frame 1 is best, right of it frame 2; frame 1 alone sees the last row."""
    radius, columns = 4, 40
    keys, samples = (
        np.zeros((12 + 2 * radius, columns, 2), np.uint32),
        np.zeros((12 + 2 * radius, columns, 2, 1), np.uint8),
    )
    near, far = (100, 1), (180, 2)
    for column in range(columns):
        order = (near, far) if column < 20 else (far, near)
        for k, (value, frame) in enumerate(order):
            keys[:, column, k], samples[:, column, k] = key(2 - k, frame), value
    keys[-radius - 1 :], samples[-radius - 1 :] = 0, 0
    keys[-radius - 1 :, :, 0], samples[-radius - 1 :, :, 0] = key(1, 1), 100
    view = feathered(keys, samples, radius)[..., 0].astype(int)
    assert view.shape == (12, columns - 2 * radius)
    ramp = view[0]
    assert (ramp[:12] == 100).all() and (ramp[-12:] == 180).all()
    assert (np.diff(ramp) >= 0).all() and np.diff(ramp).max() <= 10
    assert ramp[16 - 1] == pytest.approx(136, abs=1) and ramp[16] == pytest.approx(144, abs=1)
    assert (view[-1] == 100).all(), "who does not see a cell has no part in it"


def drive(samples=K, frames=(), **options):
    mosaic = ipm_rs.Mosaic(0.1, tile=64, samples=samples, **options)
    for image, pose, name in frames:
        mosaic.add(camera(), image, map_from_vehicle=pose, distance=SEES, name=name)
    return mosaic


@pytest.fixture(scope="module")
def frames():
    """The road, on which in two of nine frames something stands."""
    found = []
    for number in range(9):
        pose = standing_at(0.7 * number, 0.02 * number, 0.01 * number)
        image = seen_from(camera(), pose)
        if number in (3, 6):
            image[50:, 60:110] = 255
        found.append((image, pose, f"frame {number}"))
    return found


def everything(mosaic):
    return {
        name: getattr(tile.arrays, name)
        for key in mosaic.tiles
        for tile in [mosaic._tiles.get(key, mosaic._kind)]
        for name in tile.arrays._fields
    }


def test_samples_do_not_know_the_order_and_merge(frames):
    names = ("robust", "feathered", "weighted")
    expected = drive(frames=frames)
    views = expected.layers(names=names)
    other = drive(frames=[frames[i] for i in (4, 8, 0, 2, 6, 1, 7, 5, 3)])
    one, rest = drive(frames=frames[:4]), drive(frames=frames[4:])
    one.merge(rest)
    for same in (other, one):
        for name, layer in everything(same).items():
            np.testing.assert_array_equal(layer, everything(expected)[name], name)
        for name in names:
            np.testing.assert_array_equal(same.layers(names=name)[name], views[name])


def test_what_stands_there_in_few_frames_is_not_seen(frames):
    mosaic = drive(frames=frames)
    window = (6, 11), (-1, 1)
    xy = mosaic.window(*window).xy()
    truth = road(xy[..., 0], xy[..., 1])
    error = {
        blend: np.abs(mosaic.image(*window, blend=blend) - truth).mean()
        for blend in ("weighted", "robust", "best", "mean")
    }
    assert error["robust"] < 6
    assert all(error[blend] > 4 * error["robust"] for blend in ("weighted", "best", "mean"))
    clean = drive(frames=[frame for number, frame in enumerate(frames) if number not in (3, 6)])
    sharp = clean.layers(*window, names=("robust", "weighted"))
    assert np.abs(sharp["robust"].astype(int) - sharp["weighted"]).mean() < 1, "where all agree nothing is lost"


def test_feathered_views_are_the_best_one_but_for_seams(frames):
    mosaic = drive(frames=frames)
    whole = mosaic.layers(names=("best", "feathered", "mask"))
    assert whole["feathered"][~whole["mask"]].max() == 0
    same = np.abs(whole["best"].astype(int) - whole["feathered"])[whole["mask"]]
    assert (same == 0).mean() > 0.5 and (same > 0).mean() > 0.02
    part = mosaic.image((5.0, 9.3), (-2.1, 3.0), blend="feathered")
    grid, inner = mosaic.window(), mosaic.window((5.0, 9.3), (-2.1, 3.0))
    top, left = round((grid.x[1] - inner.x[1]) / 0.1), round((grid.y[1] - inner.y[1]) / 0.1)
    np.testing.assert_array_equal(part, whole["feathered"][top : top + inner.shape[0], left : left + inner.shape[1]])


def labelled(pose, wrong=()):
    """Ids of squares of 2 m on the road, 200 and above."""
    lens = camera().with_pose(camera().camera_from_vehicle @ np.linalg.inv(pose))
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    points = lens.ground_from_pixels(np.stack([u.ravel(), v.ravel()], 1))
    ids = ids_of(np.nan_to_num(points[:, 0], nan=1e3), np.nan_to_num(points[:, 1])).reshape(HEIGHT, WIDTH)
    for id_ in wrong:
        ids[50:, 40:120] = id_
    return ids


def ids_of(x, y):
    return (200 + 3 * (np.floor(x / 2) % 4) + 20 * (np.floor(y / 2) % 2)).astype(np.uint8)


def test_labels_are_voted_on_and_never_mixed(tmp_path):
    frames = [(labelled(pose, [7] if number == 4 else []), pose, str(number)) for number, pose in enumerate(POSES)]
    mosaic = drive(None, frames, labels=True)
    assert (mosaic.samples, mosaic.labels, mosaic.channels) == (8, True, 1)
    layers = mosaic.layers(names=("labels", "best", "agreement", "count", "density", "mask"))
    known = {7, *ids_of(*np.mgrid[0:8:2, 0:4:2].reshape(2, -1)).tolist()}
    assert set(np.unique(layers["labels"][layers["mask"]])) <= known
    xy = mosaic.window().xy()
    inside = np.abs(xy / 2 - np.round(xy / 2)).min(-1) > 0.15  # 0.3 m from the edges of squares
    well = inside & (layers["density"] > 0.5) & (layers["count"] >= 4)
    right = layers["labels"] == ids_of(xy[..., 0], xy[..., 1])
    assert well.sum() > 1000 and right[well].mean() > 0.995
    assert (layers["best"] == 7)[well].any() and not (layers["labels"] == 7)[well].any()
    assert (layers["agreement"][well & (layers["best"] == 7)] < 1).all()
    np.testing.assert_array_equal(mosaic.image(), layers["labels"])
    assert set(mosaic.layers()) == {"labels", "count"}
    mosaic.save(tmp_path / "map")
    with ipm_rs.Mosaic.load(tmp_path / "map") as again:
        assert again.labels and again.samples == 8
        np.testing.assert_array_equal(again.image(), layers["labels"])
    assert mosaic.nbytes < drive(8, [(np.zeros((HEIGHT, WIDTH), np.uint8), POSES[0], None)]).nbytes * len(mosaic.tiles)


def test_what_a_map_does_not_keep_is_refused(tmp_path, frames):
    plain, kept, labels = drive(0, frames[:1]), drive(K, frames[:1]), drive(None, frames[:1], labels=True)
    for mosaic, blend, words in (
        (plain, "robust", "samples=8"),
        (plain, "feathered", "samples=8"),
        (plain, "labels", "labels=True"),
        (kept, "labels", "labels=True"),
        (labels, "weighted", "pictures"),
        (labels, "robust", "pictures"),
    ):
        with pytest.raises(ipm_rs.MosaicError, match=words):
            mosaic.image(blend=blend)
    for one, other in itertools.permutations((plain, kept, labels), 2):
        with pytest.raises(ipm_rs.MosaicError, match="samples a cell"):
            one.merge(other)
    for wrong in ({"samples": 65}, {"samples": -1}, {"labels": True, "samples": 0}, {"labels": True, "channels": 3}):
        with pytest.raises(ipm_rs.ArgumentError):
            ipm_rs.Mosaic(0.1, **wrong)
    with pytest.raises(ipm_rs.ArgumentTypeError, match="labels"):
        ipm_rs.Mosaic(0.1, labels=1)
    kept.save(tmp_path / "map")
    with pytest.raises(ipm_rs.MosaicError, match="6 samples a cell of pictures"):
        ipm_rs.Mosaic(0.1, tile=64, path=tmp_path / "map")
    with pytest.raises(ipm_rs.MosaicError, match="labels"):
        labels.refine([(camera(), frames[0][0], frames[0][1])])
    with pytest.raises(ipm_rs.MosaicError, match="labels"):
        labels.gain(camera(), frames[0][0], map_from_vehicle=frames[0][1])
    with pytest.raises(ipm_rs.ArgumentError, match="brightness"):
        labels.add(camera(), frames[0][0], map_from_vehicle=frames[0][1], gain=1.5)
    with pytest.raises(ipm_rs.ImageError, match="1 channels"):
        drive(None, labels=True).add(camera(), np.zeros((HEIGHT, WIDTH, 3), np.uint8), map_from_vehicle=np.eye(4))


def test_gains_even_out_the_exposure(frames):
    factors = (1.0, 0.8, 1.15, 0.7, 1.1, 0.85, 1.2, 0.75, 1.0)
    plain, even = drive(0), drive(0)
    for (image, pose, _), factor in zip(frames, factors, strict=True):
        seen = np.rint(image * factor).clip(0, 255).astype(np.uint8)
        where = {"map_from_vehicle": pose, "distance": SEES}
        gain = even.gain(camera(), seen, **where)
        even.add(camera(), seen, gain=gain, **where)
        plain.add(camera(), seen, **where)
        assert gain * factor == pytest.approx(1, abs=0.05)
    std = [mosaic.layers((6, 11), (1.5, 3), names="std")["std"].mean() for mosaic in (plain, even)]
    assert std[1] < 0.1 * std[0]


def test_gains_of_rigs_of_nothing_and_of_few_cells(frames):
    image, pose, _ = frames[0]
    mosaic = drive(0)
    assert mosaic.gain(camera(), image, map_from_vehicle=pose) == 1.0
    rig = ipm_rs.Rig({"front": camera(), "again": camera(yaw=0.05)})
    images = {"front": image, "again": seen_from(camera(yaw=0.05), pose)}
    mosaic.add(rig, images, map_from_vehicle=pose)
    darker = {"front": images["front"] // 2, "again": images["again"]}
    gains = mosaic.gain(rig, darker, map_from_vehicle=pose)
    assert gains["front"] == pytest.approx(2**0.95, rel=0.03) and gains["again"] == pytest.approx(1, abs=0.03)
    assert mosaic.add(rig, darker, map_from_vehicle=pose, gain=gains) > 0
    with pytest.raises(ipm_rs.ArgumentError, match="'again'"):
        mosaic.add(rig, darker, map_from_vehicle=pose, gain={"front": 1.0})
    assert mosaic.gain(camera(), image, map_from_vehicle=standing_at(300.0)) == 1.0
    white = np.full_like(image, 255)
    assert mosaic.gain(camera(), white, map_from_vehicle=pose) == 1.0, "what is clipped says nothing"
    with pytest.raises(ipm_rs.ImageError, match="shape"):
        mosaic.gain(camera(), image[1:], map_from_vehicle=pose)
