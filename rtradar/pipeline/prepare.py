"""Preparation of a run: placement, echo model, link budget, noise, and the clutter of the room."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Person
from rtradar.body.people import body_of_people
from rtradar.echoes import Echoes
from rtradar.errors import InputError, ValidityWarning
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.motion import Motion
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.indoors import Indoors, indoors
from rtradar.pipeline.processing import Processing
from rtradar.pipeline.timing import reuse_freed_memory, stage_line
from rtradar.pipeline.warm_up import processing_compiled_beside, warm_up_processing
from rtradar.process.window_functions import weights
from rtradar.radar import Radar
from rtradar.scatter import EchoModel
from rtradar.scatter.binary_phase import BinaryPhaseModel
from rtradar.scatter.common.poses import has_mesh
from rtradar.scatter.link_budget import LinkBudget, link_budget, power_of_parts_alone
from rtradar.scatter.multipath.room_model import RoomModel
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.scatter.validity import warn_of
from rtradar.scatter.world import World, build_world, model_of_people
from rtradar.scene import Object, Scene
from rtradar.settings import MAX_SNR_DB, RunSettings
from rtradar.signal import Noise
from rtradar.signal.phase_noise import mean_delays
from rtradar.signal.receiver import Expected, Mover, ReceiverStage
from rtradar.system.checks import brief
from rtradar.system.threads import one_blas_thread

Moving = Motion | Person | Sequence[Motion | Person | Object]
"""Who and what moves: one or several, with a bare motion for a person where the scene puts them."""

_CREST = 9.0
"""Power of people's samples at their peak over its mean: the echoes of parts add up by chance."""


@one_blas_thread()
def prepare(moving: Moving, radar: Radar, scene: Scene, settings: RunSettings) -> Capture:
    """Place people before a radar and settle everything that the first echo needs.

    Errors are those of `rtradar.run`.
    """
    check_radar(radar)
    scene, everyone = people_in(scene, moving)
    reuse_freed_memory()
    processing = Processing.of(radar, settings)
    if settings.snr_db == "physical":
        # They report a missing value before the work.
        radar.noise_power_w, radar.watts_per_m2  # noqa: B018
    if radar.receiver is not None and not settings.spreading:
        raise InputError(
            f"radar '{radar.name}' has a [receiver], whose levels need the loss with distance; "
            "leave out --no-spreading (spreading=False)"
        )
    if radar.multiplexing == "bpm" and (scene.walls or scene.furniture):
        raise InputError(
            f"scene '{scene.name}': radar '{radar.name}' has multiplexing = 'bpm', which is "
            "simulated in free space only; take 'tdm', or leave the scene out"
        )
    with stage_line("preparing"):
        with processing_compiled_beside():
            with processing.stages.time("motion"):
                body = body_of_people(everyone, settings)
                radar = scene.place(radar)
                processing = replace(processing, radar=radar)
            n_chirps, frame_starts = _frames(radar, body)
            warm_up_start = time.perf_counter()
            model = _echo_model(radar, body, scene, settings)
            chirps = np.arange(2 * radar.n_tx)
            around = model.person if isinstance(model, World) else model
            # Which paths need a model of their own is not yet known.
            quick = around.optical_echoes if isinstance(around, RoomModel) else model.echoes
            echoes = quick(chirps)
            # Not every model has specular points; the report shows them of all.
            geometry = Geometry(radar.tx[:1], radar.rx[None, :1], *body.at([0.0]))
            solve_specular_points(geometry, points=True)
        warm_up_processing(echoes, radar)
        warmup_s = time.perf_counter() - warm_up_start
    with warnings.catch_warnings(record=True) as caught, processing.stages.time("survey"):
        warnings.simplefilter("always", ValidityWarning)
        person, spreading = model_of_people(model), settings.spreading
        budget = link_budget(person, radar, body, n_chirps, spreading=spreading, scene=scene)
        if isinstance(model, World):
            budget = replace(budget, limits=(*budget.limits, *model.limits))
            for limit in model.limits:
                warn_of(limit)
    for warning in caught:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    noise = _noise(radar, budget, settings)
    movers = _movers(budget, model, echoes, n_chirps) if radar.receiver is not None else ()
    inside, tones = None, model
    if radar.multiplexing == "bpm":
        tones = BinaryPhaseModel(radar, lambda own: _echo_model(own, body, scene, settings))
    if isinstance(around, RoomModel):
        with processing.stages.time("room"):
            powers = budget.power, noise.power
            inside = indoors(around, radar, body, scene, settings, n_chirps, *powers)
            if isinstance(model, World):
                objects = model.prune(radar, n_chirps, 0.0 if settings.keep_all else noise.power)
                inside = inside._replace(summary=inside.summary | {"objects": objects})
            if inside.ghosts is not None:
                direct = around.without_ghosts()
                tones = model.with_person(direct) if isinstance(model, World) else direct
    return Capture(
        people=everyone,
        scene=scene,
        settings=settings,
        processing=processing,
        body=body,
        model=model,
        tones=tones,
        inside=inside,
        link_budget=budget,
        warned=tuple(str(warning.message) for warning in caught),
        noise=noise,
        receiver=_receiver(radar, movers, noise, inside, n_chirps, settings),
        n_chirps=n_chirps,
        frame_starts=frame_starts,
        warmup_s=warmup_s,
    )


