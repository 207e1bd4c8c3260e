"""Time of the work alone, without what a process does once: compiling and loading machine code."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

_lock = threading.Lock()
_inside, _since, _before = 0, 0.0, 0.0  # threads that warm up, since when, and the seconds before


@contextmanager
def warming_up() -> Iterator[None]:
    """Count the time inside as warm-up, in each thread and at any depth, and no moment twice."""
    global _inside, _since, _before
    with _lock:
        if not _inside:
            _since = time.perf_counter()
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if not _inside:
                _before += time.perf_counter() - _since


class Moment(NamedTuple):
    """Readings of two clocks [s] that go in turn: one while some thread warms up, one otherwise."""

    work_s: float
    warm_up_s: float

    @classmethod
    def now(cls) -> Moment:
        """Read both clocks."""
        with _lock:
            now_s = time.perf_counter()
            # What was warmed up before, and what is being warmed up at this moment.
            warm_up_s = _before + (now_s - _since if _inside else 0.0)
        return cls(now_s - warm_up_s, warm_up_s)
