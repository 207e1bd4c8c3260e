"""Multipliers against closed forms and against the same law integrated the other way round."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import betainc, gammainc, gammaincc, gammaln

from rtradar.errors import InputError
from rtradar.process import ca_scale, os_scale
from rtradar.process.cfar import _log_os_pfa, order_rank


def log_rohling(alpha: float, n: int, k: int) -> float:
    return math.fsum(-math.log1p(alpha / (n - i)) for i in range(k))


def integral(f, highest: float) -> float:
    """Integral from 0 of a function with one peak, split there."""
    x = np.linspace(highest * 1e-6, highest, 200_001)
    alive = x[f(x) > f(x).max() * 1e-18]
    return quad(
        f, alive[0], alive[-1], points=[x[f(x).argmax()]], epsabs=0, epsrel=1e-11, limit=500
    )[0]


def gamma_density(x, shape: int):
    return np.exp((shape - 1) * np.log(x) - x - gammaln(shape))


def os_pfa(alpha: float, n: int, k: int, looks: int) -> float:
    """P(k-th of n cells < x / alpha) averaged over the cell under test: no order statistic is
    inverted."""
    f = lambda x: gamma_density(x, looks) * betainc(k, n - k + 1, gammainc(looks, x / alpha))  # noqa: E731
    return integral(f, alpha * 3 * looks + 60 + 10 * math.sqrt(looks))


def ca_pfa(alpha: float, n: int, looks: int) -> float:
    """The sum of the n training cells follows the Gamma law too; average over it."""
    return integral(
        lambda t: gamma_density(t, n * looks) * gammaincc(looks, alpha * t / n),
        3.0 * n * looks + 60,
    )


@given(
    n=st.integers(1, 400),
    quantile=st.floats(0.01, 1.0),
    log_pfa=st.floats(math.log(1e-12), math.log(0.999)),
)
@settings(max_examples=60, deadline=None)
def test_one_look_is_rohlings_product(n: int, quantile: float, log_pfa: float) -> None:
    pfa = math.exp(log_pfa)
    k = order_rank(n, quantile)
    alpha = os_scale(n, quantile, pfa)
    # alpha is solved to 1e-12; the rate is at most 28 times as steep, and ill-conditioned near 1
    # where alpha is tiny.
    assert log_rohling(alpha, n, k) == pytest.approx(math.log(pfa), abs=1e-9)
    # The integral that serves many looks gives the same for one.
    assert _log_os_pfa(alpha, n, k, 1) == pytest.approx(math.log(pfa), abs=1e-9)


@pytest.mark.parametrize(
    ("n", "quantile", "pfa", "looks"),
    [
        (8, 0.75, 1e-12, 4),
        (40, 0.2, 1e-12, 2),
        (144, 0.75, 1e-6, 96),
        (49, 0.75, 1e-12, 192),
        (400, 0.75, 1e-3, 96),
        (144, 1, 0.5, 8),
    ],
)
def test_many_looks_against_the_other_integral(
    n: int, quantile: float, pfa: float, looks: int
) -> None:
    alpha = os_scale(n, quantile, pfa, looks)
    assert os_pfa(alpha, n, order_rank(n, quantile), looks) == pytest.approx(
        pfa, rel=1e-8
    )  # the two quadratures


@given(
    n=st.sampled_from([1, 8, 40, 144, 400]),
    quantile=st.sampled_from([0.01, 0.5, 0.75, 1.0]),
    looks=st.sampled_from([1, 2, 96, 192]),
    log_pfa=st.tuples(st.floats(-27.0, -0.01), st.floats(-27.0, -0.01)),
)
@settings(max_examples=40, deadline=None)
def test_fewer_alarms_need_a_greater_multiplier(n, quantile, looks, log_pfa) -> None:
    low, high = (os_scale(n, quantile, math.exp(value), looks) for value in sorted(log_pfa))
    assert low >= high > 0
    low, high = (ca_scale(n, math.exp(value), looks) for value in sorted(log_pfa))
    assert low >= high > 0


@given(n=st.integers(1, 400), log_pfa=st.floats(math.log(1e-12), math.log(0.999)))
@settings(max_examples=60, deadline=None)
def test_cell_averaging_of_one_look(n: int, log_pfa: float) -> None:
    # alpha = N (Pfa^(-1/N) - 1)
    assert ca_scale(n, math.exp(log_pfa)) == pytest.approx(n * math.expm1(-log_pfa / n), rel=1e-9)


@pytest.mark.parametrize(
    ("n", "pfa", "looks"), [(144, 1e-6, 96), (8, 1e-12, 192), (144, 0.9, 3), (40, 1e-3, 2)]
)
def test_cell_averaging_of_many_looks(n: int, pfa: float, looks: int) -> None:
    assert ca_pfa(ca_scale(n, pfa, looks), n, looks) == pytest.approx(
        pfa, rel=1e-8
    )  # the quadrature


def test_known_multipliers() -> None:
    # alpha = N (Pfa^(-1/N) - 1) = 144 (10^(6/144) - 1)
    assert ca_scale(144, 1e-6) == pytest.approx(144 * (10 ** (1 / 24) - 1), rel=1e-12)
    # Of one training cell both detectors are the same: Pfa = 1 / (1 + alpha).
    assert os_scale(1, 0.75, 0.01) == pytest.approx(99.0, rel=1e-9)
    assert os_scale(1, 0.75, 0.01, looks=5) == pytest.approx(ca_scale(1, 0.01, looks=5), rel=1e-9)


@pytest.mark.parametrize(
    ("n", "quantile", "rank"),
    [(144, 0.75, 108), (30, 0.1, 3), (7, 0.75, 6), (5, 1.0, 5), (3, 0.01, 1)],
)
def test_rank(n: int, quantile: float, rank: int) -> None:
    assert order_rank(n, quantile) == rank


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: os_scale(0, 0.75, 0.1), "n_train"),
        (lambda: os_scale(8, 0.0, 0.1), "quantile"),
        (lambda: os_scale(8, 0.75, 1.0), "false-alarm rate"),
        (lambda: os_scale(8, 0.75, 0.1, looks=0), "looks"),
        (lambda: ca_scale(8, -0.1), "false-alarm rate"),
        (lambda: ca_scale(8.5, 0.1), "n_train"),
    ],
)
def test_bad_input_is_refused(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
