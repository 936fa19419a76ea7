"""`ipm_rs.torch.Warp`: what a layer must do, held against `Lut.warp` and PyTorch's own checks."""

from __future__ import annotations

import copy
import io
import pickle
import threading
import weakref

import numpy as np
import pytest
from helpers import refuses

import ipm_rs
from ipm_rs import errors

torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install 'ipm-rs[torch]'")
Warp = ipm_rs.torch.Warp

WIDTH, HEIGHT = 23, 17
KINDS = pytest.mark.parametrize("interpolation", ["bilinear", "nearest", "area"])
DTYPES = [torch.float32, torch.float64, torch.float16, torch.bfloat16]


def ragged(rows: int = 9, cols: int = 11) -> ipm_rs.Lut:
    """Cells of a pixel and of several, on rims, in the halo and outside."""
    row, column = np.mgrid[:rows, :cols]
    u, v = (column - 4.0) * (1.0 + 0.25 * row) + 9.3, 2.1 * row - 1.4 + 0.3 * column
    u[2, 3], v[4, 5] = np.nan, 40.0
    u[:, 7], v[3, :] = np.round(u[:, 7]), np.round(v[3, :])
    return ipm_rs.Lut.from_maps(u, v, source_size=(WIDTH, HEIGHT))


torch.set_num_threads(1)  # threads that wait for each other on a busy machine took a minute of these tests
LUT = ragged()
CAMERAS = {
    name: ipm_rs.Camera.from_euler(
        [[14, 0, 11.2], [0, 14, 8.1], [0, 0, 1]], image_size=(WIDTH, HEIGHT), position=(1, 0, 1.4), pitch=0.4, yaw=yaw
    )
    for name, yaw in (("front", 0.0), ("left", 1.0))
}
RING = ipm_rs.RigLut(CAMERAS, ipm_rs.BevGrid(x=(2, 6), y=(-3, 5), resolution=0.5), feather=1.0)


def numbers(*shape: int, dtype=None, seed: int = 0):
    return torch.from_numpy(np.random.default_rng(seed).normal(size=shape)).to(dtype or torch.float32)


def lasting(images):
    return images.contiguous(memory_format=torch.channels_last)


@KINDS
@pytest.mark.parametrize("dtype", DTYPES)
def test_it_is_the_warp_of_a_lut_in_every_dtype_and_order(interpolation, dtype):
    layer, images = Warp(LUT, interpolation, border_value=2.5), numbers(2, 3, HEIGHT, WIDTH, dtype=dtype)
    given = images.float().numpy() if dtype in (torch.bfloat16, torch.float16) else images.numpy()
    wanted = torch.from_numpy(LUT.warp(given, interpolation=interpolation, border_value=2.5, layout="NCHW")).to(dtype)
    view = layer(images)
    assert view.dtype == dtype and view.shape == (2, 3, *LUT.shape) and view.is_contiguous()
    assert torch.equal(view, wanted)
    beside = layer(lasting(images))
    assert beside.is_contiguous(memory_format=torch.channels_last)
    assert torch.allclose(beside, view, rtol=1e-2, atol=1e-5)
    assert torch.equal(layer(images[0]), view[0]) and torch.equal(layer(images[:, ::2]), view[:, ::2])
    assert layer(images[:0]).shape == (0, 3, *LUT.shape)
    assert torch.equal(layer(images.flip(-1)), layer(images.flip(-1).contiguous()))


def test_integers_are_warped_too():
    labels = torch.arange(HEIGHT * WIDTH).reshape(1, 1, HEIGHT, WIDTH)
    view = Warp(LUT, "nearest", border_value=-1)(labels)
    assert torch.equal(
        view[0, 0], torch.from_numpy(LUT.warp(labels[0, 0].numpy(), interpolation="nearest", border_value=-1))
    )
    assert Warp(LUT)(labels.to(torch.uint8)).dtype == torch.uint8


