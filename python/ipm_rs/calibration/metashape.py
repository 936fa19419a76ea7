"""Agisoft Metashape (PhotoScan): ``cameras.xml`` of File, Export, Export Cameras.

The format, after Metashape's manual (appendix "Camera models") and its converters:

* ``sensor``: ``type`` frame or fisheye, ``resolution``, ``calibration`` with ``f``, ``cx``, ``cy``, ``b1``, ``b2``,
  ``k1`` to ``k4``, ``p1``, ``p2``; missing numbers are 0.
* ``u = w/2 + cx + x' f + x' b1 + y' b2``, ``v = h/2 + cy + y' f``: **cx and cy count from the middle of the image**,
  and the corner of the image is (0, 0), so that 0.5 is subtracted here. K is ``[[f + b1, b2, ...], [0, f, ...]]``.
* frame: ``x' = x (1 + k1 r2 + k2 r4 + k3 r6 + k4 r8) + p1 (r2 + 2 x2) + 2 p2 x y``: **p1 and p2 stand the other way
  round than OpenCV's**. A fourth radial term OpenCV's model does not have: where it is not 0, its rational model is
  fitted over the image; how near is logged at level INFO by ``ipm_rs.calibration``, more than 0.1 pixels is warned of,
  and more than 0.5 refused. fisheye: the same with the angle for the radius, ``KannalaBrandt``.
* ``camera``: ``transform``, sixteen numbers row by row: points of the camera (optical axes: x right, y down, z forward)
  to the chunk's own frame, whose unit the chunk's or component's ``scale`` gives in metres. What leads from there to
  the earth is left out: geocentric metres are no vehicle frame.

``vehicle_from_world=`` says how the chunk's frame stands in the vehicle frame (x forward, y left, z up); without it
that frame is taken for the vehicle's, and the road's height in it is ``ground=``. A sensor without cameras is at the
origin and looks along +x.
"""

from __future__ import annotations

import logging
import os
import warnings
import xml.parsers.expat
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import BrownConrady, Camera, KannalaBrandt
from ipm_rs.calibration._bodies import pick
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import Section, blame, inverse, number, pinhole, pose
from ipm_rs.calibration._files import Document, open_document, same_size
from ipm_rs.calibration._mount import metric, mounted, rigid_argument
from ipm_rs.calibration._yaml import scalar
from ipm_rs.errors import CalibrationError, CalibrationWarning

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["KEYS", "TITLE", "cameras", "missing", "read"]

TITLE = "Metashape"
KEYS = ("document", "chunk", "sensors", "sensor", "calibration")

_MOST_ELEMENTS = 500_000
_NUMBERS = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4")
_TOLERATED, _REFUSED = 0.1, 0.5  # pixels

_log = logging.getLogger("ipm_rs.calibration")


@dataclass
class _Element:
    """One element of the file."""

    name: str
    attributes: dict[str, str]
    children: list[_Element] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """What stands between its tags."""
        return "".join(self.texts)

    def all(self, name: str) -> list[_Element]:
        """Return the children of a name."""
        return [child for child in self.children if child.name == name]

    def first(self, name: str) -> _Element | None:
        """Return the first child of a name."""
        return next((child for child in self.children if child.name == name), None)

    def deep(self, name: str) -> list[_Element]:
        """Return the elements of a name here and below, but not inside of another such."""
        if self.name == name:
            return [self]
        return [found for child in self.children for found in child.deep(name)]


