"""Our own JSON: everything that a `Camera` holds, each float to the last bit.

::

    {
      "format": "ipm_rs.Camera",
      "version": 1,
      "image_size": [2048, 1024],
      "intrinsics": [[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
      "lens": {"model": "BrownConrady", "arguments": [[k1, k2, p1, p2]]},
      "camera_from_vehicle": [[...], [...], [...], [0.0, 0.0, 0.0, 1.0]]
    }

Pixels (pixel (0, 0) is the centre of the first), metres, vehicle axes x forward, y left, z up, camera axes x right, y
down, z forward, ``p_camera = R p_vehicle + t``. ``lens`` is null for a pinhole, else the call that makes it. Where the
road is stays the caller's: pass the same ``ground=`` as before. Floats are written with as many digits as bring the
same bits back.
"""
