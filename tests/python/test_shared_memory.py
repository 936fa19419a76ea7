"""Tensors and buffers of other libraries, in and out, without a copy."""

from __future__ import annotations

import array
import ctypes
import mmap

import numpy as np
import pytest
from helpers import refuses, same, textured

import ipm_rs
from ipm_rs import errors

SHAPE = (40, 50, 3)
RESULT = (60, 70, 3)


@pytest.fixture(scope="module")
def lut() -> ipm_rs.Lut:
    rows, columns = np.mgrid[0:60, 0:70].astype(np.float64)
    return ipm_rs.Lut.from_maps(
        0.8 * columns + 0.21 * rows - 6.3, 0.7 * rows - 0.13 * columns + 2.2, source_size=(50, 40)
    )


class Tensor:
    """What another library's tensor offers, on memory that is a NumPy array's."""

    def __init__(self, array: np.ndarray, device: int = 1) -> None:
        self._array = array
        self._device = device
        self.exports = 0

    def __dlpack__(self, **options):
        self.exports += 1
        return self._array.__dlpack__(**options)

    def __dlpack_device__(self):
        return (self._device, 0)


class TensorWithArray(Tensor):
    """As torch's, whose `__array__` knows no `copy`."""

    def __array__(self, dtype=None):
        return self._array if dtype is None else self._array.astype(dtype)


class ArrayOnly:
    def __init__(self, array: np.ndarray, copies: bool = False) -> None:
        self._array = array
        self._copies = copies

    def __array__(self, dtype=None, copy=None):
        return self._array.copy() if self._copies else self._array


class Interface:
    def __init__(self, array: np.ndarray) -> None:
        self._array = array
        self.__array_interface__ = array.__array_interface__


SHARERS = {
    "DLPack": Tensor,
    "DLPack and __array__": TensorWithArray,
    "__array__": ArrayOnly,
    "__array_interface__": Interface,
    "memoryview": memoryview,
    "memoryview of a buffer": lambda a: memoryview(bytearray(a.tobytes())).cast("B", a.shape),
}


@pytest.mark.parametrize("name", SHARERS)
@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_images_that_share_their_memory(lut, name, interpolation):
    image = textured(*SHAPE)
    got = lut.warp(SHARERS[name](image), interpolation=interpolation)
    assert type(got) is np.ndarray
    assert same(got, lut.warp(image, interpolation=interpolation))


@pytest.mark.parametrize("name", ["DLPack", "DLPack and __array__", "__array__", "__array_interface__", "memoryview"])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_strides_come_along(lut, name, dtype):
    image = textured(100, 130, 3, dtype)[30:70, 17:67]
    assert same(lut.warp(SHARERS[name](image)), lut.warp(image))
    planes = textured(3 * 100, 130, None, dtype).reshape(3, 100, 130)[::-1, 30:70, 17:67]
    if name != "DLPack":  # whose strides are not negative
        assert same(lut.warp(SHARERS[name](planes), layout="CHW"), lut.warp(planes, layout="CHW"))
    planes = planes[::-1]
    assert same(lut.warp(SHARERS[name](planes), layout="CHW"), lut.warp(planes, layout="CHW"))


@pytest.mark.parametrize("name", ["DLPack and __array__", "__array__", "__array_interface__", "memoryview"])
@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_out_is_written_in_place_and_returned_itself(lut, name, interpolation):
    image = textured(*SHAPE)
    memory = np.full(RESULT, 77, np.uint8)
    out = SHARERS[name](memory)
    assert lut.warp(SHARERS[name](image), out=out, interpolation=interpolation) is out
    assert same(memory, lut.warp(image, interpolation=interpolation))


def test_out_that_has_dlpack_alone(lut):
    """Writable where both sides speak DLPack 1, which says so; else NumPy takes it for read-only, and so do we."""
    image, memory = textured(*SHAPE), np.full(RESULT, 77, np.uint8)
    out = Tensor(memory)
    if np.from_dlpack(out).flags.writeable:
        assert lut.warp(image, out=out) is out
        assert same(memory, lut.warp(image))
    else:
        with refuses(errors.ImageError, "out", "read-only", out=memory):
            lut.warp(image, out=out)


