"""How Numba compiles loops: on first use, and kept on disk for every later one."""

from __future__ import annotations

import multiprocessing
import warnings
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numba import njit, types
from numba.core.caching import CompileResultCacheImpl, IndexDataCacheFile, NullCache
from numba.core.registry import cpu_target
from numba.extending import register_jitable

from rtradar.kernels.code_stamp import note_options, stamp_of

_Function = Callable[..., Any]


class CacheWarning(UserWarning):
    """Compiled code cannot be kept on disk: results are right, but every process compiles again."""


class _NeverFound(dict[Any, Any]):
    """What Numba has compiled of its own functions, products of complex numbers for one.

    It looks there before it compiles one again, by name and types but not by ``fastmath``, which
    would be that of whoever came first: how a function rounds would depend on what its process
    compiled before. So that each has its own, nothing is found.
    """

    def get(self, key: Any, default: Any = None) -> Any:
        return default


cpu_target.target_context.cached_internal_func = _NeverFound()


def compiled(*, fastmath: bool | set[str] = False) -> Callable[[_Function], _Function]:
    """Compile a function that Python calls.

    It lets other threads run, keeps its code on disk, and divides by zero as NumPy does. The code
    is loaded again as long as all that went into it is the same, functions and constants of other
    modules included. Where it cannot be kept, a `CacheWarning` says so once. ``fastmath`` are the
    liberties that LLVM may take with floating point: all of them, or those named.
    """
    numba_decorator: Callable[[_Function], Any] = njit(
        nogil=True, error_model="numpy", fastmath=fastmath
    )

    def decorator(function: _Function) -> _Function:
        dispatcher = numba_decorator(function)
        if hasattr(dispatcher, "compile"):  # not so with NUMBA_DISABLE_JIT
            dispatcher._cache = _CodeOnDisk(dispatcher)
            _functions[f"{function.__module__}.{function.__qualname__}"] = dispatcher
        return dispatcher

    return decorator


def inlined(*, fastmath: bool | set[str] = False) -> Callable[[_Function], _Function]:
    """Compile a function into each compiled one that calls it; called by Python it is plain Python.

    Nothing is compiled that only Python or a later process would use. And only inlined code rounds
    alike whether its caller was just compiled or comes from disk. ``fastmath`` is that of
    `compiled`, for what this function does.
    """
    options = {"forceinline": True, "error_model": "numpy", "fastmath": fastmath}
    numba_decorator: Callable[[_Function], _Function] = register_jitable(**options)

    def decorator(function: _Function) -> _Function:
        note_options(function, options)
        return numba_decorator(function)

    return decorator


