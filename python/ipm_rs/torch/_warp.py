"""`Warp`: a table as a layer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor, nn

from ipm_rs import Lut
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError, DtypeError, ImageError
from ipm_rs.rig import RigLut
from ipm_rs.torch._geometry import sampled
from ipm_rs.torch._ops import rig_warp, warp
from ipm_rs.torch._tables import Table, luts_of, nearest_pixels, table_of

__all__ = ["Warp"]

_INTERPOLATIONS = ("bilinear", "nearest", "area")

#: What a map says where there is no image: far outside, which padding with zeros answers.
_FAR = -9.0


class Warp(nn.Module):
    """A bird's-eye view as a layer: (N, C, H, W) images or features to (N, C, rows, columns) of the road.

    On the CPU it runs in the kernels of `Lut.warp`, on `torch.get_num_threads()` threads, and gradients go back through
    `Lut.warp_adjoint`: exact, and the same for any number of threads. On any other device it is `grid_sample` with the
    table's maps. It works in `torch.compile` without a graph break, in `torch.func.vmap`, and with derivatives of any
    order.

    It has no parameters. Its state is the hash of the table, so that a checkpoint is not loaded into a model of another
    calibration. Picklable, and movable with ``.to(device)``; ``.half()`` and the like change nothing.

    Parameters
    ----------
    lut : Lut or RigLut
        The table. Of a `RigLut` the images of all cameras are taken at once.
    interpolation : {"bilinear", "nearest", "area"}
        As for `Lut.warp`. "area" is on the CPU only.
    border_value : float or sequence of float
        What cells get without an image; one, or one for each channel.

    Raises
    ------
    ArgumentTypeError, ArgumentError
        An argument is of another kind.
    OutOfMemoryError
        There is not enough memory to hash the table.
    """

    def __init__(
        self,
        lut: Lut | RigLut,
        interpolation: Literal["bilinear", "nearest", "area"] = "bilinear",
        border_value: float | Sequence[float] = 0.0,
    ) -> None:
        super().__init__()
        self._table = table_of(lut)
        if not isinstance(interpolation, str) or interpolation not in _INTERPOLATIONS:
            got = f"{interpolation!r:.60}" if isinstance(interpolation, str) else type(interpolation).__name__
            known = ", ".join(map(repr, _INTERPOLATIONS))
            raise ArgumentError(f"interpolation: expected one that is linear in the image, {known}, got {got}")
        self._interpolation = interpolation
        self._border = _numbers("border_value", border_value)
        self._key = self._table.key
        self._names = list(lut.rig) if isinstance(lut, RigLut) else []
        self._maps: _Maps | None = None

    @property
    def lut(self) -> Lut | RigLut:
        """The table."""
        return self._table.lut

    @property
    def interpolation(self) -> str:
        """How values are taken."""
        return self._interpolation

    @property
    def mask(self) -> Tensor:
        """(rows, columns) bool on the CPU: which cells have an image."""
        return torch.from_numpy(self._table.lut.mask)

    def extra_repr(self) -> str:
        """Tell what it is of."""
        rows, columns = self._table.shape
        cameras = f"{len(self._table.sources)} cameras, " if self._names else ""
        return f"{cameras}{rows} x {columns} cells, interpolation={self._interpolation!r}, table={self._key[:12]}"

    def forward(self, images: Any) -> Tensor:
        """Make the bird's-eye view.

        Parameters
        ----------
        images : Tensor
            Of one camera, (N, C, H, W) or (C, H, W), contiguous or ``channels_last``, of the table's size. Of a
            `RigLut` (N, cameras, C, H, W) or (cameras, C, H, W) in the rig's order; or, where sizes differ, a mapping
            of names to (N, C, H, W) or (C, H, W). Gradients go to floats: float16, bfloat16, float32 and float64;
            integers are taken too.

        Returns
        -------
        Tensor
            (N, C, rows, columns) or (C, rows, columns), of the images' dtype, device and memory format.

        Raises
        ------
        ImageError, DtypeError, ArgumentError, ArgumentTypeError
            Images of another shape or dtype, or on a device for which there is no such interpolation.
        """
        if self._names:
            return self._of_rig(images)
        if not isinstance(images, Tensor):
            raise ArgumentTypeError(f"images: expected a torch.Tensor, got {type(images).__name__}")
        if images.ndim == 3:
            return self.forward(images[None])[0]
        self._check("images", images, self._table.sources[0], "(N, C, H, W) or (C, H, W)")
        self._check_border(images.shape[1])
        if images.device.type == "cpu":
            return warp(images, self._key, self._interpolation, self._border)
        return self._on_device([images])

    def _of_rig(self, images: Any) -> Tensor:
        names = self._names
        if isinstance(images, Mapping):
            missing = [name for name in names if name not in images]
            if missing or len(images) != len(names):
                raise ArgumentError(f"images: expected one for each of {names}, got {sorted(map(str, images))}")
            given = [images[name] for name in names]
        elif isinstance(images, Tensor):
            if images.ndim not in (4, 5) or images.shape[-4] != len(names):
                raise ImageError(
                    f"images: expected (N, cameras, C, H, W) or (cameras, C, H, W) of {len(names)} cameras, got shape "
                    f"{tuple(images.shape)}"
                )
            given = list(images.unbind(-4))
        else:
            raise ArgumentTypeError(
                f"images: expected a torch.Tensor or a mapping of names to tensors, got {type(images).__name__}"
            )
        if not all(isinstance(image, Tensor) for image in given):
            raise ArgumentTypeError("images: expected tensors, got other objects in the mapping")
        if all(image.ndim == 3 for image in given):
            return self._of_batches(names, [image[None] for image in given])[0]
        return self._of_batches(names, given)

    def _of_batches(self, names: list[str], images: list[Tensor]) -> Tensor:
        first = images[0]
        for name, image, source in zip(names, images, self._table.sources, strict=True):
            self._check(f"images[{name!r}]", image, source, "(N, C, H, W)")
            if (image.shape[:2], image.dtype, image.device) != (first.shape[:2], first.dtype, first.device):
                raise ImageError(
                    f"images[{name!r}]: expected (N, C) = {tuple(first.shape[:2])} of {first.dtype} on {first.device}, "
                    f"as the first camera's, got {tuple(image.shape[:2])} of {image.dtype} on {image.device}"
                )
        self._check_border(first.shape[1])
        if first.device.type == "cpu":
            return rig_warp(images, self._key, self._interpolation, self._border)
        return self._on_device(images)

    def _check(self, name: str, images: Tensor, source: tuple[int, int], what: str) -> None:
        if images.ndim != 4 or tuple(images.shape[-2:]) != source or images.shape[1] == 0:
            rows, columns = source
            raise ImageError(
                f"{name}: expected {what} with H = {rows} and W = {columns}, as the table's camera has, got shape "
                f"{tuple(images.shape)}; for features of another size build the table of camera.resized(width, height)"
            )

    def _check_border(self, channels: int) -> None:
        if len(self._border) not in (1, channels):
            raise ArgumentError(f"border_value: expected one number or {channels}, got {len(self._border)}")

    # ------------------------------------------------------------ other devices

    def _on_device(self, images: list[Tensor]) -> Tensor:
        """Make it with PyTorch's own operators, wherever the images are."""
        first = images[0]
        if self._interpolation == "area":
            raise ArgumentError(
                f'interpolation: expected "bilinear" or "nearest" for images on {first.device}, got "area", for which '
                "there are kernels on the CPU alone; use images.cpu(), or bilinear"
            )
        if self._maps is None or self._maps.device != first.device:
            if torch.compiler.is_compiling():
                raise ArgumentError(
                    f"images: expected them where the layer is, got {first.device}; use warp.to({str(first.device)!r})"
                )
            self._maps = _Maps(self._table, self._interpolation, first.device)
        return self._maps.warp(images, self._border)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> Any:
        module = super()._apply(fn, recurse)
        device = fn(torch.empty(0)).device
        # not buffers: `.half()` would round their coordinates
        elsewhere = device.type != "cpu" and self._interpolation != "area"
        self._maps = _Maps(self._table, self._interpolation, device) if elsewhere else None
        return module

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is worked out from the table."""
        return {**self.__dict__, "_maps": None}

    # ------------------------------------------------------------ state

    def get_extra_state(self) -> dict[str, str]:
        """Return the hash of the table, which is all of the layer's state."""
        return {"table": self._key}

    def set_extra_state(self, state: Any) -> None:
        """Check that a checkpoint is of this table.

        Raises
        ------
        CalibrationError
            It is of another one.
        """
        got = state.get("table") if isinstance(state, Mapping) else None
        if not isinstance(got, str) or got != self._key:
            shown = got[:12] + "..." if isinstance(got, str) else "no hash"
            raise CalibrationError(
                f"state_dict: expected that of a Warp through table {self._key[:12]}..., got {shown}; the checkpoint "
                "is of another camera, grid or road: build this Warp from its table, or leave the entry out"
            )


