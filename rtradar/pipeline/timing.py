"""Wall-clock time of the stages of a run, and its memory."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar
from pathlib import Path

from rtradar.system.clock import Moment
from rtradar.trace.rays import rays_traced

_LINES = {
    "survey": "link budget",
    "room": "tracing the room",
    "pictures": "drawing pictures",
    "view": "body and paths to view",
    "report": "writing the report",
}
"""Stages that have a line of their own on a terminal. Echoes and maps have a progress bar."""

NOT_TO_CLOUD = ("spectrogram", "angle", "sources", "write", "pictures", "view", "report")
"""Stages of a run that the range-Doppler-time cloud does not need: other products, and files."""

_lines_shown: ContextVar[bool] = ContextVar("lines_shown", default=False)


@contextmanager
def lines_shown() -> Iterator[None]:
    """Show a line for each stage inside, if stderr is a terminal."""
    token = _lines_shown.set(True)
    try:
        yield
    finally:
        _lines_shown.reset(token)


@contextmanager
def stage_line(text: str) -> Iterator[None]:
    """Show what is done inside, and in the end how long it took, if `lines_shown`."""
    if not (_lines_shown.get() and sys.stderr is not None and sys.stderr.isatty()):
        yield
        return
    start = time.perf_counter()
    print(f"{text} ...", end="", file=sys.stderr, flush=True)
    try:
        yield
    except BaseException:
        print(file=sys.stderr)
        raise
    # A progress bar may have been here meanwhile.
    said = f"{text}: {time.perf_counter() - start:.1f} s"
    print(f"\r{said:60}", file=sys.stderr, flush=True)


def to_cloud_s(stages: Mapping[str, float], wall_s: float) -> float:
    """Return the time of a run from the motion to the range-Doppler-time cloud [s].

    Parameters
    ----------
    stages : mapping
        Time of each stage by its name [s].
    wall_s : float
        Time of the whole run, without compiling [s].

    Returns
    -------
    float
        Time of all stages but `NOT_TO_CLOUD` [s].
    """
    return wall_s - sum(stages.get(name, 0.0) for name in NOT_TO_CLOUD)


class Stages:
    """Wall-clock time [s] by the name of the stage, in ``seconds``, without that of warming up.

    ``begun`` is the moment at which they begin, ``rays`` how many rays were traced before.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.begun, self.rays = Moment.now(), rays_traced()

    @contextmanager
    def time(self, name: str) -> Iterator[None]:
        """Add the time spent inside to stage ``name``."""
        start = Moment.now().work_s
        try:
            with stage_line(_LINES[name]) if name in _LINES else nullcontext():
                yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + Moment.now().work_s - start


def forget_peak_memory() -> None:
    """Restart `peak_memory_mb` on Linux; elsewhere it stays that of the whole process."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # proc(5): resets the peak resident set size


def peak_memory_mb() -> float:
    """Return the peak resident size since `forget_peak_memory`, or so far [MB = 1e6 bytes]."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
