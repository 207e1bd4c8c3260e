"""Micro-Doppler: short-time Fourier transform of one virtual channel over slow time.

One channel is sampled once a TDM cycle, at the middle of its own chirp. The paper transforms its
first channel (section 3.2.3).

The power of all range bins is summed, not their signals: neighbouring bins of a Hann-windowed range
spectrum differ in phase by half a turn, so their signals cancel (over all bins, to nothing), and a
person who walks goes through bins. By Parseval's theorem the sum does not depend on where in a bin
an echo lies.

The transform is written out, on SciPy's FFT, because it runs column by column on a stream;
`scipy.signal.ShortTimeFFT`, with which the tests compare it, gives the same columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.process.clutter import ClutterRemoval
from rtradar.process.power_maps import without_copies
from rtradar.process.spectra import check_channel, checked_chirps, complex_kind
from rtradar.process.window_functions import DEFAULT_WINDOWS, WindowFunctions, weights
from rtradar.radar import Radar

WINDOW_CYCLES, OVERLAP = 128, 0.95
"""Cycles in a frame of the paper's spectrograms, and the overlap of frames (section 3.2.3)."""


def window_cycles(radar: Radar, window_s: float | None = None) -> int:
    """Cycles in a window of the spectrogram.

    Parameters
    ----------
    radar : Radar
        Radar that gives the schedule.
    window_s : float, optional
        Length of a window [s]. By default it is that of the paper's `WINDOW_CYCLES` of TDM, and no
        longer than a frame where there are gaps between frames.

    Returns
    -------
    int
        Whole cycles nearest to that; under Doppler division a multiple of the bands.

    Raises
    ------
    InputError
        Where a window would hold fewer than two cycles, or more than a frame before a gap.
    """
    # The paper's window in cycles of TDM; where all Tx transmit at once cycles are shorter by their
    # number.
    cycles = WINDOW_CYCLES * (radar.n_tx if radar.at_once else 1)
    if radar.in_frames:
        cycles = min(cycles, radar.cycles_per_frame)
    if window_s is not None:
        cycles = round(window_s / radar.cycle_duration_s)
        most = radar.cycles_per_frame if radar.in_frames else cycles
        if not 2 <= cycles <= most:
            cycle_s = radar.cycle_duration_s
            upto = f" to {most * cycle_s:.3g} s, a frame" if radar.in_frames else ""
            raise InputError(
                f"spectrogram_window_s = {window_s:g}; with radar '{radar.name}' a window is from "
                f"{2 * cycle_s:.3g} s, two cycles,{upto or ' on'} (--spectrogram-window)"
            )
    return max(1, round(cycles / radar.n_doppler_bands)) * radar.n_doppler_bands


@dataclass(frozen=True)
class Spectrogram:
    """Power over time and velocity.

    Parameters
    ----------
    power : (time, velocity) float32 or float64
        Power of the range bins together, in the unit of the squared IF; coherent gain 1 in a bin.
    time : (time,) float64
        Middle of each window, where its weight is greatest [s since the start of the capture].
    velocity : (velocity,) float64
        Range rate [m/s], positive receding, ascending, zero at index ``window // 2``; wavelength of
        the sweep centre.
    """

    power: NDArray[np.floating]
    time: NDArray[np.float64]
    velocity: NDArray[np.float64]


