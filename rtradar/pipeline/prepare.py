"""Preparation of a run: placement, echo model, link budget, noise, and the clutter of the room."""

from __future__ import annotations

import math
import warnings
from dataclasses import asdict, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Person
from rtradar.body.people import body_of_people
from rtradar.description import Movers, parts_of, read_run_file
from rtradar.errors import InputError, ValidityWarning
from rtradar.exchange import open_samples
from rtradar.pipeline.capture import Capture, PreparedRoom
from rtradar.pipeline.processing import Processing, refuse_large_maps
from rtradar.pipeline.timing import stage_line
from rtradar.process import clutter_removal, range_spectrum
from rtradar.process.window_functions import WindowFunctions, weights
from rtradar.radar import Radar
from rtradar.scatter import EchoModel
from rtradar.scatter.clutter.body_shadow import ClutterShadow
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.common.poses import has_mesh
from rtradar.scatter.link_budget import LinkBudget, link_budget, power_of_parts_alone
from rtradar.scatter.multipath.room_model import FIELD_ERROR, RoomModel
from rtradar.scatter.people_and_objects import (
    BinaryPhaseModel,
    PeopleAndObjects,
    build_model_of_all,
)
from rtradar.scatter.validity import Limit, warn_of
from rtradar.scene import Object, Scene
from rtradar.settings import MAX_SNR_DB, RunSettings
from rtradar.signal import Noise, separate
from rtradar.signal.clutter import MovingRoomIf, RoomIf
from rtradar.signal.ghosts import ghosts_within
from rtradar.signal.noise import mean_delays
from rtradar.signal.receiver import Expected, Mover, ReceiverStage
from rtradar.system.threads import one_blas_thread

_ROWS_AT_ONCE = 4096
"""Chirps of a background that are read together."""

_CREST = 9.0
"""Power of people's samples at their peak over its mean: the echoes of parts add up by chance."""


_LEFT_OUT, _OF_GHOSTS = 0.04, 0.75
"""Budget of errors, as fractions of the tolerated power: 4 % for ghosts left out, 75 % for all
ghosts, and the rest for the shadow in the clutter."""

_LEADS = 0.5
"""Part of the clutter power from behind the antennas above which there is a warning."""


@one_blas_thread()
def prepare(
    moving: Movers,
    radar: Radar,
    scene: Scene,
    settings: RunSettings,
    *,
    in_memory: bool = False,
) -> Capture:
    """Place people before a radar and settle everything that the first echo needs.

    Errors are those of `rtradar.run`. Maps that would be too large ``in_memory`` are refused.
    """
    scene, everyone = people_in(scene, moving)
    _refuse_together(radar, scene, settings)
    processing = Processing.of(radar, settings)
    radar = processing.radar
    # People, objects and the radar at their places in the world.
    with stage_line("preparing"), processing.stages.time("motion"):
        body = body_of_people(everyone, settings)
        radar = scene.place(radar)
        processing = replace(processing, radar=radar)
    if in_memory:
        refuse_large_maps(radar, radar.chirps_in(body.duration_s), sources=True)
    processing = with_background(processing)
    n_chirps, frame_starts = _frames(radar, body)
    # What they return at this level, over every path, and how strong they are without the room.
    with processing.stages.time("survey"):
        model = _echo_model(radar, body, scene, settings)
        budget = _surveyed(model, radar, body, n_chirps, scene, settings)
    # With that the noise.
    noise = _noise(radar, budget, settings)
    # The room: its clutter, and which echoes over its walls are worth their cost beside the noise.
    room: PreparedRoom | None = None
    summed: EchoModel = model
    if radar.multiplexing == "bpm":
        summed = BinaryPhaseModel(radar, lambda own: _echo_model(own, body, scene, settings))
    if not scene.is_empty:
        with processing.stages.time("room"):
            powers = budget.power, noise.power
            room, limits = _prepare_room(model, radar, body, scene, settings, n_chirps, *powers)
            budget = replace(budget, limits=(*budget.limits, *limits))
        if room.ghosts is not None and model.room is not None:
            summed = model.with_person(model.room.without_ghosts())
    # What else the receiver does to the samples, by the strongest that moves.
    receiver = None
    if radar.receiver is not None:
        receiver = ReceiverStage(
            radar,
            _expected(budget, model, radar, n_chirps, noise, processing.window_functions),
            n_chirps=n_chirps,
            seed=settings.seed,
            room=room.clutter if room else None,
            keep_all=settings.keep_all,
        )
    return Capture(
        people=everyone,
        scene=scene,
        processing=processing,
        body=body,
        model=model,
        summed=summed,
        room=room,
        link_budget=budget,
        noise=noise,
        receiver=receiver,
        n_chirps=n_chirps,
        frame_starts=frame_starts,
    )


