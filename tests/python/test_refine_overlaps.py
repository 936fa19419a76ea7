"""`refine.from_overlaps`: the poses of a ring from the road that two cameras see at once."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors, refine, scene
from ipm_rs.refine._motion import angles_of
from ipm_rs.refine._ring import Ring
from ipm_rs.refine._ringsearch import _alike, searched_again
from ipm_rs.refine._road import pose_of_camera

K = [[120.0, 0, 127.5], [0, 120.0, 95.5], [0, 0, 1]]
GRID = ipm_rs.BevGrid(x=(-1, 7), y=(-1, 7), resolution=0.1)


def camera(yaw, x=0.0, y=0.0, *, roll=0.0, pitch=0.6, height=1.5, focal=120.0) -> ipm_rs.Camera:
    matrix = np.array(K)
    matrix[[0, 1], [0, 1]] = focal
    return ipm_rs.Camera.from_euler(
        matrix, image_size=(256, 192), position=(x, y, height), roll=roll, pitch=pitch, yaw=np.radians(yaw)
    )


TRUE = {"front": camera(0, 1.0), "left": camera(70, 0.8, 0.4), "back": camera(180, -1.0)}
GIVEN = ipm_rs.Rig({**TRUE, "left": camera(71, 0.8, 0.4, roll=-0.015, pitch=0.62, height=1.42)})


@pytest.fixture(scope="module")
def images() -> dict[str, np.ndarray]:
    random = np.random.default_rng(1)
    gains = {"front": 0.8, "left": 0.9, "back": 1.0}
    seen = {name: scene.render(each) * gains[name] for name, each in TRUE.items()}
    return {
        name: np.clip(each + random.normal(0, 2, each.shape), 0, 255).astype(np.uint8) for name, each in seen.items()
    }


def values(camera: ipm_rs.Camera) -> np.ndarray:
    return np.array([*np.degrees(angles_of(camera.vehicle_from_camera)), camera.position[2]])


def off(found: ipm_rs.Camera, true: ipm_rs.Camera) -> np.ndarray:
    """Roll, pitch, yaw in degrees, as little as it takes to turn back, and the height."""
    difference = values(found) - values(true)
    difference[:3] = (difference[:3] + 180) % 360 - 180
    return difference


def stained(camera: ipm_rs.Camera, random: np.random.Generator) -> np.ndarray:
    """A picture of a road that is nothing but stains of 30 cm, four samples a pixel, noise of two grey levels."""
    tile = np.random.default_rng(5).normal(size=(128, 128))
    tile = 14 * sum(np.roll(tile, shift, (0, 1)) for shift in ((0, 0), (0, 1), (1, 0), (1, 1)))
    v, u = np.mgrid[:192, :256].astype(float)
    total = np.zeros((192, 256))
    for du, dv in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):
        seen = camera.ground_from_pixels(np.stack([u + du, v + dv], -1).reshape(-1, 2))[:, :2]
        at = np.clip(np.nan_to_num(seen / 0.15), -1e4, 1e4)
        (i, j), (a, b) = np.floor(at).astype(int).T, (at - np.floor(at)).T
        corners = [tile[(i + di) % 128, (j + dj) % 128] for di in (0, 1) for dj in (0, 1)]
        weights = [(1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b]
        total += sum(w * c for w, c in zip(weights, corners, strict=True)).reshape(total.shape) / 4
    return np.clip(110 + total + random.normal(0, 2, total.shape), 0, 255).astype(np.uint8)


def test_the_camera_beside_is_found(images):
    found = refine.from_overlaps(GIVEN, images, fixed="front", grid=GRID)
    off = values(found.rig["left"]) - values(TRUE["left"])
    assert np.abs(off[:3]).max() < 0.1 and abs(off[3]) < 0.02, off
    assert found.rig["front"] == TRUE["front"] and found.rig["back"] == TRUE["back"]
    assert set(found.kept) == {"front", "back"} and "no road" in found.kept["back"]
    pair = ("front", "left")
    assert list(found.after) == [pair] and found.after[pair] > 0.95 > 0.7 > found.before[pair]
    assert found.parameters == tuple(("left", name) for name in ("roll", "pitch", "yaw", "height"))
    deviations = np.array(list(found.deviations.values())) * ([180 / np.pi] * 3 + [1.0])
    assert (np.abs(off) < 4 * deviations).all() and deviations.max() < 0.15, (off, deviations)
    assert 1.05 < (found.gains["front"] / found.gains["left"]).mean() < 1.2
    assert "left" in str(found) and "correlate" in str(found)


def test_derivatives_are_those_of_the_views():
    """On a picture that changes slowly the view is smooth: what remains is the geometry."""
    v, u = np.mgrid[:192, :256].astype(np.float32)
    smooth = {name: np.sin(u / 23) + np.cos(v / 19) for name in ("front", "left")}
    rig = {name: TRUE[name] for name in smooth}
    likely = np.array([0.03, 0.03, 0.03, 0.15])
    ring = Ring(rig, [smooth], "front", ipm_rs.Plane(normal=(0.02, -0.01, 1)), GRID, 1.5, likely)
    chosen = ring.chosen(ring.start, 1)
    view = ring.views(ring.start, 1, chosen)["left"]
    for column in range(4):
        step = np.zeros(4)
        step[column] = 1e-3
        ends = [ring.views(ring._moved(ring.start, sign * step), 1, chosen)["left"].pictures[0] for sign in (1, -1)]
        differences = ((ends[0] - ends[1]) / 2e-3)[chosen["front", "left"]]
        np.testing.assert_allclose(view.slopes(0)[:, column], differences, atol=0.05 * np.abs(differences).max())


def test_what_the_pictures_do_not_tell(images):
    with refuses(errors.ArgumentError, "same road"):
        refine.from_overlaps(GIVEN.subset(["front", "back"]), images, grid=GRID)
    with refuses(errors.ArgumentError, "fixed"):
        refine.from_overlaps(GIVEN, images, fixed="top", grid=GRID)
    with refuses(errors.ArgumentError, "none of 'left'"):
        refine.from_overlaps(GIVEN, {"front": images["front"]}, grid=GRID)
    with refuses(errors.ImageError, "contrast"):
        refine.from_overlaps(GIVEN, {name: np.full_like(image, 80) for name, image in images.items()}, grid=GRID)
    with refuses(errors.ImageError, "256x192"):
        refine.from_overlaps(GIVEN, {**images, "left": images["left"][:-1]}, grid=GRID)
    with refuses(errors.ImageError, "images['left']", "finite"):
        refine.from_overlaps(GIVEN, {**images, "left": images["left"] * np.float32("nan")}, grid=GRID)
    with refuses(errors.CalibrationError, "above the road"):
        refine.from_overlaps(GIVEN, images, ground=3.0)
    with refuses(errors.ArgumentError, "square"):
        refine.from_overlaps(GIVEN, images, grid=ipm_rs.BevGrid(x=(0, 4), y=(0, 4), resolution=(0.1, 0.2)))
    with refuses(errors.ArgumentError, "instants"):
        refine.from_overlaps(GIVEN, [], grid=GRID)
    with refuses(errors.ArgumentTypeError, "names"):
        refine.from_overlaps(GIVEN, [images["front"]], grid=GRID)
    with refuses(errors.ArgumentTypeError, "rig"):
        refine.from_overlaps("rig", images)


def test_a_fit_that_went_astray_is_refused(images, monkeypatch):
    """A pair may gain what another loses, where what they see is not flat."""
    scores = itertools.chain([{("front", "left"): 0.85}], itertools.repeat({("front", "left"): 0.6}))
    monkeypatch.setattr(Ring, "agreement", lambda self, state: next(scores))
    with refuses(errors.CalibrationError, "'front' and 'left' correlate with 0.60, 0.85 before"):
        refine.from_overlaps(GIVEN, images, fixed="front", grid=GRID)


def test_of_a_pair_that_goes_astray_the_worse_camera_is_held():
    ring = object.__new__(Ring)
    ring.free, ring.pairs = ["left", "back"], [("front", "left"), ("left", "back")]
    before = {("front", "left"): 0.8, ("left", "back"): 0.7}
    assert ring.astray(before, {("front", "left"): 0.9, ("left", "back"): 0.3}, 0.1) == ("back", ("left", "back"))
    assert ring.astray(before, {("front", "left"): 0.75, ("left", "back"): 0.7}, 0.1) is None
    alike = {("front", "left"): 0.98, ("front", "right"): 0.97, ("left", "back"): 0.6}
    assert ring.unlike(alike) == "back" and ring.unlike({**alike, ("left", "back"): 0.8}) is None


def test_two_degrees_and_a_tenth_of_the_height_are_searched(images):
    """Least squares alone would end beside it: the views show nothing alike at first."""
    far = ipm_rs.Rig({"front": TRUE["front"], "left": camera(72, 0.8, 0.4, roll=0.03, pitch=0.565, height=1.65)})
    found = refine.from_overlaps(far, images, fixed="front", grid=GRID)
    off = values(found.rig["left"]) - values(TRUE["left"])
    assert np.abs(off[:3]).max() < 0.1 and abs(off[3]) < 0.02, off


def test_the_prior_holds_what_is_given(images):
    near = refine.from_overlaps(GIVEN, images, fixed="front", grid=GRID, prior=(1e-4, 1e-5))
    assert np.abs(values(near.rig["left"]) - values(GIVEN["left"])).max() < 0.01
    with refuses(errors.ArgumentError, "prior", "10 degrees"):
        refine.from_overlaps(GIVEN, images, grid=GRID, prior=(20, 0.1))
    with refuses(errors.ArgumentError, "prior"):
        refine.from_overlaps(GIVEN, images, grid=GRID, prior=(1.0, 0.1, 2.0))


def test_strips_at_the_far_ends_of_a_picture_place_a_camera():
    """The one behind shares six degrees with either neighbour, from 6 m on; as given, with one of them nothing."""
    true = {"front": camera(0, 1.0), "left": camera(84, 0.8, 0.4), "right": camera(-84, 0.8, -0.4),
            "back": camera(180, pitch=0.5, focal=80.0)}  # fmt: skip
    given = {"front": true["front"], "left": camera(83, 0.8, 0.4, roll=0.02, pitch=0.62, height=1.45),
             "right": camera(-83, 0.8, -0.4, roll=-0.02, pitch=0.58, height=1.55),
             "back": camera(182, roll=0.03, pitch=0.53, height=1.4, focal=80.0)}  # fmt: skip
    random = np.random.default_rng(1)
    images = {name: stained(each, random) for name, each in true.items()}
    around = ipm_rs.BevGrid(x=(-9, 7), y=(-7, 7), resolution=0.1)
    found = refine.from_overlaps(ipm_rs.Rig(given), images, fixed="front", grid=around)
    assert set(found.kept) == {"front"} and found.after["left", "back"] > 0.98
    errors = np.concatenate([off(found.rig[name], true[name]) for name in ("left", "right", "back")])
    deviations = np.array(list(found.deviations.values())) * np.tile([180 / np.pi] * 3 + [1.0], 3)
    assert np.abs(errors).max() < 0.1 and np.abs(errors[3::4]).max() < 0.02, errors
    times = errors / deviations
    assert deviations.max() < 0.1 and 0.3 < np.sqrt((times**2).mean()) < 1.7, (errors, deviations)
    # and once more, where it was given up too early: the others are placed well by now
    pictures = {name: image.astype(np.float32) for name, image in images.items()}
    likely = np.array([0.035, 0.035, 0.035, 0.15])
    ring = Ring(given, [pictures], "front", ipm_rs.Plane(normal=(0, 0, 1)), around, 1.5, likely)
    state = {name: ring.start["back"] if name == "back" else pose_of_camera(true[name]) for name in given}
    again = searched_again(ring, state, "back")
    assert np.abs(off(given["back"].with_pose(again["back"].camera_from_vehicle), true["back"])).max() < 0.1
    assert all(again[name] is state[name] for name in ("front", "left", "right"))


@pytest.mark.filterwarnings("ignore::ipm_rs.CalibrationWarning")
def test_a_pair_that_is_out_of_sight_is_not_alike(images):
    """A camera that turns away from one neighbour is not judged by the other alone."""
    pictures = {name: image.mean(-1, dtype=np.float32) for name, image in images.items()}
    likely = np.array([0.03, 0.03, 0.03, 0.15])
    ring = Ring(TRUE, [pictures], "front", ipm_rs.Plane(normal=(0, 0, 1)), GRID, 1.5, likely)
    alone = _alike(ring, ring.start)
    assert ring.pairs == [("front", "left")] and alone > 0.9
    ring.pairs = [("front", "left"), ("left", "back")]
    assert _alike(ring, ring.start) == alone / 2


def test_the_answer_is_the_same_on_any_number_of_threads(images):
    before = ipm_rs.get_num_threads()
    found = []
    try:
        for threads in (1, 3):
            ipm_rs.set_num_threads(threads)
            found.append(refine.from_overlaps(GIVEN.subset(["front", "left"]), images, fixed="front", grid=GRID))
    finally:
        ipm_rs.set_num_threads(before)
    for other in found[1:]:
        assert other.rig == found[0].rig and other.after == found[0].after
        np.testing.assert_array_equal(other.covariance, found[0].covariance)


def test_a_camera_of_which_nothing_is_told_stays():
    """Of pictures of other cameras, say: what agrees by chance is elsewhere, and as uncertain as the given pose."""
    ring = Ring(GIVEN.subset(["front", "left"]), [{}], "front", ipm_rs.Plane(normal=(0, 0, 1)), GRID, 1.5,
                np.array([0.03, 0.03, 0.03, 0.15]))  # fmt: skip
    vague, told = np.diag(ring.likely**2), np.diag(ring.likely**2 * [1.0, 0.1, 1.0, 1.0])
    led = {**ring.start, "left": ring.start["left"].moved(np.array([0.0, 0.0, 0.05, 0.0]), range(4))}
    assert ring.untold(led, vague) == "left" and ring.untold(led, told) is None
    assert ring.untold(ring.start, vague) is None, "held to what it is likely to be, and there"


def test_cameras_behind_one_that_stays_stay_too():
    ring = object.__new__(Ring)
    ring.fixed, ring.free, ring.start = "front", ["left", "back", "right"], {"left": "as given"}
    ring.pairs = [("front", "left"), ("left", "back"), ("front", "right")]
    assert ring.cut_off() == []
    assert ring.hold("left", {"left": "found", "back": "found"}) == {"left": "as given", "back": "found"}
    assert ring.pairs == [("front", "right")] and ring.cut_off() == ["back"]