@KINDS
def test_gradients_are_exact(interpolation):
    layer, images = (
        Warp(LUT, interpolation, border_value=[1.0, -2.0]),
        numbers(2, 2, HEIGHT, WIDTH, dtype=torch.float64),
    )
    for order in (images, lasting(images)):
        order = order.detach().requires_grad_()
        assert torch.autograd.gradcheck(layer, (order,), fast_mode=True)
        assert torch.autograd.gradgradcheck(layer, (order,), fast_mode=True)
    grad = numbers(2, 2, *LUT.shape, dtype=torch.float64, seed=1)
    images.requires_grad_()
    (layer(images) * grad).sum().backward()
    there = (Warp(LUT, interpolation)(images.detach()) * grad).sum()
    assert abs(there - (images.grad * images.detach()).sum()) <= 1e-12 * grad.abs().sum()
    assert torch.equal(
        images.grad, torch.from_numpy(LUT.warp_adjoint(grad.numpy(), interpolation=interpolation, layout="NCHW"))
    )


@KINDS
def test_small_floats_have_gradients_of_their_own_dtype(interpolation):
    for dtype in DTYPES[2:]:
        images = numbers(1, 2, HEIGHT, WIDTH, dtype=dtype).requires_grad_()
        view = Warp(LUT, interpolation)(images)
        view.backward(torch.ones_like(view))
        assert images.grad.dtype == dtype
        exact = LUT.warp_adjoint(np.ones((2, *LUT.shape), np.float32), interpolation=interpolation, layout="CHW")
        assert torch.equal(images.grad[0], torch.from_numpy(exact).to(dtype))


@KINDS
def test_threads_change_nothing(interpolation):
    row, column = np.mgrid[:200, :300]
    big = ipm_rs.Lut.from_maps(1.1 * column - 0.2 * row, 1.6 * row - 9.0, source_size=(300, 290))
    before, found = torch.get_num_threads(), []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            images = numbers(1, 8, 290, 300).requires_grad_()
            view = Warp(big, interpolation)(images)
            view.square().sum().backward()
            found.append((view.detach(), images.grad))
    finally:
        torch.set_num_threads(before)
    assert torch.equal(found[0][0], found[1][0]) and torch.equal(found[0][1], found[1][1])


@KINDS
@pytest.mark.filterwarnings("ignore:The .grad attribute of a Tensor that is not a leaf:UserWarning")
def test_opcheck(interpolation):
    ops = torch.ops.ipm_rs
    layer, ring = Warp(LUT), Warp(RING)
    key = layer._key
    images, grad = numbers(2, 2, HEIGHT, WIDTH), numbers(2, 2, *LUT.shape)
    for of_image, of_grad in ((images, grad), (lasting(images), lasting(grad))):
        image, given = of_image.clone().requires_grad_(), of_grad.clone().requires_grad_()
        torch.library.opcheck(ops.warp.default, (image, key, interpolation, [0.5]))
        torch.library.opcheck(ops.warp_adjoint.default, (given, key, interpolation))
    both = [numbers(1, 2, HEIGHT, WIDTH, seed=k).requires_grad_() for k in range(2)]
    torch.library.opcheck(ops.rig_warp.default, (both, ring._key, interpolation, [0.5]))
    torch.library.opcheck(
        ops.rig_warp_adjoint.default, (numbers(1, 2, *RING.shape).requires_grad_(), ring._key, interpolation)
    )


@KINDS
def test_vmap_over_batches(interpolation):
    layer, images = Warp(LUT, interpolation), numbers(3, 2, 2, HEIGHT, WIDTH)
    wanted = torch.stack([layer(one) for one in images])
    assert torch.equal(torch.func.vmap(layer)(images), wanted)
    assert torch.equal(torch.func.vmap(layer, in_dims=1)(images.movedim(0, 1)), wanted)
    assert torch.equal(torch.func.vmap(layer)(images[:, 0]), wanted[:, 0])
    images.requires_grad_()
    torch.func.vmap(layer)(images).square().sum().backward()
    again = images.detach().clone().requires_grad_()
    layer(again.flatten(0, 1)).square().sum().backward()
    assert torch.equal(images.grad, again.grad)


