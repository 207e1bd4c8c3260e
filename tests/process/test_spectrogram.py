"""The spectrogram: SciPy's columns, the axes of one TDM channel, and the same whatever the
blocks."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import ShortTimeFFT
from scipy.signal.windows import hann

import rtradar as rt
from rtradar.errors import InputError
from rtradar.process import WindowFunctions, clutter_removal, range_spectrum
from rtradar.process.spectrogram import SlidingSpectrogram, spectrogram
from rtradar.radar import Radar

pytestmark = pytest.mark.drawn

LOW, HIGH = Radar.preset("paper-12ghz"), Radar.preset("paper-77ghz")
TINY = Radar(tx_y=3, tx_z=0, rx_y=2, rx_z=0, samples_per_chirp=4)
HANN = WindowFunctions("hann", "hann")
"""What the closed forms of these tests are of."""


def noise(shape: tuple[int, ...], seed: int = 0) -> NDArray[np.complex128]:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def turning(radar: Radar, velocity: float, n_cycles: int) -> NDArray[np.complex128]:
    """A channel's echo of amplitude 1 that recedes at this velocity, (cycle, 1); written with the
    paper's figures."""
    times = np.arange(n_cycles) * 12 * radar.chirp_duration_s
    return np.exp(
        2j * np.pi * 2 * velocity / 299_792_458.0 * (radar.start_frequency_hz + 2e9) * times
    )[:, None]


