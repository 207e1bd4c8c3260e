"""How Numba compiles loops: on first use, and kept on disk for every later one."""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import pickle
import platform
import shutil
import time
import warnings
from collections import defaultdict
from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numba import config, njit, types
from numba.core.caching import CompileResultCacheImpl, NullCache
from numba.core.compiler import Compiler
from numba.core.registry import cpu_target
from numba.core.serialize import dumps
from numba.extending import register_jitable

from rtradar.system.clock import warming_up
from rtradar.system.files import atomic_file

_Function = Callable[..., Any]


class CacheWarning(UserWarning):
    """Compiled code cannot be kept on disk: results are right, but every process compiles again."""


_tables: defaultdict[frozenset[str], dict[Any, Any]] = defaultdict(dict)


class _Compiler(Compiler):
    """Numba's compiler, with tables of our own for the functions of Numba that our code calls.

    The product of two complex numbers, for one, is such a function. Numba keeps them in one table
    of the process, by name and types but not by ``fastmath``: how our products round would depend
    on who compiled first, and those of other packages on ours. Here each ``fastmath`` has a table.
    """

    def __init__(self, typing: Any, target: Any, *given: Any) -> None:
        _, _, _, flags, _ = given  # library, arguments, result, flags, locals
        own = target.subtarget(cached_internal_func=_tables[frozenset(flags.fastmath.flags)])
        super().__init__(typing, own, *given)  # type: ignore[no-untyped-call]


# Nobody calls these functions from C. Without the wrapper for that, compiling takes a tenth less.
_OPTIONS: Any = {"error_model": "numpy", "pipeline_class": _Compiler, "no_cfunc_wrapper": True}


def compiled(*, fastmath: bool | set[str] = False) -> Callable[[_Function], _Function]:
    """Compile a function that Python calls.

    It lets other threads run and divides by zero as NumPy does. Code of rtradar's own functions is
    kept on disk; where that is impossible, a `CacheWarning` says so once. The time of compiling and
    loading is counted by `warming_up`. ``fastmath`` names the liberties that LLVM may take with
    floating point; True allows all of them.
    """
    numba_decorator: Callable[[_Function], Any] = njit(nogil=True, fastmath=fastmath, **_OPTIONS)

    def decorator(function: _Function) -> _Function:
        dispatcher = numba_decorator(function)
        if hasattr(dispatcher, "compile"):  # not so with NUMBA_DISABLE_JIT
            dispatcher.compile = warming_up()(dispatcher.compile)
            if function.__module__.startswith(f"{__package__}."):
                dispatcher._cache = _CodeOnDisk(dispatcher)
        return dispatcher

    return decorator


def inlined(*, fastmath: bool | set[str] = False) -> Callable[[_Function], _Function]:
    """Compile a function into each compiled one that calls it; called by Python it is plain Python.

    So nothing is compiled that only Python or a later process would use. And only inlined code
    rounds alike whether its caller was just compiled or comes from disk. ``fastmath`` is as in
    `compiled`, for the arithmetic of this function.
    """
    numba_decorator: Callable[[_Function], _Function] = register_jitable(
        forceinline=True, fastmath=fastmath, **_OPTIONS
    )
    return numba_decorator


@inlined()
def on_cache_lines(count, like):
    """Return an array (count,) of the kind of ``like`` that begins on a cache line.

    Otherwise every load of 64 bytes would touch two lines: the prime-factor DFT then takes
    1.17 to 1.34 times as long, the tone sum 1.11 to 1.25 (`validation/cost/alignment.py`).
    """
    store = np.empty(count + 64 // like.itemsize, dtype=like.dtype)
    begin = (-store.ctypes.data % 64) // like.itemsize
    return store[begin : begin + count]


_SETTINGS = (
    *("OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT"),
    *("LOOP_VECTORIZE", "SLP_VECTORIZE", "USING_SVML"),
)
"""Settings of Numba, by environment variables, that change its code."""

_UNUSED_S = 30 * 86400.0  # after which code of other versions goes


def _read_sources() -> bytes:
    """Digest of the texts of all compiled functions and of the constants that they use."""
    here = Path(__file__).parent
    files = sorted([*here.rglob("*.py"), here.parent / "conventions.py"])
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).digest()


# Modules may be edited while a process runs. This is what it has imported.
try:
    _sources = _read_sources()
except OSError:  # an archive has no files that could be read so, and nothing is kept
    _sources = b""


