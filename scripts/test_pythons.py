"""Try a wheel in every Python 3.10+ of this machine: `python scripts/test_pythons.py dist/ipm_rs-....whl`.

Each interpreter gets a throw-away virtual environment that holds the wheel, NumPy and nothing else, and runs
`smoke.py` there with warnings as errors. The oldest interpreter runs it a second time with the oldest NumPy that
the wheel admits.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

MINORS = range(10, 20)
SMOKE = Path(__file__).with_name("smoke.py")


def interpreters() -> dict[tuple[int, int], str]:
    """Find one CPython per minor version: on PATH, or among the versions that pyenv keeps."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found: dict[tuple[int, int], str] = {}
    candidates = [shutil.which(f"python3.{minor}") for minor in MINORS]
    candidates += [sys.executable, *map(str, sorted(pyenv.glob("3.*/bin/python")))]
    question = "import sys; print(sys.implementation.name, *sys.version_info[:2])"
    for candidate in filter(None, candidates):
        # A pyenv shim exists for every version and fails for those that are not selected.
        answer = subprocess.run([candidate, "-c", question], capture_output=True, text=True, check=False)
        match = re.fullmatch(r"cpython 3 (\d+)\s*", answer.stdout)
        if match and int(match[1]) in MINORS:
            found.setdefault((3, int(match[1])), candidate)
    return dict(sorted(found.items()))


def oldest_numpy(wheel: Path) -> str:
    """Read the lower bound of NumPy from the wheel's metadata."""
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        match = re.search(r"^Requires-Dist: numpy>=(\S+)$", archive.read(name).decode(), re.MULTILINE)
    if match is None:
        raise SystemExit(f"{wheel}: no 'Requires-Dist: numpy>=...' in its metadata")
    return match[1]


def smoke(python: str, wheel: Path, *requirements: str) -> str:
    """Install the wheel into a new environment, check that NumPy is its only company, and run the smoke script."""
    with tempfile.TemporaryDirectory(prefix="ipm_rs-") as folder:
        subprocess.run([python, "-m", "venv", folder], check=True)
        inner = next(
            str(path) for path in (Path(folder, "bin/python"), Path(folder, "Scripts/python.exe")) if path.exists()
        )
        pip = [inner, "-m", "pip", "--disable-pip-version-check"]
        # `--only-binary`: a NumPy that has no wheel for this interpreter is a missing case, not a C build.
        subprocess.run([*pip, "install", "--quiet", "--only-binary=numpy", str(wheel), *requirements], check=True)
        listed = subprocess.run([*pip, "list", "--format=freeze"], capture_output=True, text=True, check=True).stdout
        packages = {line.split("==")[0].lower() for line in listed.split()} - {"pip", "setuptools", "wheel"}
        if packages != {"ipm-rs", "numpy"}:
            raise SystemExit(f"expected ipm-rs and numpy alone, found {sorted(packages)}")
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
        script = shutil.copy(SMOKE, folder)
        run = [inner, "-W", "error", script]
        return subprocess.run(
            run, capture_output=True, text=True, check=True, cwd=folder, env=environment
        ).stdout.strip()


def main() -> None:
    """Run every case and print one line for each; the first failure ends the run."""
    wheel = Path(sys.argv[1]).resolve(strict=True)
    found = interpreters()
    if not found:
        raise SystemExit("no CPython 3.10 or newer was found")
    oldest, *_ = found.values()
    for python, requirements in [
        *((python, ()) for python in found.values()),
        (oldest, (f"numpy=={oldest_numpy(wheel)}.*",)),
    ]:
        try:
            print(smoke(python, wheel, *requirements), flush=True)
        except subprocess.CalledProcessError as error:
            raise SystemExit(f"{python}: {error}\n{error.stdout or ''}{error.stderr or ''}") from None
    absent = [f"3.{minor}" for minor in range(10, 16) if (3, minor) not in found]
    print(f"{len(found) + 1} passed, 0 failed" + (f" (not found here: {', '.join(absent)})" if absent else ""))


if __name__ == "__main__":
    main()
