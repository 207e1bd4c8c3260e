"""Stamps of compiled functions: equal where the same machine code comes of them, and only there.

The code of a function contains that of each function that it calls, the values of constants, and
the options of Numba for all of these. They are read from the functions in memory and not from
files, because a module may have been edited since it was imported.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Iterable
from functools import cache
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba import config
from numba.extending import is_jitted

_Description = tuple[Any, ...]
_Function = Callable[..., Any]


class UnknownCodeError(TypeError):
    """A compiled function uses a value of a kind that has no stamp."""


_LIBRARIES = {"builtins", "cmath", "math", "numba", "numpy"}
"""Libraries whose functions are described by name: each stamp has their versions, and the name of
each file that of Python."""

_FLAGS = "OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "USING_SVML"
"""Settings of Numba, by environment variables, that change its code but not its cache."""

_CODE = (
    *("co_argcount", "co_kwonlyargcount", "co_varnames", "co_names", "co_freevars", "co_cellvars"),
    *("co_code", "co_exceptiontable"),
)

_CODE_FLAGS = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS | inspect.CO_GENERATOR
"""Flags that affect machine code; while a profiler runs, Numba removes others."""

_VALUES = type(None), type(...), bool, int, float, complex, str, bytes, np.generic, np.dtype

_options: dict[_Function, dict[str, Any]] = {}


def note_options(function: _Function, options: dict[str, Any]) -> None:
    """Remember the options of Numba for a Python function that is inlined; stamps contain them."""
    _options[function] = options


def stamp_of(function: _Function) -> str:
    """Stamp of a compiled function, of all that it calls and of all constants that these use.

    It is the same in each process in which these are. An `UnknownCodeError` is raised if it uses a
    value of which this module cannot tell whether it is the same.
    """
    versions = np.__version__, *(str(getattr(config, name, None)) for name in _FLAGS)
    return hashlib.sha256(repr((versions, _described(function, (), {}))).encode()).hexdigest()


def _described(value: Any, names: Iterable[str], seen: dict[int, int]) -> _Description:
    """Nested tuples of plain values whose text is the same in each process.

    ``names`` are those that the code around the value uses.
    """
    if isinstance(value, _VALUES):
        return type(value).__name__, repr(value)
    if isinstance(value, tuple | list):
        return type(value).__name__, *(_described(item, names, seen) for item in value)
    if isinstance(value, set | frozenset):
        return "set", *sorted(_described(item, names, seen) for item in value)
    if isinstance(value, dict):
        items = sorted(value.items())
        return "dict", *((key, _described(item, names, seen)) for key, item in items)
    if isinstance(value, np.ndarray):
        digest = hashlib.sha256(value.tobytes()).hexdigest()
        return "array", value.dtype.str, value.shape, value.strides, digest
    if isinstance(value, CodeType):
        return "code", _code_digest(value)
    if isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields"):
        return "named tuple", value.__qualname__, value._fields
    of_library = isinstance(value, ModuleType | type | FunctionType | BuiltinFunctionType)
    home = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
    if of_library and str(home).partition(".")[0] in _LIBRARIES:
        return "library", home, getattr(value, "__qualname__", "")
    # Functions may call themselves and each other.
    if id(value) in seen:
        return "again", seen[id(value)]
    seen[id(value)] = len(seen)
    if isinstance(value, ModuleType):
        used = {name: getattr(value, name) for name in names if hasattr(value, name)}
        return "module", *((name, _described(item, names, seen)) for name, item in used.items())
    if isinstance(value, FunctionType):
        options = _described(_options.get(value), (), seen)
        return "function", options, _described_function(value, seen)
    if is_jitted(value):
        options = _described(value.targetoptions, (), seen)
        return "compiled", options, _described(value.py_func, (), seen)
    raise UnknownCodeError(f"a compiled function uses what has no stamp: {value!r:.80}")


def _described_function(function: FunctionType, seen: dict[int, int]) -> _Description:
    code = function.__code__
    # Names of attributes, too, which equal those of globals now and then: then the stamp covers
    # more than it must.
    names = sorted(_names(code))
    used = {name: function.__globals__[name] for name in names if name in function.__globals__}
    cells = zip(code.co_freevars, function.__closure__ or (), strict=True)
    used |= {name: cell.cell_contents for name, cell in cells}
    return _described((code, function.__defaults__, function.__kwdefaults__, used), names, seen)


@cache
def _code_digest(code: CodeType) -> str:
    """Digest of bytecode and its constants, without line numbers and file names."""
    own = *(getattr(code, name) for name in _CODE), code.co_flags & _CODE_FLAGS
    return hashlib.sha256(repr((*own, _described(code.co_consts, (), {}))).encode()).hexdigest()


@cache
def _names(code: CodeType) -> frozenset[str]:
    """Names of globals and attributes in a function and in those inside it."""
    inside = (_names(item) for item in code.co_consts if isinstance(item, CodeType))
    return frozenset(code.co_names).union(*inside)
