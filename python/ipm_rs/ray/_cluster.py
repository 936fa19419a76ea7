"""Ray itself: imported when it is needed, started where there is none."""

from __future__ import annotations

import contextlib
import importlib
import logging
import os
from collections.abc import Iterator
from types import ModuleType
from typing import Any

from ipm_rs._arguments import path_text
from ipm_rs.errors import ArgumentError, ArgumentTypeError, MissingExtraError

__all__ = ["connected", "pool", "require_ray", "resolved", "share", "whole"]


def require_ray() -> ModuleType:
    """Import ``ray`` and ``ray.data`` and return the first, or raise MissingExtraError where they are not installed."""
    try:
        importlib.import_module("ray.data")
        return importlib.import_module("ray")
    except ImportError as error:
        raise MissingExtraError(
            f"expected Ray Data, which shares work among machines, found none ({error}); install it with: pip install "
            '"ipm-rs[ray]"'
        ) from error


@contextlib.contextmanager
def connected(address: str | None) -> Iterator[ModuleType]:
    """Give Ray: that which runs in this process, or the cluster at `address`, or one of this machine's CPUs.

    What was started here is left again when the block ends.

    Raises
    ------
    ArgumentError
        There is no cluster at the address.
    MissingExtraError
        Ray is not installed.
    """
    ray = require_ray()
    if address is not None:
        address = path_text("address", address)
    if ray.is_initialized():
        if address is not None and address != "auto":
            raise ArgumentError(
                f"address: expected none, because this process uses a cluster already, got {address!r:.100}; leave it "
                "out, or call ray.shutdown() first"
            )
        yield ray
        return
    own = address == "local" or (address is None and "RAY_ADDRESS" not in os.environ)
    options = {"address": "local", "include_dashboard": False} if own else {"address": address}
    try:
        ray.init(**options, logging_level="ERROR", log_to_driver=False)
        logging.getLogger("ray.data").setLevel(logging.ERROR)
    except Exception as error:  # Ray raises plain ones too, such as of a machine too busy to start it in time
        raise ArgumentError(
            f"address: expected a Ray cluster, found none at {address or os.environ.get('RAY_ADDRESS')!r:.100} "
            f'({_first_line(error)}); start one with `ray start --head`, or give "local"'
        ) from error
    try:
        yield ray
    finally:
        ray.shutdown()


def pool(ray: ModuleType, workers: int | None) -> Any:
    """Return the strategy of so many actors, or of as many as there is work and room for."""
    if workers is None:
        return ray.data.ActorPoolStrategy(min_size=1)
    return ray.data.ActorPoolStrategy(size=whole("workers", workers, 1, 1_000_000))


def share(ray: ModuleType, workers: int | None) -> float:
    """Return what part of a CPU an actor asks for beside tasks that read, of which each asks for a whole one.

    Half of one: to decode a picture takes ten times as long as to warp it. Less where the machine would have no CPU
    left for reading, and everything would wait for ever.
    """
    count = 1 if workers is None else workers
    have = float(ray.cluster_resources().get("CPU", 0))
    if have == 0 or count * 0.5 <= have - 1 or (count * 0.5 > have and len(ray.nodes()) > 1):
        return 0.5  # there is room, or an autoscaler makes some
    return int(100 * max(0.0, have - 1) / count) / 100


def resolved(value: Any) -> Any:
    """Return what a reference of Ray leads to, or the value itself: Ray Data passes references on as they are."""
    return require_ray().get(value) if type(value).__name__ == "ObjectRef" else value


def whole(name: str, value: Any, low: int, high: int) -> int:
    """Return a whole number within bounds.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        It is another, or none.
    """
    if isinstance(value, bool) or not isinstance(value, int):
        raise ArgumentTypeError(f"{name}: expected a whole number, got {type(value).__name__}")
    if not low <= value <= high:
        raise ArgumentError(f"{name}: expected {low} to {high}, got {value}")
    return value


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
