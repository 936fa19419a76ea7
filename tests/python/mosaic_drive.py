"""A drive of small pictures for maps. Without pytest, so that processes which are killed begin quickly."""

from __future__ import annotations

import numpy as np

import ipm_rs

WIDTH, HEIGHT = 160, 90
K = np.array([[120.0, 0, 79.5], [0, 120.0, 44.5], [0, 0, 1]])


def camera(**pose):
    pose = {"position": (1.0, 0.0, 1.4), "pitch": 0.15, **pose}
    return ipm_rs.Camera.from_euler(K, image_size=(WIDTH, HEIGHT), **pose)


def standing_at(x, y=0.0, yaw=0.0, z=0.0):
    pose = np.eye(4)
    pose[:3, :3] = ipm_rs.rotation_from_euler(0.0, 0.0, yaw)
    pose[:3, 3] = x, y, z
    return pose


LENGTH = 24


def frame(number):
    """A picture of noise and where it was taken: on a drive of some tiles, and back."""
    image = np.random.default_rng(number).integers(0, 256, (HEIGHT, WIDTH), dtype=np.uint8)
    return image, standing_at(2.0 * min(number, LENGTH - number), 0.3 * number, 0.1)


def add(mosaic, numbers):
    for number in numbers:
        image, pose = frame(number)
        mosaic.add(camera(), image, map_from_vehicle=pose, distance=(1, 9), name=f"frame {number}")


def on_disk(path, **options):
    return ipm_rs.Mosaic(0.1, tile=64, path=path, memory=0, **options)
