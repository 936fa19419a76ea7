"""The public face: names, docstrings, signatures, errors."""

from __future__ import annotations

import ast
import importlib.util
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
ROOT = pathlib.Path(__file__).resolve().parents[2]
PUBLIC = {name: getattr(ipm_rs, name) for name in ipm_rs.__all__ if name != "__version__"}
MODULES = [name for name, value in PUBLIC.items() if inspect.ismodule(value)]
EXCEPTIONS = [name for name, value in PUBLIC.items() if isinstance(value, type) and issubclass(value, BaseException)]
CLASSES = [name for name, value in PUBLIC.items() if isinstance(value, type) and name not in EXCEPTIONS]
FUNCTIONS = [name for name, value in PUBLIC.items() if inspect.isroutine(value)]
MEMBERS = {
    "Camera": (
        "from_euler from_ground_points from_points from_projection from_fov load load_all save to_json intrinsics "
        "lens image_size is_panorama camera_from_vehicle vehicle_from_camera position project unproject "
        "ground_from_pixels resized cropped with_pose binned rotated180 mirrored masked mask undistorted "
        "project_polygon ground_polygon "
        "from_vanishing_point pixels_from_cells cells_from_pixels project_polyline horizon horizon_line "
        "ground_range row_ranges range_error"
    ),
    "BrownConrady": "coefficients max_angle",
    "KannalaBrandt": "coefficients max_angle",
    "Mei": "xi coefficients max_angle",
    "DoubleSphere": "xi alpha max_angle",
    "Eucm": "alpha beta max_angle",
    "RadialPolynomial": "coefficients max_angle",
    "Ocam": "polynomial affine max_angle",
    "FTheta": "polynomial form linear max_angle",
    "Fov": "omega max_angle",
    "Division": "k max_angle",
    "InverseBrownConrady": "coefficients max_angle",
    "ThinPrismFisheye": "coefficients max_angle",
    "Cylindrical": "max_angle",
    "Equirectangular": "max_angle",
    "BevGrid": "shape x y resolution sample_at xy cell_from_ground ground_from_cell",
    "Plane": "from_camera from_coefficients from_angles transformed coefficients normal height_at",
    "HeightMap": "on_grid heights shape origin spacing height_at",
    "Lut": "save load export between from_maps from_homography from_ground_points warp warp_adjoint mask maps "
    "sampling_density resolved_mask shape "
    "source_size source_wraps border_mode nbytes camera grid ground",
    "PixelRays": "camera nbytes",
    "Layers": "",
    "Rig": "cameras subset moved to_json save load",
    "RigLut": "rig grid ground shape nbytes mask source weights warp warp_adjoint without gains agreement save load",
    "Mosaic": "load save commit close resolution tile channels dtype samples labels frames tiles bounds nbytes add "
    "gain refine merge window image layers export_tiles export_geotiff",
    "Trajectory": "load timestamps poses max_gap start end covers at",
    "Homography": "from_points from_matrix pixels_from_ground ground_from_pixels",
    "Bowl": "flat radius center height steepest height_at height_map",
}
BASES = {
    "IpmError": (Exception,),
    "CalibrationError": (ValueError,),
    "GridError": (ValueError,),
    "LutError": (ValueError,),
    "MosaicError": (ValueError,),
    "ImageError": (ValueError,),
    "ArgumentError": (ValueError,),
    "ArgumentTypeError": (TypeError,),
    "DtypeError": (errors.ArgumentTypeError, TypeError),
    "FileError": (OSError,),
    "MissingFileError": (errors.FileError, FileNotFoundError),
    "MissingExtraError": (ImportError,),
    "OutOfMemoryError": (MemoryError,),
}


