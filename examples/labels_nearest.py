"""Warp a label image without inventing labels, and mark what the camera does not see.

Bilinear interpolation of class ids makes classes that nobody annotated: between road (7) and person (24) lies
building (11). Nearest takes one pixel and keeps its id, for any dtype.
"""

from __future__ import annotations

import numpy as np

import ipm_rs

ROAD, BUILDING, PERSON, IGNORE = 7, 11, 24, 255


def main() -> None:
    intrinsics = np.array([[1000.0, 0.0, 639.5], [0.0, 1000.0, 359.5], [0.0, 0.0, 1.0]])
    # What somebody knows who has mounted a camera: 1.5 m high, looking 6 degrees down (positive pitch is down).
    camera = ipm_rs.Camera.from_euler(
        intrinsics, image_size=(1280, 720), position=(0.0, 0.0, 1.5), pitch=np.deg2rad(6.0)
    )
    grid = ipm_rs.BevGrid(x=(4, 34), y=(-12, 12), resolution=0.1)
    lut = ipm_rs.Lut(camera, grid)

    labels = np.full((720, 1280), ROAD, np.uint8)
    labels[300:520:2, ::2] = PERSON  # worst case: hardly two equal neighbours

    nearest = lut.warp(labels, interpolation="nearest", border_value=IGNORE)
    bilinear = lut.warp(labels, interpolation="bilinear", border_value=IGNORE)
    print(f"ids in the image: {np.unique(labels)}")
    print(f"nearest:  {np.unique(nearest)}")
    print(f"bilinear: {np.unique(bilinear).size} different ids, {(bilinear == BUILDING).sum()} cells of 'building'")

    assert set(np.unique(nearest[lut.mask])) == {ROAD, PERSON}
    assert set(np.unique(nearest)) == {ROAD, PERSON, IGNORE}
    assert np.unique(bilinear[lut.mask]).size > 2

    # Instance ids need more than 8 bits; int32 works the same way.
    instances = labels.astype(np.int32) * 1000 + 17
    assert set(np.unique(lut.warp(instances, interpolation="nearest")[lut.mask])) == {7017, 24017}


if __name__ == "__main__":
    main()
