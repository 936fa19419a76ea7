"""Build a wheel from an sdist without a network, twice, and try it: `python scripts/build_offline.py SDIST`.

First, with the network: the crates of its lock file and the build system's wheels go into local folders. Then pip
builds from these alone, in a network namespace of its own where the system allows one, and again in another folder:
both wheels must be the same to the byte. The result is installed from local files and tried. `--profile dev` is five
times as fast and shows the same but for what optimisation does. Cargo and Python must be there.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import tarfile
import tempfile
import venv
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SMOKE = Path(__file__).with_name("smoke.py")


def run(command: list[str | Path], **options: Any) -> None:
    """Run a command and end with it where it fails."""
    print("+", *command, flush=True)
    if subprocess.run([str(part) for part in command], check=False, **options).returncode:
        raise SystemExit(f"failed: {' '.join(map(str, command))}")


def alone() -> list[str]:
    """Find what keeps a command from any network: a namespace of its own, where that may be made."""
    command = ["unshare", "--net", "--map-root-user"]
    try:
        allowed = subprocess.run([*command, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        allowed = False
    if not allowed:
        print("no network namespace may be made here: cargo and pip are told to stay offline, and trusted")
    return command if allowed else []


def fetch(source: Path, folder: Path, python: Path) -> dict[str, str]:
    """With the network, everything that the build needs; returns the environment that finds it."""
    vendored, wheels = folder / "crates", folder / "wheels"
    run(
        ["cargo", "vendor", "--quiet", "--locked", "--manifest-path", source / "Cargo.toml", vendored],
        stdout=subprocess.DEVNULL,
    )
    run([python, "-m", "pip", "download", "--quiet", "--dest", wheels, "maturin>=1.9.4,<2", "numpy"])
    home = folder / "cargo"
    home.mkdir()
    replaced = f'[source.crates-io]\nreplace-with = "vendored"\n\n[source.vendored]\ndirectory = "{vendored}"\n'
    (home / "config.toml").write_text(replaced)
    # paths of this machine are in messages of panics, if they are not replaced
    remap = f"--remap-path-prefix={vendored}=/crates --remap-path-prefix={folder}=/build"
    return {
        **os.environ,
        "CARGO_HOME": str(home),
        "CARGO_NET_OFFLINE": "true",
        "CARGO_ENCODED_RUSTFLAGS": remap.replace(" ", "\x1f"),
        "PIP_NO_INDEX": "1",
        "PIP_FIND_LINKS": str(wheels),
        "SOURCE_DATE_EPOCH": "1700000000",
    }


def main() -> None:
    """Build, compare, install, try."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sdist", type=lambda name: Path(name).resolve(strict=True))
    parser.add_argument("--profile", default="release", help="of cargo: release (default) or dev")
    parser.add_argument("--once", action="store_true", help="do not build a second time")
    arguments = parser.parse_args()
    guard = alone()
    with tempfile.TemporaryDirectory(prefix="ipm_rs-") as name:
        folder = Path(name)
        venv.create(folder / "venv", with_pip=True)
        python = folder / "venv/bin/python"
        digests = []
        environment = None
        for turn in range(1 if arguments.once else 2):
            # in one place: what a compiler makes depends on paths in ways that no option replaces all of
            source = folder / "source"
            shutil.rmtree(source, ignore_errors=True)
            with tarfile.open(arguments.sdist) as archive:
                archive.extractall(source, filter="data")
            (inner,) = source.iterdir()
            environment = environment or fetch(inner, folder, python)
            out = folder / f"built-{turn}"
            options = {
                **environment,
                "CARGO_TARGET_DIR": str(folder / "target"),
                "MATURIN_PEP517_ARGS": f"--profile {arguments.profile}",
            }
            run([*guard, python, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", out, inner], env=options)
            (wheel,) = out.glob("*.whl")
            digests.append(hashlib.sha256(wheel.read_bytes()).hexdigest())
            print(f"{wheel.name}: {digests[-1]}", flush=True)
            shutil.rmtree(folder / "target")
        if len(set(digests)) != 1:
            raise SystemExit("two builds of the same source differ")
        run([*guard, python, "-m", "pip", "install", "--quiet", wheel], env=environment)
        clean = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
        run([*guard, python, "-W", "error", shutil.copy(SMOKE, folder)], env=clean, cwd=folder)
    print(
        "1 passed, 0 failed"
        if arguments.once
        else "2 builds without a network, the same to the byte: 1 passed, 0 failed"
    )


if __name__ == "__main__":
    main()
