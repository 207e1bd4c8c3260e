"""Seconds and memory of a run, stage by stage."""

from __future__ import annotations

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
