"""All levels compiled before the first run, by two processes side by side.

Code is kept under stamps of all that it was made from (`rtradar.kernels.code_stamp`), so that what
is compiled here is never taken for another version's.
"""

from __future__ import annotations

import importlib
import pkgutil
import time
import warnings
from contextlib import ExitStack
from typing import Any

import numpy as np

import rtradar.kernels
from rtradar.body import Body
from rtradar.kernels.jit import functions_to_compile
from rtradar.motion import Motion, synthetic_motion
from rtradar.pipeline.run import run
from rtradar.pipeline.timing import lines_shown, stage_line
from rtradar.pipeline.warm_up import other_process, warm_up_any_processing
from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scene import Scene

_MAX_S = 600.0  # for each process

_LEVELS: dict[str, dict[str, Any]] = {
    "specular": {"bounces": 2, "terms": 2},
    "physical-optics": {},
    "analytic": {},
}
"""Levels with functions of their own, and options that need further ones."""

ON_DEMAND = (
    *("rtradar.kernels.receiver", "rtradar.kernels.scatter.facets_by_length"),
    *("rtradar.kernels.surface_currents", "rtradar.kernels.surface_integrals"),
)
"""Modules that no run of a level needs: receivers, moving objects, full wave."""


def left_to_compile() -> set[str]:
    """Functions that runs of levels need and of which there is no code on disk."""
    for module in pkgutil.walk_packages(rtradar.kernels.__path__, "rtradar.kernels."):
        importlib.import_module(module.name)
    return {name for name in functions_to_compile() if not name.startswith(ON_DEMAND)}


def compile_ahead() -> float:
    """Compile what runs of all levels need, by two processes side by side; return the seconds.

    Nothing is done, and 0 returned, where all of it is on disk or nothing can be kept there.
    `left_to_compile` tells afterwards whether something went wrong in a process.
    """
    if not left_to_compile():
        return 0.0
    start = time.perf_counter()
    with lines_shown(), stage_line("compiling all levels"):
        work = (f"from {__name__} import {own.__name__} as go; go()" for own in _SHARES)
        with ExitStack() as others:
            for wait in [others.enter_context(other_process(own, _MAX_S)) for own in work]:
                wait()
    return time.perf_counter() - start


def compile_rooms() -> None:
    """Compile what processes samples, and then what rooms add to them."""
    warm_up_any_processing()
    _run("specular", {}, "living-room", clutter_removal="mean")


def compile_levels() -> None:
    """Compile the echoes of each level in free space, and then what else is left of its runs."""
    radar, body = Radar.preset("paper-12ghz"), Body.from_motion(_motion())
    for level, options in _LEVELS.items():
        build_model(level, radar, body, **options).echoes(np.arange(2 * radar.n_tx))
    # By now the other process has compiled what processes samples.
    for level, options in _LEVELS.items():
        _run(level, options, "free-space")


_SHARES = compile_rooms, compile_levels


def _motion() -> Motion:
    return synthetic_motion("walk", seed=0, duration_s=0.15)


def _run(level: str, options: dict[str, Any], scene: str, **settings: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        radar, room = Radar.preset("paper-12ghz"), Scene.load(scene)
        settings |= {"fidelity": level, "model_options": options, "snr_db": 20.0}
        run(_motion(), radar, room, **settings)
