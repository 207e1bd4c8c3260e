"""Two clocks that go in turn, while some thread warms up and otherwise."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import pytest

from rtradar.system import clock
from rtradar.system.clock import Moment, warming_up


@pytest.fixture
def now_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Time that only goes on as a test says."""
    now_s = [100.0]
    monkeypatch.setattr(clock, "time", SimpleNamespace(perf_counter=lambda: now_s[0]))
    return now_s


def since(began: Moment) -> tuple[float, float]:
    now = Moment.now()
    return now.work_s - began.work_s, now.warm_up_s - began.warm_up_s


def test_what_compiles_within_what_compiles_is_counted_once(now_s: list[float]) -> None:
    began = Moment.now()
    now_s[0] += 1.0
    with warming_up():
        now_s[0] += 2.0
        with warming_up():
            now_s[0] += 4.0
            assert since(began) == (1.0, 6.0)
        now_s[0] += 8.0
    now_s[0] += 16.0
    assert since(began) == (17.0, 14.0)


def test_an_error_ends_it(now_s: list[float]) -> None:
    began = Moment.now()

    @warming_up()
    def compile_in_vain() -> None:
        now_s[0] += 2.0
        raise ValueError("stop")

    with pytest.raises(ValueError, match="stop"):
        compile_in_vain()
    now_s[0] += 4.0
    assert since(began) == (4.0, 2.0)


def test_seconds_of_several_threads_are_counted_once(now_s: list[float]) -> None:
    began, inside, enough = Moment.now(), threading.Event(), threading.Event()

    def other() -> None:
        with warming_up():
            inside.set()
            enough.wait()

    thread = threading.Thread(target=other)
    with warming_up():
        now_s[0] += 1.0
        thread.start()
        inside.wait()
        now_s[0] += 2.0
    now_s[0] += 4.0  # the other is still at it
    enough.set()
    thread.join()
    now_s[0] += 8.0
    assert since(began) == (8.0, 7.0)
