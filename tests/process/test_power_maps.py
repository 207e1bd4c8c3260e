"""Doppler division: what is summed over bands is summed over neighbouring bands, around the Doppler
axis."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.process.power_maps import _about, _block_sums


@pytest.mark.parametrize("count", [1, 3, 5])
def test_a_block_begins_at_its_band_and_goes_on_around_the_axis(count: int) -> None:
    power = np.random.default_rng(3).random((5, 7, 2))
    expected = [sum(power[(band + k) % 5] for k in range(count)) for band in range(5)]
    np.testing.assert_allclose(_block_sums(power, count), expected, rtol=1e-14)


def test_cells_are_added_up_as_far_as_the_window_functions_spread_an_echo() -> None:
    power = np.zeros((16, 12))
    power[0, 6] = 1.0
    expected = np.zeros_like(power)
    expected[np.ix_([13, 14, 15, 0, 1, 2, 3], [5, 6, 7])] = 1.0
    np.testing.assert_array_equal(_about(power, (3, 1)), expected)
