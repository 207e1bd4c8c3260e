"""How Numba compiles loops: on first use, kept on disk for every later one, and no slower than need be."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numba.core import event
from numba.extending import register_jitable

_Function = Callable[..., Any]


def compiled(*, parallel: bool = False, fastmath: bool | set[str] = False) -> Callable[[_Function], _Function]:
    """Compile a function that Python calls.

    It lets other threads run, keeps its code on disk, and divides by zero as NumPy does.

    Parameters
    ----------
    parallel : bool
        Whether Numba shares its ``prange`` among threads.
    fastmath : bool or set of str
        Liberties that LLVM may take with floating point: all of them, or those named.

    Returns
    -------
    decorator
    """
    numba_decorator: Callable[[_Function], Any] = njit(
        cache=True, nogil=True, error_model="numpy", parallel=parallel, fastmath=fastmath
    )

    def decorator(function: _Function) -> _Function:
        dispatcher = numba_decorator(function)
        if hasattr(dispatcher, "compile"):  # not so with NUMBA_DISABLE_JIT
            dispatcher.compile = _with_room(dispatcher.compile)
        return dispatcher

    return decorator


def taken_in(*, fastmath: bool | set[str] = False) -> Callable[[_Function], _Function]:
    """Have a function compiled into each compiled one that calls it; called by Python it is plain Python.

    Nothing is made that only Python or a later process would use, which takes time. And only what is taken in rounds alike
    whether its caller was just compiled or comes from disk.

    Parameters
    ----------
    fastmath : bool or set of str
        As of `compiled`, for what this function does.

    Returns
    -------
    decorator
    """
    decorator: Callable[[_Function], _Function] = register_jitable(forceinline=True, error_model="numpy", fastmath=fastmath)
    return decorator


@taken_in()
def on_cache_lines(count, like):  # type: ignore[no-untyped-def]
    """An array (count,) of the kind of ``like`` that begins where a cache line does.

    From elsewhere, every load of 64 bytes would touch two lines.
    """
    store = np.empty(count + 64 // like.itemsize, dtype=like.dtype)
    begin = (-store.ctypes.data % 64) // like.itemsize
    return store[begin : begin + count]


_ROOM = 2**16 + 2**10
"""Places of a frame: with a few more than half a megabyte it gets a chunk of one, and leaves the rest to what it calls."""


def _with_room(call: _Function) -> _Function:
    """Call it where Python has room for the frames of what it calls.

    CPython keeps frames in chunks of 16 KB. A recursion to and fro across the end of one, as that of Numba's compiler, has the
    next chunk mapped and unmapped by the system each time; a frame too large for such a chunk gets a larger one.
    """

    def in_a_chunk_of_its_own(*arguments: Any) -> Any:
        return call(*arguments)

    in_a_chunk_of_its_own.__code__ = in_a_chunk_of_its_own.__code__.replace(co_stacksize=_ROOM)
    return in_a_chunk_of_its_own


def is_on_disk(function: _Function) -> bool:
    """Whether any process here has compiled it before, or none ever will (``NUMBA_DISABLE_JIT``).

    Parameters
    ----------
    function : callable
        Made by `compiled`.

    Returns
    -------
    bool
    """
    stats = getattr(function, "stats", None)
    return stats is None or any(Path(stats.cache_path).glob(f"*.{function.__qualname__}-*.nbi"))


class _CollectorAtRest(event.Listener):
    """Python's garbage collector rests while Numba compiles.

    Compiling makes so many objects that the collector would go through all of Numba's own again and again.
    """

    def __init__(self) -> None:
        self._depth, self._was_on = 0, False

    # One thread compiles at a time, by Numba's lock; what a function calls is compiled meanwhile.
    def on_start(self, _: event.Event) -> None:
        if self._depth == 0:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, _: event.Event) -> None:
        self._depth -= 1
        if self._depth == 0 and self._was_on:
            gc.enable()


event.register("numba:compile", _CollectorAtRest())  # type: ignore[no-untyped-call]
