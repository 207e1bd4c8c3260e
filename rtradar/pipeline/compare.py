"""`compare`: one recording by several echo models, with the same noise, and how far they differ."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from rtradar.body import Person
from rtradar.description import Movers, Moving, given_parts
from rtradar.errors import InputError
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.compared import (
    MAP_PICTURES,
    MEASURES,
    Compared,
    Comparison,
    comparison_rows,
    draw_maps_and_clouds,
    figures_of,
    finite,
    write_figures,
)
from rtradar.pipeline.output.pictures import removed
from rtradar.pipeline.output.view import load_run_view
from rtradar.pipeline.output.writer import files_of_pictures, files_of_runs, read_maps
from rtradar.pipeline.prepare import people_in, power_alone, prepare
from rtradar.pipeline.result import Result
from rtradar.pipeline.run import run_into
from rtradar.process.window_functions import WindowFunctions, noise_bandwidth_bins
from rtradar.radar import Radar
from rtradar.report.figures.canvas import FieldUnit, field_unit
from rtradar.report.pages import comparison
from rtradar.scatter import MODELS
from rtradar.scatter.link_budget import LinkBudget
from rtradar.scene import Scene
from rtradar.settings import (
    RunOptions,
    RunSettings,
    check_fidelities,
    settings_of,
    takes_settings,
)
from rtradar.system.checks import check_path
from rtradar.system.output_folder import OutputFiles, atomic_folder

_PICTURES = {
    "Echo power over time": "compare_power.png",
    "Echo power and occlusion of each part": "compare_parts.png",
    **MAP_PICTURES,
}
_COSTS = ("wall_s", "real_time_factor", "peak_memory_mb", "stages", "variant")
_FILES = ("compare.html", "compare.json", "compare.csv", *files_of_pictures(_PICTURES.values()))
_SEVERAL = OutputFiles("compare.json", r"compare\.(json|csv)")
_CONFIDENCE = 0.95


@takes_settings
def compare(
    motion: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    *,
    out: str | Path,
    fidelities: Sequence[str] = ("analytic-paper", "analytic", "specular"),
    overwrite: bool = False,
    **options: Unpack[RunOptions],
) -> Comparison:
    """Run several models on the same recording and tell how they differ.

    All runs have the same noise, sample by sample: that of the first model, whose echo ``snr_db``
    is relative to. The last model named is the reference.

    Parameters
    ----------
    motion, radar, scene
        The same as for `run`.
    out : path
        Folder for a run of each model, in a folder of its name, and for ``compare.json``,
        ``compare.html`` and pictures. The reference runs once more with the next seed: what
        differs between both is noise and the draw of points, and no difference of models.
    fidelities : sequence of str
        Two models or more, each once; `rtradar.scatter.MODELS` has their names.
    overwrite : bool
        Whether files that ``out`` holds under names of the new ones are replaced even where no
        ``compare.json`` lists them.
    **options
        Settings of all runs, the fields of `rtradar.RunSettings` but ``fidelity``.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If fewer than two models are named, one twice, or one that does not exist; and as in `run`.
    BackendError
        As in `run`.
    """
    names = list(fidelities)
    check_fidelities(names)
    if "fidelity" in options:
        raise InputError("compare has no option 'fidelity'; name the models in fidelities")
    asked = settings = settings_of("compare", RunOptions, options)
    moving, before, there = given_parts(motion, radar, scene, settings)
    if not people_in(there, moving)[1]:
        raise InputError(
            f"compare: nobody is in scene '{there.name}', and it is people's echoes that levels "
            "differ in; give a motion"
        )
    kind = files_of_runs("compare.json", _FILES, [*MODELS, *MODELS.gone])
    place = check_path("out", out)
    with atomic_folder(place, kind, overwrite=overwrite) as folder:
        results: dict[str, Result] = {}
        occluded: dict[str, _Occluded] = {}
        for name in names:
            own = replace(settings, fidelity=name)
            into = folder / name
            results[name] = run_into(into, moving, before, there, own, place=place / name)
            occluded[name] = _occluded(results[name], moving, before, there, own)
            # The noise of the first model is that of all.
            settings = replace(settings, noise_power_m2=results[name].summary["noise_power_m2"])
        summary = _summary(results, occluded, names[-1])
        with TemporaryDirectory() as again:
            own = replace(settings, fidelity=names[-1], seed=settings.seed + 1)
            other = run_into(Path(again, "again"), moving, before, there, own, pictures=False)
            summary["other_seed"] = _figures(other, occluded[names[-1]], results[names[-1]])
        pictures, unit = _draw(results, occluded, folder, names[-1])
        views = {name: load_run_view(folder / name) for name in names}
        comparison.write_comparison(
            folder / "compare.html", summary, comparison_rows(summary), pictures, unit, views
        )
        write_figures(folder, summary, kind)

    def captures() -> dict[str, Capture]:
        return {
            name: prepare(moving, before, there, replace(asked, fidelity=name)) for name in names
        }

    return Comparison(summary, Path(out), _captures=captures)


@takes_settings
def compare_recordings(
    motions: Sequence[Moving],
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    *,
    out: str | Path,
    fidelities: Sequence[str] = ("analytic-paper", "analytic", "specular"),
    overwrite: bool = False,
    **options: Unpack[RunOptions],
) -> Comparison:
    """Compare models on several recordings, each by itself, and tell the mean and its interval.

    Parameters
    ----------
    motions : sequence
        Recordings, two or more, each what `compare` takes as ``motion``.
    radar, scene
        The same as for `run`.
    out : path
        Folder for a comparison of each recording, in a folder of its number and name, and for
        ``compare.json`` and ``compare.csv`` with the mean over recordings of each figure and the
        interval that holds it with a confidence of 95 %, by Student's t of as many recordings.
    fidelities : sequence of str
        Two models or more, each once, the reference last; `rtradar.scatter.MODELS` has their names.
    overwrite : bool
        Whether files of other origin are replaced, as by `compare`.
    **options
        Settings of all runs: fields of `rtradar.RunSettings`.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        As of `compare`, and where there is one recording.
    BackendError
        As of `compare`.
    """
    if len(motions) < 2:
        raise InputError(f"{len(motions)} recordings; give two or more, or use compare")
    place = check_path("out", out)
    names = [f"{number:02d}-{_file_name(own)}" for number, own in enumerate(motions, start=1)]
    found = []
    for name, motion in zip(names, motions, strict=True):
        one = compare(
            motion,
            radar,
            scene,
            out=place / name,
            fidelities=fidelities,
            overwrite=overwrite,
            **options,
        )
        found.append(one.summary)
    first = found[0]
    summary: dict[str, Any] = {name: first[name] for name in ("reference", "versions")}
    summary |= {"recordings": names, "confidence": _CONFIDENCE}
    summary["fidelities"] = {
        model: _means([one["fidelities"][model] for one in found]) for model in first["fidelities"]
    }
    summary["other_seed"] = _means([one["other_seed"] for one in found])
    with atomic_folder(place, _SEVERAL, overwrite=overwrite) as folder:
        write_figures(folder, summary, _SEVERAL)
    return Comparison(summary, place)


def _file_name(motion: Moving) -> str:
    """Return the name of a recording as one of a file."""
    alone = isinstance(motion, str | Path) or not isinstance(motion, Sequence)
    everyone: Any = [motion] if alone else motion
    names = [
        one.motion.name if isinstance(one, Person) else getattr(one, "name", str(one))
        for one in everyone
    ]
    return re.sub(r"[^\w.-]+", "-", "-".join(names))[:40]


def _means(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the mean of each figure over recordings, and its interval; None where one has none."""
    means: dict[str, Any] = {}
    for key, *_ in MEASURES:
        values = [one[key] for one in found]
        means[key] = None
        if None not in values:
            mean, count = float(np.mean(values)), len(values)
            half = float(stdtrit(count - 1, (1 + _CONFIDENCE) / 2) * np.std(values, ddof=1))
            half /= math.sqrt(count)
            means[key] = {"mean": mean, "low": mean - half, "high": mean + half}
    return means


