"""Compiled code is never stale: it is loaded from disk while all that went into it is the same, and
compiled anew after that."""

from __future__ import annotations

import cProfile
import importlib
import os
import pkgutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import config
from numba.core.caching import NullCache
from numba.extending import is_jitted

import rtradar
from references import CASES
from rtradar.kernels.code_stamp import UnknownCodeError, _code_digest, stamp_of
from rtradar.kernels.gaussian_noise import add_noise
from rtradar.kernels.jit import _CodeOnDisk, compiled

ESTATE = {
    "caller": """
from rtradar.kernels.jit import compiled
from estate import far
from estate.near import OFFSET, near, kept, table

@compiled()
def answer(number):
    return near(number) + kept(number) + OFFSET + table[1] + far.by_module(number)

@compiled()
def other(number):
    return number + 0.5
""",
    "near": """
import numpy as np
from rtradar.kernels.jit import compiled, inlined
from estate.far import beyond

OFFSET = 1000.0
table = np.array([0.0, 20000.0])

@inlined(fastmath=set())
def near(number, weight=1.0):
    return beyond(number) * weight

@compiled(fastmath=False)
def kept(number):
    return number * 100.0
""",
    "far": """
from rtradar.kernels.jit import inlined
WEIGHT = 10.0
SIGN = 1.0

@inlined()
def beyond(number):
    return number * WEIGHT

@inlined()
def by_module(number):
    return number * SIGN

def unused(number):
    return number * 7.0
""",
}
"""Modules of a package: a compiled function, what a second one inlines into it, and what a third
inlines into that."""


