"""The table of kernels and of the cases in which each is compared with its reference."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

Pair = tuple[Any, Any]
"""What a kernel and its reference give: an array each, or a tuple of arrays."""

UNTOUCHED = 77
"""Stands in arrays before a kernel fills them, so that what it leaves out is noticed."""


class OfEach(float):
    """Tolerance relative to the magnitude of each number, and not to the largest one."""


class KernelCase(NamedTuple):
    """Cases of one kernel: one for each combination of the options of ``results``."""

    results: Callable[..., Pair]
    tolerance: float | tuple[float, ...]  # of all arrays, or of each in turn
    options: dict[str, Sequence[Any]]

    def variants(self) -> Iterator[dict[str, Any]]:
        """All combinations of the options."""
        for values in product(*self.options.values()):
            yield dict(zip(self.options, values, strict=True))


CASES: dict[str, KernelCase] = {}
"""By the name of the kernel below `rtradar.kernels`."""


def kernel_case(
    kernel: Callable[..., Any], tolerance: float | tuple[float, ...] = 1e-12, **options: Any
) -> Callable[[Callable[..., Pair]], Callable[..., Pair]]:
    """Register the decorated function, which calls a kernel and its reference, as its case."""
    name = f"{kernel.__module__}.{kernel.__name__}".removeprefix("rtradar.kernels.")

    def add(results: Callable[..., Pair]) -> Callable[..., Pair]:
        CASES[name] = KernelCase(results, tolerance, options)
        return results

    return add


def filled(
    kernel: Callable[..., Any], *given: Any, out: tuple[np.ndarray, ...], adds: bool = False
) -> tuple[np.ndarray, ...]:
    """Call a kernel that fills its last arguments ``out``, or ``adds`` to zeros; return these."""
    for array in out:
        array.fill(0 if adds else UNTOUCHED)
    kernel(*given, *out)
    return out


def assert_close(found: Any, expected: Any, tolerance: float | tuple[float, ...]) -> None:
    """Compare arrays pair by pair; a tolerance is relative to the largest magnitude expected.

    What is no number is close to nothing.
    """
    found, expected = (v if isinstance(v, tuple) else (v,) for v in (found, expected))
    each = tolerance if isinstance(tolerance, tuple) else (tolerance,) * len(found)
    for one, other, own in zip(found, expected, each, strict=True):
        one = np.asarray(one, dtype=np.complex128)
        other = np.reshape(other, one.shape).astype(np.complex128)
        largest = np.abs(other).max(initial=0)
        rtol, atol = (own, 0) if isinstance(own, OfEach) else (0, own * largest)
        np.testing.assert_allclose(one, other, rtol=rtol, atol=atol, equal_nan=False)


def samples(*shape: int, seed: int = 0) -> np.ndarray:
    """Complex normal numbers of single precision."""
    parts = np.random.default_rng(seed).standard_normal((*shape, 2), dtype=np.float32)
    return parts.view(np.complex64)[..., 0]
