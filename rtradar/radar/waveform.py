"""The sweep of a radar and the samples of it, and the range that follows from both."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.system.fields import Limits

MOST, _MOST_SAMPLES = 65536, 16384
"""Largest counts of antennas on a line and of bands, and of samples of a chirp, four times as
many as chips of boards take."""


def positive(least: float = 1e-15, most: float = 1e15) -> Limits:
    """Return the limits of a number above 0, far outside of every radar where none are given.

    Inside, no product or ratio of two of them leaves the range of float64.
    """
    given = "" if (least, most) == (1e-15, 1e15) else f", {least:g} to {most:g}"
    return Limits(least, most, f"it must be a positive, finite number{given}")


@dataclass(frozen=True, kw_only=True, repr=False)
class Waveform:
    """The sweep of a radar, and what follows from it; `Radar` documents the fields."""

    start_frequency_hz: Annotated[float, positive(1e9, 300e9)] = 12e9
    bandwidth_hz: Annotated[float, positive(1e6, 100e9)] = 4e9
    chirp_duration_s: Annotated[float, positive(1e-15, 0.1)] = 62.5e-6
    samples_per_chirp: Annotated[int, Limits(1, _MOST_SAMPLES)] = 256
    adc_start_s: Annotated[float, Limits(0, 0.1)] = 0.0
    adc_rate_hz: Annotated[float | None, positive()] = None

    @property
    def slope_hz_per_s(self) -> float:
        """Sweep rate [Hz/s] (:eq:`chirp`)."""
        return self.bandwidth_hz / self.chirp_duration_s

    @property
    def sampled_duration_s(self) -> float:
        """Length of the part of a chirp in which its IF is sampled [s]."""
        if self.adc_rate_hz is None:
            return self.chirp_duration_s - self.adc_start_s
        return self.samples_per_chirp / self.adc_rate_hz

    @property
    def sample_rate_hz(self) -> float:
        """Rate of the complex IF samples [Hz]."""
        return self.adc_rate_hz or self.samples_per_chirp / self.sampled_duration_s

    @property
    def sampled_start_hz(self) -> float:
        """Frequency of the sweep at the first IF sample [Hz]."""
        return self.start_frequency_hz + self.slope_hz_per_s * self.adc_start_s

    @property
    def sampled_bandwidth_hz(self) -> float:
        """Part of the bandwidth that is swept while the IF is sampled [Hz]."""
        # The whole sweep, without the rounding of a product.
        if self.adc_rate_hz is None and self.adc_start_s == 0:
            return self.bandwidth_hz
        return self.slope_hz_per_s * self.sampled_duration_s

    @property
    def centre_frequency_hz(self) -> float:
        """Frequency at the middle of the samples [Hz]; the phase at a range bin changes with it."""
        return self.sampled_start_hz + self.sampled_bandwidth_hz / 2

    @property
    def wavelength_m(self) -> float:
        """Wavelength at the middle of the samples [m]."""
        return SPEED_OF_LIGHT_MPS / self.centre_frequency_hz

    @property
    def start_wavelength_m(self) -> float:
        """Wavelength at the sweep start [m], the unit of the antenna spacings."""
        return SPEED_OF_LIGHT_MPS / self.start_frequency_hz

    @property
    def range_bin_m(self) -> float:
        """Range resolution and width of one range bin, c / 2B [m] (:eq:`range-axis`).

        B is the bandwidth that is sampled.
        """
        return SPEED_OF_LIGHT_MPS / (2 * self.sampled_bandwidth_hz)

    @property
    def max_range_m(self) -> float:
        """Range whose beat frequency is the sample rate, c Fs / 2s [m] (:eq:`range-axis`)."""
        return self.range_bin_m * self.samples_per_chirp

    @cached_property
    def range_m(self) -> NDArray[np.float64]:
        """Range of each range bin (range,) [m], half the length of the path from Tx to Rx."""
        return np.arange(self.samples_per_chirp, dtype=np.float64) * self.range_bin_m
