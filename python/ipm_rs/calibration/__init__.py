"""Readers of calibration files: one module for each format, and how a file's format is recognised.

How to add a format
-------------------
1. A module ``ipm_rs/calibration/<format>.py`` with

   * a docstring that states the dataset's axes, units, angle signs, quaternion order, transform direction, pixel base
     and road height, with the ``ground=`` to use;
   * ``TITLE``: its name in messages, ``"KITTI"``;
   * ``KEYS``: words that its files use as keys, by which the format nearest to an unknown file is found;
   * ``read(source, *, ...) -> Camera``. `source` is a path or the content as a mapping; ``image_size=None`` if the
     files do not hold the size, ``camera=None`` (or a default) if a file holds several, others as the format needs;
   * ``missing(document) -> str | None``: what the `Document` lacks to be of this format, in a few words ("no key
     'intrinsic'"); None if nothing. It looks at keys that are parsed (``document.keys``, ``.tree``, ``.json``), never
     at words anywhere in the text, and claims no file that `read` cannot read. It may raise `CalibrationError`, which
     counts as missing.

   Checks come from ``_checks`` (`Section`, `number`, `matrix`, `quaternion`, `pose`, `blame`), files from ``_files``
   (`read_json`, `Document`), the camera from ``_camera.build``; nothing but errors of ``ipm_rs.errors``
   may leave a reader, whatever the bytes.
2. Its name in `FORMATS`, before any format whose files it could be taken for.
3. ``Camera.from_<format>`` in ``_core.pyi``, for editors and type checkers; the method itself is there once the name is
   in `FORMATS`.
4. A sample in ``tests/python/calibration_datasets.py`` or ``calibration_samples.py``: the tests of all formats
   then mutate it, cut it short, and hold that no other format claims it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol, cast

from ipm_rs._core import Camera, Lut, Plane
from ipm_rs.calibration._attached import Attached, AttachedMethod
from ipm_rs.errors import ArgumentError

if TYPE_CHECKING:
    from ipm_rs.calibration._files import Document
    from ipm_rs.calibration._load import load, load_all, recognise

__all__ = ["FORMATS", "load", "load_all", "reader", "recognise"]

FORMATS: tuple[str, ...] = (
    "json",
    "cityscapes",
    "kitti_raw",
    "kitti_360",
    "kitti",
    "argoverse2",
    "nuscenes",
    "waymo",
    "carla",
    "woodscape",
    "matlab",
    "dgp",
    "argoverse1",
    "mmdet3d",
    "once",
    "zod",
    "openlane",
    "pandaset",
    "a2d2",
    "pjlab",
    "opensfm",
    "metashape",
    "basalt",
    "nerfstudio",
    "open3d",
    "depthai",
    "realsense",
    "cam2bev",
    "autoware",
    "kalibr",
    "euroc",
    "ncamera",
    "okvis",
    "orbslam",
    "camodocal",
    "ros",
    "opencv",
    "colmap",
    "ocamcalib",
)
"""Names of the formats, in the order in which they are tried; each is a module here and a ``Camera.from_<name>``."""


class Reader(Protocol):
    """What a module of a format provides.

    One whose files hold several cameras has a function ``cameras(document)`` too, which names them as the option
    ``camera=`` of its ``read`` takes them: `load_all` reads each.
    """

    TITLE: str
    KEYS: tuple[str, ...]

    def read(self, source: Any, **options: Any) -> Camera: ...

    def missing(self, document: Document) -> str | None: ...


def reader(name: str) -> Reader:
    """Return the module of a format."""
    if name not in FORMATS:
        raise ArgumentError(f"name: expected one of {', '.join(FORMATS)}, got {name!r}; pass one of these")
    return cast(Reader, import_module(f"ipm_rs.calibration.{name}"))


def __getattr__(name: str) -> Any:
    if name in (
        "load",
        "load_all",
        "recognise",
    ):  # with what they need, only when asked for: half of the package's import time
        return getattr(import_module("ipm_rs.calibration._load"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


_METHODS = {
    "load": Attached.to("load", "ipm_rs.calibration._load", "load"),
    "load_all": Attached.to("load_all", "ipm_rs.calibration._load", "load_all"),
    # what is no file's: cameras of what is known otherwise
    "from_ground_points": Attached.to("from_ground_points", "ipm_rs.refine._points", "camera_from_ground_points"),
    "from_points": Attached.to("from_points", "ipm_rs.refine._points", "camera_from_points"),
    "from_projection": Attached.to("from_projection", "ipm_rs.refine._known", "from_projection"),
    "from_fov": Attached.to("from_fov", "ipm_rs.refine._known", "from_fov"),
    # and of other pictures from the same place
    "undistorted": AttachedMethod("undistorted", "ipm_rs.views._undistorted", "undistorted"),
    # areas
    "project_polygon": AttachedMethod("project_polygon", "ipm_rs.ground._polygons", "project_polygon"),
    "ground_polygon": AttachedMethod("ground_polygon", "ipm_rs.ground._polygons", "ground_polygon"),
    **{f"from_{name}": Attached.to(f"from_{name}", f"ipm_rs.calibration.{name}", "read") for name in FORMATS},
}
_OTHERS: list[tuple[type, str, str]] = [
    (Lut, "between", "ipm_rs.views._between"),
    (Plane, "from_camera", "ipm_rs.ground._planes"),
]
"""Static methods of other classes."""
for _name, _method in _METHODS.items():
    setattr(Camera, _name, _method)
for _owner, _name, _module in _OTHERS:
    setattr(_owner, _name, Attached.to(_name, _module, _name, _owner.__name__))
for _name in ("transformed",):
    setattr(Plane, _name, AttachedMethod(_name, "ipm_rs.ground._planes", _name, "Plane"))
