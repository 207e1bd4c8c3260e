"""Angles of a point echo: its direction, the width of the beam, and the gain of focusing.

The IF samples of a point are computed here from the paper's Table 1: the antenna positions, the
TDM order, the exact path over each Tx and Rx at the instant of every sample, and
exp(j 2 pi (f tau + s tau t - s tau^2 / 2)). The point is 4 m away and stands still, or it moves at
+-3 m/s along the line of sight, through 8 range bins, and is 4 m away in the middle of the frame.
Beam widths are compared with the closed form, the sum of the phases of the 48 paths at the middle
of the sweep.

    python validation/closed_forms/angle.py [--quick] [--json FILE]
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from rtradar.clouds.spatial import spatial_points
from rtradar.process import range_spectrum
from rtradar.process.angles import AngleSpectra, angle, angle_spectra
from rtradar.process.spectra import cell_spectra
from rtradar.process.steering import Taper
from rtradar.radar import Radar
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import power_db

Array = NDArray[np.float64]

C = 299_792_458.0
BANDWIDTH_HZ, N_SAMPLES, N_TX, N_RX = 4e9, 256, 6, 8  # of each line
START_HZ = {"paper-12ghz": 12e9, "paper-77ghz": 77e9}
CHIRP_S = {"paper-12ghz": 62.5e-6, "paper-77ghz": 12.5e-6}
CYCLES = {"paper-12ghz": 133, "paper-77ghz": 666}
RANGE_M = 4.0
DIRECTIONS_DEG = ((0.0, 0.0), (-14.0, -3.0), (30.0, 10.0), (-40.0, 20.0), (12.0, -30.0))
SPEEDS_MPS = (0.0, 3.0, -3.0)
TOLERANCE_DEG = 0.5


def line_places(preset: str) -> tuple[Array, Array]:
    """Tx and Rx on one line, about its middle [m]: 4 and 1/2 wavelengths of the low end apart."""
    wavelength = C / START_HZ[preset]
    return (np.arange(N_TX) - 2.5) * 4 * wavelength, (np.arange(N_RX) - 3.5) * wavelength / 2


def place_of(azimuth_deg: float, elevation_deg: float) -> Array:
    """Position at the range of all points, in the radar's frame [m]."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    way = [
        np.cos(elevation) * np.cos(azimuth),
        np.cos(elevation) * np.sin(azimuth),
        np.sin(elevation),
    ]
    return RANGE_M * np.array(way)


def samples_of(preset: str, place: Array, speed: float) -> NDArray[np.complex64]:
    """IF samples of one frame (chirp, rx, sample); the point is at ``place`` in its middle."""
    chirp_s, slope = CHIRP_S[preset], BANDWIDTH_HZ / CHIRP_S[preset]
    tx, rx = line_places(preset)
    n_chirps = CYCLES[preset] * 2 * N_TX
    fast = np.arange(N_SAMPLES) / N_SAMPLES * chirp_s
    x = np.empty((n_chirps, N_RX, N_SAMPLES), dtype=np.complex64)
    for chirp in range(n_chirps):
        line, number = divmod(chirp % (2 * N_TX), N_TX)  # the line along y first, then that along z
        moved = speed * (chirp * chirp_s + fast - n_chirps * chirp_s / 2)
        at = place[:, None] * (1 + moved / RANGE_M)
        along, square = at[1 + line], (at**2).sum(axis=0)
        there = np.sqrt(square - 2 * along * tx[number] + tx[number] ** 2)
        back = np.sqrt(square - 2 * along * rx[:, None] + rx[:, None] ** 2)
        tau = (there + back) / C
        x[chirp] = np.exp(
            2j * np.pi * (START_HZ[preset] * tau + slope * tau * fast - slope * tau**2 / 2)
        )
    return x


