"""Warps inside PyTorch (extra ``torch``): a layer with gradients, samples for a DataLoader, cameras that are learned.

    warp = ipm_rs.torch.Warp(lut)                              # an nn.Module: (N, C, H, W) to (N, C, rows, columns)
    transform = ipm_rs.torch.Transform(lut)                    # image, labels and mask of a dataset's sample
    uv, depth = ipm_rs.torch.project(points, K, pose)          # gradients to the camera's pose, its K and the road
    view = ipm_rs.torch.sample(images, uv, depth > 0)

On the CPU a warp runs in our kernels, and its gradients are exact transposes that do not depend on the number of
threads; on any other device it runs in `torch.nn.functional.grid_sample`.
"""

from importlib import import_module as _import_module

from ipm_rs.errors import MissingExtraError

try:
    _import_module("torch")
except ImportError as error:
    raise MissingExtraError(
        f'expected PyTorch, found none ({error}); install it with: pip install "ipm-rs[torch]"'
    ) from error

from ipm_rs.torch._geometry import camera_from_vehicle, ground_points, project, sample
from ipm_rs.torch._transform import Transform
from ipm_rs.torch._warp import Warp

__all__ = ["Transform", "Warp", "camera_from_vehicle", "ground_points", "project", "sample"]
