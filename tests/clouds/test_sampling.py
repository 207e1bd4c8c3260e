"""A uniform sample of a stream."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtradar.clouds.rdt import UniformSample
from rtradar.errors import InputError


def stream(n: int, cuts: list[int], n_rows: int, seed: int = 0) -> UniformSample:
    sample = UniformSample(n_rows, seed, columns=2)
    rows = np.column_stack([np.arange(n), -np.arange(n)]).astype(float)
    for part in np.split(rows, sorted(min(cut, n) for cut in cuts)):
        sample.add(part)
    return sample


@settings(max_examples=50)
@given(
    n=st.integers(0, 60), n_rows=st.integers(1, 40), cuts=st.lists(st.integers(0, 60), max_size=4)
)
def test_rows_are_of_the_stream_without_repeats_however_it_is_cut(
    n: int, n_rows: int, cuts: list[int]
) -> None:
    sample = stream(n, cuts, n_rows)
    rows = sample.rows()
    assert sample.n_seen == n
    assert len(rows) == len({*rows[:, 0]}) == min(n, n_rows)
    np.testing.assert_array_equal(rows[:, 0], -rows[:, 1])
    np.testing.assert_array_equal(rows, stream(n, [], n_rows).rows())


@given(n=st.integers(0, 20))
def test_filled_repeats_rows_where_there_are_too_few(n: int) -> None:
    filled = stream(n, [], 10).filled()
    assert len(filled) == (10 if n else 0)
    assert {*filled[:, 0]} <= set(range(n))


def test_every_row_is_as_likely() -> None:
    counts, first = np.zeros(20), np.zeros(20)
    for seed in range(2000):
        chosen = stream(20, [7], 5, seed).rows()[:, 0].astype(int)
        counts[chosen] += 1
        first[chosen[0]] += 1
    # 500 each, standard deviation sqrt(2000 x 1/4 x 3/4) = 19.4: five of them.
    assert np.abs(counts - 500).max() < 97
    # And 100 each come first, standard deviation 9.7: the first part of a sample is a sample.
    assert np.abs(first - 100).max() < 49


@pytest.mark.parametrize(("n_rows", "seed"), [(0, 0), (1.5, 0), (True, 0), (3, -1)])
def test_counts_are_counts(n_rows: object, seed: int) -> None:
    with pytest.raises(InputError, match="whole number"):
        UniformSample(n_rows, seed)  # type: ignore[arg-type]