def spectrogram(
    signals: ArrayLike,
    radar: Radar,
    *,
    tx: int = 0,
    window: int = WINDOW_CYCLES,
    overlap: float = OVERLAP,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> Spectrogram:
    """Spectrogram of one virtual channel (:eq:`spectrogram`), summed over the given range bins.

    Parameters
    ----------
    signals : (cycle, range) complex
        Range spectra of the channel in consecutive TDM cycles: ``spectra[tx :: radar.n_tx, rx]`` of
        what `rtradar.process.range_spectrum` gives. One range bin, or a gate of them, is a slice of
        the last axis.
    radar : Radar
        Radar that gives the schedule and the wavelength.
    tx : int
        Transmitter of the channel: its chirp is that far into the cycle, which moves the time axis.
    window : int
        Number of cycles in one window.
    overlap : float
        Least fraction of a window that it has in common with the next: 0.95 of 128 cycles is a hop
        of 6.
    window_functions : WindowFunctions
        Window functions of the range spectra and in slow time. Only that in slow time is applied
        here; under DDM both tell how far an echo spreads over cells.

    Returns
    -------
    Spectrogram
        Only whole windows. Under Hann windows an echo of constant amplitude a and velocity reads
        1.5 a^2 in its velocity bin where all range bins are given: the three bins of a
        Hann-windowed range spectrum hold 1/4, 1 and 1/4. float32 where ``signals`` are complex64 or
        float32, else float64.

    Raises
    ------
    InputError
        Where the shape or type is wrong, a value is not finite, there are fewer cycles than one
        window takes, or ``tx``, ``window`` or ``overlap`` have no meaning.
    """
    # All windows of the whole signal, none of which passes a removal of clutter.
    hop = _hop(radar, tx, window, overlap)
    values = np.asarray(signals)
    if values.ndim != 2 or values.shape[1] < 1 or values.dtype.kind not in "fc":
        raise InputError(
            f"spectrogram: signals have shape {values.shape}, type {values.dtype}; they must be "
            "complex (cycle, range), at least 1 in range"
        )
    if len(values) < window:
        raise InputError(
            f"spectrogram: {len(values)} cycles are fewer than the window of {window}; give a "
            "longer capture or a shorter window"
        )
    if not np.isfinite(values).all():
        raise InputError("spectrogram: signals hold NaN or infinity; every value must be finite")
    values = values.astype(complex_kind(values), copy=False)
    starts = _starts(0, len(values), window, hop, radar)
    power = _columns(values, starts, window, radar, tx, ClutterRemoval(radar), window_functions)
    return Spectrogram(power, _times(starts, radar, tx, window), radar.velocity_mps(window))


class SlidingSpectrogram:
    """`spectrogram` of all range bins of one virtual channel of a stream, in constant memory.

    The columns are those of `spectrogram`, to the last bit, however the stream is cut into blocks.

    Parameters
    ----------
    radar : Radar
        Radar that gives the schedule and the shape.
    channel : int
        Index of the channel, tx * n_rx + rx.
    window : int, optional
        Number of cycles in one window; `window_cycles` if left out.
    overlap : float
        Least fraction of a window that it has in common with the next.
    removal : ClutterRemoval, optional
        Removal whose `ClutterRemoval.block` the spectra have passed; each window of the spectrogram
        passes its `ClutterRemoval.window`. A person who does not move during a window is then
        removed with the clutter.
    window_functions : WindowFunctions
        See `spectrogram`.

    Raises
    ------
    InputError
        Where there is no such channel, or ``window`` or ``overlap`` have no meaning.
    """

    def __init__(
        self,
        radar: Radar,
        *,
        channel: int = 0,
        window: int | None = None,
        overlap: float = OVERLAP,
        removal: ClutterRemoval | None = None,
        window_functions: WindowFunctions = DEFAULT_WINDOWS,
    ) -> None:
        window = window_cycles(radar) if window is None else window
        check_channel("spectrogram", channel, radar)
        self._radar, self._window = radar, window
        self._tx, self._rx = divmod(channel, radar.n_rx)
        self._own = self._tx, removal or ClutterRemoval(radar), window_functions
        self._hop = _hop(radar, self._tx, window, overlap)
        self._chirps = 0  # pushed so far
        self._start = 0  # cycle that the next window begins with, and the first of those held
        self._held = np.empty((0, radar.samples_per_chirp), np.complex64)  # less than a window

    def push(self, spectra: NDArray[np.complexfloating]) -> Spectrogram:
        """Take the next block of chirps and give the columns that it completes.

        Parameters
        ----------
        spectra : (chirp, rx, range) complex
            Range spectra of the chirps that follow those of the last call, from `range_spectrum`;
            the first chirp of all comes from Tx 0.

        Returns
        -------
        Spectrogram
            Columns in float32; none where no window is complete yet.

        Raises
        ------
        InputError
            Where the shape does not fit the radar.
        """
        radar = self._radar
        block = checked_chirps("SlidingSpectrogram: spectra", spectra, radar)
        # Every n_tx-th chirp is of this Tx; where it comes first depends on how many chirps were
        # before.
        new = block[(self._tx - self._chirps) % radar.n_tx :: radar.n_tx, self._rx]
        self._chirps += len(block)
        cycles = np.concatenate([self._held, new.astype(np.complex64, copy=False)])
        starts = _starts(self._start, len(cycles), self._window, self._hop, radar)
        power = _columns(cycles, starts, self._window, radar, *self._own)
        times = _times(self._start + starts, radar, self._tx, self._window)
        # What no later window needs goes. The hop is at most the window, so it is all here.
        gone = len(starts) * self._hop
        if radar.in_frames:
            gone = max(0, len(cycles) - self._window + 1)
        self._start += gone
        self._held = cycles[gone:].copy()  # a view would keep the whole block
        return Spectrogram(power, times, radar.velocity_mps(self._window))


def _hop(radar: Radar, tx: int, window: int, overlap: float) -> int:
    """Cycles from one window to the next."""
    if not 0 <= tx < radar.n_tx:
        raise InputError(
            f"spectrogram: tx = {tx}; radar '{radar.name}' has Tx 0 to {radar.n_tx - 1}"
        )
    if window < 2:
        raise InputError(f"spectrogram: window = {window} cycles; it must hold at least 2")
    if not 0 <= overlap < 1:
        raise InputError(
            f"spectrogram: overlap = {overlap}; it is a fraction of the window, from 0 to below 1"
        )
    # 100 x (1 - 0.9) is a little less than 10, and means 10.
    return max(1, int(window * (1 - overlap) * (1 + 1e-12)))


def _starts(first: int, count: int, window: int, hop: int, radar: Radar) -> NDArray[np.int64]:
    """Cycles among ``count``, of which the first has that number, with which a window begins.

    Windows lie within one frame where there are gaps between frames, and begin anew with each.
    """
    starts = np.arange(0, count - window + 1, 1 if radar.in_frames else hop)
    if not radar.in_frames:
        return starts
    within = (first + starts) % radar.cycles_per_frame
    return starts[(within % hop == 0) & (within + window <= radar.cycles_per_frame)]


def _times(starts: NDArray[np.int64], radar: Radar, tx: int, window: int) -> NDArray[np.float64]:
    """Middle of the windows from these cycles on (time,) [s]; they are even about window / 2."""
    own = float(radar.tx_delay_s[tx] + radar.chirp_times(1)[0])
    return radar.cycle_times(starts) + window / 2 * radar.cycle_duration_s + own


def _columns(
    signals: NDArray[np.complexfloating],
    starts: NDArray[np.int64],
    window: int,
    radar: Radar,
    tx: int,
    removal: ClutterRemoval,
    window_functions: WindowFunctions,
) -> NDArray[np.floating]:
    """Power (time, velocity) of windows of signals (cycle, range), which begin at these rows."""
    real = np.float32 if signals.dtype == np.complex64 else np.float64
    scale: NDArray[Any] = weights(window_functions.doppler, window).astype(real)[:, None]
    power = np.empty((len(starts), window), dtype=real)
    # One window at a time stays in the cache of a core, and columns do not depend on each other.
    for row, start in enumerate(starts):
        weighted = removal.window(signals[start : start + window]) * scale
        parts = scipy.fft.fft(weighted, axis=0, overwrite_x=True).view(real)
        squares = np.square(parts, out=parts)
        if radar.multiplexing == "ddm":
            # Rows of a Tx hold all of them, moved back by its code, by so many bands.
            bands = tx * window // radar.n_doppler_bands
            received = np.roll(squares[:, ::2] + squares[:, 1::2], bands, axis=0)
            own = without_copies(received, radar, 1, window_functions) / radar.n_tx
            power[row] = own.sum(axis=1)
        else:
            power[row] = squares.sum(axis=1)
    return np.fft.fftshift(power, axes=1)