def check_radar(radar: object) -> None:
    """Raise InputError unless this is a radar."""
    if not isinstance(radar, Radar):
        raise InputError(
            f"radar = {brief(radar)}; it must be a Radar, such as rt.Radar.preset('paper-12ghz')"
        )


def people_in(scene: Scene, given: Moving) -> tuple[Scene, tuple[Person, ...]]:
    """Return a scene with the objects that are given, and everyone in it: the scene's come last.

    A bare motion is a person where the scene puts them. InputError if there is nobody, or the scene
    is none.
    """
    if not isinstance(scene, Scene):
        raise InputError(
            f"scene = {brief(scene)}; it must be a Scene, such as rt.Scene.load('living-room')"
        )
    several = given if isinstance(given, Sequence) else (given,)
    objects = tuple(one for one in several if isinstance(one, Object))
    if objects:
        scene = replace(scene, objects=objects + scene.objects)
    everyone = tuple(
        one if isinstance(one, Person) else Person(one, scene.person_position_m, scene.heading_deg)
        for one in several
        if not isinstance(one, Object)
    )
    everyone += scene.people
    if not everyone:
        raise InputError(
            f"scene '{scene.name}': nobody is there; give a motion, or several with their places"
        )
    return scene, everyone


def _frames(radar: Radar, body: Body) -> tuple[int, NDArray[np.int64]]:
    """Return the number of chirps in whole cycles, and the first cycle of each frame."""
    n_chirps = radar.chirps_in(body.duration_s)
    starts = radar.window_starts(n_chirps)
    if len(starts) == 0:
        raise InputError(
            f"motion {' and '.join(body.names)}: the interval of {body.duration_s:.3f} s holds no "
            f"whole frame of {radar.frame_duration_s} s of radar '{radar.name}'; choose a longer "
            "one (--start, --duration)"
        )
    return n_chirps, starts


def _echo_model(radar: Radar, body: Body, scene: Scene, settings: RunSettings) -> EchoModel:
    return build_world(
        settings.fidelity,
        radar,
        body,
        scene=scene,
        order=settings.order,
        variant=settings.variant,
        spreading=settings.spreading,
        materials=body.materials,
        **(settings.model_options or {}),
    )


def power_alone(
    moving: Moving, radar: Radar, scene: Scene, settings: RunSettings
) -> NDArray[np.float64] | None:
    """Power (time, part) of each part, alone in free space, at the times of the `LinkBudget` [m^2].

    None for people with a mesh, of which no part can stand alone.
    """
    scene, everyone = people_in(scene, moving)
    body = body_of_people(everyone, settings)
    if has_mesh(body):
        return None
    radar = scene.place(radar)
    level = partial(_echo_model, radar, scene=Scene(), settings=settings)
    return power_of_parts_alone(level, radar, body, radar.chirps_in(body.duration_s))


def _movers(
    budget: LinkBudget, model: EchoModel, echoes: Echoes, n_chirps: int
) -> tuple[Mover, ...]:
    """Return people, by the link budget and some echoes of everything, and each moving object."""
    objects = model.movers(n_chirps) if isinstance(model, World) else ()
    own = echoes.part < len(budget.part_power)
    delays = mean_delays(replace(echoes, amplitude=np.where(own, echoes.amplitude, 0)))
    power = sum(budget.person_power)
    people = Mover(power, _CREST * power, float(delays.mean()))
    return people, *(Mover(largest, largest, delay_s) for largest, delay_s in objects)


def _receiver(
    radar: Radar,
    movers: tuple[Mover, ...],
    noise: Noise,
    inside: Indoors | None,
    n_chirps: int,
    settings: RunSettings,
) -> ReceiverStage | None:
    """Return what the receiver adds, by what moves and the noise of a map's cell."""
    if radar.receiver is None:
        return None
    gain = 1.0
    lengths = radar.samples_per_chirp, radar.cycles_per_frame
    for window, n in zip((settings.range_window, settings.doppler_window), lengths, strict=True):
        gain *= float((weights(window, n) ** 2).sum())
    return ReceiverStage(
        radar,
        Expected(movers, noise.power, noise.power * gain),
        n_chirps=n_chirps,
        seed=settings.seed,
        room=inside.room if inside else None,
        keep_all=settings.keep_all,
    )


def _noise(radar: Radar, budget: LinkBudget, settings: RunSettings) -> Noise:
    """Return the noise per sample, by the first of the settings that gives its power."""
    if settings.noise_power_m2 is not None:
        return Noise(settings.noise_power_m2, settings.seed)
    if not isinstance(settings.snr_db, str):
        return Noise.for_snr(budget.power, settings.snr_db, settings.seed)
    power = radar.noise_power_w / radar.watts_per_m2
    if power > budget.power * 10 ** (MAX_SNR_DB / 10):
        raise InputError(
            f"snr_db = physical: noise of radar '{radar.name}' is more than {MAX_SNR_DB:g} dB "
            "above the echo; look at transmit_power_dbm, noise_figure_db, noise_temperature_k "
            "and gain_dbi"
        )
    return Noise(power, settings.seed)
