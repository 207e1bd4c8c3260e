"""Doppler division: what is summed over bands is summed over neighbouring bands, around the Doppler axis."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.process.doppler_division import _block_sums


@pytest.mark.parametrize("count", [1, 3, 5])
def test_a_block_begins_at_its_band_and_goes_on_around_the_axis(count: int) -> None:
    power = np.random.default_rng(3).random((5, 7, 2))
    expected = [sum(power[(band + k) % 5] for k in range(count)) for band in range(5)]
    np.testing.assert_allclose(_block_sums(power, count), expected, rtol=1e-14)
