"""How loops are compiled: division by zero, inlined functions, and code that is kept on disk."""

from __future__ import annotations

import errno
import math
import os
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numba import config
from numba.core.registry import cpu_target

import rtradar
import rtradar.kernels.jit as compiling
from rtradar.kernels.jit import (
    CacheWarning,
    check_cache,
    compiled,
    inlined,
    on_cache_lines,
    try_cache,
)


@inlined()
def half(number: float) -> float:
    return number / 2


def double(number: float) -> float:
    return number * 2


def test_dividing_by_zero_raises_nothing() -> None:
    assert compiled()(lambda number: number / 0.0)(1.0) == math.inf


def test_what_is_inlined_is_called_by_python_and_by_compiled_functions() -> None:
    assert half(3.0) == compiled()(lambda number: half(number))(3.0) == 1.5


@pytest.mark.parametrize(
    "kind", [pytest.param(np.complex64, marks=pytest.mark.slow), np.complex128]
)
def test_how_a_product_rounds_does_not_depend_on_what_was_compiled_before(
    kind: type[np.complexfloating],
) -> None:
    """Multiplications have the liberties of their own function, before and after another's, and do
    not pass them on to functions of other packages."""

    def liberties(decorated: Any) -> set[str]:
        product = decorated(lambda a, b: a * b)
        product(kind(1), kind(2))
        (code,) = product.inspect_llvm().values()
        return set(re.findall(r"= fmul (\w+ )?(?:float|double)", code))

    of_others = cpu_target.target_context.cached_internal_func
    before = dict(of_others)
    for _ in range(2):
        assert liberties(compiled()) == {""}
        assert liberties(compiled(fastmath={"contract"})) == {"contract "}
        assert liberties(compiled(fastmath=True)) == {"fast "}
    assert of_others is cpu_target.target_context.cached_internal_func
    assert of_others == before
    assert type(of_others) is dict
    liberties(numba.njit(fastmath=True))
    assert liberties(compiled()) == {""}


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.complex128])
def test_an_array_on_cache_lines(kind: type[np.generic]) -> None:
    for made in (on_cache_lines, compiled()(lambda count, like: on_cache_lines(count, like))):
        array = made(33, np.zeros(1, dtype=kind))
        assert array.dtype == kind
        assert array.shape == (33,)
        assert array.ctypes.data % 64 == 0


# -- code on disk ----------------------------------------------------------------------------------


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder for code, and no warning so far."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(compiling, "_warned", False)
    yield tmp_path / "cache"
    compiling._place.cache_clear()


def of_package(function: Callable[..., Any] = double) -> Any:
    """A function that is compiled as if it stood in the package, as by a process of its own."""
    function.__module__ = "rtradar.kernels.toy"
    return compiled()(function)


def from_disk(function: Any) -> bool:
    stats = function.stats
    return bool(sum(stats.cache_hits.values())) and not sum(stats.cache_misses.values())


def files(cache: Path) -> list[Path]:
    return sorted(cache.rglob("*.nbc"))


def test_what_was_compiled_before_comes_from_disk(cache: Path) -> None:
    first = of_package()
    assert (first(2), first(2.0), first(3.0)) == (4, 4.0, 6.0)
    assert not from_disk(first)
    assert len(files(cache)) == 2  # one for each type of argument
    again = of_package()
    assert (again(2), again(2.0)) == (4, 4.0)
    assert from_disk(again)


def test_only_functions_of_the_package_are_kept(cache: Path) -> None:
    """The hash is of the package's texts: others' would be stale one day."""
    assert compiled()(lambda number: number * 2)(2.0) == 4.0
    assert not files(cache)


@pytest.mark.parametrize("setting", ["OPT", "BOUNDSCHECK", "CPU_NAME"])
def test_settings_go_into_the_hash(
    cache: Path, monkeypatch: pytest.MonkeyPatch, setting: str
) -> None:
    of_package()(2.0)
    compiling._place.cache_clear()
    monkeypatch.setattr(config, setting, "generic" if setting == "CPU_NAME" else 1)
    again = of_package()
    again(2.0)
    assert not from_disk(again)
    assert len(list(cache.glob("*/rtradar-*"))) == 2


