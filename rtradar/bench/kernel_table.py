"""The table of compiled kernels, each with a case that calls it and its plain reference.

A case is a function of the module ``k`` of the kernel. It makes arguments, and returns two
functions without arguments, which call the kernel and its reference and give the same arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

Call = Callable[[], Any]
"""Returns an array, or a tuple of arrays."""

Calls = tuple[Call, Call]
"""Of a kernel and of its reference."""


class KernelCase(NamedTuple):
    """One kernel and what it is compared with."""

    name: str  # module and function below `rtradar.kernels`
    does: str  # what it computes, and the size of the case, in a few words
    tolerance: float  # largest allowed difference, relative to the reference's largest magnitude
    calls_of: Callable[[ModuleType], Calls]

    def make(self) -> Calls:
        """Make the arguments, and return the calls of the kernel and of the reference."""
        return self.calls_of(import_module(f"rtradar.kernels.{self.name.rpartition('.')[0]}"))


CASES: dict[str, KernelCase] = {}


def kernel_case(name: str, does: str, tolerance: float = 1e-12) -> Callable[[Any], Any]:
    """Register the decorated function as the case of a kernel; see `KernelCase`."""

    def add(calls_of: Callable[[ModuleType], Calls]) -> Callable[[ModuleType], Calls]:
        CASES[name] = KernelCase(name, does, tolerance, calls_of)
        return calls_of

    return add


def filled(
    kernel: Callable[..., Any], *arguments: Any, out: tuple[np.ndarray, ...], adds: bool = False
) -> Call:
    """A call of a kernel that fills its last arguments ``out``, or ``adds`` to zeros there."""

    def call() -> tuple[np.ndarray, ...]:
        for array in out if adds else ():
            array[...] = 0
        kernel(*arguments, *out)
        return out

    return call
