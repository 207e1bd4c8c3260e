"""Many echoes spread over a grid for one FFT: against the plain sum, tone by tone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.signal import synthesize

LOW = Radar.preset("paper-12ghz")
FEW, TWO, ONE = (
    Radar(tx_y=2, tx_z=1, rx_y=2, rx_z=2, samples_per_chirp=n, bandwidth_hz=1e8) for n in (16, 2, 1)
)
ODD = Radar(tx_y=2, tx_z=1, rx_y=2, rx_z=2, samples_per_chirp=45, frame_duration_s=3.75e-3)

COUNT = 300


def many_echoes(
    radar: Radar, nodes: int, seed: int, *, count: int = COUNT, chirps: int = 3
) -> Echoes:
    rng = np.random.default_rng(seed)
    shape = (chirps, radar.n_rx, count)
    places = -np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes) / 2
    amplitude = rng.standard_normal((nodes, *shape)) + 1j * rng.standard_normal((nodes, *shape))
    return Echoes(
        # The same for all chirps, for nothing moves so fast.
        length=rng.uniform(-0.1, 1.1, shape[1:]) * 2 * radar.max_range_m + np.zeros(shape),
        amplitude=amplitude,
        frequency=radar.centre_frequency_hz + radar.bandwidth_hz * places,
        tx=radar.tx_of_chirp(np.arange(chirps)),
        part=np.zeros(count, dtype=np.int64),
        bounces=np.ones(count, dtype=np.int64),
    )


def plain(echoes: Echoes, radar: Radar) -> NDArray[np.complex128]:
    """Paper, eq. 9 with its last term, in NumPy; amplitudes by Lagrange's polynomial."""
    time = np.arange(radar.samples_per_chirp) / radar.sample_rate_hz
    frequency = radar.start_frequency_hz + radar.slope_hz_per_s * time
    delay = echoes.length[..., None] / SPEED_OF_LIGHT_MPS
    beat = radar.slope_hz_per_s * delay
    turns = radar.start_frequency_hz * delay + beat * time - beat * delay / 2
    amplitude = np.zeros(turns.shape, dtype=np.complex128)
    for node, own in enumerate(echoes.frequency):
        others = np.delete(echoes.frequency, node)
        amplitude += echoes.amplitude[node][..., None] * np.prod(
            (frequency[:, None] - others) / (own - others), axis=1
        )
    in_band = (beat >= 0) & (beat < radar.sample_rate_hz)
    return np.asarray(np.sum(np.where(in_band, amplitude, 0) * np.exp(2j * np.pi * turns), axis=2))


# One grid up to three nodes, two up to six; beyond, no grid. Ten times the rounding of complex64.
@pytest.mark.parametrize("nodes", [1, 2, 3, 4, 6, 7])
@pytest.mark.parametrize(
    "radar", [LOW, ODD, FEW, TWO, ONE], ids=["12ghz", "45 samples", "16 samples", "2", "1"]
)
def test_many_echoes_are_the_plain_sum_to_float32(radar: Radar, nodes: int) -> None:
    echoes = many_echoes(radar, nodes, seed=nodes)
    expected = plain(echoes, radar)
    found = synthesize(echoes, radar, radar.chirp_times(3), dtype=np.complex64)
    assert found.dtype == np.complex64
    assert np.sqrt((np.abs(found - expected) ** 2).mean() / (np.abs(expected) ** 2).mean()) < 6e-7


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_the_sum_does_not_depend_on_the_order_of_echoes_nor_on_the_blocks_of_chirps(
    seed: int,
) -> None:
    echoes = many_echoes(ODD, 3, seed, chirps=60)
    order = np.random.default_rng(seed).permutation(COUNT)
    times = ODD.chirp_times(60)
    shuffled = replace(
        echoes, length=echoes.length[..., order], amplitude=echoes.amplitude[..., order]
    )
    found = synthesize(echoes, ODD, times, dtype=np.complex64)
    largest = np.abs(found).max()
    np.testing.assert_allclose(
        synthesize(shuffled, ODD, times, dtype=np.complex64), found, rtol=0, atol=2e-6 * largest
    )
    tail = replace(
        echoes, length=echoes.length[50:], amplitude=echoes.amplitude[:, 50:], tx=echoes.tx[50:]
    )
    np.testing.assert_array_equal(synthesize(tail, ODD, times[50:], dtype=np.complex64), found[50:])


def test_one_echo_among_silent_ones_is_a_clean_tone() -> None:
    """What is left out of a tone lies far below it at every other beat frequency."""
    echoes = many_echoes(LOW, 1, seed=0)
    alone = np.zeros_like(echoes.amplitude)
    alone[..., 5] = 1.0
    length = np.full_like(echoes.length, 5.4321)
    one = replace(echoes, length=length, amplitude=alone)
    x = synthesize(one, LOW, LOW.chirp_times(3), dtype=np.complex64)[0, 0]
    spectrum = np.abs(np.fft.fft(x * np.blackman(256) ** 2)) / 256
    peak = int(spectrum.argmax())
    assert np.delete(spectrum, np.arange(peak - 20, peak + 21) % 256).max() < 1e-6 * spectrum[peak]
