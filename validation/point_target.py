"""A point echo at a known place and velocity reads back, from path lengths through IF and spectra to the map.

Both presets; places 3 to 5 m away, on the boresight and off it; standing, receding, approaching, and too fast, where
the reading is the known alias. Every length is exact, of that Tx and that Rx at the centre of that chirp. Reference:
range over the array's centre in the middle of the window, range rate with the wavelength of the sweep centre. Reading:
the centroid of the summed power of all channels, for a point at 2 m/s goes through five range bins in 0.1 s and, from the
low to the high end of the sweep, through as many Doppler bins: the map has a plateau there, and its highest cell (shown
below the table, no claim) says little.

    python validation/point_target.py [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.echoes import Echoes
from rtradar.process import range_doppler
from rtradar.radar import Radar
from rtradar.signal import synthesize

Array = NDArray[np.float64]

PRESETS = ("paper-12ghz", "paper-77ghz")
PLACES_M = {"torso": (0.0, 0.0, 1.0), "left, low": (-0.5, 2.0, 0.2), "near": (-1.0, 1.0, 1.0)}
SPEEDS_MPS = (0.0, 2.0, -2.0, 0.731, 8.0, -8.0)
VELOCITY_TOLERANCE = 0.1  # bins
STANDING_TOLERANCE = 0.1  # bins
MOVING_TOLERANCE = 1 / 3  # bins


@dataclass(frozen=True)
class Row:
    """One figure against its reference."""

    claim: str
    quantity: str
    unit: str
    reference: float
    ours: float
    error: float
    tolerance: float
    passed: bool


@dataclass(frozen=True)
class Peak:
    """Where the highest cell lies, in bins from the truth."""

    case: str
    range_bins: float
    velocity_bins: float


def summed_power(radar: Radar, place: ArrayLike, velocity: ArrayLike) -> Array:
    """Map (range, velocity) of one window, in the middle of which the point is at ``place``."""
    chirps = radar.chirps_per_frame
    times = radar.chirp_times(chirps)
    tx = radar.tx_of_chirp(np.arange(chirps))
    at = np.asarray(place) + (times - chirps * radar.chirp_duration_s / 2)[:, None] * np.asarray(velocity)
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
    """Mean bin of the power within ``reach`` of its peak, across the ends of the axis where need be."""
    bins = power.argmax() + np.arange(-reach, reach + 1)
    weights = power[bins % len(power)]
    return float(weights @ bins / weights.sum())


def nearest_turn(bins: float, cycles: int) -> float:
    """A number of Doppler bins, less whole turns of the axis."""
    return (bins + cycles / 2) % cycles - cycles / 2


def measure(preset: str, place: str, speed: float) -> tuple[list[Row], Peak]:
    radar = Radar.preset(preset)
    way = np.asarray(PLACES_M[place]) - np.asarray(radar.position_m)
    range_m = float(np.linalg.norm(way))
    power = summed_power(radar, PLACES_M[place], speed * way / range_m)

    cycles = radar.cycles_per_frame
    seen = nearest_turn(speed / radar.velocity_bin_mps, cycles)  # bins; not the speed itself where it aliases
    # 12 bins beside the plateau: a Hann-windowed tone has 1e-6 of its power beyond.
    reach = 12 + int(abs(speed) * radar.frame_duration_s / radar.range_bin_m)
    read_range = centroid(power.sum(axis=1), reach)
    read_velocity = seen + nearest_turn(centroid(power.sum(axis=0), reach) - cycles // 2 - seen, cycles)

    case = f"{preset}, {place}, {speed:+g} m/s"
    aliased = abs(speed) > radar.max_velocity_mps
    range_tolerance = MOVING_TOLERANCE if speed else STANDING_TOLERANCE
    rows = [
        row(f"{case}: range", "m", range_m, radar.range_bin_m, read_range, range_tolerance),
        row(
            f"{case}: {'alias' if aliased else 'velocity'}",
            "m/s",
            seen * radar.velocity_bin_mps,
            radar.velocity_bin_mps,
            read_velocity,
            VELOCITY_TOLERANCE,
        ),
    ]
    peak = np.unravel_index(power.argmax(), power.shape)
    off_velocity = nearest_turn(float(peak[1]) - cycles // 2 - seen, cycles)
    return rows, Peak(case, float(peak[0]) - range_m / radar.range_bin_m, off_velocity)


def row(quantity: str, unit: str, reference: float, width: float, bins: float, tolerance_bins: float) -> Row:
    """A reading in bins of this width, in the unit of its axis; error and tolerance alike."""
    ours = bins * width
    error = ours - reference
    tolerance = tolerance_bins * width
    return Row("a point echo reads back", quantity, unit, reference, ours, error, tolerance, abs(error) <= tolerance)


def measurements() -> Iterator[tuple[list[Row], Peak]]:
    for preset in PRESETS:
        for place in PLACES_M:
            for speed in SPEEDS_MPS:
                yield measure(preset, place, speed)


def main() -> int:
    parser = argparse.ArgumentParser(description="A point echo at a known place and velocity reads back.")
    parser.add_argument("--json", type=Path, help="write the rows there as well")
    options = parser.parse_args()

    rows: list[Row] = []
    peaks: list[Peak] = []
    print(f"{'quantity':46s} {'unit':4s} {'reference':>10s} {'ours':>10s} {'error':>10s} {'tolerance':>10s}  error/bin")
    for measured, peak in measurements():
        peaks.append(peak)
        for entry in measured:
            rows.append(entry)
            radar = Radar.preset(entry.quantity.split(",")[0])
            width = radar.range_bin_m if entry.unit == "m" else radar.velocity_bin_mps
            print(
                f"{entry.quantity:46s} {entry.unit:4s} {entry.reference:10.5f} {entry.ours:10.5f} {entry.error:10.5f} "
                f"{entry.tolerance:10.5f} {entry.error / width:10.4f}  {'passed' if entry.passed else 'FAILED'}",
                flush=True,
            )
    print(f"\n{'highest cell, bins from the truth':46s} {'range':>7s} {'velocity':>9s}")
    for peak in peaks:
        print(f"{peak.case:46s} {peak.range_bins:7.2f} {peak.velocity_bins:9.2f}")
    if options.json:
        content = {"rows": [asdict(entry) for entry in rows], "peaks": [asdict(peak) for peak in peaks]}
        options.json.write_text(json.dumps(content, indent=1) + "\n")
    failed = sum(not entry.passed for entry in rows)
    print(f"\n{len(rows) - failed} of {len(rows)} figures within their tolerance")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
