"""Frames and range-time maps of a stream: those of the schedule, however it is cut."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.process import SlidingRangeTime, SlidingWindows, clutter_removal, range_time
from rtradar.radar import Radar


def tiny_radar(n_tx: int, cycles_per_frame: float, cycles_per_hop: float) -> Radar:
    cycle = n_tx * 1e-4
    return Radar(
        tx_y=n_tx,
        tx_z=0,
        rx_y=1,
        rx_z=0,
        samples_per_chirp=2,
        chirp_duration_s=1e-4,
        frame_duration_s=cycles_per_frame * cycle,
        frame_hop_s=cycles_per_hop * cycle,
    )


def numbered(n_chirps: int, radar: Radar) -> np.ndarray:
    """Chirps that carry their own number."""
    shape = (n_chirps, radar.n_rx, radar.samples_per_chirp)
    return np.broadcast_to(np.arange(n_chirps)[:, None, None], shape).astype(np.complex64)


@given(data=st.data())
@settings(max_examples=200, deadline=None)
def test_any_cut_gives_the_windows_of_the_schedule(data: st.DataObject) -> None:
    radar = tiny_radar(
        data.draw(st.integers(1, 4), "n_tx"),
        data.draw(st.floats(1.0, 9.0), "frame"),
        # Halves make ties of the rounding; hops under a cycle count as one; hops over the frame
        # leave chirps unused.
        data.draw(
            st.one_of(st.floats(0.1, 25.0), st.sampled_from([0.25, 0.5, 1.5, 2.5, 12.5])), "hop"
        ),
    )
    n_chirps = data.draw(st.integers(0, 150), "chirps")
    cuts = data.draw(st.lists(st.integers(0, n_chirps), max_size=12), "cuts")
    stream = SlidingWindows(radar)
    starts = []
    for block in np.split(numbered(n_chirps, radar), sorted(cuts)):
        for index, start, cube in stream.push(block):
            assert index == len(starts)
            assert cube.shape == (
                radar.cycles_per_frame,
                radar.n_tx,
                radar.n_rx,
                radar.samples_per_chirp,
            )
            first = start * radar.n_tx
            np.testing.assert_array_equal(
                cube[..., 0].real.ravel(), np.arange(first, first + radar.chirps_per_frame)
            )
            starts.append(start)
    assert starts == radar.window_starts(n_chirps).tolist()
    assert stream.n_chirps == n_chirps


def test_a_hop_far_below_a_cycle_costs_no_more_than_one_of_a_cycle() -> None:
    radar = tiny_radar(2, 3, 1e-5)
    stream = SlidingWindows(radar)
    assert (
        [start for _, start, _ in stream.push(numbered(40, radar))]
        == list(range(18))
        == radar.window_starts(40).tolist()
    )


@pytest.mark.parametrize("preset", ["paper-12ghz", "paper-77ghz"])
def test_presets(preset: str) -> None:
    radar = Radar.preset(preset)
    thin = Radar(
        name=preset,
        start_frequency_hz=radar.start_frequency_hz,
        chirp_duration_s=radar.chirp_duration_s,
        rx_y=1,
        rx_z=1,
        samples_per_chirp=1,
    )
    n = round(0.7 / radar.chirp_duration_s)
    stream = SlidingWindows(thin)
    starts = [
        start
        for block in np.array_split(numbered(n, thin), 13)
        for _, start, _ in stream.push(block)
    ]
    assert starts == radar.window_starts(n).tolist()
    assert len(starts) == 25


def test_memory_stays_at_one_and_a_quarter_windows() -> None:
    radar = tiny_radar(2, 10, 2)
    stream = SlidingWindows(radar)
    size = stream._buffer.nbytes
    for _ in stream.push(numbered(5000, radar)):
        pass
    # A quarter of 20 chirps, and one receiver.
    assert stream._buffer.nbytes == size == 25 * radar.samples_per_chirp * 8


def test_windows_cannot_be_written() -> None:
    radar = tiny_radar(1, 2, 1)
    _, _, cube = next(SlidingWindows(radar).push(numbered(4, radar)))
    with pytest.raises(ValueError, match="read-only"):
        cube[:] = 0


def test_wrong_shape_and_windows_left_behind() -> None:
    radar = tiny_radar(1, 2, 1)
    stream = SlidingWindows(radar)
    with pytest.raises(InputError, match="needs"):
        stream.push(np.zeros((3, 1, 3), np.complex64))
    stream.push(numbered(4, radar))
    with pytest.raises(RuntimeError, match="take every window"):
        stream.push(numbered(4, radar))


RADAR = Radar(
    tx_y=2,
    tx_z=0,
    rx_y=2,
    rx_z=0,
    samples_per_chirp=8,
    chirp_duration_s=250e-6,
    frame_duration_s=0.05,
)
STEP = 10  # cycles of 0.5 ms in 5 ms; a window holds ten steps
WINDOW = 100


def streamed(
    spectra: NDArray[np.complexfloating], method: str, block: int, radar: Radar = RADAR
) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
    removal = clutter_removal(method, radar)
    sliding = SlidingRangeTime(radar, removal)
    found = [
        sliding.push(removal.block(spectra[at : at + block], at), at)
        for at in range(0, len(spectra), block)
    ]
    found.append(sliding.finish())
    return np.concatenate([power for power, _ in found]), np.concatenate(
        [times for _, times in found]
    )


def noise(n_cycles: int, radar: Radar = RADAR) -> NDArray[np.complex64]:
    rng = np.random.default_rng(0)
    shape = (n_cycles * radar.n_tx, radar.n_rx, radar.samples_per_chirp)
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex64)


def written_out(spectra: NDArray[np.complexfloating]) -> NDArray[np.float64]:
    """Each step less the mean over the ten steps about it, shifted into the capture at its ends."""
    steps = spectra.astype(np.complex128).reshape(
        -1, STEP, RADAR.n_tx, RADAR.n_rx, RADAR.samples_per_chirp
    )
    out = []
    for number, step in enumerate(steps):
        first = min(max(number - 5, 0), max(len(steps) - 10, 0))
        mean = steps[first : first + 10].mean(axis=(0, 1))
        out.append((abs(step - mean) ** 2).mean(axis=(0, 1, 2)))
    return np.array(out)


@pytest.mark.parametrize("block", [STEP, 3 * STEP, 40 * STEP])
def test_the_mean_over_the_window_about_each_step_is_removed(block: int) -> None:
    spectra = noise(40 * STEP) + 3.0
    power, times = streamed(spectra, "mean", block * RADAR.n_tx)
    np.testing.assert_allclose(power, written_out(spectra), rtol=1e-5)  # complex64
    np.testing.assert_allclose(
        times, (np.arange(40) + 0.5) * STEP * RADAR.cycle_duration_s, rtol=1e-12
    )


@pytest.mark.parametrize("steps", [1, 4, 10, 11])
def test_a_short_capture_has_the_mean_of_all_of_it(steps: int) -> None:
    spectra = noise(steps * STEP)
    power, _ = streamed(spectra, "mean", 20 * STEP * RADAR.n_tx)
    np.testing.assert_allclose(power, written_out(spectra), rtol=1e-5)


@pytest.mark.parametrize("method", ["none", "exponential", "mti"])
def test_other_methods_leave_nothing_to_do(method: str) -> None:
    spectra = noise(20 * STEP)
    removed = clutter_removal(method, RADAR).block(spectra, 0)
    expected = range_time(removed, RADAR)
    for found, wanted in zip(streamed(spectra, method, len(spectra)), expected, strict=True):
        np.testing.assert_array_equal(found, wanted)


def test_a_room_goes_and_a_walker_stays() -> None:
    cycles = np.arange(40 * STEP)
    room, walker = np.zeros(8), np.zeros(8)
    room[2], walker[5] = 1000.0, 1.0
    # At 1 m/s the phase turns by 4 pi v T / lambda: 9 Doppler bins of the window, far from zero
    # Doppler.
    turns = np.exp(4j * math.pi * 1.0 * cycles * RADAR.cycle_duration_s / RADAR.wavelength_m)
    both = room + turns[:, None] * walker
    spectra = np.broadcast_to(
        both[:, None, None], (len(cycles), RADAR.n_tx, RADAR.n_rx, 8)
    ).reshape(-1, RADAR.n_rx, 8)
    power, _ = streamed(spectra.astype(np.complex64), "mean", len(spectra))
    assert power[:, 2].max() < 1e-12 * 1000**2  # what complex64 leaves
    # A still window takes sinc(d) of an echo d = 4.67 bins fast, at most 1 / (pi d): 7 % of its
    # amplitude.
    bins = 1.0 / RADAR.velocity_bin_mps
    assert abs(np.sqrt(power[:, 5]) - 1).max() < 1 / (math.pi * bins) + 1e-3


def test_who_stands_still_for_a_window_goes_with_the_room() -> None:
    """Half a second at rest, then 1 m/s: the first half reads nothing but near its end, the second
    reads 1."""
    rest = np.zeros(1000)
    phase = np.cumsum(
        np.append(rest, np.full(1000, 4 * math.pi * RADAR.cycle_duration_s / RADAR.wavelength_m))
    )
    spectra = np.broadcast_to(
        np.exp(1j * phase)[:, None, None, None], (2000, RADAR.n_tx, RADAR.n_rx, 8)
    )
    power, times = streamed(spectra.reshape(-1, RADAR.n_rx, 8).astype(np.complex64), "mean", 400)
    half = WINDOW / 2 * RADAR.cycle_duration_s
    assert power[times < 0.5 - half, 0].max() < 1e-12
    assert power[times > 0.5 + half, 0].min() > (1 - 1 / (math.pi / RADAR.velocity_bin_mps)) ** 2


def test_memory_does_not_grow() -> None:
    sliding = SlidingRangeTime(RADAR, clutter_removal("mean", RADAR))
    held = []
    for block in range(12):
        sliding.push(noise(5 * STEP), block * 5 * STEP * RADAR.n_tx)
        held.append((len(sliding._frame), len(sliding._waiting)))
    assert len(set(held[2:])) == 1
    assert max(held[-1]) == WINDOW // STEP


def test_uneven_steps_count_by_their_cycles() -> None:
    """Blocks of 25 cycles end in the middle of a step."""
    spectra = noise(100)
    radar = dataclasses.replace(RADAR, frame_duration_s=0.1)
    power, times = streamed(spectra, "mean", 25 * RADAR.n_tx, radar)
    whole = spectra.astype(np.complex128).reshape(100, -1, 8)
    left = abs(whole - whole.mean(axis=0)) ** 2
    expected = [
        left[first : first + count].mean(axis=(0, 1))
        for first, count in ((0, 10), (10, 10), (20, 5), (25, 10))
    ]
    np.testing.assert_allclose(power[:4], expected, rtol=1e-5)
    assert len(times) == 12
