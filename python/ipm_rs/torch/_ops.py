"""The operators ``ipm_rs::warp`` and ``ipm_rs::rig_warp`` and their transposes.

Warps are linear, so that each is the gradient of the other, and derivatives of any order are exact. Tables go by their
names; see `_tables`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from ipm_rs import Lut
from ipm_rs.rig import RigLut
from ipm_rs.torch._tables import table_named

__all__ = ["rig_warp", "warp"]


def is_interleaved(images: Tensor) -> bool:
    """Whether the channels of (N, C, H, W) lie side by side (``torch.channels_last``), and not in planes."""
    return not images.is_contiguous() and images.is_contiguous(memory_format=torch.channels_last)


def _like(images: Tensor, shape: tuple[int, int], interleaved: bool) -> Tensor:
    """Return memory for as many pictures of another size."""
    order = torch.channels_last if interleaved else torch.contiguous_format
    count, channels = images.shape[:2]
    return torch.empty((count, channels, *shape), dtype=images.dtype, device=images.device, memory_format=order)


def _room(table: str, kind: str, images: Tensor, shape: tuple[int, int], interleaved: bool) -> Tensor:
    """Return memory as `_like` does, that of the table's last such result if nobody holds it any more."""
    count, channels = images.shape[:2]
    size = count * channels * shape[0] * shape[1]
    if size == 0:
        return _like(images, shape, interleaved)
    room = table_named(table).memory.room(kind, size * images.element_size())
    memory = torch.from_numpy(room).view(images.dtype)
    if interleaved:
        return memory.view(count, *shape, channels).permute(0, 3, 1, 2)
    return memory.view(count, channels, *shape)


def _dense(images: Tensor) -> Tensor:
    return images if is_interleaved(images) else images.contiguous()


def _array(images: Tensor) -> tuple[Any, str]:
    """Return the memory of dense (N, C, H, W) as an array, and its layout."""
    if is_interleaved(images):
        return images.permute(0, 2, 3, 1).numpy(), "NHWC"
    return images.numpy(), "NCHW"


#: What NumPy or the adjoint lack is worked out in float32.
_FORWARD = {torch.bfloat16: torch.float32}
_BACKWARD = {torch.bfloat16: torch.float32, torch.float16: torch.float32}


def _as(tensors: Sequence[Tensor], wider: dict[torch.dtype, torch.dtype]) -> list[Tensor]:
    return [_dense(tensor.detach().to(wider.get(tensor.dtype, tensor.dtype))) for tensor in tensors]


def _options(interpolation: str, layout: str, border: Sequence[float] | None = None) -> dict[str, Any]:
    """Return what warps are called with: as many threads as PyTorch has for its own operators, one in a worker."""
    options = {"interpolation": interpolation, "layout": layout, "threads": torch.get_num_threads()}
    return options if border is None else {**options, "border_value": border[0] if len(border) == 1 else list(border)}


def _lut(key: str) -> Lut:
    lut = table_named(key).lut
    assert isinstance(lut, Lut), "a name of the other kind"
    return lut


def _rig_lut(key: str) -> RigLut:
    lut = table_named(key).lut
    assert isinstance(lut, RigLut), "a name of the other kind"
    return lut


# ---------------------------------------------------------------- one camera


@torch.library.custom_op("ipm_rs::warp", mutates_args=(), device_types="cpu")
def warp(images: Tensor, table: str, interpolation: str, border: Sequence[float]) -> Tensor:
    """(N, C, H, W) images of a camera to (N, C, rows, columns) of the road."""
    lut = _lut(table)
    (given,) = _as([images], _FORWARD)
    made = _room(table, "warp", given, lut.shape, is_interleaved(given))
    if made.numel():
        array, layout = _array(given)
        lut.warp(array, out=_array(made)[0], **_options(interpolation, layout, border))
    return made.to(images.dtype)


@torch.library.custom_op("ipm_rs::warp_adjoint", mutates_args=(), device_types="cpu")
def warp_adjoint(grad: Tensor, table: str, interpolation: str) -> Tensor:
    """(N, C, rows, columns) of the road to the (N, C, H, W) pixels that it was taken from."""
    lut = _lut(table)
    (given,) = _as([grad], _BACKWARD)
    made = _room(table, "adjoint", given, lut.source_size[::-1], is_interleaved(given))
    if made.numel():
        array, layout = _array(given)
        lut.warp_adjoint(array, out=_array(made)[0], **_options(interpolation, layout))
    return made.to(grad.dtype)


@warp.register_fake
def _(images: Tensor, table: str, interpolation: str, border: Sequence[float]) -> Tensor:
    return _like(images, table_named(table).shape, is_interleaved(images))


@warp_adjoint.register_fake
def _(grad: Tensor, table: str, interpolation: str) -> Tensor:
    return _like(grad, table_named(table).sources[0], is_interleaved(grad))