@lru_cache(maxsize=1)
def _place(_named: str) -> tuple[Any, Path]:
    """Format and folder of the code that is kept, by the folder named in NUMBA_CACHE_DIR.

    Numba says where: in the folder that is named, beside the modules, or in the user's cache. The
    name of the folder there is one hash of all that the code is made from. Code of other versions
    is removed when no process has used it for a month.
    """
    if not _sources:
        raise OSError("the package is not in files")
    code = CompileResultCacheImpl(_increment)  # type: ignore[no-untyped-call]
    # Whatever changes the machine code: sources, versions, settings and the processor.
    made_from = (
        _sources,
        platform.python_version(),
        *(version(package) for package in ("numba", "llvmlite", "numpy")),
        *(str(getattr(config, name, None)) for name in _SETTINGS),
        cpu_target.target_context.codegen().magic_tuple(),
    )
    digest = hashlib.sha256(repr(made_from).encode()).hexdigest()[:16]
    folder = Path(code.locator.get_cache_path()) / f"rtradar-{digest}"
    folder.mkdir(parents=True, exist_ok=True)
    # The time of the folder says when a process last used it.
    os.utime(folder)
    for other in folder.parent.glob("rtradar-" + "?" * len(digest)):
        if time.time() - other.stat().st_mtime > _UNUSED_S:
            shutil.rmtree(other, ignore_errors=True)
    return code, folder


class _CodeOnDisk(NullCache):
    """Machine code of one function on disk, which Numba loads from here and saves here.

    Numba's own cache checks only the file of a function, not what is inlined into it from others.
    Whatever goes wrong (a damaged file, a full disk, another version of Numba), the function is
    compiled.
    """

    def __init__(self, dispatcher: Any) -> None:
        function = dispatcher.py_func
        self._name = f"{function.__module__}.{function.__qualname__}"

    def _file(self, sig: Any) -> tuple[Any, Path]:
        """Format and path of the code for these types of arguments."""
        code, folder = _place(config.CACHE_DIR)  # type: ignore[attr-defined]
        digest = hashlib.sha256(f"{self._name} {sig}".encode()).hexdigest()[:16]
        return code, folder / f"{self._name.rpartition('.')[2]}-{digest}.nbc"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        target_context.refresh()
        try:
            code, path = self._file(sig)
            data = path.read_bytes()
            # The file begins with a digest of the rest.
            if hashlib.sha256(data[32:]).digest() != data[:32]:  # damaged
                return None
            return code.rebuild(target_context, pickle.loads(data[32:]))
        except Exception:  # there is none yet, or `save_overload` says what is wrong
            return None

    def save_overload(self, sig: Any, result: Any) -> None:
        try:
            self.save(sig, result)
        except Exception as error:  # the code is in memory: a run does not end for want of a file
            _warn(error)

    def save(self, sig: Any, result: Any) -> Path | None:
        """Keep code; an error of any kind is raised where it cannot be kept."""
        code, path = self._file(sig)
        # A module that was edited since may have been imported later than the digest was taken: its
        # code does not belong to that digest.
        if code.check_cachable(result) and _read_sources() == _sources:
            data = dumps(code.reduce(result))  # type: ignore[no-untyped-call]
            with atomic_file(path) as file:
                file.write(hashlib.sha256(data).digest() + data)
        return path


_warned = False

CACHE_ADVICE = (
    "every process compiles anew, for a minute or so: name a folder that can be written in "
    "NUMBA_CACHE_DIR"
)
"""What it means that compiled code is not kept, and what helps."""


def _reason(error: Exception) -> str:
    """Say in one line why code is not kept."""
    text = "no folder for it can be written" if "no locator available" in str(error) else str(error)
    return " ".join(text.split()) or type(error).__name__


def _warn(error: Exception) -> None:
    """Warn once that code is not kept, in the process that starts workers and not in them."""
    global _warned
    if not _warned and multiprocessing.parent_process() is None:
        _warned = True
        text = f"compiled code is not kept ({_reason(error)}); {CACHE_ADVICE}"
        warnings.warn(text, CacheWarning, stacklevel=2)


def check_cache() -> None:
    """Warn where no folder for compiled code can be written, before workers start, which do not."""
    try:
        _place(config.CACHE_DIR)  # type: ignore[attr-defined]
    except Exception as error:  # also what another version of Numba may raise here
        _warn(error)


def try_cache() -> tuple[str, str]:
    """Compile a function, keep its code and load it again.

    Returned are where code is kept, or why it is not; and what to do about it, empty where all is
    well.
    """
    dispatcher: Any = compiled()(_increment)
    if not hasattr(dispatcher, "compile"):
        return (
            "nothing is compiled",
            "NUMBA_DISABLE_JIT is set, which makes all of it very slow: unset it",
        )
    cache, sig = dispatcher._cache, (types.int64,)
    dispatcher._cache = NullCache()  # whatever is there, it is compiled
    dispatcher.compile(sig)
    try:
        path = cache.save(sig, dispatcher.overloads[sig])
        if cache.load_overload(sig, dispatcher.targetctx) is None:
            raise OSError("what was written could not be loaded again")
    except Exception as error:
        return f"not kept: {_reason(error)}", f"compiled code is not kept; {CACHE_ADVICE}"
    return f"kept, in {path.parent}", ""


def _increment(number):
    return number + 1