def spectra_of(
    preset: str, x: NDArray[np.complex64], speed: float, focus: bool, taper: Taper
) -> AngleSpectra:
    """Spectra of the cell in which the point is in the middle of the frame."""
    radar = Radar.preset(preset)
    cube = range_spectrum(x, radar).reshape(CYCLES[preset], 2 * N_TX, N_RX, N_SAMPLES)
    row = round(RANGE_M / radar.range_bin_m)
    column = round(speed / radar.velocity_bin_mps)
    values = cell_spectra(cube, radar, [row], [column + CYCLES[preset] // 2])
    cell = [row * radar.range_bin_m], [column * radar.velocity_bin_mps]
    return angle_spectra(values, radar, *cell, focus=focus, taper=taper)


def finely(seen: AngleSpectra) -> tuple[Array, Array]:
    """Azimuths [deg] and power of one cell, sampled twice as finely as the power varies."""
    assert seen.y is not None
    fine = np.linspace(seen.sines[0], seen.sines[-1], 40_001)
    return np.degrees(np.arcsin(fine)), CubicSpline(seen.sines, seen.y[0].astype(np.float64))(fine)


def peak_and_width(angles_deg: Array, power: Array) -> tuple[float, float]:
    """Highest power, and the width of its lobe at half of that power [deg]."""
    top = int(power.argmax())
    below = power < power[top] / 2
    left, right = top - np.argmax(below[top::-1]), top + np.argmax(below[top:])
    return float(power[top]), float(angles_deg[right] - angles_deg[left])


def closed_form(preset: str, focus: bool) -> tuple[float, float]:
    """Highest power and beam width [deg] of one line, uniformly weighted, for a boresight point."""
    tx, rx = line_places(preset)
    wavelength = C / (START_HZ[preset] + BANDWIDTH_HZ / 2)
    angles = np.linspace(-10, 10, 8001)
    u = np.sin(np.radians(angles))

    def paths(sines: ArrayLike) -> Array:
        legs = [
            np.sqrt(RANGE_M**2 - 2 * RANGE_M * np.multiply.outer(sines, p) + p**2) for p in (tx, rx)
        ]
        return np.asarray(legs[0][..., :, None] + legs[1][..., None, :])

    plane = 2 * RANGE_M - np.multiply.outer(u, tx[:, None] + rx)
    phase = 2 * np.pi / wavelength * (paths(0.0) - (paths(u) if focus else plane))
    return peak_and_width(angles, np.abs(np.exp(1j * phase).mean(axis=(1, 2))) ** 2)


def direction_rows(preset: str, direction: tuple[float, float], speed: float) -> Iterator[Row]:
    radar = Radar.preset(preset)
    place = place_of(*direction)
    x = samples_of(preset, place, speed)
    case = f"{preset}, azimuth {direction[0]:+.0f}, elevation {direction[1]:+.0f}, {speed:+.0f} m/s"
    for name, truth, found in zip(
        ("azimuth", "elevation"), direction, angle(x, radar, RANGE_M, speed), strict=True
    ):
        says = f"a point reads back: {name}, 4 m away, standing and at 3 m/s"
        degrees = float(np.degrees(found))
        yield judged(
            case, name, "deg", degrees, TOLERANCE_DEG, reference=truth, key="point", says=says
        )
    cloud = spatial_points(spectra_of(preset, x, speed, True, "taylor"), radar, 0.05)
    # Half a range bin and half a degree at 4 m. If there are several peaks, all must lie there.
    off = np.linalg.norm(cloud.points - np.array(radar.position_m) - place, axis=1)
    limit = radar.range_bin_m / 2 + RANGE_M * np.radians(TOLERANCE_DEG)
    says = "a point reads back: farthest point of its spatial cloud"
    farthest = float(off.max()) if len(off) else np.nan
    yield judged(
        case,
        f"cloud: farthest of {len(off)} point(s)",
        "m",
        farthest,
        limit,
        key="point",
        says=says,
    )


def beam_rows(preset: str, x: NDArray[np.complex64]) -> Iterator[Row]:
    figures = {}
    cases: tuple[tuple[bool, Taper], ...] = (
        (True, "uniform"),
        (False, "uniform"),
        (True, "taylor"),
    )
    for focus, taper in cases:
        seen = spectra_of(preset, x, 0.0, focus, taper)
        figures[focus, taper] = peak_and_width(*finely(seen))
    case = f"{preset}, beam on the boresight"
    sharp, flat = closed_form(preset, True), closed_form(preset, False)
    ours = float(power_db(figures[False, "uniform"][0] / figures[True, "uniform"][0]))
    loss = float(power_db(flat[0] / sharp[0]))
    if preset == "paper-12ghz":
        says = "beam at 4 m, 12 GHz, broadside: what the far-field FFT loses to focusing, at least"
        yield judged(case, "far-field FFT against focusing, at most", "dB", ours, -3.5, says=says)
        says = "beam at 4 m, 12 GHz, broadside: width at -3 dB, focused, at most"
        yield judged(
            case,
            "width at -3 dB, focused, at most",
            "deg",
            figures[True, "uniform"][1],
            2.0,
            says=says,
        )
    # 0.1 dB and 0.05 deg, because the point is a quarter of a range bin off the middle of its cell.
    says = "what the far-field FFT loses at 4 m against the phases of all 48 paths, summed"
    yield judged(case, "far-field FFT against focusing", "dB", ours, 0.1, reference=loss, says=says)
    for name, focus, expected in (("focused", True, sharp[1]), ("far-field FFT", False, flat[1])):
        width, says = (
            figures[focus, "uniform"][1],
            "width of the beam at -3 dB against the phases of all 48 paths, summed",
        )
        yield judged(
            case, f"width at -3 dB, {name}", "deg", width, 0.05, reference=expected, says=says
        )
    yield reported(
        case,
        "width at -3 dB, focused, Taylor taper of the cloud",
        "deg",
        figures[True, "taylor"][1],
    )


def pair_rows(preset: str, apart_deg: float, taper: Taper) -> Iterator[Row]:
    """Two equal points side by side at eight phases: resolved where the power dips between them."""
    first, second = (
        samples_of(preset, place_of(side * apart_deg / 2, 0.0), 0.0) for side in (-1, 1)
    )
    radar = Radar.preset(preset)
    dips: list[float] = []
    blurred: list[float] = []
    errors: list[float] = []
    counts: list[int] = []
    for phase in np.arange(8) * np.pi / 4:
        x = first + second * np.complex64(np.exp(1j * phase))
        for focus, into in ((True, dips), (False, blurred)):
            seen = spectra_of(preset, x, 0.0, focus, taper)
            angles, power = finely(seen)
            near = np.where(abs(angles) < apart_deg, power, 0.0)
            left, right = (int(np.where(side * angles > 0, near, 0.0).argmax()) for side in (-1, 1))
            into.append(
                float(power_db(power[left : right + 1].min() / min(power[left], power[right])))
            )
            if focus:
                errors += [abs(abs(angles[there]) - apart_deg / 2) for there in (left, right)]
                counts.append(len(spatial_points(seen, radar, 0.0).points))
    case = f"{preset}, two points {apart_deg:g} deg apart, {taper}"
    if taper == "uniform":  # the claim; the dip is shallowest when the points are in phase
        says = "two points 3 degrees apart at 4 m: dip between them, at any phase"
        quantity = "dip between them, shallowest of 8 phases, at most"
        yield judged(case, quantity, "dB", max(dips), -1.0, says=says, cases=len(dips))
    else:
        yield reported(case, "dip between them, shallowest of 8 phases", "dB", max(dips))
        yield reported(case, "points in the cloud, fewest of 8 phases", "", min(counts))
    yield reported(case, "dip between them, median", "dB", float(np.median(dips)))
    yield reported(case, "dip with the far-field FFT, median", "dB", float(np.median(blurred)))
    yield reported(case, "largest error of a maximum", "deg", max(errors))


def measure(quick: bool) -> list[Row]:
    rows: list[Row] = []
    presets = ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz")
    speeds = SPEEDS_MPS[:2] if quick else SPEEDS_MPS
    for preset, direction, speed in itertools.product(presets, DIRECTIONS_DEG, speeds):
        rows += direction_rows(preset, direction, speed)
    for preset in presets:
        rows += beam_rows(preset, samples_of(preset, place_of(0.0, 0.0), 0.0))
    rows += pair_rows("paper-12ghz", 3.0, "uniform")
    rows += pair_rows("paper-12ghz", 3.0, "taylor")
    return rows


if __name__ == "__main__":
    sys.exit(main("Angles of a point echo: place, beam width, gain of focusing.", measure))
