"""How loops are compiled: zero as NumPy divides by it, functions that are taken in, and Python's collector meanwhile."""

import errno
import gc
import math
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import config
from numba.core import event
from numba.core.caching import NullCache
from numba.core.errors import TypingError

import rtradar.kernels.jit as compiling
from rtradar.kernels.jit import (
    CacheWarning,
    compiled,
    inlined,
    is_on_disk,
    on_cache_lines,
    try_cache,
)


@inlined()
def half(number: float) -> float:
    return number / 2


def double(number: float) -> float:
    return number * 2


# Not kept on disk, unlike those of the package: each is compiled when it is first called.
def uncached(function: Callable[..., Any]) -> Any:
    made: Any = compiled()(function)
    made._cache = NullCache()
    return made


@pytest.fixture(params=[True, False])
def collector(request: pytest.FixtureRequest) -> Iterator[bool]:
    (gc.enable if request.param else gc.disable)()
    yield request.param
    gc.enable()


def test_dividing_by_zero_raises_nothing() -> None:
    assert uncached(lambda number: number / 0.0)(1.0) == math.inf


def test_what_is_inlined_is_called_by_python_and_by_compiled_functions() -> None:
    assert half(3.0) == uncached(lambda number: half(number))(3.0) == 1.5


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.complex128])
def test_an_array_on_cache_lines(kind: type[np.generic]) -> None:
    for made in (on_cache_lines, uncached(lambda count, like: on_cache_lines(count, like))):
        array = made(33, np.zeros(1, dtype=kind))
        assert array.dtype == kind
        assert array.shape == (33,)
        assert array.ctypes.data % 64 == 0


def test_what_is_on_disk_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    twice: Any = compiled()(double)
    assert not is_on_disk(twice)
    twice(2.0)
    assert is_on_disk(twice)
    assert is_on_disk(double)  # as NUMBA_DISABLE_JIT leaves it: nothing to compile


def test_trouble_with_the_disk_is_told_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(
            errno.ENOSPC, os.strerror(errno.ENOSPC), str(tmp_path / "a name of the moment")
        )

    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiling, "_told", False)
    monkeypatch.setattr(compiling.IndexDataCacheFile, "save", full)
    with pytest.warns(
        CacheWarning,
        match=r"compiled code is not kept \(No space left on device\).* NUMBA_CACHE_DIR",
    ) as told:
        assert [compiled()(double)(2.0), compiled()(half)(2.0)] == [4.0, 1.0]
    assert len(told) == 1


@pytest.mark.parametrize("part", ["CompileResultCacheImpl", "IndexDataCacheFile", "stamp_of"])
def test_another_numba_may_keep_code_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    def changed(*_: object, **__: object) -> None:
        raise TypeError("an argument is missing")

    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiling, "_told", False)
    monkeypatch.setattr(compiling, part, changed)
    with pytest.warns(CacheWarning, match="an argument is missing"):
        assert compiled()(double)(2.0) == 4.0


def test_the_cache_is_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    for _ in range(2):
        finding, advice = try_cache()
        assert (finding.startswith(f"kept, for one in {tmp_path}"), advice) == (True, "")
    monkeypatch.setattr(compiling.IndexDataCacheFile, "load", lambda *_: None)
    assert try_cache()[0] == "not kept: what was written could not be loaded again"


def test_the_collector_is_afterwards_as_it_was(collector: bool) -> None:
    uncached(lambda number: half(number) + 1)(3.0)
    assert gc.isenabled() == collector


def test_the_collector_is_as_it_was_after_what_cannot_be_compiled(collector: bool) -> None:
    with pytest.raises(TypingError):
        uncached(lambda number: half(number).nothing)(3.0)
    assert gc.isenabled() == collector


def test_the_collector_rests_meanwhile() -> None:
    runs: list[str] = []

    def note(phase: str, _: object) -> None:
        runs.append(phase)

    gc.collect()
    gc.callbacks.append(note)
    try:
        uncached(lambda number: max(half(number), number * 3) + 2)(3.0)
    finally:
        gc.callbacks.remove(note)
    # Thousands of objects are made, and every 700 would start it; afterwards it starts once.
    assert runs.count("start") <= 1


def test_compiling_has_room_for_frames() -> None:
    resource = pytest.importorskip("resource")

    def faults_of_calls_from(depth: int) -> int:
        """Pages that the system maps while a function is called a thousand times from under so many frames."""
        if depth:
            return faults_of_calls_from(depth - 1)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for _ in range(1000):
            double(1.0)
        return int(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)

    found: list[int] = []

    class Watch(event.Listener):
        def on_start(self, _: event.Event) -> None:
            found.extend(faults_of_calls_from(depth) for depth in range(200))

        def on_end(self, _: event.Event) -> None: ...

    # A thread's frames begin in a chunk of their own; otherwise its end is at one of these depths, where each call maps a page.
    with event.install_listener("numba:compile", Watch()):
        compiling = threading.Thread(target=uncached(double), args=(2.0,))
        compiling.start()
        compiling.join()
    assert len(found) == 200
    assert max(found) < 1000
