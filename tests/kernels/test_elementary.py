"""Phasors, and cubics between two values, on which references of kernels rely."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from rtradar.kernels.elementary import (
    fast_phasor,
    hermite_weights,
    phasor,
    phasor_float32,
    sine,
    smoothstep,
)

FRACTION = np.linspace(0, 1, 21)


def phasors(turns: np.ndarray, function: Callable[..., Any]) -> np.ndarray:
    """The phasors (number,) of a compiled loop, in complex128."""

    @numba.njit(fastmath={"contract"}, error_model="numpy")
    def fill(turns, across, up):
        for i in range(len(turns)):
            across[i], up[i] = function(turns[i])

    across, up = np.empty_like(turns), np.empty_like(turns)
    fill(turns, across, up)
    return across + 1j * up.astype(np.float64)


@pytest.mark.parametrize(
    ("function", "kind", "most", "tolerance"),
    [(phasor, np.float64, 1e3, 1e-15), (phasor_float32, np.float32, 30.0, 1e-6)],
)
def test_a_phasor_is_exact(
    function: Callable[..., Any], kind: type[np.floating], most: float, tolerance: float
) -> None:
    turns = np.random.default_rng(0).uniform(-most, most, 10_003).astype(kind)
    exact = turns.astype(np.float64)
    expected = np.exp(2j * np.pi * (exact - np.rint(exact)))
    np.testing.assert_allclose(phasors(turns, function), expected, rtol=0, atol=tolerance)


def test_phasors_and_sines_of_angles_are_as_exact_as_they_say() -> None:
    angle = np.linspace(-300.0, 300.0, 20_011)
    across, up = fast_phasor(angle)
    np.testing.assert_allclose(across + 1j * up, np.exp(1j * angle), rtol=0, atol=1e-13)
    np.testing.assert_allclose(sine(angle), np.sin(angle), rtol=0, atol=1e-13)
    small = np.logspace(-9, 0, 50)
    np.testing.assert_allclose(sine(small), np.sin(small), rtol=1e-15)


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
