"""What follows from the paper's radar without a run: its tables 1 and 2 and its equations."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.paper.items import PAPER_OS_SCALE, Sources
from rtradar.process.window_functions import hann
from rtradar.radar import Radar
from rtradar.system.figure_style import new_figure, save_figure

_BODY_PARTS, _NOISE_M2 = 21, 0.01  # of the paper's program: noise of fixed power for each part
_LEVELS_DB = {"siso": 50.0, "mimo": 85.0}
_TARGET_M = 4.0


def radar_figures(sources: Sources) -> dict[str, Any]:
    """Compute limits, the far field, and levels above the noise; draw the arrays.

    Parameters
    ----------
    sources : Sources
        Folder of the pictures.

    Returns
    -------
    dict
        Figures by their names.
    """
    # Figure 1 has a small array, and figure 3 that of the paper.
    radar = Radar.preset("paper-12ghz")
    pair = dataclasses.replace(radar, name="2Tx-4Rx", tx_y=2, tx_z=0, rx_y=4, rx_z=0)
    for name, drawn in (("figure-1", pair), ("figure-3", radar)):
        figure = new_figure(4.6)
        drawn.plot(ax=figure.subplots())
        save_figure(figure, sources.out / f"{name}.png")
    # The paper takes the wavelength at the start of the sweep for some limits; ours are at its
    # centre.
    start_m = SPEED_OF_LIGHT_MPS / radar.start_frequency_hz
    high = {name: slow_chirps(name).max_velocity_mps for name in ("60", "77")}
    delay_s = 2 * 5.0 / SPEED_OF_LIGHT_MPS
    return {
        "slope": radar.slope_hz_per_s,
        "rate": radar.sample_rate_hz / 1e6,
        "chirps": round(radar.frame_duration_s / radar.chirp_duration_s),
        "cycles": radar.cycles_per_frame,
        "channels": radar.n_channels,
        "pairs": radar.n_tx * len(radar.rx),
        "r_max": radar.max_range_m,
        "r_bin_cm": 100 * radar.range_bin_m,
        "v_max": radar.max_velocity_mps,
        "v_bin": radar.velocity_bin_mps,
        "angle": radar.max_angle_deg,
        "beam": radar.angle_resolution_deg,
        "null_start": math.degrees(2 * math.asin(1 / 48)),
        "null_centre": math.degrees(2 * math.asin(radar.wavelength_m / start_m / 48)),
        "start_mm": 1e3 * start_m,
        "centre_mm": 1e3 * radar.wavelength_m,
        "too_high": 100 * (start_m / radar.wavelength_m - 1),
        "v_60": high["60"],
        "v_77": high["77"],
        "neglected_rad": math.pi * radar.slope_hz_per_s * delay_s**2,
        "hop_ms": 1e3 * radar.frame_hop_s,
        **_far_field(radar),
        **_levels(radar),
    }


def slow_chirps(name: str) -> Radar:
    """Return the radar at 60 or 77 GHz with the chirps of the one at 12 GHz.

    Parameters
    ----------
    name : str
        Start frequency [GHz], in digits.

    Returns
    -------
    Radar
    """
    return dataclasses.replace(
        Radar.preset("paper-12ghz"), name=f"{name} GHz", start_frequency_hz=float(name) * 1e9
    )


def _far_field(radar: Radar) -> dict[str, Any]:
    """Compute what a far-field FFT makes of a point at 4 m before the array."""
    # The phases are those of the exact paths, and the beams those of a far-field transform: once of
    # these phases, and once of equal phases, as if the point were in focus.
    tx, rx = radar.tx_m[: radar.tx_y], radar.rx_m[: radar.rx_y]
    point = np.array([_TARGET_M, 0.0, 0.0])
    length = np.linalg.norm(tx - point, axis=1)[:, None] + np.linalg.norm(rx - point, axis=1)
    element = (tx[:, None, 1] + rx[:, 1]).ravel()
    wave = 2 * np.pi / radar.wavelength_m
    sines = np.linspace(-0.15, 0.15, 6001)
    field = np.exp(-1j * wave * (length.ravel() - 2 * _TARGET_M))
    beams = {}
    for name, phases in (("far", field), ("near", np.ones_like(field))):
        pattern = np.abs(np.exp(-1j * wave * sines[:, None] * element) @ phases) / len(element)
        above = sines[pattern > pattern.max() / math.sqrt(2)]
        beams[name] = pattern.max(), math.degrees(above[-1] - above[0])
    aperture_m = float(np.ptp(element))
    return {
        "aperture": aperture_m,
        "far_field": 2 * aperture_m**2 / radar.wavelength_m,
        "far_loss_db": -20 * math.log10(abs(field.mean())),
        "far_beam": beams["far"][1],
        "near_beam": beams["near"][1],
    }


def _levels(radar: Radar) -> dict[str, Any]:
    """Compute the paper's two levels of truth above its own noise, and its false-alarm rate."""
    # The paper's windows are not normalised, so they raise the noise of a cell by the sum of their
    # squares.
    windows = hann(radar.samples_per_chirp), hann(radar.cycles_per_frame)
    gain = math.prod(float((window**2).sum()) for window in windows)
    noise_db = 10 * math.log10(_BODY_PARTS * _NOISE_M2 * gain)
    cells, rank = 144, 108  # of the training band, and 75 % of them
    alarm = math.prod((cells - i) / (cells - i + PAPER_OS_SCALE) for i in range(rank))
    return {
        "siso_level": _LEVELS_DB["siso"] - noise_db,
        "mimo_level": _LEVELS_DB["mimo"] - 20 * math.log10(radar.n_channels) - noise_db,
        "os_alarm": alarm,
        "os_once": round(1 / alarm),
    }
