"""Methods in Python of compiled classes, `Camera.from_<format>` and others, imported when somebody uses them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from importlib import import_module
from types import MethodType
from typing import TYPE_CHECKING, Any, TypeAlias

__all__ = ["Attached", "AttachedMethod"]


if TYPE_CHECKING:
    _Static: TypeAlias = staticmethod[..., Any]
else:
    _Static = staticmethod  # takes no parameters at run time


def _unread() -> None:
    """Read a calibration; look at the method itself to see its arguments."""


class Attached(_Static):
    """A static method whose module is imported when somebody first looks at it: importing the package does not."""

    _name: str
    _module: str
    _function: str
    _owner: str

    @classmethod
    def to(cls, name: str, module: str, function: str, owner: str = "Camera") -> Attached:
        """Return one that leads to a function.

        It is no constructor, because since Python 3.15 `staticmethod` counts what it is made of.

        Parameters
        ----------
        name : str
            Of the method, as `help` shows it.
        module, function : str
            Where the function is that does it; its docstring and signature are the method's.
        owner : str
            The class.
        """
        attached = cls(_unread)
        attached._name, attached._module, attached._function, attached._owner = name, module, function, owner
        return attached

    def __get__(self, camera: Any, owner: type | None = None) -> Callable[..., Any]:
        return self._method

    @functools.cached_property
    def _method(self) -> Callable[..., Any]:
        function = getattr(import_module(self._module), self._function)

        @functools.wraps(function)
        def method(*arguments: Any, **keywords: Any) -> Any:
            return function(*arguments, **keywords)

        method.__name__ = self._name
        method.__qualname__ = f"{self._owner}.{self._name}"
        return method


class AttachedMethod:
    """The same with the object as the function's first argument."""

    def __init__(self, name: str, module: str, function: str, owner: str = "Camera") -> None:
        self._static = Attached.to(name, module, function, owner)

    def __get__(self, instance: Any, owner: type | None = None) -> Callable[..., Any]:
        method = self._static.__get__(None)
        return method if instance is None else MethodType(method, instance)
