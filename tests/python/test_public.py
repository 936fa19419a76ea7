"""The public face: names, docstrings, signatures, errors."""

from __future__ import annotations

import ast
import importlib
import inspect
import pathlib
import pickle
import re
import subprocess
import sys

import numpy as np
import pytest

import ipm_rs
from ipm_rs import errors
from ipm_rs.calibration import FORMATS

FOLDER = pathlib.Path(ipm_rs.__file__).parent
LENSES = ("BrownConrady", "KannalaBrandt", "Mei", "DoubleSphere", "Eucm", "RadialPolynomial", "Ocam")
CLASSES = ("Camera", "BevGrid", "Lut", "Plane", "HeightMap", *LENSES)
FUNCTIONS = (
    "flip_handedness",
    "flip_handedness_euler",
    "flip_handedness_rotation",
    "flip_handedness_pose",
    "homography_from_points",
    "vanishing_point",
    "rotation_from_euler",
    "cpu_info",
    "set_num_threads",
    "get_num_threads",
)
MEMBERS = {
    "Camera": (
        "from_euler load save to_json intrinsics lens image_size camera_from_vehicle vehicle_from_camera position "
        "project unproject ground_from_pixels resized cropped with_pose binned rotated180 mirrored "
        "from_vanishing_point pixels_from_cells cells_from_pixels project_polyline horizon horizon_line ground_range "
        "row_ranges range_error"
    ),
    "BrownConrady": "coefficients max_angle",
    "KannalaBrandt": "coefficients max_angle",
    "Mei": "xi coefficients max_angle",
    "DoubleSphere": "xi alpha max_angle",
    "Eucm": "alpha beta max_angle",
    "RadialPolynomial": "coefficients max_angle",
    "Ocam": "polynomial affine max_angle",
    "BevGrid": "shape x y resolution sample_at xy cell_from_ground ground_from_cell",
    "Plane": "from_coefficients from_angles coefficients normal height_at",
    "HeightMap": "on_grid heights shape origin spacing height_at",
    "Lut": "from_maps from_homography from_ground_points warp mask maps sampling_density resolved_mask shape "
    "source_size nbytes",
}
BASES = {
    "IpmError": (Exception,),
    "CalibrationError": (ValueError,),
    "GridError": (ValueError,),
    "LutError": (ValueError,),
    "ImageError": (ValueError,),
    "ArgumentError": (ValueError,),
    "ArgumentTypeError": (TypeError,),
    "DtypeError": (errors.ArgumentTypeError, TypeError),
    "FileError": (OSError,),
    "MissingFileError": (errors.FileError, FileNotFoundError),
    "MissingExtraError": (ImportError,),
    "OutOfMemoryError": (MemoryError,),
}


def test_every_promised_name_is_exported():
    for name in (*CLASSES, *FUNCTIONS, "reference", "IpmError", "__version__"):
        assert hasattr(ipm_rs, name), name
        assert name in ipm_rs.__all__, name


@pytest.mark.parametrize(
    "module",
    ["ipm_rs", "ipm_rs.reference", "ipm_rs.calibration", *(f"ipm_rs.calibration.{name}" for name in FORMATS)],
)
def test_all_is_true(module):
    module = importlib.import_module(module)
    assert module.__all__
    assert len(set(module.__all__)) == len(module.__all__)
    for name in module.__all__:
        assert hasattr(module, name), name


def test_version():
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", ipm_rs.__version__)


def test_cpu_info():
    info = ipm_rs.cpu_info()
    assert isinstance(info, dict) and info
    assert all(isinstance(key, str) for key in info)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_have_docstrings_and_signatures(name):
    function = getattr(ipm_rs, name)
    assert function.__doc__ and len(function.__doc__) > 20
    assert inspect.signature(function) is not None


@pytest.mark.parametrize("name", CLASSES)
def test_classes_have_docstrings_and_signatures(name):
    cls = getattr(ipm_rs, name)
    assert cls.__doc__ and len(cls.__doc__) > 40
    assert inspect.signature(cls) is not None
    assert cls.__module__.startswith("ipm_rs")


@pytest.mark.parametrize(("name", "member"), [(name, m) for name, text in MEMBERS.items() for m in text.split()])
def test_members_have_docstrings_and_signatures(name, member):
    attribute = inspect.getattr_static(getattr(ipm_rs, name), member)
    assert getattr(attribute, "__doc__", None), f"{name}.{member}"
    bound = getattr(getattr(ipm_rs, name), member)
    if callable(bound):
        assert inspect.signature(bound) is not None


@pytest.mark.parametrize("name", CLASSES)
def test_no_member_is_a_surprise(name):
    public = {member for member in vars(getattr(ipm_rs, name)) if not member.startswith("_")}
    if name == "Camera":  # one class method for each format
        public -= {f"from_{format_name}" for format_name in FORMATS}
    assert public == set(MEMBERS[name].split())


