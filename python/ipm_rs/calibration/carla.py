"""CARLA: a camera sensor's size, field of view and transform, in CARLA's own or in the mirrored, right-handed axes.

* Intrinsics: ``fov`` is the horizontal angle in degrees, ``f = width / (2 tan(fov / 2))`` for both axes. CARLA counts
  pixels from the corner, ``cx = width / 2``; the centre of the first pixel is (0, 0) here, so **half a pixel is taken
  off**: ``cx = width / 2 - 0.5``, ``cy = height / 2 - 0.5``. The default lens effects (``lens_k`` and so on) are not
  modelled.
* Transform of the sensor in the vehicle's frame (that of ``spawn_actor(..., attach_to=vehicle)``),
  ``handedness="left"``: x forward, y **right**, z up, metres, angles in **degrees**, positive pitch nose **up**,
  positive yaw nose right, positive roll right side down: ``Rz(yaw) Ry(-pitch) Rx(-roll)``. Reading mirrors it,
  ``diag(1, -1, 1) R diag(1, -1, 1)``: (x, -y, z) and (roll, -pitch, -yaw).
* ``handedness="right"``: x forward, y left, z up already, angles still in degrees, positive pitch looks down: the
  ``spawn_point`` of the ROS bridge's ``objects.json``, whose sensors are read too.

The vehicle's origin is on the ground: ``ground=0``. A transform in the world (``sensor.get_transform()``) gives a
camera in the world's frame instead, mirrored likewise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from ipm_rs._arguments import check_word
from ipm_rs._core import Camera, flip_handedness_pose, rotation_from_euler
from ipm_rs.calibration._camera import build
from ipm_rs.calibration._checks import (
    OPTICAL_FROM_FLU,
    Matrix,
    Section,
    describe,
    listed,
    number,
    numbers,
    pinhole,
    pose,
    rigid,
    whole,
)
from ipm_rs.calibration._files import Document, Source, keys_missing, needs_size, read_json, same_size
from ipm_rs.calibration.kitti import one_of
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = ["KEYS", "TITLE", "cameras", "intrinsics", "missing", "read"]

TITLE = "CARLA"
KEYS = ("image_size_x", "image_size_y", "fov", "spawn_point", "sensor_tick", "objects")

_AXES, _ANGLES = ("x", "y", "z"), ("roll", "pitch", "yaw")
_SIZE = ("image_size_x", "image_size_y")
_NAMES: dict[Any, tuple[str, ...]] = {"location": _AXES, "rotation": _ANGLES}


@np.errstate(all="ignore")  # what overflows is for the camera to refuse, not for NumPy to warn of
def read(
    source: Source | None = None,
    *,
    camera: str | None = None,
    image_size: Sequence[int] | None = None,
    fov: float | None = None,
    transform: Any = None,
    handedness: Literal["left", "right"] = "left",
    nearest_rotation: bool = False,
) -> Camera:
    """Camera of a CARLA sensor, from its numbers or from a file.

    Parameters
    ----------
    source : str, path or mapping, optional
        A JSON file or its content: a sensor's attributes ``image_size_x``, ``image_size_y``, ``fov`` (texts, as CARLA
        has them, are read as numbers) with ``transform`` and ``handedness`` as below, or with ``spawn_point``; or the
        ROS bridge's ``objects.json``. What is given by keyword must not be in it too.
    camera : str, optional
        The ``id`` of the sensor in ``objects.json``; not needed if it has one camera.
    image_size : (int, int), optional
        Width and height in pixels.
    fov : float, optional
        Horizontal field of view, degrees.
    transform : optional
        Of the sensor in the vehicle's frame: a ``carla.Transform``, its 4x4 ``get_matrix()``, or a mapping of
        ``x, y, z`` (metres) and ``roll, pitch, yaw`` (degrees), flat or in ``location`` and ``rotation``; what is not
        named is 0. Without it, the camera is at the origin and looks along +x.
    handedness : {"left", "right"}
        Of the frame that `transform` is in: CARLA's own, or x forward, y left, z up.
    nearest_rotation : bool
        Take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

    Returns
    -------
    Camera
        A pinhole; its principal point counts from pixel centres: ``(width - 1) / 2``.

    Raises
    ------
    MissingFileError, FileError
        The file cannot be read.
    CalibrationError
        A number is missing or cannot be right.
    ArgumentError, ArgumentTypeError
        There is no such camera, something was given twice, or an argument has the wrong type.
    """
    check_word("camera", camera)
    handedness = one_of("handedness", handedness, ("left", "right"))
    place = Section({}, f"{TITLE} camera") if source is None else _sensor(read_json(source, TITLE), camera)
    for name, value, keys in (
        ("fov", fov, ("fov",)),
        ("transform", transform, ("transform", "spawn_point")),
    ):
        there = [key for key in keys if key in place]
        if value is not None and there:
            raise ArgumentError(f"{name}: expected none, since {place.where(there[0])} is there, got one too; drop one")
    if "image_size_x" in place or "image_size_y" in place:
        place.require(*_SIZE)
        size: Any = tuple(whole(_real(place.value(key)), place.where(key), minimum=1) for key in _SIZE)
        same_size(image_size, size, place.where())
    else:
        size = needs_size(image_size, place.where(), "it is the sensor's image_size_x and image_size_y")
    if fov is None:
        angle, where = _real(place.value("fov")), place.where("fov")
    else:
        angle, where = fov, "fov"
    if transform is None:
        vehicle_from_sensor = _own_transform(place, handedness, nearest_rotation)
    else:
        vehicle_from_sensor = _flu(transform, "transform", handedness, nearest_rotation)
    return build(
        place.where(),
        intrinsics(size, angle, where=where),
        image_size=size,
        vehicle_from_camera=vehicle_from_sensor @ rigid(OPTICAL_FROM_FLU.T, (0.0, 0.0, 0.0)),
    )


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format."""
    if keys_missing(document, "objects") is None:
        return None if _cameras(document.json["objects"]) else "no camera sensor in 'objects'"
    return keys_missing(document, "image_size_x", "image_size_y", "fov")


