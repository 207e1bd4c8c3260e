"""Shares of the return left to the parts of a body over 10 ms, node by node as they come to be asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class FresnelInterval:
    """Shares at both ends of 10 ms, and at nodes in between for parts whose share bends.

    Parameters
    ----------
    fine : (part,) bool
        Which parts have nodes in between.
    ends : (2, frequency, pair, part) complex128
    occluders : (part, part) bool
        Hidden first.
    inner : int
        Nodes in between.
    """

    def __init__(
        self,
        fine: NDArray[np.bool_],
        ends: NDArray[np.complex128],
        occluders: NDArray[np.bool_],
        inner: int,
    ) -> None:
        self.fine, self.ends, self.occluders = fine, ends, occluders
        # Of the parts that are fine alone, for the others would be many.
        self._column = np.cumsum(fine) - 1
        self._between = np.empty((inner, *ends.shape[1:-1], int(fine.sum())), dtype=np.complex128)
        self._known = np.zeros((inner, self._between.shape[-1]), dtype=bool)

    def missing(
        self, nodes: slice, parts: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Node and part of each share that is not known yet, of these nodes in between and parts."""
        own = parts[self.fine[parts]]
        node, which = np.nonzero(~self._known[nodes][:, self._column[own]])
        return np.arange(len(self._known))[nodes][node], own[which]

    def keep(
        self, node: NDArray[np.int64], part: NDArray[np.int64], shares: NDArray[np.complex128]
    ) -> None:
        """Remember ``shares (share, frequency, pair)``."""
        column = self._column[part]
        self._between[node, :, :, column], self._known[node, column] = shares, True

    def nodes(self, parts: NDArray[np.int64]) -> NDArray[np.complex128]:
        """All nodes (node, frequency, pair, part); of a part that is not fine the first and the last count."""
        ends, fine = self.ends[..., parts], self.fine[parts]
        nodes = np.repeat(ends[:1], len(self._between) + 2, axis=0)
        nodes[-1] = ends[1]
        nodes[1:-1, :, :, fine] = self._between[..., self._column[parts[fine]]]
        return nodes

    def beside(self, end: int, parts: NDArray[np.int64]) -> NDArray[np.complex128]:
        """The node next to the first (0) or the last (-1) one: (frequency, pair, part)."""
        fine = self.fine[parts]
        node = self.ends[-1 - end][..., parts]
        if fine.any():
            node[..., fine] = self._between[end][..., self._column[parts[fine]]]
        return node
