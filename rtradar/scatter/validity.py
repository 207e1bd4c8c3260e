"""Limits of validity: where optics ends, what is too near, too fast, or at another velocity."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from rtradar.body import Body, Ellipsoids
from rtradar.conventions import MINIMUM_ANTENNA_DISTANCE_M, MINIMUM_KA, SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError, ValidityWarning
from rtradar.radar import Radar
from rtradar.rcs import ellipsoid_radii

Array = NDArray[np.float64]

WARN_FRACTION = 0.05
"""Limits that concern less of the echo power than this are counted, without a Python warning."""

_BEAMS = 181
"""Sines from -1 to 1 in which the largest beam of an array is sought."""

_STEP_S = 1e-3
"""Interval over which the range rate of a part is measured [s]."""


@dataclass(frozen=True)
class Limit:
    """A limit of validity that the capture came near or went past.

    ``name`` is short, for machines, ``message`` one line for people. ``share``, so called in
    ``summary.json``, is the fraction that is concerned, 0 to 1: of the person's echo power, unless
    the message begins with something else.
    """

    name: str
    share: float
    message: str


def warn_of(limit: Limit) -> None:
    """Issue a `ValidityWarning` for a limit that concerns more than 5 % of the echo power."""
    if limit.share > WARN_FRACTION:
        warnings.warn(f"{limit.share:.0%} of the {limit.message}", ValidityWarning, stacklevel=3)


# -- curvature -------------------------------------------------------------------------------------


def smaller_radius(semi_axes: Array, direction: Array) -> Array:
    """Compute the smaller radius of curvature where the normal has a direction (..., part) [m].

    ``semi_axes (part, 3)`` are those of ellipsoids [m], directions (..., part, 3) are in their
    axes, of any length.
    """
    size = np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-12)
    x, y, z = np.moveaxis(direction / size, -1, 0)
    theta = np.arccos(np.clip(z, -1, 1))
    a, b, c = semi_axes.T
    return np.asarray(ellipsoid_radii(a, b, c, theta, np.arctan2(y, x))[0])


def warn_of_small_radii(
    target: Ellipsoids,
    tx: Array,
    rx: Array,
    wavenumber: Array,
    amplitude: Array,
    *,
    stacklevel: int = 2,
) -> None:
    """Warn where much of an echo comes from radii below `MINIMUM_KA` over the wavenumber.

    The antennas (n, 3) are given pair by pair [m], with their wavenumbers (n,) [1/m] and the
    amplitudes (n, part) of each part's echo, of which only the ratio counts. A `ValidityWarning` is
    issued if such radii, taken where the normal halves the angle between both antennas, give more
    than 5 % of the power. A radius counts less by the cosine of incidence, half the angle between
    both antennas. ``stacklevel`` is counted from the caller; see `warnings.warn`.

    Equation :eq:`validity` of the theory page.
    """
    normal = np.zeros((len(tx), *target.centres.shape))
    for antennas in (tx, rx):
        sight = np.einsum("pji,npj->npi", target.frames, antennas[:, None] - target.centres)
        normal += sight / np.linalg.norm(sight, axis=-1, keepdims=True)
    # Opposite antennas have no such normal, and no echo.
    cosine = np.linalg.norm(normal, axis=-1) / 2
    ka = wavenumber[:, None] * smaller_radius(target.semi_axes, normal) * cosine
    power, small = np.abs(amplitude) ** 2, ka < MINIMUM_KA
    concerned, whole = float(power[small].sum()), float(power.sum())
    if whole > 0 and concerned > WARN_FRACTION * whole:
        warnings.warn(
            f"{concerned / whole:.0%} of the echo power is from places whose wavenumber times "
            "radius of curvature times cosine of incidence is below "
            f"{MINIMUM_KA:g}, down to {float(ka[small].min()):.3g}, "
            "where optics is off by decibels; rtradar.rcs.sphere(method='mie') is exact",
            ValidityWarning,
            stacklevel=stacklevel + 1,
        )


def small_curvature(radar: Radar, body: Body, times: Array) -> NDArray[np.bool_]:
    """Whether the smaller radius at the specular point of the array's centre is too small.

    The result is (time, part), for ``times (time,)`` [s].
    """
    centres, frames, semi_axes = body.at(times)
    sight = np.einsum("tpji,tpj->tpi", frames, radar.poses_at(times)[1][:, None] - centres)
    wavenumber = 2 * np.pi * radar.start_frequency_hz / SPEED_OF_LIGHT_MPS
    return np.asarray(wavenumber * smaller_radius(semi_axes, sight) < MINIMUM_KA)


# -- velocity --------------------------------------------------------------------------------------


def too_fast(radar: Radar, body: Body, times: Array) -> NDArray[np.bool_]:
    """Whether the range rates of the parts' centres are ambiguous, (time, part)."""
    if body.duration_s < _STEP_S:
        return np.zeros((len(times), len(body.part_names)), dtype=bool)
    early = np.minimum(times, body.duration_s - _STEP_S)
    before, after = (
        np.linalg.norm(body.at(at).centres - radar.poses_at(at)[1][:, None], axis=-1)
        for at in (early, early + _STEP_S)
    )
    return np.asarray(np.abs(after - before) / _STEP_S > radar.max_velocity_mps)


