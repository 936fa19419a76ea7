"""From a colour-coded depth image to points in the vehicle's frame, and to what another camera sees of them.

Run it with `python examples/depth_to_points.py`; it needs NumPy alone and makes its own image.
"""

from __future__ import annotations

import numpy as np

import ipm_rs

WALL = 30.0  # metres ahead of the vehicle's origin


def depth_image(camera: ipm_rs.Camera) -> np.ndarray:
    """Draw the planar depth of a flat road that ends at a wall, as a simulator would."""
    width, height = camera.image_size
    u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    ray = camera.unproject(np.column_stack([u.ravel(), v.ravel()]))
    to_road = np.where(ray[:, 2] < 0, -camera.position[2] / np.where(ray[:, 2] < 0, ray[:, 2], 1), np.inf)
    to_wall = (WALL - camera.position[0]) / ray[:, 0]
    hit = camera.position + ray * np.minimum(to_road, to_wall)[:, None]
    _, depth, _ = camera.project(hit)
    return depth.reshape(height, width)


def main() -> None:
    # CARLA's own terms: field of view in degrees, positive pitch looks up, y to the right.
    transform = {"x": 1.5, "y": 0.0, "z": 2.4, "pitch": -10.0}
    camera = ipm_rs.Camera.from_carla(image_size=(800, 600), fov=90, transform=transform)
    raw = ipm_rs.encode_carla_depth(depth_image(camera))  # (600, 800, 4) uint8, BGRA: what the sensor sends

    # The way of every frame: bytes -> metres -> points.
    depth = ipm_rs.decode_carla_depth(raw)
    points, index = ipm_rs.points_from_depth(depth, camera, frame="vehicle", compact=True, max_depth=100)
    road, wall = points[points[:, 2] < 0.01], points[points[:, 2] > 0.01]
    print(f"{len(points)} points: {len(road)} on the road within {np.abs(road[:, 2]).max() * 1e3:.2f} mm of z = 0,")
    print(f"{len(wall)} on the wall within {np.abs(wall[:, 0] - WALL).max() * 1e3:.2f} mm of x = {WALL:g} m")
    assert len(points) == depth.size and np.array_equal(index, np.arange(depth.size))
    assert np.abs(road[:, 2]).max() < 1e-3 and np.abs(wall[:, 0] - WALL).max() < 1e-3

    # What a second camera sees, 3 m further left and further back: the nearest point of each pixel.
    transform = {"x": -4.0, "y": -3.0, "z": 3.0, "pitch": -15.0}
    other = ipm_rs.Camera.from_carla(image_size=(400, 300), fov=90, transform=transform)
    seen_depth, seen, height = ipm_rs.render_points(points, other, values=points[:, 2], radius=1, border_value=np.nan)
    print(f"the other camera sees {np.mean(seen >= 0):.0%} of its image, from {np.nanmin(seen_depth):.1f} m on")
    uv, _, valid = other.project(points[seen[seen >= 0]])
    assert np.isfinite(uv).all() and valid.mean() > 0.98
    assert np.array_equal(np.isnan(height), seen < 0)


if __name__ == "__main__":
    main()
