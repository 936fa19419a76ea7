"""The ground: its planes in other frames, polygons on it and in the picture, homographies to it.

The functions are attached to `Camera` and `Plane` and imported when somebody first looks at them; `Homography` is
public.
"""
