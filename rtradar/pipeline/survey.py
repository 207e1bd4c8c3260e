"""The pass before the signal: how strong the person's echo is, and how near the model is to the ends of its validity."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import MINIMUM_ANTENNA_DISTANCE_M, MINIMUM_KA, SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError, ValidityWarning
from rtradar.pipeline.rooms.inside_walls import Inside
from rtradar.process.angles import folded_angle_deg
from rtradar.radar import Radar
from rtradar.rcs import ellipsoid_radii
from rtradar.scatter import EchoModel
from rtradar.scatter.common.poses import anchor_step
from rtradar.scene import Scene
from rtradar.signal import in_band
from rtradar.system.row_files import FileBackedRows, release_pages

_CHIRPS_AT_ONCE = 64

_WARN_SHARE = 0.05
"""Limits that concern less of the echo power than this are counted, without a Python warning."""

_STEP_S = 1e-3
"""Interval over which the range rate of a part is taken."""


@dataclass(frozen=True)
class Limit:
    """One end of validity that the capture came near or went past.

    Parameters
    ----------
    name : str
        Short, for machines.
    share : float
        Of the person's echo power, 0 to 1.
    message : str
        One line for people.
    """

    name: str
    share: float
    message: str


@dataclass(frozen=True)
class Survey:
    """What the pass found.

    Parameters
    ----------
    power : float
        Sum of |amplitude|^2 over the visible echoes of the person, averaged over rx and one chirp every 10 ms [m^2].
    visible : bool
        Whether there is any echo at all.
    part_power : dict
        The same by name of body part.
    times : (time,) float64
        Instants looked at [s] since the start of the capture.
    power_at : (time, part) float64
        The same power by instant and part [m^2].
    hidden_at : (time, part) float64
        Share of the channels that do not see the part, 0 to 1.
    limits : tuple of Limit
    """

    power: float
    visible: bool
    part_power: dict[str, float]
    times: NDArray[np.float64]
    power_at: NDArray[np.float64]
    hidden_at: NDArray[np.float64]
    limits: tuple[Limit, ...]


def survey(
    model: EchoModel,
    radar: Radar,
    body: Body,
    n_chirps: int,
    *,
    spreading: bool = True,
    scene: Scene | None = None,
) -> Survey:
    """Look at one chirp every 10 ms.

    Parameters
    ----------
    model : EchoModel
        Of this body and radar.
    radar : Radar
    body : Body
    n_chirps : int
        In the capture.
    spreading : bool
        As of the model; only for the reference where nobody is visible.
    scene : Scene, optional
        What the person must not stand in; nothing if left out.

    Returns
    -------
    Survey

    Raises
    ------
    InputError
        Where a part comes within 0.3 m of an antenna, nothing of the person is ever within the radar's range, or the pelvis, or a
        part with more than 5 % of the echo power, is inside a wall.

    Warns
    -----
    ValidityWarning
        Where more than 5 % of the echo power is concerned, and where nobody is visible.
    """
    chirps = np.arange(0, n_chirps, anchor_step(radar))
    n_parts = len(body.part_names)
    powers, shares_hidden = FileBackedRows(), FileBackedRows()
    concerned = dict.fromkeys(("small_curvature", "velocity_ambiguous", "beyond_range"), 0.0)
    small_parts: set[str] = set()
    seen_in_band = False
    solid = Inside(scene or Scene(), body.part_names)
    for first in range(0, len(chirps), _CHIRPS_AT_ONCE):
        chosen = chirps[first : first + _CHIRPS_AT_ONCE]
        times = np.minimum(radar.centres_of(chosen), body.duration_s)
        _refuse_too_near(radar, body, times)
        echoes = model.echoes(chosen)
        power = (np.abs(echoes.amplitude) ** 2).mean(axis=0)
        inside = in_band(echoes, radar)
        seen_in_band |= bool(inside.any())
        concerned["beyond_range"] += float((power * ~inside).sum(axis=-1).mean(axis=1).sum())
        by_part = np.zeros((len(chosen), n_parts))
        np.add.at(by_part.T, echoes.part, power.mean(axis=1).T)
        powers.append(by_part)
        solid.look(times, body.at(times), by_part)
        seen = np.zeros((len(chosen), echoes.length.shape[1], n_parts), dtype=bool)
        for echo, part in enumerate(echoes.part):
            seen[..., part] |= power[..., echo] > 0
        shares_hidden.append(1 - seen.mean(axis=1))
        small = _small_curvature(radar, body, times)
        concerned["small_curvature"] += float((by_part * small).sum())
        small_parts |= {
            body.part_names[part] for part in np.flatnonzero((by_part * small).sum(axis=0))
        }
        concerned["velocity_ambiguous"] += float((by_part * _too_fast(radar, body, times)).sum())
    if not seen_in_band:
        raise InputError(
            f"the person is never within the range of radar '{radar.name}', {radar.max_range_m:.2f} m; place the radar "
            "nearer (position_m) or raise samples_per_chirp"
        )
    power_at, hidden_at = powers.rows(), shares_hidden.rows()
    part_power = dict(zip(body.part_names, power_at.mean(axis=0).tolist(), strict=True))
    looked_at = radar.centres_of(chirps)
    power = float(power_at.sum())
    indoors = solid.found(power_at.sum(axis=0))
    release_pages(power_at)
    if power == 0:
        # A point of 1 m^2 at the world's origin stands in for the person.
        warnings.warn(
            "nobody is visible: the signal-to-noise ratio is relative to a point of 1 m^2 at the origin",
            ValidityWarning,
            stacklevel=2,
        )
        distance = float(np.linalg.norm(radar.position_m))
        reference = distance**-4 if spreading else 1.0
        return Survey(reference, False, part_power, looked_at, power_at, hidden_at, ())
    messages = {
        "small_curvature": f"echo power from places whose wavenumber times radius of curvature is below "
        f"{MINIMUM_KA:g}, where optics is off by decibels: {', '.join(name for name in body.part_names if name in small_parts)}",
        "velocity_ambiguous": f"echo power from parts faster than the unambiguous {radar.max_velocity_mps:.2f} m/s: "
        f"it shows at another velocity{_and_direction(radar)}",
        "beyond_range": f"echo power from beyond {radar.max_range_m:.2f} m, removed by the ideal IF low-pass",
    }
    found = [(name, value, messages[name]) for name, value in concerned.items() if value > 0]
    limits = tuple(
        Limit(name, value / power, message) for name, value, message in [*found, *indoors]
    )
    for limit in limits:
        warn_of(limit)
    return Survey(power / len(chirps), True, part_power, looked_at, power_at, hidden_at, limits)


def _and_direction(radar: Radar) -> str:
    angle_deg = folded_angle_deg(radar)
    return (
        f" and, ahead, {angle_deg:.1f} degrees beside its direction, more to the sides"
        if angle_deg > 0
        else ""
    )


def warn_of(limit: Limit) -> None:
    """Warn of a limit that concerns much of the echo power.

    Parameters
    ----------
    limit : Limit

    Warns
    -----
    ValidityWarning
        Where it is more than 5 %.
    """
    if limit.share > _WARN_SHARE:
        warnings.warn(f"{limit.share:.0%} of the {limit.message}", ValidityWarning, stacklevel=3)


def _refuse_too_near(radar: Radar, body: Body, times: NDArray[np.float64]) -> None:
    """Refuse parts near an antenna: the distance to a part is at least that to its centre less its largest semi-axis."""
    centres, frames, semi_axes = body.at(times)
    antennas = np.concatenate([radar.tx, radar.rx])
    reach = semi_axes.max(axis=1)
    gap = np.linalg.norm(centres[:, None] - antennas[:, None], axis=-1) - reach
    for time, antenna, part in np.argwhere(gap < MINIMUM_ANTENNA_DISTANCE_M):
        distance = _distance(
            frames[time, part].T @ (antennas[antenna] - centres[time, part]), semi_axes[part]
        )
        if distance < MINIMUM_ANTENNA_DISTANCE_M:
            raise InputError(
                f"at {times[time]:.2f} s the {body.part_names[part]} is {max(distance, 0):.2f} m from an "
                f"antenna of radar '{radar.name}'; "
                f"at least {MINIMUM_ANTENNA_DISTANCE_M} m is allowed: move the radar (position_m) or choose another interval"
            )


def _distance(place: NDArray[np.float64], semi_axes: NDArray[np.float64]) -> float:
    """Distance of a place in an ellipsoid's axes from its surface; 0 inside.

    The nearest point is a^2 x / (a^2 + t) with the root t of sum (a x / (a^2 + t))^2 = 1, found by bisection.
    """
    squares = semi_axes**2
    if ((place / semi_axes) ** 2).sum() <= 1:
        return 0.0
    low, high = 0.0, float(np.linalg.norm(semi_axes * place))
    for _ in range(80):
        middle = (low + high) / 2
        if ((semi_axes * place / (squares + middle)) ** 2).sum() > 1:
            low = middle
        else:
            high = middle
    return float(np.linalg.norm(place - squares * place / (squares + high)))


def _small_curvature(radar: Radar, body: Body, times: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where the smaller radius of curvature at the specular point, seen from the array's centre, is too small (time, part)."""
    centres, frames, semi_axes = body.at(times)
    sight = np.einsum("tpji,tpj->tpi", frames, np.asarray(radar.position_m) - centres)
    sight /= np.linalg.norm(sight, axis=-1, keepdims=True)
    theta, phi = np.arccos(np.clip(sight[..., 2], -1, 1)), np.arctan2(sight[..., 1], sight[..., 0])
    smaller, _ = ellipsoid_radii(semi_axes[:, 0], semi_axes[:, 1], semi_axes[:, 2], theta, phi)
    return np.asarray(
        2 * np.pi * radar.start_frequency_hz / SPEED_OF_LIGHT_MPS * smaller < MINIMUM_KA
    )


def _too_fast(radar: Radar, body: Body, times: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where the range rate of a part's centre is ambiguous (time, part)."""
    if body.duration_s < _STEP_S:
        return np.zeros((len(times), len(body.part_names)), dtype=bool)
    early = np.minimum(times, body.duration_s - _STEP_S)
    ranges = [
        np.linalg.norm(body.at(at).centres - np.asarray(radar.position_m), axis=-1)
        for at in (early, early + _STEP_S)
    ]
    return np.asarray(np.abs(ranges[1] - ranges[0]) / _STEP_S > radar.max_velocity_mps)
