"""What the documents say of the source tree: where `unsafe` lives, which files there are, which targets make has."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RUST = sorted((ROOT / "src").rglob("*.rs"))


def code(path: Path) -> str:
    """A Rust source without comments and the insides of strings."""
    text = re.sub(r"//[^\n]*", "", path.read_text(encoding="utf-8"))
    return re.sub(r'"(?:\\.|[^"\\])*"', '""', text)


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_unsafe_lives_where_decision_0007_says():
    rows = [line for line in read("docs/decisions/0007-where-unsafe-lives.md").splitlines() if line.startswith("| `")]
    places = {place: 0 for row in rows for place in re.findall(r"`(src/[^`]*)`", row.split("|")[1])}
    assert places
    for path in RUST:
        if re.search(r"\bunsafe\b", code(path)):
            name = path.relative_to(ROOT).as_posix()
            found = [place for place in places if name == place or (place.endswith("/") and name.startswith(place))]
            assert len(found) == 1, f"{name} holds unsafe; decision 0007 lists it {len(found)} times"
            places[found[0]] += 1
    assert [place for place, count in places.items() if not count] == []


BASE = {"error", "isa", "view", "parallel", "digits"}
#: Which rooms of the crate each may use, besides itself. What is not listed may be used by nobody below `python`.
MAY_USE = {
    "isa": set(),
    "digits": set(),
    "view": {"error"},
    "parallel": {"error", "view"},
    "finding": {"digits"},
    "geometry": BASE,
    "ground": BASE | {"geometry"},
    "camera": BASE | {"geometry", "ground", "finding"},
    "grid": {"digits", "view"},
    "table": BASE,
    "kernels": BASE | {"table"},
    "lut": BASE | {"geometry", "ground", "camera", "grid", "finding", "table", "kernels"},
    "warp": BASE | {"lut", "table", "kernels"},
    "cloud": BASE | {"geometry", "camera"},
    "raster": BASE | {"grid"},
    "refine": BASE | {"geometry", "ground", "camera"},
    "mosaic": BASE | {"ground", "camera", "grid", "lut", "warp"},
    "rig": BASE | {"ground", "camera", "grid", "table", "kernels", "lut", "warp", "raster"},
}
UPWARD: set[tuple[str, str]] = set()


def uses(path: Path) -> set[str]:
    """The rooms that a Rust source names, its tests apart."""
    text = code(path).split("#[cfg(test)]")[0]
    grouped = [name for group in re.findall(r"\buse crate::\{([^;]*)\};", text) for name in re.findall(r"\w+", group)]
    return {*re.findall(r"\bcrate::(\w+)", text), *grouped}


def test_rooms_use_only_what_stands_below_them():
    found, upward = set(), set()
    for path in RUST:
        room = path.relative_to(ROOT / "src").parts[0].removesuffix(".rs")
        if room in ("lib", "python", "error"):
            continue
        assert room in MAY_USE, f"{room} is new: say what it may use"
        for used in uses(path) - {room}:
            found.add((room, used))
            if used not in MAY_USE[room]:
                upward.add((room, used))
                assert (room, used) in UPWARD, f"{path.relative_to(ROOT)} uses crate::{used}"
    assert len(found) > 40, "the test has gone blind"
    assert upward == UPWARD, "one is mended: take it off the list"


def test_errors_live_beside_what_raises_them_and_know_nothing_else():
    """`error.rs` gathers them and so names every room; none of the files it names knows one."""
    gathered = re.findall(r"\buse crate::([\w:]+)", code(ROOT / "src/error.rs"))
    single = {"isa::IsaError", "grid::GridError"}  # in files of their own, which use no other room's errors
    assert single < set(gathered)
    named = {"/".join(name.split("::error")[0].split("::")) + "/error.rs" for name in set(gathered) - single}
    rooms = [path for path in RUST if path.name == "error.rs" and "python" not in path.parts]
    assert {path.relative_to(ROOT / "src").as_posix() for path in rooms} == named | {"error.rs"}
    for path in set(rooms) - {ROOT / "src/error.rs"}:
        assert set(re.findall(r"\bcrate::[\w:]+", code(path))) <= {"crate::digits::count", "crate::digits::readable"}, (
            path
        )


def test_the_core_says_nothing_in_python():
    """How to mend an error is said in `src/python/mend.rs`, in Python's words."""
    words = re.compile(r"\bnp\.|numpy|\b[a-z_]+=[A-Z\\\\\"(]|\bcamera\.\w+\(")
    for path in RUST:
        if path.name == "error.rs" and "python" not in path.parts:
            found = words.search(path.read_text("utf-8"))
            assert not found, f"{path.relative_to(ROOT)}: {found[0]}"


def test_the_core_is_one_with_and_without_python():
    """What the default features build is what the binding gets: only its own module is left out."""
    naming = [path.relative_to(ROOT / "src").as_posix() for path in RUST if "feature =" in path.read_text("utf-8")]
    assert [name for name in naming if not name.startswith("python/")] == ["lib.rs"]
    assert read("src/lib.rs").count("feature =") == 1


def test_the_reference_knows_neither_tables_nor_kernels():
    for path in sorted((ROOT / "src/warp/reference").rglob("*.rs")):
        text = code(path)
        assert not re.search(r"\b(lut|table|kernels)::", text), path.name
        assert "Lut" not in text, path.name


