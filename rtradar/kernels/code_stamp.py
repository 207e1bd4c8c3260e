"""Stamps of compiled functions: equal where the same machine code comes of them, other where anything in it has changed.

Into the code of a function goes that of each function that it calls, of constants the values, and what Numba was told of all of
these. It is read from the functions in memory and not from files: a module may have been edited since it was imported.
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
"""What these provide is known by its name: their versions are in each stamp, and Python's in the name of each file."""

_FLAGS = "OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "USING_SVML"
"""Settings of Numba, by environment variables, that change the code it makes and that its own cache overlooks."""

_CODE = (
    "co_argcount",
    "co_kwonlyargcount",
    "co_varnames",
    "co_names",
    "co_freevars",
    "co_cellvars",
    "co_code",
    "co_exceptiontable",
)

_CODE_FLAGS = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS | inspect.CO_GENERATOR
"""Flags of bytecode that go into machine code; while a profiler runs, Numba takes others off as it calls a function."""

_VALUES = type(None), type(...), bool, int, float, complex, str, bytes, np.generic, np.dtype

_options: dict[_Function, dict[str, Any]] = {}


def note_options(function: _Function, options: dict[str, Any]) -> None:
    """Remember what Numba was told of a function that is compiled into others; it belongs to their stamps.

    Parameters
    ----------
    function : callable
        A Python function, not yet compiled.
    options : dict
        Keyword arguments of Numba's decorator.
    """
    _options[function] = options


def stamp_of(function: _Function) -> str:
    """Stamp of a compiled function, of all that it calls and of all constants that these use.

    Parameters
    ----------
    function : callable
        Made by a decorator of Numba.

    Returns
    -------
    str
        Hexadecimal; the same in each process in which these are the same.

    Raises
    ------
    UnknownCodeError
        Where something goes into the code of which this module cannot tell whether it is the same.
    """
    versions = np.__version__, *(str(getattr(config, name, None)) for name in _FLAGS)
    return hashlib.sha256(repr((versions, _described(function, (), {}))).encode()).hexdigest()


def _described(value: Any, names: Iterable[str], seen: dict[int, int]) -> _Description:
    """Nested tuples of plain values whose text is the same in each process; ``names`` are those that the code around it uses."""
    if isinstance(value, _VALUES):
        return type(value).__name__, repr(value)
    if isinstance(value, tuple | list):
        return type(value).__name__, *(_described(item, names, seen) for item in value)
    if isinstance(value, set | frozenset):
        return "set", *sorted(_described(item, names, seen) for item in value)
    if isinstance(value, dict):
        return "dict", *(
            (key, _described(item, names, seen)) for key, item in sorted(value.items())
        )
    if isinstance(value, np.ndarray):
        return (
            "array",
            value.dtype.str,
            value.shape,
            value.strides,
            hashlib.sha256(value.tobytes()).hexdigest(),
        )
    if isinstance(value, CodeType):
        return "code", _code_digest(value)
    if isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields"):
        return "named tuple", value.__qualname__, value._fields
    home = (
        value.__name__ if isinstance(value, ModuleType) else str(getattr(value, "__module__", None))
    )
    if (
        isinstance(value, ModuleType | type | FunctionType | BuiltinFunctionType)
        and home.partition(".")[0] in _LIBRARIES
    ):
        return "library", home, getattr(value, "__qualname__", "")
    # Functions may call themselves and each other.
    if id(value) in seen:
        return "again", seen[id(value)]
    seen[id(value)] = len(seen)
    if isinstance(value, ModuleType):
        return "module", *(
            (name, _described(getattr(value, name), names, seen))
            for name in names
            if hasattr(value, name)
        )
    if isinstance(value, FunctionType):
        return (
            "function",
            _described(_options.get(value), (), seen),
            _described_function(value, seen),
        )
    if is_jitted(value):
        return (
            "compiled",
            _described(value.targetoptions, (), seen),
            _described(value.py_func, (), seen),
        )
    raise UnknownCodeError(f"a compiled function uses what has no stamp: {value!r:.80}")


def _described_function(function: FunctionType, seen: dict[int, int]) -> _Description:
    code = function.__code__
    # Of attributes, too, which share names with globals now and then: then the stamp covers more than it must.
    names = sorted(_names(code))
    used: dict[str, Any] = {
        name: function.__globals__[name] for name in names if name in function.__globals__
    }
    used |= {
        name: cell.cell_contents
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True)
    }
    return _described((code, function.__defaults__, function.__kwdefaults__, used), names, seen)


@cache
def _code_digest(code: CodeType) -> str:
    """Of bytecode and of the constants in it; not of line numbers and file names, which do not go into machine code."""
    parts = (
        *(getattr(code, name) for name in _CODE),
        code.co_flags & _CODE_FLAGS,
        _described(code.co_consts, (), {}),
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()


@cache
def _names(code: CodeType) -> frozenset[str]:
    """Names of globals and attributes in a function and in those inside it."""
    return frozenset(code.co_names).union(
        *(_names(item) for item in code.co_consts if isinstance(item, CodeType))
    )