def folded_angle_deg(radar: Radar) -> float:
    """Compute the angular error, at broadside, of an echo whose velocity is folded once [deg].

    With a range rate that is wrong by twice the unambiguous velocity, the phase of one Tx after the
    other is wrong by 1 / n_tx of a turn. On a line of Tx with spacing d this is the phase of a
    direction whose sine differs by lambda / (n_tx d). In a listed array the wrong phases are no
    plane wave: the direction is that of the largest beam, over the half space ahead. The error is 0
    if Tx do not take turns, or no line has two of them.
    """
    taking_turns = radar.tx_delay_s[-1] > 0
    on_a_line = (radar.tx_y > 1 and radar.rx_y > 0) or (radar.tx_z > 1 and radar.rx_z > 0)
    if not (taking_turns and (on_a_line or not radar.is_cross)):
        return 0.0
    if not radar.is_cross:
        # Tx at one place are polarisations.
        return _beam_of_turns_deg(radar) if np.ptp(radar.tx_m, axis=0).any() else 0.0
    spacing_m = radar.tx_spacing_wavelengths * radar.start_wavelength_m
    return math.degrees(math.asin(min(1.0, radar.wavelength_m / (radar.n_tx * spacing_m))))


def _beam_of_turns_deg(radar: Radar) -> float:
    """Angle from broadside to the largest beam where each Tx is wrong by its share of a turn [deg].

    Of two beams alike, such as those above and below an array without height, the nearer one.
    """
    sines = np.linspace(-1, 1, _BEAMS)
    y, z = (axis.ravel() for axis in np.meshgrid(sines, sines, indexing="ij"))
    ahead = y**2 + z**2 <= 1
    y, z = y[ahead], z[ahead]
    order = np.argsort(radar.tx_order if radar.tx_order is not None else np.arange(radar.n_tx))
    turns = np.repeat(order / radar.n_tx, radar.n_channels // radar.n_tx)
    field = np.zeros(len(y), dtype=np.complex128)
    for place, turn in zip(radar.virtual_m / radar.wavelength_m, turns, strict=True):
        field += np.exp(2j * np.pi * (y * place[1] + z * place[2] - turn))
    power = np.abs(field)
    best = power > power.max() * (1 - 1e-3)
    return math.degrees(math.asin(float(np.sqrt((y[best] ** 2 + z[best] ** 2).min()))))


# -- distance --------------------------------------------------------------------------------------


def sampled(length: Array, radar: Radar) -> NDArray[np.bool_]:
    """Whether paths of these lengths (...) [m] are within the range that the sampling covers."""
    return np.asarray(length < 2 * radar.max_range_m)


def refuse_too_near(radar: Radar, body: Body, times: Array) -> None:
    """Raise an `InputError` if a part is nearer than `MINIMUM_ANTENNA_DISTANCE_M` to an antenna.

    The message names the part and the time, one of ``times`` [s].
    """
    centres, frames, semi_axes = body.at(times)
    antennas = np.concatenate(radar.antennas_at(times), axis=1)
    # The distance to a part is at least that to its centre less its largest semi-axis.
    away = np.linalg.norm(centres[:, None] - antennas[:, :, None], axis=-1)
    gap = away - semi_axes.max(axis=1)
    for time, antenna, part in np.argwhere(gap < MINIMUM_ANTENNA_DISTANCE_M):
        local = frames[time, part].T @ (antennas[time, antenna] - centres[time, part])
        distance = _distance(local, semi_axes[part])
        if distance < MINIMUM_ANTENNA_DISTANCE_M:
            raise InputError(
                f"at {times[time]:.2f} s the {body.part_names[part]} is {max(distance, 0):.2f} m "
                f"from an antenna of radar '{radar.name}'; at least {MINIMUM_ANTENNA_DISTANCE_M} m "
                "is allowed: move the radar (position_m) or choose another interval"
            )


def _distance(place: Array, semi_axes: Array) -> float:
    """Distance of a place in an ellipsoid's axes from its surface; 0 inside.

    The nearest point is a^2 x / (a^2 + t) with the root t of sum (a x / (a^2 + t))^2 = 1.
    """

    def beyond(t: float) -> float:
        return float(((semi_axes * place / (semi_axes**2 + t)) ** 2).sum()) - 1

    if beyond(0.0) <= 0:
        return 0.0
    t = brentq(beyond, 0.0, float(np.linalg.norm(semi_axes * place)))
    return float(np.linalg.norm(t * place / (semi_axes**2 + t)))