def test_no_copy_is_made_of_an_image(lut):
    """Planes of 4 GB that are one row."""
    row = textured(1, 60_000)
    columns = np.linspace(0, 59_999, 100).round()
    wide = ipm_rs.Lut.from_maps(
        columns[np.newaxis], np.linspace(0, 64_999, 100).round()[np.newaxis], source_size=(60_000, 65_000)
    )
    image = np.lib.stride_tricks.as_strided(row, (65_000, 60_000), (0, 1))
    for share in (Tensor, ArrayOnly):
        np.testing.assert_array_equal(wide.warp(share(image)), row[:, columns.astype(int)])


def test_out_that_overlaps_the_image_by_another_way():
    map_x, map_y = np.meshgrid(np.arange(8.0)[::-1], np.arange(4.0))
    flip = ipm_rs.Lut.from_maps(map_x, map_y, source_size=(8, 4))
    image = textured(4, 8, 3)
    for share in (TensorWithArray, memoryview, ArrayOnly):
        with refuses(errors.ImageError, "out", "memory", out=image):
            flip.warp(image, out=share(image))
        with refuses(errors.ImageError, "out", "memory", out=image):
            flip.warp(Tensor(image), out=image)


def test_read_only_memory(lut):
    image = textured(*SHAPE)
    expected = lut.warp(image)
    assert same(lut.warp(memoryview(image.tobytes()).cast("B", SHAPE)), expected)
    image.setflags(write=False)
    for share in (memoryview, ArrayOnly, Interface):
        assert same(lut.warp(share(image)), expected)
        out = np.full(RESULT, 7, np.uint8)
        out.setflags(write=False)
        with refuses(errors.ImageError, "out", "read-only", out=out):
            lut.warp(image, out=share(out))


@pytest.mark.parametrize("device", [2, 4, 7, 8, 10, 14])
def test_memory_of_another_device(lut, device):
    image = textured(*SHAPE)
    tensor = TensorWithArray(image, device)
    with refuses(errors.ArgumentTypeError, "image", "CPU", "TensorWithArray", f"type {device}", "image.cpu()"):
        lut.warp(tensor)
    memory = np.full(RESULT, 7, np.uint8)
    with refuses(errors.ArgumentTypeError, "out", "CPU", "out.cpu()", out=memory):
        lut.warp(image, out=TensorWithArray(memory, device))
    assert tensor.exports == 0


def test_pinned_memory_is_the_cpus(lut):
    image = textured(*SHAPE)
    assert same(lut.warp(TensorWithArray(image, 3)), lut.warp(image))


class NeedsGradient(Tensor):
    def __dlpack__(self, **options):
        raise BufferError("tensors that require gradient cannot be exported, use tensor.detach()")

    def __array__(self, dtype=None):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead.")


def test_what_the_producer_says_is_passed_on(lut):
    image, memory = textured(*SHAPE), np.full(RESULT, 7, np.uint8)
    with refuses(errors.ArgumentTypeError, "image", "NeedsGradient", "tensor.detach()") as _:
        lut.warp(NeedsGradient(image))
    with refuses(errors.ArgumentTypeError, "out", "NeedsGradient", "tensor.detach()", out=memory):
        lut.warp(image, out=NeedsGradient(memory))
    with pytest.raises(errors.ArgumentTypeError) as caught:
        lut.warp(NeedsGradient(image))
    assert isinstance(caught.value.__cause__, BufferError)


def test_an_interrupt_is_not_swallowed(lut):
    class Interrupted(Tensor):
        def __dlpack__(self, **options):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lut.warp(Interrupted(textured(*SHAPE)))


def test_a_broken_producer(lut):
    class NoCapsule(Tensor):
        def __dlpack__(self, **options):
            return 3

    class StrangeDevice(TensorWithArray):
        def __dlpack_device__(self):
            return "cpu"

    with refuses(errors.ArgumentTypeError, "image", "NoCapsule"):
        lut.warp(NoCapsule(textured(*SHAPE)))
    image = textured(*SHAPE)
    assert same(lut.warp(StrangeDevice(image)), lut.warp(image))


COPIES = {
    "a list": lambda a: a.tolist(),
    "__array__ that copies": lambda a: ArrayOnly(a, copies=True),
    "an array of objects": lambda a: ArrayOnly(a.astype(object)),
}