def test_the_stub_documents_every_name():
    """Editors and the manual read `_core.pyi`: every function there says what it takes and what it refuses."""
    stub = ast.parse((FOLDER / "_core.pyi").read_text(encoding="utf-8"))
    documented = {}
    for node in stub.body:
        if isinstance(node, ast.ClassDef):
            members = [n for n in node.body if isinstance(n, ast.FunctionDef) and not n.name.startswith("__")]
            documented |= {f"{node.name}.{n.name}": ast.get_docstring(n) for n in members}
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            documented[node.name] = ast.get_docstring(node)
    promised = {*CLASSES, *FUNCTIONS, *(f"{name}.{m}" for name, text in MEMBERS.items() for m in text.split())}
    assert promised <= documented.keys()
    assert [name for name in promised if not documented[name]] == []
    for name, shape in (("Camera.project", "(N, 3)"), ("Lut.warp", "(H, W"), ("BevGrid.xy", "(rows, columns, 2)")):
        assert shape in documented[name], name
    for name in ("Camera.project", "Lut.warp", "Lut.from_maps"):
        assert "Error" in documented[name], name


def test_keywords_stay_keywords():
    for function, names in {
        ipm_rs.Lut.warp: ("interpolation", "border_value", "out", "threads"),
        ipm_rs.Lut.from_maps: ("source_size",),
        ipm_rs.Lut.from_homography: ("size", "source_size"),
        ipm_rs.Camera.from_euler: ("image_size", "position", "roll", "pitch", "yaw", "lens"),
        ipm_rs.Camera.from_cityscapes: ("image_size",),
        ipm_rs.Camera.project: ("ground",),
        ipm_rs.Camera.ground_from_pixels: ("ground",),
        ipm_rs.BevGrid: ("x", "y", "resolution", "sample_at"),
        ipm_rs.Camera: ("image_size", "camera_from_vehicle", "vehicle_from_camera", "lens"),
        ipm_rs.Lut: ("ground",),
    }.items():
        parameters = inspect.signature(function).parameters
        for name in names:
            assert parameters[name].kind is inspect.Parameter.KEYWORD_ONLY, f"{function}: {name}"


# ---------------------------------------------------------------------------------------------------------------------
# Errors


@pytest.mark.parametrize("name", BASES)
def test_error_classes(name):
    error = getattr(errors, name)
    assert issubclass(error, errors.IpmError)
    for base in BASES[name]:
        assert issubclass(error, base)
    assert error.__doc__
    one = error("what was expected, what came")
    assert str(one) == "what was expected, what came"
    again = pickle.loads(pickle.dumps(one))
    assert type(again) is error and str(again) == str(one) and again.args == one.args


def test_error_classes_are_public():
    for name in BASES:
        assert getattr(ipm_rs, name, None) is getattr(errors, name), name


def test_no_error_class_is_a_surprise():
    found = {name for name, value in vars(errors).items() if isinstance(value, type) and issubclass(value, Exception)}
    assert found == set(BASES)


def test_errors_are_caught_the_ordinary_way():
    with pytest.raises(ValueError):
        ipm_rs.BevGrid(x=(5, 1), y=(0, 1), resolution=1)
    with pytest.raises(TypeError):
        ipm_rs.Lut.from_maps(None, None, source_size=(1, 1))
    with pytest.raises(errors.IpmError):
        ipm_rs.Camera(np.zeros((3, 3)), image_size=(1, 1))


# ---------------------------------------------------------------------------------------------------------------------
# What an import costs and touches


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    return done.stdout


def test_import_needs_numpy_alone():
    heavy = "PIL tqdm cv2 scipy torch yaml"
    code = f"import sys, ipm_rs; print([m for m in '{heavy}'.split() if m in sys.modules])"
    assert run(code).strip() == "[]"


def test_the_reference_takes_nothing_from_the_core():
    """Loaded from its folder alone, it computes; the oracle must not lean on what it checks."""
    folder = str(pathlib.Path(ipm_rs.reference.__file__).parent)
    code = (
        "import importlib.util, sys\n"
        f"spec = importlib.util.spec_from_file_location('alone', {ipm_rs.reference.__file__!r}, "
        f"submodule_search_locations=[{folder!r}])\n"
        "alone = sys.modules['alone'] = importlib.util.module_from_spec(spec)\n"
        "spec.loader.exec_module(alone)\n"
        "print(alone.grid_shape((7, 50), (-10, 10), (0.05, 0.025)))\n"
        "print([m for m in sys.modules if m.startswith('ipm_rs')])\n"
    )
    assert run(code).split("\n")[:2] == ["(860, 800)", "[]"]


@pytest.mark.parametrize(
    "first", ["ipm_rs.calibration.cityscapes", "ipm_rs.calibration", "ipm_rs.reference", "ipm_rs.errors"]
)
def test_any_module_may_be_imported_first(first):
    assert run(f"import {first}; print({first}.__name__)").strip() == first


def test_the_package_is_typed():
    assert (FOLDER / "py.typed").is_file() and (FOLDER / "_core.pyi").is_file()
