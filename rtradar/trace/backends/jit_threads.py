"""Threads of Dr.Jit in this process: one, until many rays come at once, and none is taken away again.

Its threads wait for work awake, 20 ms each time, on cores on which ours have other work: of few rays that costs more than it
saves. To take them away meanwhile is no way out. Dr.Jit 1.5.0 tells a thread to stop, then looks whether it sleeps, without a
fence in between; one that falls asleep in that moment is told by nobody, and `set_thread_count` waits for it for ever.
"""

from __future__ import annotations

import threading
from typing import Any

from rtradar.system.threads import thread_count

MANY_RAYS = 1 << 16
"""At once, from which on all cores share them."""

_ONE_AT_A_TIME = threading.Lock()


def begin_with_one() -> None:
    """Give Dr.Jit one thread: to be called before it computes anything, while it has none yet to take away."""
    import drjit as dr

    dr.set_thread_count(1)


def grow_for(mi: Any, rays: int) -> None:
    """Give Dr.Jit as many threads as this process may use, if that many rays are to be traced with Mitsuba ``mi``."""
    if rays < MANY_RAYS or not mi.variant().startswith("llvm"):
        return
    import drjit as dr

    with _ONE_AT_A_TIME:
        if dr.thread_count() < thread_count():
            dr.set_thread_count(thread_count())