class _Occluded(NamedTuple):
    """Fraction of the echo power that other parts occlude, over all and of each part (part,)."""

    share: float | None
    of_parts: NDArray[np.float64]


def _occluded(
    result: Result, motion: Movers, radar: Radar, scene: Scene, settings: RunSettings
) -> _Occluded:
    """Compare the echo power of each part with that which the same level has of it alone."""
    seen = _budget(result).power_at
    if result.summary["occlusion"] == "none":
        return _Occluded(0.0, np.zeros(seen.shape[1]))
    alone = power_alone(motion, radar, scene, settings)
    if alone is None:
        return _Occluded(None, np.full(seen.shape[1], np.nan))
    with np.errstate(divide="ignore", invalid="ignore"):
        of_parts = 1 - seen.sum(axis=0) / alone.sum(axis=0)
        return _Occluded(finite(float(1 - seen.sum() / alone.sum())), of_parts)


def _summary(
    results: Mapping[str, Result], occluded: Mapping[str, _Occluded], reference: str
) -> dict[str, Any]:
    first = next(iter(results.values())).summary
    shared = dict(first["parameters"])
    del shared["fidelity"], shared["variant"]
    return {
        "reference": reference,
        "parameters": shared,
        **{name: first[name] for name in ("seed", "noise_power_m2", "versions")},
        "fidelities": {
            name: _figures(result, occluded[name], results[reference])
            for name, result in results.items()
        },
    }


