"""``rtradar bench --only kernels``: what each compiled kernel buys beside its plain reference.

A case is a function that makes arguments, as `rtradar.bench.kernel_cases` and
`rtradar.bench.scatter_cases` have them. It returns two functions without arguments, which call the
kernel and its reference and give the same arrays. ``tests/kernels/test_references.py`` holds each
kernel to its reference within the tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtradar.bench.floors import best_s

Call = Callable[[], Any]
"""Returns an array, or a tuple of arrays."""

_LEAST_S = 0.2  # of repeats of each function


@dataclass(frozen=True)
class KernelCase:
    """One kernel and what it is compared with.

    Parameters
    ----------
    name : str
        Module and function below `rtradar.kernels`.
    does : str
        What the kernel computes, and the size of the case, in a few words.
    tolerance : float
        Largest allowed difference, relative to the largest magnitude of the reference.
    make : callable
        Makes the arguments, and returns the calls of the kernel and of the reference.
    """

    name: str
    does: str
    tolerance: float
    make: Callable[[], tuple[Call, Call]]


CASES: dict[str, KernelCase] = {}


def kernel_case(name: str, does: str, tolerance: float = 1e-12) -> Callable[[Any], Any]:
    """Register the decorated function as the case of a kernel; see `KernelCase`."""

    def add(make: Callable[[], tuple[Call, Call]]) -> Callable[[], tuple[Call, Call]]:
        CASES[name] = KernelCase(name, does, tolerance, make)
        return make

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
    pairs = [
        (np.asarray(one), np.asarray(other).reshape(np.shape(one)))
        for one, other in zip(_arrays(found), _arrays(expected), strict=True)
    ]
    found_by_pair = [
        np.abs(one.astype(np.complex128) - other).max(initial=0)
        / max(float(np.abs(other).max(initial=0)), 1e-300)
        for one, other in pairs
    ]
    return float(np.max(found_by_pair))  # Python's max would lose a NaN that comes later


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
        rows.append(
            {
                "name": case.name,
                "does": case.does,
                "kernel_s": kernel_s,
                "reference_s": reference_s,
                "ratio": reference_s / kernel_s,
                "difference": found,
            }
        )
    return rows