@dataclass
class _Camera:
    """A camera or, without a transform, a sensor."""

    label: str
    sensor: _Element
    transform: str | None = None
    scale: str | None = None


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format; None if nothing."""
    if document.is_directory:
        return "a directory"
    if not document.text.lstrip().startswith("<") or "<sensor" not in document.text:
        return "no XML with <sensor>"
    return None if _cameras(_root(document), document.origin) else "no <sensor> with <calibration>"


def cameras(document: Document) -> list[str]:
    """Labels of the cameras, as ``camera=`` takes them; of the sensors where no camera is aligned."""
    return _labels(_cameras(_root(document), document.origin))


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite, the camera refuses
def read(
    source: str | os.PathLike[str],
    *,
    camera: str | int | None = None,
    image_size: tuple[int, int] | None = None,
    vehicle_from_world: ArrayLike | None = None,
    metres_per_unit: float | None = None,
    nearest_rotation: bool = False,
) -> Camera:
    """Read one camera of Metashape.

    Parameters
    ----------
    source : str or path
        The XML file.
    camera : str or int, optional
        Label of an aligned camera (most often the image's name), or its number from 0 among these; of a sensor where no
        camera is aligned. Needed if there is more than one.
    image_size : (int, int), optional
        Width and height in pixels. The file says it; if given it must agree.
    vehicle_from_world : (4, 4) array, optional
        Where the chunk's frame, its lengths in metres, stands in the vehicle frame. Without it that frame is taken for
        the vehicle's.
    metres_per_unit : float, optional
        Length of the chunk's unit in metres. Without it the file's ``scale``, or 1 where it has none.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera

    Raises
    ------
    MissingFileError, FileError
        The file does not exist, or cannot be read.
    CalibrationError
        An element is missing, a value cannot be right, or the lens has no model here.
    ArgumentError, ArgumentTypeError
        There is no such camera; an argument is wrong.
    """
    check_word("camera", camera)
    document = open_document(source, TITLE)
    found = _cameras(_root(document), document.origin)
    if not found:
        raise CalibrationError(
            f"{document.origin}: expected a <sensor> with <calibration>, got none; align the cameras and export again"
        )
    entry = found[pick(_labels(found), camera, document.origin)]
    where = f"sensor {entry.sensor.attributes.get('label', '')!r:.60}"
    calibration = entry.sensor.first("calibration")
    assert calibration is not None  # `_cameras` has looked
    values: dict[str, Any] = {key: 0.0 for key in _NUMBERS if key != "f"}
    values |= {child.name: scalar(child.text.strip()) for child in calibration.children if child.name in _NUMBERS}
    place = Section(values, document.origin, where, nearest=nearest_rotation)
    size = _size(calibration.first("resolution") or entry.sensor.first("resolution"), place)
    same_size(image_size, size, document.origin)
    f = place.number("f", unit="pixels", positive=True)
    cx, cy, b1, b2 = (place.number(key, unit="pixels") for key in ("cx", "cy", "b1", "b2"))
    K = pinhole(f + b1, f, (size[0] - 1) / 2 + cx, (size[1] - 1) / 2 + cy, b2)
    kind = calibration.attributes.get("type", entry.sensor.attributes.get("type", "frame"))
    lens = _lens(place, kind, float(np.hypot(*size)) / 2 + float(np.hypot(cx, cy)), f)
    if entry.transform is None:
        T = mounted(None, None)
    else:
        at = f"{document.origin}: camera {entry.label!r:.60}: transform"
        world_from_camera = pose([scalar(word) for word in entry.transform.split()], at, nearest=nearest_rotation)
        unit = metres_per_unit
        if unit is None and entry.scale is not None:
            unit = number(scalar(entry.scale.strip()), f"{document.origin}: scale", positive=True)
        world = rigid_argument(vehicle_from_world, "vehicle_from_world", nearest=nearest_rotation)
        T = inverse(metric(world_from_camera, 1.0 if unit is None else unit)) @ inverse(world)
    return build(place.where(), K, image_size=size, camera_from_vehicle=T, lens=lens)


def _labels(found: list[_Camera]) -> list[str]:
    labels = [entry.label for entry in found]
    return labels if len(set(labels)) == len(labels) else [str(index) for index in range(len(labels))]


def _size(resolution: _Element | None, place: Section) -> tuple[int, int]:
    sides = {} if resolution is None else resolution.attributes
    values = {key: scalar(side) for key, side in sides.items() if key in ("width", "height")}
    return Section(values, place.origin, f"{place.path}.resolution").image_size("width", "height")


def _lens(place: Section, kind: str, reach: float, f: float) -> Any:
    k = [place.number(key) for key in ("k1", "k2", "k3", "k4")]
    p1, p2, p3, p4 = (place.number(key) for key in ("p1", "p2", "p3", "p4"))
    if kind not in ("frame", "fisheye") or p3 or p4 or (kind == "fisheye" and (p1 or p2)):
        got = f"type {kind!r:.30}" if kind not in ("frame", "fisheye") else "tangential terms that OpenCV's lenses lack"
        raise CalibrationError(
            f"{place.where()}: expected a frame camera with p3 and p4 of 0, or a fisheye without tangential terms, got "
            f"{got}; fit fewer terms, or export undistorted images"
        )
    with blame(place.where()):
        if kind == "fisheye":
            return KannalaBrandt(k)
        if k[3]:
            return BrownConrady(_rational(k, (p2, p1), reach / f, f, place.where()))
        terms = [k[0], k[1], p2, p1, k[2]]
        return BrownConrady(terms) if any(terms) else None


def _rational(k: list[float], tangential: tuple[float, float], reach: float, f: float, where: str) -> list[float]:
    """OpenCV's eight terms for a polynomial of four, over the radii that the image has.

    Least squares, weighted again after each step: by the denominator, which makes the linear problem the true one, and
    by the error (Lawson), which evens it out. Twelve steps take a drone's lens from 0.15 pixels to 0.056; 40 reach
    0.054.
    """
    radius = np.linspace(0.0, min(4 * reach, 3.0), 4001)
    distorted = radius * np.polyval([*k[::-1], 1.0], radius**2)
    ends = np.flatnonzero((np.diff(distorted) <= 0) | (distorted[1:] > reach) | ~np.isfinite(distorted[1:]))
    r2 = radius[1 : ends[0] + 1 if len(ends) else None] ** 2
    best, fitted = np.inf, np.zeros(6)
    if len(r2) >= 100:
        factor = np.polyval([*k[::-1], 1.0], r2)
        powers = (r2 / r2[-1])[:, None] ** np.arange(1, 4)
        basis, under, even = np.hstack([powers, -powers * factor[:, None]]), np.ones(len(r2)), np.ones(len(r2))
        for _ in range(12):
            weight = np.sqrt(r2 * even) / under
            solved = np.linalg.lstsq(basis * weight[:, None], (factor - 1) * weight, rcond=None)[0]
            over, under = 1 + powers @ solved[:3], 1 + powers @ solved[3:]
            if not bool((under > 0.05).all()):
                break
            off = np.abs(over / under - factor) * np.sqrt(r2) * f
            if off.max() < best:
                best, fitted = float(off.max()), solved / np.tile(r2[-1] ** np.arange(1, 4), 2)
            even *= off + 1e-12
            even /= even.mean()
    if not best <= _REFUSED:
        raise CalibrationError(
            f"{where}: expected radial terms that OpenCV's rational model fits to {_REFUSED:g} pixels, got {best:.3g} "
            "at best; fit k1 to k3 only, or export undistorted images"
        )
    _log.info("%s: k4 is not 0; the rational model fitted to the four terms is within %.3g pixels", where, best)
    if best > _TOLERATED:
        warnings.warn(
            f"{where}: the rational model fitted to the four radial terms is up to {best:.2g} pixels off them; fit k1 "
            "to k3 only if that is too much",
            CalibrationWarning,
            stacklevel=4,
        )
    k1, k2, k3, k4, k5, k6 = (float(term) for term in fitted)
    return [k1, k2, *tangential, k3, k4, k5, k6]


def _cameras(root: _Element, origin: str) -> list[_Camera]:
    """Aligned cameras of the file's chunk; its sensors where none is."""
    chunks = root.deep("chunk") or [root]
    if len(chunks) > 1:
        raise CalibrationError(f"{origin}: expected one chunk, got {len(chunks)}; export one at a time")
    chunk = chunks[0]
    sensors = [sensor for group in chunk.all("sensors") for sensor in group.deep("sensor")]
    known = {sensor.attributes.get("id", ""): sensor for sensor in sensors if sensor.first("calibration") is not None}
    components = {
        component.attributes.get("id", ""): _scale(component)
        for group in chunk.all("components")
        for component in group.all("component")
    }
    whole, found = _scale(chunk), []
    for group in chunk.all("cameras"):
        for camera in group.deep("camera"):
            transform, sensor = camera.first("transform"), known.get(camera.attributes.get("sensor_id", ""))
            if transform is not None and sensor is not None and transform.text.strip():
                scale = components.get(camera.attributes.get("component_id", "")) or whole
                found.append(_Camera(camera.attributes.get("label", ""), sensor, transform.text, scale))
    return found or [_Camera(sensor.attributes.get("label", ""), sensor) for sensor in known.values()]


def _scale(element: _Element) -> str | None:
    transform = element.first("transform")
    scale = None if transform is None else transform.first("scale")
    return None if scale is None else scale.text


def _root(document: Document) -> _Element:
    """Parse the file; its size is bounded by what was read, its elements here."""
    root = _Element("", {})
    stack, count = [root], 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > _MOST_ELEMENTS or len(stack) > 50:
            raise CalibrationError(
                f"{document.origin}: expected at most {_MOST_ELEMENTS} elements, 50 deep, got more; export the cameras "
                "without points"
            )
        stack.append(_Element(name, attributes))
        stack[-2].children.append(stack[-1])

    def end(_name: str) -> None:
        stack.pop()

    def text(data: str) -> None:
        stack[-1].texts.append(data)

    def doctype(*_: Any) -> None:
        raise CalibrationError(
            f"{document.origin}: expected plain elements, got a DOCTYPE; remove it, calibration files need no entities"
        )

    parser = xml.parsers.expat.ParserCreate(encoding="utf-8")
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = text, doctype
    try:
        parser.Parse(document.text.encode("utf-8"), True)
    except xml.parsers.expat.ExpatError as error:
        raise CalibrationError(
            f"{document.origin}: expected XML, got text that is not: {error}; the file may be cut short, fetch it again"
        ) from error
    return root
