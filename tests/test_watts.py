"""Powers in watts against the radar equation, written out, and noise against kTBF.

Powers are far below the default absolute tolerance of `pytest.approx`, so all tests set ``abs=0``.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import rtradar as rt
from rtradar.front_end import Antenna
from rtradar.process import range_spectrum
from rtradar.signal import Noise, synthesize

RADAR = rt.Radar(
    tx_y=1,
    tx_z=0,
    rx_y=4,
    rx_z=0,
    chirp_duration_s=250e-6,
    samples_per_chirp=128,
    frame_duration_s=0.05,
    transmit_power_dbm=12.0,
    noise_figure_db=11.0,
    tx_antenna=Antenna(gain_dbi=8.0),
    rx_antenna=Antenna(gain_dbi=5.0),
)


def test_a_sphere_by_the_radar_equation() -> None:
    # Skolnik: P_r = P_t G_t G_r lambda^2 sigma / ((4 pi)^3 R^4), by decibels.
    distance, sigma, wavelength = 64 * RADAR.range_bin_m, 0.25, 299_792_458 / 14e9
    expected_dbm = (
        12
        + 8
        + 5
        + 20 * math.log10(wavelength)
        + 10 * math.log10(sigma)
        - 30 * math.log10(4 * math.pi)
    )
    expected_dbm -= 40 * math.log10(distance)
    length = np.full((1, 4, 1), 2 * distance)
    amplitude = np.full((1, 1, 4, 1), math.sqrt(sigma) / distance**2, dtype=np.complex128)
    one = np.zeros(1, np.int64)
    echoes = rt.Echoes(
        length=length,
        amplitude=amplitude,
        frequency=np.array([14e9]),
        tx=one,
        part=one,
        bounces=one + 1,
    )
    spectra = range_spectrum(synthesize(echoes, RADAR, RADAR.chirp_times(1)), RADAR)
    peak = np.abs(spectra[0, 0, 64]) ** 2 * RADAR.watts_per_m2
    assert 10 * math.log10(peak * 1e3) == pytest.approx(expected_dbm, abs=0.001)


def test_noise_is_ktbf() -> None:
    # -174 dBm/Hz, 11 dB, 512 kHz.
    assert RADAR.sample_rate_hz == pytest.approx(512e3)
    assert 10 * math.log10(RADAR.noise_power_w * 1e3) == pytest.approx(
        -173.975 + 11 + 10 * math.log10(512e3), abs=0.001
    )


@pytest.mark.parametrize(
    ("figure_db", "antenna_k"),
    [
        (11.0, 290.0),
        (11.0, 20.0),
        (11.0, 0.0),
        (3.0, 290.0),
        (3.0, 2900.0),
        (0.0, 77.0),
        (0.0, 0.0),
    ],
)
def test_the_receiver_adds_its_noise_whatever_the_antennas_see(
    figure_db: float, antenna_k: float
) -> None:
    # The noise figure is defined for a source of 290 K: the receiver adds F - 1 (Friis 1944).
    radar = dataclasses.replace(RADAR, noise_figure_db=figure_db, noise_temperature_k=antenna_k)
    received = 1.380649e-23 * antenna_k * 512e3
    added = 1.380649e-23 * 290 * (10 ** (figure_db / 10) - 1) * 512e3
    assert radar.noise_power_w == pytest.approx(received + added, rel=1e-12, abs=0)
    samples = np.zeros((2000, 4, 128), np.complex64)
    Noise(radar.noise_power_w / radar.watts_per_m2, 0).add(samples, radar, 0)
    measured = (np.abs(samples.astype(np.complex128)) ** 2).mean() * radar.watts_per_m2
    assert measured == pytest.approx(received + added, rel=5 / math.sqrt(samples.size), abs=0)


def test_a_run_by_watts(tmp_path: Path) -> None:
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.2)
    results = [
        rt.run(
            motion,
            radar,
            out=tmp_path / name,
            fidelity="analytic",
            snr_db="physical",
            range_window="hann",
            doppler_window="hann",
        )
        for name, radar in (
            ("a", RADAR),
            ("b", dataclasses.replace(RADAR, transmit_power_dbm=22.0)),
        )
    ]
    first, second = (result.summary for result in results)
    assert first["parameters"]["snr_db"] == "physical"
    assert first["watts"]["noise_power_w"] == pytest.approx(RADAR.noise_power_w, rel=1e-12, abs=0)
    assert second["watts"]["noise_power_w"] == pytest.approx(RADAR.noise_power_w, rel=1e-12, abs=0)
    assert second["watts"]["echo_power_w"] == pytest.approx(
        10 * first["watts"]["echo_power_w"], rel=1e-12, abs=0
    )
    assert second["noise_power_m2"] == pytest.approx(first["noise_power_m2"] / 10, rel=1e-12, abs=0)
    with h5py.File(tmp_path / "a" / "maps.h5") as file:
        floor = float(np.median(file["range_doppler"][0])) * RADAR.watts_per_m2
    # Hann in both transforms, four channels: 1.5^2 / (128 samples x 200 cycles); the median of
    # Gamma(4) is 0.918 of its mean.
    expected = 4 * RADAR.noise_power_w * 1.5**2 / (128 * 200) * 0.918
    assert floor == pytest.approx(expected, rel=0.05, abs=0)


@pytest.mark.parametrize(
    ("changes", "options", "said"),
    [
        ({"transmit_power_dbm": None}, {}, "does not state transmit_power_dbm"),
        ({"noise_figure_db": None}, {}, "does not state noise_figure_db"),
        ({}, {"spreading": False}, "needs the loss with distance"),
        ({}, {"snr_db": "best"}, "a number of decibels .* inf or physical"),
    ],
)
def test_what_is_missing_is_said_before_the_work(
    tmp_path: Path, changes: dict[str, Any], options: dict[str, Any], said: str
) -> None:
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.2)
    with pytest.raises(rt.InputError, match=said):
        rt.run(
            motion,
            dataclasses.replace(RADAR, **changes),
            out=tmp_path / "out",
            **({"snr_db": "physical"} | options),
        )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("field", "value"), [("transmit_power_dbm", 1e3), ("noise_temperature_k", None)]
)
def test_powers_without_meaning(field: str, value: object) -> None:
    with pytest.raises(rt.InputError, match=f"{field} = .*it must be a number from"):
        rt.Radar(**{field: value})
