"""Link budget: the power of people's echoes over time, and the limits of validity they meet."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.people import OnePart
from rtradar.conventions import MINIMUM_KA
from rtradar.echoes import Echoes
from rtradar.errors import InputError, ValidityWarning
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import field_of
from rtradar.scatter.common.poses import EchoModel, chirps_by_steps, keyframe_step
from rtradar.scatter.validity import (
    Inside,
    Limit,
    folded_angle_deg,
    refuse_too_near,
    sampled,
    small_curvature,
    too_fast,
    warn_of,
)
from rtradar.scene import Scene
from rtradar.system.row_files import FileBackedRows, release_pages

Array = NDArray[np.float64]

_CHIRPS_AT_ONCE = 64


@dataclass(frozen=True)
class LinkBudget:
    """Echo power of people over a capture, and limits of validity.

    ``power`` is the sum of |amplitude|^2 over the visible echoes, averaged over rx and over one
    chirp every 10 ms; ``part_power`` is the same by the name of the body part, and ``person_power
    (person,)`` by person [m^2]; ``visible`` says whether there is any echo. At ``times (time,)``
    since the start of the capture [s], ``power_at (time, part)`` is the power [m^2] and ``field_at
    (time, rx)`` the complex sum of all echoes at the centre of the sweep [m].
    """

    power: float
    visible: bool
    part_power: dict[str, float]
    person_power: tuple[float, ...]
    times: Array
    power_at: Array
    field_at: NDArray[np.complex128]
    limits: tuple[Limit, ...]


def link_budget(
    model: EchoModel,
    radar: Radar,
    body: Body,
    n_chirps: int,
    *,
    spreading: bool = True,
    scene: Scene | None = None,
) -> LinkBudget:
    """Evaluate the echoes of one chirp every 10 ms, and warn of limits of validity.

    ``spreading`` counts only for the reference of an invisible body. The person must not be in
    walls and furniture of the scene: an `InputError` is raised if the pelvis, or a part with more
    than 5 % of the person's echo power, is inside a wall, and also if the trunks of two people are
    inside one another, a part comes within 0.3 m of an antenna, or nothing of a person is ever
    within the radar's range. A `ValidityWarning` is issued if a limit concerns more than 5 % of the
    echo power, or nobody is visible.
    """
    # One chirp every 10 ms stands for the capture. Rows go to files, because a capture may be long.
    chirps = chirps_by_steps(radar, n_chirps, keyframe_step(radar))
    powers, fields = FileBackedRows(), FileBackedRows()
    others = Inside(scene or Scene(), body)
    concerned = dict.fromkeys(("small_curvature", "velocity_ambiguous", "beyond_range"), 0.0)
    small_parts = np.zeros(len(body.part_names), dtype=bool)
    ever_sampled = np.zeros(len(body.names), dtype=bool)
    for first in range(0, len(chirps), _CHIRPS_AT_ONCE):
        chosen = chirps[first : first + _CHIRPS_AT_ONCE]
        # Past the end of the recording the body rests.
        times = np.minimum(radar.centres_of(chosen), body.duration_s)
        refuse_too_near(radar, body, times)
        echoes = model.echoes(chosen)
        # The low-pass filter removes echoes beyond the sampled range: a person has to have an echo
        # within it at least once.
        inside = sampled(echoes.length, radar)
        ever_sampled[body.owner[echoes.part[inside.any(axis=(0, 1))]]] = True
        by_part = _by_part(echoes, len(body.part_names))
        powers.append(by_part)
        (field,) = field_of(echoes, np.array([radar.centre_frequency_hz]))
        fields.append(field.astype(np.complex128).view(np.float64))
        # What the limits concern: parts inside others, echoes beyond the range, radii that are too
        # small, range rates that are ambiguous.
        others.look(times, body.at(times), by_part)
        power = (np.abs(echoes.amplitude) ** 2).mean(axis=0)
        concerned["beyond_range"] += float((power * ~inside).sum(axis=-1).mean(axis=1).sum())
        small = by_part * small_curvature(radar, body, times)
        concerned["small_curvature"] += float(small.sum())
        small_parts |= small.any(axis=0)
        concerned["velocity_ambiguous"] += float((by_part * too_fast(radar, body, times)).sum())
    # The run is refused where nothing of a person could show.
    if not ever_sampled.all():
        who = "person" if len(body.names) == 1 else f"person '{body.names[ever_sampled.argmin()]}'"
        raise InputError(
            f"the {who} is never within the range of radar '{radar.name}', "
            f"{radar.max_range_m:.2f} m; place the radar nearer (position_m) or raise "
            "samples_per_chirp"
        )
    # The power of all instants, by part and by person.
    power_at = powers.rows()
    part_power = dict(zip(body.part_names, power_at.mean(axis=0).tolist(), strict=True))
    power = float(power_at.sum())
    person_power = np.bincount(body.owner, weights=power_at.mean(axis=0)).tolist()
    # This may refuse parts that are strong and were inside a wall.
    in_others = others.found(power_at.sum(axis=0))
    release_pages(power_at)
    field_at = fields.rows().view(np.complex128)
    kept = part_power, tuple(person_power), radar.centres_of(chirps), power_at, field_at
    # Nobody is visible: a point of reference takes the place of the power, and no limit is met.
    if power == 0:
        return LinkBudget(_reference_power(radar, spreading), False, *kept, ())
    # Each limit as a fraction of the power, and a warning where it concerns much of it.
    names = [name for name, small in zip(body.part_names, small_parts, strict=True) if small]
    messages = _messages(radar, names)
    found = [(name, value, messages[name]) for name, value in concerned.items() if value > 0]
    limits = tuple(Limit(name, own / power, text) for name, own, text in [*found, *in_others])
    for limit in limits:
        warn_of(limit)
    return LinkBudget(power / len(chirps), True, *kept, limits)


def power_of_parts_alone(
    model_of: Callable[[Body], EchoModel], radar: Radar, body: Body, n_chirps: int
) -> Array:
    """Power (time, part) of each part where it is alone in free space [m^2].

    ``model_of`` builds the level for a body. The instants are those of the `LinkBudget`. What its
    ``power_at`` lacks of this power is occluded by other parts.
    """
    chirps = chirps_by_steps(radar, n_chirps, keyframe_step(radar))
    alone = np.empty((len(chirps), len(body.part_names)))
    # With a body of one part nothing can occlude it.
    for part in range(len(body.part_names)):
        model = model_of(OnePart(body, part))
        for first in range(0, len(chirps), _CHIRPS_AT_ONCE):
            chosen = slice(first, first + _CHIRPS_AT_ONCE)
            amplitude = model.echoes(chirps[chosen]).amplitude
            alone[chosen, part] = (np.abs(amplitude) ** 2).mean(axis=(0, 2)).sum(axis=-1)
    return alone


def _by_part(echoes: Echoes, n_parts: int) -> Array:
    """Power (chirp, part), mean over rx and frequencies."""
    power = (np.abs(echoes.amplitude) ** 2).mean(axis=(0, 2))
    by_part = np.zeros((len(power), n_parts))
    np.add.at(by_part.T, echoes.part, power.T)
    return by_part


def _reference_power(radar: Radar, spreading: bool) -> float:
    """Power of a point of 1 m^2 at the world's origin, for an invisible person [m^2]."""
    warnings.warn(
        "nobody is visible: the signal-to-noise ratio is relative to a point of 1 m^2 at the "
        "origin",
        ValidityWarning,
        stacklevel=3,
    )
    return float(np.linalg.norm(radar.position_m)) ** -4 if spreading else 1.0


def _messages(radar: Radar, small_parts: list[str]) -> dict[str, str]:
    angle_deg, beside = folded_angle_deg(radar), ""
    if angle_deg > 0:
        beside = f" and, ahead, {angle_deg:.1f} degrees beside its direction, more to the sides"
    return {
        "small_curvature": "echo power from places whose wavenumber times radius of curvature is "
        f"below {MINIMUM_KA:g}, where optics is off by decibels: {', '.join(small_parts)}",
        "velocity_ambiguous": "echo power from parts faster than the unambiguous "
        f"{radar.max_velocity_mps:.2f} m/s: it shows at another velocity{beside}",
        "beyond_range": f"echo power from beyond {radar.max_range_m:.2f} m, removed by the ideal "
        "IF low-pass",
    }