def _figures(result: Result, occluded: _Occluded, reference: Result) -> dict[str, Any]:
    """Return the figures of one model; differences of the reference from itself are zero."""
    summary, stages = result.summary, result.summary["stages"]
    budgets = _budget(result), _budget(reference)
    least = np.finfo(np.float64).tiny
    ours, its = (10 * np.log10(np.maximum(one.power_at.sum(axis=1), least)) for one in budgets)
    power = ours - its
    with np.errstate(divide="ignore", invalid="ignore"):
        norm = np.linalg.norm(budgets[1].field_at)
        error = np.linalg.norm(budgets[0].field_at - budgets[1].field_at) / norm
    of_parts = map(finite, occluded.of_parts.tolist())
    return {
        "power_mean_db": finite(float(power.mean())),
        "power_rms_db": finite(float(np.sqrt((power**2).mean()))),
        "field_error": finite(float(error)),
        "occluded_share": occluded.share,
        **figures_of(_compared(result), _compared(reference)),
        "scatter_s": stages["scatter"] + stages["survey"],
        **{name: summary[name] for name in _COSTS},
        **{name: summary[name] for name in ("limits", "part_power_m2")},
        "part_occluded_share": dict(zip(summary["part_power_m2"], of_parts, strict=True)),
    }


def _budget(result: Result) -> LinkBudget:
    assert result.link_budget is not None  # every run has one
    return result.link_budget


def _compared(result: Result) -> Compared:
    assert result.out is not None
    return Compared(result.out, result.summary, result.radar, result.points)


def _draw(
    results: Mapping[str, Result],
    occluded: Mapping[str, _Occluded],
    folder: Path,
    reference: str,
) -> tuple[dict[str, Path], FieldUnit]:
    """Draw the pictures of a comparison; return them and the unit of the power of parts."""
    compared = {name: _compared(result) for name, result in results.items()}
    parameters, radar = results[reference].summary["parameters"], results[reference].radar
    spreading, title = parameters["spreading"], f"{parameters['motion']}, {radar.name}"

    def unit_of(powers: Iterable[NDArray[np.floating]]) -> FieldUnit:
        strongest = max(float(power.max()) for power in powers)
        return field_unit(radar, spreading=spreading, strongest_m2=strongest)

    power, parts = (folder / file for file in list(_PICTURES.values())[:2])
    budgets = {name: _budget(result) for name, result in results.items()}
    total = {name: budget.power_at.sum(axis=1) for name, budget in budgets.items()}
    comparison.draw_power_over_time(
        power, budgets[reference].times, total, unit_of(total.values()), reference, title
    )
    mean = {name: budget.power_at.mean(axis=0) for name, budget in budgets.items()}
    hidden = {name: found.of_parts for name, found in occluded.items()}
    names, part_unit = list(results[reference].summary["part_power_m2"]), unit_of(mean.values())
    comparison.draw_part_power(parts, names, mean, hidden, part_unit, title)

    def map_levels(powers: Mapping[str, NDArray[Any]]) -> tuple[dict[str, Any], str]:
        unit = field_unit(radar, spreading=spreading, range_m=radar.range_m[:, None])
        levels = {name: unit.level(one / radar.n_channels) for name, one in powers.items()}
        return levels, unit.label("mean of channels")

    def column_levels(powers: Mapping[str, NDArray[Any]]) -> tuple[dict[str, Any], str]:
        # One echo is spread over as many range bins.
        windows = WindowFunctions(range=parameters["range_window"])
        range_bins = noise_bandwidth_bins(windows.range, radar.samples_per_chirp)
        unit = unit_of(one / range_bins for one in powers.values())
        levels = {name: unit.level(one / range_bins) for name, one in powers.items()}
        return levels, unit.label("one channel")

    # The same frame of all, for they have the same times.
    frame = compared[reference].best_frame()
    with read_maps(compared[reference].maps) as maps:
        at = f"window at {maps['time'][frame]:.2f} s"
        titles = (
            f"{title}{removed(maps['range_doppler'])}, {at}",
            title + removed(maps["spectrogram"]),
            title,
        )
    frames, levels = [frame] * len(compared), (map_levels, column_levels)
    drawn = draw_maps_and_clouds(folder, compared, frames, levels, titles)
    return dict(zip(_PICTURES, (power, parts), strict=False)) | drawn, part_unit
