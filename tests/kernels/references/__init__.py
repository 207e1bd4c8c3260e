"""A reference in plain NumPy for each compiled kernel, and the cases in which both are compared.

Each module has a group of kernels: first a reference, and after it the case that calls it.
"""

# Each of these modules puts its cases into the table.
from references import (  # noqa: F401
    double_reflections,
    facets,
    full_wave,
    motion,
    processing,
    rays,
    receiver,
    rooms,
    signal,
    silhouettes,
    specular_point,
)
from references.cases import CASES

__all__ = ["CASES"]