class _Maps:
    """A table's maps as tensors on a device."""

    def __init__(self, table: Table, interpolation: str, device: torch.device) -> None:
        self.device = device
        self._nearest = interpolation == "nearest"
        luts = luts_of(table.lut)
        self._sources = table.sources
        self._shape = table.shape
        if self._nearest:
            self._pixels = [torch.from_numpy(nearest_pixels(lut)).to(device) for lut in luts]
        else:
            # (rows, columns, 2) source pixels
            self._places = [torch.from_numpy(np.stack(lut.maps(outside=_FAR), -1)).to(device) for lut in luts]
        self._weights: list[Tensor] | None = None
        if isinstance(table.lut, RigLut):
            rig = table.lut
            if self._nearest:
                source = torch.from_numpy(rig.source)
                self._weights = [(source == place).to(device) for place in range(len(luts))]
            else:
                self._weights = [torch.from_numpy(rig.weights(name)).to(device) for name in rig.rig]

    def warp(self, images: list[Tensor], border: Sequence[float]) -> Tensor:
        """Make the view of one image of each camera."""
        return self._moved(images, border) if self._nearest else self._blended(images, border)

    def _moved(self, images: list[Tensor], border: Sequence[float]) -> Tensor:
        first = images[0]
        empty = first.new_tensor(border).reshape(1, -1, 1, 1)
        view = empty.expand(*first.shape[:2], *self._shape)
        for place, (image, pixels) in enumerate(zip(images, self._pixels, strict=True)):
            shown = pixels >= 0 if self._weights is None else (pixels >= 0) & self._weights[place]
            own = image.flatten(2)[..., pixels.clamp(min=0).flatten()].unflatten(-1, self._shape)
            view = torch.where(shown, own, view)
        return view

    def _blended(self, images: list[Tensor], border: Sequence[float]) -> Tensor:
        first = images[0]
        if not first.is_floating_point():
            raise DtypeError(
                f"images: expected floats for bilinear on {self.device}, got {first.dtype}; use images.float()"
            )
        wide = first.dtype if first.dtype == torch.float64 else torch.float32
        empty = torch.as_tensor(border, dtype=wide, device=first.device).reshape(1, -1, 1, 1)
        view: Any = empty
        for place, (image, at) in enumerate(zip(images, self._places, strict=True)):
            # above the border's value, so that zeros around the image are the border
            own = sampled(image.to(wide) - empty, at.to(wide).expand(len(image), *at.shape))
            view = view + (own if self._weights is None else own * self._weights[place].to(wide))
        return view.to(first.dtype)


def _numbers(name: str, values: Any) -> list[float]:
    try:
        array = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(
            f"{name}: expected a number or one for each channel, got {type(values).__name__}"
        ) from error
    if array.ndim != 1 or not array.size:
        raise ArgumentError(f"{name}: expected a number or one for each channel, got shape {array.shape}")
    return [float(value) for value in array]
