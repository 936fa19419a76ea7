"""What a built wheel holds and asks for: `python scripts/check_wheel.py dist/ipm_rs-....whl ...`.

Contents and their hashes, licences, the bill of materials, metadata and size; of Linux wheels also the libraries and
the C library's version that they need, what they export, and how they are linked (readelf, of binutils or LLVM, for
any architecture). What is inside the kernels is `verify_simd.py`'s.
"""

from __future__ import annotations

import base64
import csv
import email
import hashlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# MB: half as much again as the largest of November 2026.
LARGEST_WHEEL, LARGEST_LIBRARY = 4.5, 11.0

# What a Linux wheel may load, by kind: the C library with its parts, and the compiler's for unwinding.
LIBRARIES = {
    "manylinux": r"lib(c|m|pthread|dl|rt|gcc_s)\.so\.\d|ld-linux-[\w-]+\.so\.\d",
    "musllinux": r"libc\.so|libc\.musl-\w+\.so\.1",
}
# What the interpreter's stable interface has of names with an underscore.
PRIVATE = {"_Py_Dealloc", "_Py_DecRef", "_Py_IncRef", "_Py_NoneStruct", "_Py_TrueStruct", "_Py_FalseStruct"}
PRIVATE |= {"_Py_EllipsisObject", "_Py_NotImplementedStruct", "_Py_NegativeRefcount", "_Py_CheckRecursiveCall"}
# All that this package needs to run.
MANDATORY = {"numpy"}


class Faults(list[str]):
    """What is wrong with a wheel."""

    def unless(self, holds: bool, fault: str) -> None:
        """Note a fault."""
        if not holds:
            self.append(fault)


def check_contents(archive: zipfile.ZipFile, faults: Faults) -> str:
    """Compare the files with those of the source tree, and all with their hashes; return the library's name."""
    names = set(archive.namelist())
    info = next(name for name in names if name.endswith(".dist-info/METADATA")).rpartition("/")[0]
    sources = {path for kind in ("*.py", "*.pyi", "py.typed", "*.html") for path in (ROOT / "python").rglob(kind)}
    expected = {path.relative_to(ROOT / "python").as_posix() for path in sources}
    expected |= {f"{info}/{name}" for name in ("METADATA", "WHEEL", "RECORD", "entry_points.txt")}
    expected |= {f"{info}/licenses/{path.name}" for path in ROOT.glob("LICENSE-*")}
    libraries = {name for name in names if re.fullmatch(r"ipm_rs/_core\.[\w.-]*(so|pyd)", name)}
    boms = {name for name in names if name.startswith(f"{info}/sboms/") and name.endswith(".json")}
    faults.unless(len(libraries) == 1, f"expected one library, found {sorted(libraries)}")
    faults.unless(bool(boms), "expected a bill of materials, found none")
    faults.unless(not expected - names, f"missing: {sorted(expected - names)}")
    faults.unless(not names - expected - libraries - boms, f"too much: {sorted(names - expected - libraries - boms)}")
    record = {row[0]: row[1:] for row in csv.reader(archive.read(f"{info}/RECORD").decode().splitlines()) if row}
    faults.unless(set(record) == names, "RECORD does not name the files that are there")
    for name in names & set(record) - {f"{info}/RECORD"}:
        data = archive.read(name)
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        faults.unless(record[name] == [f"sha256={digest}", str(len(data))], f"RECORD is wrong about {name}")
    for name in boms:
        crates = {part["name"] for part in json.loads(archive.read(name))["components"]}
        faults.unless({"pyo3", "rayon"} <= crates, f"{name} names no crates: {sorted(crates)[:5]}")
    return next(iter(libraries), "")


