"""A uniform sample of a stream that is too long to keep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.system.seeds import check_seed, stream

_WITH_REPLACEMENT = 1
"""Marks the random stream that draws with replacement, apart from that of the keys."""


class UniformSample:
    """Rows of a stream, every subset of them equally likely: each row gets a random key, those with the least keys stay.

    All the memory it ever takes it takes at once.

    Parameters
    ----------
    n_rows : int
        Rows kept.
    seed : int
        Of the keys; the same stream and seed give the same sample, however the stream is cut.
    columns : int
        Numbers in a row.

    Attributes
    ----------
    n_seen : int
        Rows so far.

    Raises
    ------
    InputError
        Where ``n_rows`` or ``seed`` is out of its range.
    """

    def __init__(self, n_rows: int, seed: int, columns: int = 3) -> None:
        if isinstance(n_rows, bool) or not isinstance(n_rows, int | np.integer) or n_rows < 1:
            raise InputError(f"cloud: n_points = {n_rows!r}; it must be a whole number, at least 1")
        self._n_rows = int(n_rows)
        self._seed = check_seed("cloud: ", seed)
        self._random = np.random.default_rng(stream(self._seed))
        self._keys = np.full(self._n_rows, np.inf)  # of places that no row has taken yet
        self._rows = np.full((self._n_rows, columns), np.nan)
        self.n_seen = 0

    def add(self, rows: NDArray[np.float64]) -> None:
        """Take the next rows, (row, column) float64.

        Parameters
        ----------
        rows : (row, column) float64
        """
        keys = np.concatenate([self._keys, self._random.random(len(rows))])
        least = np.argpartition(keys, self._n_rows - 1)[: self._n_rows]
        is_new = least >= self._n_rows
        free = np.ones(self._n_rows, dtype=bool)
        free[least[~is_new]] = False
        self._keys[free] = keys[least[is_new]]
        self._rows[free] = rows[least[is_new] - self._n_rows]
        self.n_seen += len(rows)

    def rows(self) -> NDArray[np.float64]:
        """The sample, at most ``n_rows``, in random order: any first part of it is a sample too."""
        return np.asarray(self._rows[np.argsort(self._keys)[: self.n_seen]])

    def filled(self) -> NDArray[np.float64]:
        """Exactly ``n_rows``: drawn with replacement where fewer were seen; none where none was."""
        rows = self.rows()
        if not 0 < len(rows) < self._n_rows:
            return rows
        return rows[
            np.random.default_rng(stream(self._seed, _WITH_REPLACEMENT)).integers(
                len(rows), size=self._n_rows
            )
        ]
