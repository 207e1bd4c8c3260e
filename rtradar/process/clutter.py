"""Removal of static clutter from range spectra, before Doppler.

A static echo has the same range spectrum in every TDM cycle, each Tx, Rx and range bin by itself;
what is constant there from cycle to cycle is removed. T is the cycle, f the Doppler frequency, and
:eq:`clutter-gain` has the gains:

``none``
    Nothing is removed.
``mean``
    The mean over each frame is removed; in the spectrogram that over each of its own windows, in
    the range-time map that over one frame about each step (`rtradar.process.SlidingRangeTime`).
    Doppler bins -1, 0 and 1 of a Hann window change; the others keep their values, because a
    constant has no part in them. A slow echo is removed with the clutter: of one of d bins the
    fraction sinc(d) counts as static. That is all of a person who does not move in that frame, and
    more than half of the highest peak below 0.6 bins (0.06 m/s for the paper's radar at 12 GHz,
    0.011 m/s at 77 GHz). A fast echo loses nothing, but leaves up to 1 / (pi d) of its amplitude in
    the bins about zero, where nothing static made it: 23 dB below its peak at 5.5 bins, 34 dB at
    20.5 (validation/closed_forms/clutter.py).
``exponential``
    A background that follows each chirp, b += a (x - b), a = 1 - exp(-T / time constant), is
    subtracted from the next. It starts as the first chirp and is the mean of all of them until
    1 / a cycles are there: one chirp alone would leave its noise in every range bin at zero Doppler
    for as long. Half the power is left at f = 1 / (2 pi time constant), all of it well above; white
    noise becomes 2 / (2 - a) as strong. A person who does not move fades with the time constant,
    and leaves a hole that fades likewise, at zero Doppler.
``mti``
    A canceller of two or three pulses of the same Tx: x[n] - x[n-1], or x[n] - 2 x[n-1] + x[n-2],
    over sqrt(2) or sqrt(6), so that white noise keeps its mean power: blind at zero and at
    multiples of 1 / T, and weak for all that is slow (-10 and -22 dB at 1 m/s for the paper's radar
    at 12 GHz). Noise takes on the same colour. The first one or two cycles come out as zeros.

A background, the range spectra of one cycle of the same room without what is looked for, may be
subtracted before any of these: what the room returns goes, and a person who does not move stays.

``mean`` works frame by frame, the others on the stream. All of them are linear, and treat all
channels alike, so that directions stay.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.process.spectra import checked_chirps
from rtradar.radar import Radar
from rtradar.system.checks import is_real
from rtradar.system.threads import thread_map

_CELLS_AT_ONCE = 2048
"""Cells of one task of a thread: a short frame of them fits the cache of a core."""


class ClutterRemoval:
    """What `clutter_removal` gives: every block of the stream passes `block`, every frame `window`.

    This one removes nothing.

    Parameters
    ----------
    radar : Radar
        Radar that gives the schedule and the shape.
    background : (tx, rx, range) complex, optional
        Range spectra that are subtracted from every cycle before.

    Attributes
    ----------
    works_by_windows : bool
        Whether it is `window` that removes; `block` then only subtracts the background.
    """

    works_by_windows = False

    def __init__(self, radar: Radar, background: ArrayLike | None = None) -> None:
        self._radar = radar
        self._next: int | None = None  # chirp that the next block must begin with
        self._room = None if background is None else _complex(background)
        shape = radar.n_tx, radar.n_rx, radar.samples_per_chirp
        if self._room is not None and self._room.shape != shape:
            raise InputError(
                f"clutter removal: background has shape {self._room.shape}; that of a cycle of "
                f"radar '{radar.name}' is (tx, rx, range) = {shape}"
            )

    def block(self, spectra: ArrayLike, first_chirp: int) -> NDArray[np.complexfloating]:
        """Range spectra of the next chirps without clutter, for a method that works on the stream.

        The values do not depend on how the stream is cut into blocks, to the last bit.

        Parameters
        ----------
        spectra : (chirp, rx, range) complex
            Spectra from `range_spectrum`: whole TDM cycles, those that follow the last call's. Not
            written to.
        first_chirp : int
            Number of the first chirp in the capture.

        Returns
        -------
        (chirp, rx, range) complex64 or complex128
            As precise as ``spectra``; ``spectra`` themselves where the method works by frames.

        Raises
        ------
        InputError
            Where the shape does not fit the radar, the block does not hold whole cycles or does not
            follow the last one.
        """
        radar = self._radar
        chirps = _complex(checked_chirps("clutter removal: spectra", spectra, radar))
        if first_chirp % radar.n_tx or len(chirps) % radar.n_tx:
            raise InputError(
                f"clutter removal: {len(chirps)} chirps from chirp {first_chirp} on are not whole "
                f"TDM cycles; begin with a multiple of {radar.n_tx}, and take a multiple of it"
            )
        if self._next not in (None, first_chirp):
            raise InputError(
                f"clutter removal: the block begins with chirp {first_chirp}, the last one ended "
                f"before {self._next}; give the chirps without a gap, or begin anew with "
                "another removal"
            )
        # The state of a stream is only right if no chirp is left out and none comes twice.
        self._next = first_chirp + len(chirps)
        cycles = chirps.reshape(-1, radar.n_tx, *chirps.shape[1:])
        if self._room is not None:
            cycles = cycles - self._room.astype(cycles.dtype)
        return self._stream(cycles).reshape(chirps.shape)

    def window(self, cycles: ArrayLike) -> NDArray[np.complexfloating]:
        """Range spectra of one frame without clutter, for a method that works by frames.

        Parameters
        ----------
        cycles : (cycle, ...) complex
            Frame such as the ``cube (cycle, tx, rx, range)`` of `SlidingWindows`, made of what
            `block` gave. Not written to.

        Returns
        -------
        (cycle, ...) complex64 or complex128
            As precise as ``cycles``; ``cycles`` themselves where the method works on the stream.

        Raises
        ------
        InputError
            Where there is nothing to average.
        """
        values = _complex(cycles)
        if values.ndim < 1 or len(values) < 1:
            raise InputError(
                f"clutter removal: cycles have shape {values.shape}; a window needs at least one "
                "cycle"
            )
        return self._window(values)

    def description(self, window_cycles: int) -> str:
        """What is removed and how, in a few words, for titles and attributes.

        Parameters
        ----------
        window_cycles : int
            TDM cycles in each of the frames that are made of the stream.

        Returns
        -------
        str
            ``none`` where nothing is removed.
        """
        own = self._method(window_cycles)
        if self._room is None:
            return own
        return "background" if own == "none" else f"background, then {own}"

    def _method(self, window_cycles: int) -> str:
        return "none"

    def _stream(self, cycles: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
        """The next ``cycles (cycle, tx, rx, range)`` of the stream without clutter."""
        return cycles

    def _window(self, cycles: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
        return cycles


class _Mean(ClutterRemoval):
    works_by_windows = True

    def _method(self, window_cycles: int) -> str:
        seconds = window_cycles * self._radar.cycle_duration_s
        return f"mean over {window_cycles} cycles ({seconds:.3g} s)"

    def _window(self, cycles: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
        flat = cycles.reshape(len(cycles), -1)
        out = np.empty(flat.shape, flat.dtype)

        def subtract(first: int) -> None:
            cells = flat[:, first : first + _CELLS_AT_ONCE]
            # In double: the mean of equal values is that value, and their difference is zero.
            mean = cells.mean(axis=0, dtype=np.complex128).astype(cells.dtype)
            np.subtract(cells, mean, out=out[:, first : first + _CELLS_AT_ONCE])

        thread_map(subtract, range(0, flat.shape[1], _CELLS_AT_ONCE))
        return out.reshape(cycles.shape)


class _Exponential(ClutterRemoval):
    def __init__(
        self, radar: Radar, background: ArrayLike | None, time_constant_s: float = 1.0
    ) -> None:
        super().__init__(radar, background)
        if not is_real(time_constant_s) or not 0 < time_constant_s < math.inf:
            raise InputError(
                f"time_constant_s = {time_constant_s!r}; it must be a number of seconds, positive "
                "and finite"
            )
        self._time_constant_s = time_constant_s
        # With gaps between frames the mean time from cycle to cycle counts.
        apart_s = radar.cycle_duration_s
        if radar.frame_period_s is not None:
            apart_s = radar.frame_period_s / radar.cycles_per_frame
        self._weight = -math.expm1(-apart_s / time_constant_s)
        self._count = 0  # cycles in the background
        shape = (radar.n_tx, radar.n_rx, radar.samples_per_chirp)
        # In double, because it takes steps of 1e-3 and less.
        self._background = np.zeros(shape, np.complex128)

    def _method(self, window_cycles: int) -> str:
        return f"exponential background, time constant {self._time_constant_s:g} s"

    def _stream(self, cycles: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
        out = np.empty_like(cycles)
        for cycle, left in zip(cycles, out, strict=True):
            # The background starts as the first cycle, and is the mean of all until its own weight
            # is larger.
            if self._count == 0:
                self._background[...] = cycle
            self._count += 1
            step = cycle - self._background
            left[...] = step
            # As pairs of real numbers, which a real weight multiplies faster.
            parts = step.view(np.float64)
            parts *= max(self._weight, 1 / self._count)
            self._background += step
        return out


class _Mti(ClutterRemoval):
    def __init__(self, radar: Radar, background: ArrayLike | None, pulses: int = 2) -> None:
        super().__init__(radar, background)
        if pulses not in (2, 3):
            raise InputError(f"clutter removal 'mti': pulses = {pulses!r}; allowed: 2, 3")
        self._order = int(pulses) - 1
        # The squares of the weights sum to this binomial coefficient.
        self._gain = 1 / math.sqrt(math.comb(2 * self._order, self._order))
        # The last cycles, as received.
        shape = (0, radar.n_tx, radar.n_rx, radar.samples_per_chirp)
        self._held = np.empty(shape, np.complex64)
        self._cycles = 0  # that have passed

    def _method(self, window_cycles: int) -> str:
        return f"MTI canceller of {self._order + 1} pulses"

    def _stream(self, cycles: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
        out = np.zeros_like(cycles)
        known = np.concatenate([self._held, cycles])
        # Little changes from cycle to cycle, so differences of differences hardly round.
        differences = np.diff(known, n=self._order, axis=0) * known.real.dtype.type(self._gain)
        out[len(out) - len(differences) :] = differences
        if self._radar.in_frames:
            # Over a gap between frames nothing is the difference of two cycles.
            numbers = np.arange(self._cycles, self._cycles + len(cycles))
            out[numbers % self._radar.cycles_per_frame < self._order] = 0
        self._cycles += len(cycles)
        self._held = known[-self._order :].copy()  # a view would keep the whole block
        return out


_METHODS: dict[str, tuple[type[ClutterRemoval], str]] = {
    "none": (ClutterRemoval, ""),
    "mean": (_Mean, ""),
    "exponential": (_Exponential, "time_constant_s"),
    "mti": (_Mti, "pulses"),
}
"""Class of each method, and the name of its setting."""

CLUTTER_REMOVALS = tuple(_METHODS)
"""Names of the methods of `clutter_removal`."""


def clutter_removal(
    method: str,
    radar: Radar,
    *,
    time_constant_s: float | None = None,
    pulses: int | None = None,
    background: ArrayLike | None = None,
) -> ClutterRemoval:
    """Remove static clutter from a stream of range spectra and from its frames.

    Memory does not grow with the stream. A stream passes both steps, whatever the method::

        removal = clutter_removal("mean", radar)
        for first_chirp, spectra in blocks:
            for _, start, cube in windows.push(removal.block(spectra, first_chirp)):
                power = power_map(removal.window(cube), radar)

    Parameters
    ----------
    method : {"none", "mean", "exponential", "mti"}
        Method, as the head of this module describes them.
    radar : Radar
        Radar that gives the schedule and the shape.
    time_constant_s : float, optional
        Time constant of ``exponential`` [s]; 1 s if left out.
    pulses : {2, 3}, optional
        Number of pulses of the canceller ``mti``; 2 if left out.
    background : (tx, rx, range) complex, optional
        Range spectra of one cycle of the room alone, subtracted from every cycle before.

    Returns
    -------
    ClutterRemoval
        For one stream; another stream needs another.

    Raises
    ------
    InputError
        Where there is no such method, a setting has no meaning or belongs to another method,
        ``mean`` has only one cycle to average, or the background is no cycle of the radar.
    """
    if method not in _METHODS:
        raise InputError(
            f"clutter removal '{method}' is unknown; allowed: {', '.join(CLUTTER_REMOVALS)}"
        )
    if method != "none" and radar.multiplexing == "ddm":
        raise InputError(
            f"clutter removal '{method}': under multiplexing = 'ddm' what does not move has a "
            "Doppler of its own for each Tx, which this would leave in; choose 'none', or TDM"
        )
    # A setting of another method would have no effect, and is refused.
    make, setting = _METHODS[method]
    given = {"time_constant_s": time_constant_s, "pulses": pulses}
    own: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    for name in own:
        if name != setting:
            owner = next(other for other, (_, its) in _METHODS.items() if its == name)
            raise InputError(
                f"clutter removal '{method}' has no {name}; leave it out, or choose '{owner}'"
            )
    if method == "mean" and radar.cycles_per_frame < 2:
        raise InputError(
            f"clutter removal 'mean': a frame of radar '{radar.name}' holds one TDM cycle, and "
            "its mean is all of it; lengthen the frame or choose 'exponential' or 'mti'"
        )
    return make(radar, background, **own)


def _complex(values: ArrayLike) -> NDArray[np.complexfloating]:
    array = np.asarray(values)
    if array.dtype.kind not in "fc":
        raise InputError(
            f"clutter removal: cycles are of type {array.dtype}; they must be complex numbers"
        )
    return array.astype(np.result_type(array.dtype, np.complex64), copy=False)
