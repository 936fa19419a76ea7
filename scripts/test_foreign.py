"""Try a wheel in a Python of another system: `python scripts/test_foreign.py --root ROOT --python ... WHEEL NUMPY`.

For wheels that this machine's own interpreters cannot load. ROOT is a folder with another system's files: packages of
Debian for arm64 or of a newer release, unpacked by `dpkg -x`, or what musl's compiler made. `--emulator qemu-aarch64`
runs it as another CPU; `--chroot` runs it inside of its folder, with its own C library. No installer is needed there:
the wheels, this one and NumPy's, are unpacked to where that Python looks for packages, in a copy that is thrown away.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SMOKE = Path(__file__).with_name("smoke.py")
# Commands of the package are started by sys.executable, which is not one that this machine can start by itself.
INSTALL = """
import os, sys, sysconfig, zipfile
site = sysconfig.get_path("purelib")
os.makedirs(site, exist_ok=True)
for wheel in sys.argv[2:]:
    zipfile.ZipFile(wheel).extractall(site)
with open(os.path.join(site, "sitecustomize.py"), "w") as file:
    file.write(f"import sys\\nsys.executable = {sys.argv[1]!r}\\n")
print(site)
"""


def main() -> int:
    """Copy the root, install, run the smoke script."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheels", nargs="+", type=lambda name: Path(name).resolve(strict=True))
    parser.add_argument("--root", required=True, type=lambda name: Path(name).resolve(strict=True))
    parser.add_argument("--python", required=True, help="the interpreter, as it is called inside of the root")
    parser.add_argument("--emulator", help="qemu-aarch64, for one")
    parser.add_argument("--chroot", action="store_true", help="run inside of the root")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="ipm_rs-") as name:
        root = Path(name) / "root"
        shutil.copytree(arguments.root, root, symlinks=True)
        inside = root / "files"
        inside.mkdir()
        files = [shutil.copy(path, inside) for path in (SMOKE, *arguments.wheels)]
        python = root / arguments.python.lstrip("/")
        if arguments.chroot:
            command = ["chroot", str(root), arguments.python]
            files = [f"/files/{Path(path).name}" for path in files]
            executable = arguments.python
        else:
            command = [arguments.emulator, "-L", str(root), str(python)] if arguments.emulator else [str(python)]
            executable = str(root / "start")
            Path(executable).write_text(f'#!/bin/sh\nexec {" ".join(command)} "$@"\n')
            Path(executable).chmod(0o755)
        smoke, *wheels = files
        subprocess.run([*command, "-c", INSTALL, executable, *wheels], check=True)
        return subprocess.run([*command, "-W", "error", smoke], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