def check_metadata(archive: zipfile.ZipFile, faults: Faults) -> None:
    """Check what an index and an installer read."""
    name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
    metadata = email.message_from_bytes(archive.read(name))
    every = metadata.get_all("Requires-Dist", [])
    needed = {re.split(r"[ ><=!~;\[]", line)[0] for line in every if "extra ==" not in line}
    faults.unless(needed == MANDATORY, f"expected {MANDATORY} to be needed, found {needed}")
    version = re.search(r'^version = "(.+?)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)
    faults.unless(version is not None and metadata["Version"] == version[1], f"the version is {metadata['Version']}")
    faults.unless(metadata["Requires-Python"] == ">=3.10", f"it is for Python {metadata['Requires-Python']}")
    expression = metadata["License-Expression"]
    faults.unless(expression == "MIT OR Apache-2.0", f"its licence is {expression}")
    files = set(metadata.get_all("License-File", []))
    faults.unless({"LICENSE-MIT", "LICENSE-APACHE"} <= files, f"its licence files are {sorted(files)}")
    faults.unless(len(metadata.get_payload()) > 1000, "it has no description")
    faults.unless(bool(metadata.get_all("Classifier")), "it has no classifiers")


def readelf(library: Path) -> str:
    """All that readelf knows of what is loaded."""
    program = shutil.which("readelf") or shutil.which("llvm-readelf")
    if program is None:
        raise SystemExit("readelf was not found; install binutils or LLVM")
    command = [program, "--wide", "--dynamic", "--dyn-syms", "--version-info", "--program-headers", str(library)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def check_linux(library: Path, tags: str, faults: Faults) -> str:
    """Check what a shared library loads, needs and exports."""
    text = readelf(library)
    kind = "musllinux" if "musllinux" in tags else "manylinux"
    for name in re.findall(r"\(NEEDED\).*\[(.+)\]", text):
        faults.unless(bool(re.fullmatch(LIBRARIES[kind], name)), f"it loads {name}, which a {kind} may not have")
    needed = {tuple(map(int, number.split("."))) for number in re.findall(r"\bGLIBC_(\d+(?:\.\d+)+)", text)}
    newest = max(needed, default=(0, 0))
    promised = max((tuple(map(int, pair)) for pair in re.findall(r"manylinux_(\d+)_(\d+)", tags)), default=(0, 0))
    if kind == "manylinux":
        faults.unless(newest[:2] <= promised, f"it needs glibc {newest}, its name says {promised}")
    else:
        faults.unless(not needed, f"it needs glibc {newest}")
    symbols = re.findall(r"^ *\d+: \S+ +\d+ (\w+) +(\w+) +\w+ +(\S+) (\S+)", text, re.MULTILINE)
    exported = {name.split("@")[0] for _, bind, place, name in symbols if place != "UND" and bind != "LOCAL"}
    faults.unless(exported == {"PyInit__core"}, f"it exports {sorted(exported)[:8]}")
    if "abi3" in tags:
        wanted = {name.split("@")[0] for _, _, place, name in symbols if place == "UND"}
        private = {name for name in wanted if name.startswith("_Py")} - PRIVATE
        faults.unless(not private, f"it needs {sorted(private)}, which a stable interface has not")
        faults.unless(any(name.startswith("Py") for name in wanted), "it needs nothing of Python")
    stack = re.search(r"GNU_STACK(?: +0x\w+){5} ([RWE ]{3})", text)
    faults.unless(stack is not None and "E" not in stack[1], "its stack may be executed")
    faults.unless("GNU_RELRO" in text and re.search(r"BIND_NOW|\bNOW\b", text) is not None, "it is not RELRO and NOW")
    faults.unless("TEXTREL" not in text, "its code is changed as it is loaded")
    libc = f"glibc {'.'.join(map(str, newest))}" if needed else "no glibc"
    return f"{libc}, {len(exported)} symbol exported"


def check(wheel: Path) -> Faults:
    """Check all of a wheel and say in a line what was seen."""
    faults, seen = Faults(), "its library was not looked at: no Linux wheel"
    size = wheel.stat().st_size / 1e6
    faults.unless(size <= LARGEST_WHEEL, f"it is {size:.1f} MB, more than {LARGEST_WHEEL}")
    with zipfile.ZipFile(wheel) as archive, tempfile.TemporaryDirectory(prefix="ipm_rs-") as folder:
        library = check_contents(archive, faults)
        check_metadata(archive, faults)
        unpacked = archive.getinfo(library).file_size / 1e6 if library else 0.0
        faults.unless(unpacked <= LARGEST_LIBRARY, f"its library is {unpacked:.1f} MB, more than {LARGEST_LIBRARY}")
        if library and "linux" in wheel.name:
            seen = check_linux(Path(archive.extract(library, folder)), wheel.stem.partition("-")[2], faults)
        files = len(archive.namelist())
    for fault in faults:
        print(f"{wheel.name}: {fault}", file=sys.stderr)
    print(f"{wheel.name}: {size:.1f} MB, library {unpacked:.1f} MB, {files} files, {seen}: {len(faults)} faults")
    return faults


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(f"usage: {sys.argv[0]} WHEEL ...")
    sys.exit(any([check(Path(name)) for name in sys.argv[1:]]))
