"""Seconds and memory of a run, stage by stage."""

from __future__ import annotations

import ctypes
import platform
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


class Stages:
    """Wall-clock seconds by the name of the stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def rounded(self) -> dict[str, float]:
        """The same in whole tenths of a millisecond."""
        return {name: round(seconds, 4) for name, seconds in self.seconds.items()}

    @contextmanager
    def time(self, name: str) -> Iterator[None]:
        """Add the time spent inside to stage ``name``."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # malloc.h of the GNU C library
_HEAP_BYTES = 1 << 24


def keep_memory_low() -> None:
    """Ask the GNU C library for one heap, and to give back at once what large arrays took; elsewhere nothing happens.

    Each thread that starts may else get a heap of its own, which keeps what was freed in it, and the size from which an array
    is given back to the system grows with what was freed before. Then memory depends on how threads fell in with each
    other, and creeps for seconds. Smaller arrays stay in the heap: the blocks of a run use the same memory again, and the
    system need not clear new pages for each. Holds for the process, for good.
    """
    library = _gnu_c_library()
    if library is not None:
        for option, value in (
            (_M_ARENA_MAX, 1),
            (_M_MMAP_THRESHOLD, _HEAP_BYTES),
            (_M_TRIM_THRESHOLD, 2 * _HEAP_BYTES),
        ):
            library.mallopt(option, value)


def give_back_memory() -> None:
    """Let the GNU C library give back all that is free in its heap; elsewhere nothing happens. Takes milliseconds."""
    library = _gnu_c_library()
    if library is not None:
        library.malloc_trim(0)


def _gnu_c_library() -> ctypes.CDLL | None:
    return ctypes.CDLL(None) if platform.libc_ver()[0] == "glibc" else None


def forget_peak_memory() -> None:
    """Let `peak_memory_mb` begin anew, where the system can: Linux does, elsewhere it stays that of the process."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # proc(5): resets the peak resident set size


def peak_memory_mb() -> float:
    """Largest resident size of this process since `forget_peak_memory`, or so far [MB = 1e6 bytes]."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