@inlined()
def on_cache_lines(count, like):
    """An array (count,) of the kind of ``like`` that begins where a cache line does.

    From elsewhere, every load of 64 bytes would touch two lines: the prime-factor DFT then takes
    1.17 to 1.34 times as long, the tone sum 1.11 to 1.25 (`validation/cost/alignment.py`).
    """
    store = np.empty(count + 64 // like.itemsize, dtype=like.dtype)
    begin = (-store.ctypes.data % 64) // like.itemsize
    return store[begin : begin + count]


class _CodeOnDisk(NullCache):
    """Machine code of one function on disk, which Numba loads from here and saves here.

    Numba's own cache checks only the file of a function, not what is inlined into it from others.
    Here code is kept under the function's stamp (`code_stamp`), taken whenever code is needed, in
    the folders and formats of Numba. Whatever goes wrong, be it a damaged file, a full disk or
    another version of Numba, the function is compiled.
    """

    def __init__(self, dispatcher: Any) -> None:
        self.trouble = ""
        self._dispatcher = dispatcher
        self._stamp = ""
        self._file: Any = None

    @cached_property
    def _format(self) -> Any:
        """Folder and format of this function's code; None where no folder can be written."""
        try:
            return CompileResultCacheImpl(self._dispatcher.py_func)  # type: ignore[no-untyped-call]
        except Exception as error:  # also what another version of Numba may raise here
            no_folder = "no locator available" in str(error)
            self._warn("no folder for it can be written" if no_folder else error)
            return None

    @property
    def cache_path(self) -> Any:
        return None if self._format is None else self._format.locator.get_cache_path()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        target_context.refresh()
        file = self._take_stamp()
        try:
            found = None if file is None else file.load(self._key(sig))
            if found is None:
                return None
            # Processes that compile for other arguments, or another text, may have written it, too.
            stamp, arguments, code = found
            if (stamp, arguments) != (self._stamp, sig):
                return None
            return self._format.rebuild(target_context, code)
        except Exception:  # a damaged file raises almost anything
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        file = self._file
        try:
            if file is None or not self._format.check_cachable(data):
                return
            self._format.locator.ensure_cache_path()
            entry = self._stamp, sig, self._format.reduce(data)
            try:
                file.save(self._key(sig), entry)
            except OSError:
                raise
            except Exception:  # a damaged index
                file.flush()
                file.save(self._key(sig), entry)
        except Exception as error:  # the code is in memory: a run does not end for want of a file
            self._warn(error)

    def has_code(self) -> bool:
        """Whether there is code of the function as it is now."""
        file = self._take_stamp()
        try:
            return file is not None and bool(file._load_index())
        except Exception:  # a damaged index raises almost anything
            return False

    def _take_stamp(self) -> Any:
        """File of the function as it is now; None where it has none."""
        self._file = None
        if self._format is not None:
            try:
                self._stamp = stamp_of(self._dispatcher)
                self._file = IndexDataCacheFile(  # type: ignore[no-untyped-call]
                    cache_path=self.cache_path,
                    filename_base=self._format.filename_base,
                    source_stamp=self._stamp,
                )
            except Exception as error:  # also what another version of Numba may raise here
                self._warn(error)
        return self._file

    def _key(self, sig: Any) -> Any:
        return sig, self._dispatcher.targetctx.codegen().magic_tuple()

    def _warn(self, why: object) -> None:
        """Warn once that code is not kept, in the process that starts workers and not in them."""
        global _warned
        text = why.strerror if isinstance(why, OSError) and why.strerror else str(why)
        self.trouble = " ".join(text.split()) or type(why).__name__
        if not _warned and multiprocessing.parent_process() is None:
            _warned = True
            text = f"compiled code is not kept ({self.trouble}); {CACHE_ADVICE}"
            warnings.warn(text, CacheWarning, stacklevel=2)


_warned = False
_functions: dict[str, _Function] = {}

CACHE_ADVICE = (
    "every process compiles anew, for a minute or so: name a folder that can be written in "
    "NUMBA_CACHE_DIR"
)
"""What it means that compiled code is not kept, and what helps."""


def is_on_disk(function: _Function) -> bool:
    """Whether any process here has compiled a function before, or none can do so for this one.

    True, too, where code is not kept and where nothing is compiled (``NUMBA_DISABLE_JIT``).
    """
    cache = getattr(function, "_cache", None)
    return not isinstance(cache, _CodeOnDisk) or cache.cache_path is None or cache.has_code()


def functions_to_compile() -> set[str]:
    """Compiled functions, of modules imported so far, of which there is no code on disk.

    None where code is not kept, and where nothing is compiled.
    """
    return {name for name, function in _functions.items() if not is_on_disk(function)}


def check_cache() -> None:
    """Warn where no folder for compiled code can be written, before workers start, which do not."""
    is_on_disk(compiled()(_increment))


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
    cache.load_overload(sig, dispatcher.targetctx)  # as Numba does first
    dispatcher._cache = NullCache()  # whatever is there, it is compiled
    dispatcher.compile(sig)
    cache.save_overload(sig, dispatcher.overloads[sig])
    trouble = cache.trouble
    if not trouble and cache.load_overload(sig, dispatcher.targetctx) is None:
        trouble = "what was written could not be loaded again"
    if trouble:
        return f"not kept: {trouble}", f"compiled code is not kept; {CACHE_ADVICE}"
    return f"kept, for one in {cache.cache_path}", ""


def _increment(number):
    return number + 1
