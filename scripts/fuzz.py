"""Run the fuzz targets of fuzz/, one after the other: `make fuzz SECONDS=60 TARGETS="tables lenses"`.

With a nightly Rust and cargo-fuzz they run under libFuzzer and AddressSanitizer, guided by coverage; what they learn
stays in fuzz/target/corpus. Without, the same targets run on any Rust under proptest. What ends a run is written to
fuzz/artifacts, and `cargo +nightly fuzz run --features libfuzzer TARGET FILE` repeats it.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FUZZ = ROOT / "fuzz"
# MB: tables whose header asks for much are refused within it.
MEMORY = 4096
# Seconds for one input, ten times what any should take with AddressSanitizer on a busy machine.
LONGEST = 20


def targets() -> list[str]:
    """Every target that there is."""
    return sorted(path.stem for path in (FUZZ / "fuzz_targets").glob("*.rs"))


def has_cargo_fuzz() -> bool:
    """Whether nightly and cargo-fuzz are here."""
    answer = subprocess.run(["cargo", "+nightly", "fuzz", "--version"], capture_output=True, check=False)
    return answer.returncode == 0


def run_guided(target: str, seconds: int) -> bool:
    """Run a target under libFuzzer; say how many inputs and how much was covered."""
    learned = FUZZ / "target/corpus" / target
    learned.mkdir(parents=True, exist_ok=True)
    command = ["cargo", "+nightly", "fuzz", "run", "--features", "libfuzzer", target, str(learned)]
    command += [str(FUZZ / "corpus" / target), "--", f"-max_total_time={seconds}", f"-timeout={LONGEST}"]
    command += [f"-rss_limit_mb={MEMORY}", "-max_len=2048", "-print_final_stats=1"]
    process = subprocess.run(
        command, cwd=ROOT, check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    )
    executions = re.search(r"stat::number_of_executed_units: +(\d+)", process.stdout)
    covered = re.findall(r"cov: (\d+)", process.stdout)
    if process.returncode or executions is None:
        print(process.stdout[-6000:])
        print(f"{target}: failed", flush=True)
        return False
    print(
        f"{target}: {int(executions[1]):,} inputs in {seconds} s, {covered[-1] if covered else 0} edges covered",
        flush=True,
    )
    return True


def run_stable(target: str, seconds: int) -> bool:
    """Run a target under proptest."""
    environment = {**os.environ, "FUZZ_SECONDS": str(seconds), "FUZZ_TARGET": target}
    command = ["cargo", "test", "--quiet", "--test", "stable", "--", "--nocapture"]
    return subprocess.run(command, cwd=FUZZ, env=environment, check=False).returncode == 0


def main() -> int:
    """Run all, also after one that failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", help=f"some of: {' '.join(targets())} (default: all)")
    parser.add_argument("--seconds", type=int, default=60, help="for each target (default: %(default)s)")
    parser.add_argument("--stable", action="store_true", help="under proptest, also where cargo-fuzz is")
    arguments = parser.parse_args()
    if unknown := set(arguments.targets) - set(targets()):
        parser.error(f"unknown: {' '.join(sorted(unknown))}")
    guided = not arguments.stable and has_cargo_fuzz()
    if not guided:
        print(
            "under proptest" + ("" if arguments.stable else ": no nightly Rust with cargo-fuzz was found"), flush=True
        )
    run = run_guided if guided else run_stable
    chosen = arguments.targets or targets()
    failed = [target for target in chosen if not run(target, arguments.seconds)]
    print(f"{len(chosen) - len(failed)} passed, {len(failed)} failed" + (f": {' '.join(failed)}" if failed else ""))
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
