"""Run the Rust tests on CPUs that this one is not: `python scripts/test_emulated.py neon` or `... no-avx`.

`neon` cross-compiles them for aarch64 and runs them under qemu-aarch64. `no-avx` runs this machine's own test programs
under qemu-x86_64, as a CPU without AVX and as two with AVX2 but without AVX-512, so that detection and dispatch really
choose something else. Nothing is skipped: what is missing is named, with the package that brings it, and the exit
status is 1. For Debian and Ubuntu on x86-64.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

AARCH64 = "aarch64-unknown-linux-gnu"
LINKER = "aarch64-linux-gnu-gcc"

# What a CPU must be found to have, as the runner of tests/common/isas.rs reports it.
NEON = {"max": "scalar neon"}
X86_64 = {"Nehalem": "scalar", "Haswell": "scalar avx2", "EPYC": "scalar avx2"}

# Property tests try 256 cases each on a real CPU; emulated, arithmetic on vectors takes 20 to 60 times as long.
CASES = "64"


def cross_compiler() -> str | None:
    """Find a rustc that has the standard library for aarch64: the one on PATH, or Debian's.

    rustup brings it with `rustup target add aarch64-unknown-linux-gnu`; Debian's rustc-web lives in /usr/bin, where a
    rustup on PATH hides it.
    """
    for rustc in filter(None, [os.environ.get("RUSTC"), shutil.which("rustc"), "/usr/bin/rustc"]):
        question = [rustc, "--print", "target-libdir", "--target", AARCH64]
        try:
            answer = subprocess.run(question, capture_output=True, text=True, check=False)
        except OSError:
            continue
        if answer.returncode == 0 and list(Path(answer.stdout.strip()).glob("libstd-*.rlib")):
            return rustc
    return None


def static_libc() -> bool:
    """Whether the cross linker has a libc to link statically."""
    if not shutil.which(LINKER):
        return True  # the linker itself is what is missing
    answer = subprocess.run([LINKER, "-print-file-name=libc.a"], capture_output=True, text=True, check=True)
    return Path(answer.stdout.strip()).is_absolute()


def require(found: dict[str, object]) -> None:
    """Name the packages whose parts were not found, and stop."""
    missing = [package for package, part in found.items() if not part]
    if not missing:
        return
    print(f"missing: {' '.join(missing)}", file=sys.stderr)
    if any(package.endswith(":arm64") for package in missing):
        print("  sudo dpkg --add-architecture arm64", file=sys.stderr)
    print(f"  sudo apt-get update && sudo apt-get install {' '.join(missing)}", file=sys.stderr)
    raise SystemExit(1)


def run_tests(name: str, expected: str, arguments: list[str], environment: dict[str, str]) -> None:
    """Run all test programs on one CPU; stop at what fails, or did not run what this CPU is expected to have."""
    command = [os.environ.get("CARGO", "cargo"), "test", "--lib", "--tests", *arguments]
    if os.environ.get("CI"):
        command.append("--locked")
    started = time.monotonic()
    merged = {"PROPTEST_CASES": CASES, **os.environ, **environment}
    merged.pop("IPM_RS_ISA", None)  # what detection chooses is what is tested
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    process = subprocess.run(command, env=merged, text=True, check=False, **pipe)
    output = re.sub(r"^.*TCG doesn't support.*\n", "", process.stdout, flags=re.MULTILINE)
    passed = [int(count) for count in re.findall(r"^test result: ok\. (\d+) passed", output, re.MULTILINE)]
    reports = re.findall(r"instruction sets: run: (.*?); not run: (.*)", output)
    if process.returncode or not sum(passed) or not reports:
        print(output)
        raise SystemExit(f"{name}: cargo test ended with {process.returncode}")
    for run, not_run in reports:
        if run != expected:
            raise SystemExit(f"{name}: expected the instruction sets '{expected}', got '{run}' (not run: {not_run})")
    took = f"{time.monotonic() - started:.0f} s"
    print(f"{name}: {sum(passed)} tests in {len(passed)} programs passed; run: {run}; not run: {not_run}; {took}")


def neon() -> None:
    """Cross-compile and run on an aarch64."""
    if platform.machine() in ("aarch64", "arm64"):
        raise SystemExit("this is an aarch64: `make test-rust` runs the NEON kernels")
    rustc = cross_compiler()
    require(
        {
            "rustc-web": rustc or Path("/usr/bin/rustc").exists(),
            "libstd-rust-web-dev:arm64": rustc,
            "gcc-aarch64-linux-gnu": shutil.which(LINKER),
            "libc6-dev-arm64-cross": static_libc(),
            "qemu-user": shutil.which("qemu-aarch64"),
        }
    )
    assert rustc
    version = subprocess.run([rustc, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    print(f"compiler: {rustc}, {version}")
    variable = AARCH64.upper().replace("-", "_")
    environment = {
        "RUSTC": rustc,
        f"CARGO_TARGET_{variable}_LINKER": LINKER,
        # Static, because a dynamic program may meet the loader of one libc and the libc of another: with `qemu -L` and
        # libc6:arm64 both present, the first thread that was started never returned.
        f"CARGO_TARGET_{variable}_RUSTFLAGS": "-C target-feature=+crt-static",
    }
    # Its own directory: another compiler than the one of target/.
    arguments = ["--target", AARCH64, "--target-dir", "target/neon"]
    for cpu, expected in NEON.items():
        runner = {f"CARGO_TARGET_{variable}_RUNNER": f"qemu-aarch64 -cpu {cpu}"}
        run_tests(f"aarch64 {cpu}", expected, arguments, {**environment, **runner})


def no_avx() -> None:
    """Run this machine's test programs on older CPUs."""
    if platform.machine() != "x86_64":
        raise SystemExit(f"this needs an x86-64 machine, not {platform.machine()}")
    require({"qemu-user": shutil.which("qemu-x86_64")})
    for cpu, expected in X86_64.items():
        runner = {"CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER": f"qemu-x86_64 -cpu {cpu}"}
        run_tests(f"x86-64 {cpu}", expected, [], runner)


if __name__ == "__main__":
    modes = {"neon": neon, "no-avx": no_avx}
    if len(sys.argv) != 2 or sys.argv[1] not in modes:
        raise SystemExit(f"usage: {sys.argv[0]} {'|'.join(modes)}")
    os.chdir(Path(__file__).resolve().parent.parent)
    modes[sys.argv[1]]()