class Estate:
    """The package in a folder: edited so that neither size nor time of a file tell, and imported as
    by another process."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "estate"
        self.folder.mkdir()
        (self.folder / "__init__.py").touch()
        for name, text in ESTATE.items():
            (self.folder / f"{name}.py").write_text(text)
            os.utime(self.folder / f"{name}.py", (1e9, 1e9))

    def edit(self, name: str, old: str, new: str) -> None:
        assert len(old) == len(new)
        file = self.folder / f"{name}.py"
        text = file.read_text()
        assert text.count(old) == 1
        file.write_text(text.replace(old, new))
        os.utime(file, (1e9, 1e9))

    def load(self) -> Any:
        for name in [name for name in sys.modules if name.partition(".")[0] == "estate"]:
            del sys.modules[name]
        return importlib.import_module("estate.caller")


@pytest.fixture
def estate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Estate]:
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(
        sys, "dont_write_bytecode", True
    )  # Python's own cache would take an edited file for the same
    monkeypatch.syspath_prepend(tmp_path)
    before = dict(sys.modules)
    yield Estate(tmp_path)
    for name in sys.modules.keys() - before.keys():
        if name.partition(".")[0] == "estate":
            del sys.modules[name]


def from_disk(function: Any) -> bool:
    stats = function.stats
    return bool(sum(stats.cache_hits.values())) and not sum(stats.cache_misses.values())


def test_what_has_not_changed_comes_from_disk(estate: Estate) -> None:
    assert estate.load().answer(1.0) == 21111.0
    again = estate.load()
    assert again.answer(1.0) == 21111.0
    assert from_disk(again.answer)


@pytest.mark.parametrize(
    ("module", "old", "new", "result"),
    [
        pytest.param("caller", "table[1]", "table[0]", 1111.0, id="its own text"),
        pytest.param("near", "beyond(number) *", "beyond(number) -", 21110.0, id="inlined"),
        pytest.param("near", "weight=1.0", "weight=3.0", 21131.0, id="default of an argument"),
        pytest.param(
            "near", "number * 100.0", "number * 200.0", 21211.0, id="another compiled function"
        ),
        pytest.param(
            "near", "OFFSET = 1000.0", "OFFSET = 2000.0", 22111.0, id="constant of another module"
        ),
        pytest.param("near", "20000.0", "30000.0", 31111.0, id="array of another module"),
        pytest.param(
            "far", "number * WEIGHT", "number - WEIGHT", 21092.0, id="inlined into what is inlined"
        ),
        pytest.param(
            "far", "WEIGHT = 10.0", "WEIGHT = 40.0", 21141.0, id="constant of a third module"
        ),
        pytest.param("far", "number * SIGN", "number - SIGN", 21110.0, id="by the module's name"),
        pytest.param(
            "far", "SIGN = 1.0", "SIGN = 9.0", 21119.0, id="constant by the module's name"
        ),
    ],
)
def test_an_edit_of_what_goes_into_it(
    estate: Estate, module: str, old: str, new: str, result: float
) -> None:
    assert estate.load().answer(1.0) == 21111.0
    estate.edit(module, old, new)
    edited = estate.load()
    assert edited.answer(1.0) == result
    assert not from_disk(edited.answer)
    again = estate.load()
    assert again.answer(1.0) == result
    assert from_disk(again.answer)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("fastmath=set()", "fastmath=True "),
        ("compiled(fastmath=False)", "compiled(fastmath=True )"),
    ],
)
def test_what_numba_is_told_goes_into_it(estate: Estate, old: str, new: str) -> None:
    before = stamp_of(estate.load().answer)
    estate.edit("near", old, new)
    assert stamp_of(estate.load().answer) != before


def test_an_edit_of_what_does_not_go_into_it(estate: Estate) -> None:
    before = estate.load()
    stamps = stamp_of(before.answer), stamp_of(before.other)
    estate.edit("far", "number * 7.0", "number * 9.0")
    assert stamp_of(estate.load().answer) == stamps[0]
    estate.edit("far", "number * SIGN", "number + SIGN")
    after = estate.load()
    assert stamp_of(after.answer) != stamps[0]
    assert stamp_of(after.other) == stamps[1]


def test_an_edit_under_a_running_process(estate: Estate) -> None:
    running = estate.load()
    estate.edit("far", "number * WEIGHT", "number - WEIGHT")
    assert (
        running.answer(1.0) == 21111.0
    )  # compiled from what was imported, and not kept as what is in the file now
    assert estate.load().answer(1.0) == 21092.0


def test_in_processes_of_their_own(estate: Estate, tmp_path: Path) -> None:
    words = "from estate.caller import answer as f; print(f(1.0), sum(f.stats.cache_hits.values()))"
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path / "shared"),
        "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path]),
        "PYTHONDONTWRITEBYTECODE": "1",
    }

    def begin(seed: int) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", words]
        return subprocess.Popen(
            command,
            env={**environment, "PYTHONHASHSEED": str(seed)},
            stdout=subprocess.PIPE,
            text=True,
        )

    at_once = [begin(seed) for seed in range(3)]
    assert [process.communicate()[0].split()[0] for process in at_once] == ["21111.0"] * 3
    assert [process.returncode for process in at_once] == [0, 0, 0]
    assert begin(3).communicate()[0].split() == ["21111.0", "1"]
    estate.edit("far", "number * WEIGHT", "number - WEIGHT")
    assert begin(4).communicate()[0].split() == ["21092.0", "0"]


def test_code_of_other_arguments_is_not_taken_for_it(estate: Estate, tmp_path: Path) -> None:
    """Two processes that compile at the same time may leave each other's code under one name."""
    first = estate.load()
    assert (first.other(1), first.other(1.0)) == (1.5, 1.5)
    codes = sorted((tmp_path / "cache").rglob("caller.other-*.nbc"))
    assert len(codes) == 2
    texts = [code.read_bytes() for code in codes]
    for code, text in zip(codes, reversed(texts), strict=True):
        code.write_bytes(text)
    again = estate.load()
    assert (again.other(1), again.other(1.0)) == (1.5, 1.5)
    assert not sum(again.other.stats.cache_hits.values())


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
@pytest.mark.parametrize(
    "damage",
    [lambda text: b"", lambda text: text[: len(text) // 2], lambda text: b"\0" * len(text)],
)
def test_damaged_files_are_made_anew(
    estate: Estate, tmp_path: Path, kind: str, damage: Callable[[bytes], bytes]
) -> None:
    estate.load().answer(1.0)
    (file,) = (tmp_path / "cache").rglob(f"caller.answer-*.{kind}")
    file.write_bytes(damage(file.read_bytes()))
    again = estate.load()
    assert again.answer(1.0) == 21111.0
    assert not from_disk(again.answer)
    third = estate.load()
    assert third.answer(1.0) == 21111.0
    assert from_disk(third.answer)


def test_stamps_of_functions_that_call_each_other_and_themselves() -> None:
    source = """
from numba import njit
@njit
def even(n):
    return n == 0 or odd(n - 1)
@njit
def odd(n):
    return n != 0 and (even(n - 1) if n > 0 else odd(n + {}))
"""

    def made(step: int) -> Any:
        scope: dict[str, Any] = {}
        exec(source.format(step), scope)
        return scope["even"]

    assert stamp_of(made(1)) == stamp_of(made(1)) != stamp_of(made(2))


def test_what_a_function_closes_over_goes_into_it() -> None:
    def made(value: object) -> Any:
        return compiled()(lambda number: number + value)

    assert stamp_of(made(1)) == stamp_of(made(1))
    assert (
        len(
            {
                stamp_of(made(value))
                for value in (1, 1.0, True, -0.0, 0.0, np.float32(1), np.ones(1), np.ones(2), (1,))
            }
        )
        == 9
    )


def test_what_has_no_stamp_is_told() -> None:
    unknown = object()
    with pytest.raises(UnknownCodeError, match="object at"):
        stamp_of(compiled()(lambda: unknown))


@pytest.mark.parametrize("setting", ["BOUNDSCHECK", "OPT"])
def test_settings_of_numba_go_into_it(monkeypatch: pytest.MonkeyPatch, setting: str) -> None:
    before = stamp_of(add_noise)
    monkeypatch.setattr(config, setting, 1)
    assert stamp_of(add_noise) != before


# -- functions of the package ----------------------------------------------------------------------


def compiled_functions() -> dict[str, Any]:
    found = {}
    for module in pkgutil.walk_packages(rtradar.__path__, "rtradar."):
        if module.name not in ("rtradar.__main__", "rtradar.trace.backends.probe_script"):
            for value in vars(importlib.import_module(module.name)).values():
                if is_jitted(value):
                    found[f"{value.py_func.__module__}.{value.py_func.__qualname__}"] = value
    return found


def test_each_function_of_the_package_has_a_stamp() -> None:
    found = compiled_functions()
    # These are plain functions that call compiled ones.
    plain = {
        "prime_factor_dft.add_doppler_power",
        "prime_factor_dft.pick_cells",
        "nufft.sum_by_nufft",
        "nufft.add_anchored_tones",
    }
    assert {f"rtradar.kernels.{name}" for name in CASES.keys() - plain} <= set(found)
    assert len({stamp_of(function) for function in found.values()}) == len(found)
    # None is kept by Numba itself, which does not see what other files bring in.
    assert all(isinstance(function._cache, _CodeOnDisk | NullCache) for function in found.values())


@pytest.mark.parametrize(
    ("inlined", "by", "not_by"),
    [
        (
            "rtradar.kernels.elementary.phasor",
            "rtradar.kernels.nufft._spread_tones",
            "rtradar.kernels.gaussian_noise.add_noise",
        ),
        (
            "rtradar.kernels.elementary.dot",
            "rtradar.kernels.scatter.mirrors.slab_fields",
            "rtradar.kernels.scatter.specular_point.solve",
        ),
        (
            "rtradar.kernels.jit.on_cache_lines",
            "rtradar.kernels.prime_factor_dft._transform",
            "rtradar.kernels.scatter.specular_point.solve",
        ),
        (
            "rtradar.kernels.scatter.specular_point.newton",
            "rtradar.kernels.scatter.specular_point.solve",
            "rtradar.kernels.prime_factor_dft._transform",
        ),
    ],
)
def test_stamps_of_the_package_have_what_is_inlined(
    monkeypatch: pytest.MonkeyPatch, inlined: str, by: str, not_by: str
) -> None:
    def named(name: str) -> Any:
        module, _, attribute = name.rpartition(".")
        return getattr(importlib.import_module(module), attribute)

    before = stamp_of(named(by)), stamp_of(named(not_by))
    function = named(inlined)
    function = getattr(function, "py_func", function)
    code = function.__code__
    monkeypatch.setattr(function, "__code__", code.replace(co_consts=(*code.co_consts, "changed")))
    assert stamp_of(named(by)) != before[0]
    assert stamp_of(named(not_by)) == before[1]


def test_nothing_is_kept_by_numba_itself() -> None:
    """It would not see what other files bring in, and fails on import where no folder can be
    written."""
    root = Path(rtradar.__file__).parents[1]
    files = [file for folder in ("rtradar", "validation") for file in (root / folder).rglob("*.py")]
    assert len(files) > 200
    assert not [file for file in files if "cache=True" in file.read_text(encoding="utf-8")]


@compiled()
def _plus_one(number: float) -> float:
    return number + 1


def test_a_stamp_stays_as_it_is_while_a_profiler_watches() -> None:
    before = stamp_of(_plus_one)
    _plus_one(1.0)
    profiler = cProfile.Profile()
    profiler.enable()
    _plus_one(2.0)  # Numba takes flags off the function's code for the profiler's sake
    profiler.disable()
    _code_digest.cache_clear()
    assert stamp_of(_plus_one) == before