def cameras(document: Document) -> list[str]:
    """Name the cameras that a document of this format holds, as `camera=` takes them."""
    objects = document.json.get("objects", ())
    return [str(sensor.get("id")) for _, sensor in _cameras(objects)]


def intrinsics(image_size: Sequence[int], fov: float, *, where: str = "fov") -> Matrix:
    """K, (3, 3), of a CARLA camera, for pixel centres: ``f = width / (2 tan(fov / 2))``, ``c = (size - 1) / 2``.

    Parameters
    ----------
    image_size : (int, int)
        Width and height in pixels.
    fov : float
        Horizontal field of view, degrees, more than 0 and less than 180.
    where : str
        What to call `fov` in a message.

    Raises
    ------
    CalibrationError
        `fov` or a size cannot be right.
    """
    angle = number(fov, where, unit="degrees", positive=True)
    if angle >= 180:
        raise CalibrationError(f"{where}: expected less than 180 degrees, got {angle:g}; a pinhole sees no more")
    if angle < 1e-6:
        raise CalibrationError(f"{where}: expected 1e-6 degrees or more, got {angle:g}; give the angle in degrees")
    if not isinstance(image_size, (list, tuple, np.ndarray)):
        raise ArgumentTypeError(
            f"image_size: expected (width, height), got {describe(image_size)}; give two whole numbers"
        )
    sides = numbers(image_size, "image_size", 2, unit="pixels").tolist()
    width, height = (whole(side, "image_size", minimum=1) for side in sides)
    focal = width / (2 * math.tan(math.radians(angle) / 2))
    return pinhole(focal, focal, (width - 1) / 2, (height - 1) / 2)


def _real(value: Any) -> Any:
    """Read a number that CARLA holds as text; anything else stays as it is."""
    if isinstance(value, str) and "_" not in value:
        try:
            return float(value)
        except ValueError:
            pass
    return value


