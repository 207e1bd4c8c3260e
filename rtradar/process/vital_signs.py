"""Breath and heart of a person who holds still, from the phase of a range cell over slow time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.radar import Radar

_Reals = NDArray[np.float64]

BREATH_HZ, HEART_HZ = (0.1, 0.7), (0.75, 3.0)
"""Rates among which breath and heart are sought [Hz]."""

_HARMONICS = 6  # of the breath, that are not taken for the heart
_PER_BIN = 8  # rates that are tried for each that the length resolves
_ARC_RAD = 1.0  # from which spread of the phase on a circle is told from a line
_LEAST_CYCLES, _LEAST_BREATHS = 32, 2.0
_BLOCKS = 16  # of rates that are tried together
_FAINTEST_DB = 20.0  # below the cell that changes most, down to which cells are looked at


@dataclass(frozen=True, eq=False)
class VitalSigns:
    """What the phase of one range cell says of somebody's chest.

    Parameters
    ----------
    time_s : (cycle,) float64
        Centres of the cycles [s].
    way_m : (cycle,) float64
        Way of what moves in the cell along the line of sight, positive receding, about 0 [m].
    range_m : float
        Range of the cell [m].
    breath_hz, heart_hz : float
        Rates [Hz].
    breath_m, heart_m : float
        Amplitudes along the line of sight, half of the way from end to end [m].
    explained : float
        Fraction of the way's variance, without a line, that the breath and its harmonics explain:
        near 1 of who holds still, near 0 where nobody breathes.
    """

    time_s: _Reals
    way_m: _Reals
    range_m: float
    breath_hz: float
    heart_hz: float
    breath_m: float
    heart_m: float
    explained: float


def vital_signs(
    spectra: NDArray[np.complexfloating],
    radar: Radar,
    *,
    range_m: float | None = None,
    breath_hz: Sequence[float] = BREATH_HZ,
    heart_hz: Sequence[float] = HEART_HZ,
) -> VitalSigns:
    r"""Read breath and heart from the slow time of a capture.

    All channels are added up so that what moves in the range cell is strongest. It goes round what
    stands still there, on a circle whose centre is fitted by least squares; the angle about that,
    unwrapped, times :math:`\lambda / 4 \pi`, is the way. A sine of the breath's rate and its
    harmonics and one of the heart's are fitted to that, with a line for who drifts.

    Parameters
    ----------
    spectra : (chirp, rx, range) complex
        Range spectra of whole cycles, without their mean being removed.
    radar : Radar
        Radar whose cycles follow each other evenly: without frames, or `Radar.over_capture`.
    range_m : float, optional
        Range of the cell [m]; by default, of those in which power changes, that whose way is most
        like a breath.
    breath_hz, heart_hz : (float, float)
        Least and largest rate [Hz].

    Returns
    -------
    VitalSigns

    Raises
    ------
    InputError
        Where the capture is too short, cycles come in frames, or a rate is beyond half of that of
        the cycles.
    """
    cycles = _cycles(len(spectra), radar, breath_hz, heart_hz)
    cube = np.asarray(spectra[: cycles * radar.n_tx]).reshape(cycles, -1, spectra.shape[2])
    time = radar.cycle_times(np.arange(cycles)) + radar.cycle_active_s / 2
    # The cell, its way, and the breath in it.
    if range_m is None:
        power = cube.var(axis=0).sum(axis=0)
        cells = np.flatnonzero(power >= 10 ** (-_FAINTEST_DB / 10) * power.max()).tolist()
    else:
        if not radar.range_m[0] <= range_m <= radar.range_m[-1]:
            raise InputError(
                f"vital signs: range_m = {range_m:g}; the radar's ranges end at "
                f"{radar.range_m[-1]:.3g} m"
            )
        cells = [int(np.abs(radar.range_m - range_m).argmin())]
    ways = {cell: _way(cube[:, :, cell], radar) for cell in cells}
    tried = {cell: _rate(time, way, breath_hz, []) for cell, way in ways.items()}
    left = {cell: _left_over(time, way, tried[cell]) for cell, way in ways.items()}
    cell = min(cells, key=lambda one: left[one])
    way, breath = ways[cell], tried[cell]
    # Then the heart beside it and its harmonics.
    heart = _rate(time, way, heart_hz, [breath * k for k in range(1, _HARMONICS + 1)])
    sizes = _fit(time, way, [breath, heart, *(breath * k for k in range(2, _HARMONICS + 1))])[0]
    return VitalSigns(
        time_s=time,
        way_m=way - way.mean(),
        range_m=float(radar.range_m[cell]),
        breath_hz=breath,
        heart_hz=heart,
        breath_m=float(sizes[0]),
        heart_m=float(sizes[1]),
        explained=1 - left[cell],
    )


def _cycles(
    n_chirps: int, radar: Radar, breath_hz: Sequence[float], heart_hz: Sequence[float]
) -> int:
    """Count the cycles of a capture; InputError where these cannot tell the rates."""
    if radar.in_frames:
        raise InputError(
            f"vital signs: radar '{radar.name}' has frames with gaps; take slow_time = 'capture'"
        )
    cycles = n_chirps // radar.n_tx
    length_s, least_s = cycles * radar.cycle_duration_s, _LEAST_BREATHS / breath_hz[0]
    if cycles < _LEAST_CYCLES or length_s < least_s:
        raise InputError(
            f"vital signs: {cycles} cycles in {length_s:.3g} s; at least {_LEAST_CYCLES} in "
            f"{least_s:g} s are needed, two breaths of the slowest rate"
        )
    if heart_hz[1] > (highest := 0.5 / radar.cycle_duration_s):
        raise InputError(
            f"vital signs: cycles follow each other too slowly for {heart_hz[1]:g} Hz; at most "
            f"{highest:.3g} Hz can be told (heart_hz)"
        )
    return cycles


def _way(cell: NDArray[np.complexfloating], radar: Radar) -> _Reals:
    """Way (cycle,) of what moves in a cell (cycle, channel) [m]."""
    series = cell.astype(np.complex128)
    changes = series - series.mean(axis=0)
    # The weights of the channels by which the changes add up.
    weights = np.linalg.eigh(changes.conj().T @ changes)[1][:, -1]
    # A longer path turns the phase back.
    return -_angle(series @ weights) * radar.wavelength_m / (4 * np.pi)


def _left_over(time: _Reals, way: _Reals, rate: float) -> float:
    """Part of a way that is neither a line nor a sine of this rate and its harmonics."""
    harmonics = [rate * k for k in range(1, _HARMONICS + 1)]
    whole = _fit(time, way, [])[1]
    return _fit(time, way, harmonics)[1] / whole if whole > 0 else 1.0


def _angle(values: NDArray[np.complex128]) -> _Reals:
    """Unwrapped angle of values about the centre of the circle on which they lie [rad]."""
    # |z|^2 = 2 Re(c* z) + r^2 - |c|^2 is linear in the centre and the rest.
    scale = float(np.abs(values).max()) or 1.0
    z = values / scale
    columns = np.column_stack([2 * z.real, 2 * z.imag, np.ones(len(z))])
    x, y, _ = np.linalg.lstsq(columns, np.abs(z) ** 2, rcond=None)[0]
    round_centre = np.unwrap(np.angle(z - (x + 1j * y)))
    # Of a short arc the centre is not known: then nothing is taken to stand still there.
    if np.ptp(round_centre) > _ARC_RAD:
        return np.asarray(round_centre)
    return np.asarray(np.unwrap(np.angle(z)))


def _fit(time: _Reals, way: _Reals, rates: Sequence[float]) -> tuple[_Reals, float]:
    """Amplitudes of sines (rate,) beside a line, and the power that is left."""
    matrix = _columns(time, rates)
    found = np.linalg.lstsq(matrix, way, rcond=None)[0]
    left = float(np.sum((way - matrix @ found) ** 2))
    return np.hypot(found[2::2], found[3::2]), left


def _columns(time: _Reals, rates: Sequence[float]) -> _Reals:
    """A line and sines, (time, column)."""
    turned = 2 * np.pi * np.outer(time, rates)
    sines = np.stack([np.cos(turned), np.sin(turned)], axis=2).reshape(len(time), -1)
    return np.column_stack([np.ones(len(time)), time - time.mean(), sines])


def _rate(time: _Reals, way: _Reals, within: Sequence[float], beside: Sequence[float]) -> float:
    """Rate of the sine that leaves least, beside sines of other rates [Hz]."""
    from scipy.optimize import minimize_scalar  # slow to import

    step = 1 / (_PER_BIN * (time[-1] - time[0]))
    tried = np.arange(within[0], within[1] + step / 2, step)
    # A sine too near to one of the others takes its place.
    apart = np.abs(tried[:, None] - np.array([*beside, np.inf])).min(axis=1)
    tried = tried[apart >= step]
    # What a line and the other sines leave, and how much of it each sine takes, by blocks.
    others = np.linalg.qr(_columns(time, beside))[0]
    left = way - others @ (others.T @ way)
    taken = np.concatenate(
        [_taken(time, left, others, some) for some in np.array_split(tried, _BLOCKS)]
    )
    best = float(tried[int(taken.argmax())])
    fine = minimize_scalar(
        lambda rate: -_taken(time, left, others, np.array([rate]))[0],
        bounds=(best - step, best + step),
        method="bounded",
        options={"xatol": step * 1e-3},
    )
    return float(fine.x)


def _taken(time: _Reals, left: _Reals, others: _Reals, rates: _Reals) -> _Reals:
    """Power (rate,) that a sine of each rate takes of what orthonormal columns have left."""
    turned = 2 * np.pi * np.outer(time, rates)
    cosine, sine = (own - others @ (others.T @ own) for own in (np.cos(turned), np.sin(turned)))
    # Normal equations of two columns, for all rates at once.
    a, b, d = (np.sum(own, axis=0) for own in (cosine**2, cosine * sine, sine**2))
    u, v = left @ cosine, left @ sine
    return np.asarray((d * u**2 - 2 * b * u * v + a * v**2) / np.maximum(a * d - b**2, 1e-30))
