"""Ctrl-C and SIGTERM end the process at once, in one line, with no half-written file and no child.

A KeyboardInterrupt would be raised wherever the main thread is. In callbacks of compilers and
tracers that gives crashes, hangs and swallowed interrupts, and in long compiled loops it comes too
late. So a thread waits for the signal, removes unfinished files (`rtradar.system.files`) and ends
the process. It needs the interpreter lock, which tracers and compiled loops release.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing import resource_tracker
from pathlib import Path

_SIGNALS = {
    "SIGINT": "stopped by the user",
    "SIGTERM": "ended by SIGTERM",
    "SIGHUP": "its terminal was closed",
}
_KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
INTERRUPTED = 128 + signal.SIGINT
"""Exit status after Ctrl-C, as shells have it."""
_PATIENCE_S = 0.5  # until killed children are gone
_ended = threading.Event()


def end_well(message: Callable[[], str]) -> None:
    """Handle signals that ask this process to end; call it once, in the main thread.

    Parameters
    ----------
    message : callable
        Function that returns what the user should know then, in a few words.
    """
    # Python's handler of signals writes to this pipe at once, whatever the main thread is doing. A
    # thread waits at the other end.
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    for name in _SIGNALS:
        number = getattr(signal, name, None)
        # nohup and "&" have signals ignored.
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: None)
    threading.Thread(
        target=_wait, args=(reader, message), name="rtradar-ending", daemon=True
    ).start()


def stay_if_ending() -> None:
    """Wait for the end of the process if it is near; results no longer matter."""
    if _ended.is_set():
        threading.Event().wait()


def _wait(reader: int, message: Callable[[], str]) -> None:
    number = signal.Signals(os.read(reader, 1)[0])
    _ended.set()
    terminal = "\n" if sys.stderr and sys.stderr.isatty() else ""
    stderr = -1  # where there is none
    with contextlib.suppress(OSError):
        stderr = os.dup(2)
        # Threads that miss a killed worker, and a worker that starts while its parent ends, would
        # print tracebacks.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    _end_children()
    # Not imported here: it takes a quarter of a second, in which a signal would show a traceback.
    # Where nothing has imported it, there is no unfinished file.
    getattr(sys.modules.get("rtradar.system.files"), "discard_unfinished", _nothing)()
    line = f"rtradar: {_SIGNALS.get(number.name, number.name)}; {' '.join(message().split())}\n"
    # In a thread, because the main thread may be writing.
    flushed = threading.Thread(target=sys.stdout.flush, daemon=True)
    flushed.start()
    flushed.join(0.2)
    with contextlib.suppress(OSError):
        os.write(stderr, (terminal + line).encode(errors="replace"))
    os._exit(INTERRUPTED if number == signal.SIGINT else 1)


def _nothing() -> None:
    pass


def _end_children() -> None:
    """Kill the processes that this one started, and theirs, and wait until they are gone."""
    # The resource tracker of multiprocessing removes semaphores when all other processes are gone.
    spared = {getattr(resource_tracker._resource_tracker, "_pid", None)}
    until = time.monotonic() + _PATIENCE_S
    killed: set[int] = set()
    # Repeated, because threads may start others.
    while (children := _descendants() - spared) - killed and time.monotonic() < until:
        for child in children:
            with contextlib.suppress(OSError):
                os.kill(child, _KILL)
        killed |= children
        time.sleep(0.01)
    while killed & _descendants() and time.monotonic() < until:
        time.sleep(0.01)


def _descendants() -> set[int]:
    """Return the running processes that descend from this one."""
    parents = {}
    # Fields follow the last closing parenthesis, because the name in parentheses may hold anything.
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            fields = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
            # The first thread of a killed process may be dead while another still writes a file.
            if fields[0] != "Z" or int(fields[17]) > 1:
                parents[int(stat.parent.name)] = int(fields[1])
    if not parents:  # a system without /proc
        return {child.pid for child in multiprocessing.active_children() if child.pid}
    # Each round adds the children of those that the last one found.
    found: set[int] = set()
    newly = {os.getpid()}
    while newly:
        newly = {child for child, parent in parents.items() if parent in newly} - found
        found |= newly
    return found
