"""The Rust tests under tools that see what tests do not: `python scripts/test_checked.py miri|asan|memcheck`.

`miri` interprets the tests of views, tables, threads and what is merged from rows, and stops at undefined behaviour;
it knows plain Rust only, so kernels of instruction sets are left to guard pages. `asan` runs all Rust tests under
AddressSanitizer. Both need a nightly Rust. `memcheck` runs them under valgrind's, which sees what is read before it was
written too, and knows AVX2 but not AVX-512. What is missing is named, with the command that brings it.
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

# What Miri interprets: parts of the names of unit tests, and those among them that take it minutes and show nothing
# more, as they try all numbers that there are.
MIRI = ["view::", "table::", "parallel::", "raster::tests::threads_and_batches", "mosaic::", "lut::derived"]
TOO_LONG = [
    "every_half_is_what_the_standard_says",
    "rounds_to_the_nearest_half",
    "what_cannot_be_had_is_an_error",
    "keys_grow_with_the_resolution",
    "weights_are_the_eighth_power",
]
# A test whose clock goes on while Miri works out what takes no time elsewhere.
CLOCKS = ["short_work_is_not_asked"]
# Clocks and variables of the system are needed; the pool is never freed, which is meant; crossbeam, under rayon,
# keeps to tree borrows and not to stacked ones. A logarithm is the same each time here, as on every machine: by itself
# Miri adds another error to each.
MIRIFLAGS = "-Zmiri-disable-isolation -Zmiri-ignore-leaks -Zmiri-tree-borrows -Zmiri-deterministic-floats"


def require(component: str, command: list[str]) -> None:
    """Stop where a tool of nightly is not there."""
    if subprocess.run(command, capture_output=True, check=False).returncode:
        brings = f"rustup toolchain install nightly --component {component}"
        raise SystemExit(f"missing: nightly Rust with {component}; {brings}")


def run(name: str, command: list[str], environment: dict[str, str], parts: list[str]) -> None:
    """Run tests, and fail where none of a part ran: modules are renamed, and lists of them are forgotten."""
    started = time.monotonic()
    process = subprocess.Popen(
        command, env={**os.environ, **environment}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert process.stdout is not None
    passed, names = 0, ""
    for line in process.stdout:
        print(line, end="", flush=True)
        if match := re.match(r"test result: ok\. (\d+) passed", line):
            passed += int(match[1])
        if line.startswith("test "):
            names += line
    if process.wait() or not passed:
        raise SystemExit(f"{name}: ended with {process.returncode} after {passed} tests")
    if missing := [part for part in parts if part not in names]:
        raise SystemExit(f"{name}: no test ran of {', '.join(missing)}; what has another name now?")
    print(f"{name}: {passed} passed, 0 failed; {time.monotonic() - started:.0f} s")


def miri() -> None:
    """Interpret the tests that need no instruction set."""
    require("miri,rust-src", ["cargo", "+nightly", "miri", "--version"])
    skipped = [part for name in TOO_LONG + CLOCKS for part in ("--skip", name)]
    command = ["cargo", "+nightly", "miri", "test", "--lib", "--", *MIRI, *skipped]
    environment = {"MIRIFLAGS": MIRIFLAGS, "PROPTEST_CASES": "4", "IPM_RS_NUM_THREADS": "3"}
    run("miri", command, {**environment, "CARGO_TARGET_DIR": "target/miri"}, MIRI)


def asan() -> None:
    """Run all under AddressSanitizer."""
    require("rustc", ["cargo", "+nightly", "--version"])
    target = f"{platform.machine()}-unknown-linux-gnu"
    command = ["cargo", "+nightly", "test", "--lib", "--tests", "--target", target]
    environment = {
        "RUSTFLAGS": "-Zsanitizer=address",
        "CARGO_TARGET_DIR": "target/asan",
        # the tests of guard pages say what was tried when a page was touched; the pool is never freed
        "ASAN_OPTIONS": "allow_user_segv_handler=1:detect_leaks=0:allocator_may_return_null=1",
        "PROPTEST_CASES": os.environ.get("PROPTEST_CASES", "32"),
    }
    run("asan", command, environment, [])


def memcheck() -> None:
    """Run all under valgrind."""
    if shutil.which("valgrind") is None:
        raise SystemExit("missing: valgrind; apt-get install valgrind")
    target = f"{platform.machine()}-unknown-linux-gnu"
    skipped = [part for name in CLOCKS for part in ("--skip", name)]
    command = ["cargo", "test", "--lib", "--tests", "--target", target, "--", *skipped]
    runner = f"CARGO_TARGET_{target.upper().replace('-', '_')}_RUNNER"
    environment = {
        runner: "valgrind --quiet --error-exitcode=99 --leak-check=no",
        "CARGO_TARGET_DIR": "target/memcheck",
        "PROPTEST_CASES": os.environ.get("PROPTEST_CASES", "2"),
    }
    run("memcheck", command, environment, [])


if __name__ == "__main__":
    modes = {"miri": miri, "asan": asan, "memcheck": memcheck}
    if len(sys.argv) != 2 or sys.argv[1] not in modes:
        raise SystemExit(f"usage: {sys.argv[0]} {'|'.join(modes)}")
    os.chdir(Path(__file__).resolve().parent.parent)
    modes[sys.argv[1]]()