def _keep(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
    # the table itself too: a module may be gone before its gradients are asked for
    ctx.of = inputs[1], inputs[2]
    ctx.table = table_named(inputs[1])


def _warp_gradient(ctx: Any, grad: Tensor) -> tuple[Any, ...]:
    return warp_adjoint(grad, *ctx.of), None, None, None


def _adjoint_gradient(ctx: Any, grad: Tensor) -> tuple[Any, ...]:
    return warp(grad, *ctx.of, [0.0]), None, None


warp.register_autograd(_warp_gradient, setup_context=_keep)
warp_adjoint.register_autograd(_adjoint_gradient, setup_context=_keep)


def _folded(tensor: Tensor, dim: int | None, size: int) -> Tensor:
    """Make the dimension that is mapped over a part of the batch."""
    moved = tensor.expand(size, *tensor.shape) if dim is None else tensor.movedim(dim, 0)
    return moved.flatten(0, 1)


@warp.register_vmap
def _(
    info: Any, in_dims: tuple[Any, ...], images: Tensor, table: str, interpolation: str, border: Sequence[float]
) -> tuple[Tensor, int]:
    folded = _folded(images, in_dims[0], info.batch_size)
    return warp(folded, table, interpolation, border).unflatten(0, (info.batch_size, -1)), 0


@warp_adjoint.register_vmap
def _(info: Any, in_dims: tuple[Any, ...], grad: Tensor, table: str, interpolation: str) -> tuple[Tensor, int]:
    folded = _folded(grad, in_dims[0], info.batch_size)
    return warp_adjoint(folded, table, interpolation).unflatten(0, (info.batch_size, -1)), 0


# ---------------------------------------------------------------- a ring of cameras


def _are_interleaved(images: Sequence[Tensor]) -> bool:
    # each by itself: those of one camera may be parts of (N, cameras, C, H, W)
    return is_interleaved(images[0][:1])


@torch.library.custom_op("ipm_rs::rig_warp", mutates_args=(), device_types="cpu")
def rig_warp(images: Sequence[Tensor], table: str, interpolation: str, border: Sequence[float]) -> Tensor:
    """(N, C, H, W) images of each camera to (N, C, rows, columns) of the road."""
    lut = _rig_lut(table)
    given = [image.detach().to(_FORWARD.get(image.dtype, image.dtype)) for image in images]
    interleaved = _are_interleaved(given)
    made = _room(table, "warp", given[0], lut.shape, interleaved)
    order, layout = ((1, 2, 0), "HWC") if interleaved else ((0, 1, 2), "CHW")
    options = _options(interpolation, layout, border)
    for index in range(len(made) if made.numel() else 0):  # of (N, cameras, ...) those of a camera are not side by side
        own = [image[index].permute(order).contiguous().numpy() for image in given]
        lut.warp(own, out=made[index].permute(order).numpy(), **options)
    return made.to(images[0].dtype)


@torch.library.custom_op("ipm_rs::rig_warp_adjoint", mutates_args=(), device_types="cpu")
def rig_warp_adjoint(grad: Tensor, table: str, interpolation: str) -> list[Tensor]:
    """(N, C, rows, columns) of the road to the (N, C, H, W) pixels of each camera."""
    lut = _rig_lut(table)
    (given,) = _as([grad], _BACKWARD)
    if not given.numel():
        return [_like(grad, source, is_interleaved(grad)) for source in table_named(table).sources]
    array, layout = _array(given)
    found = lut.warp_adjoint(array, **_options(interpolation, layout))
    tensors = [torch.from_numpy(found[name]) for name in lut.rig]
    if layout == "NHWC":
        tensors = [tensor.permute(0, 3, 1, 2) for tensor in tensors]
    return [tensor.to(grad.dtype) for tensor in tensors]


@rig_warp.register_fake
def _(images: Sequence[Tensor], table: str, interpolation: str, border: Sequence[float]) -> Tensor:
    return _like(images[0], table_named(table).shape, _are_interleaved(images))


@rig_warp_adjoint.register_fake
def _(grad: Tensor, table: str, interpolation: str) -> list[Tensor]:
    return [_like(grad, source, is_interleaved(grad)) for source in table_named(table).sources]


def _rig_warp_gradient(ctx: Any, grad: Tensor) -> tuple[Any, ...]:
    return rig_warp_adjoint(grad, *ctx.of), None, None, None


def _rig_adjoint_gradient(ctx: Any, grads: Sequence[Tensor]) -> tuple[Any, ...]:
    return rig_warp(grads, *ctx.of, [0.0]), None, None


rig_warp.register_autograd(_rig_warp_gradient, setup_context=_keep)
rig_warp_adjoint.register_autograd(_rig_adjoint_gradient, setup_context=_keep)


@rig_warp.register_vmap
def _(
    info: Any,
    in_dims: tuple[Any, ...],
    images: Sequence[Tensor],
    table: str,
    interpolation: str,
    border: Sequence[float],
) -> tuple[Tensor, int]:
    dims = in_dims[0] if isinstance(in_dims[0], (list, tuple)) else [in_dims[0]] * len(images)
    folded = [_folded(image, dim, info.batch_size) for image, dim in zip(images, dims, strict=True)]
    return rig_warp(folded, table, interpolation, border).unflatten(0, (info.batch_size, -1)), 0


@rig_warp_adjoint.register_vmap
def _(
    info: Any, in_dims: tuple[Any, ...], grad: Tensor, table: str, interpolation: str
) -> tuple[list[Tensor], list[int]]:
    found = rig_warp_adjoint(_folded(grad, in_dims[0], info.batch_size), table, interpolation)
    return [one.unflatten(0, (info.batch_size, -1)) for one in found], [0] * len(found)