def test_compiled_without_a_graph_break():
    layer, images = Warp(LUT, "area", border_value=1.0), numbers(2, 3, HEIGHT, WIDTH)

    def loss(images):
        return (layer(images).sin() * 2).sum()

    for order in (images, lasting(images)):
        plain, compiled = order.clone().requires_grad_(), order.clone().requires_grad_()
        wanted, made = loss(plain), torch.compile(loss, fullgraph=True, backend="aot_eager")(compiled)
        wanted.backward(), made.backward()
        assert torch.equal(made, wanted) and torch.equal(compiled.grad, plain.grad)
    ring, of_ring = Warp(RING), numbers(2, 2, 3, HEIGHT, WIDTH)
    assert torch.equal(torch.compile(ring, fullgraph=True, backend="aot_eager")(of_ring), ring(of_ring))
    counter = torch._dynamo.testing.CompileCounter()
    step = torch.compile(loss, backend=counter, fullgraph=True, dynamic=True)
    step(images), step(numbers(5, 3, HEIGHT, WIDTH))
    assert counter.frame_count <= 2


def test_state_is_the_hash_of_the_table():
    layer = torch.nn.Sequential(torch.nn.Conv2d(3, 3, 1), Warp(LUT))
    file = io.BytesIO()
    torch.save(layer.state_dict(), file)
    file.seek(0)
    state = torch.load(file, weights_only=True)
    torch.nn.Sequential(torch.nn.Conv2d(3, 3, 1), Warp(ragged(), "nearest")).load_state_dict(state)
    other = torch.nn.Sequential(torch.nn.Conv2d(3, 3, 1), Warp(ragged(10)))
    with refuses(errors.CalibrationError, "another camera, grid or road"):
        other.load_state_dict(state)
    other.load_state_dict({key: value for key, value in state.items() if "extra" not in key}, strict=False)
    assert not list(Warp(LUT).parameters()) and "9 x 11 cells" in repr(Warp(LUT))


@pytest.mark.parametrize("lut", [LUT, RING], ids=["lut", "ring"])
def test_copies_and_pickles_warp_alike(lut):
    layer = Warp(lut, border_value=[1, 2, 3]).to("meta").to("cpu")
    images = numbers(1, 3, HEIGHT, WIDTH) if lut is LUT else numbers(1, 2, 3, HEIGHT, WIDTH)
    for other in (pickle.loads(pickle.dumps(layer)), copy.deepcopy(layer), Warp(lut, border_value=(1, 2, 3))):
        assert torch.equal(other(images), layer(images))
    assert layer.half()(images).dtype == torch.float32


def test_a_graph_outlives_its_layer():
    lut = ragged(7)
    images = numbers(1, 1, HEIGHT, WIDTH).requires_grad_()
    loss = Warp(lut)(images).sum()
    with pytest.raises(Exception, match="table"):
        torch.ops.ipm_rs.warp(images, "no such table", "bilinear", [0.0])
    loss.backward()
    assert images.grad.abs().sum() > 0


LARGE = ipm_rs.Lut.from_maps(*np.mgrid[:150, :150].astype(float)[::-1], source_size=(150, 150))


def test_memory_is_used_again_once_nobody_holds_the_result():
    layer, images = Warp(LARGE), numbers(1, 16, 150, 150)
    first = layer(images)
    place, expected = first.data_ptr(), first.clone()
    second = layer(2 * images)  # the first is still held
    assert second.data_ptr() != place
    assert torch.equal(first, expected) and torch.equal(second, 2 * expected)
    place = second.data_ptr()
    del second
    assert layer(3 * images).data_ptr() == place
    smaller = layer(images[:, :15])
    assert torch.equal(smaller, expected[:, :15])


