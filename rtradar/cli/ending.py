"""Ctrl-C and SIGTERM: the process ends at once, in one line, with nothing half-written and no process of its own left.

A KeyboardInterrupt would be raised wherever the main thread is. In the callbacks of compilers and tracers that gives crashes,
hangs and swallowed interrupts, and in long compiled loops it comes too late. So a thread waits for the signal instead, takes away
what is unfinished (`rtradar.system.files`), and ends the process. It needs the interpreter's lock for that, which tracers,
compiled loops and linear algebra release.
"""

from __future__ import annotations

import contextlib
import multiprocessing.util
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing import resource_tracker
from pathlib import Path

from rtradar.system.files import discard_unfinished

_SIGNALS = {
    "SIGINT": "stopped by the user",
    "SIGTERM": "ended by SIGTERM",
    "SIGHUP": "its terminal was closed",
}
_KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
_PATIENCE_S = 0.5
"""Waited, at the end, until children are gone."""
_ended = threading.Event()


def end_well(told: Callable[[], str]) -> None:
    """From now on a signal that asks this process to end does so well; to be called once, in the main thread.

    Parameters
    ----------
    told : callable
        What the user should know then, in a few words.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    for name in _SIGNALS:
        number = getattr(signal, name, None)
        if (
            number is not None and signal.getsignal(number) is not signal.SIG_IGN
        ):  # as nohup and "&" ask for
            signal.signal(number, lambda *_: None)
    threading.Thread(target=_wait, args=(reader, told), name="rtradar-ending", daemon=True).start()


def stay_if_ending() -> None:
    """Where the process is about to end, wait for it: what the main thread finds out meanwhile is of no interest."""
    if _ended.is_set():
        threading.Event().wait()


def _wait(reader: int, told: Callable[[], str]) -> None:
    number = signal.Signals(os.read(reader, 1)[0])
    _ended.set()
    _end_children()
    discard_unfinished()
    line = f"rtradar: {_SIGNALS.get(number.name, number.name)}; {' '.join(told().split())}\n"
    flushed = threading.Thread(
        target=sys.stdout.flush, daemon=True
    )  # the main thread may be in the midst of writing
    flushed.start()
    flushed.join(0.2)
    with contextlib.suppress(OSError, ValueError):
        os.write(2, ("\n" if sys.stderr.isatty() else "").encode() + line.encode(errors="replace"))
    os._exit(1)


def _end_children() -> None:
    """Kill the processes that this one started, and theirs, and wait a little until they are gone."""
    # One of them keeps account of semaphores, and takes them away when all others are gone. The main thread, which clears up
    # after workers that are no more, must not tell it of that, too.
    tracker = resource_tracker._resource_tracker
    tracker._send = lambda *_: None  # type: ignore[attr-defined]
    # No more of Python's own: one that starts as this process goes would say that it is told nothing.
    multiprocessing.util.spawnv_passfds = lambda *_: threading.Event().wait()
    spared = {getattr(tracker, "_pid", None)}
    until = time.monotonic() + _PATIENCE_S
    killed: set[int] = set()
    # Again, for others may be starting some by other ways.
    while (
        children := (
            _descendants()
            or {child.pid for child in multiprocessing.active_children() if child.pid}
        )
        - spared
    ) - killed:
        for child in children:
            with contextlib.suppress(OSError):
                os.kill(child, _KILL)
        killed |= children
        time.sleep(0.01)
    while killed & _descendants() and time.monotonic() < until:
        time.sleep(0.01)


def _descendants() -> set[int]:
    """Of this process, those that run; empty where the system has no /proc."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            fields = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
            # Of one that is killed the first thread may be dead while another still makes a file.
            if fields[0] != "Z" or int(fields[17]) > 1:
                parents[int(stat.parent.name)] = int(fields[1])
    found: set[int] = set()
    newly = {os.getpid()}
    while newly:
        newly = {child for child, parent in parents.items() if parent in newly} - found
        found |= newly
    return found
