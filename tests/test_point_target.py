"""A point echo at a known place and velocity reads back: from path lengths to a cell of the map.

Where the power of all channels is summed, range and velocity are read as its centroid. In 0.1 s a
point at 2 m/s crosses five range bins, and as many Doppler bins from the low to the high end of the
sweep, so the map has a plateau there and no distinct peak.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from rtradar.echoes import Echoes
from rtradar.process import range_doppler
from rtradar.radar import Radar
from rtradar.signal import synthesize

Array = NDArray[np.float64]

LOW, HIGH = Radar.preset("paper-12ghz"), Radar.preset("paper-77ghz")
TORSO, LEFT, NEAR = (0.0, 0.0, 1.0), (-0.5, 2.0, 0.2), (-1.0, 1.0, 1.0)


class Reading(NamedTuple):
    """Errors of the map's centroid and of its peak, in bins."""

    range_error: float
    velocity_error: float
    peak_range_error: float
    peak_velocity_error: float


def point(radar: Radar, place: ArrayLike, velocity: ArrayLike) -> tuple[Echoes, Radar, Array]:
    """One frame of a point that is at ``place`` in its middle; lengths are exact at each chirp."""
    chirps = radar.chirps_per_frame
    times = radar.chirp_times(chirps)
    tx = radar.tx_of_chirp(np.arange(chirps))
    at = np.asarray(place) + (times - chirps * radar.chirp_duration_s / 2)[:, None] * np.asarray(
        velocity
    )
    there = np.linalg.norm(radar.tx[tx] - at, axis=1)
    back = np.linalg.norm(radar.rx[radar.rx_of_tx[tx]] - at[:, None], axis=2)
    length = (there[:, None] + back)[..., None]
    amplitude = np.full((1, *length.shape), 0.3 - 0.4j)
    echoes = Echoes(
        length=length,
        amplitude=amplitude,
        frequency=[radar.centre_frequency_hz],
        tx=tx,
        part=[0],
        bounces=[1],
    )
    return echoes, radar, times


def sight(radar: Radar, place: ArrayLike) -> tuple[float, Array]:
    """Range of a place [m] and the direction to it."""
    way = np.asarray(place) - np.asarray(radar.position_m)
    return float(np.linalg.norm(way)), way / np.linalg.norm(way)


def spectra(radar: Radar, place: ArrayLike, velocity: ArrayLike) -> Array:
    """Power (range, velocity, channel)."""
    x = synthesize(*point(radar, place, velocity), dtype=np.complex64)
    return np.asarray(np.abs(range_doppler(x, radar).values) ** 2)


def centroid(power: Array, reach: int) -> float:
    """Mean bin of the power within ``reach`` bins of its peak; the axis is cyclic."""
    bins = power.argmax() + np.arange(-reach, reach + 1)
    weights = power[bins % len(power)]
    return float(weights @ bins / weights.sum())


def read(radar: Radar, power: Array, range_m: float, velocity: float) -> Reading:
    """Errors of a map (range, velocity)."""
    cycles = radar.cycles_per_frame
    # 12 bins beside the plateau: a tone with a Hann window has 1e-6 of its power beyond.
    reach = 12 + int(abs(velocity) * radar.frame_duration_s / radar.range_bin_m)
    true_range = range_m / radar.range_bin_m
    true_velocity = velocity / radar.velocity_bin_mps + cycles // 2
    peak = np.unravel_index(power.argmax(), power.shape)
    return Reading(
        centroid(power.sum(axis=1), reach) - true_range,
        centroid(power.sum(axis=0), reach) - true_velocity,
        float(peak[0] - true_range),
        float(peak[1] - true_velocity),
    )


CASES = [(LOW, place, speed) for place in (TORSO, LEFT, NEAR) for speed in (0.0, 2.0, -2.0)]
CASES += [(HIGH, TORSO, 0.0), (HIGH, TORSO, 2.0), (HIGH, LEFT, -2.0)]


