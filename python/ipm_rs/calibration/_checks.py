"""Checks that the readers share: mappings that know their place in a file, and the checks of values and rotations.

`Section` composes the place that every message begins with, ``"camera.json: intrinsic.fx"``.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ipm_rs.calibration._rotations import OPTICAL_FROM_FLU, inverse, pinhole, pose, quaternion, rigid, rotation
from ipm_rs.calibration._values import (
    Matrix,
    coefficients,
    describe,
    forgotten_commas,
    image_size,
    listed,
    matrix,
    number,
    numbers,
    whole,
)
from ipm_rs.errors import ArgumentError, ArgumentTypeError, CalibrationError

__all__ = [
    "OPTICAL_FROM_FLU",
    "Matrix",
    "Section",
    "blame",
    "coefficients",
    "describe",
    "forgotten_commas",
    "image_size",
    "inverse",
    "listed",
    "matrix",
    "number",
    "numbers",
    "pinhole",
    "pose",
    "quaternion",
    "rigid",
    "rotation",
    "whole",
]


@contextmanager
def blame(origin: str) -> Iterator[None]:
    """Put the file's name before whatever a camera or a lens made in the block finds wrong; NumPy warns of nothing.

    What only says which number cannot be is told to be corrected: here it stands in a file.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except (CalibrationError, ArgumentError, ArgumentTypeError) as error:
        place = "" if str(error).startswith(origin) else f"{origin}: "
        mend = "" if "; " in str(error) or str(error).endswith("?") else "; correct it"
        if not place and not mend:
            raise
        raise type(error)(f"{place}{error}{mend}") from error


class Section:
    """A mapping in a calibration that knows the file and the place it comes from.

    Parameters
    ----------
    content : mapping
        Its keys and values.
    origin : str
        The file, or what stands for it in messages.
    path : str
        Its place in the file, ``"cam0.intrinsics"``; empty at the top.
    nearest : bool
        Whether its rotations, and those of what is nested in it, may be off by what three printed digits leave; see
        `rotation`.
    """

    def __init__(self, content: Any, origin: str, path: str = "", *, nearest: bool = False) -> None:
        self.origin, self.path, self.nearest = origin, path, nearest
        if not isinstance(content, Mapping):
            place = f"{origin}: {path}" if path else origin
            raise CalibrationError(
                f"{place}: expected an object with keys, got {describe(content)}; nest the keys in it"
            )
        self.content: Mapping[Any, Any] = content

    def __contains__(self, key: str) -> bool:
        return key in self.content

    def where(self, key: str = "") -> str:
        """Place of a key, for messages."""
        path = ".".join(part for part in (self.path, key) if part)
        return f"{self.origin}: {path}" if path else self.origin

    def require(self, *keys: str) -> None:
        """Check that all keys are there; every missing one is named at once."""
        missing = [key + self.hint(key, known=keys) for key in keys if key not in self.content]
        if missing:
            raise CalibrationError(
                f"{self.where()}: expected the keys {', '.join(keys)}, missing {'; '.join(missing)}; add them, "
                "or fetch the file again"
            )

    def only(self, *keys: str) -> None:
        """Check that there are no other keys."""
        other = [key for key in self.content if key not in keys]
        if other:
            raise CalibrationError(
                f"{self.where()}: expected the keys {', '.join(keys)} only, got {listed(map(str, other))} too; remove "
                "what does not belong"
            )

    def hint(self, key: str, known: Sequence[str] = ()) -> str:
        """Name the key there that may be a misspelling of a missing one; empty if there is none."""
        names = [name for name in self.content if isinstance(name, str) and name not in known]
        alike = [name for name in names if name.lower() == key.lower()]
        if not alike and len(key) > 2:  # short names are all alike
            alike = difflib.get_close_matches(key, names, n=1)
        return f", where there is {alike[0]!r}" if alike else ""

    def value(self, key: str) -> Any:
        """Whatever the key holds; it must be there."""
        self.require(key)
        return self.content[key]

    def number(self, key: str, *, unit: str = "", positive: bool = False) -> float:
        """Return the finite number of a key."""
        return number(self.value(key), self.where(key), unit=unit, positive=positive)

    def whole(self, key: str, *, minimum: int = 0) -> int:
        """Return the whole number of a key."""
        return whole(self.value(key), self.where(key), minimum=minimum)

    def numbers(self, key: str, count: int | Sequence[int] | None = None, *, unit: str = "") -> Matrix:
        """Return the list of finite numbers of a key."""
        return numbers(self.value(key), self.where(key), count, unit=unit)

    def matrix(self, key: str, shape: tuple[int, int], *, unit: str = "") -> Matrix:
        """Return the matrix of a key, which may be nested or flat."""
        return matrix(self.value(key), self.where(key), shape, unit=unit)

    def rotation(self, key: str) -> Matrix:
        """Return the 3x3 rotation of a key, as given."""
        return rotation(self.value(key), self.where(key), nearest=self.nearest)

    def pose(self, key: str, *, unit: str = "metres") -> Matrix:
        """Return the rigid 3x4 or 4x4 transform of a key as (4, 4)."""
        return pose(self.value(key), self.where(key), unit=unit, nearest=self.nearest)

    def quaternion(self, key: str, order: str) -> Matrix:
        """Return the rotation matrix of a key's unit quaternion, (3, 3)."""
        return quaternion(self.value(key), self.where(key), order, nearest=self.nearest)

    def text(self, key: str, among: Sequence[str] = ()) -> str:
        """Return the text of a key, one of `among` if that is given."""
        value = self.value(key)
        if not isinstance(value, str) or (among and value not in among):
            wanted = f"one of {listed(among)}" if among else "text"
            raise CalibrationError(f"{self.where(key)}: expected {wanted}, got {describe(value)}; correct it")
        return value

    def section(self, key: str) -> Section:
        """Return the mapping of a key."""
        path = f"{self.path}.{key}" if self.path else key
        return Section(self.value(key), self.origin, path, nearest=self.nearest)

    def sections(self, key: str) -> list[Section]:
        """Return the mappings of a key's list, at least one."""
        values = self.value(key)
        if not isinstance(values, (list, tuple)) or not values:
            raise CalibrationError(
                f"{self.where(key)}: expected a list, got {describe(values)}; list the cameras in it"
            )
        path = f"{self.path}.{key}" if self.path else key
        return [
            Section(value, self.origin, f"{path}[{index}]", nearest=self.nearest) for index, value in enumerate(values)
        ]

    def listed(self, key: str, count: int) -> Sequence[Any]:
        """Return the list of a key, which must have an entry for each camera."""
        values = self.value(key)
        if not isinstance(values, (list, tuple)) or len(values) != count:
            raise CalibrationError(
                f"{self.where(key)}: expected a list of {count}, one for each camera, got {describe(values)}; "
                "add what is missing"
            )
        return values

    def with_values(self, **values: Any) -> Section:
        """Return the same section with other values for some of its keys."""
        return Section({**self.content, **values}, self.origin, self.path, nearest=self.nearest)

    def pair(self, key: str) -> tuple[int, int]:
        """Return (width, height) from one key with two numbers."""
        width, height = self.numbers(key, 2, unit="pixels")
        return image_size(float(width), float(height), self.where(key))

    def image_size(self, width: str, height: str) -> tuple[int, int]:
        """Return (width, height) from two keys."""
        return self.whole(width, minimum=1), self.whole(height, minimum=1)
