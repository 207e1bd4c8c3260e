"""The range-time map without static clutter: against means written out, and the same in any
pieces."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rtradar.process import SlidingRangeTime, clutter_removal, range_time
from rtradar.radar import Radar

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
