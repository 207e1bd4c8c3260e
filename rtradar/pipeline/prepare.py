"""Setting a person before a radar in a scene: echoes surveyed, noise settled, the room traced."""

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
from rtradar.pipeline.rooms.indoors import indoors
from rtradar.pipeline.survey import Survey, survey
from rtradar.pipeline.timing import Stages
from rtradar.pipeline.warm_up import processing_compiled_beside, warm_up_processing
from rtradar.process import WindowFunctions, build_detector, clutter_removal
from rtradar.radar import Radar
from rtradar.scatter import EchoModel, build_model
from rtradar.scatter.antenna_gain import is_shaped
from rtradar.scatter.multipath.multipath import Multipath
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
        paths, model = _echo_model(radar, body, scene, settings)
        echoes = (paths or model).echoes(np.arange(2 * radar.n_tx))
        # Not every model has specular points; the report shows them of all.
        solve_specular_points(
            Geometry(radar.tx[:1], radar.rx[None, :1], *body.at([0.0])), points=True
        )
    warm_up_processing(echoes, radar)
    warmup_s = time.perf_counter() - warm
    with warnings.catch_warnings(record=True) as caught, stages.time("survey"):
        warnings.simplefilter("always", ValidityWarning)
        surveyed = survey(model, radar, body, n_chirps, spreading=settings.spreading, scene=scene)
    for warning in caught:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    noise = _noise(radar, surveyed, settings)
    inside = None
    if paths is not None:
        with stages.time("room"):
            inside = indoors(
                paths, radar, body, scene, settings, n_chirps, surveyed.power, noise.power
            )
        model = inside.model
    names = [motion.name, radar.name, settings.fidelity, *([scene.name] if paths else [])]
    return Capture(
        radar=radar,
        body=body,
        model=model,
        inside=inside,
        survey=surveyed,
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


def _has_room(scene: Scene) -> bool:
    return bool(scene.walls or scene.furniture)


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


def _echo_model(
    radar: Radar, body: Body, scene: Scene, settings: RunSettings
) -> tuple[Multipath | None, EchoModel]:
    """The paths of the room, if the scene has one, and the model of the person alone."""
    variant, spreading, material = settings.variant, settings.spreading, settings.body_material
    options = dict(settings.model_options or {})
    if not _has_room(scene):
        of_skin = {} if material == "perfect-conductor" else {"material": material}
        model = build_model(
            settings.fidelity,
            radar,
            body,
            variant=variant,
            spreading=spreading,
            **options,
            **of_skin,
        )
        return None, model
    if is_shaped(radar.tx_antenna) or is_shaped(radar.rx_antenna):
        raise InputError(
            f"radar '{radar.name}' has antennas with a pattern, and scene '{scene.name}' paths "
            "over walls, whose directions at the antennas are not followed; take free-space, or "
            "antennas with pattern = 'isotropic'"
        )
    if options:
        raise InputError(
            f"fidelity '{settings.fidelity}' has no option '{next(iter(options))}' in scene "
            f"'{scene.name}'; leave it out"
        )
    paths = Multipath(
        radar,
        body,
        scene,
        variant=variant,
        spreading=spreading,
        order=settings.order,
        fidelity=settings.fidelity,
        material=material,
    )
    return paths, paths.person


def _noise(radar: Radar, surveyed: Survey, settings: RunSettings) -> Noise:
    """The noise per sample, by the first of the settings that says its power."""
    if settings.noise_power_m2 is not None:
        return Noise(settings.noise_power_m2, settings.seed)
    if not isinstance(settings.snr_db, str):
        return Noise.for_snr(surveyed.power, settings.snr_db, settings.seed)
    power = radar.noise_power_w / radar.watts_per_m2
    if power > surveyed.power * 10 ** (MAX_SNR_DB / 10):
        raise InputError(
            f"snr_db = physical: noise of radar '{radar.name}' is more than {MAX_SNR_DB:g} dB "
            "above the echo; look at transmit_power_dbm, noise_figure_db, noise_temperature_k "
            "and gain_dbi"
        )
    return Noise(power, settings.seed)
