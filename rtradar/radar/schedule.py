"""The time and the Tx of every chirp of a radar, and the velocity that follows.

Chirps are numbered as they are transmitted, without those that a gap between frames has room for.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.radar.array import MOST_CHIRPS, Array
from rtradar.radar.waveform import MOST, positive
from rtradar.system.fields import Limits

_Number = TypeVar("_Number", NDArray[np.int64], NDArray[np.float64])


class FollowingCount(int):
    """Number of chirps that follows from other fields, and anew where these are replaced."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Schedule(Array):
    """The chirps of a radar, and what follows from their times; `Radar` documents the fields."""

    idle_s: Annotated[float, Limits(0, 1e3)] = 0.0
    frame_duration_s: Annotated[float, positive()] = 0.1
    frame_hop_s: Annotated[float, positive()] = 0.025
    frame_period_s: Annotated[float | None, positive()] = None
    cycle_period_s: Annotated[float | None, positive()] = None
    chirps_per_frame: Annotated[int, Limits(1, MOST_CHIRPS)] = None  # type: ignore[assignment]
    multiplexing: Literal["tdm", "fdm", "ddm", "bpm"] = "tdm"
    carrier_step_hz: Annotated[float | None, positive()] = None
    doppler_bands: Annotated[int | None, Limits(1, MOST)] = None

    @property
    def chirp_period_s(self) -> float:
        """Time from the start of a chirp to the start of the next in a frame [s]."""
        return self.chirp_duration_s + self.idle_s

    @property
    def in_frames(self) -> bool:
        """Whether chirps come in frames of their own, with a gap between them."""
        return self.frame_period_s is not None

    @property
    def burst_chirps(self) -> int | None:
        """Number of chirps that follow each other without a gap; None if all do."""
        if self.in_frames:
            return self.chirps_per_frame
        return None if self.cycle_period_s is None else self.n_tx

    @property
    def at_once(self) -> bool:
        """Whether the chirps of a cycle, one of each Tx, share one slot of time: FDM and DDM.

        Under BPM all Tx transmit at once, too, but a cycle takes the slots of ``n_tx`` chirps,
        whose signs tell the Tx apart.
        """
        return self.multiplexing in ("fdm", "ddm")

    @property
    def receives_sums(self) -> bool:
        """Whether what a receiver gets in one chirp is the sum over all Tx, as DDM and BPM have."""
        return self.multiplexing in ("ddm", "bpm")

    @property
    def cycle_duration_s(self) -> float:
        """Time until the Tx transmit as before [s]: n_tx chirps under TDM and BPM, else one.

        With a ``cycle_period_s`` it is that.
        """
        if self.cycle_period_s is not None:
            return self.cycle_period_s
        return self.cycle_active_s

    @property
    def cycle_active_s(self) -> float:
        """Time that the chirps of a cycle take [s], without a gap behind them."""
        return self.chirp_period_s if self.at_once else self.n_tx * self.chirp_period_s

    @property
    def chirp_interval_s(self) -> float:
        """Mean time from one chirp to the next of a frame, counted over all Tx [s]."""
        return self.chirp_period_s / self.n_tx if self.at_once else self.chirp_period_s

    @cached_property
    def tx_delay_s(self) -> NDArray[np.float64]:
        """Delay of each Tx after the first of a cycle, (tx,) [s]; under BPM of each chirp."""
        step_s = 0.0 if self.at_once else self.chirp_period_s
        return np.arange(self.n_tx, dtype=np.float64) * step_s

    @cached_property
    def tx_signs(self) -> NDArray[np.int64]:
        """Sign of each Tx in each chirp of a cycle under BPM, (chirp, tx) (:eq:`bpm`)."""
        # A Hadamard matrix: the sign is that of the parity of the digits that both numbers have in
        # common.
        numbers = range(self.n_tx)
        return np.array([[(-1) ** (chirp & tx).bit_count() for tx in numbers] for chirp in numbers])

    @cached_property
    def tx_offset_hz(self) -> NDArray[np.float64]:
        """Height of the sweep of each Tx above `start_frequency_hz`, (tx,) [Hz]; the mean is 0."""
        if self.multiplexing != "fdm":
            return np.zeros(self.n_tx)
        # Bands as wide as the IF is sampled, about the sweep of the radar.
        step = self.sample_rate_hz if self.carrier_step_hz is None else self.carrier_step_hz
        return np.asarray((np.arange(self.n_tx) - (self.n_tx - 1) / 2) * step)

    @property
    def occupied_bandwidth_hz(self) -> float:
        """Width from the lowest to the highest frequency transmitted [Hz]; larger under FDM."""
        return self.bandwidth_hz + float(np.ptp(self.tx_offset_hz))

    @property
    def receiver_rate_hz(self) -> float:
        """Complex sample rate of a receiver before it separates the bands of FDM, if any [Hz]."""
        return self.sample_rate_hz + float(np.ptp(self.tx_offset_hz))

    @property
    def n_doppler_bands(self) -> int:
        """Number of bands of the Doppler axis under DDM, else 1."""
        if self.multiplexing != "ddm":
            return 1
        default = self.n_tx + math.ceil(self.n_tx / 3)
        return default if self.doppler_bands is None else self.doppler_bands

    @property
    def cycles_per_frame(self) -> int:
        """Number of whole cycles in one frame; a multiple of `n_doppler_bands` under DDM."""
        given = self.chirps_per_frame
        if isinstance(given, FollowingCount):
            return self.cycles_in_frame_duration
        return given // self.n_tx

    @property
    def cycles_in_frame_duration(self) -> int:
        """Number of whole cycles that ``frame_duration_s`` holds."""
        # A whole number of cycles but for rounding counts as that.
        cycles = math.floor(self.frame_duration_s / self.cycle_duration_s * (1 + 1e-12))
        return cycles - cycles % self.n_doppler_bands

    @property
    def hop_cycles(self) -> float:
        """Number of cycles from one frame to the next, not rounded, and at least 1."""
        if self.in_frames:
            return float(self.cycles_per_frame)
        return max(1.0, self.frame_hop_s / self.cycle_duration_s)

    @property
    def gaps_text(self) -> str:
        """What is known of time where there are gaps between frames; empty where there are none."""
        if self.cycle_period_s is not None:
            return (
                f"one cycle of {1e3 * self.cycle_active_s:.3g} ms every "
                f"{1e3 * self.cycle_period_s:.3g} ms; velocities beyond "
                f"{self.max_velocity_mps:.3g} m/s fold back"
            )
        if self.frame_period_s is None:
            return ""
        active_s = self.cycles_per_frame * self.cycle_duration_s
        return (
            f"frames of {1e3 * active_s:.3g} ms every {1e3 * self.frame_period_s:.3g} ms; "
            "nothing is measured in between"
        )

    @property
    def max_velocity_mps(self) -> float:
        """Unambiguous velocity, lambda / (4 cycle) [m/s] (:eq:`doppler-axis`)."""
        return self.wavelength_m / (4 * self.cycle_duration_s)

    @property
    def velocity_bin_mps(self) -> float:
        """Velocity resolution and width of one Doppler bin [m/s] (:eq:`doppler-axis`)."""
        return self.wavelength_m / (2 * self.cycles_per_frame * self.cycle_duration_s)

    def velocity_mps(self, n_cycles: int) -> NDArray[np.float64]:
        """Give the velocity of each Doppler bin, ascending, zero at index ``n_cycles // 2``.

        Parameters
        ----------
        n_cycles : int
            Number of cycles in the frame that is transformed.

        Returns
        -------
        (velocity,) float64
            Velocity [m/s].
        """
        # The order of a shifted DFT: zero is in the middle, and of an even number the first is the
        # most negative.
        bins = np.arange(n_cycles, dtype=np.float64) - n_cycles // 2
        return bins * (self.wavelength_m / (2 * n_cycles * self.cycle_duration_s))

    def tx_of_chirp(self, chirp: NDArray[np.integer]) -> NDArray[np.int64]:
        """Find the transmitter of each chirp (:eq:`tdm`).

        Parameters
        ----------
        chirp : (chirp,) int
            Numbers of chirps, from 0 at the start of the capture.

        Returns
        -------
        (chirp,) int64
            Index into `tx`.
        """
        return np.asarray(chirp, dtype=np.int64) % self.n_tx

    def chirp_times(self, n: int, first: int = 0) -> NDArray[np.float64]:
        """Give the centres of ``n`` successive chirps (:eq:`tdm`).

        Parameters
        ----------
        n, first : int
            Number of chirps, and the number of the first.

        Returns
        -------
        (chirp,) float64
            Time since the start of the capture [s].
        """
        return self.centres_of(np.arange(first, first + n))

    def centres_of(self, chirps: NDArray[np.integer]) -> NDArray[np.float64]:
        """Give the centres of some chirps.

        Parameters
        ----------
        chirps : (chirp,) int
            Numbers of chirps, from 0 at the start of the capture.

        Returns
        -------
        (chirp,) float64
            Time since the start of the capture [s].
        """
        # Chirps that are transmitted at once share a slot of time. The centre is that of the
        # samples, which may begin late in the chirp and end early.
        frame_s, numbers = self._in_frame(np.asarray(chirps, dtype=np.int64))
        slots = numbers // self.n_tx if self.at_once else numbers
        middle = (self.adc_start_s + self.sampled_duration_s / 2) / self.chirp_period_s
        return np.asarray(frame_s + (slots + middle) * self.chirp_period_s, dtype=np.float64)

    def slots_of(self, chirps: NDArray[np.integer]) -> NDArray[np.integer] | NDArray[np.float64]:
        """Give the places of chirps in time, counted in `chirp_interval_s`.

        They are the numbers of the chirps themselves where no gap is between frames, and that of
        the first for all that are transmitted at once. What is computed at regular intervals is
        interpolated between them by these.

        Parameters
        ----------
        chirps : (chirp,) int
            Numbers of chirps, from 0 at the start of the capture.

        Returns
        -------
        (chirp,) int or float64
            Number of intervals since the start of the capture.
        """
        frame_s, numbers = self._in_frame(np.asarray(chirps, dtype=np.int64))
        if self.at_once:
            numbers = numbers - numbers % self.n_tx
        gaps = self.burst_chirps is not None
        return np.asarray(frame_s / self.chirp_interval_s + numbers) if gaps else numbers

    @cached_property
    def gapless(self) -> Self:
        """The radar without gaps between its frames, whose cycles begin at places of `slots_of`."""
        if self.burst_chirps is None:
            return self
        count = int(self.chirps_per_frame)  # whatever a shorter cycle has room for
        return dataclasses.replace(
            self, frame_period_s=None, cycle_period_s=None, chirps_per_frame=count
        )

    def over_capture(self, cycles: int = 128) -> Self:
        """The radar whose slow time goes on from frame to frame: one cycle in each period.

        Of frames of several cycles the first one counts.

        Parameters
        ----------
        cycles : int
            Number of cycles of a window, in place of those of a frame; windows overlap by three
            quarters.

        Returns
        -------
        Radar
            With a ``cycle_period_s`` in place of the ``frame_period_s``.

        Raises
        ------
        InputError
            Where the chirps have no gaps.
        """
        if self.cycle_period_s is not None:
            return self
        if self.frame_period_s is None:
            raise InputError(
                "the chirps of the radar have no gaps, and their slow time goes on as it is; leave "
                "slow_time = capture out, or give frame_period_s"
            )
        period_s = self.frame_period_s
        return dataclasses.replace(
            self,
            frame_period_s=None,
            cycle_period_s=period_s,
            chirps_per_frame=cycles * self.n_tx,
            frame_hop_s=cycles / 4 * period_s,
        )

    def _in_frame(
        self, numbers: NDArray[np.int64], *, cycles: bool = False
    ) -> tuple[NDArray[np.float64] | float, NDArray[np.int64]]:
        """Start of the frame of each chirp or cycle [s], and its number within it."""
        if self.burst_chirps is None:
            return 0.0, numbers
        per = self.burst_chirps // (self.n_tx if cycles else 1)
        frame, within = np.divmod(numbers, per)
        return frame * (self.frame_period_s or self.cycle_duration_s), within

    def cycle_times(self, cycles: NDArray[np.integer]) -> NDArray[np.float64]:
        """Give the starts of some cycles.

        Parameters
        ----------
        cycles : (cycle,) int
            Numbers of cycles, from 0 at the start of the capture.

        Returns
        -------
        (cycle,) float64
            Time since the start of the capture [s].
        """
        frame_s, numbers = self._in_frame(np.asarray(cycles), cycles=True)
        return np.asarray(frame_s + numbers * self.cycle_duration_s, dtype=np.float64)

    def chirps_in(self, duration_s: float) -> int:
        """Count the chirps of a capture, in whole cycles, and in whole frames where it has gaps.

        Parameters
        ----------
        duration_s : float
            Length of the capture [s].

        Returns
        -------
        int
        """
        if self.frame_period_s is None:
            return math.floor(duration_s / self.cycle_duration_s * (1 + 1e-12)) * self.n_tx
        # With gaps the last frame counts if its chirps are over, whatever of its gap is left.
        active_s = self.cycles_per_frame * self.cycle_duration_s
        frames = math.floor((duration_s * (1 + 1e-12) - active_s) / self.frame_period_s) + 1
        return max(0, frames) * self.cycles_per_frame * self.n_tx

    def duration_of(self, n_chirps: int) -> float:
        """Give the time that so many chirps take, gaps between frames included.

        Parameters
        ----------
        n_chirps : int
            Number of chirps since the start of the capture.

        Returns
        -------
        float
            Time from the start of the first chirp to the end of the last [s].
        """
        if self.frame_period_s is None:
            return n_chirps / self.n_tx * self.cycle_duration_s
        # Up to the end of the last chirp: the gap after the last frame does not count.
        frames, more = divmod(max(n_chirps - 1, 0), self.chirps_per_frame)
        return frames * self.frame_period_s + (more + 1) * self.chirp_interval_s

    def window_starts(self, n_chirps: int) -> NDArray[np.int64]:
        """Find the first cycle of each frame in a capture of ``n_chirps``.

        A frame starts at the cycle boundary nearest to a multiple of ``frame_hop_s`` and holds
        ``cycles_per_frame``; with a ``frame_period_s`` it is what is transmitted in one period.

        Parameters
        ----------
        n_chirps : int
            Number of chirps in the capture.

        Returns
        -------
        (window,) int64
            Numbers of cycles; empty where the capture is shorter than one frame.
        """
        # Multiples of the hop up to the last cycle at which a whole frame can begin; half a cycle
        # beyond it may round down to it.
        last = n_chirps // self.n_tx - self.cycles_per_frame
        candidates = np.arange(max(0, math.floor((last + 0.5) / self.hop_cycles) + 1))
        starts = np.rint(candidates * self.hop_cycles).astype(np.int64)
        return starts[starts <= last]

    def window_times(self, starts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Give the centres of frames.

        Parameters
        ----------
        starts : (window,) int
            First cycle of each frame, as `window_starts` gives them.

        Returns
        -------
        (window,) float64
            Time since the start of the capture [s].
        """
        frame_s, numbers = self._in_frame(np.asarray(starts), cycles=True)
        centres = numbers + self.cycles_per_frame / 2
        return np.asarray(frame_s + centres * self.cycle_duration_s, dtype=np.float64)
