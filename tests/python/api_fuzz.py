"""The API fuzzer: calls every public name with right arguments, of which one or two are spoiled.

    python api_fuzz.py [--seed 0] [--calls 100000]        # runs, and tells what it found; exit status 1 if anything
    python api_fuzz.py --seed 0 --call 1234               # one call again, in this process, with its traceback

A call must return, or raise an error of ours or a TypeError of argument binding. What an argument raises must come out
as an error of ours, an interrupt as it is. Calls run in a child process, so that a crash or a hang comes with its call.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import gc
import json
import os
import pathlib
import random
import re
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from functools import partial
from typing import Any

SLOWEST_S = 5.0
"""More CPU time than this, or five times as much wall time, is no answer."""
MEMORY = 3 << 30
"""Bytes of address space that a child may have beyond those it starts with: absurd sizes must be refused."""
GROWTH = 64 << 20
"""Bytes that a child may grow by between its first fifth and its end."""
BINDING = re.compile(r"positional argument|keyword argument|required argument|unexpected|missing \d|multiple values")


class Caller:
    """Makes calls, each from its number and the seed alone."""

    def __init__(self, seed: int, folder: pathlib.Path) -> None:
        import api_values

        self.seed, self.folder, self.values = seed, folder, api_values
        api_values.write_files(folder)
        self.names = sorted(api_values.names().items())

    def make(self, number: int) -> tuple[str, Any, dict[str, Any]]:
        """Name, function and arguments of a call; what is spoiled is in the name."""
        import numpy as np
        from api_hostile import mutated, mutated_count

        rng = random.Random(f"{self.seed} {number}")
        name, recipe = rng.choice(self.names)
        function, arguments = recipe(self.values.Values(rng, self.folder))
        for _ in range(rng.choice([0, 1, 1, 1, 1, 2, 2, 3]) if arguments else 0):
            key = rng.choice(list(arguments))
            others = [value for other, value in arguments.items() if other != key and isinstance(value, np.ndarray)]
            spoil = partial(mutated_count, rng) if key in ("threads", "n") else partial(mutated, rng, arguments[key])
            try:
                what, arguments[key] = spoil(others)
            except Exception:  # NumPy does not make everything of everything that was spoiled already
                continue
            name += f", {key}: {what}"
        return name, function, arguments

    def problem(self, number: int) -> str | None:
        """What is wrong with a call, None if nothing is."""
        import api_hostile

        name, function, arguments = self.make(number)
        api_hostile.interrupts.clear()
        raised: BaseException | None = None
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                function(**arguments)
        except BaseException as error:
            raised = error
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        wrong = complaint(name, raised) if raised else None
        if not wrong and api_hostile.interrupts and not isinstance(raised, tuple(api_hostile.interrupts)):
            wrong = f"swallowed {api_hostile.interrupts[0].__name__}, raised {raised!r:.200}"
        if cpu > SLOWEST_S or wall > 5 * SLOWEST_S:
            wrong = f"{wrong or ''} took {wall:.1f} s, {cpu:.1f} s of CPU"
        return f"{name}: {wrong}" if wrong else None


def complaint(name: str, error: BaseException) -> str | None:
    """What is wrong with an exception, None if it is right."""
    from api_hostile import MARK, PASSED

    from ipm_rs.errors import IpmError

    if isinstance(error, IpmError):
        return None
    if isinstance(error, PASSED) and error.args == (MARK,):
        return None
    if isinstance(error, MemoryError) and (not error.args or str(error).startswith("Unable to allocate")):
        return None  # Python's, of a sequence that lies about its length; NumPy's, of a list of huge arrays
    is_binding = isinstance(error, TypeError) and BINDING.search(str(error)) and not error.__cause__
    is_builtin = name.startswith(("pickle", "Layers"))  # Python's own, not ours
    if is_binding or is_builtin:
        return None
    where = "".join(traceback.format_tb(error.__traceback__)[-2:]).strip().replace("\n", " | ")
    return f"raised {type(error).__name__}: {str(error)[:200]!r} at {where[-300:]}"


def child(seed: int, start: int, calls: int, progress: str) -> None:
    """Make calls, in a folder of its own; the number of the running one is in the file `progress`."""
    with tempfile.TemporaryDirectory() as folder, pathlib.Path(progress).open("r+b", buffering=0) as file:
        os.chdir(folder)
        caller = Caller(seed, pathlib.Path(folder))
        used = int(pathlib.Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, resource.RLIM_INFINITY))
        grown_from = 0
        for number in range(start, calls):
            os.pwrite(file.fileno(), struct.pack("q", number), 0)
            if number == start + max((calls - start) // 5, 2000):
                grown_from = resident()
            if problem := caller.problem(number):
                print(json.dumps({"seed": seed, "call": number, "problem": problem}), flush=True)
            sys.exc_info()
        if grown_from and (grown := resident() - grown_from) > GROWTH:
            problem = f"memory grew by {grown >> 20} MB over {calls - start} calls"
            print(json.dumps({"seed": seed, "call": calls, "problem": problem}), flush=True)
        os.chdir("/")


def resident() -> int:
    """Bytes of memory in use, without what waits for the garbage collector or in the allocator."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def run(
    seed: int, calls: int, *, seconds: float | None = None, script: str = __file__
) -> tuple[int, list[dict[str, Any]]]:
    """Make calls in children; how many were made, and what was wrong with which."""
    problems: list[dict[str, Any]] = []
    start, end = 0, None if seconds is None else time.monotonic() + seconds
    while start < calls:
        with tempfile.NamedTemporaryFile() as progress:
            progress.write(struct.pack("q", start))
            progress.flush()
            command = [sys.executable, script, "--child", f"{seed},{start},{calls},{progress.name}"]
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
                ended = watched(process, progress.name, end)
                said, erred = process.communicate()
            problems += [json.loads(line) for line in said.splitlines() if line.startswith("{")]
            start = struct.unpack("q", pathlib.Path(progress.name).read_bytes())[0] + 1
        if ended == "time is over":
            return start, problems
        if process.returncode != 0:
            why = ended or (
                signal.Signals(-process.returncode).name
                if process.returncode < 0
                else f"exit status {process.returncode}"
            )
            problems.append({"seed": seed, "call": start - 1, "problem": f"{why}: {erred.strip()[-500:]}"})
    return calls, problems


def watched(process: subprocess.Popen[str], progress: str, end: float | None) -> str | None:
    """Wait for a child; kill it where one call takes a minute, or where the time is over. Says which."""
    last, since = b"", time.monotonic()
    while process.poll() is None:
        time.sleep(0.05)
        now, at = time.monotonic(), pathlib.Path(progress).read_bytes()
        if at != last:
            last, since = at, now
        reason = "time is over" if end and now > end else "did not return within a minute" if now > since + 60 else None
        if reason:
            process.kill()
            return reason
    return None


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--calls", type=int, default=100_000)
    parser.add_argument("--call", type=int, help="only this one, in this process")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        seed, start, calls, progress = options.child.split(",")
        child(int(seed), int(start), int(calls), progress)
        return 0
    if options.call is not None:
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            name, function, arguments = Caller(options.seed, pathlib.Path(folder)).make(options.call)
            print(name, function, arguments, sep="\n")
            print(function(**arguments))
            os.chdir("/")
        return 0
    began = time.monotonic()
    made, problems = run(options.seed, options.calls)
    for problem in problems:
        print(problem["seed"], problem["call"], problem["problem"])
    print(f"seed {options.seed}: {made} calls in {time.monotonic() - began:.0f} s, {len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
