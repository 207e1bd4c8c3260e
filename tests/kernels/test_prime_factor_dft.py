from __future__ import annotations

import os
import subprocess
import sys
from math import gcd
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from references.processing import doppler_power_reference
from rtradar.kernels.prime_factor_dft import add_doppler_power, pick_cells, prime_factor_dft

PRODUCTS = [
    (
        n,
        [
            (a, n // a)
            for a in range(2, 41)
            if n % a == 0 and 2 <= n // a <= 40 and gcd(a, n // a) == 1
        ],
    )
    for n in range(1, 700)
]


def test_it_serves_numbers_of_cycles_with_two_small_coprime_factors_and_no_others() -> None:
    for n_cycles, pairs in PRODUCTS:
        assert (prime_factor_dft(n_cycles) is not None) == bool(pairs), n_cycles


@given(
    n_cycles=st.sampled_from([n for n, pairs in PRODUCTS if pairs]),
    channels=st.integers(1, 3),
    n_range=st.sampled_from([1, 5, 64, 65, 130, 257, 600]),
    seed=st.integers(0, 2**32 - 1),
)
def test_it_is_the_power_of_the_dft_and_picks_its_cells(
    n_cycles: int, channels: int, n_range: int, seed: int
) -> None:
    rng, dft = np.random.default_rng(seed), prime_factor_dft(n_cycles)
    assert dft is not None
    parts = rng.standard_normal((n_cycles, channels + 1, n_range, 2)).astype(np.float32)
    spectra, own = parts.view(np.complex64)[..., 0], range(1, channels + 1)
    weights = rng.uniform(0, 1, n_cycles).astype(np.float32)
    before = rng.uniform(0, 1, (n_cycles, n_range)).astype(np.float32)
    power = before.copy()
    add_doppler_power(spectra, own, weights, dft, power)
    expected = doppler_power_reference(spectra, own, weights)
    # Rounding of float32 sums of some hundred terms, beside the largest.
    np.testing.assert_allclose(power - before, expected, rtol=0, atol=3e-6 * expected.max())
    turns, listed = rng.integers(n_cycles, size=7), rng.permutation(n_range)[:300]
    at = rng.integers(len(listed), size=(7, 2))
    values = np.full((7, 2, channels + 1), np.nan, np.complex64)
    pick_cells(spectra, own, weights, dft, (turns, at, listed), values)
    # The other channels are left as they are.
    assert np.isnan(values[..., 0]).all()
    whole = np.fft.fft(spectra * weights[:, None, None], axis=0)
    chosen = whole[turns[:, None], 1:, listed[at]]
    np.testing.assert_allclose(values[..., 1:], chosen, rtol=0, atol=3e-6 * np.abs(whole).max())


@pytest.mark.parametrize("factor", range(2, 41))
def test_it_serves_every_factor(factor: int) -> None:
    n_cycles = factor * (37 if factor != 37 else 36)  # 37 stays whole, and so does the other
    dft = prime_factor_dft(n_cycles)
    assert dft is not None
    rng = np.random.default_rng(factor)
    spectra = rng.standard_normal((n_cycles, 1, 3, 2), dtype=np.float32).view(np.complex64)[..., 0]
    weights, power = np.ones(n_cycles, dtype=np.float32), np.zeros((n_cycles, 3), dtype=np.float32)
    add_doppler_power(spectra, range(1), weights, dft, power)
    expected = doppler_power_reference(spectra, range(1), weights)
    np.testing.assert_allclose(power, expected, rtol=0, atol=3e-6 * expected.max())


BOUNDS = """
import numpy as np
from rtradar.kernels.prime_factor_dft import add_doppler_power, prime_factor_dft
for n_cycles in (2 * 37, 38 * 37, 39 * 37, 40 * 37):
    spectra, power = np.ones((n_cycles, 1, 3), np.complex64), np.zeros((n_cycles, 3), np.float32)
    weights, dft = np.ones(n_cycles, np.float32), prime_factor_dft(n_cycles)
    add_doppler_power(spectra, range(1), weights, dft, power)
"""


@pytest.mark.slow
def test_the_longest_tables_have_room(tmp_path: Path) -> None:
    # What is read beyond an array is times 0 here, and most often a number: only checked code is
    # sure to tell.
    environment = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", BOUNDS], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_what_is_no_number_stays_in_its_range_bin() -> None:
    spectra = np.ones((133, 1, 70), dtype=np.complex64)
    spectra[7, 0, 3] = np.nan
    power, dft = np.zeros((133, 70), dtype=np.float32), prime_factor_dft(133)
    assert dft is not None
    add_doppler_power(spectra, range(1), np.ones(133, dtype=np.float32), dft, power)
    assert np.isnan(power[:, 3]).all()
    assert np.isfinite(np.delete(power, 3, axis=1)).all()