@pytest.mark.parametrize(
    "hold",
    [
        lambda view: view.numpy(),
        lambda view: view[0, 3:5],
        lambda view: view.detach().permute(0, 2, 3, 1),
        lambda view: np.from_dlpack(view),
        lambda view: view.untyped_storage(),
        lambda view: view.requires_grad_().square().grad_fn,
    ],
    ids=["array", "part", "detached", "dlpack", "storage", "graph"],
)
def test_memory_that_anything_holds_is_not_used_again(hold):
    layer, images = Warp(LARGE), lasting(numbers(1, 16, 150, 150))
    view = layer(images)
    place, held = view.data_ptr(), hold(view)
    del view
    others = [layer(images + count) for count in range(3)]
    assert place not in {other.data_ptr() for other in others}
    assert held is not None


def test_threads_that_share_a_layer_have_memory_of_their_own():
    layer, images = Warp(LARGE), numbers(1, 16, 150, 150)
    expected = [layer(images + count).clone() for count in range(4)]
    wrong = []

    def work(count: int) -> None:
        for _ in range(50):
            if not torch.equal(layer(images + count), expected[count]):
                wrong.append(count)

    threads = [threading.Thread(target=work, args=(count,)) for count in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_memory_goes_with_the_layer():
    lut = ipm_rs.Lut.from_maps(*np.mgrid[:140, :150].astype(float)[::-1], source_size=(150, 150))
    layer = Warp(lut)
    layer(numbers(1, 16, 150, 150))
    memory = weakref.ref(layer._table.memory)
    del layer
    assert memory() is None


# ---------------------------------------------------------------------------------------------------------------------
# rings


@KINDS
def test_a_ring_is_warped_as_one(interpolation):
    layer, images = Warp(RING, interpolation, border_value=[0.5, 1.5, 2.5]), numbers(2, 2, 3, HEIGHT, WIDTH)
    view = layer(images)
    for index in range(2):
        given = dict(zip(RING.rig, images[index].numpy(), strict=True))
        wanted = RING.warp(given, interpolation=interpolation, border_value=[0.5, 1.5, 2.5], layout="CHW")
        assert np.array_equal(view[index].numpy(), wanted)
    assert torch.equal(layer(images[0]), view[0])
    assert torch.equal(layer({name: images[:, k] for k, name in enumerate(RING.rig)}), view)
    beside = images.permute(0, 1, 3, 4, 2).contiguous().permute(0, 1, 4, 2, 3)
    made = layer(beside)
    assert made.is_contiguous(memory_format=torch.channels_last) and torch.allclose(made, view, atol=1e-6)
    exact = images[:1].double().requires_grad_()
    assert torch.autograd.gradcheck(layer, (exact,), fast_mode=True)
    assert torch.equal(torch.func.vmap(layer)(images[:, None])[:, 0], view)


# ---------------------------------------------------------------------------------------------------------------------
# other devices


@pytest.mark.parametrize("interpolation", ["bilinear", "nearest"])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64, torch.float16])
def test_other_devices_show_the_same(interpolation, dtype):
    """Their way, taken on the CPU."""
    for lut, shape in ((LUT, (2, 3)), (RING, (2, 2, 3))):
        layer = Warp(lut, interpolation, border_value=[0.25, 0.5, 1.0])
        images = torch.from_numpy(np.random.default_rng(4).uniform(0, 1, (*shape, HEIGHT, WIDTH))).to(dtype)
        there = layer._on_device([images] if lut is LUT else list(images.unbind(1)))
        assert there.dtype == dtype
        bound = 0 if interpolation == "nearest" else 2**-10
        assert (there.double() - layer(images).double()).abs().max() <= bound


def test_the_meta_device_has_shapes():
    layer = Warp(LUT).to("meta")
    images = torch.empty(2, 3, HEIGHT, WIDTH, device="meta")
    view = layer(images)
    assert view.device.type == "meta" and view.shape == (2, 3, *LUT.shape)
    assert Warp(RING, "nearest")(torch.empty(1, 2, 3, HEIGHT, WIDTH, device="meta")).shape == (1, 3, *RING.shape)
    with refuses(errors.ArgumentError, "for which there are kernels on the CPU alone"):
        Warp(LUT, "area")(images)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device here")
