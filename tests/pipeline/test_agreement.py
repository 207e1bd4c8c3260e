"""How far apart two results are, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtradar.pipeline.compared import above_noise, chamfer, level_agreement

EVERYWHERE = np.ones(4, dtype=bool)


def test_levels_by_hand() -> None:
    # 0, 10, 20, 30 dB against 0, 10, 20, 34 dB.
    found = level_agreement([1, 10, 100, 1000], [1, 10, 100, 10**3.4], EVERYWHERE)
    assert found.mean_db == pytest.approx(-1.0)
    assert found.rms_db == pytest.approx(2.0)
    # Deviations from the means 15 and 16: sums of products 610, of squares 500 and 760.
    deviations = np.array([-15, -5, 5, 15]), np.array([-16, -6, 4, 18])
    expected = (
        deviations[0]
        @ deviations[1]
        / math.sqrt((deviations[0] @ deviations[0]) * (deviations[1] @ deviations[1]))
    )
    assert found.correlation == pytest.approx(expected)


def test_only_cells_that_count_do() -> None:
    found = level_agreement([1, 10, 0, 0], [2, 20, 5, 0], np.array([True, True, False, False]))
    assert found.correlation == pytest.approx(1.0)
    assert found.mean_db == pytest.approx(-10 * math.log10(2))


@given(gain=st.floats(0.01, 100))
def test_a_gain_is_a_shift_and_no_other_shape(gain: float) -> None:
    power = np.array([1.0, 3.0, 200.0, 7.0])
    found = level_agreement(gain * power, power, EVERYWHERE)
    assert found.correlation == pytest.approx(1.0)
    assert found.mean_db == pytest.approx(10 * math.log10(gain), abs=1e-9)
    assert found.rms_db == pytest.approx(abs(found.mean_db), abs=1e-9)


def test_nothing_to_compare_is_no_number() -> None:
    assert all(math.isnan(value) for value in level_agreement([1.0], [1.0], np.array([False])))
    flat = level_agreement([1.0, 1.0], [1.0, 2.0], np.array([True, True]))
    assert math.isnan(flat.correlation)
    assert flat.rms_db > 0


def test_noise_is_left_out() -> None:
    power = np.full(100, 1.0)
    power[:3] = [9.0, 11.0, 1e9]
    assert np.flatnonzero(above_noise(power)).tolist() == [2]  # 11 is 80 dB below the peak
    power[2] = 1e6
    assert np.flatnonzero(above_noise(power)).tolist() == [1, 2]


def test_chamfer_by_hand() -> None:
    first, second = np.array([[0.0, 0], [2, 0]]), np.array([[0.0, 3]])
    # There: 3 and sqrt(13); back: 3.
    expected = ((3 + math.sqrt(13)) / 2 + 3) / 2
    assert (
        chamfer(first, second, (1, 1)) == chamfer(second, first, (1, 1)) == pytest.approx(expected)
    )
    assert chamfer(first, first, (1, 1)) == 0
    assert chamfer(first * [2, 5], second * [2, 5], (2, 5)) == pytest.approx(expected)


def test_chamfer_of_nothing() -> None:
    nothing = np.zeros((0, 3))
    assert chamfer(nothing, nothing, (1, 1, 1)) == 0
    assert chamfer(nothing, np.zeros((1, 3)), (1, 1, 1)) == math.inf