@pytest.mark.parametrize("name", COPIES)
def test_what_would_need_a_copy_is_refused(lut, name):
    image, memory = textured(*SHAPE), np.full(RESULT, 7, np.uint8)
    with refuses(errors.ArgumentTypeError, "image", "array", "numpy.asarray(image)"):
        lut.warp(COPIES[name](image))
    with refuses(errors.ArgumentTypeError, "out", "array"):
        lut.warp(image, out=COPIES[name](memory))


@pytest.mark.parametrize(
    "buffer",
    [bytearray(32), array.array("f", [0.0] * 32), memoryview(b"0" * 32), (ctypes.c_ubyte * 32)(), mmap.mmap(-1, 32)],
    ids=lambda buffer: type(buffer).__name__,
)
def test_buffers_of_one_dimension_have_no_rows(lut, buffer):
    with refuses(errors.ArgumentTypeError, "image", "rows and columns", type(buffer).__name__, "reshape"):
        lut.warp(buffer)


def test_buffers_with_a_shape(lut):
    """array.array and ctypes memory become images by a cast, and lose nothing."""
    image = textured(*SHAPE, "float32")
    flat = array.array("f", image.ravel().tolist())
    view = memoryview(flat).cast("B").cast("f", SHAPE)
    assert same(lut.warp(view), lut.warp(image))
    out = memoryview(array.array("f", [0.0] * int(np.prod(RESULT)))).cast("B").cast("f", RESULT)
    assert lut.warp(view, out=out) is out
    np.testing.assert_array_equal(np.asarray(out), lut.warp(image))
    rows = ((ctypes.c_ubyte * 50) * 40)()
    grey = textured(40, 50)
    np.asarray(rows)[...] = grey
    assert same(lut.warp(rows), lut.warp(grey))


def test_tensors_that_a_layer_takes_are_told_of_it(lut):
    image = textured(*SHAPE)
    needing, elsewhere = NeedsGradient(image), TensorWithArray(image, 2)
    needing.requires_grad = True
    with refuses(errors.ArgumentTypeError, "image: expected values", "requires grad", "ipm_rs.torch.Warp", "detach()"):
        lut.warp(needing)
    with refuses(errors.ArgumentTypeError, "use image.cpu()") as _:
        lut.warp(elsewhere)
    elsewhere.__class__ = type("Tensor", (TensorWithArray,), {"__module__": "torch"})
    with refuses(errors.ArgumentTypeError, "use image.cpu(), or ipm_rs.torch.Warp"):
        lut.warp(elsewhere)


def test_buffers_are_released(lut):
    """A bytearray with an export cannot be resized: nothing of it is kept after the call."""
    memory = bytearray(textured(*SHAPE).tobytes())
    result = bytearray(int(np.prod(RESULT)))
    for _ in range(3):
        lut.warp(memoryview(memory).cast("B", SHAPE), out=memoryview(result).cast("B", RESULT))
    memory.append(1)
    result.append(1)


def test_torch(lut):
    torch = pytest.importorskip("torch")
    image = textured(*SHAPE)
    expected = lut.warp(image)
    assert same(lut.warp(torch.from_numpy(image)), expected)
    out = torch.zeros(RESULT, dtype=torch.uint8)
    assert lut.warp(torch.from_numpy(image), out=out) is out
    assert same(out.numpy(), expected)
    planes = torch.from_numpy(textured(2 * 3 * 40, 50, None, "float32").reshape(2, 3, 40, 50))
    batch = torch.empty((2, 3, 60, 70))
    assert lut.warp(planes, layout="NCHW", out=batch) is batch
    assert same(batch.numpy(), lut.warp(planes.numpy(), layout="NCHW"))
    with refuses(errors.ArgumentTypeError, "image", "Tensor", "detach()"):
        lut.warp(planes.clone().requires_grad_(), layout="NCHW")
    with refuses(errors.ArgumentTypeError, "out", "Tensor", "detach()"):
        lut.warp(planes, layout="NCHW", out=batch.clone().requires_grad_())
    labels = torch.from_numpy(textured(40, 50, None, "bool"))
    assert same(lut.warp(labels, interpolation="nearest"), lut.warp(labels.numpy(), interpolation="nearest"))
