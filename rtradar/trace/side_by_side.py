"""Work that traces a little in between, many items at once."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rtradar.threads import in_threads, thread_count

ONE_AT_A_TIME = threading.Lock()
"""Held by whoever traces in such work, and while Dr.Jit's threads are changed."""

_Result = TypeVar("_Result")


def in_tracing_threads(work: Callable[[int], _Result], items: range) -> list[_Result]:
    """`in_threads` for work that traces; Dr.Jit has one thread meanwhile.

    After every few rays its threads wait for more without sleeping, on cores on which ours have other work.
    """
    if len(items) < 2 or thread_count() < 2:
        return [work(item) for item in items]
    with _one_thread():
        return in_threads(work, items)


_before: list[int] = []
"""Threads of Dr.Jit at each entry; who leaves last gives back what the first one found."""


@contextmanager
def _one_thread() -> Iterator[None]:
    if "drjit" not in sys.modules:
        yield
        return
    import drjit as dr

    with ONE_AT_A_TIME:
        _before.append(dr.thread_count())
        dr.set_thread_count(1)
    try:
        yield
    finally:
        with ONE_AT_A_TIME:
            dr.set_thread_count(_before.pop())
