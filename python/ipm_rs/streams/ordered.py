"""Work on several threads whose results come in order, with a bound on what is under way."""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

__all__ = ["cpus", "ordered"]


def cpus() -> int:
    """Return how many CPUs the process may use."""
    usable = getattr(os, "sched_getaffinity", None)
    return len(usable(0)) if usable else os.cpu_count() or 1


def ordered(items: Iterable[T], work: Callable[[T], R], jobs: int) -> Generator[tuple[T, Future[R]], None, None]:
    """Give each item and its finished future, in the order of the items.

    One thread takes the items, `jobs` others work on them, and the caller's own uses the results. At most ``jobs + 2``
    items are under way, so memory does not grow with their number. What `items` itself raises is raised here, after the
    results of those before it. Where the iterator is closed, work that has begun ends first, and none begins.
    """
    room, done = threading.Semaphore(jobs + 2), threading.Event()
    results: queue.SimpleQueue[tuple[T, Future[R]] | BaseException | None] = queue.SimpleQueue()
    pool = ThreadPoolExecutor(jobs, thread_name_prefix="ipm-rs-frame")

    def take() -> None:
        end: BaseException | None = None
        iterator = iter(items)
        try:
            while not done.is_set():
                room.acquire()
                if done.is_set():
                    break
                try:
                    item = next(iterator)
                except StopIteration:
                    break
                results.put((item, pool.submit(work, item)))
        except BaseException as error:  # raised again by the thread that waits
            end = error
        finally:
            close = getattr(iterator, "close", None)
            if close is not None:
                with contextlib.suppress(Exception):
                    close()
            results.put(end)

    reader = threading.Thread(target=take, name="ipm-rs-reader", daemon=True)
    reader.start()
    try:
        while True:
            found = results.get()
            if found is None:
                return
            if isinstance(found, BaseException):
                raise found
            item, future = found
            # waited for here, so that the caller's thread, which signals reach, is the one that can be interrupted
            future.exception()
            yield item, future
            room.release()
    finally:
        done.set()
        room.release()
        reader.join()
        pool.shutdown(wait=True, cancel_futures=True)
