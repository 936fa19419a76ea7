"""`help()` at the prompt says what the type stub says: one text for editors, the manual and the running module."""

from __future__ import annotations

import ast
import inspect
import pathlib
import re

import pytest

import ipm_rs
from ipm_rs import _core
from ipm_rs.calibration import FORMATS

ATTACHED = {
    *(f"Camera.from_{name}" for name in ("ground_points", "points", "projection", "fov")),
    *("Camera.load", "Camera.load_all"),
    *(f"Camera.from_{name}" for name in FORMATS),
    *(f"Camera.{name}" for name in ("undistorted", "project_polygon", "ground_polygon")),
    *("Lut.between", "Plane.from_camera", "Plane.transformed"),
}
"""Written in Python, with docstrings of their own, which go further than the stub's."""

STUB = ast.parse((pathlib.Path(ipm_rs.__file__).parent / "_core.pyi").read_text(encoding="utf-8"))
DEFINITIONS = [node for node in STUB.body if isinstance(node, ast.ClassDef | ast.FunctionDef)]


def documented() -> dict[str, str]:
    """Each public name of the stub with its docstring; a class's goes on with that of its constructor."""
    texts: dict[str, str] = {}
    for node in DEFINITIONS:
        if node.name.startswith("_"):
            continue
        text = ast.get_docstring(node) or ""
        if isinstance(node, ast.ClassDef):
            for member in node.body:
                if isinstance(member, ast.FunctionDef) and member.name == "__new__":
                    text = f"{text}\n\n{ast.get_docstring(member)}"
                elif isinstance(member, ast.FunctionDef) and not member.name.startswith("_"):
                    texts.setdefault(f"{node.name}.{member.name}", ast.get_docstring(member) or "")
        texts.setdefault(node.name, text)  # of overloads the first has the text
    return texts


DOCUMENTED = documented()


def compiled_names() -> list[str]:
    """Every public name of the extension module, and every public attribute of its classes."""
    names = []
    for name, value in vars(_core).items():
        if name.startswith("_"):
            continue
        names.append(name)
        if isinstance(value, type):
            names += [f"{name}.{member}" for member in sorted(vars(value)) if not member.startswith("_")]
    return names


def find(name: str) -> object:
    owner, _, member = name.partition(".")
    return inspect.getattr_static(getattr(_core, owner), member) if member else getattr(_core, owner)


def test_stub_and_module_have_the_same_names():
    assert set(compiled_names()) == set(DOCUMENTED)
    assert len(DOCUMENTED) > 100


@pytest.mark.parametrize("name", compiled_names())
def test_help_is_the_docstring_of_the_stub(name):
    assert DOCUMENTED[name].strip()
    if name not in ATTACHED:
        assert inspect.getdoc(find(name)) == DOCUMENTED[name]


@pytest.mark.parametrize("name", sorted(ATTACHED))
def test_help_of_readers_explains_each_argument(name):
    owner, _, member = name.partition(".")
    method = getattr(getattr(_core, owner), member)
    assert (method.__qualname__, name in DOCUMENTED) == (name, True)
    for argument in inspect.signature(method).parameters.keys() - {"self"}:
        line = rf"^(\w+, )*{argument}(, \w+)* : "
        assert re.search(line, inspect.getdoc(method), re.MULTILINE), argument


@pytest.mark.parametrize("name", compiled_names())
def test_help_shows_the_arguments(name):
    """The signature is not lost among the text: `inspect.signature` has it, and the text explains each argument."""
    owner, _, member = name.partition(".")
    value = getattr(getattr(_core, owner), member) if member else getattr(_core, owner)
    if callable(value):
        parameters = inspect.signature(value).parameters
        section = DOCUMENTED[name].partition("Args:")[2].partition("Returns:")[0]
        if section:
            assert [p for p in parameters if p != "self" and p not in section] == []
