"""Range and velocity of a point echo, read back from the map that the whole chain makes of it.

Both presets; places 3 to 5 m away, on the boresight and off it; standing, receding, approaching,
and so fast that the reading is the known alias. Every length is exact for its Tx and Rx at the
middle of its chirp. The reference is the range over the array's centre in the middle of the frame,
and the range rate with the wavelength of the sweep's centre. The reading is the centroid of the
power summed over all channels: a point at 2 m/s crosses five range bins in 0.1 s and, from the low
to the high end of the sweep, as many Doppler bins, so the map has a plateau there, on which the
position of the highest cell means little. That cell is reported and not judged.

    python validation/closed_forms/point_target.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.echoes import Echoes
from rtradar.process import range_doppler
from rtradar.radar import Radar
from rtradar.signal import synthesize
from rtradar.validate.rows import Row, judged, main, reported

Array = NDArray[np.float64]

PRESETS = ("paper-12ghz", "paper-77ghz")
PLACES_M = {"torso": (0.0, 0.0, 1.0), "left, low": (-0.5, 2.0, 0.2), "near": (-1.0, 1.0, 1.0)}
SPEEDS_MPS = (0.0, 2.0, -2.0, 0.731, 8.0, -8.0)
VELOCITY_TOLERANCE = 0.1  # bins
STANDING_TOLERANCE = 0.1  # bins
MOVING_TOLERANCE = 1 / 3  # bins


def summed_power(radar: Radar, place: ArrayLike, velocity: ArrayLike) -> Array:
    """Map (range, velocity) of one frame, in the middle of which the point is at ``place``."""
    chirps = radar.chirps_per_frame
    times = radar.chirp_times(chirps)
    tx = radar.tx_of_chirp(np.arange(chirps))
    at = np.asarray(place) + (times - chirps * radar.chirp_duration_s / 2)[:, None] * np.asarray(
        velocity
    )
    there = np.linalg.norm(radar.tx[tx] - at, axis=1)
    back = np.linalg.norm(radar.rx[radar.rx_of_tx[tx]] - at[:, None], axis=2)
    length = (there[:, None] + back)[..., None]
    echoes = Echoes(
        length=length,
        amplitude=np.ones((1, *length.shape), dtype=np.complex128),
        frequency=np.array([radar.centre_frequency_hz]),
        tx=tx,
        part=np.zeros(1, dtype=np.int64),
        bounces=np.ones(1, dtype=np.int64),
    )
    values = range_doppler(synthesize(echoes, radar, times, dtype=np.complex64), radar).values
    return np.asarray((np.abs(values) ** 2).sum(axis=2))


def centroid(power: Array, reach: int) -> float:
    """Mean bin of the power within ``reach`` bins of its peak; the axis is cyclic."""
    bins = power.argmax() + np.arange(-reach, reach + 1)
    weights = power[bins % len(power)]
    return float(weights @ bins / weights.sum())


def nearest_alias(bins: float, cycles: int) -> float:
    """Fold a number of Doppler bins into the axis."""
    return (bins + cycles / 2) % cycles - cycles / 2


def case_rows(preset: str, place: str, speed: float) -> Iterator[Row]:
    radar = Radar.preset(preset)
    way = np.asarray(PLACES_M[place]) - np.asarray(radar.position_m)
    range_m = float(np.linalg.norm(way))
    power = summed_power(radar, PLACES_M[place], speed * way / range_m)

    cycles = radar.cycles_per_frame
    seen = nearest_alias(
        speed / radar.velocity_bin_mps, cycles
    )  # bins; not the speed itself where it aliases
    # 12 bins beside the plateau: a tone with a Hann window has 1e-6 of its power beyond them.
    reach = 12 + int(abs(speed) * radar.frame_duration_s / radar.range_bin_m)
    read_range = centroid(power.sum(axis=1), reach)
    read_velocity = seen + nearest_alias(
        centroid(power.sum(axis=0), reach) - cycles // 2 - seen, cycles
    )

    claim = f"{preset}, {place}, {speed:+g} m/s"
    velocity = "alias" if abs(speed) > radar.max_velocity_mps else "velocity"
    tolerance = MOVING_TOLERANCE if speed else STANDING_TOLERANCE
    says = f"a point reads back: range, {'moving' if speed else 'standing'}"
    yield judged(
        claim,
        "range",
        "bins",
        read_range,
        tolerance,
        reference=range_m / radar.range_bin_m,
        key="point",
        says=says,
    )
    says = "a point reads back: velocity or its known alias, up to and beyond the unambiguous one"
    yield judged(
        claim,
        velocity,
        "bins",
        read_velocity,
        VELOCITY_TOLERANCE,
        reference=seen,
        key="point",
        says=says,
    )
    peak = np.unravel_index(power.argmax(), power.shape)
    yield reported(
        claim,
        "highest cell, range off",
        "bins",
        float(peak[0]) - range_m / radar.range_bin_m,
        key="point",
    )
    off = nearest_alias(float(peak[1]) - cycles // 2 - seen, cycles)
    yield reported(claim, f"highest cell, {velocity} off", "bins", off, key="point")


def measure(quick: bool) -> list[Row]:
    presets = PRESETS[:1] if quick else PRESETS
    places = list(PLACES_M)[:2] if quick else list(PLACES_M)
    cases = [
        (preset, place, speed) for preset in presets for place in places for speed in SPEEDS_MPS
    ]
    return [row for case in cases for row in case_rows(*case)]


if __name__ == "__main__":
    sys.exit(main("A point echo at a known place and velocity reads back.", measure))