def _own_transform(place: Section, handedness: str, nearest: bool) -> Matrix:
    """(4, 4) transform that a mapping holds, in axes x forward, y left, z up."""
    if "transform" in place and "spawn_point" in place:
        raise CalibrationError(f"{place.where()}: expected transform or spawn_point, got both; keep one")
    if "spawn_point" in place:  # the ROS bridge's
        return _flu(place.value("spawn_point"), place.where("spawn_point"), "right", nearest)
    if "handedness" in place:
        handedness = place.text("handedness", among=("left", "right"))
    if "transform" in place:
        return _flu(place.value("transform"), place.where("transform"), handedness, nearest)
    return np.eye(4)


def _flu(transform: Any, where: str, handedness: str, nearest: bool) -> Matrix:
    """(4, 4) transform in axes x forward, y left, z up."""
    if hasattr(transform, "get_matrix"):  # carla.Transform
        transform = transform.get_matrix()
    if not isinstance(transform, Mapping):
        T = pose(transform, where, nearest=nearest)
        return flip_handedness_pose(T) if handedness == "left" else T
    x, y, z, roll, pitch, yaw = _six(transform, where)
    if handedness == "left":
        y, pitch, yaw = -y, -pitch, -yaw
    return rigid(rotation_from_euler(math.radians(roll), math.radians(pitch), math.radians(yaw)), (x, y, z))


def _six(transform: Mapping[Any, Any], where: str) -> list[float]:
    """``x, y, z, roll, pitch, yaw`` of a mapping; what is not named is 0, what is not known is refused."""
    found: dict[str, float] = {}
    for key, value in transform.items():
        names, place = _NAMES.get(key, ()), f"{where}.{key}"
        if key == "location" and isinstance(value, (list, tuple)):
            value = dict(zip(_AXES, numbers(value, place, 3).tolist(), strict=True))
        elif not names:
            names, value, place = (*_AXES, *_ANGLES), {key: value}, where
        for name, item in Section(value, place).content.items():
            if name not in names:
                raise CalibrationError(
                    f"{place}: expected the keys {', '.join(names)}, got {describe(name)}; correct or remove it"
                )
            if name in found:
                raise CalibrationError(f"{where}: expected {name!r} once, got it twice; keep one")
            unit = "metres" if name in _AXES else "degrees"
            found[name] = number(_real(item), f"{place}.{name}", unit=unit)
    return [found.get(name, 0.0) for name in (*_AXES, *_ANGLES)]


def _sensor(place: Section, camera: Any) -> Section:
    """Find the camera in the ROS bridge's ``objects``; another mapping is the camera itself."""
    if camera is not None and not isinstance(camera, str):
        raise ArgumentTypeError(f"camera: expected the id of a sensor, got {describe(camera)}; pass text")
    if "objects" not in place:
        if camera is not None and place.content.get("id", camera) != camera:
            raise ArgumentError(f"camera: expected none for one sensor, got {camera!r}; drop it")
        return place
    cameras = _cameras(place.value("objects"))
    found = cameras if camera is None else [(path, sensor) for path, sensor in cameras if sensor.get("id") == camera]
    if len(found) != 1:
        got = "none" if camera is None else f"{camera!r}" + (f", which {len(found)} have" if found else "")
        names = listed(str(sensor.get("id")) for _, sensor in cameras)
        raise ArgumentError(f"camera: expected the id of a camera of {place.origin}, got {got}; pass one of {names}")
    (path, sensor), *_ = found
    return Section(sensor, place.origin, path)


def _cameras(objects: Any) -> list[tuple[str, Mapping[str, Any]]]:
    """Every camera among the objects and their sensors, with its place."""
    found: list[tuple[str, Mapping[str, Any]]] = []
    for index, thing in enumerate(objects if isinstance(objects, (list, tuple)) else ()):
        if not isinstance(thing, Mapping):
            continue
        sensors = thing.get("sensors")
        inner = enumerate(sensors if isinstance(sensors, (list, tuple)) else ())
        every = [(f"objects[{index}]", thing), *((f"objects[{index}].sensors[{row}]", sensor) for row, sensor in inner)]
        for path, sensor in every:
            if isinstance(sensor, Mapping) and str(sensor.get("type", "")).startswith("sensor.camera."):
                found.append((path, sensor))
    return found
