"""``rtradar bench --only kernels``: what each compiled kernel buys beside its plain reference.

Each kernel is held to its reference within the tolerance of its case by
``tests/kernels/test_references.py``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# These two fill the table.
import rtradar.bench.kernel_cases
import rtradar.bench.scatter_cases  # noqa: F401
from rtradar.bench.floors import best_s
from rtradar.bench.kernel_table import CASES

_LEAST_S = 0.2  # of repeats of each function


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
    rows = []
    for case in CASES.values():
        kernel, reference = case.make()
        found = difference(kernel(), reference())
        kernel_s, reference_s = best_s(kernel, _LEAST_S), best_s(reference, _LEAST_S)
        row = {"name": case.name, "does": case.does, "kernel_s": kernel_s}
        row |= {"reference_s": reference_s, "ratio": reference_s / kernel_s, "difference": found}
        rows.append(row)
    return rows
