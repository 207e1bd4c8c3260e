"""Receiver noise: its power and whiteness, and that it does not know how the capture is cut."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

import rtradar.system.threads
from rtradar.radar import Radar
from rtradar.signal import Noise

LOW = Radar.preset("paper-12ghz")
SMALL = Radar(tx_y=2, tx_z=1, rx_y=2, rx_z=2, samples_per_chirp=8, frame_duration_s=3.75e-3)


def noise(
    power: float, radar: Radar, chirps: int, seed: int = 0, first: int = 0
) -> NDArray[np.complex64]:
    samples = np.zeros((chirps, radar.n_rx, radar.samples_per_chirp), np.complex64)
    Noise(power, seed).add(samples, radar, first)
    return samples


@pytest.fixture(scope="module")
def plenty() -> NDArray[np.complex64]:
    return noise(1.0, LOW, 480, seed=1)


def test_power(plenty: NDArray[np.complex64]) -> None:
    # |n|^2 of power 1 has standard deviation 1: five of them for the mean, each with its own seed.
    for power, samples in ((1.0, plenty), (2.5e-7, noise(2.5e-7, LOW, 480, seed=2))):
        assert np.mean(np.abs(samples) ** 2) == pytest.approx(
            power, rel=5 / math.sqrt(samples.size)
        )


def test_both_parts_are_normal_and_the_phase_is_even(plenty: NDArray[np.complex64]) -> None:
    deviation = math.sqrt(0.5)
    for values in (plenty.real, plenty.imag):
        assert stats.kstest(values.ravel()[::3], stats.norm(scale=deviation).cdf).pvalue > 1e-4
    # |n|^2 is exponential, its phase evenly spread, and neither tells of the other.
    power, turns = np.abs(plenty.ravel()) ** 2, np.angle(plenty.ravel()) / (2 * np.pi) + 0.5
    assert stats.kstest(power[::3], stats.expon.cdf).pvalue > 1e-4
    assert stats.kstest(turns[::3], stats.uniform.cdf).pvalue > 1e-4
    assert stats.chi2_contingency(np.histogram2d(np.exp(-power), turns, bins=16)[0]).pvalue > 1e-4


@pytest.mark.parametrize("deviations", [3.0, 4.0, 4.5])
def test_the_tails_are_those_of_a_normal(plenty: NDArray[np.complex64], deviations: float) -> None:
    values = np.abs(np.concatenate([plenty.real.ravel(), plenty.imag.ravel()])) * math.sqrt(2)
    expected = values.size * math.erfc(deviations / math.sqrt(2))
    assert abs(np.count_nonzero(values > deviations) - expected) < 5 * math.sqrt(expected)


@pytest.mark.parametrize("lag", [(0, 0, 1), (0, 0, 7), (0, 1, 0), (1, 0, 0), (12, 0, 0), (1, 1, 1)])
def test_white(plenty: NDArray[np.complex64], lag: tuple[int, int, int]) -> None:
    # 12 chirps is one cycle: the next one's stream.
    early = plenty[tuple(slice(None, -k or None) for k in lag)]
    late = plenty[tuple(slice(k, None) for k in lag)]
    assert abs(np.mean(late * early.conj())) < 5 / math.sqrt(early.size)
    # Nor do powers know of each other, whose deviation is 1.
    assert abs(np.mean((np.abs(late) ** 2 - 1) * (np.abs(early) ** 2 - 1))) < 5 / math.sqrt(
        early.size
    )


@given(cuts=st.lists(st.integers(0, 10), max_size=4), end=st.integers(1, 32))
@settings(max_examples=30)
def test_how_a_capture_is_cut_into_blocks_does_not_matter(cuts: list[int], end: int) -> None:
    whole = noise(1.0, SMALL, end)
    edges = sorted({0, end, *(SMALL.n_tx * cut for cut in cuts if SMALL.n_tx * cut < end)})
    blocks = [noise(1.0, SMALL, last - first, first=first) for first, last in pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(blocks), whole)


def test_a_capture_that_ends_inside_a_cycle_has_the_same_noise_up_to_there() -> None:
    np.testing.assert_array_equal(noise(1.0, SMALL, 8), noise(1.0, SMALL, 9)[:8])


def test_a_block_starts_with_a_cycle() -> None:
    with pytest.raises(ValueError, match="starts at chirp 4"):
        noise(1.0, SMALL, 3, first=4)


def test_seed() -> None:
    np.testing.assert_array_equal(noise(1.0, SMALL, 30, seed=5), noise(1.0, SMALL, 30, seed=5))
    ours, other = noise(1.0, LOW, 48, seed=5), noise(1.0, LOW, 48, seed=6)
    assert abs(np.mean(ours * other.conj())) < 5 / math.sqrt(ours.size)


@pytest.mark.parametrize("threads", [1, 3])
def test_any_number_of_threads_makes_the_same(
    monkeypatch: pytest.MonkeyPatch, threads: int
) -> None:
    usual = noise(1.0, SMALL, 300)
    with ThreadPoolExecutor(threads) as pool:
        monkeypatch.setattr(rtradar.system.threads, "_pool", lambda: pool)
        np.testing.assert_array_equal(noise(1.0, SMALL, 300), usual)


def test_it_is_the_transform_of_its_bits() -> None:
    cycle = noise(1.0, SMALL, SMALL.n_tx, seed=3)
    bits = np.random.SFC64([3, 0]).random_raw(cycle.size).reshape(cycle.shape)
    u, turns = ((bits >> 33) + 0.5) / 2**31, bits.astype(np.uint32).view(np.int32) / 2.0**32
    # float32 logarithm, sine and cosine: 1e-7 each, of radii up to 5.
    np.testing.assert_allclose(cycle, np.sqrt(-np.log(u)) * np.exp(2j * np.pi * turns), atol=2e-6)


def test_power_scales_the_same_noise() -> None:
    np.testing.assert_allclose(
        noise(4.0, SMALL, 30), 2 * noise(1.0, SMALL, 30), rtol=1e-6
    )  # float32


def test_it_is_added_to_what_is_there() -> None:
    samples = np.full((6, SMALL.n_rx, SMALL.samples_per_chirp), 3 - 2j, np.complex64)
    Noise(1.0).add(samples, SMALL, 0)
    np.testing.assert_allclose(samples - (3 - 2j), noise(1.0, SMALL, 6), atol=1e-6)  # float32


@pytest.mark.parametrize(("snr_db", "power"), [(20, 0.03), (0, 3), (-10, 30), (3.0103, 1.5)])
def test_power_for_an_snr(snr_db: float, power: float) -> None:
    made = Noise.for_snr(3.0, snr_db, seed=9)
    assert made.power == pytest.approx(
        power, rel=1e-6
    )  # 3.0103 dB is a factor of two to seven digits
    assert made.seed == 9


def test_infinite_snr_adds_nothing() -> None:
    none = Noise.for_snr(3.0, math.inf)
    assert none.power == 0
    samples = np.full((6, SMALL.n_rx, SMALL.samples_per_chirp), 1j, np.complex64)
    none.add(samples, SMALL, 0)
    assert (samples == 1j).all()
