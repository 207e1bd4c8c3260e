"""`clouds_of`: the clouds of one capture and nothing else, for collections of many."""

from __future__ import annotations

from rtradar.motion import Motion
from rtradar.pipeline.cloud_maker import CloudMaker, Clouds
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.timing import Stages, keep_memory_low
from rtradar.process import build_detector
from rtradar.process import clutter_removal as make_removal
from rtradar.radar import Radar
from rtradar.scene import Scene


def clouds_of(
    motion: Motion,
    radar: Radar,
    scene: Scene | None = None,
    *,
    fidelity: str = "specular",
    start_s: float = 0.0,
    duration_s: float | None = None,
    heading_deg: float = 0.0,
    snr_db: float = 20.0,
    pfa: float = 1e-6,
    seed: int = 0,
    clutter_removal: str = "none",
) -> tuple[Clouds, float]:
    """The clouds that `run` makes, and nothing else: no maps, no pictures, no files, no progress bar.

    Parameters
    ----------
    motion, radar, scene, fidelity, start_s, duration_s, heading_deg, snr_db, pfa, seed, clutter_removal
        As in `run`.

    Returns
    -------
    clouds : Clouds
        The same as those of `run` with these parameters where there is no GPU: one is not used, so that they are the same to the
        byte on every machine's CPU.
    warmup_s : float
        Seconds that went into what a process does once, such as compiling.

    Raises
    ------
    InputError, BackendError
        As in `run`.
    """
    keep_memory_low()
    removal = make_removal(clutter_removal, radar)
    capture = prepare(
        motion,
        radar,
        scene or Scene(),
        stages=Stages(),
        fidelity=fidelity,
        start_s=start_s,
        duration_s=duration_s,
        heading_deg=heading_deg,
        snr_db=snr_db,
        pfa=pfa,
        seed=seed,
        variant="cpu",  # workers share the cores, and a sample is the same to the byte whatever else its machine has
        spreading=True,
        noise_power_m2=None,
        model_options=None,
        body_material="perfect-conductor",
        order=1,
        keep_all=False,
    )
    detect = build_detector("os-cfar", pfa=pfa, looks=radar.n_channels)
    maker = CloudMaker(
        capture.radar, detect=detect, seed=seed, stages=capture.stages, removal=removal
    )
    capture.stream(maker, progress=False)
    return maker.finish(), capture.warmup_s
