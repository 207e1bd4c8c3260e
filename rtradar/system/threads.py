"""A thread map on threads that stay: starting some costs as much as the work of a short call."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, TypeVar

from rtradar.errors import InputError
from rtradar.system.checks import brief

THREADS_VARIABLE = "RTRADAR_THREADS"
"""Environment variable that limits the threads of this process, for workers that share cores."""

_CORES = os.cpu_count() or 1  # once, because the system reads a file to tell

_PARTS = 4
"""Parts of its work that each thread gets, so that a slower one has fewer."""

_Result = TypeVar("_Result")


def thread_limit() -> int | None:
    """Return the number of threads that the environment allows, if it gives one."""
    named = os.environ.get(THREADS_VARIABLE, "")
    if not named:
        return None
    if not named.isdecimal() or int(named) < 1:
        raise InputError(
            f"{THREADS_VARIABLE} = {brief(named)}; it must be a whole number, at least 1, or unset"
        )
    return int(named)


def thread_count() -> int:
    """Threads that `thread_map` has: as many as this process may use."""
    return thread_limit() or _CORES


def thread_environment(threads: int) -> dict[str, str]:
    """Return environment variables that limit all threads of a new process, also of libraries."""
    own = (
        THREADS_VARIABLE,
        "NUMBA_NUM_THREADS",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
    )
    return dict.fromkeys(own, str(threads))


def thread_map(work: Callable[[int], _Result], items: range) -> list[_Result]:
    """Map a function over items in threads; return results in order, or raise the first error.

    NumPy, the FFT and compiled loops release the interpreter lock, so threads pay. The caller works
    too, because waking up takes as long as many an item.
    """
    # All threads take from one iterator, so that a slow item keeps only one of them busy.
    results: list[Any] = [None] * len(items)
    failed: dict[int, BaseException] = {}
    left = iter(enumerate(items))

    def take() -> None:
        # The interpreter lock is held while the next is taken.
        for place, item in left:
            try:
                results[place] = work(item)
            except BaseException as error:
                failed[place] = error
                deque(left, maxlen=0)  # nobody begins another

    shared = [take]
    helpers = [_pool().submit(_all_of, shared) for _ in range(min(len(items), thread_count()) - 1)]
    take()
    # Who has not woken by now has nothing left to do.
    awake = [helper for helper in helpers if not helper.cancel()]
    # Cancelled work stays in the pool's queue until a thread wakes, on a busy machine for seconds,
    # and must not keep the arrays of this work until then.
    shared.clear()
    try:
        wait(awake)
    except BaseException:  # an interrupt: nobody works on behind the back of who has left
        deque(left, maxlen=0)
        wait(awake)
        raise
    if failed:
        raise failed[min(failed)]
    return results


def in_threads(kernel: Callable[..., Any], count: int, *given: Any) -> list[Any]:
    """Call ``kernel(start, stop, *given)`` for parts of ``count`` items, a few for each thread.

    Returned is what each call returns, in order.
    """
    size = max(1, -(-count // (_PARTS * thread_count())))
    return thread_map(
        lambda start: kernel(start, min(start + size, count), *given), range(0, count, size)
    )


def begun(work: Callable[[], _Result]) -> Callable[[], _Result]:
    """Begin work in a thread that is free; return a function that waits for its result.

    That function is to be called once. It does the work itself if no thread has begun it by then.
    The work must share nothing that changes with what the caller does meanwhile, and make no large
    products of matrices: `one_blas_thread` ends for them, too, when the caller leaves it.
    """
    if thread_count() == 1:
        return work
    # As in `thread_map`: what is cancelled stays in the queue, and must not keep the work.
    left = [work]
    future = _pool().submit(lambda: left.pop()())

    def result() -> _Result:
        if future.cancel():
            return left.pop()()
        try:
            return future.result()
        except BaseException:  # an interrupt: nobody works on behind the back of who has left
            wait([future])
            raise

    return result


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let products of matrices take one thread each inside, in the whole process.

    After each product OpenBLAS's threads wait for the next in a loop, which takes a core from those
    of `thread_map` (`validation/cost/threads.py`).
    """
    with _libraries().limit(limits=1, user_api="blas"):
        yield


@lru_cache(maxsize=1)
def _libraries() -> Any:
    # Looking through all that are loaded takes as long as the samples of a block.
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def _all_of(shared: list[Callable[[], None]]) -> None:
    for take in shared:
        take()


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, thread_count() - 1), thread_name_prefix="rtradar")


# Threads do not follow into a forked process: there they are started anew.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)
