"""`ipm_rs.torch`: projection with gradients, and samples of a dataset in workers."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from helpers import refuses, textured

import ipm_rs
from ipm_rs import errors

torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install 'ipm-rs[torch]'")
torch.set_num_threads(1)  # threads that wait for each other take long on a busy machine
it = ipm_rs.torch

K = np.array([[55.0, 0, 31.2], [0, 54, 23.6], [0, 0, 1]])
POSE = {"position": (1.2, 0.1, 1.5), "roll": 0.02, "pitch": 0.25, "yaw": -0.1}
GRID = ipm_rs.BevGrid(x=(2, 12), y=(-4, 4), resolution=0.25)
LENSES = [None, ipm_rs.BrownConrady([-0.2, 0.05, 1e-3, -2e-3, 0.01]), ipm_rs.KannalaBrandt([0.05, -0.01, 2e-3, -1e-4])]


def camera(lens=None, **changes) -> ipm_rs.Camera:
    return ipm_rs.Camera.from_euler(K, image_size=(64, 48), lens=lens, **{**POSE, **changes})


def pose(**changes):
    return it.camera_from_vehicle(**{**POSE, **changes})


def test_poses_are_those_of_cameras():
    made = pose(position=torch.tensor(POSE["position"], dtype=torch.float64))
    np.testing.assert_allclose(made, camera().camera_from_vehicle, atol=1e-14)
    assert pose().dtype == torch.float64 and pose(yaw=torch.tensor(0.5)).dtype == torch.float32
    with refuses(errors.ImageError, "position: expected (3,)"):
        it.camera_from_vehicle((1, 2))


@pytest.mark.parametrize("lens", LENSES, ids=["pinhole", "brown", "fisheye"])
def test_points_are_projected_as_by_a_camera(lens):
    points = it.ground_points(GRID, 0.1, dtype=torch.float64)
    uv, depth = it.project(points, torch.from_numpy(K), pose(), lens)
    wanted, z, _ = camera(lens).project(points.reshape(-1, 3).numpy())
    seen = np.isfinite(wanted[:, 0])
    assert seen.mean() > 0.6
    np.testing.assert_allclose(uv.reshape(-1, 2).numpy()[seen], wanted[seen], atol=1e-9)
    np.testing.assert_allclose(depth.reshape(-1).numpy(), z, atol=1e-12)


@pytest.mark.parametrize("lens", LENSES, ids=["pinhole", "brown", "fisheye"])
def test_gradients_of_all_that_a_camera_is(lens):
    few = it.ground_points(GRID, dtype=torch.float64)[::13, ::9]

    def pixels(angles, place, matrix, height):
        points = few + torch.stack([height * 0, height * 0, height])
        return it.project(points, matrix, it.camera_from_vehicle(place, *angles), lens)[0]

    given = [
        torch.tensor([0.02, 0.25, -0.1], dtype=torch.float64),
        torch.tensor(POSE["position"], dtype=torch.float64),
        torch.from_numpy(K),
        torch.tensor(0.05, dtype=torch.float64),
    ]
    assert torch.autograd.gradcheck(pixels, [one.requires_grad_() for one in given])


def test_points_behind_a_camera_spoil_no_gradient():
    pitch = torch.tensor(0.2, dtype=torch.float64, requires_grad=True)
    points = torch.tensor([[5.0, 0, 0], [-5, 0, 0], [1.2, 0.1, 0.5]], dtype=torch.float64)
    uv, depth = it.project(points, torch.from_numpy(K), pose(pitch=pitch))
    assert depth[1] < 0
    uv[depth > 0.5].sum().backward()
    assert torch.isfinite(pitch.grad)


def test_samples_are_those_of_a_table():
    images = torch.from_numpy(textured(48, 64, 3).astype(np.float64)).permute(2, 0, 1)
    uv, depth = it.project(it.ground_points(GRID, dtype=torch.float64), torch.from_numpy(K), pose())
    view = it.sample(images, uv, depth > 0, border_value=7.0)
    wanted = ipm_rs.Lut(camera(), GRID).warp(np.ascontiguousarray(images), layout="CHW", border_value=7.0)
    assert view.shape == wanted.shape and np.abs(view.numpy() - wanted).max() < 0.02
    both = it.sample(images[None].expand(2, -1, -1, -1), torch.stack([uv, uv]), depth > 0, border_value=7.0)
    assert torch.equal(both[1], view)


def test_a_pitch_is_learned():
    """By gradient descent, from how a road looks that is known from above."""
    x, y = torch.meshgrid(torch.linspace(12, 2, 80), torch.linspace(4, -4, 64), indexing="ij")
    road = torch.sin(1.1 * x + 0.4 * y) + torch.cos(1.7 * y - 0.3 * x)
    points = torch.stack([x, y, torch.zeros_like(x)], -1)
    true = torch.from_numpy(K).float()
    with torch.no_grad():  # what the camera sees of it, at the truth
        rays = ipm_rs.Camera.ground_from_pixels(
            camera(), np.stack(np.meshgrid(np.arange(64.0), np.arange(48.0)), -1).reshape(-1, 2)
        )[:, :2]
        xy = torch.from_numpy(np.nan_to_num(rays, nan=1e3)).float()
        image = (torch.sin(1.1 * xy[:, 0] + 0.4 * xy[:, 1]) + torch.cos(1.7 * xy[:, 1] - 0.3 * xy[:, 0])).reshape(
            1, 48, 64
        )
    pitch = torch.tensor(POSE["pitch"] + math.radians(1.5), requires_grad=True)
    optimiser = torch.optim.Adam([pitch], lr=2e-3)
    losses = []
    for _ in range(60):
        uv, depth = it.project(points, true, pose(pitch=pitch))
        seen = (depth > 0) & (uv[..., 0] > 0) & (uv[..., 0] < 63) & (uv[..., 1] > 12) & (uv[..., 1] < 47)
        loss = (it.sample(image, uv, seen)[0] - road)[seen].square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert abs(math.degrees(pitch.item() - POSE["pitch"])) < 0.1, f"{losses[0]:.3f} to {losses[-1]:.3f}"
    assert losses[-1] < 0.2 * losses[0]


@pytest.mark.parametrize(
    ("call", "error", "phrase"),
    [
        (lambda: it.project(np.zeros((2, 3)), torch.eye(3), torch.eye(4)), errors.ArgumentTypeError, "points"),
        (lambda: it.project(torch.zeros(2, 2), torch.eye(3), torch.eye(4)), errors.ImageError, "(..., 3), got (2, 2)"),
        (lambda: it.project(torch.zeros(2, 3), torch.eye(4), torch.eye(4)), errors.ImageError, "intrinsics"),
        (
            lambda: it.project(torch.zeros(2, 3), torch.eye(3), torch.eye(4), ipm_rs.DoubleSphere(0.1, 0.5)),
            errors.ArgumentTypeError,
            "got DoubleSphere; undistort",
        ),
        (lambda: it.ground_points("grid"), errors.ArgumentTypeError, "BevGrid, got str"),
        (lambda: it.sample(torch.zeros(4, 4), torch.zeros(2, 2, 2)), errors.ImageError, "images"),
        (lambda: it.sample(torch.zeros(2, 1, 4, 4), torch.zeros(3, 2, 2, 2)), errors.ImageError, "uv"),
        (lambda: it.sample(torch.zeros(1, 4, 4), torch.zeros(2, 3, 2), torch.ones(3, 2)), errors.ImageError, "valid"),
        (lambda: it.Transform("lut"), errors.ArgumentTypeError, "an ipm_rs.Lut or an ipm_rs.RigLut"),
    ],
)
def test_mistakes_are_named(call, error, phrase):
    with refuses(error, phrase):
        call()


# ---------------------------------------------------------------------------------------------------------------------
# samples of a dataset

LUT = ipm_rs.Lut(camera(), GRID)


class Frames(torch.utils.data.Dataset):
    """Images and labels, from above, and how many threads there were."""

    def __init__(self, transform):
        self.transform = transform

    def __len__(self):
        return 4

    def __getitem__(self, index):
        sample = self.transform(textured(48, 64, 3, seed=index), np.full((48, 64), index, np.uint8))
        return {**sample, "threads": torch.get_num_threads()}


def test_a_sample_is_warped_at_once():
    image, label = textured(48, 64, 3), (textured(48, 64, 1, seed=3)[..., 0] % 19).astype(np.uint8)
    sample = it.Transform(LUT, interpolation="area", label_interpolation="mode")(image, label)
    assert sample["image"].shape == (3, *LUT.shape) and sample["image"].dtype == torch.uint8
    assert np.array_equal(sample["image"].permute(1, 2, 0), LUT.warp(image, interpolation="area"))
    assert np.array_equal(sample["label"], LUT.warp(label, interpolation="mode", border_value=255))
    assert np.array_equal(sample["mask"], LUT.mask) and set(it.Transform(LUT)(image)) == {"image", "mask"}
    planes = torch.from_numpy(image).permute(2, 0, 1).contiguous()
    assert torch.equal(it.Transform(LUT)(planes)["image"], it.Transform(LUT)(image)["image"])
    assert it.Transform(LUT)(image[..., 0].copy())["image"].shape == (1, *LUT.shape)
    pillow = pytest.importorskip("PIL.Image")
    assert torch.equal(it.Transform(LUT)(pillow.fromarray(image))["image"], it.Transform(LUT)(image)["image"])
    ring = ipm_rs.RigLut({"front": camera(), "left": camera(yaw=0.8)}, GRID)
    of_ring = it.Transform(ring)({"front": image, "left": image[::-1]})
    assert np.array_equal(of_ring["image"].permute(1, 2, 0), ring.warp({"front": image, "left": image[::-1]}))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_workers_give_what_this_process_gives(method):
    frames = Frames(it.Transform(LUT))
    frames[0]  # a pool of threads may be there before workers are forked
    loader = torch.utils.data.DataLoader(
        frames, batch_size=2, num_workers=1, multiprocessing_context=method, timeout=60
    )
    for number, batch in enumerate(loader):
        assert batch["threads"].tolist() == [1, 1]
        for place in range(2):
            wanted = frames[2 * number + place]
            assert all(torch.equal(batch[key][place], wanted[key]) for key in ("image", "label", "mask"))


def test_transforms_are_pickled():
    image = textured(48, 64, 3)
    transform = it.Transform(LUT, border_value=[1, 2, 3])
    assert torch.equal(pickle.loads(pickle.dumps(transform))(image)["image"], transform(image)["image"])
