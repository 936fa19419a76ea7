"""Interleaved timing in one process."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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


@contextmanager
def collection_off() -> Iterator[None]:
    """Keep garbage collection out of what is timed."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def milliseconds(call: Callable[[], object]) -> float:
    """Time one call."""
    start = time.perf_counter_ns()
    call()
    return (time.perf_counter_ns() - start) / 1e6


def interleaved(calls: dict[str, Callable[[], object]], rounds: int, seconds: float) -> dict[str, Times]:
    """Time every call in turns, round after round.

    In a round each call runs twice untimed, so that it finds its own data in the caches and the previous library's
    threads at rest, and then four times timed. The order rotates. A call for which all rounds would take more than
    `seconds` drops out when it has used them, but not before three rounds. Garbage collection is off.
    """
    taken: dict[str, list[float]] = {name: [] for name in calls}
    spent = dict.fromkeys(calls, 0.0)
    names = list(calls)
    for call in calls.values():
        call()
    with collection_off():
        for number in range(rounds):
            for name in names[number % len(names) :] + names[: number % len(names)]:
                if number >= 3 and spent[name] > seconds * 1e3:
                    continue
                call = calls[name]
                for repeat in range(UNTIMED + 4):
                    elapsed = milliseconds(call)
                    spent[name] += elapsed
                    if repeat >= UNTIMED:
                        taken[name].append(elapsed)
    return {name: _summary(np.array(samples)) for name, samples in taken.items()}


def _summary(taken: np.ndarray) -> Times:
    median, p95 = np.percentile(taken, [50, 95])
    return Times(float(median), float(taken.min()), float(p95), len(taken))
