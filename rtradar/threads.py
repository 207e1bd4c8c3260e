"""Threads that stay: to start some for every call costs as much as a short call's work."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

THREADS_VARIABLE = "RTRADAR_THREADS"
"""Environment variable that limits the threads of this process, where it shares the cores with others of its kind."""

_Result = TypeVar("_Result")


def thread_limit() -> int | None:
    """Threads this process may use, where the environment says so."""
    named = os.environ.get(THREADS_VARIABLE, "")
    return int(named) if named.isdigit() and int(named) > 0 else None


def thread_count() -> int:
    """Threads that `in_threads` has: as many as this process may use."""
    return thread_limit() or os.cpu_count() or 1


def environment_of(threads: int) -> dict[str, str]:
    """Environment that holds a new process to that many threads: ours, those of compiled loops, and of linear algebra."""
    own = THREADS_VARIABLE, "NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
    return dict.fromkeys(own, str(threads))


def in_threads(work: Callable[[int], _Result], items: range) -> list[_Result]:
    """Results in the order of the items; NumPy, the FFT and compiled loops release the interpreter lock, so threads do pay.

    ``work`` must not call this itself: it would wait for threads that wait for it.
    """
    if len(items) < 2:
        return [work(item) for item in items]
    return list(_pool().map(work, items))


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(thread_count(), thread_name_prefix="rtradar")


# Threads do not follow into a forked process: there they are started anew.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)