def with_background(processing: Processing) -> Processing:
    """Return a processing that subtracts the background of its settings, where they name one."""
    settings = processing.settings
    if settings.background is None:
        return processing
    radar, windows, path = processing.radar, processing.window_functions, Path(settings.background)
    if radar.is_moving or radar.multiplexing == "ddm":
        how = "moves" if radar.is_moving else "has multiplexing = 'ddm'"
        raise InputError(
            f"background: radar '{radar.name}' {how}, and a room is then not the same in every "
            "cycle; leave --background out"
        )
    # The mean over all cycles of a recording of the room alone is what stands still in it; its
    # range spectra are subtracted from every cycle.
    with processing.stages.time("background"), warnings.catch_warnings():
        # They were given when it was simulated.
        warnings.simplefilter("ignore", ValidityWarning)
        cycle = separate(_mean_cycle(path, radar, processing.unit), radar, 0)
        spectra = range_spectrum(cycle, radar, window_functions=windows)
    removal = clutter_removal(settings.clutter_removal, radar, background=spectra)
    return replace(processing, removal=removal)


def _mean_cycle(path: Path, radar: Radar, unit: str) -> NDArray[np.complex64]:
    """Mean of all cycles (tx, rx, sample) of the IF samples of a file, or of a run again."""
    if not path.exists():
        raise InputError(
            f"background '{path}' does not exist; give the folder of a run, or a file of IF samples"
        )
    # Whole cycles at a time, so that every block has all Tx.
    step = max(1, _ROWS_AT_ONCE // radar.n_tx) * radar.n_tx
    # A run whose samples were not kept is simulated again.
    if (path / "run.toml").is_file() and not (path / "if.zarr").exists():
        parts = parts_of(read_run_file(path / "run.toml"), path)
        # Its samples still hold the background that was subtracted from its maps.
        capture = prepare(*parts[:3], replace(parts.settings, background=None))
        theirs, of_unit = capture.radar, "m"
        blocks = (values for _, values in capture.received(step, progress=False))
    else:
        file = open_samples(path, None if path.is_dir() else radar)
        theirs, of_unit = file.radar or radar, file.unit
        blocks = (file[first : first + step] for first in range(0, len(file), step))
    told = f"background '{path}': "
    if of_unit != unit:
        raise InputError(f"{told}its samples are in {of_unit}, and these in {unit}")
    # Any other radar, or the same one elsewhere, sees another room.
    for field in fields(Radar):
        if field.name != "name" and getattr(theirs, field.name) != getattr(radar, field.name):
            raise InputError(
                f"{told}its radar has another {field.name}; give a run or a recording of the room "
                "by the same radar at the same place"
            )
    # Summed in double: a mean over thousands of cycles of equal samples would lose digits in
    # single.
    total = np.zeros((radar.n_tx, radar.n_rx, radar.samples_per_chirp), np.complex128)
    count = 0
    for block in blocks:
        cycles = np.asarray(block)[: len(block) // radar.n_tx * radar.n_tx]
        total += cycles.reshape(-1, *total.shape).sum(axis=0, dtype=np.complex128)
        count += len(cycles) // radar.n_tx
    if not count or not np.isfinite(total).all():
        raise InputError(f"{told}it has no whole cycle, or samples that are not finite")
    return (total / count).astype(np.complex64)


def _refuse_together(radar: Radar, scene: Scene, settings: RunSettings) -> None:
    """Raise InputError for a radar, a scene and settings that do not go together."""
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


def _surveyed(
    model: PeopleAndObjects,
    radar: Radar,
    body: Body,
    n_chirps: int,
    scene: Scene,
    settings: RunSettings,
) -> LinkBudget:
    """Return the link budget with the limits of the objects; of nobody visible, all warnings."""
    # Warnings are held back, because those of a budget without any echo say why nobody is visible.
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ValidityWarning)
        alone, spreading = model.people_alone, settings.spreading
        budget = link_budget(alone, radar, body, n_chirps, spreading=spreading, scene=scene)
        limits = model.limits
        for limit in limits:
            warn_of(limit)
    # They are given all the same, each from the place where it arose.
    for warning in caught:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    all_limits = [*budget.limits, *limits]
    if not budget.visible:
        all_limits += [Limit("nobody_visible", 0.0, str(warning.message)) for warning in caught]
    return replace(budget, limits=tuple(all_limits))


def people_in(scene: Scene, several: Movers) -> tuple[Scene, tuple[Person, ...]]:
    """Return a scene with the objects that are given, and everyone in it: the scene's come last.

    A bare motion is a person where the scene puts them. InputError if there is nobody.
    """
    objects = tuple(one for one in several if isinstance(one, Object))
    if objects:
        scene = replace(scene, objects=objects + scene.objects)
    everyone = tuple(
        one if isinstance(one, Person) else Person(one, scene.person_position_m, scene.heading_deg)
        for one in several
        if not isinstance(one, Object)
    )
    return scene, everyone + scene.people


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


def _echo_model(radar: Radar, body: Body, scene: Scene, settings: RunSettings) -> PeopleAndObjects:
    return build_model_of_all(
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
    moving: Movers, radar: Radar, scene: Scene, settings: RunSettings
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


def _expected(
    budget: LinkBudget,
    model: PeopleAndObjects,
    radar: Radar,
    n_chirps: int,
    noise: Noise,
    windows: WindowFunctions,
) -> Expected:
    """Return what the receiver gets: people, each moving object, and the noise of a map's cell."""
    # Which paths of a room need a model of their own is not yet known.
    chirps, room = np.arange(2 * radar.n_tx), model.room
    echoes = model.echoes(chirps) if room is None else room.optical_echoes(chirps)
    # Parts of people come first; objects are movers of their own.
    own = echoes.part < len(budget.part_power)
    delays = mean_delays(replace(echoes, amplitude=np.where(own, echoes.amplitude, 0)))
    power = sum(budget.person_power)
    people = Mover(power, _CREST * power, float(delays.mean()))
    objects = (Mover(largest, largest, delay_s) for largest, delay_s in model.movers(n_chirps))
    # Weights of a window function sum to 1, so noise in a cell of the map falls by the sum of their
    # squares, over range and over Doppler.
    gain = float((weights(windows.range, radar.samples_per_chirp) ** 2).sum())
    gain *= float((weights(windows.doppler, radar.cycles_per_frame) ** 2).sum())
    return Expected((people, *objects), noise.power, noise.power * gain)


def _noise(radar: Radar, budget: LinkBudget, settings: RunSettings) -> Noise:
    """Return the noise per sample, by the first of the settings that gives its power."""
    if settings.noise_power_m2 is not None:
        return Noise(settings.noise_power_m2, settings.seed)
    if not isinstance(settings.snr_db, str):
        return Noise.for_snr(budget.power, settings.snr_db, settings.seed)
    # Noise in watts over the watts of an echo of 1 m^2 is noise in the unit of the samples.
    power = radar.noise_power_w / radar.watts_per_m2
    if power > budget.power * 10 ** (MAX_SNR_DB / 10):
        raise InputError(
            f"snr_db = physical: noise of radar '{radar.name}' is more than {MAX_SNR_DB:g} dB "
            "above the echo; look at transmit_power_dbm, noise_figure_db, noise_temperature_k "
            "and gain_dbi"
        )
    return Noise(power, settings.seed)


# -- rooms -----------------------------------------------------------------------------------------


def _prepare_room(
    everything: PeopleAndObjects,
    radar: Radar,
    body: Body,
    scene: Scene,
    settings: RunSettings,
    n_chirps: int,
    person_power_m2: float,
    noise_power_m2: float,
) -> tuple[PreparedRoom, tuple[Limit, ...]]:
    """Trace a room with whoever is in it, and leave out what stays below the noise.

    The settings give the backend, the order of the paths, and whether everything is kept. The
    powers are those of people's echoes without the room, and of noise, per IF sample [m^2]. What is
    not worth its cost is taken out of the model of ``everything``. Returned are also the limits of
    the walls.
    """
    noise, variant = 0.0 if settings.keep_all else noise_power_m2, settings.variant
    # The tolerated error is a power relative to that of people, and 0 where everything is exact.
    allowed = 0.0
    if settings.path_tolerance_db is not None:
        allowed = person_power_m2 * 10 ** (settings.path_tolerance_db / 10)
    # Three things may err: ghosts that are left out, ghosts that are interpolated in time, and the
    # shadow of people in the clutter. Each takes what those before it have left of the budget.
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
    # The clutter takes at least one reflection by walls, also where people have no ghosts.
    order = max(settings.order, 1)

    def trace(still: Radar) -> Clutter:
        return Clutter(still, scene, variant=variant, order=order).prune(noise)

    # Static clutter: traced anew along the way of a radar that moves, exactly the same in every
    # cycle where nobody casts a shadow, and else less what people and objects occlude of it.
    clutter = trace(radar.at(0.0))
    if radar.is_moving:
        static: RoomIf = MovingRoomIf(radar, radar.duration_of(n_chirps), trace)
    elif model is None and not scene.objects:
        static = RoomIf(radar, clutter.cycle())
    else:
        shadow = ClutterShadow(clutter, body, scene.objects, allowed - error)
        static, error = RoomIf(radar, clutter.cycle(), shadow), error + shadow.error_m2
    # What was found, kept and left out, for the summary.
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
    return PreparedRoom(static, ghosts, summary), _limits(model, radar, clutter)


def _limits(model: RoomModel | None, radar: Radar, clutter: Clutter) -> tuple[Limit, ...]:
    """Return the limits of validity that a room comes near, with a warning where they matter."""
    limits = []
    if radar.is_moving and model is not None:
        limits.append(Limit("clutter_shadow", 0.0, "shadow of people in clutter, left out"))
    behind, leader = clutter.behind()
    if behind > 0:
        message = (
            f"clutter power is from behind the antennas, most of it from '{leader}', and so are "
            "ghosts; elements on a board radiate ahead: give the radar a [tx_antenna] and an "
            "[rx_antenna] that look less behind, such as pattern = 'cosine' with exponent = 2"
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
