"""How loops are compiled: division by zero, inlined functions, and code that is kept on disk."""

import errno
import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import config
from numba.core.caching import NullCache

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


def test_dividing_by_zero_raises_nothing() -> None:
    assert uncached(lambda number: number / 0.0)(1.0) == math.inf


def test_what_is_inlined_is_called_by_python_and_by_compiled_functions() -> None:
    assert half(3.0) == uncached(lambda number: half(number))(3.0) == 1.5


@pytest.mark.parametrize("kind", [np.complex64, np.complex128])
def test_how_a_product_rounds_does_not_depend_on_what_was_compiled_before(
    kind: type[np.complexfloating],
) -> None:
    """Multiplications have the liberties of their own function, before and after another's."""

    def liberties(fastmath: bool | set[str]) -> set[str]:
        product: Any = compiled(fastmath=fastmath)(lambda a, b: a * b)
        product._cache = NullCache()
        product(kind(1), kind(2))
        (code,) = product.inspect_llvm().values()
        return set(re.findall(r"= fmul (\w+ )?(?:float|double)", code))

    assert liberties(False) == {""}
    assert liberties({"contract"}) == {"contract "}
    assert liberties(True) == {"fast "}
    assert liberties(False) == {""}


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
            errno.ENOSPC, os.strerror(errno.ENOSPC), str(tmp_path / "a name of this process")
        )

    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiling, "_warned", False)
    monkeypatch.setattr(compiling.IndexDataCacheFile, "save", full)
    with pytest.warns(
        CacheWarning,
        match=r"compiled code is not kept \(No space left on device\).* NUMBA_CACHE_DIR",
    ) as warned:
        assert [compiled()(double)(2.0), compiled()(half)(2.0)] == [4.0, 1.0]
    assert len(warned) == 1


@pytest.mark.parametrize("part", ["CompileResultCacheImpl", "IndexDataCacheFile", "stamp_of"])
def test_another_numba_may_keep_code_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    def changed(*_: object, **__: object) -> None:
        raise TypeError("an argument is missing")

    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiling, "_warned", False)
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
