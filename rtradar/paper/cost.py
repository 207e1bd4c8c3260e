"""Time and memory, and what becomes of the paper's chirps at 60 and 77 GHz."""

from __future__ import annotations

import os
import platform
import warnings
from typing import Any

from rtradar.bench.runs import measure_baseline
from rtradar.errors import InputError, ValidityWarning
from rtradar.paper.formulas import slow_chirps
from rtradar.paper.sources import ACTIVITIES, Sources
from rtradar.pipeline import run
from rtradar.radar import Radar
from rtradar.system.figure_style import dress, new_figure, save_figure

_QUICK_S = 1.0


def cost_figures(sources: Sources) -> dict[str, Any]:
    """Time the paper's method and ours, take memory at 77 GHz, and draw what its chirps alias.

    Parameters
    ----------
    sources : Sources
        Who moves, and the folder of the pictures.

    Returns
    -------
    dict
        Figures by their names.
    """
    baseline = measure_baseline("paper-12ghz", 1, quick=True)
    if baseline is None:
        raise InputError("there is no paper_numpy.py to time; use a checkout, or install again")
    frame_s = baseline["total"]["median"]
    motion = sources.motion("jumping_jack")
    activity = ACTIVITIES["jumping_jack"]
    longest_s = min(activity.shown_s, motion.duration_s)
    duration_s = min(_QUICK_S, longest_s) if sources.quick else longest_s
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)
        summary = run(motion, Radar.preset("paper-77ghz"), duration_s=duration_s).summary
        figure = new_figure(3.8, width_in=9.0)
        for axes, name in zip(figure.subplots(1, 2), ("60", "77"), strict=True):
            radar = slow_chirps(name)
            aliased = run(motion, radar, fidelity="analytic", duration_s=longest_s)
            aliased.plot.spectrogram(axes)
            for text in list(axes.texts):
                text.remove()
            dress(axes, title=f"{activity.title}, {radar.name}", grid=False)
        save_figure(figure, sources.out / "number-60-77ghz.png")
    return {
        "machine": f"{os.cpu_count()} cores, {platform.machine()}",
        "numpy_frame_s": frame_s,
        "numpy_sample_min": frame_s * 117 / 60,
        "s_77": summary["wall_s"],
        "capture_77": summary["capture_s"],
        "mb_77": summary["peak_memory_mb"],
    }
