"""Our own JSON: everything that a `Camera` holds, each float to the last bit.

::

    {
      "format": "ipm_rs.Camera",
      "version": 1,
      "image_size": [2048, 1024],
      "intrinsics": [[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
      "lens": {"model": "BrownConrady", "coefficients": [k1, k2, p1, p2]},
      "camera_from_vehicle": [[...], [...], [...], [0.0, 0.0, 0.0, 1.0]]
    }

Pixels (pixel (0, 0) is the centre of the first), metres, vehicle axes x forward, y left, z up, camera axes x right, y
down, z forward, ``p_camera = R p_vehicle + t``. ``lens`` is null for a pinhole, else the model and its arguments, with
``max_angle`` if a limit was given. A camera that is `masked` has a key more, ``"mask": [hidden, shown, hidden, ...]``:
how many pixels in turn, row by row, do not show the road and do. Where the road is stays the caller's: pass the same
``ground=`` as before. Floats have as many digits as bring the same bits back.
"""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ipm_rs import _core
from ipm_rs._core import Camera
from ipm_rs.calibration._checks import Section, blame, image_size, number, numbers
from ipm_rs.calibration._files import Document, Source, keys_missing, read_json
from ipm_rs.calibration._jsontext import parse_json
from ipm_rs.errors import ArgumentTypeError, CalibrationError
from ipm_rs.files.atomic import as_path, atomically

__all__ = ["KEYS", "TITLE", "missing", "read", "save", "to_json"]

TITLE = "ipm_rs"
KEYS = ("format", "version", "image_size", "intrinsics", "lens", "camera_from_vehicle")

_FORMAT, _VERSION = "ipm_rs.Camera", 1

# Arguments of each lens model, in the order of its constructor, and how many numbers each has: 0 for one plain number,
# None for a list of any length, which the constructor checks; or the words that it may be.
_LENSES: dict[str, dict[str, int | tuple[str, ...] | None]] = {
    "BrownConrady": {"coefficients": None},
    "KannalaBrandt": {"coefficients": 4},
    "Mei": {"xi": 0, "coefficients": 4},
    "DoubleSphere": {"xi": 0, "alpha": 0},
    "Eucm": {"alpha": 0, "beta": 0},
    "RadialPolynomial": {"coefficients": 4},
    "Ocam": {"polynomial": None, "affine": 3},
    "FTheta": {"polynomial": None, "form": ("forward", "backward"), "linear": 3},
    "Fov": {"omega": 0},
    "Division": {"k": 0},
    "InverseBrownConrady": {"coefficients": None},
    "ThinPrismFisheye": {"coefficients": None},
    "Cylindrical": {},
    "Equirectangular": {},
}


def read(source: Source) -> Camera:
    """Read a camera that `Camera.save` or `Camera.to_json` wrote.

    Parameters
    ----------
    source : str, path or mapping
        The file; or the text of `to_json`, which begins with ``{``; or what ``json.loads`` makes of it.

    Returns
    -------
    Camera
        Equal to the one that was written.

    Raises
    ------
    MissingFileError, FileError
        There is no such file, or it cannot be read.
    CalibrationError
        It is of another format or a newer version, or its numbers cannot be right.
    ArgumentTypeError
        `source` is neither text, a path nor a mapping.
    """
    if isinstance(source, str) and source.lstrip()[:1] == "{":
        place = Section(parse_json(source, "JSON text"), "JSON text")
    else:
        place = read_json(source, TITLE)
    place.require(*KEYS)
    place.text("format", among=(_FORMAT,))
    version = place.whole("version", minimum=1)
    if version != _VERSION:
        raise CalibrationError(
            f"{place.where('version')}: expected {_VERSION}, got {version}; a newer ipm_rs wrote it, install that"
        )
    place.only(*KEYS, "mask")
    size = place.numbers("image_size", 2, unit="pixels")
    with blame(place.origin):
        camera = Camera(
            place.matrix("intrinsics", (3, 3), unit="pixels"),
            image_size=image_size(float(size[0]), float(size[1]), place.where("image_size")),
            camera_from_vehicle=place.pose("camera_from_vehicle"),
            lens=_lens(place),
        )
    return camera.masked(_mask(place, camera.image_size)) if "mask" in place else camera


