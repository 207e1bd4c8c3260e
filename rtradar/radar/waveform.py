"""The chirp, and what follows from it: wavelengths, and how ranges are told apart."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS


@dataclass(frozen=True, kw_only=True)
class Waveform:
    """Fields as in `rtradar.Radar`, which checks them."""

    name: str = "custom"
    start_frequency_hz: float = 12e9
    bandwidth_hz: float = 4e9
    chirp_duration_s: float = 62.5e-6
    samples_per_chirp: int = 256

    @property
    def centre_frequency_hz(self) -> float:
        """Middle of the sweep [Hz]; phases at a range bin turn with this one."""
        return self.start_frequency_hz + self.bandwidth_hz / 2

    @property
    def wavelength_m(self) -> float:
        """Wavelength at the sweep centre [m]."""
        return SPEED_OF_LIGHT_MPS / self.centre_frequency_hz

    @property
    def start_wavelength_m(self) -> float:
        """Wavelength at the sweep start [m], the unit of the antenna spacings."""
        return SPEED_OF_LIGHT_MPS / self.start_frequency_hz

    @property
    def slope_hz_per_s(self) -> float:
        """Sweep rate [Hz/s]."""
        return self.bandwidth_hz / self.chirp_duration_s

    @property
    def sample_rate_hz(self) -> float:
        """Complex IF samples a second [Hz]."""
        return self.samples_per_chirp / self.chirp_duration_s

    @property
    def range_bin_m(self) -> float:
        """Range resolution and width of one range bin, c / 2B [m] (paper, eq. 2).

        Equation :eq:`range-axis` of the theory page.
        """
        return SPEED_OF_LIGHT_MPS / (2 * self.bandwidth_hz)

    @property
    def max_range_m(self) -> float:
        """Range whose beat frequency reaches the sample rate, c Fs / 2s [m] (paper, eq. 1).

        Equation :eq:`range-axis` of the theory page.
        """
        return self.range_bin_m * self.samples_per_chirp

    @cached_property
    def range_m(self) -> NDArray[np.float64]:
        """Range of each range bin (range,) [m], half the Tx..Rx path."""
        return np.arange(self.samples_per_chirp, dtype=np.float64) * self.range_bin_m
