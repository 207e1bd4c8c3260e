"""Which Tx transmits when, and what follows from it: processing windows, and how velocities are told apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.radar.array import CrossArray


@dataclass(frozen=True, kw_only=True)
class Schedule(CrossArray):
    """Fields as in `rtradar.Radar`, which checks them."""

    frame_duration_s: float = 0.1
    frame_hop_s: float = 0.025
    multiplexing: Literal["tdm", "fdm", "ddm"] = "tdm"
    carrier_step_hz: float | None = None
    doppler_bands: int | None = None

    @property
    def at_once(self) -> bool:
        """Whether all Tx transmit at once."""
        return self.multiplexing != "tdm"

    @property
    def cycle_duration_s(self) -> float:
        """Time until the same Tx transmits again [s]: one turn through all Tx under TDM, else one chirp."""
        return self.chirp_duration_s if self.at_once else self.n_tx * self.chirp_duration_s

    @property
    def chirp_interval_s(self) -> float:
        """Mean time from one chirp to the next, counted over all Tx [s]."""
        return self.chirp_duration_s / self.n_tx if self.at_once else self.chirp_duration_s

    @cached_property
    def tx_delay_s(self) -> NDArray[np.float64]:
        """How long after the first Tx each Tx transmits in a cycle, (tx,) [s]."""
        return np.asarray(
            np.arange(self.n_tx) * (0.0 if self.at_once else self.chirp_duration_s),
            dtype=np.float64,
        )

    @cached_property
    def tx_offset_hz(self) -> NDArray[np.float64]:
        """How far the sweep of each Tx lies above that of `start_frequency_hz`, (tx,) [Hz]; their mean is 0."""
        if self.multiplexing != "fdm":
            return np.zeros(self.n_tx)
        step = self.sample_rate_hz if self.carrier_step_hz is None else self.carrier_step_hz
        return np.asarray((np.arange(self.n_tx) - (self.n_tx - 1) / 2) * step)

    @property
    def occupied_bandwidth_hz(self) -> float:
        """From the lowest to the highest frequency transmitted [Hz]; FDM takes more than the sweep."""
        return self.bandwidth_hz + float(np.ptp(self.tx_offset_hz))

    @property
    def receiver_rate_hz(self) -> float:
        """Complex samples a second of a receiver before it parts the bands of FDM [Hz]; else the `sample_rate_hz`."""
        return self.sample_rate_hz + float(np.ptp(self.tx_offset_hz))

    @property
    def n_doppler_bands(self) -> int:
        """Bands of the Doppler axis under DDM, else 1."""
        if self.multiplexing != "ddm":
            return 1
        return (
            self.n_tx + math.ceil(self.n_tx / 3)
            if self.doppler_bands is None
            else self.doppler_bands
        )

    @property
    def cycles_per_frame(self) -> int:
        """Whole cycles in one frame (133 of the paper's 133.3); under DDM a multiple of `n_doppler_bands`."""
        cycles = math.floor(self.frame_duration_s / self.cycle_duration_s * (1 + 1e-12))
        return cycles - cycles % self.n_doppler_bands

    @property
    def hop_cycles(self) -> float:
        """Cycles from one window to the next, not rounded; a hop below one cycle reaches every cycle, as one of a cycle does."""
        return max(1.0, self.frame_hop_s / self.cycle_duration_s)

    @property
    def chirps_per_frame(self) -> int:
        """Chirps in the whole cycles of one frame."""
        return self.cycles_per_frame * self.n_tx

    def tx_of_chirp(self, chirp: NDArray[np.integer]) -> NDArray[np.int64]:
        """Transmitter of each chirp, numbered from the start of the capture.

        Parameters
        ----------
        chirp : (chirp,) int
            From 0.

        Returns
        -------
        (chirp,) int64
            Index into `tx`.

        Notes
        -----
        Equation :eq:`tdm` of the theory page.
        """
        return np.asarray(chirp, dtype=np.int64) % self.n_tx

    def chirp_times(self, n: int, first: int = 0) -> NDArray[np.float64]:
        """Centres of ``n`` chirps from chirp ``first`` on, (chirp,) [s] since the start of the capture.

        Parameters
        ----------
        n : int
            How many.
        first : int
            Number of the first of them.

        Returns
        -------
        (chirp,) float64
            [s].

        Notes
        -----
        Equation :eq:`tdm` of the theory page.
        """
        return self.centres_of(np.arange(first, first + n))

    def centres_of(self, chirps: NDArray[np.integer]) -> NDArray[np.float64]:
        """When the centres of some chirps are.

        Parameters
        ----------
        chirps : (chirp,) int
            Counted from the start of the capture.

        Returns
        -------
        (chirp,) float64
            [s] since the start of the capture.
        """
        slots = np.asarray(chirps) // self.n_tx if self.at_once else np.asarray(chirps)
        return np.asarray((slots + 0.5) * self.chirp_duration_s, dtype=np.float64)

    def window_starts(self, n_chirps: int) -> NDArray[np.int64]:
        """First cycle of each processing window in a capture of ``n_chirps``, (window,).

        A window starts at the cycle boundary nearest to a multiple of ``frame_hop_s`` and takes ``cycles_per_frame``.

        Parameters
        ----------
        n_chirps : int
            In the capture.

        Returns
        -------
        (window,) int64
            Cycles; none where the capture is shorter than one window.
        """
        last = n_chirps // self.n_tx - self.cycles_per_frame
        if last < 0:
            return np.zeros(0, dtype=np.int64)
        candidates = np.arange(math.floor((last + 0.5) / self.hop_cycles) + 1)
        starts = np.rint(candidates * self.hop_cycles).astype(np.int64)
        return np.unique(starts[starts <= last])

    def window_times(self, starts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Centres of the windows that start at these cycles, (window,) [s].

        Parameters
        ----------
        starts : (window,) int
            First cycle of each, as of `window_starts`.

        Returns
        -------
        (window,) float64
            Since the start of the capture [s].
        """
        return np.asarray(
            (np.asarray(starts) + self.cycles_per_frame / 2) * self.cycle_duration_s,
            dtype=np.float64,
        )

    @property
    def max_velocity_mps(self) -> float:
        """Unambiguous velocity, lambda / (4 cycle) with the centre wavelength [m/s] (paper, eq. 3).

        Equation :eq:`doppler-axis` of the theory page.
        """
        return self.wavelength_m / (4 * self.cycle_duration_s)

    @property
    def velocity_bin_mps(self) -> float:
        """Velocity resolution and width of one Doppler bin, centre wavelength [m/s] (paper, eq. 4).

        Equation :eq:`doppler-axis` of the theory page.
        """
        return self.wavelength_m / (2 * self.cycles_per_frame * self.cycle_duration_s)

    def velocity_mps(self, n_cycles: int) -> NDArray[np.float64]:
        """Velocity of each Doppler bin (velocity,) [m/s], ascending, zero at index ``n_cycles // 2``.

        Parameters
        ----------
        n_cycles : int
            In the window that is transformed.

        Returns
        -------
        (velocity,) float64
            [m/s].
        """
        bins = np.arange(n_cycles, dtype=np.float64) - n_cycles // 2
        return bins * (self.wavelength_m / (2 * n_cycles * self.cycle_duration_s))
