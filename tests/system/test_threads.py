"""Threads that stay, and can be limited by the environment of the process."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from concurrent.futures import wait
from functools import partial

import pytest
from threadpoolctl import ThreadpoolController

from rtradar.errors import InputError
from rtradar.system import threads
from rtradar.system.threads import (
    THREADS_VARIABLE,
    begun,
    in_threads,
    one_blas_thread,
    thread_count,
    thread_environment,
    thread_limit,
    thread_map,
)

COUNT = """
import numba, rtradar.system.threads
from rtradar.trace.backend import select, use
use(select("llvm"))
import drjit
print(rtradar.system.threads._pool()._max_workers, numba.get_num_threads(), drjit.thread_count())
"""


def test_results_come_in_the_order_of_the_items() -> None:
    assert thread_map(lambda item: item * item, range(20)) == [item * item for item in range(20)]
    assert thread_map(str, range(0)) == []


def test_an_error_in_a_thread_is_raised() -> None:
    def fail(item: int) -> None:
        raise ValueError(f"item {item}")

    with pytest.raises(ValueError, match="item 0"):
        thread_map(fail, range(2))


@pytest.mark.parametrize("count", ["1", "4"])
def test_what_was_begun_is_done_once(monkeypatch: pytest.MonkeyPatch, count: str) -> None:
    monkeypatch.setenv(THREADS_VARIABLE, count)
    done = list[int]()
    waited_for = begun(lambda: done.append(1))
    waited_for()
    assert done == [1]
    with pytest.raises(KeyError):
        begun(lambda: {}[3])()


@pytest.mark.usefixtures("four_threads")
def test_what_no_thread_has_begun_is_done_by_who_waits() -> None:
    done, who = threading.Event(), list[int]()
    asleep = [threads._pool().submit(done.wait, 60) for _ in range(3)]
    try:
        begun(lambda: who.append(threading.get_ident()))()
        assert who == [threading.get_ident()]
    finally:
        done.set()
        wait(asleep)


def test_after_an_error_no_other_item_is_begun() -> None:
    begun = []

    def fail(item: int) -> None:
        begun.append(item)
        raise ValueError(f"item {item}")

    with pytest.raises(ValueError, match=r"item 0"):
        thread_map(fail, range(1000))
    assert sorted(begun) == list(range(len(begun)))
    assert len(begun) <= thread_count()


@pytest.mark.usefixtures("four_threads")
def test_after_an_interrupt_nobody_works_on(monkeypatch: pytest.MonkeyPatch) -> None:
    caller, begun, waiting = threading.get_ident(), [], threading.Event()

    def work(item: int) -> None:
        if threading.get_ident() == caller:
            waiting.wait(60)  # until the other has an item
            return
        waiting.set()
        time.sleep(0.05)
        begun.append(item)

    def interrupted(helpers: object, real: Callable[[object], object] = threads.wait) -> None:
        monkeypatch.setattr(threads, "wait", real)
        raise KeyboardInterrupt

    monkeypatch.setattr(threads, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        thread_map(work, range(2))
    assert len(begun) == 1


def test_work_may_itself_be_shared_among_threads() -> None:
    found = thread_map(lambda item: sum(thread_map(lambda other: item * other, range(8))), range(8))
    assert found == [28 * item for item in range(8)]


@pytest.mark.usefixtures("four_threads")
def test_work_is_not_kept_for_threads_that_have_not_woken() -> None:
    class Array:
        """Stands for one that is large."""

    def work(item: int, array: Array) -> None:
        pass

    array, done = Array(), threading.Event()
    gone = weakref.ref(array)
    asleep = [
        threads._pool().submit(done.wait, 60) for _ in range(3)
    ]  # as on a machine that is busy with other things
    try:
        thread_map(partial(work, array=array), range(8))
        del array
        assert gone() is None
    finally:
        done.set()
        wait(asleep)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_forked_process_has_threads_of_its_own() -> None:
    program = """
import os
from rtradar.system.threads import thread_map
thread_map(str, range(4))
child = os.fork()
if child == 0:
    os._exit(0 if thread_map(str, range(4)) == ["0", "1", "2", "3"] else 1)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    assert (
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", program], timeout=60, check=False
        ).returncode
        == 0
    )


@pytest.mark.slow
def test_every_kind_of_thread_is_limited() -> None:
    environment = {**os.environ, **thread_environment(1)}
    found = subprocess.run(
        [sys.executable, "-c", COUNT], env=environment, capture_output=True, text=True, check=True
    )
    assert found.stdout.split() == ["1", "1", "1"]


def test_parts_of_the_work_cover_all_items_once() -> None:
    for count in (0, 1, 7, 100):
        parts = in_threads(lambda start, stop: range(start, stop), count)
        assert [item for part in parts for item in part] == list(range(count))


def _blas_threads() -> list[int]:
    libraries = ThreadpoolController().select(user_api="blas").info()
    return [library["num_threads"] for library in libraries]


def test_matrix_products_take_one_thread_inside_and_as_many_as_before_after() -> None:
    before = _blas_threads()
    assert before
    with one_blas_thread():
        assert set(_blas_threads()) == {1}
    assert _blas_threads() == before


@pytest.mark.parametrize("text", ["abc", "0", "-1", "1.5", "\u00b2"])
def test_another_number_of_threads_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv(THREADS_VARIABLE, text)
    with pytest.raises(InputError, match=r"RTRADAR_THREADS = .*; it must be a whole number"):
        thread_count()
    monkeypatch.setenv(THREADS_VARIABLE, "3")
    assert thread_limit() == thread_count() == 3
    monkeypatch.setenv(THREADS_VARIABLE, "")
    assert thread_limit() is None
    monkeypatch.delenv(THREADS_VARIABLE)
    assert thread_limit() is None
    assert thread_count() >= 1
