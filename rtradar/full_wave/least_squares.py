"""Least squares with more rows than unknowns, some of which may be spoiled by rounding."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

_NEGLIGIBLE = 1e-13
"""Pivot, relative to the largest one, below which a source adds nothing but rounding."""


class LeastSquares(NamedTuple):
    """Pivoted orthogonal factors of a matrix.

    Attributes
    ----------
    q : (row, rank) complex128
        Orthonormal columns.
    r : (rank, rank) complex128
        Upper triangle.
    columns : (rank,) int64
        Unknowns that are used, in the order of the triangle.
    unknowns : int
        Number of all unknowns.
    """

    q: Field  # (row, rank)
    r: Field  # (rank, rank)
    columns: NDArray[np.int64]  # (rank,)
    unknowns: int

    @classmethod
    def of(cls, matrix: Field) -> LeastSquares:
        """Factorise a matrix (row, unknown), and leave out what rounding has spoiled."""
        q, r, pivots = qr(matrix, mode="economic", pivoting=True, check_finite=False)
        size = np.abs(np.diagonal(r))
        rank = int(np.count_nonzero(size > _NEGLIGIBLE * size[0]))
        return cls(q[:, :rank], r[:rank, :rank], pivots[:rank], matrix.shape[1])

    def solve(self, right: Field) -> tuple[Field, Array]:
        """Find solutions (unknown, case), and the squares of what they leave (case,)."""
        seen = self.q.conj().T @ right
        out = np.zeros((self.unknowns, right.shape[1]), dtype=np.complex128)
        out[self.columns] = solve_triangular(self.r, seen, check_finite=False)
        return out, np.sum(np.abs(right - self.q @ seen) ** 2, axis=0)