def test_every_public_name_is_of_a_kind_that_is_looked_at():
    """Each test below goes over one of these lists; together they are everything that is exported."""
    assert sorted([*MODULES, *EXCEPTIONS, *CLASSES, *FUNCTIONS, "__version__"]) == sorted(ipm_rs.__all__)
    assert [name for name, value in vars(ipm_rs).items() if not name.startswith("_") and callable(value)] == [
        name for name in vars(ipm_rs) if name in (*EXCEPTIONS, *CLASSES, *FUNCTIONS)
    ]


def documented_on_the_api_page() -> set[str]:
    pages = (page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs" / "api").glob("*.md")))
    page = "\n".join(pages)
    return {name.removeprefix("ipm_rs.") for name in re.findall(r"^::: (ipm_rs\.[\w.]+)$", page, re.MULTILINE)}


def test_the_api_page_has_every_public_name():
    on_page = documented_on_the_api_page()
    assert sorted(set(FUNCTIONS + CLASSES) - on_page) == []
    for module in MODULES:  # as a whole, or each of its functions
        promised = getattr(ipm_rs, module).__all__
        own = (name for name in promised if name not in FUNCTIONS)  # `diagnosis.doctor` is `doctor`
        functions = {f"{module}.{name}" for name in own if inspect.isroutine(getattr(PUBLIC[module], name))}
        assert module in on_page or functions <= on_page, module
    assert "errors" in on_page and set(EXCEPTIONS) <= set(errors.__all__)
    assert "ipm_rs.__version__" in (ROOT / "docs" / "api" / "index.md").read_text(encoding="utf-8")


def test_every_page_of_names_is_in_the_table_of_them():
    folder = ROOT / "docs" / "api"
    index = (folder / "index.md").read_text(encoding="utf-8")
    for page in sorted(folder.glob("*.md")):
        for name in re.findall(r"^::: (ipm_rs\.[\w.]+)$", page.read_text(encoding="utf-8"), re.MULTILINE):
            if name == "ipm_rs.refine":
                continue  # its text only
            whole = name.removeprefix("ipm_rs.").split(".")[0] in ("errors", "reference", "pointfile")
            assert f"({page.name}{'' if whole else '#' + name})" in index, name


def test_the_api_page_has_nothing_that_is_not_public():
    for name in documented_on_the_api_page():
        module, _, last = name.rpartition(".")
        if module == "torch" and not importlib.util.find_spec("torch"):
            continue  # what is there is held where PyTorch is
        owner = importlib.import_module(f"ipm_rs.{module}".rstrip("."))
        public = last in owner.__all__
        assert public or (not last.startswith("_") and importlib.util.find_spec(f"{owner.__name__}.{last}")), name


@pytest.mark.parametrize(
    "module",
    ["ipm_rs", *(f"ipm_rs.{name}" for name in MODULES), *(f"ipm_rs.calibration.{name}" for name in FORMATS)],
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
    classes = [kind for kind in getattr(ipm_rs, name).__mro__ if kind.__module__.startswith("ipm_rs")]
    public = {member for kind in classes for member in vars(kind) if not member.startswith("_")}
    if name == "Camera":  # one class method for each format
        public -= {f"from_{format_name}" for format_name in FORMATS}
    assert public == set(MEMBERS[name].split())


STUB = ast.parse((FOLDER / "_core.pyi").read_text(encoding="utf-8"))
STUB_FUNCTIONS = {
    f"{owner.name}.{node.name}" if isinstance(owner, ast.ClassDef) else node.name: node
    for owner in (STUB, *(node for node in STUB.body if isinstance(node, ast.ClassDef)))
    for node in owner.body
    if isinstance(node, ast.FunctionDef)
}


def test_the_stub_gives_every_argument_and_result_a_type():
    """`tests/python/test_help.py` holds names and docstrings of stub and module against each other."""
    untyped = []
    for name, node in STUB_FUNCTIONS.items():
        every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg]
        arguments = [a for a in every if a is not None and a.arg not in ("self", "cls")]
        untyped += [f"{name}({a.arg})" for a in arguments if a.annotation is None]
        untyped += [] if node.returns else [f"{name} ->"]
    assert untyped == []
    assert {*FUNCTIONS} - {"doctor"} <= STUB_FUNCTIONS.keys()  # which is written in Python


@pytest.mark.parametrize("module", [name for name in MODULES if name != "errors"])
def test_functions_of_public_modules_are_typed_and_documented(module):
    for name in PUBLIC[module].__all__:
        value = getattr(PUBLIC[module], name)
        if inspect.isfunction(value):
            signature = inspect.signature(value)
            assert inspect.getdoc(value), name
            assert signature.return_annotation is not inspect.Signature.empty, name
            assert [p.name for p in signature.parameters.values() if p.annotation is p.empty] == [], name


def test_docstrings_say_shapes_and_what_is_refused():
    for name, shape in (
        (ipm_rs.Camera.project, "(N, 3)"),
        (ipm_rs.Lut.warp, "(H, W"),
        (ipm_rs.BevGrid.xy, "columns, 2)"),
    ):
        assert shape in inspect.getdoc(name), name
    methods = [getattr(getattr(ipm_rs, name), member) for name in MEMBERS for member in MEMBERS[name].split()]
    for function in [*filter(callable, methods), *map(PUBLIC.get, FUNCTIONS)]:
        takes = [name for name in inspect.signature(function).parameters if name != "self"]
        assert not takes or re.search(r"^Raises(:|\n------)$", inspect.getdoc(function), re.MULTILINE), function


def test_keywords_stay_keywords():
    for function, names in {
        ipm_rs.Lut.warp: ("interpolation", "border_mode", "border_value", "out", "threads"),
        ipm_rs.Lut.from_maps: ("source_size", "border_mode", "source_wraps"),
        ipm_rs.Lut.from_homography: ("size", "source_size", "grid", "border_mode"),
        ipm_rs.Camera.from_euler: ("image_size", "position", "roll", "pitch", "yaw", "lens"),
        ipm_rs.Camera.from_cityscapes: ("image_size",),
        ipm_rs.Camera.project: ("ground",),
        ipm_rs.Camera.ground_from_pixels: ("ground",),
        ipm_rs.BevGrid: ("x", "y", "resolution", "sample_at"),
        ipm_rs.Camera: ("image_size", "camera_from_vehicle", "vehicle_from_camera", "lens"),
        ipm_rs.Lut: ("ground", "border_mode"),
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
    assert set(EXCEPTIONS) == set(BASES) | {"CalibrationWarning"}
    for name in BASES:
        assert getattr(ipm_rs, name, None) is getattr(errors, name), name


def test_no_error_class_is_a_surprise():
    found = {name for name, value in vars(errors).items() if isinstance(value, type) and issubclass(value, Exception)}
    assert found == set(BASES) | {"CalibrationWarning"}
    assert issubclass(errors.CalibrationWarning, UserWarning)


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


def test_torch_is_an_extra():
    code = (
        "import sys, ipm_rs; sys.modules['torch'] = None\n"
        "try:\n    ipm_rs.torch\nexcept ipm_rs.MissingExtraError as error:\n    print(error)"
    )
    assert 'pip install "ipm-rs[torch]"' in run(code)


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


def test_attached_methods_are_made_where_static_methods_count_arguments() -> None:
    """As in Python 3.15, in which `import ipm_rs` failed for it."""

    class Strict(staticmethod):
        def __new__(cls, function):
            return super().__new__(cls, function)

    source = (FOLDER / "calibration" / "_attached.py").read_text(encoding="utf-8")
    names = {"staticmethod": Strict, "__name__": "attached"}
    exec(compile(source, "_attached.py", "exec"), names)
    method = names["Attached"].to("root", "math", "sqrt", "Camera").__get__(None)
    assert method(9.0) == 3.0 and method.__qualname__ == "Camera.root"
