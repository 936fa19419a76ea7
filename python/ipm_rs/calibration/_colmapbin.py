"""COLMAP's binary models, as the words of its text models: little-endian, without padding.

``cameras.bin``: u64 count; for each i32 id, i32 model, u64 width, u64 height, f64 parameters.
``images.bin``: u64 count; for each i32 id, 4 f64 quaternion, 3 f64 translation, i32 camera, name ended by a zero byte,
u64 count of points, each f64 x, f64 y, i64 id.
"""

from __future__ import annotations

import struct
from typing import Any

from ipm_rs.errors import CalibrationError

__all__ = ["camera_words", "image_words", "is_cameras"]

_MODELS = {
    0: ("SIMPLE_PINHOLE", 3), 1: ("PINHOLE", 4), 2: ("SIMPLE_RADIAL", 4), 3: ("RADIAL", 5), 4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8), 6: ("FULL_OPENCV", 12), 7: ("FOV", 5), 8: ("SIMPLE_RADIAL_FISHEYE", 4),
    9: ("RADIAL_FISHEYE", 5), 10: ("THIN_PRISM_FISHEYE", 12), 11: ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    12: ("SIMPLE_DIVISION", 4), 13: ("DIVISION", 5), 14: ("SIMPLE_FISHEYE", 3), 15: ("FISHEYE", 4), 16: ("EUCM", 6),
    17: ("EQUIRECTANGULAR", 2),
}  # fmt: skip
_COUNT = struct.Struct("<Q")
_CAMERA = struct.Struct("<iiQQ")
_IMAGE = struct.Struct("<i7di")
_MOST = 100_000
_LONGEST_NAME = 4096


def is_cameras(data: bytes) -> bool:
    """Whether it may be ``cameras.bin``: a count, and a first camera of a known model that is there whole."""
    if len(data) < _COUNT.size + _CAMERA.size:
        return False
    (count,) = _COUNT.unpack_from(data)
    _, model, width, height = _CAMERA.unpack_from(data, _COUNT.size)
    if not (0 < count <= _MOST and model in _MODELS and 0 < width < 2**31 and 0 < height < 2**31):
        return False
    return len(data) >= _COUNT.size + count * (_CAMERA.size + 2 * 8)


def camera_words(data: bytes, origin: str) -> list[tuple[str, list[str]]]:
    """Place and words ``CAMERA_ID MODEL WIDTH HEIGHT PARAMS...`` of each camera."""
    found = []
    count, at = _start(data, origin)
    for index in range(count):
        camera, model, width, height = _unpacked(_CAMERA, data, at, origin)
        at += _CAMERA.size
        if model not in _MODELS:
            raise CalibrationError(
                f"{origin}: camera {camera}: expected a model from 0 to {max(_MODELS)}, got {model}; fetch the file "
                f"again, or export it as text: colmap model_converter (camera {index + 1} of {count})"
            )
        name, parameters = _MODELS[model]
        values = _unpacked(struct.Struct(f"<{parameters}d"), data, at, origin)
        at += 8 * parameters
        found.append((f"camera {camera}", [str(camera), name, str(width), str(height), *map(repr, values)]))
    _ended(data, at, origin)
    return found


def image_words(data: bytes, origin: str) -> list[tuple[str, list[str]]]:
    """Place and words ``IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`` of each image."""
    found = []
    count, at = _start(data, origin)
    for _ in range(count):
        image, *pose, camera = _unpacked(_IMAGE, data, at, origin)
        at += _IMAGE.size
        end = data.find(b"\0", at, at + _LONGEST_NAME)
        if end < 0:
            raise CalibrationError(f"{origin}: image {image}: expected a name, got none; fetch images.bin again")
        name = data[at:end].decode("utf-8", "replace")
        (points,) = _unpacked(_COUNT, data, end + 1, origin)
        at = end + 1 + _COUNT.size + 24 * points
        found.append((f"image {image}", [str(image), *map(repr, pose), str(camera), name]))
    _ended(data, at, origin)
    return found


def _start(data: bytes, origin: str) -> tuple[int, int]:
    (count,) = _unpacked(_COUNT, data, 0, origin)
    if count > _MOST:
        raise CalibrationError(
            f"{origin}: expected at most {_MOST} entries, got {count}; pass cameras.bin or images.bin of COLMAP"
        )
    return count, _COUNT.size


def _unpacked(layout: struct.Struct, data: bytes, at: int, origin: str) -> tuple[Any, ...]:
    if at + layout.size > len(data):
        raise CalibrationError(
            f"{origin}: expected {at + layout.size} bytes or more, got {len(data)}; the file was cut short, fetch it "
            "again"
        )
    return layout.unpack_from(data, at)


def _ended(data: bytes, at: int, origin: str) -> None:
    if at != len(data):
        raise CalibrationError(
            f"{origin}: expected {at} bytes, got {len(data)}; the file is damaged, or none of COLMAP's: fetch it again"
        )
