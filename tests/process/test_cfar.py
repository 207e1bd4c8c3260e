"""CFAR detectors against sorting and averaging cell by cell and the masks of the paper's own code;
multipliers against closed forms and the same law integrated the other way round."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import betainc, gammainc, gammaincc, gammaln

from rtradar.errors import InputError
from rtradar.process import ca_cfar, ca_scale, os_cfar, os_scale
from rtradar.process.cfar import _log_os_pfa, order_rank


def by_sorting(power, guard, train, quantile, scale_of):
    """Both detectors by the book: (order statistic, cell averaging)."""
    ordered, averaged = np.zeros(power.shape, bool), np.zeros(power.shape, bool)
    outer = guard + train
    for i, j in np.ndindex(power.shape):
        ring = sorted(
            power[a, b]
            for a in range(max(0, i - outer), min(power.shape[0], i + outer + 1))
            for b in range(max(0, j - outer), min(power.shape[1], j + outer + 1))
            if max(abs(a - i), abs(b - j)) > guard
        )
        rank = math.ceil(quantile * len(ring) - 1e-9)
        ordered[i, j] = power[i, j] > scale_of("os", len(ring)) * ring[rank - 1]
        averaged[i, j] = power[i, j] > scale_of("ca", len(ring)) * np.mean(ring)
    return ordered, averaged


@given(
    shape=st.tuples(st.integers(6, 17), st.integers(6, 17)),
    guard=st.integers(0, 2),
    train=st.integers(1, 4),
    quantile=st.sampled_from([0.1, 0.5, 0.75, 1.0]),
    looks=st.sampled_from([1, 7]),
    single=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=40, deadline=None)
def test_against_sorting(shape, guard, train, quantile, looks, single, seed) -> None:
    rng = np.random.default_rng(seed)
    power = rng.gamma(looks, size=shape) * 10 ** rng.uniform(0, 1, shape)
    power = power.astype(np.float32 if single else np.float64)
    pfa = 0.05

    def scale_of(kind, n):
        return os_scale(n, quantile, pfa, looks) if kind == "os" else ca_scale(n, pfa, looks)

    ordered, averaged = by_sorting(power.astype(float), guard, train, quantile, scale_of)
    np.testing.assert_array_equal(os_cfar(power, guard, train, quantile, pfa, looks), ordered)
    np.testing.assert_array_equal(ca_cfar(power, guard, train, pfa, looks), averaged)


@given(
    shape=st.tuples(st.integers(1, 20), st.integers(4, 20)),
    scale=st.floats(0.5, 6.0),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=30, deadline=None)
def test_given_multiplier(shape, scale, seed) -> None:
    power = np.random.default_rng(seed).exponential(size=shape)
    ordered, averaged = by_sorting(power, 1, 2, 0.75, lambda *_: scale)
    np.testing.assert_array_equal(os_cfar(power, 1, 2, scale=scale), ordered)
    np.testing.assert_array_equal(ca_cfar(power, 1, 2, scale=scale), averaged)


@pytest.mark.parametrize("detect", [os_cfar, ca_cfar])
@given(exponent=st.integers(-40, 40), flipped=st.sampled_from(["lr", "ud", "transpose"]))
@settings(max_examples=20, deadline=None)
def test_unit_and_orientation_do_not_matter(detect, exponent: int, flipped: str) -> None:
    power = np.random.default_rng(5).gamma(3.0, size=(20, 31))
    mask = detect(power, pfa=0.05, looks=3)
    assert 0 < mask.sum() < mask.size / 2
    np.testing.assert_array_equal(detect(power * 2.0**exponent, pfa=0.05, looks=3), mask)
    flip = {"lr": np.fliplr, "ud": np.flipud, "transpose": np.transpose}[flipped]
    np.testing.assert_array_equal(detect(flip(power), pfa=0.05, looks=3), flip(mask))


@pytest.mark.parametrize("detect", [os_cfar, ca_cfar])
def test_weak_echo_beside_a_strong_one(detect) -> None:
    power = np.ones((40, 40))
    power[20, 20] = 1e15
    power[20, 33] = 100.0
    mask = detect(power)
    assert mask[20, 20]
    assert mask[20, 33]
    # Order statistics ignore the one strong training cell; neither detector may report a neighbour.
    assert mask.sum() == 2


def test_silence_has_no_detections() -> None:
    for detect in (os_cfar, ca_cfar):
        assert not detect(np.zeros((30, 30))).any()


def test_one_target_in_noise_is_found_and_noise_is_not() -> None:
    power = np.random.default_rng(0).gamma(96.0, size=(256, 133)).astype(np.float32)
    power[77, 40] *= 3
    for detect in (os_cfar, ca_cfar):
        mask = detect(power, looks=96)
        assert mask[77, 40]
        assert mask.sum() <= 2  # 34 048 cells at 1e-6


@pytest.mark.parametrize("name", ["RDM", "RDMnoise", "RDM1", "RDMnoise1"])
def test_masks_of_the_papers_code(name: str) -> None:
    mocap = os.environ.get("RTRADAR_MOCAP")
    if not mocap:
        pytest.skip("RTRADAR_MOCAP is not set: the reference masks are beside that folder")
    with np.load(Path(mocap).parent / "reference" / "cfar_crops_octave.npz") as crops:
        power, mask = 10 ** (crops[name] / 10), crops[f"os_{name}"].astype(bool)
    np.testing.assert_array_equal(os_cfar(power, scale=5.0003), mask)


@pytest.mark.parametrize("detect", [os_cfar, ca_cfar])
@pytest.mark.parametrize(
    ("power", "options", "message"),
    [
        (np.ones(5), {}, "range, velocity"),
        (np.ones((9, 9), complex), {}, "range, velocity"),
        (np.full((9, 9), np.nan), {}, "NaN"),
        (np.full((9, 9), np.inf), {}, "infinity"),
        (-np.ones((9, 9)), {}, "decibels"),
        (np.ones((5, 5)), {}, "no training cells"),
        (np.ones((9, 9)), {"guard": -1}, "guard"),
        (np.ones((9, 9)), {"train": 0}, "train"),
        (np.ones((9, 9)), {"pfa": 0.0}, "false-alarm rate"),
        (np.ones((9, 9)), {"pfa": 1.0}, "false-alarm rate"),
        (np.ones((9, 9)), {"pfa": math.nan}, "false-alarm rate"),
        (np.ones((9, 9)), {"looks": 0}, "looks"),
        (np.ones((9, 9)), {"looks": 1.5}, "looks"),
        (np.ones((9, 9)), {"scale": 0.0}, "scale"),
        (np.ones((9, 9)), {"scale": math.inf}, "scale"),
    ],
)
def test_bad_input_is_refused(detect, power, options, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        detect(power, **options)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("quantile", [0.0, 1.1, math.nan])
def test_bad_quantile_is_refused(quantile: float) -> None:
    with pytest.raises(InputError, match="quantile"):
        os_cfar(np.ones((9, 9)), quantile=quantile)


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
def test_bad_numbers_are_refused(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
