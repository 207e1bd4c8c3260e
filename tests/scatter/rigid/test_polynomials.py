"""Polynomials in time between knots."""

from __future__ import annotations

import numpy as np

from rtradar.scatter.rigid.polynomials import PolynomialsInTime


def test_polynomials_of_degree_seven_are_met() -> None:
    rng = np.random.default_rng(0)
    times, tx = rng.uniform(0.1, 0.2, 40), rng.integers(0, 3, 40)
    knots = PolynomialsInTime(times, 0.01)
    powers = np.arange(8)[:, None, None, None, None]
    terms = rng.normal(size=(8, 3, 2, 4, 5, 2)).view(np.complex128)[..., 0]

    def field(at: np.ndarray) -> np.ndarray:
        return (terms * (at / 0.2)[:, None, None, None, None, None] ** powers).sum(axis=1)

    found = knots.between(field(knots.numbers * 0.01), tx)
    expected = np.moveaxis(field(times)[np.arange(40), tx], 2, 0)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
