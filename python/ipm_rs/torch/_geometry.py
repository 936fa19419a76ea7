"""Cameras that are learned: projection and sampling with gradients to poses, intrinsics and the height of the road."""

from __future__ import annotations

from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from ipm_rs import BevGrid, BrownConrady, KannalaBrandt
from ipm_rs.errors import ArgumentTypeError, ImageError

__all__ = ["camera_from_vehicle", "ground_points", "project", "sample", "sampled"]

#: Axes of a camera, x right, y down and z forward, from those of the vehicle, x forward, y left and z up.
_OPTICAL = ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))


def camera_from_vehicle(position: Any, roll: Any = 0.0, pitch: Any = 0.0, yaw: Any = 0.0) -> Tensor:
    """Return the pose of a camera as `Camera.from_euler` builds it, with gradients to its position and angles.

    Parameters
    ----------
    position : (3,) Tensor or sequence of float
        Where the camera is in the vehicle frame, metres: x forward, y left, z up.
    roll, pitch, yaw : Tensor or float
        Radians, of no dimension. Positive pitch looks down, yaw turns left, roll lifts the left side.

    Returns
    -------
    (4, 4) Tensor
        ``camera_from_vehicle``, float64 if all of them are numbers, else of the first tensor's dtype and device.

    Raises
    ------
    ImageError
        `position` is of another shape.
    """
    given = [value for value in (position, roll, pitch, yaw) if isinstance(value, Tensor)]
    like = given[0] if given else torch.zeros((), dtype=torch.float64)

    def number(value: Any) -> Tensor:
        return torch.as_tensor(value, dtype=like.dtype, device=like.device)

    place = number(position)
    if place.shape != (3,):
        raise ImageError(f"position: expected (3,), got shape {tuple(place.shape)}")
    zero, one = number(0.0), number(1.0)

    def turn(angle: Any, axis: int) -> Tensor:
        c, s = torch.cos(number(angle)), torch.sin(number(angle))
        rows = [
            [[one, zero, zero], [zero, c, -s], [zero, s, c]],
            [[c, zero, s], [zero, one, zero], [-s, zero, c]],
            [[c, -s, zero], [s, c, zero], [zero, zero, one]],
        ][axis]
        return torch.stack([torch.stack(row) for row in rows])

    vehicle_from_body = turn(yaw, 2) @ turn(pitch, 1) @ turn(roll, 0)
    rotation = number(_OPTICAL) @ vehicle_from_body.T
    top = torch.cat([rotation, -(rotation @ place)[:, None]], 1)
    return torch.cat([top, number([[0.0, 0.0, 0.0, 1.0]])])


def ground_points(grid: BevGrid, ground: Any = 0.0, **options: Any) -> Tensor:
    """Return the samples of a grid's cells on a level road, with gradients to the road's height.

    Parameters
    ----------
    grid : BevGrid
        The grid.
    ground : Tensor or float
        The height of the road: of no dimension, or one for each cell, (rows, columns), metres.
    **options
        ``dtype`` and ``device``; by default those of `ground`, or float32.

    Returns
    -------
    (rows, columns, 3) Tensor
        Points in the vehicle frame, metres.

    Raises
    ------
    ArgumentTypeError
        `grid` is none.
    """
    if not isinstance(grid, BevGrid):
        raise ArgumentTypeError(f"grid: expected an ipm_rs.BevGrid, got {type(grid).__name__}")
    if isinstance(ground, Tensor):
        options = {"dtype": ground.dtype, "device": ground.device, **options}
    options.setdefault("dtype", torch.float32)
    xy = torch.as_tensor(grid.xy(), **options)
    height = torch.as_tensor(ground, **options).expand(xy.shape[:-1])
    return torch.cat([xy, height[..., None]], -1)


def project(
    points: Tensor, intrinsics: Tensor, camera_from_vehicle: Tensor, lens: BrownConrady | KannalaBrandt | None = None
) -> tuple[Tensor, Tensor]:
    """Project points into a camera, with gradients to all tensors; `Camera.project` in PyTorch.

    Parameters
    ----------
    points : (..., 3) Tensor
        In the vehicle frame, metres.
    intrinsics : (3, 3) Tensor
        The camera matrix K, or (..., 3, 3) for as many cameras as the leading dimensions of `points` say.
    camera_from_vehicle : (4, 4) Tensor
        The pose, likewise.
    lens : BrownConrady or KannalaBrandt, optional
        Without one it is a pinhole.

    Returns
    -------
    uv : (..., 2) Tensor
        Pixels; (0, 0) is the centre of the first. Of points that are not in front of a pinhole they are no place of the
        image: `sample` leaves them out by their depth.
    depth : (...) Tensor
        z in the camera's frame, metres.

    Raises
    ------
    ImageError, ArgumentTypeError
        Shapes do not fit, or there are no gradients of such a lens here.
    """
    for name, tensor, shape in (
        ("points", points, (3,)),
        ("intrinsics", intrinsics, (3, 3)),
        ("camera_from_vehicle", camera_from_vehicle, (4, 4)),
    ):
        if not isinstance(tensor, Tensor):
            raise ArgumentTypeError(f"{name}: expected a torch.Tensor, got {type(tensor).__name__}")
        if tuple(tensor.shape[-len(shape) :]) != shape:
            raise ImageError(f"{name}: expected shape (..., {', '.join(map(str, shape))}), got {tuple(tensor.shape)}")
    rotation, translation = camera_from_vehicle[..., :3, :3], camera_from_vehicle[..., :3, 3]
    seen = (rotation @ points[..., None])[..., 0] + translation
    depth = seen[..., 2]
    # of points at or behind the camera's plane no division by zero, whose gradient is NaN even where it is not used
    in_front = depth > 1e-6
    if lens is None or isinstance(lens, BrownConrady):
        z = torch.where(in_front, depth, torch.ones_like(depth))
        plane = seen[..., :2] / z[..., None]
        if lens is not None:
            plane = _brown_conrady(plane, lens.coefficients)
    elif isinstance(lens, KannalaBrandt):
        plane = _kannala_brandt(seen, lens.coefficients)
    else:
        raise ArgumentTypeError(
            f"lens: expected None, a BrownConrady or a KannalaBrandt, got {type(lens).__name__}; undistort the images "
            "first with Lut.between(camera, camera.undistorted())"
        )
    homogeneous = torch.cat([plane, torch.ones_like(plane[..., :1])], -1)
    return (intrinsics[..., :2, :] @ homogeneous[..., None])[..., 0], depth


