"""Interleaved timing in one process."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

UNTIMED = 2
"""Calls before the timed ones: after one, a warp of 0.17 ms still took 15 % longer than after two."""


@dataclass(frozen=True)
class Times:
    """Milliseconds per call."""

    median: float
    minimum: float
    p95: float
    calls: int

    as_dict = asdict


def interleaved(calls: dict[str, Callable[[], object]], rounds: int, seconds: float) -> dict[str, Times]:
    """Time every call in turns, round after round.

    In a round each call runs twice untimed, so that it finds its own data in the caches and the previous library's
    threads at rest, and then four times timed. The order rotates. A call for which all rounds would take more than
    `seconds` drops out when it has used them, but not before three rounds. Garbage collection is off.
    """
    taken: dict[str, list[int]] = {name: [] for name in calls}
    spent = dict.fromkeys(calls, 0)
    names = list(calls)
    for call in calls.values():
        call()
    collecting = gc.isenabled()
    gc.disable()
    try:
        for number in range(rounds):
            for name in names[number % len(names) :] + names[: number % len(names)]:
                if number >= 3 and spent[name] > seconds * 1e9:
                    continue
                call = calls[name]
                for repeat in range(UNTIMED + 4):
                    start = time.perf_counter_ns()
                    call()
                    elapsed = time.perf_counter_ns() - start
                    spent[name] += elapsed
                    if repeat >= UNTIMED:
                        taken[name].append(elapsed)
    finally:
        if collecting:
            gc.enable()
    return {name: _summary(np.array(samples) / 1e6) for name, samples in taken.items()}


def _summary(milliseconds: np.ndarray) -> Times:
    median, p95 = np.percentile(milliseconds, [50, 95])
    return Times(float(median), float(milliseconds.min()), float(p95), len(milliseconds))