@pytest.mark.parametrize(
    ("window", "overlap", "hop"),
    [(128, 0.95, 6), (100, 0.9, 10), (7, 0.5, 3), (16, 0.0, 16), (4, 0.99, 1)],
)
def test_columns_are_those_of_scipy(window: int, overlap: float, hop: int) -> None:
    signals = noise((300, 3))
    found = spectrogram(signals, TINY, window=window, overlap=overlap, window_functions=HANN)
    # SciPy's windows have their middles, sample window // 2, at multiples of the hop: zeros before
    # the signal put ours there.
    ahead = -(window // 2) % hop
    first = (ahead + window // 2) // hop
    transform = ShortTimeFFT(
        hann(window, sym=False),
        hop,
        1 / TINY.cycle_duration_s,
        fft_mode="centered",
        scale_to="magnitude",
    )
    padded = np.concatenate([np.zeros((ahead, 3)), signals])
    columns = transform.stft(
        padded, first, first + 1 + (300 - window) // hop, axis=0
    )  # (velocity, range, time)
    np.testing.assert_allclose(
        found.power, (np.abs(columns) ** 2).sum(axis=1).T, rtol=1e-10, atol=1e-14
    )
    # The periodic window of odd length is even about half a sample more; a sample is at the middle
    # of its chirp.
    middles = np.arange(len(found.time)) * hop + window / 2
    np.testing.assert_allclose(found.time, middles * 3 * 62.5e-6 + 62.5e-6 / 2, rtol=1e-12)
    doppler = transform.f * 299_792_458.0 / (2 * 14e9)
    np.testing.assert_allclose(found.velocity, doppler, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("radar", [LOW, HIGH], ids=["12 GHz", "77 GHz"])
@pytest.mark.parametrize("bins", [0, 1, -1, 20, -64, 63])
def test_an_echo_reads_its_velocity_and_its_power(radar: Radar, bins: int) -> None:
    width = {"paper-12ghz": 0.111530, "paper-77ghz": 0.098824}[
        radar.name
    ]  # c / (2 f_c 128 cycles) [m/s], by hand
    signals = turning(radar, bins * radar.velocity_mps(128)[65], 300)
    found = spectrogram(signals, radar, window_functions=HANN)
    assert found.velocity[65] == pytest.approx(width, rel=1e-5)
    assert found.power.shape == (29, 128)
    assert (found.power.argmax(axis=1) == 64 + bins).all()
    np.testing.assert_allclose(found.power.max(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(
        found.power.sum(axis=1), 1.5, rtol=1e-12
    )  # a Hann window: 1/4, 1, 1/4


@pytest.mark.parametrize("tx", [0, 5, 11])
def test_time_is_that_of_the_channels_own_chirps(tx: int) -> None:
    # A flash in one chirp: the column that has it in the middle of its window is the highest, and
    # carries its time.
    cycle = 64 + 6 * 40
    signals = np.zeros((600, 1), np.complex64)
    signals[cycle] = 1
    found = spectrogram(signals, LOW, tx=tx)
    flat = found.power.sum(axis=1)
    assert found.time[flat.argmax()] == pytest.approx(
        LOW.chirp_times(1, first=cycle * 12 + tx)[0], rel=1e-12
    )
    assert np.diff(found.time) == pytest.approx(6 * 750e-6)


@pytest.mark.parametrize("fraction", [0.0, 0.25, 0.5])
def test_power_does_not_depend_on_the_place_in_a_range_bin(fraction: float) -> None:
    radar = Radar(samples_per_chirp=64)
    tone = 0.5 * np.exp(2j * np.pi * (20 + fraction) * np.arange(64) / 64)
    spectra = range_spectrum(np.broadcast_to(tone, (128 * 12, 8, 64)), radar, window_functions=HANN)
    found = spectrogram(spectra[::12, 0], radar, window_functions=HANN)
    assert found.power.dtype == np.float32
    # Three bins hold 1/4, 1 and 1/4 of 0.5^2, or others as much. 1e-5: float32.
    np.testing.assert_allclose(found.power[0, 64], 1.5 * 0.25, rtol=1e-5)


def stream_data(n_chirps: int, radar: Radar) -> NDArray[np.complex64]:
    return noise((n_chirps, radar.n_rx, radar.samples_per_chirp), seed=n_chirps).astype(
        np.complex64
    )


@given(data=st.data())
@settings(max_examples=150, deadline=None)
def test_any_cut_gives_the_same_to_the_last_bit(data: st.DataObject) -> None:
    window = data.draw(st.integers(2, 12), "window")
    overlap = data.draw(st.sampled_from([0.0, 0.3, 0.5, 0.95]), "overlap")
    channel = data.draw(st.integers(0, TINY.n_channels - 1), "channel")
    n_chirps = data.draw(st.integers(0, 120), "chirps")
    cuts = data.draw(st.lists(st.integers(0, n_chirps), max_size=12), "cuts")
    chirps = stream_data(n_chirps, TINY)
    stream = SlidingSpectrogram(TINY, channel=channel, window=window, overlap=overlap)
    parts = [stream.push(block) for block in np.split(chirps, sorted(cuts))]
    tx, rx = divmod(channel, TINY.n_rx)
    signals = chirps[tx :: TINY.n_tx, rx]
    power, time = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("power", "time")
    )
    if len(signals) < window:
        assert power.shape == (0, window)
        assert time.shape == (0,)
        return
    whole = spectrogram(signals, TINY, tx=tx, window=window, overlap=overlap)
    np.testing.assert_array_equal(power, whole.power)
    np.testing.assert_allclose(time, whole.time, rtol=1e-12)
    np.testing.assert_array_equal(parts[0].velocity, whole.velocity)


def test_a_column_comes_as_soon_as_its_last_chirp_is_there() -> None:
    stream = SlidingSpectrogram(
        TINY, channel=2, window=4, overlap=0.5
    )  # Tx 1: the second chirp of each cycle of three
    counts = [len(stream.push(chirp[None]).time) for chirp in stream_data(30, TINY)]
    assert np.flatnonzero(counts).tolist() == [10, 16, 22, 28]  # cycles 3, 5, 7 and 9


def test_a_stream_without_clutter_has_columns_less_the_mean_of_their_window() -> None:
    chirps = stream_data(90, TINY) + 100
    stream = SlidingSpectrogram(TINY, window=8, overlap=0.5, removal=clutter_removal("mean", TINY))
    power = np.concatenate([stream.push(part).power for part in np.split(chirps, [10, 11, 50])])
    own = chirps[:: TINY.n_tx, 0]
    expected = [
        spectrogram(window - window.mean(axis=0, dtype=complex), TINY, window=8).power[0]
        for window in (own[first : first + 8] for first in range(0, len(own) - 7, 4))
    ]
    # complex64 of values of 100.
    np.testing.assert_allclose(power, expected, rtol=1e-3, atol=1e-9 * 100**2)


def test_memory_does_not_grow() -> None:
    radar = Radar(rx_y=1, rx_z=1, samples_per_chirp=64)
    window_bytes = 128 * 64 * 8
    stream = SlidingSpectrogram(radar)
    block = stream_data(1000 * radar.n_tx, radar)
    tracemalloc.start()
    for _ in range(5):
        stream.push(block)
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    # Less than one window of the channel is held; the rest is the tracer's own. One block of the
    # channel has 8 windows.
    assert held < 1.5 * window_bytes


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tx": 12}, "Tx 0 to 11"),
        ({"tx": -1}, "Tx 0 to 11"),
        ({"window": 1}, "at least 2"),
        ({"window": 141}, "shorter window"),
        ({"overlap": 1.0}, "fraction of the window"),
        ({"overlap": float("nan")}, "fraction of the window"),
        ({"signals": np.zeros(140, complex)}, r"\(cycle, range\)"),
        ({"signals": np.zeros((140, 0), complex)}, "at least 1 in range"),
        ({"signals": np.zeros((140, 2), int)}, "must be complex"),
        ({"signals": np.full((140, 2), np.nan + 0j)}, "finite"),
    ],
)
def test_what_has_no_meaning_is_refused_in_one_line(
    change: dict[str, object], message: str
) -> None:
    arguments: dict[str, object] = {"signals": noise((140, 2)), "radar": LOW} | change
    with pytest.raises(InputError, match=message) as refused:
        spectrogram(**arguments)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("channel", [-1, 96])
def test_there_is_no_such_channel(channel: int) -> None:
    with pytest.raises(InputError, match="channels 0 to 95"):
        SlidingSpectrogram(LOW, channel=channel)


def test_a_block_of_another_radar_is_refused() -> None:
    with pytest.raises(InputError, match="needs"):
        SlidingSpectrogram(LOW).push(np.zeros((12, 8, 255), np.complex64))


def test_a_run_has_the_window_and_the_overlap_that_are_asked_of_it() -> None:
    walk = rt.synthetic_motion("walk", seed=0, duration_s=0.5)
    radar = rt.Radar(tx_y=2, tx_z=0, rx_y=2, rx_z=0, samples_per_chirp=32, bandwidth_hz=0.5e9)
    window_s = 64.3 * radar.cycle_duration_s
    found = rt.run(
        walk, radar, fidelity="analytic", spectrogram_window_s=window_s, spectrogram_overlap=0.5
    ).maps["spectrogram"]
    cycles = radar.chirps_in(0.5) // 2
    assert found.shape == (1 + (cycles - 64) // 32, 64)
    wrong = ("spectrogram_window_s", 1e-6), ("spectrogram_window_s", -1), ("spectrogram_overlap", 1)
    for name, value in wrong:
        with pytest.raises(InputError, match=name):
            rt.run(walk, radar, **{name: value})


def test_noise_reads_its_mean_power_and_range_bins_add() -> None:
    # Each cell: sum of w^2 over (sum of w)^2, 1.5 / 128, times the noise power 2, times 20 range
    # bins.
    signals = noise((4096, 20))
    found = spectrogram(signals, LOW, overlap=0.0, window_functions=HANN)
    # 32 windows x 128 cells x 20 looks: 0.35 % for independent cells, half as much again for the
    # window's skirts; five sigma.
    assert found.power.mean() == pytest.approx(1.5 / 128 * 2 * 20, rel=0.025)
    assert found.power.dtype == np.float64
    parts = (signals[:, :7], signals[:, 7:])
    both = (spectrogram(part, LOW, overlap=0.0, window_functions=HANN).power for part in parts)
    np.testing.assert_allclose(found.power, sum(both), rtol=1e-12)
