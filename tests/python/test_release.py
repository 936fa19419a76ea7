"""What a release rests on: one version everywhere, pinned actions, licences, a checker of wheels that sees faults."""

from __future__ import annotations

import importlib.util
import re
import shutil
import zipfile
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


def script(name: str) -> ModuleType:
    """A script of the project, as a module of its own."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "scripts" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_action_is_pinned_by_hash():
    uses = [
        (path.name, line.strip())
        for path in (ROOT / ".github/workflows").glob("*.yml")
        for line in path.read_text().splitlines()
        if "uses:" in line
    ]
    assert len(uses) > 20
    loose = [use for use in uses if not re.fullmatch(r"(- )?uses: [\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", use[1])]
    assert not loose


def test_one_action_is_one_version():
    pins: dict[str, set[str]] = {}
    for path in (ROOT / ".github/workflows").glob("*.yml"):
        for name, pin in re.findall(r"uses: ([\w./-]+)@(.*)", path.read_text()):
            pins.setdefault(name, set()).add(pin)
    assert {name: pin for name, pin in pins.items() if len(pin) > 1} == {}


@pytest.fixture
def release(tmp_path, monkeypatch):
    module = script("release")
    for name in {*module.PLACES, *module.HOMES, "CHANGELOG.md"}:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    return module


def test_one_version_everywhere():
    script("release").check("")


def test_a_version_is_set_in_every_file(release, tmp_path):
    old = release.versions()["Cargo.toml"]
    before = {name: (tmp_path / name).read_text().splitlines() for name in release.PLACES}
    release.bump("7.8.9")
    assert set(release.versions().values()) == {"7.8.9"}
    with pytest.raises(SystemExit, match="address of the source"):
        release.check("v7.8.9")
    release.settle("https://host.example/a/ipm_rs")
    release.check("v7.8.9")
    for name, lines in before.items():
        after = [line for line in (tmp_path / name).read_text().splitlines() if "host.example" not in line]
        changed = [pair for pair in zip(lines, after, strict=True) if pair[0] != pair[1]]
        assert changed == [(line, line.replace(old, "7.8.9")) for line, _ in changed] and len(changed) == 1, name
    with pytest.raises(SystemExit, match=r"expected the tag v7\.8\.9"):
        release.check("v7.8.8")


def test_where_the_source_is_stands_in_every_file(release, tmp_path):
    before = {name: (tmp_path / name).read_text() for name in release.HOMES}
    for url in ("https://host.example/a/ipm_rs", "https://elsewhere.example/group/b/ipm_rs"):
        release.settle(url)
        assert release.homes() == dict.fromkeys(release.HOMES, url)
        for name, text in before.items():  # what was there stays, in its order
            kept = iter((tmp_path / name).read_text().splitlines())
            assert all(line in kept for line in text.splitlines()), name
    text = (tmp_path / "pyproject.toml").read_text()
    assert text.count("[project.urls]") == 1 and 'Issues = "https://elsewhere.example/group/b/ipm_rs/issues"' in text
    # a table of its own, between two that are not part of it
    tables = [line for line in text.splitlines() if line.startswith("[")]
    assert tables[tables.index("[project.urls]") + 1] == "[project.optional-dependencies]"
    (tmp_path / "CITATION.cff").write_text(before["CITATION.cff"])
    with pytest.raises(SystemExit, match="expected one address of the source"):
        release.check("")


@pytest.mark.parametrize(
    "wrong", ["", "http://host.example/a/b", "https://host.example", "https://h.example/a/b/", 'https://h/"']
)
def test_what_is_no_address_is_refused(release, tmp_path, wrong):
    with pytest.raises(SystemExit, match="expected an address"):
        release.settle(wrong)
    assert release.homes() == script("release").homes()


@pytest.mark.parametrize("wrong", ["0.0.1", "1", "1.2", "v9.0.0", "9.0.0-x", "9.0.0+1", ""])
def test_what_is_no_later_version_is_refused(release, tmp_path, wrong):
    before = (tmp_path / "Cargo.toml").read_text()
    with pytest.raises(SystemExit, match="expected a version above"):
        release.bump(wrong)
    assert (tmp_path / "Cargo.toml").read_text() == before


def test_versions_sort_as_semantic_versioning_says(release):
    ascending = [
        "0.9.0",
        "0.10.0-alpha.1",
        "0.10.0-beta.2",
        "0.10.0-beta.10",
        "0.10.0-rc.1",
        "0.10.0",
        "0.10.1",
        "1.0.0",
    ]
    assert sorted(reversed(ascending), key=release.order) == ascending


def test_a_version_that_differs_in_one_file_is_found(release, tmp_path):
    citation = tmp_path / "CITATION.cff"
    citation.write_text(re.sub(r"^version: .*", "version: 5.5.5", citation.read_text(), flags=re.MULTILINE))
    with pytest.raises(SystemExit, match="expected one version everywhere"):
        release.check("")


def test_licences_of_all_crates_are_permissive(capsys):
    if shutil.which("cargo") is None:
        pytest.skip("cargo was not found")
    assert script("check_licences").main() == 0
    assert "0 of a licence that is not allowed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("expression", "allowed"),
    [
        ("MIT", True),
        ("GPL-3.0-only", False),
        ("MIT/Apache-2.0", True),
        ("GPL-2.0 OR MIT", True),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", True),
        ("MIT AND GPL-3.0", False),
        ("", False),
    ],
)
def test_licence_expressions(expression, allowed):
    module = script("check_licences")
    assert module.permits(expression, module.allowed()) == allowed


def wheel() -> Path:
    """The wheel that `make build` made."""
    found = sorted((ROOT / "dist").glob("ipm_rs-*.whl"))
    if not found:
        pytest.skip("there is no wheel in dist/")
    return found[0]


def rewritten(target: Path, change) -> Path:
    """The wheel with its files changed by `change`, which is given (name, data) and returns data or None."""
    path = target / wheel().name
    with zipfile.ZipFile(wheel()) as source, zipfile.ZipFile(path, "w") as out:
        for name in source.namelist():
            data = change(name, source.read(name))
            if data is not None:
                out.writestr(name, data)
    return path


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda name, data: None if name.endswith("LICENSE-MIT") else data, "missing: "),
        (lambda name, data: None if "/sboms/" in name else data, "bill of materials"),
        (
            lambda name, data: data + b"#" if name == "ipm_rs/errors.py" else data,
            "RECORD is wrong about ipm_rs/errors.py",
        ),
        (lambda name, data: data.replace(b"Requires-Dist: numpy", b"Requires-Dist: scipy"), "to be needed"),
        (
            lambda name, data: data.replace(b"PyInit__core", b"PyInit__cold") if name.endswith(".so") else data,
            "it exports",
        ),
    ],
)
def test_a_wheel_with_a_fault_is_found_out(tmp_path, change, fault):
    faults = script("check_wheel").check(rewritten(tmp_path, change))
    assert any(fault in found for found in faults), faults
