"""The cross of two lines of antennas, and what follows from it: channels, and how angles are told apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.radar.waveform import Waveform


@dataclass(frozen=True, kw_only=True)
class CrossArray(Waveform):
    """Fields as in `rtradar.Radar`, which checks them."""

    tx_y: int = 6
    tx_z: int = 6
    rx_y: int = 8
    rx_z: int = 8
    tx_spacing_wavelengths: float = 4.0
    rx_spacing_wavelengths: float = 0.5
    position_m: tuple[float, float, float] = (-4.0, 1.0, 1.0)
    channels: Literal["pairs", "all"] = "pairs"

    @property
    def n_tx(self) -> int:
        """Transmitters, and chirps in one cycle."""
        return self.tx_y + self.tx_z

    @property
    def n_rx(self) -> int:
        """Length of the rx axis: receivers that are kept in one chirp."""
        return (
            self.rx_y + self.rx_z
            if self.channels == "all"
            else (self.rx_y if self.tx_y else self.rx_z)
        )

    @property
    def n_channels(self) -> int:
        """Virtual channels, ``n_tx * n_rx``; channel = tx * n_rx + rx."""
        return self.n_tx * self.n_rx

    def _lines(self, along_y: int, along_z: int, spacing_m: float) -> NDArray[np.float64]:
        places = np.zeros((along_y + along_z, 3))
        places[:along_y, 1] = (np.arange(along_y) - (along_y - 1) / 2) * spacing_m
        places[along_y:, 2] = (np.arange(along_z) - (along_z - 1) / 2) * spacing_m
        return places + np.asarray(self.position_m)

    @cached_property
    def tx(self) -> NDArray[np.float64]:
        """Transmitters (tx, 3) [m], world."""
        return self._lines(
            self.tx_y, self.tx_z, self.tx_spacing_wavelengths * self.start_wavelength_m
        )

    @cached_property
    def rx(self) -> NDArray[np.float64]:
        """Receivers (rx, 3) [m], world: the y-line, then the z-line."""
        return self._lines(
            self.rx_y, self.rx_z, self.rx_spacing_wavelengths * self.start_wavelength_m
        )

    @cached_property
    def rx_of_tx(self) -> NDArray[np.int64]:
        """Indices into `rx` of the receivers kept while each Tx transmits, (tx, rx)."""
        if self.channels == "all":
            return np.tile(np.arange(self.rx_y + self.rx_z), (self.n_tx, 1))
        y_line = (
            np.tile(np.arange(self.rx_y), (self.tx_y, 1))
            if self.tx_y
            else np.zeros((0, self.n_rx), np.int64)
        )
        z_line = (
            np.tile(np.arange(self.rx_z) + self.rx_y, (self.tx_z, 1))
            if self.tx_z
            else np.zeros((0, self.n_rx), np.int64)
        )
        return np.concatenate([y_line, z_line])

    @property
    def max_angle_deg(self) -> float:
        """Unambiguous azimuth and elevation, asin(lambda / 2d) with the centre wavelength [deg] (paper, eq. 5).

        Equation :eq:`angle-axis` of the theory page.
        """
        return math.degrees(math.asin(min(1.0, 1 / (2 * self._virtual_spacing_wavelengths))))

    @property
    def angle_resolution_deg(self) -> float:
        """Half-power beam width of one uniform virtual line in its far field at broadside, 0.886 lambda / N d [deg].

        Where Tx and Rx spacing do not fill a line without gaps this is that of the line of the same element count.

        Equation :eq:`angle-axis` of the theory page.
        """
        elements = max(self.tx_y * self.rx_y, self.tx_z * self.rx_z)
        if elements < 2:
            return 180.0
        return min(180.0, math.degrees(0.886 / (elements * self._virtual_spacing_wavelengths)))

    @property
    def _virtual_spacing_wavelengths(self) -> float:
        return self.rx_spacing_wavelengths * self.start_wavelength_m / self.wavelength_m
