"""Phasors, and cubics between two values, on which references of kernels rely."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from rtradar.kernels.elementary import hermite_weights, phasor, smoothstep

FRACTION = np.linspace(0, 1, 21)


@numba.njit(fastmath={"contract"}, error_model="numpy")
def phasors(turns: np.ndarray) -> np.ndarray:
    out = np.empty(len(turns), dtype=np.complex128)
    for i in range(len(turns)):
        across, up = phasor(turns[i])
        out[i] = complex(across, up)
    return out


def test_a_phasor_is_exact() -> None:
    turns = np.random.default_rng(0).uniform(-1e3, 1e3, 10_003)
    expected = np.exp(2j * np.pi * (turns - np.rint(turns)))
    np.testing.assert_allclose(phasors(turns), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("width", [1.0, 3.0, 0.02])
def test_a_cubic_has_the_values_and_slopes_at_both_ends(width: float) -> None:
    values, slopes = (0.4, -1.3), (2.0, 0.7)
    expected = CubicHermiteSpline([0.0, width], values, slopes)(FRACTION * width)
    weights = np.array([hermite_weights(fraction, width) for fraction in FRACTION])
    np.testing.assert_allclose(weights @ [*values, *slopes], expected, rtol=0, atol=1e-14)


def test_a_smooth_step_is_level_at_both_ends() -> None:
    expected = CubicHermiteSpline([0.0, 1.0], [0.0, 1.0], [0.0, 0.0])(FRACTION)
    found = [smoothstep(fraction) for fraction in FRACTION]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)