def missing(document: Document) -> str | None:
    """Say what a document lacks to be of this format."""
    lacks = keys_missing(document, "format")
    if lacks is None and document.json["format"] != _FORMAT:
        lacks = f"another format than {_FORMAT!r}"
    return lacks


def to_json(camera: Camera) -> str:
    """Return a camera as JSON text, which `read` turns into an equal one."""
    if not isinstance(camera, Camera):
        raise ArgumentTypeError(f"camera: expected a Camera, got {type(camera).__name__}; pass one")
    content = {
        "format": _FORMAT,
        "version": _VERSION,
        "image_size": list(camera.image_size),
        "intrinsics": camera.intrinsics.tolist(),
        "lens": _lens_content(camera.lens),
        "camera_from_vehicle": camera.camera_from_vehicle.tolist(),
    }
    mask = camera.mask
    if mask is not None:
        content["mask"] = _run_lengths(mask)
    lines = (f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in content.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def save(camera: Camera, path: str | os.PathLike[str]) -> None:
    """Write a camera as a JSON file, whole or not at all; an existing file is replaced.

    Raises
    ------
    FileError
        The file cannot be written, or the path is that of a directory, a device or a pipe.
    ArgumentTypeError
        `path` is no path.
    """
    text = to_json(camera)
    with atomically(as_path(path)) as file:
        file.write(text.encode())


def _run_lengths(mask: NDArray[np.bool_]) -> list[int]:
    """How many pixels in turn, row by row, are hidden and shown; the first number is of hidden ones, and may be 0."""
    changes = np.flatnonzero(np.diff(mask.ravel(), prepend=False))
    return np.diff(changes, prepend=0, append=mask.size).tolist()


def _mask(place: Section, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Read the mask of a file."""
    width, height = size
    lengths = place.numbers("mask", unit="numbers of pixels")
    if not (lengths >= 0).all() or not (lengths == np.floor(lengths)).all() or lengths.sum() != width * height:
        raise CalibrationError(
            f"{place.where('mask')}: expected whole numbers that sum to the {width * height} pixels of the image, "
            f"got {len(lengths)} that sum to {lengths.sum():g}"
        )
    shown = np.arange(len(lengths)) % 2 == 1
    return np.repeat(shown, lengths.astype(np.int64)).reshape(height, width)


def _lens_content(lens: Any) -> dict[str, Any] | None:
    """Model and arguments of a lens."""
    if lens is None:
        return None
    model = type(lens).__name__
    content: dict[str, Any] = {"model": model}
    for name in _LENSES[model]:
        value = getattr(lens, name)
        content[name] = list(value) if isinstance(value, (list, tuple)) else value
    _, (_, _, keywords) = lens.__reduce__()  # tells a limit that was given from the model's own
    return {**content, **keywords}


def _lens(place: Section) -> Any:
    """Lens of a file."""
    if place.value("lens") is None:
        return None
    lens = place.section("lens")
    model = lens.text("model", among=tuple(_LENSES))
    arguments = _LENSES[model]
    lens.require(*arguments)
    lens.only("model", *arguments, "max_angle")
    values: list[Any] = []
    for name, count in arguments.items():
        if isinstance(count, tuple):
            values.append(lens.text(name, among=count))
            continue
        value, where = lens.value(name), lens.where(name)
        values.append(number(value, where) if count == 0 else numbers(value, where, count).tolist())
    options = {"max_angle": lens.number("max_angle", unit="radians")} if "max_angle" in lens else {}
    with blame(lens.where()):
        return getattr(_core, model)(*values, **options)
