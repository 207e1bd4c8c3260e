"""A person in a room: the paths over its walls, its static clutter, what of both is worth its cost, and where ghosts are."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.pipeline.rooms.clutter_if import RoomIf
from rtradar.pipeline.survey import Limit, warn_of
from rtradar.radar import Radar
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.multipath.multipath import FIELD_ERROR, Multipath
from rtradar.scene import Scene
from rtradar.settings import RunSettings

_GHOST_STEP_CYCLES = 4
"""Over which the velocity of a ghost is taken."""


class Indoors(NamedTuple):
    """The person in the room.

    ``model`` the person, ``room`` the IF of the room itself, ``account`` what was kept and dropped, for JSON; ``limits`` what the
    walls bring.
    """

    model: Multipath
    room: RoomIf
    account: dict[str, Any]
    limits: tuple[Limit, ...]


class Ghost(NamedTuple):
    """Where an echo over walls shows: ``path`` its walls, ``range_m``, ``velocity_mps``, ``azimuth_rad`` and its power."""

    path: str
    range_m: float
    velocity_mps: float
    azimuth_rad: float
    power_m2: float


def indoors(
    model: Multipath,
    radar: Radar,
    body: Body,
    scene: Scene,
    settings: RunSettings,
    n_chirps: int,
    person_power_m2: float,
    noise_power_m2: float,
) -> Indoors:
    """Trace a room with a person in it, and leave out what stays below the noise.

    Parameters
    ----------
    model : Multipath
        The person in the room; what is not worth its cost is taken out of it.
    radar : Radar
        Where it stands in the scene.
    body : Body
    scene : Scene
    settings : RunSettings
        Settings of the run: the backend, the order of the paths, the seed of diffuse returns, and
        whether everything is kept.
    n_chirps : int
        Number of chirps in the capture.
    person_power_m2, noise_power_m2 : float
        Mean power of the person's echoes without the room, and of noise, per IF sample [m^2].

    Returns
    -------
    Indoors
    """
    noise, variant = 0.0 if settings.keep_all else noise_power_m2, settings.variant
    paths = model.prune(n_chirps, noise)
    clutter = Clutter(
        radar, scene, variant=variant, seed=settings.seed, order=max(settings.order, 1)
    ).prune(noise)
    room = RoomIf(clutter, body, variant=variant)
    still = room.power_m2
    account = {
        "paths": [path.row() for path in paths],
        "clutter": {
            "power_m2": still,
            "signal_to_clutter_db": float(10 * np.log10(person_power_m2 / still))
            if still > 0
            else None,
            "kept": [asdict(item) for item in clutter.kept],
            "dropped": [asdict(item) for item in clutter.dropped],
        },
    }
    return Indoors(model, room, account, _limits(model))


def _limits(model: Multipath) -> tuple[Limit, ...]:
    """Walls that are not followed over the sweep, where the person is seen by them."""
    share = max(model.not_followed.values(), default=0.0)
    if share == 0:
        return ()
    names = ", ".join(model.not_followed)
    message = (
        f"echo power by walls whose coefficient over the sweep is not known to {FIELD_ERROR:.0%}, so dispersive they are or so "
        f"little they let through: {names}"
    )
    limit = Limit("wall_frequency_response", share, message)
    warn_of(limit)
    return (limit,)


def ghosts(model: Multipath, radar: Radar, time_s: float) -> list[Ghost]:
    """Where the echoes over walls show at one time [s], path by path, each the mean of its parts weighted by their power.

    The azimuth is the one from which the last leg comes, that of its antenna's image mirrored back.
    """
    cycle = round(time_s / radar.cycle_duration_s - _GHOST_STEP_CYCLES / 2)
    chirps = (max(cycle, 0) + np.array([0, _GHOST_STEP_CYCLES])) * radar.n_tx
    echoes = model.echoes(chirps)
    power = (np.abs(echoes.amplitude) ** 2).mean(axis=(0, 1, 2))
    length = echoes.length.mean(axis=1)
    rate = (length[1] - length[0]) / (_GHOST_STEP_CYCLES * radar.cycle_duration_s)
    azimuth = _azimuth(echoes.length[0, : radar.rx_y], radar)
    found = []
    for path in dict.fromkeys(model.path_names):
        own = (
            np.array([name == path for name in model.path_names])
            & (echoes.bounces > 1)
            & (power > 0)
        )
        if own.any():
            weight = power[own] / power[own].sum()
            range_m, velocity = (
                float(weight @ length.mean(axis=0)[own]) / 2,
                float(weight @ rate[own]) / 2,
            )
            found.append(
                Ghost(
                    path, range_m, velocity, float(weight @ azimuth[own]), float(power[own].sum())
                )
            )
    return found


def _azimuth(length: NDArray[np.float64], radar: Radar) -> NDArray[np.float64]:
    """Direction from which echoes come, by the slope of their lengths (rx, echo) along the line of receivers."""
    places = radar.rx[: radar.rx_y, 1]
    if len(places) < 2:
        return np.zeros(length.shape[1])
    slope = np.polyfit(places, length, 1)[0]
    return np.arcsin(np.clip(-slope, -1, 1))
