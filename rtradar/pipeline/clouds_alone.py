"""`clouds_of`: the clouds of one capture and nothing else, for collections of many."""

from __future__ import annotations

from typing import Unpack

from rtradar.motion import Motion
from rtradar.pipeline.cloud_maker import CloudMaker, Clouds
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.timing import Stages, keep_memory_low
from rtradar.radar import Radar
from rtradar.scene import Scene
from rtradar.settings import RunOptions, RunSettings


def clouds_of(
    motion: Motion, radar: Radar, scene: Scene | None = None, **options: Unpack[RunOptions]
) -> tuple[Clouds, float]:
    """Make the clouds that `run` makes, and nothing else: no files, no pictures, no progress bar.

    Parameters
    ----------
    motion, radar, scene
        The same as for `run`.
    **options
        Settings, the fields of `rtradar.RunSettings`; ``variant`` is ``cpu`` if left out.

    Returns
    -------
    clouds : Clouds
        The clouds that `run` gives with these settings. On the CPU they are the same to the byte,
        whatever else the machine has.
    warmup_s : float
        Time that went into what a process does once, such as compiling [s].

    Raises
    ------
    InputError, BackendError
        As in `run`.
    """
    keep_memory_low()
    options.setdefault("variant", "cpu")  # workers share the cores
    settings = RunSettings(**options)
    capture = prepare(motion, radar, scene or Scene(), settings, Stages())
    maker = CloudMaker(
        capture.radar,
        detect=capture.detect,
        seed=settings.seed,
        stages=capture.stages,
        removal=capture.removal,
        window_functions=capture.window_functions,
    )
    capture.stream(maker, progress=False)
    return maker.finish(), capture.warmup_s
