"""`Camera.from_<format>` and `Camera.load`: readers know files, the compiled class knows cameras."""

from __future__ import annotations

import functools
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeAlias

__all__ = ["Attached"]


if TYPE_CHECKING:
    _Static: TypeAlias = staticmethod[..., Any]
else:
    _Static = staticmethod  # takes no parameters at run time


def _unread() -> None:
    """Read a calibration; look at the method itself to see its arguments."""


class Attached(_Static):
    """A static method whose module is imported when somebody first looks at it: importing the package does not.

    Parameters
    ----------
    name : str
        Of the method, as `help` shows it.
    module, function : str
        Where the function is that does it; its docstring and signature are the method's.
    """

    def __init__(self, name: str, module: str, function: str) -> None:
        super().__init__(_unread)
        self._name = name
        self._module = module
        self._function = function

    def __get__(self, camera: Any, owner: type | None = None) -> Callable[..., Any]:
        return self._method

    @functools.cached_property
    def _method(self) -> Callable[..., Any]:
        function = getattr(import_module(self._module), self._function)

        @functools.wraps(function)
        def method(*arguments: Any, **keywords: Any) -> Any:
            return function(*arguments, **keywords)

        method.__name__ = self._name
        method.__qualname__ = f"Camera.{self._name}"
        return method
