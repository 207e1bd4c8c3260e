"""Sums of phasors over triangles, and their series, against NumPy and a quadrature."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rtradar.kernels.scatter.triangles import (
    SERIES,
    mean_of_phasor,
    positive_fraction,
    sum_large,
    sum_small,
)


def quadrature(mean: float, u: float, v: float, k: float) -> complex:
    """Mean of exp(-jk deviation), u, v and -u - v at a triangle's corners, times exp(-jk mean)."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x, y = np.meshgrid((nodes + 1) / 2, (nodes + 1) / 2, indexing="ij")
    second, third = x, y * (1 - x)
    phase = mean + u * (1 - second - third) + v * second - (u + v) * third
    return complex(np.sum(np.outer(weights, weights) / 2 * (1 - x) * np.exp(-1j * k * phase)))


def facets(least: float, most: float) -> tuple[NDArray[np.float64], ...]:
    """Forty means, deviations and strengths whose p for k = 250 lies between two bounds."""
    rng = np.random.default_rng(0)
    turn, size = rng.uniform(0, 2 * np.pi, 40), np.sqrt(np.linspace(least, most, 40)) / 250
    # On the ellipse u^2 + u v + v^2 = size^2.
    u, v = size * (np.cos(turn) - np.sin(turn) / np.sqrt(3)), size * 2 / np.sqrt(3) * np.sin(turn)
    return rng.uniform(-2, 2, 40), u, v, rng.uniform(0, 1, 40)


@pytest.mark.parametrize(
    ("add_up", "bounds"), [(sum_small, (0.0, SERIES)), (sum_large, (0.1, 400.0))]
)
def test_sums_are_those_of_the_integrals(add_up: object, bounds: tuple[float, float]) -> None:
    mean, u, v, strength = facets(*bounds)
    for i in range(len(mean)):
        found = add_up(mean[i : i + 1], u[i : i + 1], v[i : i + 1], strength[i : i + 1], 250.0)  # type: ignore[operator]
        # The series leaves out 2 (p^6 + 10 p^3 q^2 + q^4) / 14!, where q^2 is at most 4 p^3 / 27:
        # 2.4e-7 of a facet for p = 4.
        assert found == pytest.approx(
            strength[i] * quadrature(mean[i], u[i], v[i], 250.0), abs=3e-7
        )
    whole = sum(strength[i] * quadrature(mean[i], u[i], v[i], 250.0) for i in range(len(mean)))
    assert add_up(mean, u, v, strength, 250.0) == pytest.approx(whole, abs=2e-6)  # type: ignore[operator]


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-2, 2))
def test_positive_fraction_of_a_linear_function(a: float, b: float, c: float) -> None:
    rng = np.random.default_rng(0)
    u, v = rng.uniform(size=(2, 20_000))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    # 20 000 draws of a share have a standard deviation of at most 0.0036.
    assert positive_fraction(a, b, c) == pytest.approx(
        np.mean(a + (b - a) * u + (c - a) * v >= 0), abs=0.02
    )


@given(st.lists(st.floats(-20, 20), min_size=3, max_size=3), st.sampled_from([1.0, 1e-3, 1e-9]))
def test_the_mean_phasor_is_the_integral_over_the_triangle(
    phases: list[float], scale: float
) -> None:
    u = (np.array(phases) - np.mean(phases)) * scale
    integral = quadrature(0.0, u[0], u[1], 1.0)
    # The series ends after its ninth term.
    assert complex(*mean_of_phasor(*u)) == pytest.approx(integral, abs=1e-9)