def test_what_depends_on_the_instruction_set_names_them_all():
    """`by_isa!` asks for every one; a match with a wildcard would let a new one fall back to scalar without a word."""
    matching = {path.name for path in RUST if re.search(r"\bIsa::\w+[^\n;{}]*=>", code(path))}
    assert matching == {"isa.rs"}
    cpu = code(ROOT / "src/isa.rs").split("#[cfg(test)]")[0]
    for match in re.findall(r"match (?:self|\$isa) \{.*?\n        \}", cpu, re.DOTALL):
        assert "_ =>" not in match
    assert sum("by_isa!" in code(path) for path in RUST) >= 2


def test_only_one_file_asks_the_cpu():
    asking = [path.name for path in RUST if "feature_detected!" in code(path)]
    assert asking == ["isa.rs"]


def test_the_page_about_kernels_lists_their_files():
    """The tree of docs/simd.md: each folder with its files, `mod.rs` and tests apart."""
    tree = re.search(r"^```text\n(.*?)^```", read("docs/simd.md"), re.MULTILINE | re.DOTALL)[1]
    for path in sorted((ROOT / "src/kernels").rglob("*.rs")):
        assert re.search(rf"\b{path.stem}\b", tree), f"{path.relative_to(ROOT)} is not in the tree"
    listed = set(re.findall(r"\b(\w+)\.rs\b", tree))
    assert listed <= {path.stem for path in RUST}


def test_the_page_about_kernels_names_what_exists():
    page = read("docs/simd.md")
    for name in re.findall(r"\((`\w+`)\)", page):
        assert any(name.strip("`") in code(path) for path in RUST), name
    for target in re.findall(r"`make ([a-z-]+)", page):
        assert re.search(rf"^{target}:", read("Makefile"), re.MULTILINE), target
    emulated = read("scripts/test_emulated.py")
    for cpu in ("Nehalem", "Haswell", "EPYC"):
        assert cpu in page and f'"{cpu}"' in emulated


def test_contributing_names_what_exists():
    page = read("CONTRIBUTING.md")
    for target in re.findall(r"`make ([a-z-]+)", page):
        assert re.search(rf"^{target}:", read("Makefile"), re.MULTILINE), target
    tree = re.search(r"^```text\n(.*?)^```", page, re.MULTILINE | re.DOTALL)[1]
    for line in tree.splitlines():
        if line[0] != " ":
            assert (ROOT / line.split()[0]).exists(), line
    folders = {path.name + "/" for path in ROOT.iterdir() if path.is_dir() and path.name[0] != "."}
    made = {"target/", "dist/", "site/"}
    assert {folder for folder in folders - made if folder != "proptest-regressions/"} <= set(
        re.findall(r"^\S+/", tree, re.M)
    ) | {"python/"}


RECIPES = {
    "A lens": (r"(?i)\b(py)?eucm\b", {"kalibr", "basalt", "_lenswords"}),
    "A calibration reader": (r"woodscape", set()),
    "An interpolation": (
        r"Interpolation::Area|Self::Area\b|warp_(many_)?mode|Taken::Mode|[\"']mode[\"']|reference/warps",
        {"masked"},
    ),
    "A dtype": (r"\bF16\b", set()),
    "An instruction set": (r"(?i)\bneon\b", set()),
}
"""The name of a recipe's example, and the modules that know it for another reason: readers of that lens, masks that are
worked out by area."""


@pytest.mark.parametrize("title", RECIPES)
def test_a_recipe_names_every_file_that_knows_its_example(title):
    pattern, others = RECIPES[title]
    section = re.search(rf"^### {title}\n(.*?)^##", read("CONTRIBUTING.md"), re.MULTILINE | re.DOTALL)[1]
    named = set(re.findall(r"`((?:src|python)/[\w/]+\.\w+)`", section))
    sources = [*RUST, *(path for path in (ROOT / "python").rglob("*.py*") if path.suffix in (".py", ".pyi"))]
    names = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8").split("#[cfg(test)]")[0] for path in sources}
    knowing = {name for name, text in names.items() if re.search(pattern, name + re.sub(r"//.*", "", text))}
    assert {name for name in knowing if Path(name).stem not in others} == named


def test_recipes_name_what_exists():
    section = re.search(r"^## Recipes\n(.*?)^## Commits", read("CONTRIBUTING.md"), re.MULTILINE | re.DOTALL)[1]
    for name in re.findall(r"`((?:src|python|tests|benches|docs|scripts)/[\w/.]*)`", section):
        assert (ROOT / name).exists(), name


def test_the_workflow_runs_what_a_commit_does_not():
    nightly = read(".github/workflows/nightly.yml")
    assert "schedule:" in nightly and "cron:" in nightly
    for target in ("test-neon", "test-no-avx"):
        assert f"target: {target}," in nightly
    assert "run: make ${{ matrix.target }}" in nightly
    for workflow in (ROOT / ".github" / "workflows").glob("*.yml"):
        for target in re.findall(r"run: make ([a-z-]+)", workflow.read_text(encoding="utf-8")):
            assert re.search(rf"^{target}:", read("Makefile"), re.MULTILINE), f"{workflow.name}: {target}"
