"""CFAR detectors against sorting and averaging cell by cell, and against the masks of the paper's
own code."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.process import ca_cfar, ca_scale, os_cfar, os_scale


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
