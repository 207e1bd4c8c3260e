"""Setting a person before a radar in a scene: placed, echoes of every chirp surveyed, noise settled, the room traced."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from rtradar.body import Body
from rtradar.errors import InputError, ValidityWarning
from rtradar.motion import Motion, place
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.rooms.indoors import indoors
from rtradar.pipeline.survey import survey
from rtradar.pipeline.timing import Stages
from rtradar.pipeline.warm_up import processing_compiled_beside, warm_up_processing
from rtradar.radar import Radar
from rtradar.scatter import EchoModel, build_model
from rtradar.scatter.antenna_gain import is_shaped
from rtradar.scatter.multipath.multipath import Multipath
from rtradar.scatter.specular_point.solver import mirror
from rtradar.scene import Scene
from rtradar.signal import Noise
from rtradar.system.seeds import check_seed

_MAX_SNR_DB = 200.0  # more than the samples' float32 can hold beside the echo


def prepare(
    motion: Motion,
    radar: Radar,
    scene: Scene,
    *,
    stages: Stages,
    fidelity: str,
    start_s: float,
    duration_s: float | None,
    heading_deg: float,
    snr_db: float | Literal["physical"],
    pfa: float,
    seed: int,
    variant: str,
    spreading: bool,
    noise_power_m2: float | None,
    model_options: Mapping[str, Any] | None,
    body_material: str,
    order: int,
    keep_all: bool,
) -> Capture:
    """Place a person before a radar, build the model, survey its echoes, and trace the room.

    Parameters are those of `rtradar.run`, and so are the errors.
    """
    _check(snr_db, pfa, seed, noise_power_m2)
    if isinstance(snr_db, str):
        if not spreading:
            raise InputError(
                "snr_db = physical needs the loss with distance; leave out --no-spreading (spreading=False)"
            )
        radar.noise_power_w, radar.watts_per_m2  # says what is missing before the work  # noqa: B018
    walled = bool(scene.walls or scene.furniture)
    with processing_compiled_beside():
        with stages.time("motion"):
            radar = scene.place(radar)
            heading = heading_deg + scene.heading_deg
            placed = place(motion, start_s=start_s, duration_s=duration_s, heading_deg=heading)
            body = Body.from_motion(placed.shifted([*scene.person_position_m, 0.0]))
        n_cycles = math.floor(body.duration_s / radar.cycle_duration_s * (1 + 1e-12))
        n_chirps = n_cycles * radar.n_tx
        windows = radar.window_starts(n_chirps)
        if len(windows) == 0:
            raise InputError(
                f"motion {motion.name}: the interval of {body.duration_s:.3f} s holds no whole frame of "
                f"{radar.frame_duration_s} s of radar '{radar.name}'; choose a longer one (--start, --duration)"
            )
        warm = time.perf_counter()
        paths: Multipath | None = None
        model: EchoModel
        if walled:
            if is_shaped(radar.tx_antenna) or is_shaped(radar.rx_antenna):
                raise InputError(
                    f"radar '{radar.name}' has antennas with a pattern, and scene '{scene.name}' paths over walls, whose "
                    "directions at the antennas are not followed; take free-space, or antennas with pattern = 'isotropic'"
                )
            if model_options:
                raise InputError(
                    f"fidelity '{fidelity}' has no option '{next(iter(model_options))}' in scene '{scene.name}'; leave it out"
                )
            paths = Multipath(
                radar,
                body,
                scene,
                variant=variant,
                spreading=spreading,
                order=order,
                fidelity=fidelity,
                material=body_material,
            )
            model = paths.person
        else:
            of_skin = {} if body_material == "perfect-conductor" else {"material": body_material}
            model = build_model(
                fidelity,
                radar,
                body,
                variant=variant,
                spreading=spreading,
                **(model_options or {}),
                **of_skin,
            )
        echoes = (paths or model).echoes(np.arange(2 * radar.n_tx))
        # Not every model has specular points; the report shows them of all.
        mirror(radar.tx[:1], radar.rx[None, :1], *body.at([0.0]), points=True)
    warm_up_processing(echoes, radar)
    warmup_s = time.perf_counter() - warm
    with warnings.catch_warnings(record=True) as caught, stages.time("survey"):
        warnings.simplefilter("always", ValidityWarning)
        surveyed = survey(model, radar, body, n_chirps, spreading=spreading, scene=scene)
    for warning in caught:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    if noise_power_m2 is not None:
        noise = Noise(noise_power_m2, seed)
    elif isinstance(snr_db, str):
        noise = _physical_noise(radar, surveyed.power, seed)
    else:
        noise = Noise.for_snr(surveyed.power, snr_db, seed)
    inside = None
    if paths is not None:
        with stages.time("room"):
            inside = indoors(
                paths,
                radar,
                body,
                scene,
                variant=variant,
                order=order,
                seed=seed,
                n_chirps=n_chirps,
                person_power_m2=surveyed.power,
                noise_power_m2=noise.power,
                keep_all=keep_all,
            )
        model = inside.model
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
        title=f"{motion.name}, {radar.name}, {fidelity}" + (f", {scene.name}" if walled else ""),
        stages=stages,
        warmup_s=warmup_s,
    )


def _physical_noise(radar: Radar, echo_power_m2: float, seed: int) -> Noise:
    power = radar.noise_power_w / radar.watts_per_m2
    if power > echo_power_m2 * 10 ** (_MAX_SNR_DB / 10):
        raise InputError(
            f"snr_db = physical: noise of radar '{radar.name}' is more than {_MAX_SNR_DB:g} dB above the echo; look at "
            "transmit_power_dbm, noise_figure_db, noise_temperature_k and gain_dbi"
        )
    return Noise(power, seed)


def _check(
    snr_db: float | Literal["physical"], pfa: float, seed: int, noise_power_m2: float | None
) -> None:
    if isinstance(snr_db, str):
        if snr_db != "physical":
            raise InputError(
                f"snr_db = {snr_db!r}; it must be a number of decibels, inf, or physical (--snr-db)"
            )
    elif not (-_MAX_SNR_DB <= snr_db <= _MAX_SNR_DB or snr_db == math.inf):
        raise InputError(
            f"snr_db = {snr_db}; it must lie within +-{_MAX_SNR_DB:g} dB, or be inf for no noise (--snr-db)"
        )
    if noise_power_m2 is not None and not 0 <= noise_power_m2 < math.inf:
        raise InputError(
            f"noise_power_m2 = {noise_power_m2}; it must be a number of square metres, at least 0"
        )
    if not 0 < pfa < 1:
        raise InputError(
            f"pfa = {pfa}; a false-alarm rate lies between 0 and 1, both excluded (--pfa)"
        )
    check_seed("", seed)
