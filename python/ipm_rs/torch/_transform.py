"""`Transform`: what a dataset does to each of its samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor

from ipm_rs import Lut
from ipm_rs.errors import ArgumentTypeError
from ipm_rs.rig import RigLut

__all__ = ["Transform"]


class Transform:
    """An image, its labels and which cells are seen, from above: for the ``__getitem__`` of a dataset.

    Runs on `torch.get_num_threads()` threads, which is one in the workers of a DataLoader. Picklable, so that it goes
    to workers that are spawned; forked ones share the table's memory.

    Parameters
    ----------
    lut : Lut or RigLut
        The table.
    interpolation : {"bilinear", "nearest", "area"}
        Of images.
    label_interpolation : {"nearest", "mode"}
        Of labels, which are never blended: "mode" takes the commonest id of what a cell covers.
    border_value : float or sequence of float
        What cells of images get without an image.
    ignore_index : int
        What cells of labels get there: 255, or -100, which losses leave out.

    Raises
    ------
    ArgumentTypeError
        `lut` is no table.
    """

    def __init__(
        self,
        lut: Lut | RigLut,
        *,
        interpolation: Literal["bilinear", "nearest", "area"] = "bilinear",
        label_interpolation: Literal["nearest", "mode"] = "nearest",
        border_value: float | Sequence[float] = 0.0,
        ignore_index: int = 255,
    ) -> None:
        if not isinstance(lut, (Lut, RigLut)):
            raise ArgumentTypeError(f"lut: expected an ipm_rs.Lut or an ipm_rs.RigLut, got {type(lut).__name__}")
        self._lut = lut
        self._image = {"interpolation": interpolation, "border_value": border_value}
        self._label = {"interpolation": label_interpolation, "border_value": ignore_index}

    @property
    def lut(self) -> Lut | RigLut:
        """The table."""
        return self._lut

    def __call__(self, image: Any, label: Any = None) -> Any:
        """Warp a sample.

        Parameters
        ----------
        image : array, PIL image or Tensor; of a `RigLut`, a mapping of names to these
            (H, W) or (H, W, C) of any dtype that `Lut.warp` takes; of tensors (C, H, W).
        label : likewise, optional
            (H, W) of whole numbers.

        Returns
        -------
        dict of str to Tensor
            ``image``, (C, rows, columns) of the image's dtype, a view of (rows, columns, C) where the image was so;
            ``mask``, (rows, columns) bool, which cells are seen; and ``label``, (rows, columns), if one was given.

        Raises
        ------
        ImageError, DtypeError, ArgumentError, ArgumentTypeError
            As for `Lut.warp`.
        """
        sample = {"image": self._warped(image, self._image), "mask": torch.from_numpy(self._lut.mask)}
        if label is not None:
            sample["label"] = self._warped(label, self._label)
        return sample

    def _warped(self, image: Any, options: dict[str, Any]) -> Tensor:
        first = next(iter(image.values()), None) if isinstance(image, Mapping) else image
        planar = isinstance(first, Tensor) and first.ndim == 3
        if isinstance(image, Mapping):
            given: Any = {name: _memory(one) for name, one in image.items()}
        else:
            given = _memory(image)
        how: dict[str, Any] = {**options, "threads": torch.get_num_threads(), "layout": "CHW" if planar else "HWC"}
        view = self._lut.warp(given, **how)
        tensor = torch.from_numpy(view)
        if tensor.ndim == 2:
            return tensor if options is self._label else tensor[None]
        return tensor if planar else tensor.permute(2, 0, 1)


def _memory(image: Any) -> Any:
    """Return what `Lut.warp` reads: arrays and tensors as they are, pictures of Pillow by their memory."""
    if isinstance(image, Tensor):
        return image.detach().contiguous().numpy() if image.device.type == "cpu" else image
    return image if isinstance(image, np.ndarray) else np.asarray(image)
