"""Setting a person before a radar in a scene: echoes budget, noise settled, the room traced."""

from __future__ import annotations

import math
import time
import warnings

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.errors import InputError, ValidityWarning
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.motion import Motion, place
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.indoors import indoors
from rtradar.pipeline.timing import Stages
from rtradar.pipeline.warm_up import processing_compiled_beside, warm_up_processing
from rtradar.process import WindowFunctions, build_detector, clutter_removal
from rtradar.radar import Radar
from rtradar.scatter import EchoModel, build_model
from rtradar.scatter.link_budget import LinkBudget, link_budget
from rtradar.scatter.multipath.room_model import RoomModel
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.scene import Scene
from rtradar.settings import MAX_SNR_DB, RunSettings
from rtradar.signal import Noise


def prepare(
    motion: Motion, radar: Radar, scene: Scene, settings: RunSettings, stages: Stages
) -> Capture:
    """Place a person before a radar, build the echo model, survey its echoes, and trace the room.

    Errors are those of `rtradar.run`.
    """
    removal = clutter_removal(settings.clutter_removal, radar)
    detect = build_detector(settings.detector, pfa=settings.pfa, looks=radar.n_channels)
    window_functions = WindowFunctions(settings.range_window, settings.doppler_window)
    if settings.snr_db == "physical":
        # These say what is missing before the work.
        radar.noise_power_w, radar.watts_per_m2  # noqa: B018
    with processing_compiled_beside():
        with stages.time("motion"):
            radar, body = _placed(motion, radar, scene, settings)
        n_chirps, windows = _frames(motion, radar, body)
        warm = time.perf_counter()
        model = _echo_model(radar, body, scene, settings)
        echoes = model.echoes(np.arange(2 * radar.n_tx))
        # Not every model has specular points; the report shows them of all.
        solve_specular_points(
            Geometry(radar.tx[:1], radar.rx[None, :1], *body.at([0.0])), points=True
        )
    warm_up_processing(echoes, radar)
    warmup_s = time.perf_counter() - warm
    with warnings.catch_warnings(record=True) as caught, stages.time("survey"):
        warnings.simplefilter("always", ValidityWarning)
        person = model.person if isinstance(model, RoomModel) else model
        budget = link_budget(
            person, radar, body, n_chirps, spreading=settings.spreading, scene=scene
        )
    for warning in caught:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    noise = _noise(radar, budget, settings)
    inside = None
    if isinstance(model, RoomModel):
        with stages.time("room"):
            inside = indoors(
                model, radar, body, scene, settings, n_chirps, budget.power, noise.power
            )
    names = [motion.name, radar.name, settings.fidelity, *([scene.name] if inside else [])]
    return Capture(
        radar=radar,
        body=body,
        model=model,
        inside=inside,
        survey=budget,
        warned=tuple(str(warning.message) for warning in caught),
        noise=noise,
        n_chirps=n_chirps,
        windows=windows,
        removal=removal,
        detect=detect,
        window_functions=window_functions,
        title=", ".join(names),
        stages=stages,
        warmup_s=warmup_s,
    )


def _placed(
    motion: Motion, radar: Radar, scene: Scene, settings: RunSettings
) -> tuple[Radar, Body]:
    """The radar and the person where they are in the scene."""
    placed = place(
        motion,
        start_s=settings.start_s,
        duration_s=settings.duration_s,
        heading_deg=settings.heading_deg + scene.heading_deg,
    )
    body = Body.from_motion(placed.shifted([*scene.person_position_m, 0.0]))
    return scene.place(radar), body


def _frames(motion: Motion, radar: Radar, body: Body) -> tuple[int, NDArray[np.int64]]:
    """The number of chirps in whole cycles, and the first cycle of each frame."""
    n_chirps = math.floor(body.duration_s / radar.cycle_duration_s * (1 + 1e-12)) * radar.n_tx
    windows = radar.window_starts(n_chirps)
    if len(windows) == 0:
        raise InputError(
            f"motion {motion.name}: the interval of {body.duration_s:.3f} s holds no whole frame "
            f"of {radar.frame_duration_s} s of radar '{radar.name}'; choose a longer one "
            "(--start, --duration)"
        )
    return n_chirps, windows


def _echo_model(radar: Radar, body: Body, scene: Scene, settings: RunSettings) -> EchoModel:
    options = dict(settings.model_options or {})
    if settings.body_material != "perfect-conductor":
        options["material"] = settings.body_material
    return build_model(
        settings.fidelity,
        radar,
        body,
        scene=scene,
        order=settings.order,
        variant=settings.variant,
        spreading=settings.spreading,
        **options,
    )


def _noise(radar: Radar, budget: LinkBudget, settings: RunSettings) -> Noise:
    """The noise per sample, by the first of the settings that says its power."""
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