@pytest.mark.parametrize("file", ["kernels/elementary.py", "conventions.py"])
def test_texts_go_into_the_hash(cache: Path, monkeypatch: pytest.MonkeyPatch, file: str) -> None:
    read = Path.read_bytes

    def edited(path: Path) -> bytes:
        return read(path) + (b"#" if path.as_posix().endswith(f"rtradar/{file}") else b"")

    before = compiling._read_sources()
    monkeypatch.setattr(Path, "read_bytes", edited)
    assert compiling._read_sources() != before == compiling._sources
    # A process that imported the old text does not keep what it compiles from it.
    function = of_package()
    assert function(2.0) == 4.0
    assert not files(cache)


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: b"",
        lambda text: text[: len(text) // 2],
        lambda text: b"\0" * len(text),
        lambda text: text[:-9] + bytes([text[-9] ^ 1]) + text[-8:],
    ],
)
def test_damaged_files_are_made_anew(cache: Path, damage: Callable[[bytes], bytes]) -> None:
    of_package()(2.0)
    (file,) = files(cache)
    file.write_bytes(damage(file.read_bytes()))
    again, third = of_package(), of_package()
    assert (again(2.0), third(2.0)) == (4.0, 4.0)
    assert (from_disk(again), from_disk(third)) == (False, True)


def test_nothing_is_kept_by_numba_itself() -> None:
    """It would not see what other files bring in, and fails where no folder can be written."""
    modules = list(Path(rtradar.__file__).parent.rglob("*.py"))
    assert len(modules) > 200
    assert not [path for path in modules if "cache=True" in path.read_text(encoding="utf-8")]


def test_code_of_other_versions_goes_when_it_is_old(cache: Path) -> None:
    of_package()(2.0)
    (folder,) = cache.glob("*/rtradar-*")
    old, new = folder.with_name("rtradar-" + "0" * 16), folder.with_name("rtradar-" + "1" * 16)
    others = folder.with_name("rtradar-mine")
    for one in (old, new, others):
        one.mkdir()
        (one / "code.nbc").touch()
    for one in (old, others, folder):
        os.utime(one, (time.time() - 31 * 86400,) * 2)
    compiling._place.cache_clear()
    again = of_package()
    again(2.0)
    assert from_disk(again)
    assert {path.name for path in folder.parent.iterdir()} == {
        folder.name,
        new.name,
        others.name,
    }


# The disk is full, and another version of Numba keeps code otherwise.
@pytest.mark.parametrize(
    ("part", "error", "says"),
    [
        ("rtradar.system.files.os.replace", OSError(errno.ENOSPC, "No space left"), "No space"),
        ("rtradar.kernels.jit.CompileResultCacheImpl", TypeError("missing"), "missing"),
        ("rtradar.kernels.jit.dumps", TypeError("missing"), "missing"),
    ],
)
def test_trouble_with_keeping_code_is_told_once(
    cache: Path, monkeypatch: pytest.MonkeyPatch, part: str, error: Exception, says: str
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(part, fails)
    message = rf"compiled code is not kept \(.*{says}.* NUMBA_CACHE_DIR"
    with pytest.warns(CacheWarning, match=message) as warned:
        assert [of_package()(2.0), of_package()(2)] == [4.0, 4]
    assert len(warned) == 1


def test_the_cache_is_tried(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for _ in range(2):
        finding, advice = try_cache()
        assert (finding.startswith(f"kept, in {cache}"), advice) == (True, "")
    check_cache()  # says nothing
    monkeypatch.setattr(compiling.pickle, "loads", lambda _: None)
    assert try_cache()[0] == "not kept: what was written could not be loaded again"
