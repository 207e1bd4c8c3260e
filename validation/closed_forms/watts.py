"""Received power and noise in watts: the whole chain against the radar equation and k T B F.

reflector  a triangular trihedral of 0.5 m by `rays`, through IF samples and a range spectrum: watts
           at the peak against P_t G_t G_r lambda^2 sigma / ((4 pi)^3 R^4) (Skolnik, Introduction to
           Radar Systems, 3rd ed., section 1.2), with sigma = 4 pi a^4 / (3 lambda^2)
small      the same with 0.3 m, where the single bounces of the three plates count more; the closed
           form omits them, so this is reported
point      the same chain with a known cross-section
noise      mean power of IF samples without an echo against k (T + 290 K (F - 1)) Fs (Friis, Proc.
           IRE 32, 1944), within five standard deviations of that mean, at antenna temperatures T of
           290, 20 and 0 K, and through the range-Doppler map

The return of a trihedral is computed far away, where it has its cross-section, and then set at its
range.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Iterator

import numpy as np
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.process import power_map, range_spectrum
from rtradar.signal import Noise, synthesize
from rtradar.validate.rows import Row, judged, main, reported

LIGHT, BOLTZMANN = 299_792_458.0, 1.380649e-23
FAR_M = 500.0
POWER_DBM, TX_GAIN_DBI, RX_GAIN_DBI, FIGURE_DB = 12.0, 9.0, 7.0, 11.0


def radar(centre_hz: float) -> rt.Radar:
    """One Tx and two Rx that point ahead, 1 GHz about the centre."""
    return rt.Radar(
        start_frequency_hz=centre_hz - 0.5e9,
        bandwidth_hz=1e9,
        tx_y=1,
        tx_z=0,
        rx_y=2,
        rx_z=0,
        position_m=(0.0, 0.0, 0.0),
        transmit_power_dbm=POWER_DBM,
        noise_figure_db=FIGURE_DB,
        tx_antenna=rt.Antenna(gain_dbi=TX_GAIN_DBI),
        rx_antenna=rt.Antenna(pattern="cosine", exponent=2.0, gain_dbi=RX_GAIN_DBI),
    )


def equation_dbm(centre_hz: float, sigma: float, distance: float) -> float:
    """Received power by the radar equation, in decibels."""
    wavelength = LIGHT / centre_hz
    gains = POWER_DBM + TX_GAIN_DBI + RX_GAIN_DBI
    return gains + 10 * math.log10(wavelength**2 * sigma / ((4 * math.pi) ** 3 * distance**4))


def received_dbm(centre_hz: float, scattering: complex, distance: float) -> float:
    """Received power through the chain of a scattering length [m] on the boresight [dBm]."""
    made = radar(centre_hz)
    length = np.linalg.norm(made.rx - [distance, 0, 0], axis=1)[None, :, None] + np.linalg.norm(
        made.tx[0] - [distance, 0, 0]
    )
    one = np.zeros(1, np.int64)
    amplitude = np.full((1, *length.shape), np.conj(scattering) / distance**2)
    echoes = rt.Echoes(
        length=length,
        amplitude=amplitude,
        frequency=np.array([centre_hz]),
        tx=one,
        part=one,
        bounces=one + 1,
    )
    spectra = range_spectrum(synthesize(echoes, made, made.chirp_times(1)), made)
    return float(10 * np.log10((np.abs(spectra[0]) ** 2).max() * made.watts_per_m2 * 1e3))


def trihedral(edge: float, centre_hz: float) -> complex:
    """Scattering length of three right triangles, seen along the middle, by `rays`."""
    corners = np.vstack([np.zeros(3), edge * np.eye(3)])
    mesh = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 1]], process=False)
    place = np.full((1, 3), FAR_M / math.sqrt(3))
    return complex(rt.scattering_length(mesh, place, place, centre_hz, fidelity="rays")[0])


def reflector_rows(quick: bool) -> Iterator[Row]:
    distance = 40 * radar(14e9).range_bin_m
    for centre in (14e9,) if quick else (14e9, 24e9):
        for edge in (0.5, 0.3):
            sigma = 4 * math.pi * edge**4 / (3 * (LIGHT / centre) ** 2)
            found = received_dbm(centre, trihedral(edge, centre), distance)
            expected = equation_dbm(centre, sigma, distance)
            what = f"power of a trihedral of {edge} m at {distance:.2f} m, {centre / 1e9:.0f} GHz"
            if edge == 0.5:
                says = (
                    "received power of a corner reflector of 0.5 m in watts, by `rays`, "
                    "against the radar equation"
                )
                yield judged("reflector", what, "dBm", found, 0.1, reference=expected, says=says)
            else:
                yield reported("small", what, "dBm", found, reference=expected)


def point_rows() -> Iterator[Row]:
    for centre in (14e9, 24e9, 79e9):
        distance = 25 * radar(centre).range_bin_m
        found = received_dbm(centre, math.sqrt(0.7), distance)
        says = (
            "received power of a point of known cross-section in watts against the radar equation"
        )
        expected = equation_dbm(centre, 0.7, distance)
        yield judged(
            "point",
            f"power at {centre / 1e9:.0f} GHz",
            "dBm",
            found,
            0.01,
            reference=expected,
            says=says,
        )


def noise_rows(quick: bool) -> Iterator[Row]:
    made = radar(24e9)
    expected = noise_w(290.0)
    total, count, maps = 0.0, 0, []
    for seed in range(2 if quick else 8):
        samples = noise_samples(made, seed)
        total += float((np.abs(samples.astype(np.complex128)) ** 2).sum()) * made.watts_per_m2
        count += samples.size
        power = power_map(range_spectrum(samples, made)[:, None], made)
        maps.append(float(power.mean()) * made.watts_per_m2)
    sigmas = abs(total / count / expected - 1) * math.sqrt(count)
    yield reported(
        "noise",
        "power of a sample",
        "dBm",
        10 * math.log10(total / count * 1e3),
        reference=10 * math.log10(expected * 1e3),
    )
    says = "noise power of IF samples in watts against k T F Fs, in standard deviations of the mean"
    yield judged("noise", f"of {count} samples, off by", "sigma", sigmas, 5.0, says=says)
    # Two channels, and a Hann window in each transform, of 1.5 bins.
    mapped = expected * 2 * 1.5**2 / (256 * made.cycles_per_frame)
    error = abs(10 * math.log10(float(np.mean(maps)) / mapped))
    says = "noise power in range-Doppler maps in watts against k T F Fs over the windows' gain"
    yield judged("noise", "in the map", "dB", error, 0.02, says=says)
    says = (
        "noise power of IF samples with antennas that see 0, 20 and 1000 K against "
        "k (T + 290 K (F - 1)) Fs, in standard deviations of the mean"
    )
    for antenna_k in (0.0, 20.0, 1000.0):
        samples = noise_samples(dataclasses.replace(made, noise_temperature_k=antenna_k), 8)
        mean = float((np.abs(samples.astype(np.complex128)) ** 2).mean()) * made.watts_per_m2
        sigmas = abs(mean / noise_w(antenna_k) - 1) * math.sqrt(samples.size)
        yield judged(
            "noise", f"antennas that see {antenna_k:g} K, off by", "sigma", sigmas, 5.0, says=says
        )


def noise_w(antenna_k: float) -> float:
    """Noise of one IF sample [W]: that of the antennas, and the receiver's, by its noise figure."""
    return BOLTZMANN * (antenna_k + 290 * (10 ** (FIGURE_DB / 10) - 1)) * 256 / 62.5e-6


def noise_samples(made: rt.Radar, seed: int) -> NDArray[np.complex64]:
    """IF samples of one frame without an echo."""
    samples = np.zeros((made.chirps_per_frame, 2, 256), np.complex64)
    Noise(made.noise_power_w / made.watts_per_m2, seed).add(samples, made, 0)
    return samples


def measure(quick: bool) -> list[Row]:
    return [*reflector_rows(quick), *point_rows(), *noise_rows(quick)]


if __name__ == "__main__":
    sys.exit(main("Received power and noise in watts", measure))
