"""Threads of Dr.Jit in this process: one, until many rays come at once, and none is taken away.

Its threads wait for work awake, 20 ms each time, on cores on which ours have other work: for few
rays that costs more than it saves. To take them away again is not possible. Dr.Jit 1.5.0 tells a
thread to stop and then looks whether it sleeps, without a fence in between. One that falls asleep
in that moment gets no message, and `set_thread_count` waits for it for ever.
"""

from __future__ import annotations

import threading
from typing import Any

from rtradar.system.threads import thread_count

MANY_RAYS = 1 << 16
"""Least number of rays traced at once that all cores share."""

_ONE_AT_A_TIME = threading.Lock()


def begin_with_one() -> None:
    """Give Dr.Jit one thread; call it before Dr.Jit computes anything and has others."""
    import drjit as dr

    dr.set_thread_count(1)


def grow_for(mi: Any, rays: int) -> None:
    """Give Dr.Jit all threads that this process may use, if so many rays are to be traced."""
    if rays < MANY_RAYS or not mi.variant().startswith("llvm"):
        return
    import drjit as dr

    with _ONE_AT_A_TIME:
        if dr.thread_count() < thread_count():
            dr.set_thread_count(thread_count())
