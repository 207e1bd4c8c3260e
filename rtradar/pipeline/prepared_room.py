"""People in a room, or nobody: paths over its walls, static clutter, and what is left out."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np

from rtradar.body import Body
from rtradar.radar import Radar
from rtradar.scatter.clutter.body_shadow import ClutterShadow
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.multipath.room_model import FIELD_ERROR, RoomModel
from rtradar.scatter.people_and_objects import PeopleAndObjects
from rtradar.scatter.validity import Limit, warn_of
from rtradar.scene import Scene
from rtradar.settings import RunSettings
from rtradar.signal.clutter import MovingRoomIf, RoomIf
from rtradar.signal.ghosts import GhostIf, ghosts_within

_LEFT_OUT, _OF_GHOSTS = 0.04, 0.75
"""Budget of errors, as fractions of the tolerated power: 4 % for ghosts left out, 75 % for all
ghosts, and the rest for the shadow in the clutter."""

_LEADS = 0.5
"""Part of the clutter power from behind the antennas above which there is a warning."""


class PreparedRoom(NamedTuple):
    """People and objects in a room: what is summed chirp by chirp, and the IF of the room itself.

    ``model`` is that of the people, None of nobody, and ``summed`` the echoes of all that is
    summed: all but ghosts whose IF samples are approximated, ``ghosts``. ``clutter`` is the room
    itself. ``summary`` is what was kept and dropped, for JSON; ``limits`` are those of the walls.
    """

    model: RoomModel | None
    summed: PeopleAndObjects
    clutter: RoomIf
    ghosts: GhostIf | None
    summary: dict[str, Any]
    limits: tuple[Limit, ...]


def prepare_room(
    everything: PeopleAndObjects,
    radar: Radar,
    body: Body,
    scene: Scene,
    settings: RunSettings,
    n_chirps: int,
    person_power_m2: float,
    noise_power_m2: float,
) -> PreparedRoom:
    """Trace a room with whoever is in it, and leave out what stays below the noise.

    The settings give the backend, the order of the paths, and whether everything is kept. The
    powers are those of people's echoes without the room, and of noise, per IF sample [m^2]. What is
    not worth its cost is taken out of the model of ``everything``.
    """
    noise, variant = 0.0 if settings.keep_all else noise_power_m2, settings.variant
    allowed = 0.0
    if settings.path_tolerance_db is not None:
        allowed = person_power_m2 * 10 ** (settings.path_tolerance_db / 10)
    model, error, ghosts, said = everything.room, 0.0, None, dict[str, Any]()
    summary: dict[str, Any] = {"paths": [], "faces": []}
    if model is not None:
        tones = allowed > 0 and model.has_ghost_tones
        paths = model.prune(n_chirps, noise, _LEFT_OUT * allowed if tones else 0.0)
        error = model.left_out_m2
        if tones:
            ghosts, said = ghosts_within(
                model.ghosts, radar, n_chirps, _OF_GHOSTS * allowed - error
            )
            error += said.pop("error_m2")
        summary["paths"] = [asdict(path) for path in paths]
        summary["faces"] = [face._asdict() for face in model.faces]
        said = {"left_out": model.left_out, **said}
    order = max(settings.order, 1)

    def trace(still: Radar) -> Clutter:
        return Clutter(still, scene, variant=variant, order=order).prune(noise)

    clutter = trace(radar.at(0.0))
    if radar.is_moving:
        static: RoomIf = MovingRoomIf(radar, radar.duration_of(n_chirps), trace)
    elif model is None and not scene.objects:
        static = RoomIf(radar, clutter.cycle())
    else:
        shadow = ClutterShadow(clutter, body, scene.objects, allowed - error)
        static, error = RoomIf(radar, clutter.cycle(), shadow), error + shadow.error_m2
    ratio = person_power_m2 / static.power_m2 if model is not None and static.power_m2 > 0 else None
    summary["clutter"] = {
        "power_m2": static.power_m2,
        "signal_to_clutter_db": None if ratio is None else float(10 * np.log10(ratio)),
        "kept": [asdict(item) for item in clutter.kept],
        "dropped": [asdict(item) for item in clutter.dropped],
    }
    if allowed > 0:
        said["error_db"] = 10 * math.log10(error / person_power_m2) if error > 0 else None
        summary["approximation"] = {"tolerance_db": settings.path_tolerance_db, **said}
    if scene.objects:
        summary["objects"] = everything.prune(radar, n_chirps, noise)
    summed = everything
    if model is not None and ghosts is not None:
        summed = everything.with_person(model.without_ghosts())
    limits = _limits(model, radar, clutter)
    return PreparedRoom(model, summed, static, ghosts, summary, limits)


def _limits(model: RoomModel | None, radar: Radar, clutter: Clutter) -> tuple[Limit, ...]:
    """Return the limits of validity that a room comes near, with a warning where they matter."""
    limits = []
    if radar.is_moving and model is not None:
        limits.append(Limit("clutter_shadow", 0.0, "shadow of people in clutter, left out"))
    behind, leader = clutter.behind()
    if behind > 0:
        message = (
            f"clutter power is from behind the antennas, most of it from '{leader}', and so are "
            "ghosts; elements on a board radiate ahead: give the radar an [antenna], such as "
            "pattern = 'cosine' with exponent = 2"
        )
        limits.append(Limit("clutter_behind", behind, message))
        if behind > _LEADS:
            warn_of(limits[-1])
    # Walls that are not followed over the sweep, where they matter.
    not_followed = {} if model is None else model.not_followed
    fraction = max(not_followed.values(), default=0.0)
    if fraction > 0:
        message = (
            "echo power by walls whose coefficient over the sweep is not known to "
            f"{FIELD_ERROR:.0%}, because they are too dispersive or transmit too little: "
            f"{', '.join(not_followed)}"
        )
        limits.append(Limit("wall_frequency_response", fraction, message))
        warn_of(limits[-1])
    return tuple(limits)