def sample(images: Tensor, uv: Tensor, valid: Tensor | None = None, border_value: float = 0.0) -> Tensor:
    """Sample images at pixels, bilinear, with gradients to images and pixels.

    For grids that are small or change in each step; a table is many times faster where the camera stays as it is.

    Parameters
    ----------
    images : (N, C, H, W) or (C, H, W) Tensor
        Floats.
    uv : (rows, columns, 2) or (N, rows, columns, 2) Tensor
        Pixels; (0, 0) is the centre of the first.
    valid : (rows, columns) or (N, rows, columns) bool Tensor, optional
        Where to sample; elsewhere there is `border_value`, and no gradient. ``depth > 0`` of `project`.
    border_value : float
        What there is outside the images, with which pixels at their edges are blended as by `Lut.warp`.

    Returns
    -------
    (N, C, rows, columns) or (C, rows, columns) Tensor
        The samples.

    Raises
    ------
    ImageError, ArgumentTypeError
        Shapes do not fit.
    """
    for name, tensor in (("images", images), ("uv", uv)):
        if not isinstance(tensor, Tensor):
            raise ArgumentTypeError(f"{name}: expected a torch.Tensor, got {type(tensor).__name__}")
    if images.ndim == 3:
        if uv.ndim != 3:
            raise ImageError(f"uv: expected (rows, columns, 2) for one image, got shape {tuple(uv.shape)}")
        return sample(images[None], uv, valid, border_value)[0]
    if images.ndim != 4:
        raise ImageError(f"images: expected (N, C, H, W) or (C, H, W), got shape {tuple(images.shape)}")
    if uv.ndim not in (3, 4) or uv.shape[-1] != 2 or (uv.ndim == 4 and len(uv) != len(images)):
        raise ImageError(
            f"uv: expected (rows, columns, 2) or ({len(images)}, rows, columns, 2), got shape {tuple(uv.shape)}"
        )
    at = uv.expand(len(images), *uv.shape[-3:])
    if valid is not None:
        if tuple(valid.shape[-2:]) != tuple(uv.shape[-3:-1]):
            raise ImageError(f"valid: expected shape {tuple(uv.shape[-3:-1])}, got {tuple(valid.shape)}")
        at = torch.where(valid[..., None], at, torch.full_like(at, -9.0))
    return sampled(images - border_value, at) + border_value


def sampled(images: Tensor, at: Tensor) -> Tensor:
    """Sample (N, C, H, W) at (N, rows, columns, 2) pixels, with zeros around."""
    size = torch.tensor([images.shape[-1], images.shape[-2]], dtype=at.dtype, device=at.device)
    # corners and not centres at -1 and 1, so that a side of one pixel has a place
    return F.grid_sample(images, (2 * at + 1) / size - 1, mode="bilinear", padding_mode="zeros", align_corners=False)


def _brown_conrady(plane: Tensor, coefficients: Any) -> Tensor:
    """OpenCV's model: k1, k2, p1, p2, k3, k4, k5, k6 as far as they are given."""
    k = [float(value) for value in coefficients] + [0.0] * 14
    if any(k[8:14]):
        raise ArgumentTypeError("lens: expected a BrownConrady of up to 8 coefficients, got thin prisms or a tilt")
    x, y = plane[..., 0], plane[..., 1]
    r2 = x * x + y * y
    radial = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])))
    return torch.stack(
        [
            x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
            y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y,
        ],
        -1,
    )


def _kannala_brandt(seen: Tensor, coefficients: Any) -> Tensor:
    """OpenCV's fisheye model: the angle from the axis times a polynomial of its square."""
    k = [float(value) for value in coefficients]
    x, y, z = seen.unbind(-1)
    # away from the axis by so little that no pixel moves: the gradient of a square root at 0 is infinite
    side = torch.sqrt(x * x + y * y + 1e-18)
    angle = torch.atan2(side, z)
    square = angle * angle
    image = angle * (1 + square * (k[0] + square * (k[1] + square * (k[2] + square * k[3]))))
    return seen[..., :2] * (image / side)[..., None]
