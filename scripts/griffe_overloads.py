"""Griffe extension for the API page: functions of a stub that are only overloads.

A stub has no implementation beside its overloads, and Griffe makes a function of nothing else. The first overload,
which carries the docstring, takes that place and shows all signatures.
"""

from __future__ import annotations

from typing import Any

import griffe


class StubOverloads(griffe.Extension):
    """Make a member of each function that has overloads alone."""

    def on_module_members(self, *, mod: griffe.Module, **kwargs: Any) -> None:
        """Look through a module when all of it has been read."""
        for name, overloads in list(mod.overloads.items()):
            if overloads and name not in mod.members:
                function = overloads[0]
                function.overloads = list(overloads)
                mod.set_member(name, function)