@pytest.mark.parametrize(
    ("radar", "place", "speed"),
    CASES,
    ids=lambda value: value.name if isinstance(value, Radar) else str(value),
)
def test_a_point_reads_back(radar: Radar, place: tuple[float, ...], speed: float) -> None:
    range_m, direction = sight(radar, place)
    reading = read(radar, spectra(radar, place, speed * direction).sum(axis=2), range_m, speed)
    # Measured 0.03 to 0.09 bins at 12 GHz, below 0.01 at 77 GHz: the mean path over an array of
    # 0.5 m is longer than the one over its centre, and a DFT-even window's middle is half a cycle
    # late.
    assert abs(reading.range_error) < 0.1
    # Measured below 0.02 bins: the array, and the beat frequency, by which it is lower (1e-4).
    assert abs(reading.velocity_error) < 0.03
    # The highest cell is the nearest one for a point at rest, else on the plateau of 5 bins.
    assert abs(reading.peak_range_error) < (0.6 if speed == 0 else 1.1)
    assert abs(reading.peak_velocity_error) < 0.6


@pytest.mark.parametrize("radar", [LOW, HIGH], ids=["12 GHz", "77 GHz"])
def test_a_walker_toward_the_radar_off_the_line_of_sight(radar: Radar) -> None:
    range_m, direction = sight(radar, TORSO)
    velocity = np.array([-1.4, 0.0, 0.0])
    reading = read(
        radar, spectra(radar, TORSO, velocity).sum(axis=2), range_m, float(velocity @ direction)
    )
    assert abs(reading.range_error) < 0.1
    assert abs(reading.velocity_error) < 0.03


def test_every_channel_reads_the_way_of_its_own_antennas() -> None:
    # A point at rest: half the path of its Tx and Rx, 96 different ones. 1e-3: the centroid's ends.
    place = np.array(LEFT)
    power = spectra(LOW, place, np.zeros(3))
    there, back = (np.linalg.norm(places - place, axis=1) for places in (LOW.tx, LOW.rx))
    for tx in range(12):
        for rx in range(8):
            half = (there[tx] + back[LOW.rx_of_tx[tx, rx]]) / 2
            assert abs(read(LOW, power[..., tx * 8 + rx], half, 0.0).range_error) < 1e-3


def test_phases_of_the_channels_are_those_of_their_ways() -> None:
    # At a range bin the phase belongs to the sweep centre; any wrong sign or order shows here.
    place = np.array(LEFT)
    echoes, _, times = point(LOW, place, np.zeros(3))
    values = range_doppler(synthesize(echoes, LOW, times), LOW).values
    cell = np.unravel_index((np.abs(values) ** 2).sum(axis=2).argmax(), values.shape[:2])
    length = echoes.length[:12, :, 0].ravel()
    # The window is even about sample 128, at the sweep centre; before it, the phase is pi a bin.
    turns = length * LOW.centre_frequency_hz - length**2 * LOW.slope_hz_per_s / 2 / 299_792_458.0
    expected = np.exp(2j * np.pi * turns / 299_792_458.0)
    ratio = values[cell] / expected
    np.testing.assert_allclose(np.angle(ratio / ratio[0]), 0, atol=1e-6)


@pytest.mark.parametrize("radar", [LOW, HIGH], ids=["12 GHz", "77 GHz"])
@pytest.mark.parametrize("speed", [8.0, -8.0])
def test_too_fast_aliases_to_its_known_place(radar: Radar, speed: float) -> None:
    # A kick at 12 GHz: 8 - 2 x 7.14 = -6.28 m/s; at 77 GHz: 8 - 2 x 6.32 = -4.65 m/s: approaching.
    range_m, direction = sight(radar, TORSO)
    seen = speed - np.sign(speed) * 2 * radar.max_velocity_mps
    assert seen == pytest.approx(
        np.sign(speed) * {"paper-12ghz": -6.276, "paper-77ghz": -4.649}[radar.name], abs=1e-3
    )
    power = spectra(radar, TORSO, speed * direction).sum(axis=2)
    reading = read(radar, power, range_m, seen)
    cycles = radar.cycles_per_frame
    wrapped = (reading.velocity_error + cycles / 2) % cycles - cycles / 2
    assert abs(wrapped) < 0.1  # measured 0.05: four times that at 2 m/s
    # Its range is right over the 21 bins that it crosses: measured 0.13 bins, half a cycle late.
    assert abs(reading.range_error) < 0.2
