"""``rtradar bench --only kernels``: what each compiled kernel buys beside its plain reference.

A case, as `rtradar.bench.kernel_cases` and `rtradar.bench.scatter_cases` have them, is a function
of the module ``k`` of the kernel. It makes arguments, and returns two functions without arguments,
which call the kernel and its reference and give the same arrays. Each kernel is held to its
reference within the tolerance by ``tests/kernels/test_references.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from rtradar.bench.floors import best_s

Call = Callable[[], Any]
"""Returns an array, or a tuple of arrays."""

Calls = tuple[Call, Call]
"""Of a kernel and of its reference."""

_LEAST_S = 0.2  # of repeats of each function


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


def difference(found: Any, expected: Any) -> float:
    """Largest difference over the largest magnitude expected, of the worst pair of arrays.

    NaN where any of the arrays holds it, so that no tolerance lets it pass.
    """
    differences = [
        np.abs(np.asarray(one, np.complex128) - np.reshape(other, np.shape(one))).max(initial=0)
        / max(float(np.abs(other).max(initial=0)), 1e-300)
        for one, other in zip(_arrays(found), _arrays(expected), strict=True)
    ]
    return float(np.max(differences))  # Python's max would lose a NaN that comes later


def _arrays(values: Any) -> tuple[Any, ...]:
    return values if isinstance(values, tuple) else (values,)


def measure_kernels() -> list[dict[str, Any]]:
    """A row for each kernel: best times [s] of both, their ratio, and the largest difference."""
    import rtradar.bench.kernel_cases  # (fills CASES)
    import rtradar.bench.scatter_cases  # noqa: F401

    rows = []
    for case in CASES.values():
        kernel, reference = case.make()
        found = difference(kernel(), reference())
        kernel_s, reference_s = best_s(kernel, _LEAST_S), best_s(reference, _LEAST_S)
        row = {"name": case.name, "does": case.does, "kernel_s": kernel_s}
        row |= {"reference_s": reference_s, "ratio": reference_s / kernel_s, "difference": found}
        rows.append(row)
    return rows