@pytest.mark.parametrize("interpolation", ["bilinear", "nearest"])
def test_cuda_shows_the_same(interpolation):
    layer, images = Warp(LUT, interpolation, border_value=0.5), torch.rand(2, 3, HEIGHT, WIDTH)
    wanted = layer(images)
    there = layer.to("cuda")(images.cuda())
    assert (there.cpu() - wanted).abs().max() <= 2**-10


# ---------------------------------------------------------------------------------------------------------------------
# training, mistakes


def test_a_network_trains_as_with_grid_sample():
    maps = LUT.maps(outside=-9)
    grid = torch.from_numpy(
        np.stack([2 * m / (s - 1) - 1 for m, s in zip(maps, LUT.source_size, strict=True)], -1)[None]
    )

    def peer(images):
        at = grid.to(images.dtype).expand(len(images), -1, -1, -1)
        return torch.nn.functional.grid_sample(images, at, align_corners=True)

    images, target = numbers(4, 3, HEIGHT, WIDTH), numbers(4, 1, *LUT.shape, seed=9)
    losses = []
    for warp in (Warp(LUT), peer):
        torch.manual_seed(0)
        below, above = torch.nn.Conv2d(3, 8, 3, padding=1), torch.nn.Conv2d(8, 1, 3, padding=1)
        optimiser = torch.optim.SGD([*below.parameters(), *above.parameters()], lr=0.05)
        run = []
        for _ in range(50):
            loss = (above(torch.relu(warp(below(images)))) - target).square().mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            run.append(loss.item())
        losses.append(run)
    assert losses[0][-1] < 0.95 * losses[0][0]
    np.testing.assert_allclose(losses[0], losses[1], rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    ("make", "error", "phrase"),
    [
        (lambda: Warp("lut"), errors.ArgumentTypeError, "an ipm_rs.Lut or an ipm_rs.RigLut, got str"),
        (lambda: Warp(LUT, "mode"), errors.ArgumentError, "linear in the image"),
        (lambda: Warp(LUT, 3), errors.ArgumentError, "got int"),
        (lambda: Warp(LUT, border_value="red"), errors.ArgumentTypeError, "border_value"),
        (lambda: Warp(LUT, border_value=[]), errors.ArgumentError, "border_value"),
        (lambda: Warp(LUT, border_value=[1, 2])(numbers(1, 3, HEIGHT, WIDTH)), errors.ArgumentError, "one number or 3"),
        (lambda: Warp(LUT)(numbers(1, 3, WIDTH, HEIGHT)), errors.ImageError, f"H = {HEIGHT} and W = {WIDTH}"),
        (lambda: Warp(LUT)(numbers(HEIGHT, WIDTH)), errors.ImageError, "(N, C, H, W) or (C, H, W)"),
        (lambda: Warp(LUT)(np.zeros((1, 3, HEIGHT, WIDTH))), errors.ArgumentTypeError, "a torch.Tensor, got ndarray"),
        (lambda: Warp(LUT)(numbers(1, 3, HEIGHT, WIDTH).to(torch.complex64)), errors.DtypeError, "complex64"),
        (lambda: Warp(RING)(numbers(3, 3, HEIGHT, WIDTH)), errors.ImageError, "of 2 cameras"),
        (lambda: Warp(RING)({"front": numbers(3, HEIGHT, WIDTH)}), errors.ArgumentError, "'left'"),
        (lambda: Warp(RING)({"front": numbers(3, HEIGHT, WIDTH), "left": 3}), errors.ArgumentTypeError, "tensors"),
        (
            lambda: Warp(RING)({"front": numbers(1, 3, HEIGHT, WIDTH), "left": numbers(1, 2, HEIGHT, WIDTH)}),
            errors.ImageError,
            "as the first camera's",
        ),
        (
            lambda: LUT.warp(numbers(3, HEIGHT, WIDTH).requires_grad_(), layout="CHW"),
            errors.ArgumentTypeError,
            "ipm_rs.torch.Warp",
        ),
    ],
)
def test_mistakes_are_named(make, error, phrase):
    with refuses(error, phrase):
        make()
