"""Virtual views: pictures as another camera at the same place would take them.

`Camera.undistorted` makes such a camera, `Lut.between` the table from the one's picture to the other's. Both are
attached to their classes and imported when somebody first looks at them.
"""
