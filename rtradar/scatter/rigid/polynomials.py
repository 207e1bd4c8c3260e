"""Knots in time, evenly spaced: polynomials through the fields of the eight about each chirp."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rtradar.scatter.common.interpolation import interpolation_weights

_COUNT = 8
_OFFSETS = np.arange(_COUNT) - _COUNT // 2 + 1


class PolynomialsInTime:
    """The knots ``numbers (knot,)`` about times [s], at these numbers of ``apart`` seconds."""

    def __init__(self, times: NDArray[np.float64], apart: float) -> None:
        before = np.floor(times / apart).astype(np.int64)
        around = before[:, None] + _OFFSETS
        self.numbers = np.unique(around)
        weights = interpolation_weights(_OFFSETS.astype(np.float64), times / apart - before)
        ends = np.arange(len(times) + 1) * _COUNT
        given = weights.ravel(), np.searchsorted(self.numbers, around).ravel(), ends
        self._weights = csr_array(given, shape=(len(times), len(self.numbers)))

    def between(
        self, field: NDArray[np.complex128], tx: NDArray[np.int64]
    ) -> NDArray[np.complex64]:
        """Compute amplitudes (node, chirp, rx, echo) of chirps, each of its Tx ``tx (chirp,)``.

        They are those of the polynomials through ``field (knot, tx, rx, node, echo)``.
        """
        _, _, receivers, nodes, echoes = field.shape
        out = np.empty((nodes, len(tx), receivers, echoes), dtype=np.complex64)
        for number in np.unique(tx):
            own = np.flatnonzero(tx == number)
            # Weights are real: real and imaginary parts are columns of their own.
            columns = np.ascontiguousarray(field[:, number]).reshape(len(field), -1)
            found = np.ascontiguousarray(self._weights[own] @ columns.view(np.float64))
            shaped = found.view(np.complex128).reshape(len(own), receivers, nodes, echoes)
            out[:, own] = np.moveaxis(shaped, 2, 0)
        return out
